//! The filter for any shift, over the shifts of the shipped gearboxes, behind toothed wheels, in cars whose clutches, valves
//! and converters are not those it knows.

mod car;
mod controller;

use std::collections::BTreeMap;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use car::{Car, PERIOD_S, Random, STEPS, Teeth};
use config::{GearboxFile, Vehicle};
use controller::Controller;
use design::ShiftTables;
use drivetrain::{ClutchValve, ShiftKind, ValveMaps};
use geartrain::{Change, Gearbox, Shift};
use observer::any_shift::{AnyShiftFilter, GearCommand, ShiftInput, ShiftPhase};
use observer::{EngineNoise, Health, Reading, SpeedReading, ValveModel};

fn gearbox(name: &str) -> Gearbox {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../gearboxes").join(name);
    GearboxFile::read(Path::new(&path)).unwrap().gearbox
}

/// How far a draw is from the nominal car.
#[derive(Clone, Copy)]
struct Draw {
    friction: [f64; 2],
    gain: [f64; 2],
    converter: f64,
}

impl Draw {
    fn new(random: &mut Random) -> Self {
        let friction = [random.factor(0.15), random.factor(0.15)];
        let gain = [random.factor(0.10), random.factor(0.10)];
        Self { friction, gain, converter: random.factor(0.10) }
    }
}

struct Bench {
    vehicle: Vehicle,
    valve: ValveMaps<f64>,
}

impl Bench {
    fn new() -> Self {
        let vehicle = Vehicle::two_speed_at().unwrap();
        let ClutchValve::Proportional(mut valve) = vehicle.oncoming.valve else { panic!("a current") };
        valve.gain_pa_a = valve.gain_pa_a.scaled(1.43);
        Self { vehicle, valve }
    }

    fn car(&self, gearbox: &Gearbox, shift: &Shift) -> Option<Car> {
        let Change::Single { offgoing, oncoming, .. } = &shift.change else { return None };
        let clutches = [gearbox.elements[*offgoing].pack?, gearbox.elements[*oncoming].pack?];
        let v = &self.vehicle;
        Some(Car {
            engine: v.engine,
            converter: v.converter,
            shift: shift.reduced?,
            clutches,
            valves: [self.valve; 2],
            driveline: v.driveline,
            road: v.road,
        })
    }

    fn filter<'a>(&self, tables: &'a ShiftTables<f64>) -> AnyShiftFilter<'a, f64> {
        let v = &self.vehicle;
        let wheel = |teeth: f64, periods: f64, deviation_rad_s: f64| SpeedReading {
            deviation_rad_s,
            lag_rad: 0.5 * (periods + 1.0) * std::f64::consts::TAU / teeth,
            pitch_rad: std::f64::consts::TAU / teeth,
            delay_s: 0.0,
        };
        let inertia = v.engine.inertia_kg_m2;
        AnyShiftFilter {
            tables: tables.tables(),
            driveline: v.driveline,
            wheels_kg_m2: v.road.inertia_at_wheel() + v.driveline.wheel_inertia_kg_m2,
            turbine: design::turbine_torque(Some(v.converter), inertia, [0.10, 0.08]),
            uncertainty: design::shift_uncertainty(0.15, 0.10, 15.0),
            readings: [wheel(60.0, 10.0, 0.1), wheel(60.0, 5.0, 0.1), wheel(48.0, 2.0, 0.02)],
            engine: (
                wheel(58.0, 10.0, 0.1),
                EngineNoise {
                    reading_rad_s: 0.1,
                    acceleration_walk: 50.0 / inertia / 0.05_f64.sqrt(),
                    acceleration_max_rad_s2: 400.0 / inertia,
                },
            ),
            limits: v.limits,
        }
    }

    fn tables(&self, gearbox: &Gearbox) -> ShiftTables<f64> {
        let valve = ValveModel { valve: ClutchValve::Proportional(self.valve), delay_s: 0.015 };
        ShiftTables::new(gearbox, |_| Some((valve, None)), 0.0).unwrap()
    }
}

/// What is compared at one time.
struct Row {
    time_s: f64,
    /// By the true slips: whether offgoing and oncoming stick.
    sticks: [bool; 2],
    truth: [f64; 2],
    estimate: [f64; 2],
    open_loop: [f64; 2],
    pressure: [[f64; 3]; 2],
    phase: Option<ShiftPhase>,
    health: Health,
    speeds: [f64; 4],
    turbine: [f64; 2],
}

