//! `wetclutch design`.

use car::{GainMethod, Vehicle};
use config::{Kind, Source, VehicleFile};
use design::{Certificate, CompliantCertificate, DiscreteCertificate, Model, OffsetMissed, Quantity, SolverRecord};
use observer::Phase;
use report::tables::phase_name;
use trace::quantity;
use trace::{ShownPath as _, units};
use wetclutch::gains::{GainUse, PhaseDesign, design_shift};

use super::design_car::of_car;
use super::page::{check_page, write_page};
use crate::args::Design;
use crate::commands::warn_without_effect;
use crate::failure::Failure;
use crate::output;

pub(crate) fn design(options: &Design) -> Result<(), Failure> {
    check_page(&options.page, options.bounds.iter().chain([&options.vehicle]))?;
    if Source::read(&options.vehicle)?.kind().is_ok_and(|kind| kind == Kind::Car) {
        return of_car(options);
    }
    if options.shift.is_some() {
        warn_without_effect("--shift", "the vehicle file is of one shift");
    }
    let vehicle = match &options.bounds {
        Some(bounds) => VehicleFile::read_with(&options.vehicle, bounds)?,
        None => VehicleFile::read(&options.vehicle)?,
    };
    let missed = of_vehicle(&vehicle, &vehicle.source, options, &[])?;
    not_met(missed, options)
}

/// Prints the gains for a vehicle of a file under its name and lines about it; returns the requirements that they do not meet.
pub(super) fn of_vehicle(
    vehicle: &Vehicle,
    source: &Source,
    options: &Design,
    about: &[String],
) -> Result<Vec<OffsetMissed>, Failure> {
    warn_of_unused(options);
    let designed = design_shift(vehicle, options.phases(), &options.library())?;
    let text: Vec<String> = designed.phases.iter().flat_map(|(phase, design)| lines(*phase, design)).collect();
    if options.json {
        output::exact_json(&designed.json(source)?)?;
    } else {
        output::line(&format!("{} ({})", vehicle.name, source.path.shown()))?;
        for line in about {
            output::line(line)?;
        }
        output::line("")?;
        for line in &text {
            output::line(line)?;
        }
        output::line(&format!("vehicle file sha256 {}", source.sha256()))?;
    }
    write_page(&options.page, || super::design_page::sheet(vehicle, source, options, (about, &text)))?;
    Ok(designed.missed)
}

/// The certified gain is printed, but a requirement that it does not meet is a failure.
pub(super) fn not_met(missed: Vec<OffsetMissed>, options: &Design) -> Result<(), Failure> {
    if missed.is_empty() {
        return Ok(());
    }
    let of_the_option = |missed: OffsetMissed| match options.offset_max {
        Some(_) => OffsetMissed { required_by: "--offset-max".to_owned(), ..missed },
        None => missed,
    };
    let messages = missed.into_iter().map(|missed| of_the_option(missed).to_string());
    Err(Failure::Work(messages.collect::<Vec<_>>().join("\n")))
}

/// The design for a phase, as text.
fn lines(phase: Phase, design: &PhaseDesign) -> Vec<String> {
    match design {
        PhaseDesign::Rigid(certificate, use_of) => rigid_lines(phase, certificate, use_of),
        PhaseDesign::Compliant(certificate, use_of) => compliant_lines(phase, certificate, use_of),
        PhaseDesign::Discrete(certificate) => discrete_lines(phase, certificate),
        PhaseDesign::Sliding { speed_rad_s2, pressure_pa_s } => sliding_lines(phase, speed_rad_s2, pressure_pa_s),
    }
}

/// Warns of the options that the observer and the method do not use.
pub(super) fn warn_of_unused(options: &Design) {
    for unused in options.library().without_effect() {
        let (option, used_by) = match unused {
            "kappa1_per_s" => ("--kappa1", "`--method iss`"),
            "kappa2_per_s" => ("--kappa2", "`--method iss`"),
            "offset_max_pa" => ("--offset-max", "`--method iss`"),
            "error_bound" => ("--error-bound", "`--method iss`"),
            "quantity" => ("--bound-on", "the methods in discrete time"),
            "sample_time_s" => ("--sample-time", "the methods in discrete time"),
            _ => ("--method", "the rigid and the compliant observer"),
        };
        warn_without_effect(option, &format!("it is for {used_by}"));
    }
}

