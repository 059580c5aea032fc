//! The headers: that of the library, and that of a car.

use std::fmt::Write as _;

use ecu::{LEARNT_WORDS, status};
use observer::Health;

use crate::c_text::{comment, distinct_upper, upper};
use crate::{CSource, ExportedFilter, Image};

/// `wetclutch.h`, the same for every car.
pub(crate) fn library() -> String {
    let mut words = "/* Bits of a status; 0 means that everything is right. */\n".to_owned();
    for (name, bit, meaning) in status::ALL {
        let _ = writeln!(words, "#define WETCLUTCH_STATUS_{name} 0x{bit:x}u /* {meaning} */");
    }
    let mut health = "/* Health of an estimate, from best to worst. */\n".to_owned();
    for of in Health::ALL {
        let _ = writeln!(health, "#define WETCLUTCH_HEALTH_{} {}u", of.name().to_uppercase(), of as u32);
    }
    include_str!("wetclutch.h")
        .replace("@STATUS@", &words)
        .replace("@HEALTH@", &health)
        .replace("@LEARNT@", &LEARNT_WORDS.to_string())
}

/// The memory of the observer, bytes, and what it is.
pub(crate) fn memory(image: &Image, c_source: Option<&CSource>) -> (usize, String) {
    match c_source {
        Some(source) => (
            source.memory_bytes(image),
            format!("enough for wetclutch.c, with its stack of {}, and for the library.", source.stack),
        ),
        None => (
            image.memory_bytes,
            "of a machine of 64 bits. One of 32 bits needs less: wetclutch_memory_size. For wetclutch.c export with --c.".to_owned(),
        ),
    }
}

/// The header of a car.
pub(crate) fn of_car(filter: &ExportedFilter, image: &Image, c_source: Option<&CSource>) -> String {
    let (name, macros) = (&filter.name, upper(&filter.name));
    let mut places = String::new();
    let elements = filter.elements();
    let element_macros = distinct_upper(elements.iter().map(AsRef::as_ref));
    for (at, (element, of)) in elements.iter().zip(element_macros).enumerate() {
        let _ = writeln!(places, "#define WETCLUTCH_{macros}_ELEMENT_{of} {at} /* {} */", comment(element));
    }
    let gears = &filter.car.gearbox.gears;
    for (at, (gear, of)) in gears.iter().zip(distinct_upper(gears.iter().map(|gear| gear.name.as_str()))).enumerate() {
        let (name, ratio) = (comment(&gear.name), gear.ratio);
        let _ = writeln!(places, "#define WETCLUTCH_{macros}_GEAR_{of} {at} /* {name}, ratio {ratio:.3} */");
    }
    let shifts: Vec<String> = filter.shifts().map(|shift| filter.shift_name(shift)).collect();
    let (bytes, of) = memory(image, c_source);
    let mut text = String::new();
    let _ = write!(
        text,
        "/* The observer of \"{}\", shifts {}.\n   Written by wetclutch {} from a vehicle file with the SHA-256\n   {}. */\n\
         #ifndef WETCLUTCH_{macros}_H\n#define WETCLUTCH_{macros}_H\n\n#include \"wetclutch.h\"\n\n\
         #ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         /* Places of the elements in wetclutch_input.commands and wetclutch_estimate.element_pa, and of the gears. */\n{places}\n\
         /* Memory of the observer, bytes: {of} */\n\
         #define WETCLUTCH_{macros}_MEMORY_BYTES {bytes}u\n\n\
         /* The parameters, all of them words of 32 bits: float, or uint32_t. The unit is in the comment. */\n\
         typedef struct {{\n{}}} wetclutch_{name}_parameters_t;\n\n\
         extern const wetclutch_{name}_parameters_t wetclutch_{name}_parameters;\n\n\
         /* The image, as wetclutch_init takes it. */\n\
         #define WETCLUTCH_{macros}_IMAGE ((const uint32_t *)(const void *)&wetclutch_{name}_parameters)\n\
         #define WETCLUTCH_{macros}_IMAGE_BYTES {}u\n\n\
         /* The estimate that wetclutch_{name}.a2l describes, where a program defines it. */\n\
         extern wetclutch_estimate wetclutch_{name}_estimate;\n\n\
         /* Runs the observer over a simulated shift in this memory. Returns 0 if every estimate has the right bits; else the step, from 1 on, with\n   \
         a wrong one, -1 if the image is refused, -2 if a value that is not compared one by one is wrong. */\n\
         int32_t wetclutch_{name}_selftest(uint64_t *memory, uint32_t memory_bytes);\n\n\
         #ifdef __cplusplus\n}}\n#endif\n#endif\n",
        comment(&filter.car.name),
        comment(&shifts.join(", ")),
        env!("CARGO_PKG_VERSION"),
        filter.vehicle_sha256,
        image.members(filter),
        4 * image.words.len(),
    );
    text
}
