//! The page of a simulated drive of a car with any gearbox: the drive, the table of its shifts, shifts drawn.

mod drawn;
mod figures;
mod shifts;

use std::cmp::Ordering;

use car::Car;
use config::Source;
use minijinja::{Value, context};
use observer::Health;
use study::gearbox::drive::{ScoredDrive, ScoredShift};
use study::gearbox::matrix::Matrix;
use study::gearbox::worth_a_look::BY_EACH;
use study::gearbox::{ShiftDraw, TruePhase};
use trace::quantity;
use trace::shown_units::{convert_table, sentence};

use crate::interactive::within_room;
use crate::matrix_page::kind_rows;
use crate::page::{PageError, origin, render};
use crate::tables::{health_meaning, number};
use crate::words::found;
pub use drawn::{Drawn, DrawnShift, drawn};
use figures::{overview_figure, shift_figure};
use shifts::{Column, filled_columns, rows_of};
pub use shifts::{shift_cells, shift_rows, shift_words, simulated_shift_cells};

/// Shifts that are drawn; of a drive with more, the worst, or those worth a look.
pub const MAX_DRAWN: usize = 400;
/// Worst shifts that are named.
const WORST: usize = 5;

/// What a page is made from.
pub struct DrivePage<'a> {
    /// The name of the drive.
    pub name: &'a str,
    /// The car that the filter and the shift controller know.
    pub car: &'a Car,
    /// How the driven car differs from it, and the seed of that, where the drive was simulated.
    pub draw: Option<(&'a ShiftDraw, u64)>,
    /// The drive.
    pub drive: &'a ScoredDrive,
    /// The files that the drive follows from.
    pub sources: &'a [&'a Source],
}

impl DrivePage<'_> {
    /// The page; it needs nothing but itself.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn html(&self) -> Result<String, PageError> {
        let (car, drive) = (self.car, self.drive);
        let worst = worst_first(&drive.shifts);
        let mut drawn: Vec<&ScoredShift> = drive.shifts.iter().filter(|shift| shift.is_drawn).collect();
        drawn.sort_by(|a, b| by_need(a, b));
        let figures = within_room(drawn.iter().take(MAX_DRAWN).map(|shift| shift_figure(shift, drive, car)));
        let mut figures: Vec<(&ScoredShift, Value)> = drawn.iter().copied().zip(figures).collect();
        drawn.truncate(figures.len());
        figures.sort_by_key(|(shift, _)| shift.number);
        let figures = figures.into_iter().map(|(shift, figure)| {
            context! {
                number => shift.number,
                title => title(shift, car),
                at => number(shift.time_s[0], 2),
                clutches => clutch_words(shift, car),
                figure,
            }
        });
        let figures: Vec<Value> = figures.collect();
        let columns = filled_columns(drive, car);
        let (titles, rows) = rows_of(&columns, drive, car);
        let mut rows: Vec<_> = rows.into_iter().zip(&drive.shifts).collect();
        rows.sort_by(|(_, a), (_, b)| by_need(a, b));
        let is_drawn = |shift: &ScoredShift| drawn.iter().any(|other| other.number == shift.number);
        let first = rows.iter().map(|(_, shift)| *shift).find(|shift| is_drawn(shift)).map(|shift| shift.number);
        let rows: Vec<Value> =
            rows.into_iter().map(|(cells, shift)| context! { cells, linked => is_drawn(shift) }).collect();
        let (mut kind_titles, mut kinds) = kind_rows(&Matrix::of_drive(drive, car));
        convert_table(&mut kind_titles, &mut kinds);
        let (overview, missing) = overview_figure(drive, car);
        let named = worst.iter().take(WORST).map(|shift| {
            context! { number => shift.number, gears => car.shift_name(shift.gears), error => quantity(shift.worst_error_n_m(), "N m", 1) }
        });
        render(
            "drive.html",
            context! {
                name => self.name,
                title => "drive",
                version => env!("CARGO_PKG_VERSION"),
                vehicle_name => &car.name,
                gearbox_name => &car.gearbox.name,
                overview => overview.html(),
                missing,
                found => found(&findings(drive)),
                kind_titles,
                kinds,
                columns => column_words(&titles, &columns),
                rows,
                healths => healths(drive),
                figures,
                opened => first,
                worst => named.collect::<Vec<_>>(),
                undrawn => drive.shifts.len() - drawn.len(),
                chosen => drive.shifts.len() > MAX_DRAWN,
                by_each => BY_EACH,
                draw => self.draw.map(|(draw, _)| draw_rows(draw, car)),
                converter => self.draw.filter(|_| car.converter.is_some()).map(|(draw, _)| number(draw.converter, 3)),
                seed => self.draw.map(|(_, seed)| seed),
                has_truth => drive.has_truth(),
                inputs => origin(self.sources),
            },
        )
    }
}

