//! Files of what the gearbox filter has learnt of a car.

use geartrain::Gearbox;
use observer::gearbox::{LEARNT, Learnt};
use serde::Deserialize;
use toml::Spanned;

use crate::check::Check;
use crate::{ConfigError, Source, toml_string};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLearnt {
    gearbox: Spanned<String>,
    elements: Spanned<Vec<String>>,
    shifts: u32,
    refused: u8,
    oil_temperature_degc: Option<f64>,
    mean: Spanned<Vec<f64>>,
    covariance: Spanned<Vec<Vec<f64>>>,
}

/// Names of the elements that have plates, in the order of the filter's tables.
fn names(gearbox: &Gearbox) -> Vec<&str> {
    gearbox.elements.iter().filter(|element| element.pack.is_some()).map(|element| element.name.as_str()).collect()
}

/// The text of a file of what was learnt of a car with this gearbox. The same numbers are read again from it, but
/// for the odds, which are those of a drive.
pub fn write_learnt(gearbox: &Gearbox, learnt: &Learnt<f64>) -> String {
    let row = |values: &[f64]| values.iter().map(|value| format!("{value:e}")).collect::<Vec<_>>().join(", ");
    let elements: Vec<String> = names(gearbox).into_iter().map(toml_string).collect();
    // The covariance is symmetric: its lower triangle.
    let triangle = learnt.covariance.iter().enumerate();
    let triangle = triangle.map(|(k, values)| format!("  [{}],\n", row(&values[..=k])));
    // The temperature that it is for, where the log has one.
    let oil = learnt.oil_degc.map_or_else(String::new, |degc| format!("oil_temperature_degc = {degc:?}\n"));
    format!(
        "# What the gearbox filter has learnt of a car. Each number is in units of the deviation that the quantity has\n\
         # unlearnt: torque factors and kiss points by element, inertias by pair of gears, torque at the gearbox input, stiffness\n\
         # of the drive shafts, scale of the wheel speed, reported engine torque, lags and delays of the valves by element.\n\
         gearbox = {}\nelements = [{}]\nshifts = {}\nrefused = {}\n{oil}mean = [{}]\ncovariance = [\n{}]\n",
        toml_string(&gearbox.name),
        elements.join(", "),
        learnt.shifts,
        learnt.refused,
        row(&learnt.mean),
        triangle.collect::<String>(),
    )
}

/// Checks a file of what was learnt, of whatever car.
///
/// # Errors
/// The text is no such file.
pub fn check_learnt(source: &Source) -> Result<(), ConfigError> {
    source.parse::<RawLearnt>().map(drop)
}

