//! A car with a whole gearbox that differs from its file, and a drive of it behind sensors.

use std::cell::RefCell;
use std::path::Path;

use car::ErrorBudget;
use car::{Car, Drive, DriveSegment, Sensors};
use config::{CarFile, DriveFile, Source};
use fit::gearbox::{GearboxFit, GivenFile, HeldOut, Quantities, Quantity, Recorded, Recorder, ShiftLog};
use fit::{FitError, ReadingAges, Series};
use observer::Reading;
use observer::ShiftTables;
use observer::gearbox::ShiftInput;
use plant::car::{CarCalibration, CarModel, CarSample, simulate_car_drive};
use study::gearbox::ShiftDraw;

use study::gearbox::matrix::Random;
use study::gearbox::measured::{MeasuredRow, SensedDrive};
use study::gearbox::recording::reported_engine_n_m;

/// Bounds of what is drawn: as fractions, and of the kiss point in Pa.
const FRICTION: f64 = 0.15;
const GAIN: f64 = 0.08;
const CONVERTER: f64 = 0.08;
const INERTIA: f64 = 0.10;
const KISS_PA: f64 = 10e3;
/// Scale and noise of a pressure sensor.
const SENSOR_SCALE: f64 = 0.008;
const SENSOR_PA: f64 = 3e3;
/// Of the volume of each piston's stroke.
const FILL: f64 = 0.25;
/// Of the drag of each open element.
const DRAG: f64 = 0.5;
/// Of mass, rolling resistance, air drag, engine inertia, stiffness of the drive shafts and slip of the tyres.
const MASS: f64 = 0.15;
const ROLLING: f64 = 0.3;
const AIR: f64 = 0.2;
const ENGINE_INERTIA: f64 = 0.1;
const STIFFNESS: f64 = 0.2;
const TYRE: f64 = 0.25;
/// Of a reported engine torque: scale, an error that comes and goes, both as fractions, noise, N m, and by how much it is ahead, s.
const REPORTED: f64 = 0.08;
const REPORTED_SLOWLY: f64 = 0.03;
const REPORTED_N_M: f64 = 1.0;
const AHEAD_S: [f64; 2] = [-0.02, 0.04];
/// Grade at the ends of the segments of a hilly road, and in the mean, rad.
const GRADE_RAD: f64 = 0.03;
const MEAN_GRADE_RAD: f64 = 0.008;
/// Sets random numbers of their own apart from those of the others.
const ROAD_STREAM: u64 = 0x2545_f491_4f6c_dd1d;
/// Sets the random number of the backlash apart from those of the others.
const BACKLASH_STREAM: u64 = 0x9e37_79b9_7f4a_7c15;
/// Sets the random numbers of the valves' timing apart from those of the others.
const TIMING_STREAM: u64 = 0x5bf0_3635_dab2_c9e1;
/// Time between two rows, s.
const ROW_S: f64 = 0.01;

pub(crate) fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// Files of a fit.
pub(crate) trait FittedFile {
    /// The file with the fitted values, as it is to stand at this path.
    fn vehicle_file(&self, car: &CarFile, path: &Path, logs: &str, of: Option<&HeldOut>) -> Result<CarFile, FitError>;
}

impl FittedFile for GearboxFit {
    fn vehicle_file(&self, car: &CarFile, path: &Path, logs: &str, of: Option<&HeldOut>) -> Result<CarFile, FitError> {
        let given = GivenFile { path: &car.source.path, text: &car.source.text, gearbox: &car.gearbox_source.path };
        let source = Source { path: path.to_owned(), text: self.vehicle_text(car, given, path, logs, of)? };
        Ok(CarFile::from_sources(source, car.gearbox_source.clone()).unwrap())
    }
}

/// A car of the repository.
pub(crate) fn car(name: &str) -> CarFile {
    CarFile::read(&root().join("vehicles").join(name)).unwrap()
}

