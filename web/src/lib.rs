//! The sensor in a browser: what a page asks as JSON, answered by the functions of the program.
//!
//! The page writes a question to the memory that [`question`] gives, calls [`answer`], and reads as many bytes there as [`answer_bytes`] says.
//! A log follows the JSON of its question behind a zero byte. Nothing is kept between two questions.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod cars;
mod files;
mod log;
mod page;
mod settings;

use std::cell::RefCell;

use serde::Deserialize;
use serde_json::{Value, json};
use wetclutch::Error;

use crate::log::Asked;

pub use crate::settings::Settings;

thread_local! {
    static QUESTION: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static ANSWER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Memory for a question of so many bytes.
#[expect(unsafe_code, reason = "the page finds it by its name")]
#[unsafe(no_mangle)]
pub extern "C" fn question(bytes: usize) -> *mut u8 {
    QUESTION.with_borrow_mut(|question| {
        question.clear();
        question.resize(bytes, 0);
        question.as_mut_ptr()
    })
}

/// Answers the question; where the answer begins.
#[expect(unsafe_code, reason = "the page finds it by its name")]
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    let question = QUESTION.take();
    ANSWER.with_borrow_mut(|answer| {
        *answer = answer_to(&question);
        answer.as_ptr()
    })
}

/// How long the answer is.
#[expect(unsafe_code, reason = "the page finds it by its name")]
#[unsafe(no_mangle)]
pub extern "C" fn answer_bytes() -> usize {
    ANSWER.with_borrow(Vec::len)
}

/// What a page asks.
#[derive(Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case")]
enum Question {
    /// The cars, with their gears.
    Cars,
    /// Figures and tables of a simulated drive.
    Run { settings: Settings },
    /// What the car measures in it, as CSV.
    Measured { settings: Settings },
    /// The estimates of that, as CSV.
    Estimates { settings: Settings },
    /// A first channel map for the log.
    Map { name: String },
    /// Figures and tables of the log.
    Log { car: String, name: String, map: Option<String> },
    /// The estimates of the log, as CSV.
    LogEstimates { car: String, name: String, map: Option<String> },
}

/// The answer to a question in bytes: JSON, or CSV where it was asked for. An error is JSON with `error` and `hint`.
pub fn answer_to(question: &[u8]) -> Vec<u8> {
    answered(question).unwrap_or_else(|error| text_of(&json!({ "error": error.message(), "hint": error.hint() })))
}

fn answered(question: &[u8]) -> Result<Vec<u8>, Error> {
    let mut parts = question.splitn(2, |byte| *byte == 0);
    let (json, text) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let asked = serde_json::from_slice(json).map_err(|error| Error::Input(format!("the question: {error}")))?;
    Ok(match &asked {
        Question::Cars => text_of(&cars::described()?),
        Question::Run { settings } => text_of(&page::of_run(settings)?),
        Question::Measured { settings } => page::measured(settings)?.csv()?,
        Question::Estimates { settings } => page::estimates(settings)?.csv()?,
        Question::Map { name } => text_of(&log::suggested(&Asked { car: "", name, map: None, text })?),
        Question::Log { car, name, map } => text_of(&log::drawn(&Asked { car, name, map: map.as_deref(), text })?),
        Question::LogEstimates { car, name, map } => {
            log::estimates(&Asked { car, name, map: map.as_deref(), text })?.csv()?
        }
    })
}

fn text_of(value: &Value) -> Vec<u8> {
    value.to_string().into_bytes()
}
