//! Sampling of a recorded drive, with ideal or real sensors.

use car::{ReadingErrors, Sensors, SpeedSensor, Vehicle};
use observer::Phase;
use plant::sensors::{Channel, Readings, Rows, dealt, read_current, read_speed};
use trace::{Column, Trace, Values, Word, signal};

/// The samples of a trace that lie at multiples of a period.
pub fn sampled(trace: &Trace, period_s: f64) -> Trace {
    sampled_beside(trace, period_s, 0.0)
}

/// The samples of a trace that lie at this offset from multiples of a period, s.
pub fn sampled_beside(trace: &Trace, period_s: f64, offset_s: f64) -> Trace {
    let mut next = 0.0;
    let kept: Vec<usize> = (trace.time_s.iter().map(|time_s| time_s - offset_s).enumerate())
        .filter(|&(_, time)| {
            let due = time >= next * period_s - 1e-9;
            if due {
                next = (time / period_s + 1e-6).floor() + 1.0;
            }
            due
        })
        .map(|(i, _)| i)
        .collect();
    let column = |column: &Column| Column {
        name: column.name.clone(),
        values: match &column.values {
            Values::Numbers(numbers) => Values::Numbers(kept.iter().map(|&i| numbers[i]).collect()),
            Values::Words(words) => Values::Words(kept.iter().map(|&i| words[i].clone()).collect()),
        },
    };
    Trace {
        path: trace.path.clone(),
        time_s: kept.iter().map(|&i| trace.time_s[i]).collect(),
        columns: trace.columns.iter().map(column).collect(),
    }
}

/// The rows of a trace at this period, whose measurable signals went through the car's sensors; the truth is as it was.
///
/// A row holds the readings that arrived since the row before, and NaN for a channel without one: a reading that was
/// lost, or a channel slower than the rows. Where readings are older than their row, a column has their age, see
/// [`signal::age_of`]. `whole` is at full rate, so that the teeth of the speed wheels can be counted. The slip follows
/// from turbine and output speed, as on a controller.
pub fn through_sensors(whole: &Trace, period_s: f64, sensors: &Sensors, vehicle: &Vehicle) -> Trace {
    let mut measured = sampled_beside(whole, period_s, sensors.row_offset_s);
    let at_s = measured.time_s.clone();
    let rows = Rows { at_s: &at_s, offset_s: sensors.row_offset_s, shift_s: shift_s(whole), seed: sensors.seed };
    let channel = |name| {
        let values = whole.get(name).filter(|values| !values.is_empty())?;
        Some(Channel { name, time_s: &whole.time_s, values })
    };
    let mut speeds = [
        (signal::ENGINE_SPEED, sensors.engine),
        (signal::TURBINE_SPEED, sensors.turbine),
        (signal::OUTPUT_SPEED, sensors.output),
        (signal::WHEEL_SPEED, sensors.wheel),
    ];
    let outliers = dealt(sensors.outliers, speeds.len(), sensors.seed);
    for ((_, sensor), outliers) in speeds.iter_mut().zip(outliers) {
        let errors = ReadingErrors { outliers: sensor.errors.outliers + outliers, ..sensor.errors };
        *sensor = SpeedSensor { errors, ..*sensor };
    }
    for (name, sensor) in speeds {
        if let Some(truth) = channel(name) {
            arrive(&mut measured, name, read_speed(&sensor, truth, rows));
        }
    }
    for name in [signal::ONCOMING_CURRENT, signal::OFFGOING_CURRENT] {
        if let (Some(sensor), Some(truth)) = (&sensors.current, channel(name)) {
            arrive(&mut measured, name, read_current(sensor, truth, rows));
        }
    }
    if let (Some(turbine), Some(output)) = (measured.get(signal::TURBINE_SPEED), measured.get(signal::OUTPUT_SPEED)) {
        let slip = turbine.iter().zip(output).map(|(&t, &o)| vehicle.shift.oncoming_slip(t, o)).collect();
        replace(&mut measured, signal::ONCOMING_SLIP, slip);
    }
    measured
}

/// Puts the readings of a channel in place of its true values, with their ages where they have some.
fn arrive(measured: &mut Trace, name: &str, readings: Readings) {
    if let Some(age) = signal::age_of(name).filter(|_| readings.have_ages()) {
        measured.add(age, readings.age_s);
    }
    replace(measured, name, readings.values);
}

fn replace(measured: &mut Trace, name: &str, values: Vec<f64>) {
    if let Some(column) = measured.columns.iter_mut().find(|column| column.name == name) {
        column.values = Values::Numbers(values);
    }
}

