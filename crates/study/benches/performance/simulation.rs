//! Gain designs and simulated shifts.

use std::fmt::Write as _;
use std::hint::black_box;

use car::{Experiment, GainMethod};
use config::ExperimentFile;
use design::rigid::design_phase;
use design::{Model, Quantity, design_discrete_phase, requirement};
use observer::Phase;
use plant::{Powertrain, Simulation};

use crate::shared::{SAMPLE_TIME_S, vehicle};
use crate::{one, time};

/// Gain designs, and shifts of the plant.
pub(crate) fn designs_and_shifts(page: &mut String) {
    let vehicle = vehicle();
    let required = requirement(&vehicle, Phase::InertiaPhase).into();
    let five_steps = one(|| {
        black_box(design_phase(black_box(&vehicle), Phase::InertiaPhase, &required).unwrap());
    });
    let peak_to_peak = one(|| {
        black_box(
            design_discrete_phase(
                black_box(&vehicle),
                Model::Rigid,
                GainMethod::PeakToPeak,
                Quantity::ClutchTorque,
                Phase::InertiaPhase,
                SAMPLE_TIME_S,
            )
            .unwrap(),
        );
    });
    let drive = |sample_time_s: f64| {
        let experiment = Experiment { sample_time_s, ..ExperimentFile::e1().unwrap().experiment };
        one(|| {
            let mut sum = 0.0;
            plant::simulate(black_box(&vehicle), &experiment, |sample| sum += sample.oncoming_pa).unwrap();
            black_box(sum);
        })
    };
    let experiment = Experiment { sample_time_s: 0.01, ..ExperimentFile::e1().unwrap().experiment };
    let powertrain = Powertrain::new(vehicle.clone());
    let request_s = experiment.shift.request_s;
    let mut warm = Simulation::new(&powertrain, &vehicle, &experiment).unwrap();
    warm.advance(request_s, |_| {}).unwrap();
    let window = one(|| {
        let (mut shift, mut sum) = (black_box(&warm).clone(), 0.0);
        shift.advance(request_s + 1.5, |sample| sum += sample.oncoming_pa).unwrap();
        black_box(sum);
    });
    page.push_str("\n## Design and simulation\n\n| what | time | aim |\n|---|---|---|\n");
    let rows = [
        ("gain design of one phase, five steps", five_steps, "1 ms"),
        ("gain design of one phase, peak-to-peak", peak_to_peak, ""),
        ("a shift of 1.5 s from a warm state: 100 Hz controller, events, valve delays", window, "250 µs"),
        ("a launch and shift of 9.5 s, recorded every 10 ms", drive(0.01), "3 ms"),
        ("the same, recorded every 1 ms", drive(0.001), "3 ms"),
    ];
    for (name, seconds, aim) in rows {
        let _ = writeln!(page, "| {name} | {} | {aim} |", time(seconds));
    }
    page.push_str(
        "\nThe simulation keeps every state within 0.1 % of its range against a tolerance a hundred thousand times tighter:\n\
         `default_tolerance_is_good_to_a_thousandth_of_each_range` in `crates/plant/tests/shift.rs` checks that.\n",
    );
}
