//! No input, in either precision and with any car, makes an observer panic, or say `good` of what cannot be.

use std::sync::OnceLock;

use car::{GainMethod, Vehicle};
use config::VehicleFile;
use design::{
    Model, bounded, compliant_observer, design_compliant, design_discrete, design_rigid, design_sliding,
    extended_filter, inversion, kalman_filter, rigid_observer, sliding_observer, super_twisting, unscented_filter,
};
use drivetrain::{ClutchValve, PulseWidth, Real, Table1, Valve};
use observer::{
    CompliantGains, Discretisation, Estimate, Estimator, FillBudget, Health, Input, InputLimits, Reading, RigidGains,
    Schedule, SlidingGains, Tracker, one_shift_filter,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

/// Gains of every design of the built-in car; they are tried on any car, as a wrong file would.
struct Gains {
    rigid: Vec<Schedule<f64, RigidGains<f64>>>,
    compliant: Vec<Schedule<f64, CompliantGains<f64>>>,
    sliding: SlidingGains<f64>,
}

fn gains() -> &'static Gains {
    static GAINS: OnceLock<Gains> = OnceLock::new();
    GAINS.get_or_init(|| {
        let vehicle = VehicleFile::built_in().unwrap().vehicle;
        let methods = &GainMethod::ALL[1..];
        let discrete = |model, method: &GainMethod| design_discrete(&vehicle, model, *method, 0.01).unwrap();
        let mut rigid = vec![design_rigid(&vehicle).unwrap().gains().into(), RigidGains::open_loop().into()];
        rigid.extend(methods.iter().map(|method| discrete(Model::Rigid, method).rigid_gains()));
        let mut compliant = vec![design_compliant(&vehicle).unwrap().gains().into()];
        compliant.extend(methods.iter().map(|method| discrete(Model::Compliant, method).compliant_gains()));
        Gains { rigid, compliant, sliding: design_sliding(&vehicle) }
    })
}

/// A sample as a log may hold it.
type Sample = [f64; 6];

/// A subnormal number stands for a reading that did not come; one in some is old.
fn at<T: Real>(sample: &Sample) -> Input<T> {
    let [dt_s, engine, turbine, slip, wheel, command] = *sample;
    let reading = |value: f64| {
        let age_s = if value.to_bits().is_multiple_of(5) { (value * 1e3).fract().abs() * 0.1 } else { 0.0 };
        (value == 0.0 || !value.is_subnormal()).then(|| Reading { value: T::of(value), age_s: T::of(age_s) })
    };
    Input {
        dt_s: T::of(dt_s),
        engine_rad_s: reading(engine),
        turbine_rad_s: reading(turbine),
        // Slip of the built-in car.
        output_rad_s: reading(turbine - 0.6 * slip),
        wheel_rad_s: reading(wheel),
        command: reading(command),
        offgoing_command: reading(command),
        engine_torque_n_m: reading(engine),
    }
}

/// What may never be, whatever the input.
fn judge<T: Real>(limits: &InputLimits<T>, estimate: &Estimate<T>) -> Result<(), TestCaseError> {
    let pressure = estimate.pressure_pa;
    prop_assert!(pressure >= T::zero() && pressure <= limits.pressure_max_pa, "{estimate:?}");
    prop_assert!(estimate.clutch_torque_n_m.is_finite(), "{estimate:?}");
    prop_assert!(estimate.shaft_torque_n_m.is_none_or(|torque| torque.is_finite()), "{estimate:?}");
    if let Some(bounds) = estimate.bounds {
        for [low, high] in
            [Some(bounds.pressure_pa), Some(bounds.clutch_torque_n_m), bounds.shaft_torque_n_m].into_iter().flatten()
        {
            prop_assert!(low <= high && low.is_finite() && high.is_finite(), "{estimate:?}");
        }
        prop_assert!(bounds.hold(estimate) || estimate.health != Health::Good, "{estimate:?}");
    }
    Ok(())
}

fn survives<T: Real>(
    observer: &impl Estimator<T>,
    limits: &InputLimits<T>,
    samples: &[Sample],
    recovers: bool,
) -> Result<(), TestCaseError> {
    let mut state = observer.start();
    for sample in samples {
        judge(limits, &observer.step(&mut state, &at(sample)))?;
    }
    // Whatever there was before, usable samples are used again, and once it has said that it starts anew there is nothing
    // more to say. With gains of another car every sample may ask for what cannot be.
    let mut health = Health::TimeRejected;
    let (speed, command) = (limits.speed_max_rad_s.to_f64_exact(), 0.3 * limits.command_max.to_f64_exact());
    // The built-in car in first gear, in which the ring stands still.
    let usable = [0.01, 0.3 * speed, 0.2 * speed, 0.2 * speed, 0.2 * speed / 7.5, command];
    for _ in 0..20 {
        let estimate = observer.step(&mut state, &at(&usable));
        judge(limits, &estimate)?;
        health = estimate.health;
    }
    let name = std::any::type_name_of_val(observer);
    let usual = matches!(
        health,
        Health::Good
            | Health::ReadingRefused
            | Health::ChannelLost
            | Health::Flare
            | Health::OutsideRange
            | Health::LimitedToRange
            | Health::PressureLimited
            | Health::HeldClutchSlips
    );
    prop_assert!(usual || !recovers, "{name} {health:?}");
    Ok(())
}

