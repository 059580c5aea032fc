//! What the readings of a shift show of lag and delay of both valves.
//!
//! Both are constants of a shift, and the filter has no states of them: it goes on with the valve models as they are, and how far
//! its states would be off by an error of the timing is carried beside them (a filter in two stages, after Friedland). With the
//! errors `b` of the timing, each in its standard deviation, the states are off by `V b`:
//!
//! ```text
//! V+ = F V + G w        w: pressure by the timing, in standard deviations of the pressure's error `x`
//! S = H V               by so much is a reading off, beside noise of the variance s^2 of its innovation e
//! V+ = V - K S          I+ = I + S S'/s^2,  i+ = i + S e/s^2
//! ```
//!
//! What all readings together say of `b` has the information `I` and the mean `I^-1 i`. In the filter `x` has the errors of lag and
//! delay as before, so a part of what the readings show is its, and less is believed than could be.

use drivetrain::Real;

use super::information::{cholesky, lower_inverse};
use super::learnt::{ACTING, Known, STATES_ACTING};
use super::powertrain::{CORE, dot};
use super::{LASTING, N, OUTPUT, PRESSURE, TURBINE};

/// Lag and delay of the offgoing, then of the oncoming clutch.
pub(super) const TIMINGS: usize = ACTING - STATES_ACTING;

/// Per standard deviation of lag and of delay of each clutch.
pub(super) type ByTiming<T> = [[T; 2]; 2];

/// What the readings have shown of the timing since the shift began.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Timing<T> {
    /// Errors of the timing that the valve models have taken off, in standard deviations.
    taken_off: [T; TIMINGS],
    /// By how much each state is off per standard deviation of each.
    off: [[T; TIMINGS]; N],
    information: [[T; TIMINGS]; TIMINGS],
    /// Information times mean.
    value: [T; TIMINGS],
}

impl<T: Real> Timing<T> {
    /// Nothing is shown yet. The valve models of both clutches have taken off these errors.
    pub(super) fn nothing(taken_off: ByTiming<T>) -> Self {
        let [[a, b], [c, d]] = taken_off;
        let off = [[T::zero(); TIMINGS]; N];
        Self { taken_off: [a, b, c, d], off, information: [[T::zero(); TIMINGS]; TIMINGS], value: [T::zero(); TIMINGS] }
    }

    /// Adds the pressure by the timing to what the states are off by, for as long as the states act.
    pub(super) fn add_pressure(&mut self, by: &ByTiming<T>) {
        let [[off_lag, off_delay], [on_lag, on_delay]] = *by;
        let zero = T::zero();
        add(&mut self.off[PRESSURE[0]], T::one(), &[off_lag, off_delay, zero, zero]);
        add(&mut self.off[PRESSURE[1]], T::one(), &[zero, zero, on_lag, on_delay]);
    }

    /// Carries it on with the first states.
    pub(super) fn pass(&mut self, rows: &[[T; N]; CORE]) {
        let carried = rows.each_ref().map(|row| self.of(row));
        self.off[..CORE].copy_from_slice(&carried);
    }

    /// A state fades by a factor; with zero it is another one.
    pub(super) fn fade(&mut self, state: usize, factor: T) {
        let off = &mut self.off[state.min(N - 1)];
        *off = off.map(|off| factor * off);
    }

    /// Turbine and output speed become one.
    pub(super) fn tie(&mut self, ratio: T, fraction: [T; 2]) {
        let mut output = [T::zero(); TIMINGS];
        add(&mut output, fraction[0], &self.off[TURBINE]);
        add(&mut output, fraction[1], &self.off[OUTPUT]);
        (self.off[TURBINE], self.off[OUTPUT]) = (output.map(|off| ratio * off), output);
    }

    /// By how much a combination of the states is off.
    #[inline]
    pub(super) fn of(&self, row: &[T; N]) -> [T; TIMINGS] {
        let mut sum = [T::zero(); TIMINGS];
        for (per, off) in row.iter().zip(&self.off) {
            add(&mut sum, *per, off);
        }
        sum
    }

