//! Logs whose commands come late or early against the speeds.

use car::Car;
use car::ErrorBudget;
use observer::Health;
use observer::gearbox::ShiftInput;
use plant::car::CarModel;
use study::gearbox::ShiftDraw;
use study::gearbox::car_log::LogStep;
use study::gearbox::drive::ScoredDrive;
use study::gearbox::logged::LoggedDrive;
use study::gearbox::recording::Recording;
use study::gearbox::tour::drive_tour;

use super::cars::{Random, cars, cars_with_strokes, one_way, sensors};

/// Cars that are drawn of each gearbox; with more than one there are more cars and delays.
fn draws() -> u64 {
    std::env::var("DELAY_DRAWS").map_or(1, |draws| draws.parse().unwrap())
}

/// A drive through all gears of this car.
fn recorded(truth: Car, known: &Car) -> Recording {
    let (model, mut recording) = (CarModel::new(truth).unwrap(), Recording::default());
    drive_tour(&model, known, |sample| recording.push(sample), || ()).unwrap();
    recording
}

/// A car whose friction, converter, valves and strokes are within their bounds of the known one.
fn drawn(known: &Car, seed: u64) -> Car {
    let (mut random, errors) = (Random(seed), ErrorBudget::of_car(known));
    let draw = ShiftDraw::within(known, &errors, || random.uniform()).with_timing(&errors, || random.uniform());
    draw.with_strokes(known, || random.uniform()).car(known)
}

/// What is said of a drive whose commands come so many rows of 10 ms late.
fn said(known: &Car, recording: &Recording, late: isize) -> ScoredDrive {
    said_with(known, recording, late, |_| ())
}

/// The same with another change of the readings.
fn said_with(known: &Car, recording: &Recording, late: isize, change: impl Fn(&mut ShiftInput<f64>)) -> ScoredDrive {
    let (tables, sensors) = (LoggedDrive::tables(known, None).unwrap(), sensors());
    let mut logged = LoggedDrive::new(known, &tables, Some(&sensors), None);
    let inputs: Vec<_> = recording.inputs(known, &tables, &sensors, 1).collect();
    for (at, (sample, input)) in recording.samples.iter().zip(&inputs).enumerate() {
        let then = at.saturating_add_signed(-late).min(inputs.len() - 1);
        let mut input = ShiftInput { commands: inputs[then].commands, ..*input };
        change(&mut input);
        logged.push(&LogStep::of(sample.time_s, input));
    }
    logged.finish()
}

/// The delay that is said, ms: positive for commands that come late.
fn delay_ms(drive: &ScoredDrive) -> Option<f64> {
    let said = drive.warnings.iter().find_map(|warning| warning.split_once("come about "))?.1;
    let (number, rest) = said.split_once(" ms").unwrap();
    let late = if rest.trim_start_matches(" or more").starts_with(" too late") { 1.0 } else { -1.0 };
    Some(late * number.parse::<f64>().unwrap())
}

fn has_word(drive: &ScoredDrive) -> bool {
    drive.states.iter().any(|state| state.health == Health::CommandsMistimed)
}

/// Cars within the budget are right; of the same with commands that come 100 ms and more late or early it is said.
#[test]
fn commands_that_come_late_or_early_are_noticed() {
    let more = if draws() > 1 { cars_with_strokes() } else { Vec::new() };
    for known in cars().into_iter().chain([one_way()]).chain(more) {
        for seed in 1..=draws() {
            let recording = recorded(drawn(&known, seed), &known);
            let label = format!("{} {seed}", known.gearbox.name);
            let right = said(&known, &recording, 0);
            assert_eq!((delay_ms(&right), has_word(&right)), (None, false), "{label}: {:?}", right.warnings);
            for late in if draws() > 1 { vec![10, -10, 20, -20] } else { vec![10, -10] } {
                let wrong = said(&known, &recording, late);
                let found = delay_ms(&wrong).unwrap_or(f64::NAN);
                println!("{label}: {} ms, said {found} ms", 10 * late);
                assert!((found - 10.0 * late as f64).abs() < 45.0 && has_word(&wrong), "{label} {late}: {found}");
            }
        }
    }
}

/// All valves at one end of their bounds of lag and delay: as far as a right car can seem late or early.
#[test]
fn slow_and_fast_valves_are_no_delay_of_the_commands() {
    let known = cars().remove(0);
    for end in [0.0, 1.0] {
        let errors = ErrorBudget::of_car(&known);
        let draw = ShiftDraw::within(&known, &errors, || 0.5).with_timing(&errors, || end);
        let drive = said(&known, &recorded(draw.car(&known), &known), 0);
        assert_eq!(delay_ms(&drive), None, "{end}: {:?}", drive.warnings);
    }
}

/// What is outside the budget in another way is not called a delay.
#[test]
fn readings_of_another_scale_are_no_delay_of_the_commands() {
    let known = cars().remove(0);
    let recording = recorded(drawn(&known, 1), &known);
    let scaled = |commands: f64, engine: f64| {
        let drive = said_with(&known, &recording, 0, |input| {
            input.commands.iter_mut().flatten().for_each(|reading| reading.value *= commands);
            input.engine_rad_s.iter_mut().for_each(|reading| reading.value *= engine);
        });
        assert_eq!(delay_ms(&drive), None, "{commands} {engine}: {:?}", drive.warnings);
    };
    [(1.2, 1.0), (0.8, 1.0), (1.0, 0.95), (1.0, 1.1)]
        .into_iter()
        .for_each(|(commands, engine)| scaled(commands, engine));
}
