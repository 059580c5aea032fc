//! The filter for every shift of a gearbox: its tables from the gear train, and what it does not know from budgets.

use alloc::vec::Vec;

use crate::gearbox::{
    AccelerationReading, ElementUncertainty, FrictionElement, GearRow, GearboxFilter, GearboxTables, MAX_ELEMENTS,
    Piston, ShiftElement, ShiftRow, ShiftUncertainty, TurbineTorque, ValveLimits,
};
use crate::{Budget, FillBudget, InputLimits, ValveModel};
use car::{AccelerationSensor, Car, ElementErrors, ErrorBudget, Sensors};
use drivetrain::{Cylinder, Real};
use geartrain::{Change, Gear, Gearbox, Shift};

use crate::of_sensors::{SCALE_MIN, engine_noise, speed_reading, std_dev_of};

/// Quantum of the speeds of engine, turbine and output where no sensor is described, rad/s: that of the built-in car's budget.
const SPEED_QUANTUM_RAD_S: f64 = 0.7;
/// The same of the wheel speed.
const WHEEL_QUANTUM_RAD_S: f64 = 0.14;
/// Errors of the valve's map beside its gain, as a fraction \[chosen\]: with the bounds of 15 % of friction and 10 % of gain it gives a
/// standard deviation of 12 %.
const MAP_FRACTION: f64 = 0.06;

/// Lowest part of the squared torque error that lasts \[chosen\]: where friction and gain are stated as known, so that the states keep a variance.
const MIN_SLOW_PART: f64 = 0.1;

/// Standard deviations of the part of the pressure's error at rest that does not last, as of hysteresis, and of the kiss
/// point beside the valve's gain, Pa \[chosen\]: 10 kPa together.
const PRESSURE_PA: f64 = 7e3;
const KISS_POINT_PA: f64 = 7e3;
/// Standard deviation of the part of the turbine torque's error that does not last, as a fraction \[chosen\]: the shape of the
/// converter's maps.
const TURBINE_FRACTION: f64 = 0.03;

/// Time after which the scale of the wheel speed is another, by as much as it can be known at best, s \[chosen\]: a tyre that gets warm.
const WHEEL_SCALE_S: f64 = 60.0;

/// Pressure drop of a fast fill, Pa \[chosen\], for the flow of whose errors those of the time of a fill follow.
const FILL_PA: f64 = 0.15e6;

/// The tables of a gearbox, owned.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftTables<T> {
    elements: Vec<FrictionElement<T>>,
    gears: Vec<GearRow<T>>,
    shifts: Vec<ShiftRow<T>>,
    /// Place of each of the gearbox's elements in the tables.
    places: Vec<Option<usize>>,
}

impl ShiftTables<f64> {
    /// The tables of a gearbox whose elements are made by `friction_element` from their plates, `None` for an element without a valve. An
    /// element without plates or valve is left out, and the shifts between others remain; so do those between one of them and a one-way clutch or a dog. What sits on the input
    /// shaft without being part of the gearbox, as an engine without converter, is added to the mass.
    ///
    /// # Errors
    /// More clutches and brakes than the filter has room for; holds their number.
    fn new(
        gearbox: &Gearbox,
        friction_element: impl Fn(usize) -> Option<FrictionElement<f64>>,
        more_on_input_kg_m2: f64,
    ) -> Result<Self, usize> {
        let (mut elements, mut places) = (Vec::new(), Vec::new());
        for (at, element) in gearbox.elements.iter().enumerate() {
            let friction = element.pack.and_then(|_| friction_element(at)).map(|element| {
                elements.push(element);
                elements.len() - 1
            });
            places.push(friction);
        }
        if elements.len() > MAX_ELEMENTS {
            return Err(elements.len());
        }
        let shift_rows = gearbox.shifts.iter().filter_map(|shift| {
            let of = |element: usize| match places[element] {
                None if gearbox.is_one_way(element) => Some(ShiftElement::OneWay),
                None => gearbox.is_dog(element).then_some(ShiftElement::Dog),
                Some(place) if shift.is_one_sided(gearbox, element) => Some(ShiftElement::one_sided(place)),
                Some(place) => Some(ShiftElement::at(place)),
            };
            let clutches = match &shift.change {
                Change::Single { offgoing, oncoming, .. } => [of(*offgoing)?, of(*oncoming)?],
                // Of ratios alone.
                Change::Unknown => [ShiftElement::Unknown; 2],
                _ => return None,
            };
            let mut reduced = shift.reduced?;
            reduced.mass_kg_m2[0][0] += more_on_input_kg_m2;
            // Between gears of one ratio the speeds show nothing.
            let has_valve = clutches.iter().any(|clutch| clutch.has_pressure());
            if gearbox.is_same_ratio(shift.from, shift.to) || !has_valve || !shift.changes_dog_under_power(gearbox) {
                return None;
            }
            let has_dog = has_dog(gearbox, shift);
            let mut row = ShiftRow { has_dog, ..ShiftRow::new([shift.from, shift.to], clutches, &reduced) };
            for (place, slip) in places.iter().zip(gearbox.slips_in_shift(shift).unwrap_or_default()) {
                if let Some(place) = *place {
                    row.slips[place] = slip;
                }
            }
            Some(row)
        });
        let shifts: Vec<_> = shift_rows.collect();
        // In a gear the inertia is the same in every shift from it or to it.
        let inertia = |gear: usize, ratio: f64| {
            let shift = shifts.iter().find(|shift| shift.from == gear || shift.to == gear);
            shift.map_or(f64::INFINITY, |shift| shift.inertia_at(ratio))
        };
        let gears = gearbox.gears.iter().enumerate();
        let gears = gears.map(|(at, gear)| GearRow {
            ratio: gear.ratio,
            inertia_kg_m2: inertia(at, gear.ratio),
            holding: holding(gear, &places),
        });
        Ok(Self { gears: gears.collect(), elements, shifts, places })
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> ShiftTables<U> {
        ShiftTables {
            elements: self.elements.iter().map(FrictionElement::cast).collect(),
            gears: self.gears.iter().map(GearRow::cast).collect(),
            shifts: self.shifts.iter().map(ShiftRow::cast).collect(),
            places: self.places.clone(),
        }
    }
}

impl<T: Real> ShiftTables<T> {
    /// As the filter takes them.
    pub fn tables(&self) -> GearboxTables<'_, T> {
        GearboxTables { elements: &self.elements, gears: &self.gears, shifts: &self.shifts }
    }

