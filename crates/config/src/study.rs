//! The study file: an experiment, what varies in it, and how the runs are chosen.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use toml::{Spanned, Table, Value};

use crate::check::{Check, Number, Numbers};
use crate::{ConfigError, Experiment, Source, Vehicle};

/// How the runs of a study are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Plan {
    /// Every combination of the factors' levels.
    FullFactorial,
    /// Each factor in as many layers as there are runs, one run in each.
    LatinHypercube,
    /// A scrambled Sobol sequence.
    Sobol,
    /// Independent random numbers.
    Random,
    /// Saltelli's arrangement of two samples, from which first-order and total Sobol indices follow. It takes
    /// `n (factors + 2)` runs.
    Saltelli,
}

impl Plan {
    /// As the study file writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::FullFactorial => "full-factorial",
            Self::LatinHypercube => "latin-hypercube",
            Self::Sobol => "sobol",
            Self::Random => "random",
            Self::Saltelli => "saltelli",
        }
    }
}

/// Whose parameter a factor changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// The simulated car alone: its observers, their gains and its shift controller are those of the vehicle file.
    Car,
    /// The vehicle file: the simulated car, and what observers and shift controller are told.
    Vehicle,
    /// The experiment file.
    Experiment,
}

/// What a factor does to the value in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Change {
    /// Replaces it.
    #[default]
    Set,
    /// Multiplies it; every number of a list.
    Scale,
    /// Adds to it; to every number of a list.
    Add,
}

/// The values that a factor takes.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// One of these, each as often as the others.
    List(Vec<f64>),
    /// Any in this range, all alike; the number of levels in a full factorial plan.
    Uniform(f64, f64, usize),
    /// Any in this range, all alike on a logarithmic scale; the number of levels.
    LogUniform(f64, f64, usize),
    /// Normally distributed with this mean and standard deviation, cut off at three deviations; the number of
    /// levels.
    Normal(f64, f64, usize),
}

/// What varies.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// Its name in tables.
    pub name: String,
    /// What it changes, as the study file writes it.
    pub key: String,
    /// Whose parameter it is.
    pub target: Target,
    path: Vec<String>,
    change: Change,
    /// The values it takes.
    pub values: Values,
}

/// A study: an experiment with factors.
#[derive(Debug, Clone)]
pub struct Study {
    /// The file.
    pub source: Source,
    /// Short name.
    pub name: String,
    /// Title for people.
    pub title: String,
    /// How the runs are chosen.
    pub plan: Plan,
    /// Number of runs.
    pub runs: u64,
    /// Seed of the plan and of every run's sensors.
    pub seed: u64,
    /// What varies.
    pub factors: Vec<Factor>,
    /// The vehicle before any change.
    pub vehicle: Arc<Vehicle>,
    /// The experiment before any change, with the study's observers.
    pub experiment: Arc<Experiment>,
    tables: [Table; 2],
}