/// What was learnt of a car with this gearbox.
///
/// # Errors
/// The text is no such file, is of another gearbox, or its numbers cannot be what a filter has learnt.
pub fn read_learnt(gearbox: &Gearbox, source: &Source) -> Result<Learnt<f64>, ConfigError> {
    let raw: RawLearnt = source.parse()?;
    let check = Check::of(source);
    let (given, expected) = (raw.elements.get_ref(), names(gearbox));
    if raw.gearbox.get_ref() != &gearbox.name || given != &expected {
        let message = format!(
            "was learnt of the gearbox \"{}\" with the elements {}, and the car has \"{}\" with {}",
            raw.gearbox.get_ref(),
            given.join(", "),
            gearbox.name,
            expected.join(", ")
        );
        let hint = "take the file that was written for this car, or start without one".to_owned();
        return Err(check.meaning("gearbox", raw.gearbox.span().start, message, Some(hint)));
    }
    let size = |key: &str, offset: usize, count: usize, expected: usize| {
        let message = format!("has {count} numbers, expected {expected}");
        let hint = "the file is cut, or of another version of the program: start without it".to_owned();
        (count == expected).then_some(()).ok_or_else(|| check.meaning(key, offset, message, Some(hint)))
    };
    let (mean, covariance) = (raw.mean.get_ref(), raw.covariance.get_ref());
    size("mean", raw.mean.span().start, mean.len(), LEARNT)?;
    size("covariance", raw.covariance.span().start, covariance.len(), LEARNT)?;
    let (shifts, refused, oil_degc) = (raw.shifts, raw.refused, raw.oil_temperature_degc);
    let mut learnt =
        Learnt { mean: [0.0; LEARNT], covariance: [[0.0; LEARNT]; LEARNT], shifts, refused, odds: 0.0, oil_degc };
    learnt.mean.copy_from_slice(mean);
    for (i, row) in covariance.iter().enumerate() {
        size("covariance", raw.covariance.span().start, row.len(), i + 1)?;
        for (j, &value) in row.iter().enumerate() {
            (learnt.covariance[i][j], learnt.covariance[j][i]) = (value, value);
        }
    }
    learnt.checked().ok_or_else(|| {
        let message = "the numbers are not within the bounds of the car's errors, or are no covariance".to_owned();
        let hint = "the file was changed by hand or written in part; start without it".to_owned();
        check.meaning("covariance", raw.covariance.span().start, message, Some(hint))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CarFile;

    fn gearbox(file: &str, text: &str) -> Gearbox {
        let vehicle = format!("name = \"car\"\ngearbox = \"{file}\"\n");
        CarFile::from_sources(Source::built_in("car.toml", &vehicle), Source::built_in(file, text)).unwrap().car.gearbox
    }

    fn eight_speed() -> Gearbox {
        gearbox("gearboxes/8hp.toml", include_str!("../../../gearboxes/8hp.toml"))
    }

    /// Something that was learnt: unequal numbers everywhere.
    fn learnt() -> Learnt<f64> {
        let mut learnt = Learnt {
            mean: [0.0; LEARNT],
            covariance: [[0.0; LEARNT]; LEARNT],
            shifts: 31,
            refused: 2,
            odds: 0.0,
            oil_degc: Some(81.5),
        };
        for i in 0..LEARNT {
            learnt.mean[i] = 1.0 / (i as f64 + 3.0) - 0.1;
            for j in 0..LEARNT {
                learnt.covariance[i][j] = if i == j { 0.7 } else { 0.1 / ((i + j) as f64 + 30.0) };
            }
        }
        learnt
    }

    #[test]
    fn what_is_written_is_read_again_to_the_last_digit() {
        let gearbox = eight_speed();
        let source = Source::built_in("learnt.toml", &write_learnt(&gearbox, &learnt()));
        assert_eq!(read_learnt(&gearbox, &source).unwrap(), learnt());
        // A car without a sensor of the oil's temperature.
        let without = Learnt { oil_degc: None, ..learnt() };
        let text = write_learnt(&gearbox, &without);
        assert!(!text.contains("oil_temperature"));
        assert_eq!(read_learnt(&gearbox, &Source::built_in("learnt.toml", &text)).unwrap(), without);
    }

    #[test]
    fn a_file_of_another_car_or_a_broken_one_is_refused() {
        let gearbox = eight_speed();
        let text = write_learnt(&gearbox, &learnt());
        let refused =
            |text: &str| read_learnt(&gearbox, &Source::built_in("learnt.toml", text)).unwrap_err().to_string();
        let other = refused(&text.replace("\"E\"", "\"F\""));
        assert!(other.starts_with("learnt.toml:4: `gearbox`: was learnt of the gearbox"), "{other}");
        let numbers = |count: usize| format!("has {count} numbers, expected {LEARNT}");
        assert!(refused(&text.replace("mean = [", "mean = [0.0, ")).contains(&numbers(LEARNT + 1)));
        // Of a version in which one quantity less was learnt.
        let end = text.find("]\ncovariance").unwrap();
        let earlier = format!("{}{}", &text[..text[..end].rfind(", ").unwrap()], &text[end..]);
        let earlier = refused(&earlier);
        assert!(earlier.contains(&numbers(LEARNT - 1)) && earlier.contains("another version"), "{earlier}");
        assert!(refused(&text.replace("7e-1", "-7e-1")).contains("no covariance"));
        assert!(refused(&text.replace("7e-1", "nan")).contains("no covariance"));
        assert!(refused(&text.replace("81.5", "815")).contains("bounds"));
        // Cut anywhere in the middle.
        for part in 1..8 {
            assert!(read_learnt(&gearbox, &Source::built_in("learnt.toml", &text[..part * text.len() / 8])).is_err());
        }
    }
}
