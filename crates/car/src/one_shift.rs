//! The vehicle of one shift of a car with a gearbox: what designs of gains are made for.

use drivetrain::{
    AccelerationRow, ClutchValve, CommandKind, Converter, Driveline, Engagement, Real, ReducedShift, RoadLoad, Valve,
};
use geartrain::{Change, Shift};

use crate::error_budget::{BACKLASH_RAD, CHANNEL_SKEW_S, COMMAND_AGE_S, WHEEL_DELAY_S, around, command_limits};
use crate::{
    Car, CompliantRequirement, DesignRequirement, ElementErrors, ErrorBounds, ErrorBudget, FilterSettings,
    ObserverSettings, PhaseSlips, Requirements, ShiftClutch, Uncertainty, ValveUncertainty, Vehicle,
};

/// The car whose values are scaled, that of `vehicles/two_speed_at.toml`: maximum engine torque, N m.
pub const ENGINE_TORQUE_N_M: f64 = 190.0;
/// Its ratio of the gearbox before the shift, and of the differential.
pub const RATIO_BEFORE: f64 = 2.5;
/// The same of the differential.
pub const FINAL_RATIO: f64 = 3.0;
/// Largest torque of its drive shafts in a shift, N m.
pub const SHAFT_TORQUE_N_M: f64 = 800.0;
/// Torque at its gearbox output that a rigid model leaves out, N m.
pub const OUTPUT_ERROR_N_M: f64 = 175.0;
/// How fast the torque of its offgoing clutch changes, N m per root second: 0.7 of the 285 N m that it holds at the maximum engine
/// torque. From half of them it falls to zero in a torque phase of 0.25 s.
pub const OFFGOING_N_M: f64 = 200.0;
/// What is left of that torque when the clutch is open, N m.
pub const OFFGOING_OPEN_N_M: f64 = 10.0;
/// Relative error of the mass of a car as it is driven.
pub const MASS_ERROR: f64 = 0.15;
/// Its offgoing and oncoming clutch: torque over that of the turbine, mean radius of the plates, m, and piston area, m^2.
pub const TORQUE_FRACTIONS: [f64; 2] = [1.5, 0.6];
/// The same of the mean radius of the plates, m.
pub const PLATE_RADII_M: [f64; 2] = [0.14, 0.13];
/// The same of the piston areas, m^2.
pub const PISTON_AREAS_M2: [f64; 2] = [0.012, 0.01];
/// What its error budget does to the outputs in torque and inertia phase ([`Vehicle::acceleration_errors`]), rad/s^2.
pub const ACCELERATION_ERRORS_RAD_S2: [f64; 2] = [63.326091034413786, 834.0051599116736];

/// Turbine torque of the shift at which the errors are weighed, over the maximum torque of the engine: 133 of 190 N m in the car that is
/// scaled.
const SHIFT_TORQUE: f64 = 0.7;
/// Friction coefficient and number of faces with which its oncoming clutch has the pressures of its error budget.
const FRICTION: f64 = 0.13;
const FACES: f64 = 3.0;
/// Turbine acceleration of an inertia phase at which an error of the inertia is weighed, rad/s^2, per fraction by which the ratio falls
/// \[chosen\]: a turbine of 400 rad/s that reaches its new speed in 0.4 s.
pub(crate) const TURBINE_RAD_S2: f64 = 1000.0;

