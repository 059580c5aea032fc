//! Values that a DBC gives a name (`VAL_`), and which of them are no readings.
//!
//! A name stands for a state (a gear, a lever, a flag) or for "no value" (`SNA`, `Error`). The DBC does not mark which; the rules:
//!
//! - A name whose words deny a value (`SNA`, `not available`, `invalid`, `undefined`, `reserved`) makes it missing in every signal of at least
//!   two bits. A name of a fault (`Error`, `Fehler`) does so for a quantity, and for a state where it is one of the two highest raw values.
//! - A signal is a quantity if it has a unit that is known, a factor other than 1, or is a float. Its named values are missing, as where a conversion of MDF
//!   gives some numbers a text and scales the others, except those that are readings by the DBC: within a range `[min|max]` that excludes
//!   a part of the raw values, or zero. Words that announce a value (`Init`, `Default`) deny it here too.
//! - Every other name is that of a state: the value stays.

use can_dbc::ValDescription;
use trace::Unit;

use super::bits::Number;

/// Words that deny a value, in any signal. Umlauts are written out before.
const NO_VALUE: &[&str] = &[
    "sna",
    "nv",
    "na",
    "nan",
    "invalid",
    "inval",
    "ungueltig",
    "ungultig",
    "unavailable",
    "undefined",
    "undef",
    "undefiniert",
    "unknown",
    "unbekannt",
    "missing",
    "reserved",
    "reserviert",
    "unsupported",
    "unplausibel",
    "implausible",
    "unused",
];
/// What is denied by a `not` or `no` (`nicht`, `kein`) before it.
const DENIED: &[&str] = &[
    "available",
    "avail",
    "avl",
    "valid",
    "defined",
    "def",
    "used",
    "supported",
    "known",
    "present",
    "plausible",
    "verfuegbar",
    "verfugbar",
    "vorhanden",
    "gueltig",
    "gultig",
    "definiert",
    "belegt",
    "bekannt",
    "plausibel",
    "signal",
    "data",
    "value",
    "reading",
    "measurement",
    "wert",
    "daten",
    "messwert",
    "info",
    "information",
];
/// Words of a fault.
const FAULT: &[&str] = &[
    "error",
    "err",
    "fault",
    "faulty",
    "failure",
    "failed",
    "fail",
    "fehler",
    "fehlerhaft",
    "defect",
    "defective",
    "defekt",
    "malfunction",
];
/// Words that announce a value which is not there yet, or stand for one.
const NOT_YET: &[&str] = &[
    "init",
    "initial",
    "initialization",
    "initialisation",
    "initialising",
    "initializing",
    "initialisierung",
    "initwert",
    "default",
    "defaultwert",
    "substitute",
    "ersatzwert",
    "neutralwert",
    "startup",
];
const NOT: &[&str] = &["not", "no", "nicht", "kein", "keine", "keinen", "without", "ohne"];

/// What is known of a signal besides its names.
pub(super) struct Named<'a> {
    pub(super) size: usize,
    pub(super) number: Number,
    pub(super) factor: f64,
    pub(super) offset: f64,
    pub(super) unit: &'a str,
    pub(super) range: [f64; 2],
}

