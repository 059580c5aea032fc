//! What the estimates of a car are certified for, and under which assumptions.

use std::fmt::Write as _;

use crate::ExportedFilter;
use crate::c_text::hex_float;

/// `certificate.md`.
pub(crate) fn certificate(filter: &ExportedFilter) -> String {
    let budget = &filter.budget;
    let mut text = format!(
        "# What is certified for \"{}\"\n\n\
         Vehicle file SHA-256 `{}`, gearbox file SHA-256 `{}`, wetclutch {}.\n\n\
         **Guaranteed** are the ranges of pressure and torque (`pressure_range_pa`, `torque_range_n_m`, `element_range_pa`): they hold while every \
         error is within its bound below, and while the valve commands of the input are those that the valves get. The estimate itself is the \
         most probable one of a Kalman filter; its standard deviation is no bound. The filter has no constant gains: it computes them in each step \
         from the variances in the parameters.\n\n\
         ## Bounds of each element\n\n\
         | element | friction factor | valve gain factor | valve lag factor | valve delay, s | hysteresis, Pa | command error | highest pressure, Pa |\n\
         |---|---|---|---|---|---|---|---|\n",
        filter.car.name,
        filter.vehicle_sha256,
        filter.gearbox_sha256,
        env!("CARGO_PKG_VERSION"),
    );
    let elements = filter.car.gearbox.elements.iter().zip(&budget.elements).enumerate();
    for (at, (element, errors)) in elements {
        let Some(errors) = errors.as_ref().filter(|_| filter.tables.place(at).is_some()) else { continue };
        let pair = |[low, high]: [f64; 2]| format!("{} to {}", number(low), number(high));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            element.name,
            pair(errors.friction_factor),
            pair(errors.valve_gain_factor),
            pair(errors.valve_lag_factor),
            pair(errors.valve_delay_s),
            number(errors.valve_hysteresis_pa),
            number(errors.command),
            number(errors.pressure_max_pa),
        );
    }
    text += "\n## Errors that the filter expects\n\n| error, relative | bound |\n|---|---|\n";
    for (name, bound) in [
        ("capacity of the converter", budget.converter),
        ("engine torque as the engine's controller reports it", budget.engine),
        ("turbine-side inertia", budget.inertia),
        ("stiffness of the drive shafts", budget.stiffness),
        ("scale of the wheel speed", budget.wheel_scale),
    ] {
        let _ = writeln!(text, "| {name} | {} |", number(bound));
    }
    let shifts: Vec<String> = filter.shifts().map(|shift| filter.shift_name(shift)).collect();
    let _ = write!(
        text,
        "\n## What is assumed\n\n\
         - Shifts: {}. In any other change of the gear the valve models alone give the pressures.\n\
         - A command is at most {} s older than the step that first shows it, and never older than the time step.\n\
         - The direction of a clutch torque is that of its slip, where the speeds show one beyond their errors; else either is possible.\n\
         - The drag of plates that slip is between none and the peak of the vehicle file.\n\
         - Single precision, without fused or reordered operations: `wetclutch_{}_selftest` shows it.\n",
        shifts.join(", "),
        number(budget.command_age_s),
        filter.name,
    );
    text
}

/// A number in single precision, to read and by its bits.
fn number(value: f64) -> String {
    let single = value as f32;
    format!("{single} (`{}`)", hex_float(single))
}