/// Every observer with every method in this precision, with and without its range.
fn attack<T: Real>(
    vehicle: &Vehicle,
    discretisation: Discretisation,
    samples: &[Sample],
    recovers: bool,
) -> Result<(), TestCaseError> {
    let limits = &design::input_limits(vehicle).cast::<T>();
    let range = bounded(vehicle, ());
    let tracker = |tracker: Tracker<f64>| Tracker { discretisation, ..tracker };
    macro_rules! survives {
        ($observer:expr) => {{
            let mut observer = $observer;
            observer.tracker = tracker(observer.tracker);
            survives(&observer.cast::<T>(), limits, samples, recovers)?;
            survives(&range.cast(observer.cast::<T>()), limits, samples, recovers)?;
        }};
    }
    for gains in &gains().rigid {
        survives!(rigid_observer(vehicle, *gains));
    }
    for gains in &gains().compliant {
        survives!(compliant_observer(vehicle, *gains));
    }
    survives!(sliding_observer(vehicle, gains().sliding));
    let kalman = kalman_filter(vehicle, None).cast::<T>();
    survives(&kalman, limits, samples, recovers)?;
    survives(&range.cast(kalman), limits, samples, recovers)?;
    let gearbox = one_shift_filter(vehicle, None).cast::<T>();
    survives(&gearbox, limits, samples, recovers)?;
    survives(&range.cast(gearbox), limits, samples, recovers)?;
    survives!(extended_filter(vehicle, None));
    survives!(super_twisting(vehicle));
    survives!(inversion(vehicle));
    let mut unscented = unscented_filter(vehicle, None);
    unscented.filter.tracker = tracker(unscented.filter.tracker);
    survives(&unscented.cast::<T>(), limits, samples, recovers)
}

/// Numbers that break things: no numbers, infinite, subnormal, huge, of any bits; and such as a car has.
fn number(usual: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => usual,
        2 => prop::sample::select(vec![
            f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 5e-324, 1e-310, 1e-40, -1e-40, 1e-15,
            1e15, 1e37, -1e37, f64::MAX, f64::MIN, f64::MIN_POSITIVE,
        ]),
        1 => any::<u64>().prop_map(f64::from_bits),
        1 => any::<u32>().prop_map(|bits| f64::from(f32::from_bits(bits))),
    ]
}

fn sample() -> impl Strategy<Value = Sample> {
    [
        number(0.0..0.05).boxed(),
        number(0.0..700.0).boxed(),
        number(-100.0..700.0).boxed(),
        number(-300.0..400.0).boxed(),
        number(-5.0..80.0).boxed(),
        number(0.0..1.2).boxed(),
    ]
}

/// Samples of a car: one number of a row in eight is broken, the row before goes on otherwise.
fn samples() -> impl Strategy<Value = Vec<Sample>> {
    let mostly_usual = [
        (0.001..0.03).boxed(),
        (80.0..600.0).boxed(),
        (0.0..600.0).boxed(),
        (-200.0..350.0).boxed(),
        (0.0..70.0).boxed(),
        (0.0..1.0).boxed(),
    ];
    prop::collection::vec(prop_oneof![3 => sample(), 5 => mostly_usual], 1..40)
}

