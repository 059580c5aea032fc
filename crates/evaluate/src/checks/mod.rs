//! Whether a log is one of this car: what its readings contradict, each rule in a file of its own.

mod came_speed;
mod check;
mod clutch_torques;
mod command_delay;
mod contradictions;
mod converter_check;
mod doubted_pressures;
mod failed_speeds;
pub mod held_commands;
mod holes;
mod in_gear;
mod lock_up_check;
mod open_loop;
mod other_shifts;
mod polled_speeds;
mod pressing;
pub mod ratio_histogram;
mod ratio_scale;
mod refused_commands;
mod scales;
mod slipping_elements;
mod still_commands;
pub mod swapped_speeds;
mod unannounced;
mod unused_acceleration;

use car::{Car, ErrorBudget};
use observer::ShiftTables;

use self::clutch_torques::ClutchTorques;
use self::command_delay::CommandDelay;
use self::contradictions::CommandCheck;
use self::converter_check::ConverterCheck;
use self::doubted_pressures::DoubtedPressures;
use self::failed_speeds::FailedSpeeds;
use self::held_commands::HeldCommands;
use self::holes::Holes;
use self::in_gear::InGear;
use self::lock_up_check::LockUpCheck;
use self::open_loop::OpenLoop;
use self::other_shifts::OtherShifts;
use self::polled_speeds::PolledSpeeds;
use self::refused_commands::RefusedCommands;
use self::scales::Scales;
use self::slipping_elements::SlippingElements;
use self::still_commands::StillCommands;
use self::swapped_speeds::SwappedSpeeds;
use self::unannounced::UnannouncedShifts;
use self::unused_acceleration::UnusedAcceleration;

pub use came_speed::CameSpeed;
pub use in_gear::Unusable;
pub use ratio_scale::WrongScale;
pub use refused_commands::RefusedCommand;

pub(crate) use check::{Check, CheckedRow, EndedShift};
pub(crate) use in_gear::GearSpeeds;
pub(crate) use other_shifts::is_of_its_gears;

/// All checks of a log.
pub(crate) struct Checks<'c> {
    pub(crate) swapped: SwappedSpeeds,
    commands: CommandCheck<'c>,
    pub(crate) in_gear: InGear,
    pub(crate) open_loop: OpenLoop,
    doubted: DoubtedPressures<'c>,
    pub(crate) delay: CommandDelay<'c>,
    pub(crate) converter: ConverterCheck<'c>,
    pub(crate) lock_up: LockUpCheck<'c>,
    pub(crate) refused: RefusedCommands<'c>,
    still: StillCommands<'c>,
    held: HeldCommands<'c>,
    pub(crate) holes: Holes,
    other: OtherShifts,
    polled: PolledSpeeds,
    failed: FailedSpeeds,
    unannounced: UnannouncedShifts,
    acceleration: UnusedAcceleration,
    pub(crate) slipping: SlippingElements<'c>,
    pub(crate) torques: ClutchTorques<'c>,
    pub(crate) scales: Scales<'c>,
}

impl<'c> Checks<'c> {
    pub(crate) fn new(car: &'c Car, tables: &'c ShiftTables<f64>, budget: &ErrorBudget) -> Self {
        Self {
            swapped: SwappedSpeeds::default(),
            commands: CommandCheck::new(car, tables, budget),
            in_gear: InGear::default(),
            open_loop: OpenLoop::new(car),
            doubted: DoubtedPressures::new(car),
            delay: CommandDelay::new(tables, budget),
            converter: ConverterCheck::new(car),
            lock_up: LockUpCheck::new(car),
            refused: RefusedCommands::new(car, tables),
            still: StillCommands::new(car, tables),
            held: HeldCommands::new(car, tables),
            holes: Holes::default(),
            other: OtherShifts::default(),
            polled: PolledSpeeds::default(),
            failed: FailedSpeeds::default(),
            unannounced: UnannouncedShifts::new(car),
            acceleration: UnusedAcceleration::default(),
            slipping: SlippingElements::new(car, tables, budget),
            torques: ClutchTorques::new(car),
            scales: Scales::new(car),
        }
    }

    /// Each of them, in the order of their warnings.
    pub(crate) fn each(&mut self) -> [&mut dyn Check; 20] {
        [
            &mut self.swapped,
            &mut self.commands,
            &mut self.in_gear,
            &mut self.open_loop,
            &mut self.doubted,
            &mut self.delay,
            &mut self.converter,
            &mut self.lock_up,
            &mut self.refused,
            &mut self.still,
            &mut self.held,
            &mut self.holes,
            &mut self.other,
            &mut self.polled,
            &mut self.failed,
            &mut self.acceleration,
            &mut self.unannounced,
            &mut self.slipping,
            &mut self.torques,
            &mut self.scales,
        ]
    }
}
