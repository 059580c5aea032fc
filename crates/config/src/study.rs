//! The study file: an experiment, the factors that vary, and the plan of the runs.

mod experiments;
mod values;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use car::ObserverEntry;
use serde::Deserialize;
use toml::Spanned;

use crate::check::{Check, Number, Numbers};
use crate::tree::{Change, Tree};
use crate::{ConfigError, ExperimentFile, Kind, Source, VehicleFile};
use experiments::{changed_experiment, experiment_tree};

pub use values::{Sometimes, Values};

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
    /// The vehicle file: the simulated car, and the parameters of observers and shift controller.
    Vehicle,
    /// The experiment file.
    Experiment,
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
    /// How long before the shift request a run is recorded, s: in this time observers find the state of the driveline,
    /// and the scales and delays of the sensors.
    pub record_before_s: f64,
    /// What varies.
    pub factors: Vec<Factor>,
    /// The vehicle before any change.
    pub vehicle: Arc<VehicleFile>,
    /// The experiment before any change, with the study's observers.
    pub experiment: Arc<ExperimentFile>,
    /// The values of vehicle and experiment.
    trees: [Tree; 2],
}

/// A run of a study: the files with the factors' values in place. Their sources are the files before the change.
#[derive(Debug, Clone)]
pub struct Varied {
    /// The simulated car, before the experiment's `off_nominal` differences.
    pub car: Arc<VehicleFile>,
    /// The parameters of observers and shift controller.
    pub vehicle: Arc<VehicleFile>,
    /// The experiment.
    pub experiment: ExperimentFile,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawStudy {
    name: Spanned<String>,
    title: Spanned<String>,
    experiment: Spanned<String>,
    plan: Plan,
    runs: Option<Spanned<u64>>,
    #[serde(default)]
    seed: u64,
    record_before_s: Option<Number>,
    observers: Option<Spanned<Vec<Spanned<String>>>>,
    factor: Spanned<Vec<RawFactor>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawFactor {
    key: Spanned<String>,
    name: Option<Spanned<String>>,
    #[serde(default)]
    change: Change,
    values: Option<Numbers>,
    range: Option<Numbers>,
    log_range: Option<Numbers>,
    normal: Option<RawNormal>,
    levels: Option<Spanned<u32>>,
    chance: Option<Number>,
    otherwise: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawNormal {
    mean: Number,
    deviation: Number,
}

/// Measures of shift quality: columns of the table of runs, in its order.
pub const QUALITY: [&str; 7] = [
    "torque_phase_s",
    "inertia_phase_s",
    "flare_rad_s",
    "least_shaft_torque_n_m",
    "jerk_peak_m_s3",
    "vibration_dose_m_s1_75",
    "friction_work_j",
];

/// How long before the shift request a run is recorded, if the file does not say, s.
pub const RECORD_BEFORE_S: f64 = 1.2;
/// Most runs of a study.
const MAX_RUNS: u64 = 1_000_000_000;
/// Dimensions of the Sobol sequence. A Sobol plan takes one for each factor, a Saltelli plan two.
pub const SOBOL_DIMENSIONS: usize = 256;

impl Study {
    /// Reads and checks a study file, with the experiment and vehicle it names. Every factor is tried at both ends
    /// of its values.
    ///
    /// # Errors
    /// A file cannot be read, is no study file, or holds a value that cannot be right.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::read(path)?)
    }

    /// Checks the text of a study file; the files that it names are in its folder.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_source(source: Source) -> Result<Self, ConfigError> {
        let raw: RawStudy = source.parse_as(Kind::Study)?;
        let beside = |name: &str| source.path.parent().map_or_else(|| PathBuf::from(name), |folder| folder.join(name));
        let experiment = ExperimentFile::read(&beside(raw.experiment.get_ref()))
            .map_err(|error| error.named_by(&source, "experiment", raw.experiment.span().start))?;
        let vehicle = experiment.read_vehicle()?;
        Self::of(source, experiment, vehicle)
    }

    fn of(source: Source, mut experiment: ExperimentFile, vehicle: VehicleFile) -> Result<Self, ConfigError> {
        let raw: RawStudy = source.parse()?;
        let check = Check::of(&source);
        experiment.observers = observers(&check, &raw, std::mem::take(&mut experiment.observers))?;
        let factors = raw.factor.get_ref().iter().map(|raw| factor(&check, raw)).collect::<Result<Vec<_>, _>>()?;
        let at = raw.factor.span().start;
        if factors.is_empty() {
            let hint = Some(
                "add a table [[factor]], such as key = \"car.vehicle.mass_kg\", range = [1400.0, 1800.0]".to_owned(),
            );
            return Err(check.meaning("factor", at, "a study needs at least one factor".to_owned(), hint));
        }
        let of_observer = |name: &str| experiment.observers.iter().any(|o| name.starts_with(&(o.column() + ".")));
        let own =
            |name: &str| QUALITY.contains(&name) || ["run", "seed", "status"].contains(&name) || of_observer(name);
        if let Some(at) = factors.iter().position(|factor| own(&factor.name)) {
            let message = format!("`{}` is the name of another column in the table of runs", factors[at].name);
            let hint = "give the factor another `name`".to_owned();
            let place = raw.factor.get_ref()[at].key.span().start;
            return Err(check.meaning(&factors[at].key, place, message, Some(hint)));
        }
        if let Some(twice) = (1..factors.len()).find(|&i| factors[..i].iter().any(|f| f.name == factors[i].name)) {
            let message = format!("two factors have the name `{}`", factors[twice].name);
            let place = raw.factor.get_ref()[twice].key.span().start;
            return Err(check.meaning("factor", place, message, Some("give one of them a `name`".to_owned())));
        }
        let runs = runs(&check, &raw, &factors)?;
        enough_dimensions(&check, &raw)?;
        let trees = [Tree::of(&vehicle.source)?, experiment_tree(&experiment)?];
        experiment.scenarios.clear();
        let (vehicle, experiment) = (Arc::new(vehicle), Arc::new(experiment));
        let (plan, seed) = (raw.plan, raw.seed);
        let record_before_s = raw.record_before_s.as_ref();
        let record_before_s = record_before_s.map(|before| check.number("record_before_s", before, 0.1..=600.0));
        let study = Self {
            name: check.name("name", raw.name.get_ref(), raw.name.span().start)?,
            title: check.title("title", &raw.title)?,
            plan,
            runs,
            seed,
            record_before_s: record_before_s.unwrap_or(Ok(RECORD_BEFORE_S))?,
            factors,
            vehicle,
            experiment,
            trees,
            source,
        };
        study.try_every_factor(&raw)?;
        Ok(study)
    }

    /// Finds a factor with an unknown key, or with values out of range, before the first run.
    fn try_every_factor(&self, raw: &RawStudy) -> Result<(), ConfigError> {
        let check = Check::of(&self.source);
        for (i, factor) in self.factors.iter().enumerate() {
            for value in factor.values.trials() {
                self.with(&[(factor, value)]).map_err(|error| {
                    let place = raw.factor.get_ref()[i].key.span().start;
                    let what = error.what();
                    let (what, of_error) =
                        what.split_once("\nhint: ").map_or((what.as_str(), None), |(what, hint)| (what, Some(hint)));
                    let message = format!("the value {value} of the factor is refused: {what}");
                    let hint = "every value of a factor must be within the range of its key; a factor with \
                                `change = \"scale\"` multiplies the value of the file";
                    check.meaning(&factor.key, place, message, Some(of_error.unwrap_or(hint).to_owned()))
                })?;
            }
        }
        Ok(())
    }

    /// The files with these values of the factors, in their order.
    ///
    /// # Errors
    /// A value is outside the range of its key.
    pub fn varied(&self, values: &[f64]) -> Result<Varied, ConfigError> {
        let changes: Vec<(&Factor, f64)> = self.factors.iter().zip(values.iter().copied()).collect();
        self.with(&changes)
    }

    /// The files with these factors at these values, and all other values unchanged.
    fn with(&self, changes: &[(&Factor, f64)]) -> Result<Varied, ConfigError> {
        let of = |target| changes.iter().copied().filter(move |(factor, _)| factor.target == target);
        let [vehicle_tree, experiment_tree] = &self.trees;
        let source = &self.vehicle.source;
        let changed_vehicle = |changes: &mut dyn Iterator<Item = _>| {
            VehicleFile::from_tree(source, &changed(source, vehicle_tree, changes)?)
        };
        let vehicle = if of(Target::Vehicle).count() == 0 {
            Arc::clone(&self.vehicle)
        } else {
            Arc::new(changed_vehicle(&mut of(Target::Vehicle))?)
        };
        let car = if of(Target::Car).count() == 0 {
            Arc::clone(&vehicle)
        } else {
            Arc::new(changed_vehicle(&mut of(Target::Vehicle).chain(of(Target::Car)))?)
        };
        let experiment = changed_experiment(&self.experiment, experiment_tree, of(Target::Experiment))?;
        experiment.check_observers(&vehicle)?;
        Ok(Varied { car, vehicle, experiment })
    }

    /// Whether the parameters of the observers differ between runs.
    pub fn varies_vehicle(&self) -> bool {
        self.factors.iter().any(|factor| factor.target == Target::Vehicle)
    }

    /// SHA-256 of everything that determines the runs.
    pub fn fingerprint(&self) -> String {
        let text = [&self.source.text, &self.vehicle.source.text, &self.experiment.source.text];
        let text = text.map(String::as_str).join("\u{0}");
        Source { path: PathBuf::new(), text }.sha256()
    }
}

impl Factor {
    /// The name of the change in the study file.
    pub fn change_name(&self) -> &'static str {
        match self.change {
            Change::Set => "set",
            Change::Scale => "scale",
            Change::Add => "add",
        }
    }
}

