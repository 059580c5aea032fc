//! Gains of an observer for one shift, with their certificates.

mod options;

use car::{GainMethod, Vehicle};
use config::Source;
use design::compliant::{best_compliant_phase, compliant_requirement, physical_gains};
use design::open_loop::is_open_loop;
use design::rigid::best_phase;
use design::{
    Certificate, CompliantCertificate, DesignError, DiscreteCertificate, ErrorModel, Model, OffsetMissed, Quantity,
    design_discrete_phase, design_sliding, error_models, open_loop_bound_pa, requirement,
};
use observer::{Discretisation, Phase};
use serde_json::{Map, Value, json};

pub use self::options::{
    DesignObserver, DesignOptions, ERROR_BOUND, KAPPA1_PER_S, KAPPA2_PER_S, OFFSET_MAX_PA, SAMPLE_TIME_S,
    quantity_named,
};
use crate::{Error, VehicleFile};

/// The phases of a shift that gains are designed for.
pub const DESIGN_PHASES: [Phase; 2] = [Phase::TorquePhase, Phase::InertiaPhase];

/// Gains of one phase, with their certificate.
#[derive(Debug, Clone, PartialEq)]
pub enum PhaseDesign {
    /// Of the rigid observer in continuous time.
    Rigid(Certificate, GainUse),
    /// Of the compliant observer in continuous time.
    Compliant(CompliantCertificate, GainUse),
    /// For a sample time.
    Discrete(DiscreteCertificate),
    /// Of the sliding-mode observer, which has no certificate.
    Sliding {
        /// Gains on the speeds, rad/s^2.
        speed_rad_s2: Vec<f64>,
        /// Gains of the pressure, Pa/s.
        pressure_pa_s: Vec<f64>,
    },
}

impl PhaseDesign {
    /// Gains and certificate as an object in JSON.
    ///
    /// # Errors
    /// A number is not finite.
    pub fn json(&self) -> Result<Value, Error> {
        Ok(match self {
            Self::Rigid(certificate, use_of) => use_of.added_to(serde_json::to_value(certificate)?),
            Self::Compliant(certificate, use_of) => use_of.added_to(serde_json::to_value(certificate)?),
            Self::Discrete(certificate) => serde_json::to_value(certificate)?,
            Self::Sliding { speed_rad_s2, pressure_pa_s } => {
                json!({ "speed_rad_s2": speed_rad_s2, "pressure_pa_s": pressure_pa_s })
            }
        })
    }
}

/// What a gain of continuous time is good for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GainUse {
    /// Whether its corrections of the pressure leave the estimate that of the open loop.
    pub is_open_loop: bool,
    /// Steady-state bound of the open loop on the clutch torque, as a pressure, with every error of the budget, Pa.
    pub open_loop_bound_pa: f64,
    /// The longest step over which it may correct, s.
    pub longest_step_s: f64,
}

impl GainUse {
    fn rigid(vehicle: &Vehicle, phase: Phase, certificate: &Certificate) -> Self {
        let gain = &certificate.gain_pa_s_rad;
        Self {
            is_open_loop: is_open_loop(vehicle, Model::Rigid, phase, gain, SAMPLE_TIME_S),
            open_loop_bound_pa: open_loop_bound_pa(vehicle, Model::Rigid, phase, SAMPLE_TIME_S),
            longest_step_s: certificate.longest_step_s(vehicle, phase, Discretisation::Exact),
        }
    }

    fn compliant(vehicle: &Vehicle, phase: Phase, certificate: &CompliantCertificate) -> Self {
        let rows = &certificate.gain_normalised;
        let gains = physical_gains(rows, rows);
        let [_, gain] = if phase == Phase::TorquePhase { gains.torque_phase } else { gains.inertia_phase };
        Self {
            is_open_loop: is_open_loop(vehicle, Model::Compliant, phase, &gain, SAMPLE_TIME_S),
            open_loop_bound_pa: open_loop_bound_pa(vehicle, Model::Compliant, phase, SAMPLE_TIME_S),
            longest_step_s: certificate.longest_step_s(vehicle, phase, Discretisation::Exact),
        }
    }

