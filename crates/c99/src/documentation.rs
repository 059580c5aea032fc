//! The documentation of Rust functions, for the C functions that are made of them.

use std::collections::HashMap;
use std::path::Path;

use crate::names::RustPath;

/// Where a function stands and what its documentation says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Entry {
    /// File and line.
    pub(crate) place: String,
    /// Its documentation, line by line.
    pub(crate) lines: Vec<String>,
}

/// The documentation of the functions of some crates.
#[derive(Debug, Default)]
pub struct Documentation {
    /// By module, type and name. A function of a trait is under the type that it is for.
    entries: HashMap<(String, Option<String>, String), Entry>,
}

impl Documentation {
    /// Reads the sources of all crates in a folder, as `crates/NAME/src`.
    ///
    /// # Errors
    /// A file cannot be read.
    pub fn of_crates(folder: &Path) -> std::io::Result<Self> {
        let mut documentation = Self::default();
        for package in std::fs::read_dir(folder)? {
            let package = package?;
            let sources = package.path().join("src");
            if sources.is_dir() {
                let name = package.file_name().to_string_lossy().into_owned();
                documentation.read_folder(&sources, &name, &format!("crates/{name}/src"))?;
            }
        }
        Ok(documentation)
    }

    fn read_folder(&mut self, folder: &Path, module: &str, shown: &str) -> std::io::Result<()> {
        for file in std::fs::read_dir(folder)? {
            let path = file?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let shown = format!("{shown}/{name}");
            if path.is_dir() {
                self.read_folder(&path, &format!("{module}::{name}"), &shown)?;
            } else if let Some(stem) = name.strip_suffix(".rs") {
                let module = match stem {
                    "lib" | "mod" | "main" => module.to_owned(),
                    _ => format!("{module}::{stem}"),
                };
                self.read(&module, &shown, &std::fs::read_to_string(&path)?);
            }
        }
        Ok(())
    }

    /// Takes the functions of a file.
    pub(crate) fn read(&mut self, module: &str, file: &str, text: &str) {
        let (mut lines, mut of) = (Vec::new(), None);
        for (at, line) in text.lines().enumerate() {
            let plain = line.trim();
            if let Some(text) = plain.strip_prefix("///") {
                lines.push(without_targets(text.trim()));
                continue;
            }
            if plain.starts_with("#[") {
                continue;
            }
            if line.starts_with("impl") || line.starts_with("pub trait") || line.starts_with("trait") {
                of = type_of_block(line);
            } else if line == "}" {
                of = None;
            } else if let Some(name) = function_name(plain) {
                let place = format!("{file}, line {}", at + 1);
                let key = (module.to_owned(), of.clone(), name.to_owned());
                self.entries.entry(key).or_insert(Entry { place, lines: std::mem::take(&mut lines) });
            }
            lines.clear();
        }
    }

    /// What is known of a function.
    pub(crate) fn of(&self, path: &RustPath) -> Option<&Entry> {
        self.entries.get(&(path.module.clone(), path.of.clone(), path.name.clone()))
    }
}

/// A line without the targets of its links.
fn without_targets(line: &str) -> String {
    let (first, links) = line.split_once("](").unwrap_or((line, ""));
    let parts = links.split("](").map(|rest| rest.split_once(')').map_or("", |(_, after)| after));
    let is_link = !links.is_empty();
    std::iter::once(first).chain(parts.filter(|_| is_link)).collect::<Vec<_>>().join("]")
}

/// The type of `impl<T> Type<T> {` and of `impl Trait for Type {`.
fn type_of_block(line: &str) -> Option<String> {
    let line = line.split(" where").next()?.rsplit(" for ").next()?;
    let mut words = String::new();
    let mut depth = 0_i32;
    for character in line.chars() {
        match character {
            '<' => depth += 1,
            '>' => depth -= 1,
            '{' => break,
            _ if depth == 0 => words.push(character),
            _ => {}
        }
    }
    let name = words.split_whitespace().last()?.rsplit("::").next()?.trim_start_matches('&');
    name.starts_with(char::is_uppercase).then(|| name.to_owned())
}

/// The name after `fn`.
fn function_name(line: &str) -> Option<&str> {
    let words: &[&str] = &["pub", "pub(crate)", "pub(super)", "const", "unsafe", "extern", "\"C\""];
    let mut rest = line;
    loop {
        let (word, after) = rest.split_once(' ')?;
        if word == "fn" {
            return after.split(|character: char| !character.is_alphanumeric() && character != '_').next();
        }
        if !words.contains(&word) {
            return None;
        }
        rest = after;
    }
}

#[cfg(test)]
mod tests {
    use super::Documentation;
    use crate::names::RustPath;

    #[test]
    fn a_function_has_its_documentation_by_module_type_and_name() {
        let mut documentation = Documentation::default();
        documentation.read(
            "observer::gearbox",
            "mod.rs",
            "/// Of the type.\nstruct A;\n\nimpl<T: Real> A<T> {\n    /// One, Eq. (2.3).\n    /// Two.\n    #[inline]\n    pub(crate) fn \
             go(&self) {\n    }\n}\n\nimpl<T> From<T> for B<T> {\n    fn go() {}\n}\n\n/// Free.\nfn go() {}\n",
        );
        let of = |of: Option<&str>| {
            let path = RustPath {
                module: "observer::gearbox".to_owned(),
                of: of.map(str::to_owned),
                name: "go".to_owned(),
                is_closure: false,
            };
            documentation.of(&path).cloned().map(|entry| (entry.place, entry.lines.join(" ")))
        };
        let entry = |place: &str, text: &str| Some((place.to_owned(), text.to_owned()));
        assert_eq!(of(Some("A")), entry("mod.rs, line 8", "One, Eq. (2.3). Two."));
        assert_eq!(of(Some("B")), entry("mod.rs, line 13", ""));
        assert_eq!(of(None), entry("mod.rs, line 17", "Free."));
        assert_eq!(of(Some("C")), None);
    }
}
