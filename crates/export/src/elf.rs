//! The parameters of a car in a linked program.

use object::{Endianness, Object as _, ObjectSection as _, ObjectSymbol as _, SectionKind};

use crate::a2l::Addresses;
use crate::{ExportError, ExportedFilter, Image};

/// Finds parameters and estimate of a car in a program for a controller, and compares the parameters with the image of the car.
///
/// # Errors
/// The file is no program, the parameters are not in it, or they are others.
pub fn addresses(program: &[u8], filter: &ExportedFilter, image: &Image) -> Result<Addresses, ExportError> {
    let file = object::File::parse(program).map_err(|error| ExportError::Program(error.to_string()))?;
    let is_big_endian = file.endianness() == Endianness::Big;
    let expected: Vec<u8> = (image.words.iter())
        .flat_map(|word| if is_big_endian { word.to_be_bytes() } else { word.to_le_bytes() })
        .collect();
    let address_of = |name: &str| {
        let found = file.symbols().find(|symbol| symbol.is_definition() && symbol.name() == Ok(name));
        found.map(|symbol| symbol.address())
    };
    let estimate = address_of(&format!("wetclutch_{}_estimate", filter.name)).unwrap_or(0);
    let name = format!("wetclutch_{}_parameters", filter.name);
    let Some(parameters) = address_of(&name) else {
        // Without names the content is sought.
        let parameters = found_at(&file, &expected).ok_or(ExportError::NotInProgram(name))?;
        return Ok(Addresses { parameters, estimate, is_big_endian });
    };
    let size = expected.len() as u64;
    let found = file.sections().find_map(|section| section.data_range(parameters, size).ok().flatten());
    match found {
        Some(bytes) if bytes == expected => Ok(Addresses { parameters, estimate, is_big_endian }),
        Some(bytes) => Err(ExportError::OtherParameters(name, first_difference(image, bytes, &expected))),
        None => Err(ExportError::NotInProgram(name)),
    }
}

/// Where these bytes are in a program.
fn found_at(file: &object::File<'_>, bytes: &[u8]) -> Option<u64> {
    let kept = |kind| matches!(kind, SectionKind::ReadOnlyData | SectionKind::Data | SectionKind::Text);
    file.sections().filter(|section| kept(section.kind())).find_map(|section| {
        let data = section.data().ok()?;
        let at = data.windows(bytes.len()).step_by(4).position(|part| part == bytes)?;
        Some(section.address() + 4 * at as u64)
    })
}

/// The name of the first parameter that is another one.
fn first_difference(image: &Image, found: &[u8], expected: &[u8]) -> String {
    let at = found.iter().zip(expected).position(|(found, expected)| found != expected).unwrap_or(0);
    let entry = image.entries.iter().rev().find(|entry| entry.offset <= at);
    entry.map_or_else(String::new, crate::Entry::name)
}
