//! An element that is engaged in a gear and slips there, and valves that do not do what is commanded.
//!
//! A clutch that slips takes power: the turbine turns faster than in the gear while it drives, and slower while the car drives it; one that is open
//! leaves the turbine without torque. Which element it is, the speeds of turbine and output alone do not show; the gears do. It is engaged in every
//! gear that slips, and it has held no more than in a slip. Where the speeds of a gear are those of another one, elements hold that are not
//! commanded. A shift whose commands have been those of its new gear for long counts as that gear: a clutch that does not open or close is no reason
//! for the shift controller to end it.

use car::{Car, ErrorBudget};
use observer::{Health, Reading, ShiftTables};

use super::check::{Check, CheckedRow};
use super::in_gear::RATIO_FROM_RAD_S;
use super::pressing::Pressing;
use super::ratio_histogram::RatioHistogram;

/// A gear counts after so long, s, and a slip after so long, s \[chosen\]: gear signals come late, and a reading may be wrong.
const STEADY_S: f64 = 1.0;
const LASTS_S: f64 = 0.3;
/// The commands of a gear in a shift to it count after so long, s \[chosen\]: an inertia phase takes up to 1 s.
const COMMANDED_S: f64 = 2.0;
/// Fraction of the turbine speed in the gear and slip beside it, rad/s, up to which the gear holds, and above which it slips \[chosen\].
const HOLDS: (f64, f64) = (0.02, 2.0);
const SLIPS: (f64, f64) = (0.04, 5.0);
/// Turbine torque up to which the direction of the power is not known, N m \[chosen\].
const MIN_N_M: f64 = 10.0;
/// Rows that are needed in a gear that slips, and in gears that hold \[chosen\].
const ENOUGH: u64 = 30;
const ENOUGH_HOLD: u64 = 100;
/// Fraction of the rows whose ratio is near the middle one from which on it is a ratio, and no slip, and how near \[chosen\].
const CONSTANT: (f64, f64) = (0.8, 0.02);
/// An element that has held so many times what it would have had to hold in a slip is sound \[chosen\]: the torque of the converter errs by its maps.
const SOUND: f64 = 1.5;

/// Rows in a gear that do not fit it.
#[derive(Default)]
struct OfGear {
    rows: u64,
    time_s: f64,
    /// Turbine speed over that of the gear.
    ratio: RatioHistogram<300>,
}

/// A slip that goes on.
#[derive(Clone, Copy)]
struct Slipping {
    gear: usize,
    since_s: f64,
    /// Largest turbine torque in it, N m.
    turbine_n_m: f64,
    lasts: bool,
}

/// What the log shows so far.
pub(crate) struct SlippingElements<'c> {
    car: &'c Car,
    pressing: Pressing,
    /// The gear, and whether the commands alone are those of it, in a shift.
    gear: Option<(usize, bool)>,
    /// Since when it is this gear or the commands are those of it, and since when it holds, s.
    since_s: f64,
    holds_since_s: Option<f64>,
    slipping: Option<Slipping>,
    /// Engine torque that was reported last, N m.
    reported_n_m: Option<f64>,
    gears: Vec<OfGear>,
    rows_that_hold: u64,
    first_s: Option<f64>,
    /// By element, the least of what it would have had to hold in a slip, and the largest torque that it has held since the first, N m.
    slipped_n_m: Vec<f64>,
    held_n_m: Vec<f64>,
}

impl<'c> SlippingElements<'c> {
    pub(super) fn new(car: &'c Car, tables: &ShiftTables<f64>, budget: &ErrorBudget) -> Self {
        let elements = car.gearbox.elements.len();
        Self {
            car,
            pressing: Pressing::new(car, tables, budget),
            gear: None,
            since_s: f64::NAN,
            holds_since_s: None,
            slipping: None,
            reported_n_m: None,
            gears: car.gearbox.gears.iter().map(|_| OfGear::default()).collect(),
            rows_that_hold: 0,
            first_s: None,
            slipped_n_m: vec![f64::INFINITY; elements],
            held_n_m: vec![0.0; elements],
        }
    }

    /// Torque at the gearbox input, N m, with the newest speeds of engine and turbine, rad/s; `None` where it is not known.
    fn turbine_n_m(&self, row: &CheckedRow<'_>) -> Option<f64> {
        let [engine, turbine, _] = row.came_rad_s;
        let torque_n_m: f64 = match &self.car.converter {
            Some(converter) if !row.step.input.lock_up_applied => converter.torques(engine, turbine).turbine_n_m,
            _ => self.reported_n_m?,
        };
        torque_n_m.is_finite().then_some(torque_n_m)
    }