/// Begin and end of the shift in a recorded drive, s; those of the whole drive where it has none.
fn shift_s(whole: &Trace) -> [f64; 2] {
    let column = whole.columns.iter().find(|column| column.name == signal::TRUE_PHASE);
    let words = column.map_or(&[][..], |column| match &column.values {
        Values::Words(words) => words,
        Values::Numbers(_) => &[],
    });
    let shifting = |word: &Word| [Phase::TorquePhase, Phase::InertiaPhase].iter().any(|phase| phase.name() == *word);
    let first = words.iter().position(shifting).or((!whole.is_empty()).then_some(0));
    let last = words.iter().rposition(shifting).or(whole.len().checked_sub(1));
    [first, last].map(|at| at.map_or(0.0, |at| whole.time_s[at]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::VehicleFile;

    #[test]
    fn every_tenth_sample_is_kept_at_a_tenth_of_the_rate() {
        let mut trace = Trace::with_columns(&["x"]);
        for i in 0..101 {
            trace.push(f64::from(i) * 1e-3, &[f64::from(i)]);
        }
        let kept = sampled(&trace, 0.01);
        assert_eq!(kept.get("x").unwrap(), [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0]);
        assert_eq!(sampled(&trace, 0.001), trace);
    }

    /// A drive of one second whose shift is from 0.4 to 0.8 s.
    fn drive() -> Trace {
        let names = [
            signal::ENGINE_SPEED,
            signal::TURBINE_SPEED,
            signal::OUTPUT_SPEED,
            signal::WHEEL_SPEED,
            signal::ONCOMING_SLIP,
            signal::ONCOMING_CURRENT,
            signal::ONCOMING_PRESSURE,
        ];
        let mut trace = Trace::with_columns(&names);
        for i in 0..1000 {
            let time_s = f64::from(i) * 1e-3;
            trace.push(time_s, &[200.0 + 50.0 * time_s, 180.0, 72.0, 24.0 + time_s, 180.0, 0.3, 2e5 * time_s]);
        }
        let phase = |&time_s: &f64| match time_s {
            t if t < 0.3995 => Phase::BeforeShift,
            t if t < 0.5995 => Phase::TorquePhase,
            t if t < 0.7995 => Phase::InertiaPhase,
            _ => Phase::AfterShift,
        };
        trace.add_words(signal::TRUE_PHASE, trace.time_s.iter().map(|time_s| phase(time_s).name().into()).collect());
        trace
    }

    fn sensors() -> Sensors {
        config::ExperimentFile::bench().unwrap().sensors.unwrap()
    }

    fn read(sensors: &Sensors) -> Trace {
        through_sensors(&drive(), 0.01, sensors, &VehicleFile::built_in().unwrap())
    }

    /// The columns in which two traces differ.
    fn differ(a: &Trace, b: &Trace) -> Vec<String> {
        let bits = |trace: &Trace, name: &str| {
            trace.get(name).map(|values| values.iter().map(|value| value.to_bits()).collect::<Vec<u64>>())
        };
        let names = b.columns.iter().map(|column| column.name.clone());
        names.filter(|name| bits(a, name) != bits(b, name)).collect()
    }

    #[test]
    fn an_error_of_one_channel_leaves_every_other_as_it_is() {
        let right = read(&sensors());
        let with = |change: fn(&mut Sensors)| {
            let mut sensors = sensors();
            change(&mut sensors);
            differ(&right, &read(&sensors))
        };
        assert_eq!(with(|s| s.wheel.errors.scale = 1.01), [signal::WHEEL_SPEED]);
        assert_eq!(with(|s| s.engine.delay_s = 0.02), [signal::ENGINE_SPEED]);
        assert_eq!(with(|s| s.output.errors.outliers = 1.0), [signal::OUTPUT_SPEED, signal::ONCOMING_SLIP]);
        assert_eq!(with(|s| s.wheel.offset_s = 0.004), [signal::WHEEL_SPEED, "wheel_speed_age_s"]);
        let current = |s: &mut Sensors| s.current.as_mut().unwrap().errors.missing_share = 0.5;
        assert_eq!(with(current), [signal::ONCOMING_CURRENT]);
        assert!(with(|_| ()).is_empty());
    }

    #[test]
    fn a_row_without_a_turbine_reading_has_no_slip_and_the_truth_has_no_holes() {
        let mut sensors = sensors();
        sensors.turbine.sample_time_s = 0.02;
        let measured = read(&sensors);
        let came = |name: &str| -> Vec<bool> { measured.get(name).unwrap().iter().map(|v| !v.is_nan()).collect() };
        let half: Vec<bool> = (0..measured.len()).map(|i| i % 2 == 0).collect();
        assert_eq!((came(signal::TURBINE_SPEED), came(signal::ONCOMING_SLIP)), (half.clone(), half));
        assert!(came(signal::OUTPUT_SPEED).iter().chain(&came(signal::ONCOMING_PRESSURE)).all(|came| *came));
    }

    #[test]
    fn outliers_that_are_dealt_out_lie_in_the_shift_and_are_as_many_as_asked() {
        let right = read(&sensors());
        for seed in 0..20 {
            let of = |outliers| read(&Sensors { seed, outliers, ..sensors() });
            let (right, wrong) = (of(0.0), of(3.0));
            let names = [signal::ENGINE_SPEED, signal::TURBINE_SPEED, signal::OUTPUT_SPEED, signal::WHEEL_SPEED];
            let off = |name: &str| -> Vec<f64> {
                let values = right.get(name).unwrap().iter().zip(wrong.get(name).unwrap()).zip(&right.time_s);
                values.filter(|((right, wrong), _)| right != wrong).map(|(_, &time_s)| time_s).collect()
            };
            let times: Vec<f64> = names.into_iter().flat_map(off).collect();
            assert!(times.len() == 3 && times.iter().all(|time| (0.4..0.8).contains(time)), "{times:?}");
        }
        assert_eq!(shift_s(&drive()), [0.4, 0.799]);
        assert_eq!(shift_s(&right.filtered(|name| name != signal::TRUE_PHASE)), [0.0, 0.99]);
    }

    #[test]
    fn rows_beside_the_ticks_of_the_controller_are_of_their_own_time() {
        let beside = read(&Sensors { row_offset_s: 0.009, ..sensors() });
        assert!((beside.time_s[1] - 0.019).abs() < 1e-12 && beside.get("engine_speed_age_s").is_none());
        let pressure = beside.get(signal::ONCOMING_PRESSURE).unwrap();
        assert!(beside.time_s.iter().zip(pressure).all(|(time_s, pressure)| (pressure - 2e5 * time_s).abs() < 1e-6));
    }
}
