//! Words that repeat, such as phases.

use std::collections::HashMap;

/// Words that repeat: each is stored once.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Words {
    /// Of each row, the place of its word in [`Self::words`].
    pub codes: Codes,
    /// The different words, in the order in which they came first.
    pub words: Vec<String>,
    places: HashMap<String, usize>,
}

/// The place of the word of each row, in a byte as long as there are no more than 256 words.
#[derive(Debug, Clone, PartialEq)]
pub enum Codes {
    /// Of up to 256 words.
    Bytes(Vec<u8>),
    /// Of more.
    Wide(Vec<u32>),
}

impl Words {
    /// The word of a row.
    pub fn get(&self, row: usize) -> Option<&str> {
        self.words.get(self.codes.get(row)?).map(String::as_str)
    }

    pub(crate) fn push(&mut self, word: &str) {
        // Mostly it is the word of the row before.
        if let Some(last) = self.codes.last().filter(|last| self.words[*last] == word) {
            return self.codes.push(last);
        }
        let code = match self.places.get(word) {
            Some(code) => *code,
            None => {
                let code = self.words.len();
                self.words.push(word.to_owned());
                self.places.insert(word.to_owned(), code);
                code
            }
        };
        self.codes.push(code);
    }

    /// Repeats the last word; an empty one where there is none.
    pub(crate) fn repeat(&mut self, times: usize) {
        if times > 0 && self.codes.is_empty() {
            self.push("");
            return self.repeat(times - 1);
        }
        self.codes.repeat(times);
    }
}

impl<'a> FromIterator<&'a str> for Words {
    fn from_iter<I: IntoIterator<Item = &'a str>>(words: I) -> Self {
        let mut all = Self::default();
        words.into_iter().for_each(|word| all.push(word));
        all
    }
}

impl Default for Codes {
    fn default() -> Self {
        Self::Bytes(Vec::new())
    }
}

impl Codes {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Bytes(codes) => codes.len(),
            Self::Wide(codes) => codes.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// That of a row.
    pub fn get(&self, row: usize) -> Option<usize> {
        match self {
            Self::Bytes(codes) => codes.get(row).map(|code| usize::from(*code)),
            Self::Wide(codes) => codes.get(row).map(|code| *code as usize),
        }
    }

    pub(crate) fn reserve(&mut self, rows: usize) {
        match self {
            Self::Bytes(codes) => codes.reserve_exact(rows),
            Self::Wide(codes) => codes.reserve_exact(rows),
        }
    }

    fn last(&self) -> Option<usize> {
        self.get(self.len().checked_sub(1)?)
    }

    /// Repeats the last one.
    fn repeat(&mut self, times: usize) {
        match self {
            Self::Bytes(codes) => codes.resize(codes.len() + times, codes.last().copied().unwrap_or(0)),
            Self::Wide(codes) => codes.resize(codes.len() + times, codes.last().copied().unwrap_or(0)),
        }
    }

    fn push(&mut self, code: usize) {
        match (&mut *self, u8::try_from(code)) {
            (Self::Bytes(codes), Ok(code)) => codes.push(code),
            (Self::Bytes(codes), Err(_)) => {
                *self = Self::Wide(codes.iter().map(|code| u32::from(*code)).collect());
                self.push(code);
            }
            (Self::Wide(codes), _) => codes.push(u32::try_from(code).unwrap_or(u32::MAX)),
        }
    }
}

impl FromIterator<usize> for Codes {
    fn from_iter<I: IntoIterator<Item = usize>>(codes: I) -> Self {
        let mut all = Self::default();
        codes.into_iter().for_each(|code| all.push(code));
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_stay_the_same_when_there_are_too_many_for_a_byte() {
        let all: Vec<String> = (0..1000).map(|at| format!("word {}", at % 300)).collect();
        let words: Words = all.iter().map(String::as_str).collect();
        assert_eq!((words.words.len(), words.codes.len()), (300, 1000));
        assert!((0..1000).all(|row| words.get(row) == Some(&all[row])) && words.get(1000).is_none());
        let few: Words = all[..256].iter().map(String::as_str).collect();
        assert!(matches!(few.codes, Codes::Bytes(_)) && matches!(words.codes, Codes::Wide(_)));
        assert_eq!(few.get(255), Some("word 255"));
    }
}
