//! A car's observer for a transmission controller, as files: parameters as C and as an image, header, description for calibration tools,
//! example, self-test, certificate.
//!
//! The code is `libwetclutch.a` (`embedded/library`) or `wetclutch.c` (`embedded/portable`), the same for all cars; what is written here is
//! of one car. Nothing here writes to the disk: a caller gets names and bytes.

mod a2l;
mod c_text;
mod certificate;
mod elf;
mod error;
mod estimate_members;
mod exported_file;
mod exported_filter;
mod fmu;
mod header;
mod input_members;
mod parameters;
mod portable;
mod readme;
mod self_test;
mod shift_inputs;
mod units;

use config::CarFile;

pub use a2l::{Addresses, a2l};
pub use elf::addresses;
pub use error::ExportError;
pub use exported_file::ExportedFile;
pub use exported_filter::{ExportOptions, ExportedFilter};
pub use parameters::{Entry, Image, Values};
pub use portable::CSource;
pub use shift_inputs::shift_inputs;

/// The files of a car's observer.
///
/// # Errors
/// As [`ExportedFilter::new`]; or a number of the car has no place in single precision, or the shift of the self-test cannot be simulated.
pub fn export(file: &CarFile, options: &ExportOptions) -> Result<Vec<ExportedFile>, ExportError> {
    let filter = ExportedFilter::new(file, options)?;
    let image = Image::of(&filter)?;
    let c_source = options.c_source.as_ref();
    let addresses = match &options.program {
        Some(program) => addresses(program, &filter, &image)?,
        None => Addresses::default(),
    };
    let test = self_test::SelfTest::of(&filter, &image, options.sensors.as_ref())?;
    let name = &filter.name;
    let texts = [
        ("wetclutch.h".to_owned(), header::library()),
        (format!("wetclutch_{name}.h"), header::of_car(&filter, &image, c_source)),
        (format!("wetclutch_{name}_parameters.c"), image.c_source(&filter)),
        (format!("wetclutch_{name}_selftest.c"), test.c_source(&filter)),
        (format!("wetclutch_{name}.a2l"), a2l(&filter, &image, &addresses)),
        ("example.c".to_owned(), readme::example(name)),
        (format!("wetclutch_{name}_sfunction.c"), readme::sfunction(&filter)),
        ("certificate.md".to_owned(), certificate::certificate(&filter)),
        ("report.md".to_owned(), readme::report(&filter, &image, &test, c_source)),
        ("README.md".to_owned(), readme::readme(&filter)),
    ];
    let mut files: Vec<_> = texts.into_iter().map(|(name, text)| ExportedFile::text(name, text)).collect();
    files.push(ExportedFile { name: format!("wetclutch_{name}_parameters.bin"), bytes: image.bytes() });
    if let Some(source) = c_source {
        files.push(ExportedFile::text("wetclutch.c".to_owned(), source.text.clone()));
        files.push(ExportedFile::text("CMakeLists.txt".to_owned(), readme::cmake(name)));
    }
    if !options.fmu_libraries.is_empty() {
        files.extend(fmu::models(&fmu::of_observer(&filter, &image), &options.fmu_libraries)?);
    }
    if !options.car_fmu_libraries.is_empty() {
        files.extend(fmu::models(&fmu::of_car(&filter, file), &options.car_fmu_libraries)?);
    }
    Ok(files)
}
