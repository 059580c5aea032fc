//! The shifts of a log with their estimates.
//!
//! The finder of `logs` says when a shift was, [`RecentSamples`] holds the last seconds of estimates, and [`ShiftEstimate`] is what
//! both say about one shift. Pressures and torques are given for the shift that the vehicle file describes; of other shifts only
//! the speeds tell something.

use std::ops::Range;

use car::Vehicle;
use drivetrain::ReducedShift;
use logs::shifts::Held;
use logs::{Direction, Load, Shift, ShiftQuality};
use observer::{ChannelHealth, Channels, Estimate, Health, Input, Phase, Reading};
use trace::Cell;

/// A step of a log with its estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogSample {
    /// Time of the step, s.
    pub time_s: f64,
    /// Engine, turbine and output speed, rad/s, as far as they were read and the observer did not refuse them; else NaN.
    pub speeds_rad_s: [f64; 3],
    /// Command of the oncoming clutch's valve, A or %, likewise.
    pub command: f64,
    /// The readings of the step as they came, refused ones too.
    pub input: Input<f64>,
    /// What it estimates.
    pub estimate: Estimate<f64>,
    /// Measured pressure of the oncoming clutch, Pa.
    pub pressure_pa: Option<Reading<f64>>,
    /// Measured torque of the oncoming clutch, N m.
    pub torque_n_m: Option<Reading<f64>>,
}

impl LogSample {
    /// A step with its estimate, without measured pressure and torque. A reading that the observer refused is none: what is said of a shift
    /// follows from the others.
    pub fn new(time_s: f64, input: &Input<f64>, estimate: Estimate<f64>) -> Self {
        let Channels { engine, turbine, output, command, .. } = estimate.channels;
        let value = |reading: Option<Reading<f64>>, channel: ChannelHealth| match reading {
            Some(reading) if !channel.is_refused() => reading.value,
            _ => f64::NAN,
        };
        let speeds_rad_s =
            [value(input.engine_rad_s, engine), value(input.turbine_rad_s, turbine), value(input.output_rad_s, output)];
        Self {
            time_s,
            speeds_rad_s,
            command: value(input.command, command),
            input: *input,
            estimate,
            pressure_pa: None,
            torque_n_m: None,
        }
    }

    /// Whether there is an estimate: none in a gear that the vehicle file does not describe.
    pub fn is_estimated(&self) -> bool {
        !self.estimate.pressure_pa.is_nan()
    }
}

/// Stands where there is no estimate.
pub fn no_estimate() -> Estimate<f64> {
    Estimate {
        pressure_pa: f64::NAN,
        clutch_torque_n_m: f64::NAN,
        shaft_torque_n_m: None,
        phase: Phase::BeforeShift,
        health: Health::Good,
        channels: Channels::all(ChannelHealth::Absent),
        bounds: None,
    }
}

/// Time before and after a shift that belongs to it, s.
const BEFORE_S: f64 = 0.6;
const AFTER_S: f64 = 0.9;
/// What is held: a shift is known so long after it began, and no observer runs ahead of its log.
const HELD_S: f64 = logs::shifts::LONGEST_S + logs::shifts::SETTLED_S + BEFORE_S + 1.0;
/// No more samples are held, whatever their rate.
const MAX_HELD: usize = 500_000;

/// The last seconds of a log.
#[derive(Debug, Clone)]
pub struct RecentSamples {
    /// In the order of their times, so that a shift's are a slice; those before `first` are no longer held.
    samples: Vec<LogSample>,
    first: usize,
    held: Held,
}

impl Default for RecentSamples {
    fn default() -> Self {
        Self { samples: Vec::new(), first: 0, held: Held::new(HELD_S) }
    }
}

impl RecentSamples {
    /// Takes the next sample.
    pub fn push(&mut self, sample: LogSample) {
        // After a time stamp that was far too late, the time goes back.
        while self.samples.last().is_some_and(|last| last.time_s > sample.time_s) {
            self.samples.pop();
        }
        self.first = self.first.min(self.samples.len());
        self.samples.push(sample);
        let oldest_s = self.held.oldest_s(sample.time_s);
        let is_old = |first: usize| self.samples[first].time_s < oldest_s || self.samples.len() - first > MAX_HELD;
        while self.first < self.samples.len() && is_old(self.first) {
            self.first += 1;
        }
        // A sample is moved at most once for three that are taken.
        if 4 * self.first > 3 * self.samples.len() {
            self.samples.drain(..self.first);
            self.first = 0;
        }
    }

