//! What a simulated car shows at an instant.

use super::controller::{CarCommands, GearShown, ShiftStage};
use super::integrate::CarStep;
use super::model::{CarModel, CarTorques};
use super::run::Driver;
use crate::Contact;
use crate::gear_train::MAX_ELEMENTS;
use car::{Gear, ShiftCommand};

/// One friction element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementSample {
    /// Its place among the elements of the gearbox.
    pub element: usize,
    /// Command of its valve as it was sent last: current in A, or duty cycle in %.
    pub command: f64,
    /// Pressure, Pa.
    pub pressure_pa: f64,
    /// Torque, N m, positive when it drives its output side; drag included.
    pub torque_n_m: f64,
    /// Slip, rad/s: input side less output side.
    pub slip_rad_s: f64,
    /// Whether it sticks.
    pub sticks: bool,
}

/// A shift that is under way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftUnderWay {
    /// The gear before.
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// Whether it begins in neutral; `from` is then a gear of the other direction, whose clutch is open.
    pub is_from_neutral: bool,
    /// What the controller is about.
    pub stage: ShiftStage,
    /// The clutch that opens.
    pub offgoing: ElementSample,
    /// The clutch that closes.
    pub oncoming: ElementSample,
}

/// The car at an instant. Everything is true; what a car measures of it is for the sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarSample {
    /// Time, s.
    pub time_s: f64,
    /// Gear; during a shift the one that is left.
    pub gear: usize,
    /// Whether no gear is engaged; `gear` is then one of those that follow by one clutch.
    pub is_neutral: bool,
    /// The gear that is left for neutral, until its clutch is open.
    pub left: Option<usize>,
    /// The shift, from its request to the end of its last ramp.
    pub shift: Option<ShiftUnderWay>,
    /// What the driver does.
    pub driver: Driver,
    /// Fraction of the engine torque that the transmission controller leaves.
    pub engine_share: f64,
    /// Speeds and torques.
    pub torques: CarTorques,
    /// Torque on the gearbox input, N m: converter and lock-up clutch, or the engine less its drag and the torque of its own
    /// inertia.
    pub turbine_n_m: f64,
    /// Load of the drive shafts at the gearbox output, N m.
    pub output_n_m: f64,
    /// Driven wheel speed, rad/s.
    pub wheel_rad_s: f64,
    /// Vehicle speed, m/s.
    pub vehicle_m_s: f64,
    /// Vehicle acceleration, m/s^2.
    pub vehicle_m_s2: f64,
    /// Pressure of each element of the gearbox, Pa; zero for dogs and one-way clutches.
    pub pressures_pa: [f64; MAX_ELEMENTS],
    /// Slip of each element, rad/s.
    pub slips_rad_s: [f64; MAX_ELEMENTS],
    /// Commands of the elements, as they were sent last, A or %.
    pub commands: [f64; MAX_ELEMENTS],
}

impl CarSample {
    /// The gear that is engaged or left, and the gear that is wanted.
    pub fn gears(&self) -> ShiftCommand {
        let [from, to] = match &self.shift {
            Some(shift) if shift.is_from_neutral => [Gear::Neutral, Gear::at(shift.to)],
            Some(shift) => [shift.from, shift.to].map(Gear::at),
            None if self.is_neutral => [self.left.map_or(Gear::Neutral, Gear::at), Gear::Neutral],
            None => [Gear::at(self.gear); 2],
        };
        ShiftCommand { from, to }
    }

    /// At a time within a step.
    pub(super) fn of(
        model: &CarModel,
        step: &CarStep<'_>,
        time_s: f64,
        commands: &CarCommands,
        driver: Driver,
        GearShown { gear, is_neutral, left, shift }: GearShown,
    ) -> Self {
        let x = step.at(time_s.clamp(step.start_s, step.end_s));
        let torques = model.torques(step.contacts, &x, step.inputs);
        let mut pressures_pa = [0.0; MAX_ELEMENTS];
        for (element, pressure) in pressures_pa.iter_mut().enumerate().take(model.lock_up()) {
            *pressure = model.pressure_pa(&x, element);
        }
        let element = |element: usize| ElementSample {
            element,
            command: commands.elements[element],
            pressure_pa: pressures_pa[element],
            torque_n_m: torques.elements_n_m[element],
            slip_rad_s: model.slip(&x, element),
            sticks: step.contacts.of(element) == Some(Contact::Stuck),
        };
        Self {
            time_s,
            gear,
            is_neutral,
            left,
            shift: shift.map(|shift| ShiftUnderWay {
                from: shift.from,
                to: shift.to,
                is_from_neutral: shift.is_from_neutral,
                stage: shift.stage,
                offgoing: element(shift.offgoing),
                oncoming: element(shift.oncoming),
            }),
            driver,
            engine_share: commands.engine_share,
            turbine_n_m: torques.turbine_n_m(model),
            output_n_m: torques.shaft_n_m / model.car.driveline.final_ratio,
            wheel_rad_s: x.wheel_rad_s,
            vehicle_m_s: x.vehicle_m_s,
            vehicle_m_s2: model.vehicle_acceleration(&x, torques.tyre_n, step.inputs),
            pressures_pa,
            slips_rad_s: std::array::from_fn(
                |element| {
                    if element <= model.lock_up() { model.slip(&x, element) } else { 0.0 }
                },
            ),
            commands: commands.elements,
            torques,
        }
    }
}
