//! From the steps of a log to stretches of driving in which the engine pulls.

use super::DrivenCar;
use super::skew::{Dated, SkewRecorder, turns_by};
use super::stretch::{Driving, Stretch, StretchReadings};
use super::twist::TwistRecorder;
use crate::Series;

/// After a shift clutches and shafts come to rest, s.
const SETTLES_S: f64 = 0.5;
/// Longest time without a reading of a speed, s.
const GAP_S: f64 = 0.1;
/// Rows further apart are of two stretches, s \[chosen\]: where a recording was stopped, nothing is known of what lies between them. Logs whose rows are
/// so far apart have no shifts, and are refused.
const HOLE_S: f64 = 1.0;
/// Output speed below which the readings of toothed wheels are too old, rad/s \[chosen, as in the filter\].
const OUTPUT_MIN_RAD_S: f64 = 15.0;
/// The engine pulls where the turbine turns slower than this fraction of its speed, and until it turns faster than the second one \[chosen\] ...
const PULLS: [f64; 2] = [0.97, 0.99];
/// ... and it is not idling, rad/s \[chosen: with a foot on the brake it idles, cold too\].
const ENGINE_MIN_RAD_S: f64 = 120.0;
/// Without a converter it pulls with this torque, and until it has less than the second one, N m \[chosen\].
const PULLS_N_M: [f64; 2] = [15.0, 5.0];
/// The end of a stretch is left out, s: from the release of the accelerator until the engine does not pull any more the brake may be on
/// already.
const FOOT_S: f64 = 0.5;
/// Time of driving that is kept, s: two hours.
const MAX_S: f64 = 7200.0;
/// Of readings before a stretch what a late signal needs, s.
const BEFORE_S: f64 = 0.5;

/// What a row shows besides its readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RowState {
    /// The gear; none in a shift.
    pub(crate) gear: Option<usize>,
    pub(crate) lock_up: bool,
}

/// Takes the steps of a log one after the other.
pub(crate) struct DrivingRecorder {
    car: DrivenCar,
    /// Of the stretch that is open.
    readings: StretchReadings,
    open: Option<(usize, f64)>,
    unsettled_s: f64,
    /// The time of the row before, s.
    row_s: f64,
    twist: TwistRecorder,
    output: SkewRecorder,
    engine: SkewRecorder,
    found: Driving,
}

impl DrivingRecorder {
    pub(crate) fn new(car: DrivenCar) -> Self {
        Self {
            car,
            readings: StretchReadings::default(),
            open: None,
            unsettled_s: f64::NEG_INFINITY,
            row_s: f64::NAN,
            twist: TwistRecorder::default(),
            output: SkewRecorder::default(),
            engine: SkewRecorder::default(),
            found: Driving::default(),
        }
    }

    /// Takes a row: its time, the readings of engine, turbine, output and wheel speed, the reported engine torque, and its state.
    pub(crate) fn push(&mut self, time_s: f64, speeds: [Dated; 4], reported: Dated, state: RowState) {
        if !self.row_s.is_nan() && !(0.0..=HOLE_S).contains(&(time_s - self.row_s)) {
            self.break_off(time_s);
        }
        self.row_s = time_s;
        let StretchReadings { engine, turbine, output, reported: torque } = &mut self.readings;
        for (series, reading) in [engine, turbine, output].into_iter().zip(speeds).chain([(torque, reported)]) {
            if let Some((time_s, value)) = reading {
                series.push(time_s, value);
            }
        }
        let gear = state.gear.filter(|_| !state.lock_up);
        self.twist.push(&self.car, time_s, speeds, gear);
        let ratio = state.gear.and_then(|gear| Some((gear, self.car.gears.get(gear)?.ratio)));
        let ratio = ratio.filter(|(_, ratio)| *ratio > 0.0);
        let [of_engine, of_turbine, of_output, _] = speeds;
        self.output.push(time_s, [of_turbine, of_output], ratio);
        let locked = state.gear.filter(|_| state.lock_up && self.car.converter.is_some()).map(|gear| (gear, 1.0));
        self.engine.push(time_s, [of_turbine, of_engine], locked);
        if gear.is_none() || gear != self.open.map(|(gear, _)| gear).or(gear) {
            self.unsettled_s = time_s;
        }
        let is_settled = time_s > self.unsettled_s + SETTLES_S;
        match (self.open, gear) {
            (Some((open, _)), Some(gear)) if open == gear && self.pulls(gear, time_s, PULLS[1], PULLS_N_M[1]) => {}
            (Some(_), _) => self.close(),
            (None, Some(gear)) if is_settled && self.pulls(gear, time_s, PULLS[0], PULLS_N_M[0]) => {
                self.open = Some((gear, time_s));
            }
            (None, _) => {}
        }
        if self.open.is_none() {
            self.forget();
        }
    }

