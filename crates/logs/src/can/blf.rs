//! CAN logs as BLF: objects in compressed containers.
//!
//! The crate `ablf` 0.2 was tried: it prints, panics on damaged data, and does not know the object of plain CAN messages (type 1)
//! nor those of CAN FD. The layout here follows python-can's reader and the public header of the format.

use std::fmt::Display;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::ZlibDecoder;

use super::frame::{Frame, Frames};
use crate::LogError;

/// Largest object that is read, bytes; writers use containers of 128 KiB.
const LARGEST_OBJECT: u32 = 64 << 20;
/// Bytes that every object begins with.
const BASE: usize = 16;

const CAN_MESSAGE: u32 = 1;
const CONTAINER: u32 = 10;
const CAN_MESSAGE2: u32 = 86;
const CAN_FD_MESSAGE: u32 = 100;
const CAN_FD_MESSAGE_64: u32 = 101;

/// A BLF file that is read object by object.
pub(crate) struct Blf {
    path: PathBuf,
    input: BufReader<Box<dyn Read + Send>>,
    /// Place in the file.
    offset: u64,
    /// What is left of the containers so far: whole objects and the beginning of one.
    inner: Vec<u8>,
    at: usize,
    frames: u64,
    damage: Option<LogError>,
    ended: bool,
}

/// The first bytes of an object.
const OBJECT: &[u8] = b"LOBJ";
/// Maximum number of bytes of padding between two objects.
const PADDING_MAX: usize = 8;

/// The head of an object.
struct Object {
    kind: u32,
    header: usize,
    size: usize,
}

impl Object {
    fn parse(bytes: &[u8]) -> Result<Self, String> {
        if bytes.get(..4) != Some(OBJECT) {
            return Err("there is no object where one should begin".to_owned());
        }
        let (header, size, kind) = (u16_at(bytes, 4), u32_at(bytes, 8), u32_at(bytes, 12));
        if size < BASE as u32 || size > LARGEST_OBJECT || usize::from(header) < BASE {
            return Err(format!("an object has a stated size of {size} bytes, and {header} of them as its head"));
        }
        Ok(Self { kind, header: usize::from(header), size: size as usize })
    }
}

/// Where the next object begins. Between objects lies padding of up to eight bytes; its size and its values depend on the writer.
fn begin_of_object(bytes: &[u8]) -> Option<usize> {
    bytes.windows(OBJECT.len()).take(PADDING_MAX + 1).position(|window| window == OBJECT)
}

/// The data of a frame of CAN FD with so many bytes: a writer may leave out the last ones.
fn trimmed(data: &[u8], length: u8) -> &[u8] {
    &data[..data.len().min(usize::from(length))]
}

/// Little-endian numbers; zero beyond the end.
fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes.get(at..at + N).and_then(|bytes| bytes.try_into().ok()).unwrap_or([0; N])
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes_at(bytes, at))
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes_at(bytes, at))
}

impl Blf {
    pub(crate) fn open(path: &Path, input: Box<dyn Read + Send>) -> Result<Self, LogError> {
        let mut blf = Self {
            path: path.to_owned(),
            input: BufReader::new(input),
            offset: 0,
            inner: Vec::new(),
            at: 0,
            frames: 0,
            damage: None,
            ended: false,
        };
        let start = blf.bytes(8)?;
        let length = u32_at(&start, 4);
        if start.len() < 8
            || !(48..=4096).contains(&length)
            || blf.bytes(length as usize - 8)?.len() + 8 < length as usize
        {
            return Err(LogError::cut_or_damaged(path, "byte 4", "the head of the file is cut or has a wrong length"));
        }
        Ok(blf)
    }

    /// Up to this many bytes of the file. The memory grows with what is there, not with what is asked for.
    fn bytes(&mut self, count: usize) -> Result<Vec<u8>, LogError> {
        let mut bytes = Vec::new();
        let read = (&mut self.input).take(count as u64).read_to_end(&mut bytes).map_err(LogError::io(&self.path))?;
        self.offset += read as u64;
        Ok(bytes)
    }

    fn damaged(&self, offset: u64, message: impl Display) -> LogError {
        LogError::cut_or_damaged(&self.path, format!("byte {offset}"), message)
    }

