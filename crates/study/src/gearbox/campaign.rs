//! Studies of a car with any gearbox: many cars that differ from the known one, each on the same drive or through the same shifts.
//!
//! The study and the number of a run determine the run, so that runs can be made on any number of threads, stopped and resumed.

use std::fmt::Write;

use car::{Car, Drive, Sensors};
use car::{ElementErrors, ErrorBudget};
use config::{CarStudy, CarStudyRuns, SampledErrors};
use drivetrain::ShiftKind;
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarShift, simulate_car_drive};

use super::drive::DriveScorer;
use super::matrix::{
    CLASSES, ErrorsByPhase, Matrix, MatrixCounts, MatrixRow, MatrixShift, PhaseErrors, Random, class, counts,
    errors_by_phase, power_throttle,
};
use super::measured::SensedDrive;
use super::{EvaluateError, SAMPLE_S, ShiftDraw, SquaredErrors, score_shift};
use crate::StudyError;
use evaluate::mixed;

/// Names of the phases and clutches in the order of the errors.
const PHASES: [&str; 2] = ["torque_phase", "inertia_phase"];
const CLUTCHES: [&str; 2] = ["controlling", "other"];
/// What a row says of a clutch in a phase.
const ERRORS: [&str; 5] =
    ["rows", "torque_rms_n_m", "torque_open_loop_rms_n_m", "pressure_rms_pa", "pressure_open_loop_rms_pa"];
/// What a row says of a group of shifts.
const COUNTS: [&str; 10] = [
    "failed",
    "compared_phases",
    "phases_above_open_loop",
    "compared_shifts",
    "shifts_above_open_loop",
    "values",
    "outside_range",
    "without_range",
    "shift_rows",
    "say_slip",
];
/// Numbers of a group in a row.
const WIDTH: usize = 1 + PHASES.len() * CLUTCHES.len() * ERRORS.len() + COUNTS.len();

/// A kind of shift in a class of `1/|i_off - i_on|`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Group {
    kind: ShiftKind,
    class: usize,
}

/// A study made ready to run.
#[derive(Debug)]
pub struct CarCampaign {
    /// The study.
    pub study: CarStudy,
    sensors: Sensors,
    /// What filter and ranges know of the errors: of the vehicle file and the sensors.
    budget: ErrorBudget,
    /// What the cars are sampled from.
    sampled: ErrorBudget,
    groups: Vec<Group>,
}

/// One car of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct CarRow {
    /// Number of the run.
    pub run: u64,
    /// Seed of the car and of its sensors.
    pub seed: u64,
    /// Why it has no shifts, if the simulation failed.
    pub failure: Option<String>,
    /// For every group the number of shifts, the errors and the counts; not a number where there is none.
    numbers: Vec<f64>,
}

/// Sums over the shifts of a group.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    shifts: f64,
    errors: ErrorsByPhase,
    counts: MatrixCounts,
}

/// The budget with the bounds of a study in place of its own, where the study has them.
fn sampled_budget(budget: &ErrorBudget, errors: &SampledErrors) -> ErrorBudget {
    let mut sampled = budget.clone();
    let around = |relative: f64| [1.0 - relative, 1.0 + relative];
    for element in sampled.elements.iter_mut().flatten() {
        element.friction_factor = errors.friction.map_or(element.friction_factor, around);
        element.valve_gain_factor = errors.valve_gain.map_or(element.valve_gain_factor, around);
    }
    sampled.converter = errors.converter.unwrap_or(sampled.converter);
    sampled
}

impl CarCampaign {
    /// Makes a study ready; `sensors` are those of a study that names none.
    ///
    /// # Errors
    /// The gearbox has more clutches than the filter has room for, or the filter has tables for none of the shifts.
    pub fn new(study: CarStudy, sensors: &Sensors) -> Result<Self, StudyError> {
        let car = &study.car;
        let sensors = study.sensors.unwrap_or(*sensors);
        let budget = ErrorBudget::of_car(car).read_by(car, Some(&sensors));
        let tables = ShiftTables::of_car(car, &budget).map_err(EvaluateError::TooManyElements)?;
        let pairs: Vec<[usize; 2]> = match &study.what {
            CarStudyRuns::Shifts(pairs) => pairs.clone(),
            CarStudyRuns::Drive(_) => {
                let forward = car.gearbox.forward_gears();
                forward.windows(2).flat_map(|pair| [[pair[0], pair[1]], [pair[1], pair[0]]]).collect()
            }
        };
        if let Some([from, to]) = pairs.iter().find(|[from, to]| tables.tables().shift(*from, *to).is_none()) {
            let name = |gear: usize| car.gearbox.gears.get(gear).map_or("?", |gear| gear.name.as_str());
            if matches!(study.what, CarStudyRuns::Shifts(_)) {
                return Err(EvaluateError::NoTables(format!("{}-{}", name(*from), name(*to))).into());
            }
        }
        let gain = |[from, to]: &[usize; 2]| gain(car, *from, *to);
        let classes = (0..CLASSES.len()).filter(|&at| pairs.iter().any(|pair| class(gain(pair)) == at));
        let groups = classes.flat_map(|class| ShiftKind::ALL.map(|kind| Group { kind, class })).collect();
        let sampled = sampled_budget(&budget, &study.errors);
        Ok(Self { sensors, budget, sampled, groups, study })
    }

