//! The Kalman filter on readings as the field gives them: wrong, late, lost, in single precision, from any moment on.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;

use config::{Experiment, Study, Vehicle};
use design::{kalman_filter, open_loop_maps, rigid_observer};
use observer::{ChannelHealth, Estimate, Estimator, Health, Input, Phase, Reading, RigidGains};
use study::sampling::through_sensors;
use study::{Campaign, Consistency, RunColumns, simulate_drive, true_phases};
use trace::{Trace, signal};

const SAMPLE_S: f64 = 0.01;

/// The drive of the field, with readings of some of its scenarios.
struct Field {
    vehicle: Vehicle,
    experiment: Experiment,
    drive: Trace,
}

/// A row of a log: what came, and the true phase and pressure.
type Row = (Input<f64>, Phase, f64);

impl Field {
    fn new() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/field.toml");
        let experiment = Experiment::read(&path).unwrap();
        let vehicle = experiment.read_vehicle().unwrap();
        let drive = simulate_drive(&vehicle, &experiment).unwrap();
        Self { vehicle, experiment, drive }
    }

    fn rows(&self, scenario: &str) -> Vec<Row> {
        let scenario = self.experiment.scenarios.iter().find(|known| known.name == scenario).unwrap();
        let sensors = self.experiment.with_scenario(scenario).sensors.unwrap();
        let measured = through_sensors(&self.drive, SAMPLE_S, &sensors, &self.vehicle);
        let columns = RunColumns::of(&measured, &self.vehicle).unwrap();
        let truth = measured.get(signal::ONCOMING_PRESSURE).unwrap();
        let phases = true_phases(&measured).unwrap();
        columns.samples().enumerate().map(|(i, sample)| (sample.unwrap().0, phases[i], truth[i])).collect()
    }

    fn estimates(&self, observer: &impl Estimator<f64>, rows: &[Row]) -> Vec<Estimate<f64>> {
        let mut state = observer.start();
        rows.iter().map(|(input, ..)| observer.step(&mut state, input)).collect()
    }

    fn kalman(&self, rows: &[Row]) -> Vec<Estimate<f64>> {
        self.estimates(&kalman_filter(&self.vehicle, self.experiment.sensors_told.as_ref()), rows)
    }
}

