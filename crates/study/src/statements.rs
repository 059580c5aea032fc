//! The source chapter's statements, each held against what was measured here.

use config::{Experiment, Vehicle};
use drivetrain::{Table1, Valve, ValveMaps};
use observer::Phase;
use serde::Serialize;
use trace::{signal, units::mpa};

use crate::{Comparison, ObserverRun, PhaseScore, StudyError, compare};

/// Whether our measurement bears a statement out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It does.
    Agrees,
    /// It does not, and the row says why.
    Differs,
}

impl Verdict {
    /// The word for people.
    pub fn word(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs => "differs",
        }
    }
}

/// A statement with the chapter's figure, ours, and a plain word.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statement {
    /// The experiment.
    pub experiment: &'static str,
    /// What is claimed.
    pub claim: &'static str,
    /// The chapter's figure.
    pub chapter: &'static str,
    /// Ours.
    pub ours: String,
    /// Whether they agree.
    pub verdict: Verdict,
    /// Why they differ, or what else the numbers say.
    pub because: String,
}

/// Runs that take one cause of error away, to say what an error is made of.
struct Without {
    /// E1 with tyres that hardly slip.
    tyre_slip: Comparison,
    /// E1 with a valve that obeys the observers' model.
    valve_error: Comparison,
    /// E2 on a level road.
    grade: Comparison,
}

impl Without {
    fn run(vehicle: &Vehicle, e1: &Experiment, e2: &Experiment) -> Result<Self, StudyError> {
        let mut stiff = vehicle.clone();
        stiff.tyre.slip_scale /= 20.0;
        let mut ideal = vehicle.clone();
        if let Valve::Proportional { time_constant_s, gain_pa_a } = vehicle.observer_valve {
            for clutch in [&mut ideal.offgoing, &mut ideal.oncoming] {
                clutch.valve = ValveMaps {
                    time_constant_s: Table1::constant(time_constant_s),
                    gain_pa_a: Table1::constant(gain_pa_a),
                    delay_s: Table1::constant(0.0),
                };
            }
        }
        let mut level = e2.clone();
        level.off_nominal.grade_rad = None;
        Ok(Self {
            tyre_slip: compare(&stiff, e1)?,
            valve_error: compare(&ideal, e1)?,
            grade: compare(vehicle, &level)?,
        })
    }
}

/// The experiments, run, and the statements about them.
#[derive(Debug, Clone, PartialEq)]
pub struct Chapter {
    /// E1 to E4.
    pub experiments: [Comparison; 4],
    /// The statements in the order of the chapter.
    pub statements: Vec<Statement>,
}

/// Runs E1 to E4 on this vehicle and checks the chapter's statements.
///
/// # Errors
/// Simulation, design, or signals; see [`StudyError`].
pub fn reproduce(vehicle: &Vehicle, experiments: &[Experiment; 4]) -> Result<Chapter, StudyError> {
    let [e1, e2, e3, e4] = experiments;
    let experiments = [compare(vehicle, e1)?, compare(vehicle, e2)?, compare(vehicle, e3)?, compare(vehicle, e4)?];
    let statements = statements(vehicle, &experiments, &Without::run(vehicle, e1, e2)?);
    Ok(Chapter { experiments, statements })
}

/// A score that the experiment files are known to produce; a missing one reads as NaN and agrees with nothing.
const NONE: PhaseScore = PhaseScore {
    phase: Phase::BeforeShift,
    samples: 0,
    peak: f64::NAN,
    rms: f64::NAN,
    mean: f64::NAN,
    settling_s: None,
    chatter: f64::NAN,
};

fn of(comparison: &Comparison, name: &str, phase: Phase) -> PhaseScore {
    comparison.run(name).and_then(|run| run.pressure_in(phase)).copied().unwrap_or(NONE)
}

fn open(comparison: &Comparison, phase: Phase) -> PhaseScore {
    comparison.open_loop().and_then(|run| run.pressure_in(phase)).copied().unwrap_or(NONE)
}

