//! `docs/reference/equations.md` against the code, both ways.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The chapter's equation numbers in a text: `(2.6)-(2.9)` names four, `(2.62b)` names 62.
fn equations(text: &str) -> BTreeSet<u32> {
    let mut found = BTreeSet::new();
    let mut range_from = None;
    let mut rest = text;
    while let Some(at) = rest.find("(2.") {
        let between = &rest[..at];
        let number: String = rest[at + 3..].chars().take_while(char::is_ascii_digit).collect();
        let after = &rest[at + 3 + number.len()..];
        rest = after;
        let closed = after.starts_with(')') || (after.len() > 1 && after[1..].starts_with(')'));
        let Ok(number) = number.parse::<u32>() else { continue };
        if !closed {
            continue;
        }
        match range_from.take().filter(|_| between.trim_start_matches(|c: char| c.is_ascii_lowercase()) == ")-") {
            Some(from) => found.extend(from..=number),
            None => {
                found.insert(number);
            }
        }
        range_from = Some(number);
    }
    found
}

/// Rust files of the workspace's own crates.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Equations named in the comments of a source file.
fn equations_in_comments(file: &Path) -> BTreeSet<u32> {
    let text = fs::read_to_string(file).unwrap();
    let comments = text.lines().filter(|line| line.trim_start().starts_with("//"));
    comments.flat_map(equations).collect()
}

/// The file and the word of a cell "`file` `word`".
fn file_and_word(cell: &str) -> (String, String) {
    let quoted: Vec<&str> = cell.split('`').skip(1).step_by(2).collect();
    assert_eq!(quoted.len(), 2, "a cell names a file and a word: {cell}");
    (quoted[0].to_owned(), quoted[1].to_owned())
}

fn rows() -> Vec<[String; 4]> {
    let page = fs::read_to_string(root().join("docs/reference/equations.md")).unwrap();
    (page.lines())
        .filter(|line| line.starts_with("| (2."))
        .map(|line| {
            let cells: Vec<String> = line.trim_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect();
            <[String; 4]>::try_from(cells).unwrap_or_else(|cells| panic!("{} cells in {line}", cells.len()))
        })
        .collect()
}

#[test]
fn every_file_symbol_and_test_of_the_page_exists() {
    for [equation, _, code, test] in rows() {
        let (file, symbol) = file_and_word(&code);
        let text = fs::read_to_string(root().join(&file)).unwrap_or_else(|e| panic!("{equation}: {file}: {e}"));
        assert!(text.contains(&symbol), "{equation}: {file} has no {symbol}");
        let (file, name) = file_and_word(&test);
        let text = fs::read_to_string(root().join(&file)).unwrap_or_else(|e| panic!("{equation}: {file}: {e}"));
        assert!(text.contains(&format!("fn {name}(")), "{equation}: {file} has no test {name}");
        assert!(text.contains("#[test]"), "{equation}: {file} holds no tests");
    }
}

#[test]
fn every_equation_that_the_code_names_is_on_the_page() {
    let on_page: BTreeSet<u32> = rows().iter().flat_map(|row| equations(&row[0])).collect();
    let mut files = Vec::new();
    sources(&root().join("crates"), &mut files);
    for file in files.iter().filter(|file| !file.ends_with("tests/equations.rs")) {
        for number in equations_in_comments(file) {
            assert!(on_page.contains(&number), "{} names (2.{number}), and the page does not", file.display());
        }
    }
}

#[test]
fn the_code_of_each_row_names_its_equation() {
    for [equation, _, code, _] in rows() {
        let (file, _) = file_and_word(&code);
        let named = equations_in_comments(&root().join(&file));
        assert!(!named.is_disjoint(&equations(&equation)), "{file} does not name {equation}");
    }
}

#[test]
fn numbers_are_found_alone_in_ranges_and_with_letters() {
    let numbers = |text: &str| equations(text).into_iter().collect::<Vec<_>>();
    assert_eq!(numbers("Eq. (2.6a) and (2.9)-(2.12), not (2.5 kPa)"), [6, 9, 10, 11, 12]);
}
