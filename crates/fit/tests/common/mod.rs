//! Cars drawn at random, their shifts behind sensors, and what a fit is compared with.
#![allow(dead_code, clippy::unwrap_used, reason = "shared by several tests; a test may panic")]

use std::ops::ControlFlow::Continue;

use car::ShiftClutch;
use car::{Sensors, Vehicle};
use config::{ExperimentFile, Source, VehicleFile};
use drivetrain::{ClutchValve, Table1};
use fit::{Driving, Fit, FitError, Given, Map, Parameter, ReadingAges, Series, ShiftRecord};
use plant::hybrid::RELATIVE_TOLERANCE;
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_pcg::Pcg64Mcg;
use study::sampling::through_sensors;
use study::simulate_shift_within;
use trace::{Trace, Values, signal};

/// The vehicle of a file as a fit takes it.
pub(crate) fn given(file: &VehicleFile) -> Given {
    Given { vehicle: file.vehicle.clone(), shafts: file.shafts().unwrap(), text: file.source.text.clone() }
}

/// Files of a fit.
pub(crate) trait FittedFile {
    /// The file with the fitted values.
    fn vehicle_file(&self, file: &VehicleFile, logs: &str) -> Result<VehicleFile, FitError>;
}

impl FittedFile for Fit {
    fn vehicle_file(&self, file: &VehicleFile, logs: &str) -> Result<VehicleFile, FitError> {
        let text = self.vehicle_text(&given(file), logs)?;
        Ok(VehicleFile::from_source(Source { text, ..file.source.clone() }).unwrap())
    }
}

/// The fit of a car to shifts, and to driving between them.
pub(crate) fn fitted(car: &TestCar, shifts: &[ShiftRecord], driving: &[Driving]) -> Fit {
    fit::fit(&given(&car.file), shifts, driving, car.ages(), &mut |_| Continue(())).unwrap()
}

/// The numbers of a signal of a log.
pub(crate) fn column<'a>(log: &'a mut Trace, name: &str) -> &'a mut Vec<f64> {
    match &mut log.columns.iter_mut().find(|column| column.name == name).unwrap().values {
        Values::Numbers(values) => values,
        Values::Words(_) => unreachable!("a signal has numbers"),
    }
}

/// Random numbers of one car.
pub(crate) struct Draw(Pcg64Mcg);

impl Draw {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::new(0xa5a5_1234_0000_0000_1111 ^ (u128::from(seed) << 20) | 1))
    }

    /// Between two numbers.
    pub(crate) fn between(&mut self, minimum: f64, maximum: f64) -> f64 {
        let fraction: f64 = StandardUniform.sample(&mut self.0);
        minimum + fraction * (maximum - minimum)
    }

    fn factor(&mut self, fraction: f64) -> f64 {
        self.between(1.0 - fraction, 1.0 + fraction)
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// What the logs have besides speeds and commands.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Logs {
    /// Nothing.
    SpeedsAndCurrent,
    /// An engine torque signal with an error of up to 5 %, and in the first shift a pressure sensor.
    TorqueAndOnePressure,
}

/// A car that differs from its file in every parameter.
pub(crate) struct TestCar {
    pub(crate) file: VehicleFile,
    pub(crate) car: Vehicle,
    pub(crate) sensors: Sensors,
    /// The unknowns of a perfect fit.
    pub(crate) truth: Vec<(Parameter, f64)>,
    torque_signal_scale: f64,
    pressure_scale: f64,
    pressure_late_s: f64,
    /// Factor on the time of the fill.
    pub(crate) fill: f64,
    seed: u64,
    /// Relative tolerance with which its shifts are integrated.
    pub(crate) tolerance: f64,
    /// Whether the pedal is released now and then in its drives.
    pub(crate) releases: bool,
    draw: Draw,
}

/// Readings of a shift with the truth behind them.
pub(crate) struct TestShift {
    pub(crate) record: ShiftRecord,
    /// Times at which the clutch slips and carries torque, s.
    pub(crate) slipping_s: [f64; 2],
    pub(crate) torque_n_m: Series,
    pub(crate) pressure_pa: Series,
}

