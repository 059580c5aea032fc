//! Fits of cars with a whole gearbox to drives behind sensors.
mod channels;
mod drawn;
mod driving;
mod estimated;
mod pressures;

use std::ops::ControlFlow::Continue;
use std::path::Path;

use car::{Car, CarErrorBounds};
use car::{ErrorBudget, Gear, ShiftCommand};
use config::{CarFile, Source};
use drawn::{Case, Drawn, FittedFile as _, car, city, every_fifth, hilly, tables};
use fit::gearbox::{Driving, GearboxFit, Quantity, Recorder, ShiftLog, fit};
use fit::{ReadingAges, Verdict};
use observer::Reading;
use observer::element_uncertainty;
use observer::gearbox::{ElementUncertainty, ShiftInput};

fn fitted(drawn: &Drawn, shifts: &[ShiftLog]) -> GearboxFit {
    fit(&drawn.file, &drawn.tables(), shifts, &Driving::default(), &mut |_| Continue(())).unwrap()
}

/// The rows of a drive of a drawn car as its file's filter is shown them.
fn rows(drawn: &Drawn, drive: u32) -> Vec<(f64, ShiftInput<f64>)> {
    let mut rows = Vec::new();
    drawn.each_row(&city(drive), |_| (), |time_s, input| rows.push((time_s, *input)));
    rows
}

/// The fit of rows, and how many shifts were left out.
fn fit_of_rows(drawn: &Drawn, rows: &[(f64, ShiftInput<f64>)]) -> (GearboxFit, usize) {
    let tables = drawn.tables();
    let mut recorder = Recorder::new(&drawn.file, &tables, ReadingAges::of(&drawn::sensors()));
    rows.iter().for_each(|(time_s, input)| recorder.push(*time_s, input));
    let recorded = recorder.finish();
    (fitted(drawn, &recorded.shifts), recorded.skipped.len())
}

/// Fraction of the true values that lie in their stated intervals.
fn held(drawn: &Drawn, fit: &GearboxFit) -> f64 {
    let tables = drawn.tables();
    let known: Vec<Quantity> = fit
        .quantities
        .all
        .iter()
        .copied()
        .filter(|quantity| !matches!(quantity, Quantity::Drag(_) | Quantity::Gain(_)))
        .collect();
    let inside = known.iter().filter(|quantity| {
        let truth = drawn.true_unknown(&tables, &fit.quantities, **quantity);
        (fit.unknown(**quantity) - truth).abs() <= 1.96 * fit.sd(**quantity)
    });
    inside.count() as f64 / known.len() as f64
}

#[test]
fn fitted_files_of_drawn_cars_have_smaller_torque_errors_on_shifts_that_were_held_out() {
    // The second has neither converter nor planetary gears.
    for (vehicle, seed) in [("eight_speed.toml", 1), ("dual_clutch.toml", 2)] {
        let drawn = Drawn::of(car(vehicle), seed, Case::Usual);
        let (recorded, truth) = drawn.driven(&city(2));
        let [fitted_shifts, held_out] = every_fifth(recorded.shifts);
        assert!(fitted_shifts.len() >= 20, "{vehicle}: {}", fitted_shifts.len());
        let fit = fitted(&drawn, &fitted_shifts);
        let file = fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap();
        let [given, found] = [&drawn.file, &file].map(|car| truth.squared_error(car, &held_out).sqrt());
        assert!(found < 0.6 * given, "{vehicle}: {given} {found}");
        let fraction = held(&drawn, &fit);
        assert!(fraction > 0.85, "{vehicle}: {fraction}");
        let checked = fit.validate((&drawn.file, &drawn.tables()), (&file, &tables(&file)), &held_out).unwrap();
        let [given, fitted] = checked.turbine_rad_s.map(|error| error.value);
        assert!(fitted < given && 2 * checked.better > checked.shifts, "{checked:?}");
        assert!(fit.is_converged && fit.at_limit.is_empty() && fit.torque_misfit < 2.0, "{}", fit.torque_misfit);
    }
}

