//! Messages and tables. Colours appear on terminals only and never under `NO_COLOR`.

use std::io::{self, Write};

use anstyle::{AnsiColor, Style};

const ERROR: Style = AnsiColor::Red.on_default().bold();
const HINT: Style = AnsiColor::Cyan.on_default();

/// An error on standard error; `hint:` at the start of a line is coloured.
pub(crate) fn error(message: &str) {
    let mut stderr = anstream::stderr().lock();
    // There is no other place to report that standard error cannot be written.
    let _ = writeln!(stderr, "{ERROR}error:{ERROR:#} {}", coloured_hints(message));
}

/// A message on standard error.
pub(crate) fn note(message: &str) {
    let _ = writeln!(anstream::stderr().lock(), "{message}");
}

fn coloured_hints(message: &str) -> String {
    let line = |line: &str| match line.strip_prefix("hint:") {
        Some(rest) => format!("{HINT}hint:{HINT:#}{rest}"),
        None => line.to_owned(),
    };
    message.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// A table on standard output, see [`lines`].
pub(crate) fn table(left: usize, rows: &[Vec<String>]) -> io::Result<()> {
    lines(left, rows).iter().try_for_each(|line| self::line(line))
}

/// The same, of rows that may be very many: each is made twice, and none is kept.
pub(crate) fn long_table<R: Iterator<Item = Vec<String>>>(left: usize, rows: impl Fn() -> R) -> io::Result<()> {
    let mut widths = Vec::new();
    for row in rows() {
        widths.resize(row.len().max(widths.len()), 0);
        widths.iter_mut().zip(row).for_each(|(width, cell)| *width = cell.chars().count().max(*width));
    }
    rows().try_for_each(|row| self::line(&line_of(left, &row, &widths)))
}

/// The lines of a table: the first `left` columns to the left, the others to the right.
pub(crate) fn lines(left: usize, rows: &[Vec<String>]) -> Vec<String> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |j: usize| rows.iter().filter_map(|row| row.get(j)).map(|cell| cell.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    rows.iter().map(|row| line_of(left, row, &widths)).collect()
}

/// A line of a table with columns of these widths.
fn line_of(left: usize, row: &[String], widths: &[usize]) -> String {
    let cells = row.iter().zip(widths).enumerate().map(|(j, (cell, &width))| match j < left {
        true => format!("{cell:<width$}"),
        false => format!("{cell:>width$}"),
    });
    cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
}

/// A line on standard output. A reader that has closed it, such as `head`, misses the rest: that is no error, and the files of the
/// command are still written.
pub(crate) fn line(text: &str) -> io::Result<()> {
    match writeln!(io::stdout().lock(), "{text}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// A count with commas between the thousands: 60,000,000.
pub(crate) fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut grouped = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_separated_by_commas() {
        assert_eq!([7, 950, 9501, 60_000_000].map(grouped), ["7", "950", "9,501", "60,000,000"]);
    }
}
