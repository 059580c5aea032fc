//! `design` of a car with a gearbox.

use crate::support::{Folder, ROOT, VEHICLE, printed, refused, stderr, stdout, wetclutch};

fn car(name: &str) -> String {
    format!("{ROOT}vehicles/{name}.toml")
}

#[test]
fn the_gains_of_a_shift_are_printed_with_their_certificate() {
    let car = car("eight_speed");
    let design = |more: &[&str]| wetclutch(&[&["design", &car, "--shift", "2-3"], more].concat());
    let text = printed(&design(&["--method", "interval"]));
    for words in [
        "eight-speed automatic, 2.0 L, shift 2-3 (",
        "ratio 3.130 to 2.104, 1/(i_off - i_on) = 0.97; oncoming element C, alpha -1.525: its slip is alpha (w_t - 2.104 w_o)",
        "Gains are designed for upshifts with a driving engine.",
        "the gearbox filter estimates",
        "torque phase: the gain is the open loop: no gain reduces the bound",
        "inertia phase: L normalised",
        "turbine-side inertia",
        "certificate for forward and backward slip",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    for observer in ["rigid", "compliant", "sliding"] {
        let json = printed(&design(&["--observer", observer, "--json", "--phase", "inertia"]));
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json.as_object().unwrap().len(), 2);
        assert_eq!(json["json_version"], 1);
        let has_certificate = json["inertia_phase"]["vertices"].as_array().is_some_and(|vertices| vertices.len() == 2);
        assert_eq!(has_certificate, observer != "sliding", "{json}");
    }
}

#[test]
fn a_default_requirement_that_is_not_met_is_said_and_no_failure() {
    let car = car("eight_speed");
    let design = |more: &[&str]| wetclutch(&[&["design", &car, "--shift", "6-7", "--phase", "torque"], more].concat());
    let text = printed(&design(&[]));
    for words in [", not met)", "open loop is used: its steady-state bound", "--offset-max replaces it"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let output = design(&["--offset-max", "10000"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stdout(&output).contains(", not met)") && stderr(&output).contains("--offset-max"), "{}", stderr(&output));
}

#[test]
fn without_a_shift_the_upshifts_that_hide_their_pressure_are_in_a_table() {
    let car = car("eight_speed");
    let table = |more: &[&str]| printed(&wetclutch(&[&["design", &car, "--method", "interval"], more].concat()));
    let text = table(&[]);
    for words in [
        "certified steady-state bound on the error of the torque of the oncoming clutch: of the valve",
        "torque phase: open loop, N m",
        "observer rigid, method interval, sample time 10 ms",
        "Gains are designed for upshifts with a driving engine.",
        "`design` and `sensitivity` may call different phases hidden",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let json: serde_json::Value = serde_json::from_str(&table(&["--json"])).unwrap();
    let rows = json["shifts"].as_array().unwrap();
    assert_eq!(rows.len(), 7);
    for row in rows {
        let name = format!("{}-{}", row["from_gear"].as_str().unwrap(), row["to_gear"].as_str().unwrap());
        let line = text.lines().find(|line| line.starts_with(&name)).unwrap();
        let mut hidden = 0;
        for phase in ["torque_phase", "inertia_phase"] {
            let bound = |key: &str| row[phase][key].as_f64().unwrap();
            let is_hidden = bound("best_gain_bound_n_m") >= 0.999 * bound("open_loop_bound_n_m");
            assert_eq!(row[phase]["uses_open_loop"].as_bool(), Some(is_hidden), "{row}");
            assert!(line.contains(&format!("{:.1}", bound("open_loop_bound_n_m"))), "{line}");
            hidden += usize::from(is_hidden);
        }
        assert_eq!(line.matches("open loop is used").count(), hidden, "{line}");
        assert!(line.contains(&format!("{:.2}", row["ratio_gain"].as_f64().unwrap())), "{line}");
        // Whether the gearbox output can be weighed against the turbine torque to within the budget: in no shift of this car.
        assert!(row["torque_phase"]["uses_open_loop"].as_bool().unwrap() && hidden == 1, "{row}");
    }
    let phase: serde_json::Value = serde_json::from_str(&table(&["--json", "--phase", "torque"])).unwrap();
    let shift = &phase["shifts"][0];
    assert!(shift["inertia_phase"].is_null() && shift["torque_phase"].is_object(), "{phase}");
}

#[test]
fn upshifts_with_two_transitions_are_named_below_the_table() {
    let folder = Folder::new("design-double");
    let gearbox = std::fs::read_to_string(format!("{ROOT}gearboxes/8hp.toml")).unwrap();
    // Without 2nd and 3rd gear the upshift from 1st gear changes two elements.
    let lines = gearbox.lines().filter(|line| !line.contains("name = \"2\"") && !line.contains("name = \"3\""));
    folder.write("g.toml", lines.map(|line| format!("{line}\n")).collect::<String>());
    let car = folder.write("car.toml", "name = \"x\"\ngearbox = \"g.toml\"\n");
    let text = printed(&wetclutch(&["design", &car, "--method", "interval", "--phase", "torque"]));
    assert!(text.contains("no design: in 1-4 more than one element opens or closes (double)"), "{text}");
    assert!(text.lines().any(|line| line.starts_with("4-5")) && !text.lines().any(|line| line.starts_with("1-4")));
}

#[test]
fn what_has_no_design_is_refused_with_a_hint() {
    let (eight, dual) = (car("eight_speed"), car("dual_clutch"));
    let cases: [(&[&str], &str); 8] = [
        (&["design", &eight, "--shift", "1-9"], "no shift \"1-9\"\nhint: two gears"),
        (&["design", &eight, "--shift", "3-2"], "3-2 is no upshift between forward gears"),
        (&["design", &eight, "--shift", "1-4"], "(double), and the designs are for one clutch against another"),
        (&["design", &dual], "the car has no converter"),
        (&["design", &dual, "--shift", "1-2"], "the car has no converter"),
        (&["design", &eight, "--method", "iss"], "has no bound for a sample time\nhint: "),
        (&["design", &eight, "--observer", "sliding"], "hint: "),
        (&["design", &eight, "--bounds", "b.toml"], "--bounds has values for a vehicle file of one shift\nhint: "),
    ];
    for (arguments, words) in cases {
        let text = refused(&wetclutch(arguments));
        assert!(text.contains(words), "{arguments:?}: {text}");
    }
    let unused = wetclutch(&["design", VEHICLE, "--shift", "1-2"]);
    assert!(unused.status.success() && stderr(&unused).contains("warning: --shift has no effect: "));
}
