//! What limits the estimate of which shift: the runs of the matrix with one error less. Either the filter is told what it does
//! not know, or the car or its sensors are without it.

use car::{Car, Sensors};
use car::{ElementErrors, ErrorBudget};
use drivetrain::{ClutchValve, ShiftKind, Table1};
use observer::Reading;
use observer::gearbox::ShiftInput;
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarSample, CarShift};
use study::gearbox::matrix::{
    CLASSES, ErrorsByPhase, MatrixCounts, MatrixRow, MatrixShift, Pooled, class, counts, drawn_car, errors_by_phase,
    neighbouring_shifts,
};
use study::gearbox::{ShiftScoreRow, inputs, score_samples, simulated};

use super::PHASES;
use super::cars::{cars, sensors};

/// The error that is taken away.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Without {
    Nothing,
    /// The filter knows the torque at the gearbox input.
    TurbineTorque,
    /// It knows friction, gain and kiss point of all clutches.
    Clutches,
    /// It knows `M11` and the stiffness of the shafts.
    Inertia,
    /// All valves have the delay that the filter takes them to have.
    Delay,
    /// No open clutch has drag.
    Drag,
    /// The readings of the toothed wheels have no noise.
    Noise,
    /// The speeds are read exactly, at the moment.
    SpeedErrors,
    /// The car has no other errors than those that are drawn, and the filter knows their covariance: friction and gain of each
    /// clutch, and the converter. What such a filter reaches, no filter exceeds with these sensors.
    AllButDrawn,
}

const ALL: [(Without, &str); 9] = [
    (Without::Nothing, "as is"),
    (Without::TurbineTorque, "T_t"),
    (Without::Clutches, "mu, gain"),
    (Without::Inertia, "M11, K_s"),
    (Without::Delay, "delay"),
    (Without::Drag, "drag"),
    (Without::Noise, "noise"),
    (Without::SpeedErrors, "speeds"),
    (Without::AllButDrawn, "all else"),
];

/// An error that is almost none, as a fraction.
const LITTLE: f64 = 0.005;
/// Standard deviation of a speed that is read exactly, rad/s: that of turbine, output and wheel.
const EXACT_RAD_S: [f64; 3] = [0.01, 0.01, 0.002];

impl Without {
    /// The car without the error, if it is one of the car.
    fn car(self, truth: &Car) -> Option<Car> {
        let budget = ErrorBudget::of_car(truth);
        let (drag, delay) = match self {
            Self::Drag => (true, false),
            Self::Delay => (false, true),
            Self::AllButDrawn => (true, true),
            _ => return None,
        };
        let mut car = truth.clone();
        for (clutch, errors) in car.clutches.iter_mut().zip(&budget.elements) {
            let Some((clutch, errors)) = clutch.as_mut().zip(errors.as_ref()) else { continue };
            let [min_s, max_s] = errors.valve_delay_s;
            if drag {
                clutch.drag_n_m = 0.0;
            }
            if let (true, ClutchValve::Proportional(maps)) = (delay, &mut clutch.valve) {
                maps.delay_s = Table1::constant(0.5 * (min_s + max_s));
            }
        }
        Some(car)
    }

    /// The car that the filter knows, and what it does not know.
    fn known(self, known: &Car, truth: &Car) -> (Car, ErrorBudget) {
        let (mut car, mut errors) = (known.clone(), ErrorBudget::of_car(known));
        if self == Self::Clutches {
            for element in errors.elements.iter_mut().flatten() {
                (element.friction_factor, element.valve_gain_factor) =
                    ([1.0 - LITTLE, 1.0 + LITTLE], [1.0 - LITTLE, 1.0 + LITTLE]);
            }
            for (clutch, truth) in car.clutches.iter_mut().zip(&truth.clutches) {
                if let (Some(clutch), Some(truth)) = (clutch, truth) {
                    (clutch.clutch, clutch.valve) = (truth.clutch, truth.valve);
                }
            }
        }
        if [Self::Inertia, Self::AllButDrawn].contains(&self) {
            (errors.inertia, errors.stiffness) = (LITTLE, LITTLE);
        }
        (car, errors)
    }

    fn sensors(self, sensors: &Sensors) -> Sensors {
        let mut sensors = *sensors;
        if self == Self::Noise {
            for sensor in [&mut sensors.turbine, &mut sensors.output, &mut sensors.wheel] {
                sensor.noise_rad_s = 0.0;
            }
        }
        sensors
    }

    /// Puts the truth into what the filter is shown.
    fn tell(self, input: &mut ShiftInput<f64>, sample: &CarSample) {
        match self {
            Self::TurbineTorque => input.engine_n_m = Some(Reading::now(sample.turbine_n_m)),
            Self::SpeedErrors => {
                let now = |speed| Some(Reading::now(speed));
                input.turbine_rad_s = now(sample.torques.turbine_rad_s);
                input.output_rad_s = now(sample.torques.output_rad_s);
                input.wheel_rad_s = now(sample.wheel_rad_s);
            }
            _ => {}
        }
    }

