//! Units in which results are shown to people, in place of those that the program shows them in. Files and JSON keep SI units.
//!
//! The unit of a column stands in its title, that of an axis in its label: `pressure MPa`, `flare rpm, 95 %`, `speed (rpm)`. Title,
//! cells and values are converted by it, so that a table or a figure is made once.

use std::fmt::Write as _;
use std::ops::Range;
use std::str::FromStr;
use std::sync::OnceLock;

use crate::units::{Quantity, Unit};

/// The quantities whose unit may be chosen.
const QUANTITIES: [Quantity; 5] =
    [Quantity::Rotation, Quantity::Pressure, Quantity::Torque, Quantity::Velocity, Quantity::Temperature];

/// Units as titles, labels and sentences of the program spell them; a longer one before those that it ends with.
const SPELT: [&str; 11] = ["rad/s", "rpm", "MPa", "kPa", "hPa", "Pa", "bar", "N m", "km/h", "m/s", "degC"];

/// At most one unit of each quantity.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ShownUnits(Vec<Unit>);

static HELD: OnceLock<ShownUnits> = OnceLock::new();

impl ShownUnits {
    /// Shows results of this process in these units from now on. Only the first call has an effect.
    pub fn hold(self) {
        HELD.get_or_init(|| self);
    }

    /// The units that results may be shown in, as a list.
    pub fn known() -> String {
        let of = |quantity: &Quantity| Unit::of_quantity(*quantity).map(|unit| unit.name);
        QUANTITIES.iter().flat_map(of).collect::<Vec<_>>().join(", ")
    }

    /// The conversion from a unit, if another one of its quantity is wanted.
    fn conversion(&self, from: Unit) -> Option<Conversion> {
        let to = *self.0.iter().find(|unit| unit.quantity == from.quantity)?;
        (to != from).then_some(Conversion { from, to })
    }

    /// A title or label with the wanted unit, and how the values below it are converted; none if they stay.
    fn converted(&self, title: &str) -> Option<(String, Conversion)> {
        let (place, unit) = unit_in(title)?;
        let conversion = self.conversion(unit)?;
        Some((format!("{}{}{}", &title[..place.start], conversion.to.name, &title[place.end..]), conversion))
    }

    /// A sentence with each number that has its unit behind it in the wanted unit.
    fn sentence(&self, text: &str) -> String {
        let mut shown = String::with_capacity(text.len());
        let mut rest = text;
        while let Some((numbers, place, unit)) = numbers_with_unit(rest) {
            match self.conversion(unit) {
                Some(to) => {
                    let space = &rest[numbers.end..place.start];
                    shown += &rest[..numbers.start];
                    shown += &to.cell(&rest[numbers]);
                    shown += space;
                    shown += to.to.name;
                }
                None => shown += &rest[..place.end],
            }
            rest = &rest[place.end..];
        }
        shown + rest
    }

    /// A value in a unit, with decimals for it, in the wanted unit.
    fn quantity(&self, value: f64, unit: &str, decimals: usize) -> String {
        match Unit::parse(unit).and_then(|unit| self.conversion(unit)) {
            Some(to) => format!("{:.*} {}", to.decimals(decimals), to.value(value), to.to.name),
            None => format!("{value:.decimals$} {unit}"),
        }
    }

    /// The titles and rows of a table.
    fn table(&self, titles: &mut [String], rows: &mut [Vec<String>]) {
        for (j, title) in titles.iter_mut().enumerate() {
            let Some((shown, conversion)) = self.converted(title) else { continue };
            *title = shown;
            for cell in rows.iter_mut().filter_map(|row| row.get_mut(j)) {
                *cell = conversion.cell(cell);
            }
        }
    }
}

impl FromStr for ShownUnits {
    type Err = String;

