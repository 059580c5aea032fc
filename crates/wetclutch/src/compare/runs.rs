//! Two runs over each other: their shifts matched, and how they differ.

use std::path::{Path, PathBuf};

use trace::ShownPath as _;
use trace::units::{key_ending, of_key};

use super::curves::{self, Curve, SIGNALS, ShiftCurves};
use super::run::{Run, ShiftOfRun};
use crate::Error;

/// How the shifts of two runs were matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Matching {
    /// By the times at which they begin, and their gears.
    Time,
    /// By gears and kind, in the order in which they come.
    Order,
}

/// What a quantity is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// What the driver feels, and how long the shift takes.
    Score,
    /// The errors of the estimates.
    Error,
    /// Widths of the ranges by the error budget.
    Range,
    /// The estimates themselves.
    Estimate,
}

impl Group {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Score => "score",
            Self::Error => "error",
            Self::Range => "range",
            Self::Estimate => "estimate",
        }
    }
}

/// Two runs over each other.
#[derive(Debug, Clone)]
pub struct RunComparison {
    /// The runs as they were named.
    pub paths: [PathBuf; 2],
    /// Shifts of each run.
    pub shifts: [usize; 2],
    /// How the shifts were matched.
    pub matching: Matching,
    /// The shifts of both runs, the largest difference first.
    pub pairs: Vec<ShiftPair>,
    /// The shifts of one run alone.
    pub only: [Vec<ShiftOfRun>; 2],
    /// Quantities over all pairs, the largest difference first.
    pub quantities: Vec<QuantityDifference>,
    /// Whether a run has no signals, so that no curves are compared.
    pub without_signals: Option<PathBuf>,
}

/// A shift of both runs.
#[derive(Debug, Clone)]
pub struct ShiftPair {
    /// The shift in each run.
    pub shifts: [ShiftOfRun; 2],
    /// How its quantities differ, the largest difference first.
    pub differences: Vec<Difference>,
    /// The signals of the shift in each run, in the order of [`SIGNALS`]; none without signals.
    pub curves: Option<[Box<[Curve; SIGNALS.len()]>; 2]>,
    /// RMS difference of each signal within the shift, in the unit of the signal.
    pub rms: [Option<f64>; SIGNALS.len()],
}

/// A quantity of a shift in both runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The name of its column, which ends in its unit.
    pub name: String,
    /// What it is of.
    pub group: Group,
    /// Its values, in SI.
    pub values: [f64; 2],
    /// The difference over the largest value of this quantity in both runs.
    pub size: f64,
}

/// A quantity over all shifts of both runs.
#[derive(Debug, Clone, PartialEq)]
pub struct QuantityDifference {
    /// The name of its column.
    pub name: String,
    /// What it is of.
    pub group: Group,
    /// Means over the shifts that have it in both runs, in SI.
    pub means: [f64; 2],
    /// Mean absolute difference.
    pub mean_absolute: f64,
    /// Number of the shift of the first run with the largest difference, and that difference.
    pub largest: (usize, f64),
    /// The shifts.
    pub count: usize,
    /// Mean size of the differences over all shifts, see [`Difference::size`].
    pub size: f64,
}

impl ShiftPair {
    /// The size of its largest difference.
    pub fn size(&self) -> f64 {
        self.differences.first().map_or(0.0, |difference| difference.size)
    }

    /// Kind and health where they differ.
    pub fn words(&self) -> Vec<(&'static str, [&str; 2])> {
        let [a, b] = &self.shifts;
        let pairs = [("kind", [&a.kind, &b.kind]), ("health", [&a.health, &b.health])];
        let differ = |(_, [a, b]): &(&str, [&String; 2])| a != b && !a.is_empty() && !b.is_empty();
        pairs.into_iter().filter(differ).map(|(what, both)| (what, both.map(String::as_str))).collect()
    }
}

