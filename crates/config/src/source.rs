//! The text of a configuration file.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};
use trace::text_file::{LARGEST_LIST, LARGEST_TEXT, read_text_of};

use crate::ConfigError;
use crate::entries::entries_of;
use crate::near::is_near;
use crate::tree::Tree;

/// What a configuration file describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A vehicle.
    Vehicle,
    /// A vehicle with a gearbox file of its own.
    Car,
    /// A simulated drive with one shift.
    Experiment,
    /// A simulated drive with all its shifts.
    Drive,
    /// Drives with varied parameters.
    Study,
    /// Cars with a gearbox, drawn at random.
    CarStudy,
    /// Values in place of some of a vehicle file's.
    Overlay,
    /// The sensors of a car.
    Sensors,
    /// A gearbox.
    Gearbox,
    /// What the gearbox filter has learnt of a car.
    Learnt,
    /// Which channels of a log are which signals.
    ChannelMap,
}

impl Kind {
    /// A file of this kind, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Vehicle => "a vehicle file of one shift",
            Self::Car => "a vehicle file of a car with a gearbox",
            Self::Experiment => "an experiment file",
            Self::Drive => "a drive file",
            Self::Study => "a study file",
            Self::CarStudy => "a study file of a car with a gearbox",
            Self::Overlay => "a file with a part of a vehicle file, such as bounds",
            Self::Sensors => "a sensors file",
            Self::Gearbox => "a gearbox file",
            Self::Learnt => "a file of what was learnt of a car",
            Self::ChannelMap => "a channel map",
        }
    }

    /// What takes a file of this kind.
    fn taken_by(self) -> &'static str {
        match self {
            Self::Vehicle | Self::Car => {
                "a vehicle file goes after --vehicle, or is named by an experiment, drive or study file"
            }
            Self::Experiment | Self::Drive => "`wetclutch simulate` takes it",
            Self::Study | Self::CarStudy => "`wetclutch study` takes it",
            Self::Overlay => "`wetclutch design VEHICLE` takes it after --bounds",
            Self::Sensors => "`wetclutch estimate` takes it after --sensors",
            Self::Learnt => "`wetclutch estimate` takes it after --learnt",
            Self::ChannelMap => "`wetclutch estimate` and `inspect` take it after --map",
            Self::Gearbox => "a vehicle file names it as `gearbox`; `wetclutch check` describes it",
        }
    }
}

/// The tables of a vehicle file.
const VEHICLE_TABLES: [&str; 10] =
    ["engine", "converter", "gear_train", "clutch", "driveline", "tyre", "vehicle", "oil", "observer", "design"];

/// Keys by which the kinds of files are known, and `shifts` and `shaft`, which are no `shift`.
const KINDS_KEYS: [&str; 13] = [
    "gearbox",
    "gear_train",
    "shift",
    "shifts",
    "shaft",
    "segment",
    "trace",
    "factor",
    "runs",
    "vehicle",
    "gear",
    "sensors",
    "channel",
];

/// A key of a table that is none of these, and may be one of them.
pub(crate) fn misspelt<'t>(
    table: impl Iterator<Item = &'t str>,
    keys: &[&'static str],
) -> Option<(&'t str, &'static str)> {
    let mut pairs = table.flat_map(|key| keys.iter().map(move |known| (key, *known)));
    pairs.find(|(key, known)| !keys.contains(key) && is_near(key, known))
}

/// Text of a file with its name and fingerprint.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Where the text came from; for a built-in file, the name it has in the repository.
    pub path: PathBuf,
    /// The text.
    pub text: String,
}

