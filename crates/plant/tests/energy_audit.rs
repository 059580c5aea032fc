//! What the engine gives is stored or dissipated, and the audit notices a missing term.

use crate::common::{e1, each_step, vehicle};
use car::Experiment;
use plant::{PowerBalance, Powertrain, stored_energy};

/// Energies of a whole drive, J.
struct Audit {
    engine: f64,
    sinks: Vec<(&'static str, f64)>,
    stored: f64,
}

/// E1 uphill, with clutch B overfilled and clutch A released too late, so that every term of the balance is at work.
fn uphill() -> Experiment {
    let mut experiment = e1();
    experiment.off_nominal.grade_rad = Some(0.03);
    experiment.shift.transfer_holding_margin = 1.4;
    experiment.shift.boost_s = 0.06;
    experiment
}

/// The powers are integrated over each step of the simulation by Gauss's rule with three points on the dense output.
fn audit(experiment: &Experiment) -> Audit {
    const GAUSS: [(f64, f64); 3] =
        [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
    let powertrain = Powertrain::new(experiment.simulated_vehicle(&vehicle()));
    let mut audit = Audit { engine: 0.0, sinks: Vec::new(), stored: 0.0 };
    let (mut first, mut last) = (None, None);
    each_step(&powertrain, experiment, STEP_TOLERANCE, |step| {
        let length = step.end_s - step.start_s;
        for (at, weight) in GAUSS {
            let state = step.at(step.start_s + at * length);
            let balance = PowerBalance::of(&powertrain, step.mode, &state, step.inputs);
            audit.engine += weight * length * balance.engine_w;
            audit.sinks.resize(balance.sinks.len(), ("", 0.0));
            for (sum, (name, watts)) in audit.sinks.iter_mut().zip(balance.sinks) {
                *sum = (name, sum.1 + weight * length * watts);
            }
        }
        first.get_or_insert(step.at(step.start_s));
        last = Some(step.at(step.end_s));
    });
    audit.stored = stored_energy(&powertrain, &last.unwrap()) - stored_energy(&powertrain, &first.unwrap());
    audit
}

/// Of the energy that the engine gives, this part may be unaccounted for: a hundred times the tolerance of
/// each step, for their sum over the drive and for the kinks of the maps within a step.
const TOLERANCE: f64 = 100.0 * STEP_TOLERANCE;
const STEP_TOLERANCE: f64 = 1e-9;

impl Audit {
    /// Energy that is unaccounted for, J, if one sink is left out.
    fn missing(&self, without: &str) -> f64 {
        let lost: f64 = self.sinks.iter().filter(|(name, _)| *name != without).map(|(_, joules)| joules).sum();
        self.engine - lost - self.stored
    }
}

#[test]
fn power_in_is_stored_or_dissipated() {
    let audit = audit(&uphill());
    let missing = audit.missing("");
    assert!(missing.abs() < TOLERANCE * audit.engine, "{missing} J of {} J are missing", audit.engine);
}

/// The accelerator is released and pressed in 1st gear, over a gap in the driveline; both clutches drag and fill.
#[test]
fn backlash_drag_and_stroke_neither_make_nor_lose_energy() {
    let mut experiment = uphill();
    experiment.off_nominal.backlash_rad = Some(0.03);
    experiment.off_nominal.tip_out_s = Some([5.0, 5.6]);
    experiment.off_nominal.clutch_drag_n_m = 8.0;
    experiment.off_nominal.piston_stroke = Some(true);
    let audit = audit(&experiment);
    let missing = audit.missing("");
    assert!(missing.abs() < TOLERANCE * audit.engine, "{missing} J of {} J are missing", audit.engine);
}

#[test]
fn the_audit_fails_when_any_term_is_dropped() {
    let audit = audit(&uphill());
    for (name, _) in &audit.sinks {
        let missing = audit.missing(name);
        assert!(missing.abs() > TOLERANCE * audit.engine, "without {name} only {missing} J are missing");
    }
    assert!(audit.stored > TOLERANCE * audit.engine);
}
