//! Options of `design`.

use std::path::PathBuf;

use car::{GainMethod, SAMPLE_TIMES_S};
use clap::{Args, ValueEnum};
use design::Quantity;
use observer::Phase;
use wetclutch::gains::{
    DESIGN_PHASES, DesignObserver, DesignOptions, ERROR_BOUND, KAPPA1_PER_S, KAPPA2_PER_S, OFFSET_MAX_PA, SAMPLE_TIME_S,
};

use super::{PageChoice, within};

#[derive(Debug, Clone, Args)]
pub(crate) struct Design {
    /// Vehicle file
    pub(crate) vehicle: PathBuf,
    /// Shift of a car with a gearbox, such as 1-2; without it, a table of all upshifts from each gear to the next
    #[arg(long, value_name = "FROM-TO")]
    pub(crate) shift: Option<String>,
    /// File with values that replace those of the vehicle file, such as the output of `error-bound`
    #[arg(long, value_name = "BOUNDS.toml")]
    pub(crate) bounds: Option<PathBuf>,
    /// Observer to design for
    #[arg(long, value_enum, default_value_t = DesignChoice::Rigid)]
    pub(crate) observer: DesignChoice,
    /// Design method of the gains [default: iss; of the table of all upshifts: peak-to-peak]
    #[arg(long, value_enum)]
    pub(crate) method: Option<MethodChoice>,
    /// Quantity of the error bound in the discrete-time methods [default: clutch-torque]
    #[arg(long, value_enum, value_name = "QUANTITY")]
    pub(crate) bound_on: Option<QuantityChoice>,
    /// Phase to design for
    #[arg(long, value_enum, default_value_t = PhaseChoice::Both)]
    pub(crate) phase: PhaseChoice,
    /// kappa1 in 1/s; if neither this option nor the file gives it, it is increased step by step
    #[arg(long, value_name = "PER_S", allow_negative_numbers = true, value_parser = within(KAPPA1_PER_S))]
    pub(crate) kappa1: Option<f64>,
    /// kappa2 in 1/s: decay rate of the error; the settling time is 4/kappa2
    #[arg(long, value_name = "PER_S", allow_negative_numbers = true, value_parser = within(KAPPA2_PER_S))]
    pub(crate) kappa2: Option<f64>,
    /// Bound on the model error |w|: in rad/s^2 for the rigid observer, normalised for the compliant one
    #[arg(long, value_name = "BOUND", allow_negative_numbers = true, value_parser = within(ERROR_BOUND))]
    pub(crate) error_bound: Option<f64>,
    /// Largest acceptable offset of the estimate in Pa
    #[arg(long, value_name = "PA", allow_negative_numbers = true, value_parser = within(OFFSET_MAX_PA))]
    pub(crate) offset_max: Option<f64>,
    /// Sample time in s, for the discrete-time methods [default: 0.01]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = within(SAMPLE_TIMES_S))]
    pub(crate) sample_time: Option<f64>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) page: PageChoice,
}

impl Design {
    /// The method for the gains of one shift.
    pub(crate) fn method(&self) -> MethodChoice {
        self.method.unwrap_or(MethodChoice::Iss)
    }

    /// The same as the library takes it.
    pub(crate) fn library(&self) -> DesignOptions {
        DesignOptions {
            observer: self.observer.into(),
            method: self.method.map(GainMethod::from),
            quantity: self.bound_on.map(Quantity::from),
            sample_time_s: self.sample_time,
            kappa1_per_s: self.kappa1,
            kappa2_per_s: self.kappa2,
            error_bound: self.error_bound,
            offset_max_pa: self.offset_max,
        }
    }

    /// Sample time of a design in discrete time, s.
    pub(crate) fn sample_time_s(&self) -> f64 {
        self.sample_time.unwrap_or(SAMPLE_TIME_S)
    }

    /// The phases to design for.
    pub(crate) fn phases(&self) -> &'static [Phase] {
        match self.phase {
            PhaseChoice::Both => &DESIGN_PHASES,
            PhaseChoice::Torque => &[Phase::TorquePhase],
            PhaseChoice::Inertia => &[Phase::InertiaPhase],
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DesignChoice {
    /// Reduced-order, rigid driveline, by the chapter's five steps
    Rigid,
    /// Reduced-order with elastic drive shafts
    Compliant,
    /// Full-order sliding mode: gains from the sliding condition, without a certificate
    Sliding,
}

impl DesignChoice {
    /// Its name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::Compliant => "compliant",
            Self::Sliding => "sliding",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodChoice {
    /// The chapter's method, in continuous time: the smallest gain with the required decay
    Iss,
    /// The same for a sample time, with every error of the budget in the bound; this method and the following ones use the
    /// open loop where no gain reduces the bound
    IssDiscrete,
    /// The gain with the smallest error bound for a sample time, with every error of the budget
    PeakToPeak,
    /// The same, with a gain that depends on the friction coefficient
    Scheduled,
    /// The gain with the narrowest range that is computed together with the estimate
    Interval,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum QuantityChoice {
    /// The clutch torque, on which the speeds depend directly
    ClutchTorque,
    /// The pressure, which follows from the speeds only with the friction coefficient
    Pressure,
}

impl From<DesignChoice> for DesignObserver {
    fn from(choice: DesignChoice) -> Self {
        match choice {
            DesignChoice::Rigid => Self::Rigid,
            DesignChoice::Compliant => Self::Compliant,
            DesignChoice::Sliding => Self::Sliding,
        }
    }
}

impl From<QuantityChoice> for Quantity {
    fn from(choice: QuantityChoice) -> Self {
        match choice {
            QuantityChoice::ClutchTorque => Self::ClutchTorque,
            QuantityChoice::Pressure => Self::Pressure,
        }
    }
}

impl From<MethodChoice> for GainMethod {
    fn from(choice: MethodChoice) -> Self {
        match choice {
            MethodChoice::Iss => Self::Iss,
            MethodChoice::IssDiscrete => Self::IssDiscrete,
            MethodChoice::PeakToPeak => Self::PeakToPeak,
            MethodChoice::Scheduled => Self::Scheduled,
            MethodChoice::Interval => Self::Interval,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PhaseChoice {
    /// Torque phase and inertia phase
    Both,
    /// Load moves from the offgoing to the oncoming clutch
    Torque,
    /// Both clutches slip
    Inertia,
}
