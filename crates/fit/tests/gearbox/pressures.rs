//! What is between a command and the plates: pistons with a stroke, and valves with a hysteresis.

use car::Car;
use fit::gearbox::{GearboxFit, Quantity, Recorded, Recorder, ShiftLog, open_loop};
use fit::{ReadingAges, Series};
use observer::Reading;
use observer::gearbox::{MAX_ELEMENTS, ShiftInput};

use super::drawn::{self, Case, Drawn, FittedFile as _, Truth, car, city, every_fifth, hilly};
use super::{fitted, rows};

/// The quantities of the elements that lie outside of their intervals, with errors in standard deviations.
fn outside(drawn: &Drawn, fit: &GearboxFit, is_asked: impl Fn(&Quantity) -> bool) -> Vec<(Quantity, f64)> {
    let tables = drawn.tables();
    let errors = fit.quantities.all.iter().filter(|quantity| is_asked(quantity)).map(|quantity| {
        let error = fit.unknown(*quantity) - drawn.true_unknown(&tables, &fit.quantities, *quantity);
        (*quantity, error / fit.sd(*quantity))
    });
    errors.filter(|(_, sides)| sides.abs() > 1.96).collect()
}

/// The same car with a file that knows of no strokes.
fn without_strokes(drawn: &Drawn) -> Drawn {
    let mut other = drawn.clone();
    other.file.clutches.iter_mut().flatten().for_each(|clutch| clutch.has_stroke = false);
    other
}

/// Sum of the squared errors of the kiss points.
fn squared_kiss_error(drawn: &Drawn, fit: &GearboxFit) -> f64 {
    let tables = drawn.tables();
    let error = |place: usize| {
        let kiss = Quantity::Kiss(place);
        fit.unknown(kiss) - drawn.true_unknown(&tables, &fit.quantities, kiss)
    };
    (0..fit.quantities.elements.len()).map(|place| error(place).powi(2)).sum()
}

/// An element that is applied again before it is empty kisses earlier.
#[test]
fn pistons_that_were_not_empty_leave_kiss_points_lags_and_friction_in_their_intervals() {
    let is_asked = |quantity: &Quantity| matches!(quantity, Quantity::Kiss(_) | Quantity::Lag(_) | Quantity::Torque(_));
    let (mut wrong, mut all, mut squares, mut kiss) = (Vec::new(), 0, [0.0; 2], [0.0; 2]);
    for seed in [2, 4, 6] {
        let drawn = Drawn::of(car("eight_speed_stroke.toml"), seed, Case::Usual).without_hysteresis();
        let (recorded, truth) = drawn.driven(&hilly(&city(2), seed));
        let [shifts, held_out] = every_fifth(recorded.shifts);
        let fit = fitted(&drawn, &shifts);
        wrong.extend(outside(&drawn, &fit, is_asked));
        all += fit.quantities.all.iter().filter(|quantity| is_asked(quantity)).count();
        let file = fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap();
        let cars = [&drawn.file, &file].into_iter().zip(&mut squares);
        cars.for_each(|(car, sum)| *sum += truth.squared_error(car, &held_out));
        kiss[0] += squared_kiss_error(&drawn, &fit);
        kiss[1] += squared_kiss_error(&drawn, &fitted(&without_strokes(&drawn), &shifts));
    }
    assert!(kiss[0] < kiss[1], "{kiss:?}");
    let [given, found] = squares.map(f64::sqrt);
    assert!(found < 0.6 * given, "{given} {found}");
    // Of 45 quantities with 95 % each, 6 are outside in 2 % of draws.
    assert!(wrong.len() < 6, "{all}: {wrong:?}");
}

/// With the values of the car the commands give the pressures of the plant, also of an element that is applied again before it is empty.
#[test]
fn pressures_of_pistons_with_a_stroke_are_those_of_the_plant() {
    let drawn = Drawn::of(car("eight_speed_stroke.toml"), 1, Case::Right);
    let (recorded, truth) = drawn.driven(&city(1));
    let error_pa = |car: &Car| {
        let tables = drawn::tables(car);
        let points = recorded.shifts.iter().flat_map(|log| open_loop(car, &tables, log));
        let squares = points.flat_map(|point| {
            let of = |which: usize| (point.pressure_pa[which] - truth.pressure_pa[which].at(point.time_s)).powi(2);
            [of(0), of(1)]
        });
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
        f64::sqrt(sum / count)
    };
    let (known, unknown) = (error_pa(&drawn.file), error_pa(&without_strokes(&drawn).file));
    // The reading of a current has a noise of 2 mA, 2 kPa in front of the lag of the valve.
    assert!(known < 2e3 && 2.0 * known < unknown, "{known} {unknown}");
}

