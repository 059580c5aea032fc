//! The fill volume of a clutch whose piston has a stroke, and logs with which it is not identified.
use std::ops::ControlFlow::Continue;

use crate::common::{FittedFile as _, Logs, TestCar, fitted, given};
use car::Vehicle;
use config::{Source, VehicleFile};
use fit::{Parameter, Series, ShiftRecord, Verdict};

fn shifts(car: &mut TestCar, count: u64) -> Vec<ShiftRecord> {
    (0..count).map(|number| car.shift(number, Logs::TorqueAndOnePressure).record).collect()
}

/// Text of a vehicle file without the values of its cylinder.
fn without_fill_tables(car: &TestCar) -> String {
    let text = &car.file.source.text;
    let (from, to) = (text.find("[clutch.b.fill]").unwrap(), text.find("[driveline]").unwrap());
    [&text[..from], &text[to..]].concat()
}

#[test]
fn a_pressure_in_one_shift_tells_the_fill_volume_and_the_file_gets_it() {
    let mut car = TestCar::with_stroke(5);
    let shifts = shifts(&mut car, 3);
    let fit = fitted(&car, &shifts, &[]);
    let fill = fit.fill.unwrap();
    assert_eq!(
        (fill.verdict() == Verdict::NotIdentifiable, fill.shifts, fill.is_misfit),
        (false, 1, false),
        "{fill:?}"
    );
    let error = fill.log_volume - car.fill.ln();
    // The file is off by more than what is left.
    assert!(error.abs() < 2.0 * fill.sd[0] && error.abs() < 0.5 * car.fill.ln().abs(), "{fill:?} {}", car.fill.ln());
    assert!(fit.report().iter().any(|row| row.name == "fill volume of the oncoming clutch"));
    let file = fit.vehicle_file(&car.file, "a simulation").unwrap();
    let volumes = [&car.file, &file].map(|vehicle| vehicle.oncoming.cylinder.stroke_m3);
    assert!((volumes[1] / volumes[0] / fill.log_volume.exp() - 1.0).abs() < 1e-3, "{volumes:?}");
    // The limits of the stroke contain the true volume and are narrower.
    let limits = [&car.file, &file].map(|vehicle| vehicle.error_bounds.fill.unwrap().volume_m3);
    let width = limits.map(|[minimum, maximum]| (maximum / minimum).ln());
    assert!(width[1] < width[0], "{limits:?}");
    assert!((limits[1][0]..limits[1][1]).contains(&(car.fill * volumes[0])), "{limits:?} {}", car.fill * volumes[0]);
    // A file that leaves the cylinder at its defaults gets a table of its own.
    let silent = Source { text: without_fill_tables(&car), ..car.file.source.clone() };
    let silent = VehicleFile::from_source(silent).unwrap();
    let file = fit.vehicle_file(&silent, "a simulation").unwrap();
    assert!((file.oncoming.cylinder.stroke_m3 / volumes[1] - 1.0).abs() < 1e-9, "{}", file.source.text);
}

/// A piston that is still on its way when the pulse of the fill is over goes on with what the pressure is above its spring.
#[test]
fn the_preload_that_was_found_with_the_volume_is_written_with_it() {
    let mut car = TestCar::with_stroke(1);
    let shifts = shifts(&mut car, 2);
    let fit = fitted(&car, &shifts, &[]);
    let file = fit.vehicle_file(&car.file, "a simulation").unwrap();
    let fraction = |vehicle: &Vehicle| vehicle.oncoming.cylinder.preload_pa / vehicle.oncoming.cylinder.kiss_pa;
    let [given, after, truth] = [&car.file, &file, &car.car].map(fraction);
    assert!((after - truth).abs() < 0.4 * (given - truth).abs(), "{given} {after} {truth}");
    // The limits of the preload move with it, and contain the true one.
    let limits = file.error_bounds.fill.unwrap().preload_pressure_pa;
    assert!((limits[0]..limits[1]).contains(&car.car.oncoming.cylinder.preload_pa), "{limits:?}");
    // A spring whose preload is nearly its force at the kiss point keeps below that.
    let text = car
        .file
        .source
        .text
        .replace("preload_n = 450 ", "preload_n = 560 ")
        .replace("[40.5e3, 49.5e3]", "[50.4e3, 61.6e3]");
    let strong = VehicleFile::from_source(Source { text, ..car.file.source.clone() }).unwrap();
    assert!(fraction(&strong) > 0.9, "{}", fraction(&strong));
    let file = fit.vehicle_file(&strong, "a simulation").unwrap();
    // To the digits that are written.
    assert!((fraction(&file) / fraction(&strong) - 1.0).abs() < 1e-5, "{}", fraction(&file));
}