    /// Multiplies the turbine-side inertia `M11` of all shifts.
    pub fn scale_inertia(&mut self, factor: T) {
        for row in &mut self.shifts {
            row.mass_kg_m2[0][0] = factor * row.mass_kg_m2[0][0];
        }
    }

    /// What the filter does not know of each element.
    pub fn uncertainties_mut(&mut self) -> impl Iterator<Item = &mut ElementUncertainty<T>> {
        self.elements.iter_mut().map(|element| &mut element.uncertainty)
    }

    /// The element of the gearbox at a place of the tables.
    pub fn element_at(&self, place: usize) -> Option<usize> {
        self.places.iter().position(|at| *at == Some(place))
    }

    /// Place of an element of the gearbox in the tables; `None` if it is not in them.
    pub fn place(&self, element: usize) -> Option<usize> {
        self.places.get(element).copied().flatten()
    }
}

/// Output speed below which the readings of toothed wheels are too old, rad/s \[chosen\].
const OUTPUT_MIN_RAD_S: f64 = 15.0;
/// Largest speed, rad/s: a larger reading is none of a gearbox \[chosen\].
const SPEED_MAX_RAD_S: f64 = 1500.0;

impl ShiftTables<f64> {
    /// The tables of a car with these bounds of its errors.
    ///
    /// # Errors
    /// More clutches and brakes than the filter has room for; holds their number.
    pub fn of_car(car: &Car, budget: &ErrorBudget) -> Result<Self, usize> {
        let on_input_kg_m2 = if car.converter.is_some() { 0.0 } else { car.engine.inertia_kg_m2 };
        Self::new(
            &car.gearbox,
            |element| {
                let (clutch, errors) = (car.clutches.get(element)?.as_ref()?, budget.element(element)?);
                let [shortest_s, longest_s] = errors.valve_delay_s;
                // The friction over slip is the car's; the gearbox file has one coefficient. So are the strokes.
                let fill = clutch.standard_fill_budget(car.oil_temperature_degc);
                let range = Budget {
                    valve: clutch.valve,
                    lag_factor: errors.valve_lag_factor,
                    gain_factor: errors.valve_gain_factor,
                    delay_s: errors.valve_delay_s,
                    hysteresis_pa: errors.valve_hysteresis_pa,
                    command: errors.command,
                    command_age_s: budget.command_age_s,
                    line_pressure_pa: [errors.pressure_max_pa; 2],
                    pressure_max_pa: errors.pressure_max_pa,
                    fill,
                    friction_factor: errors.friction_factor,
                    drag_n_m: clutch.drag_n_m,
                    slip_rad_s: 0.0,
                };
                Some(FrictionElement {
                    clutch: clutch.clutch,
                    valve: ValveModel { valve: clutch.valve, delay_s: 0.5 * (shortest_s + longest_s) },
                    limits: valve_limits(errors),
                    piston: fill.map(|fill| piston(&clutch.cylinder, &fill)),
                    budget: Some(range),
                    uncertainty: ElementUncertainty {
                        drag_n_m: clutch.drag_n_m,
                        ..element_uncertainty(errors, budget.valve_error_scale)
                    },
                })
            },
            on_input_kg_m2,
        )
    }
}

