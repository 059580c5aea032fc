//! What goes wrong with readings on their way: lost, repeated, and wrong ones.
//!
//! Each kind of error has random numbers of its own, so that one kind changes neither the noise nor another kind.

use car::ReadingErrors;

use super::{Noise, Readings, Rows};

/// Applies the errors to the readings of the channel called `name`. `outlier` is the size of an outlier, in the unit of
/// the readings.
pub(super) fn disturb(readings: &mut Readings, errors: &ReadingErrors, outlier: f64, name: &str, rows: Rows<'_>) {
    let noise = |kind: &str| Noise::new(rows.seed, &format!("{name}, {kind}"));
    freeze(readings, errors.frozen_s, noise("frozen"), rows);
    lose_by_chance(readings, errors.missing_share, noise("missing"));
    lose_a_burst(readings, errors.burst_s, noise("burst"), rows);
    add_outliers(readings, errors.outliers, outlier, noise("outliers"), rows);
}

/// Begin and end of a time of this length in the shift, s, drawn at random; one that is longer than the shift begins
/// with it.
fn span_in_shift(length_s: f64, mut noise: Noise, rows: Rows<'_>) -> [f64; 2] {
    let [begin_s, end_s] = rows.shift_s;
    let begin_s = begin_s + noise.uniform() * (end_s - begin_s - length_s).max(0.0);
    [begin_s, begin_s + length_s]
}

/// Repeats the last reading before a time in the shift, until that time has passed.
fn freeze(readings: &mut Readings, length_s: f64, noise: Noise, rows: Rows<'_>) {
    if length_s <= 0.0 {
        return;
    }
    let [begin_s, end_s] = span_in_shift(length_s, noise, rows);
    let mut last = None;
    for (value, &at_s) in readings.values.iter_mut().zip(rows.at_s) {
        if (begin_s..end_s).contains(&at_s) {
            // A reading that did not come does not come of it.
            *value = if value.is_nan() { f64::NAN } else { last.unwrap_or(*value) };
        } else if !value.is_nan() {
            last = Some(*value);
        }
    }
}

fn lose_by_chance(readings: &mut Readings, fraction: f64, mut noise: Noise) {
    if fraction <= 0.0 {
        return;
    }
    for at in 0..readings.values.len() {
        if !readings.values[at].is_nan() && noise.uniform() < fraction {
            readings.lose(at);
        }
    }
}

fn lose_a_burst(readings: &mut Readings, length_s: f64, noise: Noise, rows: Rows<'_>) {
    if length_s <= 0.0 {
        return;
    }
    let [begin_s, end_s] = span_in_shift(length_s, noise, rows);
    for (at, at_s) in rows.at_s.iter().enumerate() {
        if (begin_s..end_s).contains(at_s) {
            readings.lose(at);
        }
    }
}

/// Adds the size of an outlier, with a random sign, to this many different readings in the shift.
fn add_outliers(readings: &mut Readings, count: f64, size: f64, mut noise: Noise, rows: Rows<'_>) {
    let [begin_s, end_s] = rows.shift_s;
    let in_shift = |&at: &usize| (begin_s..=end_s).contains(&rows.at_s[at]) && !readings.values[at].is_nan();
    let mut left: Vec<usize> = (0..rows.at_s.len()).filter(in_shift).collect();
    for _ in 0..(count as usize).min(left.len()) {
        let at = left.swap_remove(noise.below(left.len()));
        readings.values[at] += if noise.uniform() < 0.5 { size } else { -size };
    }
}

impl Readings {
    fn lose(&mut self, at: usize) {
        (self.values[at], self.age_s[at]) = (f64::NAN, f64::NAN);
    }
}
