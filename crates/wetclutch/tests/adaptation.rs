//! Fill time, kiss point, lag and friction by clutch, gears and oil temperature.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use wetclutch::fitted::{Adaptation, Adapted};
use wetclutch::{Column, FitOptions, Fitted, LogInput, Table, Values, VehicleFile, fit, simulate};

fn root(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file)
}

/// Oil temperatures, degC, each with the factors on lag and friction that the simulated gearbox has there.
const OIL: [(f64, f64, f64); 2] = [(25.0, 1.4, 1.06), (85.0, 1.0, 1.0)];

/// Logs of a drive at each temperature, with noise; `degc` gives the column of the temperature.
fn logs(vehicle: &VehicleFile, degc: impl Fn(f64) -> Option<f64>) -> Vec<Arc<Table>> {
    let mut drive = wetclutch::read_drive(&root("drives/city.toml"), None).unwrap();
    drive.repetitions = 2;
    let sensors = config::Source::read(&root("experiments/bench.toml")).unwrap();
    drive.sensors = Some(wetclutch::simulated_sensors_of(&sensors).unwrap());
    let log = |(number, (oil_degc, lag, friction)): (u64, (f64, f64, f64))| {
        let mut car = vehicle.car().unwrap().clone();
        for clutch in car.clutches.iter_mut().flatten() {
            clutch.valve = clutch.valve.changed(lag, 1.0, None);
            clutch.clutch.friction = clutch.clutch.friction.scaled(friction);
            clutch.clutch.static_friction *= friction;
        }
        drive.sensors.as_mut().unwrap().seed = number;
        let mut log = simulate(&car, &drive).unwrap().measured;
        if let Some(oil_degc) = degc(oil_degc) {
            let values = Values::Numbers(vec![oil_degc; log.len()]);
            log.columns.push(Column { name: "oil_temperature_degc".to_owned(), values });
        }
        Arc::new(log)
    };
    (0..).zip(OIL).map(log).collect()
}

fn fitted(vehicle: &VehicleFile, logs: &[Arc<Table>], oil_step_k: f64) -> Fitted {
    let options = FitOptions { oil_step_k: Some(oil_step_k), ..FitOptions::default() };
    let inputs: Vec<_> = logs.iter().map(|log| LogInput::of_table("a drive", log)).collect();
    fit(vehicle, &inputs, &options, &mut |_| (), &mut |_| ()).unwrap()
}

fn vehicle() -> VehicleFile {
    VehicleFile::read(&root("vehicles/eight_speed.toml")).unwrap()
}

#[test]
fn lag_fill_time_and_friction_follow_the_temperature() {
    let vehicle = vehicle();
    let found = fitted(&vehicle, &logs(&vehicle, Some), 20.0);
    let adaptations = found.adaptations.as_ref().unwrap();
    assert_eq!(adaptations.warnings, [""; 0]);
    let car = vehicle.car().unwrap();
    let of = |element: &str, quantity: Adapted| -> Vec<&Adaptation> {
        let rows = adaptations.rows.iter();
        rows.filter(|row| row.element == element && row.quantity == quantity && row.shift.is_none()).collect()
    };
    let mut lags = 0;
    for (element, clutch) in car.gearbox.elements.iter().zip(&car.clutches) {
        let Some(clutch) = clutch else { continue };
        let file_s = clutch.valve.lag(clutch.clutch.kiss_pressure(), 0.0);
        for (row, (oil_degc, factor, _)) in of(&element.name, Adapted::ValveLag).into_iter().zip(OIL) {
            assert!(row.oil_degc.is_some_and(|[low, high]| (low..high).contains(&oil_degc)) && row.shifts > 0);
            let found = row.found.unwrap();
            // The kiss point, at which the lag is given, is fitted too.
            let inside = 0.97 * found.interval[0]..1.03 * found.interval[1];
            assert!(inside.contains(&(factor * file_s)), "{row:?} {}", factor * file_s);
            lags += usize::from(found.fraction < 0.7);
        }
        for quantity in [Adapted::ValveLag, Adapted::FillTime] {
            let courses: Vec<f64> =
                of(&element.name, quantity).iter().filter_map(|row| row.found).map(|found| found.value).collect();
            assert!(courses.is_sorted_by(|cold, hot| cold >= hot), "{courses:?}");
        }
        for (row, (.., factor)) in of(&element.name, Adapted::Friction).into_iter().zip(OIL) {
            let [low, high] = row.found.unwrap().interval;
            assert!((low..high).contains(&factor), "{row:?}");
        }
    }
    // Of ten lags at least half are identified, and those of the cold oil are longer.
    assert!(lags >= 5, "{lags}");
    let [cold, hot] = of("E", Adapted::ValveLag)[..] else { panic!("two temperatures") };
    assert!(cold.found.unwrap().value > 1.2 * hot.found.unwrap().value);
    let [cold, hot] = of("E", Adapted::FillTime)[..] else { panic!("two temperatures") };
    assert!(cold.found.unwrap().value > 1.1 * hot.found.unwrap().value);
    // What is not driven is said.
    let lacking =
        adaptations.rows.iter().filter(|row| row.shift.as_ref().is_some_and(|shift| shift.gears == ["6", "7"]));
    let lacking: Vec<&Adaptation> = lacking.collect();
    assert!(!lacking.is_empty() && lacking.iter().all(|row| row.shifts == 0 && row.found.is_none()));
    assert!(lacking.iter().all(|row| row.lacks == "a shift that can be fitted"), "{lacking:?}");
    let table = found.adaptation_table();
    assert_eq!(table.len(), adaptations.rows.len());
    assert!(table.numbers("value").unwrap().iter().any(|value| value.is_nan()));
}

#[test]
fn without_a_temperature_all_shifts_are_one_group() {
    let vehicle = vehicle();
    let mut logs = logs(&vehicle, |_| None);
    logs.truncate(1);
    let adaptations = fitted(&vehicle, &logs, 20.0).adaptations.unwrap();
    assert!(!adaptations.rows.is_empty() && adaptations.rows.iter().all(|row| row.oil_degc.is_none()));
    let found =
        fit(&vehicle, &[LogInput::of_table("a drive", &logs[0])], &FitOptions::default(), &mut |_| (), &mut |_| ());
    let found = found.unwrap();
    assert!(found.adaptations.is_none() && found.adaptation_table().is_empty());
}

#[test]
fn a_step_that_is_none_is_refused() {
    for step_k in [1.0, 500.0, f64::NAN] {
        let options = FitOptions { oil_step_k: Some(step_k), ..FitOptions::default() };
        let error = fit(&vehicle(), &[], &options, &mut |_| (), &mut |_| ()).unwrap_err().to_string();
        assert!(
            error
                .starts_with(&format!("the step of the oil temperature is {step_k} K\nhint: give one from 2 to 200 K"))
        );
    }
}
