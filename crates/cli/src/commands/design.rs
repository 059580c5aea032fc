//! `wetclutch design`.

use config::{GainMethod, Vehicle};
use design::compliant::{CompliantRequirement, compliant_requirement, design_compliant_phase};
use design::rigid::design_phase;
use design::{
    Certificate, CompliantCertificate, DesignError, DiscreteCertificate, IssRequirement, Model, Quantity,
    design_discrete_phase, design_sliding, requirement,
};
use observer::Phase;
use report::tables::phase_name;
use serde_json::{Map, Value, json};
use trace::units;

use crate::args::{Design, DesignChoice, MethodChoice, PhaseChoice};
use crate::failure::Failure;
use crate::output;

pub(crate) fn design(options: &Design) -> Result<(), Failure> {
    let vehicle = match &options.bounds {
        Some(bounds) => Vehicle::read_with(&options.vehicle, bounds)?,
        None => Vehicle::read(&options.vehicle)?,
    };
    let phases: &[Phase] = match options.phase {
        PhaseChoice::Both => &[Phase::TorquePhase, Phase::InertiaPhase],
        PhaseChoice::Torque => &[Phase::TorquePhase],
        PhaseChoice::Inertia => &[Phase::InertiaPhase],
    };
    options_apply(options)?;
    let sample_time_s = options.sample_time.unwrap_or(SAMPLE_TIME_S);
    let mut object = Map::new();
    let mut text = Vec::new();
    for &phase in phases {
        let failed = |error: DesignError| Failure::Work(format!("{}: {error}", phase_name(phase)));
        let (json, lines) = match (options.observer, options.method) {
            (DesignChoice::Rigid, MethodChoice::Iss) => {
                let required = replaced(requirement(&vehicle, phase).into(), options);
                let certificate = design_phase(&vehicle, phase, &required).map_err(failed)?;
                (serde_json::to_value(&certificate)?, rigid_lines(phase, &certificate))
            }
            (DesignChoice::Compliant, MethodChoice::Iss) => {
                let required = replaced_compliant(compliant_requirement(&vehicle, phase), options);
                let certificate = design_compliant_phase(&vehicle, phase, &required).map_err(failed)?;
                (serde_json::to_value(&certificate)?, compliant_lines(phase, &certificate))
            }
            (DesignChoice::Rigid | DesignChoice::Compliant, method) => {
                let model = if options.observer == DesignChoice::Rigid { Model::Rigid } else { Model::Compliant };
                let quantity = options.bound_on.map_or(Quantity::ClutchTorque, Quantity::from);
                let certificate = design_discrete_phase(&vehicle, model, method.into(), quantity, phase, sample_time_s)
                    .map_err(failed)?;
                (serde_json::to_value(&certificate)?, discrete_lines(phase, &certificate))
            }
            (DesignChoice::Sliding, _) => sliding(&vehicle, phase),
        };
        object.insert(phase.name().to_owned(), json);
        text.extend(lines);
    }
    if options.json {
        output::line(&serde_json::to_string_pretty(&object)?)?;
        return Ok(());
    }
    output::line(&format!("{} ({})\n", vehicle.name, vehicle.source.path.display()))?;
    for line in &text {
        output::line(line)?;
    }
    output::line(&format!("vehicle file sha256 {}", vehicle.source.sha256()))?;
    Ok(())
}

/// Sample time of a design that is given none, s: the usual period of a transmission controller.
const SAMPLE_TIME_S: f64 = 0.01;

