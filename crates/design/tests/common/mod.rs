//! A car that obeys the model of an observer, for the tests of the observers with designed gains.

#![allow(dead_code, clippy::unwrap_used, reason = "each test file uses a part of it; a test may")]

pub(crate) mod sampled;

use config::VehicleFile;
use design::{design_rigid, rigid_observer};
use observer::{Phase, RigidObserver, RigidState, Sample, SampleEstimator};

pub(crate) const ENGINE_RAD_S: f64 = 370.0;
pub(crate) const DT_S: f64 = 1e-4;

pub(crate) fn observer() -> RigidObserver<f64> {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains())
}

pub(crate) fn input(dt_s: f64, turbine_rad_s: f64, slip_rad_s: f64, command: f64) -> Sample<f64> {
    Sample { dt_s, engine_rad_s: ENGINE_RAD_S, turbine_rad_s, slip_rad_s, wheel_rad_s: f64::NAN, command }
}

/// A car that obeys the rigid model but for an error `w`, and the observer on it.
pub(crate) struct Car {
    pub(crate) observer: RigidObserver<f64>,
    pub(crate) state: RigidState<f64>,
    pub(crate) phase: Phase,
    pub(crate) speeds: [f64; 2],
    pub(crate) pressure_pa: f64,
    pub(crate) command: f64,
    /// Whether the last sample still lay in the phase: left alone the car locks clutch B, or A grips again.
    pub(crate) in_phase: bool,
}

impl Car {
    /// In this phase, with an estimate that is wrong by `error_pa`.
    pub(crate) fn start(phase: Phase, error_pa: f64) -> Self {
        // In first gear the slip of B is the turbine speed; less of it means that A has let go.
        let speeds = if phase == Phase::TorquePhase { [360.0, 360.0] } else { [340.0, 300.0] };
        Self::start_at(observer(), phase, speeds, error_pa)
    }

    /// The same at these speeds, with this observer.
    pub(crate) fn start_at(observer: RigidObserver<f64>, phase: Phase, speeds: [f64; 2], error_pa: f64) -> Self {
        let command = 0.25;
        let mut state = observer.start_sample();
        for dt in [0.0, 10.0, 1e-9] {
            observer.step_sample(&mut state, &input(dt, speeds[0], speeds[1], command));
        }
        let estimate = observer.step_sample(&mut state, &input(1e-9, speeds[0], speeds[1], command));
        assert_eq!(estimate.phase, phase);
        Self { observer, state, phase, speeds, pressure_pa: estimate.pressure_pa + error_pa, command, in_phase: true }
    }

    /// One sample later: the error of the estimate, Pa. The speeds go as in Eq. (2.24a), the pressure as
    /// in Eq. (2.24b), both exactly for coefficients that stand still over the sample.
    pub(crate) fn step(&mut self, w: [f64; 2]) -> f64 {
        let model = self.observer.model;
        let m = model.speed_model(self.phase, ENGINE_RAD_S, self.speeds[0], self.speeds[1]);
        let before = self.pressure_pa;
        self.pressure_pa = model.valve.linear(self.command, before).advance(before, DT_S);
        let mean = 0.5 * (before + self.pressure_pa);
        let rate = |i: usize| m.free_rad_s2[i] + m.per_pressure_rad_s2_pa[i] * mean + w[i];
        self.speeds = [self.speeds[0] + DT_S * rate(0), self.speeds[1] + DT_S * rate(1)];
        if self.phase == Phase::TorquePhase {
            self.speeds[1] = self.speeds[0];
        }
        let estimate =
            self.observer.step_sample(&mut self.state, &input(DT_S, self.speeds[0], self.speeds[1], self.command));
        self.in_phase =
            estimate.phase == self.phase && self.speeds[1].abs() > self.observer.tracker.supervisor.lock_slip_rad_s;
        self.pressure_pa - estimate.pressure_pa
    }
}

/// The mean of start and end stands for the integral of the pressure over a sample; that and rounding
/// leave less than this, Pa.
pub(crate) const DISCRETISATION_PA: f64 = 20.0;

/// A valve over a sample under a constant command: `e^(A22 T)`, its integral, and the integral of that.
pub(crate) fn over_a_sample(a22: f64, dt: f64) -> (f64, f64, f64) {
    let phi = (a22 * dt).exp();
    let psi = (phi - 1.0) / a22;
    (phi, psi, (psi - dt) / a22)
}
