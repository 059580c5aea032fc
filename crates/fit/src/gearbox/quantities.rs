//! The quantities of a fit, and what is known of them before.

use car::{Car, ErrorBudget};
use drivetrain::Real;
use nalgebra::DMatrix;
use observer::gearbox::{ElementUncertainty, GearboxFilter};
use observer::{ShiftTables, element_uncertainty, gearbox_filter};

use super::shift_log::{ShiftLog, is_fitted, transmitting};
use super::zero_offset::{sd_before_pa, zero_offsets};
use crate::driving::{AIR, DRAG_UNIT_N_M, ROLLING, Term, WIND, rolling_floor};
use crate::parameters::OFFSET_FLOOR_PA;
use crate::parameters::OFFSET_UNIT_PA;

/// Unit of the unknown of a delay, s.
pub(crate) const DELAY_UNIT_S: f64 = 0.01;
/// Unit of the unknown of a kiss point, Pa.
pub(crate) const KISS_UNIT_PA: f64 = 1e4;
/// Standard deviation of the drag before, N m \[chosen: the drag of an element with hot oil\].
const DRAG_N_M: f64 = 1.0;
/// Part of the variance that friction elements, their drags, valves or inertias have in common \[chosen\]: oil, temperature, the shaft at the input, the
/// channel of the currents.
const COMMON: f64 = 1.0 / 3.0;
/// Bound of the torque ratio above 1, as a fraction \[chosen\].
const TORQUE_RATIO: f64 = 0.10;

/// Bound of the delay of the reported engine torque, and of the engine speed in front of a converter, s: one cycle of a bus, and whether it is held or interpolated.
const INPUT_DELAY_S: f64 = 0.01;
/// Bound of the delay of the reported engine torque beside a converter, s \[chosen: the torque that is asked for comes some strokes later\].
const REPORTED_DELAY_S: f64 = 0.05;
/// Bounds of mass \[chosen: an empty car with four people and luggage\] and inertia of the engine \[chosen\].
const MASS: f64 = 0.25;
const ENGINE_INERTIA: f64 = 0.2;
/// Error of the scale of a pressure sensor, as a standard deviation.
const PRESSURE_SCALE: f64 = 0.005;

/// A quantity of a car.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Capacity of the converter; without a converter the reported engine torque.
    Input,
    /// Torque ratio of the converter above 1.
    TorqueRatio,
    /// Without a converter the delay of the reported engine torque against the turbine speed.
    InputDelay,
    /// Delay of the engine speed against the turbine speed, in front of a converter.
    EngineDelay,
    /// Peak of the drag of an element that is open or slips.
    Drag(usize),
    /// Torque of an element: friction times valve gain.
    Torque(usize),
    /// Kiss point of an element, as a pressure by the gain of the file.
    Kiss(usize),
    /// Gain of the valve of an element: the speeds see it only where the lag depends on the pressure.
    Gain(usize),
    /// Lag of the valve of an element.
    Lag(usize),
    /// Delay of its command against the turbine speed, beside that of the file.
    Delay(usize),
    /// Turbine-side inertia of the shifts between two gears.
    Inertia(usize),
    /// Scale of the pressure sensor.
    PressureScale,
    /// Zero offset of the pressure sensor of an element, where no reading shows it alone.
    PressureOffset(usize),
    /// Mass of the car.
    Mass,
    /// Rolling resistance.
    Rolling,
    /// Air drag.
    Air,
    /// Beside a converter: what the reported engine torque has to be multiplied with.
    ReportedScale,
    /// Its delay against the turbine speed.
    ReportedDelay,
    /// Inertia of the engine in front of a converter.
    EngineInertia,
}

