//! The values of a file with their places, from which raw types are read. The runs of a study take them with some of them changed.

use std::fmt;
use std::ops::Range;
use std::slice::Iter;
use std::sync::Arc;

use serde::Deserialize;
use serde::de::value::SeqDeserializer;
use serde::de::{
    self, DeserializeOwned, DeserializeSeed, Deserializer, Expected, IntoDeserializer, MapAccess, Unexpected, Visitor,
};
use serde_spanned::de::{SpannedDeserializer, is_spanned};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use crate::source::Layers;
use crate::{ConfigError, Source};

/// What a factor does to the value in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Change {
    /// Replaces it.
    #[default]
    Set,
    /// Multiplies it; every number of a list.
    Scale,
    /// Adds to it; to every number of a list.
    Add,
}

/// The values of a file with their places in it.
#[derive(Debug, Clone)]
pub(crate) struct Tree {
    root: Node,
}

#[derive(Debug, Clone)]
struct Node {
    place: Range<usize>,
    value: Value,
}

#[derive(Debug, Clone)]
enum Value {
    Float(f64),
    Integer(i64),
    /// A whole number beyond those, such as a seed.
    Large(u64),
    Switch(bool),
    Text(Arc<str>),
    Time,
    List(Vec<Node>),
    Table(Vec<(Key, Node)>),
}

/// A key, and where it is.
#[derive(Debug, Clone)]
struct Key {
    name: Arc<str>,
    at: usize,
}

impl Tree {
    /// The values of a file.
    ///
    /// # Errors
    /// The text is not TOML.
    pub(crate) fn of(source: &Source) -> Result<Self, ConfigError> {
        Layers { source, over: None }.tree()
    }

    /// The values of a table, or the place of a number that is too large.
    pub(crate) fn of_table(root: &DeTable<'_>) -> Result<Self, usize> {
        Ok(Self { root: Node { place: 0..0, value: table(root)? } })
    }

    /// Whether the file has this key outside all tables, or this table.
    pub(crate) fn has(&self, key: &str) -> bool {
        matches!(&self.root.value, Value::Table(table) if table.iter().any(|(own, _)| *own.name == *key))
    }

    /// Takes a key outside all tables, or a table, out of the file.
    pub(crate) fn remove(&mut self, key: &str) {
        if let Value::Table(table) = &mut self.root.value {
            table.retain(|(own, _)| *own.name != *key);
        }
    }

    /// Changes the value at a path. Missing tables are created; an unknown key is refused when the file is checked.
    ///
    /// # Errors
    /// There is no such value, or it is not a number.
    pub(crate) fn change(&mut self, path: &[String], change: Change, value: f64) -> Result<(), String> {
        self.root.change(path, change, value)
    }

    /// The values as raw types; `source` is the file that they were read from.
    ///
    /// # Errors
    /// A key is unknown, or a value has the wrong type.
    pub(crate) fn read<T: DeserializeOwned>(&self, source: &Source) -> Result<T, ConfigError> {
        self.read_from(&Layers { source, over: None })
    }

    /// The same of the files that they were read from.
    pub(crate) fn read_from<T: DeserializeOwned>(&self, files: &Layers<'_>) -> Result<T, ConfigError> {
        T::deserialize(&self.root).map_err(|wrong| files.wrong(wrong.place.unwrap_or(0), &wrong.message))
    }
}

/// The values of a table, or the place of a number that is too large.
fn table(table: &DeTable<'_>) -> Result<Value, usize> {
    let key = |key: &Spanned<DeString<'_>>| Key { name: Arc::from(&**key.get_ref()), at: key.span().start };
    let entries = table.iter().map(|(name, value)| Ok((key(name), node(value)?)));
    entries.collect::<Result<_, usize>>().map(Value::Table)
}

fn node(spanned: &Spanned<DeValue<'_>>) -> Result<Node, usize> {
    let place = spanned.span();
    let value = match spanned.get_ref() {
        DeValue::Float(number) => Value::Float(number.as_str().parse().map_err(|_| place.start)?),
        DeValue::Integer(number) => {
            let (digits, radix) = (number.as_str(), number.radix());
            match (i64::from_str_radix(digits, radix), u64::from_str_radix(digits, radix)) {
                (Ok(number), _) => Value::Integer(number),
                (_, Ok(number)) => Value::Large(number),
                _ => return Err(place.start),
            }
        }
        DeValue::Boolean(on) => Value::Switch(*on),
        DeValue::String(text) => Value::Text(Arc::from(&**text)),
        DeValue::Datetime(_) => Value::Time,
        DeValue::Array(list) => Value::List(list.iter().map(node).collect::<Result<_, _>>()?),
        DeValue::Table(inner) => table(inner)?,
    };
    Ok(Node { place, value })
}

