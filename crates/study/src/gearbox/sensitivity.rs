//! What each error of the bounds does to the estimate of each shift of a car, and where the speeds show nothing of a clutch's torque.
//!
//! The car makes every shift between neighbouring gears in every kind. What its sensors read is estimated with its file, and again with
//! one value of the file off by its bound, one way and the other. Each error by itself, so that their squares can be added.

use car::{Car, Sensors, ShiftClutch};
use car::{ElementErrors, ErrorBudget};
use drivetrain::Real;
use serde::Serialize;
use trace::quantity;

use super::matrix::{MatrixShift, controlling_of};
use super::nominal::{NominalShift, nominal_shifts};
use super::{EvaluateError, ShiftScoreRow, TruePhase};
use crate::StudyError;

/// Fraction of the valve model's standard deviation above which the speeds are of no use.
const HIDDEN: f64 = 0.9;
/// Rows that a phase needs.
const MIN_ROWS: usize = 3;

/// What is off. Of a clutch: the one whose torque is estimated, or the other one of the shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ShiftErrorKind {
    /// Friction of the clutch.
    Friction,
    /// Gain of its valve.
    ValveGain,
    /// Lag of its valve.
    ValveLag,
    /// Delay of the valves.
    ValveDelay,
    /// Kiss point, or hysteresis of its valve.
    KissPoint,
    /// Friction of the other clutch.
    OtherFriction,
    /// Gain of its valve.
    OtherValveGain,
    /// Capacity of the converter.
    Converter,
    /// The engine torque that the engine's controller reports.
    EngineTorque,
    /// Turbine-side inertia `M11`.
    Inertia,
    /// Stiffness of the drive shafts.
    Stiffness,
}

impl ShiftErrorKind {
    /// All of them, in the order of a table.
    pub const ALL: [Self; 11] = [
        Self::Friction,
        Self::ValveGain,
        Self::ValveLag,
        Self::ValveDelay,
        Self::KissPoint,
        Self::OtherFriction,
        Self::OtherValveGain,
        Self::Converter,
        Self::EngineTorque,
        Self::Inertia,
        Self::Stiffness,
    ];

    /// For tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Friction => "friction",
            Self::ValveGain => "valve gain",
            Self::ValveLag => "valve lag",
            Self::ValveDelay => "valve delay",
            Self::KissPoint => "kiss point",
            Self::OtherFriction => "other friction",
            Self::OtherValveGain => "other valve gain",
            Self::Converter => "converter capacity",
            Self::EngineTorque => "reported engine torque",
            Self::Inertia => "turbine-side inertia",
            Self::Stiffness => "shaft stiffness",
        }
    }

    /// The bound of a budget as it is printed, of the elements the widest.
    pub fn bound(self, budget: &ErrorBudget) -> String {
        let percent = |relative: f64| format!("{:.0} %", 100.0 * relative);
        match self {
            Self::Friction | Self::OtherFriction => percent(budget.widest(ElementErrors::friction)),
            Self::ValveGain | Self::OtherValveGain => percent(budget.widest(ElementErrors::valve_gain)),
            Self::ValveLag => percent(budget.widest(ElementErrors::valve_lag)),
            Self::ValveDelay => format!("{:.0} ms", 1e3 * budget.widest(ElementErrors::valve_delay)),
            Self::KissPoint => quantity(1e-3 * budget.widest(|element| element.valve_hysteresis_pa), "kPa", 0),
            Self::Converter => percent(budget.converter),
            Self::EngineTorque => percent(budget.engine),
            Self::Inertia => percent(budget.inertia),
            Self::Stiffness => percent(budget.stiffness),
        }
    }

    /// Whether a car can have it.
    pub fn is_of(self, car: &Car) -> bool {
        match self {
            Self::Converter => car.converter.is_some(),
            // With a converter the filter of a shift does not use it.
            Self::EngineTorque => car.converter.is_none(),
            _ => true,
        }
    }
}

/// What one error does to the estimates of one clutch in one phase: root mean square over the phase.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EffectInShift {
    /// The error.
    pub error: ShiftErrorKind,
    /// On the torque by the filter and by the valve model alone, N m.
    pub torque_n_m: [f64; 2],
    /// On the pressure by the filter and by the valve model alone, Pa.
    pub pressure_pa: [f64; 2],
}

/// What the errors do to the estimate of the clutch that drives the inertia phase, in one phase.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseOfShift {
    /// Mean size of the torque, N m.
    pub torque_n_m: f64,
    /// Each error at its bound.
    pub effects: Vec<EffectInShift>,
}

impl PhaseOfShift {
    /// Standard deviation of the torque by the filter and by the valve model alone, N m: each error anywhere within its bound, and
    /// independent of the others.
    pub fn std_dev_n_m(&self) -> [f64; 2] {
        self.std_dev(|effect| effect.torque_n_m)
    }

