//! The matrix of a car: every shift in every kind, as rows of tables, and as a page.

use car::Car;
use config::CarFile;
use drivetrain::ShiftKind;
use minijinja::{Value, context};
use study::gearbox::SquaredErrors;
use study::gearbox::matrix::{CLASSES, Matrix, MatrixCounts, MatrixRow, NOTHING_N_M, PhaseErrors, Pooled, class};
use trace::Cell;
use trace::shown_units::convert_table;

use crate::figure::{Figure, Series, Stroke};
use crate::log_page::ESTIMATE;
use crate::page::{PageError, origin, render};
use crate::panels::{panel, with_values};
use crate::tables::number;

/// Names of the phases and of the clutches, in the order of the errors.
const PHASES: [&str; 2] = ["torque", "inertia"];
const INERTIA: usize = 1;

/// The ratio of two errors; in brackets where the open loop errs by less than [`NOTHING_N_M`], a dash without rows.
pub fn ratio(errors: &SquaredErrors) -> String {
    match errors.ratio() {
        Some(ratio) if errors.rms_n_m()[1] > NOTHING_N_M => number(ratio, 2),
        Some(ratio) => format!("({})", number(ratio, 2)),
        None => "–".to_owned(),
    }
}

/// Both errors of a torque, N m: filter / open loop.
pub(crate) fn torques(errors: &SquaredErrors) -> String {
    let [estimate, open_loop] = errors.rms_n_m().map(|n_m| number(n_m, 1));
    if errors.rows > 0.0 { format!("{estimate} / {open_loop}") } else { "–".to_owned() }
}

/// Both errors of a pressure, kPa: filter / open loop.
fn pressures(errors: &SquaredErrors) -> String {
    let [estimate, open_loop] = errors.rms_pa().map(|pa| number(1e-3 * pa, 0));
    if errors.rows > 0.0 { format!("{estimate} / {open_loop}") } else { "–".to_owned() }
}

/// The shift by the names of its gears.
fn gears(car: &Car, [from, to]: [usize; 2]) -> String {
    let name = |gear: usize| car.gearbox.gears.get(gear).map_or("?", |gear| gear.name.as_str());
    format!("{}-{}", name(from), name(to))
}

fn above(counts: &MatrixCounts) -> String {
    format!("{} of {}", counts.above, counts.compared)
}

/// The shifts between neighbouring gears that are not made, with the reason of each; none where all are made.
pub fn not_driven(pairs: &[[usize; 2]], car: &Car) -> Option<String> {
    let reasons: Vec<String> =
        pairs.iter().map(|&pair| format!("{} ({})", gears(car, pair), car.why_no_shift(pair))).collect();
    (!reasons.is_empty()).then(|| format!("not driven: {}", reasons.join("; ")))
}

/// The runs that failed, in words.
pub fn failures(matrix: &Matrix, car: &Car) -> Vec<String> {
    let failed = matrix.rows.iter().filter_map(|row| {
        let (message, shift) = (row.failure.as_ref()?, row.shift);
        let (count, draws, kind) = (row.counts.failed, matrix.draws, shift.kind.name());
        Some(format!("{} {kind}: {count} of {draws} runs failed: {message}", gears(car, [shift.from, shift.to])))
    });
    failed.collect()
}

/// Title and rows of the table of shifts.
pub fn shift_rows(matrix: &Matrix, car: &Car) -> (Vec<String>, Vec<Vec<String>>) {
    let titles = [
        "shift",
        "kind",
        "1/|i_off - i_on|",
        "inertia phase",
        "N m",
        "torque phase",
        "N m",
        "other, inertia",
        "other, torque",
        "pressure kPa, inertia",
        "pressure kPa, torque",
        "above",
        "outside",
    ];
    let row = |row: &MatrixRow| {
        let [[torque, other_torque], [inertia, other_inertia]] = &row.errors;
        vec![
            gears(car, [row.shift.from, row.shift.to]),
            row.shift.kind.name().to_owned(),
            number(row.shift.gain, 2),
            ratio(&inertia.torque),
            torques(&inertia.torque),
            ratio(&torque.torque),
            torques(&torque.torque),
            ratio(&other_inertia.torque),
            ratio(&other_torque.torque),
            pressures(&inertia.pressure),
            pressures(&torque.pressure),
            above(&row.counts),
            row.counts.outside.to_string(),
        ]
    };
    (titles.map(str::to_owned).to_vec(), matrix.rows.iter().map(row).collect())
}