    /// Takes a reading that the timing moves by `seen`, with its innovation and what that moves the states, all in standard deviations of
    /// the innovation.
    #[inline]
    pub(super) fn take(&mut self, seen: &[T; TIMINGS], innovation: T, moves: &[T; N]) {
        for (off, moves) in self.off.iter_mut().zip(moves) {
            add(off, -*moves, seen);
        }
        for (sum, of) in self.information.iter_mut().zip(seen) {
            add(sum, *of, seen);
        }
        add(&mut self.value, innovation, seen);
    }

    /// What was known before the shift, and what is known after it, of all that acts in it. `before` and `after` are that of the states with the
    /// timing as the valve models have it. Of the timing it does not matter what is taken to be known before the shift:
    /// here one standard deviation about what the models have taken off.
    pub(super) fn together(&self, mut before: Known<T>, mut after: Known<T>) -> Option<(Known<T>, Known<T>)> {
        let mut precision = self.information;
        for (k, row) in precision.iter_mut().enumerate() {
            row[k] = row[k] + T::one();
        }
        let root = lower_inverse(&cholesky(&precision)?);
        let (zero, one) = (T::zero(), T::one());
        let covariance: [[T; TIMINGS]; TIMINGS] = core::array::from_fn(|a| {
            core::array::from_fn(|b| root.iter().fold(zero, |sum, row| sum + row[a] * row[b]))
        });
        let mean = covariance.each_ref().map(|row| dot(row, &self.value));
        // By how much all that acts is off.
        let mut off = [[zero; TIMINGS]; ACTING];
        for (row, state) in off.iter_mut().zip(LASTING) {
            *row = self.off[state];
        }
        for (k, taken_off) in self.taken_off.into_iter().enumerate() {
            let a = STATES_ACTING + k;
            off[a][k] = one;
            (before.mean[a], after.mean[a]) = (taken_off, taken_off);
            for b in 0..ACTING {
                (before.covariance[a][b], before.covariance[b][a]) = (zero, zero);
                (after.covariance[a][b], after.covariance[b][a]) = (zero, zero);
            }
            before.covariance[a][a] = one;
        }
        for a in 0..ACTING {
            after.mean[a] = after.mean[a] + dot(&off[a], &mean);
            let with = covariance.each_ref().map(|row| dot(row, &off[a]));
            for (value, off) in after.covariance[a].iter_mut().zip(&off) {
                *value = *value + dot(&with, off);
            }
        }
        Some((before, after))
    }
}

/// Adds so many times a row.
#[inline]
fn add<T: Real>(to: &mut [T; TIMINGS], times: T, row: &[T; TIMINGS]) {
    for (to, x) in to.iter_mut().zip(row) {
        *to = *to + times * *x;
    }
}

#[cfg(test)]
mod tests {
    use super::super::covariance::{Gaussian, Measured};
    use super::super::{FRICTION, KISS};
    use super::*;

    /// Numbers between -1 and 1 without order.
    fn number(seed: usize) -> f64 {
        (seed as f64 * 12.9898).sin() * 43758.5453 % 1.0
    }

    const ALL: usize = N + TIMINGS;
    type Full = [[f64; ALL]; ALL];

    fn product(a: &Full, b: &Full) -> Full {
        core::array::from_fn(|i| core::array::from_fn(|j| (0..ALL).map(|k| a[i][k] * b[k][j]).sum()))
    }

    fn turned(a: &Full) -> Full {
        core::array::from_fn(|i| core::array::from_fn(|j| a[j][i]))
    }

    /// A Kalman filter with the timing as four more states.
    struct Whole {
        mean: [f64; ALL],
        covariance: Full,
    }