/// A hysteresis that the fit does not know moves kiss points and lags, and the intervals say so; the bounds of a file can say that there is none.
#[test]
fn kiss_points_and_lags_have_what_an_unknown_hysteresis_may_do() {
    let is_asked = |quantity: &Quantity| matches!(quantity, Quantity::Kiss(_) | Quantity::Lag(_));
    for seed in [5, 9] {
        let drawn = Drawn::of(car("eight_speed.toml"), seed, Case::WithTiming);
        let (recorded, _) = drawn.driven(&hilly(&city(2), seed));
        let fit = fitted(&drawn, &recorded.shifts);
        let wrong = outside(&drawn, &fit, is_asked);
        // 10 quantities with 95 % each: 3 are outside in 1 % of draws.
        assert!(wrong.len() < 3, "{seed}: {wrong:?}");
        let drawn = drawn.without_hysteresis();
        let certain = fitted(&drawn, &recorded.shifts);
        assert_eq!(certain.unknowns, fit.unknowns);
        for (place, _) in fit.quantities.elements.iter().enumerate() {
            let kiss = Quantity::Kiss(place);
            // The bound of 10 kPa as a uniform distribution, in units of 10 kPa.
            let minimum = 3.0_f64.sqrt().recip().min(fit.quantities.sd_before(fit.quantities.place(kiss).unwrap()));
            assert!(fit.sd(kiss) > 0.999 * minimum && certain.sd(kiss) < fit.sd(kiss), "{seed} {place}");
        }
    }
}

/// How full a piston was is not known where a log begins in a shift.
#[test]
fn a_shift_with_strokes_needs_its_commands_from_before() {
    let drawn = Drawn::of(car("eight_speed_stroke.toml"), 3, Case::Usual);
    let (tables, rows) = (drawn.tables(), rows(&drawn, 1));
    let recorded = |from_s: f64, until_s: f64| {
        let mut recorder = Recorder::new(&drawn.file, &tables, ReadingAges::of(&drawn::sensors()));
        for (time_s, input) in rows.iter().filter(|(time_s, _)| *time_s < until_s) {
            let mut input = *input;
            if *time_s < from_s {
                input.commands = [None; 8];
            }
            recorder.push(*time_s, &input);
        }
        recorder.finish()
    };
    let all = recorded(0.0, f64::INFINITY).shifts;
    let (first, second) = (&all[1], &all[2]);
    let of = |from_s: f64| recorded(from_s, second.command_s[0]);
    let names = |from_s: f64| of(from_s).shifts.into_iter().map(|shift| shift.name).collect::<Vec<_>>();
    assert!(names(first.slip_s[0] - 0.5).contains(&first.name));
    let late = of(first.slip_s[0] - 0.05);
    assert!(late.shifts.is_empty(), "{:?}", late.shifts.len());
    assert!(late.skipped.iter().any(|reason| reason.contains("the oil volume of its pistons")), "{:?}", late.skipped);
    // Commands that are missing for half of a log leave the shifts of the other half.
    let half_s = all[all.len() / 2].command_s[0] - 3.0;
    let left = recorded(half_s, f64::INFINITY).shifts;
    assert_eq!(left.len(), all.len() - all.len() / 2);
    assert!(fitted(&drawn, &left).unknowns.iter().all(|x| x.is_finite()));
}

/// A pressure in bar, read as Pa, is none: it tells nothing of valve or stroke.
#[test]
fn a_pressure_in_another_unit_tells_nothing_of_a_piston_with_a_stroke() {
    let drawn = Drawn::of(car("eight_speed_stroke.toml"), 2, Case::Usual);
    let (recorded, truth) = drawn.driven(&hilly(&city(1), 2));
    let tables = drawn.tables();
    let at = drawn.file.gearbox.elements.iter().position(|element| element.name == "C").unwrap();
    let place = tables.place(at).unwrap();
    let without = fitted(&drawn, &recorded.shifts);
    let mut shifts = recorded.shifts.clone();
    truth.measure(&mut shifts, &tables, place, 1);
    for log in &mut shifts {
        log.pressure.iter_mut().flat_map(|series| &mut series.value).for_each(|value| *value *= 1e-5);
    }
    let fit = fitted(&drawn, &shifts);
    assert_eq!(fit.fills[place].map(|fill| fill.shifts), Some(0));
    for quantity in [Quantity::Torque(place), Quantity::Lag(place), Quantity::Kiss(place)] {
        let moved = (fit.unknown(quantity) - without.unknown(quantity)) / without.sd(quantity);
        assert!(moved.abs() < 0.5, "{quantity:?}: {moved}");
    }
}

/// The place of element C in the tables.
fn place_of_c(drawn: &Drawn) -> usize {
    let at = drawn.file.gearbox.elements.iter().position(|element| element.name == "C").unwrap();
    drawn.tables().place(at).unwrap()
}