    /// The samples from one time to another, with the one before them.
    pub fn between(&self, [from_s, to_s]: [f64; 2]) -> &[LogSample] {
        let held = &self.samples[self.first..];
        let first = held.partition_point(|sample| sample.time_s < from_s).saturating_sub(1);
        let end = held.partition_point(|sample| sample.time_s <= to_s).max(first);
        &held[first..end]
    }
}

/// A value with its range: of an estimate the mean over a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ranged {
    /// The value.
    pub value: f64,
    /// Lowest and highest, where there is a range.
    pub range: Option<[f64; 2]>,
}

/// Error of an estimate against what was measured: measured minus estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredError {
    /// Measured values.
    pub samples: usize,
    /// Root of the mean square.
    pub rms: f64,
    /// Mean.
    pub mean: f64,
    /// Largest size.
    pub peak: f64,
    /// Fraction of the values within the guaranteed range, 0 to 1, where there is one.
    pub inside: Option<f64>,
}

/// What an observer says about the shift of its vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatedShift {
    /// Torque phase: from the kiss point until the offgoing clutch slips, s; not numbers where the observer did not see the shift, because a speed
    /// did not come or was refused.
    pub torque_phase_s: [f64; 2],
    /// When the oncoming clutch was locked, s; none if it was not seen.
    pub lock_up_s: Option<f64>,
    /// Mean pressure in the inertia phase, Pa.
    pub pressure_pa: Ranged,
    /// Mean clutch torque in the inertia phase, N m.
    pub torque_n_m: Ranged,
    /// Lowest drive-shaft torque of the shift, N m: its tie-up, or the hole in its torque; where the observer estimates it.
    pub min_shaft_n_m: Option<f64>,
    /// Work of friction in the oncoming clutch, J, and what the range of its torque allows.
    pub friction_work_j: Ranged,
    /// Error of the pressure from the torque phase to lock-up, Pa, where it was measured.
    pub pressure_error_pa: Option<MeasuredError>,
    /// The same of the clutch torque, N m.
    pub torque_error_n_m: Option<MeasuredError>,
    /// Fraction of the samples of each health but good, 0 to 1, worst first.
    pub unhealthy: Vec<(Health, f64)>,
}

/// A shift of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftEstimate {
    /// Its place among the shifts of the log, from 1.
    pub number: usize,
    /// What the speeds and gears say.
    pub shift: Shift,
    /// What the observer says; none if it is not the shift of the vehicle file, or the observer did not see it.
    pub estimated: Option<EstimatedShift>,
    /// Whether it is the shift of the vehicle file.
    pub of_vehicle: bool,
    /// The time that belongs to it, s.
    pub window_s: [f64; 2],
    /// Samples in that time that are kept for a figure.
    pub samples: Vec<LogSample>,
}

/// At most so many of these samples: of those that lie together the one with the worst health.
pub fn thinned(samples: &[LogSample], maximum: usize) -> Vec<LogSample> {
    let together = samples.len().div_ceil(maximum.max(1)).max(1);
    let mut kept = Vec::with_capacity(samples.len().div_ceil(together));
    let worst = |samples: &[LogSample]| samples.iter().max_by_key(|sample| sample.estimate.health).copied();
    kept.extend(samples.chunks(together).filter_map(worst));
    kept
}

/// Ratios this close are the same.
const SAME_RATIO: f64 = 0.03;

/// Whether a shift between gears of these ratios, 1st first, is the one of a vehicle file.
pub fn is_of_vehicle(shift: &Shift, ratios: &[f64], vehicle: &Vehicle) -> bool {
    let of = |gear: u32| usize::try_from(gear).ok().and_then(|gear| ratios.get(gear.checked_sub(1)?));
    let same = |ratio: Option<&f64>, own: f64| ratio.is_some_and(|ratio| (ratio / own - 1.0).abs() < SAME_RATIO);
    same(of(shift.from), vehicle.shift.ratio_offgoing()) && same(of(shift.to), vehicle.shift.ratio_oncoming())
}

