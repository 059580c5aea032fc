//! The filter for every shift.
#![no_std]
#![no_main]

use embedded::observer::{GearboxFilter, GearboxState, ShiftEstimate, ShiftInput};

/// What the linker keeps is what this name reaches.
#[unsafe(no_mangle)]
extern "C" fn _start(
    filter: &GearboxFilter<'_, f32>,
    state: &mut GearboxState<f32>,
    input: &ShiftInput<f32>,
    estimate: &mut ShiftEstimate<f32>,
    restart: bool,
) {
    if restart {
        *state = filter.start();
    }
    *estimate = filter.step(state, input);
}