    /// The gear to which a shift goes, if the commands of a row are those of it: what it engages presses, what it opens does not, and nothing else
    /// does. At least one of these changes in the shift.
    fn commanded(&self, row: &CheckedRow<'_>) -> Option<usize> {
        let gears = row.step.input.gear;
        let (from, to) = (gears.from.place()?, gears.to.place()?);
        let has_plates = |element: &usize| self.car.clutches.get(*element).is_some_and(Option::is_some);
        let mut changes = false;
        let mut all = (0..self.car.gearbox.elements.len()).filter(has_plates);
        let is_of_gear = all.all(|element| {
            let (engaged, presses) =
                ([from, to].map(|gear| self.engages(gear, element)), self.pressing.of(element, row));
            changes |= engaged[0] != engaged[1];
            match engaged {
                [_, true] => presses == Some(true),
                [true, false] => presses == Some(false),
                [false, false] => presses != Some(true),
            }
        });
        (is_of_gear && changes).then_some(to)
    }

    /// Whether turbine and output speed of a row in a shift are fast enough to be compared with those of this gear.
    fn is_compared(&self, row: &CheckedRow<'_>, gear: usize) -> bool {
        let [_, turbine, output] = row.came_rad_s;
        // Without a converter the turbine turns with the engine at a standstill.
        let has_converter = self.car.converter.is_some();
        let by_turbine = if has_converter { turbine / self.car.gearbox.gears[gear].ratio } else { f64::NAN };
        output.max(by_turbine) > RATIO_FROM_RAD_S && !(turbine + output).is_nan()
    }

    /// Takes a row in a gear, or with the commands of one.
    fn in_gear(&mut self, row: &CheckedRow<'_>, gear: usize) {
        let (car, [_, turbine, output]) = (self.car, row.came_rad_s);
        let in_gear = car.gearbox.gears[gear].ratio * output;
        let slip = turbine - in_gear;
        let over = |(fraction, beside): (f64, f64)| slip.abs() > fraction * in_gear.abs() + beside;
        if over(SLIPS) {
            let overruns = slip < 0.0 && car.gearbox.one_way_clutch_of(gear).is_some();
            let turbine_n_m = self.turbine_n_m(row).filter(|n_m| n_m * slip.signum() > -MIN_N_M && !overruns);
            self.holds_since_s = None;
            match turbine_n_m {
                Some(turbine_n_m) => self.slips(row, (gear, turbine / in_gear), turbine_n_m.abs()),
                None => self.end_slip(),
            }
            return;
        }
        self.end_slip();
        let time_s = row.step.time_s;
        let since_s = (!over(HOLDS)).then(|| *self.holds_since_s.get_or_insert(time_s));
        self.holds_since_s = since_s;
        if since_s.is_some_and(|since_s| time_s - since_s >= LASTS_S) {
            self.rows_that_hold += 1;
            self.holds(row, gear);
        }
    }

    /// Takes a row in which the gear holds: after the first slip, what its elements hold.
    fn holds(&mut self, row: &CheckedRow<'_>, gear: usize) {
        let Some(turbine_n_m) = self.first_s.and_then(|_| self.turbine_n_m(row)) else { return };
        for of in &self.car.gearbox.gears[gear].holding {
            let held_n_m = &mut self.held_n_m[of.element];
            *held_n_m = held_n_m.max((of.per_turbine_torque * turbine_n_m).abs());
        }
    }

    /// Takes a row in which the gear slips, with turbine speed over that of the gear, and the size of the turbine torque, N m.
    fn slips(&mut self, row: &CheckedRow<'_>, (gear, ratio): (usize, f64), turbine_n_m: f64) {
        let time_s = row.step.time_s;
        let new = Slipping { gear, since_s: time_s, turbine_n_m, lasts: false };
        let slipping = self.slipping.get_or_insert(new);
        slipping.turbine_n_m = slipping.turbine_n_m.max(turbine_n_m);
        slipping.lasts |= time_s - slipping.since_s >= LASTS_S;
        if slipping.lasts {
            self.first_s.get_or_insert(slipping.since_s);
            let of_gear = &mut self.gears[gear];
            of_gear.rows += 1;
            of_gear.time_s += row.step.input.dt_s.clamp(0.0, 1.0);
            of_gear.ratio.push(ratio);
        }
    }

