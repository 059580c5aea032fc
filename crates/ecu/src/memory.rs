//! The observer in memory that its caller gives.
//!
//! The memory begins with a head of fixed size; behind it are the tables of the car. It has no pointers and may be copied and moved as
//! bytes. On a machine of 64 bits it is a little larger than on one of 32.

use car::ShiftCommand;
use observer::LOST_S;
use observer::gearbox::{
    FrictionElement, GearRow, GearboxFilter, GearboxState, GearboxTables, ShiftEstimate, ShiftRow,
};
use observer::{ChannelHealth, Health};

use crate::image::Header;
use crate::interface::{Estimate, Input, is_number};
use crate::layout::Parameters;
use crate::learnt::{self, LearntWords};
use crate::status;
use crate::words::Layout;

/// Alignment of the memory, bytes.
pub const ALIGNMENT: usize = 8;
/// First word of a memory with an observer. The size of the head belongs to it: another version or machine has another one.
const SEAL: u32 = u32::from_le_bytes(*b"WCLM") ^ size_of::<Head>() as u32;

/// The head of the memory.
#[repr(C, align(8))]
struct Head {
    /// [`SEAL`].
    seal: u32,
    header: Header,
    parameters: Parameters<f32>,
    state: GearboxState<f32>,
    estimate: Estimate,
    /// The last gear that was in the tables.
    gear: ShiftCommand,
    has_stepped: bool,
}

/// Places of the tables behind the head, bytes, and where they end.
struct Places {
    elements: usize,
    gears: usize,
    shifts: usize,
    end: usize,
}

impl Places {
    /// For a header whose counts were checked.
    #[inline]
    fn of(header: &Header) -> Self {
        let aligned = |bytes: usize| bytes.next_multiple_of(ALIGNMENT);
        let elements = aligned(size_of::<Head>());
        let gears = aligned(elements + header.elements as usize * size_of::<FrictionElement<f32>>());
        let shifts = aligned(gears + header.gears as usize * size_of::<GearRow<f32>>());
        let end = aligned(shifts + header.shifts as usize * size_of::<ShiftRow<f32>>());
        Self { elements, gears, shifts, end }
    }
}

/// Memory that the observer of an image needs, bytes.
///
/// # Errors
/// A bit of the [`status`]: the image cannot be used.
pub fn size(image: &[u32]) -> Result<usize, u32> {
    Header::of(image).map(|(header, _)| size_by(&header))
}

/// Memory that the observer of an image with this header needs, bytes. The header was checked.
#[inline]
pub fn size_by(header: &Header) -> usize {
    Places::of(header).end
}

/// An observer in its memory.
pub struct Observer<'m> {
    head: &'m mut Head,
    tables: GearboxTables<'m, f32>,
}

impl<'m> Observer<'m> {
    /// Builds the observer of an image, with nothing learnt.
    ///
    /// # Errors
    /// Bits of the [`status`]; the memory then holds no observer.
    ///
    /// # Safety
    /// `memory` is aligned to [`ALIGNMENT`], and `bytes` from there on may be written and belong to nobody else during `'m`.
    pub unsafe fn init(memory: *mut u8, bytes: usize, image: &[u32]) -> Result<Self, u32> {
        if bytes < size_of::<u32>() {
            return Err(status::MEMORY_SIZE);
        }
        // SAFETY: the memory is large enough for its first word.
        unsafe { memory.cast::<u32>().write(0) };
        let (header, mut words) = Header::of(image)?;
        let places = Places::of(&header);
        if bytes < places.end {
            return Err(status::MEMORY_SIZE);
        }
        let parameters = Parameters::take(&mut words).ok_or(status::IMAGE_CONTENT)?;
        // SAFETY: the places are aligned, apart from each other and within the memory.
        let tables = unsafe {
            GearboxTables {
                elements: fill::<FrictionElement<f32>>(memory.add(places.elements), header.elements, &mut words)?,
                gears: fill::<GearRow<f32>>(memory.add(places.gears), header.gears, &mut words)?,
                shifts: fill::<ShiftRow<f32>>(memory.add(places.shifts), header.shifts, &mut words)?,
            }
        };
        if !words.is_empty() {
            return Err(status::IMAGE_CONTENT);
        }
        let place = memory.cast::<Head>();
        // SAFETY: the head is at the beginning of the memory, which is aligned and large enough. Each member is written in its place, as the
        // stack of a controller may have no room for all of them; the seal is the last one.
        unsafe {
            (&raw mut (*place).header).write(header);
            (&raw mut (*place).parameters).write(parameters);
            (&raw mut (*place).state).write(parameters.filter(tables).start());
            (&raw mut (*place).estimate).write(Estimate::default());
            (&raw mut (*place).gear).write(ShiftCommand::NEUTRAL);
            (&raw mut (*place).has_stepped).write(false);
            (&raw mut (*place).seal).write(SEAL);
            Ok(Self { head: &mut *place, tables })
        }
    }

