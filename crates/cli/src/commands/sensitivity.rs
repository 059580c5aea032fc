//! `wetclutch sensitivity`.

use std::path::{Path, PathBuf};

use car::{Car, ErrorBudget};
use config::{Kind, Source, VehicleFile};
use report::car_sensitivity_page::{BOUND_AND_STD_DEV, car_sensitivity_page, hidden_phases, sensitivity_rows};
use report::sensitivity_page;
use serde_json::json;
use study::gearbox::sensitivity::{PhaseOfShift, ShiftErrorKind, ShiftSensitivity, car_sensitivity};
use study::sensitivity::{ShaftEffect, ValveEffect, shaft_level, valve_alone};
use study::{PhaseSensitivity, sensitivity as find};
use trace::ShownPath as _;

use super::car::no_shift;
use super::matrix::sensors_or_bench;
use crate::args::SensitivityOptions;
use crate::browser;
use crate::commands::{read_car, replaceable, warn_of_sensors, write_text};
use crate::failure::Failure;
use crate::output;
use trace::quantity;
use wetclutch::shell_quoted;

pub(crate) fn sensitivity(options: &SensitivityOptions) -> Result<(), Failure> {
    options.output.as_deref().map(|folder| replaceable(folder, &["sensitivity.html"])).transpose()?;
    let vehicle = match &options.vehicle {
        Some(path) if Source::read(path)?.kind()? == Kind::Car => return of_car(options, path),
        Some(path) => VehicleFile::read(path)?,
        None => VehicleFile::built_in()?,
    };
    if options.sensors.is_some() {
        warn_of_sensors();
    }
    let (phases, valve, shaft) = (find(&vehicle), valve_alone(&vehicle), shaft_level(&vehicle));
    if let Some(page) = page_of(options) {
        write_text(&page, &sensitivity_page(&phases, &valve, &shaft, &vehicle)?)?;
    }
    if options.json {
        output::json(&json!({ "phases": phases, "valve": valve, "shaft": shaft }))?;
    } else {
        print(&phases, &valve, &shaft)?;
    }
    show_page(options)
}

/// The place of the page.
fn page_of(options: &SensitivityOptions) -> Option<PathBuf> {
    options.output.as_ref().map(|folder| folder.join("sensitivity.html"))
}

/// Says where the page is, and opens it.
fn show_page(options: &SensitivityOptions) -> Result<(), Failure> {
    let Some(page) = page_of(options) else { return Ok(()) };
    if !options.json {
        output::line(&format!("page: {}", page.shown()))?;
    }
    browser::open_if(options.open.is_wanted, &page);
    Ok(())
}

fn print(phases: &[PhaseSensitivity], valve: &[ValveEffect], shaft: &[ShaftEffect]) -> Result<(), Failure> {
    for phase in phases {
        output::line(&format!(
            "{}, {}: the accelerations change by {:.0} rad/s^2 per MPa\n",
            phase.phase.replace('_', " "),
            phase.view.name(),
            phase.influence_rad_s2_mpa
        ))?;
        let head = [
            "error",
            "bound",
            "unit",
            "equivalent pressure error, kPa",
            "per unit, kPa",
            "clutch torque per unit, N m",
            "angle to the pressure",
        ];
        let rows = phase.effects.iter().map(|effect| {
            vec![
                effect.error.to_owned(),
                effect.bound_text(),
                effect.unit.to_owned(),
                format!("{:.1}", 1e-3 * (effect.bound * effect.pressure_pa_per_unit).abs()),
                format!("{:.2}", 1e-3 * effect.pressure_pa_per_unit),
                format!("{:.2}", effect.clutch_n_m_per_unit),
                effect.angle_deg.map_or_else(|| "one speed".to_owned(), |angle| format!("{angle:.1} deg")),
            ]
        });
        output::table(1, head.map(str::to_owned).to_vec(), rows.collect())?;
        output::line("")?;
    }
    let kpa = |effect: &ValveEffect| format!("{} {}", effect.error, quantity(1e-3 * effect.pressure_pa, "kPa", 1));
    output::line(&format!(
        "pressure error of the open loop in a shift: {}\n",
        valve.iter().map(kpa).collect::<Vec<_>>().join(", ")
    ))?;
    let n_m = |effect: &ShaftEffect| format!("{} {}", effect.error, quantity(effect.torque_n_m, "N m", 0));
    output::line(&format!(
        "error of the level of the shaft torque, which the speeds do not show: {}\n",
        shaft.iter().map(n_m).collect::<Vec<_>>().join(", ")
    ))?;
    Ok(())
}

/// The same for every shift of a car with a gearbox.
fn of_car(options: &SensitivityOptions, path: &Path) -> Result<(), Failure> {
    let car = read_car(path)?;
    let shifts = car_sensitivity(&car, &sensors_or_bench(options.sensors.as_deref())?)?;
    if shifts.is_empty() {
        return Err(Failure::Input(no_shift(&car, path)));
    }
    if let Some(page) = page_of(options) {
        write_text(&page, &car_sensitivity_page(&shifts, &car)?)?;
    }
    if options.json {
        let objects: Vec<_> = shifts.iter().map(|shift| json_of(shift, &car)).collect();
        output::json(&json!({ "shifts": objects }))?;
    } else {
        print_of_car(&shifts, &car, path)?;
    }
    show_page(options)
}

fn print_of_car(shifts: &[ShiftSensitivity], car: &Car, path: &Path) -> Result<(), Failure> {
    output::line(
        "standard deviation of the estimated torque of the clutch that drives the inertia phase: filter / valve model alone, and their ratio,\n\
         where each error is anywhere within its bound, independent of the others; hidden: the ratio is above 0.9, the speeds show nothing of\n\
         this torque, and the estimate is that of the valve model\n",
    )?;
    let (titles, rows) = sensitivity_rows(shifts, car);
    output::table(3, titles, rows)?;
    let budget = ErrorBudget::of_car(car);
    let bound = |error: ShiftErrorKind| format!("{} {}", error.name(), error.bound(&budget));
    let bounds: Vec<String> = ShiftErrorKind::ALL.into_iter().filter(|error| error.is_of(car)).map(bound).collect();
    let [hidden, all] = hidden_phases(shifts);
    output::line(&format!("\nbounds, in both directions: {}\nhidden: {hidden} of {all} phases", bounds.join(", ")))?;
    // A car without converter has no designs.
    if car.converter.is_some() {
        output::line(&format!("{BOUND_AND_STD_DEV}: `wetclutch design {}`.", shell_quoted(path)))?;
    }
    Ok(())
}

/// One shift with its phases, in SI units.
fn json_of(shift: &ShiftSensitivity, car: &Car) -> serde_json::Value {
    let gear = |gear: usize| car.gearbox.gears[gear].name.as_str();
    let phase = |phase: &Option<PhaseOfShift>| {
        phase.as_ref().map(|phase| {
            json!({
                "mean_torque_n_m": phase.torque_n_m,
                "deviation_n_m": phase.std_dev_n_m(),
                "deviation_pa": phase.std_dev_pa(),
                "hidden": phase.is_hidden(),
                "effects": phase.effects,
            })
        })
    };
    let [torque, inertia] = &shift.phases;
    json!({
        "from_gear": gear(shift.shift.from),
        "to_gear": gear(shift.shift.to),
        "kind": shift.shift.kind.name(),
        "element": car.gearbox.elements[shift.element].name,
        "ratio_gain": shift.shift.gain,
        "torque_phase": phase(torque),
        "inertia_phase": phase(inertia),
    })
}
