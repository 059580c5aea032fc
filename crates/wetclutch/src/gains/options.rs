//! How gains are designed.

use std::ops::RangeInclusive;

use car::{GainMethod, SAMPLE_TIMES_S};
use design::compliant::CompliantRequirement;
use design::{IssRequirement, Quantity};

use crate::Error;
use crate::vehicle::unknown;

/// Sample time of a design where none is given, s: the usual period of a transmission controller.
pub const SAMPLE_TIME_S: f64 = 0.01;
/// Range of `kappa1`, 1/s.
pub const KAPPA1_PER_S: RangeInclusive<f64> = 0.01..=1e4;
/// Range of `kappa2`, 1/s.
pub const KAPPA2_PER_S: RangeInclusive<f64> = 0.4..=800.0;
/// Range of a bound on the model error.
pub const ERROR_BOUND: RangeInclusive<f64> = 0.0..=1e6;
/// Range of the largest acceptable offset, Pa.
pub const OFFSET_MAX_PA: RangeInclusive<f64> = 1e3..=10e6;

/// Which observer gains are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DesignObserver {
    /// Reduced-order, rigid driveline.
    Rigid,
    /// Reduced-order with elastic drive shafts.
    Compliant,
    /// Full-order sliding mode: gains from the sliding condition, without a certificate.
    Sliding,
}

impl DesignObserver {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Rigid, Self::Compliant, Self::Sliding];

    /// The observer of this name.
    ///
    /// # Errors
    /// There is none.
    pub fn named(name: &str) -> Result<Self, Error> {
        let found = Self::ALL.into_iter().find(|observer| observer.name() == name);
        found.ok_or_else(|| unknown("observer", name, &Self::ALL.map(Self::name)))
    }

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::Compliant => "compliant",
            Self::Sliding => "sliding",
        }
    }
}

/// How gains are designed.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignOptions {
    /// The observer.
    pub observer: DesignObserver,
    /// The design method; [`GainMethod::Iss`] if none is given.
    pub method: Option<GainMethod>,
    /// What the bound of a method in discrete time is on; the clutch torque if it is not given.
    pub quantity: Option<Quantity>,
    /// Sample time of a method in discrete time, s; [`SAMPLE_TIME_S`] if it is not given.
    pub sample_time_s: Option<f64>,
    /// `kappa1` of the method [`GainMethod::Iss`], 1/s, in place of that of the file, as are the following ones.
    pub kappa1_per_s: Option<f64>,
    /// `kappa2`, 1/s.
    pub kappa2_per_s: Option<f64>,
    /// Bound on the model error: rad/s^2 of the rigid observer, normalised of the compliant one.
    pub error_bound: Option<f64>,
    /// Largest acceptable offset of the estimate, Pa.
    pub offset_max_pa: Option<f64>,
}

impl DesignOptions {
    /// Those of an observer, all else as usual.
    pub fn of(observer: DesignObserver) -> Self {
        Self {
            observer,
            method: None,
            quantity: None,
            sample_time_s: None,
            kappa1_per_s: None,
            kappa2_per_s: None,
            error_bound: None,
            offset_max_pa: None,
        }
    }

