//! Tables as apps and tuning tools export them.

use crate::common::{Folder, channel, read};
use logs::OpenOptions;

/// Times and values of a channel of a table, its unit, and what was said.
fn engine(text: &str, name: &str) -> (Vec<(f64, f64)>, String, Vec<String>) {
    let folder = Folder::new("apps");
    let (log, samples, notes) = read(&folder.write("log.csv", text), &OpenOptions::default()).unwrap();
    let unit = log.channels()[log.find(name, None).unwrap()].unit.clone();
    let values = channel(&log, &samples, name).into_iter().map(|(time_s, value, _)| (time_s, value));
    (values.filter(|(_, value)| value.is_finite()).collect(), unit, notes)
}

#[test]
fn a_table_of_car_scanner_has_a_reading_in_each_row() {
    let head = "\"SECONDS\";\"PID\";\"VALUE\";\"UNITS\";\n";
    let rows = "\"58216.5\";\"Engine RPM\";\"1500.5\";\"rpm\";\n\"58216.5\";\"Vehicle speed\";\"40\";\"km/h\";\n\
        \"58216.75\";\"Engine RPM\";\"1501.5\";\"rpm\";\n\"58217\";\"Gear\";\"P\";\"\";\n";
    let (values, unit, notes) = engine(&format!("{head}{rows}"), "Engine RPM");
    assert_eq!((values, &*unit), (vec![(58216.5, 1500.5), (58216.75, 1501.5)], "rpm"));
    assert_eq!(notes, ["1 of 4 rows are no readings and are left out, the first is line 5: `58217 Gear P  `"]);
    let (values, unit, _) = engine(&format!("{head}{rows}"), "Vehicle speed");
    assert_eq!((values, &*unit), (vec![(58216.5, 40.0)], "km/h"));
    // With places, between commas, with its last line cut.
    let with_places =
        "SECONDS,PID,VALUE,UNITS,LATITUDE,LONGTITUDE\n1.0,N,5,rpm,48.1,11.5\n1.5,N,6,rpm,48.1,11.5\n2.0,N,7";
    assert_eq!(engine(with_places, "N").0[..2], [(1.0, 5.0), (1.5, 6.0)]);
}

#[test]
fn a_channel_that_comes_late_and_rows_that_are_no_readings_are_said() {
    let folder = Folder::new("readings");
    let head = "SECONDS;PID;VALUE;UNITS\n";
    let rows: String = (0..10_000).map(|i| format!("{}.5;N;{i};rpm\n", i)).collect();
    let (_, _, notes) = engine(&format!("{head}{rows}10001;late;1;rpm\n"), "N");
    assert_eq!(notes, ["1 readings of 1 channels that are not in the first 64 KiB of the log are left out"]);
    let error =
        |text: &str| read(&folder.write("log.csv", text), &OpenOptions::default()).map(drop).unwrap_err().to_string();
    assert!(
        error(&format!("{head}x;N;1;rpm\ny;N;2;rpm\n")).contains("2 of 2 rows are no readings, line 2: `x N 1 rpm`")
    );
    assert!(error(&format!("{head};;;\n")).contains("1 of 1 rows are no readings"));
}

#[test]
fn times_of_apps_are_read() {
    // Torque: two times, of which the second has parts of seconds; `-` where nothing came.
    let torque = "GPS Time, Device Time, Longitude, Latitude,GPS Speed (Meters/second), Engine RPM(rpm), Speed (OBD)(km/h)\n\
        Wed Aug 05 18:57:50 GMT+01:00 2026,05-Aug-2026 18:57:56.000,-8.1,41.2,3.5,1500.5,40.0\n\
        Wed Aug 05 18:57:51 GMT+01:00 2026,05-Aug-2026 18:57:56.250,-8.1,41.2,-,-,40.0\n\
        Wed Aug 05 18:57:52 GMT+01:00 2026,05-Aug-2026 18:57:56.500,-8.1,41.2,3.5,1502.5,40.05\n";
    let (values, unit, _) = engine(torque, "Engine RPM");
    assert_eq!((values.len(), &*unit, values[1].0 - values[0].0), (2, "rpm", 0.5));
    // OBD Fusion: a line before the names.
    let fusion = "# StartTime = 03/18/2021 09:41:08.5510 AM\nTime (sec), Engine RPM (RPM), Vehicle speed (MPH)\n0.0,1500.5,40\n0.25,1501.5,41\n";
    let (values, unit, _) = engine(fusion, "Engine RPM");
    assert_eq!((values, &*unit), (vec![(0.0, 1500.5), (0.25, 1501.5)], "RPM"));
    // Date and time of the day in two columns.
    let two = "Date;Time;N_Eng [rpm]\n16.05.2024;18:16:50.000;1500.5\n16.05.2024;18:16:50.250;1501.5\n";
    assert_eq!(engine(two, "N_Eng").0.len(), 2);
    // A zone behind the time, and the date as Java writes it.
    let java = "GPS Time,N [rpm]\nWed Aug 05 18:57:50 GMT+01:00 2026,1500\nWed Aug 05 18:57:51 GMT+01:00 2026,1501\n";
    assert_eq!(engine(java, "N").0, [(1_785_952_670.0, 1500.0), (1_785_952_671.0, 1501.0)]);
}

#[test]
fn the_export_of_hp_tuners_is_read() {
    let text = "HP Tuners CSV Log File\nVersion: 1.0\n\n[Log Information]\nCreation Time: 1/1/2024 10:00:00 AM\nNotes: \n\n\
        [Channel Information]\n0,12,13\nOffset,Engine RPM (SAE),Vehicle Speed (SAE)\ns,rpm,mph\n\n[Channel Data]\n0.000,1500,40\n0.031,1501,\n0.062,1502,41\n";
    let (values, unit, notes) = engine(text, "Engine RPM (SAE)");
    assert_eq!((values, &*unit), (vec![(0.0, 1500.0), (0.031, 1501.0), (0.062, 1502.0)], "rpm"));
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!(engine(text, "Vehicle Speed (SAE)").0.len(), 2);
}

#[test]
fn a_third_row_of_titles_is_read_over() {
    let texts = [
        // Names, units, descriptions; a number of each channel above; types below.
        "Time;N_Eng;P_Clutch\ns;rpm;bar\nclock;crank shaft;clutch A\n0.00;1500;4.5\n0.01;1501;4.6\n",
        "1;2;3\nTime;N_Eng;P_Clutch\ns;rpm;bar\n0.00;1500;4.5\n0.01;1501;4.6\n",
        "Time;N_Eng;P_Clutch\ns;rpm;bar\ndouble;float;float\n0.00;1500;4.5\n0.01;1501;4.6\n",
        "Group;Engine;Gearbox\nTime;N_Eng;P_Clutch\ns;rpm;bar\n0.00;1500;4.5\n0.01;1501;4.6\n",
        "Time;N_Eng;P_Clutch\nclock;crank shaft;clutch A\ns;rpm;bar\n0.00;1500;4.5\n0.01;1501;4.6\n",
        "Time;N_Eng;P_Clutch\ns;rpm;bar\nTime since start;crank shaft;clutch A\n0.00;1500;4.5\n0.01;1501;4.6\n",
    ];
    for text in texts {
        let (values, unit, _) = engine(text, "N_Eng");
        assert_eq!((values, &*unit), (vec![(0.0, 1500.0), (0.01, 1501.0)], "rpm"), "{text}");
    }
}