fn mapped(table: &Table1<f64>, value: impl Fn(f64, f64) -> f64) -> Table1<f64> {
    let values: Vec<f64> = table.axis().iter().zip(table.values()).map(|(x, y)| value(*x, *y)).collect();
    Table1::new(table.axis(), &values).unwrap()
}

/// A factor on a map and the changes of its shape, from the factors at three points.
fn around(whole: Parameter, map: Map, [low, middle, high]: [f64; 3]) -> [(Parameter, f64); 3] {
    let shape = |number: usize, end: f64| (Parameter::Shape(map, number), end / middle - 1.0);
    [(whole, middle.ln()), shape(0, low), shape(1, high)]
}

/// Gives a clutch another stroke, other passages and another preload; the factor on the time of its fill.
fn draw_fill(clutch: &mut ShiftClutch, draw: &mut Draw) -> f64 {
    /// Drop over the passages in a fast fill, Pa.
    const DROP_PA: f64 = 0.15e6;
    let cylinder = &mut clutch.cylinder;
    let flow = cylinder.flow(DROP_PA);
    let (volume, passages) = (draw.between(0.75, 1.25), draw.between(0.8, 1.25));
    let fraction = draw.between(0.9, 1.1) * cylinder.preload_pa / cylinder.kiss_pa;
    cylinder.stroke_m3 *= volume;
    cylinder.supply = cylinder.supply.with_resistance_factor(passages);
    cylinder.exhaust = cylinder.exhaust.with_resistance_factor(passages);
    cylinder.kiss_pa = clutch.clutch.kiss_pressure();
    cylinder.preload_pa = fraction * cylinder.kiss_pa;
    volume * flow / cylinder.flow(DROP_PA)
}

impl TestCar {
    pub(crate) fn drawn(seed: u64) -> Self {
        Self::of(VehicleFile::built_in().unwrap(), seed)
    }

