//! Errors and other messages on standard error. An error of a file comes with the line that it is about, as compilers show it.

use std::borrow::Cow;
use std::io::Write as _;
use std::path::Path;

use anstream::ColorChoice;
use anstyle::{AnsiColor, Style};
use clap::ValueEnum;
use config::{Excerpt, Source};

use crate::output::printable_lines;

const ERROR: Style = AnsiColor::Red.on_default().bold();
const WARNING: Style = AnsiColor::Yellow.on_default().bold();
const HINT: Style = AnsiColor::Cyan.on_default();
const FRAME: Style = AnsiColor::Blue.on_default().bold();

/// How the errors that follow the first one of a message begin.
const NEXT: &str = "\nerror: ";

/// When messages have colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum Colors {
    /// On a terminal, unless NO_COLOR is set
    #[default]
    Auto,
    /// Also in files and pipes
    Always,
    /// Nowhere
    Never,
}

impl Colors {
    /// Holds for all messages from now on, those of the command line too.
    pub(crate) fn hold(self) {
        match self {
            Self::Auto => ColorChoice::Auto,
            Self::Always => ColorChoice::Always,
            Self::Never => ColorChoice::Never,
        }
        .write_global();
    }

    /// What arguments ask for that may be wrong otherwise.
    pub(crate) fn of_arguments(arguments: impl Iterator<Item = String>) -> Self {
        let arguments: Vec<String> = arguments.take_while(|argument| argument != "--").collect();
        let given =
            arguments.iter().enumerate().rev().find_map(|(at, argument)| match argument.strip_prefix("--color") {
                Some("") => arguments.get(at + 1).map(String::as_str),
                Some(value) => value.strip_prefix('='),
                None => None,
            });
        given.and_then(|given| Self::from_str(given, false).ok()).unwrap_or_default()
    }
}

/// An error on standard error, or several, each after [`NEXT`].
pub(crate) fn error(message: &str) {
    let mut stderr = anstream::stderr().lock();
    for one in message.split(NEXT) {
        // There is no other place to report that standard error cannot be written.
        let _ = writeln!(stderr, "{ERROR}error:{ERROR:#} {}", with_excerpt(&printable_lines(&without_codes(one))));
    }
}

/// A message without the numbers of the operating system's errors, whose words are before them.
fn without_codes(message: &str) -> String {
    let mut parts = message.split(" (os error ");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |shown, part| {
        let code = part.find(|c: char| !c.is_ascii_digit()).unwrap_or(part.len());
        shown + part[code..].strip_prefix(')').unwrap_or(&part[code..])
    })
}

/// Another message on standard error.
pub(crate) fn say(message: &str) {
    let shown = printable_lines(message);
    let shown = match shown.strip_prefix("warning:") {
        Some(rest) => Cow::Owned(format!("{WARNING}warning:{WARNING:#}{rest}")),
        None => shown,
    };
    let _ = writeln!(anstream::stderr().lock(), "{}", with_hints(shown.lines()));
}

/// An error with the line that it is about, behind its first line.
fn with_excerpt(message: &str) -> String {
    let first = message.lines().next().unwrap_or_default();
    let excerpt = place(first).and_then(|(path, line, what)| {
        let source = Source::read(Path::new(path)).ok()?;
        Some(excerpt_lines(path, &Excerpt::of(&source, line, what)?))
    });
    let hints = message.lines().skip(1);
    with_hints([first].into_iter().chain(excerpt.as_deref()).chain(hints))
}

/// File, line and what is wrong there, of a message that begins with them: `car.toml:14: ...`.
fn place(first: &str) -> Option<(&str, usize, &str)> {
    first.match_indices(':').find_map(|(at, _)| {
        let (path, rest) = (&first[..at], &first[at + 1..]);
        let (line, what) = rest.split_once(": ")?;
        let line = line.parse().ok().filter(|_| line.bytes().all(|byte| byte.is_ascii_digit()))?;
        Some((path, line, what))
    })
}

/// A line of a file with carets below what is wrong.
fn excerpt_lines(path: &str, excerpt: &Excerpt) -> String {
    let Excerpt { line, column, text, marked } = excerpt;
    let number = line.to_string();
    let width = number.len();
    let [before, wrong] = [&text[..marked.start], &text[marked.clone()]].map(|part| part.chars().count());
    let carets = "^".repeat(wrong.max(1));
    [
        format!("{:width$}{FRAME}-->{FRAME:#} {path}:{line}:{column}", ""),
        format!("{:width$} {FRAME}|{FRAME:#}", ""),
        format!("{FRAME}{number} |{FRAME:#} {text}"),
        format!("{:width$} {FRAME}|{FRAME:#} {:before$}{ERROR}{carets}{ERROR:#}", "", ""),
    ]
    .join("\n")
}

/// Lines of a message; `hint:` at the start of one is coloured.
fn with_hints<'m>(lines: impl Iterator<Item = &'m str>) -> String {
    let line = |line: &'m str| match line.strip_prefix("hint:") {
        Some(rest) => Cow::Owned(format!("{HINT}hint:{HINT:#}{rest}")),
        None => Cow::Borrowed(line),
    };
    lines.map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_errors_are_left_out() {
        let message = "a.csv: No such file or directory (os error 2)\nhint: check it (os error 13) again";
        assert_eq!(without_codes(message), "a.csv: No such file or directory\nhint: check it again");
        assert_eq!(without_codes("nothing (to leave out)"), "nothing (to leave out)");
    }

    #[test]
    fn the_place_of_an_error_may_be_in_a_file_with_any_name() {
        assert_eq!(place("my car.toml:14: `a` is 1"), Some(("my car.toml", 14, "`a` is 1")));
        assert_eq!(place("C:\\car.toml:3: a: b:4: c"), Some(("C:\\car.toml", 3, "a: b:4: c")));
        for none in
            ["car.toml: no such file", "log.csv: line 3: x", "a:+3: x", "a: 3", "", ":", "a:99999999999999999999: x"]
        {
            assert_eq!(place(none), None, "{none}");
        }
    }

    #[test]
    fn the_colours_that_wrong_arguments_ask_for_are_found() {
        let of = |text: &str| Colors::of_arguments(text.split(' ').map(str::to_owned));
        assert_eq!(of("w check --color always --nonsense"), Colors::Always);
        assert_eq!(of("w --color=never --color=always check"), Colors::Always);
        for auto in ["w --color", "w --color=blue", "w --colors=always", "w -- --color=always"] {
            assert_eq!(of(auto), Colors::Auto, "{auto}");
        }
    }
}
