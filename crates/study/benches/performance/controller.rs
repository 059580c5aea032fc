//! Steps on a controller, as `cargo bench -p study --bench controller` counted them.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Deserialize;

use crate::shared::root;

/// What that benchmark keeps.
#[derive(Deserialize)]
struct Counts {
    toolchain: String,
    /// Instructions of a step, by observer and part.
    #[serde(default)]
    instructions: BTreeMap<String, u64>,
    /// Bytes of code, parameters and state.
    #[serde(default)]
    bytes: BTreeMap<String, u64>,
}

/// The table of the counts, where there are some.
pub(crate) fn counts(page: &mut String) {
    let Ok(text) = std::fs::read_to_string(root().join("crates/study/benches/controller.toml")) else { return };
    let counts: Counts = toml::from_str(&text).unwrap();
    let _ = write!(
        page,
        "\n## On a controller\n\nCortex-M4F, single precision, counted in QEMU by `cargo bench -p study --bench controller` ({}).\n",
        counts.toolchain
    );
    for (title, values) in [("mean instructions of a step", counts.instructions), ("bytes", counts.bytes)] {
        if !values.is_empty() {
            let _ = write!(page, "\n| what | {title} |\n|---|---|\n");
            for (name, value) in values {
                let _ = writeln!(page, "| {name} | {value} |");
            }
        }
    }
}
