//! How fast the main job is: one observer step, one gain design, one simulated drive, and the plant's
//! integrator beside a library's on the same equations.
//!
//! `cargo bench` prints, for each, the fastest, median and mean time.

#![expect(clippy::unwrap_used, reason = "a benchmark")]

use config::{Experiment, Vehicle};
use design::rigid::design_phase;
use design::{
    compliant_observer, design_compliant, design_rigid, design_sliding, requirement, rigid_observer, sliding_observer,
};
use differential_equations::prelude::*;
use divan::{Bencher, black_box};
use observer::{Estimator, Input, Phase, RigidGains};
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::state::STATES;
use plant::{HybridIntegrator, Inputs, Mode, Powertrain, Simulation, State};

fn main() {
    divan::main();
}

fn vehicle() -> Vehicle {
    Vehicle::two_speed_at().unwrap()
}

mod observer_step {
    use super::*;

    /// Samples that keep the observer in its inertia phase, where a step costs most.
    fn samples() -> Vec<Input<f64>> {
        let sample = |n: u32| Input {
            dt_s: if n == 1 { 10.0 } else { 0.01 },
            engine_rad_s: 370.0,
            turbine_rad_s: 340.0 - 0.01 * f64::from(n),
            slip_rad_s: 300.0 - 0.02 * f64::from(n),
            wheel_rad_s: f64::NAN,
            command: 0.25,
        };
        (0..1000).map(sample).collect()
    }

    /// The same samples with the wheel speed that goes with them.
    fn with_wheel() -> Vec<Input<f64>> {
        let wheel = |x: Input<f64>| Input { wheel_rad_s: (x.turbine_rad_s - 0.6 * x.slip_rad_s) / 3.0, ..x };
        samples().into_iter().map(wheel).collect()
    }

    fn bench(bencher: Bencher, observer: &impl Estimator<f64>) {
        let samples = with_wheel();
        bencher.counter(samples.len()).bench_local(|| {
            let mut state = observer.start();
            samples.iter().fold(0.0, |sum, input| sum + observer.step(&mut state, black_box(input)).pressure_pa)
        });
    }

    #[divan::bench(name = "compliant f64, 1000 steps")]
    fn compliant(bencher: Bencher) {
        let vehicle = vehicle();
        bench(bencher, &compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains()));
    }

    #[divan::bench(name = "sliding f64, 1000 steps")]
    fn sliding(bencher: Bencher) {
        let vehicle = vehicle();
        bench(bencher, &sliding_observer(&vehicle, design_sliding(&vehicle)));
    }

    #[divan::bench(name = "open loop f64, 1000 steps")]
    fn open_loop(bencher: Bencher) {
        bench(bencher, &rigid_observer(&vehicle(), RigidGains::open_loop()));
    }

    #[divan::bench(name = "rigid f64, 1000 steps")]
    fn rigid_f64(bencher: Bencher) {
        let vehicle = vehicle();
        bench(bencher, &rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains()));
    }

    #[divan::bench(name = "rigid f32, 1000 steps")]
    #[expect(clippy::cast_possible_truncation, reason = "single precision is what is measured")]
    fn rigid_f32(bencher: Bencher) {
        let vehicle = vehicle();
        let observer = rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains()).cast::<f32>();
        let single = |x: Input<f64>| Input {
            dt_s: x.dt_s as f32,
            engine_rad_s: x.engine_rad_s as f32,
            turbine_rad_s: x.turbine_rad_s as f32,
            slip_rad_s: x.slip_rad_s as f32,
            wheel_rad_s: f32::NAN,
            command: x.command as f32,
        };
        let samples: Vec<Input<f32>> = samples().into_iter().map(single).collect();
        bencher.counter(samples.len()).bench_local(|| {
            let mut state = observer.start();
            samples.iter().fold(0.0, |sum, input| sum + observer.step(&mut state, black_box(input)).pressure_pa)
        });
    }
}

