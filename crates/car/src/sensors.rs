//! Sensors of a car, and what goes wrong with their readings.

/// What goes wrong with the readings of a channel. Observers are not told of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadingErrors {
    /// Factor on the reading, such as the wheel speed of a worn tyre.
    pub scale: f64,
    /// Fraction of the readings that are lost, each by chance.
    pub missing_share: f64,
    /// Length of one dropout at a random time in the shift, s: every reading in it is lost.
    pub burst_s: f64,
    /// Length of one time in the shift in which the channel repeats its last reading, s.
    pub frozen_s: f64,
    /// Number of single readings in the shift that are wrong.
    pub outliers: f64,
}

impl ReadingErrors {
    /// No error.
    pub const NONE: Self = Self { scale: 1.0, missing_share: 0.0, burst_s: 0.0, frozen_s: 0.0, outliers: 0.0 };
}

/// A toothed wheel read by a timer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedSensor {
    /// Teeth of the wheel.
    pub teeth: f64,
    /// Resolution of the timer, s.
    pub timer_s: f64,
    /// Tooth periods that one reading spans at least.
    pub periods: f64,
    /// Time between two readings on the bus, s.
    pub sample_time_s: f64,
    /// Time of the first reading after that of the first row, s: channels with different offsets are asynchronous.
    pub offset_s: f64,
    /// Age of a reading when it arrives, s.
    pub delay_s: f64,
    /// Standard deviation of a reading, rad/s.
    pub noise_rad_s: f64,
    /// What goes wrong with its readings.
    pub errors: ReadingErrors,
    /// Size of the error of an outlier, rad/s; its sign is random.
    pub outlier_rad_s: f64,
}

/// A current sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurrentSensor {
    /// Standard deviation of a reading, A.
    pub noise_a: f64,
    /// Constant error, A.
    pub offset_a: f64,
    /// Step of the converter, A.
    pub resolution_a: f64,
    /// Time between two readings, s; without one there is a reading in every row.
    pub sample_time_s: Option<f64>,
    /// Time of the first reading after that of the first row, s.
    pub offset_s: f64,
    /// Age of a reading when it arrives, s.
    pub delay_s: f64,
    /// What goes wrong with its readings.
    pub errors: ReadingErrors,
    /// Size of the error of an outlier, A; its sign is random.
    pub outlier_a: f64,
}

impl CurrentSensor {
    /// Maximum error of a reading, A: offset, half of the resolution, and five standard deviations of the noise.
    pub fn error_max_a(&self) -> f64 {
        const SIGMAS: f64 = 5.0;
        self.offset_a.abs() + 0.5 * self.resolution_a + SIGMAS * self.noise_a
    }

    /// A sensor without any error: the command is known exactly, as a duty cycle is.
    pub const EXACT: Self = Self {
        noise_a: 0.0,
        offset_a: 0.0,
        resolution_a: 0.0,
        sample_time_s: None,
        offset_s: 0.0,
        delay_s: 0.0,
        errors: ReadingErrors::NONE,
        outlier_a: OUTLIER_A,
    };
}

/// An accelerometer along the car, as of a stability control: it reads the acceleration with the part of gravity along the road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccelerationSensor {
    /// Standard deviation of a reading, m/s^2.
    pub noise_m_s2: f64,
    /// Constant error, m/s^2.
    pub bias_m_s2: f64,
    /// Step of the readings, m/s^2.
    pub resolution_m_s2: f64,
    /// Time between two readings on the bus, s.
    pub sample_time_s: f64,
    /// Time of the first reading after that of the first row, s.
    pub offset_s: f64,
    /// Age of a reading when it arrives, s.
    pub delay_s: f64,
    /// What goes wrong with its readings.
    pub errors: ReadingErrors,
    /// Size of the error of an outlier, m/s^2; its sign is random.
    pub outlier_m_s2: f64,
}

impl AccelerationSensor {
    /// A usual one \[chosen\].
    pub const USUAL: Self = Self {
        noise_m_s2: 0.05,
        bias_m_s2: 0.0,
        resolution_m_s2: 0.0,
        sample_time_s: 0.01,
        offset_s: 0.0,
        delay_s: 0.0,
        errors: ReadingErrors::NONE,
        outlier_m_s2: 2.0,
    };
}

/// The sensors of a car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors {
    /// Seed of every random number.
    pub seed: u64,
    /// Time of the rows after the ticks of the shift controller, s. The clocks of the channels are relative to the rows.
    pub row_offset_s: f64,
    /// Number of single readings in the shift that are wrong, each of a speed sensor drawn at random.
    pub outliers: f64,
    /// Engine speed.
    pub engine: SpeedSensor,
    /// Turbine speed.
    pub turbine: SpeedSensor,
    /// Gearbox output speed.
    pub output: SpeedSensor,
    /// Driven wheel speed.
    pub wheel: SpeedSensor,
    /// Current of the oncoming clutch's valve; without a sensor the command is known exactly, as a duty cycle is.
    pub current: Option<CurrentSensor>,
    /// Longitudinal acceleration, if it is measured.
    pub acceleration: Option<AccelerationSensor>,
}

impl Sensors {
    /// The same sensors whose readings have no errors: what an observer may know of them.
    #[must_use]
    pub fn without_errors(mut self) -> Self {
        self.outliers = 0.0;
        for sensor in [&mut self.engine, &mut self.turbine, &mut self.output, &mut self.wheel] {
            sensor.errors = ReadingErrors::NONE;
        }
        if let Some(current) = &mut self.current {
            current.errors = ReadingErrors::NONE;
        }
        if let Some(acceleration) = &mut self.acceleration {
            acceleration.errors = ReadingErrors::NONE;
        }
        self
    }
}

/// Size of an outlier of a current, A, if nothing else is known \[chosen\].
pub const OUTLIER_A: f64 = 0.1;
