//! The vehicle of one shift of a car with a gearbox.

use car::one_shift::ACCELERATION_ERRORS_RAD_S2;
use car::{Car, Vehicle};
use config::{CarFile, Source, VehicleFile};
use drivetrain::Valve;

fn shipped(vehicle: &str, gearbox: &str) -> Car {
    let read = |path: String| {
        let text = std::fs::read_to_string(format!("{}/../../{path}", env!("CARGO_MANIFEST_DIR"))).unwrap();
        Source { path: path.into(), text }
    };
    CarFile::from_sources(read(format!("vehicles/{vehicle}.toml")), read(format!("gearboxes/{gearbox}.toml")))
        .unwrap()
        .car
}

fn eight_speed() -> Car {
    CarFile::eight_speed().unwrap().car
}

fn of(car: &Car, shift: &str) -> Result<Vehicle, String> {
    let gears = car.shift_named(shift).map_err(|error| error.to_string())?;
    car.of_shift(gears).map_err(|error| error.to_string())
}

fn near(a: f64, b: f64, within: f64) {
    assert!((a / b - 1.0).abs() < within, "{a} {b}");
}

/// The two-speed gearbox with the eight-speed car around it, whose engine, driveline and body are those of the built-in vehicle of one
/// shift.
#[test]
fn the_two_speed_gearbox_gives_the_built_in_vehicle() {
    let text = "name = \"two speeds\"\ngearbox = \"two_speed.toml\"\n[hydraulics]\nline_pressure_pa = 1.0e6\n";
    let gearbox = Source::built_in("two_speed.toml", include_str!("../../../gearboxes/two_speed.toml"));
    let found = of(&CarFile::from_sources(Source::built_in("two.toml", text), gearbox).unwrap(), "1-2").unwrap();
    let built_in = VehicleFile::built_in().unwrap().vehicle;
    assert_eq!((found.engine, found.converter), (built_in.engine, built_in.converter));
    assert_eq!((found.driveline, found.road), (built_in.driveline, built_in.road));
    near(found.output_inertia_kg_m2, built_in.output_inertia_kg_m2, 1e-12);
    let (own, other) = (&found.shift, &built_in.shift);
    for i in 0..2 {
        near(own.slip_offgoing[i], other.slip_offgoing[i], 1e-12);
        near(own.slip_oncoming[i], other.slip_oncoming[i], 1e-12);
        near(own.mass_kg_m2[i][i], other.mass_kg_m2[i][i], 1e-12);
    }
    // The friction of this gearbox is 0.13 to 0.157, that of the built-in car 0.12 to 0.145.
    let (own, other) = (&found.error_bounds, &built_in.error_bounds);
    near(own.shift_pressure_pa, 0.13 / 0.1437 * other.shift_pressure_pa, 0.01);
    near(own.shift_ramp_pa_s / own.shift_pressure_pa, 4.0, 1e-9);
    near(own.offgoing_torque_n_m, other.offgoing_torque_n_m, 1e-9);
    near(own.output_torque_n_m, other.output_torque_n_m, 1e-9);
    near(own.shaft_torque_n_m, other.shaft_torque_n_m, 1e-9);
    near(own.slip_quantum_rad_s, other.slip_quantum_rad_s, 0.03);
    near(own.slip_rad_s, other.slip_rad_s, 1e-9);
    // A turbine torque within 13.3 N m, and in the inertia phase 7.9 N m of the inertia, in place of 20 N m.
    let model_error = |phase: fn(&Vehicle) -> f64| phase(&found) / phase(&built_in);
    assert!((0.9..1.0).contains(&model_error(|vehicle| vehicle.requirements.torque_phase.model_error_max_rad_s2)));
    near(model_error(|vehicle| vehicle.requirements.inertia_phase.model_error_max_rad_s2), 1.0, 0.1);
    near(found.settings.filter.offgoing_n_m, built_in.settings.filter.offgoing_n_m, 1e-9);
    assert_eq!(found.settings.phase_slips, built_in.settings.phase_slips);
    // The turbine torque is within 10 % of 133 N m, the inertia of 0.06 kg m^2 and more within 20 %.
    near(own.turbine_torque_n_m, 13.3, 1e-9);
    near(own.inertia_torque_n_m, 0.2 * found.shift.mass_kg_m2[0][0] * 600.0, 1e-9);
}

