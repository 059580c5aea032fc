//! Coverage-guided fuzzing of the targets of the crate `fuzz`, with cargo-fuzz and libFuzzer.
//!
//! Needs a C++ compiler and `cargo install cargo-fuzz`; a stable toolchain is enough without a sanitizer. From the
//! project's folder, ten minutes of the reader of MDF files, in at most 1 GB of memory and 10 s for an input:
//!
//! ```text
//! mkdir -p fuzz/corpus/mdf
//! cargo fuzz run mdf --sanitizer none fuzz/corpus/mdf crates/fuzz/corpus/mdf crates/logs/tests/data -- \
//!     -max_total_time=600 -rss_limit_mb=1024 -timeout=10 -max_len=16384
//! ```
//!
//! An input that is a finding goes to `crates/fuzz/corpus`, where the tests try it.

use std::panic;
use std::process;
use std::sync::{LazyLock, Mutex, PoisonError};

use fuzz::{Depth, Fuzzer, Target};

/// Lets panics unwind: a reader may catch a panic of a library that it uses, and give an error. libFuzzer's own hook
/// would end the process at once.
pub fn start() {
    panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
}

/// Gives an input to a target, and ends the process if a panic comes out of it.
pub fn run(target: Target, input: &[u8]) {
    static FUZZER: LazyLock<Mutex<Fuzzer>> =
        LazyLock::new(|| Mutex::new(Fuzzer::new(Depth::Short).expect("the project's own files can be read")));
    if !FUZZER.lock().unwrap_or_else(PoisonError::into_inner).survives(target, input) {
        process::abort();
    }
}

/// The program of a target: `program!(Target)`.
#[macro_export]
macro_rules! program {
    ($target:ident) => {
        ::libfuzzer_sys::fuzz_target!(init: $crate::start(), |input: &[u8]| {
            $crate::run(::fuzz::Target::$target, input);
        });
    };
}
