//! Clutches whose torque in shifts, by the speeds, changes against that of their valve models: worn plates, a leak, another oil.
//!
//! While both clutches of a shift slip, the speeds show the torque of the one that drives the change of speed. Its mean over that of the valve model of the
//! file differs from 1 by friction, gain and kiss point of this car, and stays what it is in shifts between the same gears. From one shift on it does not where something in the gearbox has changed. The
//! quantities of the filter pass the bounds of the error budget later, or not at all: it has learnt the car as it was before.

use car::{Car, ShiftCommand};
use drivetrain::Real;

use super::check::{Check, EndedShift};
use crate::ShiftScoreRow;

/// Rows of a shift that are needed \[chosen\].
const ENOUGH_ROWS: u32 = 8;
/// Torque by the valve model and torque by the speeds from which on they are compared, N m, and largest standard deviation of the estimate over it \[chosen\].
const MIN_N_M: [f64; 2] = [15.0, 8.0];
const MAX_STD_DEV: f64 = 0.3;
/// Shifts before and after a change that are needed \[chosen\].
const BEFORE: usize = 2;
const AFTER: usize = 3;
/// Change of the logarithm of the ratio that is reported: 0.7 times, or 1.43 times \[chosen: a warm-up changes friction by a tenth\].
const CHANGE: f64 = 0.357;
/// Fraction of the shifts on both sides that lie on their side of the middle \[chosen\].
const FRACTION: f64 = 0.8;
/// Shifts of an element that are kept: as many of the first as of the last ones.
const KEPT: usize = 200;
/// Shifts are compared in which the torque by the valve model, or that by the speeds, differs by this factor at most \[chosen\]: an error of the kiss point
/// is one of the pressure, and weighs more in a shift with little torque. A controller may command more where a clutch is weak.
const SIMILAR: f64 = 1.6;
/// Elements from which on a change is taken to be one of the oil.
const MANY: usize = 3;

/// Sums over the rows of a shift, of a clutch, N m.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    rows: u32,
    estimate: f64,
    std_dev: f64,
    valve: f64,
}

/// A shift of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Compared {
    gears: ShiftCommand,
    begin_s: f64,
    /// Logarithms of its torque by the valve model, N m, and of that by the speeds over it.
    valve: f64,
    ratio: f64,
}

impl Compared {
    /// Whether it can be compared with another one.
    fn is_like(&self, other: &Self) -> bool {
        let [valve, speeds] = [self.valve - other.valve, self.valve + self.ratio - other.valve - other.ratio];
        self.gears == other.gears && valve.abs().min(speeds.abs()) <= Real::ln(SIMILAR)
    }
}

/// A change of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Change {
    /// Begin of the first shift after it, s.
    since_s: f64,
    /// Change of the logarithm of the ratio: the median of the shifts after it against those before between the same gears.
    size: f64,
    /// Shifts before and after, between gears that have both.
    shifts: [usize; 2],
    /// Fraction of them that lie on their side of the middle.
    clear: f64,
}

/// What the shifts of a log show of each element.
pub(crate) struct ClutchTorques<'c> {
    car: &'c Car,
    /// By element: the shift that is under way, and those before.
    sums: Vec<Sums>,
    shifts: Vec<Vec<Compared>>,
}

impl<'c> ClutchTorques<'c> {
    pub(super) fn new(car: &'c Car) -> Self {
        let elements = car.gearbox.elements.len();
        Self { car, sums: vec![Sums::default(); elements], shifts: vec![Vec::new(); elements] }
    }

    /// The elements that have changed.
    fn found(&self) -> Vec<(usize, Change)> {
        self.shifts.iter().enumerate().filter_map(|(element, shifts)| Some((element, change(shifts)?))).collect()
    }

    /// Leaves out what the shifts show: another check explains it.
    pub(crate) fn leave_out(&mut self) {
        self.shifts.iter_mut().for_each(Vec::clear);
    }