/// So long before the end of a log a speed must be there again for the speeds to show the new gear, s.
const SHOWS_GEAR_S: f64 = 0.5;

/// The shift of a vehicle file at the end of the samples that its observer has seen after this time, where the speeds do not show it because one of
/// them was lost until the end or shortly before it.
pub fn seen_by_observer_alone(
    recent: &RecentSamples,
    after_s: f64,
    ratios: &[f64],
    vehicle: &Vehicle,
) -> Option<Shift> {
    let samples = recent.between([f64::NEG_INFINITY, f64::INFINITY]);
    let end_s = samples.last()?.time_s;
    samples.iter().rev().take_while(|sample| end_s - sample.time_s <= SHOWS_GEAR_S).find(|sample| is_blind(sample))?;
    let is_in = |sample: &LogSample| sample.estimate.phase == Phase::InertiaPhase;
    let last = samples.iter().rposition(is_in)?;
    let first = last - samples[..last].iter().rev().take_while(|sample| is_in(sample)).count();
    let inertia_s = [samples[first].time_s, samples.get(last + 1).unwrap_or(&samples[last]).time_s];
    let gears = |from, to| Shift {
        from,
        to,
        direction: Direction::Up,
        load: Load::Unknown,
        command_s: None,
        inertia_s: Some(inertia_s),
        gear_s: None,
        quality: ShiftQuality::default(),
    };
    let last_gear = u32::try_from(ratios.len()).ok()?;
    let mut upshifts = (2..=last_gear).map(|to| gears(to - 1, to));
    let shift = upshifts.find(|shift| is_of_vehicle(shift, ratios, vehicle))?;
    (inertia_s[0] > after_s).then_some(shift)
}

impl ShiftEstimate {
    /// A shift of the recent samples; `of_vehicle` as of [`is_of_vehicle`]. It keeps none of them.
    pub fn of(number: usize, shift: Shift, of_vehicle: bool, recent: &RecentSamples, vehicle: &Vehicle) -> Self {
        let around_s = [shift.start_s() - BEFORE_S - logs::shifts::LONGEST_S, shift.end_s() + AFTER_S];
        let around = of_vehicle.then(|| recent.between(around_s));
        let estimated = around.and_then(|samples| EstimatedShift::of(&shift, samples, &vehicle.shift));
        let begin_s = estimated.as_ref().map_or(shift.start_s(), |e| e.torque_phase_s[0].min(shift.start_s()));
        let end_s = estimated.as_ref().and_then(|e| e.lock_up_s).map_or(shift.end_s(), |s| s.max(shift.end_s()));
        let window_s = [begin_s - BEFORE_S, end_s + AFTER_S];
        Self { number, shift, estimated, of_vehicle, window_s, samples: Vec::new() }
    }

    /// The same shift on a clock that began at this time of the log's, s.
    pub fn earlier_by(mut self, origin_s: f64) -> Self {
        self.shift = self.shift.earlier_by(origin_s);
        if let Some(estimated) = &mut self.estimated {
            estimated.torque_phase_s.iter_mut().chain(&mut estimated.lock_up_s).for_each(|time_s| *time_s -= origin_s);
        }
        self.window_s.iter_mut().for_each(|time_s| *time_s -= origin_s);
        self.samples.iter_mut().for_each(|sample| sample.time_s -= origin_s);
        self
    }

    /// When it began, s: with its command, else with the torque phase, else with what the finder saw first.
    pub fn begin_s(&self) -> f64 {
        let torque_phase_s = self.estimated.as_ref().map(|estimated| estimated.torque_phase_s[0]);
        self.shift.command_s.or(torque_phase_s.filter(|time_s| time_s.is_finite())).unwrap_or(self.shift.start_s())
    }

    /// When it was over, s.
    pub fn end_s(&self) -> f64 {
        let lock_up_s = self.estimated.as_ref().and_then(|estimated| estimated.lock_up_s);
        lock_up_s.unwrap_or(self.shift.end_s())
    }
}

/// A column of the table of shifts: its name, and what a shift writes into it. The time before them is the begin of the shift.
type Column = (&'static str, fn(&ShiftEstimate) -> Cell<'static>);

