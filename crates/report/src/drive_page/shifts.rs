//! The table of the shifts of a drive, for the page, the terminal and files.

use car::Car;
use observer::Health;
use study::gearbox::drive::{ScoredDrive, ScoredShift};
use study::gearbox::matrix::{ErrorsByPhase, controlling_of};
use study::gearbox::shift_comfort::ShiftComfort;
use study::gearbox::{SquaredErrors, TruePhase};
use trace::Cell;
use trace::shown_units::convert_table;

use super::{clutch_names, kind_name, phase_s};
use crate::matrix_page::{ratio, torques};
use crate::tables::{coverage, health_meaning, number};

/// A column of the table of shifts.
pub(super) struct Column {
    pub(super) title: &'static str,
    /// What it holds, for those who have not met it.
    pub(super) meaning: &'static str,
    cell: fn(&ScoredShift, &Car) -> String,
    /// Whether pages alone show it: a terminal has less room.
    is_of_pages: bool,
}

const fn column(title: &'static str, meaning: &'static str, cell: fn(&ScoredShift, &Car) -> String) -> Column {
    Column { title, meaning, cell, is_of_pages: false }
}

/// A column of what the occupants feel.
const fn felt(title: &'static str, meaning: &'static str, cell: fn(&ScoredShift, &Car) -> String) -> Column {
    Column { is_of_pages: true, ..column(title, meaning, cell) }
}

