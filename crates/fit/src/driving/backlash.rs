//! The backlash of the driveline, from reversals of its torque in a gear.
//!
//! What the gearbox output turns ahead of the wheels is the twist of the shafts, beyond the backlash on the side to which the torque acts:
//!
//! ```text
//! integral of (w_o/i_df - w_w) = c + e integral of w_w + d w_w + T/K + (b/2) sign(T)
//! ```
//!
//! ([`twist`](super::twist)). `b` is the backlash at the wheels. Times soon after a reversal, in which the teeth are on their way and
//! the shafts oscillate, are left out.

use drivetrain::Real;

use super::twist::{Cell, InputTorque, changes, identified, rests};
use super::{DrivenCar, Driving};
use crate::Verdict;
use crate::verdict::SIDES;

/// Fewest reversals: their scatter is part of the interval.
const REVERSALS: usize = 4;
/// Standard deviation of the stiffness before the fit, as a fraction \[chosen\].
const STIFFNESS: f64 = 0.15;
/// Error of the torque in overrun, as a fraction: the overrun half of a converter's map is rarely measured \[chosen\].
const OVERRUN_FRACTION: f64 = 0.3;
/// Standard deviation of a backlash of which nothing is known but that it is anywhere between 0 and 0.1 rad at the wheels \[chosen\]. The
/// fit itself has none: a mean would pull.
const BEFORE_RAD: f64 = 0.1 / 3.464;
/// Maximum backlash that the error budget of a file may have, rad.
pub(crate) const MAX_RAD: f64 = 0.2;

/// Which drive identifies it.
const BACKLASH_IDENTIFIED_BY: &str = "press and release the accelerator in a gear on a straight road, each for 2 s, with the speed of the driven wheels logged";

/// What was found of the backlash.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BacklashFit {
    /// Backlash at the wheels, rad.
    pub rad: f64,
    /// Its standard deviation as it is stated.
    pub sd_rad: f64,
    /// Reversals of the torque that were fitted.
    pub reversals: usize,
}

impl BacklashFit {
    /// How far the logs identify it.
    pub fn verdict(&self) -> Verdict {
        Verdict::of(self.sd_rad, BEFORE_RAD)
    }

    /// Whether it goes into the file.
    pub(crate) fn is_identifiable(&self) -> bool {
        self.verdict() != Verdict::NotIdentifiable
    }

    /// What it says of itself in the file.
    pub(crate) fn comment(&self) -> String {
        format!(
            "95 % +- {:.4} rad, {} reversals of the torque, {}",
            SIDES * self.sd_rad,
            self.reversals,
            self.verdict().name()
        )
    }

    /// What a fit says of it, or of what the logs lack for it.
    pub(crate) fn statement(found: &Result<Self, String>) -> String {
        match found {
            Ok(found) if found.is_identifiable() => format!(
                "backlash of the driveline: {:.4} rad at the wheels, +- {:.4} rad, from {} reversals of its torque in a gear. The speed of one wheel shows it on \
                 straight roads, that of both driven wheels on all",
                found.rad,
                SIDES * found.sd_rad,
                found.reversals
            ),
            Ok(found) => {
                format!(
                    "backlash of the driveline: not identified, +- {:.3} rad; {BACKLASH_IDENTIFIED_BY}",
                    SIDES * found.sd_rad
                )
            }
            Err(reason) => format!("backlash of the driveline: not identified: {reason}"),
        }
    }
}

/// Whether the torque turns around in a stretch, from rest to rest.
fn has_reversal(cells: &[Cell]) -> bool {
    rests(cells).windows(2).any(|pair| cells[pair[0]].sign() != cells[pair[1]].sign())
}

/// The backlash of a car in the gears of its logs.
///
/// # Errors
/// What the logs lack for it.
pub(crate) fn fit_backlash<'a>(
    car: &DrivenCar,
    logs: impl Iterator<Item = &'a Driving>,
) -> Result<BacklashFit, String> {
    if car.converter.is_none() {
        return Err("the torque of a car without converter is not computed for it".to_owned());
    }
    let mut stretches: Vec<&Vec<Cell>> = Vec::new();
    for stretch in logs.flat_map(|log| &log.twists) {
        // The same drive says what it has to say once.
        if has_reversal(stretch) && !stretches.contains(&stretch) {
            stretches.push(stretch);
        }
    }
    let (changes, reversals) = changes(&stretches, 1, f64::NEG_INFINITY, &InputTorque::OF_FILE);
    if reversals < REVERSALS {
        return Err(format!(
            "{reversals} reversals of the torque in a gear with a wheel speed, {REVERSALS} are needed; {BACKLASH_IDENTIFIED_BY}"
        ));
    }
    let stiffness = car.driveline.shaft_stiffness_n_m_rad;
    let compliance = stiffness.recip();
    let found = identified(&changes, compliance, STIFFNESS);
    let found = found
        .ok_or_else(|| format!("the speeds of output and wheels do not fit together; {BACKLASH_IDENTIFIED_BY}"))?;
    let (rad, sd_rad) = (found.value[3], found.sd[3]);
    if rad > MAX_RAD {
        return Err(format!("it would be {rad:.2} rad at the wheels, and more than {MAX_RAD} rad is none of a car"));
    }
    let torques = stretches.iter().copied().flatten().map(|cell| cell.wheels_n_m);
    let (count, sum) =
        torques.filter(|torque| *torque < 0.0).fold((0.0, 0.0), |(n, sum), torque| (n + 1.0, sum - torque));
    let by_overrun = OVERRUN_FRACTION * sum / f64::max(count, 1.0) / stiffness;
    Ok(BacklashFit { rad: rad.max(0.0), sd_rad: Real::hypot(sd_rad, by_overrun), reversals })
}