    fn added_to(self, mut certificate: Value) -> Value {
        certificate["uses_open_loop"] = json!(self.is_open_loop);
        certificate["longest_step_s"] = json!(self.longest_step_s);
        certificate["open_loop_bound_pa"] = json!(self.open_loop_bound_pa);
        certificate
    }
}

/// Designs the gains of one phase. A required offset that no certified gain reaches comes with the best gain.
///
/// # Errors
/// The design has no solution. Options without effect are left to [`DesignOptions::without_effect`].
pub fn design_phase(
    vehicle: &Vehicle,
    phase: Phase,
    options: &DesignOptions,
) -> Result<(PhaseDesign, Option<OffsetMissed>), DesignError> {
    let of_model = |model: Model| {
        let quantity = options.quantity.unwrap_or(Quantity::ClutchTorque);
        let method = options.method.unwrap_or_default();
        let certificate = design_discrete_phase(vehicle, model, method, quantity, phase, options.sample_time_s())?;
        Ok((PhaseDesign::Discrete(certificate), None))
    };
    match (options.observer, options.method.unwrap_or_default()) {
        (DesignObserver::Rigid, GainMethod::Iss) => {
            let required = options.replaced(requirement(vehicle, phase).into());
            let (certificate, missed) = best_phase(vehicle, phase, &required)?;
            let use_of = GainUse::rigid(vehicle, phase, &certificate);
            Ok((PhaseDesign::Rigid(certificate, use_of), missed))
        }
        (DesignObserver::Compliant, GainMethod::Iss) => {
            let required = options.replaced_compliant(compliant_requirement(vehicle, phase));
            let (certificate, missed) = best_compliant_phase(vehicle, phase, &required)?;
            let use_of = GainUse::compliant(vehicle, phase, &certificate);
            Ok((PhaseDesign::Compliant(certificate, use_of), missed))
        }
        (DesignObserver::Rigid, _) => of_model(Model::Rigid),
        (DesignObserver::Compliant, _) => of_model(Model::Compliant),
        (DesignObserver::Sliding, _) => Ok((sliding(vehicle, phase), None)),
    }
}

fn sliding(vehicle: &Vehicle, phase: Phase) -> PhaseDesign {
    let gains = design_sliding(vehicle);
    let (speed_rad_s2, pressure_pa_s) = match phase {
        Phase::TorquePhase => (vec![gains.torque_speed_rad_s2], vec![gains.torque_pressure_pa_s]),
        _ => (gains.inertia_speed_rad_s2.to_vec(), gains.inertia_pressure_pa_s.to_vec()),
    };
    PhaseDesign::Sliding { speed_rad_s2, pressure_pa_s }
}

/// Gains of a shift, with their certificates.
#[derive(Debug, Clone, PartialEq)]
pub struct Designed {
    /// By phase.
    pub phases: Vec<(Phase, PhaseDesign)>,
    /// Required offsets that no certified gain reaches.
    pub missed: Vec<OffsetMissed>,
    /// How the errors of the estimate follow from their causes, by phase and corner; none of gains in continuous time and of the sliding mode.
    pub error_models: Vec<(Phase, ErrorModel)>,
}

impl Designed {
    /// Gains and certificates by phase as an object in JSON, each with the hash of the vehicle file that they are for, if they have a certificate.
    ///
    /// # Errors
    /// A number is not finite.
    pub fn json(&self, source: &Source) -> Result<Map<String, Value>, Error> {
        let of_phase = |(phase, design): &(Phase, PhaseDesign)| {
            let mut json = design.json()?;
            if !matches!(design, PhaseDesign::Sliding { .. }) {
                json["vehicle_sha256"] = json!(source.sha256());
            }
            Ok((phase.name().to_owned(), json))
        };
        self.phases.iter().map(of_phase).collect()
    }
}

