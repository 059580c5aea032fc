//! The filter for every shift of a gearbox: its tables from the gear train, and what it does not know from budgets.

use drivetrain::{Converter, Real};
use geartrain::{Change, Gearbox};
use observer::any_shift::{
    FrictionElement, GearRow, GearboxTables, MAX_ELEMENTS, ShiftRow, ShiftUncertainty, TurbineTorque,
};
use observer::{Budget, ValveModel};

/// Errors of the valve's map beside its gain, as a share \[chosen\]: with the bounds of 15 % of friction and 10 % of gain it gives a
/// deviation of 12 %.
const MAP_SHARE: f64 = 0.06;

/// The tables of a gearbox, owned.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftTables<T> {
    elements: Vec<FrictionElement<T>>,
    gears: Vec<GearRow<T>>,
    shifts: Vec<ShiftRow<T>>,
    /// Place of each of the gearbox's elements in the tables.
    places: Vec<Option<usize>>,
}

impl ShiftTables<f64> {
    /// The tables of a gearbox whose elements have these valves, `None` for an element that has none, as a dog. An element
    /// without plates or valve is left out, and the shifts between others remain. What sits on the input
    /// shaft without being part of the gearbox, as an engine without converter, is added to the mass.
    ///
    /// # Errors
    /// More clutches and brakes than the filter has room for; holds their number.
    pub fn new(
        gearbox: &Gearbox,
        valve: impl Fn(usize) -> Option<(ValveModel<f64>, Option<Budget<f64>>)>,
        more_on_input_kg_m2: f64,
    ) -> Result<Self, usize> {
        let (mut elements, mut places) = (Vec::new(), Vec::new());
        for (at, element) in gearbox.elements.iter().enumerate() {
            let friction = element.pack.zip(valve(at)).map(|(clutch, (valve, budget))| {
                elements.push(FrictionElement { clutch, valve, budget });
                elements.len() - 1
            });
            places.push(friction);
        }
        if elements.len() > MAX_ELEMENTS {
            return Err(elements.len());
        }
        let shift_rows = gearbox.shifts.iter().filter_map(|shift| {
            let Change::Single { offgoing, oncoming, .. } = &shift.change else { return None };
            let mut reduced = shift.reduced?;
            reduced.mass_kg_m2[0][0] += more_on_input_kg_m2;
            let clutches = [places[*offgoing]?, places[*oncoming]?];
            Some(ShiftRow::new([shift.from, shift.to], clutches, &reduced))
        });
        let shifts: Vec<_> = shift_rows.collect();
        // In a gear the inertia is the same in every shift from it or to it.
        let inertia = |gear: usize, ratio: f64| {
            let shift = shifts.iter().find(|shift| shift.from == gear || shift.to == gear);
            shift.map_or(f64::INFINITY, |shift| shift.inertia_at(ratio))
        };
        let gears = gearbox.gears.iter().enumerate();
        let gears = gears.map(|(at, gear)| GearRow { ratio: gear.ratio, inertia_kg_m2: inertia(at, gear.ratio) });
        Ok(Self { gears: gears.collect(), elements, shifts, places })
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> ShiftTables<U> {
        ShiftTables {
            elements: self.elements.iter().map(FrictionElement::cast).collect(),
            gears: self.gears.iter().map(GearRow::cast).collect(),
            shifts: self.shifts.iter().map(ShiftRow::cast).collect(),
            places: self.places.clone(),
        }
    }
}

impl<T: Real> ShiftTables<T> {
    /// As the filter takes them.
    pub fn tables(&self) -> GearboxTables<'_, T> {
        GearboxTables { elements: &self.elements, gears: &self.gears, shifts: &self.shifts }
    }

    /// Place of an element of the gearbox in the tables; `None` if it is not in them.
    pub fn place(&self, element: usize) -> Option<usize> {
        self.places.get(element).copied().flatten()
    }
}

/// Standard deviation of an error whose bound is the edge of a uniform distribution.
fn deviation_of(bound: f64) -> f64 {
    bound / 3.0_f64.sqrt()
}

/// What the filter does not know, from the bounds of friction and valve gain, each as a share.
pub fn shift_uncertainty(friction: f64, valve_gain: f64, output_least_rad_s: f64) -> ShiftUncertainty<f64> {
    let parts = [deviation_of(friction), deviation_of(valve_gain), MAP_SHARE];
    let square: f64 = parts.iter().map(|part| part * part).sum();
    ShiftUncertainty {
        torque_share: square.sqrt(),
        gain_part: parts[1] * parts[1] / square,
        torque_share_s: 3.0,
        valve_s: 0.012,
        pressure_pa: 0.01e6,
        pressure_s: 0.15,
        kiss_pa: 0.015e6,
        turbine_walk: 0.02,
        rate_rad_s: 0.1,
        rate_walk: 0.01,
        load_walk: 1500.0,
        output_least_rad_s,
    }
}

/// The torque at the gearbox input, from the bounds of the converter's capacity and of the reported engine torque, each as a
/// share.
pub fn turbine_torque(
    converter: Option<Converter<f64>>,
    engine_inertia_kg_m2: f64,
    [converter_bound, engine_bound]: [f64; 2],
) -> TurbineTorque<f64> {
    TurbineTorque {
        converter,
        engine_inertia_kg_m2,
        converter_share: deviation_of(converter_bound),
        engine_share: deviation_of(engine_bound),
    }
}
