//! `wetclutch design` of a car with a gearbox: one of its shifts, or a table of all upshifts.

use car::{Car, OneShiftError, Vehicle};
use config::CarFile;
use design::{DiscreteCertificate, Model, Quantity, design_discrete_phase};
use observer::Phase;
use report::tables::phase_name;
use serde_json::{Map, Value, json};
use trace::{ShownPath as _, units};

use super::design::{not_met, of_vehicle, warn_of_unused};
use super::progress;
use crate::args::{Design, DesignChoice, MethodChoice};
use crate::failure::Failure;
use crate::output;
use wetclutch::shell_quoted;

/// What the designs are not for, and what serves there.
const OTHER_KINDS: &str = "Gains are designed for upshifts with a driving engine. In the other kinds of shift, and between shifts, the gearbox filter \
                           estimates\n(`wetclutch estimate`): its gains follow from the variances of the readings and of the car's errors.";

/// In the table, where no gain reduces the bound.
const OPEN_LOOP: &str = "open loop is used";

pub(super) fn of_car(options: &Design) -> Result<(), Failure> {
    if options.bounds.is_some() {
        return Err(Failure::Input(
            "--bounds has values for a vehicle file of one shift\n\
             hint: the bounds of a car with a gearbox are in its file, under [error_bounds] and [clutch.NAME.error_bounds] (docs/reference/vehicle-file.md)"
                .to_owned(),
        ));
    }
    let car = CarFile::read(&options.vehicle)?;
    let path = options.vehicle.shown();
    let named = |error: OneShiftError| Failure::Input(format!("{path}: {error}"));
    match &options.shift {
        Some(shift) => {
            let gears = car.shift_named(shift).map_err(named)?;
            let vehicle = car.of_shift(gears).map_err(named)?;
            let missed = of_vehicle(&vehicle, &car.source, options, &about(&car, &vehicle, gears))?;
            if options.offset_max.is_some() {
                return not_met(missed, options);
            }
            if !missed.is_empty() && !options.json {
                output::line(
                    "what is not met is a default of one shift, and no requirement of this file: --offset-max replaces it",
                )?;
            }
            Ok(())
        }
        None if options.page.page.is_some() => Err(Failure::Input(
            "--page is for the gains of one shift\nhint: name it with --shift, such as --shift 1-2".to_owned(),
        )),
        None => table(&car, options).map_err(|error| match error {
            TableError::Shift(error) => named(error),
            TableError::Other(failure) => failure,
        }),
    }
}

/// What the gains of a shift are on, and what they are for.
fn about(car: &Car, vehicle: &Vehicle, gears: [usize; 2]) -> Vec<String> {
    let shift = &vehicle.shift;
    let [on_turbine, _] = shift.slip_oncoming;
    vec![
        format!(
            "ratio {:.3} to {:.3}, 1/(i_off - i_on) = {:.2}; oncoming element {}, alpha {:.3}: its slip is alpha (w_t - {:.3} w_o)",
            shift.ratio_offgoing(),
            shift.ratio_oncoming(),
            ratio_gain(vehicle),
            oncoming_name(car, gears),
            on_turbine,
            shift.ratio_oncoming(),
        ),
        OTHER_KINDS.to_owned(),
    ]
}

/// What an error of a torque is multiplied by in the torque phase: `1/(i_off - i_on)`.
fn ratio_gain(vehicle: &Vehicle) -> f64 {
    (vehicle.shift.ratio_offgoing() - vehicle.shift.ratio_oncoming()).abs().recip()
}

/// Name of the element that closes.
fn oncoming_name(car: &Car, [from, to]: [usize; 2]) -> &str {
    let shift = car.gearbox.shift(from, to).and_then(|shift| shift.change.single());
    shift.map_or("", |[_, oncoming]| car.gearbox.elements[oncoming].name.as_str())
}

/// An upshift with its certificates, in the order of the phases.
struct Row<'c> {
    gears: [usize; 2],
    oncoming: &'c str,
    vehicle: Vehicle,
    certificates: Vec<(Phase, DiscreteCertificate)>,
}

enum TableError {
    Shift(OneShiftError),
    Other(Failure),
}

impl<E: Into<Failure>> From<E> for TableError {
    fn from(error: E) -> Self {
        Self::Other(error.into())
    }
}

