//! What the readings of a shift show of lag and delay of both valves.
//!
//! Both are constants of a shift, and the filter has no states of them: it goes on with the valve models as they are, and how far
//! its states would be off by an error of the timing is carried beside them (a filter in two stages, after Friedland). With the
//! errors `b` of the timing, each in its deviation, the states are off by `V b`:
//!
//! ```text
//! V+ = F V + G w        w: pressure by the timing, in deviations of the pressure's error `x`
//! S = H V               by so much is a reading off, beside noise of the variance s^2 of its innovation e
//! V+ = V - K S          I+ = I + S S'/s^2,  i+ = i + S e/s^2
//! ```
//!
//! What all readings together say of `b` has the information `I` and the mean `I^-1 i`. In the filter `x` has the errors of lag and
//! delay as before, so a part of what the readings show is its, and less is believed than could be.

use drivetrain::Real;

use super::learnt::{ACTING, Known, STATES_ACTING};
use super::powertrain::{CORE, dot};
use super::shown::{cholesky, lower_inverse};
use super::{LASTING, N, OUTPUT, PRESSURE, TURBINE};

/// Lag and delay of the offgoing, then of the oncoming clutch.
pub(super) const TIMINGS: usize = ACTING - STATES_ACTING;

/// Per deviation of lag and of delay of each clutch.
pub(super) type ByTiming<T> = [[T; 2]; 2];