/// Why a car has no vehicle of one shift.
#[derive(Debug, thiserror::Error)]
pub enum OneShiftError {
    /// The name is not that of two gears.
    #[error(
        "the gearbox has no shift \"{asked}\"\nhint: two gears with a hyphen between them, as \"1-2\"; its gears are {gears}"
    )]
    NoShift {
        /// What was asked for.
        asked: String,
        /// The gears that there are.
        gears: String,
    },
    /// The ratio does not fall, or there is a reverse gear in it.
    #[error(
        "{shift} is no upshift between forward gears, and the designs are for upshifts with a driving engine\n\
         hint: the gearbox filter estimates the other kinds (`wetclutch estimate`); the upshifts of one clutch against another \
         are {upshifts}"
    )]
    NoUpshift {
        /// The shift.
        shift: String,
        /// Those that there are.
        upshifts: String,
    },
    /// More than one element opens or closes.
    #[error(
        "in {shift} more than one element opens or closes ({change}), and the designs are for one clutch against another\n\
         hint: the upshifts of one clutch against another are {upshifts}"
    )]
    Several {
        /// The shift.
        shift: String,
        /// What the trade calls it.
        change: String,
        /// Those that there are.
        upshifts: String,
    },
    /// The inertias are not known, or an element carries no torque in its gear.
    #[error(
        "the inertias of {shift} are not known\n\
         hint: a gearbox of level \"shares\" needs `shift_mass` for the two gears, and both elements a torque in their gears"
    )]
    NoMass {
        /// The shift.
        shift: String,
    },
    /// An element has no plates.
    #[error(
        "{element}, which opens or closes in {shift}, has no friction plates\nhint: the designs are for two wet clutches or brakes"
    )]
    NoPlates {
        /// The shift.
        shift: String,
        /// The element.
        element: String,
    },
    /// The car has no converter.
    #[error(
        "the car has no converter, and the observers with designed gains take the turbine torque from the maps of one\n\
         hint: the gearbox filter takes the torque that the engine's controller reports (`wetclutch estimate`), and `wetclutch \
         sensitivity` lists what the speeds show of each clutch torque"
    )]
    NoConverter,
}

/// What differs between a shift with a valve that is commanded by a current and one with a duty cycle.
struct ByCommand {
    command_max: f64,
    valve: ValveUncertainty,
    /// Settling times of torque and inertia phase, s, then the same of the compliant observer.
    settling_s: [f64; 4],
}

const BY_CURRENT: ByCommand =
    ByCommand { command_max: 1.2, valve: ValveUncertainty::None, settling_s: [0.15, 0.10, 0.10, 0.10] };
const BY_DUTY_CYCLE: ByCommand = ByCommand {
    command_max: 100.0,
    valve: ValveUncertainty::PressureDrop((0.0, 40e3)),
    settling_s: [0.25, 0.18, 0.17, 0.13],
};

/// A shift with all that its vehicle needs.
struct OneShift<'c> {
    car: &'c Car,
    name: String,
    reduced: ReducedShift<f64>,
    converter: Converter<f64>,
    offgoing: ShiftClutch,
    oncoming: ShiftClutch,
    /// What is not known of the oncoming clutch and of the car.
    element: ElementErrors,
    budget: ErrorBudget,
}

impl Car {
    /// The gears of a shift that is written as `1-2`.
    ///
    /// # Errors
    /// There are no such gears.
    pub fn shift_named(&self, name: &str) -> Result<[usize; 2], OneShiftError> {
        // The name of a gear may have a line in it.
        let at = |(line, _): (usize, &str)| {
            let (from, to) = (self.gearbox.gear(name[..line].trim())?, self.gearbox.gear(name[line + 1..].trim())?);
            (from != to).then_some([from, to])
        };
        name.match_indices('-').find_map(at).ok_or_else(|| self.no_shift(name))
    }

    fn no_shift(&self, asked: &str) -> OneShiftError {
        let gears = self.gearbox.gears.iter().map(|gear| gear.name.as_str()).collect::<Vec<_>>().join(", ");
        OneShiftError::NoShift { asked: asked.to_owned(), gears }
    }

    /// The upshifts from each forward gear to the next in which one element opens and one closes.
    pub fn single_upshifts(&self) -> Vec<[usize; 2]> {
        let is_single = |gears: &[usize; 2]| {
            self.gearbox.shift(gears[0], gears[1]).is_some_and(|shift| shift.change.single().is_some())
        };
        self.gearbox.forward_gears().windows(2).map(|pair| [pair[0], pair[1]]).filter(is_single).collect()
    }

    /// The vehicle of one shift of this car, for the designs of gains and their certificates.
    ///
    /// Engine, converter, clutches, driveline, tyre and road are the car's, the gear train is its reduction to the shift. The
    /// observers' valve is that of the oncoming element, linear around the pressure of a shift; of a normally-high valve the command is
    /// `zero_pressure_a` less the current. The bounds of the errors are those of the car ([`ErrorBudget::of_car`]). All else is
    /// that of `vehicles/two_speed_at.toml`, scaled to the car and to the torques that the two elements carry.
    ///
    /// # Errors
    /// It is no shift between two wet clutches with a falling ratio, or the car has no converter; see [`OneShiftError`].
    pub fn of_shift(&self, gears: [usize; 2]) -> Result<Vehicle, OneShiftError> {
        let name = self.shift_name(gears.into());
        let shift = self.gearbox.shift(gears[0], gears[1]).ok_or_else(|| self.no_shift(&name))?;
        Ok(OneShift::of(self, shift, name)?.vehicle())
    }
}

