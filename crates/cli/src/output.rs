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

/// A table on standard output: the first `left` columns to the left, the others to the right.
pub(crate) fn table(left: usize, rows: &[Vec<String>]) -> io::Result<()> {
    long_table(left, || rows.iter().cloned())
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

/// The lines of a table, as [`table`] has them, below its titles. A title that is wider than the cells of its
/// column takes several lines.
pub(crate) fn titled_lines(left: usize, titles: &[String], rows: &[Vec<String>]) -> Vec<String> {
    let length = |text: &str| text.chars().count();
    let widest = |j: usize| rows.iter().filter_map(|row| row.get(j)).map(|cell| length(cell)).max().unwrap_or(0);
    let word = |title: &str| words(title).map(|word| length(&word)).max().unwrap_or(0);
    let widths: Vec<usize> = titles.iter().enumerate().map(|(j, title)| widest(j).max(word(title))).collect();
    let titles: Vec<Vec<String>> = titles.iter().zip(&widths).map(|(title, &width)| wrapped(title, width)).collect();
    let height = titles.iter().map(Vec::len).max().unwrap_or(0);
    // The last lines of all titles stand on one line.
    let title_line = |at: usize| {
        let of =
            |title: &Vec<String>| (at + title.len()).checked_sub(height).map_or(String::new(), |at| title[at].clone());
        titles.iter().map(of).collect::<Vec<_>>()
    };
    let titles: Vec<Vec<String>> = (0..height).map(title_line).collect();
    titles.iter().chain(rows).map(|row| line_of(left, row, &widths)).collect()
}

/// A text in lines of at most this width, as far as its words are no wider. The two words of a unit stay together.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words(text) {
        match lines.last_mut().filter(|line| line.chars().count() + 1 + word.chars().count() <= width) {
            Some(line) => *line = format!("{line} {word}"),
            None => lines.push(word),
        }
    }
    lines
}

/// The words of a title; `N m` is one.
fn words(title: &str) -> impl Iterator<Item = String> {
    const JOINED: char = '\u{a0}';
    let joined = title.replace("N m", &format!("N{JOINED}m"));
    joined.split(' ').map(|word| word.replace(JOINED, " ")).collect::<Vec<_>>().into_iter()
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
    fn a_title_that_is_wider_than_its_cells_takes_several_lines() {
        let cells = |cells: &[&str]| cells.iter().map(|&cell| cell.to_owned()).collect::<Vec<_>>();
        let titles = cells(&["shift", "past new gear rad/s", "torque N m"]);
        let rows = [cells(&["1-2", "0.5", "62 (23 to 102)"]), cells(&["2-1", "11.5", "1"])];
        let of_unit = titled_lines(1, &cells(&["at the turbine N m"]), &[cells(&["1"])]);
        assert_eq!(of_unit, ["at the", "turbine", "N m", "1"]);
        let expected = ["        past", "         new", "        gear", "shift  rad/s      torque N m"];
        assert_eq!(titled_lines(1, &titles, &rows)[..4], expected);
        assert_eq!(
            titled_lines(1, &titles, &rows)[4..],
            ["1-2      0.5  62 (23 to 102)", "2-1     11.5               1"]
        );
        assert_eq!(titled_lines(1, &titles, &[]).len(), 4);
        assert!(titled_lines(1, &[], &[]).is_empty());
    }

    #[test]
    fn thousands_are_separated_by_commas() {
        assert_eq!([7, 950, 9501, 60_000_000].map(grouped), ["7", "950", "9,501", "60,000,000"]);
    }
}
