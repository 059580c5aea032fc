//! The gears that a log names.

use car::{Car, Gear, ShiftCommand};
use observer::Reading;

/// Values that a message names.
const NAMED: usize = 5;

/// A shift is done by the readings if the turbine has at most this fraction of the way to the new gear before it, with the output at least
/// so fast, rad/s \[chosen\]: a late `gear` leaves the turbine at the new gear, a change of mind comes before it is there.
const LEFT_OF_WAY: f64 = 0.05;
const OUTPUT_RAD_S: f64 = 20.0;

/// Samples of a gear signal, and those of a gear that the gearbox does not have: after such a one the gear before stands.
struct GearSignal {
    /// Its name.
    name: &'static str,
    samples: u64,
    unknown: u64,
    /// The first unknown values.
    values: Vec<String>,
}

impl GearSignal {
    fn new(name: &'static str) -> Self {
        Self { name, samples: 0, unknown: 0, values: Vec::new() }
    }

    /// Takes a sample: the gear if the gearbox has it, and the value as the log has it.
    fn take(&mut self, found: Option<Gear>, value: impl FnOnce() -> String) -> Option<Gear> {
        self.samples += 1;
        if found.is_none() {
            self.unknown += 1;
            if self.values.len() < NAMED {
                let value = value();
                if !self.values.contains(&value) {
                    self.values.push(value);
                }
            }
        }
        found
    }

    /// What was met, in a sentence.
    ///
    /// # Errors
    /// Most samples are unknown; holds what to say of it, with `gears` as a hint.
    fn note(&self, gears: &str) -> Result<Option<String>, String> {
        let Self { name, samples, unknown, values } = self;
        if *unknown == 0 {
            return Ok(None);
        }
        let met = format!(
            "{unknown} of {samples} samples of {name} are no gear of this gearbox ({}) and are not used",
            values.join(", ")
        );
        if 2 * unknown > *samples {
            return Err(format!("{met}\nhint: {gears}"));
        }
        Ok(Some(format!(
            "{met}: the gear before is kept\nhint: 0, N and P mean no gear, -1 and R reverse: `scale` and `offset` in a channel map make other numbers these, and \
             `valid_range` of `channel.{name}` leaves out those that mean no signal"
        )))
    }
}

/// Whether the turbine is at the first of two gears by its speed and that of the output.
fn fits(car: &Car, gears: [Gear; 2], [turbine, output]: [f64; 2]) -> bool {
    let [of, other] = gears.map(|gear| car.ratio(gear).map_or(f64::NAN, |ratio| ratio * output));
    output > OUTPUT_RAD_S && (turbine - of).abs() < LEFT_OF_WAY * (of - other).abs()
}

/// What a log says of gear and target gear, up to a row.
pub(super) struct Gears {
    /// Of `gear` and `target_gear`.
    signals: [GearSignal; 2],
    /// The newest gear and target gear that the gearbox has.
    newest: [Option<Gear>; 2],
    /// The newest speeds of turbine and output, rad/s.
    speeds_rad_s: [f64; 2],
    /// Of the row before: `gear`, and what the filter was shown.
    before: Option<(Gear, ShiftCommand)>,
    /// The gear that is left while `gear` is still the one before it, and how often this was so.
    left: Option<Gear>,
    late: u64,
    /// The last gear that was engaged since neutral was asked for; whether it stands for a neutral `gear` now, and how often it did.
    engaged: Option<Gear>,
    is_neutral: bool,
    neutral: u64,
    /// Changes of gear and target gear.
    changes: [u64; 2],
    exchanged: Exchanged,
}

/// Shifts that begin with the speeds of the gear that they go to and end in the gear that they come from, with its speeds: `gear` and
/// `target_gear` are exchanged. And all that are as they should be.
#[derive(Default)]
struct Exchanged {
    /// The shift under way, and whether it began with the speeds of its old or of its new gear.
    open: Option<([Gear; 2], [bool; 2])>,
    shifts: u64,
    right: u64,
}