    /// Neither slips nor holds for now.
    fn pause(&mut self) {
        self.end_slip();
        self.holds_since_s = None;
    }

    /// Ends a slip: what each element would have had to hold.
    fn end_slip(&mut self) {
        let Some(slip) = self.slipping.take().filter(|slip| slip.lasts) else { return };
        for of in &self.car.gearbox.gears[slip.gear].holding {
            let slipped_n_m = &mut self.slipped_n_m[of.element];
            *slipped_n_m = slipped_n_m.min((of.per_turbine_torque * slip.turbine_n_m).abs());
        }
    }

    /// Gears that slip, and pairs of a gear and the one whose ratio it has.
    fn found(&self) -> (Vec<usize>, Vec<[usize; 2]>) {
        let (mut slipping, mut others) = (Vec::new(), Vec::new());
        if self.rows_that_hold < ENOUGH_HOLD {
            return (slipping, others);
        }
        for (gear, of_gear) in self.gears.iter().enumerate().filter(|(_, of_gear)| of_gear.rows >= ENOUGH) {
            let middle = of_gear.ratio.middle();
            let (fraction, near) = CONSTANT;
            if of_gear.ratio.fraction_near(middle, near) < fraction {
                slipping.push(gear);
                continue;
            }
            let gears = &self.car.gearbox.gears;
            let ratio = middle * gears[gear].ratio;
            let is_other = |other: &usize| *other != gear && (gears[*other].ratio / ratio - 1.0).abs() <= near;
            others.extend((0..gears.len()).find(is_other).map(|other| [gear, other]));
        }
        (slipping, others)
    }

    /// Whether a gear slips, or its speeds are those of another one.
    pub(crate) fn is_found_in(&self, gear: usize) -> bool {
        let (slipping, others) = self.found();
        slipping.contains(&gear) || others.iter().any(|[of, _]| *of == gear)
    }

    /// Whether the log shows an element that does not hold where it should.
    pub(crate) fn is_found(&self) -> bool {
        let (slipping, others) = self.found();
        !(slipping.is_empty() && others.is_empty())
    }

    fn engages(&self, gear: usize, element: usize) -> bool {
        self.car.gearbox.gears[gear].holding.iter().any(|of| of.element == element && of.per_turbine_torque != 0.0)
    }

    fn name(&self, element: usize) -> &str {
        &self.car.gearbox.elements[element].name
    }

