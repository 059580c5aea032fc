//! Gears and their changes from the ratio of turbine and output speed.

use std::collections::VecDeque;

use drivetrain::Real;

use super::held::Held;
use super::track::Track;
use super::unfit::Unfit;

/// Below this output speed a ratio says nothing, rad/s.
const OUTPUT_MIN_RAD_S: f64 = 8.0;
/// Below this turbine speed a ratio says nothing, rad/s.
const TURBINE_MIN_RAD_S: f64 = 20.0;
/// A ratio is in gear within this part of the way to the next gear.
const BAND: f64 = 0.2;
/// And within this fraction.
const BAND_MAX: f64 = 0.04;
/// A gear counts when the ratio was in it for so long, s, and for so many points.
const IN_GEAR_S: f64 = 0.1;
const IN_GEAR_POINTS: u32 = 5;
/// A change that takes longer is none: a neutral, or a converter in place of a turbine, s.
pub(super) const LONGEST_S: f64 = 3.0;
/// Readings further apart than this are a hole, s: what happens in it is not seen.
const HOLE_S: f64 = 0.3;
/// Without the other one of turbine and output for so long, a reading is one that came alone, s \[chosen\].
const ALONE_S: f64 = 0.1;
/// Points of which the middle one is taken.
const MEDIAN: usize = 5;

/// The middle one of ratios, of which each is a number. Minimum and maximum take no branches, which noise makes hard to predict.
fn middle([a, b, c, d, e]: [f64; MEDIAN]) -> f64 {
    let minimum = |a: f64, b: f64| if a < b { a } else { b };
    let maximum = |a: f64, b: f64| if a > b { a } else { b };
    // Of the maximum of two and two, the less, and of the minimum the greater: neither can be left out. The other two can.
    let (low, high) = (maximum(minimum(a, b), minimum(c, d)), minimum(maximum(a, b), maximum(c, d)));
    maximum(minimum(low, high), minimum(e, maximum(low, high)))
}

/// Ratio of turbine and output at one time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) time_s: f64,
    pub(super) ratio: f64,
    pub(super) output_rad_s: f64,
}

/// Some time in one gear.
#[derive(Debug, Clone, Copy)]
struct InGear {
    gear: usize,
    first_s: f64,
    last_s: f64,
    points: u32,
}

impl InGear {
    fn counts(&self) -> bool {
        self.points >= IN_GEAR_POINTS && self.last_s - self.first_s >= IN_GEAR_S
    }
}

/// A change of the gear.
#[derive(Debug, Clone, Copy)]
pub(super) struct RatioChange {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) inertia_s: [f64; 2],
}

/// Watches the ratio.
pub(super) struct RatioWatch {
    /// Logarithms of the ratios, and the minimum and maximum ratio that is in each gear.
    gears: Vec<(f64, [f64; 2])>,
    turbine: Track,
    /// Output readings for which the turbine speed is still to come.
    outputs: VecDeque<(f64, f64)>,
    /// The newest points before their middle one is taken, each in the place of the oldest, and how many came.
    raw: [Point; MEDIAN],
    raw_count: usize,
    held_outputs: Held,
    held_points: Held,
    points: VecDeque<Point>,
    before: Option<InGear>,
    now: Option<InGear>,
    changes: VecDeque<RatioChange>,
    /// When the newest output reading came, s.
    output_s: f64,
    /// From when until when there was no ratio the last time, s: a sensor failed, and the car drove on.
    without_ratio_s: Option<[f64; 2]>,
    unfit: Unfit,
}

impl RatioWatch {
    pub(super) fn new(ratios: &[f64], held_s: f64) -> Self {
        let logs: Vec<f64> = ratios.iter().map(|ratio| Real::ln(*ratio)).collect();
        let band = |i: usize| {
            let step = |j: usize| logs.get(j).map_or(f64::INFINITY, |other| (other - logs[i]).abs());
            (BAND * step(i.wrapping_sub(1)).min(step(i + 1))).min(BAND_MAX)
        };
        Self {
            gears: (0..logs.len())
                .map(|i| (logs[i], [Real::exp(logs[i] - band(i)), Real::exp(logs[i] + band(i))]))
                .collect(),
            turbine: Track::new(held_s),
            outputs: VecDeque::new(),
            raw: [Point { time_s: f64::NAN, ratio: f64::NAN, output_rad_s: f64::NAN }; MEDIAN],
            raw_count: 0,
            held_outputs: Held::new(held_s),
            held_points: Held::new(held_s),
            points: VecDeque::new(),
            before: None,
            now: None,
            changes: VecDeque::new(),
            output_s: f64::NAN,
            without_ratio_s: None,
            unfit: Unfit::default(),
        }
    }

