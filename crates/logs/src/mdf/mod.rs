//! ASAM MDF 4: channel groups that share a time are a stream.
//!
//! `falcon_mdf` reads the structure of a file. Plain numbers in deflated or unpacked blocks are decoded here, column by column;
//! what is rarer is decoded by the library.

mod blocks;
mod bus;
mod bytes;
mod conversion;
mod cut;
mod field;
mod group;
mod inflate;
mod limits;
mod records;
mod times;
mod units;

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use falcon_mdf::{Channel as MdfChannel, ChannelGroup, DataGroup, Mf4Error, Mf4File, OpenOptions};

use crate::ahead::Crew;
use crate::can::{Database, Decoder};
use crate::columns::{Batch, Stream};
use crate::{Channel, LogError, TimeColumn, error};
use blocks::Blocks;
use bus::Bus;
use bytes::Bytes;
use conversion::unreadable;
use field::{Field, Tile};
use group::{Decoding, Group, Part};
use limits::{GroupAt, LARGEST_BLOCK, ON_TRUST};
use records::Records;
use times::{Times, time_channel};
use units::{TimeUnits, unit_of};

/// An open MDF file.
pub(crate) struct MdfLog {
    path: PathBuf,
    file: Mf4File,
    /// The same, for blocks of data.
    blocks: Arc<Blocks>,
    /// Who unpacks them.
    crew: Crew,
    /// How many groups have each name.
    names: HashMap<String, usize>,
    places: Vec<Place>,
    /// Signals on a logged bus, behind the channels of the file.
    database: Option<Database>,
    /// The units of the times.
    time_units: TimeUnits,
    notes: Vec<String>,
    /// The first place of a file that is cut, and what it lacks.
    cut: Option<(String, String)>,
}

/// Where a channel is, and the group with its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    group: GroupAt,
    channel: usize,
    time: GroupAt,
}

impl MdfLog {
    /// Opens a file, or its bytes in memory; then `path` is what messages call it. A unit in `time` replaces that of the times with this name.
    pub(crate) fn open(
        path: &Path,
        memory: Option<&Arc<[u8]>>,
        database: Option<Database>,
        time: Option<&TimeColumn>,
    ) -> Result<(Self, Vec<Channel>), LogError> {
        let options = OpenOptions {
            build_channels_db: false,
            parallel_parsing: false,
            max_alloc: ON_TRUST,
            max_decompressed: LARGEST_BLOCK,
            ..OpenOptions::default()
        };
        let whole = bytes::backend(path, memory);
        let (file, cut) =
            match whole.and_then(|bytes| Mf4File::from_source_with_options(Arc::new(bytes), options.clone())) {
                Ok(file) => (file, None),
                Err(error) => {
                    let is_cut = matches!(error, Mf4Error::TruncatedFile { .. });
                    let mended = bytes::backend(path, memory).ok().filter(|_| is_cut);
                    let mended = mended.and_then(|bytes| cut::open(bytes, options));
                    let (file, place, what) = mended.ok_or_else(|| damaged(path, "its structure", &error))?;
                    (file, Some((place, what)))
                }
            };
        let blocks = Arc::new(Blocks::new(Bytes::open(path, memory)?));
        let mut names = HashMap::new();
        groups(&file).for_each(|(_, group)| *names.entry(group.acquisition_name.clone()).or_default() += 1);
        let masters = groups(&file).filter_map(|(at, group)| Some((at, time_channel(group)?)));
        let (time_units, notes) = TimeUnits::of(path, &file, masters, time)?;
        let (path, places) = (path.to_owned(), Vec::new());
        let mut log = Self { path, file, blocks, crew: Crew::of(1), names, places, database, time_units, notes, cut };
        let mut channels = log.find_channels();
        if log.file.unfinalized().is_some() {
            log.notes.push("the recorder did not finish the file: the complete part is read".to_owned());
        }
        if log.lacks_dbc() {
            log.notes.push(
                "there are frames of a CAN bus, whose signals are not read\nhint: a DBC defines the signals in them: give it with --dbc"
                    .to_owned(),
            );
        }
        if let Some(database) = log.database.as_ref().filter(|_| log.has_frames()) {
            channels.extend_from_slice(database.channels());
        }
        Ok((log, channels))
    }

    /// Whether there are frames of a CAN bus in it.
    pub(crate) fn has_frames(&self) -> bool {
        !self.file.can_frame_groups().is_empty()
    }

    /// Whether there are frames of a CAN bus, and no DBC.
    pub(crate) fn lacks_dbc(&self) -> bool {
        self.database.is_none() && self.has_frames()
    }

    /// Adds a note.
    pub(crate) fn note(&mut self, note: &str) {
        self.notes.push(note.to_owned());
    }