/// The columns of the table of shifts, in SI.
pub const COLUMNS: &[Column] = &[
    ("number", |s| Cell::Whole(s.number as u64)),
    ("from_gear", |s| Cell::Whole(u64::from(s.shift.from))),
    ("to_gear", |s| Cell::Whole(u64::from(s.shift.to))),
    ("load", |s| {
        Cell::Word(match s.shift.load {
            Load::PowerOn => "power_on",
            Load::PowerOff => "power_off",
            Load::Unknown => "unknown",
        })
    }),
    ("of_vehicle", |s| Cell::Word(if s.of_vehicle { "yes" } else { "no" })),
    ("end_s", |s| number(Some(s.end_s()))),
    ("command_s", |s| number(s.shift.command_s)),
    ("gear_signal_s", |s| number(s.shift.gear_s)),
    ("ratio_begin_s", |s| number(s.shift.inertia_s.map(|inertia_s| inertia_s[0]))),
    ("ratio_end_s", |s| number(s.shift.inertia_s.map(|inertia_s| inertia_s[1]))),
    ("torque_phase_begin_s", |s| estimated(s, |e| Some(e.torque_phase_s[0]))),
    ("inertia_phase_begin_s", |s| estimated(s, |e| Some(e.torque_phase_s[1]))),
    ("lock_up_s", |s| estimated(s, |e| e.lock_up_s)),
    ("flare_rad_s", |s| number(s.shift.quality.flare_rad_s)),
    ("jerk_m_s3", |s| number(s.shift.quality.jerk_m_s3)),
    ("oncoming_pressure_mean_pa", |s| estimated(s, |e| Some(e.pressure_pa.value))),
    ("oncoming_pressure_mean_least_pa", |s| estimated(s, |e| e.pressure_pa.end(0))),
    ("oncoming_pressure_mean_greatest_pa", |s| estimated(s, |e| e.pressure_pa.end(1))),
    ("oncoming_torque_mean_n_m", |s| estimated(s, |e| Some(e.torque_n_m.value))),
    ("oncoming_torque_mean_least_n_m", |s| estimated(s, |e| e.torque_n_m.end(0))),
    ("oncoming_torque_mean_greatest_n_m", |s| estimated(s, |e| e.torque_n_m.end(1))),
    ("least_shaft_torque_n_m", |s| estimated(s, |e| e.min_shaft_n_m)),
    ("friction_work_j", |s| estimated(s, |e| Some(e.friction_work_j.value))),
    ("friction_work_least_j", |s| estimated(s, |e| e.friction_work_j.end(0))),
    ("friction_work_greatest_j", |s| estimated(s, |e| e.friction_work_j.end(1))),
    ("pressure_error_rms_pa", |s| estimated(s, |e| Some(e.pressure_error_pa?.rms))),
    ("pressure_error_mean_pa", |s| estimated(s, |e| Some(e.pressure_error_pa?.mean))),
    ("pressure_error_peak_pa", |s| estimated(s, |e| Some(e.pressure_error_pa?.peak))),
    ("pressure_inside_range", |s| estimated(s, |e| e.pressure_error_pa?.inside)),
    ("torque_error_rms_n_m", |s| estimated(s, |e| Some(e.torque_error_n_m?.rms))),
    ("torque_error_mean_n_m", |s| estimated(s, |e| Some(e.torque_error_n_m?.mean))),
    ("torque_error_peak_n_m", |s| estimated(s, |e| Some(e.torque_error_n_m?.peak))),
    ("torque_inside_range", |s| estimated(s, |e| e.torque_error_n_m?.inside)),
    ("good_share", |s| estimated(s, |e| Some(1.0 - e.unhealthy.iter().map(|(_, fraction)| fraction).sum::<f64>()))),
    ("worst_health", |s| {
        let worst = s.estimated.as_ref().map(|e| e.unhealthy.first().map_or(Health::Good, |(health, _)| *health));
        Cell::Word(worst.map_or("", Health::name))
    }),
];

fn number(value: Option<f64>) -> Cell<'static> {
    Cell::Number(trace::rounded(value.unwrap_or(f64::NAN)))
}

fn estimated(shift: &ShiftEstimate, value: fn(&EstimatedShift) -> Option<f64>) -> Cell<'static> {
    number(shift.estimated.as_ref().and_then(value))
}

