//! The certified offsets: the chapter's figure and ours, and whether the error respects ours.
//!
//! An offset, Eq. (2.42) and (2.81), bounds what remains of the error. It is tested three times: after the initial
//! error has decayed; from the start of the phase with the initial error in the bound, Eq. (2.40); and from the start of the
//! phase alone, which the theorem does not claim. The initial error has decayed after `4/kappa2`, the settling time of the
//! certificate: `exp(-4)`, 2 %, of it remains.

use car::Vehicle;
use design::compliant::{PRESSURE_UNIT_PA, SHAFT_UNIT_N_M, compliant_requirement, design_compliant_phase};
use design::{Certificate, CompliantCertificate, error_bound};
use drivetrain::Real;
use nalgebra::DMatrix;
use observer::Phase;
use trace::signal;

use super::rows::{CHAPTER_COMPLIANT, COMPLIANT, I, RIGID, T};
use super::statement::{BoundCheck, Case, Figure, Statement, Unit};
use crate::{Comparison, StudyError};

/// Time constants of `kappa2` after which an error has settled: the chapter's, from which it has `kappa2`.
const SETTLING: f64 = 4.0;
/// `H` of Eq. (2.86): turbine torque 15 % off, mass and grade.
const CHAPTER_H: [f64; 4] = [2.38, 0.0, 0.0, 0.13];

/// What a certificate says about the pressure.
#[derive(Clone, Copy)]
struct Offset {
    offset_pa: f64,
    kappa2_per_s: f64,
}

impl From<&Certificate> for Offset {
    fn from(certificate: &Certificate) -> Self {
        Self { offset_pa: certificate.offset_pa, kappa2_per_s: certificate.kappa2_per_s }
    }
}

impl From<&CompliantCertificate> for Offset {
    fn from(certificate: &CompliantCertificate) -> Self {
        Self { offset_pa: certificate.offset_pa, kappa2_per_s: certificate.kappa2_per_s }
    }
}

/// The errors of one observer in one phase, as far as the observer is in this phase too.
struct Errors {
    since_s: Vec<f64>,
    pressure_pa: Vec<f64>,
    /// Size of the error at first, of all that the certificate is about, in units of the pressure.
    initial_pa: f64,
}

impl Errors {
    fn of(comparison: &Comparison, name: &str, phase: Phase) -> Option<Self> {
        let run = comparison.run(name)?;
        let shaft = comparison.trace.get(signal::SHAFT_TORQUE)?;
        let mut errors = Self { since_s: Vec::new(), pressure_pa: Vec::new(), initial_pa: 0.0 };
        let mut start_s = None;
        for (i, &time_s) in run.time_s.iter().enumerate() {
            let estimate = &run.estimates[i];
            let at = comparison.trace.time_s.partition_point(|&t| t < time_s - 1e-9);
            if estimate.phase != phase || comparison.phases.get(at) != Some(&phase) {
                continue;
            }
            let pressure_pa = (run.truth_pa[i] - estimate.pressure_pa).abs();
            let started_s = *start_s.get_or_insert_with(|| {
                let shaft_n_m = estimate.shaft_torque_n_m.map_or(0.0, |torque| shaft[at] - torque);
                errors.initial_pa = Real::hypot(pressure_pa, shaft_n_m * PRESSURE_UNIT_PA / SHAFT_UNIT_N_M);
                time_s
            });
            errors.since_s.push(time_s - started_s);
            errors.pressure_pa.push(pressure_pa);
        }
        start_s.map(|_| errors)
    }

    fn check(&self, offset: Offset) -> BoundCheck {
        let Offset { offset_pa, kappa2_per_s } = offset;
        let decayed_after_s = SETTLING / kappa2_per_s;
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NAN, f64::max);
        let samples = || self.since_s.iter().copied().zip(self.pressure_pa.iter().copied());
        let after = largest(&mut samples().filter(|&(since_s, _)| since_s >= decayed_after_s).map(|(_, error)| error));
        let from_start = largest(&mut self.pressure_pa.iter().copied());
        let bound = |since_s| error_bound(offset_pa, kappa2_per_s, self.initial_pa, since_s);
        let fraction = largest(&mut samples().skip(1).map(|(since_s, error)| error / bound(since_s)));
        BoundCheck {
            bound_pa: offset_pa,
            decayed_after_s,
            largest_after_decay_pa: after,
            holds: (!after.is_nan()).then_some(after <= offset_pa),
            largest_share_of_bound: fraction,
            holds_with_initial_error: fraction <= 1.0,
            largest_from_start_pa: from_start,
            holds_at_start: from_start <= offset_pa,
        }
    }
}

/// The torque phase's certificate of the compliant observer with the chapter's errors and decay rates.
fn with_chapter_errors(vehicle: &Vehicle) -> Result<CompliantCertificate, StudyError> {
    let mut requirement = compliant_requirement(vehicle, T);
    requirement.h = DMatrix::from_row_slice(2, 2, &CHAPTER_H);
    requirement.w_max = 1.0;
    Ok(design_compliant_phase(vehicle, T, &requirement)?)
}