    /// The changes in one direction, in a sentence.
    fn sentence(&self, found: &[(usize, Change)], falls: bool) -> Option<String> {
        let some: Vec<_> = found.iter().filter(|(_, change)| (change.size < 0.0) == falls).collect();
        let since_s = some.iter().map(|(_, change)| change.since_s).reduce(f64::min)?;
        let each = some.iter().map(|(element, change)| {
            let name = &self.car.gearbox.elements[*element].name;
            let [before, after] = change.shifts;
            format!("{name} {:.0} % of before in {after} shifts (before: {before})", 100.0 * Real::exp(change.size))
        });
        let each = each.collect::<Vec<_>>().join(", ");
        let hint = match (falls, some.len() >= MANY) {
            (_, true) => {
                "check the oil (another fluid, its temperature, air in it), the line pressure and the scale of the commands"
            }
            (true, false) => {
                "check the plates of this clutch (worn, glazed), its piston (leak), its valve and its oil; valves with a longer lag, as by air in the oil, or another clutch that holds without its command have the same effect"
            }
            (false, false) => "check the valve of this clutch, its plates and its oil",
        };
        Some(format!(
            "warning: from {since_s:.1} s on clutches transmit {} torque in shifts than before, by the speeds over the valve model: {each}\nhint: {hint}",
            if falls { "less" } else { "more" }
        ))
    }
}

/// Where the ratio of an element changes most clearly, if it does.
fn change(shifts: &[Compared]) -> Option<Change> {
    let all = (BEFORE..(shifts.len() + 1).saturating_sub(AFTER)).filter_map(|at| change_at(shifts, at));
    all.max_by(|one, other| one.clear.total_cmp(&other.clear).then(one.size.abs().total_cmp(&other.size.abs())))
}

/// The change of the ratio between the shifts up to this place and those from it on.
fn change_at(shifts: &[Compared], at: usize) -> Option<Change> {
    let (before, after) = shifts.split_at(at);
    // By how much each shift is off those before that are like it.
    let off = |some: &[Compared], is_used: &dyn Fn(&Compared) -> bool| -> Vec<f64> {
        let of = |shift: &Compared| {
            let alike: Vec<f64> = before.iter().filter(|other| other.is_like(shift)).map(|other| other.ratio).collect();
            (!alike.is_empty()).then(|| shift.ratio - median(alike))
        };
        some.iter().filter(|shift| is_used(shift)).filter_map(of).collect()
    };
    let comes_after = |shift: &Compared| after.iter().any(|other| other.is_like(shift));
    let (off_before, off_after) = (off(before, &comes_after), off(after, &|_| true));
    if off_before.len() < BEFORE || off_after.len() < AFTER {
        return None;
    }
    let size = median(off_after.clone());
    let is_beyond = |off: &&f64| **off * size.signum() > 0.5 * size.abs();
    let beyond = [&off_before, &off_after].map(|off| off.iter().filter(is_beyond).count());
    let kept = off_before.len() - beyond[0];
    let is_clear = kept as f64 >= FRACTION * off_before.len() as f64
        && beyond[1] as f64 >= FRACTION * off_after.len() as f64
        && size.abs() >= CHANGE;
    is_clear.then(|| Change {
        since_s: after[0].begin_s,
        size,
        shifts: [off_before.len(), off_after.len()],
        clear: (kept + beyond[1]) as f64 / (off_before.len() + off_after.len()) as f64,
    })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + values[middle]) } else { values[middle] }
}