/// RMS errors of filter and open loop.
const ERRORS: &str = "RMS errors of filter / open loop";
const COLUMNS: &[Column] = &[
    column("#", "number of the shift", |s, _| s.number.to_string()),
    column("shift", "old and new gear", |shift, car| car.shift_name(shift.gears)),
    column("kind", "direction, and who drives: with power the engine, coasting the car", |s, _| {
        kind_name(s).unwrap_or("–").to_owned()
    }),
    column("begin s", "time of the request", |s, _| number(s.time_s[0], 2)),
    column("time s", "from the request until the shift is complete", |s, _| {
        number(s.quality.complete_s.unwrap_or(f64::NAN), 2)
    }),
    column(
        "rating",
        "10 is the best and 1 the lowest; 7 is a shift that is just accepted in vibration dose, jerk, step, torque hole, time and flare",
        |s, _| {
            let rating = s.comfort.as_ref().and_then(|comfort| comfort.rating(&s.quality));
            rating.map_or(String::new(), |rating| number(rating, 1))
        },
    ),
    felt("response s", "from the request to the first slip of the old gear", |s, _| {
        comfort(s, |felt| number(felt.response_s, 2))
    }),
    column("torque phase s", "one clutch holds and the other carries torque while it slips", |s, car| {
        // The ratios do not say when a clutch begins to carry.
        let is_known = !car.gearbox.has_ratios_alone();
        if is_known { number(phase_s(s, TruePhase::Torque), 2) } else { String::new() }
    }),
    column("inertia phase s", "both clutches slip", |s, _| number(phase_s(s, TruePhase::Inertia), 2)),
    column("flare rad/s", "largest slip of the old gear in the wrong direction, at the turbine", |s, _| {
        number(s.quality.flare_rad_s, 1)
    }),
    column("overshoot rad/s", "largest slip of the turbine beyond the synchronous speed of the new gear", |s, _| {
        number(s.quality.past_synchronous_rad_s, 1)
    }),
    felt(
        "step m/s^2",
        "how far the acceleration of the car, averaged over 50 ms, lies beyond those before and after the shift, at most",
        |s, _| comfort(s, |felt| number(felt.step_m_s2(), 2)),
    ),
    felt(
        "torque hole",
        "how deep the acceleration falls below those before and after the shift, at most, relative to that before",
        |s, _| comfort(s, |felt| format!("{} %", number(100.0 * felt.hole, 0))),
    ),
    felt(
        "vibration dose m/s^1.75",
        "vibration dose value of the acceleration from the request to 0.5 s after the end, weighted by ISO 2631-1",
        |s, _| comfort(s, |felt| number(felt.vibration_dose_m_s1_75, 2)),
    ),
    felt("jerk m/s^3", "maximum jerk of the car, from parabolas over 0.3 s of its speed", |s, _| {
        if s.quality.jerk_m_s3.is_nan() { String::new() } else { number(s.quality.jerk_m_s3, 1) }
    }),
    column(
        "tie-up N m",
        "largest torque with which both clutches work against each other, at the turbine, by the estimate",
        |s, _| {
            if s.summary.tie_up_n_m.is_nan() { String::new() } else { number(s.summary.tie_up_n_m, 0) }
        },
    ),
    column(
        "friction work kJ",
        "torque times slip of both clutches over the shift by the estimate; in brackets by the ends of the range by the error budget",
        |s, _| friction_work(s).map_or(String::new(), |work| ranged(&work, 1e-3, 1)),
    ),
    column("inertia phase", "error of the controlling clutch's torque over that of the open loop", |s, _| {
        scored(s, |[_, [inertia, _]]| ratio(&inertia.torque))
    }),
    column("N m", ERRORS, |s, _| scored(s, |[_, [inertia, _]]| torques(&inertia.torque))),
    column("torque phase", "error of the controlling clutch's torque over that of the open loop", |s, _| {
        scored(s, |[[torque, _], _]| ratio(&torque.torque))
    }),
    column("N m", ERRORS, |s, _| scored(s, |[[torque, _], _]| torques(&torque.torque))),
    column("other, inertia", "the same of the other clutch in the inertia phase", |s, _| {
        scored(s, |[_, [_, other]]| ratio(&other.torque))
    }),
    column(
        "in range",
        "fraction of the true pressures and torques of both clutches within their ranges by the error budget",
        |s, _| {
            if s.has_truth() { s.inside().map_or(String::new(), coverage) } else { String::new() }
        },
    ),
    column(
        "pressure kPa",
        "RMS errors of filter / open loop against measured pressures, both phases, both clutches",
        |s, _| {
            measured(s, |errors| {
                let [filter, open_loop] = errors.rms_pa();
                format!("{} / {}", number(1e-3 * filter, 1), number(1e-3 * open_loop, 1))
            })
        },
    ),
    column(
        "pressures in range",
        "fraction of the measured pressures within their ranges by the error budget",
        |s, _| {
            let [all, inside] = s.summary.pressures;
            let fraction = inside as f64 / all as f64;
            if all > 0 { coverage(fraction) } else { String::new() }
        },
    ),
    column("controlling", "the clutch that drives the inertia phase", |s, car| {
        unscored(s, |s| Some(clutch_names(s, car)[controlling_of(&s.rows, s.kind?)].to_owned()))
    }),
    column(
        "pressure MPa",
        "of the controlling clutch, mean of the inertia phase; in brackets of its range by the error budget",
        |s, _| unscored(s, |s| Some(ranged(&s.mean_pressure_pa(controlling_of(&s.rows, s.kind?))?, 1e-6, 3))),
    ),
    column(
        "torque N m",
        "of the controlling clutch, mean of the inertia phase; in brackets of its range by the error budget",
        |s, _| unscored(s, |s| Some(ranged(&s.mean_torque_n_m(controlling_of(&s.rows, s.kind?))?, 1.0, 0))),
    ),
    column(
        "at the turbine N m",
        "torque of all clutches together at the turbine, mean of the inertia phase; in brackets its standard deviation",
        |s, _| {
            unscored(s, |s| {
                s.mean_at_turbine_n_m().map(|[mean, sd]| format!("{} (+-{})", number(mean, 0), number(sd, 0)))
            })
        },
    ),
    column(
        "hidden",
        "fraction of both phases in which the speeds show nothing of the controlling clutch's torque",
        |s, car| match s.hidden() {
            Some(fraction) => format!("{:.0} %", 100.0 * fraction),
            None if car.gearbox.has_ratios_alone() => String::new(),
            None => "–".to_owned(),
        },
    ),
    column("health", "the worst health of the shift and its fraction of the samples", |s, _| {
        s.worst_health().map_or("no tables".to_owned(), health)
    }),
];

