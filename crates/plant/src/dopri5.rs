//! One step of the Dormand-Prince method of order 5 with its dense output.
//!
//! Coefficients: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed.,
//! Springer 1993, table II.5.2 and section II.6. Autonomous form: inputs are constant over a step.

/// A step that was tried.
#[derive(Debug, Clone, Copy)]
pub struct Trial<const N: usize> {
    /// State at the end.
    pub end: [f64; N],
    /// Derivative at the end, which is the first stage of the next step.
    pub end_slope: [f64; N],
    /// Error estimate over the tolerance; the step is good up to 1.
    pub error: f64,
    dense: [[f64; N]; 5],
}

impl<const N: usize> Trial<N> {
    /// State at the fraction `theta` of the step, of order 4.
    #[inline]
    pub fn at(&self, theta: f64) -> [f64; N] {
        let rest = 1.0 - theta;
        let [r1, r2, r3, r4, r5] = &self.dense;
        std::array::from_fn(|i| r1[i] + theta * (r2[i] + rest * (r3[i] + theta * (r4[i] + rest * r5[i]))))
    }
}

/// Tolerances: the error of state `i` is measured against `relative * (scale[i] + |x[i]|)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance<const N: usize> {
    /// Relative tolerance.
    pub relative: f64,
    /// Size of each state below which the tolerance does not shrink further.
    pub scale: [f64; N],
}

/// Tries a step of length `h` from `x`, where `slope = f(x)`.
#[inline]
pub fn step<const N: usize>(
    f: &impl Fn(&[f64; N]) -> [f64; N],
    x: &[f64; N],
    slope: &[f64; N],
    h: f64,
    tolerance: &Tolerance<N>,
) -> Trial<N> {
    let at = |terms: &[(f64, &[f64; N])]| -> [f64; N] {
        let mut y = *x;
        for (weight, k) in terms {
            for i in 0..N {
                y[i] += h * weight * k[i];
            }
        }
        y
    };
    let k1 = slope;
    let k2 = &f(&at(&[(1.0 / 5.0, k1)]));
    let k3 = &f(&at(&[(3.0 / 40.0, k1), (9.0 / 40.0, k2)]));
    let k4 = &f(&at(&[(44.0 / 45.0, k1), (-56.0 / 15.0, k2), (32.0 / 9.0, k3)]));
    let k5 = &f(&at(&[(19372.0 / 6561.0, k1), (-25360.0 / 2187.0, k2), (64448.0 / 6561.0, k3), (-212.0 / 729.0, k4)]));
    let k6 = &f(&at(&[
        (9017.0 / 3168.0, k1),
        (-355.0 / 33.0, k2),
        (46732.0 / 5247.0, k3),
        (49.0 / 176.0, k4),
        (-5103.0 / 18656.0, k5),
    ]));
    let end =
        at(&[(35.0 / 384.0, k1), (500.0 / 1113.0, k3), (125.0 / 192.0, k4), (-2187.0 / 6784.0, k5), (11.0 / 84.0, k6)]);
    let k7 = f(&end);

    let mut sum = 0.0;
    for i in 0..N {
        let difference = h
            * (71.0 / 57600.0 * k1[i] - 71.0 / 16695.0 * k3[i] + 71.0 / 1920.0 * k4[i] - 17253.0 / 339_200.0 * k5[i]
                + 22.0 / 525.0 * k6[i]
                - 1.0 / 40.0 * k7[i]);
        let allowed = tolerance.relative * (tolerance.scale[i] + x[i].abs().max(end[i].abs()));
        sum += (difference / allowed) * (difference / allowed);
    }
    #[expect(clippy::cast_precision_loss, reason = "the number of states is small")]
    let error = (sum / N as f64).sqrt();

    let mut dense = [*x; 5];
    for i in 0..N {
        let change = end[i] - x[i];
        let bend = h * k1[i] - change;
        dense[1][i] = change;
        dense[2][i] = bend;
        dense[3][i] = change - h * k7[i] - bend;
        dense[4][i] = h
            * (-12_715_105_075.0 / 11_282_082_432.0 * k1[i] + 87_487_479_700.0 / 32_700_410_799.0 * k3[i]
                - 10_690_763_975.0 / 1_880_347_072.0 * k4[i]
                + 701_980_252_875.0 / 199_316_789_632.0 * k5[i]
                - 1_453_857_185.0 / 822_651_844.0 * k6[i]
                + 69_997_945.0 / 29_380_423.0 * k7[i]);
    }
    Trial { end, end_slope: k7, error, dense }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn oscillator(x: &[f64; 2]) -> [f64; 2] {
        [x[1], -x[0]]
    }

    /// Error at `t = 2` of the oscillator that starts at (1, 0), and of the dense output in mid-step.
    fn errors(steps: u32) -> (f64, f64) {
        let tolerance = Tolerance { relative: 1.0, scale: [1.0; 2] };
        let h = 2.0 / f64::from(steps);
        let (mut x, mut dense_error) = ([1.0, 0.0], 0.0_f64);
        for n in 0..steps {
            let trial = step(&oscillator, &x, &oscillator(&x), h, &tolerance);
            let middle = h * (f64::from(n) + 0.5);
            dense_error = dense_error.max((trial.at(0.5)[0] - middle.cos()).abs());
            x = trial.end;
        }
        ((x[0] - 2.0_f64.cos()).hypot(x[1] + 2.0_f64.sin()), dense_error)
    }

    #[test]
    fn halving_the_step_shows_order_5_and_dense_order_4() {
        let (coarse, fine) = (errors(20), errors(40));
        let order = |a: f64, b: f64| (a / b).log2();
        assert!((order(coarse.0, fine.0) - 5.0).abs() < 0.2, "{}", order(coarse.0, fine.0));
        // The interpolant's local error is of order 5, as large as the accumulated error of order 4 allows.
        assert!(order(coarse.1, fine.1) > 4.0, "{}", order(coarse.1, fine.1));
    }

    #[test]
    fn the_dense_output_meets_both_ends_of_the_step() {
        let tolerance = Tolerance { relative: 1.0, scale: [1.0; 2] };
        let x = [0.3, -0.8];
        let trial = step(&oscillator, &x, &oscillator(&x), 0.4, &tolerance);
        assert_eq!(trial.at(0.0), x);
        assert!(trial.at(1.0).iter().zip(trial.end).all(|(a, b)| (a - b).abs() < 1e-15));
    }
}
