//! Why a statement differs, or what else the numbers say: runs with one cause of error taken away.

use car::{Experiment, Vehicle};
use config::ExperimentFile;
use drivetrain::{ClutchValve, Real, Table1, Valve, ValveMaps};
use trace::units::mpa;

use super::rows::{BUS_PERIOD_S, COMPLIANT, COMPLIANT_SAMPLED, I, RIGID, T, min_multipliers, of, open, shaft_rms};
use super::statement::Statement;
use crate::{Comparison, StudyError, compare};

/// Runs that take one cause of error away, to say what an error is made of.
struct Without {
    /// E1 with tyres that hardly slip.
    tyre_slip: Comparison,
    /// E1 with a valve that obeys the observers' model.
    valve_error: Comparison,
    /// E2 on a level road.
    grade: Comparison,
}

impl Without {
    fn run(vehicle: &Vehicle, e1: &Experiment, e2: &Experiment) -> Result<Self, StudyError> {
        let mut stiff = vehicle.clone();
        stiff.tyre.slip_scale /= 20.0;
        let mut ideal = vehicle.clone();
        if let Valve::Proportional { time_constant_s, gain_pa_a } = vehicle.settings.valve {
            for clutch in [&mut ideal.offgoing, &mut ideal.oncoming] {
                clutch.valve = ClutchValve::Proportional(ValveMaps {
                    time_constant_s: Table1::constant(time_constant_s),
                    gain_pa_a: Table1::constant(gain_pa_a),
                    delay_s: Table1::constant(0.0),
                });
            }
        }
        let mut level = e2.clone();
        level.off_nominal.grade_rad = None;
        Ok(Self {
            tyre_slip: compare(&stiff, e1)?,
            valve_error: compare(&ideal, e1)?,
            grade: compare(vehicle, &level)?,
        })
    }
}

/// Adds its reason to the first row of each statement that has one.
pub(super) fn explain(
    rows: &mut [Statement],
    vehicle: &Vehicle,
    experiments: &[ExperimentFile; 4],
    [e1, _, _, e4]: &[Comparison; 4],
) -> Result<(), StudyError> {
    let without = Without::run(vehicle, &experiments[0], &experiments[1])?;
    let mut last = "";
    for row in rows {
        if row.id != last {
            row.because = reason(row.id, vehicle, e1, e4, &without);
        }
        last = row.id;
    }
    Ok(())
}

fn reason(id: &str, vehicle: &Vehicle, e1: &Comparison, e4: &Comparison, without: &Without) -> String {
    let rms = |comparison, phase| in_mpa(of(comparison, COMPLIANT, phase).rms);
    match id {
        "rigid_peak_change" => format!(
            "the peak of the whole shift is in the torque phase, where the speeds hardly depend on the pressure; in the inertia \
             phase the RMS error is {:.0} % lower",
            100.0 * (1.0 - of(e1, RIGID, I).rms / open(e1, I).rms)
        ),
        "rigid_inertia_over_torque_phase" => {
            format!("in the torque phase the pressure has {:.0} times less effect on the speeds", visibility(vehicle))
        }
        "rigid_torque_phase_peak" => format!(
            "with the gain designed here the RMS error is {:.2} times that of the valve model alone",
            of(e1, RIGID, T).rms / open(e1, T).rms
        ),
        "off_nominal_torque_phase_peak_change" => format!(
            "the rigid model does not include the errors of turbine torque, mass and grade; on a level road the peak with the \
             gain designed here is {}",
            in_mpa(of(&without.grade, RIGID, T).peak)
        ),
        "off_nominal_inertia_phase_rms" => "the phase begins with the error of the torque phase".to_owned(),
        "full_gains_least_factor" => {
            let (_, exact) = min_multipliers(&e1.rigid, BUS_PERIOD_S);
            format!(
                "the factor is the least of 1 + T (A22 − L G) over all vertices; exactly it is {exact:.2}: the full gains neither \
                 oscillate nor diverge"
            )
        }
        "compliant_over_rigid" => format!(
            "the rest is due to tyre slip and the valve, which the model leaves out: {} with tyres that hardly slip, {} with a \
             valve that behaves as its model",
            rms(&without.tyre_slip, T),
            rms(&without.valve_error, T)
        ),
        "off_nominal_compliant_over_rigid" => format!(
            "the grade, which is not in the model, acts on the wheel speed, and the gain turns it into an error of the pressure: \
             on a level road it is {} against {} rigid with the gain designed here and {} open loop",
            rms(&without.grade, T),
            in_mpa(of(&without.grade, RIGID, T).rms),
            in_mpa(open(&without.grade, T).rms)
        ),
        "compliant_shaft_torque_rms" => format!(
            "in the torque phase {:.0} N m with tyres that hardly slip, {:.0} N m with a valve that behaves as its model",
            shaft_rms(&without.tyre_slip, COMPLIANT, T),
            shaft_rms(&without.valve_error, COMPLIANT, T)
        ),
        "compliant_sampled_rms" => format!(
            "sensor noise makes the torque-phase estimate vary by {:.2} MPa in all",
            mpa(of(e4, COMPLIANT_SAMPLED, T).chatter)
        ),
        _ => String::new(),
    }
}

fn in_mpa(pascal: f64) -> String {
    format!("{:.4} MPa", mpa(pascal))
}

/// How many times more the speeds accelerate per pressure in the inertia phase than in the torque phase.
fn visibility(vehicle: &Vehicle) -> f64 {
    let model = design::rigid_model(vehicle);
    let size = |phase| {
        let [turbine, slip] = model.influence(phase, vehicle.settings.uncertainty.friction.0);
        Real::hypot(turbine, slip)
    };
    size(I) / size(T)
}
