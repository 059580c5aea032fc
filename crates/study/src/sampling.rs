//! A recorded drive as a controller samples it, through ideal or real sensors.

use config::{Sensors, SpeedSensor, Vehicle};
use plant::sensors::{Noise, read_current, read_speed};
use trace::{Column, Trace, Values, signal};

/// The samples of a trace that lie at multiples of a period.
pub fn sampled(trace: &Trace, period_s: f64) -> Trace {
    let mut next = 0.0;
    let kept: Vec<usize> = (trace.time_s.iter().enumerate())
        .filter(|&(_, &time)| {
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

/// A sampled trace whose measurable signals went through the car's sensors; the truth is as it was.
///
/// `whole` is the trace at full rate, from which the teeth of the speed wheels are counted. The slip
/// follows from turbine and output speed, as on a controller.
pub fn through_sensors(whole: &Trace, sampled: &Trace, sensors: &Sensors, vehicle: &Vehicle) -> Trace {
    let mut measured = sampled.clone();
    let at = measured.time_s.clone();
    let mut replace = |name: &str, values: Vec<f64>| {
        if let Some(column) = measured.columns.iter_mut().find(|column| column.name == name) {
            column.values = Values::Numbers(values);
        }
    };
    let speed = |name: &str, sensor: &SpeedSensor| {
        let truth = whole.get(name).unwrap_or_default();
        read_speed(sensor, &whole.time_s, truth, &at, Noise::new(sensors.seed, name))
    };
    let turbine = speed(signal::TURBINE_SPEED, &sensors.turbine);
    let output = speed(signal::OUTPUT_SPEED, &sensors.output);
    let slip = turbine.iter().zip(&output).map(|(&t, &o)| vehicle.shift.oncoming_slip(t, o)).collect();
    replace(signal::ONCOMING_SLIP, slip);
    replace(signal::TURBINE_SPEED, turbine);
    replace(signal::OUTPUT_SPEED, output);
    replace(signal::ENGINE_SPEED, speed(signal::ENGINE_SPEED, &sensors.engine));
    replace(signal::WHEEL_SPEED, speed(signal::WHEEL_SPEED, &sensors.wheel));
    let current = sampled.get(signal::ONCOMING_CURRENT).unwrap_or_default();
    let noise = Noise::new(sensors.seed, signal::ONCOMING_CURRENT);
    replace(signal::ONCOMING_CURRENT, read_current(&sensors.current, current, noise));
    measured
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