/// The torques of the elements in a gear per turbine torque, in the order of the tables.
fn holding(gear: &Gear, places: &[Option<usize>]) -> [f64; MAX_ELEMENTS] {
    let mut holding = [0.0; MAX_ELEMENTS];
    for of in &gear.holding {
        if let Some(at) = places[of.element] {
            holding[at] = of.per_turbine_torque;
        }
    }
    holding
}

/// Whether a dog that is held in a shift is not in the gear before.
fn has_dog(gearbox: &Gearbox, shift: &Shift) -> bool {
    let Change::Single { held, .. } = &shift.change else { return false };
    let is_in = |element: usize| gearbox.gears[shift.from].holding.iter().any(|of| of.element == element);
    held.iter().any(|&element| gearbox.is_dog(element) && !is_in(element))
}

/// A piston whose stroke is within these limits, each the edge of a uniform distribution.
fn piston(cylinder: &Cylinder<f64>, fill: &FillBudget<f64>) -> Piston<f64> {
    let fraction = |[minimum, maximum]: [f64; 2], value: f64| std_dev_of(0.5 * (maximum - minimum)) / value;
    let flow = |k: usize| fill.supply[k].flow(FILL_PA, fill.viscosity_m2_s[k]).min(cylinder.flow_max_m3_s);
    let volume = fraction(fill.volume_m3, cylinder.stroke_m3);
    Piston::new(*cylinder, Real::hypot(volume, fraction([flow(1), flow(0)], cylinder.flow(FILL_PA))))
}

/// What the valve of an element can be commanded and can give.
fn valve_limits(errors: &ElementErrors) -> ValveLimits<f64> {
    ValveLimits {
        command_max: errors.command_max,
        command_error: errors.command,
        pressure_max_pa: errors.pressure_max_pa,
    }
}

/// The filter of a car with these tables, for readings of these sensors; without them the readings are taken to be of the
/// moment, with the noise of usual sensors.
///
/// A bound of the errors counts as the edge of a uniform distribution, those of friction and valves times the scale that the file has of its own.
pub fn gearbox_filter<'a>(
    car: &Car,
    tables: &'a ShiftTables<f64>,
    budget: &ErrorBudget,
    sensors: Option<&Sensors>,
) -> GearboxFilter<'a, f64> {
    GearboxFilter {
        tables: tables.tables(),
        driveline: car.driveline,
        wheels_kg_m2: car.road.inertia_at_wheel() + car.driveline.wheel_inertia_kg_m2,
        turbine: TurbineTorque {
            converter: car.converter,
            engine_inertia_kg_m2: car.engine.inertia_kg_m2,
            converter_share: std_dev_of(budget.converter),
            engine_share: std_dev_of(budget.engine),
        },
        uncertainty: uncertainty(budget),
        readings: [
            speed_reading(sensors.map(|sensors| &sensors.turbine), SPEED_QUANTUM_RAD_S),
            speed_reading(sensors.map(|sensors| &sensors.output), SPEED_QUANTUM_RAD_S),
            speed_reading(sensors.map(|sensors| &sensors.wheel), WHEEL_QUANTUM_RAD_S),
        ],
        engine: (
            speed_reading(sensors.map(|sensors| &sensors.engine), SPEED_QUANTUM_RAD_S),
            engine_noise(sensors.map(|sensors| &sensors.engine), SPEED_QUANTUM_RAD_S),
        ),
        acceleration: acceleration_reading(car, sensors.and_then(|sensors| sensors.acceleration.as_ref())),
        limits: InputLimits {
            speed_max_rad_s: SPEED_MAX_RAD_S,
            // Of any element; each has its own.
            command_max: budget.widest(|element| element.command_max),
            command_error: budget.widest(|element| element.command),
            pressure_max_pa: budget.widest(|element| element.pressure_max_pa),
            shaft_torque_max_n_m: 3.0 * shaft_n_m(car),
        },
    }
}

