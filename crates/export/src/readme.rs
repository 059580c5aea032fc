//! What stands beside the code: how to build it, how large it is, an example.

use crate::c_text::upper;
use crate::header::memory;
use crate::self_test::SelfTest;
use crate::{CSource, ExportedFilter, Image};

/// `example.c`.
pub(crate) fn example(name: &str) -> String {
    include_str!("example.c").replace("@CAR@", name).replace("@CAR_UPPER@", &upper(name))
}

/// The S-function of Simulink.
pub(crate) fn sfunction(filter: &ExportedFilter) -> String {
    let (name, elements) = (&filter.name, filter.filter().tables.elements.len());
    let text = include_str!("sfunction.c").replace("@CAR@", name).replace("@CAR_UPPER@", &upper(name));
    text.replace("@ELEMENTS@", &elements.to_string())
}

/// `CMakeLists.txt`, of the files with `wetclutch.c`.
pub(crate) fn cmake(name: &str) -> String {
    include_str!("cmake.txt").replace("@CAR@", name)
}

/// `README.md`.
pub(crate) fn readme(filter: &ExportedFilter) -> String {
    include_str!("readme.md").replace("@CAR@", &filter.name).replace("@NAME@", &filter.car.name)
}

/// `report.md`: sizes, and what is compared.
pub(crate) fn report(filter: &ExportedFilter, image: &Image, test: &SelfTest, c_source: Option<&CSource>) -> String {
    let name = &filter.name;
    let (memory, of_memory) = memory(image, c_source);
    let tables = filter.filter().tables;
    format!(
        "# Sizes and tests of the observer of \"{car}\"\n\n\
         | what | | of what it is |\n|---|---|---|\n\
         | parameters in flash | {image_bytes} bytes | `sizeof(wetclutch_{name}_parameters_t)`: {elements} elements, {gears} gears, {shifts} shifts |\n\
         | memory of the observer | {memory} bytes | {of_memory} |\n\
         | what is learnt, to be kept | {learnt} bytes | `sizeof(wetclutch_learnt)` |\n\
         | input and estimate | {input} and {estimate} bytes | `sizeof(wetclutch_input)`, `sizeof(wetclutch_estimate)` |\n\
         | self-test | {steps} steps of a simulated shift {shift} | every word of every estimate, by a checksum |\n\n\
         Code, and memory on the controller, with its own tools:\n\n\
         ```sh\narm-none-eabi-size firmware.elf      # with and without the observer\narm-none-eabi-nm -S --size-sort firmware.elf | grep -i wetclutch\n```\n",
        car = filter.car.name,
        image_bytes = 4 * image.words.len(),
        elements = tables.elements.len(),
        gears = tables.gears.len(),
        shifts = tables.shifts.len(),
        learnt = 4 * ecu::LEARNT_WORDS,
        input = size_of::<ecu::Input>(),
        estimate = size_of::<ecu::Estimate>(),
        steps = test.steps(),
        shift = filter.shift_name(test.shift),
    )
}