impl Node {
    fn change(&mut self, path: &[String], change: Change, value: f64) -> Result<(), String> {
        let Some((step, rest)) = path.split_first() else { return self.value.apply(change, value) };
        match &mut self.value {
            Value::Table(table) => {
                let at = match table.iter().position(|(key, _)| *key.name == **step) {
                    Some(at) => at,
                    None if rest.is_empty() && change != Change::Set => {
                        return Err("the file has no value to change\nhint: use `change = \"set\"`, or write the value into the file".to_owned());
                    }
                    None => {
                        let missing = if rest.is_empty() { Value::Float(value) } else { Value::Table(Vec::new()) };
                        let key = Key { name: step.as_str().into(), at: self.place.start };
                        table.push((key, Self { place: self.place.clone(), value: missing }));
                        table.len() - 1
                    }
                };
                table[at].1.change(rest, change, value)
            }
            Value::List(list) => {
                let named = list.iter().position(|item| item.value.name() == Some(step.as_str()));
                let found = named.or_else(|| step.parse().ok().filter(|&at: &usize| at < list.len()));
                let at = found.ok_or_else(|| format!("the list has no item `{step}`; items count from 0"))?;
                list[at].change(rest, change, value)
            }
            _ => Err(format!(
                "there is no `{step}`: the key before it is a single value\nhint: end the key before `{step}`"
            )),
        }
    }
}

/// A word that must be one of these.
struct OneOf(&'static [&'static str]);

impl Expected for OneOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "one of {}", self.0.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(", "))
    }
}

impl Value {
    /// What the value is, for an error.
    fn unexpected(&self) -> Unexpected<'_> {
        match self {
            Self::Float(number) => Unexpected::Float(*number),
            Self::Integer(number) => Unexpected::Signed(*number),
            Self::Large(number) => Unexpected::Unsigned(*number),
            Self::Switch(on) => Unexpected::Bool(*on),
            Self::Text(text) => Unexpected::Str(text),
            Self::Time => Unexpected::Other("date or time"),
            Self::List(_) => Unexpected::Seq,
            Self::Table(_) => Unexpected::Map,
        }
    }

    /// The value of the key `name` of a table.
    fn name(&self) -> Option<&str> {
        let Self::Table(table) = self else { return None };
        table.iter().find_map(|(key, node)| match &node.value {
            Self::Text(text) if *key.name == *"name" => Some(&**text),
            _ => None,
        })
    }

    fn apply(&mut self, change: Change, value: f64) -> Result<(), String> {
        let new = |old: f64| match change {
            Change::Set => value,
            Change::Scale => old * value,
            Change::Add => old + value,
        };
        match self {
            Self::Float(old) => *old = new(*old),
            Self::Switch(old) => {
                *old = match (change, value) {
                    (Change::Set, 0.0) => false,
                    (Change::Set, 1.0) => true,
                    _ => return Err("a switch is 0 (off) or 1 (on)\nhint: use `change = \"set\"` with values = [0, 1]".to_owned()),
                }
            }
            Self::Integer(old) => *self = Self::Float(new(*old as f64)),
            Self::Large(old) => *self = Self::Float(new(*old as f64)),
            Self::List(list) if change != Change::Set => {
                return list.iter_mut().try_for_each(|item| item.value.apply(change, value));
            }
            Self::List(_) => return Err("a list cannot be set to a number\nhint: use `change = \"scale\"`, or name one item by its number, counted from 0".to_owned()),
            Self::Text(_) | Self::Time | Self::Table(_) => return Err("the value is not a number\nhint: a factor changes numbers and switches only".to_owned()),
        }
        Ok(())
    }
}

/// Why values are not what a raw type holds.
#[derive(Debug)]
struct Wrong {
    message: String,
    place: Option<usize>,
}

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Wrong {}

impl Wrong {
    /// The innermost value that is wrong gives the place.
    fn at(self, place: usize) -> Self {
        Self { place: self.place.or(Some(place)), ..self }
    }
}

impl de::Error for Wrong {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self { message: message.to_string(), place: None }
    }
}

/// The entries of a table, or of a value with its place: of one type, so that the reading of a raw type is compiled once.
enum Entries<'de> {
    Table(Iter<'de, (Key, Node)>, Option<&'de Node>),
    Place(SpannedDeserializer<'de, &'de Node, Wrong>),
}

