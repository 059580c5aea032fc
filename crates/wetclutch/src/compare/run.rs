//! What a run has left: its table of shifts and its signals.

use std::path::{Path, PathBuf};

use trace::{CsvRows, ShownPath as _};

use crate::Error;

/// A shift of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftOfRun {
    /// Its number in the run, from 1.
    pub number: usize,
    /// Its begin and its end, s.
    pub time_s: [f64; 2],
    /// Gear before and after; empty where they are not known.
    pub gears: [String; 2],
    /// Its kind or load; empty where it is not known.
    pub kind: String,
    /// Offgoing and oncoming element; empty where they are not known.
    pub elements: [String; 2],
    /// Its worst health; empty where it is not known.
    pub health: String,
    /// The numbers of its row by the names of their columns; those that are finite.
    pub values: Vec<(String, f64)>,
}

impl ShiftOfRun {
    /// Its gears as they are called.
    pub fn name(&self) -> String {
        let [from, to] = &self.gears;
        if from.is_empty() { "shift".to_owned() } else { format!("{from}-{to}") }
    }

    /// A number of its row.
    pub(super) fn value(&self, name: &str) -> Option<f64> {
        self.values.iter().find(|(other, _)| other == name).map(|(_, value)| *value)
    }
}

/// A run.
#[derive(Debug)]
pub(super) struct Run {
    /// Its shifts in the order of their times.
    pub(super) shifts: Vec<ShiftOfRun>,
    /// The file of its signals, if it is there.
    pub(super) signals: Option<PathBuf>,
    /// Whether it is of a vehicle file of one shift; none where that is not known.
    pub(super) is_one_shift: Option<bool>,
}

/// How long a shift is taken to be whose end is not known, s.
const UNKNOWN_S: f64 = 1.5;
/// The table of shifts of `demo`, and its signals.
const OF_DEMO: [&str; 2] = ["shifts.csv", "drive.csv"];
/// How the name of a table of shifts of `estimate` ends.
const TABLE: &str = "_shifts.csv";
/// Endings of the signals of an estimate.
const SIGNALS: [&str; 3] = ["csv", "parquet", "mf4"];
/// The words of the phases outside a shift.
const OUTSIDE: [&str; 2] = ["before_shift", "after_shift"];

impl Run {
    /// Reads what there is of a run: a folder, a table of shifts, or signals.
    pub(super) fn read(path: &Path) -> Result<Self, Error> {
        if path.is_dir() {
            return Self::read(&of_folder(path)?);
        }
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if name == OF_DEMO[0] {
            return Self::of_table(path, Some(path.with_file_name(OF_DEMO[1])).filter(|path| path.is_file()));
        }
        if let Some(stem) = name.strip_suffix(TABLE) {
            let signals = SIGNALS.map(|ending| path.with_file_name(format!("{stem}.{ending}")));
            return Self::of_table(path, signals.into_iter().find(|path| path.is_file()));
        }
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let beside = [format!("{stem}{TABLE}"), OF_DEMO[0].to_owned()].map(|name| path.with_file_name(name));
        let [of_estimate, of_demo] = beside;
        if of_estimate.is_file() {
            return Self::of_table(&of_estimate, Some(path.to_owned()));
        }
        if name == OF_DEMO[1] && of_demo.is_file() {
            return Self::of_table(&of_demo, Some(path.to_owned()));
        }
        Self::of_simulated(path)
    }

    /// A run with its table of shifts.
    fn of_table(path: &Path, signals: Option<PathBuf>) -> Result<Self, Error> {
        let mut rows = CsvRows::open(path)?;
        let names: Vec<String> = rows.names().map(str::to_owned).collect();
        let place = |name: &str| names.iter().position(|other| other == name);
        let words = ["from_gear", "to_gear", "offgoing", "oncoming", "worst_health"].map(place);
        let is_one_shift = place("load").is_some();
        let kind = if is_one_shift { place("load") } else { place("kind") };
        if words[0].is_none() || kind.is_none() {
            return Err(Error::Input(format!(
                "{}: this is no table of shifts\nhint: `estimate -o OUT.csv` writes one as OUT_shifts.csv",
                path.shown()
            )));
        }
        let of_words: Vec<usize> = words.into_iter().chain([kind]).flatten().collect();
        let mut shifts = Vec::new();
        while rows.advance_in_any_order()? {
            let word = |place: Option<usize>| place.map_or(String::new(), |at| rows.text(at).into_owned());
            let numbers = names.iter().enumerate().filter(|(at, _)| !of_words.contains(at));
            let numbers = numbers.filter_map(|(at, name)| Some((name.clone(), rows.number_or_none(at)?)));
            let values: Vec<(String, f64)> = numbers.filter(|(_, value)| value.is_finite()).collect();
            let [from, to, offgoing, oncoming, health] = words.map(word);
            let mut shift = ShiftOfRun {
                number: shifts.len() + 1,
                time_s: [rows.time_s(); 2],
                gears: [from, to],
                kind: word(kind),
                elements: [offgoing, oncoming],
                health,
                values,
            };
            shift.number = shift.value("number").map_or(shift.number, |number| number as usize);
            let begin_s = shift.time_s[0];
            let end_s = shift.value("end_s").or_else(|| shift.value("complete_s").map(|length_s| begin_s + length_s));
            shift.time_s[1] = end_s.filter(|end_s| *end_s > begin_s).unwrap_or(begin_s + UNKNOWN_S);
            shifts.push(shift);
        }
        shifts.sort_by(|a, b| a.time_s[0].total_cmp(&b.time_s[0]));
        Ok(Self { shifts, signals, is_one_shift: Some(is_one_shift) })
    }

