//! The shift finder on drives whose shifts are known by construction, and on a public drive where it lies beside the project.

use std::f64::consts::PI;
use std::io::Write as _;
use std::path::Path;

use logs::{ChannelMap, Direction, Gearbox, Load, Log, Reading, Readings, Role, Shift, ShiftFinder, ShiftPhase};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

const RATIOS: [f64; 8] = [4.696, 3.130, 2.104, 1.667, 1.285, 1.0, 0.839, 0.667];
/// Time of the inertia phase from 0 to 100 % of the way; the logarithm of the ratio goes by a line.
const INERTIA_S: f64 = 0.4;
/// From the command to the inertia phase.
const FILL_S: f64 = 0.3;

/// A drive: the gear before, and shifts by the time of their inertia phase and the gear after.
#[derive(Clone)]
struct Drive {
    first: usize,
    shifts: Vec<(f64, usize)>,
    duration_s: f64,
    noise_rad_s: f64,
    power_on: bool,
    /// Readings in these times are lost.
    hole_s: [f64; 2],
    /// Output speed over time.
    output: fn(f64) -> f64,
}

fn rolling(_: f64) -> f64 {
    150.0
}

impl Drive {
    fn new(first: usize, shifts: &[(f64, usize)]) -> Self {
        let duration_s = shifts.last().map_or(5.0, |(last_s, _)| last_s + 3.0);
        Self {
            first,
            shifts: shifts.to_vec(),
            duration_s,
            noise_rad_s: 0.0,
            power_on: true,
            hole_s: [-1.0; 2],
            output: rolling,
        }
    }

    fn ratio(&self, time_s: f64) -> f64 {
        let mut log = RATIOS[self.first - 1].ln();
        for (begin_s, to) in &self.shifts {
            let fraction = ((time_s - begin_s) / INERTIA_S).clamp(0.0, 1.0);
            log += fraction * (RATIOS[to - 1].ln() - log);
        }
        log.exp()
    }

    /// The gear whose command, or whose end of the inertia phase, came last.
    fn gear(&self, time_s: f64, after_s: f64) -> usize {
        self.shifts.iter().rev().find(|(begin_s, _)| time_s >= begin_s + after_s).map_or(self.first, |(_, gear)| *gear)
    }

    /// The readings of these roles: speeds every 10 ms with phases of their own, gears every 20 ms.
    fn readings(&self, roles: &[Role]) -> Vec<Reading> {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut noise = move || 2.0 * self.noise_rad_s * (random.next_u32() as f64 / f64::from(u32::MAX) - 0.5);
        let mut readings = Vec::new();
        for role in roles {
            let (period_s, phase_s) = match role {
                Role::EngineSpeed => (0.01, 0.002),
                Role::TurbineSpeed => (0.01, 0.0),
                Role::OutputSpeed => (0.01, 0.006),
                _ => (0.02, 0.003),
            };
            for i in 0..(self.duration_s / period_s) as u32 {
                let time_s = f64::from(i) * period_s + phase_s;
                if (self.hole_s[0]..self.hole_s[1]).contains(&time_s) {
                    continue;
                }
                let turbine = self.ratio(time_s) * (self.output)(time_s);
                let value = match role {
                    Role::EngineSpeed => turbine * if self.power_on { 1.06 } else { 0.95 } + noise(),
                    Role::TurbineSpeed => turbine + noise(),
                    Role::OutputSpeed => (self.output)(time_s) + noise(),
                    Role::VehicleSpeed => (self.output)(time_s) / 12.0,
                    Role::Gear => self.gear(time_s, INERTIA_S) as f64,
                    Role::TargetGear => self.gear(time_s, -FILL_S) as f64,
                    _ => unreachable!(),
                };
                readings.push(Reading { role: *role, time_s, stamp_s: time_s, value });
            }
        }
        readings.sort_by(|one, other| one.stamp_s.total_cmp(&other.stamp_s));
        readings
    }