impl Ranged {
    /// The lower (0) or upper (1) end of its range.
    pub fn end(&self, end: usize) -> Option<f64> {
        self.range.map(|range| range[end])
    }
}

impl EstimatedShift {
    /// None if the observer saw no shift at this time.
    fn of(shift: &Shift, samples: &[LogSample], reduced: &ReducedShift<f64>) -> Option<Self> {
        let phase = |sample: &LogSample| sample.estimate.phase;
        // From the inertia phase back to where the clutch began to carry torque, and on to its lock-up.
        let [inertia_from_s, inertia_to_s] = shift.inertia_s.unwrap_or([shift.start_s(), shift.end_s()]);
        let first = samples.partition_point(|sample| sample.time_s < inertia_from_s);
        let mut of_ratio = samples[first..].iter().take_while(|sample| sample.time_s <= inertia_to_s);
        let Some(within) = of_ratio.position(|sample| phase(sample) == Phase::InertiaPhase) else {
            let last = samples.partition_point(|sample| sample.time_s <= inertia_to_s);
            return Self::unseen(samples, first..last, reduced);
        };
        let within = first + within;
        let begin = samples[..within]
            .iter()
            .rposition(|sample| matches!(phase(sample), Phase::BeforeShift | Phase::AfterShift))
            .map_or(0, |before| before + 1);
        let inertia = begin + samples[begin..].iter().position(|sample| phase(sample) == Phase::InertiaPhase)?;
        let after = |sample: &LogSample| matches!(phase(sample), Phase::AfterShift | Phase::BeforeShift);
        let end = samples[within..].iter().position(after).map_or(samples.len(), |length| within + length);
        let lock_up_s = samples.get(end).filter(|s| phase(s) == Phase::AfterShift).map(|sample| sample.time_s);
        let in_inertia = samples[inertia..end].iter().filter(|sample| phase(sample) == Phase::InertiaPhase);
        // Where a speed did not come, or was refused, the shift may have begun before it was seen.
        let from = begin - samples[..begin].iter().rev().take_while(|sample| is_blind(sample)).count();
        Some(Self {
            torque_phase_s: [samples[begin].time_s, samples[inertia].time_s],
            lock_up_s,
            pressure_pa: mean(in_inertia.clone().map(pressure))?,
            torque_n_m: mean(in_inertia.map(torque))?,
            ..Self::over(samples, from..end, reduced)?
        })
    }

    /// A shift in these samples that the observer did not see, because a speed did not come or was refused; none where most of them came.
    fn unseen(samples: &[LogSample], shift: Range<usize>, reduced: &ReducedShift<f64>) -> Option<Self> {
        let within = samples.get(shift.clone())?;
        if 2 * within.iter().filter(|sample| is_blind(sample)).count() <= within.len() {
            return None;
        }
        let from = shift.start - samples[..shift.start].iter().rev().take_while(|sample| is_blind(sample)).count();
        let to = shift.end + samples[shift.end..].iter().take_while(|sample| is_blind(sample)).count();
        Self::over(samples, from..to, reduced)
    }

    /// What is said of a part of the samples whatever its phases are.
    fn over(samples: &[LogSample], part: Range<usize>, reduced: &ReducedShift<f64>) -> Option<Self> {
        let of_shift = samples.get(part.clone())?;
        let shaft = of_shift.iter().filter_map(|sample| sample.estimate.shaft_torque_n_m);
        let measured = |value: fn(&LogSample) -> Option<Reading<f64>>, estimate: fn(&LogSample) -> Ranged| {
            MeasuredError::of(samples, part.clone(), value, estimate)
        };
        Some(Self {
            torque_phase_s: [f64::NAN; 2],
            lock_up_s: None,
            pressure_pa: mean(of_shift.iter().map(pressure))?,
            torque_n_m: mean(of_shift.iter().map(torque))?,
            min_shaft_n_m: shaft.reduce(f64::min),
            friction_work_j: friction_work(samples, part.clone(), reduced),
            pressure_error_pa: measured(|s| s.pressure_pa, pressure),
            torque_error_n_m: measured(|s| s.torque_n_m, torque),
            unhealthy: unhealthy(of_shift),
        })
    }
}

