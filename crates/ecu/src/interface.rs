//! What passes between C and the filter: plain words without padding.

use core::mem::offset_of;

use car::{Gear, ShiftCommand};
use drivetrain::Real;
use observer::gearbox::{ClutchEstimate, MAX_ELEMENTS, ShiftEstimate, ShiftInput, ShiftPhase};
use observer::{ChannelHealth, Channels};

/// A reading of a channel.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reading {
    /// The value, in the unit of the channel.
    pub value: f32,
    /// Time from the moment when it was measured until this step, s.
    pub age_s: f32,
    /// Not zero if a reading came since the step before.
    pub came: u32,
}

/// What came since the step before.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Input {
    /// Time since the step before, s. Not used in the first step.
    pub dt_s: f32,
    /// Engine speed, rad/s.
    pub engine_rad_s: Reading,
    /// Turbine speed, rad/s.
    pub turbine_rad_s: Reading,
    /// Speed of the gearbox output, rad/s.
    pub output_rad_s: Reading,
    /// Speed of the driven wheels, rad/s.
    pub wheel_rad_s: Reading,
    /// Engine torque as the engine's controller reports it, N m.
    pub engine_n_m: Reading,
    /// Longitudinal acceleration by an accelerometer, positive forward, with the part of gravity along the road, m/s^2.
    pub acceleration_m_s2: Reading,
    /// Temperature of the oil in the gearbox, degC.
    pub oil_degc: Reading,
    /// Not zero while the lock-up clutch of the converter carries torque.
    pub lock_up_applied: u32,
    /// Place of the gear before, -1 for neutral; the gear itself while there is no shift.
    pub gear_from: i32,
    /// Place of the gear after.
    pub gear_to: i32,
    /// Commands of the valves, A or %, by the places of the elements.
    pub commands: [Reading; MAX_ELEMENTS],
}

/// The clutch holds.
pub const CLUTCH_HOLDS: u32 = 1;
/// The speeds show nothing of its torque: the estimate is that of the valve model.
pub const CLUTCH_HIDDEN: u32 = 2;
/// There are guaranteed ranges.
pub const CLUTCH_RANGE: u32 = 4;

/// A clutch of a shift.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clutch {
    /// Place of the element, -1 of a one-way clutch.
    pub element: i32,
    /// [`CLUTCH_HOLDS`], [`CLUTCH_HIDDEN`], [`CLUTCH_RANGE`].
    pub flags: u32,
    /// Cylinder pressure, Pa.
    pub pressure_pa: f32,
    /// Torque, N m, positive when it drives its output side.
    pub torque_n_m: f32,
    /// Standard deviation of the torque, N m.
    pub std_dev_n_m: f32,
    /// Standard deviation of the pressure, Pa.
    pub pressure_std_dev_pa: f32,
    /// Pressure by the models of valve and piston alone, Pa.
    pub valve_pa: f32,
    /// Torque by these models and friction alone, N m.
    pub open_loop_n_m: f32,
    /// Lowest and highest pressure for errors within the budget, Pa.
    pub pressure_range_pa: [f32; 2],
    /// Lowest and highest torque for errors within the budget, N m.
    pub torque_range_n_m: [f32; 2],
}

/// Bits of [`Estimate::given`].
pub mod given {
    /// Gears and phase.
    pub const GEAR: u32 = 1 << 0;
    /// Both clutches of a shift.
    pub const CLUTCHES: u32 = 1 << 1;
    /// Torque at the gearbox input.
    pub const TURBINE: u32 = 1 << 2;
    /// Torque of the drive shafts.
    pub const SHAFT: u32 = 1 << 3;
    /// Torque of the clutch between engine and gearbox.
    pub const INPUT_CLUTCH: u32 = 1 << 4;
    /// Torque of all clutches at the turbine.
    pub const AT_TURBINE: u32 = 1 << 5;
    /// Pressure range of the first element; of the next ones the next bits.
    pub const ELEMENT_RANGE: u32 = 1 << 8;
}

/// The estimate after a step. What is not given is zero.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimate {
    /// Bits of the [`crate::status`].
    pub status: u32,
    /// What is given: bits of [`given`].
    pub given: u32,
    /// Health of the estimate, from 0, good, to 16.
    pub health: u32,
    /// Place of the gear before the shift that the filter is in; -1 for none.
    pub gear_from: i32,
    /// Place of the gear after it.
    pub gear_to: i32,
    /// 0 in gear, 1 the offgoing clutch holds, 2 both slip, 3 the oncoming clutch holds; -1 for none.
    pub phase: i32,
    /// The clutch that opens.
    pub offgoing: Clutch,
    /// The clutch that closes.
    pub oncoming: Clutch,
    /// Slip of the offgoing clutch away from the new gear, at the turbine, rad/s.
    pub flare_rad_s: f32,
    /// Torque at the gearbox input, N m.
    pub turbine_n_m: f32,
    /// Torque of the drive shafts, N m.
    pub shaft_n_m: f32,
    /// Torque of the clutch between engine and gearbox, N m, and its standard deviation.
    pub input_clutch_n_m: [f32; 2],
    /// Torque of all clutches at the turbine, N m, and its standard deviation: of a gearbox by its ratios alone.
    pub at_turbine_n_m: [f32; 2],
    /// Pressure of each element by the models of its valve and piston, Pa.
    pub element_pa: [f32; MAX_ELEMENTS],
    /// Lowest and highest pressure of each element for errors within the budget, Pa.
    pub element_range_pa: [[f32; 2]; MAX_ELEMENTS],
    /// What became of the readings of engine, turbine, output and wheel speed, engine torque and acceleration: 0 unused, 1 good, 2 absent,
    /// 3 refused, 4 lost.
    pub channels: [u32; 6],
    /// The same of the command of each element.
    pub commands: [u32; MAX_ELEMENTS],
}

