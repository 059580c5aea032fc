//! A shift of 1.5 s, simulated and estimated, beside SciPy's integrator, which only simulates it.

use std::fmt::Write as _;
use std::hint::black_box;
use std::process::Command;
use std::time::Duration;

use car::Experiment;
use config::ExperimentFile;
use design::{bounded, kalman_filter};
use drivetrain::{AccelerationRow, Clutch, Engagement};
use observer::{Bounded, Estimator as _};
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::{Contact, Direction, HybridIntegrator, Inputs, Mode, Powertrain, Simulation, State};

use super::error;
use super::outside::{answer, field, folder, numbers};
use crate::shared::{SAMPLE_TIME_S, samples};
use crate::{fastest, time};

/// How long the shift is followed, s.
const SPAN_S: f64 = 1.5;
/// Error that SciPy may have at the end, relative to the range of each state: a hundred times the tolerance, since a shift adds up its errors.
const MAX_ERROR: f64 = 1e-3;
/// Clutches in the modes of another program: the sign of the slip, or 0.
type Signs = [f64; 2];

/// A shift from its request on, under the commands that a controller gave in it.
pub(super) struct Shift<'a> {
    powertrain: &'a Powertrain,
    start: State,
    pieces: Vec<Inputs>,
}

impl<'a> Shift<'a> {
    /// The shift of experiment E1.
    pub(super) fn new(powertrain: &'a Powertrain) -> Self {
        let experiment = Experiment { sample_time_s: SAMPLE_TIME_S, ..ExperimentFile::e1().unwrap().experiment };
        let request_s = experiment.shift.request_s;
        let mut samples = Vec::new();
        let mut simulation = Simulation::new(powertrain, &powertrain.vehicle, &experiment).unwrap();
        simulation.advance(request_s + SPAN_S, |sample| samples.push(*sample)).unwrap();
        samples.retain(|sample| sample.time_s >= request_s);
        let inputs = samples.iter().map(|sample| {
            let commands = sample.commands;
            Inputs::arrived(&powertrain.vehicle, commands.throttle, commands.offgoing, commands.oncoming)
        });
        Self { powertrain, start: samples[0].state, pieces: inputs.collect() }
    }

    fn begun(&self) -> HybridIntegrator {
        HybridIntegrator::new(self.powertrain, 0.0, self.start, &self.pieces[0]).unwrap()
    }

    /// The plant at the end.
    fn simulated(&self) -> HybridIntegrator {
        let mut plant = self.begun();
        for (piece, inputs) in (1_u32..).zip(&self.pieces) {
            plant.advance(self.powertrain, inputs, f64::from(piece) * SAMPLE_TIME_S, &mut |_| {}).unwrap();
        }
        plant
    }

    /// The time of SciPy, s; none where it is not there.
    ///
    /// # Panics
    /// Its shift is another one.
    pub(super) fn scipy(&self, parameters: &str) -> Option<f64> {
        let said = numbers(&answer(Command::new("python3").arg(folder().join("shift.py")), parameters)?)?;
        let (seconds, rest) = said.split_first()?;
        let (signs, end) = rest.split_at_checked(2)?;
        let own = self.simulated();
        assert_eq!(signs, signs_of(own.mode()), "the mode at the end of a shift");
        let error = error(&end.try_into().ok()?, &own.state().to_array());
        assert!(error < MAX_ERROR, "a shift in SciPy ends elsewhere: error {error:.1e}");
        Some(*seconds)
    }

    /// Time to simulate and to estimate it, s.
    fn seconds(&self) -> f64 {
        let bounded = bounded(&self.powertrain.vehicle, kalman_filter(&self.powertrain.vehicle, None));
        let observer = Bounded { range: bounded.range.guaranteed(), ..bounded };
        let samples = samples();
        let job = || {
            black_box(black_box(self).simulated().time_s());
            let mut state = observer.start();
            black_box(samples.iter().fold(0.0, |sum, x| sum + observer.step(&mut state, black_box(x)).pressure_pa));
        };
        fastest(Duration::from_secs(1), &mut [Box::new(job)])[0]
    }

    /// What another program needs of it.
    pub(super) fn parameters(&self) -> String {
        let v = &self.powertrain.vehicle;
        let of = |row: fn(&drivetrain::ShiftCoefficients<f64>) -> AccelerationRow<f64>| {
            let engagements =
                [Engagement::BothSlipping, Engagement::OffgoingStuck, Engagement::OncomingStuck, Engagement::BothStuck];
            engagements.into_iter().flat_map(|engagement| cells(&row(&v.shift.coefficients(engagement)))).collect()
        };
        let clutch = |clutch: &Clutch<f64>| {
            [clutch.lever(), clutch.piston_area_m2, clutch.return_spring_n, clutch.static_friction]
        };
        let piece = |inputs: &Inputs| [inputs.throttle, inputs.offgoing_settled_pa, inputs.oncoming_settled_pa];
        let fields: [(&str, Vec<f64>); 10] = [
            ("turbine_rows", of(|gear| gear.turbine)),
            ("output_rows", of(|gear| gear.output)),
            ("offgoing_rows", of(|gear| gear.holding_offgoing)),
            ("oncoming_rows", of(|gear| gear.holding_oncoming)),
            ("slip_rows", [v.shift.slip_offgoing, v.shift.slip_oncoming].concat()),
            ("clutches", [clutch(&v.offgoing.clutch), clutch(&v.oncoming.clutch)].concat()),
            ("shift_start", self.start.to_array().to_vec()),
            ("shift_mode", signs_of(self.begun().mode()).to_vec()),
            ("piece", vec![SAMPLE_TIME_S, RELATIVE_TOLERANCE]),
            ("pieces", self.pieces.iter().flat_map(piece).collect()),
        ];
        fields.into_iter().map(|(name, values)| field(name, &values)).collect()
    }

    /// Writes the comparison.
    pub(super) fn write(&self, page: &mut String, parameters: &str) {
        let own = 1000.0 * self.seconds();
        let _ = match self.scipy(parameters).map(|seconds| 1000.0 * seconds) {
            Some(theirs) => writeln!(
                page,
                "A thousand shifts of {SPAN_S} s under commands that change every 10 ms, in which clutches break away and stick, are simulated and estimated with \
                 guaranteed ranges in {}.\nSciPy `solve_ivp` with LSODA and events, on the same equations in Python, needs {} to simulate them: {:.0} times as long.",
                time(own),
                time(theirs),
                theirs / own
            ),
            None => writeln!(page, "A thousand shifts of {SPAN_S} s are simulated and estimated in {}.", time(own)),
        };
    }
}

fn cells(row: &AccelerationRow<f64>) -> [f64; 4] {
    [row.per_turbine_torque, row.per_offgoing_torque, row.per_oncoming_torque, row.per_output_torque]
}

fn signs_of(mode: Mode) -> Signs {
    [mode.offgoing, mode.oncoming].map(|contact| match contact {
        Contact::Stuck => 0.0,
        Contact::Slipping(direction) => Direction::sign(direction),
    })
}