/// Designs the gains for the shift of a vehicle in these phases.
///
/// # Errors
/// The design has no solution.
pub fn design_shift(vehicle: &Vehicle, phases: &[Phase], options: &DesignOptions) -> Result<Designed, Error> {
    let mut designed = Designed { phases: Vec::new(), missed: Vec::new(), error_models: Vec::new() };
    for &phase in phases {
        let (design, missed) = design_phase(vehicle, phase, options)?;
        if let PhaseDesign::Discrete(certificate) = &design {
            let models = error_models(vehicle, phase, certificate).into_iter();
            designed.error_models.extend(models.map(|model| (phase, model)));
        }
        designed.phases.push((phase, design));
        designed.missed.extend(missed);
    }
    Ok(designed)
}

/// Designs the gains for a shift of a car, such as `1-2`; the vehicle file of one shift needs no name of it.
///
/// # Errors
/// There is no such shift or it is none that gains can be designed for, an option has no effect, or the design has no solution.
pub fn design(file: &VehicleFile, shift: Option<&str>, options: &DesignOptions) -> Result<Designed, Error> {
    options.check()?;
    let vehicle = match (file, shift) {
        (VehicleFile::Gearbox(file), Some(shift)) => &file.car.of_shift(file.car.shift_named(shift)?)?,
        (VehicleFile::Gearbox(file), None) => {
            let shifts: Vec<String> =
                file.car.single_upshifts().into_iter().map(|gears| file.car.shift_name(gears.into())).collect();
            let message = format!("shift: a car with a gearbox has many\nhint: give one of {}", shifts.join(", "));
            return Err(Error::Input(message));
        }
        (VehicleFile::OneShift(file), None) => &file.vehicle,
        (VehicleFile::OneShift(_), Some(_)) => {
            let message = "a shift has no effect with the vehicle file of one shift\nhint: leave it out";
            return Err(Error::Input(message.to_owned()));
        }
    };
    design_shift(vehicle, &DESIGN_PHASES, options)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn file(name: &str) -> VehicleFile {
        VehicleFile::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vehicles").join(name)).unwrap()
    }

    #[test]
    fn gains_of_a_car_are_those_of_its_shift() {
        let file = file("eight_speed.toml");
        let options =
            DesignOptions { method: Some(GainMethod::PeakToPeak), ..DesignOptions::of(DesignObserver::Rigid) };
        let designed = design(&file, Some("1-2"), &options).unwrap();
        let car = file.car().unwrap();
        let vehicle = car.of_shift(car.shift_named("1-2").unwrap()).unwrap();
        for (phase, found) in &designed.phases {
            let expected = design_discrete_phase(
                &vehicle,
                Model::Rigid,
                GainMethod::PeakToPeak,
                Quantity::ClutchTorque,
                *phase,
                SAMPLE_TIME_S,
            );
            assert_eq!(*found, PhaseDesign::Discrete(expected.unwrap()));
        }
        assert_eq!(designed.phases.len(), 2);
    }

    #[test]
    fn a_shift_is_asked_of_a_gearbox_and_of_nothing_else() {
        let options = DesignOptions::of(DesignObserver::Rigid);
        let error = design(&file("eight_speed.toml"), None, &options).unwrap_err();
        assert!(error.hint().is_some_and(|hint| hint.contains("1-2")), "{error}");
        let error = design(&file("eight_speed.toml"), Some("1-9"), &options).unwrap_err();
        assert!(error.message().contains("1-9"), "{error}");
        let error = design(&file("two_speed_at.toml"), Some("1-2"), &options).unwrap_err();
        assert!(error.message().contains("no effect"), "{error}");
        assert_eq!(design(&file("two_speed_at.toml"), None, &options).unwrap().phases.len(), 2);
    }
}
