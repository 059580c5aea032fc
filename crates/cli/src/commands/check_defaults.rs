//! What `wetclutch check` says about the defaults of a vehicle file.

use car::Sensors;
use config::{CarFile, Change, DefaultTaken, VehicleFile};
use study::gearbox::influence::{CarInfluence, ErrorOfEstimate, ValueFrom, car_influences};
use study::{Influence, default_influences};
use trace::units;

use crate::failure::Failure;
use crate::output;

/// Defaults that are shown, if not all are asked for.
const SHOWN: usize = 12;
/// Defaults on which a torque at the turbine depends: with the lock-up clutch closed on the engine's inertia.
const AT_TURBINE: [&str; 2] = ["converter.", "engine.inertia"];
/// Longest value that is shown as it stands in the file.
const LONGEST: usize = 24;

/// Lists the defaults of a vehicle file, those that matter most to an estimate first.
pub(super) fn describe_defaults(vehicle: &VehicleFile, all: bool) -> Result<(), Failure> {
    let taken = &vehicle.defaults_taken;
    if taken.is_empty() {
        return Ok(());
    }
    output::line(&format!("\n{} values are not in the file and are defaults", taken.len()))?;
    let Some(influences) = default_influences(vehicle)? else {
        output::line("the simulated car completes no upshift, so the influence of these values is not known")?;
        return all_names(&vehicle.defaults_taken, &[], true);
    };
    output::line(
        "which matter most: RMS change of pressure and torque of the oncoming clutch, in the torque and inertia phase of a\n\
         simulated upshift when one default is wrong, for the open loop and for the default observer (gearbox)\n",
    )?;
    let shown = if all { influences.len() } else { SHOWN.min(influences.len()) };
    let titles = ["default", "value", "wrong by", "open kPa", "open N m", "gearbox kPa", "gearbox N m"];
    let rows = influences[..shown].iter().map(row);
    output::table(3, titles.map(str::to_owned).to_vec(), rows.collect())?;
    output::line("")?;
    let shown: Vec<&str> = influences[..shown].iter().map(|influence| influence.taken.key.as_str()).collect();
    all_names(taken, &shown, all)
}

fn row(influence: &Influence) -> Vec<String> {
    let mut row =
        vec![influence.taken.key.clone(), short_value(&influence.taken), off(influence.change, &influence.limits)];
    for change in influence.changes {
        row.push(format!("{:.2}", 1e3 * units::mpa(change.pressure_pa)));
        row.push(format!("{:.2}", change.torque_n_m));
    }
    row
}

fn short_value(taken: &DefaultTaken) -> String {
    if taken.value.len() > LONGEST { "a map".to_owned() } else { taken.value.clone() }
}

/// Lists the defaults of a vehicle file with a gearbox, and the values that matter most to an estimate.
pub(super) fn describe_car_values(car: &CarFile, sensors: &Sensors, all: bool) -> Result<(), Failure> {
    let taken = &car.defaults_taken;
    if taken.is_empty() && !all {
        return Ok(());
    }
    output::line(&format!("\n{} values are not in the file and are defaults", taken.len()))?;
    if car.gearbox.has_ratios_alone() {
        let matters = |key: &str| AT_TURBINE.iter().any(|of| key.starts_with(of));
        let (shown, others): (Vec<DefaultTaken>, Vec<DefaultTaken>) =
            taken.iter().cloned().partition(|taken| matters(&taken.key));
        output::line("a torque at the turbine depends on these of them, and in a shift on the masses of the shifts:")?;
        for taken in &shown {
            output::line(&format!("  {} = {}", taken.key, taken.value))?;
        }
        return all_names(&others, &[], all);
    }
    let influences = match car_influences(car, sensors) {
        Ok(Some(influences)) if influences.shifts > 0 => influences,
        // A file is not wrong because a shift of its car cannot be simulated.
        unknown => {
            let why = match unknown {
                Ok(Some(_)) => "no clutch slips in the simulated shifts".to_owned(),
                Ok(None) => "the filter has tables for no shift of this gearbox".to_owned(),
                Err(error) => error.to_string(),
            };
            output::line(&format!("their influence is not known: {why}"))?;
            return all_names(taken, &[], true);
        }
    };
    output::line(&format!(
        "which values matter most: RMS error of torque and pressure of the clutch that drives the inertia phase, while it\n\
         slips, over {} simulated shifts between neighbouring gears, when one value is wrong in all elements, by the default filter and\n\
         by the open loop\n",
        influences.shifts
    ))?;
    let titles =
        ["value", "source", "wrong by", "filter N m", "open N m", "filter kPa", "open kPa"].map(str::to_owned).to_vec();
    let as_it_is = car_row(["no change".to_owned(), String::new(), String::new()], &influences.as_it_is);
    let rows = influences.values.iter().map(value_row);
    output::table(3, titles, std::iter::once(as_it_is).chain(rows).collect())?;
    output::line("")?;
    let shown: Vec<&str> = influences.values.iter().map(|value| value.key).collect();
    all_names(taken, &shown, all)
}

fn value_row(value: &CarInfluence) -> Vec<String> {
    let from = match value.from {
        ValueFrom::File => "the file",
        ValueFrom::Default => "default",
        ValueFrom::Gearbox => "gearbox file",
    };
    car_row([value.key.to_owned(), from.to_owned(), off(Change::Scale, &value.limits)], &value.errors)
}

fn car_row(names: [String; 3], errors: &ErrorOfEstimate) -> Vec<String> {
    let torques = errors.torque_n_m.map(|torque_n_m| format!("{torque_n_m:.2}"));
    let pressures = errors.pressure_pa.map(|pressure_pa| format!("{:.2}", 1e3 * units::mpa(pressure_pa)));
    names.into_iter().chain(torques).chain(pressures).collect()
}

/// The limits in words: `-20 to +20 %`, `x0.5 to x2`, `-0.015 to +0.015`.
fn off(change: Change, limits: &[f64]) -> String {
    let limit = |limit: &f64| match change {
        Change::Scale if (0.5..1.5).contains(limit) && *limit != 0.5 => format!("{:+.0} %", 100.0 * (limit - 1.0)),
        Change::Scale => format!("x {limit}"),
        Change::Add => format!("{limit:+}"),
        Change::Set => format!("{limit}"),
    };
    limits.iter().map(limit).collect::<Vec<_>>().join(", ")
}

/// The defaults that are not in the table.
fn all_names(taken: &[DefaultTaken], shown: &[&str], all: bool) -> Result<(), Failure> {
    let others: Vec<_> = taken.iter().filter(|taken| !shown.contains(&taken.key.as_str())).collect();
    if !all {
        let count = others.len();
        output::line(&format!("{count} other defaults have less effect, or none: --all lists them"))?;
        return Ok(());
    }
    output::line("defaults on which no estimate depends, or of which nothing is known:")?;
    for taken in others {
        output::line(&format!("  {} = {}", taken.key, taken.value))?;
    }
    Ok(())
}
