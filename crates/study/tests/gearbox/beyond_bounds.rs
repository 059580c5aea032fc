//! Cars outside their error budgets: which quantity the filter names over a drive in town, and that it names none in cars within their budgets.
//!
//! `BEYOND_REPETITIONS=20` are an hour of driving, of each element; without it the drive takes six minutes, and most changes are of one element.

use car::{Car, Drive, ElementErrorBounds, ErrorBudget, ShiftClutch};
use config::{DriveFile, Source};
use observer::gearbox::{BeyondBounds, CarQuantity, Elements, GearboxFilter, ShiftInput};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, simulate_car_drive};
use study::gearbox::recording::Recording;
use study::gearbox::{RECORD_S, ShiftDraw};

use super::cars::{Random, cars, sensors};

/// A car on its way through the drive, and the filter that does not know what is wrong with it.
struct Driven {
    known: Car,
    drive: Drive,
    has_wheels: bool,
}

/// What was found: its name, and in how many seconds first.
type Found = Option<(BeyondBounds<f64>, f64)>;

impl Driven {
    fn new(known: Car) -> Self {
        let source = Source::built_in("city.toml", include_str!("../../../../drives/city.toml"));
        let drive = Drive {
            sample_time_s: RECORD_S,
            repetitions: repetitions(),
            ..DriveFile::from_source(source).unwrap().drive
        };
        Self { known, drive, has_wheels: true }
    }

    /// Of a true car, whose commands reach the filter with an offset.
    fn found(&self, truth: Car, offset: f64, seed: u64) -> Found {
        let (known, sensors) = (&self.known, sensors());
        let budget = ErrorBudget::of_logged_car(known).read_by(known, Some(&sensors));
        let tables = ShiftTables::of_car(known, &budget).unwrap();
        let filter: GearboxFilter<'_, f64> = gearbox_filter(known, &tables, &budget, Some(&sensors));
        let model = CarModel::new(truth).unwrap();
        let (mut recording, calibration) = (Recording::default(), CarCalibration::of(self.drive.controller));
        simulate_car_drive(&model, known, calibration, &self.drive, |sample| recording.push(sample)).unwrap();
        let (mut state, mut found, mut time_s) = (filter.start(), None, 0.0);
        for mut input in recording.inputs(known, &tables, &sensors, seed) {
            moved(&mut input, offset);
            input.wheel_rad_s = input.wheel_rad_s.filter(|_| self.has_wheels);
            time_s += input.dt_s;
            filter.step(&mut state, &input);
            if let Some(beyond) = filter.beyond_bounds(&state) {
                let since_s = found.map_or(time_s, |(_, since_s): (_, f64)| since_s);
                found = Some((beyond, since_s));
            }
        }
        found
    }

    /// Of the known car with one change of all clutches.
    fn of_all(&self, change: impl Fn(&mut ShiftClutch)) -> Found {
        let mut truth = self.known.clone();
        truth.clutches.iter_mut().flatten().for_each(change);
        self.found(truth, 0.0, 1)
    }
}

/// Of a drive of two minutes.
fn repetitions() -> u32 {
    std::env::var("BEYOND_REPETITIONS").map_or(3, |text| text.parse().unwrap())
}

fn moved(input: &mut ShiftInput<f64>, by: f64) {
    input.commands.iter_mut().flatten().for_each(|command| command.value += by);
}

fn show(name: &str, found: &Found) {
    match found {
        Some((BeyondBounds { quantity, size, std_dev, bound }, since_s)) => {
            println!("{name}: {quantity:?} {size:.3} +-{std_dev:.3}, bound {bound:.3}, after {since_s:.0} s");
        }
        None => println!("{name}: nothing"),
    }
}