    /// A car whose pistons have a stroke.
    pub(crate) fn with_stroke(seed: u64) -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_stroke.toml");
        Self::of(VehicleFile::read(std::path::Path::new(path)).unwrap(), seed)
    }

    /// A car that differs from this file.
    pub(crate) fn of(file: VehicleFile, seed: u64) -> Self {
        let mut draw = Draw::new(seed);
        let mut truth = Vec::new();
        let mut factor = |draw: &mut Draw, parameter: Parameter, minimum: f64, maximum: f64| {
            let factor = draw.between(minimum, maximum);
            truth.push((parameter, factor.ln()));
            factor
        };
        let mut shaft = 0;
        let mut with_inertias = String::new();
        let (_, train) = file.source.text.split_once("[gear_train]").unwrap();
        let head = &file.source.text[..file.source.text.len() - train.len()];
        for line in train.lines() {
            match line.strip_prefix("inertia_kg_m2 = ") {
                Some(value) => {
                    let nominal: f64 = value.split(' ').next().unwrap().parse().unwrap();
                    let factor = factor(&mut draw, Parameter::Inertia(shaft), 0.8, 1.2);
                    with_inertias += &format!("inertia_kg_m2 = {}\n", factor * nominal);
                    shaft += 1;
                }
                None => with_inertias += &format!("{line}\n"),
            }
        }
        let source = Source { text: head.to_owned() + &with_inertias, ..file.source.clone() };
        let mut car = VehicleFile::from_source(source).unwrap().vehicle;
        let friction = factor(&mut draw, Parameter::Friction, 0.8, 1.2);
        car.oncoming.clutch.friction = car.oncoming.clutch.friction.scaled(friction);
        car.oncoming.clutch.static_friction *= friction;
        let offgoing = factor(&mut draw, Parameter::OffgoingFriction, 0.9, 1.1);
        car.offgoing.clutch.friction = car.offgoing.clutch.friction.scaled(offgoing);
        car.offgoing.clutch.static_friction *= offgoing;
        car.oncoming.clutch.return_spring_n *= factor(&mut draw, Parameter::Spring, 0.8, 1.2);
        car.driveline.shaft_stiffness_n_m_rad *= factor(&mut draw, Parameter::Stiffness, 0.8, 1.2);
        car.driveline.shaft_damping_n_m_s_rad *= factor(&mut draw, Parameter::Damping, 0.6, 1.65);
        car.tyre.slip_scale *= factor(&mut draw, Parameter::Tyre, 0.75, 1.25);
        car.road.mass_kg *= factor(&mut draw, Parameter::Mass, 0.88, 1.12);
        car.engine.inertia_kg_m2 *= factor(&mut draw, Parameter::EngineInertia, 0.9, 1.1);
        let capacity = factor(&mut draw, Parameter::Capacity, 0.85, 1.15);
        car.converter.capacity_n_m_s2 = car.converter.capacity_n_m_s2.scaled(capacity);
        let above = factor(&mut draw, Parameter::TorqueRatio, 0.9, 1.1);
        car.converter.torque_ratio = mapped(&car.converter.torque_ratio, |_, t| 1.0 + above * (t - 1.0));
        let (gain, lag) = (factor(&mut draw, Parameter::Gain, 0.9, 1.1), factor(&mut draw, Parameter::Lag, 0.7, 1.4));
        car.oncoming.valve = car.oncoming.valve.changed(lag, gain, None);
        let slope = draw.between(-0.08, 0.08);
        let rest = draw.between(-0.06, 0.06);
        car.oncoming.clutch.friction = mapped(&car.oncoming.clutch.friction, |slip, mu| {
            let (below, above) = ((1.0 - slip / 100.0).max(0.0), ((slip - 100.0) / 200.0).clamp(0.0, 1.0));
            mu * (1.0 + rest * below) * (1.0 + slope * above)
        });
        let at_rest = car.oncoming.clutch.friction.at(0.0);
        car.oncoming.clutch.static_friction = car.oncoming.clutch.static_friction.max(1.0001 * at_rest);
        let mut sensors = ExperimentFile::bench().unwrap().sensors.unwrap();
        let valve_late_s = draw.between(0.0, 0.015);
        if let ClutchValve::Proportional(maps) = &mut car.oncoming.valve {
            maps.delay_s = mapped(&maps.delay_s, |_, delay_s| delay_s + valve_late_s);
        }
        truth.push((Parameter::CommandDelay, valve_late_s / 0.01));
        truth.push((Parameter::Hysteresis, 0.0));
        truth.extend([(Parameter::Rolling, 0.0), (Parameter::Air, 0.0)]);
        sensors.output.delay_s = draw.between(0.0, 0.01);
        sensors.engine.delay_s = draw.between(0.0, 0.01);
        sensors.wheel.delay_s = draw.between(0.0, 0.03);
        sensors.wheel.errors.scale = draw.factor(0.02);
        truth.push((Parameter::OutputDelay, sensors.output.delay_s / 0.01));
        truth.push((Parameter::EngineDelay, sensors.engine.delay_s / 0.01));
        truth.push((Parameter::WheelDelay, sensors.wheel.delay_s / 0.01));
        truth.push((Parameter::WheelScale, sensors.wheel.errors.scale.ln()));
        let (torque_signal_scale, pressure_scale) = (draw.factor(0.05), 1.0 + 0.005 * draw.normal());
        truth.push((Parameter::EngineTorqueScale, torque_signal_scale.ln()));
        // The plant holds the throttle for 10 ms: a line between the readings is late by half of it.
        truth.push((Parameter::EngineTorqueDelay, -0.5));
        truth.push((Parameter::PressureScale, pressure_scale.ln()));
        // Random numbers of their own: the other draws do not depend on them.
        let mut more = Draw::new(!seed);
        let pressure_late_s = more.between(0.0, 0.01);
        truth.push((Parameter::PressureDelay, pressure_late_s / 0.01));
        truth.push((Parameter::PressureOffset, 0.0));
        let mut fill = 1.0;
        if file.oncoming.has_stroke {
            fill = draw_fill(&mut car.oncoming, &mut more);
        }
        let mut drawn = Self {
            file,
            car,
            sensors,
            truth,
            torque_signal_scale,
            pressure_scale,
            pressure_late_s,
            fill,
            seed,
            tolerance: RELATIVE_TOLERANCE,
            releases: false,
            draw,
        };
        drawn.tell_maps();
        drawn
    }

    /// Gives the maps of the oncoming clutch courses that no factor on those of the file has: friction that changes with the root of the
    /// slip by up to a quarter, lag with up to the power 0.3 of the pressure, gain by up to 10 % for twice the current.
    pub(crate) fn with_other_maps(mut self) -> Self {
        let [friction, lag, gain] = [0.25, 0.3, 0.1].map(|maximum| self.draw.between(-maximum, maximum));
        let (_, [_, pressure_pa, _], [_, current_a, _]) = self.points();
        let clutch = &mut self.car.oncoming.clutch;
        let fine = |table: &Table1<f64>, more: &[f64]| {
            let mut axis = [table.axis(), more].concat();
            axis.sort_by(f64::total_cmp);
            axis.dedup();
            let values: Vec<f64> = axis.iter().map(|x| table.at(*x)).collect();
            Table1::new(&axis, &values).unwrap()
        };
        let slips = [3.0, 20.0, 30.0, 75.0, 100.0, 125.0, 175.0, 200.0, 250.0, 300.0, 350.0];
        clutch.friction = mapped(&fine(&clutch.friction, &slips), |slip, mu| {
            mu * (1.0 + friction * (1.0 - (slip / 100.0).min(4.0).sqrt()))
        });
        clutch.static_friction = clutch.static_friction.max(1.0001 * clutch.friction.at(0.0));
        if let ClutchValve::Proportional(maps) = &mut self.car.oncoming.valve {
            let pressures = [0.06e6, 0.08e6, 0.13e6, 0.16e6, 0.26e6, 0.32e6, 0.36e6, 0.5e6];
            maps.time_constant_s = mapped(&fine(&maps.time_constant_s, &pressures), |p, lag_s| {
                lag_s * (p.max(2e4) / pressure_pa).powf(lag)
            });
            maps.gain_pa_a = mapped(&fine(&maps.gain_pa_a, &[0.08, 0.15, 0.25, 0.35, 0.4]), |a, k| {
                k * (1.0 + gain * (a / current_a - 1.0).clamp(-1.0, 1.5))
            });
        }
        self.tell_maps();
        self
    }

    /// A converter with a capacity that is 15 % less around a speed ratio of 0.8.
    pub(crate) fn with_other_converter(mut self) -> Self {
        let capacity = &mut self.car.converter.capacity_n_m_s2;
        *capacity = mapped(capacity, |v, c| c * (1.0 - 0.15 * (1.0 - (v - 0.8).abs() / 0.15).max(0.0)));
        self.tell_maps();
        self
    }

    /// The file takes the place of the car: nothing is off but the signals.
    pub(crate) fn with_the_right_file(mut self) -> Self {
        self.car = self.file.vehicle.clone();
        for (parameter, value) in &mut self.truth {
            let is_of_car = !parameter.is_of_signals();
            *value = if is_of_car { 0.0 } else { *value };
        }
        self
    }

    /// Gives the valve of the oncoming clutch a hysteresis that the file does not have, of up to 10 kPa to each side.
    pub(crate) fn with_hysteresis(mut self) -> Self {
        self.car.oncoming.hysteresis_pa = self.draw.between(0.0, 10e3);
        self.truth.retain(|(parameter, _)| *parameter != Parameter::Hysteresis);
        self.truth.push((Parameter::Hysteresis, self.car.oncoming.hysteresis_pa / 1e4));
        self
    }

    /// Slips, pressures and commands at which the shapes of the maps count.
    fn points(&self) -> ([f64; 5], [f64; 3], [f64; 3]) {
        let kiss_pa = self.file.oncoming.clutch.kiss_pressure();
        let pressures = [0.0, 0.5, 1.5].map(|fraction| kiss_pa + fraction * self.file.error_bounds.shift_pressure_pa);
        let commands = pressures.map(|p| self.file.oncoming.valve.command_for(p));
        ([0.0, 30.0, 100.0, 200.0, 300.0], pressures, commands)
    }

    /// The true values of what a fit finds of the maps: at their points.
    pub(crate) fn tell_maps(&mut self) {
        use Parameter as P;
        let (slips, pressures, commands) = self.points();
        let (car, file) = (&self.car.oncoming, &self.file.oncoming);
        let friction = slips.map(|slip| car.clutch.friction.at(slip) / file.clutch.friction.at(slip));
        let mut identifiable = vec![
            (P::Friction, friction[2].ln()),
            (P::FrictionAtRest, friction[0] / friction[2] - 1.0),
            (P::FrictionSlope, friction[4] / friction[2] - 1.0),
            (P::Shape(Map::Friction, 0), friction[1] / (0.3 * friction[2] + 0.7 * friction[0]) - 1.0),
            (P::Shape(Map::Friction, 1), friction[3] / (0.5 * friction[2] + 0.5 * friction[4]) - 1.0),
        ];
        let capacity = [0.5, 0.75, 0.95]
            .map(|ratio| self.car.converter.capacity_n_m_s2.at(ratio) / self.file.converter.capacity_n_m_s2.at(ratio));
        identifiable.extend(around(P::Capacity, Map::Capacity, capacity));
        if let (Some(car), Some(file)) = (car.valve.maps(), file.valve.maps()) {
            let lag = pressures.map(|p| car.time_constant_s.at(p) / file.time_constant_s.at(p));
            let gain = commands.map(|a| car.gain_pa_a.at(a) / file.gain_pa_a.at(a));
            identifiable.extend(around(P::Lag, Map::Lag, lag));
            identifiable.extend(around(P::Gain, Map::Gain, gain));
        }
        self.truth.retain(|(parameter, _)| identifiable.iter().all(|(other, _)| other != parameter));
        self.truth.extend(identifiable);
    }

    /// The unknown of a perfect fit.
    pub(crate) fn true_value(&self, parameter: Parameter) -> f64 {
        self.truth.iter().find(|(other, _)| *other == parameter).unwrap().1
    }

    /// What the log says of the sensors.
    pub(crate) fn ages(&self) -> ReadingAges {
        ReadingAges::of(&self.sensors)
    }

    /// One drive, whose shift is recorded at full rate: throttle, mass, grade and speed are drawn.
    pub(crate) fn drive(&mut self) -> Trace {
        let mut experiment = ExperimentFile::e1().unwrap();
        let throttle = self.draw.between(0.15, 0.6);
        let speed_m_s = self.draw.between(4.0, 7.0);
        experiment.throttle = Table1::new(&[0.0, 0.2, 0.6], &[0.1, 0.1, throttle]).unwrap();
        experiment.initial_vehicle_m_s = speed_m_s;
        experiment.initial_engine_rad_s = 30.0 * speed_m_s;
        experiment.shift.request_s = 2.5;
        experiment.duration_s = 6.0;
        let mut car = self.car.clone();
        car.road.mass_kg *= self.draw.factor(0.06);
        car.road.grade_rad = self.draw.between(-0.05, 0.05);
        simulate_shift_within(&car, &self.file, &experiment, 1.2, self.tolerance).unwrap()
    }

    /// The readings of a drive at 100 Hz.
    pub(crate) fn readings(&mut self, whole: &Trace, number: u64) -> Trace {
        let sensors = Sensors { seed: self.sensors.seed + number, ..self.sensors };
        let mut read = through_sensors(whole, 0.01, &sensors, &self.file);
        let mut noisy = |name: &str, scale: f64, noise: f64| {
            let values: Vec<f64> =
                read.get(name).unwrap().iter().map(|value| scale * value + noise * self.draw.normal()).collect();
            let column = read.columns.iter_mut().find(|column| column.name == name).unwrap();
            column.values = trace::Values::Numbers(values);
        };
        noisy(signal::ENGINE_TORQUE, self.torque_signal_scale, 1.0);
        noisy(signal::ONCOMING_PRESSURE, self.pressure_scale, 1e3);
        read
    }

    /// A shift that can be fitted. Drives whose shift is not like a power-on upshift are drawn again.
    pub(crate) fn shift(&mut self, number: u64, logs: Logs) -> TestShift {
        for _ in 0..20 {
            let whole = self.drive();
            let read = self.readings(&whole, number);
            if let Some(shift) = self.record(&whole, &read, number, logs) {
                return shift;
            }
        }
        panic!("no drive of this car has a shift");
    }

    /// A log of a shift as a table with the names of the program, and the same with the truth behind it.
    pub(crate) fn logs(&mut self, number: u64, logs: Logs) -> [Trace; 2] {
        let mut names = vec![
            signal::ENGINE_SPEED,
            signal::TURBINE_SPEED,
            signal::OUTPUT_SPEED,
            signal::WHEEL_SPEED,
            signal::ONCOMING_CURRENT,
            signal::OFFGOING_CURRENT,
        ];
        if logs == Logs::TorqueAndOnePressure {
            names.push(signal::ENGINE_TORQUE);
        }
        loop {
            let whole = self.drive();
            let read = self.readings(&whole, number);
            if self.record(&whole, &read, number, logs).is_some() {
                let mut measured = read.clone();
                measured.columns.retain(|column| names.contains(&column.name.as_str()));
                let mut truth = study::sampling::sampled(&whole, 0.01);
                truth.columns.retain(|column| {
                    [signal::ONCOMING_TORQUE, signal::ONCOMING_PRESSURE, signal::TRUE_PHASE]
                        .contains(&column.name.as_str())
                });
                return [measured, truth];
            }
        }
    }

    fn record(&self, whole: &Trace, read: &Trace, number: u64, logs: Logs) -> Option<TestShift> {
        let phases = study::true_phases(whole)?;
        let inertia = phases.iter().position(|phase| *phase == observer::Phase::InertiaPhase)?;
        let lock = phases.iter().position(|phase| *phase == observer::Phase::AfterShift)?;
        let torque = phases.iter().position(|phase| *phase == observer::Phase::TorquePhase)?;
        let zero_s = whole.time_s[inertia];
        let series = |name: &str, from: &Trace| {
            let mut series = Series::default();
            for (time_s, value) in from.time_s.iter().zip(from.get(name).unwrap()) {
                if value.is_finite() {
                    series.push(time_s - zero_s, *value);
                }
            }
            series
        };
        let more = logs == Logs::TorqueAndOnePressure;
        let some = |has: bool, name: &str| if has { series(name, read) } else { Series::default() };
        let mut record = ShiftRecord {
            name: format!("shift {number}"),
            engine: series(signal::ENGINE_SPEED, read),
            turbine: series(signal::TURBINE_SPEED, read),
            output: series(signal::OUTPUT_SPEED, read),
            wheel: series(signal::WHEEL_SPEED, read),
            oncoming: series(signal::ONCOMING_CURRENT, read),
            offgoing: series(signal::OFFGOING_CURRENT, read),
            pressure: later(some(more && number == 0, signal::ONCOMING_PRESSURE), self.pressure_late_s),
            engine_torque: some(more, signal::ENGINE_TORQUE),
            lock_s: whole.time_s[lock] - zero_s,
            segments: Vec::new(),
        };
        record.find_segments(&self.file.shift).ok()?;
        Some(TestShift {
            record,
            slipping_s: [whole.time_s[torque] - zero_s, whole.time_s[lock] - zero_s],
            torque_n_m: series(signal::ONCOMING_TORQUE, whole),
            pressure_pa: series(signal::ONCOMING_PRESSURE, whole),
        })
    }
}