/// The quantities of a car, in the order of the unknowns.
///
/// The unknown of a factor is its logarithm; that of a delay is in 10 ms, that of a kiss point and of a zero offset in 10 kPa, beside the file's.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantities {
    /// All of them.
    pub all: Vec<Quantity>,
    /// Names of the friction elements, by their places in the tables.
    pub elements: Vec<String>,
    /// Pairs of gears with a shift that has a model, the lower one first.
    pub pairs: Vec<[usize; 2]>,
    /// Names of these pairs.
    pub pair_names: Vec<String>,
    /// Covariance of the unknowns before the fit.
    pub before: DMatrix<f64>,
    /// Elements whose pressure is measured in a shift.
    pub measured: Vec<bool>,
    pub(crate) has_converter: bool,
    /// Minimum standard deviation of the logarithm of the rolling resistance: a mean grade acts like it.
    rolling_floor: f64,
}

impl Quantities {
    /// Those of a car with these tables, with the pairs of neighbouring gears and of these shifts. `balances` says whether the torque
    /// balance of the car and that of the engine are fitted to driving between shifts.
    pub fn of(car: &Car, tables: &ShiftTables<f64>, shifts: &[ShiftLog], balances: [bool; 2]) -> Self {
        let (pairs, measured) = (pairs(car, tables, shifts), measured(tables, shifts));
        let has_converter = car.converter.is_some();
        let mut all = match has_converter {
            true => vec![Quantity::Input, Quantity::TorqueRatio, Quantity::EngineDelay],
            false => vec![Quantity::Input, Quantity::InputDelay],
        };
        all.extend((0..measured.len()).flat_map(|at| {
            [Quantity::Torque(at), Quantity::Kiss(at), Quantity::Lag(at), Quantity::Delay(at), Quantity::Gain(at)]
        }));
        all.extend((0..measured.len()).map(Quantity::Drag));
        all.extend((0..pairs.len()).map(Quantity::Inertia));
        if measured.contains(&true) {
            all.push(Quantity::PressureScale);
        }
        let offsets = zero_offsets(car, tables, shifts);
        let is_open = |at: &usize| measured[*at] && offsets[*at].is_none();
        all.extend((0..measured.len()).filter(is_open).map(Quantity::PressureOffset));
        let of_balances = [
            [Quantity::Mass, Quantity::Rolling, Quantity::Air],
            [Quantity::ReportedScale, Quantity::ReportedDelay, Quantity::EngineInertia],
        ];
        all.extend(of_balances.into_iter().zip(balances).filter(|(_, is_used)| *is_used).flat_map(|(some, _)| some));
        let budget = ErrorBudget::of_car(car);
        // That the valves of an earlier fit agreed with each other does not make the common factor of all torques better known.
        let by_bounds =
            |element: usize| Some((tables.place(element)?, element_uncertainty(budget.element(element)?, 1.0)));
        let mut elements: Vec<_> = (0..car.gearbox.elements.len()).filter_map(by_bounds).collect();
        elements.sort_by_key(|(place, _)| *place);
        let elements: Vec<_> = elements.into_iter().map(|(_, uncertainty)| uncertainty).collect();
        let filter = gearbox_filter(car, tables, &budget, None);
        let mass_share = car.error_bounds.mass_share.unwrap_or(MASS);
        let known = Known { filter: &filter, elements: &elements, has_converter, measured: &measured, mass_share };
        let before = DMatrix::from_fn(all.len(), all.len(), |i, j| {
            if i == j { Real::powi(known.sd(all[i]), 2) } else { known.covariance(all[i], all[j]) }
        });
        let names = car.gearbox.elements.iter().enumerate();
        let mut named: Vec<(usize, String)> =
            names.filter_map(|(at, element)| Some((tables.place(at)?, element.name.clone()))).collect();
        named.sort_by_key(|(place, _)| *place);
        let pair_names = pairs.iter().map(|&pair| car.shift_name(pair.into())).collect();
        let elements = named.into_iter().map(|(_, name)| name).collect();
        let rolling_floor = rolling_floor(&car.road);
        Self { all, elements, pairs, pair_names, before, measured, has_converter, rolling_floor }
    }