fn shaft_rms(comparison: &Comparison, name: &str, phase: Phase) -> f64 {
    let shaft = comparison.run(name).and_then(|run: &ObserverRun| run.shaft.as_ref());
    shaft.and_then(|scores| scores.iter().find(|score| score.phase == phase)).map_or(f64::NAN, |score| score.rms)
}

/// How many times more the speeds accelerate per pressure in the inertia phase than in the torque phase.
fn visibility(vehicle: &Vehicle) -> f64 {
    let model = design::rigid_model(vehicle);
    let size = |phase| {
        let [turbine, slip] = model.influence(phase, vehicle.uncertainty.friction.0);
        turbine.hypot(slip)
    };
    size(I) / size(T)
}

/// Error of the estimate at the first sample of the inertia phase, Pa.
fn handed_over(comparison: &Comparison, name: &str) -> f64 {
    let (Some(run), Some(quality)) = (comparison.run(name), &comparison.quality) else { return f64::NAN };
    let at = run.time_s.partition_point(|&time| time < quality.inertia_phase_start_s);
    run.truth_pa.get(at).map_or(f64::NAN, |truth| (truth - run.estimates[at].pressure_pa).abs())
}

/// Drive-shaft torque at the start of the load transfer, N m.
fn shaft_before(comparison: &Comparison) -> f64 {
    let (Some(shaft), Some(quality)) = (comparison.trace.get(signal::SHAFT_TORQUE), &comparison.quality) else {
        return f64::NAN;
    };
    let at = comparison.trace.time_s.partition_point(|&time| time < quality.torque_phase_start_s);
    shaft.get(at).copied().unwrap_or(f64::NAN)
}

/// How much lower `ours` is, %.
fn reduction(ours: f64, theirs: f64) -> f64 {
    100.0 * (1.0 - ours / theirs)
}

fn in_mpa(pascal: f64) -> String {
    format!("{:.4} MPa", mpa(pascal))
}

fn verdict(agrees: bool) -> Verdict {
    if agrees { Verdict::Agrees } else { Verdict::Differs }
}

const RIGID: &str = "rigid ISS";
const COMPLIANT: &str = "compliant";
const COMPLIANT_SAMPLED: &str = "compliant, 100 Hz, sensors";
const T: Phase = Phase::TorquePhase;
const I: Phase = Phase::InertiaPhase;

fn statements(vehicle: &Vehicle, [e1, e2, e3, e4]: &[Comparison; 4], without: &Without) -> Vec<Statement> {
    let mut rows = nominal(vehicle, e1);
    rows.extend(off_nominal(e1, e2, without));
    rows.extend(sliding(vehicle, e3));
    rows.extend(compliant(e2, e4, without));
    rows.extend(offsets(e1, e2));
    rows
}