/// Standard deviations of an accelerometer of which nothing is known: of a reading, m/s^2, and of its delay, s; and of a delay that is stated
/// \[chosen\].
const ACCELERATION_NOISE_M_S2: f64 = 0.1;
const ACCELERATION_DELAY_S: f64 = 0.02;
const ACCELERATION_STATED_DELAY_S: f64 = 0.01;
/// What the model of the car leaves out, m/s^2 \[chosen\].
const ACCELERATION_MODEL_M_S2: f64 = 0.05;
/// Of its bias, m/s^2, and of its scale, as a fraction: with the mass of the car, of which passengers and load are a tenth \[chosen\].
const ACCELERATION_BIAS_M_S2: f64 = 0.5;
const ACCELERATION_SCALE: f64 = 0.1;

/// How the longitudinal acceleration is read.
fn acceleration_reading(car: &Car, sensor: Option<&AccelerationSensor>) -> AccelerationReading<f64> {
    let radius_m = car.road.wheel_radius_m;
    let [of_mass, of_wheels] = [car.road.inertia_at_wheel(), car.driveline.wheel_inertia_kg_m2];
    let inertia = of_mass + of_wheels;
    let noise = |sensor: &AccelerationSensor| {
        let reading = Real::hypot(sensor.noise_m_s2, sensor.resolution_m_s2 / 12.0_f64.sqrt());
        Real::hypot(reading, ACCELERATION_MODEL_M_S2)
    };
    AccelerationReading {
        std_dev_m_s2: sensor.map_or(ACCELERATION_NOISE_M_S2, noise),
        bias_m_s2: ACCELERATION_BIAS_M_S2,
        scale_fraction: ACCELERATION_SCALE,
        delay_s: sensor.map_or(0.0, |sensor| sensor.delay_s),
        delay_std_dev_s: sensor.map_or(ACCELERATION_DELAY_S, |_| ACCELERATION_STATED_DELAY_S),
        is_stated: sensor.is_some(),
        per_torque: [radius_m / inertia, of_wheels * radius_m / (inertia * of_mass)],
    }
}

/// Torque of the drive shafts with the largest turbine torque in the lowest gear, N m.
fn shaft_n_m(car: &Car) -> f64 {
    let speeds = (1..=12).map(|k| 50.0 * f64::from(k));
    let engine = speeds.map(|speed| car.engine.torque(speed, 1.0)).fold(0.0, f64::max);
    let converter = car.converter.map_or(1.0, |converter| converter.torque_ratio.range().1);
    let ratio = car.gearbox.gears.iter().map(|gear| gear.ratio.abs()).fold(0.0, f64::max);
    engine * converter * ratio * car.driveline.final_ratio
}

/// What the filter does not know of an element, whose friction and valve err by this scale times the bounds.
pub fn element_uncertainty(errors: &ElementErrors, scale: f64) -> ElementUncertainty<f64> {
    let parts = [std_dev_of(errors.friction()), std_dev_of(errors.valve_gain()), MAP_FRACTION];
    let square: f64 = parts.iter().map(|part| part * part).sum();
    ElementUncertainty {
        torque_fraction: scale * square.sqrt(),
        slow_part: (1.0 - parts[2] * parts[2] / square).max(MIN_SLOW_PART),
        valve_gain: scale * parts[1],
        kiss_point_pa: scale * KISS_POINT_PA,
        valve_lag_fraction: scale * std_dev_of(errors.valve_lag()),
        valve_delay_s: scale * std_dev_of(errors.valve_delay()),
        pressure_pa: scale * PRESSURE_PA,
        drag_n_m: 0.0,
        widths: errors.widths(),
    }
}

/// Largest skew of turbine and output speed, s \[chosen\]: of two cycles of a bus. It is taken off as an age, to first order; what is longer as a delay.
const SKEW_MAX_S: f64 = 0.02;

/// What the filter does not know beside the elements.
fn uncertainty(errors: &ErrorBudget) -> ShiftUncertainty<f64> {
    ShiftUncertainty {
        torque_fraction_s: 3.0,
        pressure_s: 0.15,
        turbine_share: TURBINE_FRACTION,
        turbine_share_s: 3.0,
        // What is low by a fraction is exceeded by more than that fraction.
        inertia_share: std_dev_of(errors.inertia / (1.0 - errors.inertia)),
        stiffness_fraction: std_dev_of(errors.stiffness),
        wheel_scale: std_dev_of(errors.wheel_scale).max(SCALE_MIN),
        wheel_scale_walk: SCALE_MIN / WHEEL_SCALE_S.sqrt(),
        rate_rad_s: 0.1,
        rate_walk: 0.01,
        channel_skew_s: SKEW_MAX_S,
        load_walk: 1500.0,
        output_least_rad_s: OUTPUT_MIN_RAD_S,
    }
}
