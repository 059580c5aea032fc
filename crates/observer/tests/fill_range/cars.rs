//! Cars and the error budgets that hold for them.

use drivetrain::cylinder::PASSAGE;
use drivetrain::{ClutchValve, Passage, Table1, ValveMaps};
use observer::{Budget, FillBudget};

use super::shifts::STEP_S;
use super::{Random, Sampling};

/// A car within its budget.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Car {
    pub(crate) limits: FillBudget<f64>,
    pub(crate) valve: ValveMaps<f64>,
    pub(crate) lag_limits: [f64; 2],
    pub(crate) gain_limits: [f64; 2],
    pub(crate) hysteresis_max_pa: f64,
    pub(crate) command_error_a: f64,
    pub(crate) delay_max_steps: usize,
    // What it is.
    pub(crate) lag_factor: f64,
    pub(crate) gain_factor: f64,
    pub(crate) hysteresis_pa: f64,
    pub(crate) delay_steps: usize,
    /// Readings of the command are all off by this; none if each is off by another error.
    reading_error_a: Option<f64>,
    pub(crate) volume_m3: f64,
    pub(crate) preload_pa: f64,
    pub(crate) kiss_pa: f64,
    pub(crate) apply: Passage<f64>,
    pub(crate) exhaust: Passage<f64>,
    pub(crate) oil_m2_s: f64,
    pub(crate) leak: f64,
    pub(crate) capacity: f64,
}

/// Highest line pressure, Pa.
pub(crate) const LINE_PA: f64 = 1.25e6;

fn around(nominal: f64, fraction: f64) -> [f64; 2] {
    [nominal * (1.0 - fraction), nominal * (1.0 + fraction)]
}

impl Car {
    /// A car somewhere in a budget of this tolerance, often at its ends.
    pub(crate) fn random(random: &mut Random, tolerance: f64) -> Self {
        let passage = |factor: f64| PASSAGE.with_resistance_factor(factor);
        // Oil of 60 and 5 degC.
        let oil_m2_s = if random.chance(0.7) { 18e-6 } else { 164e-6 };
        let apply = around(1.0, 0.3 * tolerance);
        let exhaust = [1.3 * apply[0], 1.6 * apply[1]];
        let limits = FillBudget {
            volume_m3: around(12e-6, 0.25 * tolerance),
            preload_pressure_pa: around(45e3, 0.1 * tolerance),
            kiss_pressure_pa: around(60e3, 0.1 * tolerance),
            supply: apply.map(passage),
            exhaust: exhaust.map(passage),
            viscosity_m2_s: [oil_m2_s; 2],
            flow_max_m3_s: f64::INFINITY,
            leak_m3_s_pa: 4e-12,
            capacity_m3_pa: 5e-12,
        };
        let (lag_limits, gain_limits) = (around(1.0, 0.5 * tolerance), around(1.0, 0.1 * tolerance));
        let (hysteresis_max_pa, delay_max_steps) = (20e3 * tolerance, 20 + (100.0 * tolerance) as usize);
        // All at one end together, those that fill early at one and those that fill late at the other; or each anywhere.
        let together = [Some(0.0), Some(1.0), None, None][random.count(0, 3)];
        let mut pick = |[early, late]: [f64; 2]| {
            let fraction = together.unwrap_or_else(|| [0.0, 1.0, random.fraction()][random.count(0, 2)]);
            early + fraction * (late - early)
        };
        let [low, high] = [0, 1].map(|end| gain_limits[end]);
        Self {
            limits,
            valve: ValveMaps {
                time_constant_s: Table1::new(&[0.0, 5e4, 2e5, 4e5, 1e6], &[0.08, 0.06, 0.05, 0.035, 0.02]).unwrap(),
                gain_pa_a: Table1::new(&[0.0, 0.5, 1.0], &[0.7e6, 1.0e6, 1.1e6]).unwrap(),
                delay_s: Table1::constant(0.01),
            },
            lag_limits,
            gain_limits,
            hysteresis_max_pa,
            command_error_a: 0.01 * tolerance,
            delay_max_steps,
            lag_factor: pick(lag_limits),
            gain_factor: pick([high, low]),
            hysteresis_pa: pick([0.0, hysteresis_max_pa]),
            reading_error_a: together.map(|late| 0.01 * tolerance * (2.0 * late - 1.0)),
            delay_steps: pick([0.0, delay_max_steps as f64]) as usize,
            volume_m3: pick(limits.volume_m3),
            preload_pa: pick(limits.preload_pressure_pa),
            kiss_pa: pick(limits.kiss_pressure_pa),
            apply: passage(pick(apply)),
            exhaust: passage(pick(exhaust)),
            oil_m2_s,
            leak: pick([0.0, limits.leak_m3_s_pa]),
            capacity: pick([0.6 * limits.capacity_m3_pa, limits.capacity_m3_pa]),
        }
    }

    /// Error of a reading of the command, A: one that is too small hides a cylinder that fills early.
    pub(crate) fn reading_error_a(&self, random: &mut Random) -> f64 {
        self.reading_error_a.unwrap_or_else(|| random.within([-1.0, 1.0]) * self.command_error_a)
    }

    /// The budget that it is in.
    pub(crate) fn budget(&self, sampling: Sampling) -> Budget<f64> {
        Budget {
            valve: ClutchValve::Proportional(self.valve),
            lag_factor: self.lag_limits,
            gain_factor: self.gain_limits,
            delay_s: [0.0, self.delay_max_steps as f64 * STEP_S],
            hysteresis_pa: self.hysteresis_max_pa,
            command: self.command_error_a,
            command_age_s: if sampling == Sampling::Asynchronous { 0.05 } else { 0.0 },
            line_pressure_pa: [LINE_PA; 2],
            pressure_max_pa: LINE_PA,
            fill: Some(self.limits),
            friction_factor: [1.0; 2],
            drag_n_m: 0.0,
            slip_rad_s: 0.0,
        }
    }
}