    /// Finds the channels that hold numbers over time, and notes which do not.
    fn find_channels(&mut self) -> Vec<Channel> {
        let (mut places, mut channels) = (Vec::new(), Vec::new());
        let mut left_out = LeftOut::default();
        let times = Times::of(&self.file);
        for (group, data) in groups(&self.file) {
            let name = self.group_name(group);
            let time = times.of_group(&self.file, data);
            for (channel, own) in data.channels.iter().enumerate().filter(|(_, own)| !own.is_master()) {
                let time = match time {
                    Ok(time) => time,
                    Err(why) => {
                        let group = error::shown(&name);
                        left_out.without_time.push(format!(
                            "{} (group `{group}`, {})",
                            error::shown(&own.name),
                            why.name()
                        ));
                        continue;
                    }
                };
                let kind = not_numbers(own).or_else(|| self.not_beside(time, group, own));
                if let Some(kind) = kind {
                    left_out.no_numbers.push(format!("{} ({kind})", error::shown(&own.name)));
                    continue;
                }
                if let Some(reason) = unreadable(&own.conversion) {
                    left_out.unread.push(format!("{} ({})", error::shown(&own.name), error::shown(reason)));
                    continue;
                }
                places.push(Place { group, channel, time });
                let unit = unit_of(&self.file, own);
                channels.push(Channel { name: own.name.clone(), unit, group: name.clone() });
            }
        }
        self.notes.extend(left_out.notes());
        self.places = places;
        channels
    }

    pub(crate) fn format(&self) -> String {
        format!("MDF {}", self.file.version())
    }

    /// Lets these threads unpack blocks ahead.
    pub(crate) fn unpack_with(&mut self, crew: Crew) {
        self.crew = crew;
    }

    pub(crate) fn crew(&self) -> &Crew {
        &self.crew
    }

    pub(crate) fn streams(&self, wanted: &[bool]) -> Result<Vec<Box<dyn Stream + '_>>, LogError> {
        let mut over: BTreeMap<GroupAt, BTreeMap<GroupAt, Vec<usize>>> = BTreeMap::new();
        for (i, place) in self.places.iter().enumerate().filter(|(i, _)| wanted[*i]) {
            over.entry(place.time).or_default().entry(place.group).or_default().push(i);
        }
        let cut = self.cut.as_ref().map(|(place, what)| LogError::damaged(&self.path, place, what));
        let mut streams: Vec<Box<dyn Stream + '_>> = vec![Box::new(Remarks { notes: &self.notes, cut })];
        for (time, groups) in over {
            streams.extend(self.streams_over(time, groups)?.into_iter().map(|group| Box::new(group) as Box<_>));
        }
        let own = self.places.len();
        if let Some(database) = self.database.as_ref().filter(|_| wanted.len() > own) {
            for group in self.file.can_frame_groups() {
                let frames = self
                    .file
                    .can_frames(group)
                    .map_err(|error| damaged(&self.path, "the frames of its bus", &error))?;
                let at = (group.data_group_index, group.index);
                let decoder = Decoder::new(database, &wanted[own..]);
                streams.push(Box::new(Bus::new(frames, self.time_units.size_s(at), decoder, own)));
            }
        }
        Ok(streams)
    }

    /// The channels of groups that have one time: a stream, or two where the library must decode some of them.
    fn streams_over(&self, time: GroupAt, groups: BTreeMap<GroupAt, Vec<usize>>) -> Result<Vec<Group<'_>>, LogError> {
        let Some(master) = time_channel(self.group(time).1) else { return Ok(Vec::new()) };
        let (own, others): (Vec<_>, Vec<_>) = groups.into_iter().partition(|(group, _)| *group == time);
        let own = own.into_iter().next().map(|(_, channels)| channels).unwrap_or_default();
        if let Some(decoder) = self.own_decoding(time, &own, &others) {
            let channels = own.into_iter().chain(others.into_iter().flat_map(|(_, channels)| channels)).collect();
            return Ok(vec![Group::new(self, time, decoder, channels)]);
        }
        let channels: Vec<&MdfChannel> = std::iter::once(master).chain(own.iter().map(|&i| self.channel(i))).collect();
        let decoder = Decoding::by_library(self, time, &channels)
            .map_err(|error| damaged(&self.path, &self.place_of(time), &error))?;
        let mut streams = vec![Group::new(self, time, decoder, own)];
        if let Some(decoder) = self.own_decoding(time, &[], &others).filter(|_| !others.is_empty()) {
            let channels = others.into_iter().flat_map(|(_, channels)| channels).collect();
            streams.push(Group::new(self, time, decoder, channels));
        }
        Ok(streams)
    }

    /// Decodes these channels of the group with the time, and of others beside it; none where the library must.
    fn own_decoding(&self, time: GroupAt, own: &[usize], others: &[(GroupAt, Vec<usize>)]) -> Option<Decoding<'_>> {
        let (data, group) = self.group(time);
        let field = Field::of(time_channel(group)?, group, Records::id_bytes(data))?;
        let part =
            |(group, channels): (GroupAt, &[usize])| Part::of(self, group, channels.iter().map(|&i| self.channel(i)));
        let others = others.iter().map(|(group, channels)| (*group, channels.as_slice()));
        let parts = std::iter::once((time, own)).chain(others).map(part).collect::<Option<_>>()?;
        Some(Decoding::Own { tile: Tile::new(), time: field, parts })
    }

    /// Why a channel cannot be decoded beside a time in another group, in a word: the library decodes no two groups side by side.
    fn not_beside(&self, time: GroupAt, group: GroupAt, channel: &MdfChannel) -> Option<&'static str> {
        let is_decoded =
            || self.own_decoding(time, &[], &[]).is_some() && Part::of(self, group, [channel].into_iter()).is_some();
        (time != group && !is_decoded())
            .then_some("packed in a way that is not read where the time is in another group")
    }

    fn group(&self, (data, group): GroupAt) -> (&DataGroup, &ChannelGroup) {
        let data = &self.file.data_groups()[data];
        (data, &data.channel_groups[group])
    }

    fn channel(&self, i: usize) -> &MdfChannel {
        &self.group(self.places[i].group).1.channels[self.places[i].channel]
    }

    /// A group by the name that its recorder gave it, or its number; by both where several have the name.
    fn group_name(&self, at: GroupAt) -> String {
        let (number, given) = (at.0 + 1, &self.group(at).1.acquisition_name);
        match given.trim() {
            "" => format!("{number}"),
            name if self.names.get(given).is_some_and(|count| *count > 1) => format!("{name} #{number}"),
            name => name.to_owned(),
        }
    }

    /// A group as messages show it.
    fn place_of(&self, at: GroupAt) -> String {
        format!("group `{}`", self.group_name(at))
    }
}

