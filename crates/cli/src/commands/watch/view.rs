//! What is known of an estimate that goes on: the latest row, the last seconds, the shifts.

use std::collections::{HashMap, VecDeque};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use trace::{shown_units, signal};
use wetclutch::estimate::{LiveCell, LiveRows, shown_from_s};

/// Samples in the window, at most.
const SAMPLES: f64 = 2000.0;
/// Shifts that are kept.
const SHIFTS: usize = 200;
/// The rate of the rows is counted over so long, s, and none come if it was not counted for so long.
const RATE_S: f64 = 1.0;
const STALLED_S: f64 = 3.0;

/// A panel of curves.
pub(super) struct Panel {
    /// Its quantity with the unit.
    pub(super) label: &'static str,
    /// What a value of a column is multiplied by for this unit.
    scale: f64,
    pub(super) decimals: usize,
}

pub(super) const SPEED: usize = 0;
pub(super) const PRESSURE: usize = 1;
pub(super) const TORQUE: usize = 2;
pub(super) const DRIVELINE: usize = 3;
pub(super) const PANELS: [Panel; 4] = [
    Panel { label: "speed (rad/s)", scale: 1.0, decimals: 1 },
    Panel { label: "pressure (MPa)", scale: 1e-6, decimals: 3 },
    Panel { label: "clutch torque (N m)", scale: 1.0, decimals: 0 },
    Panel { label: "driveline torque (N m)", scale: 1.0, decimals: 0 },
];

/// A curve of a panel, and the columns of its range.
pub(super) struct Curve {
    pub(super) panel: usize,
    pub(super) name: &'static str,
    column: &'static str,
    range: Option<[&'static str; 2]>,
}

const fn curve(panel: usize, name: &'static str, column: &'static str) -> Curve {
    Curve { panel, name, column, range: None }
}

const fn ranged(panel: usize, name: &'static str, column: &'static str, range: [&'static str; 2]) -> Curve {
    Curve { panel, name, column, range: Some(range) }
}

/// The curves that are shown, where their columns are known.
pub(super) const CURVES: [Curve; 10] = [
    curve(SPEED, "engine", signal::ENGINE_SPEED),
    curve(SPEED, "turbine", signal::TURBINE_SPEED),
    curve(SPEED, "output", signal::OUTPUT_SPEED),
    curve(SPEED, "wheel", signal::WHEEL_SPEED),
    ranged(
        PRESSURE,
        "offgoing",
        "offgoing_pressure_estimate_pa",
        ["offgoing_pressure_least_pa", "offgoing_pressure_greatest_pa"],
    ),
    ranged(
        PRESSURE,
        "oncoming",
        "oncoming_pressure_estimate_pa",
        ["oncoming_pressure_least_pa", "oncoming_pressure_greatest_pa"],
    ),
    ranged(
        TORQUE,
        "offgoing",
        "offgoing_torque_estimate_n_m",
        ["offgoing_torque_least_n_m", "offgoing_torque_greatest_n_m"],
    ),
    ranged(
        TORQUE,
        "oncoming",
        "oncoming_torque_estimate_n_m",
        ["oncoming_torque_least_n_m", "oncoming_torque_greatest_n_m"],
    ),
    curve(DRIVELINE, "turbine", "turbine_torque_estimate_n_m"),
    curve(DRIVELINE, "drive shafts", "shaft_torque_estimate_n_m"),
];

/// A value with its range, in the unit that is shown; not numbers where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Value {
    pub(super) value: f64,
    pub(super) range: [f64; 2],
}

impl Value {
    const NONE: Self = Self { value: f64::NAN, range: [f64::NAN; 2] };
}

/// A row of the curves.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    pub(super) time_s: f64,
    pub(super) values: [Value; CURVES.len()],
}

/// A shift that was seen.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shift {
    pub(super) number: usize,
    pub(super) gears: String,
    pub(super) begin_s: f64,
    /// None while it goes on.
    pub(super) end_s: Option<f64>,
    /// Words of the health in it other than `good`.
    pub(super) health: Vec<String>,
}