    fn found(&self, roles: &[Role]) -> Vec<Shift> {
        let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
        found(&gearbox, roles, &self.readings(roles))
    }
}

fn found(gearbox: &Gearbox, roles: &[Role], readings: &[Reading]) -> Vec<Shift> {
    let new = || ShiftFinder::new(gearbox, |role| roles.contains(&role)).unwrap();
    let mut finder = new();
    readings.iter().for_each(|reading| finder.push(reading));
    let at_the_end = finder.finish();
    // Shifts that are taken out on the way are the same.
    let mut finder = new();
    let mut on_the_way = Vec::new();
    for reading in readings {
        finder.push(reading);
        on_the_way.extend(finder.take_settled(reading.stamp_s));
    }
    on_the_way.extend(finder.finish());
    assert_eq!(on_the_way, at_the_end);
    at_the_end
}

fn gears(shifts: &[Shift]) -> Vec<(u32, u32)> {
    shifts.iter().map(|shift| (shift.from, shift.to)).collect()
}

const SPEEDS: [Role; 3] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed];

#[test]
fn speeds_alone_give_every_shift_and_its_inertia_phase() {
    for noise_rad_s in [0.0, 1.0] {
        let mut drive = Drive::new(1, &[(2.0, 2), (4.0, 3), (6.0, 5), (9.0, 8), (12.0, 6), (15.0, 2)]);
        drive.noise_rad_s = noise_rad_s;
        let shifts = drive.found(&SPEEDS);
        assert_eq!(gears(&shifts), [(1, 2), (2, 3), (3, 5), (5, 8), (8, 6), (6, 2)]);
        for (shift, (begin_s, _)) in shifts.iter().zip(&drive.shifts) {
            let [from_s, to_s] = shift.inertia_s.unwrap();
            // 5 and 95 % of the way; with noise the smallest step (8 % at 1 % noise) is told to some samples.
            let expected = [begin_s + 0.05 * INERTIA_S, begin_s + 0.95 * INERTIA_S];
            let tolerance_s = if noise_rad_s == 0.0 { 0.011 } else { 0.05 };
            let half_s = shift.quality.inertia_half_s.unwrap();
            // Twelve times and more are all within twice their interval.
            for (found_s, expected_s) in [from_s, to_s].into_iter().zip(expected) {
                assert!((found_s - expected_s).abs() < 2.0 * half_s && half_s < 0.1, "{half_s} {shift:?}");
            }
            assert!((from_s - expected[0]).abs() < tolerance_s, "{shift:?}");
            assert!((to_s - expected[1]).abs() < tolerance_s, "{shift:?}");
            assert_eq!(shift.direction, if shift.to > shift.from { Direction::Up } else { Direction::Down });
            assert_eq!((shift.load, shift.command_s, shift.gear_s), (Load::PowerOn, None, None));
        }
    }
}

