//! Names of the signals.

/// Time, s.
pub const TIME: &str = "time_s";
/// Engine speed, rad/s.
pub const ENGINE_SPEED: &str = "engine_speed_rad_s";
/// Turbine speed, rad/s.
pub const TURBINE_SPEED: &str = "turbine_speed_rad_s";
/// Gearbox output speed, rad/s.
pub const OUTPUT_SPEED: &str = "output_speed_rad_s";
/// Driven wheel speed, rad/s.
pub const WHEEL_SPEED: &str = "wheel_speed_rad_s";
/// The same as the speed of the tread, m/s; with the wheel's radius it becomes [`WHEEL_SPEED`].
pub const WHEEL_TREAD_SPEED: &str = "wheel_speed_m_s";
/// Slip of the oncoming clutch, rad/s.
pub const ONCOMING_SLIP: &str = "oncoming_slip_rad_s";
/// Commanded current of the oncoming clutch's valve, A.
pub const ONCOMING_CURRENT: &str = "oncoming_current_a";
/// Commanded current of the offgoing clutch's valve, A.
pub const OFFGOING_CURRENT: &str = "offgoing_current_a";
/// Commanded duty cycle of the oncoming clutch's valve, %.
pub const ONCOMING_DUTY: &str = "oncoming_duty_percent";
/// Commanded duty cycle of the offgoing clutch's valve, %.
pub const OFFGOING_DUTY: &str = "offgoing_duty_percent";
/// Engine torque as the engine controller reports it, N m.
pub const REPORTED_ENGINE_TORQUE: &str = "reported_engine_torque_n_m";
/// Whether the lock-up clutch of the converter carries torque, 0 or 1.
pub const LOCK_UP_APPLIED: &str = "lock_up_applied";
/// Torque of the lock-up clutch of the converter while it is applied, N m.
pub const LOCK_UP_TORQUE: &str = "lock_up_torque_n_m";
/// Torque of the clutch of the gear while there is no shift, N m, of a car without a converter, which it starts.
pub const LAUNCH_CLUTCH_TORQUE: &str = "launch_clutch_torque_n_m";
/// Gear, by its name; during a shift the one that is left.
pub const GEAR: &str = "gear";
/// Gear that is commanded, by its name.
pub const TARGET_GEAR: &str = "target_gear";
/// The number of the gear: 1 is the first forward gear, 0 none, -1 reverse.
pub const GEAR_NUMBER: &str = "gear_number";
/// The same of the target gear.
pub const TARGET_GEAR_NUMBER: &str = "target_gear_number";
/// Brake, 0 to 1.
pub const BRAKE: &str = "brake";
/// Throttle, 0 to 1.
pub const THROTTLE: &str = "throttle";

/// The column with the age of a channel's readings: how long before its row a reading was taken, s. Without this column
/// every reading is of the time of its row. The delay of the sensor itself is not in the age.
pub fn age_of(channel: &str) -> Option<&'static str> {
    AGES.iter().find(|(name, _)| *name == channel).map(|(_, age)| *age)
}

/// The channels whose readings may be older than their row, each with the column of the age.
pub const AGES: &[(&str, &str)] = &[
    (ENGINE_SPEED, "engine_speed_age_s"),
    (TURBINE_SPEED, "turbine_speed_age_s"),
    (OUTPUT_SPEED, "output_speed_age_s"),
    (WHEEL_SPEED, "wheel_speed_age_s"),
    (ONCOMING_CURRENT, "oncoming_current_age_s"),
    (OFFGOING_CURRENT, "offgoing_current_age_s"),
    (REPORTED_ENGINE_TORQUE, "reported_engine_torque_age_s"),
    (LONGITUDINAL_ACCELERATION, "longitudinal_acceleration_age_s"),
];

/// What became of the reading of the command of the oncoming clutch's valve, a word.
pub const ONCOMING_COMMAND_READING: &str = "oncoming_command_reading";
/// The same of the offgoing clutch.
pub const OFFGOING_COMMAND_READING: &str = "offgoing_command_reading";
/// What became of the reading of engine, turbine, output and wheel speed, of the commands of both clutches, and of the
/// reported engine torque.
pub const READINGS: [&str; 7] = [
    "engine_reading",
    "turbine_reading",
    "output_reading",
    "wheel_reading",
    ONCOMING_COMMAND_READING,
    OFFGOING_COMMAND_READING,
    "engine_torque_reading",
];