    /// The bounds within which the cars are sampled.
    pub fn sampled(&self) -> &ErrorBudget {
        &self.sampled
    }

    /// Where the sampled cars exceed the error bounds of the vehicle file, by which the ranges are made: a phrase for all elements
    /// with the same figures.
    pub fn exceeded(&self) -> Vec<String> {
        let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
        for (at, element) in self.study.car.gearbox.elements.iter().enumerate() {
            let (Some(bounds), Some(sampled)) = (self.budget.element(at), self.sampled.element(at)) else { continue };
            type Factor = fn(&ElementErrors) -> [f64; 2];
            let of: [(&str, Factor); 2] =
                [("friction", |element| element.friction_factor), ("valve gain", |element| element.valve_gain_factor)];
            for (what, of) in of {
                let ([low, high], [from, to]) = (of(bounds), of(sampled));
                if from >= low && to <= high {
                    continue;
                }
                let [from, to, low, high] = [from, to, low, high].map(config::significant);
                let figures = format!("{what} {from} to {to} (bounds {low} to {high})");
                match groups.iter_mut().find(|(other, _)| *other == figures) {
                    Some((_, names)) => names.push(&element.name),
                    None => groups.push((figures, vec![&element.name])),
                }
            }
        }
        let phrase = |(figures, names): &(String, Vec<&str>)| format!("{figures} of {}", names.join(", "));
        let mut exceeded: Vec<String> = groups.iter().map(phrase).collect();
        let (bound, sampled) = (self.budget.converter, self.sampled.converter);
        if sampled > bound && self.study.car.converter.is_some() {
            exceeded.push(format!("converter capacity +-{:.0} % (bound {:.0} %)", 100.0 * sampled, 100.0 * bound));
        }
        exceeded
    }

    /// The names of the columns.
    pub fn header(&self) -> Vec<String> {
        let mut names = ["run", "seed", "status"].map(str::to_owned).to_vec();
        for Group { kind, class } in &self.groups {
            let group = format!("{}.gain_from_{}", kind.name().replace([' ', '-'], "_"), CLASSES[*class]);
            names.push(format!("{group}.shifts"));
            for phase in PHASES {
                for clutch in CLUTCHES {
                    names.extend(ERRORS.map(|what| format!("{group}.{phase}.{clutch}.{what}")));
                }
            }
            names.extend(COUNTS.map(|what| format!("{group}.{what}")));
        }
        names
    }

    /// Makes a run. A simulation that fails is a row without shifts.
    ///
    /// # Errors
    /// None that a study file can cause.
    pub fn row(&self, run: u64) -> Result<CarRow, StudyError> {
        let seed = mixed(self.study.seed, run);
        let mut random = Random(seed);
        let known = &self.study.car;
        let truth = ShiftDraw::within(known, &self.sampled, || random.uniform()).car(known);
        let sensors = Sensors { seed, ..self.sensors };
        let sums = match &self.study.what {
            CarStudyRuns::Drive(drive) => self.driven(&truth, drive, &sensors),
            CarStudyRuns::Shifts(pairs) => self.shifted(&truth, pairs, &sensors),
        };
        Ok(match sums {
            Ok(sums) => CarRow { run, seed, failure: None, numbers: sums.iter().flat_map(numbers).collect() },
            Err(error) => {
                let numbers = vec![f64::NAN; self.groups.len() * WIDTH];
                CarRow { run, seed, failure: Some(error.to_string()), numbers }
            }
        })
    }