/// Words of an [`Estimate`].
pub const ESTIMATE_WORDS: usize = size_of::<Estimate>() / 4;

impl Estimate {
    /// Its words, from the first to the last.
    pub fn words(&self) -> &[u32; ESTIMATE_WORDS] {
        // SAFETY: it consists of words of 32 bits without padding, and every value of a word is one.
        unsafe { &*core::ptr::from_ref(self).cast() }
    }

    /// The same to be changed.
    pub fn words_mut(&mut self) -> &mut [u32; ESTIMATE_WORDS] {
        // SAFETY: as above; every word is a value of its member.
        unsafe { &mut *core::ptr::from_mut(self).cast() }
    }

    /// Whether the word at this place is a real number; the others are whole ones.
    pub const fn is_real(at: usize) -> bool {
        let byte = 4 * at;
        let [offgoing, oncoming] = [offset_of!(Self, offgoing), offset_of!(Self, oncoming)];
        let of_clutch = offset_of!(Clutch, pressure_pa);
        let is_whole = byte < offgoing + of_clutch
            || (byte >= oncoming && byte < oncoming + of_clutch)
            || byte >= offset_of!(Self, channels);
        !is_whole
    }
}

/// Words of an [`Input`].
pub const INPUT_WORDS: usize = size_of::<Input>() / 4;

impl Input {
    /// Its words, from the first to the last.
    pub fn words(&self) -> &[u32; INPUT_WORDS] {
        // SAFETY: it consists of words of 32 bits without padding, and every value of a word is one.
        unsafe { &*core::ptr::from_ref(self).cast() }
    }

    /// The same to be changed.
    pub fn words_mut(&mut self) -> &mut [u32; INPUT_WORDS] {
        // SAFETY: as above; every word is a value of its member.
        unsafe { &mut *core::ptr::from_mut(self).cast() }
    }

    /// Whether the word at this place is a real number; the others are whole ones.
    pub const fn is_real(at: usize) -> bool {
        let byte = 4 * at;
        let [first, whole, commands] =
            [offset_of!(Self, engine_rad_s), offset_of!(Self, lock_up_applied), offset_of!(Self, commands)];
        let in_readings = if byte >= commands { byte - commands } else { byte.wrapping_sub(first) };
        let is_whole = byte >= whole && byte < commands;
        byte < first || !is_whole && in_readings % size_of::<Reading>() != offset_of!(Reading, came)
    }

    /// In neutral, with a reading of each speed and command in each step, and none of torque, acceleration and oil.
    pub fn usual() -> Self {
        let came = Reading { came: 1, ..Reading::default() };
        Self {
            engine_rad_s: came,
            turbine_rad_s: came,
            output_rad_s: came,
            wheel_rad_s: came,
            gear_from: -1,
            gear_to: -1,
            commands: [came; MAX_ELEMENTS],
            ..Self::default()
        }
    }
}

impl Reading {
    /// A reading, or that none came.
    pub fn of(reading: Option<observer::Reading<f32>>) -> Self {
        reading.map_or(Self::default(), |of| Self { value: of.value, age_s: of.age_s, came: 1 })
    }

    /// As the filter takes it.
    pub(crate) fn reading(&self) -> Option<observer::Reading<f32>> {
        (self.came != 0).then_some(observer::Reading { value: self.value, age_s: self.age_s })
    }
}

/// The place of a gear as C has it.
fn place_of(gear: Gear) -> i32 {
    gear.place().map_or(-1, |place| place as i32)
}

impl Input {
    /// What came, as C would give it.
    pub fn of(input: &ShiftInput<f32>) -> Self {
        Self {
            dt_s: input.dt_s,
            engine_rad_s: Reading::of(input.engine_rad_s),
            turbine_rad_s: Reading::of(input.turbine_rad_s),
            output_rad_s: Reading::of(input.output_rad_s),
            wheel_rad_s: Reading::of(input.wheel_rad_s),
            engine_n_m: Reading::of(input.engine_n_m),
            acceleration_m_s2: Reading::of(input.acceleration_m_s2),
            oil_degc: Reading::default(),
            lock_up_applied: u32::from(input.lock_up_applied),
            gear_from: place_of(input.gear.from),
            gear_to: place_of(input.gear.to),
            commands: input.commands.map(Reading::of),
        }
    }