/// Sensors of the bench.
pub(crate) fn sensors() -> Sensors {
    config::read_sensors(&root().join("experiments/bench.toml")).unwrap().unwrap()
}

/// The drive in town, so many times.
pub(crate) fn city(repetitions: u32) -> Drive {
    Drive { repetitions, ..DriveFile::read(&root().join("drives/city.toml")).unwrap().drive }
}

/// A drive on a road whose grade is drawn by this seed, with as many segments as its repetitions have together.
pub(crate) fn hilly(drive: &Drive, seed: u64) -> Drive {
    let mut random = Random(seed.wrapping_mul(ROAD_STREAM));
    // A sum of three uniform numbers is nearly normal.
    let mut normal = |sd: f64| 2.0 * sd * ((0..3).map(|_| random.uniform()).sum::<f64>() - 1.5);
    let mean = normal(MEAN_GRADE_RAD);
    let mut grade = mean + normal(GRADE_RAD);
    let mut segments = Vec::new();
    for segment in (0..drive.repetitions).flat_map(|_| &drive.segments) {
        let next = mean + normal(GRADE_RAD);
        segments.push(DriveSegment { grade_rad: [grade, next], ..*segment });
        grade = next;
    }
    Drive { segments, repetitions: 1, ..drive.clone() }
}

/// The drive in town, so many times, each followed by a minute of pressing and releasing the accelerator.
pub(crate) fn with_tip_ins(repetitions: u32) -> Drive {
    let city = city(1);
    let segment = |duration_s: f64, throttle: f64| DriveSegment {
        duration_s,
        throttle: [throttle; 2],
        brake: [0.0; 2],
        ..city.segments[0]
    };
    let mut segments = city.segments.clone();
    segments.push(segment(3.0, 0.25));
    for depth in [0.25, 0.35, 0.3, 0.4].into_iter().cycle().take(16) {
        segments.extend([segment(2.0, 0.04), segment(1.6, depth)]);
    }
    Drive { segments: segments.repeat(repetitions.try_into().unwrap()), repetitions: 1, ..city }
}

/// What the channels of a log have of errors.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Channels {
    /// By how much engine, turbine, output and wheel speed are stamped late, s.
    pub(crate) late_s: [f64; 4],
    /// What the wheel speed has to be multiplied with, less 1.
    pub(crate) wheel_scale: f64,
    /// By how much all commands are stamped late, s.
    pub(crate) commands_s: f64,
}

impl Channels {
    /// The row as the log has it.
    pub(crate) fn of(&self, input: &ShiftInput<f64>) -> ShiftInput<f64> {
        let late = |reading: Reading<f64>, late_s: f64| Reading { age_s: reading.age_s - late_s, ..reading };
        let [engine, turbine, output, wheel] = self.late_s;
        let true_over_read = 1.0 + self.wheel_scale;
        ShiftInput {
            engine_rad_s: input.engine_rad_s.map(|reading| late(reading, engine)),
            turbine_rad_s: input.turbine_rad_s.map(|reading| late(reading, turbine)),
            output_rad_s: input.output_rad_s.map(|reading| late(reading, output)),
            wheel_rad_s: input
                .wheel_rad_s
                .map(|reading| late(Reading { value: reading.value / true_over_read, ..reading }, wheel)),
            commands: input.commands.map(|reading| reading.map(|reading| late(reading, self.commands_s))),
            ..*input
        }
    }
}

/// In what a car differs from its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Case {
    /// Friction, valve gain, kiss points, converter, inertias and drag.
    Usual,
    /// Lag, delay and hysteresis of each valve too, anywhere in the bounds of a car in series.
    WithTiming,
    /// In nothing.
    Right,
}