/// Refuses an option that the method would not look at.
fn options_apply(options: &Design) -> Result<(), Failure> {
    let sliding = options.observer == DesignChoice::Sliding;
    let discrete = options.method != MethodChoice::Iss;
    let required = [
        ("--kappa1", options.kappa1.is_some()),
        ("--kappa2", options.kappa2.is_some()),
        ("--error-bound", options.error_bound.is_some()),
        ("--offset-max", options.offset_max.is_some()),
    ];
    let sampled = [("--bound-on", options.bound_on.is_some()), ("--sample-time", options.sample_time.is_some())];
    let unused = [(required.as_slice(), discrete || sliding), (sampled.as_slice(), !discrete || sliding)];
    let unused = unused.iter().filter(|(_, not)| *not).flat_map(|(options, _)| *options);
    let mut unused = unused.copied().chain([("--method", discrete && sliding)]);
    match unused.find(|(_, given)| *given) {
        None => Ok(()),
        Some((option, _)) => Err(Failure::Input(format!(
            "{option} does not go with this observer and method\n\
             hint: --kappa1, --kappa2, --error-bound and --offset-max are of `--method iss`, --bound-on and --sample-time of \
             the other methods, and sliding has none"
        ))),
    }
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

fn replaced_compliant(required: CompliantRequirement, options: &Design) -> CompliantRequirement {
    CompliantRequirement {
        kappa1_per_s: options.kappa1.or(required.kappa1_per_s),
        kappa2_per_s: options.kappa2.unwrap_or(required.kappa2_per_s),
        w_max: options.error_bound.unwrap_or(required.w_max),
        offset_max_pa: options.offset_max.unwrap_or(required.offset_max_pa),
        ..required
    }
}

fn rigid_lines(phase: Phase, certificate: &Certificate) -> Vec<String> {
    let gain = certificate.gain_pa_s_rad;
    let gain = match phase {
        Phase::TorquePhase => format!("L = {:.1} Pa s/rad on the turbine speed", gain[0]),
        _ => format!("L = ({:.1}, {:.1}) Pa s/rad on turbine speed and slip", gain[0], gain[1]),
    };
    let vertices = certificate.vertices.iter().map(|v| (v.vertex.label.as_str(), v.decay_per_s, v.margin_per_s));
    let mut lines =
        vec![format!("{}: {gain}", phase_name(phase)), kappas(certificate.kappa1_per_s, certificate.kappa2_per_s)];
    lines.push(format!(
        "  offset bound {:.4} MPa (required {:.4}) for model errors up to {:.1} rad/s^2 and an exact valve model",
        units::mpa(certificate.offset_pa),
        units::mpa(certificate.offset_max_pa),
        certificate.model_error_max_rad_s2,
    ));
    lines.extend(vertex_lines(vertices));
    lines
}

fn compliant_lines(phase: Phase, certificate: &CompliantCertificate) -> Vec<String> {
    let outputs = if phase == Phase::TorquePhase { "(w_t, w_w)" } else { "(w_t, dw, w_w)" };
    let row = |row: &Vec<f64>| row.iter().map(|x| format!("{x:9.3}")).collect::<Vec<_>>().join(" ");
    let gain = &certificate.gain_normalised;
    let vertices = certificate.vertices.iter().map(|v| (v.label.as_str(), v.decay_per_s, v.margin_per_s));
    let mut lines = vec![
        format!(
            "{}: L on {outputs}, normalised by 1000 N m, 0.1 MPa, 100 rad/s and 10 rad/s (wheel)",
            phase_name(phase)
        ),
        format!("  shaft torque  {}", row(&gain[0])),
        format!("  pressure      {}", row(&gain[1])),
        kappas(certificate.kappa1_per_s, certificate.kappa2_per_s),
        format!(
            "  offset bound {:.4} MPa (required {:.4}), {:.0} N m, for |w| up to {:.2} and an exact valve model",
            units::mpa(certificate.offset_pa),
            units::mpa(certificate.offset_max_pa),
            certificate.offset_n_m,
            certificate.w_max,
        ),
    ];
    lines.extend(vertex_lines(vertices));
    lines
}

fn kappas(kappa1: f64, kappa2: f64) -> String {
    format!("  kappa1 {kappa1:.2}/s, kappa2 {kappa2:.2}/s: an initial error is gone after {:.3} s", 4.0 / kappa2)
}

fn vertex_lines<'a>(vertices: impl Iterator<Item = (&'a str, f64, f64)>) -> Vec<String> {
    let mut lines = vec!["  certificate, evaluated by eigenvalues apart from the solver:".to_owned()];
    lines
        .extend(vertices.map(|(label, decay, margin)| {
            format!("    {label}: decay {decay:.4}/s, {margin:.6}/s more than required")
        }));
    lines.push(String::new());
    lines
}