    /// Forgets what came before, but for what tells that the speeds are in no gear.
    pub(super) fn restart(&mut self, ratios: &[f64], held_s: f64) {
        let unfit = std::mem::take(&mut self.unfit);
        *self = Self { unfit, ..Self::new(ratios, held_s) };
    }

    /// The ratios so far, those in a gear and the others.
    pub(super) fn unfit(&self) -> &Unfit {
        &self.unfit
    }

    pub(super) fn turbine(&mut self, time_s: f64, rad_s: f64) {
        self.turbine.push(time_s, rad_s);
        if time_s - self.output_s > ALONE_S {
            self.goes_on(time_s);
        }
        self.join();
    }

    pub(super) fn output(&mut self, time_s: f64, rad_s: f64) {
        self.output_s = time_s;
        self.outputs.push_back((time_s, rad_s));
        // Without a turbine speed nothing is held for long.
        let oldest_s = self.held_outputs.oldest_s(time_s);
        while self.outputs.front().is_some_and(|(first_s, _)| *first_s < oldest_s) {
            self.outputs.pop_front();
        }
        self.join();
    }

    /// The drive goes on without a ratio: a reading of turbine or output speed was refused, or one of them came alone.
    pub(super) fn goes_on(&mut self, time_s: f64) {
        match &mut self.without_ratio_s {
            Some([_, last_s]) if time_s - *last_s <= HOLE_S => *last_s = last_s.max(time_s),
            without_ratio_s => *without_ratio_s = Some([time_s, time_s]),
        }
    }

    /// Whether what lies between two times is a hole: not where the drive is known to have gone on.
    fn is_hole(&self, from_s: f64, to_s: f64) -> bool {
        let is_bridged = self
            .without_ratio_s
            .is_some_and(|[first_s, last_s]| from_s <= last_s && first_s - from_s <= HOLE_S && to_s - last_s <= HOLE_S);
        to_s - from_s > HOLE_S && !is_bridged
    }

    pub(super) fn next_change(&mut self) -> Option<RatioChange> {
        self.changes.pop_front()
    }

    /// The newest point.
    pub(super) fn newest(&self) -> Option<&Point> {
        self.points.back()
    }

