//! The shift controller of any gearbox: commands of all elements and the share of engine torque, from measured speeds.
//!
//! A shift is run by the reduced shift of the gearbox: torques `U` at the turbine, `alpha` and ratio of both clutches, and the
//! 2 x 2 mass. With the offgoing slip `y = w_t - i_off w_0` and the oncoming slip `z = w_t - i_on w_0` at the turbine, one
//! speed controller serves the inertia phase of every kind of shift:
//!
//! ```text
//! U = T_t - M11 (dz_ref/dt + i_on dw_0/dt) - M12 dw_0/dt + k_p M11 (z - z_ref) + k_i M11 integral(z - z_ref)
//! ```
//!
//! The sum `U` goes to the clutch whose slip has the right sign: the oncoming one if `U (i_off - i_on) > 0`, else the
//! offgoing one. So the roles change by themselves when the turbine torque changes its sign during a shift. The controller knows
//! the nominal car; it does not know pressures, torques, or the errors of the valves.

mod calibration;
mod pressure;
mod shift;
mod strokes;
mod track;

use config::Car;
use geartrain::{Change, ElementKind};

use super::integrate::CarError;
use crate::gear_train::MAX_ELEMENTS;
pub use calibration::CarCalibration;
use pressure::Controlled;
use shift::ActiveShift;
pub use shift::ShiftStage;
use strokes::Strokes;
use track::Track;

/// What the controller measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarMeasured {
    /// Engine speed, rad/s.
    pub engine_rad_s: f64,
    /// Turbine speed, rad/s; without a converter that of the gearbox input.
    pub turbine_rad_s: f64,
    /// Gearbox output speed, rad/s.
    pub output_rad_s: f64,
    /// Driven wheel speed, rad/s.
    pub wheel_rad_s: f64,
}

/// What the controller commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarCommands {
    /// Command of each friction element's valve: current in A, or duty cycle in %.
    pub elements: [f64; MAX_ELEMENTS],
    /// Which elements are dogs that are to be in.
    pub dogs: [bool; MAX_ELEMENTS],
    /// Share of the engine torque that the driver asks for.
    pub engine_share: f64,
    /// Torque that the lock-up clutch is to hold, N m.
    pub lock_up_n_m: f64,
}

/// A shift that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShiftProgress {
    /// The gear before.
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// Place of the clutch that opens among the elements.
    pub offgoing: usize,
    /// Place of the clutch that closes.
    pub oncoming: usize,
    /// What the controller is about.
    pub stage: ShiftStage,
}

/// The shift controller.
#[derive(Debug, Clone)]
pub struct CarShiftController {
    car: Car,
    calibration: CarCalibration,
    gear: usize,
    active: Option<ActiveShift>,
    preselected: Option<usize>,
    output: Track,
    engine_share: f64,
    /// Share of its capacity with which the lock-up clutch is closed.
    lock_up_share: f64,
    is_locked_up: bool,
    strokes: Strokes,
}

impl CarShiftController {
    /// A controller for this car, in a gear.
    ///
    /// # Errors
    /// There is no such gear.
    pub fn new(car: &Car, calibration: CarCalibration, gear: usize) -> Result<Self, CarError> {
        if gear >= car.gearbox.gears.len() {
            return Err(CarError::Request(format!("the gearbox has no gear number {gear}")));
        }
        let output = Track::new(calibration.output_filter_s);
        Ok(Self {
            car: car.clone(),
            calibration,
            gear,
            active: None,
            preselected: None,
            output,
            engine_share: 1.0,
            lock_up_share: 0.0,
            is_locked_up: false,
            strokes: Strokes::new(car, gear),
        })
    }

    /// The gear, before and during a shift the one that is left.
    pub fn gear(&self) -> usize {
        self.gear
    }

    /// The shift that is under way.
    pub fn shift(&self) -> Option<ShiftProgress> {
        self.active.as_ref().map(|shift| ShiftProgress {
            from: self.gear,
            to: shift.to,
            offgoing: shift.offgoing.element,
            oncoming: shift.oncoming.element,
            stage: shift.stage,
        })
    }

    /// Puts in the dogs of this gear beside those of the gear that is engaged.
    pub fn preselect(&mut self, gear: Option<usize>) {
        self.preselected = gear.filter(|&gear| gear < self.car.gearbox.gears.len());
    }

