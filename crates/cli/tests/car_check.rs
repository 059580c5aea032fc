//! `check` of a car with a gearbox: its gears, and whether its elements hold what its engine gives.

use crate::support::{Folder, ROOT, VEHICLE, printed, refused, said, wetclutch};

fn car(folder: &Folder, name: &str, more: &str) -> String {
    folder.write(name, format!("name = \"car\"\ngearbox = '{ROOT}gearboxes/8hp.toml'\n{more}"))
}

#[test]
fn elements_that_slip_at_full_throttle_are_said_before_the_car_is_simulated() {
    let folder = Folder::new("slipping");
    let strong = car(&folder, "strong.toml", "[engine]\nmax_torque_n_m = 900\n");
    let weak = car(&folder, "weak.toml", "[hydraulics]\nline_pressure_pa = 0.4e6\n");
    for (vehicle, numbers, key) in [
        (&strong, "at 1.60 MPa: A holds 1190 N m, ", "900 N m (`engine.max_torque_n_m`)"),
        (&weak, "at 0.40 MPa: A holds 238 N m, ", "hold with `hydraulics.line_pressure_pa = "),
    ] {
        let text = said(&wetclutch(&["check", vehicle]));
        let start = format!("warning: closed elements slip at full throttle, {numbers}");
        assert!(text.contains(&start) && text.contains("\nhint: ") && text.contains(key), "{text}");
        assert_eq!(text.matches("slip at full throttle").count(), 1, "{text}");
    }
    let drive = "name = \"d\"\nvehicle = \"weak.toml\"\n[[segment]]\nduration_s = 0.2\nthrottle = 0\n";
    let (drive, out) = (folder.write("drive.toml", drive), folder.path("out"));
    let shipped = format!("{ROOT}vehicles/eight_speed.toml");
    for (arguments, is_said) in [
        (vec!["check", &drive], true),
        (vec!["simulate", &drive, "-o", &out], true),
        (vec!["simulate", &drive, "--vehicle", &strong, "-o", &out], true),
        (vec!["simulate", &drive, "--vehicle", &shipped, "-o", &out], false),
    ] {
        let text = said(&wetclutch(&arguments));
        assert_eq!(text.contains("warning: closed elements slip at full throttle"), is_said, "{arguments:?}: {text}");
    }
}

#[test]
fn check_of_a_car_prints_its_gears_capacities_and_shifts_and_draws_its_gearbox() {
    let folder = Folder::new("car-gears");
    let vehicle = car(&folder, "car.toml", "turbine_inertia_kg_m2 = { \"1-2\" = 0.09 }\n");
    let text = printed(&wetclutch(&["check", &vehicle, "-o", &folder.path("out")]));
    // A ratio with its step; the pressure and friction of this car with the torque of its engine; the inertia of its file.
    for part in ["2.1039  1.488", "C        clutch      6        582         278        1    2.09", "0.0900   0.0092"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(text.contains("278 N m in R, 1; 203 N m in 2, 3, 4, 5, 6, 7, 8"), "{text}");
    assert!(folder.read("out/train.svg").ends_with("</svg>") && folder.read("out/gear_8.svg").ends_with("</svg>"));
    // The car of one shift has no gearbox file.
    let message = refused(&wetclutch(&["check", VEHICLE, "-o", &folder.path("out")]));
    assert!(message.contains("only a gearbox is drawn") && message.contains("hint: leave -o out"), "{message}");
}