/// Title and rows of the table of kinds, by class of `1/|i_off - i_on|`.
pub fn kind_rows(matrix: &Matrix) -> (Vec<String>, Vec<Vec<String>>) {
    let titles = [
        "kind",
        "1/|i_off - i_on|",
        "inertia phase",
        "N m",
        "torque phase",
        "N m",
        "other, inertia",
        "other, torque",
        "above",
    ];
    let mut rows = Vec::new();
    for kind in ShiftKind::ALL {
        for at in 0..CLASSES.len() {
            let of = |shift: &study::gearbox::matrix::MatrixShift| shift.kind == kind && class(shift.gain) == at;
            if !matrix.rows.iter().any(|row| of(&row.shift)) {
                continue;
            }
            let Pooled { torque: [[torque, other_torque], [inertia, other_inertia]], counts } =
                Pooled::of(&matrix.rows, of);
            rows.push(vec![
                kind.name().to_owned(),
                class_name(at),
                ratio(&inertia),
                torques(&inertia),
                ratio(&torque),
                torques(&torque),
                ratio(&other_inertia),
                ratio(&other_torque),
                above(&counts),
            ]);
        }
    }
    (titles.map(str::to_owned).to_vec(), rows)
}

fn class_name(at: usize) -> String {
    match (CLASSES[at], CLASSES.get(at + 1)) {
        (_, Some(to)) if at == 0 => format!("below {to}"),
        (from, Some(to)) => format!("{from} to {to}"),
        (from, None) => format!("above {from}"),
    }
}

/// The shifts as named cells in SI units, for files. RMS errors of the clutch torque, N m, and of the pressure, Pa; without rows
/// they are not a number.
pub fn shift_cells<'a>(row: &MatrixRow, car: &'a Car) -> Vec<(String, Cell<'a>)> {
    let gear = |gear: usize| Cell::Word(car.gearbox.gears.get(gear).map_or("?", |gear| gear.name.as_str()));
    let counts = &row.counts;
    let mut cells = vec![
        ("from_gear".to_owned(), gear(row.shift.from)),
        ("to_gear".to_owned(), gear(row.shift.to)),
        ("kind".to_owned(), Cell::Word(row.shift.kind.name())),
        ("throttle".to_owned(), Cell::Number(row.shift.throttle())),
        ("ratio_gain".to_owned(), Cell::Number(row.shift.gain)),
    ];
    for (phase, clutches) in PHASES.iter().zip(&row.errors) {
        for (clutch, PhaseErrors { torque, pressure }) in ["controlling", "other"].iter().zip(clutches) {
            let mut add = |what: &str, value: f64| {
                let value = if torque.rows > 0.0 { value } else { f64::NAN };
                cells.push((format!("{phase}_phase_{clutch}_{what}"), Cell::Number(value)));
            };
            add("torque_rms_n_m", torque.rms_n_m()[0]);
            add("torque_open_loop_rms_n_m", torque.rms_n_m()[1]);
            add("pressure_rms_pa", pressure.rms_pa()[0]);
            add("pressure_open_loop_rms_pa", pressure.rms_pa()[1]);
        }
    }
    let count = [
        ("failed_runs", counts.failed),
        ("compared_phases", counts.compared),
        ("phases_above_open_loop", counts.above),
        ("compared_shifts", counts.compared_runs),
        ("shifts_above_open_loop", counts.runs_above),
        ("values_compared_with_range", counts.values),
        ("values_outside_range", counts.outside),
        ("values_without_range", counts.unranged),
        ("rows", counts.rows),
        ("rows_that_say_slip", counts.slips_said),
    ];
    cells.extend(count.map(|(name, count)| (name.to_owned(), Cell::Whole(count))));
    cells
}