#[test]
fn the_fitted_file_keeps_the_text_and_has_the_values_of_the_fit() {
    let drawn = Drawn::of(car("eight_speed.toml"), 3, Case::Usual);
    let (recorded, _) = drawn.driven(&city(1));
    let fit = fitted(&drawn, &recorded.shifts);
    let file = fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap();
    let text = &file.source.text;
    // Every line of the given file that has no fitted value stands in the new one.
    let changed = ["capacity_n_m_s2", "torque_ratio", "4.3976e-3", "2.0482e-3", "2.00, 1.88", "]"];
    let kept = drawn.file.source.text.lines().filter(|line| !changed.iter().any(|word| line.contains(word)));
    kept.for_each(|line| assert!(text.lines().any(|other| other == line), "{line}"));
    assert!(text.contains("[turbine_inertia_kg_m2]\n# fit: x "), "{text}");
    let at = (0..drawn.file.clutches.len()).find(|at| drawn.file.gearbox.elements[*at].name == "E").unwrap();
    let place = drawn.tables().place(at).unwrap();
    let [before, after] = [&drawn.file, &file].map(|car| car.clutches[at].unwrap().clutch);
    let factor = fit.unknown(Quantity::Torque(place)).exp();
    assert!((after.friction.at(50.0) / before.friction.at(50.0) / factor - 1.0).abs() < 1e-3);
    let kiss_pa = before.kiss_pressure() + 1e4 * fit.unknown(Quantity::Kiss(place));
    assert!((after.kiss_pressure() - kiss_pa).abs() < 50.0);
    // A fit to the same shifts from the fitted file has nothing to change beyond what the logs leave open.
    let again =
        fit::gearbox::fit(&file, &tables(&file), &recorded.shifts, &Driving::default(), &mut |_| Continue(())).unwrap();
    let torque = Quantity::Torque(place);
    assert!(again.unknown(torque).abs() < fit.sd(torque), "{} {}", again.unknown(torque), fit.sd(torque));
    let twice = again.vehicle_file(&file, &file.source.path, "a drive", None).unwrap().source.text;
    assert_eq!(twice.matches("[clutch.E]").count(), 1, "{twice}");
    // In another folder the gearbox file is named anew.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fitted.toml");
    let moved = fit.vehicle_file(&drawn.file, &folder, "a drive", None).unwrap();
    std::fs::write(&folder, &moved.source.text).unwrap();
    assert_eq!(CarFile::read(&folder).unwrap().clutches, moved.clutches);
}

#[test]
fn outliers_and_lost_readings_leave_the_values_within_their_intervals() {
    let drawn = Drawn::of(car("eight_speed.toml"), 4, Case::Usual);
    let mut rows = rows(&drawn, 1);
    let (clean, skipped) = fit_of_rows(&drawn, &rows);
    let is = |row: usize, every: usize| row.wrapping_mul(2_654_435_761).is_multiple_of(every);
    for (at, (_, input)) in rows.iter_mut().enumerate() {
        if is(at, 50) {
            let wrong = |reading: Reading<f64>| Reading { value: reading.value + 5.0, ..reading };
            input.turbine_rad_s = input.turbine_rad_s.map(wrong);
        }
        if is(at + 7, 20) {
            (input.turbine_rad_s, input.engine_rad_s) = (None, None);
        }
        if is(at + 3, 1000) {
            input.output_rad_s = Some(Reading::now(f64::NAN));
            input.commands[0] = Some(Reading::now(f64::INFINITY));
        }
    }
    let (faulty, more_skipped) = fit_of_rows(&drawn, &rows);
    assert!(faulty.is_converged && more_skipped <= skipped + 2, "{skipped} {more_skipped}");
    for quantity in &clean.quantities.all {
        let moved = faulty.unknown(*quantity) - clean.unknown(*quantity);
        assert!(moved.abs() <= 2.0 * clean.sd(*quantity), "{quantity:?}: {moved} of {}", clean.sd(*quantity));
    }
    assert!(held(&drawn, &faulty) > 0.8, "{}", held(&drawn, &faulty));
}

