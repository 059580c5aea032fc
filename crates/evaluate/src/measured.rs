//! A simulated drive as its car measures it: speeds through toothed wheels, currents through their sensor.
//!
//! Readings are made in blocks of 60 s, so that the memory does not grow with the drive. What the sensors count by the shift
//! (`burst_s`, `frozen_s`, `outliers`) is counted by the block here: a drive has many shifts.

use std::collections::VecDeque;
use std::convert::Infallible;

use car::columns::element_commands;
use car::{Car, FailedReading, FailedSensor, Fault, FaultKind, Sensors};
use drivetrain::road::GRAVITY_M_S2;
use drivetrain::{CommandKind, Real};
use observer::Reading;
use observer::ShiftTables;
use observer::gearbox::ShiftInput;
use plant::car::CarSample;
use plant::sensors::{Channel, Readings, Rows, dealt, read_acceleration, read_current, read_speed};

use crate::mixed;
use crate::recording::input;

/// Length of a block, s.
const BLOCK_S: f64 = 60.0;
/// Records before a block that its first readings need, s: sample time, delay, offset and the time of a standstill, 0.2 s each at most.
const BEFORE_S: f64 = 1.0;
/// Elements of a gearbox, with room for more.
const ELEMENTS: usize = 16;
/// Names of the speeds and of the acceleration, which keep their random numbers apart.
const SPEEDS: [&str; 4] = ["engine", "turbine", "output", "wheel"];
pub(crate) const ACCELERATION: &str = "acceleration";

/// A row of a drive: the truth, and what is read of it. Without a reading a value is not a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredRow {
    /// The truth.
    pub sample: CarSample,
    /// Engine, turbine, output and wheel speed, rad/s, each with its age, s.
    pub speeds: [[f64; 2]; 4],
    /// Command of the valve of each element, A or %, with its age, s.
    pub commands: [[f64; 2]; ELEMENTS],
    /// Longitudinal acceleration, m/s^2, with its age, s; none of a car that does not measure it.
    pub acceleration: [f64; 2],
}

impl MeasuredRow {
    /// Of a car that measures exactly.
    pub fn exact(sample: &CarSample) -> Self {
        let commands = sample.commands.map(|command| [command, 0.0]);
        let speeds = speeds_of(sample).map(|speed| [speed, 0.0]);
        Self { sample: *sample, speeds, commands, acceleration: [f64::NAN; 2] }
    }
}

impl MeasuredRow {
    /// What the filter is shown of the row.
    pub fn input(&self, car: &Car, tables: &ShiftTables<f64>) -> ShiftInput<f64> {
        let reading = |[value, age_s]: [f64; 2]| (!value.is_nan()).then_some(Reading { value, age_s });
        let command = |element: usize| reading(self.commands[element]);
        let of_commands = input(car, tables, &self.sample, self.speeds.map(reading), command);
        ShiftInput { acceleration_m_s2: reading(self.acceleration), ..of_commands }
    }
}

/// Speed sensors that fail on a drive, in the order of the times, s, from which on they do.
#[derive(Debug, Clone, PartialEq)]
pub struct FailedSensors {
    /// Place of the speed in a row, what it reads, and since when.
    failed: Vec<(usize, FailedReading, f64)>,
    /// The last readings before a sensor has failed, or the first ones.
    frozen: [f64; 4],
}

impl FailedSensors {
    /// Those among the faults of a drive.
    pub fn of(faults: &[Fault]) -> Self {
        let failed = faults.iter().filter_map(|fault| match fault.kind {
            FaultKind::SpeedSensor { sensor, reading } => {
                let place = FailedSensor::ALL.iter().position(|other| *other == sensor)?;
                Some((place, reading, fault.from_s))
            }
            _ => None,
        });
        let mut failed: Vec<_> = failed.collect();
        failed.sort_by(|one, other| one.2.total_cmp(&other.2));
        Self { failed, frozen: [f64::NAN; 4] }
    }