/// A car as its file has it, and as it is.
#[derive(Clone)]
pub(crate) struct Drawn {
    pub(crate) file: CarFile,
    pub(crate) truth: Car,
    pub(crate) seed: u64,
    draw: ShiftDraw,
    kiss_pa: Vec<f64>,
    /// Volume of the stroke of each element of the gearbox over that of the file.
    pub(crate) fill: Vec<f64>,
    /// What the file's inertias are multiplied with to be true, by pairs of gears.
    inertia: Vec<([usize; 2], f64)>,
    /// The same of mass, rolling resistance, air drag and engine inertia.
    vehicle: [f64; 4],
    /// What the engine's controller reports of its torque.
    pub(crate) reported: Option<ReportedErrors>,
    pub(crate) channels: Channels,
}

/// Errors of a reported engine torque.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReportedErrors {
    /// Reported over true torque.
    pub(crate) factor: f64,
    pub(crate) slowly: f64,
    pub(crate) noise_n_m: f64,
    pub(crate) ahead_s: f64,
}

impl ReportedErrors {
    fn of(seed: u64, fraction: f64) -> Self {
        let mut random = Random(!seed ^ ROAD_STREAM);
        Self {
            factor: 1.0 + fraction * REPORTED * (2.0 * random.uniform() - 1.0),
            slowly: fraction * REPORTED_SLOWLY,
            noise_n_m: REPORTED_N_M,
            ahead_s: AHEAD_S[0] + (AHEAD_S[1] - AHEAD_S[0]) * random.uniform(),
        }
    }

    /// The reading of a row.
    fn reading(&self, torque_n_m: &Series, time_s: f64) -> Reading<f64> {
        // A number that is another one in every row.
        let noise = 2.0 * Random((1e3 * time_s) as u64).uniform() - 1.0;
        let factor = self.factor * (1.0 + self.slowly * (0.3 * time_s).sin());
        Reading::now(factor * torque_n_m.at(time_s + self.ahead_s) + self.noise_n_m * noise)
    }
}

impl Drawn {
    /// A car drawn by this seed.
    pub(crate) fn of(file: CarFile, seed: u64, case: Case) -> Self {
        let mut random = Random(seed);
        let fraction = if case == Case::Right { 0.0 } else { 1.0 };
        let mut within = |bound: f64| fraction * bound * (2.0 * random.uniform() - 1.0);
        let none = ShiftDraw::none(&file);
        let draw = ShiftDraw {
            friction: none.friction.iter().map(|_| 1.0 + within(FRICTION)).collect(),
            valve_gain: none.valve_gain.iter().map(|_| 1.0 + within(GAIN)).collect(),
            converter: 1.0 + within(CONVERTER),
            ..none
        };
        // Streams of their own: the other draws do not depend on them.
        let (mut timings, mut drags) = (Random(seed ^ TIMING_STREAM), Random(!seed));
        let draw = match case {
            Case::WithTiming => draw.with_timing(&ErrorBudget::of_car(&file), || timings.uniform()),
            _ => draw,
        };
        let mut truth = draw.car(&file);
        let kiss_pa: Vec<f64> = truth.clutches.iter().map(|_| within(KISS_PA)).collect();
        for (clutch, kiss_pa) in truth.clutches.iter_mut().zip(&kiss_pa) {
            let Some(clutch) = clutch else { continue };
            let preload = clutch.cylinder.preload_pa / clutch.cylinder.kiss_pa;
            clutch.clutch.return_spring_n += kiss_pa * clutch.clutch.piston_area_m2;
            clutch.cylinder.kiss_pa = clutch.clutch.kiss_pressure();
            clutch.cylinder.preload_pa = preload * clutch.cylinder.kiss_pa;
        }
        let mut fills = Random(!seed ^ TIMING_STREAM);
        let fill: Vec<f64> =
            truth.clutches.iter().map(|_| 1.0 + fraction * FILL * (2.0 * fills.uniform() - 1.0)).collect();
        for (clutch, fill) in truth.clutches.iter_mut().zip(&fill) {
            clutch.iter_mut().for_each(|clutch| clutch.cylinder.stroke_m3 *= fill);
        }
        for clutch in truth.clutches.iter_mut().flatten() {
            clutch.drag_n_m *= 1.0 + fraction * DRAG * (2.0 * drags.uniform() - 1.0);
        }
        // The simulated gear train has its own inertia; that of the file is what is wrong.
        let mut file = file;
        let forward = file.gearbox.forward_gears();
        let pairs = (1..forward.len()).flat_map(|apart| forward.windows(apart + 1));
        let inertia: Vec<([usize; 2], f64)> =
            pairs.map(|gears| ([gears[0], gears[gears.len() - 1]], 1.0 + within(INERTIA))).collect();
        for shift in &mut file.gearbox.shifts {
            let of_pair = inertia
                .iter()
                .find(|(pair, _)| [[pair[0], pair[1]], [pair[1], pair[0]]].contains(&[shift.from, shift.to]));
            if let (Some((_, factor)), Some(reduced)) = (of_pair, &mut shift.reduced) {
                reduced.mass_kg_m2[0][0] /= factor;
            }
        }
        let mut roads = Random(seed ^ ROAD_STREAM);
        let mut factor = |bound: f64| 1.0 + fraction * bound * (2.0 * roads.uniform() - 1.0);
        // Without a converter the engine's inertia is part of `M11`.
        let engine = if file.converter.is_some() { ENGINE_INERTIA } else { 0.0 };
        let vehicle = [factor(MASS), factor(ROLLING), factor(AIR), factor(engine)];
        file.road.mass_kg /= vehicle[0];
        file.road.rolling_moment_n_m /= vehicle[1];
        file.road.drag_coefficient /= vehicle[2];
        file.engine.inertia_kg_m2 /= vehicle[3];
        file.driveline.shaft_stiffness_n_m_rad /= factor(STIFFNESS);
        file.tyre.slip_scale /= factor(TYRE);
        Self { file, truth, seed, draw, kiss_pa, fill, inertia, vehicle, reported: None, channels: Channels::default() }
    }

