//! Fill time, kiss point, lag and friction of each clutch by gears and temperature of the oil: what a controller adapts.
//!
//! The shifts are divided by their gears and by the temperature of the oil, and each group is fitted by itself, from the same file and with the same
//! driving between shifts. All shifts of a temperature together are one group more. What a fit has found in the channels of all logs holds in
//! each group. Oil that is warmer flows more easily: fill time and lag do not rise with its temperature ([`monotone`]).

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use car::{Car, ShiftClutch};
use drivetrain::Real;
use nalgebra::DMatrix;
use observer::ShiftTables;

use super::clutch::{AtValve, fill_time_s};
use super::command_delay::with_commands_earlier;
use super::contradicted::without_pressures;
use super::fitting::{GearboxFit, Progress, fit_with};
use super::monotone::not_rising;
use super::quantities::{DELAY_UNIT_S, KISS_UNIT_PA, Quantity};
use super::shift_log::{ShiftLog, is_fitted, transmitting};
use super::zero_offset::without_offsets;
use crate::driving::Driving;
use crate::fill::fill_sd;
use crate::verdict::SIDES;
use crate::{FitError, Verdict};

/// Shifts of a group with which its values are checked by each other \[chosen\].
const SHIFTS_WANTED: usize = 5;
/// Shifts between two gears, and of all gears together, that are fitted; more are thinned evenly.
const SHIFTS_MAX: usize = 80;
const ALL_SHIFTS_MAX: usize = 200;
/// Step for the derivatives of a fill time by the unknowns.
const STEP: f64 = 0.02;

/// What is adapted of a clutch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Adapted {
    /// From a step of the command to 150 kPa above the kiss point until the plates touch, s.
    FillTime,
    /// Pressure at which the clutch begins to carry torque, by the gain of the file's valve, Pa.
    KissPoint,
    /// Time constant of the valve at the kiss point, s.
    ValveLag,
    /// Dead time of the valve at the command for the kiss point, s.
    ValveDelay,
    /// Friction times valve gain, as a factor on those of the file.
    Friction,
}

impl Adapted {
    const ALL: [Self; 5] = [Self::FillTime, Self::KissPoint, Self::ValveLag, Self::ValveDelay, Self::Friction];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::FillTime => "fill time",
            Self::KissPoint => "kiss point",
            Self::ValveLag => "valve lag",
            Self::ValveDelay => "valve delay",
            Self::Friction => "friction x valve gain",
        }
    }

    /// The unit of its values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::FillTime | Self::ValveLag | Self::ValveDelay => "s",
            Self::KissPoint => "Pa",
            Self::Friction => "1",
        }
    }

    /// Whether warmer oil does not make it larger.
    fn falls_with_temperature(self) -> bool {
        matches!(self, Self::FillTime | Self::ValveLag)
    }

    /// Which shifts would identify it.
    fn identified_by(self) -> &'static str {
        match self {
            Self::FillTime => "the measured pressure of the clutch, or what identifies its kiss point and its delay",
            Self::KissPoint => "shifts at light throttle and coasting in which it slips",
            Self::ValveLag | Self::ValveDelay => {
                "shifts in which its command changes quickly while both clutches slip, or its measured pressure"
            }
            Self::Friction => "shifts at high throttle in which it drives the change of speed",
        }
    }
}

/// What a clutch does in a shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShiftRole {
    /// It gives up the load.
    Offgoing,
    /// It takes the load.
    Oncoming,
}

impl ShiftRole {
    const BOTH: [Self; 2] = [Self::Offgoing, Self::Oncoming];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Offgoing => "offgoing",
            Self::Oncoming => "oncoming",
        }
    }
}

/// The shifts that a row is of.
#[derive(Debug, Clone, PartialEq)]
pub struct AdaptedShift {
    /// Names of the gears before and after.
    pub gears: [String; 2],
    /// What the clutch does in them.
    pub role: ShiftRole,
}

/// A quantity of a clutch by the shifts of a group.
#[derive(Debug, Clone, PartialEq)]
pub struct Adaptation {
    /// The clutch.
    pub element: String,
    /// The shifts; none for all in which it slips.
    pub shift: Option<AdaptedShift>,
    /// Lowest and highest temperature of the oil in the group, degC; none where the logs have no such channel.
    pub oil_degc: Option<[f64; 2]>,
    /// How many shifts were fitted.
    pub shifts: usize,
    /// The quantity.
    pub quantity: Adapted,
    /// What the shifts show; none without shifts.
    pub found: Option<AdaptedValue>,
    /// What the logs lack for it; empty where they lack nothing.
    pub lacks: String,
}