/// What a shift has in common with the built-in vehicle stands in both.
#[test]
fn what_no_car_scales_is_that_of_the_vehicle_files_of_one_shift() {
    let pulse_width = "kind = \"pulse-width\"\nflow_sqrt_pa_s = 6000\nline_pressure_pa = 2.0e6\n\
        delay = { duty_percent = [0.0, 100.0], delay_s = [0.016, 0.016] }\n";
    let text = format!("name = \"car\"\ngearbox = \"8hp.toml\"\n[clutch.C.valve]\n{pulse_width}");
    let gearbox = Source::built_in("8hp.toml", include_str!("../../../gearboxes/8hp.toml"));
    let by_duty_cycle = CarFile::from_sources(Source::built_in("car.toml", &text), gearbox).unwrap().car;
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_pwm.toml");
    let pwm = VehicleFile::read(path.as_ref()).unwrap().vehicle;
    let built_in = VehicleFile::built_in().unwrap().vehicle;
    for (found, other) in [(of(&eight_speed(), "2-3").unwrap(), built_in), (of(&by_duty_cycle, "2-3").unwrap(), pwm)] {
        assert_eq!(
            (found.settings.phase_slips, found.settings.speed_max_rad_s),
            (other.settings.phase_slips, other.settings.speed_max_rad_s)
        );
        assert_eq!(
            (found.settings.uncertainty.valve, found.settings.shaft_settling_s),
            (other.settings.uncertainty.valve, other.settings.shaft_settling_s)
        );
        let settling = |vehicle: &Vehicle| {
            let (torque, inertia) = (&vehicle.requirements.torque_phase, &vehicle.requirements.inertia_phase);
            let compliant =
                (&vehicle.requirements.compliant_torque_phase, &vehicle.requirements.compliant_inertia_phase);
            [
                (torque.settling_time_s, torque.kappa1_per_s),
                (inertia.settling_time_s, inertia.kappa1_per_s),
                (compliant.0.settling_time_s, compliant.0.kappa1_per_s),
                (compliant.1.settling_time_s, compliant.1.kappa1_per_s),
            ]
        };
        assert_eq!(settling(&found), settling(&other));
        let of_pressure = |vehicle: &Vehicle| {
            let size = vehicle.error_bounds.shift_pressure_pa;
            [
                vehicle.requirements.torque_phase.offset_max_pa,
                vehicle.requirements.inertia_phase.offset_max_pa,
                vehicle.error_bounds.pressure_pa,
            ]
            .map(|pressure_pa| pressure_pa / size)
        };
        for (own, other) in of_pressure(&found).into_iter().zip(of_pressure(&other)) {
            near(own, other, 1e-12);
        }
        let same = |vehicle: &Vehicle| {
            let (bounds, filter) = (&vehicle.error_bounds, &vehicle.settings.filter);
            let of_bounds = [
                bounds.grade_rad,
                bounds.offgoing_drain_s,
                bounds.turbine_quantum_rad_s,
                bounds.output_quantum_rad_s,
                bounds.wheel_quantum_rad_s,
                bounds.sampling_delay_s,
                bounds.float32_rounding,
                bounds.command_age_s,
                bounds.wheel_delay_s,
                bounds.channel_skew_s,
                bounds.backlash_rad,
            ];
            let of_filter = [
                filter.turbine_share,
                filter.turbine_share_s,
                filter.twist_rate_rad_s,
                filter.valve_rate_s,
                filter.offgoing_release_s,
                filter.output_least_rad_s,
            ];
            (of_bounds, of_filter)
        };
        assert_eq!(same(&found), same(&other));
    }
    let errors = VehicleFile::built_in().unwrap().acceleration_errors();
    for (own, other) in ACCELERATION_ERRORS_RAD_S2.into_iter().zip(errors) {
        near(own, other, 1e-12);
    }
}

#[test]
fn the_bounds_are_those_of_the_car_and_of_the_oncoming_element() {
    let mut car = eight_speed();
    let vehicle = of(&car, "2-3").unwrap();
    let bounds = &vehicle.error_bounds;
    assert_eq!((bounds.friction_factor, bounds.valve_gain_factor), ([0.85, 1.15], [0.9, 1.1]));
    assert_eq!((bounds.valve_lag_factor, bounds.valve_delay_s), ([0.5, 1.5], [0.0, 0.03]));
    assert_eq!((bounds.valve_hysteresis_pa, bounds.shaft_stiffness_factor), (10e3, [0.8, 1.2]));
    near(bounds.pressure_max_pa, 1.1 * 1.6e6, 1e-12);
    let (minimum, maximum) = vehicle.settings.uncertainty.friction;
    near(minimum, 0.85 * 0.12, 1e-9);
    near(maximum, 1.15 * 0.12 * 1.21, 1e-9);
    // The valve is as it is at the pressure of a shift.
    let Valve::Proportional { time_constant_s, gain_pa_a } = vehicle.settings.valve else { panic!() };
    let pressure_pa = vehicle.oncoming.clutch.kiss_pressure() + bounds.shift_pressure_pa;
    let valve = vehicle.oncoming.valve;
    near(valve.settled_pressure(pressure_pa / gain_pa_a), pressure_pa, 1e-9);
    near(time_constant_s, valve.lag(pressure_pa, 0.0), 1e-12);
    // C closes in 2-3: what the file says of it is taken, and what it says of E is not.
    car.error_bounds.elements[2].friction_factor = Some([0.95, 1.05]);
    car.error_bounds.elements[4].friction_factor = Some([0.5, 1.5]);
    car.error_bounds.elements[2].command = Some(0.03);
    car.error_bounds.converter_share = Some(0.05);
    let vehicle = of(&car, "2-3").unwrap();
    assert_eq!(vehicle.error_bounds.friction_factor, [0.95, 1.05]);
    assert_eq!(vehicle.error_bounds.command, 0.03);
    near(vehicle.error_bounds.turbine_torque_n_m, 0.05 * 133.0, 1e-9);
}