    /// With a mass in its file that is known to a percent.
    pub(crate) fn weighed(mut self) -> Self {
        self.file.road.mass_kg = self.truth.road.mass_kg;
        self.file.error_bounds.mass_share = Some(0.01);
        self.vehicle[0] = 1.0;
        self
    }

    /// With a file whose error bounds say that no valve has a hysteresis.
    pub(crate) fn without_hysteresis(mut self) -> Self {
        let car = &mut self.file.car;
        let bounds = &mut car.error_bounds.elements;
        bounds.resize(car.clutches.len(), Default::default());
        bounds.iter_mut().for_each(|own| own.valve_hysteresis_pa = Some(0.0));
        self
    }

    /// With a backlash of its own, of up to 0.08 rad at the wheels.
    pub(crate) fn with_backlash(mut self) -> Self {
        self.truth.backlash_rad = 0.08 * Random(self.seed ^ BACKLASH_STREAM).uniform();
        self
    }

    /// With channels that are up to 10 ms late or early, the wheel speed 30 ms, with a scale of it that is off by up to 1.5 %.
    pub(crate) fn with_channels(mut self) -> Self {
        let mut random = Random(!self.seed ^ BACKLASH_STREAM);
        let mut within = |bound: f64| bound * (2.0 * random.uniform() - 1.0);
        let late_s = [within(0.01), 0.0, within(0.01), within(0.03)];
        self.channels = Channels { late_s, wheel_scale: within(0.015), commands_s: 0.0 };
        self
    }

    /// With a reported engine torque.
    pub(crate) fn with_reported(self, case: Case) -> Self {
        let fraction = if case == Case::Right { 0.0 } else { 1.0 };
        Self { reported: Some(ReportedErrors::of(self.seed, fraction)), ..self }
    }

    pub(crate) fn tables(&self) -> ShiftTables<f64> {
        tables(&self.file)
    }