impl Source {
    /// Reads a TOML file.
    ///
    /// # Errors
    /// The file is no regular file, is larger than [`trace::text_file::LARGEST_TEXT`], or is not text in UTF-8 or UTF-16.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::read_of(path, LARGEST_TEXT)
    }

    /// Reads a file with an entry in each line, such as a speed cycle: it may be longer than TOML.
    ///
    /// # Errors
    /// See [`Self::read`].
    pub(crate) fn read_list(path: &Path) -> Result<Self, ConfigError> {
        Self::read_of(path, LARGEST_LIST)
    }

    fn read_of(path: &Path, largest_bytes: u64) -> Result<Self, ConfigError> {
        let text = read_text_of(path, largest_bytes).map_err(|source| {
            let source = match source.kind() {
                io::ErrorKind::InvalidData => io::Error::new(
                    source.kind(),
                    "this is no text file, expected TOML\nhint: check the order of the files",
                ),
                _ => source,
            };
            ConfigError::Read { path: path.to_owned(), source }
        })?;
        Ok(Self { path: path.to_owned(), text })
    }

    /// A text that is part of the program.
    pub fn built_in(path: &str, text: &str) -> Self {
        Self { path: PathBuf::from(path), text: text.to_owned() }
    }

    /// SHA-256 of the text, as hexadecimal digits.
    pub fn sha256(&self) -> String {
        Sha256::digest(self.text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// The values of the file by their keys, such as `shift.request_s` or `factor.0.key`, as TOML; none of a text that is not TOML.
    pub fn values(&self) -> BTreeMap<String, String> {
        let mut values = BTreeMap::new();
        if let Ok(table) = self.parse::<toml::Table>() {
            values_of("", &toml::Value::Table(table), &mut values);
        }
        values
    }

    /// Line, counted from 1, of a byte offset.
    pub fn line(&self, offset: usize) -> usize {
        1 + self.text.bytes().take(offset).filter(|&byte| byte == b'\n').count()
    }

    /// What the file describes, by its tables.
    ///
    /// # Errors
    /// The text is not TOML, or neither a vehicle nor an experiment nor a study.
    pub fn kind(&self) -> Result<Kind, ConfigError> {
        let tables = self.table()?.into_inner();
        let has = |key: &str| tables.contains_key(key);
        let names = || tables.keys().map(|key| &**key.get_ref());
        let of_a_vehicle = |(key, value): (&Spanned<DeString<'_>>, &Spanned<DeValue<'_>>)| {
            value.get_ref().is_table() && VEHICLE_TABLES.contains(&&**key.get_ref())
        };
        // No other kind has these, and `shifts`, which such a file has, is no `shift`.
        if has("mean") || has("covariance") {
            return Ok(Kind::Learnt);
        }
        if let Some((key, known)) = misspelt(names(), &KINDS_KEYS) {
            return Err(self.unknown_key(key, known));
        }
        // The shifts of a study of cars are a text or a list; the [shift] of an experiment is a table.
        if has("runs") && tables.get("shift").is_some_and(|shift| !shift.get_ref().is_table()) {
            return Err(self.unknown_key("shift", "shifts"));
        }
        match (has("gear_train"), has("shift"), has("factor")) {
            (true, false, false) => Ok(Kind::Vehicle),
            (false, _, false) if has("segment") || has("trace") => Ok(Kind::Drive),
            (false, false, false) if has("runs") && has("vehicle") => Ok(Kind::CarStudy),
            (false, false, false) if tables.get("gearbox").is_some_and(|gearbox| !gearbox.get_ref().is_table()) => {
                Ok(Kind::Car)
            }
            (false, true, false) => Ok(Kind::Experiment),
            (false, false, true) => Ok(Kind::Study),
            (false, false, false) if has("gear") => Ok(Kind::Gearbox),
            (false, false, false) if has("sensors") => Ok(Kind::Sensors),
            (false, false, false) if !tables.is_empty() && tables.iter().all(of_a_vehicle) => Ok(Kind::Overlay),
            _ if has("channel") => Ok(Kind::ChannelMap),
            _ => Err(self.of_no_kind(names())),
        }
    }

    /// What is wrong with a file that is none of those that are known.
    fn of_no_kind<'t>(&self, tables: impl Iterator<Item = &'t str>) -> ConfigError {
        if let Some((key, known)) = misspelt(tables, &VEHICLE_TABLES) {
            return self.unknown_key(key, known);
        }
        let message = "expected a vehicle file (with [gear_train] or `gearbox`), experiment file (with [shift]), drive \
                       file (with [[segment]] or [trace]), study file (with [[factor]], or with `runs` for a car with a gearbox), gearbox file (with `gear`), sensors file (with [sensors]), bounds file (only \
                       with tables of a vehicle file), file of what was learnt (with `mean`) or channel map (with [channel])";
        ConfigError::Syntax { path: self.path.clone(), line: 1, message: message.to_owned() }
    }

    /// A key that is misspelt, at its line.
    pub(crate) fn unknown_key(&self, key: &str, known: &str) -> ConfigError {
        let begins = |text: &str| {
            let text = text.trim_start().trim_start_matches('[').trim_start().trim_start_matches(['"', '\'']);
            text.starts_with(key)
        };
        let line = 1 + self.text.lines().position(begins).unwrap_or(0);
        let message = format!("unknown key `{}`\nhint: did you mean `{known}`?", trace::printable(key));
        ConfigError::Syntax { path: self.path.clone(), line, message }
    }

    /// Where the value of a key in a table begins; the tables of a list are `shaft[0]`, `shaft[1]`.
    pub(crate) fn place_of(&self, table: &str, key: &str) -> Option<usize> {
        let entries = entries_of(self.table().ok()?.get_ref());
        entries
            .iter()
            .find(|entry| entry.tables == table && entry.name(&self.text) == key)
            .map(|entry| entry.value.start)
    }

    /// Reads the text into raw types.
    pub(crate) fn parse<T: DeserializeOwned>(&self) -> Result<T, ConfigError> {
        Layers { source: self, over: None }.parse()
    }

    /// Reads the text of a file of this kind into raw types. An error in a file of another kind says which it is.
    pub(crate) fn parse_as<T: DeserializeOwned>(&self, wanted: Kind) -> Result<T, ConfigError> {
        self.parse().map_err(|error| self.unless_other(wanted, error))
    }

    /// The error, or that the file is of another kind than this one.
    pub(crate) fn unless_other(&self, wanted: Kind, error: ConfigError) -> ConfigError {
        match self.kind() {
            Ok(kind) if kind != wanted => ConfigError::Syntax {
                path: self.path.clone(),
                line: 1,
                message: format!(
                    "this looks like {}, expected {}\nhint: {}",
                    kind.words(),
                    match wanted {
                        // Most commands take both.
                        Kind::Vehicle | Kind::Car => "a vehicle file",
                        other => other.words(),
                    },
                    kind.taken_by()
                ),
            },
            _ => error,
        }
    }

    /// The text as a table.
    pub(crate) fn table(&self) -> Result<Spanned<DeTable<'_>>, ConfigError> {
        DeTable::parse(&self.text).map_err(|error| match self.text.lines().next() {
            Some(first) if first.matches([',', ';', '\t']).count() > 1 && !first.contains(['=', '[', '#']) => {
                let message = "this looks like a table, expected TOML\nhint: check the order of the files";
                ConfigError::Syntax { path: self.path.clone(), line: 1, message: message.to_owned() }
            }
            _ => Layers { source: self, over: None }.syntax(&error),
        })
    }
}

