//! Clutches whose pistons have a stroke: fill, plateau on release, oil balance; hysteresis, backlash and drag.

use crate::common::{e1, smooth_vehicle, vehicle};
use car::{Experiment, OffNominal, Vehicle};
use config::{ExperimentFile, Source, VehicleFile};
use drivetrain::Cylinder;
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::{Contact, HybridIntegrator, Inputs, Powertrain, Sample, Segment, Simulation, Stage, State};

const STROKE: &str = include_str!("../../../vehicles/two_speed_stroke.toml");
const FILL: &str = include_str!("../../../experiments/fill.toml");

fn stroke_vehicle() -> Vehicle {
    VehicleFile::from_source(Source::built_in("two_speed_stroke.toml", STROKE)).unwrap().vehicle
}

fn fill() -> Experiment {
    ExperimentFile::from_source(Source::built_in("fill.toml", FILL)).unwrap().experiment
}

/// The experiment "fill" with these differences.
fn differing(change: impl Fn(&mut OffNominal)) -> Experiment {
    let mut experiment = fill();
    change(&mut experiment.off_nominal);
    experiment
}

/// Runs an experiment on its own car; shows every step and collects every sample.
fn run(
    nominal: &Vehicle,
    experiment: &Experiment,
    tolerance: f64,
    mut on_step: impl FnMut(&Powertrain, &Segment<'_>),
) -> Vec<Sample> {
    let powertrain = Powertrain::new(experiment.simulated_vehicle(nominal));
    let mut samples = Vec::new();
    let mut drive = Simulation::with_tolerance(&powertrain, nominal, experiment, tolerance).unwrap();
    let on_step = |step: &Segment<'_>| on_step(&powertrain, step);
    drive.advance_with_steps(experiment.duration_s, on_step, |sample| samples.push(*sample)).unwrap();
    samples
}

fn samples(experiment: &Experiment) -> Vec<Sample> {
    run(&stroke_vehicle(), experiment, RELATIVE_TOLERANCE, |_, _| {})
}

/// When the oncoming piston ends its stroke, s.
fn kiss_s(samples: &[Sample], stroke_m3: f64) -> f64 {
    samples.iter().find(|s| s.state.oncoming_m3 >= stroke_m3).unwrap().time_s
}

#[test]
fn a_nominal_fill_ends_gently_before_the_load_transfer_at_any_temperature() {
    for degc in [110.0, 80.0, 25.0, 5.0, -20.0] {
        let mut experiment = differing(|change| change.oil_temperature_degc = Some(degc));
        experiment.shift.request_s = 5.5; // cold oil takes longer
        let samples = samples(&experiment);
        let in_fill: Vec<&Sample> = samples.iter().filter(|s| matches!(s.stage, Stage::Fill(_))).collect();
        let last = in_fill.last().unwrap();
        assert!(last.state.oncoming_m3 >= stroke_vehicle().oncoming.cylinder.stroke_m3, "{degc} degC: not filled");
        // The plan lets the plates meet at twice the hold's pressure above the kiss point. Its model takes steps of 1 ms
        // and leaves out the oil that presses the piston off its stop: a tenth for both.
        let clutch = stroke_vehicle().oncoming.clutch;
        let gentle_pa = clutch.kiss_pressure() + 2.0 * experiment.shift.fast_fill.stroke_over_kiss_pa;
        let max_n_m = in_fill.iter().map(|s| s.torques.shift.oncoming_n_m).fold(0.0, f64::max);
        assert!(max_n_m < 1.1 * clutch.torque_capacity(gentle_pa, 150.0), "{degc} degC: {max_n_m} N m");
        assert!(samples.last().unwrap().mode.oncoming == Contact::Stuck, "{degc} degC: no shift");
    }
}

#[test]
fn a_larger_cylinder_or_less_flow_fills_later_and_a_smaller_one_earlier() {
    let stroke_m3 = stroke_vehicle().oncoming.cylinder.stroke_m3;
    let nominal = kiss_s(&samples(&fill()), stroke_m3);
    let late = kiss_s(&samples(&differing(|change| change.fill_volume_factor = 1.25)), 1.25 * stroke_m3);
    let early = kiss_s(&samples(&differing(|change| change.fill_volume_factor = 0.75)), 0.75 * stroke_m3);
    let starved = kiss_s(&samples(&differing(|change| change.starved_flow_factor = 0.6)), stroke_m3);
    assert!(early < nominal - 0.02 && nominal + 0.02 < late && nominal + 0.02 < starved, "{early} {nominal} {late}");
}

/// A stroke that the vehicle file switches off can be switched on, and the other way round; no stroke is the chapter.
#[test]
fn the_stroke_can_be_switched_for_the_simulated_car() {
    let mut with = e1();
    with.off_nominal.piston_stroke = Some(true);
    let filled = run(&vehicle(), &with, RELATIVE_TOLERANCE, |_, _| {});
    assert!(filled.iter().any(|s| matches!(s.stage, Stage::Fill(_)) && s.state.oncoming_m3 > 5e-6));
    let mut without = e1();
    without.off_nominal.piston_stroke = Some(false);
    let chapter = run(&vehicle(), &e1(), RELATIVE_TOLERANCE, |_, _| {});
    assert_eq!(run(&stroke_vehicle(), &without, RELATIVE_TOLERANCE, |_, _| {}), chapter);
}

/// While its spring empties it, the released clutch stands between the two pressures of the spring, for the time that
/// the volume and the resistance of the exhaust give, 0.3 s for 14.4 cm^3.
#[test]
fn a_released_clutch_stands_on_the_plateau_of_its_spring() {
    let samples = samples(&fill());
    let cylinder = stroke_vehicle().offgoing.cylinder;
    let released = |s: &&Sample| s.time_s > fill().shift.request_s && s.offgoing_pa < cylinder.kiss_pa;
    let from = samples.iter().find(released).unwrap();
    let until = samples.iter().find(|s| s.time_s > from.time_s && s.state.offgoing_m3 < 0.0).unwrap();
    let plateau = samples.iter().filter(|s| (from.time_s..until.time_s).contains(&s.time_s));
    assert!(plateau.clone().all(|s| (cylinder.preload_pa..=cylinder.kiss_pa).contains(&s.offgoing_pa)));
    assert!(plateau.clone().any(|s| s.state.offgoing_valve_pa < 0.5 * cylinder.preload_pa), "the valve is open");
    let lasts_s = until.time_s - from.time_s;
    assert!((0.25..0.45).contains(&lasts_s), "{lasts_s}");
    assert!(samples.iter().all(|s| s.offgoing_pa >= 0.0 && s.oncoming_pa >= 0.0));
}

const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// What flows through the valve into a cylinder is there or has leaked. Flow and leak are integrated apart from the
/// integrator, by Gauss's rule on the dense output.
#[test]
fn oil_that_flows_in_is_in_the_cylinder_or_has_leaked() {
    const TOLERANCE: f64 = 1e-8;
    let (mut inflow, mut leak) = ([0.0; 2], [0.0; 2]);
    let samples = run(&stroke_vehicle(), &fill(), TOLERANCE, |powertrain, step| {
        let length = step.end_s - step.start_s;
        let v = &powertrain.vehicle;
        for (at, weight) in GAUSS {
            let x = step.at(step.start_s + at * length);
            let sides = [(&v.offgoing, x.offgoing_valve_pa), (&v.oncoming, x.oncoming_valve_pa)];
            for (i, ((clutch, valve_pa), pressure)) in sides.into_iter().zip(powertrain.pressures(&x)).enumerate() {
                inflow[i] += weight * length * clutch.cylinder.flow(valve_pa - pressure);
                leak[i] += weight * length * clutch.cylinder.leak_m3_s_pa * pressure;
            }
        }
    });
    let (first, last) = (samples[0].state, samples[samples.len() - 1].state);
    let gained = [last.offgoing_m3 - first.offgoing_m3, last.oncoming_m3 - first.oncoming_m3];
    for i in 0..2 {
        // A tenth of a permille of the stroke: the kinks of the law lie within steps of the rule.
        let missing = inflow[i] - leak[i] - gained[i];
        assert!(missing.abs() < 1.2e-9, "clutch {i}: {missing} m^3 of {} are missing", gained[i]);
        assert!(leak[i] > 1e-7, "without the leak the balance would fail");
    }
}

/// Without stroke and leak the pressure tends to that of the valve as the capacities tend to zero: the difference is the
/// pressure drop of the flow that moves the pressure, at most that of the fastest change, 0.9 MPa with a lag of 50 ms.
#[test]
fn a_cylinder_without_stroke_and_capacity_has_the_pressure_of_the_valve() {
    let inputs = Inputs { throttle: 0.2, offgoing_settled_pa: 0.1e6, oncoming_settled_pa: 0.4e6 };
    let start = State { engine_rad_s: 200.0, offgoing_valve_pa: 1e6, ..State::ZERO };
    let pressures = |vehicle: Vehicle| {
        let powertrain = Powertrain::new(vehicle);
        let v = &powertrain.vehicle;
        let start = State {
            offgoing_m3: v.offgoing.cylinder.volume(1e6),
            oncoming_m3: v.oncoming.cylinder.volume(0.0),
            ..start
        };
        let mut plant = HybridIntegrator::with_tolerance(&powertrain, 0.0, start, &inputs, 1e-8).unwrap();
        (1..=40_u32)
            .flat_map(|n| {
                plant.advance(&powertrain, &inputs, 0.005 * f64::from(n), &mut |_| {}).unwrap();
                powertrain.pressures(plant.state())
            })
            .collect::<Vec<f64>>()
    };
    let mut chapter = smooth_vehicle();
    let exact = pressures(chapter.clone());
    let mut off_by = |capacity_m3_pa: f64| {
        for clutch in [&mut chapter.offgoing, &mut chapter.oncoming] {
            clutch.has_stroke = true;
            let cylinder = &mut clutch.cylinder;
            (cylinder.stroke_m3, cylinder.leak_m3_s_pa) = (0.0, 0.0);
            cylinder.preload_pa = cylinder.kiss_pa;
            (cylinder.home_capacity_m3_pa, cylinder.capacity_m3_pa) = (capacity_m3_pa, capacity_m3_pa);
        }
        pressures(chapter.clone()).iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    for capacity_m3_pa in [4e-13, 4e-14] {
        let flow_m3_s = capacity_m3_pa * 0.9e6 / 0.05;
        let Cylinder { exhaust, viscosity_m2_s, .. } = smooth_vehicle().offgoing.cylinder;
        let max_pa =
            exhaust.laminar_pa_s2_m5 * viscosity_m2_s * flow_m3_s + exhaust.orifice_pa_s2_m6 * flow_m3_s * flow_m3_s;
        let found_pa = off_by(capacity_m3_pa);
        assert!((0.8 * max_pa..max_pa).contains(&found_pa), "{found_pa} Pa of {max_pa} Pa");
    }
}

/// As for the car without a stroke: each signal within 0.1 % of its range of a run with a tight tolerance.
#[test]
fn default_tolerance_is_good_to_a_thousandth_of_each_range_with_a_stroke() {
    let usual = samples(&fill());
    let tight = run(&stroke_vehicle(), &fill(), 1e-8, |_, _| {});
    let signals = |s: &Sample| [s.state.turbine_rad_s, s.offgoing_pa, s.oncoming_pa, s.state.oncoming_m3];
    for i in 0..4 {
        let all = tight.iter().map(|s| signals(s)[i]);
        let (low, high) = all.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        let worst = usual.iter().zip(&tight).map(|(a, b)| (signals(a)[i] - signals(b)[i]).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3 * (high - low), "{i}: {:.2e} of its range", worst / (high - low));
    }
}

/// After a rise the valve stands below its command's pressure by the half-width, after a fall above it.
#[test]
fn hysteresis_keeps_the_pressure_on_the_side_that_it_comes_from() {
    let mut experiment = e1();
    experiment.off_nominal.valve_hysteresis_pa = Some(0.02e6);
    let samples = run(&vehicle(), &experiment, RELATIVE_TOLERANCE, |_, _| {});
    let last = samples.last().unwrap();
    let line_pa = experiment.shift.line_pressure_pa;
    assert!((last.oncoming_pa - (line_pa - 0.02e6)).abs() < 100.0, "{}", last.oncoming_pa);
    assert!((last.offgoing_pa - 0.02e6).abs() < 100.0, "{}", last.offgoing_pa);
}

/// A released accelerator opens the gap and a pressed one closes it; between, the shafts carry nothing.
#[test]
fn shafts_carry_no_torque_while_the_accelerator_is_changed_over_the_backlash() {
    let backlash_rad = 0.03;
    let mut experiment = e1();
    experiment.off_nominal.backlash_rad = Some(backlash_rad);
    experiment.off_nominal.tip_out_s = Some([5.0, 5.6]);
    let samples = run(&vehicle(), &experiment, RELATIVE_TOLERANCE, |_, _| {});
    let in_gap: Vec<&Sample> = samples.iter().filter(|s| s.state.twist_rad.abs() < 0.5 * backlash_rad).collect();
    assert!(in_gap.len() > 20, "{}", in_gap.len());
    assert!(in_gap.iter().all(|s| s.torques.shaft_n_m == 0.0));
    assert!(in_gap.iter().all(|s| (5.0..6.2).contains(&s.time_s)));
    assert!(samples.iter().any(|s| s.torques.shaft_n_m < -5.0), "the engine brakes through the other side of the gap");
}

/// The drag of the open clutch B holds 1st gear back, where the clutch slips forward.
#[test]
fn an_open_clutch_drags_in_the_direction_of_its_slip() {
    let samples = samples(&differing(|change| change.clutch_drag_n_m = 8.0));
    let open = samples.iter().filter(|s| (3.0..7.0).contains(&s.time_s));
    assert!(open.clone().all(|s| s.oncoming_slip_rad_s > 0.0 && s.torques.shift.oncoming_n_m > 0.0));
    assert!(open.clone().all(|s| s.torques.shift.oncoming_n_m <= 8.0));
}