/// The observers that the study names, of those of its experiment; all of these if it names none.
fn observers(
    check: &Check<'_>,
    raw: &RawStudy,
    of_experiment: Vec<ObserverEntry>,
) -> Result<Vec<ObserverEntry>, ConfigError> {
    if of_experiment.is_empty() {
        let message = "the experiment has no observer, but a study needs at least one".to_owned();
        let hint =
            "add a table [[observer]] to the experiment, such as name = \"open loop\", kind = \"open-loop\"".to_owned();
        return Err(check.meaning("experiment", raw.experiment.span().start, message, Some(hint)));
    }
    let Some(names) = &raw.observers else { return Ok(of_experiment) };
    let present: Vec<&str> = of_experiment.iter().map(|entry| entry.name.as_str()).collect();
    let wrong = |place: usize, message: String| {
        let hint = format!("the observers of the experiment are {}", present.join(", "));
        check.meaning("observers", place, message, Some(hint))
    };
    if names.get_ref().is_empty() {
        return Err(wrong(names.span().start, "a study needs at least one observer".to_owned()));
    }
    let mut chosen: Vec<ObserverEntry> = Vec::new();
    for name in names.get_ref() {
        let (name, place) = (name.get_ref(), name.span().start);
        let Some(entry) = of_experiment.iter().find(|entry| entry.name == *name) else {
            return Err(wrong(place, format!("the experiment has no observer `{name}`")));
        };
        if chosen.contains(entry) {
            return Err(wrong(place, format!("`{name}` is in the list twice")));
        }
        chosen.push(entry.clone());
    }
    Ok(chosen)
}