    /// The points from one time to another.
    pub(super) fn between(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &Point> {
        let first = self.points.partition_point(|point| point.time_s < from_s);
        self.points.range(first..).take_while(move |point| point.time_s <= to_s)
    }

    /// Makes points of the output readings that the turbine speed has passed.
    fn join(&mut self) {
        if self.gears.is_empty() {
            self.outputs.clear();
            return;
        }
        while let Some(&(time_s, output_rad_s)) =
            self.outputs.front().filter(|(time_s, _)| *time_s <= self.turbine.newest_s())
        {
            self.outputs.pop_front();
            let turbine_rad_s = self.turbine.at(time_s, HOLE_S);
            if turbine_rad_s.is_none() {
                self.goes_on(time_s);
            }
            let turbine_rad_s = turbine_rad_s.filter(|rad_s| *rad_s > TURBINE_MIN_RAD_S);
            if let Some(turbine_rad_s) = turbine_rad_s.filter(|_| output_rad_s > OUTPUT_MIN_RAD_S) {
                self.raw[self.raw_count % MEDIAN] = Point { time_s, ratio: turbine_rad_s / output_rad_s, output_rad_s };
                self.raw_count += 1;
            } else {
                // Standstill and holes: what is before is not compared with what comes after.
                self.raw_count = 0;
                if self.now.or(self.before).is_none_or(|gear| self.is_hole(gear.last_s, time_s)) {
                    (self.before, self.now) = (None, None);
                }
            }
            if self.raw_count >= MEDIAN {
                let ratio = middle(self.raw.each_ref().map(|point| point.ratio));
                let output_rad_s = middle(self.raw.each_ref().map(|point| point.output_rad_s));
                let Point { time_s, .. } = self.raw[(self.raw_count + MEDIAN / 2) % MEDIAN];
                self.take(Point { time_s, ratio, output_rad_s });
            }
        }
    }

    fn take(&mut self, point: Point) {
        let hole = self.points.back().is_some_and(|last| self.is_hole(last.time_s, point.time_s));
        if hole {
            (self.before, self.now) = (None, None);
        }
        self.points.push_back(point);
        let oldest_s = self.held_points.oldest_s(point.time_s);
        while self.points.front().is_some_and(|first| first.time_s < oldest_s) {
            self.points.pop_front();
        }
        let gear = self.gears.iter().position(|(_, [low, high])| (*low..=*high).contains(&point.ratio));
        self.unfit.push(point.ratio, gear.is_some());
        match (gear, &mut self.now) {
            (Some(gear), Some(now)) if now.gear == gear => {
                let counted = now.counts();
                now.last_s = point.time_s;
                now.points += 1;
                if !counted && now.counts() {
                    self.engaged(gear);
                }
            }
            (Some(gear), _) => {
                self.leave();
                self.now = Some(InGear { gear, first_s: point.time_s, last_s: point.time_s, points: 1 });
            }
            (None, _) => self.leave(),
        }
    }

    /// The ratio left a gear; it is remembered if it was in it for long enough.
    fn leave(&mut self) {
        if let Some(now) = self.now.take().filter(InGear::counts) {
            self.before = Some(now);
        }
    }

    /// The ratio has been in a gear for long enough.
    fn engaged(&mut self, gear: usize) {
        self.unfit.engaged = true;
        let (Some(before), Some(now)) = (self.before, self.now) else { return };
        if before.gear != gear && now.first_s - before.last_s <= LONGEST_S {
            let number = |gear: usize| u32::try_from(gear + 1).unwrap_or(u32::MAX);
            let inertia_s = self.inertia(&before, &now);
            self.changes.push_back(RatioChange { from: number(before.gear), to: number(gear), inertia_s });
        }
    }

    /// Between which times the ratio went from 5 to 95 % of its way, by lines between the points.
    fn inertia(&self, before: &InGear, now: &InGear) -> [f64; 2] {
        let (from, to) = (self.gears[before.gear].0, self.gears[now.gear].0);
        let way = |point: &Point| (Real::ln(point.ratio) - from) / (to - from);
        // Whether a ratio is further on its way than this part of it.
        let beyond = |level: f64| {
            let ratio = Real::exp(from + level * (to - from));
            move |point: &Point| if to > from { point.ratio > ratio } else { point.ratio < ratio }
        };
        let points: Vec<&Point> = self.between(before.last_s - 1.0, now.last_s).collect();
        let is_half = beyond(0.5);
        let half = points.iter().position(|point| is_half(point)).unwrap_or(0);
        let crossing = |pair: &[&Point], level: f64| {
            let [(t0, x0), (t1, x1)] = [pair[0], pair[1]].map(|point| (point.time_s, way(point)));
            if x1 == x0 { t1 } else { t0 + ((level - x0) / (x1 - x0)).clamp(0.0, 1.0) * (t1 - t0) }
        };
        let up = |level: f64| {
            let beyond = beyond(level);
            move |pair: &&[&Point]| !beyond(pair[0]) && beyond(pair[1])
        };
        let first = points[..=half.min(points.len().saturating_sub(1))]
            .windows(2)
            .rev()
            .find(up(0.05))
            .map(|pair| crossing(pair, 0.05));
        let last = points[half.saturating_sub(1).min(points.len())..]
            .windows(2)
            .find(up(0.95))
            .map(|pair| crossing(pair, 0.95));
        [first.unwrap_or(before.last_s), last.unwrap_or(now.first_s)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_five_is_that_of_the_sorted_ones() {
        // All orders of five values, some of them equal.
        for code in 0..5_usize.pow(5) {
            let ratios: [f64; MEDIAN] =
                std::array::from_fn(|i| [0.5, 1.0, 2.5, 4.0, f64::INFINITY][code / 5_usize.pow(i as u32) % 5]);
            let mut sorted = ratios;
            sorted.sort_by(f64::total_cmp);
            assert_eq!(middle(ratios), sorted[MEDIAN / 2], "{ratios:?}");
        }
    }
}
