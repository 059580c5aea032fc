//! The vehicle of one shift as a car with two gears, against a vehicle file with a gearbox that says the same.

use car::two_gears::{OFFGOING, ONCOMING};
use car::{Car, ErrorBudget, Vehicle};
use config::{CarFile, Source, VehicleFile};
use observer::{GearboxFilter, ShiftTables, gearbox_filter, one_shift_filter};

/// What `vehicles/two_speed_at.toml` states, key by key.
const BY_HAND: &str = r#"
name = "two speeds"
gearbox = "two_speed.toml"

[hydraulics]
line_pressure_pa = 1136363.636363636

[clutch.A]
friction = { slip_rad_s = [0.0, 10.0, 50.0, 150.0, 450.0], coefficient = [0.120, 0.123, 0.130, 0.138, 0.145] }
static_friction = 0.13
drag_n_m = 0.0
[clutch.A.valve]
lag = { pressure_pa = [0.0, 0.05e6, 0.1e6, 0.2e6, 0.4e6, 0.7e6, 1.0e6], time_constant_s = [0.20, 0.12, 0.08, 0.05, 0.035, 0.025, 0.02] }
gain = { current_a = [0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0], gain_pa_a = [0.70e6, 0.80e6, 0.88e6, 0.94e6, 1.00e6, 1.05e6, 1.10e6] }
delay = { current_a = [0.0, 0.2, 0.5, 1.0], delay_s = [0.030, 0.022, 0.012, 0.0] }
[clutch.A.error_bounds]
friction_factor = [0.8, 1.2]
valve_gain_factor = [0.9, 1.1]
valve_lag_factor = [0.5, 1.5]
valve_delay_s = [0.0, 0.03]
valve_hysteresis_pa = 10e3
current_a = 0.01

[clutch.B]
friction = { slip_rad_s = [0.0, 10.0, 50.0, 150.0, 450.0], coefficient = [0.120, 0.123, 0.130, 0.138, 0.145] }
static_friction = 0.13
drag_n_m = 0.0
[clutch.B.valve]
lag = { pressure_pa = [0.0, 0.05e6, 0.1e6, 0.2e6, 0.4e6, 0.7e6, 1.0e6], time_constant_s = [0.20, 0.12, 0.08, 0.05, 0.035, 0.025, 0.02] }
gain = { current_a = [0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0], gain_pa_a = [0.70e6, 0.80e6, 0.88e6, 0.94e6, 1.00e6, 1.05e6, 1.10e6] }
delay = { current_a = [0.0, 0.2, 0.5, 1.0], delay_s = [0.030, 0.022, 0.012, 0.0] }
[clutch.B.error_bounds]
friction_factor = [0.8, 1.2]
valve_gain_factor = [0.9, 1.1]
valve_lag_factor = [0.5, 1.5]
valve_delay_s = [0.0, 0.03]
valve_hysteresis_pa = 10e3
current_a = 0.01

[error_bounds]
converter_share = 0.15
engine_torque_share = 0.08
inertia_share = 0.0
shaft_stiffness_share = 0.2
wheel_scale_share = 0.02
mass_share = 0.15
"#;

fn by_hand() -> Car {
    let gearbox = Source::built_in("two_speed.toml", include_str!("../../../gearboxes/two_speed.toml"));
    CarFile::from_sources(Source::built_in("two.toml", BY_HAND), gearbox).unwrap().car
}

fn built_in() -> Vehicle {
    VehicleFile::built_in().unwrap().vehicle
}

fn near(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-6 * a.abs().max(b.abs()) + 1e-12, "{a} {b}");
}

#[test]
fn the_car_with_two_gears_is_that_of_a_gearbox_file() {
    let (own, other) = (built_in().with_two_gears(), by_hand());
    assert_eq!(own.gearbox.gears.len(), other.gearbox.gears.len());
    for (own, other) in own.gearbox.gears.iter().zip(&other.gearbox.gears) {
        assert_eq!(own.name, other.name);
        near(own.ratio, other.ratio);
        let torques = |gear: &geartrain::Gear| gear.holding.iter().map(|of| of.per_turbine_torque).collect::<Vec<_>>();
        torques(own).into_iter().zip(torques(other)).for_each(|(own, other)| near(own, other));
    }
    for (own, other) in own.clutches.iter().flatten().zip(other.clutches.iter().flatten()) {
        for pressure_pa in [0.05e6, 0.2e6, 0.6e6, 1.0e6] {
            near(own.valve.command_for(pressure_pa), other.valve.command_for(pressure_pa));
            near(own.clutch.torque_capacity(pressure_pa, 20.0), other.clutch.torque_capacity(pressure_pa, 20.0));
        }
    }
    assert_eq!((own.engine, own.converter, own.driveline), (other.engine, other.converter, other.driveline));
}

/// Compares the numbers of two texts, in their order.
fn all_near(own: &str, other: &str) {
    let is_part = |c: char| c.is_ascii_digit() || "+-.e".contains(c);
    let numbers =
        |text: &str| -> Vec<f64> { text.split(|c: char| !is_part(c)).filter_map(|word| word.parse().ok()).collect() };
    let (own, other) = (numbers(own), numbers(other));
    assert_eq!(own.len(), other.len());
    own.into_iter().zip(other).for_each(|(own, other)| near(own, other));
}

#[test]
fn its_filter_has_the_tables_of_a_gearbox_file() {
    let vehicle = built_in();
    let (car, other) = (vehicle.with_two_gears(), by_hand());
    let budget = ErrorBudget { command_age_s: 0.05, ..ErrorBudget::of_car(&other) };
    let tables = [
        ShiftTables::of_car(&car, &ErrorBudget::of_vehicle(&vehicle)).unwrap(),
        ShiftTables::of_car(&other, &budget).unwrap(),
    ];
    let [own, hand] = tables.each_ref().map(ShiftTables::tables);
    let text = |of: &observer::GearboxTables<'_, f64>| {
        let elements: Vec<_> = of.elements.iter().map(|element| (element.uncertainty, element.valve.delay_s)).collect();
        format!("{elements:?} {:?} {:?}", of.gears, of.shifts)
    };
    all_near(&text(&own), &text(&hand));
    // The parameters beside the tables, too.
    let own = gearbox_filter(&car, &tables[0], &ErrorBudget::of_vehicle(&vehicle), None);
    let hand = gearbox_filter(&other, &tables[1], &budget, None);
    let text = |of: &GearboxFilter<'_, f64>| format!("{:?} {:?} {:?}", of.uncertainty, of.readings, of.turbine);
    all_near(&text(&own), &text(&hand));
    near(own.limits.pressure_max_pa, hand.limits.pressure_max_pa);
}

#[test]
fn its_filter_has_the_pistons_and_limits_of_the_file_and_no_ranges_of_its_own() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_stroke.toml");
    let vehicle = VehicleFile::read(path.as_ref()).unwrap().vehicle;
    let filter = one_shift_filter(&vehicle, None);
    for place in [OFFGOING, ONCOMING] {
        let element = &filter.tables().elements[place];
        assert!(element.piston.is_some() && element.budget.is_none());
        assert_eq!(element.limits.command_max, vehicle.settings.command_max);
        assert_eq!(element.limits.pressure_max_pa, vehicle.error_bounds.pressure_max_pa);
    }
}
