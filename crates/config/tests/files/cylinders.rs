//! Pistons with a stroke.

use config::{Source, VehicleFile};

use super::line_of;

const STROKE: &str = include_str!("../../../../vehicles/two_speed_stroke.toml");

fn stroke_vehicle(text: &str) -> VehicleFile {
    VehicleFile::from_source(Source::built_in("vehicle.toml", text)).unwrap()
}

#[test]
fn the_car_with_a_stroke_differs_from_the_built_in_one_in_nothing_else() {
    let (built_in, mut stroke) = (VehicleFile::built_in().unwrap(), stroke_vehicle(STROKE));
    assert!(stroke.offgoing.has_stroke && stroke.oncoming.has_stroke);
    assert!(!built_in.offgoing.has_stroke && !built_in.oncoming.has_stroke);
    (stroke.source, stroke.name) = (built_in.source.clone(), built_in.name.clone());
    (stroke.offgoing.has_stroke, stroke.oncoming.has_stroke) = (false, false);
    assert!(stroke.error_bounds.fill.is_some() && built_in.error_bounds.fill.is_none());
    stroke.error_bounds.fill = None;
    assert_eq!(stroke, built_in);
}

#[test]
fn a_file_that_says_nothing_of_the_cylinders_has_a_stroke_and_the_values_of_the_file_that_says_all() {
    let all = stroke_vehicle(STROKE);
    let (from, to) = (STROKE.find("[clutch.b.fill]").unwrap(), STROKE.find("[driveline]").unwrap());
    let silent =
        stroke_vehicle(&[&STROKE[..from], &STROKE[to..]].concat().replace("[clutch.a.fill]\nenabled = true", ""));
    assert_eq!((all.offgoing, all.oncoming), (silent.offgoing, silent.oncoming));
    assert_eq!(
        (
            [silent.offgoing.hysteresis_pa, silent.oncoming.hysteresis_pa],
            silent.backlash_rad,
            silent.oil_temperature_degc
        ),
        ([0.0; 2], 0.0, 80.0)
    );
}

#[test]
fn wrong_values_of_a_cylinder_are_named_with_their_line() {
    let error = |from: &str, to: &str| {
        assert!(STROKE.contains(from), "{from}");
        let text = STROKE.replacen(from, to, 1);
        VehicleFile::from_source(Source::built_in("v.toml", &text)).unwrap_err().to_string()
    };
    let line = line_of(STROKE, "stroke_m = ");
    assert_eq!(
        error("stroke_m = 1.2e-3", "stroke_m = 1.2   "),
        format!("v.toml:{line}: `clutch.b.fill.stroke_m` is 1.2, expected 0.00001 to 0.02\nhint: 1.2 mm is 0.0012 m")
    );
    // A spring cannot press harder on its stop than at the kiss point.
    assert!(error("preload_n = 450", "preload_n = 700").contains("is 700, expected 0 to 600"));
    assert!(error("temperature_degc = 80", "temperature_degc = 353").contains("expected -40 to 150"));
    assert!(error("exhaust_factor = 1.0", "exhaust = 1.0").contains("unknown key `exhaust`"));
    assert!(error("enabled = true\nstroke_m", "enabled = 1\nstroke_m").contains("expected true or false"));
}
