//! The covariance of the states and of the speeds at earlier times.

use drivetrain::Real;

use super::past::{CLONES, PASTS, SPEEDS};
use super::powertrain::{COLUMNS, LAWS};
use super::{GAIN, N, OFFGOING, PRESSURE, SHARE};

/// Covariance of the states, of the speeds at earlier times with the states, and of those speeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Covariance<T> {
    pub(super) states: [[T; N]; N],
    pub(super) across: [[T; N]; CLONES],
    pub(super) within: [[T; CLONES]; CLONES],
}

/// A scalar measurement: covariance of the states and of the earlier speeds with it, and its variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured<T> {
    pub(super) states: [T; N],
    pub(super) earlier: [T; CLONES],
    pub(super) variance: T,
}

/// Which of the remembered speeds is the speed `k` at the earlier time `n`.
#[inline]
fn clone_of(k: usize, n: usize) -> usize {
    (SPEEDS * n + k).min(CLONES - 1)
}

impl<T: Real> Covariance<T> {
    /// Independent states with these standard deviations, without a past.
    pub(super) fn of(deviations: [T; N]) -> Self {
        let mut states = [[T::zero(); N]; N];
        for (i, deviation) in deviations.into_iter().enumerate() {
            states[i][i] = deviation * deviation;
        }
        Self { states, across: [[T::zero(); N]; CLONES], within: [[T::zero(); CLONES]; CLONES] }
    }

    /// A past of these ages: the speeds were as uncertain as now, and have changed by accelerations with these variances.
    pub(super) fn steady_past(&mut self, ages: [T; PASTS], acceleration_variances: [T; SPEEDS]) {
        for (m, across) in self.across.iter_mut().enumerate() {
            *across = self.states[m % SPEEDS];
        }
        for (m, row) in self.within.iter_mut().enumerate() {
            let (age_s, k) = (ages[m / SPEEDS], m % SPEEDS);
            for (l, value) in row.iter_mut().enumerate() {
                let same = if l % SPEEDS == k { acceleration_variances[k] } else { T::zero() };
                *value = self.states[k][l % SPEEDS] + same * age_s * ages[l / SPEEDS];
            }
        }
    }

    /// The speeds of now become the newest of the past.
    #[inline]
    pub(super) fn remember(&mut self) {
        for m in (SPEEDS..CLONES).rev() {
            for l in (SPEEDS..CLONES).rev() {
                self.within[m][l] = self.within[m - SPEEDS][l - SPEEDS];
            }
        }
        for k in 0..SPEEDS {
            for l in SPEEDS..CLONES {
                let value = self.across[l - SPEEDS][k];
                self.within[k][l] = value;
                self.within[l][k] = value;
            }
            for l in 0..SPEEDS {
                self.within[k][l] = self.states[k][l];
            }
        }
        self.across.copy_within(..CLONES - SPEEDS, SPEEDS);
        self.across[..SPEEDS].copy_from_slice(&self.states[..SPEEDS]);
    }

    /// Covariances of the speed `k` at a point in time, counted from 0 for now, with all states.
    #[inline]
    pub(super) fn of_speed(&self, k: usize, point: usize) -> &[T; N] {
        match point.checked_sub(1) {
            None => &self.states[k],
            Some(n) => &self.across[clone_of(k, n)],
        }
    }

    /// The same with the remembered speeds.
    #[inline]
    pub(super) fn of_speed_with_past(&self, k: usize, point: usize) -> [T; CLONES] {
        match point.checked_sub(1) {
            None => core::array::from_fn(|m| self.across[m][k]),
            Some(n) => self.within[clone_of(k, n)],
        }
    }