/// A part of a drive: the throttle goes to and fro.
const PART_S: f64 = 60.0;

impl TestCar {
    /// Gives the car another rolling resistance and air drag than the file has.
    pub(crate) fn on_another_road(mut self) -> Self {
        let mut draw = Draw::new(!self.sensors.seed ^ self.seed << 32);
        let [rolling, air] = [0.3, 0.2].map(|fraction| draw.factor(fraction));
        self.car.road.rolling_moment_n_m *= rolling;
        self.car.road.drag_coefficient *= air;
        self.truth.retain(|(parameter, _)| !matches!(parameter, Parameter::Rolling | Parameter::Air));
        self.truth.extend([(Parameter::Rolling, rolling.ln()), (Parameter::Air, air.ln())]);
        self
    }

    /// Gives the car a backlash of its own, of up to 0.08 rad, and releases the pedal now and then in its drives.
    pub(crate) fn with_reversals(mut self) -> Self {
        let mut draw = Draw::new(self.seed ^ 0xbac_0000);
        self.car.backlash_rad = draw.between(0.0, 0.08);
        self.releases = true;
        self
    }

    /// A log of so many parts of a minute each, on roads of other grades, with a shift in each; all with one mass of the car.
    pub(crate) fn driven(&self, parts: u32) -> Trace {
        self.driven_with(parts, |_, _| ())
    }

