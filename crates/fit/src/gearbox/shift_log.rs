//! What was measured in a shift, and when both of its elements slipped.

use car::Car;
use drivetrain::ShiftKind;
use observer::gearbox::ShiftRow;

use crate::Series;

/// Slip from which on a clutch counts as slipping is this times `sqrt(1 + i^2)`, rad/s: 3.5 standard deviations of a reading of 0.4 rad/s
/// \[chosen: the quantum of 0.7 rad/s of the filter, and some\].
const SLIPS_RAD_S: f64 = 1.5;
/// Readings in a row that may show no slip between others that do: outliers.
const OUTLIERS: usize = 2;
/// Fewest readings, and shortest time, of a slip that is used, s.
const READINGS_MIN: usize = 8;
const SHORTEST_S: f64 = 0.06;
/// Longest time between two readings, s.
const GAP_S: f64 = 0.06;
/// Output speed below which the readings of toothed wheels are too old, rad/s \[chosen, as in the filter\].
const OUTPUT_MIN_RAD_S: f64 = 15.0;

/// A measured shift between two gears.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftLog {
    /// Its gears and when it was commanded, for people.
    pub name: String,
    /// The gears before and after, by their places in the gearbox.
    pub gears: [usize; 2],
    /// Begin and end of the command, s.
    pub command_s: [f64; 2],
    /// Readings of the engine speed, rad/s, at the times that they belong to.
    pub engine: Series,
    /// The same of the turbine speed.
    pub turbine: Series,
    /// The same of the output speed.
    pub output: Series,
    /// Reported engine torque, N m.
    pub engine_torque: Series,
    /// Commands of the offgoing and of the oncoming element, A or %.
    pub commands: [Series; 2],
    /// Measured pressure of the offgoing and of the oncoming element, Pa, where the log has it; that of an element from before and after the shift
    /// too.
    pub pressure: [Series; 2],
    /// When both elements slip, s; found from the readings.
    pub slip_s: [f64; 2],
    /// Whether the lock-up clutch of the converter was applied.
    pub lock_up: bool,
    /// Temperature of the oil, degC, where the log has it.
    pub oil_degc: Option<f64>,
}

/// Which of offgoing and oncoming element transmits torque by its pressure while both slip. A one-way clutch overruns then and transmits none, and so does a
/// clutch or brake behind one that overruns: where the turbine turns slower than in its gear.
pub(crate) fn transmitting(row: &ShiftRow<f64>) -> [bool; 2] {
    let [off, on] = &row.clutches;
    [(off, on), (on, off)].map(|(one, other)| one.has_pressure() && !(one.may_overrun() && other.ratio < one.ratio))
}

/// Whether the fit has a model of a shift: neither of its elements is a dog, and one at least transmits torque by its pressure.
pub(crate) fn is_fitted(row: &ShiftRow<f64>) -> bool {
    transmitting(row).contains(&true) && !row.clutches.iter().any(|clutch| clutch.element.is_dog())
}

impl ShiftLog {
    /// Finds when both elements slip.
    pub(crate) fn find_slip(&mut self, row: &ShiftRow<f64>) -> Result<(), &'static str> {
        let [off, on] = row.clutches.map(|clutch| clutch.ratio);
        let direction = (on - off).signum();
        let slips = |time_s: f64, turbine: f64| {
            let output = self.output.at(time_s);
            let minimum = |ratio: f64| SLIPS_RAD_S * (1.0 + ratio * ratio).sqrt();
            direction * (turbine - off * output) > minimum(off) && direction * (on * output - turbine) > minimum(on)
        };
        // The longest run; single readings off it are outliers.
        let (mut best, mut run): (Option<[usize; 2]>, Option<[usize; 2]>) = (None, None);
        for (i, (time_s, turbine)) in self.turbine.time_s.iter().zip(&self.turbine.value).enumerate() {
            if !slips(*time_s, *turbine) {
                continue;
            }
            let goes_on = run.filter(|[_, last]| i - last <= OUTLIERS + 1);
            run = Some(goes_on.map_or([i, i], |[first, _]| [first, i]));
            let length = |run: Option<[usize; 2]>| run.map_or(0, |[first, last]| last - first + 1);
            if length(run) > length(best) {
                best = run;
            }
        }
        let Some([first, last]) = best.filter(|[first, last]| last - first + 1 >= READINGS_MIN) else {
            return Err("the readings show no time in which both clutches slip");
        };
        let span = [self.turbine.time_s[first], self.turbine.time_s[last]];
        self.slip_s = span;
        if span[1] - span[0] < SHORTEST_S {
            return Err("both clutches slip for too short a time");
        }
        let lasts = |series: &Series| series.longest_gap_s(span) <= GAP_S;
        if !(lasts(&self.turbine) && lasts(&self.output)) {
            return Err("readings of the turbine or output speed are missing while both clutches slip");
        }
        if self.output.between(span).any(|(_, speed)| speed < OUTPUT_MIN_RAD_S) {
            return Err("the car is too slow: readings of toothed wheels are too old");
        }
        let is_commanded = |commands: &Series| commands.time_s.first().is_some_and(|first_s| *first_s < span[0]);
        if !self.transmitted(row).all(is_commanded) {
            return Err("commands of its elements are missing");
        }
        Ok(())
    }

    /// The commands of the elements that transmit torque by their pressure.
    pub(crate) fn transmitted(&self, row: &ShiftRow<f64>) -> impl Iterator<Item = &Series> {
        self.commands.iter().zip(transmitting(row)).filter_map(|(commands, is_used)| is_used.then_some(commands))
    }

    /// Direction, and power by the torque at the input.
    pub(crate) fn kind(&self, car: &Car, input_n_m: f64) -> Option<ShiftKind> {
        let ratio = |gear: usize| car.gearbox.gears.get(gear).map_or(f64::NAN, |gear| gear.ratio);
        ShiftKind::of(input_n_m, ratio(self.gears[0]), ratio(self.gears[1]))
    }
}
