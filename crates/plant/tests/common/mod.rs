//! Vehicles and runs that several tests share.

#![allow(dead_code, reason = "each test uses a part of it")]

use car::{Experiment, Vehicle};
use config::{ExperimentFile, VehicleFile};
use drivetrain::{ClutchValve, Table1, Table2, ValveMaps};
use plant::{Powertrain, Sample, Segment, Simulation};

pub(crate) fn vehicle() -> Vehicle {
    VehicleFile::built_in().unwrap().vehicle
}

pub(crate) fn e1() -> Experiment {
    ExperimentFile::e1().unwrap().experiment
}

/// The built-in car with constants in place of all maps, so that its equations are smooth.
pub(crate) fn smooth_vehicle() -> Vehicle {
    let mut v = vehicle();
    v.engine.torque_n_m = Table2::new(&[0.0, 1.0], &[0.0, 1.0], &[[100.0, 100.0], [100.0, 100.0]]).unwrap();
    v.converter.capacity_n_m_s2 = Table1::new(&[0.0, 2.0], &[4e-3, -4e-3]).unwrap();
    v.converter.torque_ratio = Table1::constant(1.2);
    for clutch in [&mut v.offgoing, &mut v.oncoming] {
        clutch.clutch.friction = Table1::constant(0.13);
        clutch.clutch.static_friction = 0.13;
        clutch.valve = ClutchValve::Proportional(ValveMaps {
            time_constant_s: Table1::constant(0.05),
            gain_pa_a: Table1::constant(1e6),
            delay_s: Table1::constant(0.01),
        });
    }
    v
}

/// The smooth car with nothing but its gear train: no torque from the converter, no shaft, no tyre.
pub(crate) fn bare_gear_train() -> Vehicle {
    let mut v = smooth_vehicle();
    v.converter.capacity_n_m_s2 = Table1::constant(0.0);
    v.driveline.shaft_stiffness_n_m_rad = 0.0;
    v.driveline.shaft_damping_n_m_s_rad = 0.0;
    v.tyre.max_force_n = 1e-9;
    v.road.rolling_moment_n_m = 0.0;
    v
}

/// Runs an experiment on its own car and collects every sample.
pub(crate) fn samples(experiment: &Experiment, tolerance: f64) -> Vec<Sample> {
    let nominal = vehicle();
    let powertrain = Powertrain::new(experiment.simulated_vehicle(&nominal));
    let mut samples = Vec::new();
    let mut drive = Simulation::with_tolerance(&powertrain, &nominal, experiment, tolerance).unwrap();
    drive.advance(experiment.duration_s, |sample| samples.push(*sample)).unwrap();
    samples
}

/// Runs an experiment and shows every step.
pub(crate) fn each_step(
    powertrain: &Powertrain,
    experiment: &Experiment,
    tolerance: f64,
    on_step: impl FnMut(&Segment<'_>),
) {
    let nominal = vehicle();
    let mut drive = Simulation::with_tolerance(powertrain, &nominal, experiment, tolerance).unwrap();
    drive.advance_with_steps(experiment.duration_s, on_step, |_| {}).unwrap();
}