    /// What is read of a row; the last fault of a sensor holds.
    pub fn read(&mut self, row: &MeasuredRow) -> MeasuredRow {
        let mut read = *row;
        for (place, [sound, _]) in row.speeds.iter().enumerate() {
            let of_sensor = self.failed.iter().rfind(|(of, _, from_s)| *of == place && row.sample.time_s >= *from_s);
            let frozen = &mut self.frozen[place];
            if !sound.is_nan() && (of_sensor.is_none() || frozen.is_nan()) {
                *frozen = *sound;
            }
            // A sensor that reads nothing at a time reads nothing.
            if let Some((_, reading, _)) = of_sensor.filter(|_| !sound.is_nan()) {
                read.speeds[place][0] = match reading {
                    FailedReading::Zero => 0.0,
                    FailedReading::Frozen => *frozen,
                    FailedReading::None => f64::NAN,
                };
            }
        }
        read
    }
}

fn speeds_of(sample: &CarSample) -> [f64; 4] {
    let torques = &sample.torques;
    [torques.engine_rad_s, torques.turbine_rad_s, torques.output_rad_s, sample.wheel_rad_s]
}

/// What an accelerometer along the car reads: the acceleration with the part of gravity along the road, m/s^2.
pub(crate) fn specific_force(sample: &CarSample) -> f64 {
    sample.vehicle_m_s2 + GRAVITY_M_S2 * Real::sin(sample.driver.grade_rad)
}

/// A channel with the values of its records.
struct Recorded {
    name: String,
    values: Vec<f64>,
}

/// The sensors of a car on its way through a drive.
pub struct SensedDrive<'s> {
    sensors: &'s Sensors,
    /// Records in a row, and place of the first row among the records.
    every: usize,
    first: usize,
    row_s: f64,
    /// Records since the start of the drive.
    records: usize,
    block: u64,
    time_s: Vec<f64>,
    speeds: [Recorded; 4],
    /// Elements whose valve has a current that is read.
    currents: Vec<(usize, Recorded)>,
    acceleration: Recorded,
    /// Rows whose readings are not yet made.
    waiting: VecDeque<CarSample>,
    /// Times of the rows in the records, those of earlier blocks too.
    rows_s: Vec<f64>,
}

impl<'s> SensedDrive<'s> {
    /// For a row every `row_s` seconds.
    pub fn new(car: &Car, sensors: &'s Sensors, row_s: f64) -> Self {
        let every = (row_s / crate::RECORD_S - 1e-9).ceil().max(1.0);
        let record_s = row_s / every;
        let recorded = |name: &str| Recorded { name: name.to_owned(), values: Vec::new() };
        let is_current = |element: usize| {
            let clutch = car.clutches.get(element).and_then(Option::as_ref);
            clutch.is_some_and(|clutch| clutch.valve.command_kind() == CommandKind::Current)
        };
        let commands = element_commands(car).into_iter().filter(|_| sensors.current.is_some());
        let currents = commands.filter(|(at, _)| is_current(*at)).map(|(at, name)| (at, recorded(&name)));
        let (every, first) = (every as usize, (sensors.row_offset_s / record_s).round() as usize);
        Self {
            sensors,
            every,
            first,
            row_s,
            records: 0,
            block: 0,
            time_s: Vec::new(),
            speeds: SPEEDS.map(recorded),
            currents: currents.collect(),
            acceleration: recorded(ACCELERATION),
            waiting: VecDeque::new(),
            rows_s: Vec::new(),
        }
    }

    /// Time between two samples that [`Self::push`] takes, s.
    pub fn record_s(&self) -> f64 {
        let every = self.every as f64;
        self.row_s / every
    }

