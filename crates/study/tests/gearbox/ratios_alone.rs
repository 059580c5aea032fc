//! A gearbox of which the ratios alone are known: the torque of its clutches at the turbine.

use std::fmt::Write as _;

use car::ErrorBudget;
use car::{Car, ShiftCommand};
use config::{CarFile, DriveFile, Source};
use observer::Health;
use observer::gearbox::ShiftPhase;
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarSample, CarShift, simulate_car_drive};
use study::gearbox::car_log::LogStep;
use study::gearbox::logged::LoggedDrive;
use study::gearbox::recording::Recording;
use study::gearbox::{inputs, simulated};

use super::cars::{car_files, sensors};

/// Up through the gears under power and down again, twice.
const DRIVE: &str = "name = \"d\"\nsample_time_s = 0.001\nrepetitions = 2\n[[segment]]\nduration_s = 25\nthrottle = [0.1, 0.35]\n\
    [[segment]]\nduration_s = 12\nthrottle = 0.0\nbrake = 0.12\n[[segment]]\nduration_s = 8\nthrottle = [0.2, 0.6]\n";

/// The car with the ratios of its gearbox, and with the masses of its shifts if they are told.
fn by_ratios(car: &CarFile, with_masses: bool) -> Car {
    let mut text = "name = \"by its ratios\"\nlevel = \"ratios\"\ngear = [\n".to_owned();
    let gears = &car.gearbox.gears;
    for gear in gears {
        writeln!(text, "  {{ name = \"{}\", ratio = {:?} }},", gear.name, gear.ratio).unwrap();
    }
    text.push_str("]\n");
    for pair in car.gearbox.forward_gears().windows(2).filter(|_| with_masses) {
        let [[turbine, coupling], [_, output]] =
            car.gearbox.shift(pair[0], pair[1]).unwrap().reduced.unwrap().mass_kg_m2;
        writeln!(
            text,
            "[[shift_mass]]\ngears = [\"{}\", \"{}\"]\nturbine_kg_m2 = {turbine:?}\ncoupling_kg_m2 = {coupling:?}\noutput_kg_m2 = {output:?}",
            gears[pair[0]].name, gears[pair[1]].name
        )
        .unwrap();
    }
    CarFile::from_sources(car.source.clone(), Source::built_in("g.toml", &text)).unwrap().car
}

/// Torque of all clutches of a shift at the turbine, N m.
fn true_sum(car: &Car, sample: &CarSample) -> Option<f64> {
    let under_way = sample.shift.as_ref()?;
    let ShiftCommand { from, to } = sample.gears();
    let reduced = car.gearbox.shift(from.place()?, to.place()?)?.reduced?;
    Some(
        reduced.slip_offgoing[0] * under_way.offgoing.torque_n_m
            + reduced.slip_oncoming[0] * under_way.oncoming.torque_n_m,
    )
}

/// RMS error in N m, RMS over the stated standard deviation, RMS torque, and rows, of the inertia phases.
fn score(truth: &CarFile, with_masses: bool) -> [f64; 4] {
    let known = by_ratios(truth, with_masses);
    let model = CarModel::new(truth.car.clone()).unwrap();
    let drive = DriveFile::from_source(Source::built_in("drive.toml", DRIVE)).unwrap().drive;
    let mut recording = Recording::default();
    simulate_car_drive(&model, truth, CarCalibration::STANDARD, &drive, |sample| recording.push(sample)).unwrap();
    let errors = ErrorBudget::of_car(&known);
    let tables = ShiftTables::of_car(&known, &errors).unwrap();
    let filter = gearbox_filter(&known, &tables, &errors, Some(&sensors()));
    let mut state = filter.start();
    let [mut error, mut standardised, mut size, mut rows] = [0.0; 4];
    let inputs: Vec<_> = recording.inputs(truth, &tables, &sensors(), 7).collect();
    for (sample, input) in recording.samples.iter().zip(inputs) {
        let estimate = filter.step(&mut state, &input);
        assert!(estimate.clutches.is_none() && estimate.gear.is_none_or(ShiftCommand::is_steady));
        let (Some(truth), Some(ShiftPhase::BothSlip)) = (true_sum(truth, sample), estimate.phase) else { continue };
        assert!(estimate.health == Health::Good || estimate.health == Health::ReadingRefused, "{:?}", estimate.health);
        let found = estimate.at_turbine.unwrap();
        error += (found.torque_n_m - truth).powi(2);
        standardised += ((found.torque_n_m - truth) / found.std_dev_n_m).powi(2);
        size += truth * truth;
        rows += 1.0;
    }
    let rms = |sum: f64| (sum / rows).sqrt();
    [rms(error), rms(standardised), rms(size), rows]
}

#[test]
fn the_clutches_have_their_torque_at_the_turbine() {
    for car in car_files().into_iter().filter(|car| car.converter.is_some()) {
        for (how, with_masses) in [("masses told", true), ("masses assumed", false)] {
            let [error, standardised, size, rows] = score(&car, with_masses);
            println!(
                "{}, {how}: {error:.1} of {size:.0} N m, {standardised:.2} deviations, {rows} rows",
                car.gearbox.name
            );
            // An error at its bound, the edge of a uniform distribution, is 1.73 of its standard deviations.
            assert!(standardised < 1.74 && rows > 100.0, "{}, {how}: {standardised}, {rows} rows", car.gearbox.name);
            if with_masses {
                assert!(error < 0.15 * size, "{}: {error} of {size}", car.gearbox.name);
            }
        }
    }
}

/// Past a gear nothing is known of the inertias: it is said so, in every row, and no speed is accused.
#[test]
fn a_shift_past_a_gear_is_not_modelled() {
    let truth = car_files().remove(0);
    let known = by_ratios(&truth, false);
    let gear = |name: &str| truth.gearbox.gear(name).unwrap();
    let tables = LoggedDrive::tables(&known, None).unwrap();
    let samples = simulated(&truth, &truth, &CarShift::usual(&truth, gear("5"), gear("7"), 0.15)).unwrap();
    let mut logged = LoggedDrive::new(&known, &tables, Some(&sensors()), None);
    let mut healths = Vec::new();
    for (at, input) in inputs(&known, &tables, &samples, &sensors(), 1) {
        let estimate = logged.push(&LogStep::of(samples[at].time_s, input));
        if !input.gear.is_steady() {
            healths.push(estimate.health);
        }
    }
    assert!(healths.len() > 20 && healths.iter().all(|health| *health == Health::ShiftNotModelled), "{healths:?}");
    let drive = logged.finish();
    assert!(drive.shifts.len() == 1 && !drive.shifts[0].is_estimated());
}
