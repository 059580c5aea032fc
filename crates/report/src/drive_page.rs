//! The page of a simulated drive of a car with any gearbox: the drive, the table of its shifts, shifts drawn.

use config::{Car, Source};
use minijinja::{Value, context};
use observer::Health;
use study::any_shift::drive::{DriveState, ScoredDrive, ScoredShift};
use study::any_shift::matrix::{ErrorsByPhase, controlling_of};
use study::any_shift::worth_a_look::BY_EACH;
use study::any_shift::{ClutchRow, ShiftDraw, ShiftScoreRow, TruePhase};
use trace::Cell;
use trace::units::{km_h, mpa, rpm};

use crate::figure::{Axis, Band, Figure, Panel, Series, Span, Stroke};
use crate::log_page::{ESTIMATE, compact, health_panel, panel};
use crate::matrix_page::{kind_rows, ratio, torques};
use crate::page::{PageError, inline, origin, templates};
use crate::palette::{RANGE, Weight};
use crate::shift_figure::{INERTIA_PHASE, TORQUE_PHASE};
use crate::tables::{coverage, health_meaning, number};

/// Shifts that are drawn; of a drive with more, the worst, or those worth a look.
pub const MOST_DRAWN: usize = 60;
/// Worst shifts that are named.
const WORST: usize = 5;
/// Time before and after a shift that its figure shows, s.
const MARGIN_S: [f64; 2] = [0.15, 0.25];
/// Points of a curve over the whole drive.
const POINTS: usize = 3000;
/// Part of the drive that a step of the gear takes in its figure: a pixel.
const STEP: f64 = 900.0;
/// Shortest time axis, s.
const SHORTEST_S: f64 = 0.1;
/// Room above the pressures of a clutch that slips, and least height of their axis, MPa.
const PRESSURE_ROOM: f64 = 1.5;
const LEAST_MPA: f64 = 0.2;
const OPEN_LOOP: Stroke = Stroke { colour: "#767676", weight: Weight::Rival, dash: Some("6 3") };

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
        let mut drawn: Vec<&ScoredShift> =
            worst.iter().filter(|shift| shift.is_drawn).take(MOST_DRAWN).copied().collect();
        drawn.sort_by_key(|shift| shift.number);
        let is_drawn = |shift: &ScoredShift| drawn.iter().any(|other| other.number == shift.number);
        let (columns, (_, rows)) = (filled_columns(drive, car), shift_rows(drive, car));
        let rows = rows.into_iter().zip(&drive.shifts);
        let rows: Vec<Value> = rows.map(|(cells, shift)| context! { cells, linked => is_drawn(shift) }).collect();
        let (kind_titles, kinds) = kind_rows(&drive.matrix(car));
        let figures = drawn.iter().map(|shift| {
            context! {
                number => shift.number,
                title => title(shift, car),
                at => number(shift.time_s[0], 2),
                clutches => clutch_words(shift, car),
                svg => inline(&compact(&shift_figure(shift, drive, car).svg())),
            }
        });
        let named = worst.iter().take(WORST).map(|shift| {
            context! { number => shift.number, gears => gears(shift, car), error => number(shift.worst_error_n_m(), 1) }
        });
        Ok(templates()?.get_template("drive.html")?.render(context! {
            name => self.name,
            title => "drive",
            version => env!("CARGO_PKG_VERSION"),
            vehicle_name => &car.name,
            gearbox_name => &car.gearbox.name,
            overview => inline(&compact(&overview_figure(drive, car).svg())),
            findings => findings(drive),
            kind_titles,
            kinds,
            columns => columns.iter().map(|column| context! { title => column.title, meaning => column.meaning }).collect::<Vec<_>>(),
            rows,
            healths => healths(drive),
            figures => figures.collect::<Vec<_>>(),
            worst => named.collect::<Vec<_>>(),
            undrawn => drive.shifts.len() - drawn.len(),
            by_each => BY_EACH,
            draw => self.draw.map(|(draw, _)| draw_rows(draw, car)),
            converter => self.draw.filter(|_| car.converter.is_some()).map(|(draw, _)| number(draw.converter, 3)),
            seed => self.draw.map(|(_, seed)| seed),
            has_truth => drive.has_truth(),
            inputs => origin(self.sources),
        })?)
    }
}