/// What an estimate by ratios alone is, and what is missing for more.
const RATIOS_ALONE: &str = "Of this gearbox the ratios alone are known: torques are those of all clutches together at the turbine. The \
                            torque of a clutch needs the holding torques of the gears (level = \"shares\" in the gearbox file), its pressure \
                            also plates and piston (`pack`).";

/// The columns of the table of shifts: title, meaning, and a name that no other column has.
fn column_words(titles: &[String], columns: &[&Column]) -> Vec<Value> {
    let name = |at: usize| match (columns[at].title, at) {
        ("N m", 1..) => format!("{}, {}", columns[at - 1].title, titles[at]),
        _ => titles[at].clone(),
    };
    // A unit is not broken.
    let one = |(at, column): (usize, &&Column)| {
        context! { title => titles[at].replace("N m", "N\u{a0}m"), meaning => column.meaning, name => name(at) }
    };
    columns.iter().enumerate().map(one).collect()
}

/// The healths of the drive, each with its meaning.
fn healths(drive: &ScoredDrive) -> Vec<Value> {
    let there = |health: &Health| {
        let in_states = drive.states.iter().any(|state| state.health == *health);
        in_states || drive.shifts.iter().any(|shift| shift.summary.rows_with(*health) > 0)
    };
    let value =
        |health: Health| context! { name => health.name().replace('_', " "), meaning => health_meaning(health) };
    Health::ALL.into_iter().filter(|health| *health != Health::Good).filter(there).map(value).collect()
}

fn title(shift: &ScoredShift, car: &Car) -> String {
    format!("{}, {}", car.shift_name(shift.gears), kind_name(shift).unwrap_or("shift without torque"))
}

/// The kind of a shift that has one.
fn kind_name(shift: &ScoredShift) -> Option<&'static str> {
    if shift.is_garage { Some("garage shift") } else { shift.kind.map(|kind| kind.name()) }
}

/// How long a phase lasts, s; not a number in a garage shift, which has none.
fn phase_s(shift: &ScoredShift, phase: TruePhase) -> f64 {
    if shift.is_garage { f64::NAN } else { shift.length_s(phase) }
}

/// Offgoing and oncoming element; empty where the shift has none that is known.
fn clutch_names<'a>(shift: &ScoredShift, car: &'a Car) -> [&'a str; 2] {
    shift.elements.map(|at| at.and_then(|at| car.gearbox.elements.get(at)).map_or("", |element| element.name.as_str()))
}

/// What the clutches of a shift do, in words.
fn clutch_words(shift: &ScoredShift, car: &Car) -> String {
    let named = clutch_names(shift, car).into_iter().zip(["opens", "closes"]).filter(|(name, _)| !name.is_empty());
    named.map(|(name, does)| format!("{name} {does}")).collect::<Vec<_>>().join(", ")
}

