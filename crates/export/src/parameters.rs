//! The parameters of a car: their names, their words, and the C source of both.

use std::fmt::Write as _;

use ecu::{Header, Sink, image};

use crate::c_text::{comment, hex_float};
use crate::units::unit_of;
use crate::{ExportError, ExportedFilter};

/// What a parameter is.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers; several of them are an array.
    Reals(Vec<f32>),
    /// A count, a place, or a truth value.
    Whole(u32),
}

/// A parameter of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Its names, the outermost first.
    pub(crate) path: Vec<String>,
    /// Its place in the image, bytes.
    pub offset: usize,
    /// Its values.
    pub values: Values,
}

impl Entry {
    /// Its name in C.
    pub fn name(&self) -> String {
        self.path.join("_")
    }

    /// Its unit.
    pub fn unit(&self) -> &'static str {
        unit_of(&self.path)
    }

    /// Its place among the elements, gears or shifts, if it is of one of them: `elements 0`.
    pub(crate) fn part(&self) -> Option<[&str; 2]> {
        let [part, at, ..] = &self.path[..] else { return None };
        ["elements", "gears", "shifts"].contains(&part.as_str()).then_some([part, at])
    }
}

/// The image of a car with the names of its words.
#[derive(Debug, Clone)]
pub struct Image {
    /// Its parameters in their order.
    pub entries: Vec<Entry>,
    /// Its words.
    pub words: Vec<u32>,
    /// Memory that its observer needs on a machine of 64 bits, bytes; on one of 32 bits it is less.
    pub memory_bytes: usize,
}

#[derive(Default)]
struct Collected {
    path: Vec<String>,
    entries: Vec<Entry>,
    words: Vec<u32>,
}

impl Collected {
    fn push(&mut self, name: &'static str, values: Values) {
        let path = self.path.iter().cloned().chain([name.to_owned()]).filter(|name| !name.is_empty()).collect();
        self.entries.push(Entry { path, offset: 4 * self.words.len(), values });
    }
}

impl Sink for Collected {
    fn begin(&mut self, name: &'static str) {
        self.path.push(name.to_owned());
    }

    fn begin_place(&mut self, at: usize) {
        self.path.push(at.to_string());
    }

    fn end(&mut self) {
        self.path.pop();
    }

    fn reals(&mut self, name: &'static str, values: &[f32]) {
        self.push(name, Values::Reals(values.to_vec()));
        self.words.extend(values.iter().map(|value| value.to_bits()));
    }

    fn whole(&mut self, name: &'static str, value: u32) {
        self.push(name, Values::Whole(value));
        self.words.push(value);
    }
}

impl Image {
    /// The image of a filter.
    ///
    /// # Errors
    /// A controller would refuse it: a number of the car has no place in single precision.
    pub fn of(filter: &ExportedFilter) -> Result<Self, ExportError> {
        let mut collected = Collected::default();
        image::put(&filter.filter(), sha256_words(&filter.vehicle_sha256), &mut collected);
        let Collected { mut entries, mut words, .. } = collected;
        image::seal(&mut words);
        // Size and checksum of the header are known now.
        let header = entries.iter_mut().take_while(|entry| entry.path[0] == "header");
        header.zip(&words).for_each(|(entry, word)| entry.values = Values::Whole(*word));
        if let Some(wrong) = entries.iter().find(|entry| !entry.is_sound()) {
            return Err(ExportError::Single { name: wrong.name(), value: format!("{:?}", wrong.values) });
        }
        let memory_bytes = ecu::memory::size(&words).unwrap_or(0);
        Ok(Self { entries, words, memory_bytes })
    }

    /// Its header.
    pub fn header(&self) -> Option<Header> {
        Header::of(&self.words).ok().map(|(header, _)| header)
    }

    /// Its bytes, the lowest of each word first.
    pub fn bytes(&self) -> Vec<u8> {
        self.words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    /// The members of its struct in C.
    pub(crate) fn members(&self, filter: &ExportedFilter) -> String {
        self.lines(filter, |entry| {
            let name = entry.name();
            match &entry.values {
                Values::Whole(_) => format!("  uint32_t {name};"),
                Values::Reals(values) if values.len() == 1 => format!("  float {name}; /* {} */", entry.unit()),
                Values::Reals(values) => format!("  float {name}[{}]; /* {} */", values.len(), entry.unit()),
            }
        })
    }

    /// A line for each parameter, with a comment before each element, gear and shift.
    fn lines(&self, filter: &ExportedFilter, line: impl Fn(&Entry) -> String) -> String {
        let (mut text, mut before) = (String::new(), None);
        for entry in &self.entries {
            if entry.part() != before {
                before = entry.part();
                if let Some(part) = before {
                    let _ = writeln!(text, "  /* {} */", comment(&filter.words_for(part)));
                }
            }
            text += &line(entry);
            text.push('\n');
        }
        text
    }

    /// The C source of the parameters.
    pub(crate) fn c_source(&self, filter: &ExportedFilter) -> String {
        let name = &filter.name;
        let values = self.lines(filter, |entry| match &entry.values {
            Values::Whole(value) => format!("  {value}u, /* {} */", entry.name()),
            Values::Reals(values) => {
                let exact: Vec<String> = values.iter().map(|value| hex_float(*value)).collect();
                let read: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
                let exact = exact.join(", ");
                let exact = if values.len() == 1 { exact } else { format!("{{{exact}}}") };
                format!("  {exact}, /* {}: {} {} */", entry.name(), read.join(", "), entry.unit())
            }
        });
        format!(
            "/* Parameters of the observer of \"{}\". Written by wetclutch {} from a vehicle file with the SHA-256\n   {}. */\n\
             #include <math.h>\n\
             #include \"wetclutch_{name}.h\"\n\n\
             const wetclutch_{name}_parameters_t wetclutch_{name}_parameters = {{\n{values}}};\n",
            comment(&filter.car.name),
            env!("CARGO_PKG_VERSION"),
            filter.vehicle_sha256,
        )
    }
}

impl Entry {
    /// Whether a controller takes it: numbers, and axes that rise.
    fn is_sound(&self) -> bool {
        let Values::Reals(values) = &self.values else { return true };
        let rises = || values.windows(2).all(|pair| pair[0] < pair[1]);
        !values.iter().any(|value| value.is_nan()) && (self.path.last().is_none_or(|name| name != "axis") || rises())
    }
}

/// A checksum in hexadecimal as words, the first digits highest.
fn sha256_words(hex: &str) -> [u32; 8] {
    std::array::from_fn(|at| {
        hex.get(8 * at..8 * at + 8).and_then(|part| u32::from_str_radix(part, 16).ok()).unwrap_or(0)
    })
}

impl ExportedFilter {
    /// What a part of the image is: `clutch A`, `gear 1`, `shift 1-2`.
    pub(crate) fn words_for(&self, [part, at]: [&str; 2]) -> String {
        let at: usize = at.parse().unwrap_or(usize::MAX);
        match part {
            "elements" => format!("element {at}: {}", self.elements().get(at).unwrap_or(&"")),
            "gears" => format!("gear {}, ratio {:.3}", self.gear(at), self.car.gearbox.gears[at].ratio),
            _ => self.shifts().nth(at).map_or_else(String::new, |shift| format!("shift {}", self.shift_name(shift))),
        }
    }

    /// A shift by its gears.
    pub(crate) fn shift_name(&self, [from, to]: [usize; 2]) -> String {
        format!("{}-{}", self.gear(from), self.gear(to))
    }
}