/// What an estimate by ratios alone is, and what is missing for more.
const RATIOS_ALONE: &str = "Of this gearbox the ratios alone are known: torques are those of all clutches together, as the turbine feels them. The \
                            torque of a clutch needs the holding torques of the gears (level = \"shares\" in the gearbox file), its pressure \
                            plates and piston besides (`pack`).";

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

fn name(car: &Car, gear: usize) -> &str {
    car.gearbox.gears.get(gear).map_or("N", |gear| gear.name.as_str())
}

fn gears(shift: &ScoredShift, car: &Car) -> String {
    format!("{}-{}", name(car, shift.from), name(car, shift.to))
}

fn title(shift: &ScoredShift, car: &Car) -> String {
    format!("{}, {}", gears(shift, car), kind_name(shift).unwrap_or("shift without torque"))
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
    shift.elements.map(|at| car.gearbox.elements.get(at).map_or("", |element| element.name.as_str()))
}

/// What the clutches of a shift do, in words.
fn clutch_words(shift: &ScoredShift, car: &Car) -> String {
    let named = clutch_names(shift, car).into_iter().zip(["opens", "closes"]).filter(|(name, _)| !name.is_empty());
    named.map(|(name, does)| format!("{name} {does}")).collect::<Vec<_>>().join(", ")
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
    if shifts.is_empty() {
        let none = "The drive has no shift.".to_owned();
        return drive.warnings.iter().cloned().chain([none]).collect();
    }
    let most = |value: fn(&ScoredShift) -> f64| shifts.iter().map(value).fold(0.0, f64::max);
    let completed = shifts.iter().filter(|shift| shift.quality.complete_s.is_some()).count();
    let sum = |of: fn(&ScoredShift) -> u64| shifts.iter().map(of).sum::<u64>();
    let [all, inside] = [sum(|shift| 2 * shift.summary.clutches()[0]), sum(|shift| 2 * shift.summary.clutches()[1])];
    let good = sum(|shift| shift.summary.rows_with(Health::Good));
    let mut sentences = drive.warnings.clone();
    sentences.extend([format!(
        "{completed} of {} shifts were completed; the longest took {} s.",
        shifts.len(),
        number(most(|shift| shift.quality.complete_s.unwrap_or(0.0)), 2)
    )]);
    if shifts.iter().any(|shift| !shift.is_garage) {
        sentences.push(format!(
            "Largest flare of an old gear {} rad/s, largest slip beyond a new gear {} rad/s.",
            number(most(|shift| shift.quality.flare_rad_s), 1),
            number(most(|shift| shift.quality.past_synchronous_rad_s), 1),
        ));
    }
    sentences.extend([format!(
        "Health is good in {good} of {} samples of the shifts.",
        sum(|shift| shift.summary.counts.rows)
    )]);
    if drive.has_truth() {
        sentences.push(format!(
            "{inside} of {all} pressures and torques of the shift clutches are within their guaranteed ranges."
        ));
    }
    let hidden = |is_garage: bool| shifts.iter().filter(|s| !s.is_estimated() && s.is_garage == is_garage).count();
    if shifts.iter().any(|shift| shift.mean_at_turbine_n_m().is_some()) {
        sentences.push(RATIOS_ALONE.to_owned());
    }
    if hidden(false) > 0 {
        sentences.push(format!(
            "Of {} shifts the filter has no tables: nothing is estimated. They are two shifts at once, between gears of the same ratio, or past a gear where \
             the ratios alone are known.",
            hidden(false)
        ));
    }
    if hidden(true) > 0 {
        sentences.push(format!(
            "Of {} garage shifts nothing is estimated: the filter has tables of shifts from one clutch to another only.",
            hidden(true)
        ));
    }
    sentences
}

/// A column of the table of shifts.
struct Column {
    title: &'static str,
    /// What it holds, for those who have not met it.
    meaning: &'static str,
    cell: fn(&ScoredShift, &Car) -> String,
}

const fn column(title: &'static str, meaning: &'static str, cell: fn(&ScoredShift, &Car) -> String) -> Column {
    Column { title, meaning, cell }
}

