//! One step of each observer.

use std::fmt::Write as _;
use std::hint::black_box;

use car::GainMethod;
use config::ExperimentFile;
use design::{
    Model, bounded, compliant_observer, design_compliant, design_discrete, design_rigid, design_sliding,
    extended_filter, inversion, kalman_filter, rigid_observer, sliding_observer, super_twisting, unscented_filter,
};
use observer::{Bounded, Estimator, Input, RigidGains, one_shift_filter};

use crate::bars::{self, Bar};
use crate::shared::{SAMPLE_TIME_S, samples, vehicle};
use crate::{Figure, LONG, fastest, time};

/// An observer over a shift.
fn over_shift<'a, O: Estimator<f64> + 'a>(observer: O, samples: &'a [Input<f64>]) -> Box<dyn FnMut() + 'a> {
    Box::new(move || {
        let mut state = observer.start();
        black_box(samples.iter().fold(0.0, |sum, x| sum + observer.step(&mut state, black_box(x)).pressure_pa));
    })
}

/// The table of all observers, with its figure.
pub(crate) fn steps(page: &mut String) -> Figure {
    let (vehicle, samples) = (vehicle(), samples());
    let sensors = ExperimentFile::bench().unwrap().experiment.sensors_given;
    let mut names = Vec::new();
    let mut jobs = Vec::new();
    // By itself, with its guaranteed ranges, and with the range of the shaft torque too.
    macro_rules! observer {
        ($name:expr, $observer:expr) => {
            let bounded = bounded(&vehicle, $observer);
            names.push($name);
            jobs.push(over_shift(bounded.observer, &samples));
            jobs.push(over_shift(Bounded { range: bounded.range.guaranteed(), ..bounded }, &samples));
            jobs.push(over_shift(bounded, &samples));
        };
    }
    let peak_to_peak =
        design_discrete(&vehicle, Model::Rigid, GainMethod::PeakToPeak, SAMPLE_TIME_S).unwrap().rigid_gains();
    observer!("gearbox filter", one_shift_filter(&vehicle, sensors.as_ref()));
    observer!("Kalman", kalman_filter(&vehicle, sensors.as_ref()));
    observer!("extended Kalman", extended_filter(&vehicle, sensors.as_ref()));
    observer!("unscented", unscented_filter(&vehicle, sensors.as_ref()));
    observer!("rigid", rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains()));
    observer!("rigid, peak-to-peak", rigid_observer(&vehicle, peak_to_peak));
    observer!("compliant", compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains()));
    observer!("sliding", sliding_observer(&vehicle, design_sliding(&vehicle)));
    observer!("super-twisting", super_twisting(&vehicle));
    observer!("inversion", inversion(&vehicle));
    observer!("open loop", rigid_observer(&vehicle, RigidGains::open_loop()));
    let times = fastest(2 * LONG, &mut jobs);
    page.push_str(
        "\n## One step of an observer, f64\n\nMean over the steps of a simulated shift of `experiments/bench.toml` at 100 Hz, through its sensors, from 1.2 s before the \
         request.\n\n![Time of a step of each observer](../figures/steps.svg)\n\n\
         | observer | by itself | with the guaranteed ranges of pressure and torque | with the expected range of the shaft torque too |\n\
         |---|---|---|---|\n",
    );
    let mut bars = Vec::new();
    for (name, times) in names.iter().zip(times.chunks(3)) {
        let step_s = [times[0], times[1], times[2]].map(|seconds| seconds / samples.len() as f64);
        let [alone, guaranteed, all] = step_s.map(time);
        let _ = writeln!(page, "| {name} | {alone} | {guaranteed} | {all} |");
        let [alone, guaranteed, all] = step_s.map(|seconds| 1e9 * seconds);
        let parts = vec![alone, (guaranteed - alone).max(0.0), (all - guaranteed).max(0.0)];
        bars.push(Bar { label: (*name).to_owned(), parts });
    }
    (
        "steps.svg",
        bars::svg("time of a step, ns", &["observer", "guaranteed ranges", "range of the shaft torque"], &bars),
    )
}
