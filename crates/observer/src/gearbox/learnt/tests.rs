//! Tests of what is learnt from shift to shift.

use super::super::systematic::variance_in_common;
use super::*;

const CORRELATIONS: Correlations<f64> = [-0.3; MAX_ELEMENTS];
const PART: f64 = 0.75;
const STIFFNESS: [f64; ACTING] = [0.9, 0.9, 0.0, 0.0, 1.0, 2.3, 0.0, 0.0, 0.0, 0.0];

fn shift() -> Acting<f64> {
    Acting::new([1, 4].map(ShiftElement::at), Some(2), [PART; 2], STIFFNESS)
}

/// What a filter knows after a measurement of `h a` with a variance of the noise.
fn after(before: &Known<f64>, h: &[f64; ACTING], value: f64, noise: f64) -> Known<f64> {
    let with = before.covariance.map(|row| dot(&row, h));
    let variance = dot(&with, h) + noise;
    let innovation = value - dot(h, &before.mean);
    let mut after = *before;
    for a in 0..ACTING {
        after.mean[a] += with[a] / variance * innovation;
        for b in 0..ACTING {
            after.covariance[a][b] -= with[a] * with[b] / variance;
        }
    }
    after
}

/// Numbers from -1 to 1 (linear congruential).
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// The regression is the Kalman filter of all quantities with the part that does not last as noise.
#[test]
fn what_a_shift_shows_reaches_all_quantities_as_in_one_filter() {
    let (acting, mut learnt) = (shift(), Learnt::nothing(&CORRELATIONS));
    // Other shifts have tied the quantities to each other.
    let mut seed = 1;
    for pair in 0..6 {
        let acting = Acting::new([pair, pair + 1].map(ShiftElement::at), Some(pair), [PART; 2], STIFFNESS);
        let h = core::array::from_fn(|_| random(&mut seed));
        let before = learnt.known(&acting, &CORRELATIONS);
        assert!(learnt.take(&acting, &before, &after(&before, &h, 0.5, 0.1), &CORRELATIONS));
    }
    let (before, h) = (learnt.known(&acting, &CORRELATIONS), [0.9, -0.2, 0.4, 0.1, -0.7, 0.8, 0.3, -0.5, 0.2, 0.6]);
    let mut taken = learnt;
    assert!(taken.take(&acting, &before, &after(&before, &h, 0.8, 0.2), &CORRELATIONS));
    let mut row = [0.0; LEARNT];
    let mut noise = 0.2;
    for a in 0..ACTING {
        let (per_unit, more) = acting.per_unit(a);
        row[acting.places[a].unwrap()] += per_unit * h[a];
        row[STIFFNESS_AT] += STIFFNESS[a] * h[a];
        noise += more * h[a] * h[a];
    }
    let with = learnt.covariance.map(|line| dot(&line, &row));
    let variance = dot(&with, &row) + noise;
    let innovation = 0.8 - dot(&row, &learnt.mean);
    // Torque at the gearbox input, stiffness and reported torque are considered, and not corrected.
    let gain: [f64; LEARNT] = core::array::from_fn(|i| if is_considered(i) { 0.0 } else { with[i] / variance });
    for i in 0..LEARNT {
        assert!((taken.mean[i] - learnt.mean[i] - gain[i] * innovation).abs() < 1e-9, "{i}");
        for j in 0..LEARNT {
            let is_open = i == j && learnt.covariance[i][i] < 1.0 && !is_considered(i);
            let drift = if is_open { PER_SHIFT } else { 0.0 };
            // `P - K H P - P H' K' + K S K'`, for any gain `K`.
            let taken_off = gain[i] * with[j] + with[i] * gain[j] - gain[i] * gain[j] * variance;
            let expected = learnt.covariance[i][j] - taken_off + drift;
            assert!((taken.covariance[i][j] - expected).abs() < 1e-9, "{i} {j}");
        }
    }
}

