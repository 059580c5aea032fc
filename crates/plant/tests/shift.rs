//! The simulated launch and shift as a whole.

use crate::common::{e1, each_step, samples, vehicle};
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::{Contact, Mode, Powertrain, Sample, Simulation};

#[test]
fn the_shift_changes_mode_twice_and_does_not_chatter() {
    let experiment = e1();
    let powertrain = Powertrain::new(experiment.simulated_vehicle(&vehicle()));
    let mut modes: Vec<Mode> = Vec::new();
    each_step(&powertrain, &experiment, RELATIVE_TOLERANCE, |step| {
        if modes.last() != Some(&step.mode) {
            modes.push(step.mode);
        }
    });
    let sticks: Vec<_> = (modes.iter()).map(|m| (m.offgoing == Contact::Stuck, m.oncoming == Contact::Stuck)).collect();
    // First gear, inertia phase, second gear; a standstill may begin with clutch B idle and stuck.
    let from_first_gear = sticks.iter().position(|&s| s == (true, false)).unwrap();
    assert_eq!(sticks[from_first_gear..], [(true, false), (false, false), (false, true)]);
}

#[test]
fn the_shift_is_one_that_a_calibrator_would_accept() {
    let samples = samples(&e1(), RELATIVE_TOLERANCE);
    let in_shift: Vec<&Sample> = samples.iter().filter(|s| (7.4..8.7).contains(&s.time_s)).collect();
    let start = |f: &dyn Fn(&Sample) -> bool| in_shift.iter().find(|s| f(s)).unwrap().time_s;
    let torque = start(&|s| matches!(s.stage, plant::Stage::TorquePhase(_)));
    let inertia = start(&|s| s.mode.offgoing != Contact::Stuck);
    let locked = start(&|s| s.mode.oncoming == Contact::Stuck);
    assert!((0.2..0.3).contains(&(inertia - torque)), "torque phase {}", inertia - torque);
    assert!((0.3..0.4).contains(&(locked - inertia)), "inertia phase {}", locked - inertia);
    assert!(in_shift.iter().all(|s| s.torques.shaft_n_m > 0.0), "tie-up");
    let ratio = vehicle().shift.ratio_offgoing();
    let flare = in_shift.iter().map(|s| s.state.turbine_rad_s - ratio * s.state.output_rad_s).fold(0.0, f64::max);
    assert!(flare < 3.0, "flare {flare}");
    // While B is filled the shaft torque must stay where it was, within a tenth.
    let steady = in_shift[0].torques.shaft_n_m;
    let filling = in_shift.iter().filter(|s| s.time_s < torque);
    assert!(filling.clone().count() > 100, "the fill is looked at");
    assert!(filling.clone().all(|s| (s.torques.shaft_n_m / steady - 1.0).abs() < 0.1), "shuffle at the fill");
}

/// Each signal within 0.1 % of its range of a run with a hundred thousand times tighter tolerance.
#[test]
fn default_tolerance_is_good_to_a_thousandth_of_each_range() {
    let (usual, tight) = (samples(&e1(), RELATIVE_TOLERANCE), samples(&e1(), 1e-10));
    let names = ["engine", "turbine", "output", "twist", "wheel", "vehicle", "offgoing", "oncoming"];
    for (i, name) in names.into_iter().enumerate() {
        let signal = |sample: &Sample| sample.state.to_array()[i];
        let (low, high) = tight.iter().map(signal).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        let worst = usual.iter().zip(&tight).map(|(a, b)| (signal(a) - signal(b)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3 * (high - low), "{name}: {:.2e} of its range", worst / (high - low));
    }
}

#[test]
fn the_same_experiment_gives_the_same_samples() {
    assert_eq!(samples(&e1(), RELATIVE_TOLERANCE), samples(&e1(), RELATIVE_TOLERANCE));
}

#[test]
fn a_car_on_a_downhill_grade_overruns_its_engine_and_stays_finite() {
    let mut experiment = e1();
    experiment.throttle = drivetrain::Table1::constant(0.0);
    experiment.initial_vehicle_m_s = 12.0;
    experiment.initial_engine_rad_s = 200.0;
    experiment.off_nominal.grade_rad = Some(-0.08);
    experiment.shift.request_s = experiment.duration_s;
    let samples = samples(&experiment, RELATIVE_TOLERANCE);
    let last = samples.last().unwrap();
    assert!(last.state.turbine_rad_s > last.state.engine_rad_s, "overrun");
    assert!(last.torques.shift.turbine_n_m < 0.0, "the engine brakes");
    assert!(samples.iter().all(|s| s.state.to_array().iter().all(|x| x.is_finite())));
}

#[test]
fn what_is_asked_of_a_moment_is_what_its_sample_holds() {
    let (experiment, nominal) = (e1(), vehicle());
    let powertrain = Powertrain::new(experiment.simulated_vehicle(&nominal));
    let (mut modes, mut drive) = (Vec::new(), Simulation::new(&powertrain, &nominal, &experiment).unwrap());
    let asked = |moment: &plant::Moment<'_>| {
        let sample = moment.sample();
        let asked = [moment.oncoming_n_m(), moment.shaft_n_m(), moment.vehicle_m_s2(), moment.oncoming_pa()];
        let held =
            [sample.torques.shift.oncoming_n_m, sample.torques.shaft_n_m, sample.vehicle_m_s2, sample.oncoming_pa];
        assert_eq!(asked.map(f64::to_bits), held.map(f64::to_bits), "{}", moment.time_s);
        let road = &powertrain.vehicle.road;
        let force_n = sample.torques.tyre_n - road.drag_force(sample.state.vehicle_m_s) - road.grade_force();
        assert_eq!(sample.vehicle_m_s2, force_n / road.mass_kg);
        if modes.last() != Some(&moment.mode) {
            modes.push(moment.mode);
        }
    };
    drive.advance_to(experiment.duration_s, asked).unwrap();
    assert!(modes.len() > 2, "{modes:?}");
}