/// RMS errors of filter and open loop.
const ERRORS: &str = "RMS errors of filter / open loop";
const COLUMNS: &[Column] = &[
    column("#", "number of the shift", |s, _| s.number.to_string()),
    column("shift", "old and new gear", gears),
    column("kind", "direction, and who drives: with power the engine, coasting the car", |s, _| {
        kind_name(s).unwrap_or("–").to_owned()
    }),
    column("begin s", "time of the request", |s, _| number(s.time_s[0], 2)),
    column("time s", "from the request until the shift is complete", |s, _| {
        number(s.quality.complete_s.unwrap_or(f64::NAN), 2)
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
    column("past new gear rad/s", "largest slip of the turbine beyond the speed of the new gear", |s, _| {
        number(s.quality.past_synchronous_rad_s, 1)
    }),
    column("jerk m/s^3", "greatest jerk of the car, from parabolas over 0.3 s of its speed", |s, _| {
        if s.quality.jerk_m_s3.is_nan() { String::new() } else { number(s.quality.jerk_m_s3, 1) }
    }),
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
        "share of the true pressures and torques of both clutches within their guaranteed ranges",
        |s, _| {
            if s.has_truth() { s.inside().map_or(String::new(), coverage) } else { String::new() }
        },
    ),
    column("controlling", "the clutch that drives the inertia phase", |s, car| {
        unscored(s, |s| Some(clutch_names(s, car)[controlling_of(&s.rows, s.kind?)].to_owned()))
    }),
    column(
        "pressure MPa",
        "of the controlling clutch, mean of the inertia phase; in brackets of its guaranteed range",
        |s, _| unscored(s, |s| Some(ranged(&s.mean_pressure_pa(controlling_of(&s.rows, s.kind?))?, 1e-6, 3))),
    ),
    column(
        "torque N m",
        "of the controlling clutch, mean of the inertia phase; in brackets of its guaranteed range",
        |s, _| unscored(s, |s| Some(ranged(&s.mean_torque_n_m(controlling_of(&s.rows, s.kind?))?, 1.0, 0))),
    ),
    column(
        "at the turbine N m",
        "torque of the clutches together as the turbine feels it, mean of the inertia phase; in brackets its standard deviation",
        |s, _| {
            unscored(s, |s| {
                s.mean_at_turbine_n_m().map(|[mean, sd]| format!("{} (+-{})", number(mean, 0), number(sd, 0)))
            })
        },
    ),
    column(
        "not seen",
        "share of both phases in which the speeds show nothing of the controlling clutch's torque",
        |s, car| match s.hidden() {
            Some(share) => format!("{:.0} %", 100.0 * share),
            None if car.gearbox.has_ratios_alone() => String::new(),
            None => "–".to_owned(),
        },
    ),
    column("health", "the worst health of the shift and its share of the samples", |s, _| {
        s.worst_health().map_or("no tables".to_owned(), health)
    }),
];

/// The columns that a shift of the drive fills.
fn filled_columns(drive: &ScoredDrive, car: &Car) -> Vec<&'static Column> {
    let is_filled = |column: &&Column| drive.shifts.iter().any(|shift| !(column.cell)(shift, car).is_empty());
    COLUMNS.iter().filter(is_filled).collect()
}

/// Titles and rows of the table of shifts. Errors of the clutch torque where the truth is known, else means of the estimates; columns
/// that no shift fills are left out.
pub fn shift_rows(drive: &ScoredDrive, car: &Car) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let columns = filled_columns(drive, car);
    let row = |shift: &ScoredShift| columns.iter().map(|column| (column.cell)(shift, car)).collect();
    (columns.iter().map(|column| column.title).collect(), drive.shifts.iter().map(row).collect())
}