/// A run of a study: the files with the factors' values in place.
#[derive(Debug, Clone)]
pub struct Varied {
    /// The simulated car, before the experiment's `off_nominal` differences.
    pub car: Arc<Vehicle>,
    /// What observers and shift controller are told.
    pub vehicle: Arc<Vehicle>,
    /// The experiment.
    pub experiment: Experiment,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStudy {
    name: String,
    title: String,
    experiment: Spanned<String>,
    plan: Plan,
    runs: Option<Spanned<u64>>,
    #[serde(default)]
    seed: u64,
    observers: Option<Vec<Spanned<String>>>,
    factor: Spanned<Vec<RawFactor>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFactor {
    key: Spanned<String>,
    name: Option<String>,
    #[serde(default)]
    change: Change,
    values: Option<Numbers>,
    range: Option<Numbers>,
    log_range: Option<Numbers>,
    normal: Option<RawNormal>,
    levels: Option<Spanned<u32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawNormal {
    mean: Number,
    deviation: Number,
}

/// What a calibrator asks of the shift: columns of the table of runs, in its order.
pub const QUALITY: [&str; 7] = [
    "torque_phase_s",
    "inertia_phase_s",
    "flare_rad_s",
    "least_shaft_torque_n_m",
    "jerk_peak_m_s3",
    "vibration_dose_m_s175",
    "friction_work_j",
];

/// Levels of a range in a full factorial plan, if the file does not say.
const LEVELS: usize = 3;
/// Most runs of a study.
const MOST_RUNS: u64 = 1_000_000_000;

impl Study {
    /// Reads and checks a study file, with the experiment and vehicle it names. Every factor is tried at both ends
    /// of its values.
    ///
    /// # Errors
    /// A file cannot be read, is no study file, or holds a value that cannot be right.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let source = Source::read(path)?;
        let raw: RawStudy = source.parse()?;
        let check = Check { source: &source };
        let beside = |name: &str| source.path.parent().map_or_else(|| PathBuf::from(name), |folder| folder.join(name));
        let mut experiment = Experiment::read(&beside(raw.experiment.get_ref()))?;
        let vehicle = Vehicle::read(&experiment.vehicle_path())?;
        if let Some(names) = &raw.observers {
            experiment.observers = (names.iter())
                .map(|name| {
                    let found = experiment.observers.iter().find(|entry| entry.name == *name.get_ref()).cloned();
                    found.ok_or_else(|| {
                        let present: Vec<&str> = experiment.observers.iter().map(|e| e.name.as_str()).collect();
                        let message = format!("the experiment has no observer `{}`", name.get_ref());
                        let hint = format!("its observers are {}", present.join(", "));
                        check.meaning("observers", name.span().start, message, Some(hint))
                    })
                })
                .collect::<Result<_, _>>()?;
        }
        let factors = raw.factor.get_ref().iter().map(|raw| factor(&check, raw)).collect::<Result<Vec<_>, _>>()?;
        let at = raw.factor.span().start;
        if factors.is_empty() {
            return Err(check.meaning("factor", at, "a study needs at least one factor".to_owned(), None));
        }
        let own = |name: &str| QUALITY.contains(&name) || ["run", "seed", "status"].contains(&name);
        if let Some(at) = factors.iter().position(|factor| own(&factor.name)) {
            let message = format!("a column of the table of runs is called `{}`", factors[at].name);
            let hint = "give the factor a `name` of its own".to_owned();
            let place = raw.factor.get_ref()[at].key.span().start;
            return Err(check.meaning(&factors[at].key, place, message, Some(hint)));
        }
        if let Some(twice) = (1..factors.len()).find(|&i| factors[..i].iter().any(|f| f.name == factors[i].name)) {
            let message = format!("two factors are called `{}`", factors[twice].name);
            let place = raw.factor.get_ref()[twice].key.span().start;
            return Err(check.meaning("factor", place, message, Some("give one of them a `name`".to_owned())));
        }
        let runs = runs(&check, &raw, &factors)?;
        let vehicle_table = vehicle.source.parse()?;
        let mut experiment_table: Table = experiment.source.parse()?;
        // Every run reads its files anew; what no run needs costs time.
        experiment.scenarios.clear();
        for unused in ["scenario", "observer"] {
            experiment_table.remove(unused);
        }
        let tables = [vehicle_table, experiment_table];
        let (vehicle, experiment) = (Arc::new(vehicle), Arc::new(experiment));
        let (plan, seed) = (raw.plan, raw.seed);
        let study = Self {
            name: raw.name.clone(),
            title: raw.title.clone(),
            plan,
            runs,
            seed,
            factors,
            vehicle,
            experiment,
            tables,
            source,
        };
        study.try_every_factor(&raw)?;
        Ok(study)
    }

    /// A factor that names nothing, or leads to a value out of range, should not come to light in run 1234.
    fn try_every_factor(&self, raw: &RawStudy) -> Result<(), ConfigError> {
        let check = Check { source: &self.source };
        for (i, factor) in self.factors.iter().enumerate() {
            for value in factor.values.ends() {
                self.with(&[(factor, value)]).map_err(|error| {
                    let place = raw.factor.get_ref()[i].key.span().start;
                    check.meaning(&factor.key, place, format!("does not work with {value}: {}", error.what()), None)
                })?;
            }
        }
        Ok(())
    }

    /// The files with these values of the factors, in their order.
    ///
    /// # Errors
    /// A value leads out of the range of its key.
    pub fn varied(&self, values: &[f64]) -> Result<Varied, ConfigError> {
        let changes: Vec<(&Factor, f64)> = self.factors.iter().zip(values.iter().copied()).collect();
        self.with(&changes)
    }

    /// The files with these factors at these values, the others as they stand in the files.
    fn with(&self, changes: &[(&Factor, f64)]) -> Result<Varied, ConfigError> {
        let of = |target| changes.iter().copied().filter(move |(factor, _)| factor.target == target);
        let [vehicle_table, experiment_table] = &self.tables;
        let vehicle = if of(Target::Vehicle).count() == 0 {
            Arc::clone(&self.vehicle)
        } else {
            Arc::new(Vehicle::from_source(changed(&self.vehicle.source, vehicle_table, of(Target::Vehicle))?)?)
        };
        let car = if of(Target::Car).count() == 0 {
            Arc::clone(&vehicle)
        } else {
            let both = of(Target::Vehicle).chain(of(Target::Car));
            Arc::new(Vehicle::from_source(changed(&self.vehicle.source, vehicle_table, both)?)?)
        };
        let experiment = if of(Target::Experiment).count() == 0 {
            Experiment::clone(&self.experiment)
        } else {
            let source = changed(&self.experiment.source, experiment_table, of(Target::Experiment))?;
            let observers = self.experiment.observers.clone();
            let sensors_told = self.experiment.sensors_told;
            Experiment { observers, sensors_told, ..Experiment::from_source(source)? }
        };
        Ok(Varied { car, vehicle, experiment })
    }

    /// Whether the observers are told different things in different runs.
    pub fn varies_vehicle(&self) -> bool {
        self.factors.iter().any(|factor| factor.target == Target::Vehicle)
    }

    /// SHA-256 of everything that the runs follow from.
    pub fn fingerprint(&self) -> String {
        let text = [&self.source.text, &self.vehicle.source.text, &self.experiment.source.text];
        let text = text.map(String::as_str).join("\u{0}");
        Source { path: PathBuf::new(), text }.sha256()
    }
}

impl Factor {
    /// What it does to the value in the file, as the study file writes it.
    pub fn change_name(&self) -> &'static str {
        match self.change {
            Change::Set => "set",
            Change::Scale => "scale",
            Change::Add => "add",
        }
    }
}

impl Values {
    /// Smallest and largest value.
    pub fn ends(&self) -> [f64; 2] {
        match self {
            Self::List(values) => {
                values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], &v| [lo.min(v), hi.max(v)])
            }
            Self::Uniform(low, high, _) | Self::LogUniform(low, high, _) => [*low, *high],
            Self::Normal(mean, deviation, _) => [mean - 3.0 * deviation, mean + 3.0 * deviation],
        }
    }

    /// Number of levels in a full factorial plan.
    pub fn levels(&self) -> usize {
        match self {
            Self::List(values) => values.len(),
            Self::Uniform(.., levels) | Self::LogUniform(.., levels) | Self::Normal(.., levels) => *levels,
        }
    }
}

