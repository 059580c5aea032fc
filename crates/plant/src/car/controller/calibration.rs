//! Numbers of the shift controller.

use car::{ControllerCalibration, FastFill};

use super::target::{SlipCurve, SlipTarget, SlipTargets};

/// Calibration of the shift controller: one set for all gearboxes and all kinds of shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarCalibration {
    /// Control period, s.
    pub control_period_s: f64,
    /// Time to bring the oncoming clutch to its kiss point and the offgoing one to what it must hold, s.
    pub fill_s: f64,
    /// The offgoing clutch goes to what it must hold in this time, s, if that is shorter than the fill and the inertia phase comes first: the
    /// oncoming clutch is needed at its end only.
    pub lowering_s: f64,
    /// The fill of a clutch whose piston has a stroke.
    pub fast_fill: FastFill,
    /// Most torque that such a clutch is to carry at the end of its fill, N m at the turbine.
    pub filled_n_m: f64,
    /// The oncoming clutch waits this far below its kiss point, Pa.
    pub below_kiss_pa: f64,
    /// Torque that the offgoing clutch can hold over what it must, before and during the torque phase.
    pub holding_margin: f64,
    /// Torque that the oncoming clutch is given over what it must take, in the torque phase.
    pub taking_margin: f64,
    /// Time constant with which a clutch that holds gives up what it no longer must hold, s.
    pub holding_s: f64,
    /// Duration of the torque phase, s.
    pub torque_phase_s: f64,
    /// Slip of the old gear in the wrong direction that counts as a flare, rad/s at the turbine.
    pub flare_slip_rad_s: f64,
    /// Gain of such a slip on the torque of the oncoming clutch, 1/s.
    pub flare_per_s: f64,
    /// Speed of the oncoming ramp when the old gear flares, over that without.
    pub flare_ramp: f64,
    /// Fraction of the turbine torque that the offgoing clutch holds while the old gear flares.
    pub flare_holding: f64,
    /// Turbine torque beyond which its sign is believed, N m.
    pub sign_n_m: f64,
    /// Time in which the offgoing clutch gives up the turbine torque, until the old gear slips (inertia phase first), s.
    pub release_s: f64,
    /// The slip is seen so long after the command of the torque at which the old gear slips, s.
    pub release_seen_s: f64,
    /// Slip of the old gear at which it is left, rad/s at the turbine.
    pub release_slip_rad_s: f64,
    /// Targets of the slip in the inertia phase.
    pub targets: SlipTargets,
    /// Whether the inertia of an engine without a converter counts in the slip controller; else its feedback makes up for it.
    pub counts_engine: bool,
    /// Time in neutral between the directions, s: the turbine comes up.
    pub neutral_s: f64,
    /// The reference of the slip ends this far past zero, rad/s.
    pub past_synchronous_rad_s: f64,
    /// Gain of the slip error, 1/s.
    pub proportional_per_s: f64,
    /// Gain of its integral, 1/s^2.
    pub integral_per_s2: f64,
    /// The rate of the reference is taken so long ahead, s: the delays of reading, controller and valve.
    pub lead_s: f64,
    /// Gain of the slip beyond synchronous speed during the hand-over, 1/s.
    pub beyond_per_s: f64,
    /// The new gear is taken over so long before the slip reaches zero, s (inertia phase first).
    pub hand_over_lead_s: f64,
    /// Duration of the hand-over, s.
    pub hand_over_s: f64,
    /// Torque of the oncoming clutch at the end over the turbine torque.
    pub lock_margin: f64,
    /// Minimum torque that is given to the oncoming clutch at the end, N m at the turbine.
    pub lock_min_n_m: f64,
    /// Slip at which the oncoming clutch counts as locked, rad/s at the turbine.
    pub lock_slip_rad_s: f64,
    /// Time for which it must be locked, s.
    pub lock_hold_s: f64,
    /// Time in which the locked clutch goes to line pressure, s.
    pub lock_ramp_s: f64,
    /// Time after which the oncoming clutch is closed whatever its slip, s.
    pub longest_s: f64,
    /// Fraction of the engine torque in the inertia phase of power-on upshifts.
    pub up_engine_fraction: f64,
    /// Fraction of the engine torque at the end of the inertia phase of power-on downshifts.
    pub down_engine_fraction: f64,
    /// Fraction of the way at which the torque of an upshift is given back, and that of a downshift is taken.
    pub engine_way: f64,
    /// Time in which the fraction of the engine torque changes by one, s.
    pub engine_ramp_s: f64,
    /// Time in which the engine torque rises from none to the maximum in a shift, s, when the driver asks for it: a pedal that is
    /// moved in a shift is followed as fast as the clutches can answer.
    pub tip_in_s: f64,
    /// Time in which the lock-up clutch opens, s: less than that of the fill.
    pub unlock_s: f64,
    /// Gain of the slip of the lock-up clutch, 1/s.
    pub slip_per_s: f64,
    /// Gain of its integral, 1/s^2.
    pub slip_per_s2: f64,
    /// Speed of the gearbox input below which the clutch of a car without a converter opens, rad/s.
    pub launch_open_rad_s: f64,
    /// Engine speed at a launch above idle speed, per throttle, rad/s.
    pub launch_rad_s: f64,
    /// The most of it, rad/s.
    pub launch_max_rad_s: f64,
    /// Gain of the engine speed at a launch, 1/s.
    pub launch_per_s: f64,
    /// Rate at which the launch clutch takes torque, N m/s; it gives it up four times as fast.
    pub launch_n_m_s: f64,
    /// Time without slip after which the launch clutch closes, s.
    pub launch_lock_s: f64,
    /// Torque of the launch clutch without throttle, N m.
    pub creep_n_m: f64,
    /// Brake at which it is none, 0 to 1.
    pub creep_brake: f64,
    /// Most torque of the launch clutch, per engine speed over one this far below idle speed, N m s/rad.
    pub stall_n_m_s_rad: f64,
    /// How far, rad/s.
    pub stall_rad_s: f64,
    /// Time constant of the output speed, s.
    pub output_filter_s: f64,
    /// Time constant with which a pressure is made to follow, s.
    pub pressure_follow_s: f64,
    /// Most that a command is ahead of its pressure, Pa.
    pub pressure_lead_pa: f64,
}