    /// The same of the pressure, Pa.
    pub fn std_dev_pa(&self) -> [f64; 2] {
        self.std_dev(|effect| effect.pressure_pa)
    }

    fn std_dev(&self, of: fn(&EffectInShift) -> [f64; 2]) -> [f64; 2] {
        [0, 1].map(|at| (self.effects.iter().map(|effect| Real::powi(of(effect)[at], 2)).sum::<f64>() / 3.0).sqrt())
    }

    /// Standard deviation of the torque by the filter over that by the valve model alone.
    pub fn ratio(&self) -> f64 {
        let [filter, alone] = self.std_dev_n_m();
        filter / alone
    }

    /// Whether the speeds show so little of the torque that the valve model alone is as good.
    pub fn is_hidden(&self) -> bool {
        self.ratio() > HIDDEN
    }

    /// The error with the largest effect on the filter's torque.
    pub fn largest(&self) -> Option<&EffectInShift> {
        self.effects.iter().max_by(|one, other| one.torque_n_m[0].total_cmp(&other.torque_n_m[0]))
    }
}

/// What the errors do to the estimates of one shift.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftSensitivity {
    /// The shift.
    pub shift: MatrixShift,
    /// The clutch that drives the inertia phase: its place among the elements of the gearbox.
    pub element: usize,
    /// Torque and inertia phase; `None` for a phase that is too short.
    pub phases: [Option<PhaseOfShift>; 2],
}

/// What the errors do to the estimates of all shifts between neighbouring gears, each at its bound in the error budget of the car.
///
/// # Errors
/// A shift of the car cannot be simulated, or the gearbox has more clutches than the filter has room for.
pub fn car_sensitivity(car: &Car, sensors: &Sensors) -> Result<Vec<ShiftSensitivity>, StudyError> {
    let budget = ErrorBudget::of_car(car).read_by(car, Some(sensors));
    let shifts = nominal_shifts(car, sensors)?;
    let found = shifts.iter().filter_map(|shift| of_shift(car, &budget, sensors, shift).transpose());
    Ok(found.collect::<Result<_, EvaluateError>>()?)
}

fn of_shift(
    car: &Car,
    budget: &ErrorBudget,
    sensors: &Sensors,
    nominal: &NominalShift,
) -> Result<Option<ShiftSensitivity>, EvaluateError> {
    let Some(clutches) = nominal.elements() else { return Ok(None) };
    let as_it_is = nominal.estimated(car, sensors, budget, &nominal.inputs)?;
    let main = controlling_of(&as_it_is, nominal.shift.kind);
    let (own, other) = (clutches[main], clutches[1 - main]);
    let mut effects: [Vec<EffectInShift>; 2] = Default::default();
    for error in ShiftErrorKind::ALL.into_iter().filter(|error| error.is_of(car)) {
        let off = [-1.0, 1.0].map(|sign| with_error((car, budget), sensors, nominal, (error, sign), [own, other]));
        let [low, high] = off;
        let (low, high) = (low?, high?);
        for (phase, effects) in PHASES.into_iter().zip(&mut effects) {
            let change = |rows: &[ShiftScoreRow]| changed(&as_it_is, rows, phase, main);
            let (low, high) = (change(&low), change(&high));
            // Half of the difference both ways: what is linear in the error, and what is not.
            let mean = |of: fn(&[[f64; 2]; 2]) -> [f64; 2]| {
                let (low, high) = (of(&low), of(&high));
                [0, 1].map(|at| (0.5 * (low[at] * low[at] + high[at] * high[at])).sqrt())
            };
            effects.push(EffectInShift { error, torque_n_m: mean(|c| c[0]), pressure_pa: mean(|c| c[1]) });
        }
    }
    let mut phases = PHASES.into_iter().zip(effects).map(|(phase, effects)| {
        let rows: Vec<f64> =
            of_phase(&as_it_is, phase, main).map(|row| row.clutches[main].torque_n_m[0].abs()).collect();
        let torque_n_m = rows.iter().sum::<f64>() / rows.len().max(1) as f64;
        (rows.len() >= MIN_ROWS).then_some(PhaseOfShift { torque_n_m, effects })
    });
    let phases = [phases.next().flatten(), phases.next().flatten()];
    Ok(Some(ShiftSensitivity { shift: nominal.shift, element: own, phases }))
}

const PHASES: [TruePhase; 2] = [TruePhase::Torque, TruePhase::Inertia];