#[test]
fn ratios_that_contradict_the_gear_signal_are_named() {
    let drive = Drive::new(1, &[(8.0, 2), (16.0, 3), (24.0, 4), (32.0, 2)]);
    let roles = [Role::TurbineSpeed, Role::OutputSpeed, Role::Gear];
    let contradiction = |ratios: &[f64], readings: &[Reading]| {
        let gearbox = Gearbox { ratios: ratios.to_vec(), ..Gearbox::default() };
        let mut finder = ShiftFinder::new(&gearbox, |role| roles.contains(&role)).unwrap();
        readings.iter().for_each(|reading| finder.push(reading));
        finder.contradiction()
    };
    let readings = drive.readings(&roles);
    assert_eq!(contradiction(&RATIOS, &readings), None);
    let mut other = RATIOS;
    other[1] = 3.5;
    let said = contradiction(&other, &readings).unwrap();
    assert!(said.starts_with("the gear signal contradicts the ratios of the gears: in gear 2 the speeds have 3.130 and 3.500 is given\nhint: "), "{said}");
    assert!(!said.contains("gear 3"), "{said}");
    // A gear signal that changes two seconds after the shift, and one that changes before it.
    for late_s in [1.9, -0.9] {
        let moved = |reading: &Reading| match reading.role {
            Role::Gear => Reading { time_s: reading.time_s + late_s, stamp_s: reading.stamp_s + late_s, ..*reading },
            _ => *reading,
        };
        let mut late: Vec<Reading> = readings.iter().map(moved).collect();
        late.sort_by(|one, other| one.stamp_s.total_cmp(&other.stamp_s));
        assert_eq!(contradiction(&RATIOS, &late), None, "{late_s}");
        // A short stay in each gear.
        let hasty = Drive::new(1, &[(2.0, 2), (4.0, 3), (6.0, 4), (8.0, 5), (10.0, 6)]);
        let mut late: Vec<Reading> = hasty.readings(&roles).iter().map(moved).collect();
        late.sort_by(|one, other| one.stamp_s.total_cmp(&other.stamp_s));
        assert_eq!(contradiction(&RATIOS, &late), None, "{late_s}");
    }
}

#[test]
fn a_car_that_drives_its_engine_shifts_power_off() {
    let mut drive = Drive::new(4, &[(2.0, 3), (5.0, 2)]);
    drive.power_on = false;
    let shifts = drive.found(&SPEEDS);
    assert_eq!(gears(&shifts), [(4, 3), (3, 2)]);
    assert!(shifts.iter().all(|shift| shift.load == Load::PowerOff && shift.direction == Direction::Down));
}

#[test]
fn gear_signals_alone_give_commands_and_ends() {
    let drive = Drive::new(1, &[(2.0, 2), (4.0, 3), (6.0, 1)]);
    let shifts = drive.found(&[Role::Gear, Role::TargetGear]);
    assert_eq!(gears(&shifts), [(1, 2), (2, 3), (3, 1)]);
    for (shift, (begin_s, _)) in shifts.iter().zip(&drive.shifts) {
        assert!((shift.command_s.unwrap() - begin_s + FILL_S).abs() < 0.021 && shift.inertia_s.is_none());
        assert!((shift.gear_s.unwrap() - begin_s - INERTIA_S).abs() < 0.021 && shift.load == Load::Unknown);
        assert!(shift.quality.flare_rad_s.is_none() && shift.quality.jerk_m_s3.is_none());
    }
}

#[test]
fn signals_and_speeds_together_give_each_shift_once() {
    let drive = Drive::new(1, &[(2.0, 2), (4.0, 3), (6.0, 2)]);
    let shifts = drive.found(&[Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::Gear, Role::TargetGear]);
    assert_eq!(gears(&shifts), [(1, 2), (2, 3), (3, 2)]);
    for shift in &shifts {
        let (phase, [from_s, to_s]) = shift.phases()[0];
        // A power-on downshift begins with its inertia phase.
        assert_eq!(phase, if shift.direction == Direction::Up { ShiftPhase::FillAndTorque } else { ShiftPhase::Fill });
        let response_s = to_s - from_s;
        assert!((response_s - FILL_S - 0.05 * INERTIA_S).abs() < 0.03, "{response_s}");
        assert!(shift.gear_s.is_some());
    }
}

#[test]
fn what_happens_in_a_hole_or_at_standstill_is_not_a_shift() {
    let mut drive = Drive::new(2, &[(2.0, 3), (5.0, 4)]);
    drive.hole_s = [1.8, 2.6];
    assert_eq!(gears(&drive.found(&SPEEDS)), [(3, 4)]);
    // To a stop in 4th and off again in 1st, which was engaged while the car stood.
    let mut drive = Drive::new(4, &[(5.0, 1), (9.0, 2)]);
    drive.output = |time_s| 50.0 * (time_s - 5.2).abs().max(0.5) - 25.0;
    assert_eq!(gears(&drive.found(&SPEEDS)), [(1, 2)]);
}

