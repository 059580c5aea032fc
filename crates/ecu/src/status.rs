//! Bits of the status word. Zero means that everything is right.

/// The memory holds no observer: `step` before `init`, or after an `init` that failed. Nothing is estimated.
pub const NOT_INITIALISED: u32 = 1 << 0;
/// A pointer is null, or not aligned: memory to 8 bytes, an image to 4.
pub const BAD_POINTER: u32 = 1 << 1;
/// The image has another first word: it is none, or of the other byte order.
pub const IMAGE_MAGIC: u32 = 1 << 2;
/// The image has the layout of another version.
pub const IMAGE_VERSION: u32 = 1 << 3;
/// The image has another length than its header states.
pub const IMAGE_SIZE: u32 = 1 << 4;
/// The checksum of the image is another: a bit has changed, or a value was tuned and the image not sealed.
pub const IMAGE_CHECKSUM: u32 = 1 << 5;
/// The content of the image cannot be that of a car: a value is not a number, a breakpoint not above the one before it.
pub const IMAGE_CONTENT: u32 = 1 << 6;
/// The memory is too small.
pub const MEMORY_SIZE: u32 = 1 << 7;
/// The time step is zero, negative or not a number. The last estimate is held.
pub const TIME_REFUSED: u32 = 1 << 8;
/// The time step is longer than 0.25 s: the filter begins anew with what it has learnt.
pub const TIME_GAP: u32 = 1 << 9;
/// A gear is in no table. The last gear is taken.
pub const GEAR_REFUSED: u32 = 1 << 10;
/// A reading was refused: it is impossible, or it contradicts the others.
pub const READING_REFUSED: u32 = 1 << 11;
/// A channel has given no usable reading for 0.25 s.
pub const CHANNEL_LOST: u32 = 1 << 12;
/// The estimate is that of an earlier step.
pub const HELD: u32 = 1 << 13;
/// What was to be taken as learnt was refused: another version, another gearbox, a wrong checksum, or none that a filter can have.
pub const LEARNT_REFUSED: u32 = 1 << 14;

/// Every bit with its name and meaning, in the order of the bits.
pub const ALL: [(&str, u32, &str); 15] = [
    ("NOT_INITIALISED", NOT_INITIALISED, "the memory holds no observer; nothing is estimated"),
    ("BAD_POINTER", BAD_POINTER, "a pointer is null, or not aligned: memory to 8 bytes, an image to 4"),
    ("IMAGE_MAGIC", IMAGE_MAGIC, "not an image, or one of the other byte order"),
    ("IMAGE_VERSION", IMAGE_VERSION, "the image has the layout of another version"),
    ("IMAGE_SIZE", IMAGE_SIZE, "the image has another length than its header states"),
    ("IMAGE_CHECKSUM", IMAGE_CHECKSUM, "a bit of the image has changed, or a value was tuned without wetclutch_seal"),
    ("IMAGE_CONTENT", IMAGE_CONTENT, "a value is not a number, or a breakpoint not above the one before it"),
    ("MEMORY_SIZE", MEMORY_SIZE, "the memory is too small"),
    ("TIME_REFUSED", TIME_REFUSED, "time step zero, negative or not a number; the last estimate is held"),
    ("TIME_GAP", TIME_GAP, "time step longer than 0.25 s; the filter restarts with what it has learnt"),
    ("GEAR_REFUSED", GEAR_REFUSED, "a gear is in no table; the last gear is taken"),
    ("READING_REFUSED", READING_REFUSED, "a reading is impossible or contradicts the others"),
    ("CHANNEL_LOST", CHANNEL_LOST, "a channel has given no usable reading for 0.25 s"),
    ("HELD", HELD, "the estimate is that of an earlier step"),
    ("LEARNT_REFUSED", LEARNT_REFUSED, "what was learnt is of another version or gearbox, or damaged"),
];