/// The curve of comfortable shifts.
const SOFT: SlipCurve = SlipCurve::Trapezoid { rise: 0.2, fall: 0.3 };

impl CarCalibration {
    /// The numbers of a calibration.
    pub fn of(calibration: ControllerCalibration) -> Self {
        match calibration {
            ControllerCalibration::Bench => Self::STANDARD,
            ControllerCalibration::Comfort => Self::COMFORT,
        }
    }

    /// Numbers that give a good shift in every gearbox that ships with the program.
    pub const STANDARD: Self = Self {
        control_period_s: 0.01,
        fill_s: 0.20,
        lowering_s: f64::INFINITY,
        fast_fill: FastFill { hold_s: 0.14, ..FastFill::STANDARD },
        filled_n_m: 6.0,
        below_kiss_pa: 4e3,
        holding_margin: 1.2,
        taking_margin: 1.1,
        holding_s: 0.2,
        torque_phase_s: 0.20,
        flare_slip_rad_s: 1.0,
        flare_per_s: 30.0,
        flare_ramp: 1.8,
        flare_holding: 0.5,
        sign_n_m: 5.0,
        release_s: 0.5,
        release_seen_s: 0.0,
        release_slip_rad_s: 3.0,
        targets: SlipTargets {
            power_on_up: SlipTarget::lasting(0.40, SlipCurve::HalfCosine),
            power_off_up: SlipTarget::lasting(0.70, SlipCurve::HalfCosine),
            power_on_down: SlipTarget::lasting(0.72, SlipCurve::HalfCosine),
            coast_down: SlipTarget::lasting(0.40, SlipCurve::HalfCosine),
            from_neutral: SlipTarget::lasting(0.8, SlipCurve::HalfCosine),
        },
        counts_engine: false,
        neutral_s: 0.7,
        past_synchronous_rad_s: 2.5,
        proportional_per_s: 9.0,
        integral_per_s2: 25.0,
        lead_s: 0.06,
        beyond_per_s: 40.0,
        hand_over_lead_s: 0.09,
        hand_over_s: 0.12,
        lock_margin: 1.25,
        lock_min_n_m: 12.0,
        lock_slip_rad_s: 3.0,
        lock_hold_s: 0.03,
        lock_ramp_s: 0.15,
        longest_s: 3.0,
        up_engine_fraction: 0.55,
        down_engine_fraction: 0.7,
        engine_way: 0.8,
        engine_ramp_s: 0.2,
        tip_in_s: 0.5,
        unlock_s: 0.12,
        slip_per_s: 12.0,
        slip_per_s2: 30.0,
        launch_open_rad_s: 95.0,
        launch_rad_s: 260.0,
        launch_max_rad_s: 160.0,
        launch_per_s: 2.0,
        launch_n_m_s: 300.0,
        launch_lock_s: 0.1,
        creep_n_m: 15.0,
        creep_brake: 0.02,
        stall_n_m_s_rad: 8.0,
        stall_rad_s: 12.0,
        output_filter_s: 0.04,
        pressure_follow_s: 0.02,
        pressure_lead_pa: 0.3e6,
    };

    /// Numbers for comfort: the torque for the change of speed is limited to what the occupants accept, and the engine takes part of it.
    pub const COMFORT: Self = Self {
        targets: SlipTargets {
            power_on_up: SlipTarget {
                within_s: [0.35, 0.70],
                engine: 0.35,
                ..SlipTarget::lasting(0.45, SlipCurve::Trapezoid { rise: 0.35, fall: 0.3 })
            },
            power_off_up: SlipTarget {
                curve: SOFT,
                duration_s: 0.6,
                within_s: [0.35, 0.65],
                inertia_fraction: 0.0,
                inertia_m_s2: 0.35,
                engine: 0.0,
            },
            power_on_down: SlipTarget {
                curve: SOFT,
                duration_s: 0.6,
                within_s: [0.45, 0.90],
                inertia_fraction: 0.4,
                inertia_m_s2: 0.2,
                engine: 0.5,
            },
            coast_down: SlipTarget {
                curve: SOFT,
                duration_s: 0.6,
                within_s: [0.55, 0.70],
                inertia_fraction: 0.0,
                inertia_m_s2: 0.2,
                engine: 0.6,
            },
            from_neutral: SlipTarget::lasting(0.9, SOFT),
        },
        counts_engine: true,
        lowering_s: 0.1,
        release_seen_s: 0.06,
        down_engine_fraction: 1.0,
        hand_over_s: 0.16,
        lock_ramp_s: 0.10,
        hand_over_lead_s: 0.04,
        ..Self::STANDARD
    };
}