/// The recording may pause as soon as a shift is over; what was seen of it is not forgotten.
#[test]
fn a_pause_of_the_recording_costs_nothing_of_the_shift_before_it() {
    let drive = Drive { duration_s: 14.0, ..Drive::new(2, &[(6.0, 3)]) };
    let roles = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::Gear, Role::TargetGear];
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), output_rad_per_m: Some(12.0), ..Gearbox::default() };
    let readings = drive.readings(&roles);
    let whole = found(&gearbox, &roles, &readings);
    assert_eq!((gears(&whole), whole[0].load), (vec![(2, 3)], Load::PowerOn));
    assert!(whole[0].quality.jerk_m_s3.is_some());
    for pause_s in [2.0, 13.0, 16.0, 600.0] {
        let mut paused = readings.clone();
        for reading in paused.iter_mut().filter(|reading| reading.stamp_s > 7.6) {
            reading.time_s += pause_s;
            reading.stamp_s += pause_s;
        }
        assert_eq!(found(&gearbox, &roles, &paused), whole, "{pause_s} s");
    }
}

#[test]
fn readings_of_every_role_are_taken() {
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
    let readings: Vec<Reading> =
        Role::all().map(|role| Reading { role, time_s: 1.0, stamp_s: 1.0, value: 1.0 }).collect();
    assert_eq!(found(&gearbox, &SPEEDS, &readings), []);
}

#[test]
fn an_engine_stands_for_a_turbine_that_is_not_measured() {
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
    let drive = Drive::new(5, &[(2.0, 6), (5.0, 7)]);
    let mut readings = drive.readings(&[Role::EngineSpeed, Role::OutputSpeed]);
    // The converter is locked.
    readings.iter_mut().filter(|reading| reading.role == Role::EngineSpeed).for_each(|reading| reading.value /= 1.06);
    let shifts = found(&gearbox, &[Role::EngineSpeed, Role::OutputSpeed], &readings);
    assert_eq!(gears(&shifts), [(5, 6), (6, 7)]);
}

#[test]
fn a_gear_signal_contradicts_what_the_engine_alone_shows() {
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
    let drive = Drive::new(5, &[(2.0, 6), (8.0, 7)]);
    let roles = [Role::EngineSpeed, Role::OutputSpeed, Role::Gear];
    let mut readings = drive.readings(&roles);
    for reading in &mut readings {
        match reading.role {
            // The converter is locked.
            Role::EngineSpeed => reading.value /= 1.06,
            // The change of the ratio at 8 s is none of the gearbox.
            Role::Gear if reading.value == 7.0 => reading.value = 6.0,
            _ => {}
        }
    }
    assert_eq!(gears(&found(&gearbox, &roles, &readings)), [(5, 6)]);
    let mut finder = ShiftFinder::new(&gearbox, |role| roles.contains(&role)).unwrap();
    readings.iter().for_each(|reading| finder.push(reading));
    finder.restart();
    let notes = finder.notes();
    assert!(notes[0].starts_with("no turbine speed is mapped: ") && notes[1].starts_with("1 changes of"), "{notes:?}");
    assert_eq!(notes.len(), 2, "{notes:?}");
}

/// What is wrong with the readings of a drive.
type Change<'a> = &'a dyn Fn(&mut Reading);