/// What is known of the estimate.
#[derive(Debug, Default)]
pub(super) struct State {
    places: HashMap<String, usize>,
    cells: Vec<LiveCell>,
    /// From where on times are shown, s of the log's clock.
    pub(super) origin_s: f64,
    /// Time of the latest row, s.
    pub(super) time_s: f64,
    pub(super) rows: u64,
    pub(super) samples: VecDeque<Sample>,
    /// Samples that have left the window.
    pub(super) dropped: u64,
    pub(super) shifts: VecDeque<Shift>,
    /// Rows per second, and when and after how many rows that was found.
    rate: f64,
    counted: Option<(Instant, u64)>,
}

impl State {
    fn cell(&self, column: &str) -> Option<&LiveCell> {
        self.cells.get(*self.places.get(column)?)
    }

    fn number(&self, column: &str) -> f64 {
        if let Some(LiveCell::Number(number)) = self.cell(column) { *number } else { f64::NAN }
    }

    /// The word in a column; empty where there is none.
    pub(super) fn word(&self, column: &str) -> &str {
        if let Some(LiveCell::Word(word)) = self.cell(column) { word } else { "" }
    }

    /// Whether the estimates have this column.
    pub(super) fn has(&self, column: &str) -> bool {
        self.places.contains_key(column)
    }

    /// Whether the log, or the estimates, have the values of a curve.
    pub(super) fn has_curve(&self, curve: &Curve) -> bool {
        self.has(curve.column)
    }

    /// The latest values of the curves.
    pub(super) fn values(&self) -> [Value; CURVES.len()] {
        CURVES.map(|Curve { panel, column, range, .. }| {
            let shown = |column: &str| in_shown_unit(panel, self.number(column));
            Value { value: shown(column), range: range.map_or(Value::NONE.range, |range| range.map(shown)) }
        })
    }

    /// Names and pressures by the command of all elements, in the unit that is shown.
    pub(super) fn elements(&self) -> Vec<(String, Value)> {
        let mut elements: Vec<(String, Value)> = (self.places.keys())
            .filter_map(|column| {
                let name = column.strip_prefix("element_")?.strip_suffix("_valve_model_pressure_pa")?;
                let of = |what: &str| in_shown_unit(PRESSURE, self.number(&format!("element_{name}_{what}")));
                let range = [of("pressure_least_pa"), of("pressure_greatest_pa")];
                Some((name.to_uppercase(), Value { value: of("valve_model_pressure_pa"), range }))
            })
            .collect();
        elements.sort_by(|one, other| one.0.cmp(&other.0));
        elements
    }

    /// Follows the gears, and the health in a shift.
    fn see_shift(&mut self) {
        let [gear, target] = ["gear", "target_gear"].map(|column| self.word(column).to_owned());
        let shifts = gear != target && !gear.is_empty() && !target.is_empty();
        let gears = format!("{gear}-{target}");
        let (time_s, number) = (self.time_s, self.shifts.back().map_or(0, |shift| shift.number) + 1);
        let goes_on = self.shifts.back_mut().filter(|shift| shift.end_s.is_none());
        match goes_on {
            Some(shift) if shift.gears == gears => {}
            Some(shift) => shift.end_s = Some(time_s),
            None => {}
        }
        if shifts && self.shifts.back().is_none_or(|shift| shift.end_s.is_some()) {
            self.shifts.push_back(Shift { number, gears, begin_s: time_s, end_s: None, health: Vec::new() });
            if self.shifts.len() > SHIFTS {
                self.shifts.pop_front();
            }
        }
        let health = self.word("health").to_owned();
        if let Some(shift) = self.shifts.back_mut().filter(|shift| shift.end_s.is_none())
            && health != "good"
            && !health.is_empty()
            && !shift.health.contains(&health)
        {
            shift.health.push(health);
        }
    }

    /// Rows per second, zero before they are counted; none where no row comes any more.
    pub(super) fn rate(&self) -> Option<f64> {
        let (since, _) = self.counted?;
        (since.elapsed().as_secs_f64() < STALLED_S).then_some(self.rate)
    }

    fn count(&mut self) {
        let now = Instant::now();
        let Some((since, rows)) = self.counted else {
            self.counted = Some((now, self.rows));
            return;
        };
        let passed_s = now.duration_since(since).as_secs_f64();
        if passed_s >= RATE_S {
            self.rate = (self.rows - rows) as f64 / passed_s;
            self.counted = Some((now, self.rows));
        }
    }
}