impl<'c> OneShift<'c> {
    fn of(car: &'c Car, shift: &Shift, name: String) -> Result<Self, OneShiftError> {
        let upshifts = || {
            car.single_upshifts().into_iter().map(|gears| car.shift_name(gears.into())).collect::<Vec<_>>().join(", ")
        };
        let [before, after] = [shift.from, shift.to].map(|gear| car.gearbox.gears[gear].ratio);
        if !(before > after && after > 0.0) {
            return Err(OneShiftError::NoUpshift { shift: name, upshifts: upshifts() });
        }
        let Change::Single { offgoing, oncoming, .. } = shift.change else {
            let change = shift.change.name();
            return Err(OneShiftError::Several { shift: name, change, upshifts: upshifts() });
        };
        let no_plates = |element: usize| OneShiftError::NoPlates {
            shift: name.clone(),
            element: car.gearbox.elements[element].name.clone(),
        };
        let clutch = |element: usize| car.clutches.get(element).copied().flatten().ok_or_else(|| no_plates(element));
        let (offgoing_clutch, oncoming_clutch) = (clutch(offgoing)?, clutch(oncoming)?);
        let budget = ErrorBudget::of_car(car);
        let element = budget.element(oncoming).copied().ok_or_else(|| no_plates(oncoming))?;
        let Some(reduced) = shift.reduced else { return Err(OneShiftError::NoMass { shift: name }) };
        let Some(converter) = car.converter else { return Err(OneShiftError::NoConverter) };
        Ok(Self {
            reduced,
            converter,
            offgoing: offgoing_clutch,
            oncoming: with_rising_command(oncoming_clutch),
            element,
            budget,
            car,
            name,
        })
    }

    fn vehicle(&self) -> Vehicle {
        let car = self.car;
        let kind = match self.oncoming.valve.command_kind() {
            CommandKind::Current => &BY_CURRENT,
            CommandKind::DutyCycle => &BY_DUTY_CYCLE,
        };
        let error_bounds = self.error_bounds();
        let own = acceleration_errors(&self.reduced, &car.driveline, &car.road, &error_bounds);
        let [in_torque_phase, in_inertia_phase] = [0, 1].map(|phase| own[phase] / ACCELERATION_ERRORS_RAD_S2[phase]);
        let train = car.gearbox.train.as_ref();
        let [torque_s, inertia_s, compliant_torque_s, compliant_inertia_s] = kind.settling_s;
        Vehicle {
            name: format!("{}, shift {}", car.name, self.name),
            engine: car.engine,
            converter: self.converter,
            shift: self.reduced,
            // Without a stick diagram the mass of the output shaft alone is not known: it is small beside the car's.
            output_inertia_kg_m2: train.map_or(0.0, |train| train.shafts[train.output].inertia_kg_m2),
            offgoing: self.offgoing,
            oncoming: self.oncoming,
            driveline: car.driveline,
            backlash_rad: car.backlash_rad,
            oil_temperature_degc: car.oil_temperature_degc,
            tyre: car.tyre,
            road: car.road,
            settings: ObserverSettings {
                valve: self.observer_valve(self.oncoming.clutch.kiss_pressure() + error_bounds.shift_pressure_pa),
                uncertainty: Uncertainty { friction: self.friction(), valve: kind.valve },
                phase_slips: PhaseSlips { release_slip_rad_s: 1.0, lock_slip_rad_s: 3.0, lock_hold_s: 0.02 },
                speed_max_rad_s: 1000.0,
                command_max: match self.oncoming.valve.command_kind() {
                    CommandKind::Current => {
                        command_limits(&self.oncoming.valve, car.line_pressure_pa, self.element.valve_gain_factor)[1]
                    }
                    CommandKind::DutyCycle => kind.command_max,
                },
                filter: FilterSettings {
                    turbine_share: 0.10,
                    turbine_share_s: 3.0,
                    twist_rate_rad_s: 0.05,
                    valve_rate_s: 0.1,
                    offgoing_n_m: self.torque_size() * OFFGOING_N_M * self.offgoing_size(),
                    offgoing_release_s: 0.03,
                    output_least_rad_s: 20.0,
                },
                shaft_settling_s: 0.5,
            },
            requirements: Requirements {
                torque_phase: self.requirement(torque_s, None, in_torque_phase * 36.7, 0.06e6),
                inertia_phase: self.requirement(inertia_s, Some(15.0), in_inertia_phase * 1600.0, 0.05e6),
                compliant_torque_phase: self.compliant(compliant_torque_s, 15.0, 0.18e6),
                compliant_inertia_phase: self.compliant(compliant_inertia_s, 5.0, 0.04e6),
            },
            error_bounds,
        }
    }

