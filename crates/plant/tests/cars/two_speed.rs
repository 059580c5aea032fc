//! The two-speed car of the source chapter, simulated as any car, beside the plant of its own.

use car::{Car, Experiment, Vehicle};
use config::{ExperimentFile, Source, VehicleFile};
use plant::car::{CarInputs, CarIntegrator, CarModel, CarState, CarValves};
use plant::gear_train::MAX_ELEMENTS;
use plant::{Powertrain, Sample, Simulation};

/// The chapter's car with the two-speed gearbox file.
fn as_any_car(vehicle: &Vehicle) -> Car {
    Car {
        clutches: vec![Some(vehicle.offgoing), Some(vehicle.oncoming)],
        engine: vehicle.engine,
        converter: Some(vehicle.converter),
        driveline: vehicle.driveline,
        backlash_rad: vehicle.backlash_rad,
        tyre: vehicle.tyre,
        road: vehicle.road,
        ..super::two_speed()
    }
}

/// An experiment that ships with the program.
macro_rules! experiment {
    ($path:literal) => {
        ExperimentFile::from_source(Source::built_in($path, include_str!(concat!("../../../../", $path))))
            .unwrap()
            .experiment
    };
}

#[test]
fn the_two_speed_plant_and_the_general_one_agree_under_the_same_commands() {
    let chapter = VehicleFile::built_in().unwrap().vehicle;
    let stroke = include_str!("../../../../vehicles/two_speed_stroke.toml");
    let stroke = VehicleFile::from_source(Source::built_in("two_speed_stroke.toml", stroke)).unwrap().vehicle;
    assert_agreement("E1", &chapter, experiment!("experiments/e1.toml"));
    assert_agreement("E2", &chapter, experiment!("experiments/e2.toml"));
    assert_agreement("E3", &chapter, experiment!("experiments/e3.toml"));
    assert_agreement("E4", &chapter, experiment!("experiments/e4.toml"));
    assert_agreement("fill", &stroke, experiment!("experiments/fill.toml"));
}

/// At a tolerance at which the steps of neither matter, from a second before the shift to its end. The limit is a hundred times the tolerance of a
/// step, for the growth of the error.
fn assert_agreement(name: &str, nominal: &Vehicle, mut experiment: Experiment) {
    const TOLERANCE: f64 = 1e-8;
    experiment.sample_time_s = experiment.shift.control_period_s;
    let powertrain = Powertrain::new(experiment.simulated_vehicle(nominal));
    let vehicle = &powertrain.vehicle;
    let mut samples: Vec<Sample> = Vec::new();
    let mut chapter = Simulation::with_tolerance(&powertrain, nominal, &experiment, TOLERANCE).unwrap();
    chapter.advance(experiment.duration_s, |sample| samples.push(*sample)).unwrap();

    let model = CarModel::new(as_any_car(vehicle)).unwrap();
    let begin = samples.iter().position(|sample| sample.time_s > experiment.shift.request_s - 1.0).unwrap();
    let commands = |sample: &Sample| {
        let mut commands = [0.0; MAX_ELEMENTS];
        commands[..2].copy_from_slice(&[sample.commands.offgoing, sample.commands.oncoming]);
        commands
    };
    let start = &samples[begin].state;
    // Shafts: turbine, ring, carrier. In 1st gear the ring is at rest.
    let motion = model.motion_of(&[start.turbine_rad_s, 0.0, start.output_rad_s], start.engine_rad_s).unwrap();
    let state = CarState {
        twist_rad: start.twist_rad,
        wheel_rad_s: start.wheel_rad_s,
        vehicle_m_s: start.vehicle_m_s,
        motion,
        valves_pa: [start.offgoing_valve_pa, start.oncoming_valve_pa, 0.0, 0.0, 0.0, 0.0],
        volumes_m3: [start.offgoing_m3, start.oncoming_m3, 0.0, 0.0, 0.0, 0.0],
    };
    let mut valves = CarValves::new(&model, &commands(&samples[begin]));
    let mut inputs = CarInputs {
        throttle: samples[begin].commands.throttle,
        engine_share: 1.0,
        brake_n_m: 0.0,
        grade_rad: vehicle.road.grade_rad,
        settled_pa: valves.settled_pa(&model, 0.0),
        dogs: [false; MAX_ELEMENTS],
        lock_up_n_m: 0.0,
    };
    let mut plant =
        CarIntegrator::new(&model, samples[begin].time_s, state, &inputs).unwrap().with_tolerance(TOLERANCE);
    let (mut slipped, mut largest) = (false, 0.0_f64);
    for pair in samples[begin..].windows(2) {
        let (now, next) = (&pair[0], &pair[1]);
        valves.send(&model, now.time_s, &commands(now));
        inputs.throttle = now.commands.throttle;
        while plant.time_s() < next.time_s - 1e-9 {
            inputs.settled_pa = valves.settled_pa(&model, plant.time_s() + 1e-9);
            let until_s = valves.next_arrival_s().map_or(next.time_s, |arrival| arrival.min(next.time_s));
            plant.advance(&model, &inputs, until_s, &mut |_| {}).unwrap();
        }
        let [engine, turbine, output] = model.speeds(plant.state());
        let far = |a: f64, b: f64, unit: f64| (a - b).abs() / unit;
        let x = &next.state;
        let distance = [
            far(engine, x.engine_rad_s, 100.0),
            far(turbine, x.turbine_rad_s, 100.0),
            far(output, x.output_rad_s, 100.0),
            far(plant.state().twist_rad, x.twist_rad, 0.1),
            far(plant.state().wheel_rad_s, x.wheel_rad_s, 10.0),
            far(plant.state().vehicle_m_s, x.vehicle_m_s, 10.0),
            far(model.pressure_pa(plant.state(), 0), next.offgoing_pa, 1e6),
            far(model.pressure_pa(plant.state(), 1), next.oncoming_pa, 1e6),
        ];
        let worst = distance.into_iter().fold(0.0, f64::max);
        assert!(worst < 1e-6, "{name}, {:.3} s: {distance:?}", next.time_s);
        largest = largest.max(worst);
        slipped |= next.oncoming_slip_rad_s.abs() < 1e-6 && next.offgoing_slip_rad_s.abs() > 10.0;
    }
    println!("{name}: the plants differ by {largest:.1e} of the scales");
    assert!(slipped, "{name}: the shift was completed");
}
