//! The car of a set of parameters.

use car::{Shaft, Vehicle};
use drivetrain::{Clutch, Converter, Cylinder, Driveline, Engagement, ReducedShift, RoadLoad, ShiftCoefficients, Tyre};

use crate::Parameter;
use crate::parameters::{Prior, SHAPE_MIDDLE_RAD_S, SLOPE_SPAN_RAD_S};
use crate::pressure::Hydraulics;
use crate::record::{ReadingAges, SegmentKind};
use crate::shape::{Knots, Map, mapped};

/// The car of a set of parameters, and how its signals are read.
#[derive(Debug, Clone)]
pub(crate) struct Car {
    pub(crate) converter: Converter<f64>,
    pub(crate) clutch: Clutch<f64>,
    pub(crate) offgoing: Clutch<f64>,
    pub(crate) hydraulics: Hydraulics,
    pub(crate) offgoing_hydraulics: Hydraulics,
    /// That of the oncoming clutch, of which the motion does not depend: a fill is over before both clutches slip.
    pub(crate) cylinder: Option<Cylinder<f64>>,
    pub(crate) command_delay_s: f64,
    pub(crate) shift: ReducedShift<f64>,
    coefficients: [ShiftCoefficients<f64>; 3],
    pub(crate) driveline: Driveline<f64>,
    pub(crate) road: RoadLoad<f64>,
    pub(crate) tyre: Tyre<f64>,
    pub(crate) engine_inertia_kg_m2: f64,
    pub(crate) engine_drag_n_m_s: f64,
    pub(crate) output_delay_s: f64,
    pub(crate) wheel_delay_s: f64,
    pub(crate) engine_delay_s: f64,
    pub(crate) wheel_scale: f64,
    pub(crate) engine_torque_scale: f64,
    pub(crate) engine_torque_delay_s: f64,
    pub(crate) pressure_scale: f64,
    pub(crate) pressure_offset_pa: f64,
    pub(crate) pressure_delay_s: f64,
    pub(crate) ages: ReadingAges,
    pub(crate) knots: Knots,
}

impl Car {
    /// The car of the file.
    pub(crate) fn of_file(vehicle: &Vehicle, ages: ReadingAges) -> Self {
        Self {
            converter: vehicle.converter,
            clutch: Clutch {
                friction: Knots::with_points(&vehicle.oncoming.clutch.friction),
                ..vehicle.oncoming.clutch
            },
            offgoing: vehicle.offgoing.clutch,
            hydraulics: Hydraulics::of(&vehicle.oncoming).filled(),
            offgoing_hydraulics: Hydraulics::of(&vehicle.offgoing).filled(),
            cylinder: Hydraulics::of(&vehicle.oncoming).cylinder,
            command_delay_s: 0.0,
            shift: vehicle.shift,
            coefficients: coefficients(&vehicle.shift),
            driveline: vehicle.driveline,
            road: vehicle.road,
            tyre: vehicle.tyre,
            engine_inertia_kg_m2: vehicle.engine.inertia_kg_m2,
            engine_drag_n_m_s: vehicle.engine.drag_n_m_s,
            output_delay_s: 0.0,
            wheel_delay_s: 0.0,
            engine_delay_s: 0.0,
            wheel_scale: 1.0,
            engine_torque_scale: 1.0,
            engine_torque_delay_s: 0.0,
            pressure_scale: 1.0,
            pressure_offset_pa: 0.0,
            pressure_delay_s: 0.0,
            ages,
            knots: Knots::of(vehicle),
        }
    }

    /// The car whose parameters have these unknowns.
    pub(crate) fn with(&self, shafts: &[Shaft], priors: &[Prior], unknowns: &[f64]) -> Self {
        let mut car = self.clone();
        for (prior, x) in priors.iter().zip(unknowns) {
            car.set(prior.parameter, prior.parameter.value(*x), shafts);
        }
        car.coefficients = coefficients(&car.shift);
        car
    }

