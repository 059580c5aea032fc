/// Why a module has no C.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum Error {
    /// It cannot be read.
    #[error("this is not a WebAssembly module: {0}")]
    NotAModule(String),
    /// It needs what a controller does not have.
    #[error("the module imports \"{0}\"; it must be complete: build it without a path to a panic")]
    Import(String),
    /// A function that calls itself has no largest stack.
    #[error("{0} calls itself")]
    Recursion(String),
    /// The stack of a function is not known.
    #[error("{0} uses the stack pointer in a way by which the size of its stack is not known")]
    StackPointer(String),
    /// An instruction that is not translated.
    #[error("{function}: {instruction} is not translated")]
    Instruction {
        /// Name of the function.
        function: String,
        /// The instruction.
        instruction: String,
    },
    /// A part of a module that is not translated.
    #[error("the module has {0}, which is not translated")]
    Part(&'static str),
    /// The calls may need more than the linker has left for them.
    #[error("the calls need a stack of {needed} bytes, the module was linked with {linked}")]
    Stack {
        /// By the calls, bytes.
        needed: u32,
        /// By the linker, bytes.
        linked: u32,
    },
}

impl From<wasmparser::BinaryReaderError> for Error {
    fn from(error: wasmparser::BinaryReaderError) -> Self {
        Self::NotAModule(error.to_string())
    }
}