/// Shifts that begin within this time of each other are the same, s.
const SAME_S: f64 = 0.5;
/// Columns that say what the occupants feel.
const SCORE: [&str; 14] = [
    "rating",
    "complete_s",
    "response_s",
    "torque_phase_s",
    "inertia_phase_s",
    "flare_rad_s",
    "past_synchronous_rad_s",
    "held_slip_rad_s",
    "tie_up_n_m",
    "tie_up_estimate_n_m",
    "jerk_m_s3",
    "acceleration_step_m_s2",
    "torque_hole_fraction",
    "vibration_dose_m_s1_75",
];
/// Fractions of samples within ranges, and the like.
const FRACTIONS: [&str; 5] =
    ["inside_range", "measured_pressure_inside_range", "pressure_inside_range", "torque_inside_range", "hidden_share"];
/// The size of a value that matters, by its unit: what is smaller counts as this.
const MATTERS: [(&str, f64); 9] = [
    ("s", 0.1),
    ("rad/s", 3.0),
    ("N m", 5.0),
    ("Pa", 1e4),
    ("J", 100.0),
    ("m/s^2", 0.2),
    ("m/s^3", 2.0),
    ("m/s^1.75", 0.2),
    ("", 0.1),
];

/// What a column is of; none of one that is not compared.
fn group(name: &str) -> Option<Group> {
    if SCORE.contains(&name) {
        return Some(Group::Score);
    }
    let is_error = ["rms_n_m", "rms_pa"].iter().any(|ending| name.ends_with(ending)) && !name.contains("open_loop");
    if is_error || FRACTIONS.contains(&name) {
        return Some(Group::Error);
    }
    let is_estimate = ["_mean_pa", "_mean_n_m", "friction_work_j"].iter().any(|ending| name.ends_with(ending));
    is_estimate.then_some(Group::Estimate)
}

/// The unit of a quantity by its name; empty without one.
pub fn unit_of(name: &str) -> &'static str {
    of_key(name).unwrap_or("")
}

/// A quantity in words: its name without the unit.
pub fn words_of(name: &str) -> String {
    const WORDS: [(&str, &str); 8] = [
        ("complete", "time"),
        ("past synchronous", "overshoot"),
        ("hidden share", "hidden"),
        ("acceleration step", "step"),
        ("torque hole fraction", "torque hole"),
        ("tie up", "tie-up"),
        ("tie up estimate", "tie-up by the estimate"),
        ("inside range", "in range"),
    ];
    let ending = key_ending(unit_of(name)).unwrap_or("");
    let words = name.strip_suffix(ending).unwrap_or(name).replace('_', " ");
    if let Some((phase, clutch)) = words.strip_suffix(" rms").and_then(|words| words.rsplit_once(' '))
        && ["controlling", "other"].contains(&clutch)
    {
        let what = if unit_of(name) == "Pa" { "pressure" } else { "torque" };
        return format!("{what} error, {clutch} clutch, {phase}");
    }
    let known = WORDS.iter().find(|(word, _)| *word == words);
    known.map_or(words, |(_, shown)| (*shown).to_owned())
}

/// The values of a shift that are compared: columns of its row, and the widths of its ranges.
fn values(shift: &ShiftOfRun) -> Vec<(String, Group, f64)> {
    let columns = shift.values.iter().filter_map(|(name, value)| Some((name.clone(), group(name)?, *value)));
    let mut values: Vec<_> = columns.collect();
    for role in ["offgoing", "oncoming"] {
        for (what, unit) in [("pressure", "pa"), ("torque", "n_m")] {
            let end = |end: &str| shift.value(&format!("{role}_{what}_mean_{end}_{unit}"));
            if let (Some(low), Some(high)) = (end("least"), end("greatest")) {
                values.push((format!("{role}_{what}_range_{unit}"), Group::Range, high - low));
            }
        }
    }
    if shift.value("complete_s").is_none() {
        values
            .extend(shift.value("end_s").map(|end_s| ("complete_s".to_owned(), Group::Score, end_s - shift.time_s[0])));
    }
    values
}