#[test]
fn speeds_that_are_in_no_gear_are_told_with_their_ratio() {
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
    let drive = Drive::new(2, &[(3.0, 3)]);
    let notes = |change: Change<'_>| {
        let mut readings = drive.readings(&SPEEDS);
        readings.iter_mut().for_each(change);
        let mut finder = ShiftFinder::new(&gearbox, |role| SPEEDS.contains(&role)).unwrap();
        readings.iter().for_each(|reading| finder.push(reading));
        let notes = finder.notes();
        finder.restart();
        assert_eq!(finder.notes(), notes, "a reset of the clock changes nothing");
        notes.into_iter().next()
    };
    assert_eq!(notes(&|_| ()), None);
    // A turbine in rad/s with an output in rpm, a car in km/h as m/s, a time in ms as s, a car that stands.
    let output = |factor: f64| {
        move |reading: &mut Reading| {
            if reading.role == Role::OutputSpeed {
                reading.value *= factor;
            }
        }
    };
    let cases: [(Change<'_>, &str); 4] = [
        (&output(9.549), "are in no gear, the middle one of them 0.3"),
        (&output(3.6), "are in no gear, the middle one of them 0.8"),
        (
            &|reading| (reading.time_s, reading.stamp_s) = (1e3 * reading.time_s, 1e3 * reading.stamp_s),
            "never turn fast enough",
        ),
        (&output(0.01), "never turn fast enough for a ratio at the same time\nhint: check"),
    ];
    for (change, expected) in cases {
        let note = notes(change).unwrap();
        assert!(note.contains(expected) && note.contains("\nhint: "), "{note} | {expected}");
    }
}

#[test]
fn flare_is_the_turbine_above_the_old_gear() {
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
    let drive = Drive::new(2, &[(3.0, 3)]);
    let mut readings = drive.readings(&SPEEDS);
    // A half sine of 12 rad/s in the 0.2 s before the inertia phase.
    for reading in readings.iter_mut().filter(|reading| reading.role == Role::TurbineSpeed) {
        let fraction = (reading.time_s - 2.8) / 0.2;
        if (0.0..1.0).contains(&fraction) {
            reading.value += 12.0 * (PI * fraction).sin();
        }
    }
    let shifts = found(&gearbox, &SPEEDS, &readings);
    assert_eq!(gears(&shifts), [(2, 3)]);
    let flare = shifts[0].quality.flare_rad_s.unwrap();
    let [half, half_s] = [shifts[0].quality.flare_half_rad_s, shifts[0].quality.inertia_half_s].map(Option::unwrap);
    assert!((0.0..5.0).contains(&half) && (0.0..0.05).contains(&half_s) && half_s > 0.0, "{half} {half_s}");
    // Of five points in 40 ms the middle one counts: the peak is cut by at most 12 (1 - cos(pi 0.02 / 0.2)).
    assert!((flare - 12.0).abs() < 0.6, "{flare}");
    let without = drive.found(&SPEEDS)[0].quality.flare_rad_s.unwrap();
    assert!(without < 0.3, "{without}");
}

#[test]
fn jerk_is_the_second_derivative_of_the_speed() {
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), output_rad_per_m: Some(12.0), ..Gearbox::default() };
    let mut drive = Drive::new(2, &[(3.0, 3)]);
    // Speed of the car in m/s times 12: 10 + 1.5 t + 1/2 0.8 t^2.
    drive.output = |time_s| 12.0 * (10.0 + 1.5 * time_s + 0.4 * time_s * time_s);
    for roles in [vec![Role::TurbineSpeed, Role::OutputSpeed], vec![Role::TurbineSpeed, Role::VehicleSpeed]] {
        let shifts = found(&gearbox, &roles, &drive.readings(&roles));
        assert_eq!(gears(&shifts), [(2, 3)]);
        let jerk = shifts[0].quality.jerk_m_s3.unwrap();
        assert!((jerk - 0.8).abs() < 1e-6, "{jerk}");
        let half = shifts[0].quality.jerk_half_m_s3.unwrap();
        assert!(half < 1e-6, "{half}");
    }
    // Noise of the readings makes it uncertain, and its interval holds the jerk without noise.
    let roles = [Role::TurbineSpeed, Role::OutputSpeed];
    for noise_rad_s in [0.05, 0.2, 0.5] {
        drive.noise_rad_s = noise_rad_s;
        let quality = found(&gearbox, &roles, &drive.readings(&roles))[0].quality;
        let (jerk, half) = (quality.jerk_m_s3.unwrap(), quality.jerk_half_m_s3.unwrap());
        assert!(half > 0.01 && (jerk - 0.8).abs() < half, "{noise_rad_s}: {jerk} +-{half}");
    }
}

