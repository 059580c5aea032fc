//! The gearbox filter of a vehicle of one shift: its tables are those of the car with two gears that it is.

use car::two_gears::{OFFGOING, ONCOMING};
use car::{ErrorBudget, Sensors, Vehicle};

use crate::gearbox::{FrictionElement, OneShiftTables, UnheardTorque};
use crate::of_sensors::{engine_noise, speed_reading, std_dev_of};
use crate::{GearboxFilter, InputLimits, OneShiftFilter, ShiftTables, Supervisor, gearbox_filter};

/// The gearbox filter of this vehicle, for signals from these sensors; without them the readings are taken to be of the moment, with the
/// noise of the error budget.
///
/// Guaranteed ranges are those of [`crate::RangeEstimator`], the same for every observer.
pub fn one_shift_filter(vehicle: &Vehicle, sensors: Option<&Sensors>) -> OneShiftFilter<f64> {
    let (car, budget) = (vehicle.with_two_gears(), ErrorBudget::of_vehicle(vehicle));
    let tables = ShiftTables::of_car(&car, &budget).expect("a vehicle of one shift has two elements");
    let filter = gearbox_filter(&car, &tables, &budget, sensors);
    let rows = tables.tables();
    let element = |at: usize| FrictionElement { budget: None, ..rows.elements[at] };
    let own = OneShiftTables {
        elements: [OFFGOING, ONCOMING].map(element),
        gears: [OFFGOING, ONCOMING].map(|at| rows.gears[at]),
        shifts: [OFFGOING, ONCOMING].map(|at| rows.shifts[at]),
    };
    let filter = with_bounds_of(vehicle, filter, sensors);
    let unheard = unheard_torque(vehicle, filter.uncertainty.pressure_s);
    OneShiftFilter::new(own, &filter, vehicle.shift, phase_supervisor(vehicle), unheard)
}

/// The torque of the offgoing clutch without its command: an error that lasts for this time, s, and changes as the vehicle file states.
fn unheard_torque(vehicle: &Vehicle, lasts_s: f64) -> UnheardTorque<f64> {
    let given = &vehicle.settings.filter;
    UnheardTorque {
        holds_n_m: given.offgoing_n_m * (0.5 * lasts_s).sqrt(),
        open_n_m: std_dev_of(vehicle.error_bounds.offgoing_torque_n_m),
        release_s: given.offgoing_release_s,
    }
}

/// The filter with what the vehicle file states of readings.
fn with_bounds_of<'a>(
    vehicle: &Vehicle,
    filter: GearboxFilter<'a, f64>,
    sensors: Option<&Sensors>,
) -> GearboxFilter<'a, f64> {
    let (bounds, settings) = (&vehicle.error_bounds, &vehicle.settings);
    let mut uncertainty = filter.uncertainty;
    uncertainty.output_least_rad_s = settings.filter.output_least_rad_s;
    uncertainty.channel_skew_s = bounds.channel_skew_s;
    let engine = sensors.map(|sensors| &sensors.engine);
    GearboxFilter {
        uncertainty,
        readings: [
            speed_reading(sensors.map(|sensors| &sensors.turbine), bounds.turbine_quantum_rad_s),
            speed_reading(sensors.map(|sensors| &sensors.output), bounds.output_quantum_rad_s),
            speed_reading(sensors.map(|sensors| &sensors.wheel), bounds.wheel_quantum_rad_s),
        ],
        engine: (
            speed_reading(engine, bounds.turbine_quantum_rad_s),
            engine_noise(engine, bounds.turbine_quantum_rad_s),
        ),
        limits: InputLimits {
            speed_max_rad_s: settings.speed_max_rad_s,
            shaft_torque_max_n_m: vehicle.shaft_torque_max_n_m(),
            ..filter.limits
        },
        ..filter
    }
}

/// The phase supervisor of this vehicle.
pub fn phase_supervisor(vehicle: &Vehicle) -> Supervisor<f64> {
    let slips = &vehicle.settings.phase_slips;
    Supervisor {
        kiss_pressure_pa: vehicle.oncoming.clutch.kiss_pressure(),
        release_slip_rad_s: slips.release_slip_rad_s,
        lock_slip_rad_s: slips.lock_slip_rad_s,
        lock_hold_s: slips.lock_hold_s,
    }
}