/// What the words of the table of shifts say that a reader may not have met, and the healths in it: word and meaning.
pub fn shift_words(drive: &ScoredDrive, car: &Car) -> Vec<(String, &'static str)> {
    const EXPLAINED: [&str; 5] = ["flare rad/s", "past new gear rad/s", "controlling", "not seen", "health"];
    let columns = filled_columns(drive, car).into_iter().filter(|column| EXPLAINED.contains(&column.title));
    let word = |title: &str| title.trim_end_matches(" rad/s").to_owned();
    let columns = columns.map(|column| (word(column.title), column.meaning));
    let worst =
        |health: &Health| drive.shifts.iter().any(|shift| shift.worst_health().is_some_and(|(it, _)| it == *health));
    let healths = Health::ALL.into_iter().filter(|health| *health != Health::Good).filter(worst);
    columns.chain(healths.map(|health| (health.name().replace('_', " "), health_meaning(health)))).collect()
}

/// A cell of a shift whose truth is known.
fn scored(shift: &ScoredShift, cell: fn(ErrorsByPhase) -> String) -> String {
    shift.errors().filter(|_| shift.has_truth()).map_or(String::new(), cell)
}

/// A cell of a shift whose truth is not known.
fn unscored(shift: &ScoredShift, cell: impl Fn(&ScoredShift) -> Option<String>) -> String {
    Some(shift).filter(|shift| !shift.has_truth()).and_then(cell).unwrap_or_default()
}

/// A mean with the means of the ends of its range, in another unit.
fn ranged([mean, low, high]: &[f64; 3], unit: f64, decimals: usize) -> String {
    let [mean, low, high] = [mean, low, high].map(|value| number(unit * value, decimals));
    format!("{mean} ({low} to {high})")
}

fn health((worst, share): (Health, f64)) -> String {
    match worst {
        Health::Good => "good".to_owned(),
        worst => format!("{} {:.0} %", worst.name().replace('_', " "), (100.0 * share).max(1.0)),
    }
}

/// The shifts as named cells in SI units, for files. RMS errors of the torque of the controlling clutch and of the
/// other, N m; means of the inertia phase.
pub fn shift_cells<'a>(shift: &ScoredShift, car: &'a Car) -> Vec<(String, Cell<'a>)> {
    let [offgoing, oncoming] = clutch_names(shift, car);
    let quality = &shift.quality;
    let number = |name: &str, value: f64| (name.to_owned(), Cell::Number(value));
    let word = |name: &str, word: &'a str| (name.to_owned(), Cell::Word(word));
    let mut cells = vec![
        ("number".to_owned(), Cell::Whole(shift.number as u64)),
        number("time_s", shift.time_s[0]),
        word("from_gear", name(car, shift.from)),
        word("to_gear", name(car, shift.to)),
        word("kind", kind_name(shift).unwrap_or_default()),
        word("offgoing", offgoing),
        word("oncoming", oncoming),
        number("complete_s", quality.complete_s.unwrap_or(f64::NAN)),
        number(
            "torque_phase_s",
            if car.gearbox.has_ratios_alone() { f64::NAN } else { phase_s(shift, TruePhase::Torque) },
        ),
        number("inertia_phase_s", phase_s(shift, TruePhase::Inertia)),
        number("flare_rad_s", quality.flare_rad_s),
        number("past_synchronous_rad_s", quality.past_synchronous_rad_s),
        number("held_slip_rad_s", quality.held_slip_rad_s),
        number("tie_up_n_m", quality.tie_up_n_m),
        number("jerk_m_s3", quality.jerk_m_s3),
    ];
    let errors: ErrorsByPhase = shift.errors().unwrap_or_default();
    for (phase, clutches) in ["torque_phase", "inertia_phase"].iter().zip(errors) {
        for (clutch, errors) in ["controlling", "other"].iter().zip(clutches) {
            let ends = errors.torque.rms_n_m().map(|n_m| if errors.torque.rows > 0.0 { n_m } else { f64::NAN });
            for (what, value) in ["rms_n_m", "open_loop_rms_n_m"].iter().zip(ends) {
                cells.push(number(&format!("{phase}_{clutch}_{what}"), value));
            }
        }
    }
    for (c, role) in ["offgoing", "oncoming"].iter().enumerate() {
        let none = [f64::NAN; 3];
        let (pressure, torque) = (shift.mean_pressure_pa(c).unwrap_or(none), shift.mean_torque_n_m(c).unwrap_or(none));
        for (what, at) in [("", 0), ("least_", 1), ("greatest_", 2)] {
            cells.push(number(&format!("{role}_pressure_mean_{what}pa"), pressure[at]));
            cells.push(number(&format!("{role}_torque_mean_{what}n_m"), torque[at]));
        }
    }
    if car.gearbox.has_ratios_alone() {
        let [mean, deviation] = shift.mean_at_turbine_n_m().unwrap_or([f64::NAN; 2]);
        cells.push(number("at_turbine_mean_n_m", mean));
        cells.push(number("at_turbine_mean_deviation_n_m", deviation));
    }
    cells.push(number("hidden_share", shift.hidden().unwrap_or(f64::NAN)));
    let inside = shift.inside().filter(|_| shift.has_truth());
    cells.push(number("inside_range", inside.unwrap_or(f64::NAN)));
    cells.push(word("worst_health", shift.worst_health().map_or("", |(health, _)| health.name())));
    cells
}