/// The shifts with the pressure of an element by a sensor with a zero offset: with what it reads before, or while both clutches slip alone.
fn measured_with_offset(drawn: &Drawn, driven: &(Recorded, Truth), offset_pa: f64, from_rest: bool) -> Vec<ShiftLog> {
    let (recorded, truth) = driven;
    let (tables, place) = (drawn.tables(), place_of_c(drawn));
    let mut shifts = recorded.shifts.clone();
    truth.measure(&mut shifts, &tables, place, 1);
    for log in &mut shifts {
        let span_s = if from_rest { [0.0, f64::INFINITY] } else { log.slip_s };
        for pressure in &mut log.pressure {
            let mut read = Series::default();
            pressure.between(span_s).for_each(|(time_s, pa)| read.push(time_s, pa + offset_pa));
            *pressure = read;
        }
    }
    shifts
}

#[test]
fn the_zero_offset_of_a_pressure_sensor_is_not_taken_for_the_gain_of_its_valve() {
    for (name, seed) in [("eight_speed.toml", 11), ("eight_speed_stroke.toml", 2)] {
        let drawn = Drawn::of(car(name), seed, Case::Usual);
        let driven = drawn.driven(&hilly(&city(2), seed));
        let (tables, place) = (drawn.tables(), place_of_c(&drawn));
        let gain = Quantity::Gain(place);
        for from_rest in [true, false] {
            let fit_with =
                |offset_pa: f64| fitted(&drawn, &measured_with_offset(&drawn, &driven, offset_pa, from_rest));
            let right = fit_with(0.0);
            let truth = drawn.true_unknown(&tables, &right.quantities, gain);
            let sd = right.sd(gain);
            let case = format!("{name}, from rest {from_rest}");
            assert!((right.unknown(gain) - truth).abs() < 2.0 * sd, "{case}: {} {truth} {sd}", right.unknown(gain));
            // With readings at rest it is known as well as without any offset.
            assert!(!from_rest || sd < 0.02, "{case}: {sd}");
            for offset_pa in [-20e3, 10e3, 30e3] {
                let fit = fit_with(offset_pa);
                // The prior mean of no offset pulls where no reading is at rest: less than a quarter of what is stated.
                let moved = (fit.unknown(gain) - right.unknown(gain)) / sd;
                assert!(moved.abs() < if from_rest { 1e-3 } else { 0.25 }, "{case} {offset_pa}: {moved}");
                let found = fit.zero_offset_pa(place).unwrap();
                assert!((found.value - offset_pa).abs() < 2.0 * found.sd, "{case} {offset_pa}: {found:?}");
                let row = fit.report().into_iter().find(|row| row.name == "C: pressure sensor, zero offset").unwrap();
                assert!(row.value_text().ends_with(" kPa") && row.interval_text().contains(" to "), "{row:?}");
                let said = fit.statements().join("\n");
                assert!(said.contains("the pressure of C reads ") || found.value.abs() < 2.0 * found.sd, "{said}");
            }
        }
    }
}

/// The sensor of an element is read all the time: what it reads before a shift is its zero offset.
#[test]
fn readings_of_an_element_around_a_shift_show_the_zero_offset_of_its_sensor() {
    let drawn = Drawn::of(car("eight_speed.toml"), 11, Case::Usual);
    let (tables, place) = (drawn.tables(), place_of_c(&drawn));
    let mut recorder = Recorder::new(&drawn.file, &tables, ReadingAges::of(&drawn::sensors()));
    let is_of_c = |input: &ShiftInput<f64>| {
        let row = tables.tables().commanded(input.gear).copied();
        row.and_then(|row| row.clutches.iter().position(|clutch| clutch.element.place() == Some(place)))
    };
    for (time_s, input) in rows(&drawn, 1) {
        recorder.push(time_s, &input);
        // What a clutch holds in a gear, and nothing where its valve has no current.
        let command = input.commands[place].map_or(0.0, |reading| reading.value);
        let reading = Reading { value: 12e3 + 1e6 * command, age_s: 0.0 };
        recorder.push_pressure(time_s, [0, 1].map(|which| Some(reading).filter(|_| is_of_c(&input) == Some(which))));
        let mut pressures = [None; MAX_ELEMENTS];
        pressures[place] = Some(reading);
        recorder.push_element_pressures(time_s, &pressures);
    }
    let shifts = recorder.finish().shifts;
    let of_c: Vec<&Series> = shifts.iter().flat_map(|log| &log.pressure).filter(|series| !series.is_empty()).collect();
    assert!(of_c.len() > 4);
    assert!(shifts.iter().all(|log| log.pressure.iter().all(|p| p.is_empty() || p.time_s[0] < log.command_s[0])));
    let fit = fitted(&drawn, &shifts);
    let found = fit.zero_offset_pa(place);
    assert!(found.is_some_and(|found| (found.value - 12e3).abs() < 2.0 * found.sd && found.sd < 1.5e3), "{found:?}");
}
