//! A gearbox with a layshaft behind one clutch: what is said of it, as only dogs change between its gears.

use crate::support::{Folder, ROOT, printed, refused, said, wetclutch};

/// One clutch, three gears; `pairs` is the rest of the table.
fn gearbox(shafts: &str, to: &str, output: &str) -> String {
    let pair = |driver: u32, driven: u32, dog: u32| {
        format!(
            "{{ driver = \"in1\", driven = \"{to}\", driver_teeth = {driver}, driven_teeth = {driven}, dog = \"D{dog}\" }}"
        )
    };
    format!(
        "name = \"layshaft\"\nlevel = \"stick-diagram\"\ninput = \"in\"\noutput = \"out\"\nline_pressure_pa = 1.6e6\n\
         gear = [{{ name = \"1\", engaged = [\"K\", \"D1\"] }}, {{ name = \"2\", engaged = [\"K\", \"D2\"] }}]\n\
         shaft = [{{ name = \"in\", inertia_kg_m2 = 0.066 }}, {{ name = \"in1\", inertia_kg_m2 = 0.01 }}, {shafts}\
         {{ name = \"out\", inertia_kg_m2 = 0.15 }}]\n\
         gear_pair = [{}, {}{output}]\n\
         [[element]]\nname = \"K\"\nkind = \"clutch\"\ninput = \"in\"\noutput = \"in1\"\n\
         pack = {{ friction_faces = 4, mean_radius_m = 0.09, piston_area_m2 = 0.007, return_spring_n = 800, friction_coefficient = 0.12 }}\n",
        pair(11, 38, 1),
        pair(21, 43, 2)
    )
}

const CAR: &str = "name = \"car\"\ngearbox = \"box.toml\"\nlaunch = \"clutch\"\n[engine]\nmax_torque_n_m = 150.0\n\
    [driveline]\nfinal_ratio = 1.0\n[vehicle]\nmass_kg = 1200.0\nwheel_radius_m = 0.3\n";

#[test]
fn a_gearbox_without_a_forward_gear_is_refused_where_it_is_read() {
    let folder = Folder::new("backwards");
    let one_mesh = gearbox("", "out", "");
    let (file, car) = (folder.write("box.toml", &one_mesh), folder.write("car.toml", CAR));
    let new = folder.path("new.toml");
    let init = [
        "init",
        "--gearbox",
        &file,
        "--mass-kg",
        "1200",
        "--wheel-radius-m",
        "0.3",
        "--final-ratio",
        "3.9",
        "--engine-torque-n-m",
        "150",
        "-o",
        &new,
    ];
    for command in [&["check", &file][..], &["check", &car], &init] {
        let error = refused(&wetclutch(command));
        assert!(
            error.contains("no forward gear") && error.contains("hint: ") && error.contains("`idler = true`"),
            "{error}"
        );
    }
    assert_eq!(folder.names(), ["box.toml", "car.toml"]);
    let with_idlers = one_mesh.replace(", dog = ", ", idler = true, dog = ");
    folder.write("box.toml", with_idlers);
    assert!(printed(&wetclutch(&["check", &file])).contains("3.4545"));
}

#[test]
fn a_car_behind_one_clutch_says_that_only_dogs_change_between_its_gears() {
    let folder = Folder::new("one-clutch");
    let output = ", { driver = \"lay\", driven = \"out\", driver_teeth = 17, driven_teeth = 66 }";
    folder.write("box.toml", gearbox("{ name = \"lay\", inertia_kg_m2 = 0.02 },", "lay", output));
    let car = folder.write("car.toml", CAR);
    let why = "only dogs change between the gears of this gearbox";
    let warned = said(&wetclutch(&["check", &car]));
    assert!(warned.contains(&format!("warning: {why}")), "{warned}");
    let (drive, out) = (format!("{ROOT}drives/city.toml"), folder.path("out"));
    for command in [
        &["simulate", &drive, "--vehicle", &car, "-o", &out][..],
        &["sensitivity", &car],
        &["bench", "--vehicle", &car],
        &["demo", "--vehicle", &car, "-o", &out],
    ] {
        let error = refused(&wetclutch(command));
        assert!(error.contains(why) && error.contains("hint: ") && !error.contains("need plates"), "{error}");
    }
    // One whose clutches hand over says nothing of it.
    assert!(!said(&wetclutch(&["check", &format!("{ROOT}vehicles/dual_clutch.toml")])).contains(why));
}