fn run(bench: &Bench, gearbox: &Gearbox, tables: &ShiftTables<f64>, shift: &Shift, kind: ShiftKind, draw: &Draw, random: &mut Random) -> Vec<Row> {
    let nominal = bench.car(gearbox, shift).unwrap();
    let mut car = nominal;
    for c in 0..2 {
        car.clutches[c].friction = car.clutches[c].friction.scaled(draw.friction[c]);
        car.valves[c].gain_pa_a = car.valves[c].gain_pa_a.scaled(draw.gain[c]);
    }
    car.converter.capacity_n_m_s2 = car.converter.capacity_n_m_s2.scaled(draw.converter);
    let (turbine, throttle) = match kind {
        ShiftKind::PowerOnUp => (220.0, 0.2),
        ShiftKind::PowerOffUp => (230.0, 0.0),
        ShiftKind::PowerOnDown => (170.0, 0.2),
        ShiftKind::CoastDown => (150.0, 0.0),
    };
    let mut state = car.in_gear(turbine, throttle, [0.0; 2]);
    state.pressure[0] = 0.9e6;
    let mut controller = Controller::new(nominal, kind, 1.0, &state);
    let filter = bench.filter(tables);
    let mut memory = filter.start();
    let Change::Single { offgoing, oncoming, .. } = &shift.change else { panic!("single") };
    let places = [tables.place(*offgoing).unwrap(), tables.place(*oncoming).unwrap()];
    let mut wheels =
        [Teeth::new(58.0, 10, 0.1), Teeth::new(60.0, 10, 0.1), Teeth::new(60.0, 5, 0.1), Teeth::new(48.0, 2, 0.02)];
    let mut late: [VecDeque<f64>; 2] = [VecDeque::new(), VecDeque::new()];
    let mut rows = Vec::new();
    // Delay of the valves within the program's 0 to 30 ms: 12 ms.
    let delay = 120;
    for sample in 0..300 {
        let time_s = sample as f64 * PERIOD_S;
        let (currents, throttle) = controller.step(time_s, &state);
        state.throttle = throttle;
        let reading = |value: Option<f64>| value.map(Reading::now);
        let mut input = ShiftInput {
            dt_s: PERIOD_S,
            engine_rad_s: reading(wheels[0].read(random)),
            turbine_rad_s: reading(wheels[1].read(random)),
            output_rad_s: reading(wheels[2].read(random)),
            wheel_rad_s: reading(wheels[3].read(random)),
            engine_n_m: None,
            lock_up_applied: false,
            commands: [None; 8],
            gear: match (controller.shifting(), controller.done_s) {
                (false, _) => GearCommand { from: shift.from, to: shift.from },
                (true, None) => GearCommand { from: shift.from, to: shift.to },
                (true, Some(_)) => GearCommand { from: shift.to, to: shift.to },
            },
        };
        for c in 0..2 {
            input.commands[places[c]] = Some(Reading::now(currents[c]));
        }
        let estimate = filter.step(&mut memory, &input);
        if let Some(clutches) = &estimate.clutches {
            let slips = [0, 1].map(|c| car.slip(&state, c));
            let caps = [0, 1].map(|c| car.clutches[c].torque_capacity(state.pressure[c], slips[c]));
            rows.push(Row {
                time_s,
                sticks: [0, 1].map(|c| slips[c].abs() < 0.05 && state.torque[c].abs() < 0.999 * caps[c]),
                truth: state.torque,
                estimate: clutches.map(|clutch| clutch.torque_n_m),
                open_loop: clutches.map(|clutch| clutch.open_loop_n_m),
                pressure: [0, 1].map(|c| [state.pressure[c], clutches[c].pressure_pa, clutches[c].valve_pa]),
                phase: estimate.phase,
                health: estimate.health,
                speeds: [state.turbine, state.output, slips[0], slips[1]],
                turbine: [state.turbine_n_m, estimate.turbine_n_m.unwrap_or(f64::NAN)],
            });
        }
        for step in 0..STEPS {
            let now_s = time_s + (step + 1) as f64 * 1e-4;
            let mut arrived = [0.0; 2];
            for c in 0..2 {
                late[c].push_back(currents[c]);
                arrived[c] = if late[c].len() > delay { late[c].pop_front().unwrap() } else { late[c][0] };
            }
            car.step(&mut state, arrived);
            for (wheel, speed) in wheels.iter_mut().zip([state.engine, state.turbine, state.output, state.wheel]) {
                wheel.turn(now_s, speed);
            }
        }
    }
    rows
}

/// Phase in which a clutch controls: true for the inertia phase.
fn phase_of(row: &Row) -> Option<bool> {
    match row.sticks {
        [false, false] => Some(true),
        [true, false] | [false, true] => Some(false),
        [true, true] => None,
    }
}

#[derive(Default, Clone, Copy)]
struct Sum {
    estimate: f64,
    open_loop: f64,
    torque: f64,
    rows: f64,
}

impl Sum {
    fn add(&mut self, truth: f64, estimate: f64, open_loop: f64) {
        self.estimate += (truth - estimate).powi(2);
        self.open_loop += (truth - open_loop).powi(2);
        self.torque += truth.abs();
        self.rows += 1.0;
    }
    fn merge(&mut self, other: &Self) {
        self.estimate += other.estimate;
        self.open_loop += other.open_loop;
        self.torque += other.torque;
        self.rows += other.rows;
    }
    fn rms(&self) -> [f64; 2] {
        [(self.estimate / self.rows).sqrt(), (self.open_loop / self.rows).sqrt()]
    }
}

/// Which clutch controls.
fn controlling(kind: ShiftKind) -> usize {
    match kind {
        ShiftKind::PowerOnUp | ShiftKind::CoastDown => 1,
        ShiftKind::PowerOnDown | ShiftKind::PowerOffUp => 0,
    }
}