/// Whether the observer does not see the shift: turbine or output speed did not come for a while, or was refused, or another one that it needs.
fn is_blind(sample: &LogSample) -> bool {
    let Estimate { health, channels: Channels { turbine, output, .. }, .. } = sample.estimate;
    turbine.is_refused() || output.is_refused() || health == Health::SpeedsRejected
}

fn pressure(sample: &LogSample) -> Ranged {
    Ranged { value: sample.estimate.pressure_pa, range: sample.estimate.bounds.map(|bounds| bounds.pressure_pa) }
}

fn torque(sample: &LogSample) -> Ranged {
    let range = sample.estimate.bounds.map(|bounds| bounds.clutch_torque_n_m);
    Ranged { value: sample.estimate.clutch_torque_n_m, range }
}

/// Mean of values and of the ends of their ranges.
fn mean(values: impl Iterator<Item = Ranged>) -> Option<Ranged> {
    let (mut count, mut sum, mut ends) = (0.0, 0.0, Some([0.0; 2]));
    for Ranged { value, range } in values {
        count += 1.0;
        sum += value;
        ends = ends.zip(range).map(|([low, high], range)| [low + range[0], high + range[1]]);
    }
    (count > 0.0).then(|| Ranged { value: sum / count, range: ends.map(|ends| ends.map(|end| end / count)) })
}

/// Torque times slip over time.
fn friction_work(samples: &[LogSample], shift: Range<usize>, reduced: &ReducedShift<f64>) -> Ranged {
    let of = |at: usize| {
        let [turbine, output] = [1, 2].map(|speed| SpeedAt::of(samples, at, speed));
        let slip_rad_s = reduced.oncoming_slip(turbine.rad_s, output.rad_s);
        let slips = turbine.around_rad_s.map(|turbine| output.around_rad_s.map(|o| reduced.oncoming_slip(turbine, o)));
        let Ranged { value, range } = torque(&samples[at]);
        let ends = range.map(|range| {
            let all = slips.iter().flatten().flat_map(|slip| range.map(|n_m| n_m * slip));
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], power| [low.min(power), high.max(power)])
        });
        (samples[at].time_s, Ranged { value: value * slip_rad_s, range: ends })
    };
    let power: Vec<(f64, Ranged)> = shift.map(of).collect();
    let mut work = Ranged { value: 0.0, range: Some([0.0; 2]) };
    for pair in power.windows(2) {
        let ((from_s, from), (to_s, to)) = (pair[0], pair[1]);
        let half_s = 0.5 * (to_s - from_s);
        work.value += half_s * (from.value + to.value);
        work.range = work
            .range
            .zip(from.range.zip(to.range))
            .map(|(work, (from, to))| [work[0] + half_s * (from[0] + to[0]), work[1] + half_s * (from[1] + to[1])]);
    }
    work
}

/// A speed at a sample.
struct SpeedAt {
    /// By the line through the readings around it: a channel may be slower than the steps, and a log may have holes. A reading that stood until
    /// the next one would make a slip that went to zero in a hole last as long as the hole. After the last reading its value; not a number
    /// before the first one.
    rad_s: f64,
    /// Lowest and highest that it can be taken to have been: those readings, where they are further apart than those of a channel.
    around_rad_s: [f64; 2],
}

impl SpeedAt {
    fn of(samples: &[LogSample], at: usize, speed: usize) -> Self {
        /// Readings that are further apart are those at the ends of a hole, s.
        const HOLE_S: f64 = 0.03;
        let reading = |sample: &LogSample| {
            let rad_s = sample.speeds_rad_s[speed];
            (!rad_s.is_nan()).then_some((sample.time_s, rad_s))
        };
        let before = samples[..=at].iter().rev().find_map(reading);
        let Some((before_s, before_rad_s)) = before else {
            return Self { rad_s: f64::NAN, around_rad_s: [f64::NAN; 2] };
        };
        let (after_s, after_rad_s) = samples[at..].iter().find_map(reading).unwrap_or((before_s, before_rad_s));
        let span_s = after_s - before_s;
        let fraction = if span_s > 0.0 { (samples[at].time_s - before_s) / span_s } else { 0.0 };
        let rad_s = before_rad_s + fraction * (after_rad_s - before_rad_s);
        let around_rad_s = if span_s > HOLE_S { [before_rad_s, after_rad_s] } else { [rad_s; 2] };
        Self { rad_s, around_rad_s }
    }
}

