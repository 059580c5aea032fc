//! Which observers are run, and how their gains are chosen.

use core::ops::RangeInclusive;

use crate::Discretisation;

/// Kinds of observers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum ObserverKind {
    /// The valve model alone.
    OpenLoop,
    /// The valve's maps alone, with the middle of the delay budget.
    OpenLoopMaps,
    /// Rigid reduced-order observer.
    Rigid,
    /// Reduced-order observer with elastic drive shafts.
    Compliant,
    /// Full-order sliding-mode observer.
    Sliding,
    /// Kalman filter of all shifts of a gearbox, for the shift of a vehicle file.
    Gearbox,
    /// Kalman filter with unknown torques, scale and delays of the readings as states.
    Kalman,
    /// Extended Kalman filter on six states as textbooks have it, every reading of the moment.
    Extended,
    /// Unscented Kalman filter on the same six states, with the lag of the readings.
    Unscented,
    /// Super-twisting observer with implicit discretisation.
    SuperTwisting,
    /// The pressure that explains the last change of the speeds.
    Inversion,
}

impl ObserverKind {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::OpenLoop,
        Self::OpenLoopMaps,
        Self::Rigid,
        Self::Compliant,
        Self::Sliding,
        Self::Gearbox,
        Self::Kalman,
        Self::Extended,
        Self::Unscented,
        Self::SuperTwisting,
        Self::Inversion,
    ];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OpenLoop => "open-loop",
            Self::OpenLoopMaps => "open-loop-maps",
            Self::Rigid => "rigid",
            Self::Compliant => "compliant",
            Self::Sliding => "sliding",
            Self::Gearbox => "gearbox",
            Self::Kalman => "kalman",
            Self::Extended => "extended",
            Self::Unscented => "unscented",
            Self::SuperTwisting => "super-twisting",
            Self::Inversion => "inversion",
        }
    }
}

/// How the gains of a reduced-order observer are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum GainMethod {
    /// The chapter's five steps, in continuous time: the smallest gain that decays as required.
    #[default]
    Iss,
    /// The smallest gain that decays as required over a sample; the rest are for a sample time too, with every error of
    /// the budget in their bounds, and are the open loop where no gain beats that.
    IssDiscrete,
    /// The smallest bound on the error.
    PeakToPeak,
    /// The same with a gain that follows the friction coefficient.
    Scheduled,
    /// The smallest width of a range that is carried along with the estimate.
    Interval,
}

impl GainMethod {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Iss, Self::IssDiscrete, Self::PeakToPeak, Self::Scheduled, Self::Interval];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Iss => "iss",
            Self::IssDiscrete => "iss-discrete",
            Self::PeakToPeak => "peak-to-peak",
            Self::Scheduled => "scheduled",
            Self::Interval => "interval",
        }
    }
}

/// Gains given in the file in place of designed ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GivenGains {
    /// Of the rigid observer.
    Rigid {
        /// Torque phase: `L` on `w_t`.
        torque_phase_pa_s_rad: f64,
        /// Inertia phase: `L` on `(w_t, dw)`.
        inertia_phase_pa_s_rad: [f64; 2],
    },
    /// Of the sliding-mode observer, such as Eq. (2.57), (2.58) and (2.60).
    Sliding {
        /// Torque phase: `kst1`, rad/s^2.
        torque_speed_rad_s2: f64,
        /// Torque phase: `kst2`, Pa/s.
        torque_pressure_pa_s: f64,
        /// Inertia phase: `ks1` on `w_t` and `ks2` on `dw`, rad/s^2.
        inertia_speed_rad_s2: [f64; 2],
        /// Inertia phase: `ks3` and `ks4`, Pa/s.
        inertia_pressure_pa_s: [f64; 2],
    },
    /// Of the compliant observer, in the chapter's normalised units, such as Eq. (2.87) and (2.88): torque
    /// phase, inertia phase.
    CompliantNormalised([[f64; 2]; 2], [[f64; 3]; 2]),
}

/// Sample times that an observer may have, s.
pub const SAMPLE_TIMES_S: RangeInclusive<f64> = 1e-4..=0.2;

/// One observer of an experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct ObserverEntry {
    /// Its name in tables and figures.
    pub name: String,
    /// What it is.
    pub kind: ObserverKind,
    /// How its gains are chosen, if it is a reduced-order observer and they are designed.
    pub method: GainMethod,
    /// Its sample time, s.
    pub sample_time_s: f64,
    /// How it is carried over a sample.
    pub discretisation: Discretisation,
    /// Whether it gets the signals of the experiment's sensors.
    pub real_sensors: bool,
    /// Gains in place of designed ones.
    pub gains: Option<GivenGains>,
}

impl ObserverEntry {
    /// How its name begins columns and ends file names: without blanks, commas and slashes.
    pub fn column(&self) -> String {
        self.name.replace([' ', ',', '/', '\\'], "_")
    }
}