    /// The observer in a memory; `None` if it holds none.
    ///
    /// # Safety
    /// As [`Self::init`], for the memory that it was called with or a copy of it; or the first word of the memory can be read and is
    /// not that of an observer.
    pub unsafe fn open(memory: *mut u8) -> Option<Self> {
        // SAFETY: the first word may be read; where it is the seal, `init` has written the head and the tables of its header.
        unsafe {
            if memory.cast::<u32>().read() != SEAL {
                return None;
            }
            let head = &mut *memory.cast::<Head>();
            let places = Places::of(&head.header);
            let tables = GearboxTables {
                elements: core::slice::from_raw_parts(
                    memory.add(places.elements).cast(),
                    head.header.elements as usize,
                ),
                gears: core::slice::from_raw_parts(memory.add(places.gears).cast(), head.header.gears as usize),
                shifts: core::slice::from_raw_parts(memory.add(places.shifts).cast(), head.header.shifts as usize),
            };
            Some(Self { head, tables })
        }
    }

    fn filter(&self) -> GearboxFilter<'m, f32> {
        self.head.parameters.filter(self.tables)
    }

    /// Takes what came and returns the estimate for now.
    pub fn step(&mut self, input: &Input) -> &Estimate {
        let mut word = 0;
        let gear = input.gear(self.tables.gears.len()).unwrap_or_else(|| {
            word |= status::GEAR_REFUSED;
            self.head.gear
        });
        self.head.gear = gear;
        if self.head.has_stepped && input.dt_s == 0.0 {
            // A second call at the same time: nothing has changed.
            self.head.estimate.status = word | status::TIME_REFUSED | status::HELD;
            return &self.head.estimate;
        }
        if self.head.has_stepped && is_number(input.dt_s) && input.dt_s > LOST_S as f32 {
            word |= status::TIME_GAP;
        }
        self.head.has_stepped = true;
        if let Some(oil) = input.oil_degc.reading() {
            if is_number(oil.value) {
                self.head.state.take_oil_temperature(oil.value);
            } else {
                word |= status::READING_REFUSED;
            }
        }
        let filter = self.filter();
        let estimate = filter.step(&mut self.head.state, &input.shift_input(gear));
        let ranges_pa = core::array::from_fn(|at| filter.pressure_range_pa(&self.head.state, at));
        word |= match estimate.health {
            Health::TimeRejected => status::TIME_REFUSED | status::HELD,
            _ => of_channels(&estimate, self.tables.elements.len()),
        };
        self.head.estimate = Estimate { status: word, ..Estimate::of(&estimate, &ranges_pa) };
        &self.head.estimate
    }

    /// The estimate of the last step.
    pub fn estimate(&self) -> &Estimate {
        &self.head.estimate
    }

    /// Begins anew with what was learnt, as after a reset of the controller in a drive.
    pub fn reset(&mut self) {
        let learnt = *self.head.state.learnt();
        self.head.state = self.filter().go_on_with(&learnt);
        self.begin();
    }

    fn begin(&mut self) {
        self.head.estimate = Estimate::default();
        self.head.gear = ShiftCommand::NEUTRAL;
        self.head.has_stepped = false;
    }

    /// Writes what was learnt.
    pub fn learnt(&self, into: &mut LearntWords) {
        learnt::write(self.head.state.learnt(), &self.head.header, into);
    }

    /// Begins a new drive with what was learnt in another one, which is believed as far as the shifts of this drive show it.
    ///
    /// # Errors
    /// [`status::LEARNT_REFUSED`]; nothing has changed.
    pub fn start_with(&mut self, from: &LearntWords) -> Result<(), u32> {
        let learnt = learnt::read(from, &self.head.header).ok_or(status::LEARNT_REFUSED)?;
        self.head.state = self.filter().start_with(&learnt);
        self.begin();
        Ok(())
    }
}

/// What became of the readings and of the commands of so many elements.
fn of_channels(estimate: &ShiftEstimate<f32>, elements: usize) -> u32 {
    let channels = estimate.channels.each();
    channels.iter().chain(estimate.commands.iter().take(elements)).fold(0, |word, channel| match channel {
        ChannelHealth::Refused => word | status::READING_REFUSED,
        ChannelHealth::Lost => word | status::CHANNEL_LOST,
        _ => word,
    })
}

/// Reads so many values into this place.
///
/// # Safety
/// The place is aligned and has room for them.
unsafe fn fill<'m, L: Layout>(place: *mut u8, count: u32, words: &mut crate::Words<'_>) -> Result<&'m [L], u32> {
    let first = place.cast::<L>();
    for at in 0..count as usize {
        let value = L::take(words).ok_or(status::IMAGE_CONTENT)?;
        // SAFETY: there is room for it.
        unsafe { first.add(at).write(value) };
    }
    // SAFETY: all of them are written.
    Ok(unsafe { core::slice::from_raw_parts(first, count as usize) })
}