/// The same of the longitudinal acceleration.
pub const ACCELERATION_READING: &str = "longitudinal_acceleration_reading";

/// True pressure of the oncoming clutch, Pa.
pub const ONCOMING_PRESSURE: &str = "oncoming_pressure_pa";
/// True pressure of the offgoing clutch, Pa.
pub const OFFGOING_PRESSURE: &str = "offgoing_pressure_pa";
/// True torque of the oncoming clutch, N m.
pub const ONCOMING_TORQUE: &str = "oncoming_torque_n_m";
/// True torque of the offgoing clutch, N m.
pub const OFFGOING_TORQUE: &str = "offgoing_torque_n_m";
/// True slip of the offgoing clutch, rad/s.
pub const OFFGOING_SLIP: &str = "offgoing_slip_rad_s";
/// True engine torque, N m.
pub const ENGINE_TORQUE: &str = "engine_torque_n_m";
/// True turbine torque, N m.
pub const TURBINE_TORQUE: &str = "turbine_torque_n_m";
/// True drive-shaft torque, N m.
pub const SHAFT_TORQUE: &str = "shaft_torque_n_m";
/// True vehicle speed, m/s.
pub const VEHICLE_SPEED: &str = "vehicle_speed_m_s";
/// Temperature of the oil in the gearbox, degC.
pub const OIL_TEMPERATURE: &str = "oil_temperature_degc";
/// True vehicle acceleration, m/s^2.
pub const VEHICLE_ACCELERATION: &str = "vehicle_acceleration_m_s2";
/// Longitudinal acceleration by an accelerometer, with the part of gravity along the road, m/s^2.
pub const LONGITUDINAL_ACCELERATION: &str = "longitudinal_acceleration_m_s2";
/// True phase of the shift, a word.
pub const TRUE_PHASE: &str = "true_phase";

/// Signals that a car measures or commands; everything else in a simulated trace is truth.
pub const MEASURABLE: &[&str] = &[
    ENGINE_SPEED,
    TURBINE_SPEED,
    OUTPUT_SPEED,
    WHEEL_SPEED,
    ONCOMING_SLIP,
    ONCOMING_CURRENT,
    OFFGOING_CURRENT,
    ONCOMING_DUTY,
    OFFGOING_DUTY,
    REPORTED_ENGINE_TORQUE,
    THROTTLE,
];

/// Estimated pressure of the oncoming clutch, Pa.
pub const PRESSURE_ESTIMATE: &str = "oncoming_pressure_estimate_pa";
/// Estimated torque of the oncoming clutch, N m.
pub const TORQUE_ESTIMATE: &str = "oncoming_torque_estimate_n_m";
/// Estimated drive-shaft torque, N m.
pub const SHAFT_ESTIMATE: &str = "shaft_torque_estimate_n_m";
/// Lower end of the guaranteed range of the pressure, Pa.
pub const PRESSURE_MIN: &str = "oncoming_pressure_least_pa";
/// Upper end of the guaranteed range of the pressure, Pa.
pub const PRESSURE_MAX: &str = "oncoming_pressure_greatest_pa";
/// Lower end of the guaranteed range of the clutch torque, N m.
pub const TORQUE_MIN: &str = "oncoming_torque_least_n_m";
/// Upper end of the guaranteed range of the clutch torque, N m.
pub const TORQUE_MAX: &str = "oncoming_torque_greatest_n_m";
/// Lower end of the expected range of the drive-shaft torque, N m.
pub const SHAFT_MIN: &str = "shaft_torque_least_n_m";
/// Upper end of the expected range of the drive-shaft torque, N m.
pub const SHAFT_MAX: &str = "shaft_torque_greatest_n_m";
/// Phase according to the supervisor, a word.
pub const PHASE: &str = "phase";
/// Whether the input could be used, a word.
pub const HEALTH: &str = "health";
