//! The keys of a text in TOML with their places.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A key of a table with its value.
#[derive(Clone)]
pub(crate) struct Entry {
    /// The tables that it is in.
    pub(crate) tables: String,
    pub(crate) key: Range<usize>,
    pub(crate) value: Range<usize>,
    /// Places of the values of a list.
    pub(crate) items: Vec<Range<usize>>,
    pub(crate) is_table: bool,
}

impl Entry {
    /// The key, without quotation marks.
    pub(crate) fn name<'t>(&self, text: &'t str) -> &'t str {
        text.get(self.key.clone()).unwrap_or_default().trim_matches(['"', '\''])
    }
}

/// All keys of a table and of those in it.
pub(crate) fn entries_of(root: &DeTable<'_>) -> Vec<Entry> {
    let mut entries = Vec::new();
    each_entry("", root, &mut entries);
    entries
}

fn each_entry(tables: &str, table: &DeTable<'_>, entries: &mut Vec<Entry>) {
    for (key, value) in table {
        let items = match value.get_ref() {
            DeValue::Array(items) => items.iter().map(Spanned::span).collect(),
            _ => Vec::new(),
        };
        let is_table = value.get_ref().is_table();
        entries.push(Entry { tables: tables.to_owned(), key: key.span(), value: value.span(), items, is_table });
        let inner = if tables.is_empty() { key.get_ref().to_string() } else { format!("{tables}.{}", key.get_ref()) };
        each_table(&inner, value, entries);
    }
}

fn each_table(tables: &str, value: &Spanned<DeValue<'_>>, entries: &mut Vec<Entry>) {
    match value.get_ref() {
        DeValue::Table(table) => each_entry(tables, table, entries),
        DeValue::Array(items) => {
            items.iter().enumerate().for_each(|(at, item)| each_table(&format!("{tables}[{at}]"), item, entries));
        }
        _ => {}
    }
}
