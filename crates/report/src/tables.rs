//! Scores and certificates as rows of a table, the same for pages and terminals.

use design::{Certificate, CompliantCertificate};
use minijinja::{Value, context};
use observer::{Health, Phase};
use study::campaign::COMPARED;
use study::{Comparison, PhaseScore, ShiftQuality};
use trace::quantity;
use trace::units::mpa;

/// A number with these decimals; with an exponent where it is that of a diverged observer, a dash where there is none.
pub fn number(value: f64, decimals: usize) -> String {
    match value.abs() {
        size if size < 1e6 => {
            let text = format!("{value:.decimals$}");
            // Zero has no sign.
            let is_zero = !text.contains(|c: char| c.is_ascii_digit() && c != '0');
            text.strip_prefix('-').filter(|_| is_zero).map_or(text.clone(), str::to_owned)
        }
        size if size.is_nan() => "–".to_owned(),
        f64::INFINITY => "∞".to_owned(),
        _ => format!("{value:.1e}"),
    }
}

/// What a health says of a sample.
pub fn health_meaning(health: Health) -> &'static str {
    match health {
        Health::Good => "nothing to remark",
        Health::ReadingRefused => "a reading that was refused: it is impossible, or it contradicts all others",
        Health::ChannelLost => "a channel without usable readings: the estimate is less certain",
        Health::HeldClutchSlips => "a slip of a clutch that should hold: the estimate is less certain",
        Health::Flare => {
            "a flare: both clutches slip and the turbine speed rises; the oncoming clutch carries too little torque"
        }
        Health::OutsideRange => {
            "an estimate outside its range: the observer has a large error, or the car is outside its error budget"
        }
        Health::LimitedToRange => {
            "an estimate outside its guaranteed range, replaced by the nearest end: the observer has a large error, or the car is outside its error budget"
        }
        Health::BeyondBounds => {
            "a quantity of the car beyond the bound of its error by the shifts so far: the guaranteed ranges do not hold"
        }
        Health::CommandsMistimed => {
            "commands that come late or early against the speeds: the guaranteed ranges do not hold"
        }
        Health::CommandRejected => "an unusable valve command: the last usable command is used",
        Health::PressureLimited => "a pressure outside 0 to `pressure_max_pa`: the estimate is that limit",
        Health::TooSlow => "an output speed too low for its sensor: the estimate is from the valve model",
        Health::OneWayOverruns => {
            "the one-way clutch of the gear overruns: the car coasts, and the engine does not drive it"
        }
        Health::ClutchOpen => "no gear drives the car: neutral, or a clutch that is open or slips at a launch",
        Health::ShiftNotModelled => {
            "a change of gear without equations: two shifts at once, from or to neutral, between gears of the same ratio, or past a gear where the ratios alone are known"
        }
        Health::SpeedsRejected => "an unusable speed: the estimate is from the valve model alone",
        Health::Restarted => "a restart: the observer lost its state and starts again",
        Health::TimeRejected => "an unusable time step: the estimate is that of the sample before",
    }
}

/// A fraction in per cent, rounded down: 100 % is all of it.
pub fn coverage(fraction: f64) -> String {
    format!("{:.1} %", (1000.0 * fraction).floor() / 10.0)
}

/// A text that begins with a capital.
pub fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or(String::new(), |first| first.to_uppercase().chain(chars).collect())
}

/// Name of a phase for people.
pub fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::BeforeShift => "before the shift",
        Phase::TorquePhase => "torque phase",
        Phase::InertiaPhase => "inertia phase",
        Phase::AfterShift => "after lock-up",
    }
}

/// Names of the errors that are compared with those of the open loop, see [`COMPARED`].
pub const COMPARED_NAMES: [&str; COMPARED.len()] = ["pressure", "clutch torque"];

/// A time in ms, if the error settled.
fn settling(score: &PhaseScore) -> String {
    score.settling_s.map_or_else(|| "not settled".to_owned(), |s| format!("{:.0}", 1e3 * s))
}

/// Peak, RMS and mean absolute value of a torque error.
fn triple(score: &PhaseScore) -> String {
    let one = |value: f64| number(value, usize::from(value < 100.0));
    format!("{} / {} / {}", one(score.peak), one(score.rms), one(score.mean))
}

/// One row for each phase and observer.
pub(crate) fn score_rows(comparison: &Comparison) -> Vec<Value> {
    let range_pa = comparison.experiment.shift.line_pressure_pa;
    let phases = comparison.runs.first().map_or(0, |run| run.pressure.len());
    let cell = |pascal: f64| {
        context! {
            mpa => number(mpa(pascal), 4),
            percent => number(100.0 * pascal / range_pa, 1),
        }
    };
    let mut rows = Vec::new();
    for phase in 0..phases {
        let present = comparison.runs.iter().filter(|run| run.pressure[phase].samples > 0);
        for (n, run) in present.enumerate() {
            let (pressure, torque) = (&run.pressure[phase], &run.torque[phase]);
            rows.push(context! {
                first => n == 0,
                phase => phase_name(pressure.phase),
                observer => &run.entry.name,
                peak => cell(pressure.peak),
                rms => cell(pressure.rms),
                mean => cell(pressure.mean),
                settling_ms => settling(pressure),
                chatter => number(mpa(pressure.chatter), 3),
                torque => triple(torque),
                shaft => run.shaft.as_ref().map_or_else(|| "–".to_owned(), |shaft| triple(&shaft[phase])),
            });
        }
    }
    rows
}