    /// The unknown of a quantity with which the file would be that of the car.
    pub(crate) fn true_unknown(&self, tables: &ShiftTables<f64>, quantities: &Quantities, quantity: Quantity) -> f64 {
        let element = |place: usize| (0..self.file.clutches.len()).find(|at| tables.place(*at) == Some(place)).unwrap();
        match quantity {
            Quantity::Input if self.file.converter.is_some() => self.draw.converter.ln(),
            Quantity::Input | Quantity::TorqueRatio | Quantity::Delay(_) => 0.0,
            Quantity::Lag(place) => self.draw.timing[element(place)].map_or(0.0, |timing| timing.lag.ln()),
            Quantity::InputDelay | Quantity::PressureScale | Quantity::PressureOffset(_) => 0.0,
            Quantity::EngineDelay => self.channels.late_s[0] / 0.01,
            Quantity::Mass => self.vehicle[0].ln(),
            Quantity::Rolling => self.vehicle[1].ln(),
            Quantity::Air => self.vehicle[2].ln(),
            Quantity::EngineInertia => self.vehicle[3].ln(),
            Quantity::ReportedScale => -self.reported.map_or(1.0, |reported| reported.factor).ln(),
            Quantity::ReportedDelay => self.reported.map_or(0.0, |reported| reported.ahead_s) / 0.01,
            Quantity::Gain(place) => self.draw.valve_gain[element(place)].ln(),
            Quantity::Drag(place) => {
                let [truth, file] = [&self.truth, &self.file].map(|car| car.clutches[element(place)].unwrap().drag_n_m);
                truth - file
            }
            Quantity::Torque(place) => {
                let at = element(place);
                (self.draw.friction[at] * self.draw.valve_gain[at]).ln()
            }
            Quantity::Kiss(place) => {
                let at = element(place);
                let file_pa = self.file.clutches[at].unwrap().clutch.kiss_pressure();
                ((file_pa + self.kiss_pa[at]) / self.draw.valve_gain[at] - file_pa) / 1e4
            }
            Quantity::Inertia(pair) => {
                let pair = quantities.pairs[pair];
                self.inertia.iter().find(|(other, _)| *other == pair).unwrap().1.ln()
            }
        }
    }

    /// The shifts of a drive, and the truth.
    pub(crate) fn driven(&self, drive: &Drive) -> (Recorded, Truth) {
        let tables = self.tables();
        let mut recorder = Recorder::new(&self.file, &tables, ReadingAges::of(&sensors()));
        let mut truth = Truth::default();
        self.each_reported(
            drive,
            |sample| truth.push(sample),
            |time_s, input, reported| {
                recorder.push_reported(reported);
                recorder.push(time_s, input);
            },
        );
        (recorder.finish(), truth)
    }

    /// As [`Self::each_row`], with the reported engine torque.
    pub(crate) fn each_reported(
        &self,
        drive: &Drive,
        mut sampled: impl FnMut(&CarSample),
        mut read: impl FnMut(f64, &ShiftInput<f64>, Option<Reading<f64>>),
    ) {
        let torque = RefCell::new(Series::default());
        self.each_row(
            drive,
            |sample| {
                sampled(sample);
                torque.borrow_mut().push(sample.time_s, reported_engine_n_m(&self.truth, sample));
            },
            |time_s, input| {
                let reported = self.reported.map(|reported| reported.reading(&torque.borrow(), time_s));
                read(time_s, input, reported);
            },
        );
    }

    /// Simulates a drive: `sampled` gets the truth, `read` what is read of it.
    pub(crate) fn each_row(
        &self,
        drive: &Drive,
        sampled: impl FnMut(&CarSample),
        mut read: impl FnMut(f64, &ShiftInput<f64>),
    ) {
        let tables = self.tables();
        self.each_measured(drive, self.seed, sampled, |row| {
            read(row.sample.time_s, &self.channels.of(&row.input(&self.file, &tables)));
        });
    }

