//! The page of how errors of models and readings act on the estimated pressure.

use config::VehicleFile;
use minijinja::{Value, context};
use study::PhaseSensitivity;
use study::sensitivity::{ErrorEffect, ShaftEffect, ValveEffect, View};

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
    let alone_pa: f64 = valve.iter().map(|effect| effect.pressure_pa).sum();
    let charts = charts(phases, alone_pa);
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
            charts,
            alone_kpa => format!("{:.0}", 1e-3 * alone_pa),
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

/// The equivalent pressure errors of each phase as bars, the largest first, in per cent of one width for all of them, with a mark at the error of the
/// valve model alone.
fn charts(phases: &[PhaseSensitivity], alone_pa: f64) -> Vec<Value> {
    let pressure_pa = |effect: &ErrorEffect| (effect.bound * effect.pressure_pa_per_unit).abs();
    let all = phases.iter().flat_map(|phase| &phase.effects).map(pressure_pa);
    let widest_pa = all.fold(alone_pa, f64::max).max(1e-9);
    let percent = |pa: f64| format!("{:.1}", 100.0 * pa / widest_pa);
    let chart = |phase: &PhaseSensitivity| {
        let mut effects: Vec<&ErrorEffect> = phase.effects.iter().collect();
        effects.sort_by(|one, other| pressure_pa(other).total_cmp(&pressure_pa(one)));
        let bars = effects.into_iter().map(|effect| {
            let pa = pressure_pa(effect);
            context! { error => effect.error, kpa => format!("{:.1}", 1e-3 * pa), wide => percent(pa) }
        });
        context! {
            title => format!("{}, {}", phase.phase.replace('_', " "), phase.view.name()),
            bars => bars.collect::<Vec<_>>(),
            alone => percent(alone_pa),
        }
    };
    phases.iter().map(chart).collect()
}