/// The certificates of the rigid observer.
pub(crate) fn rigid_certificates(comparison: &Comparison) -> Vec<Value> {
    let one = |phase: Phase, certificate: &Certificate| {
        let outputs = if phase == Phase::TorquePhase { 1 } else { 2 };
        let gain = certificate.gain_pa_s_rad[..outputs].iter();
        context! {
            phase => phase_name(phase),
            gain => gain.map(|l| format!("{l:.1}")).collect::<Vec<_>>().join(", "),
            kappa1 => format!("{:.2}", certificate.kappa1_per_s),
            kappa2 => format!("{:.2}", certificate.kappa2_per_s),
            settling => format!("{:.2}", 4.0 / certificate.kappa2_per_s),
            model_error => format!("{:.1}", certificate.model_error_max_rad_s2),
            offset => format!("{:.4}", mpa(certificate.offset_pa)),
            offset_max => format!("{:.4}", mpa(certificate.offset_max_pa)),
            vertices => certificate.vertices.iter().map(|v| context! {
                label => &v.vertex.label,
                decay => format!("{:.4}", v.decay_per_s),
                margin => margin(v.margin_per_s),
            }).collect::<Vec<_>>(),
        }
    };
    let design = &comparison.rigid;
    vec![one(Phase::TorquePhase, &design.torque_phase), one(Phase::InertiaPhase, &design.inertia_phase)]
}

/// The certificates of the compliant observer.
pub(crate) fn compliant_certificates(comparison: &Comparison) -> Vec<Value> {
    let matrix = |rows: &[Vec<f64>]| -> Vec<String> {
        rows.iter().map(|row| row.iter().map(|x| format!("{x:.3}")).collect::<Vec<_>>().join(",  ")).collect()
    };
    let one = |phase: Phase, certificate: &CompliantCertificate| {
        context! {
            phase => phase_name(phase),
            gain => matrix(&certificate.gain_normalised),
            h => matrix(&certificate.h_normalised),
            kappa1 => format!("{:.2}", certificate.kappa1_per_s),
            kappa2 => format!("{:.2}", certificate.kappa2_per_s),
            offset => format!("{:.4}", mpa(certificate.offset_pa)),
            offset_shaft => format!("{:.0}", certificate.offset_n_m),
            offset_max => format!("{:.4}", mpa(certificate.offset_max_pa)),
            vertices => certificate.vertices.iter().map(|v| context! {
                label => &v.label,
                decay => format!("{:.4}", v.decay_per_s),
                margin => margin(v.margin_per_s),
            }).collect::<Vec<_>>(),
        }
    };
    let design = &comparison.compliant;
    vec![one(Phase::TorquePhase, &design.torque_phase), one(Phase::InertiaPhase, &design.inertia_phase)]
}

fn margin(per_s: f64) -> String {
    if per_s < 0.01 { format!("{per_s:.1e}") } else { format!("{per_s:.4}") }
}

/// How good the shift was.
pub fn quality_rows(q: &ShiftQuality) -> Vec<(&'static str, String)> {
    vec![
        ("torque phase", format!("{:.3} s", q.inertia_phase_start_s - q.torque_phase_start_s)),
        ("inertia phase", format!("{:.3} s", q.lock_up_s - q.inertia_phase_start_s)),
        ("turbine speed flare", quantity(q.flare_rad_s, "rad/s", 2)),
        ("lowest drive-shaft torque", quantity(q.least_shaft_torque_n_m, "N m", 0)),
        ("jerk over 0.3 s", format!("{:.1} m/s³", q.jerk_peak_m_s3)),
        ("vibration dose value above 0.4 Hz", format!("{:.2} m/s^1.75", q.vibration_dose_m_s1_75)),
        ("friction work of the oncoming clutch", format!("{:.1} kJ", 1e-3 * q.friction_work_j)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_any_size_is_short() {
        assert_eq!([0.01234, -5.0, f64::NAN].map(|value| number(value, 3)), ["0.012", "-5.000", "–"]);
        assert_eq!([-0.0004, -0.0006, 0.0].map(|value| number(value, 3)), ["0.000", "-0.001", "0.000"]);
        assert_eq!([1e9, -1e95, f64::INFINITY].map(|value| number(value, 3)), ["1.0e9", "-1.0e95", "∞"]);
    }

    #[test]
    fn a_range_that_misses_the_truth_once_is_not_said_to_hold_it_always() {
        assert_eq!([1.0, 0.9996, 0.5].map(coverage), ["100.0 %", "99.9 %", "50.0 %"]);
    }
}
