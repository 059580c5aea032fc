//! `c99`: writes the C of a WebAssembly module.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a program")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use c99::{Documentation, stack, translate};

const USAGE: &str = "usage: c99 --stack MODULE                                 prints the stack that each exported function needs, and the one to link with, bytes
       c99 MODULE BEFORE.c AFTER.c CRATES -o OUT.c           writes the C of a module between two files, with the documentation of the
                                                             crates of a folder";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments.as_slice() {
        ["--stack", module] => read(module).and_then(|module| {
            let stack = stack(&module).map_err(|error| error.to_string())?;
            stack.exported.iter().for_each(|(name, bytes)| println!("{name} {bytes}"));
            println!("{}", stack.linked);
            Ok(())
        }),
        [module, before, after, crates, "-o", out] => {
            write(module, before, after, Path::new(crates), &PathBuf::from(out))
        }
        _ => Err(USAGE.to_owned()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("c99: {message}");
            ExitCode::FAILURE
        }
    }
}

fn read(path: &str) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|error| format!("{path}: {error}"))
}

fn read_text(path: &str) -> Result<String, String> {
    String::from_utf8(read(path)?).map_err(|_| format!("{path}: not text"))
}

fn write(module: &str, before: &str, after: &str, crates: &Path, out: &Path) -> Result<(), String> {
    let documentation = Documentation::of_crates(crates).map_err(|error| format!("{}: {error}", crates.display()))?;
    let text = translate(&read(module)?, &read_text(before)?, &read_text(after)?, &documentation)
        .map_err(|error| format!("{module}: {error}"))?;
    std::fs::write(out, text).map_err(|error| format!("{}: {error}", out.display()))
}
