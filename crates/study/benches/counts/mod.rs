//! Counts of instructions and bytes, against those that were kept in a file.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::Deserialize;

/// Growth of a count beyond which the comparison fails.
const TOLERANCE: f64 = 0.05;

/// What is in the file.
#[derive(Deserialize)]
struct Kept {
    toolchain: String,
    #[serde(flatten)]
    counts: ByUnit,
}

/// Counts by their unit, which names a table of the file, then by what was counted.
type ByUnit = BTreeMap<String, BTreeMap<String, u64>>;

/// The counts of a benchmark.
pub(crate) struct Counts {
    bench: &'static str,
    toolchain: String,
    /// None where the file is to be renewed.
    kept: Option<Kept>,
    found: ByUnit,
    grown: Vec<String>,
}

impl Counts {
    /// None yet of this benchmark and toolchain; with `write` the file is renewed.
    pub(crate) fn new(bench: &'static str, toolchain: String, write: bool) -> Result<Self, String> {
        let kept = if write { None } else { Some(read(bench)?) };
        Ok(Self { bench, toolchain, kept, found: ByUnit::new(), grown: Vec::new() })
    }

    /// Takes a count of this unit. Returns its change against the file, in %, as text.
    pub(crate) fn take(&mut self, unit: &str, name: &str, count: u64) -> String {
        let before = self.kept.as_ref().and_then(|kept| kept.counts.get(unit)?.get(name));
        let change = before.map(|&before| count as f64 / before as f64 - 1.0);
        if self.kept.is_some() && change.is_none_or(|change| change > TOLERANCE) {
            self.grown.push(format!("{name}, {unit}"));
        }
        self.found.entry(unit.to_owned()).or_default().insert(name.to_owned(), count);
        change.map_or_else(String::new, |change| format!("{:+.1} %", 100.0 * change))
    }

    /// Renews the file, or says what has grown. Whether nothing has; counts of another toolchain are not compared.
    #[expect(clippy::print_stdout, reason = "a benchmark")]
    pub(crate) fn conclude(&self) -> Result<bool, String> {
        let renew = renew(self.bench);
        let Some(kept) = &self.kept else {
            std::fs::write(file(self.bench), self.text()).map_err(|error| error.to_string())?;
            return Ok(true);
        };
        if kept.toolchain != self.toolchain {
            println!(
                "not compared: the counts are of\n  {}\nand this is\n  {}\n{renew}",
                kept.toolchain, self.toolchain
            );
            return Ok(true);
        }
        if !self.grown.is_empty() {
            let grown = self.grown.join("\n  ");
            println!("more than {:.0} % above the file, or not in it:\n  {grown}\n{renew}", 100.0 * TOLERANCE);
        }
        Ok(self.grown.is_empty())
    }

    fn text(&self) -> String {
        let mut text =
            format!("# Counts, see `benches/{}/main.rs`; do not edit.\ntoolchain = {:?}\n", self.bench, self.toolchain);
        for (unit, counts) in &self.found {
            let _ = writeln!(text, "\n[{unit}]");
            for (name, count) in counts {
                let _ = writeln!(text, "{name:?} = {count}");
            }
        }
        text
    }
}

fn file(bench: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches").join(bench).with_extension("toml")
}

fn renew(bench: &str) -> String {
    format!("to renew the file: cargo bench -p study --bench {bench} -- --write")
}

fn read(bench: &str) -> Result<Kept, String> {
    let file = file(bench);
    let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}\n{}", file.display(), renew(bench));
    let text = std::fs::read_to_string(&file).map_err(|error| wrong(&error))?;
    toml::from_str(&text).map_err(|error| wrong(&error))
}