/// The order of the table: the largest error first, where the truth is known; else the worst health.
fn by_need(a: &ScoredShift, b: &ScoredShift) -> Ordering {
    let health = |shift: &ScoredShift| shift.worst_health().map_or((Health::Good, 0.0), |worst| worst);
    let ((a_health, a_fraction), (b_health, b_fraction)) = (health(a), health(b));
    let by_health = b_health.cmp(&a_health).then(b_fraction.total_cmp(&a_fraction));
    b.worst_error_n_m().total_cmp(&a.worst_error_n_m()).then(by_health).then(a.number.cmp(&b.number))
}

/// The shifts with the largest error first.
fn worst_first(shifts: &[ScoredShift]) -> Vec<&ScoredShift> {
    let mut worst: Vec<&ScoredShift> = shifts.iter().collect();
    worst.sort_by(|a, b| b.worst_error_n_m().total_cmp(&a.worst_error_n_m()));
    worst
}

/// Friction and valve gain of each element of the driven car over those of the known one.
fn draw_rows(draw: &ShiftDraw, car: &Car) -> Vec<Value> {
    let elements = car.gearbox.elements.iter().zip(&car.clutches).zip(draw.friction.iter().zip(&draw.valve_gain));
    let with_plates = elements.filter(|((_, clutch), _)| clutch.is_some());
    let row = with_plates.map(|((element, _), (friction, gain))| {
        context! { element => &element.name, friction => number(*friction, 3), gain => number(*gain, 3) }
    });
    row.collect()
}

/// What happened, in sentences.
pub fn findings(drive: &ScoredDrive) -> Vec<String> {
    let shifts = &drive.shifts;
    let warnings = drive.warnings.iter().map(|warning| sentence(warning));
    if shifts.is_empty() {
        let none = "The drive has no shift.".to_owned();
        return warnings.chain([none]).collect();
    }
    let maximum = |value: fn(&ScoredShift) -> f64| shifts.iter().map(value).fold(0.0, f64::max);
    let longest = number(maximum(|shift| shift.quality.complete_s.unwrap_or(0.0)), 2);
    let completed = shifts.iter().filter(|shift| shift.quality.complete_s.is_some()).count();
    let sum = |of: fn(&ScoredShift) -> u64| shifts.iter().map(of).sum::<u64>();
    let [all, inside] = [sum(|shift| 2 * shift.summary.clutches()[0]), sum(|shift| 2 * shift.summary.clutches()[1])];
    let good = sum(|shift| shift.summary.rows_with(Health::Good));
    let mut sentences: Vec<String> = warnings.collect();
    let longest = if completed > 0 { format!("; the longest took {longest} s") } else { String::new() };
    sentences.push(format!("{completed} of {} shifts were completed{longest}.", shifts.len()));
    if shifts.iter().any(|shift| !shift.is_garage) {
        sentences.push(format!(
            "Largest flare of an old gear {}, largest overshoot of a synchronous speed {}.",
            quantity(maximum(|shift| shift.quality.flare_rad_s), "rad/s", 1),
            quantity(maximum(|shift| shift.quality.past_synchronous_rad_s), "rad/s", 1),
        ));
    }
    sentences.extend([format!(
        "Health is good in {good} of {} samples of the shifts.",
        sum(|shift| shift.summary.counts.rows)
    )]);
    if drive.has_truth() {
        sentences.push(format!(
            "{inside} of {all} pressures and torques of the shift clutches are within their ranges by the error budget."
        ));
    }
    let hidden = |is_garage: bool| shifts.iter().filter(|s| !s.is_estimated() && s.is_garage == is_garage).count();
    if shifts.iter().any(|shift| shift.mean_at_turbine_n_m().is_some()) {
        sentences.push(RATIOS_ALONE.to_owned());
    }
    if hidden(false) > 0 {
        sentences.push(format!(
            "{} shifts are not estimated: the filter has no equations for them. They are two shifts at once, between gears of the same ratio, or past a gear where \
             the ratios alone are known.",
            hidden(false)
        ));
    }
    if hidden(true) > 0 {
        sentences.push(format!(
            "{} garage shifts are not estimated: the filter has equations only for shifts from one clutch to another.",
            hidden(true)
        ));
    }
    sentences
}