    /// Rows of a recorded shift of the car that truly is `truth`, beside the valve models of a filter that is told nothing.
    fn rows(self, [known, truth]: [&Car; 2], samples: &[CarSample], noise: u64) -> Vec<ShiftScoreRow> {
        let seen = sensors();
        let read = |sensors: &Sensors, tables: &_| inputs(known, tables, samples, sensors, noise);
        let standard = ErrorBudget::of_car(known);
        let tables = ShiftTables::of_car(known, &standard).unwrap();
        let filter = gearbox_filter(known, &tables, &standard, Some(&seen));
        let untold = score_samples(&tables, &filter, samples, &read(&seen, &tables));
        let (car, errors) = self.known(known, truth);
        let mut tables = ShiftTables::of_car(&car, &errors).unwrap();
        if self == Self::Clutches {
            tables.uncertainties_mut().for_each(|u| u.kiss_point_pa = LITTLE * 1e5);
        }
        if self == Self::AllButDrawn {
            sure_of_all_but_drawn(&mut tables, &standard);
        }
        let mut filter = gearbox_filter(&car, &tables, &errors, Some(&seen));
        let mut inputs = read(&self.sensors(&seen), &tables);
        // Without a converter the reported torque of the engine is already exact.
        if self == Self::TurbineTorque {
            (filter.turbine.engine_share, filter.uncertainty.turbine_share) = (LITTLE, 0.5 * LITTLE);
        }
        if self == Self::SpeedErrors {
            for (reading, std_dev_rad_s) in filter.readings.iter_mut().zip(EXACT_RAD_S) {
                (reading.std_dev_rad_s, reading.lag_rad, reading.pitch_rad) = (std_dev_rad_s, 0.0, 0.0);
            }
        }
        if self == Self::AllButDrawn {
            (filter.uncertainty.torque_fraction_s, filter.uncertainty.turbine_share) = (1e6, LITTLE);
            // Without a converter the reported torque of the engine is exact.
            if filter.turbine.converter.is_none() {
                filter.turbine.engine_share = LITTLE;
            }
        }
        if self != Self::TurbineTorque || filter.turbine.converter.take().is_some() {
            inputs.iter_mut().for_each(|(at, input)| self.tell(input, &samples[*at]));
        }
        let mut rows = score_samples(&tables, &filter, samples, &inputs);
        for (row, untold) in rows.iter_mut().zip(&untold) {
            assert_eq!(row.time_s, untold.time_s);
            for (clutch, untold) in row.clutches.iter_mut().zip(&untold.clutches) {
                clutch.torque_n_m[2] = untold.torque_n_m[2];
            }
        }
        rows
    }
}

/// Leaves the covariance of friction, gain and converter alone, as they are drawn: uniformly, and once for a shift.
fn sure_of_all_but_drawn(tables: &mut ShiftTables<f64>, budget: &ErrorBudget) {
    let [friction, valve_gain] = [budget.widest(ElementErrors::friction), budget.widest(ElementErrors::valve_gain)];
    for u in tables.uncertainties_mut() {
        u.torque_fraction = ((friction * friction + valve_gain * valve_gain) / 3.0).sqrt();
        u.slow_part = 0.9999;
        (u.kiss_point_pa, u.pressure_pa) = (100.0, 300.0);
        (u.valve_lag_fraction, u.valve_delay_s) = (0.001, 2e-4);
    }
}

/// The runs of one shift, a row for each error.
fn runs(known: &Car, shift: MatrixShift, draws: u64) -> Vec<MatrixRow> {
    let row = MatrixRow { shift, errors: ErrorsByPhase::default(), counts: MatrixCounts::default(), failure: None };
    let mut sums = vec![row; ALL.len()];
    let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
    for draw in 1..=draws {
        let truth = drawn_car(known, shift.from, shift.to, draw);
        let as_is = simulated(known, &truth, &usual).unwrap();
        for (sum, (without, _)) in sums.iter_mut().zip(ALL) {
            let other = without.car(&truth).map(|car| simulated(known, &car, &usual).unwrap());
            let rows = without.rows([known, &truth], other.as_deref().unwrap_or(&as_is), shift.noise(draw));
            let errors = errors_by_phase(&rows, shift.kind);
            sum.counts.add(&counts(&rows, &errors));
            sum.errors.iter_mut().flatten().zip(errors.iter().flatten()).for_each(|(sum, more)| sum.add(more));
        }
    }
    sums
}

/// All shifts of these cars, a column for each error.
fn columns(cars: &[Car], draws: u64) -> Vec<Vec<MatrixRow>> {
    let mut columns = vec![Vec::new(); ALL.len()];
    for car in cars {
        let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).unwrap();
        for shift in neighbouring_shifts(car, &tables).0 {
            columns.iter_mut().zip(runs(car, shift, draws)).for_each(|(column, row)| column.push(row));
        }
    }
    columns
}