#[test]
fn every_single_upshift_of_the_shipped_cars_with_a_converter_has_a_vehicle() {
    for (vehicle, gearbox, upshifts) in [
        ("four_speed", "ravigneaux_4", 3),
        ("six_speed", "lepelletier_6", 5),
        ("eight_speed", "8hp", 7),
        ("eight_speed_stroke", "8hp", 7),
        ("ten_speed", "10_speed", 9),
    ] {
        let car = shipped(vehicle, gearbox);
        let found = car.single_upshifts();
        assert_eq!(found.len(), upshifts, "{vehicle}");
        for gears in found {
            let vehicle = car.of_shift(gears).unwrap();
            let shift = &vehicle.shift;
            near(shift.ratio_offgoing(), car.gearbox.gears[gears[0]].ratio, 1e-9);
            near(shift.ratio_oncoming(), car.gearbox.gears[gears[1]].ratio, 1e-9);
            assert!(vehicle.error_bounds.shift_pressure_pa < vehicle.error_bounds.pressure_max_pa, "{}", vehicle.name);
            assert_eq!(vehicle.oncoming.has_stroke, vehicle.error_bounds.fill.is_some());
        }
    }
}

#[test]
fn a_normally_high_valve_is_commanded_by_the_current_below_the_one_without_pressure() {
    let valve = "[clutch.C.valve]\nzero_pressure_a = 1.2\n\
        lag = { pressure_pa = [0.0, 2e6], time_constant_s = [0.05, 0.05] }\n\
        gain = { current_a = [0.0, 1.2], gain_pa_a = [1.5e6, 1.5e6] }\n\
        delay = { current_a = [0.0, 1.2], delay_s = [0.01, 0.01] }\n";
    let text = format!("name = \"car\"\ngearbox = \"8hp.toml\"\n{valve}");
    let gearbox = Source::built_in("8hp.toml", include_str!("../../../gearboxes/8hp.toml"));
    let car = CarFile::from_sources(Source::built_in("car.toml", &text), gearbox).unwrap().car;
    let vehicle = of(&car, "2-3").unwrap();
    assert!(car.clutches[2].unwrap().valve.falls() && !vehicle.oncoming.valve.falls());
    assert_eq!(vehicle.settings.valve, Valve::Proportional { time_constant_s: 0.05, gain_pa_a: 1.5e6 });
}

#[test]
fn a_shift_without_a_vehicle_is_told_why() {
    let car = eight_speed();
    let cases = [
        (
            "1-9",
            "the gearbox has no shift \"1-9\"\nhint: two gears with a hyphen between them, as \"1-2\"; its gears are R, 1, 2, 3, 4, 5, 6, 7, 8",
        ),
        ("12", "the gearbox has no shift \"12\""),
        ("", "the gearbox has no shift \"\""),
        ("-", "the gearbox has no shift \"-\""),
        ("3-3", "the gearbox has no shift \"3-3\""),
        (
            "2-1",
            "2-1 is no upshift between forward gears, and the designs are for upshifts with a driving engine\nhint: the gearbox filter estimates",
        ),
        ("R-1", "R-1 is no upshift between forward gears"),
        ("1-4", "in 1-4 more than one element opens or closes (double)"),
    ];
    for (shift, words) in cases {
        let error = of(&car, shift).unwrap_err();
        assert!(error.contains(words), "{shift}: {error}");
        assert!(!error.contains("are \n") && !error.ends_with("are "), "{shift}: {error}");
    }
    let error = of(&car, "1-4").unwrap_err();
    assert!(error.ends_with("are 1-2, 2-3, 3-4, 4-5, 5-6, 6-7, 7-8"), "{error}");
    let error = of(&shipped("dual_clutch", "dual_clutch_7"), "1-2").unwrap_err();
    assert!(error.contains("the car has no converter") && error.contains("\nhint: the gearbox filter"), "{error}");
    let mut without = eight_speed();
    without.clutches[2] = None;
    let error = of(&without, "2-3").unwrap_err();
    assert!(error.contains("C, which opens or closes in 2-3, has no friction plates\nhint: "), "{error}");
    let gears = without.shift_named("2-3").unwrap();
    let place = without.gearbox.shifts.iter().position(|shift| [shift.from, shift.to] == gears).unwrap();
    without.clutches = car.clutches.clone();
    without.gearbox.shifts[place].reduced = None;
    let error = of(&without, "2-3").unwrap_err();
    assert!(error.contains("the inertias of 2-3 are not known\nhint: "), "{error}");
}
