//! What the filter has learnt of a car in a log.

use car::Car;
use evaluate::learning_count::LearningCount;
use evaluate::logged::LoggedFilter;
use observer::ShiftTables;
use observer::gearbox::{Learnt, LearntElement};

/// Part of the unlearnt standard deviation from which on nothing is said of a quantity \[chosen\]: the log has shown next to nothing of it.
const SHOWN: f64 = 0.9;

/// What was learnt of a car in a log, beside its vehicle file.
#[derive(Debug, Clone)]
pub struct LearntOfDrive {
    /// What is known after the log; `None` after a log that teaches nothing. Each log begins in doubt of what was learnt before, and
    /// to keep it again would wear it off.
    pub learnt: Option<Learnt<f64>>,
    /// Whether shifts of the log contradict what was learnt before them, so that it is forgotten.
    pub was_forgotten: bool,
    /// Shifts of this log that it was learnt from, and of all logs.
    pub shifts: [u64; 2],
    /// What was learnt, with standard deviations.
    pub sentences: Vec<String>,
}

impl LearntOfDrive {
    pub(crate) fn of(car: &Car, tables: &ShiftTables<f64>, filter: &LoggedFilter<'_>) -> Self {
        let (_, learnt, count) = filter.learnt();
        let LearningCount { taken, forgotten, .. } = count;
        let has_changed = count.has_changed();
        Self {
            learnt: has_changed.then_some(*learnt),
            was_forgotten: has_changed && forgotten > 0,
            shifts: [u64::from(taken), u64::from(learnt.shifts)],
            sentences: if has_changed { sentences(car, tables, filter) } else { Vec::new() },
        }
    }
}

/// What is known of the car beside its vehicle file, with standard deviations.
fn sentences(car: &Car, tables: &ShiftTables<f64>, filter: &LoggedFilter<'_>) -> Vec<String> {
    let (filter, learnt, _) = filter.learnt();
    let elements = car.gearbox.elements.iter().enumerate();
    let elements: Vec<_> = elements
        .filter_map(|(at, element)| Some((element.name.as_str(), filter.learnt_element(learnt, tables.place(at)?)?)))
        .collect();
    let list = |value: &dyn Fn(&LearntElement<f64>) -> [f64; 2], per_unit: f64| {
        let of = |(name, element): &(&str, _)| {
            let [error, std_dev] = value(element).map(|value| per_unit * value);
            format!("{name} {error:+.1} +-{std_dev:.1}")
        };
        elements.iter().map(of).collect::<Vec<_>>().join(", ")
    };
    let mut said = vec![
        format!(
            "learnt torque at the same pressure (friction times gain), in %, above the vehicle file: {}",
            list(&|of| of.torque_fraction, 100.0)
        ),
        format!("learnt kiss points in kPa, above the vehicle file: {}", list(&|of| of.kiss_pa, 1e-3)),
    ];
    let timing = |which: usize, per_unit: f64| {
        let of = |(at, element): (usize, &geartrain::GearboxElement)| {
            let value = filter.learnt_timing(learnt, tables.place(at)?)?[which].map(|value| per_unit * value);
            Some(format!("{} {:+.0} +-{:.0}", element.name, value[0], value[1]))
        };
        let elements = car.gearbox.elements.iter().enumerate();
        elements.filter_map(of).collect::<Vec<_>>().join(", ")
    };
    said.push(format!("learnt lag of the valves in %, above the vehicle file: {}", timing(0, 100.0)));
    said.push(format!("learnt delay of the valves in ms, above the middle of its bounds: {}", timing(1, 1e3)));
    let [input, reported] = filter.learnt_sources(learnt).map(|of| of.map(|value| 100.0 * value));
    let source =
        if car.converter.is_some() { "by the converter of the vehicle file" } else { "that the engine reports" };
    said.push(format!(
        "learnt torque at the gearbox input: {:+.1} +-{:.1} % above the one {source}",
        input[0], input[1]
    ));
    let unlearnt = 100.0 * filter.turbine.engine_share;
    if car.converter.is_some() && reported[1] < SHOWN * unlearnt {
        said.push(format!(
            "learnt reported engine torque: {:+.1} +-{:.1} % above the true one",
            reported[0], reported[1]
        ));
    }
    let [scale, std_dev] = filter.learnt_wheel_scale(learnt);
    if std_dev < SHOWN * filter.uncertainty.wheel_scale {
        said.push(format!(
            "learnt scale of the wheel speed: it reads {:+.2} +-{:.2} % of the true one",
            100.0 * scale,
            100.0 * std_dev
        ));
    }
    said
}