/// Adds the values below a key to `values`. A list of numbers or words is one value.
fn values_of(key: &str, value: &toml::Value, values: &mut BTreeMap<String, String>) {
    let below = |name: &dyn Display| if key.is_empty() { name.to_string() } else { format!("{key}.{name}") };
    match value {
        toml::Value::Table(table) => table.iter().for_each(|(name, value)| values_of(&below(name), value, values)),
        toml::Value::Array(list) if list.iter().any(toml::Value::is_table) => {
            list.iter().enumerate().for_each(|(at, value)| values_of(&below(&at), value, values));
        }
        value => {
            values.insert(key.to_owned(), value.to_string());
        }
    }
}

/// A file, and a second file whose values replace those of the first.
///
/// A place in the second file is its offset there plus the length of the first one's text.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layers<'a> {
    pub(crate) source: &'a Source,
    pub(crate) over: Option<&'a Source>,
}

impl Layers<'_> {
    /// File and line of a place.
    pub(crate) fn place(&self, offset: usize) -> (PathBuf, usize) {
        match self.over {
            Some(over) if offset >= self.source.text.len() => {
                (over.path.clone(), over.line(offset - self.source.text.len()))
            }
            _ => (self.source.path.clone(), self.source.line(offset)),
        }
    }

    /// An error of the parser with its place.
    fn syntax(&self, error: &toml::de::Error) -> ConfigError {
        self.wrong(error.span().map_or(0, |span| span.start), error.message())
    }

    /// What is wrong at a place.
    pub(crate) fn wrong(&self, place: usize, message: &str) -> ConfigError {
        let (path, line) = self.place(place);
        ConfigError::Syntax { path, line, message: trace::plain_type(message) }
    }

    /// Reads the text into raw types.
    pub(crate) fn parse<T: DeserializeOwned>(&self) -> Result<T, ConfigError> {
        self.tree()?.read_from(self)
    }

    /// The values of both texts.
    pub(crate) fn tree(&self) -> Result<Tree, ConfigError> {
        let wrong = |error| self.syntax(&error);
        let mut table = self.source.table()?;
        // Blanks before its text put every place of the second file behind those of the first.
        let moved = self.over.map(|over| " ".repeat(self.source.text.len()) + &over.text);
        if let Some(moved) = &moved {
            lay_over(table.get_mut(), DeTable::parse(moved).map_err(wrong)?.into_inner());
        }
        Tree::of_table(table.get_ref()).map_err(|place| self.wrong(place, "the number is too large"))
    }
}