/// The estimates with one error at its bound, in this direction.
fn with_error(
    (car, budget): (&Car, &ErrorBudget),
    sensors: &Sensors,
    nominal: &NominalShift,
    (error, sign): (ShiftErrorKind, f64),
    [own, other]: [usize; 2],
) -> Result<Vec<ShiftScoreRow>, EvaluateError> {
    let (mut file, mut budget) = (car.clone(), budget.clone());
    let mut inputs = std::borrow::Cow::Borrowed(&nominal.inputs);
    let end = usize::from(sign > 0.0);
    let factor = |relative: f64| 1.0 + sign * relative;
    match error {
        ShiftErrorKind::Friction => scale_friction(&mut file, &budget, own, end),
        ShiftErrorKind::OtherFriction => scale_friction(&mut file, &budget, other, end),
        ShiftErrorKind::ValveGain => scale_gain(&mut file, &budget, own, end),
        ShiftErrorKind::OtherValveGain => scale_gain(&mut file, &budget, other, end),
        ShiftErrorKind::ValveLag => of_element(&mut file, &budget, own, |clutch, errors| {
            clutch.valve = clutch.valve.changed(errors.valve_lag_factor[end], 1.0, None);
        }),
        ShiftErrorKind::ValveDelay => {
            for element in budget.elements.iter_mut().flatten() {
                element.valve_delay_s = [element.valve_delay_s[end]; 2];
            }
        }
        ShiftErrorKind::KissPoint => of_element(&mut file, &budget, own, |clutch, errors| {
            clutch.clutch.return_spring_n += sign * errors.valve_hysteresis_pa * clutch.clutch.piston_area_m2;
        }),
        ShiftErrorKind::Converter => {
            if let Some(converter) = &mut file.converter {
                converter.capacity_n_m_s2 = converter.capacity_n_m_s2.scaled(factor(budget.converter));
            }
        }
        ShiftErrorKind::EngineTorque => {
            for (_, input) in inputs.to_mut() {
                input.engine_n_m.iter_mut().for_each(|reading| reading.value *= factor(budget.engine));
            }
        }
        ShiftErrorKind::Inertia => {
            for reduced in file.gearbox.shifts.iter_mut().filter_map(|shift| shift.reduced.as_mut()) {
                reduced.mass_kg_m2[0][0] *= factor(budget.inertia);
            }
        }
        ShiftErrorKind::Stiffness => file.driveline.shaft_stiffness_n_m_rad *= factor(budget.stiffness),
    }
    nominal.estimated(&file, sensors, &budget, &inputs)
}

fn scale_friction(car: &mut Car, budget: &ErrorBudget, element: usize, end: usize) {
    of_element(car, budget, element, |clutch, errors| {
        let factor = errors.friction_factor[end];
        clutch.clutch.friction = clutch.clutch.friction.scaled(factor);
        clutch.clutch.static_friction *= factor;
    });
}

fn scale_gain(car: &mut Car, budget: &ErrorBudget, element: usize, end: usize) {
    of_element(car, budget, element, |clutch, errors| {
        clutch.valve = clutch.valve.changed(1.0, errors.valve_gain_factor[end], None);
    });
}

fn of_element(car: &mut Car, budget: &ErrorBudget, element: usize, change: impl Fn(&mut ShiftClutch, &ElementErrors)) {
    if let (Some(Some(clutch)), Some(errors)) = (car.clutches.get_mut(element), budget.element(element)) {
        change(clutch, errors);
    }
}

/// The rows of a phase in which the clutch slips.
fn of_phase(rows: &[ShiftScoreRow], phase: TruePhase, clutch: usize) -> impl Iterator<Item = &ShiftScoreRow> {
    rows.iter().filter(move |row| row.phase() == Some(phase) && !row.clutches[clutch].sticks)
}

/// RMS change of torque and pressure, by the filter and by the valve model alone.
fn changed(as_it_is: &[ShiftScoreRow], rows: &[ShiftScoreRow], phase: TruePhase, clutch: usize) -> [[f64; 2]; 2] {
    let [mut torque, mut pressure] = [[0.0; 2]; 2];
    let mut count = 0.0;
    for row in of_phase(as_it_is, phase, clutch) {
        // Both are rows of the same recording; with another file the filter may have none for the first of them.
        let Ok(at) = rows.binary_search_by(|other| other.time_s.total_cmp(&row.time_s)) else { continue };
        let (one, other) = (&row.clutches[clutch], &rows[at].clutches[clutch]);
        add_squares(&mut torque, one.torque_n_m, other.torque_n_m);
        add_squares(&mut pressure, one.pressure_pa, other.pressure_pa);
        count += 1.0;
    }
    [torque, pressure].map(|sums| sums.map(|sum| (sum / f64::max(count, 1.0)).sqrt()))
}

/// Adds the squares of what differs, by the filter and by the valve model alone.
fn add_squares(sums: &mut [f64; 2], [_, filter, alone]: [f64; 3], [_, other_filter, other_alone]: [f64; 3]) {
    sums[0] += Real::powi(other_filter - filter, 2);
    sums[1] += Real::powi(other_alone - alone, 2);
}