impl Named<'_> {
    /// The raw values that are no readings.
    pub(super) fn missing(&self, names: &[ValDescription]) -> Vec<u64> {
        let is_missing = |name: &&ValDescription| self.size > 1 && self.is_missing(name);
        let mut missing: Vec<u64> = names.iter().filter(is_missing).map(|name| self.raw(name.id)).collect();
        missing.sort_unstable();
        missing.dedup();
        missing
    }

    /// The bits of a number before factor and offset. A negative one may also be written as its bits.
    fn raw(&self, id: i64) -> u64 {
        // The signal has no more bits.
        match self.number {
            Number::Float => u64::from((id as f32).to_bits()),
            Number::Double => (id as f64).to_bits(),
            Number::Unsigned | Number::Signed => id.cast_unsigned() & self.mask(),
        }
    }

    fn mask(&self) -> u64 {
        u64::MAX >> (64 - self.size)
    }

    fn is_missing(&self, name: &ValDescription) -> bool {
        let words = words(&name.description);
        let has = |some: &[&str]| words.iter().any(|word| some.contains(&word.as_str()));
        let is_denied = |pair: &[String]| NOT.contains(&pair[0].as_str()) && DENIED.contains(&pair[1].as_str());
        // `not_available` is two words, `n/a` too; `notavailable` and `nicht verfuegbar` may be one.
        let is_joined =
            |word: &String| NOT.iter().any(|not| word.strip_prefix(not).is_some_and(|rest| DENIED.contains(&rest)));
        let is_slashed = words.windows(2).any(|pair| pair[0] == "n" && matches!(&*pair[1], "a" | "v" | "d"));
        if has(NO_VALUE) || is_slashed || words.windows(2).any(is_denied) || words.iter().any(is_joined) {
            return true;
        }
        let is_fault = has(FAULT) && !has(NOT);
        if !self.is_quantity() {
            return is_fault && self.raw(name.id) >= self.mask() - 1;
        }
        is_fault || has(NOT_YET) || !self.is_reading(name.id)
    }

    /// Whether the signal measures something, and is no list of states.
    fn is_quantity(&self) -> bool {
        let is_float = matches!(self.number, Number::Float | Number::Double);
        let has_unit = Unit::parse(self.unit).is_some_and(|unit| unit.name != "1");
        is_float || has_unit || (self.factor - 1.0).abs() > f64::EPSILON
    }

    /// Whether a named value of a quantity is a reading by what the DBC says of it.
    fn is_reading(&self, id: i64) -> bool {
        let value = self.value(self.raw(id));
        let [min, max] = self.range;
        let half = 0.5 * self.factor.abs();
        let is_inside = |value: f64| (min - half..=max + half).contains(&value);
        let (lowest, highest) = match self.number {
            Number::Signed => (self.mask() / 2 + 1, self.mask() / 2),
            _ => (0, self.mask()),
        };
        let is_part = min < max && !(is_inside(self.value(lowest)) && is_inside(self.value(highest)));
        if is_part { is_inside(value) } else { value == 0.0 }
    }

    fn value(&self, raw: u64) -> f64 {
        self.number.of(raw, self.size) * self.factor + self.offset
    }

    /// Whether a value with every bit set is a reading: that of a percentage which the DBC lets end there, as OBD does.
    pub(super) fn ends_at_all_bits(&self) -> bool {
        let [min, max] = self.range;
        let is_percentage = Unit::parse(self.unit).is_some_and(|unit| unit.name == "%");
        is_percentage && min < max && self.value(self.mask()) <= max + 0.5 * self.factor.abs()
    }
}