/// What shifts show of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdaptedValue {
    /// Its value, where physics says so with those at the other temperatures.
    pub value: f64,
    /// Ends of its interval of 95 %.
    pub interval: [f64; 2],
    /// Its value by these shifts alone.
    pub alone: f64,
    /// Standard deviation after the fit over that before.
    pub fraction: f64,
    /// How far these shifts identify it.
    pub verdict: Verdict,
}

impl AdaptedValue {
    /// The same with an interval that is as wide as another one at least.
    fn no_better_than(self, other: &Self) -> Self {
        let [low, high] = other.interval;
        if other.fraction <= self.fraction || high - low <= self.interval[1] - self.interval[0] {
            return self;
        }
        let half = 0.5 * (high - low);
        let interval = [(self.value - half).max(self.interval[0].min(0.0)), self.value + half];
        Self { interval, fraction: other.fraction, verdict: other.verdict, ..self }
    }
}

/// Adaptations of all clutches.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Adaptations {
    /// A row for each clutch, shift, temperature and quantity.
    pub rows: Vec<Adaptation>,
    /// What does not fit together, in sentences.
    pub warnings: Vec<String>,
}

/// Shifts between two gears at a temperature; of all gears without them.
type Group = (Option<i64>, Option<[usize; 2]>);

/// What is fitted, and the fit of all of it.
#[derive(Clone, Copy)]
pub struct Fitted<'a> {
    /// The car of the given file.
    pub car: &'a Car,
    /// Its tables.
    pub tables: &'a ShiftTables<f64>,
    /// Its driving between shifts.
    pub driving: &'a Driving,
    /// The fit.
    pub fit: &'a GearboxFit,
}

