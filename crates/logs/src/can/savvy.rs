//! Rows of tables of frames as SavvyCAN writes them (GVRET): `Time Stamp,ID,Extended,Dir,Bus,LEN,D1,...,D8`, with times in microseconds.

use super::frame::{Frame, PAYLOAD};
use super::line::{Line, id_of, length_with, payload};

/// Where the columns stand; none before the row of names.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Savvy {
    columns: Option<Columns>,
}

/// Places of the columns.
#[derive(Debug, Clone, PartialEq)]
struct Columns {
    time: usize,
    id: usize,
    extended: usize,
    bus: Option<usize>,
    length: usize,
    data: usize,
}

impl Columns {
    fn of(names: &str) -> Option<Self> {
        let names: Vec<String> = names.split(',').map(|name| name.trim().to_lowercase()).collect();
        let place = |wanted: &str| names.iter().position(|name| name == wanted);
        Some(Self {
            time: place("time stamp")?,
            id: place("id")?,
            extended: place("extended")?,
            bus: place("bus"),
            length: place("len")?,
            data: place("d1")?,
        })
    }
}

impl Savvy {
    /// What a row is.
    pub(super) fn line(&mut self, text: &str) -> Line {
        if text.trim().is_empty() {
            return Line::Remark;
        }
        if let Some(columns) = &self.columns {
            return columns.frame(text).map_or(Line::Unread, Line::Frame);
        }
        self.columns = Columns::of(text);
        if self.columns.is_some() { Line::Remark } else { Line::Unread }
    }
}

impl Columns {
    fn frame(&self, text: &str) -> Option<Frame> {
        let cells: Vec<&str> = text.split(',').map(str::trim).collect();
        let time_s = 1e-6 * cells.get(self.time)?.parse::<f64>().ok().filter(|time_us| time_us.is_finite())?;
        let extended = match cells.get(self.extended)?.to_lowercase().as_str() {
            "true" | "1" => true,
            "false" | "0" => false,
            _ => return None,
        };
        let length: usize = cells.get(self.length)?.parse().ok().filter(|length| *length <= PAYLOAD)?;
        let bytes = cells.get(self.data..)?.iter().take_while(|cell| !cell.is_empty()).count();
        let length = length_with(length, bytes);
        let (bytes, length) = payload(cells.get(self.data..self.data + length)?)?;
        let frame = Frame::new(time_s, id_of(cells.get(self.id)?)?, extended, bytes.get(..length)?);
        let bus = self.bus.and_then(|bus| cells.get(bus)?.parse().ok());
        Some(frame.on(bus.unwrap_or(0)))
    }
}