#[test]
fn one_shift_tells_little_and_says_so() {
    let drawn = Drawn::of(car("eight_speed.toml"), 5, Case::Usual);
    let (recorded, _) = drawn.driven(&city(1));
    let fit = fitted(&drawn, &recorded.shifts[..1]);
    let before = |place: usize| fit.quantities.sd_before(place);
    // It passes through some pressures, which may tell a kiss point or a lag, and no torque for itself.
    let is_torque =
        |quantity: &Quantity| matches!(quantity, Quantity::Input | Quantity::Torque(_) | Quantity::Inertia(_));
    let identifiable = fit
        .quantities
        .all
        .iter()
        .filter(|quantity| is_torque(quantity) && fit.verdict(**quantity) == Verdict::Measured);
    assert_eq!(identifiable.count(), 0);
    assert!(held(&drawn, &fit) > 0.9, "{}", held(&drawn, &fit));
    for (place, quantity) in fit.quantities.all.iter().enumerate() {
        assert!(fit.sd(*quantity) <= 1.000_001 * before(place), "{quantity:?}");
    }
    let said = fit.statements().join("\n");
    for words in
        ["one shift only", "torque scale: not identified", "no fitted shift uses", "drive shifts between gears"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(fit.report().iter().all(|row| !row.name.starts_with("B:")), "{:?}", fit.report());
    let mut twice = recorded.clone();
    twice.add(recorded.clone());
    assert_eq!(twice.shifts, recorded.shifts);
    assert_eq!(twice.skipped.len(), 2 * recorded.skipped.len() + recorded.shifts.len());
    let none = fit::gearbox::fit(&drawn.file, &drawn.tables(), &[], &recorded.driving, &mut |_| Continue(()));
    let none = none.unwrap_err().to_string();
    assert!(none.contains("no shift"), "{none}");
}

#[test]
fn a_log_of_another_car_does_not_fit_the_ratios() {
    let drawn = Drawn::of(car("eight_speed.toml"), 6, Case::Usual);
    let other = car("ten_speed.toml");
    let other_tables = tables(&other);
    let mut recorder = Recorder::new(&other, &other_tables, ReadingAges::default());
    rows(&drawn, 1).iter().for_each(|(time_s, input)| recorder.push(*time_s, input));
    let [all, unfit] = recorder.finish().in_gear;
    assert!(2 * unfit > all && all > 1000, "{unfit} of {all}");
}

/// Input without sense is no panic, and no shift comes from it.
#[test]
fn what_no_car_does_is_left_out() {
    let drawn = Drawn::of(car("eight_speed.toml"), 7, Case::Usual);
    let good = rows(&drawn, 1);
    let tables = drawn.tables();
    let recorded = |change: &dyn Fn(usize, &mut f64, &mut ShiftInput<f64>)| {
        let mut recorder = Recorder::new(&drawn.file, &tables, ReadingAges::default());
        for (at, (time_s, input)) in good.iter().enumerate().take(4000) {
            let (mut time_s, mut input) = (*time_s, *input);
            change(at, &mut time_s, &mut input);
            recorder.push(time_s, &input);
        }
        recorder.finish()
    };
    let clean = recorded(&|_, _, _| ()).shifts.len();
    assert!(clean >= 4, "{clean}");
    // Without commands, turbine speeds, or time that goes on.
    assert_eq!(recorded(&|_, _, input| input.commands = [None; 8]).shifts.len(), 0);
    assert_eq!(recorded(&|_, _, input| input.turbine_rad_s = None).shifts.len(), 0);
    assert_eq!(recorded(&|_, time_s, _| *time_s = 1.0).shifts.len(), 0);
    // A gear of no gearbox, a shift that never ends, and two that change all the time.
    assert_eq!(recorded(&|_, _, input| input.gear.to = Gear::at(63)).shifts.len(), 0);
    assert_eq!(recorded(&|_, _, input| input.gear = ShiftCommand::between(1, 2)).shifts.len(), 0);
    recorded(&|at, _, input| input.gear = ShiftCommand::between(1 + at % 3, 2));
    // Speeds that are huge: the model must not be left with numbers that are none.
    let huge = recorded(&|_, _, input| input.engine_rad_s = Some(Reading::now(1e300)));
    if let Ok(fit) = fit::gearbox::fit(&drawn.file, &tables, &huge.shifts, &huge.driving, &mut |_| Continue(())) {
        assert!(fit.unknowns.iter().all(|x| x.is_finite()));
    }
}

#[test]
fn the_file_of_a_car_can_have_its_own_springs_and_inertias() {
    let given = car("eight_speed.toml");
    let gearbox = || Source::read(&given.source.path.parent().unwrap().join("../gearboxes/8hp.toml")).unwrap();
    let with = |more: &str| {
        let source = Source { text: format!("{}\n{more}\n", given.source.text), ..given.source.clone() };
        CarFile::from_sources(source, gearbox())
    };
    let other = with("[clutch.E]\nreturn_spring_n = 700\n[turbine_inertia_kg_m2]\n\"1-2\" = 0.09").unwrap();
    let at = other.gearbox.elements.iter().position(|element| element.name == "E").unwrap();
    assert_eq!(other.clutches[at].unwrap().clutch.return_spring_n, 700.0);
    let gear = |name: &str| other.gearbox.gear(name).unwrap();
    for (from, to, is) in [("1", "2", true), ("2", "1", true), ("2", "3", false)] {
        let m11 = |car: &Car| car.gearbox.shift(gear(from), gear(to)).unwrap().reduced.unwrap().mass_kg_m2[0][0];
        assert_eq!((m11(&other) - 0.09).abs() < 1e-12, is);
        assert_eq!(m11(&other) == m11(&given), !is);
    }
    for (text, words) in [
        ("[turbine_inertia_kg_m2]\n\"1-9\" = 0.09", "names no shift"),
        ("[turbine_inertia_kg_m2]\nfast = 0.09", "two gears with a hyphen between them"),
        ("[turbine_inertia_kg_m2]\n\"2-3\" = 0.01", "hint: more than"),
        ("[turbine_inertia_kg_m2]\n\"1-2\" = -1", "1-2"),
        ("[clutch.E]\nreturn_spring_n = -5", "clutch.E.return_spring_n"),
        ("[clutch.E.error_bounds]\nfriction_factor = [1.1, 1.2]", "does not contain 1"),
        ("[clutch.E.error_bounds]\nvalve_delay_s = [0.03, 0.0]", "expected [minimum, maximum]"),
        ("[clutch.E.error_bounds]\nvalve_hysteresis_pa = -1", "clutch.E.error_bounds.valve_hysteresis_pa"),
        ("[clutch.E.error_bounds]\nfriction = 0.1", "unknown key"),
        ("[error_bounds]\nconverter_share = 2", "error_bounds.converter_share"),
        ("[error_bounds]\nvalve_error_scale = 0", "error_bounds.valve_error_scale"),
    ] {
        let error = with(text).unwrap_err().to_string();
        assert!(error.contains(words), "{text}: {error}");
    }
}

/// The filter and its ranges take the bounds of the file, and those of a car in series where it has none.
#[test]
fn error_bounds_of_a_file_come_before_those_of_a_car_in_series() {
    let given = car("eight_speed.toml");
    let gearbox = Source::read(&given.source.path.parent().unwrap().join("../gearboxes/8hp.toml")).unwrap();
    let more = "[clutch.E.error_bounds]\nvalve_lag_factor = [0.9, 1.2]\n[error_bounds]\nconverter_share = 0.04\nwheel_scale_share = 0.01\n";
    let source = Source { text: format!("{}\n{more}", given.source.text), ..given.source.clone() };
    let own = CarFile::from_sources(source, gearbox).unwrap();
    let at = own.gearbox.elements.iter().position(|element| element.name == "E").unwrap();
    let [of_given, of_own] = [&given.car, &own.car].map(ErrorBudget::of_car);
    assert_eq!(of_own.element(at).unwrap().valve_lag_factor, [0.9, 1.2]);
    assert_eq!(of_own.element(at).unwrap().friction_factor, of_given.element(at).unwrap().friction_factor);
    let elements = of_own.elements.clone();
    assert_eq!(of_own, ErrorBudget { converter: 0.04, wheel_scale: 0.01, elements, ..of_given });
    let tables = [&given.car, &own.car].map(tables);
    let budget = |car: usize| tables[car].tables().elements[tables[car].place(at).unwrap()].budget.unwrap();
    assert_eq!((budget(0).lag_factor, budget(1).lag_factor), ([0.5, 1.5], [0.9, 1.2]));
    // What the valves err by over their bounds is for the filter alone, and not for the ranges.
    let bounds = CarErrorBounds { valve_error_scale: Some(0.5), ..own.error_bounds.clone() };
    let trusted = Car { error_bounds: bounds, ..own.car.clone() };
    let of_trusted = drawn::tables(&trusted);
    let place = of_trusted.place(at).unwrap();
    let [usual, half] = [&tables[1], &of_trusted].map(|tables| tables.tables().elements[place].uncertainty);
    assert_eq!([half.torque_fraction, half.kiss_point_pa], [0.5 * usual.torque_fraction, 0.5 * usual.kiss_point_pa]);
    assert_eq!([half.valve_delay_s, half.pressure_pa], [0.5 * usual.valve_delay_s, 0.5 * usual.pressure_pa]);
    assert_eq!(half.slow_part, usual.slow_part);
    let of_errors = element_uncertainty(ErrorBudget::of_car(&trusted).element(at).unwrap(), 1.0);
    assert_eq!(ElementUncertainty { drag_n_m: usual.drag_n_m, ..of_errors }, usual);
    for (of_trusted, of_own) in of_trusted.tables().elements.iter().zip(tables[1].tables().elements) {
        assert_eq!(of_trusted.budget, of_own.budget);
    }
}

#[test]
fn the_ranges_of_a_fitted_file_hold_and_are_narrower() {
    for (case, seed) in [(Case::Usual, 9), (Case::WithTiming, 10)] {
        let drawn = Drawn::of(car("eight_speed.toml"), seed, case);
        let (recorded, _) = drawn.driven(&city(2));
        let [fitted_shifts, held_out] = every_fifth(recorded.shifts);
        let fit = fitted(&drawn, &fitted_shifts);
        let file = |checked| fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", checked).unwrap();
        let unchecked = file(None);
        let both = ((&drawn.file.car, &drawn.tables()), (&unchecked.car, &tables(&unchecked)));
        let checked = fit.validate(both.0, both.1, &held_out).unwrap();
        let file = file(Some(&checked));
        assert_eq!(file.error_bounds.valve_error_scale.is_some(), unchecked.error_bounds.valve_error_scale.is_none());
        assert!(checked.valve_error_scale < 0.8, "{checked:?}");
        for (place, name) in fit.quantities.elements.iter().enumerate() {
            let table = format!("[clutch.{name}.error_bounds]");
            assert_eq!(file.source.text.contains(&table), fit.elements_seen[place], "{name}");
        }
        let bounds = [&drawn.file.car, &file.car].map(ErrorBudget::of_car);
        assert!(bounds[1].converter <= bounds[0].converter && bounds[1].inertia <= bounds[0].inertia, "{bounds:?}");
        let found = estimated::estimated(&drawn, &city(1), &[drawn.file.car.clone(), file.car, unchecked.car]);
        // Where held-out shifts say that the valves err less than the bounds, the filter is better for it.
        assert!(found[1].square < found[2].square && found[1].square < found[0].square, "{found:?}");
        assert!(found[1].square < 1.2 * found[1].square_of_valves, "{found:?}");
        assert!(found[1].rows > 500.0, "{found:?}");
        found.iter().for_each(|found| assert_eq!(found.outside, [0.0; 2], "{found:?}"));
        if case == Case::Usual {
            assert!(found[1].width_n_m < 0.97 * found[0].width_n_m, "{found:?}");
            assert!(found[1].width_pa < 0.95 * found[0].width_pa, "{found:?}");
        }
    }
}

#[test]
fn a_measured_pressure_tells_friction_and_gain_apart() {
    let drawn = Drawn::of(car("eight_speed.toml"), 11, Case::Usual);
    let (recorded, truth) = drawn.driven(&city(1));
    let tables = drawn.tables();
    let at = drawn.file.gearbox.elements.iter().position(|element| element.name == "C").unwrap();
    let place = tables.place(at).unwrap();
    let mut with = recorded.shifts.clone();
    truth.measure(&mut with, &tables, place, 1);
    let [without, with] = [&recorded.shifts, &with].map(|shifts| fitted(&drawn, shifts));
    let gain = Quantity::Gain(place);
    assert_eq!((without.verdict(gain), with.verdict(gain)), (Verdict::NotIdentifiable, Verdict::Measured));
    let error = with.unknown(gain) - drawn.true_unknown(&tables, &with.quantities, gain);
    assert!(error.abs() < 2.0 * with.sd(gain) && with.sd(gain) < 0.01, "{error} {}", with.sd(gain));
    let [before, kept, found] = [None, Some(&without), Some(&with)].map(|fit| match fit {
        None => drawn.file.clone(),
        Some(fit) => fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap(),
    });
    let settled_pa = |car: &Car| car.clutches[at].unwrap().valve.settled_pressure(0.5);
    assert_eq!(settled_pa(&kept), settled_pa(&before));
    assert!((settled_pa(&found) / settled_pa(&before) / with.unknown(gain).exp() - 1.0).abs() < 1e-3);
    let friction = |car: &Car| car.clutches[at].unwrap().clutch.friction.at(50.0);
    let product = with.unknown(Quantity::Torque(place)) - with.unknown(gain);
    assert!((friction(&found) / friction(&before) / product.exp() - 1.0).abs() < 1e-3);
    let said = [&without, &with].map(|fit| fit.statements().join("\n").contains("gain separately for C"));
    assert_eq!(said, [false, true]);
    assert!(with.report().iter().any(|row| row.name == "C: valve gain"), "{:?}", with.report());

    // A pressure that no valve of the bounds makes is not used, and named.
    assert!(!with.statements().join("\n").contains("is not that of its commands"));
    let wrongs: [fn(f64) -> f64; 3] = [|pa| 0.01 * pa, |pa| -pa, |_| 5e5];
    for wrong in wrongs {
        let mut shifts = recorded.shifts.clone();
        truth.measure(&mut shifts, &tables, place, 1);
        let values = shifts.iter_mut().flat_map(|log| &mut log.pressure).flat_map(|series| &mut series.value);
        values.for_each(|pa| *pa = wrong(*pa));
        let fit = fitted(&drawn, &shifts);
        assert_eq!(fit.unknowns, without.unknowns);
        let said = fit.statements().join("\n");
        assert!(said.contains("the measured pressure of C contradicts its command"), "{said}");
    }
}

/// The pressure of an element tells the volume of its stroke, and only of that one.
#[test]
fn a_measured_pressure_tells_a_fill_volume() {
    let drawn = Drawn::of(car("eight_speed_stroke.toml"), 2, Case::Usual);
    let (recorded, truth) = drawn.driven(&hilly(&city(3), 2));
    let tables = drawn.tables();
    let at = drawn.file.gearbox.elements.iter().position(|element| element.name == "C").unwrap();
    let place = tables.place(at).unwrap();
    let mut with = recorded.shifts.clone();
    truth.measure(&mut with, &tables, place, 1);
    let [without, with] = [&recorded.shifts, &with].map(|shifts| fitted(&drawn, shifts));
    let fill = with.fills[place].unwrap();
    let error = fill.log_volume - drawn.fill[at].ln();
    assert!(
        fill.shifts > 0 && fill.verdict() != Verdict::NotIdentifiable && error.abs() < 2.0 * fill.sd[0],
        "{fill:?} {error}"
    );
    assert!(
        without.fills.iter().all(|fill| fill.unwrap().verdict() == Verdict::NotIdentifiable),
        "{:?}",
        without.fills
    );
    let said = without.statements().join("\n");
    assert!(said.contains("for the fill volume of ") && said.contains("measure the pressure"), "{said}");
    let volume = |car: &Car| car.clutches[at].unwrap().cylinder.stroke_m3;
    let [kept, found] =
        [&without, &with].map(|fit| fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap());
    assert!((volume(&kept) / volume(&drawn.file) - 1.0).abs() < 1e-4);
    assert!((volume(&found) / volume(&drawn.file) / fill.log_volume.exp() - 1.0).abs() < 1e-3);
    // The kiss point of the fitted file stays above the preload of its spring.
    let cylinder = found.clutches[at].unwrap().cylinder;
    assert!(cylinder.preload_pa < cylinder.kiss_pa);
    assert!(with.report().iter().any(|row| row.name == "C: fill volume"));
}

/// In these gearboxes one-way clutches are elements of some shifts; of the TH400 of all, one of them in series with a brake.
#[test]
fn shifts_with_one_way_clutches_tell_the_other_element() {
    for (vehicle, draws, shifts, reduced) in [
        ("three_speed_c6.toml", 3, 24, 0.6),
        ("three_speed_th400.toml", 3, 18, 0.75),
        ("four_speed_4l60e.toml", 1, 40, 0.5),
    ] {
        let (mut given, mut found) = (0.0, 0.0);
        for seed in 1..=draws {
            let drawn = Drawn::of(car(vehicle), seed, Case::Usual);
            let (recorded, truth) = drawn.driven(&city(6));
            assert!(recorded.shifts.len() >= shifts, "{vehicle}: {:?}", recorded.skipped);
            let [fitted_shifts, held_out] = every_fifth(recorded.shifts);
            let fit = fitted(&drawn, &fitted_shifts);
            assert!(fit.is_converged && fit.at_limit.is_empty() && fit.torque_misfit < 2.0, "{}", fit.torque_misfit);
            assert!(held(&drawn, &fit) > 0.85, "{vehicle} {seed}: {}", held(&drawn, &fit));
            let file = fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap();
            given += truth.squared_error(&drawn.file, &held_out);
            found += truth.squared_error(&file, &held_out);
        }
        let [given, found] = [given, found].map(|sum: f64| sum.sqrt());
        assert!(found < reduced * given, "{vehicle}: {given} {found}");
    }
}
