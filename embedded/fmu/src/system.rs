//! What is needed of the system: memory, a file, and the end of a program that has an error in itself.

use alloc::vec::Vec;
use core::alloc::{GlobalAlloc, Layout};
use core::ffi::{CStr, c_char, c_int, c_void};
use core::panic::PanicInfo;

#[link(name = "c")]
unsafe extern "C" {
    fn malloc(bytes: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
    fn abort() -> !;
    fn fopen(path: *const c_char, mode: *const c_char) -> *mut c_void;
    fn fread(into: *mut c_void, size: usize, count: usize, file: *mut c_void) -> usize;
    fn fclose(file: *mut c_void) -> c_int;
}

struct System;

#[global_allocator]
static SYSTEM: System = System;

// SAFETY: memory of `malloc` is aligned to 16 bytes; larger alignments are refused.
unsafe impl GlobalAlloc for System {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: any size may be asked for.
        if layout.align() <= 16 { unsafe { malloc(layout.size()).cast() } } else { core::ptr::null_mut() }
    }

    unsafe fn dealloc(&self, memory: *mut u8, _: Layout) {
        // SAFETY: the memory is of `malloc`.
        unsafe { free(memory.cast()) }
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: it may be called at any time.
    unsafe { abort() }
}

/// Nothing is unwound; tables of the compiler's library name this function.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

/// Longest image that is read, bytes.
const LONGEST: usize = 1 << 22;

/// The words of a file, the lowest byte of each first; `None` if it cannot be read.
pub(crate) fn read_words(path: &CStr) -> Option<Vec<u32>> {
    let mut bytes: Vec<u8> = Vec::new();
    // SAFETY: path and mode are strings of C, and each block is as large as it is said to be.
    unsafe {
        let file = fopen(path.as_ptr(), c"rb".as_ptr());
        if file.is_null() {
            return None;
        }
        let mut block = [0_u8; 4096];
        loop {
            let count = fread(block.as_mut_ptr().cast(), 1, block.len(), file);
            bytes.extend_from_slice(block.get(..count).unwrap_or_default());
            if count == 0 || bytes.len() > LONGEST {
                break;
            }
        }
        fclose(file);
    }
    let (words, rest) = bytes.as_chunks();
    rest.is_empty().then(|| words.iter().map(|word| u32::from_le_bytes(*word)).collect())
}
