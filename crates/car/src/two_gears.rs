//! A vehicle of one shift as a car with a gearbox of two gears: what the gearbox filter takes.
//!
//! | vehicle | gearbox |
//! |---|---|
//! | offgoing clutch | element `ca`, holds gear `1` |
//! | oncoming clutch | element `cb`, holds gear `2` |
//! | reduced shift | shift `1-2`; with the roles of both clutches changed, shift `2-1` |
//!
//! The vehicle file states the bounds of the oncoming clutch and its valve; they count for the offgoing clutch too.

use drivetrain::ReducedShift;
use geartrain::{Change, ElementKind, Gear, Gearbox, GearboxElement, Holding, Shift};

use crate::error_budget::half_width;
use crate::one_shift::TURBINE_RAD_S2;
use crate::{Car, CarErrorBounds, ElementErrorBounds, ErrorBounds, ErrorBudget, ShiftClutch, Vehicle};

/// Place of the offgoing clutch among the elements, and of the gear before the shift among the gears.
pub const OFFGOING: usize = 0;
/// The same of the oncoming clutch and of the gear after the shift.
pub const ONCOMING: usize = 1;

const ELEMENTS: [&str; 2] = ["ca", "cb"];
const GEARS: [&str; 2] = ["1", "2"];

impl Vehicle {
    /// The same vehicle as a car with a gearbox of two gears and two elements, with its error bounds.
    pub fn with_two_gears(&self) -> Car {
        let bounds = &self.error_bounds;
        Car {
            name: self.name.clone(),
            gearbox: gearbox(&self.shift, [&self.offgoing, &self.oncoming]),
            clutches: vec![Some(self.offgoing), Some(self.oncoming)],
            line_pressure_pa: bounds.pressure_max_pa / bounds.valve_gain_factor[1],
            engine: self.engine,
            converter: Some(self.converter),
            lock_up: None,
            driveline: self.driveline,
            backlash_rad: self.backlash_rad,
            tyre: self.tyre,
            road: self.road,
            oil_temperature_degc: self.oil_temperature_degc,
            error_bounds: car_bounds(self),
        }
    }
}

impl ErrorBudget {
    /// The bounds of a vehicle of one shift, for [`Vehicle::with_two_gears`]. Its file states the largest command and the highest pressure.
    pub fn of_vehicle(vehicle: &Vehicle) -> Self {
        let bounds = &vehicle.error_bounds;
        let mut budget = Self::of_car(&vehicle.with_two_gears());
        budget.command_age_s = bounds.command_age_s;
        for element in budget.elements.iter_mut().flatten() {
            element.command_max = vehicle.settings.command_max;
            element.pressure_max_pa = bounds.pressure_max_pa;
        }
        budget
    }
}

fn gearbox(reduced: &ReducedShift<f64>, clutches: [&ShiftClutch; 2]) -> Gearbox {
    let slips = [reduced.slip_offgoing, reduced.slip_oncoming];
    let gears = [OFFGOING, ONCOMING].map(|at| Gear {
        name: GEARS[at].to_owned(),
        ratio: -slips[at][1] / slips[at][0],
        holding: vec![Holding { element: at, per_turbine_torque: slips[at][0].recip() }],
        holding_is_unique: true,
        shaft_speeds: Vec::new(),
        turbine_max_n_m: None,
    });
    let elements = [OFFGOING, ONCOMING].map(|at| GearboxElement {
        name: ELEMENTS[at].to_owned(),
        kind: ElementKind::Clutch,
        pack: Some(clutches[at].clutch),
    });
    let shift = |from: usize, to: usize| Shift {
        from,
        to,
        change: Change::Single { offgoing: from, oncoming: to, held: Vec::new() },
        reduced: Some(ReducedShift { slip_offgoing: slips[from], slip_oncoming: slips[to], ..*reduced }),
    };
    Gearbox {
        name: "two gears".to_owned(),
        elements: elements.into(),
        gears: gears.into(),
        shifts: vec![shift(OFFGOING, ONCOMING), shift(ONCOMING, OFFGOING)],
        capacities: Vec::new(),
        train: None,
        warnings: Vec::new(),
    }
}

fn car_bounds(vehicle: &Vehicle) -> CarErrorBounds {
    let bounds = &vehicle.error_bounds;
    CarErrorBounds {
        converter_share: Some(bounds.turbine_torque_share),
        engine_torque_share: Some(bounds.engine_torque_share),
        inertia_share: Some(inertia_share(&vehicle.shift, bounds)),
        shaft_stiffness_share: Some(half_width(bounds.shaft_stiffness_factor)),
        wheel_scale_share: Some(bounds.wheel_scale),
        mass_share: Some(bounds.mass_kg / vehicle.road.mass_kg),
        valve_error_scale: None,
        elements: vec![element_bounds(bounds); 2],
    }
}

/// The error of the turbine-side inertia that is worth the stated torque in the inertia phase, as a fraction.
fn inertia_share(shift: &ReducedShift<f64>, bounds: &ErrorBounds) -> f64 {
    let step = 1.0 - shift.ratio_oncoming() / shift.ratio_offgoing();
    bounds.inertia_torque_n_m / (shift.mass_kg_m2[0][0] * TURBINE_RAD_S2 * step)
}

fn element_bounds(bounds: &ErrorBounds) -> ElementErrorBounds {
    ElementErrorBounds {
        friction_factor: Some(bounds.friction_factor),
        valve_gain_factor: Some(bounds.valve_gain_factor),
        valve_lag_factor: Some(bounds.valve_lag_factor),
        valve_delay_s: Some(bounds.valve_delay_s),
        valve_hysteresis_pa: Some(bounds.valve_hysteresis_pa),
        command: Some(bounds.command),
    }
}