/// Compares two runs.
pub(super) fn compare(a: &Path, b: &Path) -> Result<RunComparison, Error> {
    let runs = [Run::read(a)?, Run::read(b)?];
    let paths = [a, b].map(Path::to_owned);
    let common = matched(&runs, &paths)?;
    let mut curves = [0, 1].map(|_| None);
    let without_signals = paths.iter().zip(&runs).find(|(_, run)| run.signals.is_none()).map(|(path, _)| path.clone());
    if without_signals.is_none() {
        for (curves, run) in curves.iter_mut().zip(&runs) {
            *curves = run.signals.as_deref().map(|path| curves::read(path, &run.shifts)).transpose()?;
        }
    }
    let matching = common.matching;
    let mut pairs: Vec<ShiftPair> = common.pairs.iter().map(|&places| pair(&runs, &curves, places)).collect();
    set_sizes(&mut pairs);
    let quantities = quantities(&pairs);
    pairs.sort_by(|a, b| b.size().total_cmp(&a.size()).then(a.shifts[0].number.cmp(&b.shifts[0].number)));
    let only = [0, 1].map(|run: usize| {
        let is_alone = |at: &usize| common.pairs.iter().all(|pair| pair[run] != *at);
        (0..runs[run].shifts.len()).filter(is_alone).map(|at| runs[run].shifts[at].clone()).collect()
    });
    let shifts = runs.each_ref().map(|run| run.shifts.len());
    Ok(RunComparison { paths, shifts, matching, pairs, only, quantities, without_signals })
}

/// Which shift of a run is which of the other.
struct Common {
    matching: Matching,
    pairs: Vec<[usize; 2]>,
}

fn matched(runs: &[Run; 2], paths: &[PathBuf; 2]) -> Result<Common, Error> {
    let [a, b] = runs;
    for (run, path) in runs.iter().zip(paths) {
        if run.shifts.is_empty() {
            return Err(Error::Input(format!(
                "{}: the run has no shift\nhint: a comparison is one of shifts; compare other runs",
                path.shown()
            )));
        }
    }
    let kind = |run: &Run| match run.is_one_shift {
        Some(true) => "a vehicle file of one shift",
        _ => "a car with a gearbox",
    };
    if kind(a) != kind(b) {
        return Err(Error::Input(format!(
            "{} is a run of {}, and {} one of {}\nhint: compare two runs of the same car",
            paths[0].shown(),
            kind(a),
            paths[1].shown(),
            kind(b)
        )));
    }
    let (by_time, by_order) = (by_time(&a.shifts, &b.shifts), by_order(&a.shifts, &b.shifts));
    let (matching, pairs) =
        if 2 * by_time.len() >= by_order.len() { (Matching::Time, by_time) } else { (Matching::Order, by_order) };
    if pairs.is_empty() {
        return Err(Error::Input(format!(
            "the runs have no shift in common: {} has {}, {} has {}\nhint: compare two runs of the same drive, or with the same shifts",
            paths[0].shown(),
            names(&a.shifts),
            paths[1].shown(),
            names(&b.shifts)
        )));
    }
    for &[at, other] in &pairs {
        let (ours, theirs) = (&a.shifts[at], &b.shifts[other]);
        let differ = ours.elements.iter().zip(&theirs.elements).any(|(a, b)| !a.is_empty() && !b.is_empty() && a != b);
        if differ {
            let elements = |shift: &ShiftOfRun| shift.elements.join(" and ");
            return Err(Error::Input(format!(
                "the runs are of cars with different gearboxes: the shift {} is one of {} in {}, and of {} in {}\nhint: compare two runs of the same car",
                ours.name(),
                elements(ours),
                paths[0].shown(),
                elements(theirs),
                paths[1].shown()
            )));
        }
    }
    Ok(Common { matching, pairs })
}

/// The gears of shifts, each once.
fn names(shifts: &[ShiftOfRun]) -> String {
    let mut names: Vec<String> = Vec::new();
    for shift in shifts {
        let name = [shift.name(), shift.kind.replace('_', " ")].join(" ").trim().to_owned();
        if !names.contains(&name) {
            names.push(name);
        }
    }
    const SHOWN: usize = 6;
    let more = if names.len() > SHOWN { ", and others" } else { "" };
    names.truncate(SHOWN);
    names.join(", ") + more
}

/// Whether both have the same gears, as far as they are known.
fn same_gears(a: &ShiftOfRun, b: &ShiftOfRun) -> bool {
    a.gears == b.gears || [a, b].iter().any(|shift| shift.gears[0].is_empty())
}