/// Fits groups of shifts by gears and temperature of the oil, in steps of `step_k`.
///
/// # Errors
/// The fit was ended from outside.
pub fn adaptations(
    of: Fitted<'_>,
    shifts: &[ShiftLog],
    step_k: f64,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Adaptations, FitError> {
    let mut groups: BTreeMap<Group, Vec<&ShiftLog>> = BTreeMap::new();
    for log in shifts {
        let step = log.oil_degc.map(|degc| (degc / step_k).floor() as i64);
        groups.entry((step, None)).or_default().push(log);
        groups.entry((step, Some(log.gears))).or_default().push(log);
    }
    let steps: Vec<Option<i64>> = groups.keys().filter(|(_, gears)| gears.is_none()).map(|(step, _)| *step).collect();
    for step in steps {
        for gears in of.pairs() {
            groups.entry((step, Some(gears))).or_default();
        }
    }
    let mut rows = Vec::new();
    for ((step, gears), logs) in &groups {
        let oil_degc = step.map(|step| [step, step + 1].map(|end| step_k * end as f64));
        rows.extend(of.group(*gears, oil_degc, logs, progress)?);
    }
    let warnings = monotone(&mut rows);
    Ok(Adaptations { rows, warnings })
}

impl GearboxFit {
    /// The fit of some of the shifts with standard deviations that are at least those of all: shifts of one kind agree with each other, and what the model
    /// leaves out of them shows in those of other kinds alone.
    fn known_no_better_than(mut self, all: &Self) -> Self {
        let factors: Vec<f64> = (self.quantities.all.iter())
            .map(|quantity| match quantity {
                Quantity::Torque(_) | Quantity::Kiss(_) | Quantity::Lag(_) | Quantity::Delay(_) | Quantity::Gain(_) => {
                    (all.sd(*quantity) / self.sd(*quantity)).max(1.0)
                }
                _ => 1.0,
            })
            .collect();
        self.stated =
            DMatrix::from_fn(factors.len(), factors.len(), |i, j| factors[i] * factors[j] * self.stated[(i, j)]);
        self
    }

    /// Shifts with what the fit has found in their channels taken out.
    fn corrected(&self, shifts: &[ShiftLog], tables: &ShiftTables<f64>) -> Vec<ShiftLog> {
        let shifts = self.channels.moved(shifts, tables, 0.0);
        let shifts = with_commands_earlier(&shifts, self.commands_moved_s.unwrap_or(0.0));
        let shifts = without_offsets(&shifts, tables, &self.zero_offsets);
        without_pressures(&shifts, tables, &self.contradicted)
    }
}

impl Fitted<'_> {
    /// Neighbouring gears, up and down, whose shift has a model.
    fn pairs(&self) -> Vec<[usize; 2]> {
        let rows = self.tables.tables();
        let is_used = |gears: &[usize; 2]| rows.shift(gears[0], gears[1]).is_some_and(is_fitted);
        self.car
            .gearbox
            .forward_gears()
            .windows(2)
            .flat_map(|pair| [[pair[0], pair[1]], [pair[1], pair[0]]])
            .filter(is_used)
            .collect()
    }

    /// The rows of a group.
    fn group(
        &self,
        gears: Option<[usize; 2]>,
        oil_degc: Option<[f64; 2]>,
        logs: &[&ShiftLog],
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Vec<Adaptation>, FitError> {
        // Every so many of each pair of gears.
        let mut logs = logs.to_vec();
        logs.sort_by_key(|log| log.gears);
        let some = (if gears.is_some() { SHIFTS_MAX } else { ALL_SHIFTS_MAX }).min(logs.len());
        let logs: Vec<ShiftLog> = (0..some).map(|i| logs[i * logs.len() / some].clone()).collect();
        let logs = self.fit.corrected(&logs, self.tables);
        let fit = match fit_with(self.car, self.tables, &logs, (self.driving, &self.fit.balances), progress) {
            Ok((fit, _)) => Some(fit.known_no_better_than(self.fit)),
            Err(FitError::Stopped) => return Err(FitError::Stopped),
            // Without shifts, or without a minimum.
            Err(_) => None,
        };
        let clutches = match gears {
            Some(gears) => self.clutches_of(gears),
            None => (0..self.fit.quantities.elements.len()).map(|place| (place, None)).collect(),
        };
        let mut rows = Vec::new();
        for (place, shift) in clutches {
            let role = shift.as_ref().map(|shift: &AdaptedShift| shift.role);
            let slipped = logs.iter().filter(|log| self.role_of(log, place).is_some()).count();
            if shift.is_none() && slipped == 0 {
                continue;
            }
            let clutch = self.tables.element_at(place).and_then(|element| self.car.clutches[element].as_ref());
            let of = |fit, clutch| GroupFit { car: self.car, clutch, fit, place };
            let found = fit.as_ref().zip(clutch).map(|(fit, clutch)| of(fit, clutch));
            let of_all = clutch.map(|clutch| of(self.fit, clutch));
            let quantities = Adapted::ALL.into_iter().filter(|quantity| match quantity {
                // A fill is over before an offgoing clutch slips.
                Adapted::FillTime => role != Some(ShiftRole::Offgoing),
                // A valve that fills through an orifice has no time constant.
                Adapted::ValveLag => clutch.is_some_and(|clutch| clutch.valve.maps().is_some()),
                _ => true,
            });
            for quantity in quantities {
                let found = found.as_ref().and_then(|found| found.value(quantity));
                // A fill time follows from several unknowns, each of which is known no better than by all shifts.
                let all = of_all.as_ref().filter(|_| quantity == Adapted::FillTime).and_then(|of| of.value(quantity));
                let found = found.map(|found| all.map_or(found, |all| found.no_better_than(&all)));
                rows.push(Adaptation {
                    element: self.fit.quantities.elements[place].clone(),
                    shift: shift.clone(),
                    oil_degc,
                    shifts: slipped,
                    quantity,
                    lacks: lacks(quantity, found.as_ref(), slipped),
                    found,
                });
            }
        }
        Ok(rows)
    }

    /// The clutches of the shifts between two gears, by their places.
    fn clutches_of(&self, gears: [usize; 2]) -> Vec<(usize, Option<AdaptedShift>)> {
        let Some(row) = self.tables.tables().shift(gears[0], gears[1]).copied() else { return Vec::new() };
        let names = gears.map(|gear| self.car.gearbox.gears[gear].name.clone());
        let both = row.clutches.iter().zip(ShiftRole::BOTH).zip(transmitting(&row));
        both.filter(|(_, is_used)| *is_used)
            .filter_map(|((clutch, role), _)| {
                Some((clutch.element.place()?, Some(AdaptedShift { gears: names.clone(), role })))
            })
            .collect()
    }

    /// What a clutch does in a shift, if it transmits torque in it.
    fn role_of(&self, log: &ShiftLog, place: usize) -> Option<ShiftRole> {
        let row = self.tables.tables().shift(log.gears[0], log.gears[1]).copied()?;
        let at = row.clutches.iter().position(|clutch| clutch.element.place() == Some(place))?;
        transmitting(&row)[at].then_some(ShiftRole::BOTH[at])
    }
}

/// What logs lack for a quantity.
fn lacks(quantity: Adapted, found: Option<&AdaptedValue>, shifts: usize) -> String {
    let more = match shifts {
        0 => Some("a shift that can be fitted".to_owned()),
        shifts if shifts < SHIFTS_WANTED => Some(format!("more shifts: {shifts} of {SHIFTS_WANTED}")),
        _ => None,
    };
    let identified_by = match found {
        Some(found) if found.verdict == Verdict::NotIdentifiable => Some(quantity.identified_by().to_owned()),
        None if shifts > 0 => Some("shifts that the model can follow: the fit of these found no minimum".to_owned()),
        _ => None,
    };
    more.into_iter().chain(identified_by).collect::<Vec<_>>().join("; ")
}

/// The fit of a group, for one of its clutches.
struct GroupFit<'a> {
    car: &'a Car,
    clutch: &'a ShiftClutch,
    fit: &'a GearboxFit,
    place: usize,
}

