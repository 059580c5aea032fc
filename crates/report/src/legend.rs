//! The column right of a panel: a sample of each stroke and its name, near where the curve ends.

use crate::palette::Stroke;

/// Size of a label, pixels.
pub(crate) const LABEL_SIZE: u32 = 13;
/// Height of a line of text, pixels.
pub(crate) const LINE: f64 = 15.5;
/// Widest line of a name, pixels; a longer one is broken.
const WIDEST: f64 = 190.0;

/// What stands before a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Key {
    /// A piece of the curve.
    Stroke(Stroke),
    /// A piece of a shaded range of this colour.
    Range(&'static str),
    /// Nothing: a remark about the panel.
    Remark,
}

/// One entry.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    /// What it names.
    pub key: Key,
    /// The name, in lines that fit.
    pub lines: Vec<String>,
    /// Where its middle would stand best, pixels.
    pub wish: f64,
}

impl Entry {
    pub(crate) fn new(key: Key, name: &str, wish: f64) -> Self {
        Self { key, lines: broken(name, WIDEST), wish }
    }

    pub(crate) fn height(&self) -> f64 {
        LINE * self.lines.len() as f64
    }

    pub(crate) fn width(&self) -> f64 {
        self.lines.iter().map(|line| width(line)).fold(0.0, f64::max)
    }
}

/// The tops of entries in a column from `top` to `bottom`: as near to their wishes as they fit, those of about the same
/// wish in the order given. They fit if the column is as high as they are together.
pub(crate) fn placed(mut entries: Vec<Entry>, top: f64, bottom: f64) -> Vec<(f64, Entry)> {
    // Curves that end together keep one order in all panels.
    entries.sort_by(|a, b| (a.wish / LINE).round().total_cmp(&(b.wish / LINE).round()));
    let mut next = top;
    let mut tops: Vec<f64> = Vec::new();
    for entry in &entries {
        let at = (entry.wish - entry.height() / 2.0).max(next);
        tops.push(at);
        next = at + entry.height();
    }
    // What was pushed out at the bottom goes back up.
    let mut end = bottom;
    for (at, entry) in tops.iter_mut().zip(&entries).rev() {
        *at = at.min(end - entry.height()).max(top);
        end = *at;
    }
    tops.into_iter().zip(entries).collect()
}

/// The text in lines no wider than `widest` pixels; a word that is wider is broken too.
pub(crate) fn broken(text: &str, widest: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    // A space that does not break is none here: it holds a unit together.
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        let line = lines.last().map_or("", String::as_str);
        let joined = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
        if width(&joined) <= widest || line.is_empty() {
            lines.pop();
            lines.push(joined);
        } else {
            lines.push(word.to_owned());
        }
        while let Some(line) = lines.last().filter(|line| width(line) > widest && line.chars().count() > 1) {
            let (mut start, mut rest) = (String::new(), String::new());
            for c in line.chars() {
                let fits = rest.is_empty() && (start.is_empty() || width(&start) + advance(c) <= widest);
                if fits { &mut start } else { &mut rest }.push(c);
            }
            lines.pop();
            lines.push(start);
            lines.push(rest);
        }
    }
    lines
}

/// Width of a line in the figure's font, pixels; none of the fonts that it may be shown in is wider.
pub(crate) fn width(text: &str) -> f64 {
    text.chars().map(advance).sum()
}

/// Width of a character of Helvetica, with a twentieth to spare.
fn advance(c: char) -> f64 {
    let em = match c {
        'i' | 'j' | 'l' | '\'' | '|' => 0.24,
        ' ' | '\u{a0}' | 'f' | 't' | 'I' | '.' | ',' | ':' | ';' | '!' | '/' | '[' | ']' | '(' | ')' | '-' | 'r' => {
            0.34
        }
        'm' | 'M' | 'W' | '%' | '@' | '—' => 0.9,
        'w' | 'A'..='Z' | '&' => 0.75,
        c if c.is_ascii() => 0.56,
        // Most letters of other alphabets are narrower, those of East Asia are as wide as high.
        c if u32::from(c) < 0x2E80 => 0.75,
        _ => 1.0,
    };
    1.05 * em * f64::from(LABEL_SIZE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, wish: f64) -> Entry {
        Entry::new(Key::Remark, name, wish)
    }

    #[test]
    fn entries_are_moved_apart_keep_their_order_and_stay_in_the_column() {
        let placed = placed(vec![entry("b", 30.0), entry("a", 8.0), entry("c", 31.0), entry("d", 99.0)], 0.0, 100.0);
        assert_eq!(placed.iter().map(|(_, e)| e.lines[0].as_str()).collect::<String>(), "abcd");
        assert!(placed.windows(2).all(|pair| pair[1].0 - pair[0].0 >= LINE));
        assert!(placed[0].0 >= 0.0 && placed[3].0 + LINE <= 100.0);
    }

    #[test]
    fn a_full_column_holds_all_its_entries() {
        let entries: Vec<Entry> = (0..13).map(|n| entry(&n.to_string(), 100.0)).collect();
        let height = 13.0 * LINE;
        let placed = placed(entries, 0.0, height);
        assert!(placed.windows(2).all(|pair| pair[1].0 - pair[0].0 >= LINE - 1e-9));
        assert!(placed[0].0 >= 0.0 && placed[12].0 + LINE <= height + 1e-9);
    }

    #[test]
    fn a_long_name_is_broken_and_nothing_of_it_is_lost() {
        let name = "compliant, 100 Hz, sensors of the second supplier at the cold end of the oil";
        let lines = broken(name, WIDEST);
        assert_eq!(lines.join(" "), name);
        assert!(lines.len() > 1 && lines.iter().all(|line| width(line) <= WIDEST));
        let word = "x".repeat(200);
        let lines = broken(&word, WIDEST);
        assert_eq!(lines.concat(), word);
        assert!(lines.iter().all(|line| width(line) <= WIDEST));
        assert_eq!(broken("compliant, 100 Hz, sensors", WIDEST).len(), 1);
    }
}