/// Shifts of the same gears that begin at about the same time.
fn by_time(a: &[ShiftOfRun], b: &[ShiftOfRun]) -> Vec<[usize; 2]> {
    let mut taken = vec![false; b.len()];
    let mut pairs = Vec::new();
    for (at, shift) in a.iter().enumerate() {
        let apart = |other: &ShiftOfRun| (other.time_s[0] - shift.time_s[0]).abs();
        let near =
            b.iter().enumerate().filter(|(other, of)| !taken[*other] && same_gears(shift, of) && apart(of) <= SAME_S);
        if let Some((other, _)) = near.min_by(|(_, a), (_, b)| apart(a).total_cmp(&apart(b))) {
            taken[other] = true;
            pairs.push([at, other]);
        }
    }
    pairs
}

/// The first of each gears and kind with the first of the same, and so on.
fn by_order(a: &[ShiftOfRun], b: &[ShiftOfRun]) -> Vec<[usize; 2]> {
    let is_same = |a: &ShiftOfRun, b: &ShiftOfRun| {
        same_gears(a, b) && (a.kind == b.kind || a.kind.is_empty() || b.kind.is_empty())
    };
    let mut taken = vec![false; b.len()];
    let mut pairs = Vec::new();
    for (at, shift) in a.iter().enumerate() {
        let next = b.iter().enumerate().position(|(other, of)| !taken[other] && is_same(shift, of));
        if let Some(other) = next {
            taken[other] = true;
            pairs.push([at, other]);
        }
    }
    pairs
}

fn pair(runs: &[Run; 2], curves: &[Option<Vec<ShiftCurves>>; 2], [at, other]: [usize; 2]) -> ShiftPair {
    let shifts = [runs[0].shifts[at].clone(), runs[1].shifts[other].clone()];
    let theirs = values(&shifts[1]);
    let differences = values(&shifts[0]).into_iter().filter_map(|(name, group, a)| {
        let (_, _, b) = theirs.iter().find(|(other, ..)| *other == name)?;
        Some(Difference { name, group, values: [a, *b], size: 0.0 })
    });
    let differences = differences.collect();
    let curves = match curves {
        [Some(ours), Some(theirs)] => Some([Box::new(ours[at].clone()), Box::new(theirs[other].clone())]),
        _ => None,
    };
    let length_s = shifts[0].time_s[1] - shifts[0].time_s[0];
    let rms = core::array::from_fn(|signal| {
        let [ours, theirs] = curves.as_ref()?;
        ours[signal].rms_difference(&theirs[signal], length_s)
    });
    ShiftPair { shifts, differences, curves, rms }
}

/// Gives each difference its size, and puts the largest of each shift first.
fn set_sizes(pairs: &mut [ShiftPair]) {
    let mut scales: Vec<(String, f64)> = Vec::new();
    for difference in pairs.iter().flat_map(|pair| &pair.differences) {
        let value = difference.values.iter().fold(0.0, |size: f64, value| size.max(value.abs()));
        match scales.iter_mut().find(|(name, _)| *name == difference.name) {
            Some((_, scale)) => *scale = scale.max(value),
            None => {
                let unit = unit_of(&difference.name);
                let floor = MATTERS.iter().find(|(of, _)| *of == unit).map_or(0.1, |(_, floor)| *floor);
                scales.push((difference.name.clone(), value.max(floor)));
            }
        }
    }
    for pair in pairs {
        for difference in &mut pair.differences {
            let scale = scales.iter().find(|(name, _)| *name == difference.name).map_or(1.0, |(_, scale)| *scale);
            difference.size = (difference.values[1] - difference.values[0]).abs() / scale;
        }
        pair.differences.sort_by(|a, b| b.size.total_cmp(&a.size));
    }
}