impl<'de> MapAccess<'de> for Entries<'de> {
    type Error = Wrong;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Wrong> {
        match self {
            Self::Table(entries, value) => {
                let Some((key, node)) = entries.next() else { return Ok(None) };
                *value = Some(node);
                seed.deserialize(key).map(Some).map_err(|wrong| wrong.at(key.at))
            }
            Self::Place(entries) => entries.next_key_seed(seed),
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Wrong> {
        match self {
            Self::Table(_, value) => match value.take() {
                Some(node) => seed.deserialize(node).map_err(|wrong| wrong.at(node.place.start)),
                None => Err(de::Error::custom("a value comes behind its key")),
            },
            Self::Place(entries) => entries.next_value_seed(seed),
        }
    }
}

impl<'de> Deserializer<'de> for &'de Key {
    type Error = Wrong;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Wrong> {
        visitor.visit_borrowed_str(&self.name)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Wrong> {
        if is_spanned(name) {
            visitor.visit_map(SpannedDeserializer::new(&*self.name, self.at..self.at + self.name.len()))
        } else {
            self.deserialize_any(visitor)
        }
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}

impl<'de> IntoDeserializer<'de, Wrong> for &'de Node {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for &'de Node {
    type Error = Wrong;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Wrong> {
        let read = match &self.value {
            Value::Float(number) => visitor.visit_f64(*number),
            Value::Integer(number) => visitor.visit_i64(*number),
            Value::Large(number) => visitor.visit_u64(*number),
            Value::Switch(on) => visitor.visit_bool(*on),
            Value::Text(text) => visitor.visit_str(text),
            Value::Time => Err(de::Error::invalid_type(self.value.unexpected(), &visitor)),
            Value::List(list) => visitor.visit_seq(SeqDeserializer::new(list.iter())),
            Value::Table(table) => visitor.visit_map(Entries::Table(table.iter(), None)),
        };
        read.map_err(|wrong| wrong.at(self.place.start))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Wrong> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Wrong> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Wrong> {
        if is_spanned(name) {
            let read = visitor.visit_map(Entries::Place(SpannedDeserializer::new(self, self.place.clone())));
            read.map_err(|wrong| wrong.at(self.place.start))
        } else {
            self.deserialize_any(visitor)
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        words: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Wrong> {
        match &self.value {
            Value::Text(word) => visitor.visit_enum((&**word).into_deserializer()),
            other => Err(de::Error::invalid_type(other.unexpected(), &OneOf(words))),
        }
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ExperimentFile, VehicleFile};

    fn path(key: &str) -> Vec<String> {
        key.split('.').map(str::to_owned).collect()
    }

    #[test]
    fn a_file_is_the_same_through_its_tree() {
        let vehicle = VehicleFile::built_in().unwrap();
        let tree = Tree::of(&vehicle.source).unwrap();
        assert_eq!(VehicleFile::from_tree(&vehicle.source, &tree).unwrap(), vehicle);
        for experiment in ExperimentFile::built_in().unwrap().into_iter().chain([ExperimentFile::bench().unwrap()]) {
            let tree = Tree::of(&experiment.source).unwrap();
            assert_eq!(ExperimentFile::from_tree(&experiment.source, &tree).unwrap(), experiment);
        }
    }

    #[test]
    fn what_is_wrong_with_a_changed_value_is_said_with_its_line_in_the_file() {
        let source = VehicleFile::built_in().unwrap().source;
        let error = |key: &str, change, value| {
            let mut tree = Tree::of(&source).unwrap();
            tree.change(&path(key), change, value).unwrap();
            VehicleFile::from_tree(&source, &tree).unwrap_err().to_string()
        };
        let line = 1 + source.text.lines().position(|line| line.starts_with("mass_kg")).unwrap();
        let heavy = error("vehicle.mass_kg", Change::Scale, 1e6);
        assert!(heavy.contains(&format!(":{line}: `vehicle.mass_kg` is ")), "{heavy}");
        assert!(error("vehicle.mas_kg", Change::Set, 1.0).contains("unknown key `mas_kg`"));
        assert!(error("vehicle.mass_kg", Change::Scale, f64::NAN).contains("NaN"));
        let mut tree = Tree::of(&source).unwrap();
        for (key, message) in
            [("name", "not a number"), ("vehicle.mass_kg.x", "single value"), ("clutch.b.x", "no value")]
        {
            assert!(tree.change(&path(key), Change::Scale, 1.0).unwrap_err().contains(message), "{key}");
        }
    }

    #[test]
    fn a_number_that_is_too_large_is_an_error_with_its_line() {
        let source = Source::built_in("x.toml", "a = 1\nb = [2, 99999999999999999999]\n");
        assert_eq!(Tree::of(&source).unwrap_err().to_string(), "x.toml:2: the number is too large");
    }
}
