//! A simulated drive as the filter sees it: speeds through toothed wheels, the commands of the valves, the gear.

use car::{Car, Sensors};
use drivetrain::Real;
use observer::Reading;
use observer::ShiftTables;
use observer::gearbox::{MAX_ELEMENTS, ShiftInput};
use plant::car::CarSample;
use plant::sensors::{Channel, Readings, Rows, read_acceleration, read_speed};

use crate::measured::{ACCELERATION, specific_force};
use crate::{RECORD_S, SAMPLE_S};

/// Torque of the lock-up clutch from which on it counts as applied, N m.
const LOCK_UP_N_M: f64 = 0.1;

/// A drive that was sampled every [`RECORD_S`]: its speeds, and every [`SAMPLE_S`] the whole sample.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    time_s: Vec<f64>,
    /// Engine, turbine, output and wheel speed, rad/s.
    speeds_rad_s: [Vec<f64>; 4],
    /// Longitudinal acceleration with the part of gravity, m/s^2.
    force_m_s2: Vec<f64>,
    /// Every [`SAMPLE_S`].
    pub samples: Vec<CarSample>,
}

/// Records between two samples of the filter.
pub(crate) fn records_in_a_sample() -> usize {
    (SAMPLE_S / RECORD_S).round().max(1.0).whole()
}

impl Recording {
    /// Takes the next sample, [`RECORD_S`] after the one before.
    pub fn push(&mut self, sample: &CarSample) {
        if self.time_s.len().is_multiple_of(records_in_a_sample()) {
            self.samples.push(*sample);
        }
        self.time_s.push(sample.time_s);
        let torques = &sample.torques;
        let speeds = [torques.engine_rad_s, torques.turbine_rad_s, torques.output_rad_s, sample.wheel_rad_s];
        for (column, speed) in self.speeds_rad_s.iter_mut().zip(speeds) {
            column.push(speed);
        }
        self.force_m_s2.push(specific_force(sample));
    }

    /// What the filter is shown, an input for each of the samples.
    pub fn inputs(
        &self,
        car: &Car,
        tables: &ShiftTables<f64>,
        sensors: &Sensors,
        seed: u64,
    ) -> impl Iterator<Item = ShiftInput<f64>> {
        let at_s: Vec<f64> = self.samples.iter().map(|sample| sample.time_s).collect();
        let rows = Rows { at_s: &at_s, offset_s: at_s.first().copied().unwrap_or(0.0), shift_s: [0.0; 2], seed };
        let channels = [
            ("engine", &sensors.engine),
            ("turbine", &sensors.turbine),
            ("output", &sensors.output),
            ("wheel", &sensors.wheel),
        ];
        let mut columns = channels.into_iter().zip(&self.speeds_rad_s);
        let speeds: [Readings; 4] = std::array::from_fn(|_| {
            let ((name, sensor), values) = columns.next().unwrap_or((channels[0], &self.speeds_rad_s[0]));
            read_speed(sensor, Channel { name, time_s: &self.time_s, values }, rows)
        });
        let truth = Channel { name: ACCELERATION, time_s: &self.time_s, values: &self.force_m_s2 };
        let acceleration = sensors.acceleration.as_ref().map(|sensor| read_acceleration(sensor, truth, rows));
        (0..self.samples.len()).map(move |row| {
            let sample = &self.samples[row];
            let reading = |of: &Readings| {
                let (value, age_s) = (of.values[row], of.age_s[row]);
                (!value.is_nan()).then_some(Reading { value, age_s })
            };
            let command = |element: usize| Some(Reading::now(sample.commands[element]));
            let of_speeds = input(car, tables, sample, speeds.each_ref().map(reading), command);
            ShiftInput { acceleration_m_s2: acceleration.as_ref().and_then(reading), ..of_speeds }
        })
    }
}

/// What the filter is shown of a sample: the readings of engine, turbine, output and wheel speed, the commands of the elements, and what
/// the controller and the engine say.
pub(crate) fn input(
    car: &Car,
    tables: &ShiftTables<f64>,
    sample: &CarSample,
    speeds: [Option<Reading<f64>>; 4],
    command: impl Fn(usize) -> Option<Reading<f64>>,
) -> ShiftInput<f64> {
    let mut commands = [None; MAX_ELEMENTS];
    for element in 0..sample.commands.len() {
        if let Some(place) = tables.place(element) {
            commands[place] = command(element);
        }
    }
    let lock_up_applied = lock_up_is_applied(car, sample);
    // Without a converter, or where it is locked, nothing else gives the torque at the gearbox input.
    let engine_n_m = reported_engine_n_m(car, sample);
    let [engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s] = speeds;
    ShiftInput {
        dt_s: SAMPLE_S,
        engine_rad_s,
        turbine_rad_s,
        output_rad_s,
        wheel_rad_s,
        engine_n_m: (car.converter.is_none() || lock_up_applied).then_some(Reading::now(engine_n_m)),
        acceleration_m_s2: None,
        lock_up_applied,
        commands,
        gear: sample.gears(),
    }
}

/// Whether the lock-up clutch carries torque. It comes after the elements of the gearbox.
pub fn lock_up_is_applied(car: &Car, sample: &CarSample) -> bool {
    let lock_up = car.converter.and_then(|_| sample.torques.elements_n_m.get(car.gearbox.elements.len()));
    lock_up.is_some_and(|torque_n_m| torque_n_m.abs() > LOCK_UP_N_M)
}

/// The clutch between engine and gearbox, by its place among the elements: the lock-up clutch of the converter; without a converter, the
/// clutch of the gear while there is no shift.
pub fn input_clutch(car: &Car, sample: &CarSample) -> Option<usize> {
    if car.converter.is_some() {
        return lock_up_is_applied(car, sample).then_some(car.gearbox.elements.len());
    }
    let is_in_gear = sample.shift.is_none() && !sample.is_neutral;
    let from_gear = car.gearbox.shifts.iter().filter(|shift| is_in_gear && shift.from == sample.gear);
    from_gear.filter_map(|shift| shift.change.single()).map(|[offgoing, _]| offgoing).next()
}

/// Torque of the clutch between engine and gearbox, N m; not a number where there is none.
pub fn input_clutch_n_m(car: &Car, sample: &CarSample) -> f64 {
    let torque = input_clutch(car, sample).and_then(|element| sample.torques.elements_n_m.get(element));
    torque.copied().unwrap_or(f64::NAN)
}

/// The engine torque as the engine's controller reports it, N m: at the clutch, less the drag of the engine.
pub fn reported_engine_n_m(car: &Car, sample: &CarSample) -> f64 {
    sample.torques.engine_n_m - car.engine.drag_n_m_s * sample.torques.engine_rad_s
}