#[test]
fn a_shift_that_shows_nothing_teaches_nothing() {
    let (acting, nothing) = (shift(), Learnt::nothing(&CORRELATIONS));
    let (mut learnt, mut known) = (nothing, nothing.known(&acting, &CORRELATIONS));
    // The part that does not last has walked, and nothing was seen of it.
    known.covariance[0][0] += 0.3;
    assert!(learnt.take(&acting, &known, &known, &CORRELATIONS));
    let change = learnt.covariance.iter().flatten().zip(nothing.covariance.iter().flatten());
    assert!(change.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < PER_SHIFT + 1e-12);
    assert_eq!(learnt.mean, nothing.mean);
}

#[test]
fn what_cannot_be_is_refused_and_often_refused_is_another_car() {
    let (acting, mut learnt) = (shift(), Learnt::nothing(&CORRELATIONS));
    let h = core::array::from_fn(|a| f64::from(u8::from(a == 0)));
    let before = learnt.known(&acting, &CORRELATIONS);
    assert!(learnt.take(&acting, &before, &after(&before, &h, 1.0, 0.01), &CORRELATIONS));
    learnt.count(true, &CORRELATIONS);
    let known = learnt;
    for value in [12.0, -12.0, f64::NAN, f64::INFINITY] {
        let before = learnt.known(&acting, &CORRELATIONS);
        assert!(!learnt.take(&acting, &before, &after(&before, &h, value, 0.01), &CORRELATIONS), "{value}");
        let mut odd = before;
        odd.covariance[2][3] = f64::NAN;
        assert!(!learnt.take(&acting, &before, &odd, &CORRELATIONS));
    }
    assert_eq!(learnt, known);
    for refused in 1..=REFUSED_MAX {
        learnt.count(false, &CORRELATIONS);
        assert_eq!(learnt.shifts, u32::from(refused < REFUSED_MAX));
    }
    assert_eq!(learnt, Learnt::nothing(&CORRELATIONS));
}

/// Whatever the shifts show, in single precision too.
#[test]
fn ten_thousand_shifts_leave_a_covariance_and_means_within_the_bounds() {
    let correlations = CORRELATIONS.map(|correlation| correlation as f32);
    let (mut learnt, mut seed, mut taken) = (Learnt::nothing(&correlations), 5, 0);
    for k in 0..10_000 {
        let at = k % 7;
        let acting =
            Acting::new([at, at + 1].map(ShiftElement::at), Some(at), [PART as f32; 2], STIFFNESS.map(|x| x as f32));
        let known = learnt.known(&acting, &correlations);
        let double =
            Known { mean: known.mean.map(f64::from), covariance: known.covariance.map(|row| row.map(f64::from)) };
        let h = core::array::from_fn(|_| random(&mut seed));
        let shown = after(&double, &h, 3.0 * random(&mut seed), 1e-4);
        let shown =
            Known { mean: shown.mean.map(|x| x as f32), covariance: shown.covariance.map(|row| row.map(|x| x as f32)) };
        taken += u32::from(learnt.take(&acting, &known, &shown, &correlations));
        learnt.pass(20.0, &correlations);
        assert!(learnt.is_sound(), "{k}");
    }
    assert!(taken > 2000, "{taken}");
}

#[test]
fn time_makes_it_unknown_again() {
    let (acting, nothing) = (shift(), Learnt::nothing(&CORRELATIONS));
    let (mut learnt, before) = (nothing, nothing.known(&acting, &CORRELATIONS));
    assert!(learnt.take(&acting, &before, &after(&before, &[0.5; ACTING], 1.0, 0.01), &CORRELATIONS));
    let (friction, inertia) = (learnt.mean[1], learnt.mean[INERTIA_AT + 2]);
    assert!(friction > 0.05 && inertia > 0.05);
    // A night: the oil is cold again, and the inertia is that of the day before.
    learnt.pass(12.0 * 3600.0, &CORRELATIONS);
    assert!(learnt.mean[1] < 0.01 * friction && learnt.mean[INERTIA_AT + 2] > 0.98 * inertia);
    assert!((learnt.covariance[1][1] - 1.0).abs() < 0.01);
}

