//! `--page` of `check`, `design` and `fit`, and the page of a study of cars.

use crate::support::{Folder, ROOT, VEHICLE, printed, refused, said, wetclutch};

/// The page that a command writes.
fn page(command: &[&str]) -> String {
    let folder = Folder::new("page");
    let place = folder.path("page.html");
    let message = said(&wetclutch(&[command, &["--page", &place]].concat()));
    assert!(message.contains("page: "), "{message}");
    folder.read("page.html")
}

#[test]
fn a_checked_gearbox_is_a_page_with_its_drawings() {
    let html = page(&["check", &format!("{ROOT}vehicles/eight_speed.toml")]);
    // The train, eight gears and reverse.
    assert_eq!(html.matches("<div role=\"img\"").count(), 10);
    assert!(html.contains("<th scope=\"col\">ratio</th>") && html.contains("eight_speed.toml"));
}

#[test]
fn a_checked_vehicle_of_one_shift_is_a_page_with_its_maps() {
    let html = page(&["check", VEHICLE]);
    assert_eq!(html.matches("<div class=\"figure\">").count(), 4);
}

#[test]
fn a_design_is_a_page_with_the_bound_over_the_settling_time() {
    for observer in ["rigid", "compliant"] {
        let html = page(&["design", VEHICLE, "--observer", observer]);
        assert_eq!(html.matches("<div class=\"figure\">").count(), 2, "{observer}");
        for words in ["steady-state bound (MPa)", "\"open loop\"", "decay of the error (1/s)", "settling time (s)"] {
            assert!(html.contains(words), "{observer}: {words}");
        }
    }
    let sliding = page(&["design", VEHICLE, "--observer", "sliding"]);
    assert!(!sliding.contains("<div class=\"figure\">") && sliding.contains("<pre"));
}

#[test]
fn a_study_of_cars_is_a_page_with_the_errors_of_each_kind() {
    let folder = Folder::new("car-study-page");
    let study = format!(
        "name = \"s\"\ntitle = \"<b>cars\"\nvehicle = '{ROOT}vehicles/four_speed.toml'\nshifts = \"neighbouring\"\nruns = 1\n"
    );
    let study = folder.write("study.toml", study);
    let text = printed(&wetclutch(&["study", &study, "-o", &folder.path("out")]));
    assert!(text.contains(&format!("page: {}", folder.path("out/study.html"))), "{text}");
    let html = folder.read("out/study.html");
    assert!(
        html.contains("Kinds of shift") && html.contains("power-on upshift") && !html.contains("<b>cars"),
        "{html}"
    );
    assert!(html.contains("1 cars, 12 shifts, 0 cars failed"), "{html}");
}

#[test]
fn a_page_replaces_no_other_file_and_belongs_to_one_result() {
    let folder = Folder::new("no-page");
    let log = folder.write("log.csv", "time_s,engine_speed_rad_s\n0,1\n");
    let vehicle = folder.write("vehicle.toml", std::fs::read_to_string(VEHICLE).unwrap());
    assert!(refused(&wetclutch(&["check", &vehicle, "--page", &log])).contains("exists and is no page in HTML"));
    assert!(refused(&wetclutch(&["check", &vehicle, "--page", &vehicle])).contains("would replace this input"));
    let place = folder.path("page.html");
    assert!(refused(&wetclutch(&["check", &vehicle, &vehicle, "--page", &place])).contains("--page takes one file"));
    let drive = format!("{ROOT}drives/city.toml");
    assert!(refused(&wetclutch(&["check", &drive, "--page", &place])).contains("only gearboxes and vehicles"));
    let car = format!("{ROOT}vehicles/eight_speed.toml");
    assert!(refused(&wetclutch(&["design", &car, "--page", &place])).contains("--shift"));
    assert!(refused(&wetclutch(&["check", &vehicle, "--open"])).contains("--page"));
    assert!(printed(&wetclutch(&["check", &vehicle])).contains("vehicle"));
    assert!(!std::path::Path::new(&place).exists());
}