#[test]
fn what_is_beyond_its_bound_is_named_with_its_size() {
    let driven = Driven::new(cars().swap_remove(0));
    let known = || driven.known.clone();
    let of = |found: Found, name: &str| {
        show(name, &found);
        found.map(|(beyond, since_s)| (beyond.quantity, beyond.size, since_s))
    };
    // 50 mA are 55 kPa of this valve.
    for (offset, kiss_pa) in [(0.05, 55e3), (-0.05, -55e3)] {
        let (quantity, size, since_s) = of(driven.found(known(), offset, 1), "offset of all currents").unwrap();
        assert_eq!(quantity, CarQuantity::KissPoint(Elements::All));
        assert!((size - kiss_pa).abs() < 12e3, "{size}");
        // After the first shifts: the drive takes two minutes.
        assert!(since_s < 20.0, "{since_s}");
    }
    let mut truth = known();
    truth.driveline.shaft_stiffness_n_m_rad *= 0.5;
    let (quantity, size, _) = of(driven.found(truth, 0.0, 1), "shafts of half the stiffness").unwrap();
    assert_eq!(quantity, CarQuantity::Stiffness);
    assert!((size + 0.5).abs() < 0.15, "{size}");
    let late = driven.of_all(|clutch| clutch.valve = clutch.valve.changed(1.0, 1.0, Some(0.08)));
    let lag = driven.of_all(|clutch| clutch.valve = clutch.valve.changed(2.5, 1.0, None));
    for (found, name) in [(late, "delay of all valves 80 ms"), (lag, "lag of all valves 2.5 times")] {
        let (quantity, size, _) = of(found, name).unwrap();
        assert!(matches!(quantity, CarQuantity::Lag(_) | CarQuantity::Delay(_)), "{quantity:?}");
        assert!(size > 0.0);
    }
}

#[test]
fn of_a_car_within_its_budget_nothing_is_said() {
    let draws: u64 = std::env::var("BEYOND_DRAWS").map_or(2, |draws| draws.parse().unwrap());
    let (mut drives, mut said) = (0, 0);
    for (n, known) in cars().into_iter().enumerate().filter(|(n, _)| [0, 1, 2, 3, 5].contains(n)) {
        let driven = Driven::new(known);
        let budget = ErrorBudget::of_logged_car(&driven.known);
        for draw in 0..draws {
            let mut random = Random(draw.wrapping_mul(7919) + 13);
            let sampled = ShiftDraw::within(&driven.known, &budget, || random.uniform());
            let truth = sampled.with_timing(&budget, || random.uniform()).car(&driven.known);
            let found = driven.found(truth, 0.0, draw);
            if found.is_some() {
                show(&format!("car {n}, draw {draw}"), &found);
            }
            (drives, said) = (drives + 1, said + u32::from(found.is_some()));
        }
    }
    println!("{said} of {drives} drives within the budget");
    assert!(100 * said <= drives, "{said} of {drives}");
}

/// Bounds that are wider than usual allow hysteresis, offsets and timings whose traces in all shifts are as much larger.
#[test]
fn of_a_car_at_the_end_of_wide_bounds_nothing_is_said() {
    let usual = cars().swap_remove(0);
    let stating = |state: &dyn Fn(&mut ElementErrorBounds)| {
        let mut known = usual.clone();
        let elements = vec![ElementErrorBounds::default(); known.clutches.len()];
        known.error_bounds.elements = elements;
        known.error_bounds.elements.iter_mut().for_each(state);
        known
    };
    let valve = |clutch: &mut ShiftClutch, lag, gain, delay| clutch.valve = clutch.valve.changed(lag, gain, delay);
    let current = stating(&|bounds| bounds.command = Some(0.05));
    assert!(Driven::new(current.clone()).found(current, 0.04, 1).is_none(), "offset of all currents");
    let mut own = stating(&|bounds| bounds.valve_hysteresis_pa = Some(60e3));
    own.clutches.iter_mut().flatten().for_each(|clutch| clutch.hysteresis_pa = 60e3);
    assert!(Driven::new(own.clone()).found(own, 0.0, 1).is_none(), "hysteresis of the file");
    let gain = Driven::new(stating(&|bounds| bounds.valve_gain_factor = Some([0.7, 1.0])));
    assert!(gain.of_all(|clutch| valve(clutch, 1.0, 0.7, None)).is_none(), "gain 0.7");
    let late = Driven::new(stating(&|bounds| bounds.valve_delay_s = Some([0.0, 0.12])));
    assert!(late.of_all(|clutch| valve(clutch, 1.0, 1.0, Some(0.12))).is_none(), "delay 120 ms");
    let slow = Driven::new(stating(&|bounds| bounds.valve_lag_factor = Some([1.0, 2.5])));
    assert!(slow.of_all(|clutch| valve(clutch, 2.5, 1.0, None)).is_none(), "lag 2.5 times");
    let slow = Driven::new(stating(&|bounds| bounds.valve_lag_factor = Some([0.3, 2.5])));
    for at in 0..slow.known.clutches.len() {
        let mut truth = slow.known.clone();
        truth.clutches[at].iter_mut().for_each(|clutch| valve(clutch, 2.5, 1.0, None));
        let found = slow.found(truth, 0.0, 1);
        show(&format!("lag 2.5 times, element {at}"), &found);
        assert!(found.is_none(), "lag of one valve");
    }
    let current = stating(&|bounds| bounds.command = Some(0.06));
    for offset in [-0.06, -0.05, 0.05, 0.06] {
        let found = Driven::new(current.clone()).found(current.clone(), offset, 1);
        show(&format!("offset {offset}"), &found);
        assert!(found.is_none(), "offset of all currents within 60 mA");
    }
    // A delay is found where only the gain is stated wide.
    let late = Driven::new(stating(&|bounds| bounds.valve_gain_factor = Some([0.7, 1.3])));
    let found = late.of_all(|clutch| valve(clutch, 1.0, 1.0, Some(0.08)));
    show("delay 80 ms, gain wide", &found);
    assert!(found.is_some());
}