#[test]
fn what_is_read_must_be_what_a_filter_can_have_learnt() {
    let nothing = Learnt::nothing(&CORRELATIONS);
    assert_eq!(nothing.checked(), Some(nothing));
    let wrong = |change: fn(&mut Learnt<f64>)| {
        let mut learnt = nothing;
        change(&mut learnt);
        learnt.checked()
    };
    assert_eq!(wrong(|learnt| learnt.mean[3] = f64::NAN), None);
    assert_eq!(wrong(|learnt| learnt.mean[3] = 2.6), None);
    assert_eq!(wrong(|learnt| learnt.covariance[3][3] = -1.0), None);
    assert_eq!(wrong(|learnt| learnt.covariance[3][3] = 1e9), None);
    assert_eq!(wrong(|learnt| learnt.covariance[3][4] = 0.1), None);
    assert_eq!(
        wrong(|learnt| {
            learnt.covariance[3][4] = 1.1;
            learnt.covariance[4][3] = 1.1;
        }),
        None
    );
}

/// Shifts of one car, of which each shows all quantities that act in it, with a little noise.
fn shown_by(car: impl Fn(usize) -> f64, learnt: &mut Learnt<f64>, shifts: usize, seed: &mut u64) {
    for k in 0..shifts {
        let at = k % 4;
        let acting = Acting::new([at, at + 1].map(ShiftElement::at), Some(at), [PART; 2], STIFFNESS);
        let before = learnt.known(&acting, &CORRELATIONS);
        let mut known = before;
        for a in 0..ACTING {
            let h = core::array::from_fn(|b| if a == b { 1.0 } else { 0.0 });
            let truth = acting.places[a].map_or(0.0, |place| acting.per_unit(a).0 * car(place));
            known = after(&known, &h, truth + 0.1 * random(seed), 0.1);
        }
        let taken = learnt.take(&acting, &before, &known, &CORRELATIONS);
        learnt.count(taken, &CORRELATIONS);
    }
}

#[test]
fn another_car_is_found_within_a_few_shifts_and_the_same_car_is_kept() {
    let mut seed = 3;
    let car = |place: usize| if place < INERTIA_AT { 1.2 } else { 0.0 };
    let mut learnt = Learnt::nothing(&CORRELATIONS);
    shown_by(car, &mut learnt, 40, &mut seed);
    // Less than the truth: a part is taken for one of converter and inertia, which show the same.
    assert!(learnt.mean[1] > 0.7 && learnt.odds > 4.0, "{} {}", learnt.mean[1], learnt.odds);
    // The same car in another drive.
    let mut same = learnt.doubted(&CORRELATIONS);
    assert!((same.mean[1] - 0.5 * learnt.mean[1]).abs() < 1e-12 && same.covariance[1][1] > 0.5);
    shown_by(car, &mut same, 8, &mut seed);
    assert!(same.mean[1] > 0.7 && same.odds > 4.0, "{} {}", same.mean[1], same.odds);
    // Another car, in the same drive and in another one.
    let other = |place: usize| -car(place);
    for (mut learnt, shifts) in [(learnt, 8), (learnt.doubted(&CORRELATIONS), 4)] {
        shown_by(other, &mut learnt, shifts, &mut seed);
        assert!(learnt.mean[1] < -0.5 && learnt.is_sound(), "{} {}", learnt.mean[1], learnt.odds);
    }
}

#[test]
fn what_the_odds_are_against_is_given_less_weight() {
    let (acting, mut seed) = (shift(), 3);
    let mut learnt = Learnt::nothing(&CORRELATIONS);
    shown_by(|place| if place < KISS_AT { 1.2 } else { 0.0 }, &mut learnt, 40, &mut seed);
    let known = |odds: f64| {
        let mut learnt = learnt;
        learnt.odds = odds;
        learnt.known(&acting, &CORRELATIONS)
    };
    let (sure, even, against) = (known(4.6), known(0.0), known(-4.6));
    assert!((even.mean[0] - 0.5 * learnt.of_car(&acting).mean[0]).abs() < 1e-12);
    assert!(sure.mean[0] > 0.98 * learnt.of_car(&acting).mean[0] && against.mean[0] < 0.02 * sure.mean[0]);
    assert!(sure.covariance[0][0] < even.covariance[0][0] && even.covariance[0][0] > 0.5);
    let budget = Learnt::nothing(&CORRELATIONS).of_car(&acting);
    assert!((against.covariance[0][0] - budget.covariance[0][0]).abs() < 0.02);
}