    /// Begins a shift to this gear. While another shift is under way nothing happens.
    ///
    /// # Errors
    /// The shift is not one between two clutches.
    pub fn request(&mut self, to: usize, time_s: f64) -> Result<(), CarError> {
        if self.active.is_some() || to == self.gear {
            return Ok(());
        }
        let names = |gear: usize| self.car.gearbox.gears.get(gear).map_or("?", |gear| gear.name.as_str());
        let shift = self.car.gearbox.shift(self.gear, to);
        let single = shift.and_then(|shift| match (&shift.change, &shift.reduced) {
            (Change::Single { offgoing, oncoming, .. }, Some(reduced)) => Some((*offgoing, *oncoming, *reduced)),
            _ => None,
        });
        let line_pa = self.car.line_pressure_pa;
        let both = single.and_then(|(offgoing, oncoming, reduced)| {
            let clutch = |element: usize| self.car.clutches.get(element).copied().flatten();
            let offgoing = Controlled::new(offgoing, clutch(offgoing)?, reduced.slip_offgoing, line_pa);
            let on = Controlled::new(oncoming, clutch(oncoming)?, reduced.slip_oncoming, 0.0);
            let oncoming = on.filled_from(self.strokes.of(oncoming), &self.calibration);
            Some(([offgoing, oncoming], reduced.mass_kg_m2))
        });
        let Some((clutches, mass_kg_m2)) = both else {
            let message = format!(
                "shift {}-{} is not between two clutches; shift through the gears between",
                names(self.gear),
                names(to)
            );
            return Err(CarError::Request(message));
        };
        self.active = Some(ActiveShift::new(to, clutches, mass_kg_m2, line_pa, time_s));
        Ok(())
    }

    /// Commands for the period that begins at `time_s`.
    pub fn step(&mut self, time_s: f64, throttle: f64, measured: &CarMeasured) -> CarCommands {
        let period_s = self.calibration.control_period_s;
        self.output.follow(measured.wheel_rad_s * self.car.driveline.final_ratio, period_s);
        let turbine_n_m = self.turbine_torque(throttle, measured);
        let open = |element: usize| self.car.clutches.get(element).and_then(Option::as_ref);
        let mut elements: [f64; MAX_ELEMENTS] =
            std::array::from_fn(|element| open(element).map_or(0.0, |clutch| clutch.valve.command_for(0.0)));
        let mut dogs = [false; MAX_ELEMENTS];
        let line_pa = self.car.line_pressure_pa;
        // The clutches of a shift get their commands below.
        let next = self.active.as_ref().map_or(self.preselected, |shift| Some(shift.to));
        for gear in [Some(self.gear), next].into_iter().flatten() {
            for holding in &self.car.gearbox.gears[gear].holding {
                let element = holding.element;
                match &self.car.clutches[element] {
                    Some(clutch) if gear == self.gear => elements[element] = clutch.valve.command_for(line_pa),
                    Some(_) => (),
                    None => dogs[element] = self.car.gearbox.elements[element].kind == ElementKind::Dog,
                }
            }
        }
        let mut wanted = 1.0;
        if let Some(shift) = &mut self.active {
            let pressures = shift.step(&self.calibration, time_s, turbine_n_m, measured, &self.output);
            for (clutch, pressure_pa) in [&shift.offgoing, &shift.oncoming].into_iter().zip(pressures) {
                elements[clutch.element] = clutch.valve_command(pressure_pa.clamp(0.0, line_pa));
            }
            wanted = shift.engine_share(&self.calibration, turbine_n_m, measured);
            if shift.stage == ShiftStage::Done {
                self.gear = shift.to;
                self.active = None;
            }
        }
        let step = period_s / self.calibration.engine_ramp_s;
        self.engine_share += (wanted - self.engine_share).clamp(-step, step);
        let lock_up_n_m = self.lock_up(measured);
        self.strokes.follow(&self.car, &elements, period_s);
        CarCommands { elements, dogs, engine_share: self.engine_share, lock_up_n_m }
    }

    /// Torque that the lock-up clutch is to hold, N m. It is open during shifts: their turbine torque is that of the converter.
    fn lock_up(&mut self, measured: &CarMeasured) -> f64 {
        let Some(lock_up) = self.car.lock_up else { return 0.0 };
        let ratio = |gear: usize| self.car.gearbox.gears[gear].ratio;
        let is_high = ratio(self.gear) > 0.0 && ratio(self.gear) <= ratio(lock_up.first_gear);
        let fastest = if self.is_locked_up { lock_up.off_rad_s } else { lock_up.on_rad_s };
        self.is_locked_up = self.active.is_none() && is_high && measured.turbine_rad_s > fastest;
        let period_s = self.calibration.control_period_s;
        let step = if self.is_locked_up { period_s / lock_up.ramp_s } else { -period_s / self.calibration.unlock_s };
        self.lock_up_share = (self.lock_up_share + step).clamp(0.0, 1.0);
        self.lock_up_share * lock_up.capacity_n_m
    }

    /// Torque on the gearbox input as the nominal maps give it, N m. The engine controller's reductions are known.
    fn turbine_torque(&self, throttle: f64, measured: &CarMeasured) -> f64 {
        match &self.car.converter {
            Some(converter) => converter.torques(measured.engine_rad_s, measured.turbine_rad_s).turbine_n_m,
            None => {
                let engine = &self.car.engine;
                let torque = engine.torque(measured.turbine_rad_s, throttle);
                let reduced = if torque > 0.0 { torque * self.engine_share } else { torque };
                reduced - engine.drag_n_m_s * measured.turbine_rad_s
            }
        }
    }
}