/// Puts the values of one table in place of those of another, table by table.
fn lay_over<'t>(below: &mut DeTable<'t>, above: DeTable<'t>) {
    for (key, value) in above {
        match below.get_mut(&key).map(toml::Spanned::get_mut) {
            Some(DeValue::Table(below)) if value.get_ref().is_table() => {
                if let DeValue::Table(above) = value.into_inner() {
                    lay_over(below, above);
                }
            }
            _ => {
                below.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use trace::toml_string;

    use super::*;

    #[test]
    fn a_text_in_a_toml_file_is_read_back_as_it_was() {
        for text in [
            "",
            "a \"b\"",
            "C:\\new",
            "it's # no = comment",
            "two\nlines\tand\u{7f}\u{85}\u{202e}\u{e0041}",
            "Kupplung ü 离合器",
        ] {
            let quoted = toml_string(text);
            let table: toml::Table = toml::from_str(&format!("# {quoted}\ntext = {quoted}\n")).unwrap();
            assert_eq!(table["text"].as_str(), Some(text), "{quoted}");
        }
    }

    #[test]
    fn the_shift_of_a_study_of_cars_is_a_misspelt_key() {
        let text = "name = \"a\"\nvehicle = \"car.toml\"\nshift = \"neighbouring\"\nruns = 3\n";
        let error = Source::built_in("x.toml", text).kind().unwrap_err().to_string();
        assert!(error.contains("x.toml:3") && error.contains("did you mean `shifts`?"), "{error}");
    }

    /// The keys that each reader names where it does not know one.
    #[test]
    fn no_key_of_a_file_is_taken_for_a_misspelt_one_of_another_kind() {
        use crate::{CarFile, CarStudy, DriveFile, ExperimentFile, GearboxFile, Study, VehicleFile, check_learnt};
        let readers: [&dyn Fn(Source) -> Result<(), ConfigError>; 8] = [
            &|source| VehicleFile::from_source(source).map(drop),
            &|source| CarFile::from_source(source).map(drop),
            &|source| ExperimentFile::from_source(source).map(drop),
            &|source| DriveFile::from_source(source).map(drop),
            &|source| Study::from_source(source).map(drop),
            &|source| CarStudy::from_source(source).map(drop),
            // A gearbox is read by its level.
            &|source| {
                let text = format!("level = \"stick-diagram\"\n{}", source.text);
                GearboxFile::from_source(Source { text, ..source }).map(drop)
            },
            &|source| check_learnt(&source),
        ];
        for read in readers {
            let error = read(Source::built_in("x.toml", "unknown_to_all = 1\n")).unwrap_err().to_string();
            let keys: Vec<&str> = error.split('`').skip(3).step_by(2).collect();
            assert!(error.contains("unknown key `unknown_to_all`") && keys.len() > 2, "{error}");
            assert_eq!(misspelt(keys.into_iter(), &KINDS_KEYS), None);
        }
    }

    #[test]
    fn a_file_in_utf_16_or_with_a_mark_is_the_same_text() {
        let text = "[engine]\r\nname = \"Öl\"\r\n";
        let path = std::env::temp_dir().join(format!("wetclutch-source-{}.toml", std::process::id()));
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            Source::read(&path)
        };
        let wide = |mark: bool, order: fn(u16) -> [u8; 2]| {
            let mark = mark.then_some(0xfeff);
            mark.into_iter().chain(text.encode_utf16()).flat_map(order).collect::<Vec<u8>>()
        };
        for (mark, order) in [(true, u16::to_le_bytes as fn(u16) -> [u8; 2]), (true, u16::to_be_bytes)] {
            assert_eq!(read(&wide(mark, order)).unwrap().text, text);
            assert_eq!(read(&wide(false, order)).unwrap().text, text);
            // Half a letter at the end, and half of one that needs four bytes.
            assert!(read(&[wide(mark, order), vec![0]].concat()).is_err());
            assert!(read(&[wide(mark, order), order(0xd83d).to_vec()].concat()).is_err());
        }
        let marked = read(&[&[0xef, 0xbb, 0xbf], text.as_bytes()].concat()).unwrap();
        assert!(marked.parse::<toml::Table>().unwrap().contains_key("engine"));
        assert!(read(&[0xff, 0x80, 0x81]).is_err());
        let _ = std::fs::remove_file(&path);
    }
}