/// Shafts that are softer show all torques larger, in each shift alike, and so does what the equations of a shift have wrong: shifts do
/// not tell either from the torques of converter and engine, and do not move them.
#[test]
fn shifts_that_show_all_torques_larger_leave_converter_and_engine_as_they_were() {
    let mut learnt = Learnt::nothing(&CORRELATIONS);
    learnt.take_capacity(0.02, [0.058, 0.046], 1e-6);
    let before_any = learnt;
    for at in (0..400).map(|k| k % 5) {
        let acting = Acting::new([at, at + 1].map(ShiftElement::at), Some(at), [PART; 2], STIFFNESS);
        let before = learnt.known(&acting, &CORRELATIONS);
        let mut known = before;
        for (a, value) in STIFFNESS.into_iter().enumerate() {
            let h = core::array::from_fn(|b| if a == b { 1.0 } else { 0.0 });
            known = after(&known, &h, value, 0.1);
        }
        assert!(learnt.take(&acting, &before, &known, &CORRELATIONS));
    }
    for k in [TURBINE_AT, STIFFNESS_AT, REPORTED_AT] {
        assert_eq!(learnt.mean[k], before_any.mean[k], "{k}");
        assert_eq!(learnt.covariance[k][k], before_any.covariance[k][k], "{k}");
    }
    // The friction of elements is corrected, and the covariance stays one.
    assert!(learnt.mean[1] > 0.1 && learnt.covariance[1][1] < 0.9 && learnt.is_sound(), "{}", learnt.mean[1]);
}

/// However many shifts there are, what is said of a quantity is no better known than what they all have wrong alike, and of a car that
/// has learnt nothing it is the budget.
#[test]
fn what_is_said_of_a_quantity_keeps_the_error_that_all_shifts_have_in_common() {
    let mut learnt = Learnt::nothing(&CORRELATIONS);
    for k in 0..LEARNT {
        assert_eq!((learnt.mean_of(k), learnt.covariance_of(k, k)), (0.0, 1.0), "{k}");
    }
    let places = [1, KISS_AT + 1, INERTIA_AT + 1, LAG_AT + 1, DELAY_AT + 1];
    // One measurement `a + u` of variance `r`, or many of them: the mean and variance with `u` in closed form.
    for (k, (r, value)) in places.into_iter().flat_map(|k| [(3.0, 1.0), (0.3, 1.0), (1e-3, 1.0)].map(|of| (k, of))) {
        let beta = variance_in_common(k);
        (learnt.mean[k], learnt.covariance[k][k]) = (value / (1.0 + r), r / (1.0 + r));
        assert!((learnt.mean_of(k) - value / (1.0 + r + beta)).abs() < 1e-12, "{k} {r}");
        assert!((learnt.covariance_of(k, k) - (r + beta) / (1.0 + r + beta)).abs() < 1e-12, "{k} {r}");
        assert!(learnt.covariance_of(k, k) > beta / (1.0 + beta), "{k} {r}");
    }
    // More than unlearnt, as after a mixture with the budget.
    learnt.covariance[1][1] = 1.3;
    assert_eq!((learnt.mean_of(1), learnt.covariance_of(1, 1)), (learnt.mean[1], 1.3));
}

