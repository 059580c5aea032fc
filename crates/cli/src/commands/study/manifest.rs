//! `study.json`: what determines the rows of a folder, and how a folder differs from what is expected.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use trace::text_file::{LARGEST_LIST, read_text_of};
use trace::{ShownPath as _, printable};
use wetclutch::studies::Runs;

use crate::args::Shard;
use crate::failure::Failure;

const NAME: &str = "study.json";
/// Differing keys that a message names.
const NAMED: usize = 3;

/// What determines the rows of a folder.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Manifest {
    /// Version of the program.
    wetclutch: String,
    /// The study's name.
    study: String,
    /// Of everything that determines a run.
    sha256: String,
    /// None of a whole study.
    shard: Option<String>,
    first_run: u64,
    runs: u64,
    /// The values of each file by its role: an error names those that differ.
    #[serde(default)]
    files: BTreeMap<String, BTreeMap<String, String>>,
}

impl Manifest {
    /// Of a whole study.
    pub(super) fn of<R: Runs>(campaign: &R) -> Self {
        let files = campaign.sources().into_iter().map(|(role, source)| (role.to_owned(), source.values()));
        Self {
            wetclutch: env!("CARGO_PKG_VERSION").to_owned(),
            study: campaign.name().to_owned(),
            sha256: campaign.fingerprint(),
            shard: None,
            first_run: 0,
            runs: campaign.count(),
            files: files.collect(),
        }
    }

    /// Of a shard of a study with so many runs.
    #[must_use]
    pub(super) fn of_shard(self, shard: Shard, all: u64) -> Self {
        let runs = shard.of(all);
        Self { shard: Some(shard.to_string()), first_run: runs.start, runs: runs.end - runs.start, ..self }
    }

    pub(super) fn path(folder: &Path) -> PathBuf {
        folder.join(NAME)
    }

    pub(super) fn text(&self) -> Result<String, Failure> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// The manifest of a folder.
    pub(super) fn read(folder: &Path) -> Result<Self, Failure> {
        let path = Self::path(folder);
        let text = read_text_of(&path, LARGEST_LIST).map_err(|error| {
            let hint = if error.to_string().contains("\nhint: ") { "" } else { "\nhint: name the folder of a study" };
            Failure::Input(format!("{}: {error}{hint}", path.shown()))
        })?;
        serde_json::from_str(&text).map_err(|error| {
            Failure::Input(format!(
                "{}: this is no description of a study: {}\nhint: the file was changed or cut; make the study again in another folder",
                path.shown(),
                printable(&error.to_string())
            ))
        })
    }

    /// Refuses the folder of another study, or of another part of it.
    pub(super) fn check(&self, expected: &Self, folder: &Path) -> Result<(), Failure> {
        self.check_study(expected, folder)?;
        if (&self.shard, self.first_run, self.runs) == (&expected.shard, expected.first_run, expected.runs) {
            return Ok(());
        }
        Err(Failure::Input(format!(
            "{}: this is {}, expected {}\nhint: choose another folder, or give the option --shard with which it was made",
            Self::path(folder).shown(),
            self.part(),
            expected.part()
        )))
    }

    /// Refuses the folder of another study.
    fn check_study(&self, expected: &Self, folder: &Path) -> Result<(), Failure> {
        let path = Self::path(folder);
        if self.wetclutch != expected.wetclutch {
            return Err(Failure::Input(format!(
                "{}: was made by wetclutch {}, and this is wetclutch {}\nhint: the rows of two versions may differ; make the study again \
                 in another folder",
                path.shown(),
                printable(&self.wetclutch),
                expected.wetclutch
            )));
        }
        if self.sha256 == expected.sha256 {
            return Ok(());
        }
        Err(Failure::Input(format!(
            "{}: belongs to another study: {}\nhint: use the files with which it was made, or choose another folder",
            path.shown(),
            self.difference(expected)
        )))
    }

