//! A gear that a one-way clutch holds: its shifts are estimated, and in coasting the health says that it overruns.

use car::{Car, Gear};
use observer::Health;
use plant::car::{CarCalibration, CarModel, CarRun, Driver};
use study::gearbox::TruePhase;
use study::gearbox::drive::{ScoredDrive, ScoredShift, score_drive};
use study::gearbox::matrix::{controlling_of, drawn_car};
use study::gearbox::recording::Recording;
use study::gearbox::tour::drive_tour;

use super::cars::{one_way, sensors};

fn gear(car: &Car, name: &str) -> usize {
    car.gearbox.gear(name).unwrap()
}

/// Drawn cars, each through all gears.
fn tours(car: &Car) -> Vec<ScoredDrive> {
    let tour = |seed: u64| {
        let model = CarModel::new(drawn_car(car, 0, 0, seed)).unwrap();
        let mut recording = Recording::default();
        drive_tour(&model, car, |sample| recording.push(sample), || ()).unwrap();
        score_drive(car, &model, &recording, &sensors(), seed).unwrap()
    };
    (1..=6).map(tour).collect()
}

#[test]
fn the_clutch_with_a_pressure_is_estimated_and_the_one_way_clutch_has_the_torque_that_is_left() {
    let car = one_way();
    let first = Gear::at(gear(&car, "1"));
    let (mut sums, mut held, mut freed) = ([[0.0_f64; 2]; 2], [0.0_f64; 2], 0);
    for drive in tours(&car) {
        assert_eq!(drive.shifts.len(), 12);
        let of_first = |shift: &&ScoredShift| [shift.gears.from, shift.gears.to].contains(&first);
        for shift in drive.shifts.iter().filter(of_first) {
            let (kind, label) = (shift.kind.unwrap(), format!("{} {:?}", shift.number, shift.gears));
            assert!(shift.quality.complete_s.is_some() && shift.inside() == Some(1.0), "{label}");
            let main = controlling_of(&shift.rows, kind);
            assert!(
                shift.rows[0].clutches[main].has_pressure && !shift.rows[0].clutches[1 - main].has_pressure,
                "{label}"
            );
            for row in &shift.rows {
                let ([own, one_way], phase) = ([main, 1 - main].map(|at| row.clutches[at]), row.phase());
                if !own.sticks
                    && let Some(phase) = phase
                {
                    let sum = &mut sums[usize::from(phase == TruePhase::Inertia)];
                    let [truth, estimate, open_loop] = own.torque_n_m;
                    sum[0] += (estimate - truth).powi(2);
                    sum[1] += (open_loop - truth).powi(2);
                }
                let [truth, estimate, _] = one_way.torque_n_m;
                if one_way.sticks {
                    held[0] += (estimate - truth).powi(2);
                    held[1] += truth.powi(2);
                } else if row.phase() == Some(TruePhase::Inertia) {
                    // Rows at the end of a phase may be late.
                    freed += usize::from(estimate != 0.0);
                }
            }
        }
    }
    let [torque, inertia] = sums.map(|[filter, open_loop]| (filter / open_loop).sqrt());
    let left = (held[0] / held[1]).sqrt();
    println!(
        "shifts of the one-way clutch: torque phase {torque:.2}, inertia phase {inertia:.2}; of what it holds {left:.2} off; {freed} late rows"
    );
    assert!(torque < 0.7 && inertia < 0.6 && left < 0.25 && freed < 60);
}

#[test]
fn in_coasting_the_one_way_clutch_is_said_to_overrun_and_nothing_else() {
    let car = one_way();
    let model = CarModel::new(car.clone()).unwrap();
    let driver = |throttle: f64| Driver { throttle, brake: 0.0, grade_rad: 0.0 };
    let state = model.in_gear(gear(&car, "1"), None, 9.0, 0.2).unwrap();
    let start = (driver(0.2), 0.002);
    let mut run = CarRun::new(&model, &car, CarCalibration::STANDARD, gear(&car, "1"), state, start).unwrap();
    let (mut recording, mut overran) = (Recording::default(), Vec::new());
    while run.time_s() < 18.0 {
        let time_s = run.time_s();
        // Power, coasting, power, then 2nd gear and down again without power.
        let throttle = if (3.0..7.0).contains(&time_s) || time_s > 12.0 { 0.0 } else { 0.2 };
        if time_s > 10.0 {
            run.request(gear(&car, if time_s < 13.0 { "2" } else { "1" })).unwrap();
        }
        run.advance(
            driver(throttle),
            |_| {},
            |sample| {
                recording.push(sample);
                overran.push((sample.time_s, sample.slips_rad_s[5] < -10.0 && sample.shift.is_none()));
            },
        )
        .unwrap();
    }
    let drive = score_drive(&car, &model, &recording, &sensors(), 1).unwrap();
    let health = |from_s: f64, to_s: f64| {
        let rows = drive.states.iter().filter(move |state| (from_s..to_s).contains(&state.time_s));
        rows.map(|state| state.health).collect::<Vec<_>>()
    };
    let said = |rows: &[Health], health: Health| rows.iter().filter(|said| **said == health).count();
    let all = health(0.0, 18.0);
    assert_eq!((said(&all, Health::HeldClutchSlips), said(&all, Health::ClutchOpen)), (0, 0));
    assert!(overran.iter().filter(|(time_s, _)| (3.5..7.0).contains(time_s)).all(|(_, overruns)| *overruns));
    for (from_s, to_s) in [(3.5, 7.0), (15.0, 18.0)] {
        let rows = health(from_s, to_s);
        assert_eq!(said(&rows, Health::OneWayOverruns), rows.len(), "{from_s}: {rows:?}");
    }
    // Caught again it is a gear as any other.
    let rows = health(8.5, 10.0);
    assert!(said(&rows, Health::OneWayOverruns) == 0 && said(&rows, Health::Good) * 10 > rows.len() * 9, "{rows:?}");
}
