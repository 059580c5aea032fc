//! The whole file.

use std::fmt::Write as _;

use crate::calls::Calls;
use crate::documentation::Documentation;
use crate::error::Error;
use crate::function::{Known, function};
use crate::module::Module;
use crate::names::{Names, RustPath};

/// Memory and arithmetic of WebAssembly in C.
const PRELUDE: &str = include_str!("prelude.h");
/// Words of constants in a line.
const WORDS: usize = 8;
/// Below the stack, bytes: the file around the functions may keep something there.
const RESERVED: u32 = 16;

/// Stack that the calls of a module can need at most.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stack {
    /// What the module has to be linked with, bytes.
    pub linked: u32,
    /// The functions that are called from outside, and what each needs, bytes.
    pub exported: Vec<(String, u32)>,
}

/// Most stack that a call from outside can need, bytes.
///
/// # Errors
/// [`Error`]: the module cannot be translated.
pub fn stack(module: &[u8]) -> Result<Stack, Error> {
    let module = Module::read(module)?;
    let calls = Calls::of(&module)?;
    let of = |(function, needs): (&crate::module::Function<'_>, &crate::calls::Needs)| {
        function.export.clone().map(|name| (name, needs.stack_bytes))
    };
    Ok(Stack { linked: needed(&calls), exported: module.functions.iter().zip(&calls.needs).filter_map(of).collect() })
}

fn needed(calls: &Calls) -> u32 {
    let most = calls.needs.iter().map(|needs| needs.stack_bytes).max().unwrap_or_default();
    (most + RESERVED).next_multiple_of(16)
}

/// The C of a module: `before`, its functions, `after`. The functions that it exports have `inner_` before their names.
///
/// `after` finds the macros `STACK_BYTES` (where the stack begins), `HEAP` (the first free address) and `MODULE_HASH`, and `begin_memory(m)`, which writes
/// the constants.
///
/// # Errors
/// [`Error`]: the module cannot be translated.
pub fn translate(bytes: &[u8], before: &str, after: &str, documentation: &Documentation) -> Result<String, Error> {
    let module = Module::read(bytes)?;
    let calls = Calls::of(&module)?;
    let needed = needed(&calls);
    if needed > module.stack {
        return Err(Error::Stack { needed, linked: module.stack });
    }
    let paths: Vec<RustPath> = module.functions.iter().map(|function| RustPath::of(&function.symbol)).collect();
    let mut taken = Names::default();
    [before, PRELUDE, after].into_iter().for_each(|text| taken.reserve(text));
    let names: Vec<String> = module
        .functions
        .iter()
        .zip(&paths)
        .map(|(function, path)| {
            taken.take(&function.export.as_ref().map_or_else(|| path.c_name(), |name| format!("inner_{name}")))
        })
        .collect();
    let known = Known { module: &module, names: &names, needs: &calls.needs };
    // What nobody calls, such as the handler of panics, is left out.
    let reached = reached(&module);

    let mut text = format!("{before}\n{PRELUDE}\n");
    let _ = writeln!(text, "/* Where the stack begins, and the first address behind stack and constants. */");
    let _ = writeln!(text, "#define STACK_BYTES {}u\n#define HEAP {}u\n", module.stack, module.heap);
    let _ = writeln!(text, "/* Of the module. */\n#define MODULE_HASH {:#010x}u\n", hash(bytes));
    constants(&module, &mut text);
    for index in calls.order.iter().copied().filter(|index| reached[*index]) {
        let path = &paths[index];
        let entry = documentation.of(path);
        let place = entry.map_or_else(String::new, |entry| format!(" ({})", entry.place));
        let _ = write!(text, "\n/* {path}{place}");
        for line in entry.map_or(&[][..], |entry| &entry.lines) {
            // A comment of C does not end in the middle of one.
            let _ = write!(text, "\n * {}", line.replace("*/", "* /"));
        }
        let function = function(index, &known)?;
        if path.is_square_root() {
            let signature = function.lines().next().unwrap_or_default();
            let unused = if signature.contains("*m") { "  (void)m;\n" } else { "" };
            let _ = writeln!(
                text,
                " */\n#if defined(SQUARE_ROOT)\n{signature}\n{{\n{unused}  return square_root(f0);\n}}\n#else\n{function}#endif"
            );
        } else {
            let _ = writeln!(text, " */\n{function}");
        }
    }
    text.push_str(after);
    Ok(text)
}

/// FNV-1a of some bytes.
fn hash(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

/// Which functions are called from outside, at any depth.
fn reached(module: &Module<'_>) -> Vec<bool> {
    let mut reached = vec![false; module.functions.len()];
    let exported = |function: &crate::module::Function<'_>| {
        function.export.as_ref().is_some_and(|name| !name.starts_with("rust_"))
    };
    let mut open: Vec<usize> =
        module.functions.iter().enumerate().filter(|(_, function)| exported(function)).map(|(at, _)| at).collect();
    while let Some(index) = open.pop() {
        if std::mem::replace(&mut reached[index], true) {
            continue;
        }
        for operator in &module.functions[index].body {
            if let wasmparser::Operator::Call { function_index } = operator {
                open.push(*function_index as usize);
            }
        }
    }
    reached
}

/// The constants, as words.
fn constants(module: &Module<'_>, text: &mut String) {
    let mut begin = String::new();
    for (at, (address, bytes)) in module.data.iter().enumerate() {
        // Words begin where the address is a multiple of four.
        let before = (*address % 4) as usize;
        let mut padded = vec![0_u8; before];
        padded.extend_from_slice(bytes);
        padded.resize(padded.len().next_multiple_of(4), 0);
        let words: Vec<String> = padded
            .chunks_exact(4)
            .map(|bytes| bytes.iter().rev().fold(0_u32, |word, byte| word << 8 | u32::from(*byte)))
            .map(|word| format!("{word:#010x}u"))
            .collect();
        let _ = writeln!(text, "static const uint32_t constants_{at}[{}] = {{", words.len());
        for line in words.chunks(WORDS) {
            let _ = writeln!(text, "  {},", line.join(", "));
        }
        let _ = writeln!(text, "}};\n");
        let _ = writeln!(
            begin,
            "  for (i = 0u; i < {}u; i++) {{\n    set_u32(m, {}u + 4u * i, 0u, constants_{at}[i]);\n  }}",
            words.len(),
            *address as usize - before
        );
    }
    let variable = if begin.is_empty() { "  (void)m;\n" } else { "  uint32_t i;\n" };
    let _ = writeln!(
        text,
        "/* Writes the constants into the memory. */\nstatic void begin_memory(uint8_t *m)\n{{\n{variable}{begin}}}"
    );
}