    /// Reads units with commas between them; an empty text is none.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut units: Vec<Unit> = Vec::new();
        for name in text.split(',').map(str::trim).filter(|_| !text.trim().is_empty()) {
            let unit = Unit::parse(name).filter(|unit| QUANTITIES.contains(&unit.quantity));
            let unit = unit.ok_or_else(|| {
                format!("`{name}` is no unit that results are shown in, expected some of {}", Self::known())
            })?;
            if let Some(other) = units.iter().find(|other| other.quantity == unit.quantity && **other != unit) {
                return Err(format!(
                    "`{}` and `{}` measure the same quantity, expected one of them\nhint: give one unit for each quantity, such as rpm,bar",
                    other.name, unit.name
                ));
            }
            units.push(unit);
        }
        Ok(Self(units))
    }
}

fn held() -> Option<&'static ShownUnits> {
    HELD.get().filter(|units| !units.0.is_empty())
}

/// The label of an axis in the wanted unit, and how its values are converted; none if they stay.
pub fn converted(label: &str) -> Option<(String, Conversion)> {
    held()?.converted(label)
}

/// A value of a unit with its name and these decimals, in the wanted unit with as many decimals as show the same steps: `12.3 rad/s`.
pub fn quantity(value: f64, unit: &str, decimals: usize) -> String {
    match held() {
        Some(units) => units.quantity(value, unit, decimals),
        None => format!("{value:.decimals$} {unit}"),
    }
}

/// Brings the titles and rows of a table to the wanted units. A table in these units stays as it is.
pub fn convert_table(titles: &mut [String], rows: &mut [Vec<String>]) {
    if let Some(units) = held() {
        units.table(titles, rows);
    }
}

/// A text that ends with its unit, as `-3.0 to -1.0 kPa`, in the wanted unit.
pub fn with_unit(text: String) -> String {
    match converted(&text) {
        Some((shown, conversion)) => conversion.cell(&shown),
        None => text,
    }
}

/// A sentence in which numbers with a unit behind them, as `2.4 +-0.5 kPa` or `3 to 5 rad/s`, are in the wanted unit.
pub fn sentence(text: &str) -> String {
    held().map_or_else(|| text.to_owned(), |units| units.sentence(text))
}

/// From the unit of a column or an axis to the one that is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    from: Unit,
    to: Unit,
}

impl Conversion {
    /// A value in the wanted unit.
    pub fn value(self, value: f64) -> f64 {
        (self.from.to_si(value) - self.to.zero) / self.to.size
    }

    /// How many decimals show steps that are no larger.
    fn decimals(self, decimals: usize) -> usize {
        // A step of the wanted unit in the one before, in steps of that.
        const SLACK: f64 = 1.0 + 1e-9;
        let mut step = self.to.size / self.from.size;
        for _ in 0..decimals {
            step *= 10.0;
        }
        let mut count = 0;
        while step > SLACK && count < 9 {
            step /= 10.0;
            count += 1;
        }
        count
    }

    /// A cell whose numbers are of the unit before: `0.31 (0.28 to 0.35)`.
    pub fn cell(self, cell: &str) -> String {
        let mut text = String::with_capacity(cell.len());
        let mut rest = cell;
        while let Some(number) = first_number(rest) {
            text.push_str(&rest[..number.start]);
            let digits = &rest[number.clone()];
            // Writing to a string does not fail.
            let _ = match digits.parse() {
                Ok(value) if digits.contains('e') => write!(text, "{:.1e}", self.value(value)),
                Ok(value) => {
                    let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
                    write!(text, "{:.*}", self.decimals(decimals), self.value(value))
                }
                Err(_) => write!(text, "{digits}"),
            };
            rest = &rest[number.end..];
        }
        text + rest
    }
}

/// The place of the first number of a text that is no part of a word and no percentage.
fn first_number(text: &str) -> Option<Range<usize>> {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let mut at = 0;
    while at < bytes.len() {
        let count = digits(at);
        if count == 0 {
            at += 1;
            continue;
        }
        let mut end = at + count;
        if bytes.get(end) == Some(&b'.') && digits(end + 1) > 0 {
            end += 1 + digits(end + 1);
        }
        if bytes.get(end) == Some(&b'e') {
            let sign = usize::from(bytes.get(end + 1) == Some(&b'-'));
            let exponent = digits((end + 1 + sign).min(bytes.len()));
            end += if exponent > 0 { 1 + sign + exponent } else { 0 };
        }
        let before = text[..at].chars().next_back();
        let is_negative = before == Some('-') && !text[..at - 1].ends_with(|c: char| c.is_alphanumeric() || c == '+');
        let is_word = before.is_some_and(char::is_alphabetic) || text[end..].starts_with(char::is_alphabetic);
        if !is_word && !text[end..].trim_start().starts_with('%') {
            return Some(at - usize::from(is_negative)..end);
        }
        at = end;
    }
    None
}