#[test]
fn the_scale_of_the_wheel_speed_is_kept_within_its_bounds_and_apart_from_all_else() {
    let mut learnt = Learnt::nothing(&CORRELATIONS);
    assert_eq!(learnt.of_wheel(), [0.0, 1.0]);
    learnt.keep_wheel(0.8, 1e-9);
    assert_eq!(learnt.of_wheel(), [0.8, WHEEL_MIN]);
    for wrong in [[f64::NAN, 0.1], [0.1, f64::NAN], [f64::INFINITY, 0.1]] {
        learnt.keep_wheel(wrong[0], wrong[1]);
        assert_eq!(learnt.of_wheel(), [0.8, WHEEL_MIN], "{wrong:?}");
    }
    learnt.keep_wheel(-9.0, 7.0);
    assert_eq!(learnt.of_wheel(), [-EDGE, 1.0]);
    learnt.keep_wheel(0.8, 0.01);
    // Shifts show nothing of it, and a day takes little away.
    let mut seed = 7;
    shown_by(|_| 0.5, &mut learnt, 8, &mut seed);
    learnt.pass(24.0 * 3600.0, &CORRELATIONS);
    let [mean, variance] = learnt.of_wheel();
    assert!((mean - 0.8).abs() < 0.03 && variance < 0.06 && learnt.is_sound(), "{mean} {variance}");
    // Another drive may be of another car, and another car has other tyres.
    let [doubted, open] = learnt.doubted(&CORRELATIONS).of_wheel();
    assert!((doubted - 0.5 * mean).abs() < 1e-12 && open > 0.5);
    shown_by(|place| if place < INERTIA_AT { 1.2 } else { 0.0 }, &mut learnt, 40, &mut seed);
    shown_by(|place| if place < INERTIA_AT { -1.2 } else { 0.0 }, &mut learnt, 8, &mut seed);
    assert_eq!(learnt.of_wheel()[0], 0.0);
}

#[test]
fn what_depends_on_the_oil_is_forgotten_with_its_temperature() {
    let mut learnt = Learnt::nothing(&CORRELATIONS);
    for place in [1, KISS_AT + 1, INERTIA_AT + 2, TURBINE_AT, STIFFNESS_AT, WHEEL_AT, LAG_AT + 1, DELAY_AT + 1] {
        learnt.mean[place] = 0.8;
    }
    // The first reading says nothing of a change, nor does the noise of a sensor.
    let mut noise_s = learnt.take_oil(80.0);
    for reading in 0..1000 {
        noise_s += learnt.take_oil(80.0 + f64::from(reading % 7) - 3.0);
    }
    assert_eq!(noise_s, 0.0);
    // What is no temperature of oil is not taken.
    for wrong in [f64::NAN, f64::INFINITY, -273.0, 1e9] {
        assert_eq!((learnt.take_oil(wrong), learnt.oil_degc), (0.0, Some(80.0)));
    }
    // By 40 K as in two hours, at once or slowly.
    let slowly: f64 = (0..=400).map(|step| learnt.take_oil(80.0 - 0.1 * f64::from(step))).sum();
    let at_once = learnt.take_oil(80.0);
    assert!(
        (slowly - WITH_OIL_S).abs() < 0.05 * WITH_OIL_S && (at_once - WITH_OIL_S).abs() < 0.05 * WITH_OIL_S,
        "{slowly} {at_once}"
    );
    learnt.pass(WITH_OIL_S, &CORRELATIONS);
    let left = (-1.0_f64).exp();
    for (place, fraction) in [
        (1, left),
        (KISS_AT + 1, left),
        (TURBINE_AT, left),
        (LAG_AT + 1, left),
        (DELAY_AT + 1, left),
        (INERTIA_AT + 2, 1.0),
        (STIFFNESS_AT, 1.0),
        (WHEEL_AT, 1.0),
    ] {
        assert!((learnt.mean[place] / 0.8 - fraction).abs() < 3e-3, "{place}: {}", learnt.mean[place]);
    }
}