/// Channels that are left out, each with the reason.
#[derive(Default)]
struct LeftOut {
    without_time: Vec<String>,
    no_numbers: Vec<String>,
    /// Their conversions cannot be read.
    unread: Vec<String>,
}

impl LeftOut {
    fn notes(&self) -> impl Iterator<Item = String> {
        const HINT: &str = "\nhint: let the recorder write a time into their group, or name a group that has one";
        let kinds = [
            (&self.without_time, "are not over time", HINT),
            (&self.no_numbers, "do not hold single numbers", ""),
            (&self.unread, "have a conversion that cannot be read", ""),
        ];
        let some = kinds.into_iter().filter(|(names, ..)| !names.is_empty());
        some.map(|(names, what, hint)| {
            format!("{} channels {what} and are left out: {}{hint}", names.len(), error::some(names))
        })
    }
}

/// What a channel holds in place of single numbers, in a word; none if it holds these.
fn not_numbers(channel: &MdfChannel) -> Option<&'static str> {
    match () {
        () if channel.is_array() => Some("an array"),
        () if channel.unreadable().is_some() => Some("cannot be read"),
        () if channel.value_kind().is_numeric() || channel.raw_value_kind().is_numeric() => None,
        () => Some("text or bytes"),
    }
}

/// All channel groups, and where they are.
fn groups(file: &Mf4File) -> impl Iterator<Item = (GroupAt, &ChannelGroup)> {
    file.data_groups()
        .iter()
        .enumerate()
        .flat_map(|(i, data)| data.channel_groups.iter().enumerate().map(move |(j, group)| ((i, j), group)))
}

/// What the library for MDF says; of a packing that it was built without, as for the browser, in words of our own.
fn message(error: &Mf4Error) -> String {
    match error {
        Mf4Error::Unsupported { feature, .. } if feature.ends_with("compression") => format!(
            "the browser does not read its {feature}\nhint: estimate it with the program, or save it deflated or without compression"
        ),
        _ => error.to_string(),
    }
}

fn damaged(path: &Path, place: &str, error: &Mf4Error) -> LogError {
    match error {
        Mf4Error::UnsupportedVersion { .. } => LogError::damaged(
            path,
            place,
            format!("{error}\nhint: versions 4.00 to 4.20 are read; save it as one of them"),
        ),
        _ => LogError::cut_or_damaged(path, place, message(error)),
    }
}

/// What was seen when the file was opened.
struct Remarks<'a> {
    notes: &'a [String],
    cut: Option<LogError>,
}

impl Stream for Remarks<'_> {
    fn next_batch(&mut self, _: &mut Batch) -> Result<bool, LogError> {
        self.cut.take().map_or(Ok(false), Err)
    }

    fn notes(&self) -> Vec<String> {
        self.notes.to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packing_that_the_browser_does_not_read_is_said_with_what_to_do() {
        let unsupported = Mf4Error::Unsupported {
            feature: "lz4 compression".to_owned(),
            detail: "enable the 'lz4' cargo feature".to_owned(),
        };
        let text = damaged(Path::new("log.mf4"), "its records", &unsupported).to_string();
        assert!(
            text.contains("the browser does not read its lz4 compression\nhint: estimate it with the program"),
            "{text}"
        );
        assert!(!text.contains("cargo") && text.matches("hint: ").count() == 1, "{text}");
    }
}