/// The columns that a shift of the drive fills.
pub(super) fn filled_columns(drive: &ScoredDrive, car: &Car) -> Vec<&'static Column> {
    let is_filled = |column: &&Column| drive.shifts.iter().any(|shift| !(column.cell)(shift, car).is_empty());
    COLUMNS.iter().filter(is_filled).collect()
}

/// The columns of a terminal that a shift of the drive fills.
fn columns_of_terminal(drive: &ScoredDrive, car: &Car) -> Vec<&'static Column> {
    filled_columns(drive, car).into_iter().filter(|column| !column.is_of_pages).collect()
}

/// Titles and rows of the table of shifts for a terminal. Errors of the clutch torque where the truth is known, else means of the
/// estimates; columns that no shift fills are left out.
pub fn shift_rows(drive: &ScoredDrive, car: &Car) -> (Vec<String>, Vec<Vec<String>>) {
    rows_of(&columns_of_terminal(drive, car), drive, car)
}

/// Titles and rows of the table of shifts in these columns.
pub(super) fn rows_of(columns: &[&Column], drive: &ScoredDrive, car: &Car) -> (Vec<String>, Vec<Vec<String>>) {
    let row = |shift: &ScoredShift| columns.iter().map(|column| (column.cell)(shift, car)).collect();
    let mut titles: Vec<String> = columns.iter().map(|column| column.title.to_owned()).collect();
    let mut rows: Vec<Vec<String>> = drive.shifts.iter().map(row).collect();
    convert_table(&mut titles, &mut rows);
    (titles, rows)
}

/// What the words of the table of shifts say that a reader may not have met, and the healths in it: word and meaning.
pub fn shift_words(drive: &ScoredDrive, car: &Car) -> Vec<(String, &'static str)> {
    const EXPLAINED: [&str; 9] = [
        "rating",
        "flare rad/s",
        "overshoot rad/s",
        "tie-up N m",
        "friction work kJ",
        "pressure kPa",
        "controlling",
        "hidden",
        "health",
    ];
    let columns = columns_of_terminal(drive, car).into_iter().filter(|column| EXPLAINED.contains(&column.title));
    let word = |title: &str| {
        [" rad/s", " N m", " kJ", " kPa"].iter().fold(title, |title, unit| title.trim_end_matches(unit)).to_owned()
    };
    let columns = columns.map(|column| (word(column.title), column.meaning));
    let worst =
        |health: &Health| drive.shifts.iter().any(|shift| shift.worst_health().is_some_and(|(it, _)| it == *health));
    let healths = Health::ALL.into_iter().filter(|health| *health != Health::Good).filter(worst);
    columns.chain(healths.map(|health| (health.name().replace('_', " "), health_meaning(health)))).collect()
}

/// A cell of what the occupants feel of a shift.
fn comfort(shift: &ScoredShift, cell: fn(&ShiftComfort) -> String) -> String {
    shift.comfort.as_ref().map_or(String::new(), cell)
}

/// A cell of a shift whose truth is known.
fn scored(shift: &ScoredShift, cell: fn(ErrorsByPhase) -> String) -> String {
    shift.errors().filter(|_| shift.has_truth()).map_or(String::new(), cell)
}

/// A cell of a shift with measured pressures, whose torques are not known: errors of both clutches in both phases.
fn measured(shift: &ScoredShift, cell: fn(&SquaredErrors) -> String) -> String {
    let mut sum = SquaredErrors::default();
    for errors in shift.errors().unwrap_or_default().iter().flatten() {
        sum.add(&errors.pressure);
    }
    if shift.has_truth() || sum.rows == 0.0 { String::new() } else { cell(&sum) }
}

/// Friction work of both clutches, J, with its ends.
fn friction_work(shift: &ScoredShift) -> Option<[f64; 3]> {
    let [offgoing, oncoming] = shift.summary.friction_work_j;
    let (offgoing, oncoming) = (offgoing?, oncoming?);
    Some(core::array::from_fn(|end| offgoing[end] + oncoming[end]))
}