fn nominal(vehicle: &Vehicle, e1: &Comparison) -> Vec<Statement> {
    let (torque, inertia) = (of(e1, RIGID, T), of(e1, RIGID, I));
    let (open_t, open_i) = (open(e1, T), open(e1, I));
    let (peak, open_peak) = (torque.peak.max(inertia.peak), open_t.peak.max(open_i.peak));
    let lower = reduction(peak, open_peak);
    vec![
        Statement {
            experiment: "E1",
            claim: "The rigid observer’s error peak is lower than with L = 0",
            chapter: "about 35 % lower",
            ours: format!(
                "{} against {}: {:.0} % {}",
                in_mpa(peak),
                in_mpa(open_peak),
                lower.abs(),
                if lower < 0.0 { "higher" } else { "lower" }
            ),
            verdict: verdict(lower > 20.0),
            because: format!(
                "the peak of the whole shift lies in the torque phase, where the observer can do little about the \
                 valve’s delay; in the inertia phase its RMS error is {:.0} % lower",
                reduction(inertia.rms, open_i.rms)
            ),
        },
        Statement {
            experiment: "E1",
            claim: "Inertia-phase error within 0.05 MPa",
            chapter: "0.05 MPa",
            ours: format!("peak {}", in_mpa(inertia.peak)),
            verdict: verdict(inertia.peak <= 0.05e6),
            because: format!(
                "the torque phase hands over {}; RMS {}",
                in_mpa(handed_over(e1, RIGID)),
                in_mpa(inertia.rms)
            ),
        },
        Statement {
            experiment: "E1",
            claim: "The rigid observer is better in the inertia phase than in the torque phase",
            chapter: "much better",
            ours: format!("RMS {} against {}", in_mpa(inertia.rms), in_mpa(torque.rms)),
            verdict: verdict(inertia.rms < torque.rms),
            because: format!(
                "the speeds show the pressure {:.0} times more weakly in the torque phase",
                visibility(vehicle)
            ),
        },
        Statement {
            experiment: "E1",
            claim: "The rigid observer is acceptable in the torque phase",
            chapter: "acceptable; L = 0 shown beside it",
            ours: format!("RMS {} against {} open loop", in_mpa(torque.rms), in_mpa(open_t.rms)),
            verdict: verdict(torque.rms < open_t.rms),
            because: "there it is no better than the valve model alone".to_owned(),
        },
    ]
}

fn off_nominal(e1: &Comparison, e2: &Comparison, without: &Without) -> Vec<Statement> {
    let (torque, inertia) = (of(e2, RIGID, T), of(e2, RIGID, I));
    let nominal = of(e1, RIGID, T);
    let settled = inertia.settling_s.map_or_else(|| "never".to_owned(), |s| format!("after {:.0} ms", 1e3 * s));
    vec![
        Statement {
            experiment: "E2",
            claim: "Off-nominal, the rigid observer’s torque-phase error grows",
            chapter: "becomes larger",
            ours: format!("peak {} against {} nominal", in_mpa(torque.peak), in_mpa(nominal.peak)),
            verdict: verdict(torque.peak > nominal.peak),
            because: format!(
                "errors of turbine torque, mass and grade, which the rigid model does not know; on a level road its peak is {}",
                in_mpa(of(&without.grade, RIGID, T).peak)
            ),
        },
        Statement {
            experiment: "E2",
            claim: "Off-nominal, the inertia phase is still good",
            chapter: "still works well, acceptable",
            ours: format!("RMS {}, peak {}; below 0.05 MPa {settled}", in_mpa(inertia.rms), in_mpa(inertia.peak)),
            verdict: verdict(inertia.rms < open(e2, I).rms && inertia.settling_s.is_some_and(|s| s < 0.1)),
            because: format!(
                "the phase begins with the torque phase’s error; open loop has RMS {}",
                in_mpa(open(e2, I).rms)
            ),
        },
    ]
}

