//! C99 of a WebAssembly module, for the C compilers of controllers that Rust has no target for.
//!
//! The module is a library for one thread: it imports nothing, calls no function by a pointer, does not recurse, does not let its memory grow
//! and has no double precision. Another module is an [`Error`]. In return the C is plain: a function for each
//! function, with its name and documentation; no allocation, no static variable; as much memory as the calls can need, known here.
//!
//! The linear memory of the module is an array that the caller gives, of words in the byte order of the machine (`prelude.h`).

mod calls;
mod documentation;
mod error;
mod expression;
mod function;
mod module;
mod names;
mod text;

pub use documentation::Documentation;
pub use error::Error;
pub use text::{Stack, stack, translate};
