//! Each program of this package is the `step` of one observer in single precision, linked for a microcontroller.
//!
//! - **No allocator:** the package is `no_std` and has no global allocator, so whatever needs one does not build.
//! - **No panic:** the panic handler calls a function that exists nowhere. The linker drops what nothing calls. While
//!   a panic can be reached from `step`, the handler stays, and the program does not link.
//!
//! - **No double precision:** `cargo bench -p study --bench controller` looks for its routines in the programs. It also runs the
//!   observers in QEMU (package `count`) and counts their instructions.
//!
//! These programs are never run. The proof rests on the optimiser: it must see that an index is within its bounds, so
//! they are built with full optimisation over all crates. `panicking` is the control: an observer with a panic, which
//! must not link.
//!
//! To see in which file a panic is: build with `RUSTFLAGS="-C link-arg=--defsym=panic_path_is_linked=0"` and look for
//! `.rs` in the program; the numbers of line and column are beside the name.
#![no_std]

pub use observer;

use core::panic::{Location, PanicInfo};

unsafe extern "Rust" {
    /// Exists nowhere: a program that needs it does not link. The place is passed so that it stays in the program.
    fn panic_path_is_linked(at: Option<&Location<'_>>) -> !;
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    // SAFETY: never reached, because a program with this call does not link.
    unsafe { panic_path_is_linked(info.location()) }
}

/// A program whose only function is `start` and `step` of this observer, with tuning, memory, input and output
/// behind pointers, so that the optimiser knows none of their values.
#[macro_export]
macro_rules! controller {
    ($observer:ty) => {
        type State = <$observer as $crate::observer::Estimator<f32>>::State;

        /// What the linker keeps is what this name reaches.
        #[unsafe(no_mangle)]
        extern "C" fn _start(
            observer: &$observer,
            state: &mut State,
            input: &$crate::observer::Input<f32>,
            estimate: &mut $crate::observer::Estimate<f32>,
            restart: bool,
        ) {
            use $crate::observer::Estimator;
            if restart {
                *state = observer.start();
            }
            *estimate = observer.step(state, input);
        }
    };
}