    fn driven(&self, truth: &Car, drive: &Drive, sensors: &Sensors) -> Result<Vec<Sums>, EvaluateError> {
        let known = &self.study.car;
        let tables = ShiftTables::of_car(known, &self.budget).map_err(EvaluateError::TooManyElements)?;
        let filter = gearbox_filter(known, &tables, &self.budget, Some(sensors));
        let model = CarModel::new(truth.clone())?;
        let mut sensed = SensedDrive::new(known, sensors, SAMPLE_S);
        let drive = Drive { sample_time_s: sensed.record_s(), ..drive.clone() };
        let mut scorer = DriveScorer::new(known, &model, &tables, &filter);
        simulate_car_drive(&model, known, CarCalibration::of(drive.controller), &drive, |sample| {
            sensed.each(sample, |row| scorer.push(&row.sample, &row.input(known, &tables)));
        })?;
        sensed.last(|row| scorer.push(&row.sample, &row.input(known, &tables)));
        let mut sums = vec![Sums::default(); self.groups.len()];
        for shift in scorer.finish().shifts {
            let gears = shift.gears.from.place().zip(shift.gears.to.place());
            let Some((kind, (from, to))) = shift.kind.zip(gears) else { continue };
            let errors = errors_by_phase(&shift.rows, kind);
            self.add(&mut sums, (from, to, kind), &errors, &counts(&shift.rows, &errors));
        }
        Ok(sums)
    }

    fn shifted(&self, truth: &Car, pairs: &[[usize; 2]], sensors: &Sensors) -> Result<Vec<Sums>, EvaluateError> {
        let known = &self.study.car;
        let mut sums = vec![Sums::default(); self.groups.len()];
        for (at, &[from, to]) in pairs.iter().enumerate() {
            for (power, throttle) in [power_throttle(), 0.0].into_iter().enumerate() {
                let ratio = |gear: usize| known.gearbox.gears.get(gear).map_or(f64::NAN, |gear| gear.ratio);
                let sign = if throttle > 0.0 { 1.0 } else { -1.0 };
                let Some(kind) = ShiftKind::of(sign, ratio(from), ratio(to)) else { continue };
                let shift = CarShift::usual(known, from, to, throttle);
                let seed = mixed(sensors.seed, (2 * at + power) as u64);
                let rows = score_shift(known, truth, &shift, sensors, seed)?;
                let errors = errors_by_phase(&rows, kind);
                self.add(&mut sums, (from, to, kind), &errors, &counts(&rows, &errors));
            }
        }
        Ok(sums)
    }

    fn add(
        &self,
        sums: &mut [Sums],
        (from, to, kind): (usize, usize, ShiftKind),
        errors: &ErrorsByPhase,
        counts: &MatrixCounts,
    ) {
        let group = Group { kind, class: class(gain(&self.study.car, from, to)) };
        let Some(at) = self.groups.iter().position(|other| *other == group) else { return };
        sums[at].shifts += 1.0;
        sums[at].counts.add(counts);
        for (sum, more) in sums[at].errors.iter_mut().flatten().zip(errors.iter().flatten()) {
            sum.add(more);
        }
    }

    /// The row of a line of the table.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn row_of_line(&self, run: u64, line: &str) -> Result<CarRow, String> {
        let mut cells = line.split(',');
        let mut next = || cells.next().ok_or_else(|| "the row has too few cells".to_owned());
        let (found, seed, status) = (next()?, next()?, next()?);
        if found.parse() != Ok(run) {
            return Err(format!(
                "expected run {run}, found `{found}`\nhint: the file is of another study or version, or was edited"
            ));
        }
        if seed.parse() != Ok(mixed(self.study.seed, run)) {
            return Err(format!("the seed of run {run} is another one\nhint: the file is of another study or version"));
        }
        let number = |cell: &str| {
            if cell.is_empty() { Ok(f64::NAN) } else { cell.parse().map_err(|_| format!("`{cell}` is no number")) }
        };
        let numbers = cells.map(number).collect::<Result<Vec<f64>, _>>()?;
        if numbers.len() != self.groups.len() * WIDTH {
            return Err(
                "the row has another number of cells\nhint: the file is of another study or version, or was edited"
                    .to_owned(),
            );
        }
        let failure = match status {
            "ok" => None,
            "failed" => Some(FAILED_BEFORE.to_owned()),
            other => return Err(format!("there is no status `{other}`\nhint: the file was edited")),
        };
        Ok(CarRow { run, seed: mixed(self.study.seed, run), failure, numbers })
    }

    /// The table of kinds over these rows, so far empty.
    pub fn summary(&self) -> CarSummary {
        CarSummary { sums: vec![Sums::default(); self.groups.len()], runs: 0, failed: 0, failure: None }
    }

    /// Adds a row to a summary.
    pub fn push(&self, summary: &mut CarSummary, row: &CarRow) {
        summary.runs += 1;
        if let Some(failure) = &row.failure {
            summary.failed += 1;
            summary.failure.get_or_insert_with(|| failure.clone());
            return;
        }
        for (sums, numbers) in summary.sums.iter_mut().zip(row.numbers.chunks_exact(WIDTH)) {
            sums.add_numbers(numbers);
        }
    }

    /// A summary as a matrix, with a row for each kind and class.
    pub fn matrix(&self, summary: &CarSummary) -> Matrix {
        let rows = self.groups.iter().zip(&summary.sums).filter(|(_, sums)| sums.shifts > 0.0).map(|(group, sums)| {
            let shift = MatrixShift { from: 0, to: 0, kind: group.kind, gain: CLASSES[group.class] };
            MatrixRow { shift, errors: sums.errors, counts: sums.counts, failure: None }
        });
        Matrix { rows: rows.collect(), without_tables: Vec::new(), draws: summary.runs }
    }
}