#[test]
fn a_log_that_cannot_tell_a_shift_is_refused() {
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
    for roles in [vec![Role::EngineSpeed], vec![Role::TurbineSpeed, Role::VehicleSpeed], vec![]] {
        let error = ShiftFinder::new(&gearbox, |role| roles.contains(&role)).map(|_| ()).unwrap_err().to_string();
        assert!(error.starts_with("no channel of the map shows a shift\nhint: map `gear`"), "{error}");
    }
    let wrong = Gearbox { ratios: vec![1.0, 2.0], ..Gearbox::default() };
    assert!(ShiftFinder::new(&wrong, |_| true).is_err());
}

/// The drive is not part of the project: its place is in `WETCLUTCH_GENESIS_LOG`.
#[test]
fn a_public_drive_has_its_three_upshifts() {
    let Some(path) = std::env::var_os("WETCLUTCH_GENESIS_LOG") else {
        // Past the test runner, which keeps what a passing test prints.
        let skipped =
            b"SKIPPED: WETCLUTCH_GENESIS_LOG does not name the log of the public drive (maps/genesis_at8.toml)\n";
        std::io::stderr().write_all(skipped).unwrap();
        return;
    };
    let map = ChannelMap::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../maps/genesis_at8.toml")).unwrap();
    let mut log = Log::open(Path::new(&path), &map.open).unwrap();
    let mut readings = Readings::new(&mut log, &map).unwrap();
    let mut finder = ShiftFinder::new(&map.gearbox, |role| map.has(role)).unwrap();
    for reading in &mut readings {
        finder.push(&reading.unwrap());
    }
    readings.check().unwrap();
    let shifts = finder.finish();
    assert_eq!(gears(&shifts), [(1, 2), (2, 3), (3, 4)]);
    // What others found in the same drive: the ratio from 5 to 95 % in 0.76, 0.61 and 0.64 s, shift flag 1.4, 1.7 and 2.1 s.
    for (shift, (inertia_s, flag_s)) in shifts.iter().zip([(0.76, 1.4), (0.61, 1.7), (0.64, 2.1)]) {
        let [from_s, to_s] = shift.inertia_s.unwrap();
        assert!((to_s - from_s - inertia_s).abs() < 0.05, "{shift:?}");
        let flag = shift.gear_s.unwrap() - shift.command_s.unwrap();
        assert!((flag - flag_s).abs() < 0.06, "{shift:?}");
        assert_eq!(shift.load, Load::PowerOn);
    }
}

#[test]
fn a_shift_over_which_a_speed_is_not_there_is_found_by_the_ratios_around_it() {
    let drive = Drive::new(2, &[(3.0, 3)]);
    let roles = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed];
    let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
    let found = |fails: &[Role], to_s: f64, is_refused: bool| {
        let mut finder = ShiftFinder::new(&gearbox, |role| roles.contains(&role)).unwrap();
        for mut reading in drive.readings(&roles) {
            if fails.contains(&reading.role) && reading.time_s > 2.7 && reading.time_s < to_s {
                if !is_refused {
                    continue;
                }
                reading.value = f64::NAN;
            }
            finder.push(&reading);
        }
        gears(&finder.finish())
    };
    for role in [Role::TurbineSpeed, Role::OutputSpeed] {
        for is_refused in [true, false] {
            assert_eq!(found(&[role], 4.2, is_refused), [(2, 3)], "{role:?} {is_refused}");
            // A failure of more than three seconds may hold more than one shift.
            assert_eq!(found(&[role], 5.9, is_refused), [], "{role:?} {is_refused}");
        }
    }
    // And so may a hole of the recording.
    assert_eq!(found(&roles, 4.2, false), []);
}