    /// The same, where the car is changed in each part.
    pub(crate) fn driven_with(&self, parts: u32, change: impl Fn(u32, &mut Vehicle)) -> Trace {
        let mut draw = Draw::new(self.seed ^ 0xd0d0);
        let mass = draw.factor(0.06);
        let mut log: Option<Trace> = None;
        for part in 0..parts {
            let mut experiment = ExperimentFile::e1().unwrap();
            let times: Vec<f64> = (0..20).map(|at| PART_S / 20.0 * (f64::from(at) + draw.between(0.0, 0.5))).collect();
            let releases = |at: usize| self.releases && at >= 10 && at % 4 < 2;
            let position = |at: usize| if releases(at) { 0.0 } else { draw.between(0.08, 0.5) };
            let positions: Vec<f64> = (0..times.len()).map(position).collect();
            experiment.throttle = Table1::new(&times, &positions).unwrap();
            experiment.initial_vehicle_m_s = draw.between(4.0, 8.0);
            experiment.initial_engine_rad_s = 30.0 * experiment.initial_vehicle_m_s;
            experiment.shift.request_s = draw.between(2.0, 12.0);
            experiment.duration_s = PART_S;
            let mut car = self.car.clone();
            car.road.mass_kg *= mass;
            car.road.grade_rad = draw.between(-0.03, 0.03);
            change(part, &mut car);
            let whole = study::simulate_drive(&car, &experiment).unwrap();
            let sensors = Sensors { seed: self.sensors.seed + 1000 + u64::from(part), ..self.sensors };
            let read = through_sensors(&whole, 0.01, &sensors, &self.file);
            append(&mut log, read, (PART_S + 10.0) * f64::from(part));
        }
        let mut log = log.unwrap();
        log.columns.retain(|column| LOGGED.contains(&column.name.as_str()));
        log
    }

