//! The clutches of a gearbox of which nothing but the ratios is known: the sum of their torques, as the turbine feels them.
//!
//! ```text
//! sum of alpha_c T_c = T_t - M11 w_t' - M12 w_o'
//! ```
//!
//! It is the momentum balance of the turbine's side and holds in a gear as in a shift. Where one clutch carries alone, as in the
//! inertia phase, it is that clutch's. What the clutch itself has is `1/alpha` of it, which the ratios do not tell; its pressure
//! needs its plates and piston besides.

use car::ShiftCommand;
use drivetrain::Real;

use super::turbine::{Found, MIN_N_M};
use super::{GearboxFilter, GearboxState, OUTPUT, ShiftPhase, TURBINE, square};

/// Torque of all clutches together, at the turbine.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClutchesAtTurbine<T> {
    /// Torque, N m: positive when the turbine drives.
    pub torque_n_m: T,
    /// Its standard deviation, N m: torque at the gearbox input, inertia, acceleration.
    pub std_dev_n_m: T,
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Whether a change of the gear is one of a gearbox by its ratios alone, whose torques at the turbine are known.
    pub(super) fn is_at_turbine(&self, gear: ShiftCommand) -> bool {
        self.tables.elements.is_empty() && self.tables.mass(gear).is_some()
    }

    /// The clutches of a gearbox without elements, where the torque at its input and the rates of its speeds are known.
    pub(super) fn at_turbine(
        &self,
        state: &GearboxState<T>,
        gear: ShiftCommand,
        input: &Found<T>,
    ) -> Option<ClutchesAtTurbine<T>> {
        if !self.tables.elements.is_empty() || !self.are_read(&state.newest) {
            return None;
        }
        let [[m11, m12], _] = *self.tables.mass(gear)?;
        let [(turbine_rate, turbine_variance), (output_rate, output_variance)] =
            [self.rate(state, TURBINE)?, self.rate(state, OUTPUT)?];
        let torque_n_m = input.turbine_n_m - m11 * turbine_rate - m12 * output_rate;
        let variance = square(input.fraction * input.turbine_n_m.abs().at_least(T::of(MIN_N_M)))
            + input.noise
            + square(m11) * (turbine_variance + square(self.uncertainty.inertia_share * turbine_rate))
            + square(m12) * (output_variance + square(self.uncertainty.inertia_share * output_rate));
        let found = ClutchesAtTurbine { torque_n_m, std_dev_n_m: variance.sqrt() };
        (found.torque_n_m.is_finite() && found.std_dev_n_m.is_finite()).then_some(found)
    }

    /// Which gear's speeds the readings show in a shift of such a gearbox.
    pub(super) fn phase_at_turbine(&self, state: &GearboxState<T>, gear: ShiftCommand) -> Option<ShiftPhase> {
        let speeds = self.measured(&state.newest, None);
        let is_in = |gear| Some(!self.slip(self.tables.gear(gear)?.ratio, speeds).is_over());
        self.are_read(&state.newest).then_some(match (is_in(gear.from)?, is_in(gear.to)?) {
            (true, _) => ShiftPhase::OffgoingHolds,
            (_, true) => ShiftPhase::OncomingHolds,
            _ => ShiftPhase::BothSlip,
        })
    }
}