/// A cell of a shift whose truth is not known.
fn unscored(shift: &ScoredShift, cell: impl Fn(&ScoredShift) -> Option<String>) -> String {
    Some(shift).filter(|shift| !shift.has_truth()).and_then(cell).unwrap_or_default()
}

/// A mean with the means of the ends of its range, in another unit.
fn ranged([mean, low, high]: &[f64; 3], unit: f64, decimals: usize) -> String {
    let [mean, low, high] = [mean, low, high].map(|value| unit * value);
    let text = number(mean, decimals);
    // What a one-way clutch carries has no range.
    if low.is_nan() && high.is_nan() {
        return text;
    }
    format!("{text} ({} to {})", number(low, decimals), number(high, decimals))
}

fn health((worst, fraction): (Health, f64)) -> String {
    match worst {
        Health::Good => "good".to_owned(),
        worst => format!("{} {:.0} %", worst.name().replace('_', " "), (100.0 * fraction).max(1.0)),
    }
}

/// A number of a file: with the digits that mean something.
fn number_cell<'a>(name: &str, value: f64) -> (String, Cell<'a>) {
    (name.to_owned(), Cell::Number(trace::rounded(value)))
}

/// A duration of a file: a clock since 1970 has a fraction of a microsecond.
fn duration_cell<'a>(name: &str, value_s: f64) -> (String, Cell<'a>) {
    number_cell(name, (1e6 * value_s).round() / 1e6)
}

/// How a shift went and what was felt of it, as named cells in SI units.
fn quality_cells<'a>(shift: &ScoredShift, car: &'a Car) -> Vec<(String, Cell<'a>)> {
    let [offgoing, oncoming] = clutch_names(shift, car);
    let quality = &shift.quality;
    let (number, duration) = (number_cell, duration_cell);
    let word = |name: &str, word: &'a str| (name.to_owned(), Cell::Word(word));
    let mut cells = vec![
        ("number".to_owned(), Cell::Whole(shift.number as u64)),
        number("time_s", shift.time_s[0]),
        word("from_gear", car.gear_name(shift.gears.from)),
        word("to_gear", car.gear_name(shift.gears.to)),
        word("kind", kind_name(shift).unwrap_or_default()),
        word("offgoing", offgoing),
        word("oncoming", oncoming),
        duration("complete_s", quality.complete_s.unwrap_or(f64::NAN)),
        duration(
            "torque_phase_s",
            if car.gearbox.has_ratios_alone() { f64::NAN } else { phase_s(shift, TruePhase::Torque) },
        ),
        duration("inertia_phase_s", phase_s(shift, TruePhase::Inertia)),
        number("flare_rad_s", quality.flare_rad_s),
        number("past_synchronous_rad_s", quality.past_synchronous_rad_s),
        number("held_slip_rad_s", quality.held_slip_rad_s),
        number("tie_up_n_m", quality.tie_up_n_m),
        number("tie_up_estimate_n_m", shift.summary.tie_up_n_m),
        number("jerk_m_s3", quality.jerk_m_s3),
    ];
    let felt = |of: fn(&ShiftComfort) -> f64| shift.comfort.as_ref().map_or(f64::NAN, of);
    let rating = shift.comfort.as_ref().and_then(|comfort| comfort.rating(quality));
    cells.extend([
        duration("response_s", felt(|comfort| comfort.response_s)),
        number("acceleration_step_m_s2", felt(ShiftComfort::step_m_s2)),
        number("torque_hole_fraction", felt(|comfort| comfort.hole)),
        duration("torque_hole_s", felt(|comfort| comfort.hole_s)),
        number("vibration_dose_m_s1_75", felt(|comfort| comfort.vibration_dose_m_s1_75)),
        number("rating", rating.unwrap_or(f64::NAN)),
        number("oncoming_plates_degc", shift.plates_degc.unwrap_or(f64::NAN)),
        word("acceleration_source", shift.comfort.map_or("", |comfort| comfort.source.name())),
    ]);
    cells
}