#[test]
fn one_shift() {
    let Ok(name) = std::env::var("SHIFT") else { return };
    let parts: Vec<&str> = name.split(' ').collect();
    let bench = Bench::new();
    let gearbox = gearbox(parts[0]);
    let tables = bench.tables(&gearbox);
    let shift = gearbox.shift(gearbox.gear(parts[1]).unwrap(), gearbox.gear(parts[2]).unwrap()).unwrap();
    let kind = ShiftKind::ALL[parts[3].parse::<usize>().unwrap()];
    let mut random = Random(parts[4].parse().unwrap());
    let draw = if parts[4] == "0" { Draw { friction: [1.0; 2], gain: [1.0; 2], converter: 1.0 } } else { Draw::new(&mut random) };
    eprintln!("{kind:?} {:?} {:?} {:?}", draw.friction, draw.gain, draw.converter);
    for row in run(&bench, &gearbox, &tables, shift, kind, &draw, &mut random) {
        eprintln!(
            "{:.2} {:?} {:<16} truth {:7.1} {:7.1} est {:7.1} {:7.1} open {:7.1} {:7.1} p {:.3} {:.3} wt {:.1} wo {:.1} slips {:6.1} {:6.1} Tt {:.1} {:.1} {:?}",
            row.time_s, row.sticks.map(u8::from), row.phase.map_or("-", |phase| phase.name()), row.truth[0], row.truth[1], row.estimate[0],
            row.estimate[1], row.open_loop[0], row.open_loop[1], row.pressure[0][0] / 1e6, row.pressure[1][0] / 1e6, row.speeds[0], row.speeds[1], row.speeds[2], row.speeds[3], row.turbine[0], row.turbine[1], row.health
        );
    }
}

#[test]
fn matrix() {
    let bench = Bench::new();
    let draws: u64 = std::env::var("DRAWS").ok().map_or(2, |draws| draws.parse().unwrap());
    let verbose = std::env::var("VERBOSE").is_ok();
    let mut pooled: BTreeMap<(String, usize, bool, usize), Sum> = BTreeMap::new();
    for name in ["8hp.toml", "lepelletier_6.toml", "ravigneaux_4.toml", "10_speed.toml"] {
        let gearbox = gearbox(name);
        let tables = bench.tables(&gearbox);
        let gears = gearbox.forward_gears();
        for pair in gears.windows(2) {
            for kind in ShiftKind::ALL {
                let up = matches!(kind, ShiftKind::PowerOnUp | ShiftKind::PowerOffUp);
                let (from, to) = if up { (pair[0], pair[1]) } else { (pair[1], pair[0]) };
                let Some(shift) = gearbox.shift(from, to) else { continue };
                if bench.car(&gearbox, shift).is_none() {
                    continue;
                }
                let gain = 1.0 / (gearbox.gears[from].ratio - gearbox.gears[to].ratio).abs();
                let class = if gain < 2.0 { 0 } else if gain < 5.0 { 1 } else { 2 };
                let mut sums = [[Sum::default(); 2]; 2];
                for seed in 1..=draws {
                    let mut random = Random(seed * 1000 + from as u64 * 37 + to as u64);
                    let draw = Draw::new(&mut random);
                    for row in run(&bench, &gearbox, &tables, shift, kind, &draw, &mut random) {
                        let Some(inertia) = phase_of(&row) else { continue };
                        for c in 0..2 {
                            if row.sticks[c] { continue }
                            sums[usize::from(inertia)][c].add(row.truth[c], row.estimate[c], row.open_loop[c]);
                        }
                    }
                }
                let main = controlling(kind);
                if verbose {
                    let show = |sum: &Sum| if sum.rows > 0.0 { let [a, b] = sum.rms(); format!("{:5.2} ({:5.1} {:5.1}/{:5.1}, {:3.0} ms)", a / b, sum.torque / sum.rows, a, b, sum.rows * 10.0 / draws as f64) } else { "-".into() };
                    eprintln!("{name:20} {}-{} {kind:?} g {gain:.2}: torque {} inertia {} other {}", gearbox.gears[from].name, gearbox.gears[to].name, show(&sums[0][main]), show(&sums[1][main]), show(&sums[1][1 - main]));
                }
                for (inertia, sums) in sums.iter().enumerate() {
                    for (c, sum) in sums.iter().enumerate() {
                        // Where the open loop errs by more than 2 N m.
                        if sum.rows > 0.0 && sum.rms()[1] > 2.0 {
                            pooled.entry((format!("{kind:?}"), inertia, c == main, class)).or_default().merge(sum);
                        }
                    }
                }
            }
        }
    }
    for ((kind, inertia, main, class), sum) in &pooled {
        let [a, b] = sum.rms();
        eprintln!("{kind:12} {} {} class {class}: {:.2}  ({:.0} N m; {a:.1} / {b:.1})", ["torque ", "inertia"][*inertia], if *main { "main " } else { "other" }, a / b, sum.torque / sum.rows);
    }
}