/// The gear as a number for an axis: its name where that is a number, else its place among the forward gears.
fn gear_number(car: &Car, gear: usize) -> f64 {
    let place = car.gearbox.forward_gears().iter().position(|&forward| forward == gear);
    #[expect(clippy::cast_precision_loss, reason = "a handful of gears")]
    let place = place.map_or(0.0, |place| place as f64 + 1.0);
    name(car, gear).parse().unwrap_or(place)
}

/// The gear over time. A step takes `wide_s`, because a figure draws only one of points that lie closer.
fn gear_steps(drive: &ScoredDrive, car: &Car, wide_s: f64) -> Vec<(f64, f64)> {
    let mut steps: Vec<(f64, f64)> = Vec::new();
    for state in &drive.states {
        let gear = gear_number(car, state.gear);
        match steps.last() {
            Some(&(_, before)) if before == gear => {}
            Some(&(_, before)) => steps.extend([(state.time_s, before), (state.time_s + wide_s, gear)]),
            None => steps.push((state.time_s, gear)),
        }
    }
    let last_s = drive.states.last().map_or(0.0, |state| state.time_s);
    steps.extend(steps.last().copied().map(|(_, gear)| (last_s, gear)));
    steps
}

/// Room above the highest gear, so that its line is seen.
fn gear_axis(steps: &[(f64, f64)]) -> Axis {
    let gears = || steps.iter().map(|(_, gear)| *gear);
    Axis::Fixed(gears().fold(0.0, f64::min), gears().fold(1.0, f64::max) + 0.5)
}

/// Gear, speeds and pedals over the whole drive.
fn overview_figure(drive: &ScoredDrive, car: &Car) -> Figure {
    let states = &drive.states;
    let every = states.len().div_ceil(POINTS).max(1);
    let thinned = || states.iter().step_by(every);
    let curve = |label: &str, stroke: Stroke, value: &dyn Fn(&DriveState) -> f64| Series {
        label: label.to_owned(),
        stroke: Stroke { weight: Weight::Rival, ..stroke },
        points: thinned().map(|state| (state.time_s, value(state))).collect(),
    };
    let [first_s, last_s] = [states.first(), states.last()].map(|state| state.map_or(0.0, |state| state.time_s));
    let gear = Series {
        label: "gear".to_owned(),
        stroke: Stroke::SIGNAL,
        points: gear_steps(drive, car, (last_s - first_s) / STEP),
    };
    let is = |state: &DriveState| Health::ALL.map(|health| health == state.health);
    let healths: Vec<_> = states.iter().map(|state| (state.time_s, is(state))).collect();
    let spans = drive.shifts.iter().map(|shift| Span {
        label: String::new(),
        start: shift.time_s[0],
        end: shift.time_s[1],
        colour: TORQUE_PHASE,
    });
    let speeds = ["engine", "turbine"].into_iter().zip([Stroke::THIRD, Stroke::SIGNAL]).enumerate();
    let speeds = speeds.map(|(i, (label, stroke))| curve(label, stroke, &|state| rpm(state.speeds_rad_s[i])));
    let pedals = ["throttle", "brake"].into_iter().zip([Stroke::SIGNAL, Stroke::THIRD]).enumerate();
    let pedals = pedals.map(|(i, (label, stroke))| curve(label, stroke, &|state| state.pedals[i]));
    let panels = [
        Panel { axis: gear_axis(&gear.points), ..panel("gear", 120.0, vec![gear]) },
        panel("speed (km/h)", 80.0, vec![curve("vehicle", Stroke::SIGNAL, &|state| km_h(state.vehicle_m_s))]),
        panel("speed (rpm)", 110.0, speeds.collect()),
        Panel { axis: Axis::Fixed(0.0, 1.0), ..panel("pedals (0\u{a0}to\u{a0}1)", 70.0, pedals.collect()) },
    ];
    Figure {
        x_label: "time (s)",
        x_range: (first_s, last_s.max(first_s + SHORTEST_S)),
        spans: spans.take(4 * MOST_DRAWN).collect(),
        panels: panels.into_iter().chain(health_panel(&healths)).collect(),
    }
}