    /// The error budget of the shift. Numbers without a name are those of `vehicles/two_speed_at.toml`.
    fn error_bounds(&self) -> ErrorBounds {
        let (car, errors, element) = (self.car, &self.budget, &self.element);
        let torque_n_m = SHIFT_TORQUE * car.engine.largest_torque();
        let lower_gear = self.torque_size() * self.reduced.ratio_offgoing() / RATIO_BEFORE;
        let (pressure, slip) = (self.pressure_size(), self.slip_size());
        let [on_turbine, on_output] = self.reduced.slip_oncoming;
        let (turbine_quantum_rad_s, output_quantum_rad_s) = (0.7_f64, 0.7_f64);
        ErrorBounds {
            turbine_torque_n_m: errors.converter * torque_n_m,
            turbine_torque_share: errors.converter,
            inertia_torque_n_m: self.inertia_torque_n_m(),
            pressure_pa: pressure * 0.1e6,
            mass_kg: car.error_bounds.mass_share.unwrap_or(MASS_ERROR) * car.road.mass_kg,
            grade_rad: 0.0873,
            shaft_torque_n_m: lower_gear * car.driveline.final_ratio / FINAL_RATIO * SHAFT_TORQUE_N_M,
            output_torque_n_m: lower_gear * OUTPUT_ERROR_N_M,
            offgoing_torque_n_m: self.torque_size() * OFFGOING_OPEN_N_M * self.offgoing_size(),
            offgoing_drain_s: 0.1,
            turbine_quantum_rad_s,
            output_quantum_rad_s,
            slip_quantum_rad_s: Real::hypot(on_turbine * turbine_quantum_rad_s, on_output * output_quantum_rad_s),
            wheel_quantum_rad_s: 0.14,
            sampling_delay_s: 0.02,
            float32_rounding: 6e-8,
            shift_pressure_pa: pressure * 0.2e6,
            shift_ramp_pa_s: pressure * 0.8e6,
            valve_lag_factor: element.valve_lag_factor,
            valve_gain_factor: element.valve_gain_factor,
            valve_delay_s: element.valve_delay_s,
            valve_hysteresis_pa: element.valve_hysteresis_pa,
            command_age_s: COMMAND_AGE_S,
            line_pressure_pa: [element.pressure_max_pa; 2],
            fill: self.oncoming.standard_fill_budget(car.oil_temperature_degc),
            friction_factor: element.friction_factor,
            command: element.command,
            slip_rad_s: slip * 40.0,
            pressure_max_pa: element.pressure_max_pa,
            wheel_scale: errors.wheel_scale,
            wheel_delay_s: WHEEL_DELAY_S,
            channel_skew_s: CHANNEL_SKEW_S,
            engine_torque_share: errors.engine,
            shaft_stiffness_factor: around(errors.stiffness),
            backlash_rad: BACKLASH_RAD,
        }
    }

    /// A requirement at the pressures of this shift.
    fn requirement(
        &self,
        settling_time_s: f64,
        kappa1_per_s: Option<f64>,
        model_error_max_rad_s2: f64,
        offset_max_pa: f64,
    ) -> DesignRequirement {
        let offset_max_pa = self.pressure_size() * offset_max_pa;
        DesignRequirement { settling_time_s, kappa1_per_s, model_error_max_rad_s2, offset_max_pa }
    }

    /// The same on the compliant observer.
    fn compliant(&self, settling_time_s: f64, kappa1_per_s: f64, offset_max_pa: f64) -> CompliantRequirement {
        let offset_max_pa = self.pressure_size() * offset_max_pa;
        CompliantRequirement { settling_time_s, kappa1_per_s: Some(kappa1_per_s), offset_max_pa, error_matrix: None }
    }

    /// Maximum torque of the engine, over that of the car that is scaled.
    fn torque_size(&self) -> f64 {
        self.car.engine.largest_torque() / ENGINE_TORQUE_N_M
    }