    /// The options that are given and have no effect with this observer and method, by their names here.
    pub fn without_effect(&self) -> impl Iterator<Item = &'static str> {
        let is_sliding = self.observer == DesignObserver::Sliding;
        let is_discrete = self.method.unwrap_or_default() != GainMethod::Iss;
        let required = [
            ("kappa1_per_s", self.kappa1_per_s),
            ("kappa2_per_s", self.kappa2_per_s),
            ("error_bound", self.error_bound),
            ("offset_max_pa", self.offset_max_pa),
        ];
        let required = required.map(|(name, given)| (name, given.is_some() && (is_discrete || is_sliding)));
        let is_continuous = !is_discrete || is_sliding;
        let sampled = [
            ("quantity", self.quantity.is_some() && is_continuous),
            ("sample_time_s", self.sample_time_s.is_some() && is_continuous),
            ("method", self.method.is_some() && is_sliding),
        ];
        required.into_iter().chain(sampled).filter_map(|(name, is_unused)| is_unused.then_some(name))
    }

    /// Refuses what is out of range or has no effect.
    pub(super) fn check(&self) -> Result<(), Error> {
        if let Some(option) = self.without_effect().next() {
            let message = format!("{option} has no effect with this observer and method\nhint: leave it out");
            return Err(Error::Input(message));
        }
        let ranges = [
            ("kappa1_per_s", self.kappa1_per_s, KAPPA1_PER_S),
            ("kappa2_per_s", self.kappa2_per_s, KAPPA2_PER_S),
            ("error_bound", self.error_bound, ERROR_BOUND),
            ("offset_max_pa", self.offset_max_pa, OFFSET_MAX_PA),
            ("sample_time_s", self.sample_time_s, SAMPLE_TIMES_S),
        ];
        for (name, given, range) in ranges {
            if let Some(value) = given.filter(|value| !range.contains(value)) {
                let (low, high) = (range.start(), range.end());
                return Err(Error::Input(format!("`{name}` is {value}, expected {low} to {high}")));
            }
        }
        Ok(())
    }

    pub(super) fn sample_time_s(&self) -> f64 {
        self.sample_time_s.unwrap_or(SAMPLE_TIME_S)
    }

    /// The requirement of the vehicle file, with the given values.
    pub fn replaced(&self, required: IssRequirement) -> IssRequirement {
        IssRequirement {
            kappa1_per_s: self.kappa1_per_s.or(required.kappa1_per_s),
            kappa2_per_s: self.kappa2_per_s.unwrap_or(required.kappa2_per_s),
            model_error_max_rad_s2: self.error_bound.unwrap_or(required.model_error_max_rad_s2),
            offset_max_pa: self.offset_max_pa.unwrap_or(required.offset_max_pa),
        }
    }

    /// The requirement of the vehicle file for the compliant observer, with the given values.
    pub fn replaced_compliant(&self, required: CompliantRequirement) -> CompliantRequirement {
        CompliantRequirement {
            kappa1_per_s: self.kappa1_per_s.or(required.kappa1_per_s),
            kappa2_per_s: self.kappa2_per_s.unwrap_or(required.kappa2_per_s),
            w_max: self.error_bound.unwrap_or(required.w_max),
            offset_max_pa: self.offset_max_pa.unwrap_or(required.offset_max_pa),
            ..required
        }
    }
}

/// The quantity of a bound by its name.
///
/// # Errors
/// There is none.
pub fn quantity_named(name: &str) -> Result<Quantity, Error> {
    match name {
        "clutch-torque" => Ok(Quantity::ClutchTorque),
        "pressure" => Ok(Quantity::Pressure),
        _ => Err(unknown("quantity", name, &["clutch-torque", "pressure"])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_without_effect_are_named() {
        let rigid = DesignOptions::of(DesignObserver::Rigid);
        assert_eq!(rigid.without_effect().next(), None);
        let sampled = DesignOptions { method: Some(GainMethod::Interval), ..rigid.clone() };
        let sliding = DesignOptions::of(DesignObserver::Sliding);
        for (options, expected) in [
            (DesignOptions { sample_time_s: Some(0.02), ..rigid.clone() }, Some("sample_time_s")),
            (DesignOptions { quantity: Some(Quantity::Pressure), ..rigid.clone() }, Some("quantity")),
            (DesignOptions { kappa1_per_s: Some(9.0), ..rigid }, None),
            (DesignOptions { kappa1_per_s: Some(9.0), ..sampled.clone() }, Some("kappa1_per_s")),
            (DesignOptions { sample_time_s: Some(0.02), ..sampled.clone() }, None),
            (DesignOptions { observer: DesignObserver::Sliding, ..sampled }, Some("method")),
            (DesignOptions { offset_max_pa: Some(1e5), ..sliding.clone() }, Some("offset_max_pa")),
            (DesignOptions { method: Some(GainMethod::Iss), ..sliding.clone() }, Some("method")),
            (sliding, None),
        ] {
            assert_eq!(options.without_effect().next(), expected, "{options:?}");
        }
    }

    #[test]
    fn what_is_out_of_range_is_refused_with_its_range() {
        let rigid = DesignOptions::of(DesignObserver::Rigid);
        assert!(rigid.check().is_ok());
        for (options, name) in [
            (DesignOptions { kappa1_per_s: Some(f64::NAN), ..rigid.clone() }, "kappa1_per_s"),
            (DesignOptions { kappa2_per_s: Some(-1.0), ..rigid.clone() }, "kappa2_per_s"),
            (DesignOptions { error_bound: Some(f64::INFINITY), ..rigid.clone() }, "error_bound"),
            (DesignOptions { offset_max_pa: Some(0.0), ..rigid }, "offset_max_pa"),
        ] {
            let error = options.check().unwrap_err();
            assert!(error.key().as_deref() == Some(name) && error.message().contains(" to "), "{error}");
        }
        assert!(DesignObserver::named("rigid ").is_err() && quantity_named("torque").is_err());
    }
}
