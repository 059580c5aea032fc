//! A car with all the gears of its gearbox.

use drivetrain::{Converter, Driveline, Engine, RoadLoad, Tyre};
use geartrain::Gearbox;

use crate::{CarErrorBounds, Gear, ShiftClutch, ShiftCommand};

/// The lock-up clutch of the converter, and when it is closed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LockUp {
    /// Torque that it holds when it is closed, N m.
    pub capacity_n_m: f64,
    /// Lowest gear in which it is closed.
    pub first_gear: usize,
    /// Speed of the gearbox input above which it is closed, rad/s.
    pub on_rad_s: f64,
    /// Speed of the gearbox input below which it is opened, rad/s.
    pub off_rad_s: f64,
    /// Time in which it closes, s.
    pub ramp_s: f64,
    /// Slip that is kept, rad/s; zero where the clutch is to lock.
    pub slip_rad_s: f64,
}

/// A car with all the gears and elements of its gearbox.
#[derive(Debug, Clone, PartialEq)]
pub struct Car {
    /// Its name for people.
    pub name: String,
    /// The gearbox. Without a stick diagram the car can be estimated, and not simulated; with ratios alone, torques at the turbine are estimated,
    /// with masses of the shifts that are assumed where its file has none.
    pub gearbox: Gearbox,
    /// The friction elements, in the order of the gearbox's elements; `None` for dogs and one-way clutches.
    pub clutches: Vec<Option<ShiftClutch>>,
    /// Line pressure, Pa: that of an element that holds a gear.
    pub line_pressure_pa: f64,
    /// The engine.
    pub engine: Engine<f64>,
    /// The torque converter; without one the engine turns the input shaft of the gearbox.
    pub converter: Option<Converter<f64>>,
    /// The lock-up clutch of the converter, if there is one.
    pub lock_up: Option<LockUp>,
    /// Differential, drive shafts, wheels.
    pub driveline: Driveline<f64>,
    /// Backlash between gearbox and wheels, rad at the wheel.
    pub backlash_rad: f64,
    /// The driven tyres.
    pub tyre: Tyre<f64>,
    /// Vehicle body and road.
    pub road: RoadLoad<f64>,
    /// Temperature of the oil, degC.
    pub oil_temperature_degc: f64,
    /// Bounds on the errors of these values that the file has.
    pub error_bounds: CarErrorBounds,
}

impl Car {
    /// Turbine speed over output speed in a gear; `None` in neutral, and of a gear that the gearbox does not have.
    pub fn ratio(&self, gear: Gear) -> Option<f64> {
        Some(self.gearbox.gears.get(gear.place()?)?.ratio)
    }

    /// The name of a gear; `N` in neutral.
    pub fn gear_name(&self, gear: Gear) -> &str {
        gear.place().and_then(|place| self.gearbox.gears.get(place)).map_or("N", |gear| gear.name.as_str())
    }

    /// The names of the gears of a shift, as `1-2`.
    pub fn shift_name(&self, shift: ShiftCommand) -> String {
        format!("{}-{}", self.gear_name(shift.from), self.gear_name(shift.to))
    }

    /// Places of the offgoing and the oncoming element of a shift that changes one element each.
    pub fn single_shift(&self, shift: ShiftCommand) -> Option<[usize; 2]> {
        self.gearbox.shift(shift.from.place()?, shift.to.place()?)?.change.single()
    }

    /// The car with another friction of all clutches, times `factor`.
    #[must_use]
    pub fn with_friction(mut self, factor: f64) -> Self {
        for clutch in self.clutches.iter_mut().flatten() {
            clutch.clutch.friction = clutch.clutch.friction.scaled(factor);
            clutch.clutch.static_friction *= factor;
        }
        self
    }
}