    /// `P = F P F'`: the first states have a full row each over the first columns, two others fade, the rest stands.
    #[inline]
    pub(super) fn spread(&mut self, f: &[[T; COLUMNS]; LAWS], stay: T, keep: T) {
        let p = &mut self.states;
        let mut fp = [[T::zero(); N]; LAWS];
        for (i, row) in f.iter().enumerate() {
            if i == PRESSURE {
                for j in 0..N {
                    fp[i][j] = row[PRESSURE] * p[PRESSURE][j] + row[GAIN] * p[GAIN][j];
                }
                continue;
            }
            for (c, weight) in row.iter().enumerate() {
                for j in 0..N {
                    fp[i][j] = fp[i][j] + *weight * p[c][j];
                }
            }
        }
        for across in &mut self.across {
            let before = *across;
            for (value, row) in across.iter_mut().zip(f) {
                *value = row.iter().zip(&before).fold(T::zero(), |sum, (weight, p)| sum + *weight * *p);
            }
            across[SHARE] = stay * before[SHARE];
            across[OFFGOING] = keep * before[OFFGOING];
        }
        // The states without a law of their own, among each other.
        for (fading, left) in [(SHARE, stay), (OFFGOING, keep)] {
            for row in p.iter_mut().skip(LAWS) {
                row[fading] = left * row[fading];
            }
            for x in p[fading].iter_mut().skip(LAWS) {
                *x = left * *x;
            }
        }
        for i in 0..LAWS {
            for j in i..LAWS {
                let value = if j == PRESSURE {
                    fp[i][PRESSURE] * f[j][PRESSURE] + fp[i][GAIN] * f[j][GAIN]
                } else {
                    (0..COLUMNS).fold(T::zero(), |sum, c| sum + fp[i][c] * f[j][c])
                };
                p[i][j] = value;
                p[j][i] = value;
            }
            for j in LAWS..N {
                let value = match j {
                    SHARE => stay * fp[i][j],
                    OFFGOING => keep * fp[i][j],
                    _ => fp[i][j],
                };
                p[i][j] = value;
                p[j][i] = value;
            }
        }
    }

    /// Adds to the variance of a state.
    #[inline]
    pub(super) fn add(&mut self, state: usize, variance: T) {
        self.states[state][state] = self.states[state][state] + variance;
    }

    /// Keeps the variance of a state from falling below a limit.
    #[inline]
    pub(super) fn hold_above(&mut self, state: usize, variance: T) {
        let own = &mut self.states[state][state];
        *own = own.max(variance);
    }

    /// Makes a state independent of all others, with this standard deviation.
    pub(super) fn renew(&mut self, state: usize, deviation: T) {
        for i in 0..N {
            self.states[i][state] = T::zero();
            self.states[state][i] = T::zero();
        }
        for across in &mut self.across {
            across[state] = T::zero();
        }
        self.states[state][state] = deviation * deviation;
    }

    /// Corrects for a measurement by Joseph's form, which holds for any gain: `P - K S' - S K' + K V K'`. Of the best gain
    /// each state gets a share; with none its uncertainty is accounted for and stays.
    #[inline]
    pub(super) fn correct(&mut self, measured: &Measured<T>, shares: &[T; N]) -> ([T; N], [T; CLONES]) {
        let per_variance = measured.variance.recip();
        let gain: [T; N] = core::array::from_fn(|i| shares[i] * measured.states[i] * per_variance);
        let earlier = measured.earlier.map(|with| with * per_variance);
        let half_variance = T::of(0.5) * measured.variance;
        // K w' + w K' with w = K V/2 - S.
        let weight: [T; N] = core::array::from_fn(|i| half_variance * gain[i] - measured.states[i]);
        let earlier_weight: [T; CLONES] = core::array::from_fn(|m| half_variance * earlier[m] - measured.earlier[m]);
        // Whole rows: both halves come out the same, and the processor does several columns at once.
        for i in 0..N {
            let (g, w) = (gain[i], weight[i]);
            for ((p, gain), weight) in self.states[i].iter_mut().zip(&gain).zip(&weight) {
                *p = *p + (g * *weight + w * *gain);
            }
        }
        for l in 0..CLONES {
            let (g, w) = (earlier[l], earlier_weight[l]);
            for ((p, gain), weight) in self.across[l].iter_mut().zip(&gain).zip(&weight) {
                *p = *p + (g * *weight + w * *gain);
            }
            for ((p, earlier), weight) in self.within[l].iter_mut().zip(&earlier).zip(&earlier_weight) {
                *p = *p + (g * *weight + w * *earlier);
            }
        }
        (gain, earlier)
    }

    /// The covariance of some states.
    pub(super) fn block<const K: usize>(&self, states: [usize; K]) -> [[T; K]; K] {
        states.map(|i| states.map(|j| self.states[i][j]))
    }

    /// Whether all of it are numbers, and no variance is negative.
    #[inline]
    pub(super) fn is_sound(&self) -> bool {
        self.states.iter().enumerate().all(|(i, row)| row[i] >= T::zero() && row[i].is_finite())
    }
}
