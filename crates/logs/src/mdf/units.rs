//! Units of channels and of times.

use std::collections::HashMap;
use std::path::Path;

use falcon_mdf::{Channel as MdfChannel, Mf4File};
use trace::{Quantity, Unit};

use super::limits::GroupAt;
use crate::{LogError, TimeColumn, error};

/// Bytes of the head of a block, and the place in it of its length and of the number of its links.
const HEAD: usize = 24;
const LENGTH: usize = 8;
const LINK_COUNT: usize = 16;
/// The link of a channel to its conversion, and that of a conversion to its unit.
const CONVERSION: usize = 4;
const UNIT: usize = 1;

/// The unit of a channel: its own, or else that of its conversion, which `falcon_mdf` 0.7 does not give.
pub(super) fn unit_of(file: &Mf4File, channel: &MdfChannel) -> String {
    let of_conversion = || {
        let conversion = link(file, channel.block_offset(), CONVERSION)?;
        text(file, link(file, conversion, UNIT)?)
    };
    let own = channel.unit.trim();
    if own.is_empty() { of_conversion().unwrap_or_default() } else { own.to_owned() }
}

fn number(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// Where a link of a block leads, if anywhere.
fn link(file: &Mf4File, block: u64, which: usize) -> Option<u64> {
    let head = file.read_raw(block, HEAD).ok()?;
    let is_there = number(&head, LINK_COUNT)? > which as u64;
    let links = is_there.then(|| file.read_raw(block, HEAD + 8 * (which + 1)).ok()).flatten()?;
    number(&links, HEAD + 8 * which).filter(|to| *to != 0)
}

/// The text of a block: plain, or what stands first between marks of XML.
fn text(file: &Mf4File, block: u64) -> Option<String> {
    const LONGEST: u64 = 4096;
    let head = file.read_raw(block, HEAD).ok()?;
    let length = number(&head, LENGTH).filter(|length| (HEAD as u64..=LONGEST).contains(length))?;
    let bytes = file.read_raw(block, usize::try_from(length).ok()?).ok()?;
    let content = bytes.get(HEAD..)?.split(|byte| *byte == 0).next()?;
    let content = trace::text::text_of(content);
    let plain = match (head.get(..4)?, content.split_once("<TX>")) {
        (b"##TX", _) => content.as_str(),
        (b"##MD", Some((_, rest))) => rest.split_once("</TX>")?.0,
        _ => return None,
    };
    Some(plain.trim().to_owned())
}

/// The sizes of the units of the times, by the group that each is in.
#[derive(Default)]
pub(super) struct TimeUnits(HashMap<GroupAt, f64>);

impl TimeUnits {
    /// Those of these times, and notes on them. A unit of `wanted` replaces that of the times with its name.
    pub(super) fn of<'f>(
        path: &Path,
        file: &'f Mf4File,
        masters: impl Iterator<Item = (GroupAt, &'f MdfChannel)>,
        wanted: Option<&TimeColumn>,
    ) -> Result<(Self, Vec<String>), LogError> {
        let (mut sizes, mut notes, mut names) = (HashMap::new(), Vec::new(), Vec::new());
        let wanted = wanted.and_then(|time| Some((&time.name, time.unit.as_ref()?)));
        for (at, master) in masters {
            let given = wanted.filter(|(name, _)| **name == master.name).map(|(_, unit)| unit.clone());
            let (is_given, unit) = (given.is_some(), given.unwrap_or_else(|| unit_of(file, master)));
            match Unit::parse(&unit) {
                Some(Unit { quantity: Quantity::Time, size, .. }) => drop(sizes.insert(at, size)),
                _ if is_given => return Err(LogError::file(path, unknown(&master.name, &unit))),
                // MDF sets s for the values of a time.
                _ if unit.is_empty() => {}
                _ => notes.push(format!(
                    "the time `{}` has the unit `{}`, which is not known: taken as s",
                    error::shown(&master.name),
                    error::shown(&unit)
                )),
            }
            names.push(format!("`{}`", error::shown(&master.name)));
        }
        notes.dedup();
        names.dedup();
        if let Some((name, _)) = wanted.filter(|(name, _)| !names.contains(&format!("`{}`", error::shown(name)))) {
            notes.push(format!(
                "[time] of the channel map names `{}` and has no effect: the times of this log are {}\nhint: leave `name` out, or give one of these",
                error::shown(name),
                error::some(&names)
            ));
        }
        Ok((Self(sizes), notes))
    }

    /// The size of the unit of the time in a group, s.
    pub(super) fn size_s(&self, group: GroupAt) -> f64 {
        self.0.get(&group).copied().unwrap_or(1.0)
    }
}

fn unknown(name: &str, unit: &str) -> String {
    format!(
        "the time `{}` has the unit `{}` in the channel map\nhint: it can be s, ms, us, ns, min or h",
        error::shown(name),
        error::shown(unit)
    )
}