/// RMS error of the pressure in a phase, Pa.
fn rms(rows: &[Row], estimates: &[Estimate<f64>], phase: Phase) -> f64 {
    let errors: Vec<f64> = (rows.iter().zip(estimates))
        .filter(|((_, now, _), _)| *now == phase)
        .map(|((.., truth), estimate)| (estimate.pressure_pa - truth).powi(2))
        .collect();
    (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()
}

const SHIFT: [Phase; 2] = [Phase::TorquePhase, Phase::InertiaPhase];

#[test]
fn an_error_of_a_reading_costs_little() {
    let field = Field::new();
    let open = rigid_observer(&field.vehicle, RigidGains::open_loop());
    for scenario in [
        "nominal",
        "wheel scale +2 %",
        "wheel scale -2 %",
        "wheel 30 ms late",
        "output 10 ms late",
        "turbine 10 ms late",
        "one turbine outlier, 5 rad/s",
        "one wheel outlier, 5 rad/s",
        "one wheel reading missing",
        "3 % of all readings missing",
        "wheel at 50 Hz",
        "a bad log",
    ] {
        let rows = field.rows(scenario);
        let (kalman, open) = (field.kalman(&rows), field.estimates(&open, &rows));
        for phase in SHIFT {
            let ratio = rms(&rows, &kalman, phase) / rms(&rows, &open, phase);
            // Single draws of the noise; the mean of ten is below 0.2 but for a late turbine (`wetclutch bench`).
            assert!(ratio < 0.45, "{scenario}, {phase:?}: {ratio:.2} of the open loop's error");
        }
        assert!(kalman.iter().all(|estimate| estimate.health != Health::Restarted), "{scenario}");
    }
}

#[test]
fn what_is_missing_or_refused_is_said_of_its_channel() {
    let field = Field::new();
    let mut rows = field.rows("nominal");
    let at = rows.len() - 60;
    rows[at].0.wheel_rad_s.as_mut().unwrap().value += 8.0;
    rows[at + 1].0.turbine_rad_s = None;
    rows[at + 2].0.engine_rad_s.as_mut().unwrap().value = f64::INFINITY;
    rows[at + 3].0.command = Some(Reading::now(-1.0));
    for row in &mut rows[at + 10..] {
        row.0.wheel_rad_s = None;
    }
    let estimates = field.kalman(&rows);
    let channels = |step: usize| estimates[at + step].channels;
    assert_eq!((channels(0).wheel, estimates[at].health), (ChannelHealth::Refused, Health::ReadingRefused));
    assert_eq!((channels(1).turbine, channels(1).output), (ChannelHealth::Absent, ChannelHealth::Good));
    assert_eq!(channels(2).engine, ChannelHealth::Refused);
    assert_eq!((channels(3).command, estimates[at + 3].health), (ChannelHealth::Refused, Health::CommandRejected));
    assert_eq!(channels(11).wheel, ChannelHealth::Absent);
    assert_eq!((channels(45).wheel, estimates[at + 45].health), (ChannelHealth::Lost, Health::ChannelLost));
}

#[test]
fn the_filter_is_as_sure_as_it_may_be_and_the_same_in_single_precision() {
    let field = Field::new();
    let mut all = Consistency::default();
    for scenario in &field.experiment.scenarios {
        let varied = field.experiment.with_scenario(scenario);
        let sample_s = varied.observers[0].sample_time_s;
        let measured = through_sensors(&field.drive, sample_s, &varied.sensors.unwrap(), &field.vehicle);
        let filter = kalman_filter(&field.vehicle, varied.sensors_told.as_ref());
        let columns = RunColumns::of(&measured, &field.vehicle).unwrap();
        all = all.with(&Consistency::of(&filter, &measured, &columns).unwrap());
    }
    assert!(all.inside_share() > 0.93, "{all:?}");
    // From above alone: a budget is wider than any one car.
    assert!(all.nees() < 1.2 && all.nis().iter().all(|nis| *nis < 1.2), "{all:?}");
    assert!(all.same_share() > 0.99 && all.excess_in_single().abs() < 0.02 && all.restarts == 0, "{all:?}");
}

#[test]
fn what_is_learnt_in_a_launch_is_no_more_than_twice_too_sure() {
    const SCALE: usize = 10;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/combined.toml");
    let campaign = Campaign::new(Study::read(&path).unwrap()).unwrap();
    let mut squares = [0.0; 3];
    const RUNS: u64 = 24;
    for run in 0..RUNS {
        let full = campaign.run_in_full(run).unwrap();
        let (vehicle, experiment) = (&full.varied.vehicle, &full.varied.experiment);
        let sensors = experiment.sensors.unwrap();
        let measured = through_sensors(&full.trace, SAMPLE_S, &sensors, vehicle);
        let filter = kalman_filter(vehicle, experiment.sensors_told.as_ref());
        let mut state = filter.start();
        let columns = RunColumns::of(&measured, vehicle).unwrap();
        for (sample, time_s) in columns.samples().zip(&measured.time_s) {
            if *time_s > experiment.shift.request_s {
                break;
            }
            filter.step(&mut state, &sample.unwrap().0);
        }
        let states = state.states().unwrap();
        // The filter counts delays from the turbine's.
        let truth = [
            sensors.wheel.errors.scale - 1.0,
            sensors.wheel.delay_s - sensors.turbine.delay_s,
            sensors.output.delay_s - sensors.turbine.delay_s,
        ];
        for (k, truth) in truth.into_iter().enumerate() {
            let (mean, deviation) = states[SCALE + k];
            squares[k] += ((mean - truth) / deviation).powi(2) / RUNS as f64;
        }
    }
    let too_sure = squares.map(f64::sqrt);
    assert!(too_sure.iter().all(|&times| times < 2.0), "{too_sure:?}");
}

#[test]
fn a_log_may_begin_at_any_moment() {
    let field = Field::new();
    let rows = field.rows("nominal");
    let first = |phase: Phase| rows.iter().position(|(_, now, _)| *now == phase).unwrap();
    for (name, from) in [
        ("in first gear", first(Phase::TorquePhase) - 80),
        ("in the torque phase", first(Phase::TorquePhase) + 10),
        ("in the inertia phase", first(Phase::InertiaPhase) + 10),
        ("in second gear", first(Phase::AfterShift) + 100),
    ] {
        let rows = &rows[from..];
        let estimates = field.kalman(rows);
        // The first command is taken to have stood for long; what it did before fades with the lag of the valve. After
        // lock-up the pressure rises by 10 MPa/s, and the middle of the delay budget is up to 15 ms off.
        for ((row, estimate), step) in rows.iter().zip(&estimates).zip(0..) {
            let error = (estimate.pressure_pa - row.2).abs();
            let allowed = if step < 30 { 0.3e6 } else { 0.15e6 };
            assert!(error < allowed, "{name}, step {step}: {error} Pa");
        }
        assert!(estimates.iter().all(|estimate| estimate.health != Health::Restarted), "{name}");
    }
    let second_gear = field.kalman(&rows[first(Phase::AfterShift) + 100..]);
    assert_eq!(second_gear[3].phase, Phase::AfterShift);
}

#[test]
fn the_valve_maps_alone_believe_no_speed() {
    let field = Field::new();
    let maps = open_loop_maps(&field.vehicle);
    let pressures = |scenario: &str| -> Vec<f64> {
        field.estimates(&maps, &field.rows(scenario)).iter().map(|estimate| estimate.pressure_pa).collect()
    };
    assert_eq!(pressures("nominal"), pressures("wheel scale +2 %"));
}