    /// Place of a quantity among the unknowns.
    pub fn place(&self, quantity: Quantity) -> Option<usize> {
        self.all.iter().position(|other| *other == quantity)
    }

    /// Place of the shifts between two gears among the pairs.
    pub fn pair(&self, from: usize, to: usize) -> Option<usize> {
        self.pairs.iter().position(|pair| [[from, to], [to, from]].contains(pair))
    }

    /// Place of a term of the balances of driving among the unknowns.
    pub(crate) fn place_of(&self, term: Term) -> Option<usize> {
        self.place(match term {
            Term::Input => Quantity::Input,
            Term::Capacity(_) => return None,
            Term::TorqueRatio => Quantity::TorqueRatio,
            Term::InputDelay => Quantity::InputDelay,
            Term::Drag(at) => Quantity::Drag(at),
            Term::Inertia(at) => Quantity::Inertia(at),
            Term::Mass => Quantity::Mass,
            Term::Rolling => Quantity::Rolling,
            Term::Air => Quantity::Air,
            Term::ReportedScale => Quantity::ReportedScale,
            Term::ReportedDelay => Quantity::ReportedDelay,
            Term::EngineInertia => Quantity::EngineInertia,
        })
    }

    /// Minimum standard deviation of the unknown that is stated \[chosen, as of the one-shift fit\]: what the model leaves out does not
    /// shrink with more shifts.
    pub(crate) fn floor(&self, quantity: Quantity) -> f64 {
        if quantity == Quantity::Rolling { self.rolling_floor } else { quantity.floor_of_car() }
    }

    /// Words for a quantity.
    pub fn name(&self, quantity: Quantity) -> String {
        let element = |at: usize| self.elements.get(at).map_or("?", String::as_str);
        match quantity {
            Quantity::Input if self.has_converter => "converter capacity".to_owned(),
            Quantity::Input => "reported engine torque".to_owned(),
            Quantity::TorqueRatio => "converter torque ratio above 1".to_owned(),
            Quantity::InputDelay => "reported engine torque, delay".to_owned(),
            Quantity::EngineDelay => "engine speed, delay".to_owned(),
            Quantity::Delay(at) => format!("{}: valve delay", element(at)),
            Quantity::Drag(at) => format!("{}: drag", element(at)),
            Quantity::Torque(at) => format!("{}: friction x valve gain", element(at)),
            Quantity::Gain(at) => format!("{}: valve gain", element(at)),
            Quantity::PressureScale => "pressure sensor, scale".to_owned(),
            Quantity::PressureOffset(at) => self.offset_name(at),
            Quantity::Mass => "mass".to_owned(),
            Quantity::Rolling => "rolling resistance".to_owned(),
            Quantity::Air => "air drag".to_owned(),
            Quantity::ReportedScale => "true over reported engine torque".to_owned(),
            Quantity::ReportedDelay => "reported engine torque, delay".to_owned(),
            Quantity::EngineInertia => "engine inertia".to_owned(),
            Quantity::Kiss(at) => format!("{}: kiss point", element(at)),
            Quantity::Lag(at) => format!("{}: valve lag", element(at)),
            Quantity::Inertia(at) => {
                format!("M11 of {}", self.pair_names.get(at).map_or("?", String::as_str))
            }
        }
    }

    /// Words for the zero offset of the pressure sensor of an element.
    pub(crate) fn offset_name(&self, at: usize) -> String {
        format!("{}: pressure sensor, zero offset", self.elements.get(at).map_or("?", String::as_str))
    }

    /// Standard deviation of an unknown before the fit.
    pub fn sd_before(&self, at: usize) -> f64 {
        self.before[(at, at)].sqrt()
    }

