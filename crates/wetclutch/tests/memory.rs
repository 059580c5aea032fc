//! A drive that stays in memory.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use wetclutch::{
    EstimateOptions, LogInput, Simulation, Table, TemplateNumbers, Values, VehicleFile, estimate, gearboxes, score,
    simulate,
};

fn root(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file)
}

/// The first minutes of a drive.
fn driven(vehicle: &VehicleFile) -> Simulation {
    let mut drive = wetclutch::read_drive(&root("drives/city.toml"), None).unwrap();
    drive.repetitions = 1;
    drive.segments.truncate(8);
    simulate(vehicle.car().unwrap(), &drive).unwrap()
}

#[test]
fn a_car_of_a_few_numbers_is_driven_estimated_and_scored() {
    let vehicle = VehicleFile::template("8hp", &TemplateNumbers::of_mass(1900.0)).unwrap();
    let Simulation { truth, measured, summary } = driven(&vehicle);
    assert!(summary.shifts > 2 && measured.column("oncoming_pressure_pa").is_none());
    let measured = Arc::new(measured);
    let options = EstimateOptions { with_page: true, ..EstimateOptions::default() };
    let found = estimate(&vehicle, LogInput::of_table("the drive", &measured), &options).unwrap();
    assert_eq!((found.rows.len(), found.rows.numbers("time_s")), (measured.len(), measured.numbers("time_s")));
    assert!(found.shifts.len() > 2 && found.page.is_some_and(|page| page.contains("the drive")));
    let scores = score(&truth, &found.rows).unwrap();
    assert_eq!(scores.outside, 0, "{scores}");
    let inertia = scores.phases.iter().filter(|score| score.phase == "inertia phase" && score.rows > 20);
    assert!(inertia.clone().count() > 0);
    for score in inertia {
        // The valves are those of the file: both errors are those of the readings.
        assert!(score.torque_n_m.iter().all(|error| error.is_finite()), "{score:?}");
    }
    let error = score(&found.rows, &truth).unwrap_err().to_string();
    assert!(error.starts_with("the truth has no column `offgoing_pressure_pa` of numbers\nhint: "), "{error}");
    let error = VehicleFile::template("9hp", &TemplateNumbers::of_mass(1900.0)).map(|_| ()).unwrap_err().to_string();
    assert!(error.starts_with("gearbox: there is no `9hp`\nhint: the gearboxes are "), "{error}");
}

#[test]
fn a_table_in_memory_and_a_file_of_it_give_the_same_estimate() {
    let vehicle = VehicleFile::read(&root("vehicles/six_speed.toml")).unwrap();
    let measured = Arc::new(driven(&vehicle).measured);
    let options = EstimateOptions::default();
    let in_memory = estimate(&vehicle, LogInput::of_table("log.csv", &measured), &options).unwrap();
    let folder = std::env::temp_dir().join(format!("wetclutch-memory-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("log.csv");
    std::fs::write(&path, text_of(&measured)).unwrap();
    let input = LogInput { path: &path, memory: None, map: &logs::ChannelMap::default() };
    let from_file = estimate(&vehicle, input, &options).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_same(&in_memory.rows, &from_file.rows);
    assert_same(&in_memory.shifts, &from_file.shifts);
}

/// That two tables have the same bits.
fn assert_same(one: &Table, other: &Table) {
    assert_eq!(one.columns.len(), other.columns.len());
    for (one, other) in one.columns.iter().zip(&other.columns) {
        assert_eq!(one.name, other.name);
        match (&one.values, &other.values) {
            (Values::Numbers(one_s), Values::Numbers(other_s)) => {
                let bits = |numbers: &[f64]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(one_s), bits(other_s), "{}", one.name);
            }
            (one_s, other_s) => assert_eq!(one_s, other_s, "{}", one.name),
        }
    }
}

fn text_of(table: &Table) -> String {
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..table.len() {
        let cells = table.columns.iter().map(|column| match &column.values {
            Values::Numbers(numbers) if numbers[row].is_nan() => String::new(),
            Values::Numbers(numbers) => format!("{}", numbers[row]),
            Values::Words(words) => words.get(row).unwrap_or_default().to_owned(),
        });
        text += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

#[test]
fn every_gearbox_has_a_template_whose_texts_make_it_again() {
    for gearbox in gearboxes() {
        let vehicle = VehicleFile::template(gearbox, &TemplateNumbers::of_mass(1500.0)).unwrap();
        let again = VehicleFile::from_texts(vehicle.name(), vehicle.text(), vehicle.gearbox_text()).unwrap();
        assert_eq!(again, vehicle, "{gearbox}");
    }
    let error = VehicleFile::template("9hp", &TemplateNumbers::of_mass(1500.0)).unwrap_err();
    assert!(error.hint().is_some_and(|hint| hint.contains("8hp")));
    assert!(VehicleFile::template("8hp", &TemplateNumbers::of_mass(f64::NAN)).is_err());
}

#[test]
fn an_estimate_that_is_interrupted_is_an_error() {
    let vehicle = VehicleFile::read(&root("vehicles/six_speed.toml")).unwrap();
    let measured = Arc::new(driven(&vehicle).measured);
    let interrupt = Some(Arc::new(AtomicBool::new(true)));
    let options = EstimateOptions { interrupt, ..EstimateOptions::default() };
    let error = estimate(&vehicle, LogInput::of_table("log", &measured), &options).unwrap_err();
    assert_eq!(error.to_string(), "interrupted");
}