    impl Whole {
        fn pass(&mut self, rows: &[[f64; N]; CORE], by: &ByTiming<f64>) {
            let mut f: Full = core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j))));
            for (f, row) in f.iter_mut().zip(rows) {
                f[..N].copy_from_slice(row);
                for (k, by) in by.iter().flatten().enumerate() {
                    f[N + k] = row[PRESSURE[k / 2]] * by;
                }
            }
            self.mean = core::array::from_fn(|i| (0..ALL).map(|k| f[i][k] * self.mean[k]).sum());
            self.covariance = product(&product(&f, &self.covariance), &turned(&f));
        }

        fn correct(&mut self, row: &[f64; N], by: &ByTiming<f64>, value: f64, noise: f64) {
            let mut h = [0.0; ALL];
            h[..N].copy_from_slice(row);
            for (k, by) in by.iter().flatten().enumerate() {
                h[N + k] = row[PRESSURE[k / 2]] * by;
            }
            let with = self.covariance.map(|line| dot(&line, &h));
            let variance = dot(&with, &h) + noise;
            let innovation = value - dot(&h, &self.mean);
            for i in 0..ALL {
                self.mean[i] += with[i] / variance * innovation;
                for j in 0..ALL {
                    self.covariance[i][j] -= with[i] * with[j] / variance;
                }
            }
        }
    }

    /// Friedland's filter in two stages has the result of the filter with the timing among its states.
    #[test]
    fn two_stages_are_the_filter_with_lag_and_delay_as_states() {
        let start: [f64; N] = core::array::from_fn(|k| 0.3 * number(k + 1));
        let mut x = Gaussian::of(start, core::array::from_fn(|k| 0.5 + 0.3 * number(k + 40).abs()));
        let mut whole = Whole { mean: [0.0; ALL], covariance: [[0.0; ALL]; ALL] };
        whole.mean[..N].copy_from_slice(&x.mean);
        for k in 0..ALL {
            whole.covariance[k][k] = if k < N { x.covariance[k][k] } else { 1.0 };
        }
        for step in 0..40 {
            let seed = 1000 * step + 100;
            let rows: [[f64; N]; CORE] = core::array::from_fn(|i| {
                core::array::from_fn(|j| f64::from(u8::from(i == j)) + 0.2 * number(seed + 20 * i + j))
            });
            let by: ByTiming<f64> =
                core::array::from_fn(|c| core::array::from_fn(|k| 2.0 * number(seed + 90 + 2 * c + k)));
            let back = by.map(|by| by.map(|by| -by));
            x.timing.add_pressure(&by);
            x.pass(&rows, &[0.0; CORE]);
            x.timing.add_pressure(&back);
            whole.pass(&rows, &by);
            let row: [f64; N] = core::array::from_fn(|k| number(seed + 300 + k));
            let (value, noise) = (number(seed + 400), 0.3);
            x.timing.add_pressure(&by);
            let innovation = x.innovation(&Measured { row, innovation: value - dot(&row, &x.mean), noise });
            x.correct(&innovation);
            x.timing.add_pressure(&back);
            whole.correct(&row, &by, value, noise);
        }
        let mut states = Known { mean: [0.0; ACTING], covariance: [[0.0; ACTING]; ACTING] };
        for (a, i) in LASTING.into_iter().enumerate() {
            states.mean[a] = x.mean[i];
            for (b, j) in LASTING.into_iter().enumerate() {
                states.covariance[a][b] = x.covariance[i][j];
            }
        }
        let (before, after) = x.timing.together(states, states).unwrap();
        let place = |a: usize| LASTING.get(a).copied().unwrap_or(N + a - STATES_ACTING);
        for a in 0..ACTING {
            assert!((after.mean[a] - whole.mean[place(a)]).abs() < 1e-9, "{a}");
            for b in 0..ACTING {
                let error = after.covariance[a][b] - whole.covariance[place(a)][place(b)];
                assert!(error.abs() < 1e-9, "{a} {b}: {error}");
            }
        }
        assert!((STATES_ACTING..ACTING).all(|a| before.covariance[a][a] == 1.0 && after.covariance[a][a] < 0.9));
        assert_eq!((place(0), place(3)), (FRICTION[0], KISS[1]));
    }

    #[test]
    fn what_is_no_number_shows_nothing() {
        let known = Known { mean: [0.0; ACTING], covariance: [[0.0; ACTING]; ACTING] };
        let mut timing = Timing::nothing([[0.5, 0.0], [0.0, -0.5]]);
        let (_, after) = timing.together(known, known).unwrap();
        assert_eq!(after.mean[STATES_ACTING..], [0.5, 0.0, 0.0, -0.5], "what the valve models have taken off");
        timing.take(&[f64::NAN, 0.0, 0.0, 0.0], 1.0, &[0.0; N]);
        assert!(timing.together(known, known).is_none());
    }
}