    /// Takes the next sample; `take` gets the rows that are ready.
    ///
    /// # Errors
    /// Those of `take`.
    pub fn push<E>(&mut self, sample: &CarSample, take: impl FnMut(&MeasuredRow) -> Result<(), E>) -> Result<(), E> {
        self.time_s.push(sample.time_s);
        for (channel, speed) in self.speeds.iter_mut().zip(speeds_of(sample)) {
            channel.values.push(speed);
        }
        for (element, channel) in &mut self.currents {
            channel.values.push(sample.commands[*element]);
        }
        self.acceleration.values.push(specific_force(sample));
        let at = self.records;
        self.records += 1;
        if at >= self.first && (at - self.first).is_multiple_of(self.every) {
            self.waiting.push_back(*sample);
            self.rows_s.push(sample.time_s);
        }
        let begun_s = self.waiting.front().map_or(f64::INFINITY, |row| row.time_s);
        if sample.time_s - begun_s < BLOCK_S { Ok(()) } else { self.finish(take) }
    }

    /// Gives the rows that wait, those of the last block of a drive.
    ///
    /// # Errors
    /// Those of `take`.
    pub fn finish<E>(&mut self, mut take: impl FnMut(&MeasuredRow) -> Result<(), E>) -> Result<(), E> {
        let (Some(begin), Some(end)) = (self.waiting.front(), self.waiting.back()) else { return Ok(()) };
        let shift_s = [begin.time_s, end.time_s];
        let seed = mixed(self.sensors.seed, self.block);
        let offset_s = self.sensors.row_offset_s;
        let rows = Rows { at_s: &self.rows_s, offset_s, shift_s, seed };
        let sensors = [&self.sensors.engine, &self.sensors.turbine, &self.sensors.output, &self.sensors.wheel];
        let outliers = dealt(self.sensors.outliers, sensors.len(), seed);
        let speeds: [Readings; 4] = std::array::from_fn(|at| {
            let mut sensor = *sensors[at];
            sensor.errors.outliers += outliers[at];
            let Recorded { name, values } = &self.speeds[at];
            read_speed(&sensor, Channel { name, time_s: &self.time_s, values }, rows)
        });
        let currents: Vec<(usize, Readings)> = (self.currents.iter())
            .filter_map(|(element, of)| {
                let Recorded { name, values } = of;
                let truth = Channel { name, time_s: &self.time_s, values };
                Some((*element, read_current(self.sensors.current.as_ref()?, truth, rows)))
            })
            .collect();
        let Recorded { name, values } = &self.acceleration;
        let truth = Channel { name, time_s: &self.time_s, values };
        let acceleration = self.sensors.acceleration.as_ref().map(|sensor| read_acceleration(sensor, truth, rows));
        let before = self.rows_s.len() - self.waiting.len();
        for (at, sample) in self.waiting.iter().enumerate() {
            let of = |readings: &Readings| [readings.values[before + at], readings.age_s[before + at]];
            let mut row = MeasuredRow { speeds: speeds.each_ref().map(of), ..MeasuredRow::exact(sample) };
            for (element, readings) in &currents {
                row.commands[*element] = of(readings);
            }
            row.acceleration = acceleration.as_ref().map_or(row.acceleration, of);
            take(&row)?;
        }
        self.begin_block(shift_s[1]);
        Ok(())
    }

    /// As [`Self::push`], where nothing can go wrong.
    pub fn each(&mut self, sample: &CarSample, mut take: impl FnMut(&MeasuredRow)) {
        let Ok(()) = self.push::<Infallible>(sample, |row| {
            take(row);
            Ok(())
        });
    }

    /// As [`Self::finish`], where nothing can go wrong.
    pub fn last(&mut self, mut take: impl FnMut(&MeasuredRow)) {
        let Ok(()) = self.finish::<Infallible>(|row| {
            take(row);
            Ok(())
        });
    }

    /// Keeps the records that the next block needs.
    fn begin_block(&mut self, end_s: f64) {
        self.block += 1;
        self.waiting.clear();
        let records = self.time_s.partition_point(|&time_s| time_s < end_s - BEFORE_S);
        self.time_s.drain(..records);
        let currents = self.currents.iter_mut().map(|(_, channel)| channel);
        let channels = self.speeds.iter_mut().chain(currents).chain([&mut self.acceleration]);
        channels.for_each(|channel| drop(channel.values.drain(..records)));
        // Readings need all times of the rows from here on.
        let rows = self.rows_s.partition_point(|&time_s| time_s < end_s - BEFORE_S);
        self.rows_s.drain(..rows);
    }
}

