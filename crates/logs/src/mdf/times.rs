//! Which group has the time of a channel group: itself or, from MDF 4.20 on, another one that it names (a remote master).

use std::collections::HashMap;

use falcon_mdf::blocks::SyncType;
use falcon_mdf::{Channel as MdfChannel, ChannelGroup, Mf4File};

use super::conversion::unreadable;
use super::groups;
use super::limits::GroupAt;

/// Bytes of the head of a block, its number of links in them, and the link of a channel group to the one with its time.
const HEAD: usize = 24;
const LINK_COUNT: usize = 16;
const TIME_LINK: usize = 6;
/// Place of the flags behind the links, and the one of a group with its time in another.
const FLAGS: usize = 16;
const REMOTE_MASTER: u16 = 1 << 3;

/// Where each group is that has a time.
pub(super) struct Times(HashMap<u64, GroupAt>);

/// Why there is no time for a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WithoutTime {
    /// Its channels are over something else.
    Over(&'static str),
    /// Its time has a conversion that cannot be read.
    Unreadable,
    /// Neither it nor another group has one for it.
    Nowhere,
}

impl WithoutTime {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Over(what) => what,
            Self::Unreadable => "its time has a conversion that cannot be read",
            Self::Nowhere => "no time",
        }
    }
}

/// The channel with the time of the records of a group.
pub(super) fn time_channel(group: &ChannelGroup) -> Option<&MdfChannel> {
    group.channels.iter().find(|channel| channel.is_time_channel())
}

impl Times {
    pub(super) fn of(file: &Mf4File) -> Self {
        let is_read = |time: &MdfChannel| unreadable(&time.conversion).is_none();
        let with_time = groups(file).filter(|(_, group)| time_channel(group).is_some_and(is_read));
        Self(with_time.map(|(at, group)| (group.block_offset(), at)).collect())
    }

    /// The group with the time of a group.
    pub(super) fn of_group(&self, file: &Mf4File, group: &ChannelGroup) -> Result<GroupAt, WithoutTime> {
        let own = self.0.get(&group.block_offset());
        let time = own.or_else(|| self.0.get(&remote_master(file, group)?));
        time.copied().ok_or_else(|| match group.master_channel().map(|master| master.sync_type) {
            Some(SyncType::Angle) => WithoutTime::Over("over an angle"),
            Some(SyncType::Distance) => WithoutTime::Over("over a distance"),
            Some(SyncType::Index) => WithoutTime::Over("over a number of the record"),
            _ if time_channel(group).is_some() => WithoutTime::Unreadable,
            _ => WithoutTime::Nowhere,
        })
    }
}

/// Where the group is that a group names for its time. `falcon_mdf` 0.7 does not give it.
fn remote_master(file: &Mf4File, group: &ChannelGroup) -> Option<u64> {
    const MAX_LINKS: u64 = 100;
    let number = |bytes: &[u8], at: usize| Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    let head = file.read_raw(group.block_offset(), HEAD).ok()?;
    let links = number(&head, LINK_COUNT).filter(|links| *links <= MAX_LINKS)?;
    let flags_at = HEAD + 8 * usize::try_from(links).ok()? + FLAGS;
    let block = file.read_raw(group.block_offset(), flags_at + 2).ok()?;
    let flags = u16::from_le_bytes(*block.get(flags_at..)?.first_chunk()?);
    (flags & REMOTE_MASTER != 0 && links > TIME_LINK as u64).then(|| number(&block, HEAD + 8 * TIME_LINK)).flatten()
}