    /// Places of the gains that no pressure shows. They are held near those of the file: what speeds seem to say of them comes from the
    /// shape of the lag over pressure.
    pub(crate) fn held(&self) -> impl Iterator<Item = usize> + '_ {
        let is_held = |quantity: &Quantity| matches!(quantity, Quantity::Gain(at) if !self.measured[*at]);
        self.all.iter().enumerate().filter(move |(_, quantity)| is_held(quantity)).map(|(place, _)| place)
    }

    /// Power of each quantity of the shifts in the factor that all torques have in common: with all of them multiplied by one number the
    /// speeds stay the same.
    pub(crate) fn powers_of_torque(&self) -> Vec<f64> {
        let power = |quantity: &Quantity| f64::from(u8::from(quantity.is_torque_of_shifts()));
        self.all.iter().map(power).collect()
    }
}

/// What is known before a fit: what the filter of the car does not know.
struct Known<'a> {
    filter: &'a GearboxFilter<'a, f64>,
    /// By place in the tables.
    elements: &'a [ElementUncertainty<f64>],
    has_converter: bool,
    measured: &'a [bool],
    mass_share: f64,
}

impl Known<'_> {
    /// Standard deviation of a quantity.
    fn sd(&self, quantity: Quantity) -> f64 {
        let of = |at: usize| &self.elements[at];
        match quantity {
            Quantity::Input if self.has_converter => self.filter.turbine.converter_share,
            Quantity::Input => self.filter.turbine.engine_share,
            Quantity::TorqueRatio => std_dev_of(TORQUE_RATIO),
            Quantity::InputDelay | Quantity::EngineDelay => std_dev_of(INPUT_DELAY_S / DELAY_UNIT_S),
            Quantity::Delay(at) => of(at).valve_delay_s / DELAY_UNIT_S,
            Quantity::Drag(_) => DRAG_N_M / DRAG_UNIT_N_M,
            Quantity::Torque(at) => of(at).torque_fraction,
            Quantity::Kiss(at) => Real::hypot(of(at).kiss_point_pa / KISS_UNIT_PA, self.kiss_by_gain(at)),
            Quantity::Gain(at) => of(at).valve_gain,
            Quantity::PressureScale => PRESSURE_SCALE,
            Quantity::PressureOffset(_) => sd_before_pa() / OFFSET_UNIT_PA,
            Quantity::Lag(at) => of(at).valve_lag_fraction,
            Quantity::Inertia(_) => self.filter.uncertainty.inertia_share,
            Quantity::Mass => std_dev_of(self.mass_share),
            Quantity::Rolling => std_dev_of(ROLLING),
            Quantity::Air => std_dev_of(AIR),
            Quantity::ReportedScale => self.filter.turbine.engine_share,
            Quantity::ReportedDelay => std_dev_of(REPORTED_DELAY_S / DELAY_UNIT_S),
            Quantity::EngineInertia => std_dev_of(ENGINE_INERTIA),
        }
    }

    /// What a standard deviation of the gain does to a kiss point by the gain of the file.
    fn kiss_by_gain(&self, at: usize) -> f64 {
        let kiss_pa = self.filter.tables.elements[at].clutch.kiss_pressure();
        -self.elements[at].valve_gain * kiss_pa / KISS_UNIT_PA
    }

    /// The element of a quantity that the gain of its valve is part of, and what a standard deviation of the gain does to it.
    fn by_gain(&self, quantity: Quantity) -> Option<(usize, f64)> {
        match quantity {
            Quantity::Torque(at) | Quantity::Gain(at) => Some((at, self.elements[at].valve_gain)),
            Quantity::Kiss(at) => Some((at, self.kiss_by_gain(at))),
            _ => None,
        }
    }

    /// Covariance of two different quantities.
    fn covariance(&self, one: Quantity, other: Quantity) -> f64 {
        use Quantity as Q;
        match (one, other) {
            (Q::Torque(_), Q::Torque(_))
            | (Q::Delay(_), Q::Delay(_))
            | (Q::Inertia(_), Q::Inertia(_))
            | (Q::Drag(_), Q::Drag(_)) => COMMON * self.sd(one) * self.sd(other),
            _ => match (self.by_gain(one), self.by_gain(other)) {
                // The gain of one whose pressure is not measured stays that of the file.
                (Some((at, of_one)), Some((of, of_other))) if at == of && self.measured[at] => of_one * of_other,
                _ => 0.0,
            },
        }
    }
}