/// What the readings have shown of the timing since the shift began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Timing<T> {
    /// Errors of the timing that the valve models have taken off, in deviations.
    taken_off: [T; TIMINGS],
    /// By how much each state is off per deviation of each.
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
    pub(super) fn tie(&mut self, ratio: T, share: [T; 2]) {
        let mut output = [T::zero(); TIMINGS];
        add(&mut output, share[0], &self.off[TURBINE]);
        add(&mut output, share[1], &self.off[OUTPUT]);
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

    /// Takes a reading that the timing moves by `seen`, with its innovation and what that moves the states, all in deviations of
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
    /// here one deviation about what the models have taken off.
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
        for k in 0..TIMINGS {
            let a = STATES_ACTING + k;
            off[a][k] = one;
            (before.mean[a], after.mean[a]) = (self.taken_off[k], self.taken_off[k]);
            for b in 0..ACTING {
                (before.covariance[a][b], before.covariance[b][a]) = (zero, zero);
                (after.covariance[a][b], after.covariance[b][a]) = (zero, zero);
            }
            before.covariance[a][a] = one;
        }
        for a in 0..ACTING {
            after.mean[a] = after.mean[a] + dot(&off[a], &mean);
            let with = covariance.each_ref().map(|row| dot(row, &off[a]));
            for b in 0..ACTING {
                after.covariance[a][b] = after.covariance[a][b] + dot(&with, &off[b]);
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
    use super::*;
    use crate::any_shift::covariance::{Gaussian, Measured};

    /// Numbers between -1 and 1 without order.
    fn number(seed: usize) -> f64 {
        (seed as f64 * 12.9898).sin() * 43758.5453 % 1.0
    }

    /// A filter of all states with the timing of one valve as one more of them, straight on.
    struct Whole {
        mean: [f64; N + 1],
        covariance: [[f64; N + 1]; N + 1],
    }

    impl Whole {
        fn new(x: &Gaussian<f64>) -> Self {
            let mut whole = Self { mean: [0.0; N + 1], covariance: [[0.0; N + 1]; N + 1] };
            whole.mean[..N].copy_from_slice(&x.mean);
            for (row, of) in whole.covariance.iter_mut().zip(&x.covariance) {
                row[..N].copy_from_slice(of);
            }
            whole.covariance[N][N] = 1.0;
            whole
        }

        fn carry(&mut self, of: impl Fn(&[f64; N + 1]) -> [f64; N + 1]) {
            self.mean = of(&self.mean);
            self.covariance = self.covariance.each_ref().map(&of);
            let columns: [[f64; N + 1]; N + 1] =
                core::array::from_fn(|j| of(&core::array::from_fn(|i| self.covariance[i][j])));
            self.covariance = core::array::from_fn(|i| core::array::from_fn(|j| columns[j][i]));
        }

        fn correct(&mut self, row: &[f64; N + 1], innovation: f64, noise: f64) {
            let with = self.covariance.each_ref().map(|line| dot(line, row));
            let per = 1.0 / (dot(&with, row) + noise);
            for i in 0..=N {
                self.mean[i] += per * with[i] * innovation;
                for j in 0..=N {
                    self.covariance[i][j] -= per * with[i] * with[j];
                }
            }
        }
    }

    fn with_pressure(row: &[f64; N], by: f64) -> [f64; N + 1] {
        core::array::from_fn(|k| if k < N { row[k] } else { row[PRESSURE[1]] * by })
    }

    /// The oncoming valve's delay: what two stages say of it and of the lasting states is what one filter with it as a state says.
    #[test]
    fn two_stages_are_one_filter_with_the_timing_as_a_state() {
        let mut x = Gaussian::of(core::array::from_fn(number), [1.0; N]);
        x.timing = Timing::nothing([[0.0; 2], [0.0, 0.6]]);
        let mut whole = Whole::new(&x);
        let before = Known { mean: [0.0; ACTING], covariance: core::array::from_fn(|_| [0.5; ACTING]) };
        for step in 0..20 {
            let by = 1.5 * number(step + 7);
            let rows: [[f64; N]; CORE] =
                core::array::from_fn(|i| core::array::from_fn(|j| 0.4 * number(31 * i + j + step)));
            let pressures = [[0.0; 2], [0.0, by]];
            x.timing.add_pressure(&pressures);
            x.pass(&rows, &[0.1; CORE]);
            let row: [f64; N] = core::array::from_fn(|k| number(50 + k + 3 * step));
            let reading = 2.0 * number(step);
            let innovation = reading - x.value(&row);
            let look = x.look(&Measured { row, innovation, noise: 0.3 });
            x.correct(&look);
            x.timing.add_pressure(&pressures.map(|by| by.map(|by| -by)));
            whole.carry(|of| {
                let mut carried = *of;
                (0..CORE).for_each(|i| carried[i] = dot(&with_pressure(&rows[i], by), of));
                carried
            });
            (0..CORE).for_each(|i| whole.mean[i] += 0.1);
            let row = with_pressure(&row, by);
            whole.correct(&row, reading - dot(&row, &whole.mean), 0.3);
            x.fade(PRESSURE[1], 0.9);
            whole.carry(|of| core::array::from_fn(|k| if k == PRESSURE[1] { 0.9 * of[k] } else { of[k] }));
            if step % 7 == 3 {
                x.tie(1.5, [0.3, 0.4]);
                whole.carry(|of| {
                    let (mut tied, output) = (*of, 0.3 * of[TURBINE] + 0.4 * of[OUTPUT]);
                    (tied[TURBINE], tied[OUTPUT]) = (1.5 * output, output);
                    tied
                });
            }
        }
        let mut states = before;
        for (a, i) in LASTING.into_iter().enumerate() {
            states.mean[a] = x.mean[i];
            for (b, j) in LASTING.into_iter().enumerate() {
                states.covariance[a][b] = x.covariance[i][j];
            }
        }
        let (known, shown) = x.timing.together(before, states).unwrap();
        let places: [usize; ACTING] = core::array::from_fn(|a| if a < STATES_ACTING { LASTING[a] } else { N });
        let (delay, taken_off) = (ACTING - 1, 0.6);
        assert_eq!(
            (known.mean[delay], known.covariance[delay][delay], known.covariance[delay][0]),
            (taken_off, 1.0, 0.0)
        );
        let acts = |a: usize| a < STATES_ACTING || a == delay;
        for a in (0..ACTING).filter(|&a| acts(a)) {
            let off = if a == delay { taken_off } else { 0.0 };
            assert!((shown.mean[a] - off - whole.mean[places[a]]).abs() < 1e-9, "{a}");
            for b in (0..ACTING).filter(|&b| acts(b)) {
                let expected = whole.covariance[places[a]][places[b]];
                assert!((shown.covariance[a][b] - expected).abs() < 1e-9, "{a} {b}");
            }
        }
        // The other three did not act.
        assert!((shown.covariance[delay][delay] - 1.0).abs() > 0.1);
        for a in STATES_ACTING..delay {
            assert_eq!((shown.mean[a], shown.covariance[a][a], shown.covariance[a][0]), (0.0, 1.0, 0.0));
        }
    }

    #[test]
    fn what_is_no_number_shows_nothing() {
        let known = Known { mean: [0.0; ACTING], covariance: core::array::from_fn(|_| [0.5; ACTING]) };
        let mut timing = Timing::nothing([[0.0; 2]; 2]);
        assert!(timing.together(known, known).is_some());
        timing.take(&[f64::NAN; TIMINGS], 1.0, &[0.1; N]);
        assert!(timing.together(known, known).is_none());
    }
}