fn sliding(vehicle: &Vehicle, e3: &Comparison) -> Vec<Statement> {
    let inertia = |name| of(e3, name, I);
    let (large, small, iss) = (inertia("Sliding 1 (large)"), inertia("Sliding 2 (small)"), inertia("ISS, exact"));
    let lowered = inertia("ISS, Euler, lowered");
    let euler = inertia("ISS, Euler");
    let (least_euler, least_exact) = least_multipliers(vehicle, 0.01);
    vec![
        Statement {
            experiment: "E3",
            claim: "Sliding mode with large gains tracks but chatters",
            chapter: "no large errors, chatter",
            ours: format!("RMS {}, chatter {:.3} MPa", in_mpa(large.rms), mpa(large.chatter)),
            // Chatter is told from its absence by a factor of two, here and in the next two rows.
            verdict: verdict(large.chatter > 2.0 * small.chatter.max(iss.chatter)),
            because: format!("small gains chatter {:.3} MPa, ISS {:.3} MPa", mpa(small.chatter), mpa(iss.chatter)),
        },
        Statement {
            experiment: "E3",
            claim: "Sliding mode with small gains hardly chatters but errs",
            chapter: "few chatters, large errors",
            ours: format!("RMS {}, chatter {:.3} MPa", in_mpa(small.rms), mpa(small.chatter)),
            verdict: verdict(small.chatter < 0.5 * large.chatter && small.mean > iss.mean),
            because: format!("mean size {} against {} of ISS", in_mpa(small.mean), in_mpa(iss.mean)),
        },
        Statement {
            experiment: "E3",
            claim: "ISS neither chatters nor errs",
            chapter: "works well",
            ours: format!("RMS {}, chatter {:.3} MPa", in_mpa(iss.rms), mpa(iss.chatter)),
            verdict: verdict(iss.chatter < 0.5 * small.chatter && iss.rms < small.rms.min(large.rms)),
            because: format!("its mean size is {}", in_mpa(iss.mean)),
        },
        Statement {
            experiment: "E3",
            claim: "At 100 Hz the ISS gains must be lowered",
            chapter: "lowered to -1.8e4 and (-320, -540)",
            ours: format!(
                "RMS {} exact and {} Euler with full gains, {} lowered",
                in_mpa(iss.rms),
                in_mpa(euler.rms),
                in_mpa(lowered.rms)
            ),
            verdict: verdict(lowered.rms < iss.rms),
            because: format!(
                "an error is multiplied each sample by 1 + T (A22 - L G), at least {least_euler:.2} over all vertices, or \
                 exactly by Phi - L G Psi, at least {least_exact:.2}: both positive and below 1, so that the full gains \
                 neither oscillate nor diverge"
            ),
        },
    ]
}

/// The least factor by which a sample multiplies the error of the rigid observer, over both phases and all
/// vertices: by forward Euler and exactly.
fn least_multipliers(vehicle: &Vehicle, period_s: f64) -> (f64, f64) {
    let Ok(rigid) = design::design_rigid(vehicle) else { return (f64::NAN, f64::NAN) };
    let vertices = [&rigid.torque_phase, &rigid.inertia_phase].into_iter().flat_map(|certificate| {
        certificate.vertices.iter().map(|margin| (margin.vertex.a22_per_s, margin.decay_per_s))
    });
    vertices.fold((f64::INFINITY, f64::INFINITY), |(euler, exact), (a22, decay)| {
        let phi = (a22 * period_s).exp();
        let psi = (phi - 1.0) / a22;
        // The decay is that of A22 - L G, so L G = decay + A22.
        (euler.min(1.0 - period_s * decay), exact.min(phi - (decay + a22) * psi))
    })
}