#[test]
fn without_a_measured_pressure_the_fill_volume_is_not_identified() {
    let mut car = TestCar::with_stroke(5);
    let mut shifts = shifts(&mut car, 2);
    shifts.iter_mut().for_each(|shift| shift.pressure = Series::default());
    let fit = fitted(&car, &shifts, &[]);
    let fill = fit.fill.unwrap();
    assert_eq!((fill.verdict(), fill.log_volume, fill.sd[0]), (Verdict::NotIdentifiable, 0.0, fill.sd[1]));
    let said = fit.statements().join("\n");
    assert!(
        said.contains(
            "fill volume of the oncoming clutch, which is not identified by these logs, measure the pressure"
        ),
        "{said}"
    );
    let file = fit.vehicle_file(&car.file, "a simulation").unwrap();
    assert_eq!(file.oncoming.cylinder.stroke_m3, car.file.oncoming.cylinder.stroke_m3);
    assert_eq!(file.error_bounds.fill.unwrap().volume_m3, car.file.error_bounds.fill.unwrap().volume_m3);
}

/// The record of a shift with another pressure channel.
fn with_pressure(shifts: &[ShiftRecord], change: impl Fn(&Series) -> Series) -> Vec<ShiftRecord> {
    let changed = |shift: &ShiftRecord| ShiftRecord { pressure: change(&shift.pressure), ..shift.clone() };
    shifts.iter().map(changed).collect()
}

/// A pressure channel that is not what the map says: the fill volume is not identified, or a warning stands in the report.
#[test]
fn a_wrong_pressure_channel_is_not_believed() {
    let mut car = TestCar::with_stroke(5);
    let good = shifts(&mut car, 2);
    let value = |change: fn(f64) -> f64| {
        move |pressure: &Series| Series {
            value: pressure.value.iter().map(|p| change(*p)).collect(),
            ..pressure.clone()
        }
    };
    let later = |late_s: f64| {
        move |pressure: &Series| Series {
            time_s: pressure.time_s.iter().map(|time_s| time_s + late_s).collect(),
            ..pressure.clone()
        }
    };
    // That of the offgoing clutch: high before the shift, and falling.
    let other = |pressure: &Series| {
        let falls = |time_s: &f64| if *time_s < -0.2 { 1e6 } else { (1e6 - 4e6 * (time_s + 0.2)).max(0.0) };
        Series { value: pressure.time_s.iter().map(falls).collect(), ..pressure.clone() }
    };
    let cases = [
        ("frozen", with_pressure(&good, value(|_| 0.2e6))),
        ("in kPa", with_pressure(&good, value(|p| 1e-3 * p))),
        ("in bar read as MPa", with_pressure(&good, value(|p| 10.0 * p))),
        ("50 ms late", with_pressure(&good, later(0.05))),
        ("of the other clutch", with_pressure(&good, other)),
    ];
    for (case, shifts) in cases {
        let fit = match fit::fit(&given(&car.file), &shifts, &[], car.ages(), &mut |_| Continue(())) {
            Ok(fit) => fit,
            Err(error) => {
                assert!(error.to_string().contains("hint"), "{case}: {error}");
                continue;
            }
        };
        let warned = fit.statements().iter().any(|line| line.starts_with("warning: "));
        let fill = fit.fill.unwrap();
        assert!(warned || fill.verdict() == Verdict::NotIdentifiable, "{case}: {fill:?} {:#?}", fit.statements());
        assert!(fit.unknowns.iter().all(|x| x.is_finite()) && fill.sd[0] <= fill.sd[1], "{case}");
    }
    // A pressure that begins within the fill shows no fill.
    let late = with_pressure(&good, |pressure| {
        let (time_s, value) = pressure.between([-0.15, 9.0]).unzip();
        Series { time_s, value }
    });
    assert_eq!(fitted(&car, &late, &[]).fill.unwrap().verdict(), Verdict::NotIdentifiable);
}

#[test]
fn the_zero_offset_of_a_pressure_sensor_changes_no_fill_volume() {
    let fit_with = |offset_pa: f64| {
        let mut car = TestCar::with_stroke(5);
        let mut shifts = shifts(&mut car, 3);
        shifts.iter_mut().flat_map(|record| &mut record.pressure.value).for_each(|pa| *pa += offset_pa);
        fitted(&car, &shifts, &[])
    };
    let right = fit_with(0.0);
    let [gain, offset] = [Parameter::Gain, Parameter::PressureOffset];
    for offset_pa in [-20e3, 30e3] {
        let fit = fit_with(offset_pa);
        let (fill, of_right) = (fit.fill.unwrap(), right.fill.unwrap());
        // The preload is searched in steps of 5 %, and the volume goes with it.
        assert!((fill.log_volume - of_right.log_volume).abs() < 0.25 * fill.sd[0], "{fill:?} {of_right:?}");
        assert_eq!(fill.is_misfit, of_right.is_misfit);
        let moved = |p, more: f64| (fit.value(p).unwrap() - right.value(p).unwrap() - more) / fit.sd(p).unwrap();
        // The offset is in Pa, its standard deviation in 10 kPa.
        assert!(moved(gain, 0.0).abs() < 0.05 && moved(offset, offset_pa).abs() < 0.05 * 1e4, "{offset_pa}");
    }
}