/// A clutch grips some milliseconds before or after the readings show that its slip has ended. Where the filter says so too early,
/// its torque is the mean of both phases: `LIMITS_DRAWS=10 cargo test --release -p study --test tests grips -- --nocapture`.
#[test]
fn a_clutch_that_grips_too_early_in_the_filter_has_the_torque_of_both_phases() {
    let (car, draws) = (&cars()[0], std::env::var("LIMITS_DRAWS").map_or(2, |draws| draws.parse().unwrap()));
    let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).unwrap();
    let coasting = |shift: &MatrixShift| shift.kind == ShiftKind::CoastDown && class(shift.gain) == 2;
    let (mut early, mut rows, mut sum) = (0, 0, 0.0);
    for shift in neighbouring_shifts(car, &tables).0.into_iter().filter(coasting) {
        let usual = CarShift::usual(car, shift.from, shift.to, shift.throttle());
        for draw in 1..=draws {
            let truth = drawn_car(car, shift.from, shift.to, draw);
            let samples = simulated(car, &truth, &usual).unwrap();
            let scored = Without::Nothing.rows([car, &truth], &samples, shift.noise(draw));
            let both_slip = scored.iter().filter(|row| row.clutches.iter().all(|clutch| !clutch.sticks));
            for row in both_slip {
                rows += 1;
                if row.phase == "oncoming_holds" {
                    let [truth, estimate, _] = row.clutches[1].torque_n_m;
                    (early, sum) = (early + 1, sum + (estimate - truth).powi(2));
                }
            }
        }
    }
    let error = (sum / f64::from(early)).sqrt();
    println!("{early} of {rows} rows too early: {error:.1} N m");
    // By the torque of the clutch that holds it was 13.7 N m, over all gearboxes and forty cars.
    assert!(early > 0 && error < 10.0, "{early} {error}");
}

/// Prints the ratios to the open loop of the controlling clutch by kind, phase and class, one column for each error.
fn print(columns: &[Vec<MatrixRow>]) {
    println!("{:32}{}", "", ALL.map(|(_, name)| format!("{name:>9}")).concat());
    let line = |name: String, of: &dyn Fn(&Vec<MatrixRow>) -> Option<f64>| {
        let cells = columns.iter().map(|rows| of(rows).map_or_else(|| format!("{:>9}", "-"), |x| format!("{x:9.2}")));
        println!("{name:32}{}", cells.collect::<String>());
    };
    for kind in ShiftKind::ALL {
        for (p, phase) in PHASES.iter().enumerate() {
            for at in 0..CLASSES.len() {
                let of = |shift: &MatrixShift| shift.kind == kind && class(shift.gain) == at;
                line(format!("{kind:?} {phase} class {at}"), &|rows| Pooled::of(rows, of).torque[p][0].ratio());
            }
        }
    }
    line("above by 1 N m, %".to_owned(), &|rows| {
        let MatrixCounts { above, compared, .. } = Pooled::of(rows, |_| true).counts;
        Some(100.0 * above as f64 / compared as f64)
    });
}

/// The numbers of the documentation: `LIMITS_DRAWS=10 cargo test --release -p study --test tests limits -- --nocapture`.
#[test]
fn an_error_that_is_taken_away_shows_what_it_costs() {
    let draws = std::env::var("LIMITS_DRAWS").ok().map(|draws| draws.parse().unwrap());
    let cars = cars();
    let dual_clutch = cars.len() - 1;
    // Without a number of cars those of two gearboxes, once.
    let others = if draws.is_some() { dual_clutch } else { 1 };
    let mut all = columns(&cars[..others], draws.unwrap_or(1));
    println!("with a converter:");
    print(&all);
    let alone = columns(&cars[dual_clutch..], draws.unwrap_or(1));
    println!("dual clutch:");
    print(&alone);
    all.iter_mut().zip(alone).for_each(|(rows, more)| rows.extend(more));
    println!("all:");
    print(&all);
    // Over all kinds and classes each of these costs something in the phase.
    let error = |rows: &Vec<MatrixRow>, phase: usize| Pooled::of(rows, |_| true).torque[phase][0].rms_n_m()[0];
    for (phase, costly) in [
        (0, [Without::Clutches, Without::Noise, Without::SpeedErrors]),
        (1, [Without::TurbineTorque, Without::Clutches, Without::SpeedErrors]),
    ] {
        let as_is = error(&all[0], phase);
        for ((without, name), rows) in ALL.iter().zip(&all).filter(|((without, _), _)| costly.contains(without)) {
            let told = error(rows, phase);
            println!("{} phase without {without:?}: {told:.2} in place of {as_is:.2} N m", PHASES[phase]);
            assert!(told < 0.97 * as_is, "{name}, {}: {told} {as_is}", PHASES[phase]);
        }
    }
}
