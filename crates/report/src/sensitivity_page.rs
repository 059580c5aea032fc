//! The page of how errors of models and readings act on the estimated pressure.

use config::VehicleFile;
use minijinja::{Value, context};
use study::PhaseSensitivity;
use study::sensitivity::{ShaftEffect, ValveEffect, View};

use crate::page::{PageError, origin, render};

/// The page; it needs nothing but itself.
///
/// # Errors
/// None in a released program; the tests render the template.
pub fn sensitivity_page(
    phases: &[PhaseSensitivity],
    valve: &[ValveEffect],
    shaft: &[ShaftEffect],
    vehicle: &VehicleFile,
) -> Result<String, PageError> {
    let rows = phases.iter().map(|phase| {
        let largest = phase.effects.iter().map(|e| (e.bound * e.pressure_pa_per_unit).abs()).fold(0.0, f64::max);
        let effects: Vec<Value> = (phase.effects.iter())
            .map(|effect| {
                let pressure_pa = (effect.bound * effect.pressure_pa_per_unit).abs();
                context! {
                    error => effect.error,
                    unit => effect.unit,
                    bound => effect.bound_text(),
                    kpa => format!("{:.1}", 1e-3 * pressure_pa),
                    per_unit => format!("{:.2}", 1e-3 * effect.pressure_pa_per_unit),
                    torque => format!("{:.2}", effect.clutch_n_m_per_unit),
                    angle => effect.angle_deg.map(|angle| format!("{angle:.1}")),
                    shade => format!("{:.2}", 0.6 * pressure_pa / largest.max(1e-9)),
                }
            })
            .collect();
        context! {
            title => format!("{}, {}", phase.phase.replace('_', " "), phase.view.name()),
            influence => format!("{:.0}", phase.influence_rad_s2_mpa),
            effects => effects,
        }
    });
    let torque_phase = phases.iter().filter(|phase| phase.phase == "torque_phase" && phase.view == View::ShaftKnown);
    let hidden_pa = (torque_phase.flat_map(|phase| &phase.effects))
        .filter(|effect| effect.error != "friction")
        .map(|effect| (effect.bound * effect.pressure_pa_per_unit).abs())
        .fold(0.0, f64::max);
    render(
        "sensitivity.html",
        context! {
            name => "Sensitivity",
            title => "Sensitivity of the estimated pressure to errors",
            version => env!("CARGO_PKG_VERSION"),
            vehicle_name => &vehicle.name,
            phases => rows.collect::<Vec<_>>(),
            hidden_kpa => format!("{:.0}", 1e-3 * hidden_pa),
            valve => valve
                .iter()
                .map(|effect| context! { error => effect.error, kpa => format!("{:.1}", 1e-3 * effect.pressure_pa) })
                .collect::<Vec<_>>(),
            shaft => shaft
                .iter()
                .map(|effect| context! { error => effect.error, n_m => format!("{:.0}", effect.torque_n_m) })
                .collect::<Vec<_>>(),
            inputs => origin(&[&vehicle.source]),
        },
    )
}
