//! The four kinds of shift, and the order of their phases.
//!
//! Friction does work: with `U` the clutch torque at the turbine, `U (w_t - i w_0) >= 0`. While the speed ratio changes
//! from that of the offgoing clutch to that of the oncoming clutch, an upshift has `U_off <= 0 <= U_on`, a downshift
//! `U_on <= 0 <= U_off`. Only the clutch whose torque has the sign of the turbine torque can carry the load while it slips,
//! and it controls the inertia phase.

use crate::Real;

/// Direction of the ratio change, and of the turbine torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShiftKind {
    /// To a smaller ratio, turbine drives.
    PowerOnUp,
    /// To a larger ratio, turbine drives.
    PowerOnDown,
    /// To a smaller ratio, turbine is driven.
    PowerOffUp,
    /// To a larger ratio, turbine is driven.
    CoastDown,
}

/// Order of the phases of a shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PhaseOrder {
    /// Torque phase, then inertia phase under control of the oncoming clutch.
    TorqueFirst,
    /// Inertia phase under control of the offgoing clutch, then torque phase.
    InertiaFirst,
}

impl ShiftKind {
    /// The four kinds.
    pub const ALL: [Self; 4] = [Self::PowerOnUp, Self::PowerOffUp, Self::PowerOnDown, Self::CoastDown];

    /// The kind at this turbine torque. `None` without torque or without a change of ratio, and between forward and
    /// reverse: there the output is at rest, and no clutch hands the load over to the other.
    pub fn of<T: Real>(turbine_n_m: T, ratio_offgoing: T, ratio_oncoming: T) -> Option<Self> {
        let zero = T::zero();
        if ratio_offgoing * ratio_oncoming <= zero {
            return None;
        }
        let decrease = ratio_offgoing.abs() - ratio_oncoming.abs();
        let (up, down) = (decrease > zero, decrease < zero);
        let (on, off) = (turbine_n_m > zero, turbine_n_m < zero);
        match (up, down, on, off) {
            (true, _, true, _) => Some(Self::PowerOnUp),
            (_, true, true, _) => Some(Self::PowerOnDown),
            (true, _, _, true) => Some(Self::PowerOffUp),
            (_, true, _, true) => Some(Self::CoastDown),
            _ => None,
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::PowerOnUp => "power-on upshift",
            Self::PowerOffUp => "power-off upshift",
            Self::PowerOnDown => "power-on downshift",
            Self::CoastDown => "coast downshift",
        }
    }

    /// The order of its phases: torque phase first if `sign(T_t) (|i_off| - |i_on|) > 0`.
    pub fn order(self) -> PhaseOrder {
        match self {
            Self::PowerOnUp | Self::CoastDown => PhaseOrder::TorqueFirst,
            Self::PowerOnDown | Self::PowerOffUp => PhaseOrder::InertiaFirst,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_of_torque_and_ratio_change_gives_kind_and_order() {
        let of = ShiftKind::of::<f64>;
        assert_eq!(of(100.0, 2.5, 1.0), Some(ShiftKind::PowerOnUp));
        assert_eq!(of(-20.0, 2.5, 1.0), Some(ShiftKind::PowerOffUp));
        assert_eq!(of(100.0, 1.0, 2.5), Some(ShiftKind::PowerOnDown));
        assert_eq!(of(-20.0, 1.0, 2.5), Some(ShiftKind::CoastDown));
        for (kind, sign) in ShiftKind::ALL.into_iter().zip([1.0, -1.0, -1.0, 1.0]) {
            let first = if sign > 0.0 { PhaseOrder::TorqueFirst } else { PhaseOrder::InertiaFirst };
            assert_eq!(kind.order(), first, "{kind:?}");
        }
    }

    #[test]
    fn two_reverse_gears_shift_as_two_forward_gears() {
        assert_eq!(ShiftKind::of(100.0, -3.4, -2.0), Some(ShiftKind::PowerOnUp));
        assert_eq!(ShiftKind::of(100.0, -2.0, -3.4), Some(ShiftKind::PowerOnDown));
    }

    #[test]
    fn without_torque_or_change_and_between_directions_there_is_no_kind() {
        for (torque, off, on) in [
            (0.0, 2.5, 1.0),
            (100.0, 2.5, 2.5),
            (100.0, 2.5, -3.0),
            (100.0, 0.0, 1.0),
            (f64::NAN, 2.5, 1.0),
            (100.0, f64::NAN, 1.0),
        ] {
            assert_eq!(ShiftKind::of(torque, off, on), None);
        }
    }
}