    /// The stretches.
    pub(crate) fn finish(mut self) -> Driving {
        self.close();
        self.twist.close(&self.car);
        self.found.twists = self.twist.stretches;
        self.output.close();
        self.found.outputs = self.output.stretches;
        self.engine.close();
        self.found.engines = self.engine.stretches;
        self.found
    }

    /// Ends all stretches before a row that does not follow the one before it, s.
    fn break_off(&mut self, time_s: f64) {
        self.close();
        self.readings = StretchReadings::default();
        self.unsettled_s = time_s;
        self.twist.close(&self.car);
        self.output.close();
        self.engine.close();
    }

    /// Whether the engine pulls the car in a gear.
    fn pulls(&self, gear: usize, time_s: f64, slower: f64, min_n_m: f64) -> bool {
        let StretchReadings { engine, turbine, output, reported } = &self.readings;
        let newest = |series: &Series| {
            let last_s = series.time_s.last().filter(|last_s| (time_s - **last_s).abs() <= GAP_S);
            last_s.and_then(|_| series.value.last().copied())
        };
        let (Some(turbine), Some(output)) = (newest(turbine), newest(output)) else { return false };
        let gear = self.car.gears.get(gear).filter(|gear| gear.is_known());
        let is_in_gear = gear.is_some_and(|gear| turns_by(gear.ratio, turbine, output));
        let is_driven = match &self.car.converter {
            Some(_) => newest(engine).is_some_and(|engine| engine > ENGINE_MIN_RAD_S && turbine < slower * engine),
            None => newest(reported).is_some_and(|torque| torque > min_n_m),
        };
        is_in_gear && is_driven && output > OUTPUT_MIN_RAD_S
    }

    fn close(&mut self) {
        let Some((gear, begin_s)) = self.open.take() else { return };
        let readings = std::mem::take(&mut self.readings);
        // Before its first reading and after its last one nothing is known.
        let with_engine = self.car.converter.is_some().then_some(&readings.engine);
        let mut span = [begin_s, f64::INFINITY];
        for series in [&readings.turbine, &readings.output].into_iter().chain(with_engine) {
            let (Some(first_s), Some(last_s)) = (series.time_s.first(), series.time_s.last()) else { return };
            span = [span[0].max(*first_s), span[1].min(*last_s)];
        }
        span[1] -= FOOT_S;
        if self.found.time_s() >= MAX_S {
            self.found.is_cut = true;
            return;
        }
        if let Some(stretch) = Stretch::of(&self.car, gear, readings, span) {
            self.found.stretches.push(stretch);
        }
    }

    /// Drops what no stretch needs: one that begins has at most a step of old readings.
    fn forget(&mut self) {
        const KEPT: usize = 200;
        let StretchReadings { engine, turbine, output, reported } = &mut self.readings;
        for series in [engine, turbine, output, reported] {
            let from_s = series.time_s.last().map_or(f64::NAN, |last_s| last_s - BEFORE_S);
            // At least half of it goes, so that a fast log is not copied in every row.
            if series.len() > KEPT && series.time_s[series.len() / 2] < from_s {
                *series = series.part([from_s, f64::INFINITY]);
            }
        }
    }
}