/// The page of a matrix; it needs nothing but itself.
///
/// # Errors
/// None in a released program; the tests render the template.
pub fn matrix_page(matrix: &Matrix, car: &CarFile, seed: u64) -> Result<String, PageError> {
    let all = Pooled::of(&matrix.rows, |_| true).counts;
    let (mut kind_titles, mut kinds) = kind_rows(matrix);
    let (mut titles, mut rows) = shift_rows(matrix, car);
    convert_table(&mut kind_titles, &mut kinds);
    convert_table(&mut titles, &mut rows);
    titles.insert(0, "#".to_owned());
    (1..).zip(&mut rows).for_each(|(place, row): (usize, _)| row.insert(0, place.to_string()));
    render(
        "matrix.html",
        context! {
            name => "matrix",
            title => "shifts and kinds",
            vehicle_name => &car.name,
            gearbox_name => &car.gearbox.name,
            version => env!("CARGO_PKG_VERSION"),
            draws => matrix.draws,
            seed,
            nothing => NOTHING_N_M,
            kinds => ShiftKind::ALL.map(ShiftKind::name),
            chart => chart(matrix, car),
            figure => error_figure(matrix).html(),
            kind_titles,
            kind_rows => kinds,
            titles,
            rows,
            shifts => matrix.rows.len(),
            counts => context! {
                above => all.above, compared => all.compared, runs_above => all.runs_above,
                compared_runs => all.compared_runs, outside => all.outside, values => all.values,
                slips => all.slips_said, rows => all.rows,
            },
            without_tables => not_driven(&matrix.without_tables, car),
            failures => failures(matrix, car),
            inputs => origin(&[&car.source]),
        },
    )
}

/// RMS errors of filter and open loop over the shifts.
fn error_figure(matrix: &Matrix) -> Figure {
    let curves = [("filter", ESTIMATE), ("open loop", Stroke::THIRD)];
    let panels = PHASES.iter().enumerate().map(|(phase, name)| {
        let series = curves.into_iter().enumerate().map(|(which, (label, stroke))| Series {
            label: label.to_owned(),
            stroke,
            points: (1_u32..)
                .zip(&matrix.rows)
                .map(|(place, row)| {
                    let torque = &row.errors[phase][0].torque;
                    (f64::from(place), if torque.rows > 0.0 { torque.rms_n_m()[which] } else { f64::NAN })
                })
                .collect(),
        });
        panel(&format!("{name} phase (N\u{a0}m)"), 140.0, series.collect())
    });
    Figure {
        x_label: "number of the shift".into(),
        x_range: (1.0, (matrix.rows.len() as f64).max(2.0)),
        spans: Vec::new(),
        panels: with_values(panels.collect()).0,
    }
}

/// A row for each pair of gears, a cell for each kind: ratios of inertia and torque phase, coloured.
fn chart(matrix: &Matrix, car: &Car) -> Vec<Value> {
    let pair = |row: &MatrixRow| [row.shift.from.min(row.shift.to), row.shift.from.max(row.shift.to)];
    let mut pairs: Vec<[usize; 2]> = Vec::new();
    for row in &matrix.rows {
        if !pairs.contains(&pair(row)) {
            pairs.push(pair(row));
        }
    }
    let cell = |errors: &SquaredErrors| {
        let is_shown = errors.rms_n_m()[1] > NOTHING_N_M;
        context! { text => ratio(errors), colour => errors.ratio().filter(|_| is_shown).map(colour) }
    };
    let row = |of: [usize; 2]| {
        let cells = ShiftKind::ALL.map(|kind| {
            let row = matrix.rows.iter().find(|row| pair(row) == of && row.shift.kind == kind);
            let phase = |at: usize| row.map(|row| cell(&row.errors[at][0].torque));
            [phase(INERTIA), phase(0)]
        });
        let gain = matrix.rows.iter().find(|row| pair(row) == of).map(|row| number(row.shift.gain, 1));
        context! { pair => gears(car, of).replace('-', "–"), gain, cells => cells.into_iter().flatten().collect::<Vec<_>>() }
    };
    pairs.into_iter().map(row).collect()
}

/// Blue below the open loop, orange above it.
fn colour(ratio: f64) -> String {
    let shade = (ratio - 1.0).abs().min(1.0) * 0.55;
    if ratio < 1.0 { format!("rgba(0,114,178,{shade:.2})") } else { format!("rgba(213,94,0,{shade:.2})") }
}
