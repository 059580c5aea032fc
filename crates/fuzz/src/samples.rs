//! Samples for the observers: plausible ones with some that are not.

use car::{GainMethod, ObserverKind, Vehicle};
use design::{DesignError, bounded};
use drivetrain::Real;
use observer::{Estimate, Estimator, Health, Input, InputLimits, Reading};
use study::AnyObserver;

use crate::mutate::Random;

/// Sample time of designed gains, s.
const SAMPLE_S: f64 = 0.01;
/// Most samples of an input.
const MAX_SAMPLES: usize = 80;
/// Numbers of a sample.
const NUMBERS: usize = 7;
/// Bytes of a number.
const BYTES: usize = 8;

/// Every kind of observer, with gains of these methods where they are designed.
pub(crate) fn observers(vehicle: &Vehicle, methods: &[GainMethod]) -> Result<Vec<AnyObserver>, DesignError> {
    use ObserverKind::{
        Compliant, Extended, Gearbox, Inversion, Kalman, OpenLoop, OpenLoopMaps, Rigid, Sliding, SuperTwisting,
        Unscented,
    };
    let designed = [Rigid, Compliant].into_iter().flat_map(|kind| methods.iter().map(move |&method| (kind, method)));
    let others = [OpenLoop, OpenLoopMaps, Sliding, Gearbox, Kalman, Extended, Unscented, SuperTwisting, Inversion];
    (designed.chain(others.map(|kind| (kind, GainMethod::Iss))))
        .map(|(kind, method)| AnyObserver::designed(vehicle, kind, method, SAMPLE_S, None))
        .collect()
}

/// What must hold of an estimate whatever the input was.
fn assert_what_holds_for_any_input<T: Real, O>(_: &O, limits: &InputLimits<T>, estimate: &Estimate<T>) {
    let possible = estimate.pressure_pa >= T::zero() && estimate.pressure_pa <= limits.pressure_max_pa;
    let finite = estimate.clutch_torque_n_m.is_finite() && estimate.shaft_torque_n_m.is_none_or(|n_m| n_m.is_finite());
    let held = estimate.bounds.is_none_or(|bounds| bounds.hold(estimate)) || estimate.health != Health::Good;
    assert!(possible && finite && held, "{}: {estimate:?}", std::any::type_name::<O>());
}

fn step_through<T: Real>(
    observer: &impl Estimator<T>,
    limits: &InputLimits<T>,
    inputs: impl Iterator<Item = Input<T>>,
) {
    let mut state = observer.start();
    for input in inputs {
        assert_what_holds_for_any_input(observer, limits, &observer.step(&mut state, &input));
    }
}

/// Steps every observer through an input, alone and within its range, in both precisions.
pub(crate) fn step_all(vehicle: &Vehicle, observers: &[AnyObserver], input: &[u8]) {
    let limits = &design::input_limits(vehicle);
    macro_rules! both {
        ($observer:expr) => {{
            let (double, single) = ($observer, $observer.cast::<f32>());
            step_through(double, limits, doubles(input));
            step_through(&bounded(vehicle, double), limits, doubles(input));
            step_through(&single, &limits.cast(), singles(input));
            step_through(&bounded(vehicle, ()).cast(&single), &limits.cast(), singles(input));
        }};
    }
    for observer in observers {
        match observer {
            AnyObserver::Rigid(observer) => both!(observer),
            AnyObserver::Compliant(observer) => both!(observer.as_ref()),
            AnyObserver::Sliding(observer) => both!(observer),
            AnyObserver::Gearbox(observer) => both!(observer.as_ref()),
            AnyObserver::Kalman(observer) => both!(observer.as_ref()),
            AnyObserver::Extended(observer) => both!(observer.as_ref()),
            AnyObserver::Unscented(observer) => both!(observer.as_ref()),
            AnyObserver::SuperTwisting(observer) => both!(observer.as_ref()),
            AnyObserver::Inversion(observer) => both!(observer.as_ref()),
        }
    }
}