/// Gains of the sliding-mode observer in a phase.
fn sliding(vehicle: &Vehicle, phase: Phase) -> (Value, Vec<String>) {
    let gains = design_sliding(vehicle);
    let (speed, pressure) = match phase {
        Phase::TorquePhase => (vec![gains.torque_speed_rad_s2], vec![gains.torque_pressure_pa_s]),
        _ => (gains.inertia_speed_rad_s2.to_vec(), gains.inertia_pressure_pa_s.to_vec()),
    };
    let list = |values: &[f64]| values.iter().map(|x| format!("{x:.4e}")).collect::<Vec<_>>().join(", ");
    let rounded = speed.iter().map(|x| format!("{x:.0}")).collect::<Vec<_>>().join(", ");
    let lines = vec![
        format!("{}: sliding on the speeds with {rounded} rad/s^2", phase_name(phase)),
        format!("  pressure gains {} Pa/s", list(&pressure)),
        String::new(),
    ];
    (json!({ "speed_rad_s2": speed, "pressure_pa_s": pressure }), lines)
}

fn discrete_lines(phase: Phase, certificate: &DiscreteCertificate) -> Vec<String> {
    let what = match certificate.quantity {
        Quantity::ClutchTorque => "clutch torque",
        Quantity::Pressure => "pressure",
    };
    let size = |pascal: f64| match certificate.quantity {
        Quantity::ClutchTorque => {
            format!("{:.1} N m ({:.4} MPa)", units::mpa(pascal) * certificate.torque_n_m_mpa, units::mpa(pascal))
        }
        Quantity::Pressure => format!("{:.4} MPa", units::mpa(pascal)),
    };
    let of = match (phase, certificate.model) {
        (Phase::InertiaPhase, Model::Compliant) => "rows (T_s, p) on turbine, slip and wheel speed",
        (_, Model::Compliant) => "rows (T_s, p) on turbine and wheel speed",
        (Phase::InertiaPhase, Model::Rigid) => "on turbine speed and slip",
        (_, Model::Rigid) => "on turbine speed",
    };
    let name = phase_name(phase);
    let mut lines = Vec::new();
    if certificate.uses_open_loop {
        lines.push(format!("{name}: open loop serves, no gain has a smaller bound"));
        lines.push(format!(
            "  error of the {what} ultimately below {}; below {} with the best gain",
            size(certificate.open_loop_bound_pa),
            size(certificate.best_gain_bound_pa)
        ));
    } else {
        lines.push(format!("{name}: L normalised by 1000 N m, 0.1 MPa, 100 rad/s and 10 rad/s (wheel), {of}"));
        for gain in &certificate.gains {
            let row = |row: &Vec<f64>| row.iter().map(|x| format!("{x:.3}")).collect::<Vec<_>>().join(", ");
            let rows = gain.normalised.iter().map(row).collect::<Vec<_>>().join("; ");
            let at = gain.friction.map(|friction| format!(" at friction {friction}")).unwrap_or_default();
            lines.push(format!("  L = [{rows}]{at}"));
        }
        lines.push(format!(
            "  error of the {what} ultimately below {}; below {} in open loop",
            size(certificate.bound_pa),
            size(certificate.open_loop_bound_pa)
        ));
    }
    lines.push(format!("  made of, at the worst corner, at a sample time of {} ms:", 1e3 * certificate.sample_time_s));
    let parts = certificate.contributions.iter().filter(|part| part.bound_pa > 0.0);
    lines.extend(parts.map(|part| format!("    {:<24} {:.5} MPa", part.cause, units::mpa(part.bound_pa))));
    let (what, of) = match certificate.method {
        GainMethod::Interval => ("entries", "least entry"),
        _ => ("eigenvalues", "least eigenvalue"),
    };
    lines.push(format!(
        "  certificate{}, by {what} apart from the solver, for the gain in single precision:",
        if certificate.uses_open_loop { " of the best gain" } else { "" }
    ));
    lines.extend(certificate.margins.iter().map(|margin| format!("    {}: {of} {:.1e}", margin.label, margin.least)));
    lines.push(String::new());
    lines
}