    /// What differs between two studies, in words.
    fn difference(&self, expected: &Self) -> String {
        if self.study != expected.study {
            return format!("its name is \"{}\", expected \"{}\"", printable(&self.study), expected.study);
        }
        if self.files.is_empty() {
            return "its study file, experiment or vehicle is not the one given".to_owned();
        }
        for (role, values) in &expected.files {
            let none = BTreeMap::new();
            let found = self.files.get(role).unwrap_or(&none);
            let mut differing: Vec<&String> =
                values.keys().chain(found.keys()).filter(|key| values.get(*key) != found.get(*key)).collect();
            differing.sort();
            differing.dedup();
            if differing.is_empty() {
                continue;
            }
            let named = differing.iter().take(NAMED).map(|key| {
                let words = |value: Option<&String>| value.map_or("not given", |value| value).to_owned();
                let (found, given) = (words(found.get(*key)), words(values.get(*key)));
                format!("`{}` is {} there and {} here", printable(key), cut(&found), cut(&given))
            });
            let named = named.collect::<Vec<_>>().join(", ");
            let more = differing.len().saturating_sub(NAMED);
            let more = if more > 0 { format!(", and {more} more keys differ") } else { String::new() };
            return format!("of the {role} file, {named}{more}");
        }
        "the values of its files are the same, and their text, or a file that they name, is not".to_owned()
    }

    /// Which part of its study it has, in words.
    fn part(&self) -> String {
        match &self.shard {
            None => "a whole study".to_owned(),
            Some(shard) => format!("shard {}", printable(shard)),
        }
    }
}

/// A value as a message shows it.
fn cut(value: &str) -> String {
    const LONGEST: usize = 60;
    let end = if value.chars().nth(LONGEST).is_some() { "..." } else { "" };
    printable(&value.chars().take(LONGEST).collect::<String>()).into_owned() + end
}

/// The folders of all shards of a study in the order of their runs.
pub(super) fn in_order<'a, R: Runs>(campaign: &R, folders: &'a [PathBuf]) -> Result<Vec<(&'a Path, Shard)>, Failure> {
    let mut expected = Manifest::of(campaign);
    let mut shards: Vec<(&Path, Shard)> = Vec::new();
    for folder in folders {
        let found = Manifest::read(folder)?;
        found.check_study(&expected, folder)?;
        let path = Manifest::path(folder);
        let Some(shard) = &found.shard else {
            let hint = "a whole study needs no merge; give the folders that `study --shard` wrote";
            return Err(Failure::Input(format!(
                "{}: this is a whole study, expected a shard\nhint: {hint}",
                path.shown()
            )));
        };
        let shard: Shard = shard.parse().map_err(|error| {
            Failure::Input(format!("{}: `shard` is \"{}\": {error}", path.shown(), printable(shard)))
        })?;
        expected = expected.of_shard(shard, campaign.count());
        found.check(&expected, folder)?;
        match shards.iter().find(|(_, other)| other.count != shard.count || other.index == shard.index) {
            Some((other, first)) if first.count != shard.count => {
                return Err(Failure::Input(format!(
                    "{}: this is shard {shard}, and {} is shard {first}\nhint: give the shards of one division of the study",
                    path.shown(),
                    other.shown()
                )));
            }
            Some((other, _)) => {
                return Err(Failure::Input(format!(
                    "{}: shard {shard} is given twice, the first time by {}\nhint: give each shard once",
                    path.shown(),
                    other.shown()
                )));
            }
            None => shards.push((folder.as_path(), shard)),
        }
    }
    shards.sort_by_key(|(_, shard)| shard.index);
    let count = shards.first().map_or(1, |(_, shard)| shard.count);
    let is_there = |index: &u64| shards.binary_search_by_key(index, |(_, shard)| shard.index).is_ok();
    let missing: Vec<String> =
        (1..=count).filter(|index| !is_there(index)).take(NAMED + 1).map(|index| format!("{index}/{count}")).collect();
    if missing.is_empty() {
        return Ok(shards);
    }
    let (is, more) = if missing.len() == 1 { ("shard", "is") } else { ("shards", "are") };
    let end = if missing.len() > NAMED { " and more" } else { "" };
    Err(Failure::Input(format!(
        "{is} {}{end} {more} missing\nhint: give the folders of all {count} shards; `study --shard {} -o FOLDER` makes a missing one",
        missing[..missing.len().min(NAMED)].join(", "),
        missing[0]
    )))
}
