//! `libwetclutch.a`: the functions of `wetclutch.h`.
//!
//! The panic handler calls a function that exists nowhere, as in the programs of `embedded`: while a panic can be reached, a program with
//! this library does not link.
#![no_std]

use core::panic::{Location, PanicInfo};

use ecu::{Estimate, Header, Input, LEARNT_WORDS, LearntWords, Observer, memory, status};

unsafe extern "Rust" {
    /// Exists nowhere.
    fn panic_path_is_linked(at: Option<&Location<'_>>) -> !;
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    // SAFETY: never reached, because a program with this call does not link.
    unsafe { panic_path_is_linked(info.location()) }
}

/// The library unwinds nothing; tables of the compiler's library name this function.
#[cfg(not(target_os = "none"))]
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

/// Whether this is a pointer to a `T` in place.
fn is_usable<T>(pointer: *const T) -> bool {
    !pointer.is_null() && pointer.is_aligned()
}

/// The words of an image.
///
/// # Safety
/// `bytes` from `image` on may be read, unless the pointer is not usable.
unsafe fn words<'a>(image: *const u32, bytes: u32) -> Result<&'a [u32], u32> {
    if !is_usable(image) {
        return Err(status::BAD_POINTER);
    }
    if !bytes.is_multiple_of(4) {
        return Err(status::IMAGE_SIZE);
    }
    // SAFETY: by the contract of the caller.
    Ok(unsafe { core::slice::from_raw_parts(image, bytes as usize / 4) })
}

/// The observer in a memory.
///
/// # Safety
/// That of [`Observer::open`], unless the pointer is not usable.
unsafe fn observer<'m>(memory: *mut u64) -> Result<Observer<'m>, u32> {
    if !is_usable(memory) {
        return Err(status::BAD_POINTER);
    }
    // SAFETY: by the contract of the caller.
    unsafe { Observer::open(memory.cast()) }.ok_or(status::NOT_INITIALISED)
}

/// Memory that the observer of an image needs, bytes; zero if the image cannot be used.
///
/// # Safety
/// As the header `wetclutch.h` says (`crates/export/src/wetclutch.h`).
#[cfg(not(target_family = "wasm"))]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wetclutch_memory_size(image: *const u32, image_bytes: u32) -> u32 {
    // SAFETY: by the contract of the caller.
    let size = unsafe { words(image, image_bytes) }.and_then(memory::size);
    size.map_or(0, |size| size as u32)
}

/// Builds the observer of an image in this memory.
///
/// # Safety
/// As the header `wetclutch.h` says (`crates/export/src/wetclutch.h`).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wetclutch_init(
    memory: *mut u64,
    memory_bytes: u32,
    image: *const u32,
    image_bytes: u32,
) -> u32 {
    if !is_usable(memory) {
        return status::BAD_POINTER;
    }
    if (memory_bytes as usize) < size_of::<u64>() {
        return status::MEMORY_SIZE;
    }
    // SAFETY: by the contract of the caller.
    unsafe {
        // Whatever is wrong, there is no observer then.
        memory.write(0);
        let built =
            words(image, image_bytes).and_then(|image| Observer::init(memory.cast(), memory_bytes as usize, image));
        built.map_or_else(|status| status, |_| 0)
    }
}

/// Takes what came since the step before and gives the estimate for now.
///
/// # Safety
/// As the header `wetclutch.h` says (`crates/export/src/wetclutch.h`).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wetclutch_step(memory: *mut u64, input: *const Input, estimate: *mut Estimate) -> u32 {
    if !is_usable(estimate) {
        return status::BAD_POINTER;
    }
    // SAFETY: by the contract of the caller.
    let stepped = unsafe {
        match observer(memory) {
            Ok(mut observer) if is_usable(input) => *observer.step(&*input),
            Ok(observer) => Estimate { status: status::BAD_POINTER | status::HELD, ..*observer.estimate() },
            Err(status) => Estimate { status, gear_from: -1, gear_to: -1, phase: -1, ..Estimate::default() },
        }
    };
    // SAFETY: by the contract of the caller.
    unsafe { estimate.write(stepped) };
    stepped.status
}

/// Begins anew with what was learnt.
///
/// # Safety
/// As the header `wetclutch.h` says (`crates/export/src/wetclutch.h`).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wetclutch_reset(memory: *mut u64) -> u32 {
    // SAFETY: by the contract of the caller.
    unsafe { observer(memory) }.map_or_else(
        |status| status,
        |mut observer| {
            observer.reset();
            0
        },
    )
}

/// Writes what was learnt.
///
/// # Safety
/// As the header `wetclutch.h` says (`crates/export/src/wetclutch.h`).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wetclutch_learnt_get(memory: *mut u64, learnt: *mut LearntWords) -> u32 {
    if !is_usable(learnt) {
        return status::BAD_POINTER;
    }
    // SAFETY: by the contract of the caller.
    let written = unsafe { observer(memory).map(|observer| observer.learnt(&mut *learnt)) };
    written.map_or_else(|status| status, |()| 0)
}

/// Begins a new drive with what was learnt in another one.
///
/// # Safety
/// As the header `wetclutch.h` says (`crates/export/src/wetclutch.h`).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wetclutch_learnt_set(memory: *mut u64, learnt: *const LearntWords) -> u32 {
    if !is_usable(learnt) {
        return status::BAD_POINTER;
    }
    // SAFETY: by the contract of the caller.
    let taken = unsafe { observer(memory).and_then(|mut observer| observer.start_with(&*learnt)) };
    taken.map_or_else(|status| status, |()| 0)
}

/// Writes size and checksum into an image in RAM whose values were tuned.
///
/// # Safety
/// As the header `wetclutch.h` says (`crates/export/src/wetclutch.h`).
#[cfg(not(target_family = "wasm"))]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wetclutch_seal(image: *mut u32, image_bytes: u32) -> u32 {
    if !is_usable(image) {
        return status::BAD_POINTER;
    }
    // SAFETY: by the contract of the caller.
    let image = unsafe { core::slice::from_raw_parts_mut(image, image_bytes as usize / 4) };
    if image_bytes.is_multiple_of(4) && ecu::image::seal(image) { 0 } else { status::IMAGE_SIZE }
}

/// The status of the header of an image in the upper word; if it is zero, the memory of its observer in bytes in the lower one.
///
/// `wetclutch.c` has no memory for the observer yet where it asks for its size.
#[cfg(target_family = "wasm")]
#[unsafe(no_mangle)]
pub extern "C" fn wetclutch_check(
    magic: u32,
    format_version: u32,
    size_bytes: u32,
    is_checksum: u32,
    elements: u32,
    gears: u32,
    shifts: u32,
    image_bytes: u32,
) -> u64 {
    let header =
        Header { magic, format_version, size_bytes, checksum: 0, elements, gears, shifts, vehicle_sha256: [0; 8] };
    match header.check(image_bytes as usize, |_| is_checksum != 0) {
        Ok(()) => memory::size_by(&header) as u64,
        Err(status) => u64::from(status) << 32,
    }
}

const _: () = assert!(size_of::<Header>() == 15 * 4 && LEARNT_WORDS * 4 == size_of::<LearntWords>());
