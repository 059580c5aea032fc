//! What the rows in a gear tell of a log: whether their speeds fit the gear, and whether the filter could use them.

use car::{Car, Gear};
use observer::{Health, Reading};

use crate::checks::CameSpeed;
use crate::checks::ratio_histogram::RatioHistogram;
use crate::checks::ratio_scale::{RatioScale, WrongScale};
use crate::checks::swapped_speeds::SwappedSpeeds;

/// Speed of the output by any of the speeds from which on the ratio of a gear is compared with the speeds, rad/s, and fraction by which they
/// may differ.
const RATIO_FROM_RAD_S: f64 = 20.0;
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

/// The rows in a gear at speed.
pub(crate) struct InGear<'c> {
    car: &'c Car,
    /// All, and those whose speeds do not fit the ratio of the gear.
    rows: [u64; 2],
    /// Rows with each health while the car moves, in the order of [`Health::ALL`], and those in which engine, turbine or output speed have ended.
    health: [u64; Health::ALL.len()],
    ended: u64,
    swapped: SwappedSpeeds,
    scale: RatioScale,
    /// Output over wheel speed in the rows that have both; how many there are, and how long they are, s.
    output_over_wheel: RatioHistogram<1000>,
    wheel_rows: (u64, f64),
    wheel: CameSpeed,
}

/// A row in a gear.
pub(crate) struct InGearRow {
    /// The gear.
    pub(crate) gear: Gear,
    /// Its time, and that since the row before, s.
    pub(crate) time_s: f64,
    pub(crate) dt_s: f64,
    /// Newest speeds of engine, turbine and output as they came, rad/s.
    pub(crate) came_rad_s: [f64; 3],
    /// Whether one of these came before, and comes no more.
    pub(crate) has_ended: bool,
    /// Output and wheel speed of this row.
    pub(crate) output: Option<Reading<f64>>,
    pub(crate) wheel: Option<Reading<f64>>,
    /// What the filter says of the row.
    pub(crate) health: Health,
}

impl<'c> InGear<'c> {
    pub(crate) fn new(car: &'c Car) -> Self {
        Self {
            car,
            rows: [0; 2],
            health: [0; Health::ALL.len()],
            ended: 0,
            swapped: SwappedSpeeds::default(),
            scale: RatioScale::new(car),
            output_over_wheel: RatioHistogram::default(),
            wheel_rows: (0, 0.0),
            wheel: CameSpeed::default(),
        }
    }

    pub(crate) fn push(&mut self, row: &InGearRow) {
        let [engine, turbine, output] = row.came_rad_s;
        let wheel = row.wheel.filter(|reading| reading.value.is_finite());
        if let Some(Reading { value, .. }) = wheel {
            self.wheel.push(row.time_s, value);
        }
        let Some((gear, ratio)) = row.gear.place().zip(self.car.ratio(row.gear)) else { return };
        // An output speed in a wrong unit may be too slow to count. Without a converter the turbine turns with the engine at a standstill.
        let by_turbine = if self.car.converter.is_some() { turbine / ratio } else { f64::NAN };
        let by_wheels = self.wheel.at(row.time_s) * self.car.driveline.final_ratio;
        let is_at_speed = output.max(by_turbine).max(by_wheels) > RATIO_FROM_RAD_S;
        // A car that creeps is rightly too slow, and its clutch may be open; not where the turbine is too fast for that in this gear.
        let is_rightly_slow =
            matches!(row.health, Health::TooSlow | Health::ClutchOpen) && turbine / ratio <= RATIO_FROM_RAD_S;
        if (is_at_speed || output > MOVES_RAD_S && turbine > RATIO_FROM_RAD_S) && !is_rightly_slow {
            self.health[row.health as usize] += 1;
            self.ended += u64::from(row.has_ended);
        }
        if !is_at_speed {
            return;
        }
        let by_output = ratio * output;
        if (turbine - by_output).is_nan() {
            // One of both is lost, and the other shows no ratio.
            return;
        }
        self.swapped.push(engine, turbine, &[by_output]);
        self.scale.push(gear, ratio, row.came_rad_s);
        self.rows[0] += 1;
        self.rows[1] += u64::from((turbine - by_output).abs() > RATIO_FRACTION * by_output.abs());
        if let (Some(output), Some(wheel)) = (row.output.filter(|reading| reading.value.is_finite()), wheel) {
            self.output_over_wheel.push(output.value / wheel.value);
            self.wheel_rows.0 += 1;
            self.wheel_rows.1 += row.dt_s.clamp(0.0, 1.0);
        }
    }

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

    /// Rows while the car moves in which engine, turbine or output speed have ended.
    pub(crate) fn ended(&self) -> u64 {
        self.ended
    }

    /// Output over wheel speed in the middle; not a number where too few rows have both.
    pub(crate) fn output_over_wheel(&self) -> f64 {
        /// Rows that are needed to judge, and their time, s \[chosen\].
        const ENOUGH: (u64, f64) = (200, 3.0);
        let (rows, time_s) = self.wheel_rows;
        if rows < ENOUGH.0 || time_s < ENOUGH.1 { f64::NAN } else { self.output_over_wheel.middle() }
    }

    /// A speed whose scale is wrong.
    pub(crate) fn wrong_scale(&self) -> Option<WrongScale> {
        self.scale.sentence(self.car, self.output_over_wheel() / self.car.driveline.final_ratio)
    }

    /// What contradicts the channels of engine and turbine speed, in a sentence.
    pub(crate) fn swapped_speeds(&self) -> Option<String> {
        self.swapped.contradiction()
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