/// The first unit of a sentence with numbers before it: the place of the numbers, that of the unit, and the unit.
fn numbers_with_unit(text: &str) -> Option<(Range<usize>, Range<usize>, Unit)> {
    let mut places = text.match_indices([' ', '\u{a0}']).map(|(at, space)| (at, at + space.len()));
    places.find_map(|(end, at)| {
        let spelt = SPELT.iter().find(|spelt| text[at..].starts_with(*spelt))?;
        // Rates such as rad/s^2 and N m/rad are other quantities; a point may end the sentence.
        let behind = &text[at + spelt.len()..];
        let is_whole =
            behind.trim_start_matches(['.', ',', ';', ':', ')']).chars().next().is_none_or(char::is_whitespace);
        let start = start_of_numbers(&text[..end])?;
        is_whole.then_some((start..end, at..at + spelt.len(), Unit::parse(spelt)?))
    })
}

/// Where the numbers begin with which a text ends: `-3.0`, `2.4 +-0.5`, `1 to 2`.
fn start_of_numbers(text: &str) -> Option<usize> {
    let mut start = None;
    let mut end = text.len();
    loop {
        let before = text[..end].trim_end_matches(|c: char| c.is_ascii_digit() || c == '.');
        if before.len() == end || !text[before.len()..].starts_with(|c: char| c.is_ascii_digit()) {
            return start;
        }
        let signed = before.trim_end_matches(['+', '-']);
        if !(signed.is_empty() || signed.ends_with([' ', '(', '\u{a0}'])) {
            return start;
        }
        start = Some(signed.len());
        let is_width = before[signed.len()..] == *"+-";
        let joint = if is_width { " " } else { " to " };
        match signed.strip_suffix(" +- ").or_else(|| signed.strip_suffix(joint)) {
            Some(left) => end = left.len(),
            None => return start,
        }
    }
}