impl GroupFit<'_> {
    fn value(&self, quantity: Adapted) -> Option<AdaptedValue> {
        let known = self.clutch;
        let kiss_pa = known.clutch.kiss_pressure();
        let lag_s = known.valve.lag(kiss_pa, 0.0);
        let delay_s = known.valve.delay(known.valve.command_for(kiss_pa));
        match quantity {
            Adapted::FillTime => self.fill_time(known),
            Adapted::KissPoint => self.of_unknown(Quantity::Kiss, &|x| kiss_pa + KISS_UNIT_PA * x),
            Adapted::ValveLag => self.of_unknown(Quantity::Lag, &|x| lag_s * Real::exp(x)),
            Adapted::ValveDelay => self.of_unknown(Quantity::Delay, &|x| delay_s + DELAY_UNIT_S * x),
            Adapted::Friction => self.of_unknown(Quantity::Torque, &Real::exp),
        }
    }

    fn of_unknown(&self, quantity: fn(usize) -> Quantity, si: &dyn Fn(f64) -> f64) -> Option<AdaptedValue> {
        let quantity = quantity(self.place);
        let (x, sd) = (self.fit.unknown(quantity), self.fit.sd(quantity));
        let before = self.fit.quantities.sd_before(self.fit.quantities.place(quantity)?);
        Some(AdaptedValue {
            value: si(x),
            interval: [-SIDES, SIDES].map(|sides| si(x + sides * sd)),
            alone: si(x),
            fraction: sd / before,
            verdict: Verdict::of(sd, before),
        })
    }

    /// The time of a fill by the valve, the kiss point and the stroke of the fit.
    fn fill_time(&self, known: &ShiftClutch) -> Option<AdaptedValue> {
        let quantities = [Quantity::Lag, Quantity::Gain, Quantity::Delay, Quantity::Kiss].map(|of| of(self.place));
        let [lag, gain, late, kiss] = quantities.map(|quantity| self.fit.unknown(quantity));
        let at = AtValve { lag, gain, late, kiss };
        let fill = self.fit.fills[self.place];
        let stroke = fill.map_or(1.0, |fill| fill.factor());
        let value = fill_time_s(known, &at, stroke)?;
        let slope = |moved: &AtValve, stroke: f64| {
            fill_time_s(known, moved, stroke).map_or(0.0, |time_s| (time_s - value) / STEP)
        };
        let moved = [
            AtValve { lag: lag + STEP, ..at },
            AtValve { gain: gain + STEP, ..at },
            AtValve { late: late + STEP, ..at },
            AtValve { kiss: kiss + STEP, ..at },
        ];
        let slopes = moved.map(|moved| slope(&moved, stroke));
        let by_stroke = slope(&at, stroke * (1.0 + STEP));
        let stroke_before = known
            .standard_fill_budget(self.car.oil_temperature_degc)
            .map_or(0.0, |budget| fill_sd(&known.cylinder, &budget));
        let stroke_sd = fill.map_or(stroke_before, |fill| fill.sd[0]);
        let places = quantities.map(|quantity| self.fit.quantities.place(quantity));
        let variance = |covariance: &DMatrix<f64>, stroke_sd: f64| {
            let mut sum = Real::powi(by_stroke * stroke_sd, 2);
            for (one, by_one) in places.iter().zip(slopes) {
                for (other, by_other) in places.iter().zip(slopes) {
                    if let (Some(one), Some(other)) = (one, other) {
                        sum += by_one * by_other * covariance[(*one, *other)];
                    }
                }
            }
            sum.max(0.0)
        };
        let sd = variance(&self.fit.stated, stroke_sd).sqrt();
        let before = variance(&self.fit.quantities.before, stroke_before).sqrt();
        Some(AdaptedValue {
            value,
            interval: [(value - SIDES * sd).max(0.0), value + SIDES * sd],
            alone: value,
            // By the slopes here no more is known than before.
            fraction: (sd / before).min(1.0),
            verdict: Verdict::of(sd, before),
        })
    }
}

