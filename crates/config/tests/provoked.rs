//! Errors of files that no other test provokes: each with its cause, and what is said.

use car::{Car, CarSize};

use crate::common::{EXPERIMENT, STUDY, VEHICLE};
use config::{CarFile, CarStudy, ConfigError, DriveFile, ExperimentFile, GearboxFile, Source, Study, VehicleFile};

const CAR: &str = include_str!("../../../vehicles/eight_speed.toml");
const GEARBOX: &str = include_str!("../../../gearboxes/8hp.toml");
const SHARES: &str = include_str!("gearboxes/shares.toml");
const DRIVE: &str = "name = \"d\"\n[[segment]]\nduration_s = 3\nthrottle = 0.1\n";
/// A study of cars, in this folder's place.
const CAR_STUDY: &str = concat!(
    "name = \"s\"\ntitle = \"S\"\nvehicle = '",
    env!("CARGO_MANIFEST_DIR"),
    "/../../vehicles/eight_speed.toml'\nshifts = [\"1-2\"]\nruns = 3\n"
);

/// Replaces a text of a file that must be in it.
fn with(text: &str, old: &str, new: &str) -> String {
    assert!(text.contains(old), "{old}");
    text.replacen(old, new, 1)
}

/// What is said of each file that comes from this one by a replacement.
fn says<T>(file: &str, read: fn(Source) -> Result<T, ConfigError>, cases: &[(&str, &str, &str)]) {
    for (old, new, words) in cases {
        let source = Source::built_in("file.toml", &with(file, old, new));
        let text = read(source).err().unwrap_or_else(|| panic!("{new} is accepted")).to_string();
        assert!(text.starts_with("file.toml:") && text.contains(words), "{new}: {text}");
    }
}

#[test]
fn vehicle_files_of_one_shift() {
    let sets = "carrier = \"carrier\"\nsun_teeth = 40  # [chapter]\nring_teeth = 60";
    says(
        VEHICLE,
        VehicleFile::from_source,
        &[
            (
                "name = \"ring\"\ninertia",
                "name = \"housing\"\ninertia",
                "\"housing\" is the gearbox housing, which does not rotate",
            ),
            (sets, &with(sets, "60", "30"), "is 30, but the sun inside the ring has 40 teeth"),
            (
                "[[gear_train.planetary_set]]",
                "[[gear_train.shaft]]\nname = \"loose\"\ninertia_kg_m2 = 0.1\n[[gear_train.planetary_set]]",
                "leave 3 degrees of freedom, but a shift needs exactly 2",
            ),
            ("  [-22.7, 60, 105, 132, 133, 134, 136, 138, 141],\n", "", "11 rows of torque for 12 speeds"),
            (
                "offset_max_pa = 0.04e6",
                "offset_max_pa = 0.04e6\nerror_matrix = [[1.0]]",
                "expected 3 rows of up to 3 numbers, one row for each output",
            ),
            (
                "preload_pressure_pa = [42e3, 48e3]",
                "preload_pressure_pa = [42e3, 68e3]",
                "Pa is above `kiss_pressure_pa`, [57000.0, 63000.0] Pa",
            ),
        ],
    );
}

#[test]
fn vehicle_files_with_a_gearbox() {
    let read = |source| CarFile::from_sources(source, Source::built_in("8hp.toml", GEARBOX));
    let lock_up = "[lock_up]\ncapacity_n_m = 300\nfirst_gear = \"3\"\non_input_rad_s = 130\noff_input_rad_s = 140\nramp_s = 0.5\n[oil]";
    let bounds = "[clutch.A.error_bounds]\nduty_percent = 1\n[oil]";
    let delay = "[clutch.A.error_bounds]\nvalve_delay_s = [0.001, 0.002]\n[oil]";
    says(
        CAR,
        read,
        &[
            ("[oil]", lock_up, "is 140, not below `on_input_rad_s`, 130"),
            ("[oil]", bounds, "the valve of this element has no such command; its bound is `current_a`"),
            ("[oil]", delay, "does not contain the delay of the valve in this file, 0 s to 0.03 s by the command"),
            ("static_factor = 1.08", "static_factor = 0.9", "is 0.9, less than `factor` at zero slip, 1"),
            (
                "[oil]",
                "[turbine_inertia_kg_m2]\n\"7-8\" = 0.0001\n[oil]",
                "is 0.0001 kg m2, with which speeds could change without energy",
            ),
            ("line_pressure_pa = 1.6e6", "line_pressure_pa = 1e5", "and the return spring of "),
        ],
    );
}