/// The bounds of all upshifts from each forward gear to the next.
fn table(car: &CarFile, options: &Design) -> Result<(), TableError> {
    let method = options.method.unwrap_or(MethodChoice::PeakToPeak);
    let model = model_of(options, method)?;
    let quantity = options.bound_on.map_or(Quantity::ClutchTorque, Quantity::from);
    let forward = car.gearbox.forward_gears();
    let (mut rows, mut without) = (Vec::new(), Vec::new());
    let bar = progress(forward.len().saturating_sub(1) as u64, 0);
    for gears in forward.windows(2).map(|pair| [pair[0], pair[1]]) {
        match car.of_shift(gears) {
            Ok(vehicle) => {
                let design = |&phase: &Phase| {
                    let sample_time_s = options.sample_time_s();
                    design_discrete_phase(&vehicle, model, method.into(), quantity, phase, sample_time_s)
                        .map(|certificate| (phase, certificate))
                };
                let certificates = options.phases().iter().map(design).collect::<Result<_, _>>()?;
                rows.push(Row { gears, oncoming: oncoming_name(car, gears), vehicle, certificates });
            }
            Err(error @ OneShiftError::NoConverter) => {
                return Err(TableError::Shift(error));
            }
            Err(error) => without.push(error.to_string().lines().next().unwrap_or_default().to_owned()),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    if options.json {
        let objects: Vec<_> = rows.iter().map(|row| row.json(car)).collect();
        output::exact_json(&json!({ "shifts": objects }))?;
        return Ok(());
    }
    print(car, options, (model, method, quantity), &rows, &without)?;
    Ok(())
}

/// The model of the table; refuses what it has no use for.
fn model_of(options: &Design, method: MethodChoice) -> Result<Model, Failure> {
    let hint = "\nhint: the table compares bounds for a sample time: `--observer rigid` or `compliant`, with any method but `iss`; --shift 1-2 gives \
                the gains of one shift";
    let model = match options.observer {
        DesignChoice::Rigid => Model::Rigid,
        DesignChoice::Compliant => Model::Compliant,
        DesignChoice::Sliding => {
            return Err(Failure::Input(format!("`--observer sliding` has no certificate{hint}")));
        }
    };
    if method == MethodChoice::Iss {
        return Err(Failure::Input(format!("`--method iss` has no bound for a sample time{hint}")));
    }
    warn_of_unused(&Design { method: Some(method), ..options.clone() });
    Ok(model)
}

impl Row<'_> {
    fn json(&self, car: &Car) -> Value {
        let gear = |gear: usize| car.gearbox.gears[gear].name.as_str();
        let mut object = Map::new();
        object.insert("from_gear".to_owned(), json!(gear(self.gears[0])));
        object.insert("to_gear".to_owned(), json!(gear(self.gears[1])));
        object.insert("element".to_owned(), json!(self.oncoming));
        object.insert("alpha".to_owned(), json!(self.vehicle.shift.slip_oncoming[0]));
        object.insert("ratio_gain".to_owned(), json!(ratio_gain(&self.vehicle)));
        for (phase, certificate) in &self.certificates {
            let n_m = |pascal: f64| units::mpa(pascal) * certificate.torque_n_m_mpa;
            let bounds = json!({
                "open_loop_bound_pa": certificate.open_loop_bound_pa,
                "best_gain_bound_pa": certificate.best_gain_bound_pa,
                "open_loop_bound_n_m": n_m(certificate.open_loop_bound_pa),
                "best_gain_bound_n_m": n_m(certificate.best_gain_bound_pa),
                "uses_open_loop": certificate.uses_open_loop,
            });
            object.insert(phase.name().to_owned(), bounds);
        }
        Value::Object(object)
    }

    /// Its cells.
    fn cells(&self, car: &Car, quantity: Quantity) -> Vec<String> {
        let mut cells = vec![
            car.shift_name(self.gears.into()),
            self.oncoming.to_owned(),
            format!("{:.3}", self.vehicle.shift.slip_oncoming[0]),
            format!("{:.2}", ratio_gain(&self.vehicle)),
        ];
        for (_, certificate) in &self.certificates {
            let size = |pascal: f64| match quantity {
                Quantity::ClutchTorque => format!("{:.1}", units::mpa(pascal) * certificate.torque_n_m_mpa),
                Quantity::Pressure => format!("{:.1}", 1e-3 * pascal),
            };
            cells.push(size(certificate.open_loop_bound_pa));
            cells.push(match certificate.uses_open_loop {
                true => OPEN_LOOP.to_owned(),
                false => size(certificate.best_gain_bound_pa),
            });
        }
        cells
    }
}

fn print(
    car: &CarFile,
    options: &Design,
    (model, method, quantity): (Model, MethodChoice, Quantity),
    rows: &[Row<'_>],
    without: &[String],
) -> Result<(), Failure> {
    let (what, unit) = match quantity {
        Quantity::ClutchTorque => ("torque", "N m"),
        Quantity::Pressure => ("pressure", "kPa"),
    };
    let of_model = match model {
        Model::Rigid => "rigid",
        Model::Compliant => "compliant",
    };
    let method = clap::ValueEnum::to_possible_value(&method).map_or(String::new(), |value| value.get_name().to_owned());
    output::line(&format!(
        "{} ({})\n\n\
         certified steady-state bound on the error of the {what} of the oncoming clutch: of the valve model alone (open loop) and with the best gain\n\
         (observer {of_model}, method {method}, sample time {} ms), with all errors of the car at their bounds at the same time.\n\
         {OPEN_LOOP}: no gain reduces the bound; in this phase the shift hides its pressure.\n",
        car.name,
        car.source.path.shown(),
        1e3 * options.sample_time_s(),
    ))?;
    let mut titles = ["upshift", "oncoming", "alpha", "1/|i_off - i_on|"].map(str::to_owned).to_vec();
    for &phase in options.phases() {
        titles.push(format!("{}: open loop, {unit}", phase_name(phase)));
        titles.push(format!("best gain, {unit}"));
    }
    let cells = rows.iter().map(|row| row.cells(car, quantity));
    output::table(2, titles, cells.collect())?;
    for reason in without {
        output::line(&format!("no design: {reason}"))?;
    }
    let vehicle = shell_quoted(&options.vehicle);
    output::line(&format!(
        "\n`wetclutch design {vehicle} --shift FROM-TO` prints gains and certificates of one shift.\n{OTHER_KINDS}\n\
         {}: `wetclutch sensitivity {vehicle}`.",
        report::car_sensitivity_page::BOUND_AND_STD_DEV
    ))?;
    Ok(())
}