fn runs(check: &Check<'_>, raw: &RawStudy, factors: &[Factor]) -> Result<u64, ConfigError> {
    let meaning = |place: usize, message: String, hint: Option<String>| check.meaning("runs", place, message, hint);
    if raw.plan == Plan::FullFactorial {
        if let Some(runs) = &raw.runs {
            let message = "a full factorial plan has as many runs as its levels have combinations".to_owned();
            return Err(meaning(runs.span().start, message, Some("leave `runs` out".to_owned())));
        }
        let all = factors.iter().try_fold(1_u64, |n, f| n.checked_mul(f.values.levels() as u64));
        return all.filter(|&n| n <= MOST_RUNS).ok_or_else(|| {
            let message = format!("the levels have more than {MOST_RUNS} combinations");
            meaning(raw.factor.span().start, message, Some("use another plan, such as \"sobol\"".to_owned()))
        });
    }
    let Some(runs) = &raw.runs else {
        return Err(meaning(0, format!("the plan {} needs a number of runs", raw.plan.name()), None));
    };
    let (place, runs) = (runs.span().start, *runs.get_ref());
    if runs == 0 || runs > MOST_RUNS {
        return Err(meaning(place, format!("{runs} is not between 1 and {MOST_RUNS}"), None));
    }
    let group = factors.len() as u64 + 2;
    if raw.plan == Plan::Saltelli && !runs.is_multiple_of(group) {
        let message = format!("with {} factors a Saltelli plan has a multiple of {group} runs", factors.len());
        return Err(meaning(
            place,
            message,
            Some(format!("{} or {}", runs / group * group, (runs / group + 1) * group)),
        ));
    }
    Ok(runs)
}