impl Check for ClutchTorques<'_> {
    fn begin(&mut self) {
        self.sums.fill(Sums::default());
    }

    fn shift_row(&mut self, elements: [Option<usize>; 2], row: &ShiftScoreRow) {
        if row.clutches.iter().any(|clutch| clutch.sticks) {
            return;
        }
        for (element, clutch) in elements.into_iter().zip(&row.clutches) {
            let Some(sums) = element.and_then(|element| self.sums.get_mut(element)) else { continue };
            if clutch.hidden || !clutch.has_pressure {
                continue;
            }
            let [_, estimate, valve] = clutch.torque_n_m.map(f64::abs);
            let values = [estimate, valve, clutch.torque_std_dev_n_m];
            if values.iter().all(|value| value.is_finite()) {
                sums.rows += 1;
                sums.estimate += estimate;
                sums.valve += valve;
                sums.std_dev += clutch.torque_std_dev_n_m;
            }
        }
    }

    fn end(&mut self, shift: &EndedShift<'_>) {
        for (Sums { rows, estimate, std_dev, valve }, shifts) in self.sums.iter().copied().zip(&mut self.shifts) {
            let is_shown = rows >= ENOUGH_ROWS
                && valve >= MIN_N_M[0] * f64::from(rows)
                && estimate >= MIN_N_M[1] * f64::from(rows)
                && std_dev <= MAX_STD_DEV * valve;
            if !is_shown || shift.completed.is_none() {
                continue;
            }
            if shifts.len() >= KEPT {
                shifts.remove(KEPT / 2);
            }
            let EndedShift { shift, .. } = shift;
            shifts.push(Compared {
                gears: shift.gears,
                begin_s: shift.time_s[0],
                valve: Real::ln(valve / f64::from(rows)),
                ratio: Real::ln(estimate / valve),
            });
        }
    }

    fn warnings(&self) -> Vec<String> {
        let found = self.found();
        [true, false].into_iter().filter_map(|falls| self.sentence(&found, falls)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shifts between the same gears, every ten seconds.
    fn shifts(ratios: &[f64]) -> Vec<Compared> {
        of_gears(&ratios.iter().map(|ratio| (1, *ratio)).collect::<Vec<_>>())
    }

    /// Shifts from these gears to the next, every ten seconds.
    fn of_gears(shifts: &[(usize, f64)]) -> Vec<Compared> {
        let shift = |(at, (gear, ratio)): (usize, &(usize, f64))| Compared {
            gears: ShiftCommand::between(*gear, gear + 1),
            begin_s: 10.0 * at as f64,
            valve: 3.0,
            ratio: Real::ln(*ratio),
        };
        shifts.iter().enumerate().map(shift).collect()
    }

    #[test]
    fn a_change_that_stays_is_found_where_it_begins() {
        let found = change(&shifts(&[1.0, 1.1, 0.9, 0.5, 0.55, 0.45])).unwrap();
        assert_eq!((found.since_s, found.shifts), (30.0, [3, 3]));
        assert!((Real::exp(found.size) - 0.5).abs() < 1e-9 && found.clear == 1.0);
        let rises = change(&shifts(&[1.0, 0.9, 1.6, 1.5, 1.7, 1.6])).unwrap();
        assert!(rises.size > 0.0 && rises.since_s == 20.0);
        // Each pair of gears against itself.
        let found = change(&of_gears(&[(1, 1.0), (2, 2.0), (1, 0.5), (2, 1.0), (1, 0.5)])).unwrap();
        assert!((Real::exp(found.size) - 0.5).abs() < 1e-9 && found.since_s == 20.0);
    }

    #[test]
    fn a_car_that_differs_from_its_file_and_single_shifts_are_no_change() {
        assert_eq!(change(&shifts(&[0.5; 30])), None);
        assert_eq!(change(&shifts(&[1.0, 1.0, 1.0, 0.5, 1.0, 1.0, 1.0, 0.4, 1.0])), None);
        // Too few, and too small a change.
        assert_eq!(change(&shifts(&[1.0, 1.0, 0.5, 0.5])), None);
        assert_eq!(change(&shifts(&[1.0, 1.0, 1.0, 0.75, 0.75, 0.75])), None);
        assert_eq!(change(&[]), None);
        // An offset of the commands weighs more where little torque is transmitted: upshifts first, then others.
        let others = [(1, 0.9), (2, 0.9), (3, 0.9), (4, 0.9), (5, 0.3), (6, 0.3), (7, 0.3), (8, 0.3)];
        assert_eq!(change(&of_gears(&others)), None);
        // Nor are shifts with another throttle.
        let mut shifts = shifts(&[0.9, 0.9, 0.9, 0.5, 0.5, 0.5]);
        shifts[3..].iter_mut().for_each(|shift| shift.valve = 2.0);
        assert_eq!(change(&shifts), None);
    }
}