    fn gear_names(&self, gears: &[usize]) -> String {
        gears.iter().map(|gear| self.car.gearbox.gears[*gear].name.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The elements of all gears that slip which have not held more.
    fn suspects(&self, gears: &[usize]) -> Vec<usize> {
        let is_in_all = |element: &usize| gears.iter().all(|gear| self.engages(*gear, *element));
        let is_sound = |element: &usize| self.held_n_m[*element] > SOUND * self.slipped_n_m[*element];
        let elements = 0..self.car.gearbox.elements.len();
        elements.filter(|element| is_in_all(element) && !is_sound(element)).collect()
    }

    /// The gears that slip, in a sentence.
    fn of_slip(&self, gears: &[usize]) -> Option<String> {
        let first_s = self.first_s.filter(|_| !gears.is_empty())?;
        let time_s: f64 = gears.iter().map(|gear| self.gears[*gear].time_s).sum();
        let when = format!("in gear {} since {first_s:.1} s, for {time_s:.1} s in all", self.gear_names(gears));
        let suspects = self.suspects(gears);
        let names = suspects.iter().map(|element| self.name(*element)).collect::<Vec<_>>().join(", ");
        Some(match suspects.len() {
            0 => format!(
                "warning: clutches or brakes slip {when}: no single element explains it\nhint: check the line pressure and the oil, and the torques of the vehicle file"
            ),
            1 => format!(
                "warning: {names} slips {when}: it is engaged there and has held no more torque since\nhint: check its plates, its valve, its pressure and the line pressure"
            ),
            _ => format!(
                "warning: one of {names} slips {when}: they are engaged there and have held no more torque since\nhint: the gears of this log do not separate them; check their plates, valves and pressures"
            ),
        })
    }

    /// Elements of the first gear that the second one does not engage.
    fn only_in(&self, gear: usize, other: usize) -> Vec<usize> {
        let elements = 0..self.car.gearbox.elements.len();
        elements.filter(|element| self.engages(gear, *element) && !self.engages(other, *element)).collect()
    }

    /// Whether elements that hold without their commands in all of several pairs are to be open in a gear: then that cannot but slip.
    fn is_held(&self, gear: usize, pairs: &[[usize; 2]]) -> bool {
        let mut all = pairs.iter().map(|[gear, other]| self.only_in(*other, *gear));
        let Some(held) = all.next().filter(|held| !held.is_empty() && pairs.len() > 1) else { return false };
        all.all(|other| other == held) && held.iter().all(|element| !self.engages(gear, *element))
    }

    /// The gears that are others, in a sentence.
    fn of_others(&self, pairs: &[[usize; 2]]) -> Option<String> {
        let changed: Vec<[Vec<usize>; 2]> =
            pairs.iter().map(|[gear, other]| [self.only_in(*gear, *other), self.only_in(*other, *gear)]).collect();
        let is_swapped = |[off, on]: &&[Vec<usize>; 2]| changed.iter().any(|pair| pair[0] == *on && pair[1] == *off);
        let swapped = changed.iter().find(is_swapped);
        let [off, on] = swapped.or(changed.first())?;
        let which = pairs.iter().map(|[gear, other]| {
            format!("those of gear {1} in gear {0}", self.gear_names(&[*gear]), self.gear_names(&[*other]))
        });
        let which = which.collect::<Vec<_>>().join(", ");
        let first_s = self.first_s.unwrap_or(f64::NAN);
        let names = |of: &[usize]| of.iter().map(|element| self.name(*element)).collect::<Vec<_>>().join(", ");
        let many = |of: &[usize]| of.len() > 1;
        let holds = |of: &[usize]| if many(of) { "hold" } else { "holds" };
        let holds_not = |of: &[usize]| if many(of) { "do not hold" } else { "does not hold" };
        let its_command = |of: &[usize]| if many(of) { "their commands" } else { "its command" };
        let its_valve = |of: &[usize]| if many(of) { "their valves are stuck" } else { "its valve is stuck" };
        let same_on = changed.iter().all(|pair| pair[1] == *on);
        let same_off = changed.iter().all(|pair| pair[0] == *off);
        let cause = if swapped.is_some() {
            format!(
                "{} and {} hold in each other's place: their valves or connectors are swapped",
                names(off),
                names(on)
            )
        } else if same_on && (pairs.len() > 1 || !same_off) {
            format!("{} {} without {}: {}", names(on), holds(on), its_command(on), its_valve(on))
        } else if same_off && pairs.len() > 1 {
            format!("{} {} in spite of {}: {}", names(off), holds_not(off), its_command(off), its_valve(off))
        } else {
            format!(
                "{} {} in spite of {}, and {} {} without one",
                names(off),
                holds_not(off),
                its_command(off),
                names(on),
                holds(on)
            )
        };
        Some(format!(
            "warning: the speeds are {which}, since {first_s:.1} s: {cause}\nhint: check these valves and their connectors; also possible: `gear` is not that of the car, or the gearbox file has other gears"
        ))
    }
}

impl Check for SlippingElements<'_> {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let input = &row.step.input;
        let reported = row.step.reported_n_m.or(input.engine_n_m).map(|Reading { value, .. }| value);
        self.reported_n_m = reported.filter(|value| value.is_finite()).or(self.reported_n_m);
        self.pressing.push(row);
        let gear = match input.gear.is_steady() {
            true => input.gear.from.place().map(|gear| (gear, false)),
            false => self.commanded(row).map(|gear| (gear, true)),
        };
        if gear != self.gear || row.is_hole {
            (self.gear, self.since_s) = (gear, row.step.time_s);
            self.pause();
        }
        let channels = &row.estimate.channels;
        let is_free = matches!(row.estimate.health, Health::ClutchOpen | Health::OneWayOverruns | Health::TooSlow);
        let is_read = !row.has_ended && !channels.turbine.is_refused() && !channels.output.is_refused();
        let (steady_s, is_compared) = match gear {
            Some((gear, true)) => (COMMANDED_S, self.is_compared(row, gear)),
            _ => (STEADY_S, row.in_gear.as_ref().is_some_and(|of| of.is_compared)),
        };
        let is_steady = row.step.time_s - self.since_s >= steady_s;
        match gear.filter(|_| is_compared && is_read && is_steady && !is_free) {
            Some((gear, _)) => self.in_gear(row, gear),
            None => self.pause(),
        }
    }

    fn warnings(&self) -> Vec<String> {
        let (mut slipping, others) = self.found();
        slipping.retain(|gear| !self.is_held(*gear, &others));
        self.of_slip(&slipping).into_iter().chain(self.of_others(&others)).collect()
    }
}
