//! How errors act on the estimates of every shift of a car: rows of tables, and a page.

use car::{Car, ErrorBudget};
use config::CarFile;
use minijinja::{Value, context};
use study::gearbox::sensitivity::{PhaseOfShift, ShiftErrorKind, ShiftSensitivity};

use crate::figure::{Figure, Series, Stroke};
use crate::log_page::ESTIMATE;
use crate::page::{PageError, origin, render};
use crate::panels::{panel, with_values};
use crate::tables::number;

/// Names of the phases, in the order of [`ShiftSensitivity::phases`].
const PHASES: [&str; 2] = ["torque phase", "inertia phase"];

/// A word where the speeds are of no use.
const HIDDEN: &str = "hidden";

/// Why a certified bound and this statistic may call different phases hidden; without its full stop.
pub const BOUND_AND_STD_DEV: &str = "`design` and `sensitivity` may call different phases hidden: `design` bounds the error with all errors at their bounds at the \
                                       same time, for a fixed gain;\n`sensitivity` gives the standard deviation of the gearbox filter, with errors \
                                       anywhere within their bounds, independent of each other";

/// Titles and rows of the summary: a row for each shift.
pub fn sensitivity_rows(shifts: &[ShiftSensitivity], car: &Car) -> (Vec<String>, Vec<Vec<String>>) {
    let titles = [
        "shift",
        "kind",
        "clutch",
        "1/|i_off - i_on|",
        "torque phase",
        "N m",
        "largest error",
        "inertia phase",
        "N m",
        "largest error",
    ];
    let row = |shift: &ShiftSensitivity| {
        let mut row = names(shift, car);
        for phase in &shift.phases {
            row.extend(match phase {
                Some(phase) => [ratio(phase), std_devs(phase), largest(phase)],
                None => ["–", "–", "–"].map(str::to_owned),
            });
        }
        row
    };
    (titles.map(str::to_owned).to_vec(), shifts.iter().map(row).collect())
}

/// Shift, kind, clutch and `1/|i_off - i_on|`.
fn names(shift: &ShiftSensitivity, car: &Car) -> Vec<String> {
    let gear = |gear: usize| car.gearbox.gears.get(gear).map_or("?", |gear| gear.name.as_str());
    let element = car.gearbox.elements.get(shift.element).map_or("?", |element| element.name.as_str());
    let of = shift.shift;
    vec![
        format!("{}-{}", gear(of.from), gear(of.to)),
        of.kind.name().to_owned(),
        element.to_owned(),
        number(of.gain, 2),
    ]
}

/// Standard deviation by the filter over that by the valve model alone, or that the speeds show nothing.
fn ratio(phase: &PhaseOfShift) -> String {
    if phase.is_hidden() { HIDDEN.to_owned() } else { number(phase.ratio(), 2) }
}

/// Both standard deviations of the torque: filter / valve model alone.
fn std_devs(phase: &PhaseOfShift) -> String {
    let [filter, alone] = phase.std_dev_n_m().map(|n_m| number(n_m, 1));
    format!("{filter} / {alone}")
}

fn largest(phase: &PhaseOfShift) -> String {
    phase.largest().map_or_else(String::new, |effect| effect.error.name().to_owned())
}

/// Number of phases of shifts in which the speeds are of no use, and of all phases.
pub fn hidden_phases(shifts: &[ShiftSensitivity]) -> [usize; 2] {
    let phases = || shifts.iter().flat_map(|shift| shift.phases.iter().flatten());
    [phases().filter(|phase| phase.is_hidden()).count(), phases().count()]
}

/// The page; it needs nothing but itself.
///
/// # Errors
/// None in a released program; the tests render the template.
pub fn car_sensitivity_page(shifts: &[ShiftSensitivity], car: &CarFile) -> Result<String, PageError> {
    let errors: Vec<ShiftErrorKind> = ShiftErrorKind::ALL.into_iter().filter(|error| error.is_of(car)).collect();
    let budget = ErrorBudget::of_car(car);
    let bounds = errors.iter().map(|error| context! { error => error.name(), bound => error.bound(&budget) });
    let phases = PHASES.iter().enumerate().map(|(at, name)| {
        let numbered = shifts.iter().enumerate();
        let rows = numbered
            .filter_map(|(number, shift)| Some(detail((number + 1, shift), shift.phases[at].as_ref()?, &errors, car)));
        context! { name => *name, rows => rows.collect::<Vec<_>>() }
    });
    let [hidden, all] = hidden_phases(shifts);
    render(
        "car_sensitivity.html",
        context! {
            name => "Sensitivity",
            title => "Sensitivity of the estimated torques to errors",
            version => env!("CARGO_PKG_VERSION"),
            vehicle_name => &car.name,
            gearbox_name => &car.gearbox.name,
            bounds => bounds.collect::<Vec<_>>(),
            errors => errors.iter().map(|error| error.name()).collect::<Vec<_>>(),
            phases => phases.collect::<Vec<_>>(),
            hidden,
            all,
            figure => std_dev_figure(shifts).html(),
            // A car without converter has no designs.
            bound_and_deviation => car.converter.is_some().then(|| BOUND_AND_STD_DEV.replace('`', "")),
            inputs => origin(&[&car.source]),
        },
    )
}

/// Standard deviations of filter and valve model over the shifts.
fn std_dev_figure(shifts: &[ShiftSensitivity]) -> Figure {
    let curves = [("filter", ESTIMATE), ("valve model", Stroke::THIRD)];
    let panels = PHASES.iter().enumerate().map(|(at, name)| {
        let series = curves.into_iter().enumerate().map(|(which, (label, stroke))| Series {
            label: label.to_owned(),
            stroke,
            points: (1_u32..)
                .zip(shifts)
                .map(|(place, shift)| {
                    let std_dev = shift.phases[at].as_ref().map_or(f64::NAN, |phase| phase.std_dev_n_m()[which]);
                    (f64::from(place), std_dev)
                })
                .collect(),
        });
        panel(&format!("{name} (N\u{a0}m)"), 140.0, series.collect())
    });
    Figure {
        x_label: "number of the shift".into(),
        x_range: (1.0, (shifts.len() as f64).max(2.0)),
        spans: Vec::new(),
        panels: with_values(panels.collect()).0,
    }
}

/// One shift in one phase, with every error.
fn detail(
    (place, shift): (usize, &ShiftSensitivity),
    phase: &PhaseOfShift,
    errors: &[ShiftErrorKind],
    car: &Car,
) -> Value {
    let maximum = phase.std_dev_n_m().into_iter().fold(1e-9, f64::max);
    let cell = |error: &ShiftErrorKind| {
        let effect = phase.effects.iter().find(|effect| effect.error == *error).map_or(0.0, |e| e.torque_n_m[0]);
        context! { text => number(effect, 1), shade => format!("{:.2}", (0.35 * effect / maximum).min(0.6)) }
    };
    let [filter_pa, alone_pa] = phase.std_dev_pa().map(|pa| number(1e-3 * pa, 0));
    context! {
        place,
        names => names(shift, car),
        torque => number(phase.torque_n_m, 0),
        ratio => ratio(phase),
        is_hidden => phase.is_hidden(),
        torques => std_devs(phase),
        pressures => format!("{filter_pa} / {alone_pa}"),
        effects => errors.iter().map(cell).collect::<Vec<_>>(),
    }
}
