//! Steps an observer over readings and prints what each step took, in instructions.
//!
//! Runs in QEMU on the board "mps2-an386" with `-icount shift=6`: every instruction then takes 64 ns of the board's time, and
//! the system timer, which counts down at 25 MHz, tells how many there were. `cargo bench -p study --bench controller` builds
//! it, makes the readings and runs it.
//!
//! Observer and readings are in memory from [`READINGS`] on, as [`postcard`] writes them: which observer it is, its
//! parameters, the number of the readings, the readings.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;
use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use observer::{Bounded, Bounds, Estimate, Estimator, Input, KalmanFilter, RangeEstimator, RangeState, RigidObserver};

/// Where QEMU has put the readings: static RAM of the board that the program does not use.
const READINGS: *const u8 = 0x2100_0000 as *const u8;
const READINGS_BYTES: usize = 8 << 20;
/// Instructions per tick of the timer: 40 ns over 64 ns.
const PER_TICK: (u32, u32) = (40, 64);
/// Passes of a loop of two instructions, by which the counting is checked.
const PASSES: u32 = 5000;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    debug::exit(debug::EXIT_FAILURE);
    loop {
        cortex_m::asm::wfi();
    }
}

#[entry]
fn main() -> ! {
    if let Some(mut timer) = cortex_m::Peripherals::take().map(|board| board.SYST) {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(0x00ff_ffff);
        timer.clear_current();
        timer.enable_counter();
    }
    // SAFETY: QEMU has put the readings there, and nothing else writes to that memory.
    let bytes = unsafe { core::slice::from_raw_parts(READINGS, READINGS_BYTES) };
    hprintln!("loop {} {}", 2 * PASSES, instructions(|| spin(PASSES)));
    let run = match postcard::take_from_bytes::<u8>(bytes) {
        Ok((0, rest)) => run_all::<KalmanFilter<f32>>(rest),
        Ok((1, rest)) => run_all::<RigidObserver<f32>>(rest),
        _ => Err(postcard::Error::DeserializeBadEnum),
    };
    match run {
        Ok(()) => debug::exit(debug::EXIT_SUCCESS),
        Err(error) => {
            hprintln!("error {:?}", error);
            debug::exit(debug::EXIT_FAILURE);
        }
    }
    loop {
        cortex_m::asm::wfi();
    }
}

/// A loop of two instructions.
fn spin(passes: u32) {
    // SAFETY: changes nothing but a register of its own.
    unsafe { core::arch::asm!("2: subs {0}, {0}, #1", "bne 2b", inout(reg) passes => _, options(nomem, nostack)) }
}

/// Instructions that a job takes, less those of the counting itself.
fn instructions(job: impl FnOnce()) -> u32 {
    ticks(job).saturating_sub(ticks(|| {})) * PER_TICK.0 / PER_TICK.1
}

fn ticks(job: impl FnOnce()) -> u32 {
    let before = SYST::get_current();
    compiler_fence(Ordering::SeqCst);
    job();
    compiler_fence(Ordering::SeqCst);
    before.wrapping_sub(SYST::get_current()) & 0x00ff_ffff
}

/// The observer alone, the ranges alone, and both; then the guaranteed ranges alone, and the observer with them.
fn run_all<O>(bytes: &[u8]) -> Result<(), postcard::Error>
where
    O: Estimator<f32> + for<'a> serde::Deserialize<'a>,
{
    let (bounded, readings) = postcard::take_from_bytes::<Bounded<f32, O>>(bytes)?;
    let Bounded { observer, range } = &bounded;
    hprintln!("bytes {} {}", size_of::<Bounded<f32, O>>(), size_of::<(O::State, RangeState<f32>)>());
    let mut state = observer.start();
    run("observer", readings, |input| step(observer, &mut state, input).pressure_pa)?;
    let mut state = range.start();
    run("range", readings, |input| step_range(range, &mut state, input).pressure_pa[1])?;
    let mut state = bounded.start();
    run("both", readings, |input| step(&bounded, &mut state, input).pressure_pa)?;
    let bounded = Bounded { range: bounded.range.guaranteed(), ..bounded };
    let mut state = bounded.range.start();
    run("guaranteed", readings, |input| step_range(&bounded.range, &mut state, input).pressure_pa[1])?;
    let mut state = bounded.start();
    run("with-guaranteed", readings, |input| step(&bounded, &mut state, input).pressure_pa)
}

/// A step, as a function of its own: what is counted includes its call.
#[inline(never)]
fn step<O: Estimator<f32>>(observer: &O, state: &mut O::State, input: &Input<f32>) -> Estimate<f32> {
    observer.step(state, input)
}

/// The same of the range.
#[inline(never)]
fn step_range(range: &RangeEstimator<f32>, state: &mut RangeState<f32>, input: &Input<f32>) -> Bounds<f32> {
    range.step(state, input)
}

/// Steps over all readings; prints what each step took and the pressure that it returned, as bits.
fn run(name: &str, readings: &[u8], mut step: impl FnMut(&Input<f32>) -> f32) -> Result<(), postcard::Error> {
    let (count, mut rest) = postcard::take_from_bytes::<u32>(readings)?;
    for _ in 0..count {
        let (input, after) = postcard::take_from_bytes::<Input<f32>>(rest)?;
        rest = after;
        let mut pressure_pa = 0.0;
        let took = instructions(|| pressure_pa = black_box(step(black_box(&input))));
        hprintln!("{} {} {}", name, took, pressure_pa.to_bits());
    }
    Ok(())
}