/// The quantities over all pairs, the largest difference first.
fn quantities(pairs: &[ShiftPair]) -> Vec<QuantityDifference> {
    let mut found: Vec<QuantityDifference> = Vec::new();
    for pair in pairs {
        for difference in &pair.differences {
            let by = difference.values[1] - difference.values[0];
            let at = found.iter().position(|quantity| quantity.name == difference.name).unwrap_or_else(|| {
                found.push(QuantityDifference {
                    name: difference.name.clone(),
                    group: difference.group,
                    means: [0.0; 2],
                    mean_absolute: 0.0,
                    largest: (pair.shifts[0].number, 0.0),
                    count: 0,
                    size: 0.0,
                });
                found.len() - 1
            });
            let quantity = &mut found[at];
            quantity.means = core::array::from_fn(|run| quantity.means[run] + difference.values[run]);
            quantity.mean_absolute += by.abs();
            quantity.size += difference.size;
            quantity.count += 1;
            if by.abs() > quantity.largest.1.abs() {
                quantity.largest = (pair.shifts[0].number, by);
            }
        }
    }
    for quantity in &mut found {
        let count = quantity.count as f64;
        quantity.means = quantity.means.map(|sum| sum / count);
        quantity.mean_absolute /= count;
        quantity.size /= pairs.len() as f64;
    }
    found.sort_by(|a, b| b.size.total_cmp(&a.size).then_with(|| a.name.cmp(&b.name)));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shift(number: usize, begin_s: f64, gears: &str, kind: &str) -> ShiftOfRun {
        let (from, to) = gears.split_once('-').unwrap();
        ShiftOfRun {
            number,
            time_s: [begin_s, begin_s + 1.0],
            gears: [from, to].map(str::to_owned),
            kind: kind.to_owned(),
            elements: [String::new(), String::new()],
            health: "good".to_owned(),
            values: Vec::new(),
        }
    }

    #[test]
    fn shifts_are_matched_by_time_and_else_by_their_order() {
        let a = [shift(1, 2.0, "1-2", "up"), shift(2, 9.0, "2-3", "up"), shift(3, 20.0, "1-2", "up")];
        let near = [shift(1, 9.2, "2-3", "up"), shift(2, 20.1, "1-2", "down")];
        assert_eq!(by_time(&a, &near), [[1, 0], [2, 1]]);
        let far = [shift(1, 40.0, "1-2", "up"), shift(2, 50.0, "2-3", "down"), shift(3, 60.0, "1-2", "up")];
        assert!(by_time(&a, &far).is_empty());
        assert_eq!(by_order(&a, &far), [[0, 0], [2, 2]]);
    }

    #[test]
    fn the_largest_difference_stands_first_and_what_is_small_has_no_size() {
        let with = |number, jerk: f64, flare: f64| ShiftOfRun {
            values: vec![("jerk_m_s3".to_owned(), jerk), ("flare_rad_s".to_owned(), flare)],
            ..shift(number, 0.0, "1-2", "up")
        };
        let of = |a: ShiftOfRun, b: ShiftOfRun| {
            let run = |shift| Run { shifts: vec![shift], signals: None, is_one_shift: None };
            pair(&[run(a), run(b)], &[None, None], [0, 0])
        };
        let mut pairs = [of(with(1, 8.0, 1e-17), with(1, 4.0, 9e-17)), of(with(2, 4.0, 0.0), with(2, 3.0, 0.0))];
        set_sizes(&mut pairs);
        assert_eq!(pairs.each_ref().map(ShiftPair::size), [0.5, 0.125]);
        assert!(pairs[0].differences[1].size < 1e-15);
        let quantities = quantities(&pairs);
        assert_eq!((quantities[0].name.as_str(), quantities[0].largest), ("jerk_m_s3", (1, -4.0)));
        assert_eq!((quantities[0].means, quantities[0].mean_absolute), ([6.0, 3.5], 2.5));
    }

    #[test]
    fn quantities_have_words_and_units() {
        for (name, words, unit) in [
            ("vibration_dose_m_s1_75", "vibration dose", "m/s^1.75"),
            ("complete_s", "time", "s"),
            ("oncoming_torque_range_n_m", "oncoming torque range", "N m"),
            ("inertia_phase_controlling_rms_n_m", "torque error, controlling clutch, inertia phase", "N m"),
            ("rating", "rating", ""),
        ] {
            assert_eq!((words_of(name).as_str(), unit_of(name)), (words, unit));
        }
    }
}