fn compliant(e2: &Comparison, e4: &Comparison, without: &Without) -> Vec<Statement> {
    let (ours, rigid) = (of(e4, COMPLIANT, T), of(e4, RIGID, T));
    let (sampled, sampled_i) = (of(e4, COMPLIANT_SAMPLED, T), of(e4, COMPLIANT_SAMPLED, I));
    let (off, off_rigid, off_open) = (of(e2, COMPLIANT, T), of(e2, RIGID, T), open(e2, T));
    let lower = reduction(ours.rms, rigid.rms);
    let (shaft_t, shaft_i) = (shaft_rms(e4, COMPLIANT, T), shaft_rms(e4, COMPLIANT, I));
    vec![
        Statement {
            experiment: "E4",
            claim: "The compliant observer lowers the torque-phase error",
            chapter: "much smaller than the rigid observer’s",
            ours: format!("RMS {} against {}: {lower:.0} % lower", in_mpa(ours.rms), in_mpa(rigid.rms)),
            verdict: verdict(ours.rms < 0.5 * rigid.rms),
            because: format!(
                "what remains is tyre slip and the valve, which its model leaves out: {} with tyres that hardly slip, {} \
                 with a valve that obeys its model",
                in_mpa(of(&without.tyre_slip, COMPLIANT, T).rms),
                in_mpa(of(&without.valve_error, COMPLIANT, T).rms)
            ),
        },
        Statement {
            experiment: "E4",
            claim: "It gives the drive-shaft torque",
            chapter: "estimated too",
            ours: format!("RMS error {shaft_t:.0} N m in the torque phase, {shaft_i:.0} N m in the inertia phase"),
            verdict: verdict(shaft_t < 250.0 && shaft_i < 250.0),
            because: format!(
                "of {:.0} N m before the shift; in the torque phase {:.0} N m with tyres that hardly slip, {:.0} N m \
                 with a valve that obeys its model",
                shaft_before(e4),
                shaft_rms(&without.tyre_slip, COMPLIANT, T),
                shaft_rms(&without.valve_error, COMPLIANT, T)
            ),
        },
        Statement {
            experiment: "E4",
            claim: "It works at 100 Hz with quantised, noisy speeds",
            chapter: "works",
            ours: format!(
                "RMS {} in the torque phase, {} in the inertia phase",
                in_mpa(sampled.rms),
                in_mpa(sampled_i.rms)
            ),
            // An estimate that the valve model alone surpasses does not work.
            verdict: verdict(sampled.rms < open(e4, T).rms && sampled_i.rms < open(e4, I).rms),
            because: format!(
                "open loop has {} and {}; sensor noise makes the torque-phase estimate vary by {:.2} MPa in all",
                in_mpa(open(e4, T).rms),
                in_mpa(open(e4, I).rms),
                mpa(sampled.chatter)
            ),
        },
        Statement {
            experiment: "E2, E4",
            claim: "Off-nominal, the compliant observer’s torque-phase error stays small",
            chapter: "smaller than the rigid observer’s",
            ours: format!(
                "RMS {} against {} rigid and {} open loop",
                in_mpa(off.rms),
                in_mpa(off_rigid.rms),
                in_mpa(off_open.rms)
            ),
            verdict: verdict(off.rms < off_rigid.rms),
            because: format!(
                "the grade, which the model does not know, drives the wheel’s equation, and the gain carries it into the \
                 pressure: on a level road it is {} against {} rigid and {} open loop",
                in_mpa(of(&without.grade, COMPLIANT, T).rms),
                in_mpa(of(&without.grade, RIGID, T).rms),
                in_mpa(open(&without.grade, T).rms)
            ),
        },
    ]
}

fn offsets(e1: &Comparison, e2: &Comparison) -> Vec<Statement> {
    let row = |claim, chapter, offset: f64, name: &str, phase| {
        let (nominal, off) = (of(e1, name, phase), of(e2, name, phase));
        Statement {
            experiment: "E1, E2",
            claim,
            chapter,
            ours: format!(
                "{} certified; largest error {} nominal, {} off-nominal",
                in_mpa(offset),
                in_mpa(nominal.peak),
                in_mpa(off.peak)
            ),
            verdict: verdict(nominal.peak <= offset && off.peak <= offset),
            because:
                "the certificate bounds what remains after the initial error has decayed, for a valve that obeys its \
                      model; delay and lag of the real valve are outside it"
                    .to_owned(),
        }
    };
    vec![
        row("Certified offset, rigid observer, inertia phase", "0.05 MPa", e1.rigid.inertia_phase.offset_pa, RIGID, I),
        row(
            "Certified offset, rigid observer, torque phase",
            "not recoverable",
            e1.rigid.torque_phase.offset_pa,
            RIGID,
            T,
        ),
        row(
            "Certified offset, compliant observer, torque phase",
            "0.05 MPa",
            e1.compliant.torque_phase.offset_pa,
            COMPLIANT,
            T,
        ),
        row(
            "Certified offset, compliant observer, inertia phase",
            "not recoverable",
            e1.compliant.inertia_phase.offset_pa,
            COMPLIANT,
            I,
        ),
    ]
}