    /// As the filter takes it, in this gear.
    pub(crate) fn shift_input(&self, gear: ShiftCommand) -> ShiftInput<f32> {
        ShiftInput {
            dt_s: self.dt_s,
            engine_rad_s: self.engine_rad_s.reading(),
            turbine_rad_s: self.turbine_rad_s.reading(),
            output_rad_s: self.output_rad_s.reading(),
            wheel_rad_s: self.wheel_rad_s.reading(),
            engine_n_m: self.engine_n_m.reading(),
            acceleration_m_s2: self.acceleration_m_s2.reading(),
            lock_up_applied: self.lock_up_applied != 0,
            commands: self.commands.map(|command| command.reading()),
            gear,
        }
    }

    /// The gear, among so many; `None` if it is none of them.
    pub(crate) fn gear(&self, gears: usize) -> Option<ShiftCommand> {
        let place = |of: i32| match usize::try_from(of) {
            Ok(place) if place < gears => Some(Gear::at(place)),
            Err(_) if of == -1 => Some(Gear::Neutral),
            _ => None,
        };
        Some(ShiftCommand { from: place(self.gear_from)?, to: place(self.gear_to)? })
    }
}

impl Clutch {
    fn of(estimate: &ClutchEstimate<f32>) -> Self {
        let ranges = estimate.pressure_range_pa.zip(estimate.torque_range_n_m);
        let (pressure_range_pa, torque_range_n_m) = ranges.unwrap_or_default();
        let flag = |bit: u32, is_set: bool| if is_set { bit } else { 0 };
        Self {
            element: estimate.element.place().map_or(-1, |place| place as i32),
            flags: flag(CLUTCH_HOLDS, estimate.holds)
                | flag(CLUTCH_HIDDEN, estimate.hidden)
                | flag(CLUTCH_RANGE, ranges.is_some()),
            pressure_pa: estimate.pressure_pa,
            torque_n_m: estimate.torque_n_m,
            std_dev_n_m: estimate.std_dev_n_m,
            pressure_std_dev_pa: estimate.pressure_std_dev_pa,
            valve_pa: estimate.valve_pa,
            open_loop_n_m: estimate.open_loop_n_m,
            pressure_range_pa,
            torque_range_n_m,
        }
    }
}

fn phase_number(phase: ShiftPhase) -> i32 {
    match phase {
        ShiftPhase::InGear => 0,
        ShiftPhase::OffgoingHolds => 1,
        ShiftPhase::BothSlip => 2,
        ShiftPhase::OncomingHolds => 3,
    }
}

fn channel_number(health: ChannelHealth) -> u32 {
    match health {
        ChannelHealth::Unused => 0,
        ChannelHealth::Good => 1,
        ChannelHealth::Absent => 2,
        ChannelHealth::Refused => 3,
        ChannelHealth::Lost => 4,
    }
}

impl Estimate {
    /// What the filter says, with the pressure ranges of the elements; the status is that of the readings.
    pub fn of(estimate: &ShiftEstimate<f32>, ranges_pa: &[Option<[f32; 2]>; MAX_ELEMENTS]) -> Self {
        let flag = |bit: u32, is_set: bool| if is_set { bit } else { 0 };
        let mut given = flag(given::GEAR, estimate.gear.is_some())
            | flag(given::CLUTCHES, estimate.clutches.is_some())
            | flag(given::TURBINE, estimate.turbine_n_m.is_some())
            | flag(given::SHAFT, estimate.shaft_n_m.is_some())
            | flag(given::INPUT_CLUTCH, estimate.input_clutch.is_some())
            | flag(given::AT_TURBINE, estimate.at_turbine.is_some());
        for (at, range) in ranges_pa.iter().enumerate() {
            given |= flag(given::ELEMENT_RANGE << at, range.is_some());
        }
        let Channels { engine, turbine, output, wheel, engine_torque, acceleration, .. } = estimate.channels;
        let [offgoing, oncoming] = estimate.clutches.map_or([Clutch::default(); 2], |of| of.each_ref().map(Clutch::of));
        Self {
            status: 0,
            given,
            health: estimate.health as u32,
            gear_from: estimate.gear.map_or(-1, |gear| place_of(gear.from)),
            gear_to: estimate.gear.map_or(-1, |gear| place_of(gear.to)),
            phase: estimate.phase.map_or(-1, phase_number),
            offgoing,
            oncoming,
            flare_rad_s: estimate.flare_rad_s,
            turbine_n_m: estimate.turbine_n_m.unwrap_or_default(),
            shaft_n_m: estimate.shaft_n_m.unwrap_or_default(),
            input_clutch_n_m: estimate.input_clutch.map_or([0.0; 2], |of| [of.torque_n_m, of.std_dev_n_m]),
            at_turbine_n_m: estimate.at_turbine.map_or([0.0; 2], |of| [of.torque_n_m, of.std_dev_n_m]),
            element_pa: estimate.valve_pa,
            element_range_pa: ranges_pa.map(Option::unwrap_or_default),
            channels: [engine, turbine, output, wheel, engine_torque, acceleration].map(channel_number),
            commands: estimate.commands.map(channel_number),
        }
    }
}

/// Whether this is a finite number.
pub(crate) fn is_number(value: f32) -> bool {
    Real::is_finite(value)
}