impl MeasuredError {
    /// The error in a part of the samples. A measured value is compared with the estimate of its own time, by a line between
    /// the estimates around it; its range is that of the step that brought it.
    fn of(
        samples: &[LogSample],
        part: Range<usize>,
        measured: impl Fn(&LogSample) -> Option<Reading<f64>>,
        estimate: impl Fn(&LogSample) -> Ranged,
    ) -> Option<Self> {
        let (mut count, mut sum, mut squares, mut peak) = (0_u32, 0.0, 0.0, 0.0_f64);
        let (mut inside, mut ranged) = (0_u32, 0_u32);
        for at in part {
            let Some(reading) = measured(&samples[at]) else { continue };
            let time_s = samples[at].time_s - reading.age_s;
            let before = samples[..at].iter().rposition(|sample| sample.time_s <= time_s);
            let now = estimate(&samples[before.map_or(at, |before| before + 1)]).value;
            let value = before.map_or(now, |before| {
                let [from_s, to_s] = [samples[before].time_s, samples[before + 1].time_s];
                let fraction = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
                let from = estimate(&samples[before]).value;
                from + fraction * (now - from)
            });
            let error = reading.value - value;
            count += 1;
            sum += error;
            squares += error * error;
            peak = peak.max(crate::score::size(error));
            if let Some([low, high]) = estimate(&samples[at]).range {
                ranged += 1;
                inside += u32::from((low..=high).contains(&reading.value));
            }
        }
        let all = f64::from(count);
        (count > 0).then(|| Self {
            samples: usize::try_from(count).unwrap_or(usize::MAX),
            rms: (squares / all).sqrt(),
            mean: sum / all,
            peak,
            inside: (ranged > 0).then(|| f64::from(inside) / f64::from(ranged)),
        })
    }
}