    /// What an error of the turbine-side inertia is worth in the inertia phase, N m.
    fn inertia_torque_n_m(&self) -> f64 {
        let step = 1.0 - self.reduced.ratio_oncoming() / self.reduced.ratio_offgoing();
        self.budget.inertia * self.reduced.mass_kg_m2[0][0] * TURBINE_RAD_S2 * step
    }

    /// Torque of the offgoing clutch per turbine torque, over that of the car of the defaults.
    fn offgoing_size(&self) -> f64 {
        (1.0 / self.reduced.slip_offgoing[0]).abs() / TORQUE_FRACTIONS[0]
    }

    /// Slip of the oncoming clutch per speed of the turbine, over that of the car of the defaults: its torque per turbine torque is the
    /// inverse.
    fn slip_size(&self) -> f64 {
        self.reduced.slip_oncoming[0].abs() * TORQUE_FRACTIONS[1]
    }

    /// Pressure of the oncoming clutch in a shift, over that of the car of the defaults.
    fn pressure_size(&self) -> f64 {
        let clutch = &self.oncoming.clutch;
        let torque_n_m = self.car.engine.largest_torque() / self.slip_size() / ENGINE_TORQUE_N_M;
        let (minimum, maximum) = clutch.friction.range();
        let torque_per_pressure = 0.5 * (minimum + maximum) * clutch.lever() * clutch.piston_area_m2;
        torque_n_m * FRICTION * FACES * PLATE_RADII_M[1] * PISTON_AREAS_M2[1] / torque_per_pressure
    }

    /// The friction of the oncoming clutch: over slip, and what is not known of it.
    fn friction(&self) -> (f64, f64) {
        let (minimum, maximum) = self.oncoming.clutch.friction.range();
        let [low, high] = self.element.friction_factor;
        (low * minimum, high * maximum)
    }

    /// The valve of the oncoming clutch as it is at this pressure. What its lag may be besides is among the errors of the budget.
    fn observer_valve(&self, pressure_pa: f64) -> Valve<f64> {
        match &self.oncoming.valve {
            ClutchValve::Proportional(maps) | ClutchValve::NormallyHigh { maps, .. } => Valve::Proportional {
                time_constant_s: maps.time_constant_s.at(pressure_pa),
                gain_pa_a: pressure_pa / maps.current_for(pressure_pa),
            },
            ClutchValve::PulseWidth { law, .. } => Valve::PulseWidth(*law),
        }
    }
}

impl Vehicle {
    /// What the errors of its budget do to the outputs of torque and inertia phase, all at their bounds at the same time, rad/s^2.
    pub fn acceleration_errors(&self) -> [f64; 2] {
        acceleration_errors(&self.shift, &self.driveline, &self.road, &self.error_bounds)
    }
}

/// The clutch with a valve whose pressure rises with its command.
fn with_rising_command(clutch: ShiftClutch) -> ShiftClutch {
    match clutch.valve {
        ClutchValve::NormallyHigh { maps, .. } => ShiftClutch { valve: ClutchValve::Proportional(maps), ..clutch },
        _ => clutch,
    }
}

/// What the errors of the budget do to the outputs of torque and inertia phase, all at their bounds at the same time, rad/s^2.
fn acceleration_errors(
    shift: &ReducedShift<f64>,
    driveline: &Driveline<f64>,
    road: &RoadLoad<f64>,
    bounds: &ErrorBounds,
) -> [f64; 2] {
    let shift = shift.with_output_inertia(driveline.vehicle_inertia_at_output(road));
    let of = |engagement| shift.coefficients(engagement);
    let (torque, inertia) = (of(Engagement::OffgoingStuck), of(Engagement::BothSlipping));
    let output_n_m =
        bounds.output_torque_n_m + (bounds.grade_n_m(road) + bounds.mass_n_m(road)) / driveline.final_ratio;
    let size = |row: &AccelerationRow<f64>, turbine_n_m: f64, offgoing_n_m: f64| {
        (row.per_turbine_torque * turbine_n_m).abs()
            + (row.per_output_torque * output_n_m).abs()
            + (row.per_offgoing_torque * offgoing_n_m).abs()
    };
    let turbine_n_m = bounds.turbine_torque_n_m;
    let slipping = |row| size(row, turbine_n_m + bounds.inertia_torque_n_m, bounds.offgoing_torque_n_m);
    [size(&torque.turbine, turbine_n_m, 0.0), Real::hypot(slipping(&inertia.turbine), slipping(&inertia.slip_oncoming))]
}