/// Fill times and lags that do not rise with the temperature of the oil; what contradicts that, in sentences.
fn monotone(rows: &mut [Adaptation]) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut courses: Vec<Vec<usize>> = Vec::new();
    // The rows are in the order of the temperatures.
    for at in 0..rows.len() {
        let row = &rows[at];
        if row.found.is_none() || row.oil_degc.is_none() || !row.quantity.falls_with_temperature() {
            continue;
        }
        let is_same = |course: &&mut Vec<usize>| {
            let other = &rows[course[0]];
            (&other.element, &other.shift, other.quantity) == (&row.element, &row.shift, row.quantity)
        };
        match courses.iter_mut().find(is_same) {
            Some(course) => course.push(at),
            None => courses.push(vec![at]),
        }
    }
    for course in courses.into_iter().filter(|course| course.len() > 1) {
        let found: Vec<(f64, [f64; 2])> =
            course.iter().filter_map(|at| rows[*at].found).map(|found| (found.alone, found.interval)).collect();
        match not_rising(&found) {
            Some(falling) => {
                for (at, (value, interval)) in course.into_iter().zip(falling) {
                    if let Some(found) = &mut rows[at].found {
                        (found.value, found.interval) = (value, interval);
                    }
                }
            }
            None => warnings.push(rising(&rows[course[0]])),
        }
    }
    warnings
}

/// A warning about a quantity that rises with the temperature of the oil.
fn rising(row: &Adaptation) -> String {
    let shift = row.shift.as_ref().map_or_else(|| "all shifts".to_owned(), |shift| shift.gears.join("-"));
    format!(
        "warning: {} of {} in {shift} rises with the oil temperature beyond its intervals: the values of each temperature are kept\n\
         hint: check the channel of the oil temperature, and whether the logs are of one gearbox and one oil",
        row.quantity.name(),
        row.element
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(degc: f64, quantity: Adapted, value: f64, half: f64) -> Adaptation {
        let found = AdaptedValue {
            value,
            interval: [value - half, value + half],
            alone: value,
            fraction: 0.5,
            verdict: Verdict::Partly,
        };
        let gears = ["1", "2"].map(str::to_owned);
        Adaptation {
            element: "E".to_owned(),
            shift: Some(AdaptedShift { gears, role: ShiftRole::Oncoming }),
            oil_degc: Some([degc, degc + 20.0]),
            shifts: 8,
            quantity,
            found: Some(found),
            lacks: String::new(),
        }
    }

    #[test]
    fn what_rises_within_its_intervals_is_levelled_and_what_rises_beyond_them_is_said() {
        let mut rows = vec![
            row(20.0, Adapted::ValveLag, 0.05, 0.01),
            row(20.0, Adapted::Friction, 0.9, 0.01),
            row(80.0, Adapted::ValveLag, 0.055, 0.01),
            row(80.0, Adapted::Friction, 1.1, 0.01),
        ];
        assert_eq!(monotone(&mut rows), [""; 0]);
        let values = rows.iter().map(|row| row.found.unwrap().value).collect::<Vec<_>>();
        // Friction may rise.
        assert!((values[0] - 0.0525).abs() < 1e-12 && values[2] == values[0], "{values:?}");
        assert_eq!([values[1], values[3]], [0.9, 1.1]);
        assert_eq!(rows[2].found.unwrap().alone, 0.055);
        let mut rows = vec![row(20.0, Adapted::FillTime, 0.1, 0.01), row(80.0, Adapted::FillTime, 0.2, 0.01)];
        let warnings = monotone(&mut rows);
        assert!(
            warnings[0]
                .starts_with("warning: fill time of E in 1-2 rises with the oil temperature beyond its intervals")
        );
        assert_eq!(rows[1].found.unwrap().value, 0.2);
    }

    #[test]
    fn what_logs_lack_is_said() {
        let found = row(20.0, Adapted::KissPoint, 1e5, 1e4).found.unwrap();
        let open = AdaptedValue { verdict: Verdict::NotIdentifiable, ..found };
        assert_eq!(lacks(Adapted::KissPoint, Some(&found), 8), "");
        assert_eq!(lacks(Adapted::KissPoint, Some(&found), 2), "more shifts: 2 of 5");
        let both = lacks(Adapted::KissPoint, Some(&open), 2);
        assert_eq!(both, "more shifts: 2 of 5; shifts at light throttle and coasting in which it slips");
        assert_eq!(lacks(Adapted::Friction, None, 0), "a shift that can be fitted");
        assert!(lacks(Adapted::Friction, None, 9).contains("found no minimum"));
    }
}
