//! The smooth phases against another integrator: Dormand-Prince 8(5,3) of a library, at a tight tolerance.

use crate::common::{e1, samples, vehicle};
use differential_equations::prelude::*;
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::state::STATES;
use plant::{HybridIntegrator, Inputs, Mode, Powertrain, Sample, State};

/// Tolerance of our steps here; the other method's is a hundred times tighter.
const TOLERANCE: f64 = 1e-9;

struct Phase<'a> {
    powertrain: &'a Powertrain,
    mode: Mode,
    inputs: Inputs,
}

impl ODE<f64, [f64; STATES]> for Phase<'_> {
    fn diff(&self, _time: f64, x: &[f64; STATES], slope: &mut [f64; STATES]) {
        *slope = self.powertrain.derivative(self.mode, x, &self.inputs);
    }
}

fn at(samples: &[Sample], time_s: f64) -> Sample {
    *samples.iter().find(|sample| sample.time_s >= time_s - 1e-9).unwrap()
}

/// From a state of E1, under constant inputs and without a change of mode, both methods agree.
fn assert_agreement(from_s: f64, duration_s: f64) {
    let powertrain = Powertrain::new(vehicle());
    let start = at(&samples(&e1(), RELATIVE_TOLERANCE), from_s);
    let c = start.commands;
    let inputs = Inputs::arrived(&powertrain.vehicle, c.throttle, c.offgoing, c.oncoming);
    let mut plant = HybridIntegrator::with_tolerance(&powertrain, 0.0, start.state, &inputs, TOLERANCE).unwrap();
    let mode = plant.mode();
    plant
        .advance(&powertrain, &inputs, duration_s, &mut |step| assert_eq!(step.mode, mode, "the phase is not smooth"))
        .unwrap();

    let phase = Phase { powertrain: &powertrain, mode, inputs };
    let reference = IVP::ode(&phase, 0.0, duration_s, plant_start(&start))
        .method(ExplicitRungeKutta::dop853().rtol(1e-11).atol(1e-11))
        .solve()
        .unwrap();
    let reference = reference.y.last().unwrap();
    for (i, (ours, theirs)) in plant.state().to_array().iter().zip(reference).enumerate() {
        // A hundred times the tolerance of a step, for the growth of the error along the phase.
        assert!(
            (ours - theirs).abs() < 100.0 * TOLERANCE * (State::SCALE.to_array()[i] + theirs.abs()),
            "state {i}: {ours} {theirs}"
        );
    }
}

fn plant_start(sample: &Sample) -> [f64; STATES] {
    sample.state.to_array()
}

#[test]
fn first_gear_agrees_with_another_method() {
    assert_agreement(4.0, 1.5);
}

#[test]
fn torque_phase_agrees_with_another_method() {
    assert_agreement(7.75, 0.1);
}

#[test]
fn inertia_phase_agrees_with_another_method() {
    assert_agreement(8.05, 0.15);
}

#[test]
fn second_gear_agrees_with_another_method() {
    assert_agreement(8.8, 0.6);
}