    /// Reads the next object of the file into the memory; false at the end.
    fn read_outer(&mut self) -> Result<bool, LogError> {
        let offset = self.offset;
        let mut bytes = self.bytes(BASE)?;
        let begins = begin_of_object(&bytes);
        if begins.is_none() && bytes.len() < BASE {
            // Nothing but the padding of the last object.
            return Ok(false);
        }
        bytes.drain(..begins.unwrap_or(0));
        bytes.extend(self.bytes(BASE - bytes.len())?);
        let object = Object::parse(&bytes).map_err(|message| self.damaged(offset, message))?;
        let body = self.bytes(object.size - BASE)?;
        bytes.extend(body);
        let cut = bytes.len() < object.size;
        if cut {
            self.damage =
                Some(self.damaged(offset, format!("the object is cut: {} of {} bytes", bytes.len(), object.size)));
        }
        self.inner.drain(..self.at);
        self.at = 0;
        if object.kind != CONTAINER {
            self.inner.extend(bytes);
            return Ok(true);
        }
        const HEAD: usize = 16;
        let (method, declared) = (u16_at(&bytes, BASE), u32_at(&bytes, BASE + 8));
        let packed = bytes.get(BASE + HEAD..).unwrap_or_default();
        match method {
            0 => self.inner.extend_from_slice(packed),
            2 => {
                let limit = u64::from(declared.min(LARGEST_OBJECT));
                let before = self.inner.len();
                let unpacked = ZlibDecoder::new(packed).take(limit).read_to_end(&mut self.inner);
                let got = self.inner.len() - before;
                if !cut && (unpacked.is_err() || got as u64 != u64::from(declared)) {
                    self.damage =
                        Some(self.damaged(offset, format!("a container unpacks to {got} of {declared} bytes")));
                }
            }
            other => {
                return Err(self
                    .damaged(offset, format!("a container is packed by method {other}, known are 0 and 2 (deflate)")));
            }
        }
        Ok(true)
    }

    /// The next object that lies whole in the memory; none if there is none.
    fn next_inner(&mut self) -> Result<Option<(usize, Object)>, LogError> {
        let left = self.inner.get(self.at..).unwrap_or_default();
        let skip = begin_of_object(left).unwrap_or(0);
        let left = left.get(skip..).unwrap_or_default();
        if left.len() < BASE {
            return Ok(None);
        }
        let object = Object::parse(left)
            .map_err(|message| self.damaged(self.offset, format!("{message}, in the container that ends here")))?;
        if left.len() < object.size {
            return Ok(None);
        }
        let start = self.at + skip;
        self.at = start + object.size;
        Ok(Some((start, object)))
    }

    /// The frame of an object, if it is one with data.
    fn frame(&self, start: usize, object: &Object) -> Option<Frame> {
        let bytes = self.inner.get(start..start + object.size)?;
        let body = bytes.get(object.header..)?;
        // Head of version 1 or 2: flags, then the time in units of 10 us or 1 ns. It counts from the start of the recording: frames of before,
        // which a trigger keeps, have negative times.
        let (per_s, stamp) =
            (if u32_at(bytes, BASE) == 1 { 1e5 } else { 1e9 }, i64::from_le_bytes(bytes_at(bytes, 24)));
        // 2^53 ns are 104 days.
        let time_s = stamp as f64 / per_s;
        let (id, payload, remote) = match object.kind {
            CAN_MESSAGE | CAN_MESSAGE2 => {
                let length = usize::from(*body.get(3)?).min(8);
                (u32_at(body, 4), body.get(8..8 + length)?, body.get(2)? & 0x80 != 0)
            }
            CAN_FD_MESSAGE => {
                let data = body.get(20..)?;
                (u32_at(body, 4), trimmed(data, *body.get(14)?), body.get(2)? & 0x80 != 0)
            }
            CAN_FD_MESSAGE_64 => {
                // Behind the data may stand more, from a place that counts from the begin of the object.
                let more = usize::from(*body.get(35)?);
                let end = if more == 0 { body.len() } else { more.checked_sub(object.header)?.min(body.len()) };
                (u32_at(body, 4), trimmed(body.get(40..end)?, *body.get(2)?), u32_at(body, 12) & 0x10 != 0)
            }
            _ => return None,
        };
        // Of the newest object the number of the bus has one byte.
        let bus = if object.kind == CAN_FD_MESSAGE_64 { u16::from(*body.first()?) } else { u16_at(body, 0) };
        let frame = Frame::new(time_s, id & 0x1fff_ffff, id & 0x8000_0000 != 0, payload);
        (!remote).then(|| frame.on(u32::from(bus)))
    }
}

impl Frames for Blf {
    fn next_frame(&mut self) -> Result<Option<Frame>, LogError> {
        loop {
            while let Some((start, object)) = self.next_inner()? {
                if let Some(frame) = self.frame(start, &object) {
                    self.frames += 1;
                    return Ok(Some(frame));
                }
            }
            // What was unpacked before the damage is given first.
            if let Some(damage) = self.damage.take() {
                self.ended = true;
                return Err(damage);
            }
            if self.ended || !self.read_outer()? {
                if !self.ended && self.inner.len() - self.at >= BASE {
                    self.ended = true;
                    return Err(self.damaged(self.offset, "the last object is cut"));
                }
                return match self.frames {
                    0 => Err(LogError::file(
                        &self.path,
                        "there are no data frames\nhint: check that the bus was active and the recorder connected",
                    )),
                    _ => Ok(None),
                };
            }
        }
    }

    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}