/// What a table says of a run that failed before it was resumed.
const FAILED_BEFORE: &str = "the simulation failed; a study with this run alone repeats it";

/// Sums over the cars of a study.
#[derive(Debug, Clone)]
pub struct CarSummary {
    sums: Vec<Sums>,
    /// Cars.
    pub runs: u64,
    /// Those whose simulation failed.
    pub failed: u64,
    /// Why the first of them did.
    pub failure: Option<String>,
}

impl CarSummary {
    /// Shifts of all cars.
    pub fn shifts(&self) -> u64 {
        self.sums.iter().map(|sums| sums.shifts).sum::<f64>() as u64
    }
}

impl CarRow {
    /// The row as the cells of a table.
    pub fn line(&self) -> String {
        let status = if self.failure.is_some() { "failed" } else { "ok" };
        let mut line = format!("{},{},{status}", self.run, self.seed);
        for value in &self.numbers {
            // Writing to a string cannot fail.
            let _ = if value.is_nan() { write!(line, ",") } else { write!(line, ",{value}") };
        }
        line
    }
}

/// `1/|i_off - i_on|` of a shift.
fn gain(car: &Car, from: usize, to: usize) -> f64 {
    let ratio = |gear: usize| car.gearbox.gears.get(gear).map_or(f64::NAN, |gear| gear.ratio);
    (ratio(from) - ratio(to)).abs().recip()
}

/// The numbers of a group in a row, in the order of the header.
fn numbers(sums: &Sums) -> [f64; WIDTH] {
    let errors = sums.errors.iter().flatten().flat_map(|PhaseErrors { torque, pressure }| {
        let [a, b] = torque.rms_n_m();
        let [c, d] = pressure.rms_pa();
        let or_none = |value: f64| if torque.rows > 0.0 { value } else { f64::NAN };
        [torque.rows, or_none(a), or_none(b), or_none(c), or_none(d)]
    });
    let n = &sums.counts;
    let phases_and_runs = [n.failed, n.compared, n.above, n.compared_runs, n.runs_above];
    let counts = phases_and_runs.into_iter().chain([n.values, n.outside, n.unranged, n.rows, n.slips_said]);
    let all = std::iter::once(sums.shifts).chain(errors).chain(counts.map(|count| count as f64));
    let mut numbers = [f64::NAN; WIDTH];
    numbers.iter_mut().zip(all).for_each(|(place, number)| *place = number);
    numbers
}

impl Sums {
    /// Adds what [`numbers`] made.
    fn add_numbers(&mut self, numbers: &[f64]) {
        let of_rms = |rows: f64, estimate: f64, open_loop: f64| SquaredErrors {
            estimate: if rows > 0.0 { rows * estimate * estimate } else { 0.0 },
            open_loop: if rows > 0.0 { rows * open_loop * open_loop } else { 0.0 },
            size: 0.0,
            rows,
        };
        let (errors, counts) = numbers[1..].split_at(PHASES.len() * CLUTCHES.len() * ERRORS.len());
        self.shifts += numbers[0];
        for (sum, of) in self.errors.iter_mut().flatten().zip(errors.chunks_exact(ERRORS.len())) {
            let torque = of_rms(of[0], of[1], of[2]);
            sum.add(&PhaseErrors { torque, pressure: of_rms(of[0], of[3], of[4]) });
        }
        let count = |at: usize| counts[at] as u64;
        self.counts.add(&MatrixCounts {
            failed: count(0),
            compared: count(1),
            above: count(2),
            compared_runs: count(3),
            runs_above: count(4),
            values: count(5),
            outside: count(6),
            unranged: count(7),
            rows: count(8),
            slips_said: count(9),
        });
    }
}