/// In place of a bound on the offset, which leaves out the errors of the valve, if they are all that there is.
fn offset_line(use_of: &GainUse, offset: String) -> String {
    if use_of.is_open_loop {
        return format!(
            "  the gain is the open loop: the valve alone has the required decay; steady-state bound {}, by the \
             valve errors of the budget",
            mpa(use_of.open_loop_bound_pa)
        );
    }
    offset
}

/// How long a gain may correct, and whether the open loop is better by its bound.
fn use_lines(use_of: &GainUse, offset_pa: f64) -> Vec<String> {
    let mut lines = vec![step_line(use_of.longest_step_s)];
    if !use_of.is_open_loop && offset_pa > use_of.open_loop_bound_pa {
        lines.push(format!(
            "  open loop is used: its steady-state bound, with every error of the budget, is {}, less than the offset bound of this gain",
            mpa(use_of.open_loop_bound_pa)
        ));
    }
    lines
}

fn step_line(longest_step_s: f64) -> String {
    format!(
        "  corrects over steps of at most {:.1} ms; over longer ones the decay is not certified",
        1e3 * longest_step_s
    )
}

fn rigid_lines(phase: Phase, certificate: &Certificate, use_of: &GainUse) -> Vec<String> {
    let vertices = certificate.vertices.iter().map(|v| (v.vertex.label.as_str(), v.decay_per_s, v.margin_per_s));
    let offset = format!(
        "  offset bound {} ({}) for model errors up to {:.1} rad/s^2 and an exact valve model",
        mpa(certificate.offset_pa),
        required_words(certificate.offset_pa, certificate.offset_max_pa),
        certificate.model_error_max_rad_s2,
    );
    let mut lines = vec![
        format!("{}: {}", phase_name(phase), certificate.gain_text(phase)),
        kappas(certificate.kappa1_per_s, certificate.kappa2_per_s),
        offset_line(use_of, offset),
    ];
    lines.extend(use_lines(use_of, certificate.offset_pa));
    lines.extend(vertex_lines(vertices));
    lines
}

fn compliant_lines(phase: Phase, certificate: &CompliantCertificate, use_of: &GainUse) -> Vec<String> {
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
        offset_line(
            use_of,
            format!(
                "  offset bound {} ({}), {}, for |w| up to {:.2} and an exact valve model",
                mpa(certificate.offset_pa),
                required_words(certificate.offset_pa, certificate.offset_max_pa),
                quantity(certificate.offset_n_m, "N m", 0),
                certificate.w_max,
            ),
        ),
    ];
    lines.extend(use_lines(use_of, certificate.offset_pa));
    lines.extend(vertex_lines(vertices));
    lines
}

/// A pressure in the unit that is wanted.
fn mpa(pascal: f64) -> String {
    quantity(units::mpa(pascal), "MPa", 4)
}

fn required_words(offset_pa: f64, required_pa: f64) -> String {
    let missed = if offset_pa > required_pa { ", not met" } else { "" };
    format!("required {}{missed}", mpa(required_pa))
}

fn kappas(kappa1: f64, kappa2: f64) -> String {
    format!("  kappa1 {kappa1:.2}/s, kappa2 {kappa2:.2}/s: settling time {:.3} s", 4.0 / kappa2)
}

fn vertex_lines<'a>(vertices: impl Iterator<Item = (&'a str, f64, f64)>) -> Vec<String> {
    let mut lines =
        vec!["  certificate for forward and backward slip, evaluated by eigenvalues without the solver:".to_owned()];
    lines
        .extend(vertices.map(|(label, decay, margin)| {
            format!("    {label}: decay {decay:.4}/s, {margin:.6}/s more than required")
        }));
    lines.push(String::new());
    lines
}

