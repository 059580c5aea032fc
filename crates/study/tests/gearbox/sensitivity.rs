//! What each error does to the estimates of a shift.

use car::{Car, CarErrorBounds, ElementErrorBounds};
use config::{CarFile, Source};
use study::gearbox::influence::{CarInfluences, ValueFrom, car_influences};
use study::gearbox::sensitivity::{EffectInShift, PhaseOfShift, ShiftErrorKind, car_sensitivity};

use super::cars::{car_files, sensors};

fn effect(phase: &PhaseOfShift, error: ShiftErrorKind) -> Option<&EffectInShift> {
    phase.effects.iter().find(|effect| effect.error == error)
}

fn car_file(name: &str) -> CarFile {
    car_files().into_iter().find(|car| car.gearbox.name.contains(name)).unwrap()
}

fn car(name: &str) -> Car {
    car_file(name).car
}

/// What is known without a filter: the valve model alone has the whole error of friction, and none of the driveline.
#[test]
fn the_valve_model_alone_has_its_own_errors_and_no_other() {
    let car = car("AODE");
    let shifts = car_sensitivity(&car, &sensors()).unwrap();
    assert_eq!(shifts.len(), 12);
    for shift in &shifts {
        assert!(car.clutches[shift.element].is_some());
        for phase in shift.phases.iter().flatten() {
            let alone = |error| effect(phase, error).unwrap().torque_n_m[1];
            for error in [
                ShiftErrorKind::Converter,
                ShiftErrorKind::Inertia,
                ShiftErrorKind::Stiffness,
                ShiftErrorKind::OtherFriction,
            ] {
                assert_eq!(alone(error), 0.0, "{error:?}");
            }
            assert!(effect(phase, ShiftErrorKind::EngineTorque).is_none());
            // The torque by the valve model with exact timing is near the true one, and friction is 15 % of it.
            assert!(alone(ShiftErrorKind::Friction) <= 0.15 * 2.0 * phase.torque_n_m.max(10.0), "{phase:?}");
            let pressure = effect(phase, ShiftErrorKind::Friction).unwrap().pressure_pa;
            assert_eq!(pressure[1], 0.0, "friction is no error of the valve's pressure");
            let [filter, alone] = phase.std_dev_n_m();
            assert!(filter > 0.0 && alone > 0.0 && (phase.ratio() - filter / alone).abs() < 1e-12);
            assert!(phase.largest().unwrap().torque_n_m[0] <= 3.0_f64.sqrt() * filter);
        }
    }
    // Each error is at its bound in the file: one without any has no effect, half of one has half of it.
    let own = ElementErrorBounds {
        valve_delay_s: Some([0.01; 2]),
        friction_factor: Some([0.925, 1.075]),
        ..ElementErrorBounds::default()
    };
    let elements = vec![own; car.clutches.len()];
    let fitted = Car { error_bounds: CarErrorBounds { elements, ..CarErrorBounds::default() }, ..car.clone() };
    let narrow = car_sensitivity(&fitted, &sensors()).unwrap();
    for (narrow, shift) in narrow.iter().zip(&shifts) {
        for (narrow, phase) in narrow.phases.iter().flatten().zip(shift.phases.iter().flatten()) {
            let alone = |phase, error| effect(phase, error).unwrap().torque_n_m[1];
            assert_eq!(alone(narrow, ShiftErrorKind::ValveDelay), 0.0);
            // The valve model of the delay in the middle of the bounds is another, by a little.
            let ratio = alone(narrow, ShiftErrorKind::Friction) / alone(phase, ShiftErrorKind::Friction);
            assert!((ratio - 0.5).abs() < 0.1 || alone(phase, ShiftErrorKind::Friction) < 1.0, "{ratio}");
        }
    }
    // In the inertia phase under power the speeds show the clutch torque, but for the turbine torque.
    let up = shifts.iter().find(|shift| shift.shift.kind.name() == "power-on upshift").unwrap();
    let inertia = up.phases[1].as_ref().unwrap();
    assert!(inertia.ratio() < 0.6 && effect(inertia, ShiftErrorKind::Converter).unwrap().torque_n_m[0] > 1.0);
}