/// A value of a column in the unit of its panel that is shown.
fn in_shown_unit(panel: usize, value: f64) -> f64 {
    let Panel { label, scale, .. } = PANELS[panel];
    shown_units::converted(label).map_or(scale * value, |(_, to)| to.value(scale * value))
}

/// The label of a panel with the unit that is shown.
pub(super) fn label(panel: usize) -> String {
    let label = PANELS[panel].label;
    shown_units::converted(label).map_or_else(|| label.to_owned(), |(label, _)| label)
}

/// An estimate that goes on, for those who look at it.
#[derive(Debug)]
pub(super) struct View {
    /// Length of the figures, s.
    pub(super) window_s: f64,
    state: Mutex<State>,
}

impl View {
    pub(super) fn new(window_s: f64) -> Self {
        Self { window_s, state: Mutex::default() }
    }

    /// Looks at what is known; none before the first row.
    pub(super) fn with<T>(&self, look: impl FnOnce(&State) -> T) -> Option<T> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        (state.rows > 0).then(|| look(&state))
    }
}

impl LiveRows for View {
    fn begin(&self, names: &[&str]) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.places = names.iter().enumerate().map(|(at, name)| ((*name).to_owned(), at)).collect();
    }

    fn row(&self, time_s: f64, cells: &[LiveCell]) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.rows == 0 {
            state.origin_s = shown_from_s(time_s);
        }
        state.rows += 1;
        state.time_s = time_s;
        state.cells.clear();
        state.cells.extend_from_slice(cells);
        state.see_shift();
        state.count();
        let newest_s = state.samples.back().map_or(f64::NEG_INFINITY, |sample| sample.time_s);
        if time_s < newest_s {
            // The clock began anew.
            state.dropped += state.samples.len() as u64;
            state.samples.clear();
        } else if time_s - newest_s < self.window_s / SAMPLES {
            return;
        }
        let values = state.values();
        state.samples.push_back(Sample { time_s, values });
        while state.samples.front().is_some_and(|first| first.time_s < time_s - self.window_s) {
            state.samples.pop_front();
            state.dropped += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(word: &str) -> LiveCell {
        LiveCell::Word(word.to_owned())
    }

    fn row(view: &View, time_s: f64, [gear, target, health]: [&str; 3], pressure_pa: f64) {
        view.row(time_s, &[word(gear), word(target), word(health), LiveCell::Number(pressure_pa)]);
    }

    #[test]
    fn shifts_their_health_and_the_window_are_kept() {
        let view = View::new(1.0);
        assert_eq!(view.with(|_| ()), None);
        view.begin(&["gear", "target_gear", "health", "oncoming_pressure_estimate_pa"]);
        for step in 0..400 {
            let (time_s, health) = (0.01 * f64::from(step), if step == 120 { "held" } else { "good" });
            let gears = match step {
                100..150 => ["1", "2"],
                150..300 => ["2", "2"],
                300.. => ["2", "3"],
                _ => ["1", "1"],
            };
            row(&view, time_s, [gears[0], gears[1], health], 1e6);
        }
        view.with(|state| {
            let shifts: Vec<_> = state.shifts.iter().cloned().collect();
            assert_eq!(shifts.len(), 2);
            assert_eq!((shifts[0].gears.as_str(), shifts[0].health.clone()), ("1-2", vec!["held".to_owned()]));
            assert_eq!(shifts[0].end_s, Some(1.5));
            assert_eq!((shifts[1].gears.as_str(), shifts[1].end_s, shifts[1].number), ("2-3", None, 2));
            assert!(state.samples.len() <= 101 && state.samples.len() as u64 + state.dropped == 400);
            let of_pressure = CURVES.iter().position(|curve| curve.column == "oncoming_pressure_estimate_pa").unwrap();
            assert_eq!(state.values()[of_pressure].value, 1.0);
            assert!(state.values()[0].value.is_nan() && !state.has_curve(&CURVES[0]));
        });
        // A clock that begins anew begins a new figure.
        row(&view, 0.5, ["3", "3", "good"], 1e6);
        view.with(|state| assert_eq!((state.samples.len(), state.dropped), (1, 400)));
    }
}