    /// What a fit collects of a log.
    pub(crate) fn collected(&self, log: &Trace, name: &str) -> fit::Collected {
        let path = std::env::temp_dir().join(format!("fit_{name}_{}_{}.csv", self.seed, std::process::id()));
        trace::write_csv(&path, log).unwrap();
        let map = logs::ChannelMap::default();
        let open = || logs::Log::open(&path, &map.open);
        let source = fit::LogSource { path: &path, map: &map, open: &open, is_stopped: &|| false };
        let collected = fit::collect(source, &given(&self.file));
        std::fs::remove_file(&path).unwrap();
        collected.unwrap()
    }
}

/// Channels of a log.
const LOGGED: [&str; 7] = [
    signal::VEHICLE_SPEED,
    signal::ENGINE_SPEED,
    signal::TURBINE_SPEED,
    signal::OUTPUT_SPEED,
    signal::WHEEL_SPEED,
    signal::ONCOMING_CURRENT,
    signal::OFFGOING_CURRENT,
];

/// Appends a trace that begins at a time.
fn append(log: &mut Option<Trace>, mut more: Trace, begin_s: f64) {
    more.time_s.iter_mut().for_each(|time_s| *time_s += begin_s);
    let Some(log) = log else { return *log = Some(more) };
    log.time_s.extend(&more.time_s);
    for (column, more) in log.columns.iter_mut().zip(more.columns) {
        if let (trace::Values::Numbers(values), trace::Values::Numbers(more)) = (&mut column.values, more.values) {
            values.extend(more);
        }
    }
}

/// Readings that come later.
fn later(mut series: Series, late_s: f64) -> Series {
    series.time_s.iter_mut().for_each(|time_s| *time_s += late_s);
    series
}

impl TestShift {
    /// Mean squares of the errors of the open loop of a vehicle file: torque and pressure.
    pub(crate) fn errors(&self, vehicle: &Vehicle) -> [f64; 2] {
        let points: Vec<_> = (fit::open_loop(vehicle, &self.record).into_iter())
            .filter(|point| (self.slipping_s[0]..self.slipping_s[1]).contains(&point.time_s))
            .collect();
        let mean = |error: &dyn Fn(&fit::OpenLoop) -> f64| {
            points.iter().map(|point| error(point).powi(2)).sum::<f64>() / points.len() as f64
        };
        [
            mean(&|point| point.torque_n_m - self.torque_n_m.at(point.time_s)),
            mean(&|point| point.pressure_pa - self.pressure_pa.at(point.time_s)),
        ]
    }
}
