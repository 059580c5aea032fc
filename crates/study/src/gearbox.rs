//! How well the gearbox filter estimates both clutches of a shift, beside the valve models alone.
//!
//! A shift is simulated in a car that differs from the one that filter and controller know; the filter sees it through
//! toothed wheels. Errors are counted by what the true clutches do: in the *torque phase* one of them holds and the other
//! carries torque while it slips; in the *inertia phase* both slip.

pub mod campaign;
pub mod car_log;
pub mod channels;
pub mod gear_numbers;
mod gear_signal;
pub mod influence;
pub mod learnt_coverage;
pub mod matrix;
mod nominal;
pub mod pressure_command;
pub mod sensitivity;
pub mod shift_bars;
pub mod tour;

pub use evaluate::score::{inputs, score_from, score_samples, score_shift, simulated};
pub use evaluate::{
    ClutchRow, EvaluateError, RECORD_S, SAMPLE_S, ShiftScoreRow, SquaredErrors, TruePhase, drive, learning_count,
    logged, measured, recording, shift_comfort, shift_summary, worth_a_look,
};

use car::{Car, ShiftClutch};
use car::{ElementErrors, ErrorBudget};
use drivetrain::{Cylinder, Passage};

/// How a car differs from the one that is known.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftDraw {
    /// Factor on the friction of each element.
    pub friction: Vec<f64>,
    /// Factor on the gain of each element's valve.
    pub valve_gain: Vec<f64>,
    /// Factor on the converter's capacity.
    pub converter: f64,
    /// Lag, delay and hysteresis of each element's valve; none as in the known car.
    pub timing: Vec<Option<ValveTiming>>,
    /// Stroke of each element's piston; none as in the known car.
    pub strokes: Vec<Option<StrokeDraw>>,
}

/// How the stroke of a piston differs from that of the known car, each by a number from 0 to 1 between the limits of its budget.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrokeDraw {
    /// Of the volume.
    pub volume: f64,
    /// Of the pressures at both ends of the stroke.
    pub plateau: f64,
    /// Of the resistance of both passages.
    pub resistance: f64,
    /// Of the viscosity of the oil, of all elements alike.
    pub viscosity: f64,
}

/// Lag, delay and hysteresis of a valve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValveTiming {
    /// Factor on the lag.
    pub lag: f64,
    /// Delay, s.
    pub delay_s: f64,
    /// Half-width of the hysteresis, Pa.
    pub hysteresis_pa: f64,
}

impl ShiftDraw {
    /// The known car.
    pub fn none(car: &Car) -> Self {
        let ones = vec![1.0; car.clutches.len()];
        let (timing, strokes) = (vec![None; ones.len()], vec![None; ones.len()]);
        Self { timing, strokes, friction: ones.clone(), valve_gain: ones, converter: 1.0 }
    }

    /// Friction, gain and converter within the bounds of a budget, each by a number from 0 to 1.
    pub fn within(car: &Car, budget: &ErrorBudget, mut uniform: impl FnMut() -> f64) -> Self {
        let mut of_elements = |range: fn(&ElementErrors) -> [f64; 2]| {
            let elements = (0..car.clutches.len()).map(|at| budget.element(at));
            elements.map(|element| between(element.map_or([1.0; 2], range), uniform())).collect()
        };
        let friction = of_elements(|element| element.friction_factor);
        let valve_gain = of_elements(|element| element.valve_gain_factor);
        let converter = between([1.0 - budget.converter, 1.0 + budget.converter], uniform());
        Self { friction, valve_gain, converter, ..Self::none(car) }
    }

    /// The same with lag, delay and hysteresis of the valves within the bounds too.
    #[must_use]
    pub fn with_timing(mut self, budget: &ErrorBudget, mut uniform: impl FnMut() -> f64) -> Self {
        for (at, timing) in self.timing.iter_mut().enumerate() {
            let [lag, delay, hysteresis] = [uniform(), uniform(), uniform()];
            *timing = budget.element(at).map(|element| ValveTiming {
                lag: between(element.valve_lag_factor, lag),
                delay_s: between(element.valve_delay_s, delay),
                hysteresis_pa: between([0.0, element.valve_hysteresis_pa], hysteresis),
            });
        }
        self
    }

    /// The same with the strokes of the pistons of `car`, where they have one, within the budget of its cylinders too.
    #[must_use]
    pub fn with_strokes(mut self, car: &Car, mut uniform: impl FnMut() -> f64) -> Self {
        let mut viscosity = None;
        for (stroke, clutch) in self.strokes.iter_mut().zip(&car.clutches) {
            if clutch.as_ref().is_none_or(|clutch| !clutch.has_stroke) {
                continue;
            }
            let viscosity = *viscosity.get_or_insert_with(&mut uniform);
            *stroke = Some(StrokeDraw { volume: uniform(), plateau: uniform(), resistance: uniform(), viscosity });
        }
        self
    }

    /// The car that differs from this one so.
    pub fn car(&self, known: &Car) -> Car {
        let mut car = known.clone();
        for (clutch, stroke) in car.clutches.iter_mut().zip(&self.strokes) {
            if let (Some(clutch), Some(stroke)) = (clutch, stroke) {
                stroke.change(clutch, known.oil_temperature_degc);
            }
        }
        let factors = self.friction.iter().zip(&self.valve_gain).zip(&self.timing);
        for (clutch, ((friction, gain), timing)) in car.clutches.iter_mut().zip(factors) {
            let Some(clutch) = clutch else { continue };
            clutch.clutch.friction = clutch.clutch.friction.scaled(*friction);
            clutch.clutch.static_friction *= friction;
            clutch.valve = clutch.valve.changed(
                timing.map_or(1.0, |timing| timing.lag),
                *gain,
                timing.map(|timing| timing.delay_s),
            );
            if let Some(timing) = timing {
                clutch.hysteresis_pa = timing.hysteresis_pa;
            }
        }
        if let Some(converter) = &mut car.converter {
            converter.capacity_n_m_s2 = converter.capacity_n_m_s2.scaled(self.converter);
        }
        car
    }
}

impl StrokeDraw {
    /// Gives a clutch this stroke. With the pressure at its end the force of the return spring there is another.
    fn change(&self, clutch: &mut ShiftClutch, oil_degc: f64) {
        let Some(budget) = clutch.standard_fill_budget(oil_degc) else { return };
        let passage = |[wide, narrow]: [Passage<f64>; 2]| Passage {
            laminar_pa_s2_m5: between([wide.laminar_pa_s2_m5, narrow.laminar_pa_s2_m5], self.resistance),
            orifice_pa_s2_m6: between([wide.orifice_pa_s2_m6, narrow.orifice_pa_s2_m6], self.resistance),
        };
        let kiss_pa = between(budget.kiss_pressure_pa, self.plateau);
        clutch.cylinder = Cylinder {
            stroke_m3: between(budget.volume_m3, self.volume),
            preload_pa: between(budget.preload_pressure_pa, self.plateau),
            kiss_pa,
            supply: passage(budget.supply),
            exhaust: passage(budget.exhaust),
            viscosity_m2_s: between(budget.viscosity_m2_s, self.viscosity),
            ..clutch.cylinder
        };
        clutch.clutch.return_spring_n = kiss_pa * clutch.clutch.piston_area_m2;
    }
}

/// The value in a range at this fraction of it, from 0 to 1.
fn between([minimum, maximum]: [f64; 2], fraction: f64) -> f64 {
    minimum + fraction * (maximum - minimum)
}