    /// Applies a value to the car of the file.
    fn set(&mut self, parameter: Parameter, value: f64, shafts: &[Shaft]) {
        match parameter {
            Parameter::Capacity => self.converter.capacity_n_m_s2 = self.converter.capacity_n_m_s2.scaled(value),
            Parameter::TorqueRatio => {
                let ratio = |ratio: f64| 1.0 + value * (ratio - 1.0);
                self.converter.torque_ratio = mapped(&self.converter.torque_ratio, |_, t| ratio(t));
            }
            Parameter::Friction => {
                self.clutch.friction = self.clutch.friction.scaled(value);
                self.clutch.static_friction *= value;
            }
            Parameter::FrictionAtRest => {
                self.clutch.friction =
                    mapped(&self.clutch.friction, |slip, mu| mu * friction_shape([value, 0.0], slip));
            }
            Parameter::FrictionSlope => {
                self.clutch.friction =
                    mapped(&self.clutch.friction, |slip, mu| mu * friction_shape([0.0, value], slip));
            }
            Parameter::Spring => self.clutch.return_spring_n *= value,
            Parameter::Gain => self.hydraulics.valve = self.hydraulics.valve.changed(1.0, value, None),
            Parameter::Lag => self.hydraulics.valve = self.hydraulics.valve.changed(value, 1.0, None),
            Parameter::CommandDelay => self.command_delay_s = value,
            Parameter::Inertia(i) => {
                if let Some(shaft) = shafts.get(i) {
                    for (row, fraction) in self.shift.mass_kg_m2.iter_mut().zip(shaft.mass_kg_m2) {
                        row.iter_mut().zip(fraction).for_each(|(cell, fraction)| *cell += (value - 1.0) * fraction);
                    }
                }
            }
            Parameter::Stiffness => self.driveline.shaft_stiffness_n_m_rad *= value,
            Parameter::Damping => self.driveline.shaft_damping_n_m_s_rad *= value,
            Parameter::Tyre => self.tyre.slip_scale *= value,
            Parameter::Mass => self.road.mass_kg *= value,
            // Each shift has a load of its own, which takes what these would change.
            Parameter::Rolling | Parameter::Air => {}
            Parameter::OffgoingFriction => self.offgoing.friction = self.offgoing.friction.scaled(value),
            Parameter::OutputDelay => self.output_delay_s = value,
            Parameter::WheelDelay => self.wheel_delay_s = value,
            Parameter::EngineDelay => self.engine_delay_s = value,
            Parameter::WheelScale => self.wheel_scale = value,
            Parameter::EngineInertia => self.engine_inertia_kg_m2 *= value,
            Parameter::EngineTorqueScale => self.engine_torque_scale = value,
            Parameter::EngineTorqueDelay => self.engine_torque_delay_s = value,
            Parameter::PressureScale => self.pressure_scale = value,
            Parameter::PressureOffset => self.pressure_offset_pa = value,
            Parameter::PressureDelay => self.pressure_delay_s = value,
            Parameter::Hysteresis => self.hydraulics.hysteresis_pa = value,
            Parameter::Shape(map @ Map::Friction, i) => {
                self.clutch.friction = self.knots.changed(&self.clutch.friction, map, i, value);
            }
            Parameter::Shape(map @ Map::Capacity, i) => {
                self.converter.capacity_n_m_s2 = self.knots.changed(&self.converter.capacity_n_m_s2, map, i, value);
            }
            Parameter::Shape(map, i) => self.hydraulics.valve = self.knots.valve(self.hydraulics.valve, map, i, value),
        }
    }

    /// Accelerations per torque in a segment.
    pub(crate) fn coefficients(&self, kind: SegmentKind) -> &ShiftCoefficients<f64> {
        &self.coefficients[kind as usize]
    }

    /// Torque of the oncoming clutch while it slips, N m.
    #[inline]
    pub(crate) fn oncoming_torque(&self, pressure_pa: f64, slip_rad_s: f64) -> f64 {
        drivetrain::clutch::direction(slip_rad_s) * self.clutch.torque_capacity(pressure_pa, slip_rad_s)
    }
}

/// Factor on the friction at a slip, of its changes at rest and above the middle slip.
pub(crate) fn friction_shape([at_rest, slope]: [f64; 2], slip_rad_s: f64) -> f64 {
    let below = (1.0 - slip_rad_s / SHAPE_MIDDLE_RAD_S).max(0.0);
    let above = ((slip_rad_s - SHAPE_MIDDLE_RAD_S) / SLOPE_SPAN_RAD_S).clamp(0.0, 1.0);
    (1.0 + at_rest * below) * (1.0 + slope * above)
}

fn coefficients(shift: &ReducedShift<f64>) -> [ShiftCoefficients<f64>; 3] {
    [Engagement::OffgoingStuck, Engagement::BothSlipping, Engagement::OncomingStuck]
        .map(|kind| shift.coefficients(kind))
}
