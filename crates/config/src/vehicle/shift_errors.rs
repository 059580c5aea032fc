//! Bounds of the errors of a car with a gearbox, with what a file that says nothing takes.

use super::{Car, ElementErrorBounds};

/// Bounds of what the filter may not know of a car, each as a share. What the vehicle file has of its own comes before them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftErrors {
    /// Of the friction of a clutch.
    pub friction: f64,
    /// Of the gain of a valve.
    pub valve_gain: f64,
    /// Of the lag of a valve.
    pub valve_lag: f64,
    /// Of the converter's capacity.
    pub converter: f64,
    /// Of the engine torque that the engine's controller reports.
    pub engine: f64,
    /// Of the turbine-side inertia `M11` of a shift, of the true one.
    pub inertia: f64,
    /// Of the stiffness of the drive shafts.
    pub stiffness: f64,
    /// Of the scale of the wheel speed: size, wear and pressure of the tyres.
    pub wheel_scale: f64,
    /// Half-width of the hysteresis of a valve, Pa.
    pub hysteresis_pa: f64,
    /// Least and greatest delay of a valve, s.
    pub valve_delay_s: [f64; 2],
    /// Greatest time between a command and the reading that first shows it, s: of the guaranteed range.
    pub command_age_s: f64,
}

impl ShiftErrors {
    /// Those of a car in series \[chosen\], whose commands are read when they are sent.
    pub const STANDARD: Self = Self {
        friction: 0.15,
        valve_gain: 0.10,
        valve_lag: 0.5,
        converter: 0.10,
        engine: 0.08,
        inertia: 0.20,
        stiffness: 0.20,
        wheel_scale: 0.02,
        hysteresis_pa: 10e3,
        valve_delay_s: [0.0, 0.03],
        command_age_s: 0.0,
    };

    /// The same where the commands stand in a log, whose rows may come more rarely than commands are sent: a command may be older than its row by
    /// the time between two rows of a log at 10 Hz, and by no more than one such time.
    pub const LOGGED: Self = Self { command_age_s: 0.1, ..Self::STANDARD };
}

/// Bounds of what is not known of an element and its valve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementErrors {
    /// Least and greatest factor on the friction.
    pub friction_factor: [f64; 2],
    /// The same on the gain of the valve.
    pub valve_gain_factor: [f64; 2],
    /// The same on its lag.
    pub valve_lag_factor: [f64; 2],
    /// Least and greatest delay, s.
    pub valve_delay_s: [f64; 2],
    /// Greatest half-width of its hysteresis, Pa.
    pub valve_hysteresis_pa: f64,
}

impl ShiftErrors {
    /// The bounds of an element of a car, by its place in the gearbox.
    pub fn of_element(&self, car: &Car, element: usize) -> ElementErrors {
        let around = |share: f64| [1.0 - share, 1.0 + share];
        let own = car.error_bounds.elements.get(element).copied().unwrap_or_default();
        ElementErrors {
            friction_factor: own.friction_factor.unwrap_or(around(self.friction)),
            valve_gain_factor: own.valve_gain_factor.unwrap_or(around(self.valve_gain)),
            valve_lag_factor: own.valve_lag_factor.unwrap_or(around(self.valve_lag)),
            valve_delay_s: own.valve_delay_s.unwrap_or(self.valve_delay_s),
            valve_hysteresis_pa: own.valve_hysteresis_pa.unwrap_or(self.hysteresis_pa),
        }
    }

    /// With what the vehicle file has of its own; of the elements the widest.
    #[must_use]
    pub fn of_car(&self, car: &Car) -> Self {
        let own = &car.error_bounds;
        let elements: Vec<&ElementErrorBounds> =
            own.elements.iter().zip(&car.clutches).filter_map(|(own, clutch)| clutch.as_ref().map(|_| own)).collect();
        let widest = |of: fn(&ElementErrorBounds) -> Option<[f64; 2]>, share: f64| {
            let half = |own: &&ElementErrorBounds| of(own).map_or(share, |[least, most]| 0.5 * (most - least));
            elements.iter().map(half).reduce(f64::max).unwrap_or(share)
        };
        let delays = || elements.iter().map(|own| own.valve_delay_s.unwrap_or(self.valve_delay_s));
        let [least_s, most_s] = self.valve_delay_s;
        Self {
            friction: widest(|element| element.friction_factor, self.friction),
            valve_gain: widest(|element| element.valve_gain_factor, self.valve_gain),
            valve_lag: widest(|element| element.valve_lag_factor, self.valve_lag),
            converter: own.converter_share.unwrap_or(self.converter),
            engine: own.engine_torque_share.unwrap_or(self.engine),
            inertia: own.inertia_share.unwrap_or(self.inertia),
            stiffness: own.shaft_stiffness_share.unwrap_or(self.stiffness),
            wheel_scale: own.wheel_scale_share.unwrap_or(self.wheel_scale),
            hysteresis_pa: self.hysteresis_pa,
            valve_delay_s: [
                delays().map(|[least_s, _]| least_s).reduce(f64::min).unwrap_or(least_s),
                delays().map(|[_, most_s]| most_s).reduce(f64::max).unwrap_or(most_s),
            ],
            command_age_s: self.command_age_s,
        }
    }
}