/// The load of the road is then known by the output speed alone.
#[test]
fn of_the_car_of_the_file_nothing_is_said_without_a_wheel_speed() {
    for (n, known) in cars().into_iter().enumerate() {
        let driven = Driven { has_wheels: false, ..Driven::new(known.clone()) };
        for seed in [1, 2] {
            let found = driven.found(known.clone(), 0.0, seed);
            show(&format!("car {n}, seed {seed}"), &found);
            assert!(found.is_none());
        }
    }
}

#[test]
fn what_is_beyond_its_bound_in_one_element_is_named() {
    let driven = Driven::new(cars().swap_remove(0));
    type Change = fn(&mut ShiftClutch);
    let changes: [(&str, Change); 9] = [
        ("valve gain -30 %", |clutch| clutch.valve = clutch.valve.changed(1.0, 0.7, None)),
        ("spring +50 kPa", |clutch| spring(clutch, 50e3)),
        ("spring -40 kPa", |clutch| spring(clutch, -40e3)),
        ("valve gain +30 %", |clutch| clutch.valve = clutch.valve.changed(1.0, 1.3, None)),
        ("friction -35 %", |clutch| friction(clutch, 0.65)),
        ("friction +40 %", |clutch| friction(clutch, 1.4)),
        ("lag 2.5 times", |clutch| clutch.valve = clutch.valve.changed(2.5, 1.0, None)),
        ("delay 80 ms", |clutch| clutch.valve = clutch.valve.changed(1.0, 1.0, Some(0.08))),
        ("hysteresis 60 kPa", |clutch| clutch.hysteresis_pa = 60e3),
    ];
    // An hour for each element and all of them together takes some minutes.
    let is_long = repetitions() > 3;
    let clutches = if is_long { driven.known.clutches.iter().flatten().count() } else { 1 };
    for (name, change) in changes.into_iter().take(if is_long { 9 } else { 2 }) {
        if is_long {
            show(&format!("{name}, all elements"), &driven.of_all(change));
        }
        for at in 0..clutches {
            let mut truth = driven.known.clone();
            truth.clutches.iter_mut().flatten().skip(at).take(1).for_each(change);
            let found = driven.found(truth, 0.0, 1);
            show(&format!("{name}, element {at}"), &found);
            if !is_long {
                // A lower gain is a higher kiss point by the command.
                assert_eq!(found.map(|(beyond, _)| beyond.quantity), Some(CarQuantity::KissPoint(Elements::One(0))));
            }
        }
    }
}

fn friction(clutch: &mut ShiftClutch, factor: f64) {
    clutch.clutch.friction = clutch.clutch.friction.scaled(factor);
    clutch.clutch.static_friction *= factor;
}

fn spring(clutch: &mut ShiftClutch, more_pa: f64) {
    clutch.clutch.return_spring_n += more_pa * clutch.clutch.piston_area_m2;
}
