//! The channel of the wheel speed and the stiffness of the drive shafts, from driving in a gear with the engine pulling.
//!
//! The unknowns are those of [`twist`](super::twist), with the backlash as one that is in the way. Changes are half a second long: in a shorter one the noise
//! of the torque is as large as its change, and the shafts would seem too stiff (errors in variables).

use drivetrain::Real;

use super::known::{Known, MIN_SCALE, change_of_delay, said_of_delay};
use super::twist::{Cell, DELAY_S, InputTorque, SCALE, changes, identified};
use super::{DrivenCar, Driving};
use crate::verdict::SIDES;
use crate::{MapChange, MapKey, Verdict};

/// Cells of a change: 0.5 s.
const APART: usize = 5;
/// Minimum time of driving, s, and fewest stretches: their scatter is part of the intervals.
const TIME_S: f64 = 20.0;
const GROUPS: usize = 4;
/// Speed of the gearbox output below which the readings of toothed wheels are too old, rad/s \[chosen, as in the filter\].
const OUTPUT_MIN_RAD_S: f64 = 15.0;
/// Minimum standard deviations that are stated, as in the one-shift fit: of scale, delay, s, and stiffness.
const FLOORS: [f64; 3] = [1e-4, 0.3e-3, 0.015];

/// The signal in a channel map.
const SIGNAL: &str = "wheel_speed";
/// Which drive identifies it.
const WHEEL_IDENTIFIED_BY: &str =
    "press and release the accelerator in a gear on a straight road, with the speed of the driven wheels logged";
const STIFFNESS_IDENTIFIED_BY: &str =
    "press and release the accelerator in a low gear, each for 2 s and by different amounts, some twenty times";

/// What was found of the wheel speed and the drive shafts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelFit {
    /// What the readings of the wheel speed have to be multiplied with, less 1.
    pub scale: Known,
    /// By how much they are late against those of the output speed, s.
    pub late_s: Known,
    /// Logarithm of the factor on the stiffness of the shafts of the file.
    pub stiffness: Known,
    /// Time of driving that was used, s.
    pub time_s: f64,
}

impl WheelFit {
    /// Whether the stiffness goes into the file.
    pub(crate) fn tells_stiffness(&self) -> bool {
        self.stiffness.verdict() != Verdict::NotIdentifiable
    }

    /// Factor on the stiffness of the file.
    pub(crate) fn stiffness_factor(&self) -> f64 {
        Real::exp(self.stiffness.value)
    }

    /// What a fit says of it: what belongs into the channel map, and the stiffness. `output_late_s` is by how much the output speed is late.
    pub(crate) fn statements(found: &Result<Self, String>, output_late_s: Option<Known>) -> Vec<String> {
        match found {
            Ok(found) => {
                vec![found.said_of_scale(), found.said_of_delay(output_late_s), found.said_of_stiffness()]
            }
            Err(reason) => vec![format!("wheel speed and drive shafts: not identified: {reason}")],
        }
    }

    fn said_of_scale(&self) -> String {
        let Known { value, sd, .. } = self.scale;
        let half = SIDES * sd;
        let found = format!(
            "wheel_speed x {:.4} +- {half:.4} is the output speed over the final ratio ({:.0} s in gear)",
            1.0 + value,
            self.time_s
        );
        if self.scale.verdict() == Verdict::NotIdentifiable {
            return format!("{found}: its scale is not identified by these logs; {WHEEL_IDENTIFIED_BY}");
        }
        let Some(change) = self.change_of_scale() else {
            return format!("{found}: its scale and the final ratio fit together");
        };
        format!(
            "{found}: {}, or the final ratio of the vehicle file is wrong. For a wheel speed in km/h it may be the wheel radius: the speeds show only \
             the product",
            change.instruction()
        )
    }

    fn said_of_delay(&self, output_late_s: Option<Known>) -> String {
        let change = self.change_of_delay(output_late_s);
        said_of_delay(SIGNAL, "the output speed", &self.late_s, change.as_ref(), WHEEL_IDENTIFIED_BY)
    }

