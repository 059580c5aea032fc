//! What the rows in a gear tell of a log: whether their speeds fit the gear, and whether the filter could use them.

use car::Car;
use observer::Health;

use super::came_speed::CameSpeed;
use super::check::{Check, CheckedRow};
use crate::LogStep;

/// Speed of the output by any of the speeds from which on the ratio of a gear is compared with the speeds, rad/s, and fraction by which they
/// may differ.
pub(super) const RATIO_FROM_RAD_S: f64 = 20.0;
const RATIO_FRACTION: f64 = 0.1;
/// Output speed above which the car moves where the turbine is at speed, rad/s \[chosen\]: a slow walk.
const MOVES_RAD_S: f64 = 5.0;
/// From fewer rows nothing is said of all of them \[chosen\]: one second at 100 Hz.
const ENOUGH_ROWS: u64 = 100;

/// Rows in which the estimate cannot be used, of a log that has no others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unusable {
    /// How many there are.
    pub rows: u64,
    /// What most of them have.
    pub health: Health,
}

/// What the speeds of a row in a gear show.
pub(crate) struct RowInGear {
    /// The gear, by its place in the gearbox, and its ratio.
    pub(crate) gear: usize,
    pub(crate) ratio: f64,
    /// Whether the car moves, and is not rightly too slow for the filter.
    moves: bool,
    /// Whether turbine and output speed are fast enough to be compared.
    pub(crate) is_compared: bool,
}

/// The speeds of a car in its gears.
pub(crate) struct GearSpeeds<'c> {
    car: &'c Car,
    wheel: CameSpeed,
}

impl<'c> GearSpeeds<'c> {
    pub(crate) fn new(car: &'c Car) -> Self {
        Self { car, wheel: CameSpeed::default() }
    }

    /// What a row shows of its gear, with the newest speeds of engine, turbine and output, rad/s, and the health of the estimate; `None` in
    /// a shift and in neutral.
    pub(crate) fn row(&mut self, step: &LogStep, came_rad_s: [f64; 3], health: Health) -> Option<RowInGear> {
        if !step.input.gear.is_steady() {
            return None;
        }
        if let Some(wheel) = step.input.wheel_rad_s.filter(|reading| reading.value.is_finite()) {
            self.wheel.push(step.time_s, wheel.value);
        }
        let gear = step.input.gear.from;
        let (gear, ratio) = gear.place().zip(self.car.ratio(gear))?;
        let [_, turbine, output] = came_rad_s;
        // An output speed in a wrong unit may be too slow to count. Without a converter the turbine turns with the engine at a standstill.
        let by_turbine = if self.car.converter.is_some() { turbine / ratio } else { f64::NAN };
        let by_wheels = self.wheel.at(step.time_s) * self.car.driveline.final_ratio;
        let is_at_speed = output.max(by_turbine).max(by_wheels) > RATIO_FROM_RAD_S;
        // A car that creeps is rightly too slow, and its clutch may be open; not where the turbine is too fast for that in this gear.
        let is_rightly_slow =
            matches!(health, Health::TooSlow | Health::ClutchOpen) && turbine / ratio <= RATIO_FROM_RAD_S;
        let moves = is_at_speed || output > MOVES_RAD_S && turbine > RATIO_FROM_RAD_S;
        // Where one of both is lost, the other shows no ratio; behind a one-way clutch that overruns the turbine turns freely.
        let is_tied = health != Health::OneWayOverruns && !(turbine - ratio * output).is_nan();
        // Sensors of toothed wheels do not tell which way a car in reverse goes.
        let is_compared = is_at_speed && is_tied && ratio > 0.0;
        Some(RowInGear { gear, ratio, moves: moves && !is_rightly_slow, is_compared })
    }
}

/// The rows in a gear at speed.
#[derive(Default)]
pub(crate) struct InGear {
    /// All, and those whose speeds do not fit the ratio of the gear.
    rows: [u64; 2],
    /// Rows with each health while the car moves, in the order of [`Health::ALL`], and those in which engine, turbine or output speed have ended.
    health: [u64; Health::ALL.len()],
    ended: u64,
}

impl InGear {
    /// Rows, and those whose turbine and output speed do not fit the ratio of the gear; none where a speed has ended in most rows: what its
    /// sensor gave while it failed says nothing of the car.
    pub(crate) fn rows(&self) -> [u64; 2] {
        if self.has_ended() { [0; 2] } else { self.rows }
    }

    /// Whether engine, turbine or output speed have ended in most rows while the car moves.
    fn has_ended(&self) -> bool {
        2 * self.ended > self.health.iter().sum()
    }

    /// The rows while the car moves, if there are enough of them and the filter could use the readings of none.
    pub(crate) fn unusable(&self) -> Option<Unusable> {
        let of = |health: &Health| self.health[*health as usize];
        let rows = self.health.iter().sum();
        let is_used = Health::ALL.iter().any(|health| is_usable(*health) && of(health) > 0);
        let health = Health::ALL.into_iter().max_by_key(of)?;
        (!is_used && !self.has_ended() && rows >= ENOUGH_ROWS).then_some(Unusable { rows, health })
    }
}

impl Check for InGear {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let Some(in_gear) = &row.in_gear else { return };
        if in_gear.moves {
            self.health[row.estimate.health as usize] += 1;
            self.ended += u64::from(row.has_ended);
        }
        if in_gear.is_compared {
            let [_, turbine, output] = row.came_rad_s;
            let by_output = in_gear.ratio * output;
            self.rows[0] += 1;
            self.rows[1] += u64::from((turbine - by_output).abs() > RATIO_FRACTION * by_output.abs());
        }
    }

    fn warnings(&self) -> Vec<String> {
        let warning = (self.ended > 0).then(|| {
            format!(
                "warning: engine, turbine or output speed is missing or refused in {} rows in a gear with the car moving: pressures and torques \
                 there are those of the valve models alone (open loop)\nhint: the columns `_reading` of the estimate name the channel; check its sensor, rate and unit",
                self.ended
            )
        });
        warning.into_iter().collect()
    }
}

/// Whether an estimate of this health is made from the readings of the car.
fn is_usable(health: Health) -> bool {
    match health {
        Health::Good
        | Health::ReadingRefused
        | Health::ChannelLost
        | Health::Flare
        | Health::OutsideRange
        | Health::LimitedToRange
        | Health::BeyondBounds
        | Health::CommandsMistimed
        | Health::PressureLimited => true,
        Health::CommandRejected
        | Health::TooSlow
        | Health::ClutchOpen
        | Health::OneWayOverruns
        | Health::ShiftNotModelled
        | Health::SpeedsRejected
        | Health::HeldClutchSlips
        | Health::Restarted
        | Health::TimeRejected => false,
    }
}