/// Standard deviation of a uniform distribution with this bound.
pub(crate) fn std_dev_of(bound: f64) -> f64 {
    bound / 3.0_f64.sqrt()
}

/// The pairs of neighbouring gears and of these shifts with a shift that has a model, the lower gear first.
fn pairs(car: &Car, tables: &ShiftTables<f64>, shifts: &[ShiftLog]) -> Vec<[usize; 2]> {
    let rows = tables.tables();
    let forward = car.gearbox.forward_gears();
    let mut pairs: Vec<[usize; 2]> = forward.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    let ratio = |gear: usize| car.gearbox.gears.get(gear).map_or(0.0, |gear| gear.ratio);
    let lower_first = |[a, b]: [usize; 2]| if ratio(a) > ratio(b) { [a, b] } else { [b, a] };
    for pair in shifts.iter().map(|log| lower_first(log.gears)) {
        if !pairs.contains(&pair) {
            pairs.push(pair);
        }
    }
    let has_fit = |from: usize, to: usize| rows.shift(from, to).is_some_and(is_fitted);
    pairs.retain(|[low, high]| has_fit(*low, *high) || has_fit(*high, *low));
    pairs
}

/// Which elements have a measured pressure in a shift in which they transmit torque, by their places in the tables.
fn measured(tables: &ShiftTables<f64>, shifts: &[ShiftLog]) -> Vec<bool> {
    let rows = tables.tables();
    let mut measured = vec![false; rows.elements.len()];
    for log in shifts {
        let Some(row) = rows.shift(log.gears[0], log.gears[1]) else { continue };
        for ((clutch, pressure), is_used) in row.clutches.iter().zip(&log.pressure).zip(transmitting(row)) {
            if let Some(place) = clutch.element.place() {
                measured[place] |= is_used && pressure.between(log.slip_s).next().is_some();
            }
        }
    }
    measured
}

impl Quantity {
    /// Whether it is multiplied when all torques are multiplied by one number.
    pub(crate) fn has_torque_scale(self) -> bool {
        use Quantity as Q;
        let is_of_driving = matches!(self, Q::Mass | Q::Rolling | Q::Air | Q::ReportedScale | Q::EngineInertia);
        self.is_torque_of_shifts() || is_of_driving
    }

    /// The same of what acts in shifts.
    fn is_torque_of_shifts(self) -> bool {
        matches!(self, Self::Input | Self::Torque(_) | Self::Inertia(_))
    }

    fn floor_of_car(self) -> f64 {
        match self {
            Self::Delay(_) | Self::InputDelay => 0.3e-3 / DELAY_UNIT_S,
            // Errors of the torques act like it: in drawn cars without a delay it is 0.3 to 1.5 ms in the mean.
            Self::EngineDelay => 1e-3 / DELAY_UNIT_S,
            // Whether a reading is held or interpolated until the next one is not known: half a cycle of 5 ms.
            Self::ReportedDelay => 2.5e-3 / DELAY_UNIT_S,
            Self::Drag(_) => 0.2 / DRAG_UNIT_N_M,
            Self::Kiss(_) => 500.0 / KISS_UNIT_PA,
            Self::Lag(_) => 0.02,
            Self::Inertia(_) | Self::Mass => 0.015,
            Self::EngineInertia => 0.03,
            Self::Air => WIND,
            Self::PressureScale => 1e-3,
            Self::PressureOffset(_) => OFFSET_FLOOR_PA / OFFSET_UNIT_PA,
            _ => 0.005,
        }
    }
}
