//! How the shifts of both calibrations of the controller feel, in every shipped gearbox.

use car::Car;
use config::CarFile;
use drivetrain::ShiftKind;
use plant::car::{CarCalibration, CarModel};
use study::gearbox::shift_bars::{Bar, Felt, drive};

const CARS: [&str; 6] = ["eight_speed", "six_speed", "four_speed", "four_speed_one_way", "ten_speed", "dual_clutch"];

/// Every shift between neighbouring gears of these kinds, with its name, by both calibrations: bench and comfort.
fn shifts(kind: ShiftKind) -> Vec<(String, [Felt; 2])> {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vehicles");
    let mut shifts = Vec::new();
    for name in CARS {
        let car: Car = CarFile::read(&root.join(format!("{name}.toml"))).unwrap().car;
        let model = CarModel::new(car.clone()).unwrap();
        for pair in car.gearbox.forward_gears().windows(2) {
            let is_up = matches!(kind, ShiftKind::PowerOnUp | ShiftKind::PowerOffUp);
            let gears = if is_up { [pair[0], pair[1]] } else { [pair[1], pair[0]] };
            let [from, to] = gears.map(|gear| car.gearbox.gears[gear].name.as_str());
            let calibrations = [CarCalibration::STANDARD, CarCalibration::COMFORT];
            let felt = calibrations.map(|calibration| drive(&model, &car, calibration, kind, gears).unwrap());
            shifts.push((format!("{name} {from}-{to}"), felt));
        }
    }
    shifts
}

#[test]
fn a_comfortable_shift_is_beyond_a_bar_only_where_a_short_one_is_too() {
    for kind in ShiftKind::ALL {
        let shifts = shifts(kind);
        for bar in Bar::of(kind) {
            let met = |which: usize| shifts.iter().filter(|(_, felt)| bar.is_met(&felt[which])).count();
            println!("{}, {}: {} and {} of {}", kind.name(), bar.name, met(0), met(1), shifts.len());
            for (name, [bench, comfort]) in &shifts {
                let values = [bench, comfort].map(|felt| (bar.value)(felt));
                assert!(bar.is_met(comfort) || !bar.is_met(bench), "{name}, {}, {}: {values:?}", kind.name(), bar.name);
            }
        }
    }
}

#[test]
fn a_comfortable_shift_is_within_all_bars_in_nine_of_ten_cases() {
    let within = |felt: &Felt| Bar::of(felt.kind).iter().all(|bar| bar.is_met(felt));
    let all: Vec<_> = ShiftKind::ALL.into_iter().flat_map(shifts).collect();
    let counts = [0, 1].map(|which| all.iter().filter(|(_, felt)| within(&felt[which])).count());
    println!("{counts:?} of {}", all.len());
    assert!(10 * counts[1] > 9 * all.len() && 2 * counts[0] < all.len() + 5, "{counts:?} of {}", all.len());
}

#[test]
fn a_coast_downshift_takes_no_step_of_the_deceleration() {
    for (name, [bench, comfort]) in shifts(ShiftKind::CoastDown) {
        let step = |felt: &Felt| felt.comfort.beyond_m_s2.into_iter().fold(0.0, f64::max);
        let [bench, comfort] = [bench, comfort].map(|felt| step(&felt));
        assert!(comfort < 0.6 && comfort < bench.max(0.3), "{name}: {bench} and {comfort} m/s^2");
    }
}