fn unhealthy(samples: &[LogSample]) -> Vec<(Health, f64)> {
    let fraction = |health: Health| {
        let fraction = samples.iter().filter(|sample| sample.estimate.health == health).count() as f64
            / samples.len().max(1) as f64;
        (health, fraction)
    };
    Health::ALL.into_iter().skip(1).rev().map(fraction).filter(|(_, fraction)| *fraction > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::VehicleFile;

    const NO_INPUT: Input<f64> = Input::none(0.01);

    #[test]
    fn friction_work_follows_the_line_between_readings() {
        let reduced = ReducedShift {
            mass_kg_m2: [[1.0, 0.0], [0.0, 1.0]],
            slip_offgoing: [1.0, -2.0],
            slip_oncoming: [1.0, -1.0],
        };
        let sample = |at: u32, turbine: Option<f64>, output: Option<f64>| LogSample {
            time_s: 0.01 * f64::from(at),
            speeds_rad_s: [f64::NAN, turbine.unwrap_or(f64::NAN), output.unwrap_or(f64::NAN)],
            command: f64::NAN,
            input: NO_INPUT,
            estimate: Estimate { clutch_torque_n_m: 50.0, ..no_estimate() },
            pressure_pa: None,
            torque_n_m: None,
        };
        let speeds = [(Some(900.0), Some(5.0)), (Some(200.0), None), (None, None), (None, Some(80.0)), (None, None)];
        let samples: Vec<_> = (0..).zip(speeds).map(|(at, (turbine, output))| sample(at, turbine, output)).collect();
        // The turbine stays at its last reading, 200 rad/s; the output is read before the shift and in it: slips of 145, 120 and 120 rad/s at
        // 50 N m, each 10 ms apart.
        let work = friction_work(&samples, 2..5, &reduced);
        assert!((work.value - 50.0 * 0.01 * (0.5 * 145.0 + 120.0 + 0.5 * 120.0)).abs() < 1e-9, "{}", work.value);
        // No reading has come before the shift, nor in it: the slip is not known.
        assert!(friction_work(&samples[2..], 0..1, &reduced).value == 0.0);
        assert!(friction_work(&samples[2..], 0..2, &reduced).value.is_nan());
    }

    /// A log without speeds from 20 ms after the beginning of the inertia phase to after the lock-up: with a last reading that stood until the next
    /// one, the work was twice what it is.
    #[test]
    fn the_slip_in_a_hole_is_between_those_at_its_ends() {
        let reduced = &VehicleFile::built_in().unwrap().shift;
        let slip = |step: u32| 100.0 - 5.0 * f64::from(step.min(20));
        let output_rad_s = 50.0;
        let bounds =
            observer::Bounds { clutch_torque_n_m: [80.0, 130.0], pressure_pa: [0.0; 2], shaft_torque_n_m: None };
        let work = |has_hole: bool| {
            let sample = |step: u32| {
                let is_read = !has_hole || !(2..=20).contains(&step);
                let speed = |rad_s: f64| is_read.then(|| Reading::now(rad_s));
                let turbine_rad_s =
                    speed((slip(step) - reduced.slip_oncoming[1] * output_rad_s) / reduced.slip_oncoming[0]);
                let input = Input { turbine_rad_s, output_rad_s: speed(output_rad_s), ..NO_INPUT };
                let estimate = Estimate { clutch_torque_n_m: 100.0, bounds: Some(bounds), ..no_estimate() };
                LogSample::new(0.01 * f64::from(step), &input, estimate)
            };
            let samples: Vec<LogSample> = (0..30).map(sample).collect();
            friction_work(&samples, 0..22, reduced)
        };
        let (all, hole) = (work(false), work(true));
        assert!((all.value - 1000.0).abs() < 1e-6, "{}", all.value);
        assert!((hole.value - all.value).abs() < 0.05 * all.value, "{} {}", hole.value, all.value);
        let [range, wider] = [all, hole].map(|work| work.range.unwrap());
        assert!((range[0] - 800.0).abs() < 1e-6 && (range[1] - 1300.0).abs() < 1e-6, "{range:?}");
        // Within the hole the slip may have been that of either end.
        assert!(wider[0] < 200.0 && wider[1] > 2200.0, "{wider:?}");
    }

    #[test]
    fn a_refused_reading_does_no_friction_work() {
        let reduced = &VehicleFile::built_in().unwrap().shift;
        let work = |turbine: ChannelHealth, spike: f64| {
            let sample = |step: u32| {
                let reading = |value: f64| Some(Reading::now(value));
                let is_spike = step == 5;
                let mut estimate = Estimate { clutch_torque_n_m: 100.0, pressure_pa: 1e5, ..no_estimate() };
                estimate.channels.turbine = if is_spike { turbine } else { ChannelHealth::Good };
                let input = Input {
                    turbine_rad_s: reading(if is_spike { spike } else { 300.0 }),
                    output_rad_s: reading(50.0),
                    ..NO_INPUT
                };
                LogSample::new(0.01 * f64::from(step), &input, estimate)
            };
            let samples: Vec<LogSample> = (0..10).map(sample).collect();
            friction_work(&samples, 0..10, reduced).value
        };
        let good = work(ChannelHealth::Good, 300.0);
        assert!(good.abs() > 1.0);
        assert_eq!(work(ChannelHealth::Refused, 1e300), good);
        assert_eq!(work(ChannelHealth::Lost, 1e300), good);
        // What is not refused counts.
        assert!(work(ChannelHealth::Good, 1e300).abs() > 1e290);
    }

    #[test]
    fn the_recent_samples_of_a_time_are_those_of_it_and_the_one_before() {
        let mut recent = RecentSamples::default();
        for step in 0..7000 {
            let time_s = 0.01 * f64::from(step);
            recent.push(LogSample::new(time_s, &NO_INPUT, no_estimate()));
            if step % 97 > 0 {
                continue;
            }
            let held: Vec<f64> = recent.samples[recent.first..].iter().map(|sample| sample.time_s).collect();
            for [from_s, to_s] in [[-9.0, -2.0], [-20.0, 0.0], [-0.5, 5.0], [-3.001, -3.0005], [-2.0, -4.0], [1.0, 2.0]]
            {
                let [from_s, to_s] = [time_s + from_s, time_s + to_s];
                let times: Vec<f64> = recent.between([from_s, to_s]).iter().map(|sample| sample.time_s).collect();
                let before = held.iter().rposition(|held_s| *held_s < from_s).unwrap_or(0);
                let expected: Vec<f64> = held[before..].iter().copied().take_while(|held_s| *held_s <= to_s).collect();
                assert_eq!(times, expected, "{from_s} to {to_s} s");
            }
        }
    }
}
