//! The simulated car with its shift controller, as the library `embedded/car_fmu` has it.

use config::CarFile;
use drivetrain::CommandKind;

use super::Model;
use super::description::Description;
use super::variables::Variable;
use crate::ExportedFilter;

/// References: inputs, outputs of the car, whole outputs, and outputs of the elements, four of each.
const INPUTS: usize = 1;
const OUTPUTS: usize = 100;
const WHOLE: usize = 200;
const ELEMENTS: usize = 1000;
const OF_ELEMENT: usize = 4;

/// The model of a car.
pub(crate) fn of_car(filter: &ExportedFilter, file: &CarFile) -> Model {
    let digits = filter.vehicle_sha256.get(..32).unwrap_or_default();
    let description = Description {
        name: format!("wetclutch_{}_car", filter.name),
        library: "wetclutch_car_fmu",
        about: format!("Car with its shift controller: {}", filter.car.name),
        token: format!("{{{digits}}}"),
        is_serialised: false,
        variables: variables(filter),
    };
    let text = |text: &str| text.as_bytes().to_vec();
    let resources = vec![
        ("vehicle.toml", text(&file.source.text)),
        ("gearbox.toml", text(&file.gearbox_source.text)),
        ("drive.toml", text(include_str!("drive.toml"))),
    ];
    Model { description, resources }
}

fn variables(filter: &ExportedFilter) -> Vec<Variable> {
    let inputs = [
        ("accelerator", "1", "accelerator, 0 to 1"),
        ("brake", "1", "brake, 0 to 1"),
        ("grade_rad", "rad", "grade, positive uphill"),
    ];
    let outputs = [
        ("engine_rad_s", "rad/s", "engine speed"),
        ("turbine_rad_s", "rad/s", "turbine speed, of the gearbox input without a converter"),
        ("output_rad_s", "rad/s", "speed of the gearbox output"),
        ("wheel_rad_s", "rad/s", "speed of the driven wheels"),
        ("vehicle_m_s", "m/s", "speed of the vehicle"),
        ("engine_n_m", "N m", "torque of the engine at the crank"),
        ("turbine_n_m", "N m", "torque at the gearbox input"),
        ("shaft_n_m", "N m", "torque of the drive shafts at the wheels"),
    ];
    let gears = filter.car.gearbox.gears.iter().enumerate();
    let gears: Vec<String> = gears.map(|(place, gear)| format!("{place} is {}", gear.name)).collect();
    let gears = format!("-1 neutral, {}", gears.join(", "));
    let whole = [
        ("gear_from", format!("gear, during a shift the one that is left: {gears}")),
        ("gear_to", format!("gear that is wanted: {gears}")),
        ("is_shifting", "1 while a shift is under way".to_owned()),
    ];
    let real = |(reference, (name, unit, meaning)): (usize, (&str, &'static str, &str)), start| {
        variable(name.to_owned(), reference, start, true, unit, meaning.to_owned())
    };
    let mut all: Vec<Variable> = (INPUTS..).zip(inputs).map(|input| real(input, Some(0.0))).collect();
    all.extend((OUTPUTS..).zip(outputs).map(|output| real(output, None)));
    all.extend(
        (WHOLE..)
            .zip(whole)
            .map(|(reference, (name, meaning))| variable(name.to_owned(), reference, None, false, "1", meaning)),
    );
    for (at, element) in filter.car.gearbox.elements.iter().enumerate() {
        let clutch = filter.car.clutches.get(at).and_then(Option::as_ref);
        let command = match clutch.map(|clutch| clutch.valve.command_kind()) {
            Some(CommandKind::DutyCycle) => "%",
            _ => "A",
        };
        let first = ELEMENTS + OF_ELEMENT * at;
        let of_element = [
            ("command", command, "command of the valve"),
            ("pressure_pa", "Pa", "cylinder pressure"),
            ("torque_n_m", "N m", "torque, positive when it drives its output side"),
            ("slip_rad_s", "rad/s", "slip, input side less output side"),
        ];
        all.extend((first..).zip(of_element).map(|(reference, (name, unit, meaning))| {
            variable(
                format!("element_{at}.{name}"),
                reference,
                None,
                true,
                unit,
                format!("{meaning}: {}", element.name),
            )
        }));
    }
    all
}

fn variable(
    name: String,
    reference: usize,
    start: Option<f64>,
    is_real: bool,
    unit: &'static str,
    meaning: String,
) -> Variable {
    Variable { name, reference, start, is_real, unit, meaning }
}
