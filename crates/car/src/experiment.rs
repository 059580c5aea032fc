//! A simulated drive with one shift.

use drivetrain::Table1;

use crate::{ObserverEntry, OffNominal, Sensors, Vehicle};

/// A signal over time, linear between its points, held outside them.
pub type Profile = Table1<f64>;

/// A variation of an experiment, for the bench.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Its name in tables.
    pub name: String,
    /// The driver's throttle, in place of the profile's last position.
    pub throttle: Option<f64>,
    /// Age of the speed readings, s, in place of the sensors' own.
    pub sensor_delay_s: Option<f64>,
    /// Factor on the noise of all sensors.
    pub sensor_noise_factor: f64,
    /// Tooth periods of a reading of the wheels; replaces the value of the sensor. The observers use it too, because
    /// it is a known property of the sensor.
    pub wheel_periods: Option<f64>,
    /// The same of the output.
    pub output_periods: Option<f64>,
    /// The sensors of the file with the scenario's changes. The observers are told of none of them.
    pub sensors: Option<Sensors>,
    /// Time between two rows of the observers with real sensors, s, in place of their own sample time.
    pub row_time_s: Option<f64>,
    /// In what the car differs from the nominal one.
    pub off_nominal: OffNominal,
}

impl Scenario {
    /// Its name as part of the name of a file.
    pub fn file_name(&self) -> String {
        let in_a_name = |letter: char| if letter.is_alphanumeric() || letter == '-' { letter } else { '_' };
        self.name.to_lowercase().chars().map(in_a_name).collect()
    }
}

/// How the shift controller fills a clutch whose piston has a stroke: a pulse for most of the stroke, a ramp down to a
/// pressure just above the kiss point, and a hold for what is left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FastFill {
    /// Pressure of the pulse above the kiss point, Pa.
    pub over_kiss_pa: f64,
    /// Time added to the pulse that the model of the cylinder gives, s: what the controller has learnt.
    pub offset_s: f64,
    /// Time of the ramp, s.
    pub ramp_s: f64,
    /// Pressure of the hold above the kiss point, Pa.
    pub stroke_over_kiss_pa: f64,
    /// Time of the hold, s.
    pub hold_s: f64,
}

impl FastFill {
    /// Where a file says nothing.
    pub const STANDARD: Self =
        Self { over_kiss_pa: 0.15e6, offset_s: 0.0, ramp_s: 0.06, stroke_over_kiss_pa: 0.015e6, hold_s: 0.2 };
}

/// Calibration of the shift controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftCalibration {
    /// Time of the shift request, s.
    pub request_s: f64,
    /// Period of the controller, s.
    pub control_period_s: f64,
    /// Line pressure, to which a clutch is applied outside the shift, Pa.
    pub line_pressure_pa: f64,
    /// Turbine torque over what the converter's maps say, as the controller has learnt it.
    pub torque_factor: f64,
    /// How far ahead trajectories are read, s, for the dead time of the valves.
    pub lead_s: f64,
    /// Pressure commanded at first to fill the oncoming clutch, Pa.
    pub boost_pressure_pa: f64,
    /// How long, s.
    pub boost_s: f64,
    /// Time at the kiss point before the torque phase, s.
    pub settle_s: f64,
    /// The fill of a clutch whose piston has a stroke, in place of the three values above.
    pub fast_fill: FastFill,
    /// Offgoing pressure over what the gear needs, during the fill.
    pub fill_holding_margin: f64,
    /// Time of the load transfer, s.
    pub torque_phase_s: f64,
    /// Offgoing pressure over what the gear needs, during the load transfer.
    pub transfer_holding_margin: f64,
    /// Offgoing slip that ends the torque phase, rad/s.
    pub release_slip_rad_s: f64,
    /// Time in which the slip reference falls to zero, s.
    pub inertia_phase_s: f64,
    /// Slip controller: torque per slip error, N m s/rad.
    pub proportional_n_m_s_rad: f64,
    /// Slip controller: torque per integral of slip error, N m/rad.
    pub integral_n_m_rad: f64,
    /// Throttle during the inertia phase over the driver's.
    pub throttle_factor: f64,
    /// Time in which the throttle goes there and back, s.
    pub throttle_ramp_s: f64,
    /// Oncoming slip below which the throttle comes back, rad/s.
    pub throttle_return_slip_rad_s: f64,
    /// Oncoming slip that counts as locked, rad/s.
    pub lock_slip_rad_s: f64,
    /// Time in which the locked clutch is brought to line pressure, s.
    pub lock_ramp_s: f64,
}