#[test]
fn drives_and_experiments() {
    let trace = "[trace]\nfile = \"speeds.csv\"\n[[segment]]";
    let plans = "[schedule]\nthrottle = [0, 1]\nup_input_rad_s = [200, 500]\ndown_input_rad_s = [100, 200]\n[[shift]]\ntime_s = 1\ngear = \"2\"\n[[segment]]";
    says(
        DRIVE,
        DriveFile::from_source,
        &[
            ("[[segment]]", trace, "expected either [[segment]] or [trace]"),
            ("[[segment]]", plans, "the drive has both [schedule] and [[shift]]"),
        ],
    );
    let unnamed = DriveFile::from_source(Source::built_in("d.toml", DRIVE)).unwrap().read_vehicle().unwrap_err();
    assert!(unnamed.to_string().contains("names no vehicle file\nhint: vehicle = "), "{unnamed}");
    let points = (0..24).map(|at| format!("{at}.0, ")).collect::<String>();
    let throttle = format!("time_s = [{points}]\nposition = [{}]", "0.2, ".repeat(24));
    let gains = "torque_phase_normalised = [[-2.08, 30.49], [-6.46, -152.48]]";
    says(
        EXPERIMENT,
        ExperimentFile::from_source,
        &[
            (
                "time_s = [0.0, 0.3, 0.9]\nposition = [0.05, 0.05, 0.22]",
                &throttle,
                "points to the 24 of the throttle\nhint: a profile has at most 24 points",
            ),
            (gains, "torque_phase_normalised = [[-2.08, 30.49]]", "has 1 rows, expected 2"),
            (gains, "torque_phase_normalised = [[-2.08, 30.49, 1], [1, 2]]", "has 3 numbers, expected 2"),
            (
                "[scenario.sensors]\n",
                "[scenario.sensors]\nseed = 3\n",
                "every scenario draws from the seed of the [sensors] table",
            ),
        ],
    );
}

#[test]
fn scenarios_with_one_name() {
    let scenario = "\n[[scenario]]\nname = \"one name\"\n";
    let source = Source::built_in("file.toml", &[EXPERIMENT, scenario, scenario].concat());
    let text = ExperimentFile::from_source(source).unwrap_err().to_string();
    assert!(text.contains("\"one name\" and \"one name\" would have the same files\nhint: give one"), "{text}");
}

#[test]
fn sizes_of_a_car() {
    let gearbox = GearboxFile::from_source(Source::built_in("8hp.toml", GEARBOX)).unwrap().gearbox;
    let error = Car::of_size(gearbox, &CarSize { mass_kg: -1.0, ..CarSize::of_mass(1500.0) }).unwrap_err();
    assert_eq!(error.to_string(), "`mass_kg` is -1, expected a number above zero");
}

#[test]
fn gearboxes_by_their_shares() {
    let gears = "gears = [\"1\", \"2\"]";
    says(
        SHARES,
        GearboxFile::from_source,
        &[(gears, "gears = [\"1\"]", "has 1 names, expected the two gears of a shift")],
    );
}

#[test]
fn studies() {
    let runs = "runs = 40";
    let plan = "plan = \"latin-hypercube\"\nruns = 40";
    let mass = "key = \"car.vehicle.mass_kg\"";
    let levels = "levels = 4";
    let factor = |at: u32| {
        format!("\n[[factor]]\nkey = \"car.vehicle.mass_kg\"\nname = \"m{at}\"\nrange = [1300, 2000]\nlevels = 1000")
    };
    let factors: String = (0..4).map(factor).collect();
    says(
        STUDY,
        Study::from_source,
        &[
            (runs, "", "the plan latin-hypercube needs a number of runs"),
            (runs, "runs = 0", "0 is not between 1 and 1000000000"),
            (
                plan,
                "plan = \"full-factorial\"\nruns = 40",
                "the number of runs of a full factorial plan follows from its levels",
            ),
            (plan, "plan = \"saltelli\"\nruns = 41", "factors a Saltelli plan has a multiple of "),
            (mass, "key = \"car\"", "the key is a whole file, expected the key of a number"),
            (mass, "name = \"noise\"\nkey = \"car.vehicle.mass_kg\"", "two factors have the name `noise`"),
            (levels, "levels = 1", "`levels` must be 2 to 1000"),
            (levels, "chance = 0.5", "a factor with a `chance` needs its value in the other runs, `otherwise`"),
            (levels, "otherwise = 1500", "`otherwise` is for a factor with a `chance`"),
        ],
    );
    let full = with(STUDY, plan, "plan = \"full-factorial\"");
    let many = Source::built_in("file.toml", &with(&full, levels, &factors));
    let text = Study::from_source(many).unwrap_err().to_string();
    assert!(text.contains("the levels have more than 1000000000 combinations"), "{text}");
    says(
        CAR_STUDY,
        CarStudy::from_source,
        &[
            ("[\"1-2\"]", "\"all\"", "`all` is unknown\nhint: \"neighbouring\", or a list of shifts"),
            ("[\"1-2\"]", "[]", "there is no shift\nhint: name at least one, such as \"1-2\""),
            ("runs = 3", "runs = 1979-05-27", "date or time"),
        ],
    );
}