    /// A simulated drive, whose signals show the shifts.
    fn of_simulated(path: &Path) -> Result<Self, Error> {
        let none = || {
            Error::Input(format!(
                "{}: there is no table of shifts beside it, and it is no simulated drive\n\
                 hint: `wetclutch estimate LOG --vehicle CAR -o OUT.csv` writes one as OUT_shifts.csv",
                path.shown()
            ))
        };
        let is_csv = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
        let mut rows = if is_csv || !path.exists() { CsvRows::open(path)? } else { return Err(none()) };
        let [gear, target, phase, offgoing, oncoming] =
            ["gear", "target_gear", "true_phase", "offgoing", "oncoming"].map(|name| rows.find(name));
        if phase.is_none() && (gear.is_none() || target.is_none()) {
            return Err(none());
        }
        let mut shifts: Vec<ShiftOfRun> = Vec::new();
        let mut open = false;
        while rows.advance_in_any_order()? {
            let word = |place: Option<usize>| place.map_or(String::new(), |at| rows.text(at).into_owned());
            let is_in_shift = match phase {
                Some(at) => !OUTSIDE.contains(&&*rows.text(at)),
                None => word(gear) != word(target),
            };
            let time_s = rows.time_s();
            if is_in_shift && !open {
                shifts.push(ShiftOfRun {
                    number: shifts.len() + 1,
                    time_s: [time_s; 2],
                    gears: [word(gear), word(target)],
                    kind: String::new(),
                    elements: [word(offgoing), word(oncoming)],
                    health: String::new(),
                    values: Vec::new(),
                });
            }
            // A shift ends with the first row behind it.
            if let Some(shift) = shifts.last_mut().filter(|_| is_in_shift || open) {
                shift.time_s[1] = time_s;
            }
            open = is_in_shift;
        }
        for shift in &mut shifts {
            shift.values.push(("complete_s".to_owned(), shift.time_s[1] - shift.time_s[0]));
        }
        Ok(Self { shifts, signals: Some(path.to_owned()), is_one_shift: Some(phase.is_some()) })
    }
}

/// The table of shifts of a folder, or its simulated drive.
fn of_folder(folder: &Path) -> Result<PathBuf, Error> {
    let entries = std::fs::read_dir(folder).map_err(|error| Error::Input(format!("{}: {error}", folder.shown())))?;
    let mut names: Vec<String> = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    names.sort();
    let mut tables: Vec<&String> = names.iter().filter(|name| name.ends_with(TABLE) || *name == OF_DEMO[0]).collect();
    // Estimates go before the simulated drive that they are of.
    let is_simulated =
        |name: &String| name.strip_suffix(TABLE).is_some_and(|stem| names.contains(&format!("{stem}_measured.csv")));
    if !tables.iter().all(|name| is_simulated(name)) {
        tables.retain(|name| !is_simulated(name));
    }
    let drives = names.iter().filter(|name| {
        let measured = name.strip_suffix(".csv").map(|stem| format!("{stem}_measured.csv"));
        *name == "trace.csv" || measured.is_some_and(|measured| names.contains(&measured))
    });
    let drives: Vec<&String> = drives.collect();
    match (&tables[..], &drives[..]) {
        ([one], _) | ([], [one]) => Ok(folder.join(one)),
        ([], []) => Err(Error::Input(format!(
            "{}: there is no table of shifts (*{TABLE}) and no simulated drive in this folder\nhint: compare what `estimate -o`, `demo` or `simulate` has written",
            folder.shown()
        ))),
        (several @ [_, ..], _) | (_, several) => Err(Error::Input(format!(
            "{}: there are {} runs in this folder: {}\nhint: name one of these files",
            folder.shown(),
            several.len(),
            several.iter().take(5).map(|name| trace::printable(name).into_owned()).collect::<Vec<_>>().join(", ")
        ))),
    }
}