/// A shift with some time around it.
fn shift_figure(shift: &ScoredShift, drive: &ScoredDrive, car: &Car) -> Figure {
    let [from_s, to_s] = [shift.time_s[0] - MARGIN_S[0], shift.time_s[1] + MARGIN_S[1]];
    let first = drive.states.partition_point(|state| state.time_s < from_s);
    let last = drive.states.partition_point(|state| state.time_s <= to_s);
    let states = &drive.states[first..last];
    let speed = |label: String, stroke: Stroke, value: &dyn Fn(&DriveState) -> f64| Series {
        label,
        stroke,
        points: states.iter().map(|state| (state.time_s, rpm(value(state)))).collect(),
    };
    let in_gear = |gear: usize, stroke: Stroke| {
        let ratio = car.gearbox.gears.get(gear).map_or(f64::NAN, |gear| gear.ratio);
        speed(format!("turbine in gear {}", name(car, gear)), stroke, &|state| ratio * state.speeds_rad_s[2])
    };
    let dotted = |dash| Stroke { weight: Weight::Rival, dash: Some(dash), ..Stroke::SIGNAL };
    let speeds = vec![
        speed("engine".to_owned(), Stroke::THIRD, &|state| state.speeds_rad_s[0]),
        speed("turbine".to_owned(), Stroke::SIGNAL, &|state| state.speeds_rad_s[1]),
        in_gear(shift.from, dotted("2.5 2")),
        in_gear(shift.to, dotted("9 2.5 2 2.5")),
    ];
    let mut panels = vec![panel("speed (rpm)", 120.0, speeds)];
    let names = clutch_names(shift, car);
    if shift.rows.iter().any(|row| row.at_turbine_n_m.is_some()) {
        panels.push(at_turbine_panel(&shift.rows));
    } else if !shift.rows.is_empty() {
        let roles = || ["offgoing", "oncoming"].into_iter().zip(names).enumerate();
        panels.extend(roles().map(|(c, (role, name))| torque_panel(&shift.rows, c, format!("{name}, {role}"))));
        let with_pressure = roles().filter(|(c, _)| !is_one_way(&shift.rows, *c));
        panels.extend(with_pressure.map(|(c, (role, name))| pressure_panel(&shift.rows, c, format!("{name}, {role}"))));
    }
    let is = |row: &ShiftScoreRow| Health::ALL.map(|health| health == row.health);
    let healths: Vec<_> = shift.rows.iter().map(|row| (row.time_s, is(row))).collect();
    panels.extend(health_panel(&healths));
    let mut spans = phase_spans(shift, "torque phase", TruePhase::Torque, TORQUE_PHASE);
    spans.extend(phase_spans(shift, "inertia phase", TruePhase::Inertia, INERTIA_PHASE));
    spans.sort_by(|a, b| a.start.total_cmp(&b.start));
    Figure { x_label: "time (s)", x_range: (from_s.max(0.0), to_s), spans, panels }
}

/// Whether a clutch of the shift is a one-way clutch, which has no pressure and no valve model.
fn is_one_way(rows: &[ShiftScoreRow], c: usize) -> bool {
    rows.iter().any(|row| row.clutches[c].is_one_way)
}