/// The unit at the end of a title, before a comma or in brackets, and its place.
fn unit_in(title: &str) -> Option<(Range<usize>, Unit)> {
    let is_before = |text: &str| text.is_empty() || text.ends_with([' ', '(', '\u{a0}']);
    let is_after = |text: &str| text.is_empty() || text.starts_with([')', ',']);
    SPELT.iter().find_map(|spelt| {
        let mut places = title.match_indices(spelt);
        let (at, _) = places.find(|(at, _)| is_before(&title[..*at]) && is_after(&title[at + spelt.len()..]))?;
        Some((at..at + spelt.len(), Unit::parse(spelt)?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(text: &str) -> ShownUnits {
        text.parse().unwrap()
    }

    #[test]
    fn a_column_is_converted_by_the_unit_of_its_title() {
        let units = units("bar,rad/s,lb ft,degF");
        let cell = |title: &str, cell: &str| {
            let (title, conversion) = units.converted(title).unwrap();
            (title, conversion.cell(cell))
        };
        let owned = |title: &str, cell: &str| (title.to_owned(), cell.to_owned());
        assert_eq!(cell("pressure MPa", "0.312 (0.300 to -0.005)"), owned("pressure bar", "3.12 (3.00 to -0.05)"));
        assert_eq!(cell("pressure MPa", "0.312 (0.300–0.325)").1, "3.12 (3.00–3.25)");
        assert_eq!(cell("flare rpm, 95 %", "12 +- 3"), owned("flare rad/s, 95 %", "1.3 +- 0.3"));
        assert_eq!(cell("N m", "1.4 / 10.0"), owned("lb ft", "1.03 / 7.38"));
        assert_eq!(cell("speed (rpm)", "1.0e9"), owned("speed (rad/s)", "1.0e8"));
        assert_eq!(cell("oil degC", "-40.0").1, "-40.0");
        assert_eq!(cell("pressure kPa", "K1 5.0, 12 %, –"), owned("pressure bar", "K1 0.050, 12 %, –"));
    }

    #[test]
    fn other_units_and_words_that_hold_a_unit_stay() {
        let units = units("bar,rpm,lb ft,mph");
        for title in [
            "model error, rad/s^2",
            "capacity (10⁻³ N m s²)",
            "gain (Pa s/rad)",
            "time s",
            "K A B",
            "bar",
            "MPa: median",
            "",
            "A",
            "jerk m/s^3",
        ] {
            assert!(units.converted(title).is_none(), "{title}");
        }
    }

    #[test]
    fn numbers_of_a_sentence_are_converted_with_their_unit_and_nothing_else() {
        let units = units("bar,rpm,lb ft,mph");
        for (text, shown) in [
            (
                "off by 1.00 rad/s, of the fitted one by 0.50 rad/s; 12 shifts",
                "off by 9.55 rpm, of the fitted one by 4.77 rpm; 12 shifts",
            ),
            ("reads +2.0 kPa (95 % -1.0 to +5.0 kPa).", "reads +0.020 bar (95 % -0.010 to +0.050 bar)."),
            ("a kiss point 58 +-5 kPa above, 3 +- 1 kPa", "a kiss point 0.58 +-0.05 bar above, 0.03 +- 0.01 bar"),
            ("3 shifts of 20 km/h, in 2 10.0 N m", "3 shifts of 12.4 mph, in 2 7.38 lb ft"),
            ("2 rad/s^2, 3 N m/rad, 4 Pas, kPa, x5 kPa, 1-2 kPa", "2 rad/s^2, 3 N m/rad, 4 Pas, kPa, x5 kPa, 1-2 kPa"),
            ("", ""),
            ("é 1 kPa", "é 0.01 bar"),
        ] {
            assert_eq!(units.sentence(text), shown);
            assert_eq!(units.sentence(&units.sentence(text)), units.sentence(text));
        }
    }

    #[test]
    fn a_value_is_shown_with_steps_that_are_no_larger() {
        assert_eq!(units("psi").quantity(0.5, "MPa", 3), "72.5 psi");
        assert_eq!(units("kPa").quantity(0.5, "MPa", 3), "500 kPa");
        assert_eq!(units("MPa").quantity(123.0, "kPa", 1), "0.1230 MPa");
        assert_eq!(units("rpm").quantity(1.0, "rad/s", 1), "9.5 rpm");
        assert_eq!(units("rpm").quantity(12.0, "N m", 0), "12 N m");
        assert_eq!(units("").quantity(12.0, "N m", 0), "12 N m");
        assert_eq!(units("rpm").quantity(f64::NAN, "rad/s", 1), "NaN rpm");
    }

    #[test]
    fn a_table_that_was_converted_stays() {
        let of = |cells: [&str; 2]| cells.map(str::to_owned).to_vec();
        let (mut titles, mut rows) = (of(["shift", "flare rad/s"]), vec![of(["1-2", "1.0"]), vec!["2-3".to_owned()]]);
        for _ in 0..2 {
            units("rpm").table(&mut titles, &mut rows);
            assert_eq!((titles.clone(), rows[0].clone()), (of(["shift", "flare rpm"]), of(["1-2", "9.5"])));
        }
    }

    #[test]
    fn wrong_units_are_refused_with_the_list() {
        for wrong in ["furlong", "rpm,", "s", "%", "kJ", "rpm;bar"] {
            let message = ShownUnits::from_str(wrong).unwrap_err();
            assert!(message.contains("rpm") && message.contains("psi") && message.contains("lb ft"), "{message}");
            assert!(!message.contains("ms"), "{message}");
        }
        assert!(ShownUnits::from_str("bar,kPa").unwrap_err().starts_with("`bar` and `kPa` measure the same quantity"));
        assert_eq!(units("RPM, U/min"), units("rpm,rpm"));
    }
}
