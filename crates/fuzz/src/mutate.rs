//! How a file is broken: a few changes of bytes, numbers, words and lines.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::Rng;

/// Random choices that follow from a seed.
#[derive(Debug)]
pub struct Random(Pcg64Mcg);

impl Random {
    /// Choices by this generator.
    pub fn new(generator: Pcg64Mcg) -> Self {
        Self(generator)
    }

    /// Any 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// A number below `end`; 0 if there is none.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % (end.max(1) as u64)) as usize
    }

    /// A number from 0 to 1.
    pub fn fraction(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// One of these, of which there is at least one.
    pub fn of<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }
}

/// What may stand where a number stood.
const NUMBERS: [&str; 34] = [
    "",
    "nan",
    "-nan",
    "inf",
    "-inf",
    "0",
    "-0",
    "0.0",
    "-0.0",
    "1",
    "-1",
    "2",
    "1e308",
    "-1e308",
    "1e309",
    "5e-324",
    "1e-320",
    "1e-9",
    "1e9",
    "1e22",
    "2147483648",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "-9223372036854775808",
    "18446744073709551615",
    "340282350000000000000000000000000000000",
    "0x10",
    "1_000",
    "1e",
    "true",
    "\"a\"",
    "[]",
    "{}",
];

/// What may be put anywhere.
const BYTES: [&[u8]; 22] = [
    b"\"",
    b"'",
    b"\"\"\"",
    b",",
    b";",
    b"\t",
    b"=",
    b"[",
    b"]",
    b"[[",
    b"]]",
    b"{",
    b"}",
    b"#",
    b"\n",
    b"\r\n",
    b"\r",
    b"\0",
    b".",
    b"\xff",
    b"\xc3\x28",
    b"\xef\xbb\xbf",
];

/// The text with one to six changes.
pub fn mutated(text: &[u8], random: &mut Random) -> Vec<u8> {
    let mut text = text.to_vec();
    for _ in 0..=random.below(6) {
        match random.below(14) {
            // Numbers are what most of a file is about.
            0..=4 => replace_number(&mut text, random),
            5 => scale_number(&mut text, random),
            6 => lines(&mut text, random, |lines, at, _| drop(lines.remove(at))),
            7 => lines(&mut text, random, |lines, at, other| lines.insert(other, lines[at].clone())),
            8 => lines(&mut text, random, |lines, at, other| lines.swap(at, other)),
            9 => swap_words(&mut text, random),
            10 => replace_separators(&mut text, random),
            11 => insert(&mut text, random),
            12 => change_byte(&mut text, random),
            _ => cut(&mut text, random),
        }
    }
    text
}

/// Where a run of bytes of a kind starts and ends.
fn runs(text: &[u8], of: impl Fn(u8) -> bool, starts: impl Fn(u8) -> bool) -> Vec<(usize, usize)> {
    let (mut found, mut at) = (Vec::new(), 0);
    while at < text.len() {
        let end = at + text[at..].iter().take_while(|&&byte| of(byte)).count();
        if end > at && starts(text[at]) {
            found.push((at, end));
        }
        at = end.max(at) + 1;
    }
    found
}

fn number(text: &[u8], random: &mut Random) -> Option<(usize, usize)> {
    let part = |byte: u8| byte.is_ascii_digit() || b"+-.eE_".contains(&byte);
    let found = runs(text, part, |byte| byte.is_ascii_digit() || byte == b'-');
    (!found.is_empty()).then(|| *random.of(&found))
}

fn replace_number(text: &mut Vec<u8>, random: &mut Random) {
    if let Some((start, end)) = number(text, random) {
        text.splice(start..end, random.of(&NUMBERS).bytes());
    }
}

/// A number that is only somewhat wrong, which passes more checks than an extreme.
fn scale_number(text: &mut Vec<u8>, random: &mut Random) {
    let Some((start, end)) = number(text, random) else { return };
    let value: Option<f64> = std::str::from_utf8(&text[start..end]).ok().and_then(|number| number.parse().ok());
    if let Some(value) = value {
        let factor = *random.of(&[-1.0, 0.5, 0.9, 1.0 + 1e-12, 1.1, 2.0, 10.0, 0.1, 1e-3, 1e3]);
        text.splice(start..end, (value * factor).to_string().into_bytes());
    }
}

fn lines(text: &mut Vec<u8>, random: &mut Random, change: impl Fn(&mut Vec<Vec<u8>>, usize, usize)) {
    let mut lines: Vec<Vec<u8>> = text.split_inclusive(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    if !lines.is_empty() {
        let (at, other) = (random.below(lines.len()), random.below(lines.len()));
        change(&mut lines, at, other);
        *text = lines.concat();
    }
}

fn swap_words(text: &mut Vec<u8>, random: &mut Random) {
    let words = runs(text, |byte| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-', |_| true);
    if !words.is_empty() {
        let ((start, end), (from, to)) = (*random.of(&words), *random.of(&words));
        let word = text[from..to].to_vec();
        text.splice(start..end, word);
    }
}

/// All of one separator, or the next few.
fn replace_separators(text: &mut [u8], random: &mut Random) {
    let separators = *b",;=\t .[]\"\n";
    let (from, to) = (*random.of(&separators), *random.of(&separators));
    let maximum = *random.of(&[1, 3, usize::MAX]);
    let start = random.below(text.len());
    text[start..].iter_mut().filter(|byte| **byte == from).take(maximum).for_each(|byte| *byte = to);
}

fn insert(text: &mut Vec<u8>, random: &mut Random) {
    let at = random.below(text.len() + 1);
    text.splice(at..at, random.of(&BYTES).iter().copied());
}

// Any byte will do.
fn change_byte(text: &mut [u8], random: &mut Random) {
    let at = random.below(text.len());
    if let Some(byte) = text.get_mut(at) {
        *byte = random.bits() as u8;
    }
}

fn cut(text: &mut Vec<u8>, random: &mut Random) {
    let at = random.below(text.len() + 1);
    let length = *random.of(&[1, 10, 100, usize::MAX]);
    text.drain(at..at.saturating_add(length).min(text.len()));
}
