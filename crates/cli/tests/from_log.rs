//! What a log gives to a vehicle file: ratios, final ratio, engine torque, and the capacity of the converter.

use crate::support::{Folder, ROOT, printed, refused, said, stderr, wetclutch};

/// A drive of the four-speed car through its gears, its log, and a channel map for it.
fn drive(folder: &Folder) -> [String; 2] {
    let segments = "[[segment]]\nduration_s = 45\nthrottle = 0.35\n[[segment]]\nduration_s = 10\nthrottle = 0.1\n";
    let drive = folder.write("drive.toml", format!("name = \"d\"\n{segments}"));
    let car = format!("{ROOT}vehicles/four_speed.toml");
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
    let log = folder.path("sim/d_measured.csv");
    let map = folder.write("map.toml", printed(&wetclutch(&["inspect", &log, "--suggest"])));
    [log, map]
}

#[test]
fn init_takes_ratios_and_final_ratio_of_a_log_and_says_what_it_does_not_show() {
    let folder = Folder::new("from-log");
    let [log, map] = drive(&folder);
    let car = folder.path("car.toml");
    let init = |more: &[&str]| {
        wetclutch(&[&["init", "--from-log", &log, "--map", &map, "--mass-kg", "1500", "-o", &car], more].concat())
    };
    let radius = ["--wheel-radius-m", "0.3"];
    let text = said(&init(&radius));
    for part in
        ["gears of the log: 1 2.", "from the log: final ratio 3.", "engine torque ", "not in ", "mass, elements"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    // Those of the gearbox of the car, in the gears in which it was driven.
    let expected = [2.4, 1.47, 1.0, 0.67];
    let gearbox: toml::Table = toml::from_str(&folder.read("car_gearbox.toml")).unwrap();
    let gears = gearbox["gear"].as_array().unwrap();
    assert!(gears.len() >= 3, "{text}");
    for gear in gears {
        let (name, ratio) = (gear["name"].as_str().unwrap(), gear["ratio"].as_float().unwrap());
        let known = expected[name.parse::<usize>().unwrap() - 1];
        assert!((ratio / known - 1.0).abs() < 0.01, "{name}: {ratio}");
    }
    let vehicle: toml::Table = toml::from_str(&folder.read("car.toml")).unwrap();
    let final_ratio = vehicle["driveline"]["final_ratio"].as_float().unwrap();
    // As people write it.
    assert!((final_ratio / 3.0 - 1.0).abs() < 0.01 && final_ratio == config::significant(final_ratio), "{final_ratio}");
    assert!(wetclutch(&["check", &car]).status.success());
    // The capacity of the converter, at the speed ratios that the drive shows, is that of the car within its interval.
    assert!(text.contains("capacity of the converter") && !text.contains("is that of a usual one"), "{text}");
    let points = |key: &str| -> Vec<f64> {
        vehicle["converter"][key].as_array().unwrap().iter().map(|value| value.as_float().unwrap()).collect()
    };
    let known =
        config::CarFile::read(format!("{ROOT}vehicles/four_speed.toml").as_ref()).unwrap().car.converter.unwrap();
    for (ratio, capacity) in points("speed_ratio").into_iter().zip(points("capacity_n_m_s2")) {
        let expected = known.capacity_n_m_s2.at(ratio);
        assert!(
            !(0.7..0.9).contains(&ratio) || (capacity / expected - 1.0).abs() < 0.15,
            "{ratio}: {capacity} {expected}"
        );
    }
    // Of a gearbox whose ratios alone are known no command is used, and the map may have them.
    let suggested = folder.read("map.toml");
    assert!(
        suggested.contains("[channel.element_") && suggested.contains("\n# ratios = [2.399, 1.467, 1.001, 0.667]"),
        "{suggested}"
    );
    assert!(!suggested.contains("valid_range"), "{suggested}");
    // A value that means that there is none.
    let text = std::fs::read_to_string(&log).unwrap();
    let with_none = text.lines().enumerate().map(|(at, line)| {
        let (time, rest) = line.split_once(',').unwrap();
        let rest = rest.split_once(',').unwrap().1;
        if at == 700 { format!("{time},16383.5,{rest}\n") } else { format!("{line}\n") }
    });
    let with_none = folder.write("none.csv", with_none.collect::<String>());
    let suggested = printed(&wetclutch(&["inspect", &with_none, "--suggest"]));
    let line = "# [channel.engine_speed] has ";
    assert!(
        suggested.contains(line)
            && suggested.contains("16383.5; to leave out what no car has, add: valid_range = [-10, 1047]"),
        "{suggested}"
    );
    let estimate = wetclutch(&["estimate", &log, "--map", &map, "--vehicle", &car, "-o", &folder.path("out.csv")]);
    assert!(estimate.status.success(), "{}", stderr(&estimate));
    // What changes nothing is said.
    let all = ["--final-ratio", "3", "--engine-torque-n-m", "200", "--wheel-radius-m", "0.3"];
    let unused = |more: &[&str], words: &str| {
        let file = folder.path(&format!("{}.toml", words.replace([' ', '-', ':'], "_")));
        let given = [&["init", "--from-log", &log, "--map", &map, "--mass-kg", "1500", "-o", &file], &all[..], more];
        let text = said(&wetclutch(&given.concat()));
        assert!(text.contains(&format!("warning: {words}")), "{text}");
        std::fs::read_to_string(file).unwrap()
    };
    // The converter is one more number of the log.
    unused(&["--gearbox", "ravigneaux_4", "--launch", "clutch"], "--from-log has no effect: ");
    assert!(!unused(&["--stroke"], "--stroke has no effect: ").contains("[fill]"));
    // A file that is there stays, and what is missing is asked for.
    assert!(refused(&init(&["--wheel-radius-m", "0.31"])).contains("the file is there already"));
    let other = folder.path("other.toml");
    let output =
        |more: &[&str]| wetclutch(&[&["init", "--from-log", &log, "--mass-kg", "1500", "-o", &other], more].concat());
    assert!(refused(&output(&["--map", &map])).contains("hint: give it with --wheel-radius-m"));
    // A table with the names of the program needs no map.
    said(&output(&radius));
    let with_map = folder.read("other.toml");
    std::fs::remove_file(&other).unwrap();
    said(&output(&[&radius[..], &["--map", &map, "--force"]].concat()));
    assert!(folder.read("other.toml") == with_map && with_map.contains("[converter]\nspeed_ratio"));
    let renamed = folder.write("renamed.csv", text.replacen("turbine_speed_rad_s", "nT", 1));
    let refusal = refused(&wetclutch(&["init", "--from-log", &renamed, "--mass-kg", "1500", "-o", &other]));
    assert!(
        refusal.contains("needs the turbine and the output speed, and turbine_speed is not mapped\nhint: give --map"),
        "{refusal}"
    );
    let constant = folder.write(
        "constant.csv",
        (0..500)
            .map(|i| format!("{},100,50,20\n", 0.01 * f64::from(i)))
            .fold("time_s,turbine_speed_rad_s,output_speed_rad_s,wheel_speed_rad_s\n".to_owned(), |text, row| {
                text + &row
            }),
    );
    let channels = ["--channel", "turbine_speed=turbine_speed_rad_s", "--channel", "output_speed=output_speed_rad_s"];
    let one = wetclutch(
        &[
            &["init", "--from-log", &constant, "--mass-kg", "1500", "--final-ratio", "3", "-o", &other][..],
            &radius,
            &["--engine-torque-n-m", "200"],
            &channels,
        ]
        .concat(),
    );
    assert!(refused(&one).contains("not driven in two gears for long enough"), "{}", stderr(&one));
}

#[test]
fn a_vehicle_file_takes_the_converter_that_a_log_shows() {
    let folder = Folder::new("write-converter");
    let [log, map] = drive(&folder);
    let (out, page) = (folder.path("converter.toml"), folder.path("page.html"));
    let ratios = ["--shifts", "--ratios", "2.4,1.47,1,0.67"];
    let inspect = |more: &[&str]| wetclutch(&[&["inspect", &log, "--map", &map], &ratios[..], more].concat());
    let text = said(&inspect(&["--write-converter", &out, "-o", &page]));
    assert!(text.contains(&format!("converter: {out}")), "{text}");
    assert!(wetclutch(&["check", &out]).status.success());
    let found: toml::Table = toml::from_str(&folder.read("converter.toml")).unwrap();
    let list = |table: &toml::Table, key: &str| -> Vec<f64> {
        table["converter"][key].as_array().unwrap().iter().map(|value| value.as_float().unwrap()).collect()
    };
    let vehicle = std::fs::read_to_string(format!("{ROOT}vehicles/eight_speed.toml")).unwrap();
    let known: toml::Table = toml::from_str(&vehicle).unwrap();
    let at = |table: &toml::Table, ratio: f64| {
        let (axis, values) = (list(table, "speed_ratio"), list(table, "capacity_n_m_s2"));
        let after = axis.iter().position(|other| *other >= ratio).unwrap();
        let fraction = (ratio - axis[after - 1]) / (axis[after] - axis[after - 1]);
        values[after - 1] + fraction * (values[after] - values[after - 1])
    };
    for ratio in [0.7, 0.8, 0.85, 0.9] {
        assert!(
            (at(&found, ratio) / at(&known, ratio) - 1.0).abs() < 0.1,
            "{ratio}: {}",
            folder.read("converter.toml")
        );
    }
    // Only its own files are replaced, and without an engine torque there is none.
    said(&inspect(&["--write-converter", &out, "--json"]));
    assert!(refused(&inspect(&["--write-converter", &map])).contains("the output would replace this input"));
    let other = folder.write("notes.toml", "a = 1\n");
    assert!(refused(&inspect(&["--write-converter", &other])).contains("exists and is no table of a converter"));
    let speeds = std::fs::read_to_string(&map).unwrap().replace("[channel.engine_torque]", "[channel.oil_temperature]");
    let speeds = speeds.split("[channel.oil_temperature]").next().unwrap().to_owned();
    let map = folder.write("speeds.toml", speeds);
    let without = wetclutch(&[&["inspect", &log, "--map", &map], &ratios[..], &["--write-converter", &out]].concat());
    assert_eq!(without.status.code(), Some(1), "{}", stderr(&without));
    assert!(stderr(&without).contains("the converter cannot be fitted: no engine torque is mapped"));
}
