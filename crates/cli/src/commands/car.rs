//! A car with a gearbox, as the commands read and describe it.

use std::path::Path;

use car::{Car, TURBINE_SIDE_INERTIA_KG_M2};
use config::{CarFile, Kind, Source};
use trace::ShownPath as _;
use trace::quantity;

use super::gearbox;
use crate::failure::Failure;
use crate::output;

/// Reads the vehicle file of a car with a gearbox that is to be simulated.
pub(super) fn read_car(path: &Path) -> Result<CarFile, Failure> {
    if Source::read(path)?.kind()? == Kind::Vehicle {
        return Err(Failure::Input(format!(
            "{}: this vehicle file describes one shift, and not a gearbox\nhint: use one with `gearbox`, such as vehicles/eight_speed.toml",
            path.shown()
        )));
    }
    let car = CarFile::read(path)?;
    warn_of_slipping(&car);
    Ok(car)
}

/// Warns if the closed elements of a car that is to be simulated cannot hold what its engine gives: its shifts may not come to an end.
pub(super) fn warn_of_slipping(car: &CarFile) {
    if let Some(slipping) = car.slipping_elements() {
        output::note(&format!("warning: {slipping}"));
    }
}

/// Why there is nothing to show of the shifts of a car, where the filter has tables for none of them.
pub(super) fn no_shift(car: &Car, path: &Path) -> String {
    let why = car.why_not_driven().unwrap_or_else(|| {
        "the filter has tables for no shift of this gearbox\nhint: `wetclutch check` lists its shifts; clutches and brakes need plates (`pack`) and \
         valves, which ratios alone do not give"
            .to_owned()
    });
    format!("{}: {why}", path.shown())
}

/// Prints what a vehicle file with a gearbox describes.
pub(super) fn describe_car(car: &Car) -> Result<(), Failure> {
    let gears = car.gearbox.forward_gears();
    let ratio = |gear: Option<&usize>| gear.map_or(f64::NAN, |&gear| car.gearbox.gears[gear].ratio);
    output::line(&format!(
        "vehicle \"{}\": gearbox \"{}\", {} forward gears, ratio {:.3} to {:.3}, final ratio {:.3}, {} kg, {}",
        car.name,
        car.gearbox.name,
        gears.len(),
        ratio(gears.first()),
        ratio(gears.last()),
        car.driveline.final_ratio,
        car.road.mass_kg,
        if car.converter.is_some() { "torque converter" } else { "no converter" },
    ))?;
    for (element, clutch) in car.gearbox.elements.iter().zip(&car.clutches) {
        if let Some(clutch) = clutch {
            output::line(&format!(
                "  {:4} kiss point {}, holds {} at line pressure{}{}",
                element.name,
                quantity(trace::units::mpa(clutch.clutch.kiss_pressure()), "MPa", 3),
                quantity(clutch.clutch.static_capacity(car.line_pressure_pa), "N m", 0),
                if clutch.valve.falls() { ", valve normally high" } else { "" },
                if clutch.has_stroke { ", with stroke" } else { "" },
            ))?;
        }
    }
    Ok(())
}

/// Prints the gears and shifts of a car's gearbox, and what its elements hold beside what the engine asks of them.
pub(super) fn describe_gearbox(car: &Car) -> Result<(), Failure> {
    gearbox::gears(&car.gearbox)?;
    gearbox::capacities(&car.gearbox, &car.capacities())?;
    output::line(&torques_asked(car))?;
    gearbox::shifts(&car.gearbox)?;
    if car.gearbox.has_ratios_alone() {
        let [minimum, maximum] = TURBINE_SIDE_INERTIA_KG_M2;
        output::line(&format!(
            "ratios alone: `wetclutch estimate` gives the torque of all clutches together at the turbine, with its standard deviation.\n\
             Without `shift_mass` in the gearbox file, M11 is assumed, somewhere from {minimum} to {maximum} kg m2 for an engine of {}, and makes most of that\n\
             deviation in a shift. The torque of a clutch needs the holding torques (level = \"shares\"), its pressure plates and piston besides (`pack`)",
            quantity(190.0, "N m", 0)
        ))?;
    }
    Ok(())
}

/// The turbine torque that is asked of the gears: `278 N m in R, 1; 203 N m in 2, 3`.
fn torques_asked(car: &Car) -> String {
    let mut asked: Vec<(String, Vec<&str>)> = Vec::new();
    for (at, gear) in car.gearbox.gears.iter().enumerate() {
        let torque = quantity(car.max_turbine_torque(at), "N m", 0);
        match asked.iter_mut().find(|(of, _)| *of == torque) {
            Some((_, gears)) => gears.push(&gear.name),
            None => asked.push((torque, vec![&gear.name])),
        }
    }
    let asked: Vec<String> = asked.iter().map(|(torque, gears)| format!("{torque} in {}", gears.join(", "))).collect();
    format!("needed: the largest turbine torque at full throttle, {}", asked.join("; "))
}