/// The shifts of a simulation as named cells in SI units, for files: friction work by the true torques, and no estimates.
pub fn simulated_shift_cells<'a>(shift: &ScoredShift, car: &'a Car) -> Vec<(String, Cell<'a>)> {
    let mut cells = quality_cells(shift, car);
    cells.retain(|(name, _)| name != "tie_up_estimate_n_m");
    for (clutch, work_j) in ["offgoing", "oncoming"].iter().zip(shift.summary.friction_work_j) {
        cells.push(number_cell(&format!("{clutch}_friction_work_j"), work_j.map_or(f64::NAN, |[work_j, ..]| work_j)));
    }
    cells
}

/// The shifts as named cells in SI units, for files. RMS errors of the torque of the controlling clutch and of the
/// other, N m; means of the inertia phase.
pub fn shift_cells<'a>(shift: &ScoredShift, car: &'a Car) -> Vec<(String, Cell<'a>)> {
    let mut cells = quality_cells(shift, car);
    let number = number_cell;
    let errors: ErrorsByPhase = shift.errors().unwrap_or_default();
    for (phase, clutches) in ["torque_phase", "inertia_phase"].iter().zip(errors) {
        for (clutch, errors) in ["controlling", "other"].iter().zip(clutches) {
            let ends = errors.torque.rms_n_m().map(|n_m| if errors.torque.rows > 0.0 { n_m } else { f64::NAN });
            for (what, value) in ["rms_n_m", "open_loop_rms_n_m"].iter().zip(ends) {
                cells.push(number(&format!("{phase}_{clutch}_{what}"), value));
            }
        }
    }
    for (phase, clutches) in ["torque_phase", "inertia_phase"].iter().zip(errors) {
        for (clutch, errors) in ["controlling", "other"].iter().zip(clutches) {
            let ends = errors.pressure.rms_pa().map(|pa| if errors.pressure.rows > 0.0 { pa } else { f64::NAN });
            for (what, value) in ["rms_pa", "open_loop_rms_pa"].iter().zip(ends) {
                cells.push(number(&format!("{phase}_{clutch}_{what}"), value));
            }
        }
    }
    let [pressures, inside] = shift.summary.pressures;
    let fraction = if pressures > 0 { inside as f64 / pressures as f64 } else { f64::NAN };
    cells.push(number("measured_pressure_inside_range", fraction));
    for (c, role) in ["offgoing", "oncoming"].iter().enumerate() {
        let none = [f64::NAN; 3];
        let work = shift.summary.friction_work_j[c].unwrap_or(none);
        for (what, at) in [("", 0), ("_least", 1), ("_greatest", 2)] {
            cells.push(number(&format!("{role}_friction_work{what}_j"), work[at]));
        }
        let (pressure, torque) = (shift.mean_pressure_pa(c).unwrap_or(none), shift.mean_torque_n_m(c).unwrap_or(none));
        for (what, at) in [("", 0), ("least_", 1), ("greatest_", 2)] {
            cells.push(number(&format!("{role}_pressure_mean_{what}pa"), pressure[at]));
            cells.push(number(&format!("{role}_torque_mean_{what}n_m"), torque[at]));
        }
    }
    if car.gearbox.has_ratios_alone() {
        let [mean, std_dev] = shift.mean_at_turbine_n_m().unwrap_or([f64::NAN; 2]);
        cells.push(number("at_turbine_mean_n_m", mean));
        cells.push(number("at_turbine_mean_deviation_n_m", std_dev));
    }
    cells.push(number("hidden_share", shift.hidden().unwrap_or(f64::NAN)));
    let inside = shift.inside().filter(|_| shift.has_truth());
    cells.push(number("inside_range", inside.unwrap_or(f64::NAN)));
    let health = shift.worst_health().map_or("", |(health, _)| health.name());
    cells.push(("worst_health".to_owned(), Cell::Word(health)));
    cells
}