/// The rows of all certificates: the chapter's figure is compared once, the error in E1 and in E2.
pub(super) fn rows(vehicle: &Vehicle, [e1, e2, _, e4]: &[Comparison; 4]) -> Result<Vec<Statement>, StudyError> {
    let (rigid, compliant) = (&e1.rigid, &e1.compliant);
    let chapter_errors = with_chapter_errors(vehicle)?;
    let certified = [
        Certified {
            id: "offset_rigid_inertia_phase",
            claim: "Certified offset, rigid observer, inertia phase",
            chapter: Some(0.05e6),
            case: None,
            offset: (&rigid.inertia_phase).into(),
            phase: I,
            runs: [(e1, RIGID), (e2, RIGID)],
        },
        Certified {
            id: "offset_rigid_torque_phase",
            claim: "Certified offset, rigid observer, torque phase",
            chapter: None,
            case: None,
            offset: (&rigid.torque_phase).into(),
            phase: T,
            runs: [(e1, RIGID), (e2, RIGID)],
        },
        Certified {
            id: "offset_compliant_torque_phase",
            claim: "Certified offset, compliant observer, torque phase",
            chapter: Some(0.05e6),
            case: Some(Case::ChapterErrors),
            offset: (&chapter_errors).into(),
            phase: T,
            runs: [(e4, CHAPTER_COMPLIANT), (e2, CHAPTER_COMPLIANT)],
        },
        Certified {
            id: "offset_compliant_torque_phase",
            claim: "Certified offset, compliant observer, torque phase",
            chapter: None,
            case: Some(Case::BudgetErrors),
            offset: (&compliant.torque_phase).into(),
            phase: T,
            runs: [(e1, COMPLIANT), (e2, COMPLIANT)],
        },
        Certified {
            id: "offset_compliant_inertia_phase",
            claim: "Certified offset, compliant observer, inertia phase",
            chapter: None,
            case: None,
            offset: (&compliant.inertia_phase).into(),
            phase: I,
            runs: [(e1, COMPLIANT), (e2, COMPLIANT)],
        },
    ];
    Ok(certified.iter().flat_map(Certified::rows).collect())
}

/// A certificate and the runs that it is tested on.
struct Certified<'a> {
    id: &'static str,
    claim: &'static str,
    chapter: Option<f64>,
    case: Option<Case>,
    offset: Offset,
    phase: Phase,
    runs: [(&'a Comparison, &'static str); 2],
}

/// A figure agrees with the chapter's one digit if it rounds to it.
const ROUNDING_PA: f64 = 0.005e6;

impl Certified<'_> {
    fn rows(&self) -> [Statement; 2] {
        let row = |at: usize, experiment| {
            let (comparison, name) = self.runs[at];
            // The certificate is that of E1 again.
            let chapter = self.chapter.filter(|_| at == 0);
            let bound = Errors::of(comparison, name, self.phase).map(|errors| errors.check(self.offset));
            let figure = |name, value| Figure { name, value, unit: Unit::Pascal };
            Statement {
                id: self.id,
                experiment,
                claim: self.claim,
                case: self.case,
                chapter_says: match (chapter, self.case, at) {
                    (Some(_), ..) => "0.05 MPa",
                    (None, None, 0) => "not recoverable",
                    (None, ..) => "",
                },
                chapter,
                quantity: "offset",
                ours: self.offset.offset_pa,
                unit: Unit::Pascal,
                criterion: "0.05 MPa, rounded to its digits",
                agrees: chapter.map(|pa| (self.offset.offset_pa - pa).abs() < ROUNDING_PA),
                figures: (bound.iter())
                    .flat_map(|bound| {
                        [
                            figure("largest error after decay", bound.largest_after_decay_pa),
                            figure("largest error from the start", bound.largest_from_start_pa),
                        ]
                    })
                    .collect(),
                bound,
                share_of_settings: None,
                because: String::new(),
            }
        };
        [row(0, "E1"), row(1, "E2")]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFSET: Offset = Offset { offset_pa: 50e3, kappa2_per_s: 40.0 };

    /// Errors over 0.3 s every millisecond.
    fn errors(error_pa: impl Fn(f64) -> f64) -> Errors {
        let since_s: Vec<f64> = (0..300).map(|i| f64::from(i) * 1e-3).collect();
        let pressure_pa: Vec<f64> = since_s.iter().map(|&t| error_pa(t)).collect();
        Errors { initial_pa: pressure_pa[0], since_s, pressure_pa }
    }

    #[test]
    fn an_initial_error_that_decays_with_kappa2_breaks_the_offset_only_at_the_start() {
        let check = errors(|t| 80e3 * (-40.0 * t).exp()).check(OFFSET);
        assert_eq!((check.holds, check.holds_with_initial_error, check.holds_at_start), (Some(true), true, false));
        assert!((check.decayed_after_s - 0.1).abs() < 1e-12);
        assert!((check.largest_after_decay_pa - 80e3 * (-4.0_f64).exp()).abs() < 1.0);
    }

    #[test]
    fn an_error_that_remains_above_the_offset_breaks_it_everywhere() {
        let check = errors(|_| 50.1e3).check(OFFSET);
        assert_eq!((check.holds, check.holds_with_initial_error, check.holds_at_start), (Some(false), false, false));
    }

    #[test]
    fn an_error_that_decays_too_slowly_breaks_the_bound_though_it_is_small_at_last() {
        let check = errors(|t| 80e3 * (-20.0 * t).exp()).check(OFFSET);
        assert_eq!((check.holds, check.holds_with_initial_error), (Some(true), false));
    }

    #[test]
    fn of_a_phase_that_ends_before_the_decay_nothing_is_said() {
        let mut short = errors(|_| 10e3);
        short.since_s.truncate(50);
        short.pressure_pa.truncate(50);
        let check = short.check(OFFSET);
        assert_eq!((check.holds, check.holds_at_start), (None, true));
        assert!(check.largest_after_decay_pa.is_nan());
    }
}
