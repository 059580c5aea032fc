//! Names of the columns of an element's signals in a log or a table.

use drivetrain::CommandKind;

use crate::Car;

/// How the names of an element's columns begin.
pub fn element_column(element: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() { c } else { '_' };
    format!("element_{}", element.to_lowercase().chars().map(plain).collect::<String>())
}

/// The columns with the commands of the valves: element of the gearbox, and name.
pub fn element_commands(car: &Car) -> Vec<(usize, String)> {
    let elements = car.gearbox.elements.iter().zip(&car.clutches).enumerate();
    let columns = elements.filter_map(|(at, (element, clutch))| {
        let unit = match clutch.as_ref()?.valve.command_kind() {
            CommandKind::Current => "current_a",
            CommandKind::DutyCycle => "duty_percent",
        };
        Some((at, format!("{}_{unit}", element_column(&element.name))))
    });
    columns.collect()
}

/// The columns with the measured pressures of the elements: element of the gearbox, and name.
pub fn element_pressures(car: &Car) -> impl Iterator<Item = (usize, String)> + '_ {
    let elements = car.gearbox.elements.iter().zip(&car.clutches).enumerate();
    let pressed = elements.filter(|(_, (_, clutch))| clutch.is_some());
    pressed.map(|(at, (element, _))| (at, format!("{}_pressure_pa", element_column(&element.name))))
}

/// The column with the age of a command or a pressure: how long before its row it was read, s.
pub fn command_age(command: &str) -> String {
    let name = command.rsplit_once('_').map_or(command, |(name, _)| name);
    format!("{name}_age_s")
}

/// The column with the commanded pressure of an element, Pa.
pub fn pressure_command_column(element: &str) -> String {
    format!("{}_pressure_command_pa", element_column(element))
}
