//! The report of a comparison as one self-contained page.

use config::{Experiment, Vehicle};
use design::Certificate;
use minijinja::{Environment, Value, context};
use observer::Phase;
use study::{Comparison, PhaseScore};
use trace::units::mpa;

use crate::shift_figure::{drive_figure, shift_figure};

/// Why a page could not be made.
#[derive(Debug, thiserror::Error)]
#[error("the report's template failed: {0}")]
pub struct PageError(#[from] minijinja::Error);

/// A report: the page and its figures.
#[derive(Debug, Clone)]
pub struct Page {
    /// The page; needs nothing but itself.
    pub html: String,
    /// The figures by file name, as SVG.
    pub figures: Vec<(&'static str, String)>,
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

impl Page {
    /// The report of a comparison on this vehicle and experiment.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn of(comparison: &Comparison, vehicle: &Vehicle, experiment: &Experiment) -> Result<Self, PageError> {
        let shift = shift_figure(comparison).svg();
        let drive = drive_figure(comparison).svg();
        let mut environment = Environment::new();
        environment.add_template("page", include_str!("page.html"))?;
        let html = environment.get_template("page")?.render(context! {
            title => &experiment.title,
            name => &experiment.name,
            vehicle_name => &vehicle.name,
            version => env!("CARGO_PKG_VERSION"),
            shift_figure => Value::from_safe_string(shift.clone()),
            drive_figure => Value::from_safe_string(drive.clone()),
            findings => findings(comparison),
            scores => score_rows(comparison, experiment.shift.line_pressure_pa),
            range_mpa => format!("{:.1}", mpa(experiment.shift.line_pressure_pa)),
            certificates => certificates(comparison),
            quality => quality(comparison),
            inputs => [&vehicle.source, &experiment.source].map(|source| context! {
                path => source.path.display().to_string(),
                sha256 => source.sha256(),
            }),
            sample_time_ms => experiment.sample_time_s * 1e3,
        })?;
        Ok(Self { html, figures: vec![("shift.svg", shift), ("drive.svg", drive)] })
    }
}

/// What the numbers say, in sentences. Where an observer loses to the open loop, that is a sentence too.
pub fn findings(comparison: &Comparison) -> Vec<String> {
    let (observer, open_loop) = (&comparison.runs[0], &comparison.runs[1]);
    let mut sentences: Vec<String> = (observer.pressure.iter().zip(&open_loop.pressure))
        .filter(|(score, _)| score.phase != Phase::AfterShift && score.samples > 0)
        .map(|(score, open)| {
            let change = |ours: f64, theirs: f64| {
                let percent = 100.0 * (ours / theirs - 1.0);
                if percent.abs() < 1.0 {
                    "the same as open loop".to_owned()
                } else {
                    format!("{:.0} % {} than open loop", percent.abs(), if percent < 0.0 { "lower" } else { "higher" })
                }
            };
            format!(
                "In the {} the observer’s RMS error is {:.4} MPa, {}; its peak error {:.4} MPa, {}.",
                phase_name(score.phase),
                mpa(score.rms),
                change(score.rms, open.rms),
                mpa(score.peak),
                change(score.peak, open.peak),
            )
        })
        .collect();
    for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
        if let Some((share, excess)) = comparison.bound_coverage(phase) {
            sentences.push(if share >= 1.0 {
                format!("In the {} the error stays within the certified band throughout.", phase_name(phase))
            } else {
                format!(
                    "In the {} the error lies within the certified band {:.0} % of the time and leaves it by up to \
                     {:.3} MPa: the certificate assumes a valve that obeys its model, and here delay, lag and gain of \
                     the valve vary.",
                    phase_name(phase),
                    100.0 * share,
                    mpa(excess),
                )
            });
        }
    }
    sentences
}

fn score_rows(comparison: &Comparison, range_pa: f64) -> Vec<Value> {
    let row = |name: &str, score: &PhaseScore, torque: &PhaseScore| {
        let cell = |pascal: f64| {
            context! {
                mpa => format!("{:.4}", mpa(pascal)),
                percent => format!("{:.1}", 100.0 * pascal / range_pa),
            }
        };
        context! {
            observer => name,
            phase => phase_name(score.phase),
            peak => cell(score.peak),
            rms => cell(score.rms),
            mean => cell(score.mean),
            torque_peak => format!("{:.1}", torque.peak),
            torque_rms => format!("{:.1}", torque.rms),
        }
    };
    (0..comparison.runs[0].pressure.len())
        .flat_map(|i| comparison.runs.iter().map(move |run| (run, i)))
        .filter(|(run, i)| run.pressure[*i].samples > 0)
        .map(|(run, i)| row(run.name, &run.pressure[i], &run.torque[i]))
        .collect()
}

fn certificates(comparison: &Comparison) -> Vec<Value> {
    let one = |phase: Phase, certificate: &Certificate| {
        let gain = certificate.gain_pa_s_rad;
        let outputs = if phase == Phase::TorquePhase { 1 } else { 2 };
        context! {
            phase => phase_name(phase),
            gain => gain[..outputs].iter().map(|l| format!("{l:.1}")).collect::<Vec<_>>().join(", "),
            kappa1 => format!("{:.2}", certificate.kappa1_per_s),
            kappa2 => format!("{:.2}", certificate.kappa2_per_s),
            settling => format!("{:.2}", 4.0 / certificate.kappa2_per_s),
            model_error => format!("{:.1}", certificate.model_error_max_rad_s2),
            offset => format!("{:.4}", mpa(certificate.offset_pa)),
            offset_max => format!("{:.4}", mpa(certificate.offset_max_pa)),
            vertices => certificate.vertices.iter().map(|v| context! {
                label => &v.vertex.label,
                decay => format!("{:.4}", v.decay_per_s),
                margin => if v.margin_per_s < 0.01 { format!("{:.1e}", v.margin_per_s) } else { format!("{:.4}", v.margin_per_s) },
            }).collect::<Vec<_>>(),
        }
    };
    vec![
        one(Phase::TorquePhase, &comparison.design.torque_phase),
        one(Phase::InertiaPhase, &comparison.design.inertia_phase),
    ]
}

fn quality(comparison: &Comparison) -> Option<Vec<(&'static str, String)>> {
    let q = comparison.quality.as_ref()?;
    Some(vec![
        ("torque phase", format!("{:.3} s", q.inertia_phase_start_s - q.torque_phase_start_s)),
        ("inertia phase", format!("{:.3} s", q.lock_up_s - q.inertia_phase_start_s)),
        ("flare of the turbine", format!("{:.2} rad/s", q.flare_rad_s)),
        ("least drive-shaft torque", format!("{:.0} N m", q.least_shaft_torque_n_m)),
        ("jerk, peak over 20 ms", format!("{:.1} m/s³", q.jerk_peak_m_s3)),
    ])
}