/// The words of a name in small letters: `SignalNotAvailable`, `SIGNAL_NOT_AVAILABLE` and `signal not available` have the same.
fn words(name: &str) -> Vec<String> {
    let (mut words, mut word, mut was_small) = (Vec::new(), String::new(), false);
    for letter in name.chars() {
        let is_new = !letter.is_alphabetic() || letter.is_uppercase() && was_small;
        if is_new && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        was_small = letter.is_lowercase();
        match letter.to_lowercase().next() {
            Some('ä') => word.push_str("ae"),
            Some('ö') => word.push_str("oe"),
            Some('ü') => word.push_str("ue"),
            Some(letter) if letter.is_alphabetic() => word.push(letter),
            _ => {}
        }
    }
    words.push(word);
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEED: Named<'_> =
        Named { size: 16, number: Number::Unsigned, factor: 0.25, offset: 0.0, unit: "rpm", range: [0.0, 0.0] };
    const GEAR: Named<'_> =
        Named { size: 4, number: Number::Unsigned, factor: 1.0, offset: 0.0, unit: "", range: [0.0, 15.0] };

    fn missing(signal: &Named<'_>, names: &[(i64, &str)]) -> Vec<u64> {
        let name = |(id, name): &(i64, &str)| ValDescription { id: *id, description: (*name).to_owned() };
        signal.missing(&names.iter().map(name).collect::<Vec<_>>())
    }

    #[test]
    fn a_name_of_a_state_stays_a_value() {
        let states = [(0, "Park"), (1, "Drive"), (2, "Init"), (3, "Error active"), (4, "Neutral"), (5, "Default")];
        assert_eq!(missing(&GEAR, &states), []);
        // A flag has two values, and both are states.
        let flag = Named { size: 1, ..GEAR };
        assert_eq!(missing(&flag, &[(0, "No error"), (1, "Error")]), []);
        assert_eq!(missing(&flag, &[(0, "invalid"), (1, "valid")]), []);
        // The gear of a heavy vehicle has an offset, and a unit that is none.
        let gear = Named { size: 8, offset: -125.0, unit: "gear value", ..GEAR };
        let names = [(124, "Reverse"), (125, "Neutral"), (251, "Park"), (254, "Error"), (255, "Not available")];
        assert_eq!(missing(&gear, &names), [254, 255]);
        let lock = Named { size: 2, ..GEAR };
        assert_eq!(missing(&lock, &[(0, "open"), (1, "closed"), (2, "error"), (3, "not available")]), [2, 3]);
        assert_eq!(missing(&GEAR, &[(14, "no error"), (15, "OK, not in error")]), []);
    }

    #[test]
    fn a_name_that_denies_a_value_is_known_in_every_spelling() {
        for name in [
            "SNA",
            "N/A",
            "n.a.",
            "NA",
            "Signal not available",
            "SignalNotAvailable",
            "SIGNAL_NOT_AVAILABLE",
            "NotAvailable",
            "notavailable",
            "Signal nicht verfügbar",
            "ungültig",
            "Ungueltig",
            "invalid value",
            "Undefined",
            "not used",
            "Reserved",
            "no signal",
            "kein Signal",
            "unknown",
        ] {
            assert_eq!(missing(&GEAR, &[(7, name)]), [7], "{name}");
            assert_eq!(missing(&SPEED, &[(7, name)]), [7], "{name}");
        }
        for name in [
            "N",
            "D",
            "R",
            "Neutral",
            "Nav",
            "National",
            "Invalidity reset",
            "valid",
            "available",
            "not shifting",
            "snack",
            "",
        ] {
            assert_eq!(missing(&GEAR, &[(7, name)]), [], "{name}");
        }
    }

    #[test]
    fn a_named_value_of_a_quantity_is_a_reading_only_by_its_range_or_as_zero() {
        let names = [(0, "Standstill"), (1, "creep"), (65533, "Init"), (65534, "Error"), (65535, "???")];
        assert_eq!(missing(&SPEED, &names), [1, 65533, 65534, 65535]);
        // A range of all raw values excludes none, and is no word about any.
        let whole = Named { range: [0.0, 16383.75], ..SPEED };
        assert_eq!(missing(&whole, &names), [1, 65533, 65534, 65535]);
        let part = Named { range: [0.0, 16383.0], ..SPEED };
        assert_eq!(missing(&part, &names), [65533, 65534, 65535]);
        assert_eq!(missing(&part, &[(0, "Init"), (4, "Fehler")]), [0, 4]);
    }

    #[test]
    fn names_of_negative_and_floating_values_are_compared_by_their_bits() {
        let torque = Named { number: Number::Signed, size: 12, factor: 0.5, unit: "Nm", ..SPEED };
        assert_eq!(missing(&torque, &[(-2048, "low end"), (2047, "high end")]), [0x7ff, 0x800]);
        // The same as bits without a sign.
        assert_eq!(missing(&torque, &[(2048, "low end")]), [0x800]);
        let float = Named { number: Number::Float, size: 32, factor: 1.0, ..SPEED };
        assert_eq!(missing(&float, &[(-1, "absent")]), [u64::from((-1.0_f32).to_bits())]);
    }

    #[test]
    fn all_bits_of_a_percentage_are_a_reading_where_its_range_ends_there() {
        // OBD: 255 is 100 %.
        let throttle = Named { size: 8, factor: 100.0 / 255.0, unit: "%", range: [0.0, 100.0], ..SPEED };
        assert!(throttle.ends_at_all_bits());
        assert!(Named { factor: 0.39216, ..throttle }.ends_at_all_bits());
        assert!(!Named { factor: 0.4, ..throttle }.ends_at_all_bits());
        assert!(!Named { range: [0.0, 0.0], ..throttle }.ends_at_all_bits());
        assert!(!Named { range: [0.0, 16383.75], ..SPEED }.ends_at_all_bits());
    }
}