/// Each factor needs one dimension of the Sobol sequence, or two in a Saltelli plan.
fn enough_dimensions(check: &Check<'_>, raw: &RawStudy) -> Result<(), ConfigError> {
    let maximum = match raw.plan {
        Plan::Sobol => SOBOL_DIMENSIONS,
        Plan::Saltelli => SOBOL_DIMENSIONS / 2,
        Plan::FullFactorial | Plan::LatinHypercube | Plan::Random => return Ok(()),
    };
    let factors = raw.factor.get_ref();
    let Some(beyond) = factors.get(maximum) else { return Ok(()) };
    let message =
        format!("a {} plan has at most {maximum} factors, but the study has {}", raw.plan.name(), factors.len());
    let hint = "plan = \"latin-hypercube\" has no limit on the number of factors".to_owned();
    Err(check.meaning("factor", beyond.key.span().start, message, Some(hint)))
}

fn runs(check: &Check<'_>, raw: &RawStudy, factors: &[Factor]) -> Result<u64, ConfigError> {
    let meaning = |place: usize, message: String, hint: Option<String>| check.meaning("runs", place, message, hint);
    if raw.plan == Plan::FullFactorial {
        if let Some(runs) = &raw.runs {
            let message = "the number of runs of a full factorial plan follows from its levels".to_owned();
            return Err(meaning(runs.span().start, message, Some("remove `runs`".to_owned())));
        }
        let all = factors.iter().try_fold(1_u64, |n, f| n.checked_mul(f.values.levels() as u64));
        return all.filter(|&n| n <= MAX_RUNS).ok_or_else(|| {
            let message = format!("the levels have more than {MAX_RUNS} combinations");
            meaning(raw.factor.span().start, message, Some("use another plan, such as \"sobol\"".to_owned()))
        });
    }
    let Some(runs) = &raw.runs else {
        return Err(meaning(
            0,
            format!("the plan {} needs a number of runs", raw.plan.name()),
            Some("add `runs`, such as runs = 500".to_owned()),
        ));
    };
    let (place, runs) = (runs.span().start, *runs.get_ref());
    if runs == 0 || runs > MAX_RUNS {
        return Err(meaning(
            place,
            format!("{runs} is not between 1 and {MAX_RUNS}"),
            Some("some hundred runs show a distribution, such as runs = 500".to_owned()),
        ));
    }
    let group = factors.len() as u64 + 2;
    if raw.plan == Plan::Saltelli && !runs.is_multiple_of(group) {
        let message = format!("with {} factors a Saltelli plan has a multiple of {group} runs", factors.len());
        return Err(meaning(
            place,
            message,
            Some(format!("use {} or {} runs", runs / group * group, (runs / group + 1) * group)),
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
            let hint = "`car.` changes only the simulated car, `vehicle.` also the parameters of the observers, \
                        `experiment.` the experiment";
            return Err(meaning("the key of a factor must begin with `car.`, `vehicle.` or `experiment.`", Some(hint)));
        }
    };
    let Some(last) = path.last() else {
        return Err(meaning(
            "the key is a whole file, expected the key of a number",
            Some("such as car.vehicle.mass_kg"),
        ));
    };
    let values = values::values(check, key, place, raw)?;
    let (name, place) = raw.name.as_ref().map_or((last, place), |name| (name.get_ref(), name.span().start));
    let name = check.name("factor.name", name, place)?;
    if name.contains(',') {
        let message = "the name of a factor is also the name of its column, and must not contain a comma".to_owned();
        let hint = Some("use an underscore instead".to_owned());
        return Err(check.meaning("factor.name", place, message, hint));
    }
    Ok(Factor { name, key: key.clone(), target, path, change: raw.change, values })
}

/// The values of a file with changes.
fn changed<'a>(
    source: &Source,
    tree: &Tree,
    changes: impl Iterator<Item = (&'a Factor, f64)>,
) -> Result<Tree, ConfigError> {
    let mut tree = tree.clone();
    for (factor, value) in changes {
        tree.change(&factor.path, factor.change, value).map_err(|message| ConfigError::Meaning {
            path: source.path.clone(),
            line: 1,
            key: factor.path.join("."),
            message,
            hint: None,
        })?;
    }
    Ok(tree)
}