/// Whether the readings of a channel may be older than their rows.
pub fn has_ages(sample_time_s: f64, offset_s: f64, row_s: f64) -> bool {
    let is_multiple = |a: f64, b: f64| ((a / b).round() - a / b).abs() < 1e-6;
    offset_s != 0.0 || !(is_multiple(sample_time_s, row_s) || is_multiple(row_s, sample_time_s))
}

#[cfg(test)]
mod tests {
    use config::CarFile;
    use config::Source;
    use plant::car::{CarCalibration, CarModel, simulate_car_drive};

    use super::*;

    fn car() -> Car {
        let gearbox = include_str!("../../../gearboxes/ravigneaux_4.toml");
        let source = Source::built_in("car.toml", "name = \"car\"\ngearbox = \"g.toml\"\n");
        CarFile::from_sources(source, Source::built_in("g.toml", gearbox)).unwrap().car
    }

    /// Rows of a drive of 150 s, two and a half blocks.
    fn rows(sensors: &Sensors, row_s: f64) -> Vec<MeasuredRow> {
        let text = "name = \"d\"\n[[segment]]\nduration_s = 150\nthrottle = [0.05, 0.15]\n";
        let drive = config::DriveFile::from_source(Source::built_in("d.toml", text)).unwrap();
        let (car, mut rows) = (car(), Vec::new());
        let mut sensed = SensedDrive::new(&car, sensors, row_s);
        let drive = car::Drive { sample_time_s: sensed.record_s(), ..drive.drive };
        let model = CarModel::new(car.clone()).unwrap();
        simulate_car_drive(&model, &car, CarCalibration::STANDARD, &drive, |sample| {
            sensed.each(sample, |row| rows.push(*row));
        })
        .unwrap();
        sensed.last(|row| rows.push(*row));
        rows
    }

    #[test]
    fn every_row_of_a_drive_is_read_once_and_blocks_leave_no_seam() {
        let sensors = config::ExperimentFile::bench().unwrap().sensors.unwrap();
        let rows = rows(&sensors, 0.01);
        assert!(rows.len() == 15_001 || rows.len() == 15_000, "{}", rows.len());
        assert!(rows.windows(2).all(|pair| (pair[1].sample.time_s - pair[0].sample.time_s - 0.01).abs() < 1e-6));
        let fast = rows.iter().filter(|row| row.sample.torques.output_rad_s > 50.0);
        for row in fast.clone() {
            let truth = speeds_of(&row.sample);
            for (at, ([read, age_s], truth)) in row.speeds.iter().zip(truth).enumerate() {
                // Five standard deviations of noise, and some 15 ms of delay at 500 rad/s^2.
                assert!(*age_s == 0.0 && (read - truth).abs() < 8.0, "{at} {}: {read} {truth}", row.sample.time_s);
            }
        }
        assert!(fast.count() > 10_000);
        // Noise of one block is not that of another.
        let noise = |row: &MeasuredRow| row.commands[0][0] - row.sample.commands[0];
        let same = (0..5000).filter(|&at| noise(&rows[at]) == noise(&rows[at + 6001]) && noise(&rows[at]) != 0.0);
        assert!(same.count() < 1500);
    }

    #[test]
    fn a_slow_channel_has_a_reading_in_every_second_row_in_every_block() {
        let mut sensors = config::ExperimentFile::bench().unwrap().sensors.unwrap();
        sensors.turbine.sample_time_s = 0.02;
        sensors.row_offset_s = 0.004;
        let rows = rows(&sensors, 0.01);
        assert!((rows[0].sample.time_s - 0.004).abs() < 1e-9);
        let came: Vec<bool> = rows.iter().map(|row| !row.speeds[1][0].is_nan()).collect();
        assert!(came.windows(2).all(|pair| pair[0] != pair[1]));
    }
}