fn factor(check: &Check<'_>, raw: &RawFactor) -> Result<Factor, ConfigError> {
    let key = raw.key.get_ref();
    let place = raw.key.span().start;
    let meaning =
        |message: &str, hint: Option<&str>| check.meaning(key, place, message.to_owned(), hint.map(str::to_owned));
    let mut path: Vec<String> = key.split('.').map(str::to_owned).collect();
    let target = match path.remove(0).as_str() {
        "car" => Target::Car,
        "vehicle" => Target::Vehicle,
        "experiment" => Target::Experiment,
        _ => {
            let hint = "`car.` changes the simulated car alone, `vehicle.` what the observers are told too, \
                        `experiment.` the experiment";
            return Err(meaning("a factor's key begins with `car.`, `vehicle.` or `experiment.`", Some(hint)));
        }
    };
    let Some(last) = path.last() else { return Err(meaning("the key names a whole file", None)) };
    let levels = match &raw.levels {
        None => LEVELS,
        Some(levels) if (2..=1000).contains(levels.get_ref()) => *levels.get_ref() as usize,
        Some(_) => return Err(meaning("`levels` must be 2 to 1000", None)),
    };
    let all = f64::MIN..=f64::MAX;
    let pair = |name: &str, numbers: &Numbers| -> Result<(f64, f64), ConfigError> {
        match *check.numbers(name, numbers, all.clone())? {
            [low, high] if low < high => Ok((low, high)),
            _ => Err(check.meaning(key, numbers.span().start, format!("`{name}` is two rising numbers"), None)),
        }
    };
    let values = match (&raw.values, &raw.range, &raw.log_range, &raw.normal) {
        (Some(list), None, None, None) if !list.get_ref().is_empty() => {
            Values::List(check.numbers("values", list, all)?.to_vec())
        }
        (None, Some(range), None, None) => {
            pair("range", range).map(|(low, high)| Values::Uniform(low, high, levels))?
        }
        (None, None, Some(range), None) => match pair("log_range", range)? {
            (low, high) if low > 0.0 => Values::LogUniform(low, high, levels),
            _ => return Err(meaning("`log_range` must be above 0", None)),
        },
        (None, None, None, Some(normal)) => {
            let mean = check.number("normal.mean", &normal.mean, all)?;
            let deviation = check.number("normal.deviation", &normal.deviation, 0.0..=f64::MAX)?;
            Values::Normal(mean, deviation, levels)
        }
        _ => {
            let message = "a factor has one of `values`, `range`, `log_range` and `normal`";
            return Err(meaning(message, Some("for example range = [0.8, 1.2]")));
        }
    };
    let name = raw.name.clone().unwrap_or_else(|| last.clone());
    Ok(Factor { name, key: key.clone(), target, path, change: raw.change, values })
}

/// The text of a file with changed values.
fn changed<'a>(
    source: &Source,
    table: &Table,
    changes: impl Iterator<Item = (&'a Factor, f64)>,
) -> Result<Source, ConfigError> {
    let mut root = table.clone();
    for (factor, value) in changes {
        place_in_table(&mut root, &factor.path, factor.change, value).map_err(|message| ConfigError::Meaning {
            path: source.path.clone(),
            line: 1,
            key: factor.path.join("."),
            message,
            hint: None,
        })?;
    }
    Ok(Source { path: source.path.clone(), text: root.to_string() })
}

/// Changes the value that a path leads to. On the way missing tables are made: what must not be there is refused
/// when the file is checked.
fn place_in_table(table: &mut Table, path: &[String], change: Change, value: f64) -> Result<(), String> {
    let Some((step, rest)) = path.split_first() else { return Err("that is a whole table".to_owned()) };
    let is_last = rest.is_empty();
    if is_last && change != Change::Set && !table.contains_key(step) {
        return Err("there is no value to change; use `change = \"set\"`".to_owned());
    }
    let missing = || if is_last { Value::Float(value) } else { Value::Table(Table::new()) };
    place(table.entry(step.clone()).or_insert_with(missing), rest, change, value)
}

fn place(at: &mut Value, path: &[String], change: Change, value: f64) -> Result<(), String> {
    let Some((step, rest)) = path.split_first() else { return apply(at, change, value) };
    match at {
        Value::Table(table) => place_in_table(table, path, change, value),
        Value::Array(list) => {
            let named = |item: &Value| item.get("name").and_then(Value::as_str) == Some(step.as_str());
            let found = list.iter().position(named).or_else(|| step.parse().ok().filter(|&i: &usize| i < list.len()));
            let index = found.ok_or_else(|| format!("the list has no item `{step}`; items count from 0"))?;
            place(&mut list[index], rest, change, value)
        }
        _ => Err(format!("there is no `{step}`: what stands there is a single value")),
    }
}

fn apply(at: &mut Value, change: Change, value: f64) -> Result<(), String> {
    let new = |old: f64| match change {
        Change::Set => value,
        Change::Scale => old * value,
        Change::Add => old + value,
    };
    match at {
        Value::Float(old) => *old = new(*old),
        #[expect(clippy::cast_precision_loss, reason = "a number that a person wrote")]
        Value::Integer(old) => *at = Value::Float(new(*old as f64)),
        Value::Array(list) if change != Change::Set => {
            return list.iter_mut().try_for_each(|item| apply(item, change, value));
        }
        Value::Array(_) => return Err("a list cannot be set to a number; use `change = \"scale\"`".to_owned()),
        _ => return Err("that is no number".to_owned()),
    }
    Ok(())
}