/// The observers of a vehicle whose gains need no design, through a plausible input.
pub(crate) fn drive_all(vehicle: &Vehicle) {
    let input = input(&mut Random::new(rand_pcg::Pcg64Mcg::new(1)));
    let Ok(observers) = observers(vehicle, &[]) else { return };
    step_all(vehicle, &observers, &input);
}

/// The numbers of a sample: time step, engine, turbine, output, wheel, command, age.
fn numbers(sample: &[u8]) -> [u64; NUMBERS] {
    let mut numbers = [0; NUMBERS];
    for (number, bytes) in numbers.iter_mut().zip(sample.chunks_exact(BYTES)) {
        *number = bytes.iter().rev().fold(0, |bits, &byte| bits << 8 | u64::from(byte));
    }
    numbers
}

fn sample<T: Real>([dt_s, engine, turbine, output, wheel, command, age_s]: [T; NUMBERS]) -> Input<T> {
    // A value that is not a number did not come; every reading is as old, or of the moment.
    let reading = |value: T| (!value.is_nan()).then_some(Reading { value, age_s });
    Input {
        dt_s,
        engine_rad_s: reading(engine),
        turbine_rad_s: reading(turbine),
        output_rad_s: reading(output),
        wheel_rad_s: reading(wheel),
        command: reading(command),
        offgoing_command: reading(wheel),
        engine_torque_n_m: reading(engine),
    }
}

fn doubles(input: &[u8]) -> impl Iterator<Item = Input<f64>> {
    input.chunks(NUMBERS * BYTES).map(|bytes| sample(numbers(bytes).map(f64::from_bits)))
}

/// The same samples rounded; of every other one that is no plausible number, the lower half of its bits.
// Rounding and halves of bits are the purpose.
fn singles(input: &[u8]) -> impl Iterator<Item = Input<f32>> {
    let single = |bits: u64| {
        let double = f64::from_bits(bits);
        let plausible = double == 0.0 || (1e-12..1e12).contains(&double.abs());
        if plausible || bits & 1 == 0 { double as f32 } else { f32::from_bits(bits as u32) }
    };
    input.chunks(NUMBERS * BYTES).map(move |bytes| sample(numbers(bytes).map(single)))
}

/// Numbers that no sensor gives.
const STRANGE: [f64; 16] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.0,
    -0.0,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    -1e-310,
    3.5e38,
    -3.5e38,
    1e-40,
    1e12,
    -1e-3,
    1e-9,
];

/// Samples as bytes. Some inputs are a drive with a strange number now and then, some are nothing but strange ones.
pub(crate) fn input(random: &mut Random) -> Vec<u8> {
    let strange = *random.of(&[0.0, 0.01, 0.1, 0.5, 1.0]);
    // Time step, engine, turbine, output, wheel, command, age.
    let ranges = [(1e-4, 0.04), (80.0, 500.0), (0.0, 400.0), (0.0, 180.0), (0.0, 60.0), (0.0, 1.0), (0.0, 0.02)];
    let mut now: [f64; NUMBERS] = [0.01, 380.0, 340.0, 159.0, 53.0, 0.25, 0.0];
    let mut bytes = Vec::new();
    for _ in 0..=random.below(MAX_SAMPLES) {
        for (value, (low, high)) in now.iter_mut().zip(ranges) {
            *value = match random.below(40) {
                0 => low + (high - low) * random.fraction(),
                1..=10 => (*value + 0.05 * (high - low) * (random.fraction() - 0.5)).clamp(low, high),
                _ => *value,
            };
            let given = if random.fraction() < strange {
                if random.below(2) == 0 { *random.of(&STRANGE) } else { f64::from_bits(random.bits()) }
            } else {
                *value
            };
            bytes.extend(given.to_bits().to_le_bytes());
        }
    }
    bytes
}
