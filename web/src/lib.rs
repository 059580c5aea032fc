//! The sensor in a browser: what a page asks as JSON, answered by the functions of the program.
//!
//! The page writes a question to the memory that [`question`] gives, and the log that it is about to that of [`log_bytes`], calls [`answer`], and reads as
//! many bytes there as [`answer_bytes`] says. Nothing is kept between two questions.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod cars;
mod files;
mod log;
mod page;
mod settings;

use std::cell::RefCell;
use std::iter::repeat_n;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::{Value, json};
use wetclutch::Error;

use crate::log::Asked;

pub use crate::settings::Settings;

thread_local! {
    static QUESTION: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static LOG: RefCell<Arc<[u8]>> = RefCell::default();
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

/// Memory for a log of so many bytes.
#[expect(unsafe_code, reason = "the page finds it by its name")]
#[unsafe(no_mangle)]
pub extern "C" fn log_bytes(bytes: usize) -> *mut u8 {
    LOG.with_borrow_mut(|log| {
        // The log of the question before is given back first.
        *log = Arc::default();
        *log = repeat_n(0, bytes).collect();
        Arc::get_mut(log).map_or(std::ptr::null_mut(), <[u8]>::as_mut_ptr)
    })
}

/// Answers the question; where the answer begins.
#[expect(unsafe_code, reason = "the page finds it by its name")]
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    let (question, log) = (QUESTION.take(), LOG.take());
    ANSWER.with_borrow_mut(|answer| {
        *answer = answer_to(&question, log);
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
    Map(OfLog),
    /// Figures and tables of the log.
    Log(OfLog),
    /// The estimates of the log, as CSV.
    LogEstimates(OfLog),
}

/// What is asked of a log.
#[derive(Deserialize)]
struct OfLog {
    #[serde(default)]
    car: String,
    name: String,
    map: Option<String>,
    dbc: Option<Dbc>,
}

/// The DBC of a CAN log.
#[derive(Deserialize)]
pub(crate) struct Dbc {
    name: String,
    text: String,
}

impl OfLog {
    fn asked(&self, bytes: Arc<[u8]>) -> Asked<'_> {
        Asked { car: &self.car, name: &self.name, map: self.map.as_deref(), dbc: self.dbc.as_ref(), bytes }
    }
}

/// What to do about a CAN log without its DBC: of the command, and of the page.
const WITHOUT_DBC: [&str; 2] = ["give it with --dbc", "drop its DBC on this page too"];

/// The answer to a question, as JSON, and its log; in bytes: JSON, or CSV where it was asked for. An error is JSON with `error` and `hint`.
pub fn answer_to(question: &[u8], log: Arc<[u8]>) -> Vec<u8> {
    let [of_command, of_page] = WITHOUT_DBC;
    let hint = |error: &Error| error.hint().map(|hint| hint.replace(of_command, of_page));
    answered(question, log).unwrap_or_else(|error| text_of(&json!({ "error": error.message(), "hint": hint(&error) })))
}

fn answered(question: &[u8], log: Arc<[u8]>) -> Result<Vec<u8>, Error> {
    let asked = serde_json::from_slice(question).map_err(|error| Error::Input(format!("the question: {error}")))?;
    Ok(match &asked {
        Question::Cars => text_of(&cars::described()?),
        Question::Run { settings } => text_of(&page::of_run(settings)?),
        Question::Measured { settings } => page::measured(settings)?.csv()?,
        Question::Estimates { settings } => page::estimates(settings)?.csv()?,
        Question::Map(of) => text_of(&log::suggested(&of.asked(log))?),
        Question::Log(of) => text_of(&log::drawn(&of.asked(log))?),
        Question::LogEstimates(of) => log::estimates(&of.asked(log))?.csv()?,
    })
}

fn text_of(value: &Value) -> Vec<u8> {
    value.to_string().into_bytes()
}