    /// The same with readings by sensors of this seed.
    pub(crate) fn each_measured(
        &self,
        drive: &Drive,
        seed: u64,
        mut sampled: impl FnMut(&CarSample),
        mut read: impl FnMut(&MeasuredRow),
    ) {
        let sensors = Sensors { seed, ..sensors() };
        let model = CarModel::new(self.truth.clone()).unwrap();
        let mut sensed = SensedDrive::new(&self.file, &sensors, ROW_S);
        let drive = Drive { sample_time_s: sensed.record_s(), ..drive.clone() };
        simulate_car_drive(&model, &self.file, CarCalibration::STANDARD, &drive, |sample| {
            sampled(sample);
            sensed.each(sample, &mut read);
        })
        .unwrap();
        sensed.last(&mut read);
    }
}

pub(crate) fn tables(car: &Car) -> ShiftTables<f64> {
    ShiftTables::of_car(car, &ErrorBudget::of_car(car)).unwrap()
}

/// Shifts to fit, and every fifth to check.
pub(crate) fn every_fifth(shifts: Vec<ShiftLog>) -> [Vec<ShiftLog>; 2] {
    let mut divided = [Vec::new(), Vec::new()];
    for (at, shift) in shifts.into_iter().enumerate() {
        divided[usize::from(at % 5 == 4)].push(shift);
    }
    divided
}

/// True torques of the clutches of the shifts.
#[derive(Default)]
pub(crate) struct Truth {
    pub(crate) torque_n_m: [Series; 2],
    pub(crate) pressure_pa: [Series; 2],
}

impl Truth {
    fn push(&mut self, sample: &CarSample) {
        let Some(shift) = &sample.shift else { return };
        for (at, clutch) in [&shift.offgoing, &shift.oncoming].into_iter().enumerate() {
            self.torque_n_m[at].push(sample.time_s, clutch.torque_n_m.abs());
            self.pressure_pa[at].push(sample.time_s, clutch.pressure_pa);
        }
    }

    /// Gives shifts the readings of a pressure sensor at an element, by its place in the tables.
    pub(crate) fn measure(&self, shifts: &mut [ShiftLog], tables: &ShiftTables<f64>, place: usize, seed: u64) {
        let mut random = Random(seed);
        let scale = 1.0 + SENSOR_SCALE * (2.0 * random.uniform() - 1.0);
        let rows = tables.tables();
        for log in shifts {
            let row = rows.shift(log.gears[0], log.gears[1]).unwrap();
            let Some(clutch) = row.clutches.iter().position(|clutch| clutch.element.place() == Some(place)) else {
                continue;
            };
            // A sensor is read from half a second before the command on, as a recorder takes it; until then the oncoming element is empty.
            for i in (1..=50).rev().filter(|_| clutch == 1) {
                let noise_pa = SENSOR_PA * (f64::from(i % 3) - 1.0);
                log.pressure[clutch].push(log.command_s[0] - 0.01 * f64::from(i), noise_pa);
            }
            let during = log.turbine.between([log.command_s[0], log.command_s[1]]);
            for (time_s, _) in during.collect::<Vec<_>>() {
                let noise_pa = SENSOR_PA * (2.0 * random.uniform() - 1.0);
                log.pressure[clutch].push(time_s, scale * self.pressure_pa[clutch].at(time_s) + noise_pa);
            }
        }
    }

    /// Mean squared error of the torques of both clutches by the valve models of a file over shifts, N m squared.
    pub(crate) fn squared_error(&self, car: &Car, shifts: &[ShiftLog]) -> f64 {
        let tables = tables(car);
        let points = shifts.iter().flat_map(|log| fit::gearbox::open_loop(car, &tables, log));
        let errors = points.flat_map(|point| {
            [0, 1].map(|which| (point.torque_n_m[which] - self.torque_n_m[which].at(point.time_s)).powi(2))
        });
        let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), error| (sum + error, count + 1.0));
        sum / count
    }
}
