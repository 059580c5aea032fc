//! Gearbox files, on one of three levels: stick diagram, ratios and holding torques, ratios alone.

mod convert;
mod raw;

use std::path::Path;

use geartrain::{Finding, Gearbox, Part};

use crate::check::Check;
use crate::{ConfigError, Kind, Source};
pub(crate) use convert::teeth;
use convert::{Read, Spans};
use raw::{RawHead, RawRatios, RawShares, RawStickDiagram};

/// The levels of a gearbox file.
const LEVELS: &str = "the levels are \"stick-diagram\" (shafts, sets, elements), \"shares\" (ratios and holding torques) and \
                      \"ratios\" (ratios alone)";

/// The gearbox files of the program, each by its name, for the gasoline engine of `vehicles/eight_speed.toml`.
pub const SHIPPED: [(&str, &str); 16] = [
    ("8hp", include_str!("../../../../gearboxes/8hp.toml")),
    ("10_speed", include_str!("../../../../gearboxes/10_speed.toml")),
    ("dual_clutch_7", include_str!("../../../../gearboxes/dual_clutch_7.toml")),
    ("lepelletier_6", include_str!("../../../../gearboxes/lepelletier_6.toml")),
    ("ravigneaux_4", include_str!("../../../../gearboxes/ravigneaux_4.toml")),
    ("722_6", include_str!("../../../../gearboxes/722_6.toml")),
    ("8hp45", include_str!("../../../../gearboxes/8hp45.toml")),
    ("9g_tronic", include_str!("../../../../gearboxes/9g_tronic.toml")),
    ("9hp48", include_str!("../../../../gearboxes/9hp48.toml")),
    ("a340e", include_str!("../../../../gearboxes/a340e.toml")),
    ("a8lr1", include_str!("../../../../gearboxes/a8lr1.toml")),
    ("fn4a", include_str!("../../../../gearboxes/fn4a.toml")),
    ("th400", include_str!("../../../../gearboxes/th400.toml")),
    ("4l60e", include_str!("../../../../gearboxes/4l60e.toml")),
    ("c6", include_str!("../../../../gearboxes/c6.toml")),
    ("tf80sc", include_str!("../../../../gearboxes/tf80sc.toml")),
];

/// A checked gearbox file.
#[derive(Debug, Clone, PartialEq)]
pub struct GearboxFile {
    /// The text.
    pub source: Source,
    /// What it describes.
    pub gearbox: Gearbox,
    /// What is unusual, each with file, line and hint.
    pub warnings: Vec<String>,
}

impl GearboxFile {
    /// Reads and checks a gearbox file.
    ///
    /// # Errors
    /// The file cannot be read, or something in it is wrong.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::read(path)?)
    }

    /// Checks the text of a gearbox file.
    ///
    /// # Errors
    /// What is wrong, with its line and a hint.
    pub fn from_source(source: Source) -> Result<Self, ConfigError> {
        Self::checked(source).map_err(|mut errors| errors.swap_remove(0))
    }

    /// The same, with all that is wrong with a gearbox whose keys, types and numbers are right.
    ///
    /// # Errors
    /// At least one.
    pub fn checked(source: Source) -> Result<Self, Vec<ConfigError>> {
        let Read { description, spans } = read(&source).map_err(|error| vec![error])?;
        let check = Check::of(&source);
        let placed = |finding: &Finding| meaning(&check, &spans, finding);
        let gearbox =
            Gearbox::checked(&description).map_err(|findings| findings.iter().map(placed).collect::<Vec<_>>())?;
        let warnings = gearbox.warnings.iter().map(|finding| placed(finding).to_string()).collect();
        Ok(Self { source, gearbox, warnings })
    }
}

/// What a file describes, and where.
fn read(source: &Source) -> Result<Read, ConfigError> {
    let check = Check::of(source);
    let head: RawHead = source.parse()?;
    let level = head.level.as_ref().and_then(|level| level.get_ref().as_str());
    match level {
        Some("stick-diagram") => convert::stick_diagram(&check, &source.parse::<RawStickDiagram>()?),
        Some("shares") => convert::shares(&check, &source.parse::<RawShares>()?),
        Some("ratios") => convert::ratios(&check, &source.parse::<RawRatios>()?),
        _ => {
            let at = head.level.as_ref().map_or(0, |level| level.span().start);
            let message = if head.level.is_some() { "there is no such level" } else { "missing `level`" };
            let error = check.meaning("level", at, message.to_owned(), Some(LEVELS.to_owned()));
            Err(source.unless_other(Kind::Gearbox, error))
        }
    }
}

/// A finding with its place in the file.
fn meaning(check: &Check<'_>, spans: &Spans, finding: &Finding) -> ConfigError {
    let key = finding.key;
    let (list, at) = match finding.part {
        Part::Gearbox => return check.meaning(key, spans.of(key), finding.to_string(), finding.fault.hint()),
        Part::Shaft(at) => ("shaft", at),
        Part::Set(at) => ("planetary_set", at),
        Part::Pair(at) => ("gear_pair", at),
        Part::Element(at) => ("element", at),
        Part::Gear(at) => ("gear", at),
        Part::Mass(at) => ("shift_mass", at),
    };
    let (start, part) = spans.part(list, at);
    // The place of the key, or that of its part if the part has no such key.
    let offset = check.layers.source.place_of(&format!("{list}[{at}]"), key).unwrap_or(start);
    check.meaning(format!("{part}.{key}"), offset, finding.to_string(), finding.fault.hint())
}