/// Gains of the sliding-mode observer in a phase.
fn sliding_lines(phase: Phase, speed: &[f64], pressure: &[f64]) -> Vec<String> {
    let list = |values: &[f64]| values.iter().map(|x| format!("{x:.4e}")).collect::<Vec<_>>().join(", ");
    let rounded = speed.iter().map(|x| format!("{x:.0}")).collect::<Vec<_>>().join(", ");
    vec![
        format!("{}: sliding on the speeds with {rounded} rad/s^2", phase_name(phase)),
        format!("  pressure gains {} Pa/s", list(pressure)),
        String::new(),
    ]
}

fn discrete_lines(phase: Phase, certificate: &DiscreteCertificate) -> Vec<String> {
    let what = match certificate.quantity {
        Quantity::ClutchTorque => "clutch torque",
        Quantity::Pressure => "pressure",
    };
    let size = |pascal: f64| match certificate.quantity {
        Quantity::ClutchTorque => {
            let torque_n_m = units::mpa(pascal) * certificate.torque_n_m_mpa;
            format!("{} ({})", quantity(torque_n_m, "N m", 1), mpa(pascal))
        }
        Quantity::Pressure => mpa(pascal),
    };
    let name = phase_name(phase);
    let mut lines = Vec::new();
    if certificate.uses_open_loop {
        lines.push(format!("{name}: the gain is the open loop: no gain reduces the bound"));
        lines.push(format!(
            "  steady-state bound on the error of the {what}: {}; with the best gain: {}",
            size(certificate.open_loop_bound_pa),
            size(certificate.best_gain_bound_pa)
        ));
    } else {
        lines.extend(gain_lines(phase, certificate));
        lines.push(format!(
            "  steady-state bound on the error of the {what}: {}; open loop: {}",
            size(certificate.bound_pa),
            size(certificate.open_loop_bound_pa)
        ));
        lines.push(step_line(certificate.longest_step_s));
    }
    if certificate.solver.failed > 0 {
        let SolverRecord { solved, failed } = certificate.solver;
        lines.push(format!(
            "  the solver failed in {failed} of {} programs of the search: a smaller bound may exist",
            solved + failed
        ));
    }
    lines.push(format!(
        "  contributions to the bound at the worst vertex, at a sample time of {} ms:",
        1e3 * certificate.sample_time_s
    ));
    let parts = certificate.contributions.iter().filter(|part| part.bound_pa > 0.0);
    lines.extend(parts.map(|part| format!("    {:<24} {}", part.cause, quantity(units::mpa(part.bound_pa), "MPa", 5))));
    let (what, of) = match certificate.method {
        GainMethod::Interval => ("entries", "smallest entry"),
        _ => ("eigenvalues", "smallest eigenvalue"),
    };
    lines.push(format!(
        "  certificate{} for forward and backward slip, evaluated by {what} without the solver, for the gain in single precision:",
        if certificate.uses_open_loop { " of the best gain" } else { "" }
    ));
    lines.extend(certificate.margins.iter().map(|margin| format!("    {}: {of} {:.1e}", margin.label, margin.minimum)));
    lines.push(String::new());
    lines
}

/// The gains of a discrete-time design.
fn gain_lines(phase: Phase, certificate: &DiscreteCertificate) -> Vec<String> {
    let of = match (phase, certificate.model) {
        (Phase::InertiaPhase, Model::Compliant) => "rows (T_s, p) on turbine, slip and wheel speed",
        (_, Model::Compliant) => "rows (T_s, p) on turbine and wheel speed",
        (Phase::InertiaPhase, Model::Rigid) => "on turbine speed and slip",
        (_, Model::Rigid) => "on turbine speed",
    };
    let name = phase_name(phase);
    let mut lines = vec![format!("{name}: L normalised by 1000 N m, 0.1 MPa, 100 rad/s and 10 rad/s (wheel), {of}")];
    for gain in &certificate.gains {
        let row = |row: &Vec<f64>| row.iter().map(|x| format!("{x:.3}")).collect::<Vec<_>>().join(", ");
        let rows = gain.normalised.iter().map(row).collect::<Vec<_>>().join("; ");
        let at = gain.friction.map(|friction| format!(" at friction {friction}")).unwrap_or_default();
        lines.push(format!("  L = [{rows}]{at}"));
    }
    lines
}