    /// What belongs into the channel map. `output_late_s` is by how much the output speed is late.
    pub(crate) fn changes(&self, output_late_s: Option<Known>) -> impl Iterator<Item = MapChange> {
        self.change_of_scale().into_iter().chain(self.change_of_delay(output_late_s))
    }

    fn change_of_scale(&self) -> Option<MapChange> {
        let Known { value, sd, .. } = self.scale;
        self.scale.is_off_by(MIN_SCALE).then(|| MapChange::of_signal(SIGNAL, MapKey::Scale, 1.0 + value, sd))
    }

    /// Against the turbine speed, as all channels: the delay of the output speed is in it.
    fn change_of_delay(&self, output_late_s: Option<Known>) -> Option<MapChange> {
        let output = output_late_s.unwrap_or(Known { value: 0.0, sd: 0.0, before: 0.0 });
        let late_s = Known {
            value: self.late_s.value + output.value,
            sd: Real::hypot(self.late_s.sd, output.sd),
            before: Real::hypot(self.late_s.before, output.before),
        };
        if self.late_s.verdict() == Verdict::NotIdentifiable { None } else { change_of_delay(SIGNAL, &late_s) }
    }

    fn said_of_stiffness(&self) -> String {
        let half = 100.0 * SIDES * self.stiffness.sd;
        match self.stiffness.verdict() {
            Verdict::NotIdentifiable => {
                format!(
                    "stiffness of the drive shafts: not identified by these logs, +- {half:.0} %; {STIFFNESS_IDENTIFIED_BY}"
                )
            }
            verdict => format!(
                "stiffness of the drive shafts: x {:.3} +- {half:.0} %, {}; the common factor of all torques is in it. Their damping is not fitted",
                self.stiffness_factor(),
                verdict.name()
            ),
        }
    }
}

/// The wheel speed and the drive shafts of a car in the gears of its logs; `stiffness_sd` is what is known of the stiffness before, as a fraction.
///
/// # Errors
/// What the logs lack for it.
pub(crate) fn fit_wheel(
    car: &DrivenCar,
    driving: &Driving,
    torque: &InputTorque,
    stiffness_sd: f64,
) -> Result<WheelFit, String> {
    if car.converter.is_none() {
        return Err("the torque of a car without converter is not computed for it".to_owned());
    }
    let stretches: Vec<&Vec<Cell>> = driving.twists.iter().collect();
    let min_rad_s = OUTPUT_MIN_RAD_S / car.driveline.final_ratio;
    let (changes, _) = changes(&stretches, APART, min_rad_s, torque);
    let mut groups: Vec<usize> = changes.iter().map(|change| change.group).collect();
    groups.dedup();
    let time_s = changes.iter().fold(0.0, |sum, change| sum + change.span_s);
    if time_s < TIME_S || groups.len() < GROUPS {
        return Err(format!(
            "{time_s:.0} s of driving in a gear with a wheel speed, in {} stretches; {TIME_S:.0} s in {GROUPS} are needed; {WHEEL_IDENTIFIED_BY}",
            groups.len()
        ));
    }
    let compliance = car.driveline.shaft_stiffness_n_m_rad.recip();
    let found = identified(&changes, compliance, stiffness_sd)
        .filter(|found| found.value[2] > 0.0)
        .ok_or_else(|| format!("the speeds of output and wheels do not fit together; {WHEEL_IDENTIFIED_BY}"))?;
    let [scale, late_s, shafts, _] = found.value;
    // The twist tells the compliance per torque.
    let stiffness_sd_found = Real::hypot(found.sd[2] / shafts, torque.sd);
    Ok(WheelFit {
        scale: Known::of(scale, found.sd[0], FLOORS[0], SCALE),
        late_s: Known::of(late_s, found.sd[1], FLOORS[1], DELAY_S),
        stiffness: Known::of(Real::ln(compliance / shafts), stiffness_sd_found, FLOORS[2], stiffness_sd),
        time_s,
    })
}