/// Two errors of which only the sum is seen: each gets its part of it, and the same sum again is no news.
#[test]
fn a_reported_torque_moves_the_capacity_by_its_fraction_of_the_variance_and_once() {
    let (std_devs, noise) = ([0.05, 0.035], 1e-8);
    let part = 0.05_f64.powi(2) / (0.05_f64.powi(2) + 0.035_f64.powi(2));
    let mut learnt = Learnt::nothing(&CORRELATIONS);
    let capacity = |learnt: &Learnt<f64>| 0.05 * learnt.mean[TURBINE_AT];
    learnt.take_capacity(0.04, std_devs, noise);
    let (once, left) = (capacity(&learnt), learnt.covariance[TURBINE_AT][TURBINE_AT]);
    assert!((once - 0.04 * part).abs() < 1e-5 && (left - (1.0 - part)).abs() < 1e-3, "{once} {left}");
    (0..100).for_each(|_| learnt.take_capacity(0.04, std_devs, noise));
    assert!((capacity(&learnt) - once).abs() < 1e-3, "{}", capacity(&learnt));
    assert!(learnt.covariance[TURBINE_AT][TURBINE_AT] > 0.9 * left && learnt.checked().is_some());
    // Of neither of these cars, and no numbers.
    let known = learnt;
    for fraction in [0.2, -0.3, f64::NAN, f64::INFINITY] {
        learnt.take_capacity(fraction, std_devs, noise);
    }
    for (std_devs, noise) in [([f64::NAN, 0.1], 0.1), ([0.05, 0.035], f64::NAN), ([0.0, 0.0], 0.0)] {
        learnt.take_capacity(0.01, std_devs, noise);
    }
    assert_eq!(learnt, known);
}

/// In single precision too, for as long as a car lives.
#[test]
fn a_hundred_thousand_comparisons_leave_a_covariance() {
    let correlations = CORRELATIONS.map(|correlation| correlation as f32);
    let (mut learnt, mut seed) = (Learnt::<f32>::nothing(&correlations), 7);
    for _ in 0..100_000 {
        learnt.take_capacity(0.1 * random(&mut seed) as f32, [0.05, 0.035], 1e-3);
    }
    assert!(learnt.checked().is_some(), "{learnt:?}");
}

#[test]
fn lag_and_delay_are_learnt_by_element_as_far_as_they_last() {
    let (mut learnt, mut seed) = (Learnt::nothing(&CORRELATIONS), 11);
    assert_eq!(learnt.known_timing(2, PART), ValveTiming::unlearnt());
    let car = |place: usize| match place {
        LAG_AT..DELAY_AT => 1.0,
        DELAY_AT.. => -0.8,
        _ => 0.0,
    };
    shown_by(car, &mut learnt, 40, &mut seed);
    for at in 0..5 {
        let ValveTiming { mean: [lag, delay], variance } = learnt.known_timing(at, PART);
        // The first and the last were in ten shifts, in each with a part that does not last.
        let off = [lag / PART.sqrt() - 1.0, delay / PART.sqrt() + 0.8];
        assert!(off.iter().all(|off| off.abs() < 0.15), "{off:?}");
        assert!(variance.iter().all(|variance| (0.25..0.35).contains(variance)), "{variance:?}");
    }
    // No shift had these elements, and there is no ninth.
    for at in [5, MAX_ELEMENTS, usize::MAX] {
        assert_eq!(learnt.known_timing(at, PART), ValveTiming::unlearnt(), "{at}");
    }
    // What the odds are against is not taken off.
    learnt.odds = -4.6;
    let ValveTiming { mean, variance } = learnt.known_timing(1, PART);
    assert!(mean.iter().all(|mean| mean.abs() < 0.02) && variance.iter().all(|variance| *variance > 0.98));
}

/// A one-way clutch is in a shift without a place in the tables: nothing is learnt of it.
#[test]
fn an_element_that_is_not_in_the_tables_has_no_place() {
    let acting =
        Acting::new([ShiftElement::OneWay, ShiftElement::Friction(1)], Some(MAX_PAIRS), [PART; 2], [0.0; ACTING]);
    for (a, expected) in [(1, 1), (3, KISS_AT + 1), (5, TURBINE_AT), (8, LAG_AT + 1), (9, DELAY_AT + 1)] {
        assert_eq!(acting.place(a), Some(expected), "{a}");
    }
    for a in [0, 2, 4, 6, 7] {
        assert_eq!(acting.place(a), None, "{a}");
    }
}