/// The pieces of a phase; the longest has its name.
fn phase_spans(shift: &ScoredShift, label: &str, phase: TruePhase, colour: &'static str) -> Vec<Span> {
    let pieces = shift.spans_s(phase);
    let longest = pieces.iter().map(|[start, end]| end - start).fold(0.0, f64::max);
    let label = |[start, end]: [f64; 2]| if end - start >= longest { label.to_owned() } else { String::new() };
    pieces.into_iter().map(|piece| Span { label: label(piece), start: piece[0], end: piece[1], colour }).collect()
}

/// Torque of the clutches together at the turbine, with two standard deviations.
fn at_turbine_panel(rows: &[ShiftScoreRow]) -> Panel {
    let points = |of: fn([f64; 2]) -> f64| -> Vec<(f64, f64)> {
        rows.iter().map(|row| (row.time_s, row.at_turbine_n_m.map_or(f64::NAN, of))).collect()
    };
    let curve = |label: &str, stroke: Stroke, points| Series { label: label.to_owned(), stroke, points };
    let turbine = rows.iter().map(|row| (row.time_s, row.turbine_n_m[1])).collect();
    let series = vec![
        curve("clutches together", ESTIMATE, points(|[torque, _]| torque)),
        curve("turbine", Stroke::THIRD, turbine),
    ];
    let band = Band {
        label: "two standard deviations".to_owned(),
        colour: RANGE,
        lower: points(|[torque, sd]| torque - 2.0 * sd),
        upper: points(|[torque, sd]| torque + 2.0 * sd),
    };
    Panel { band: Some(band), ..panel("torque at the turbine (N\u{a0}m)", 170.0, series) }
}

/// Truth, estimate and valve model of a clutch's torque. One that holds has no torque by its valve model, and its range is all
/// that it can hold: neither is drawn.
fn torque_panel(rows: &[ShiftScoreRow], c: usize, clutch: String) -> Panel {
    let held = |clutch: &ClutchRow, value: f64| if clutch.sticks { f64::NAN } else { value };
    let of = |clutch: &ClutchRow| {
        let [truth, estimate, valve] = clutch.torque_n_m;
        let range = clutch.torque_range_n_m.map(|range| range.map(|end| held(clutch, end)));
        ([truth, estimate, held(clutch, valve)], range)
    };
    clutch_panel(rows, c, (format!("torque of {clutch} (N\u{a0}m)"), 125.0, Axis::All), of)
}

/// Truth, estimate and valve model of a clutch's pressure. The axis follows the pressures at which it slips: of one that holds the
/// speeds show nothing.
fn pressure_panel(rows: &[ShiftScoreRow], c: usize, clutch: String) -> Panel {
    let slipping = rows.iter().map(|row| &row.clutches[c]).filter(|clutch| !clutch.sticks);
    let most = slipping.flat_map(|clutch| clutch.pressure_pa).map(mpa).fold(LEAST_MPA, f64::max);
    let of = |clutch: &ClutchRow| (clutch.pressure_pa.map(mpa), clutch.pressure_range_pa.map(|range| range.map(mpa)));
    let axis = Axis::Within(0.0, PRESSURE_ROOM * most);
    clutch_panel(rows, c, (format!("pressure of {clutch} (MPa)"), 110.0, axis), of)
}

fn clutch_panel(
    rows: &[ShiftScoreRow],
    c: usize,
    (y_label, height, axis): (String, f64, Axis),
    of: impl Fn(&ClutchRow) -> ([f64; 3], Option<[f64; 2]>),
) -> Panel {
    let curve = |which: usize, label: &str, stroke: Stroke| Series {
        label: label.to_owned(),
        stroke,
        points: rows.iter().map(|row| (row.time_s, of(&row.clutches[c]).0[which])).collect(),
    };
    let end = |end: usize| {
        let value = |row: &ShiftScoreRow| of(&row.clutches[c]).1.map_or(f64::NAN, |range| range[end]);
        rows.iter().map(|row| (row.time_s, value(row))).collect()
    };
    let mut series = vec![curve(0, "true", Stroke::TRUTH), curve(1, "filter", ESTIMATE)];
    if !is_one_way(rows, c) {
        series.push(curve(2, "valve model", OPEN_LOOP));
    }
    let band = Band { label: "guaranteed range".to_owned(), colour: RANGE, lower: end(0), upper: end(1) };
    Panel { y_label, height, series, band: Some(band), axis }
}
