//! `wetclutch design`.

use config::Vehicle;
use design::rigid::design_phase;
use design::{Certificate, IssRequirement, requirement};
use observer::Phase;
use report::tables::phase_name;
use trace::units;

use crate::args::{Design, PhaseChoice};
use crate::failure::Failure;
use crate::output;

pub(crate) fn design(options: &Design) -> Result<(), Failure> {
    let vehicle = Vehicle::read(&options.vehicle)?;
    let phases: &[Phase] = match options.phase {
        PhaseChoice::Both => &[Phase::TorquePhase, Phase::InertiaPhase],
        PhaseChoice::Torque => &[Phase::TorquePhase],
        PhaseChoice::Inertia => &[Phase::InertiaPhase],
    };
    let mut designed = Vec::new();
    for &phase in phases {
        let required = replaced(requirement(&vehicle, phase).into(), options);
        let certificate = design_phase(&vehicle, phase, &required)
            .map_err(|error| Failure::Work(format!("{}: {error}", phase_name(phase))))?;
        designed.push((phase, certificate));
    }
    if options.json {
        let object: serde_json::Map<String, serde_json::Value> = (designed.iter())
            .map(|(phase, certificate)| Ok((phase.name().to_owned(), serde_json::to_value(certificate)?)))
            .collect::<Result<_, serde_json::Error>>()?;
        output::line(&serde_json::to_string_pretty(&object)?)?;
        return Ok(());
    }
    output::line(&format!("{} ({})\n", vehicle.name, vehicle.source.path.display()))?;
    for (phase, certificate) in &designed {
        print(*phase, certificate)?;
    }
    output::line(&format!("vehicle file sha256 {}", vehicle.source.sha256()))?;
    Ok(())
}

/// The vehicle file's requirement with what the options replace.
fn replaced(required: IssRequirement, options: &Design) -> IssRequirement {
    IssRequirement {
        kappa1_per_s: options.kappa1.or(required.kappa1_per_s),
        kappa2_per_s: options.kappa2.unwrap_or(required.kappa2_per_s),
        model_error_max_rad_s2: options.error_bound.unwrap_or(required.model_error_max_rad_s2),
        offset_max_pa: options.offset_max.unwrap_or(required.offset_max_pa),
    }
}

fn print(phase: Phase, certificate: &Certificate) -> Result<(), Failure> {
    let gain = certificate.gain_pa_s_rad;
    let gain = match phase {
        Phase::TorquePhase => format!("L = {:.1} Pa s/rad on the turbine speed", gain[0]),
        _ => format!("L = ({:.1}, {:.1}) Pa s/rad on turbine speed and slip", gain[0], gain[1]),
    };
    output::line(&format!("{}: {gain}", phase_name(phase)))?;
    output::line(&format!(
        "  kappa1 {:.2}/s, kappa2 {:.2}/s: an initial error is gone after {:.3} s",
        certificate.kappa1_per_s,
        certificate.kappa2_per_s,
        4.0 / certificate.kappa2_per_s,
    ))?;
    output::line(&format!(
        "  offset bound {:.4} MPa (required {:.4}) for model errors up to {:.1} rad/s^2 and an exact valve model",
        units::mpa(certificate.offset_pa),
        units::mpa(certificate.offset_max_pa),
        certificate.model_error_max_rad_s2,
    ))?;
    output::line("  certificate, evaluated by eigenvalues apart from the solver:")?;
    for vertex in &certificate.vertices {
        output::line(&format!(
            "    {}: decay {:.4}/s, {:.6}/s more than required",
            vertex.vertex.label, vertex.decay_per_s, vertex.margin_per_s,
        ))?;
    }
    output::line("")?;
    Ok(())
}