/// Limits of the valve and of a stroke, from all over what a vehicle file may say.
fn valve_and_stroke(v: &mut Vehicle, draw: [f64; 12]) {
    let mut draws = draw.into_iter();
    let mut within = |low: f64, high: f64| low * (high / low).powf(draws.next().unwrap());
    let (bounds, cylinder) = (&mut v.error_bounds, &v.oncoming.cylinder);
    bounds.line_pressure_pa = [within(1e-3, 1.0) * bounds.pressure_max_pa, bounds.pressure_max_pa];
    bounds.valve_hysteresis_pa = within(1.0, 0.2e6);
    bounds.command_age_s = within(1e-6, 1.0);
    bounds.fill = Some(FillBudget {
        volume_m3: [within(1e-9, 1e-5), within(1e-5, 1e-3)],
        preload_pressure_pa: [0.0, cylinder.preload_pa],
        kiss_pressure_pa: [within(1e-3, 1.0) * cylinder.kiss_pa, cylinder.kiss_pa],
        supply: [cylinder.supply.with_resistance_factor(within(0.01, 1.0)), cylinder.supply],
        exhaust: [cylinder.exhaust, cylinder.exhaust.with_resistance_factor(within(1.0, 20.0))],
        viscosity_m2_s: [1e-6, within(1e-6, 1e-2)],
        flow_max_m3_s: within(1e-6, 1e-2),
        leak_m3_s_pa: within(1e-15, 1e-9),
        capacity_m3_pa: within(1e-14, 1e-8),
    });
}

/// A car with numbers from all over what a vehicle file may say.
fn vehicle() -> impl Strategy<Value = Vehicle> {
    let fraction = || 0.0..1.0_f64;
    (prop::array::uniform32(fraction()), prop::array::uniform12(fraction()), any::<bool>()).prop_map(
        |(draw, budget, pulse_width)| {
            let mut draws = draw.into_iter();
            // On a logarithmic scale: the ends of the ranges are met as often as their middles.
            let mut within = |low: f64, high: f64| low * (high / low).powf(draws.next().unwrap());
            let mut v = VehicleFile::built_in().unwrap().vehicle;
            v.engine.inertia_kg_m2 = within(0.01, 5.0);
            v.driveline.final_ratio = within(0.5, 10.0);
            v.driveline.shaft_stiffness_n_m_rad = within(100.0, 1e6);
            v.driveline.shaft_damping_n_m_s_rad = within(0.01, 1e4);
            v.road.mass_kg = within(200.0, 60e3);
            v.road.wheel_radius_m = within(0.1, 1.0);
            let clutch = &mut v.oncoming.clutch;
            clutch.mean_radius_m = within(0.02, 0.5);
            clutch.friction_faces = within(1.0, 30.0);
            clutch.piston_area_m2 = within(0.001, 0.05);
            clutch.return_spring_n = within(1.0, 10e3);
            clutch.friction = Table1::constant(within(0.02, 0.5));
            clutch.static_friction = 0.5;
            v.settings.speed_max_rad_s = within(100.0, 5e3);
            v.error_bounds.pressure_max_pa = within(1e5, 10e6);
            valve_and_stroke(&mut v, budget);
            v.error_bounds.turbine_torque_share = within(1e-3, 0.9);
            v.error_bounds.sampling_delay_s = within(1e-6, 0.2);
            v.error_bounds.valve_delay_s = [0.0, within(1e-6, 0.5)];
            v.settings.filter.turbine_share = within(1e-4, 1.0);
            v.settings.filter.turbine_share_s = within(0.01, 1e3);
            v.settings.filter.valve_rate_s = within(1e-3, 10.0);
            v.settings.filter.offgoing_n_m = within(0.1, 1e5);
            v.settings.filter.offgoing_release_s = within(1e-3, 10.0);
            v.settings.filter.output_least_rad_s = within(0.1, 500.0);
            v.settings.shaft_settling_s = within(0.01, 10.0);
            v.settings.phase_slips.lock_slip_rad_s = within(0.1, 100.0);
            v.settings.phase_slips.release_slip_rad_s = within(0.1, 100.0);
            let time_constant_s = within(0.001, 2.0);
            if pulse_width {
                let law =
                    PulseWidth { flow_sqrt_pa_s: within(1e3, 1e6), line_pressure_pa: v.error_bounds.pressure_max_pa };
                v.settings.valve = Valve::PulseWidth(law);
                v.oncoming.valve = ClutchValve::PulseWidth { law, delay_s: Table1::constant(0.01) };
                v.settings.command_max = 100.0;
            } else {
                v.settings.valve = Valve::Proportional { time_constant_s, gain_pa_a: within(1e4, 20e6) };
            }
            v
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn prop_no_input_stops_an_observer(samples in samples(), euler in any::<bool>()) {
        let vehicle = VehicleFile::built_in().unwrap().vehicle;
        let discretisation = if euler { Discretisation::Euler } else { Discretisation::Exact };
        attack::<f64>(&vehicle, discretisation, &samples, true)?;
        attack::<f32>(&vehicle, discretisation, &samples, true)?;
    }

    #[test]
    fn prop_no_car_stops_an_observer(vehicle in vehicle(), samples in samples()) {
        attack::<f64>(&vehicle, Discretisation::Exact, &samples, false)?;
        attack::<f32>(&vehicle, Discretisation::Exact, &samples, false)?;
    }
}