impl Exchanged {
    /// Takes what is shown in a row, and a test of the speeds: whether they are those of a gear and not of another.
    fn row(&mut self, shown: ShiftCommand, fits: impl Fn(Gear, Gear) -> bool) {
        let gears = [shown.from, shown.to];
        match self.open {
            Some((open, _)) if open == gears => {}
            before => {
                if let Some(([from, to], [old, new])) = before
                    && shown.is_steady()
                {
                    self.shifts += u64::from(new && shown.to == from && fits(from, to));
                    self.right += u64::from(old && shown.to == to && fits(to, from));
                }
                let [from, to] = gears;
                self.open = (from != to).then(|| (gears, [fits(from, to), fits(to, from)]));
            }
        }
    }
}

impl Gears {
    pub(super) fn new(names: [&'static str; 2]) -> Self {
        Self {
            signals: names.map(GearSignal::new),
            newest: [None; 2],
            speeds_rad_s: [f64::NAN; 2],
            before: None,
            left: None,
            late: 0,
            engaged: None,
            is_neutral: false,
            neutral: 0,
            changes: [0; 2],
            exchanged: Exchanged::default(),
        }
    }

    /// Takes a sample of `gear` (0) or `target_gear` (1): the gear if the gearbox has it, and the value as the log has it.
    pub(super) fn take(&mut self, which: usize, found: Option<Gear>, value: impl FnOnce() -> String) {
        let newest = self.signals[which].take(found, value).or(self.newest[which]);
        self.changes[which] += u64::from(self.newest[which].is_some_and(|before| newest != Some(before)));
        self.newest[which] = newest;
    }

    /// Whether `gear` has had no sample.
    pub(super) fn is_without_gear(&self) -> bool {
        self.signals[0].samples == 0
    }

    /// Gear and target gear after the samples of a row with these speeds of turbine and output. Before the first gear there is none, before
    /// the first target gear it is the gear. Where the target goes on to a third gear before `gear` has changed, and the speeds are those of
    /// the first target, `gear` is late: the first target is the gear that is left. A `gear` that is neutral while the car moves on to
    /// a target gear is the one before: so some controllers say that a shift is under way.
    pub(super) fn row(&mut self, car: &Car, speeds: [Option<Reading<f64>>; 2]) -> ShiftCommand {
        for (newest, reading) in self.speeds_rad_s.iter_mut().zip(speeds) {
            *newest = reading.map_or(*newest, |reading| reading.value);
        }
        let Some(gear) = self.newest[0] else { return ShiftCommand::NEUTRAL };
        let to = self.newest[1].unwrap_or(gear);
        let gear = self.engaged(gear, to);
        let before = self.before.filter(|(before, _)| *before == gear && to != gear).map(|(_, shown)| shown);
        if before.is_none() {
            self.left = None;
        }
        if let Some(ShiftCommand { from, to: first }) = before
            && from != first
            && ![from, first].contains(&to)
            && self.is_done(car, [from, first])
        {
            self.left = Some(first);
            self.late += 1;
        }
        let shown = ShiftCommand { from: self.left.unwrap_or(gear), to };
        self.before = Some((gear, shown));
        let [turbine, output] = self.speeds_rad_s;
        self.exchanged.row(shown, |gear, other| fits(car, [gear, other], [turbine, output]));
        shown
    }

    /// The gear that is engaged, where `gear` may say neutral during a shift.
    fn engaged(&mut self, gear: Gear, to: Gear) -> Gear {
        let held =
            self.engaged.filter(|_| gear.is_neutral() && !to.is_neutral() && self.speeds_rad_s[1] > OUTPUT_RAD_S);
        self.neutral += u64::from(held.is_some() && !self.is_neutral);
        self.is_neutral = held.is_some();
        if held.is_none() {
            self.engaged = Some(gear).filter(|gear| !gear.is_neutral());
        }
        held.unwrap_or(gear)
    }

    /// Whether a shift between these gears is done by the speeds.
    fn is_done(&self, car: &Car, [from, to]: [Gear; 2]) -> bool {
        fits(car, [to, from], self.speeds_rad_s)
    }

    /// What was met in both signals, in sentences.
    ///
    /// # Errors
    /// Most samples of one are unknown, or both are exchanged; holds what to say of it, with `gears` as a hint.
    pub(super) fn notes(&self, gears: &str) -> Result<Vec<String>, String> {
        /// Shifts that are enough to tell, and changes of the target gear \[chosen\].
        const ENOUGH: u64 = 3;
        let notes = self.signals.iter().map(|signal| signal.note(gears));
        let mut notes: Vec<String> = notes.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
        let Exchanged { shifts, right, .. } = self.exchanged;
        if shifts >= ENOUGH && shifts > right {
            return Err(format!(
                "{shifts} shifts begin with the speeds of the gear that they go to, and end in the gear that they come from; {right} are as they should be\nhint: \
                 gear and target_gear are exchanged: `gear` is the one that is engaged, and `target_gear` changes first"
            ));
        }
        if self.changes[0] == 0 && self.changes[1] >= ENOUGH {
            notes.push(format!(
                "gear is the same in all samples, and target_gear changes {} times: shifts have no end, and most of them are missing or wrong\nhint: take the \
                 channel of the gear that is engaged",
                self.changes[1]
            ));
        }
        if self.neutral > 0 {
            notes.push(format!(
                "gear is neutral in a shift of a moving car ({} times): it counts as the gear before until it is another gear",
                self.neutral
            ));
        }
        if self.late > 0 {
            notes.push(format!(
                "gear is late ({} times): target_gear changed to another gear while gear was still the one before, and turbine and output speed \
                 fitted the first target: the shift to it counts as completed there\nhint: use a gear that changes when a shift is done, as the \
                 controller of the gearbox has it",
                self.late
            ));
        }
        Ok(notes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::CarFile;

    #[test]
    fn a_third_gear_is_a_late_gear_or_a_change_of_mind_by_the_speeds() {
        let car = eight_speed();
        let gear = |name: &str| Gear::at(car.gearbox.gear(name).unwrap());
        let ratio = |name: &str| car.ratio(gear(name)).unwrap();
        // Names of gear and target gear in rows with this turbine speed at the end of the first shift, the output at 100 rad/s.
        let shown = |rows: &[[&str; 2]], ratio: f64| {
            let mut gears = Gears::new(["gear", "target_gear"]);
            let reading = |value: f64| Some(Reading { value, age_s: 0.0 });
            let mut row = |names: &[&str; 2]| {
                names.iter().enumerate().for_each(|(which, name)| gears.take(which, Some(gear(name)), String::new));
                let ShiftCommand { from, to } = gears.row(&car, [reading(100.0 * ratio), reading(100.0)]);
                [from, to].map(|gear| car.gear_name(gear))
            };
            let shown: Vec<[&str; 2]> = rows.iter().map(&mut row).collect();
            (shown, gears.late, gears.notes("").unwrap().len())
        };
        let late = [["8", "8"], ["8", "6"], ["8", "5"], ["8", "5"], ["6", "5"], ["5", "5"]];
        let right = [["8", "8"], ["8", "6"], ["6", "5"], ["6", "5"], ["6", "5"], ["5", "5"]];
        assert_eq!(shown(&late, ratio("6")), (right.to_vec(), 1, 1));
        // The turbine is at the gear that is left, or on its way.
        for fraction in [0.0, 0.5, 0.9, 1.2] {
            let on_its_way = ratio("8") + fraction * (ratio("6") - ratio("8"));
            assert_eq!(shown(&late, on_its_way), (late.to_vec(), 0, 0), "{fraction}");
        }
        // `gear` never says 6, and three shifts follow each other. Back to the gear that is left is always a change of mind.
        let never = [["8", "6"], ["8", "5"], ["5", "5"]];
        assert_eq!(shown(&never, ratio("6")).0, [["8", "6"], ["6", "5"], ["5", "5"]]);
        let more = [["8", "6"], ["8", "5"], ["8", "4"], ["6", "4"]];
        assert_eq!(shown(&more, ratio("6")).0, [["8", "6"], ["6", "5"], ["6", "4"], ["6", "4"]]);
        let back = [["8", "6"], ["8", "8"], ["8", "5"]];
        assert_eq!(shown(&back, ratio("6")).0, back);
    }

    fn eight_speed() -> Car {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/eight_speed.toml");
        CarFile::read(std::path::Path::new(path)).unwrap().car
    }

    /// What is shown of rows of gear, target gear and the gear of the turbine's speed, all as names; the output turns this fast, rad/s.
    fn driven(rows: &[[&str; 3]], output: f64) -> (Vec<[String; 2]>, Result<Vec<String>, String>) {
        let car = eight_speed();
        let place = |name: &str| if name == "N" { Gear::Neutral } else { Gear::at(car.gearbox.gear(name).unwrap()) };
        let mut gears = Gears::new(["gear", "target_gear"]);
        let reading = |value: f64| Some(Reading { value, age_s: 0.0 });
        let mut row = |[gear, target, speeds]: &[&str; 3]| {
            [gear, target].iter().enumerate().for_each(|(at, name)| gears.take(at, Some(place(name)), String::new));
            let ratio = car.ratio(place(speeds)).unwrap();
            let ShiftCommand { from, to } = gears.row(&car, [reading(ratio * output), reading(output)]);
            [from, to].map(|gear| car.gear_name(gear).to_owned())
        };
        let shown = rows.iter().map(&mut row).collect();
        (shown, gears.notes(""))
    }

    #[test]
    fn a_neutral_gear_during_a_shift_of_a_car_that_moves_is_the_gear_before() {
        let shift = [["2", "2", "2"], ["2", "3", "2"], ["N", "3", "2"], ["N", "3", "3"], ["3", "3", "3"]];
        let (shown, notes) = driven(&shift, 100.0);
        assert_eq!(shown, [["2", "2"], ["2", "3"], ["2", "3"], ["2", "3"], ["3", "3"]]);
        assert!(notes.unwrap()[0].starts_with("gear is neutral in a shift of a moving car (1 times)"));
        // Neutral that is asked for is neutral, and so is what follows; a car that stands has garage shifts.
        let neutral = [["3", "3", "3"], ["3", "N", "3"], ["N", "N", "3"], ["N", "3", "3"], ["3", "3", "3"]];
        assert_eq!(driven(&neutral, 100.0).0, [["3", "3"], ["3", "N"], ["N", "N"], ["N", "3"], ["3", "3"]]);
        assert_eq!(driven(&shift, 10.0).0[2], ["N", "3"]);
    }

    #[test]
    fn gear_signals_that_are_exchanged_or_stand_still_are_said() {
        let up: Vec<[&str; 3]> = ["1", "2", "3", "4", "5"]
            .windows(2)
            .flat_map(|pair| {
                let [old, new] = [pair[0], pair[1]];
                [[old, old, old], [old, new, old], [old, new, new], [new, new, new]]
            })
            .collect();
        let exchanged: Vec<[&str; 3]> = up.iter().map(|[gear, target, speeds]| [*target, *gear, *speeds]).collect();
        assert_eq!(driven(&up, 100.0).1, Ok(Vec::new()));
        let error = driven(&exchanged, 100.0).1.unwrap_err();
        assert!(
            error.starts_with("4 shifts begin with the speeds") && error.contains("hint: gear and target_gear"),
            "{error}"
        );
        assert!(driven(&exchanged[..8], 100.0).1.is_ok(), "two shifts may be withdrawn ones");
        let frozen: Vec<[&str; 3]> = up.iter().map(|[_, target, speeds]| ["1", *target, *speeds]).collect();
        assert!(driven(&frozen, 100.0).1.unwrap()[0].starts_with("gear is the same in all samples"));
    }

    #[test]
    fn unknown_gears_are_counted_with_their_first_values() {
        let mut signal = GearSignal::new("gear");
        for value in [1, 1, 1, 1, 255, 1, 255] {
            let found = signal.take(Some(Gear::at(0)).filter(|_| value == 1), || value.to_string());
            assert_eq!(found.is_some(), value == 1);
        }
        let note = signal.note("").unwrap().unwrap();
        assert!(
            note.starts_with("2 of 7 samples of gear are no gear of this gearbox (255) and are not used"),
            "{note}"
        );
        for value in 20..40 {
            signal.take(None, || value.to_string());
        }
        let error = signal.note("use others").unwrap_err();
        assert!(error.contains("22 of 27") && error.contains("(255, 20, 21, 22, 23)"), "{error}");
        assert!(error.ends_with("hint: use others"), "{error}");
        assert_eq!(GearSignal::new("gear").note(""), Ok(None));
    }
}