#[divan::bench(name = "gain design, inertia phase")]
fn gain_design(bencher: Bencher) {
    let vehicle = vehicle();
    let required = requirement(&vehicle, Phase::InertiaPhase).into();
    bencher.bench_local(|| design_phase(black_box(&vehicle), Phase::InertiaPhase, &required).unwrap());
}

mod drive_of_9_5_s {
    use super::*;

    fn run(bencher: Bencher, sample_time_s: f64) {
        let vehicle = vehicle();
        let experiment = Experiment { sample_time_s, ..Experiment::e1().unwrap() };
        bencher.bench_local(|| {
            let mut sum = 0.0;
            plant::simulate(black_box(&vehicle), &experiment, |sample| sum += sample.oncoming_pa).unwrap();
            sum
        });
    }

    #[divan::bench(name = "recorded every 10 ms")]
    fn coarse(bencher: Bencher) {
        run(bencher, 0.01);
    }

    #[divan::bench(name = "recorded every 1 ms")]
    fn fine(bencher: Bencher) {
        run(bencher, 0.001);
    }
}

/// From a warm state at the shift request: fill, load transfer, inertia phase, lock-up, recorded every 10 ms.
#[divan::bench(name = "shift window of 1.5 s")]
fn shift_window(bencher: Bencher) {
    let vehicle = vehicle();
    let experiment = Experiment { sample_time_s: 0.01, ..Experiment::e1().unwrap() };
    let powertrain = Powertrain::new(vehicle.clone());
    let request_s = experiment.shift.request_s;
    let mut warm = Simulation::new(&powertrain, &vehicle, &experiment).unwrap();
    warm.advance(request_s, |_| {}).unwrap();
    bencher.bench_local(|| {
        let (mut shift, mut sum) = (black_box(&warm).clone(), 0.0);
        shift.advance(request_s + 1.5, |sample| sum += sample.oncoming_pa).unwrap();
        sum
    });
}

/// Two seconds in first gear under constant inputs, both at the same relative tolerance.
mod integrator {
    use super::*;

    struct FirstGear<'a> {
        powertrain: &'a Powertrain,
        mode: Mode,
        inputs: Inputs,
    }

    impl ODE<f64, [f64; STATES]> for FirstGear<'_> {
        fn diff(&self, _time: f64, x: &[f64; STATES], slope: &mut [f64; STATES]) {
            *slope = self.powertrain.derivative(self.mode, x, &self.inputs);
        }
    }

    const INPUTS: Inputs = Inputs { throttle: 0.22, offgoing_settled_pa: 1e6, oncoming_settled_pa: 0.0 };
    const START: State = State {
        engine_rad_s: 250.0,
        turbine_rad_s: 225.0,
        output_rad_s: 90.0,
        twist_rad: 0.06,
        wheel_rad_s: 30.0,
        vehicle_m_s: 8.9,
        offgoing_pa: 1e6,
        oncoming_pa: 0.0,
    };

    #[divan::bench(name = "wetclutch, with events")]
    fn ours(bencher: Bencher) {
        let powertrain = Powertrain::new(vehicle());
        bencher.bench_local(|| {
            let mut plant = HybridIntegrator::new(&powertrain, 0.0, black_box(START), &INPUTS).unwrap();
            plant.advance(&powertrain, &INPUTS, 2.0, &mut |_| {}).unwrap();
            plant.state
        });
    }

    #[divan::bench(name = "differential-equations, without events")]
    fn library(bencher: Bencher) {
        let powertrain = Powertrain::new(vehicle());
        let mode = HybridIntegrator::new(&powertrain, 0.0, START, &INPUTS).unwrap().mode;
        let problem = FirstGear { powertrain: &powertrain, mode, inputs: INPUTS };
        bencher.bench_local(|| {
            IVP::ode(&problem, 0.0, 2.0, black_box(START.to_array()))
                .method(ExplicitRungeKutta::dopri5().rtol(RELATIVE_TOLERANCE).atol(RELATIVE_TOLERANCE))
                .solve()
                .unwrap()
                .y
                .len()
        });
    }
}