#[test]
fn a_car_without_converter_has_the_error_of_the_reported_engine_torque() {
    let car = car("dual clutch");
    let shifts = car_sensitivity(&car, &sensors()).unwrap();
    let phases = || shifts.iter().flat_map(|shift| shift.phases.iter().flatten());
    assert!(phases().all(|phase| effect(phase, ShiftErrorKind::Converter).is_none()));
    assert!(phases().any(|phase| effect(phase, ShiftErrorKind::EngineTorque).unwrap().torque_n_m[0] > 2.0));
    // Where the speeds show nothing, the page says so.
    assert!(phases().any(PhaseOfShift::is_hidden) && !phases().all(PhaseOfShift::is_hidden));
}

#[test]
fn values_of_the_file_of_the_gearbox_and_defaults_are_told_apart() {
    let car = car_file("AODE");
    let found = car_influences(&car, &sensors()).unwrap().unwrap();
    assert_eq!(found.shifts, 12);
    let of = |key: &str| found.values.iter().find(|value| value.key == key).unwrap();
    assert_eq!(of("element.pack.piston_area_m2").from, ValueFrom::Gearbox);
    assert_eq!(of("valve.gain.gain_pa_a").from, ValueFrom::Default);
    // A wrong gain spoils both, the filter less; the valve model alone does not know the shafts.
    let (gain, shafts) = (of("valve.gain.gain_pa_a").errors, of("driveline.shaft_stiffness_n_m_rad").errors);
    assert!(gain.torque_n_m[0] < gain.torque_n_m[1] && gain.torque_n_m[1] > found.as_it_is.torque_n_m[1], "{gain:?}");
    assert_eq!(shafts.torque_n_m[1], found.as_it_is.torque_n_m[1]);
    let order =
        |pair: &[study::gearbox::influence::CarInfluence]| pair[0].errors.torque_n_m[0] >= pair[1].errors.torque_n_m[0];
    assert!(found.values.windows(2).all(order));
}

#[test]
fn the_bounds_of_a_file_say_how_far_its_values_are_off() {
    let car = car_file("AODE");
    let narrow = ElementErrorBounds { valve_gain_factor: Some([0.98, 1.01]), ..ElementErrorBounds::default() };
    let wide = ElementErrorBounds { valve_gain_factor: Some([0.99, 1.03]), ..ElementErrorBounds::default() };
    let mut elements = vec![narrow; car.clutches.len()];
    elements[0] = wide;
    let error_bounds = CarErrorBounds { elements, converter_share: Some(0.02), ..CarErrorBounds::default() };
    let mut fitted = car.clone();
    fitted.error_bounds = error_bounds;
    let [series, fitted] = [car, fitted].map(|car| car_influences(&car, &sensors()).unwrap().unwrap());
    let of = |found: &CarInfluences, key: &str| found.values.iter().find(|value| value.key == key).unwrap().clone();
    assert_eq!(of(&series, "valve.gain.gain_pa_a").limits, [0.9, 1.1]);
    assert_eq!(of(&fitted, "valve.gain.gain_pa_a").limits, [0.98, 1.03]);
    assert_eq!(of(&fitted, "converter.capacity_n_m_s2").limits, [0.98, 1.02]);
    // What the file does not say is that of a car in series.
    assert_eq!(of(&fitted, "valve.lag.time_constant_s").limits, of(&series, "valve.lag.time_constant_s").limits);
    // The valve model alone has what the gain adds: a fifth of the error, not all of it.
    let added =
        |found: &CarInfluences| of(found, "valve.gain.gain_pa_a").errors.pressure_pa[1] - found.as_it_is.pressure_pa[1];
    assert!(added(&fitted) < 0.4 * added(&series), "{} {}", added(&fitted), added(&series));
}

#[test]
fn a_car_that_makes_no_shift_is_no_car_without_errors() {
    // Oil at -40 degC: the pistons do not arrive in time.
    let text = "name = \"cold\"\ngearbox = \"8hp.toml\"\n[fill]\nstroke_m = 0.02\n[oil]\ntemperature_degc = -40\n";
    let gearbox = include_str!("../../../../gearboxes/8hp.toml");
    let car = CarFile::from_sources(Source::built_in("car.toml", text), Source::built_in("8hp.toml", gearbox)).unwrap();
    assert_eq!(car_influences(&car, &sensors()).unwrap().unwrap().shifts, 0);
}