/// One simulated drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Short name, used for file names.
    pub name: String,
    /// Title for people.
    pub title: String,
    /// Length of the drive, s.
    pub duration_s: f64,
    /// Sample time of the recorded signals, s.
    pub sample_time_s: f64,
    /// Engine speed at the start, rad/s.
    pub initial_engine_rad_s: f64,
    /// Vehicle speed at the start, m/s.
    pub initial_vehicle_m_s: f64,
    /// The driver's throttle over time.
    pub throttle: Profile,
    /// Differences between the simulated and the nominal car.
    pub off_nominal: OffNominal,
    /// The shift controller's calibration.
    pub shift: ShiftCalibration,
    /// The car's sensors, if the experiment describes them.
    pub sensors: Option<Sensors>,
    /// The sensors of the file without their errors, which the observers assume; scenarios and studies do not change
    /// them.
    pub sensors_given: Option<Sensors>,
    /// The observers to be run.
    pub observers: Vec<ObserverEntry>,
    /// Variations for the bench.
    pub scenarios: Vec<Scenario>,
    /// Draws of the sensors' random numbers in each scenario of the bench.
    pub draws: u64,
}

impl Experiment {
    /// The sample times of an observer: its own, and those of the scenarios' rows.
    pub fn sample_times_s<'a>(&'a self, entry: &'a ObserverEntry) -> impl Iterator<Item = (&'a ObserverEntry, f64)> {
        let rows = self.scenarios.iter().filter(|_| entry.real_sensors).filter_map(|scenario| scenario.row_time_s);
        std::iter::once(entry.sample_time_s).chain(rows).map(move |sample_time_s| (entry, sample_time_s))
    }

    /// This experiment with the variations of a scenario, and a shift controller that has adapted to them.
    #[must_use]
    pub fn with_scenario(&self, scenario: &Scenario) -> Self {
        let mut varied = self.clone();
        varied.off_nominal = scenario.off_nominal;
        varied.adapt_controller();
        if let Some(throttle) = scenario.throttle {
            let (times, mut positions) = (self.throttle.axis(), self.throttle.values().to_vec());
            if let Some(last) = positions.last_mut() {
                *last = throttle;
            }
            // The times are those of a table that was checked.
            varied.throttle = Table1::new(times, &positions).unwrap_or(self.throttle);
        }
        if let (Some(sensors), Some(changed)) = (&mut varied.sensors, scenario.sensors) {
            *sensors = Sensors { seed: sensors.seed, ..changed };
        }
        for entry in varied.observers.iter_mut().filter(|entry| entry.real_sensors) {
            entry.sample_time_s = scenario.row_time_s.unwrap_or(entry.sample_time_s);
        }
        for sensors in [&mut varied.sensors, &mut varied.sensors_given].into_iter().flatten() {
            sensors.wheel.periods = scenario.wheel_periods.unwrap_or(sensors.wheel.periods);
            sensors.output.periods = scenario.output_periods.unwrap_or(sensors.output.periods);
        }
        if let Some(sensors) = &mut varied.sensors {
            for sensor in [&mut sensors.engine, &mut sensors.turbine, &mut sensors.output, &mut sensors.wheel] {
                sensor.delay_s = scenario.sensor_delay_s.unwrap_or(sensor.delay_s);
                sensor.noise_rad_s *= scenario.sensor_noise_factor;
            }
            if let Some(current) = &mut sensors.current {
                current.noise_a *= scenario.sensor_noise_factor;
            }
            if let Some(acceleration) = &mut sensors.acceleration {
                acceleration.noise_m_s2 *= scenario.sensor_noise_factor;
            }
        }
        varied
    }

    /// Lets the shift controller know the turbine torque of the simulated car, as one that adapts would.
    pub fn adapt_controller(&mut self) {
        self.shift.torque_factor *= self.off_nominal.converter_capacity_factor;
    }

    /// The car that is simulated: the nominal one with the differences applied.
    pub fn simulated_vehicle(&self, nominal: &Vehicle) -> Vehicle {
        self.off_nominal.applied_to(nominal)
    }

    /// The driver's throttle over time, with the tip-out of the differences.
    pub fn driver_throttle(&self) -> Profile {
        self.off_nominal.throttle(&self.throttle)
    }
}
