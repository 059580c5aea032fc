//! The one loop that carries an observer over a trace, simulated or measured.

use config::Vehicle;
use observer::{Bounds, Estimate, Estimator, Input};
use trace::{Trace, TraceError, signal};

/// The columns of a trace that the observers read.
#[derive(Debug, Clone, PartialEq)]
pub struct RunColumns<'a> {
    time_s: &'a [f64],
    engine_rad_s: &'a [f64],
    turbine_rad_s: &'a [f64],
    slip_rad_s: Vec<f64>,
    wheel_rad_s: Option<&'a [f64]>,
    command_a: &'a [f64],
}

impl<'a> RunColumns<'a> {
    /// Finds the columns. Where the slip of the oncoming clutch was not recorded it follows from turbine
    /// and output speed.
    ///
    /// # Errors
    /// A signal that is needed is missing.
    pub fn of(trace: &'a Trace, vehicle: &Vehicle) -> Result<Self, TraceError> {
        let turbine_rad_s = trace.require(signal::TURBINE_SPEED)?;
        let slip_rad_s = match trace.get(signal::ONCOMING_SLIP) {
            Some(slip) => slip.to_vec(),
            None => {
                let output = trace.require(signal::OUTPUT_SPEED)?;
                turbine_rad_s.iter().zip(output).map(|(&t, &o)| vehicle.shift.oncoming_slip(t, o)).collect()
            }
        };
        Ok(Self {
            time_s: &trace.time_s,
            engine_rad_s: trace.require(signal::ENGINE_SPEED)?,
            turbine_rad_s,
            slip_rad_s,
            wheel_rad_s: trace.get(signal::WHEEL_SPEED),
            command_a: trace.require(signal::ONCOMING_CURRENT)?,
        })
    }

    fn input(&self, i: usize) -> Input<f64> {
        Input {
            dt_s: if i == 0 { 0.0 } else { self.time_s[i] - self.time_s[i - 1] },
            engine_rad_s: self.engine_rad_s[i],
            turbine_rad_s: self.turbine_rad_s[i],
            slip_rad_s: self.slip_rad_s[i],
            wheel_rad_s: self.wheel_rad_s.map_or(f64::NAN, |wheel| wheel[i]),
            command: self.command_a[i],
        }
    }
}

/// Runs an observer over every sample; one estimate for each.
pub fn run(columns: &RunColumns<'_>, observer: &impl Estimator<f64>) -> Vec<Estimate<f64>> {
    let mut state = observer.start();
    (0..columns.time_s.len()).map(|i| observer.step(&mut state, &columns.input(i))).collect()
}

/// Estimates as a trace of their own.
pub fn estimates_trace(time_s: &[f64], estimates: &[Estimate<f64>]) -> Trace {
    let mut trace = Trace { path: None, time_s: time_s.to_vec(), columns: Vec::new() };
    trace.add(signal::PRESSURE_ESTIMATE, estimates.iter().map(|e| e.pressure_pa).collect());
    trace.add(signal::TORQUE_ESTIMATE, estimates.iter().map(|e| e.clutch_torque_n_m).collect());
    if estimates.iter().any(|e| e.shaft_torque_n_m.is_some()) {
        let shaft = |e: &Estimate<f64>| e.shaft_torque_n_m.unwrap_or(f64::NAN);
        trace.add(signal::SHAFT_ESTIMATE, estimates.iter().map(shaft).collect());
    }
    if estimates.iter().any(|e| e.bounds.is_some()) {
        let mut bound = |name: &str, value: &dyn Fn(&Bounds<f64>) -> f64| {
            trace.add(name, estimates.iter().map(|e| e.bounds.as_ref().map_or(f64::NAN, value)).collect());
        };
        bound(signal::PRESSURE_LEAST, &|bounds| bounds.pressure_pa[0]);
        bound(signal::PRESSURE_GREATEST, &|bounds| bounds.pressure_pa[1]);
        bound(signal::TORQUE_LEAST, &|bounds| bounds.clutch_torque_n_m[0]);
        bound(signal::TORQUE_GREATEST, &|bounds| bounds.clutch_torque_n_m[1]);
        if estimates.iter().any(|e| e.bounds.is_some_and(|bounds| bounds.shaft_torque_n_m.is_some())) {
            bound(signal::SHAFT_LEAST, &|bounds| bounds.shaft_torque_n_m.map_or(f64::NAN, |range| range[0]));
            bound(signal::SHAFT_GREATEST, &|bounds| bounds.shaft_torque_n_m.map_or(f64::NAN, |range| range[1]));
        }
    }
    trace.add_words(signal::PHASE, estimates.iter().map(|e| e.phase.name().into()).collect());
    trace.add_words(signal::HEALTH, estimates.iter().map(|e| e.health.name().into()).collect());
    trace
}
