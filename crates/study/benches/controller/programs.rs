//! The programs for the controller: built, and looked into.

use std::path::{Path, PathBuf};
use std::process::Command;

use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

use crate::counts::Counts;
use crate::{BYTES, root, said};

const TARGET: &str = "thumbv7em-none-eabihf";
/// The programs of a step that are looked into, with what they are called in the table.
const STEPS: [(&str, &str); 4] = [
    ("kalman", "kalman"),
    ("kalman_with_range", "kalman with range"),
    ("rigid", "rigid"),
    ("rigid_with_range", "rigid with range"),
];

/// Builds a package for the controller. Returns where its programs are.
pub(crate) fn build(manifest: &str) -> Result<PathBuf, String> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let target = root().join("target");
    said(
        Command::new(cargo)
            .args(["build", "--release", "--locked", "--target", TARGET])
            .arg("--manifest-path")
            .arg(root().join(manifest))
            .arg("--target-dir")
            .arg(&target),
    )?;
    Ok(target.join(TARGET).join("release"))
}

/// Builds the programs of a step, prints their size, and looks for routines for double precision in all of them.
pub(crate) fn check(counts: &mut Counts) -> Result<bool, String> {
    let folder = build("embedded/Cargo.toml")?;
    let mut sound = true;
    println!("   bytes          code and constants of `start` and `step`, against the file");
    for (program, name) in STEPS {
        let (bytes, doubles) = look_into(&folder.join(program))?;
        let change = counts.take(BYTES, &format!("{name}: code and constants"), bytes);
        println!("{bytes:>8} {change:>8}  {name}");
        if !doubles.is_empty() {
            println!("routines for double precision in \"{program}\": {}", doubles.join(", "));
            sound = false;
        }
    }
    Ok(sound)
}

/// Bytes of code and constants, and routines for double precision.
fn look_into(program: &Path) -> Result<(u64, Vec<String>), String> {
    let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}", program.display());
    let bytes = std::fs::read(program).map_err(|error| wrong(&error))?;
    let file = object::File::parse(&*bytes).map_err(|error| wrong(&error))?;
    let kept = |kind| matches!(kind, SectionKind::Text | SectionKind::ReadOnlyData);
    let size = file.sections().filter(|section| kept(section.kind())).map(|section| section.size()).sum();
    let names: Vec<&str> = file.symbols().filter_map(|symbol| symbol.name().ok()).collect();
    // Without names nothing would be found.
    if !names.contains(&"_start") {
        return Err(wrong(&"has no table of symbols"));
    }
    let doubles = names.into_iter().filter(|name| is_double(name)).map(str::to_owned).collect();
    Ok((size, doubles))
}

/// Whether a symbol is a routine for double precision: those of the ARM run-time ABI have a `d` for it, those of the compiler's
/// library `df`; of the mathematical library only the names with an `f` at the end are single.
fn is_double(symbol: &str) -> bool {
    let of_abi = symbol.strip_prefix("__aeabi_").is_some_and(|name| name.starts_with('d') || name.ends_with("2d"));
    let of_compiler = symbol.strip_prefix("__").is_some_and(|name| name.contains("df"));
    of_abi || of_compiler
}
