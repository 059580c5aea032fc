//! Parquet files: a table of numbers, read by row group and in it some thousand rows at a time.

mod clock;
mod pages;
mod text;

use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use drivetrain::Real;
use half::f16;
use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{DataType, DoubleType, Int96};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescPtr;

use crate::columns::{Batch, Block, Stream, are_finite};
use crate::csv_log::split_unit;
use crate::row_order::RowOrder;
use crate::samples::Quality;
use crate::stamp::Midnight;
use crate::time_column::{is_time_name, time_column, time_unit};
use crate::{Channel, LogError, TimeColumn, error};
use pages::CheckedPages;
use trace::Unit;
use trace::units::Scale;

/// Rows that are decoded at once: their columns stay in the second cache. Of many columns fewer, but so many, are.
const BATCH: usize = 8192;
const FEWEST: usize = 256;
/// Numbers that are decoded at once, at most.
const NUMBERS: usize = 1 << 20;

/// An open Parquet file.
pub(crate) struct ParquetLog {
    path: PathBuf,
    reader: SerializedFileReader<File>,
    /// Column and size in s of the time.
    time: (usize, Scale),
    time_form: Form,
    /// Whether the time is that of the day.
    is_of_day: bool,
    /// Column of each channel, and how its numbers are stored.
    columns: Vec<(usize, Form)>,
    notes: Vec<String>,
}

impl ParquetLog {
    pub(crate) fn open(path: &Path, time: Option<&TimeColumn>) -> Result<(Self, Vec<Channel>), LogError> {
        let file = File::open(path).map_err(LogError::io(path))?;
        let length = file.metadata().map_err(LogError::io(path))?.len();
        let reader = SerializedFileReader::new(file).map_err(|error| cut(path, length, &error))?;
        check_places(path, length, &reader)?;
        if reader.metadata().file_metadata().num_rows() == 0 {
            return Err(LogError::file(path, "there are no rows\nhint: check that the recorder has written samples"));
        }
        let leaves: Vec<ColumnDescPtr> = reader.metadata().file_metadata().schema_descr().columns().to_vec();
        let titles: Vec<String> = leaves.iter().map(|leaf| leaf.path().string()).collect();
        let names: Vec<(String, String)> =
            titles.iter().zip(&leaves).map(|(title, leaf)| name_and_unit(title, leaf)).collect();
        let mut notes = Vec::new();
        // A column of time stamps is the time where no name says so.
        let stamps = (0..leaves.len()).find(|&i| stamp_unit(&leaves[i]).is_some());
        let named = names.iter().any(|(name, _)| is_time_name(name));
        let by_kind =
            stamps.filter(|_| time.is_none() && !named).map(|i| TimeColumn { name: names[i].0.clone(), unit: None });
        let wanted = time.or(by_kind.as_ref());
        let time = time_column(path, &names, &titles, wanted)?;
        let Some(time_form) = Form::of(&leaves[time]) else {
            return Err(LogError::file(
                path,
                format!(
                    "the time `{}` holds {}\nhint: write it as a number or a time stamp",
                    error::shown(&titles[time]),
                    kind(&leaves[time])
                ),
            ));
        };
        let size_s = time_unit(path, &names[time], wanted, &mut notes)?;
        clock::check(path, &reader, &names, (time, size_s))?;
        let is_of_day = matches!(leaves[time].logical_type_ref(), Some(LogicalType::Time(_)));
        let others = || (0..leaves.len()).filter(|&i| i != time);
        let form = |i: usize| Form::of(&leaves[i]).or_else(|| text::holds_numbers(&reader, i).then_some(Form::Text));
        let columns: Vec<(usize, Form)> = others().filter_map(|i| Some((i, form(i)?))).collect();
        let left_out: Vec<String> = others()
            .filter(|i| columns.binary_search_by_key(i, |column| column.0).is_err())
            .map(|i| format!("{} ({})", error::shown(&titles[i]), kind(&leaves[i])))
            .collect();
        if !left_out.is_empty() {
            notes.push(format!(
                "{} columns do not hold single numbers and are left out: {}",
                left_out.len(),
                error::some(&left_out)
            ));
        }
        let channels = columns.iter().map(|&(i, _)| Channel {
            name: names[i].0.clone(),
            unit: names[i].1.clone(),
            group: String::new(),
        });
        let channels = channels.collect();
        let time = (time, Scale::of(size_s));
        Ok((Self { path: path.to_owned(), reader, time, time_form, is_of_day, columns, notes }, channels))
    }

    /// Adds a note.
    pub(crate) fn note(&mut self, note: &str) {
        self.notes.push(note.to_owned());
    }

    pub(crate) fn stream(&mut self, wanted: &[bool]) -> Result<Box<dyn Stream + '_>, LogError> {
        let channels: Vec<usize> = (0..self.columns.len()).filter(|&channel| wanted[channel]).collect();
        self.check_compression(channels.iter().map(|&channel| self.columns[channel].0).chain([self.time.0]))?;
        Ok(Box::new(Groups {
            channels,
            log: self,
            group: 0,
            open: None,
            midnight: Midnight::default(),
            order: RowOrder::default(),
            without_time: 0,
        }))
    }

    /// Checks that these columns can be unpacked.
    fn check_compression(&self, mut columns: impl Iterator<Item = usize>) -> Result<(), LogError> {
        let packed = |column: usize| {
            let mut groups = self.reader.metadata().row_groups().iter();
            groups.find_map(|group| {
                let column = group.columns().get(column)?;
                Some((column.column_path().string(), not_built_in(column.compression())?))
            })
        };
        let Some((column, compression)) = columns.find_map(packed) else { return Ok(()) };
        Err(LogError::file(
            &self.path,
            format!(
                "the column `{}` is packed with {compression}, which is not read\n\
                 hint: write the file with zstd, snappy, gzip, lz4 or no compression; with pyarrow: \
                 `pq.write_table(pq.read_table(IN), OUT, compression=\"zstd\")`",
                error::shown(&column)
            ),
        ))
    }
}

/// The name of a compression that cannot be read.
fn not_built_in(compression: Compression) -> Option<&'static str> {
    match compression {
        Compression::BROTLI(_) => Some("brotli"),
        Compression::LZO => Some("LZO"),
        _ => None,
    }
}

/// Checks that every column chunk lies within the file. The reader takes the places on trust.
fn check_places(path: &Path, length: u64, reader: &SerializedFileReader<File>) -> Result<(), LogError> {
    for (group, metadata) in reader.metadata().row_groups().iter().enumerate() {
        for column in metadata.columns() {
            let start = column.dictionary_page_offset().unwrap_or_else(|| column.data_page_offset());
            let end = start.checked_add(column.compressed_size());
            let inside =
                start >= 0 && column.compressed_size() >= 0 && end.is_some_and(|end| end.unsigned_abs() <= length);
            if !inside || metadata.num_rows() < 0 || column.num_values() < 0 {
                return Err(LogError::cut_or_damaged(
                    path,
                    format!("row group {}", group + 1),
                    format!("column `{}` lies outside the file", error::shown(&column.column_path().string())),
                ));
            }
        }
    }
    Ok(())
}

fn damaged(path: &Path, position: &str, error: &ParquetError) -> LogError {
    LogError::cut_or_damaged(path, position, error)
}

/// A file that begins as Parquet and does not end so.
fn cut(path: &Path, length: u64, error: &ParquetError) -> LogError {
    LogError::file(
        path,
        format!(
            "the file of {length} bytes begins as Parquet and does not end as one ({error})\nhint: it is cut, or what wrote it did not close it: copy or \
             record it again"
        ),
    )
}

/// Name and unit of a column: by its title, by what it holds, or by the end of its name.
fn name_and_unit(title: &str, leaf: &ColumnDescPtr) -> (String, String) {
    let (name, unit) = split_unit(title);
    if !unit.is_empty() {
        return (name, unit);
    }
    let by_name = || Unit::of_name(&name).map(|unit| unit.name);
    let unit = stamp_unit(leaf).or_else(by_name).unwrap_or_default().to_owned();
    (name, unit)
}

/// The unit of a column of time stamps, or of times of the day.
fn stamp_unit(leaf: &ColumnDescPtr) -> Option<&'static str> {
    let unit = match leaf.logical_type_ref() {
        Some(LogicalType::Timestamp(stamp)) => &stamp.unit,
        Some(LogicalType::Time(time)) => &time.unit,
        _ => return (leaf.physical_type() == Physical::INT96).then_some("ns"),
    };
    Some(match unit {
        TimeUnit::MILLIS => "ms",
        TimeUnit::MICROS => "us",
        TimeUnit::NANOS => "ns",
    })
}

/// What a column holds, in a word.
fn kind(leaf: &ColumnDescPtr) -> &'static str {
    match leaf.physical_type() {
        _ if leaf.max_rep_level() > 0 => "lists",
        Physical::BYTE_ARRAY | Physical::FIXED_LEN_BYTE_ARRAY => "text or bytes",
        _ => "numbers of an unknown kind",
    }
}

/// How the numbers of a column are stored.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    /// As they are.
    Plain,
    /// Whole numbers whose highest bit is no sign.
    Unsigned,
    /// Whole numbers that are this many times as large.
    Scaled(f64),
    /// Floating numbers of 16 bits.
    Half,
    /// Days and nanoseconds in 96 bits: ns since 1970.
    Stamp96,
    /// Text of numbers.
    Text,
}

impl Form {
    /// That of a column; none if it does not hold single numbers.
    fn of(leaf: &ColumnDescPtr) -> Option<Self> {
        use ConvertedType::{DECIMAL, UINT_8, UINT_16, UINT_32, UINT_64};
        let (physical, converted) = (leaf.physical_type(), leaf.converted_type());
        if leaf.max_rep_level() > 0 {
            return None;
        }
        match physical {
            Physical::INT32 | Physical::INT64 | Physical::FIXED_LEN_BYTE_ARRAY if converted == DECIMAL => {
                let scale = leaf.type_scale();
                let fits = (0..=38).contains(&scale)
                    && (physical != Physical::FIXED_LEN_BYTE_ARRAY || leaf.type_length() <= 16);
                fits.then(|| Self::Scaled(Real::powi(10.0, scale)))
            }
            Physical::INT32 | Physical::INT64 if [UINT_8, UINT_16, UINT_32, UINT_64].contains(&converted) => {
                Some(Self::Unsigned)
            }
            Physical::BOOLEAN | Physical::INT32 | Physical::INT64 | Physical::FLOAT | Physical::DOUBLE => {
                Some(Self::Plain)
            }
            Physical::INT96 => Some(Self::Stamp96),
            Physical::FIXED_LEN_BYTE_ARRAY => (leaf.logical_type_ref() == Some(&LogicalType::Float16)
                && leaf.type_length() == 2)
                .then_some(Self::Half),
            Physical::BYTE_ARRAY => None,
        }
    }
}

/// The open columns of a row group.
struct OpenGroup {
    time: ColumnReader,
    columns: Vec<ColumnReader>,
    rows_left: u64,
}

/// The row groups of a file.
struct Groups<'a> {
    log: &'a ParquetLog,
    channels: Vec<usize>,
    group: usize,
    open: Option<OpenGroup>,
    midnight: Midnight,
    order: RowOrder,
    without_time: u64,
}

impl Groups<'_> {
    fn open(&self) -> Result<OpenGroup, ParquetError> {
        let group = self.log.reader.get_row_group(self.group)?;
        let rows_left = u64::try_from(group.metadata().num_rows()).unwrap_or(0);
        let reader = |column: usize| {
            let descriptor = group.metadata().schema_descr().column(column);
            let pages = group.get_column_page_reader(column)?;
            let pages = CheckedPages::new(pages, descriptor.clone());
            Ok::<_, ParquetError>(get_column_reader(descriptor, Box::new(pages)))
        };
        let of = |channel: &usize| reader(self.log.columns[*channel].0);
        let columns = self.channels.iter().map(of).collect::<Result<_, _>>()?;
        Ok(OpenGroup { time: reader(self.log.time.0)?, columns, rows_left })
    }

    fn decode(&mut self, open: &mut OpenGroup, block: &mut Block) -> Result<(), ParquetError> {
        let at_once = (NUMBERS / (1 + open.columns.len())).clamp(FEWEST, BATCH);
        let rows = at_once.min(usize::try_from(open.rows_left).unwrap_or(BATCH));
        let first = block.times_s.len();
        let end = first + rows;
        numbers(&mut open.time, self.log.time_form, rows, &mut block.times_s)?;
        for time_s in &mut block.times_s[first..] {
            *time_s = self.log.time.1.of_value(*time_s);
            if self.log.is_of_day && time_s.is_finite() {
                *time_s = self.midnight.unwrap(*time_s);
            }
            self.order.push(*time_s);
        }
        for (reader, column) in open.columns.iter_mut().zip(&mut block.columns) {
            numbers(reader, self.log.columns[column.channel].1, rows, &mut column.values)?;
            if are_finite(&column.values[first..]) {
                column.all_good();
                continue;
            }
            // An absent value, or NaN, is a reading that did not come.
            let of = |value: &f64| match value.is_finite() {
                true => Some(Quality::Good),
                false => (!value.is_nan()).then_some(Quality::Missing),
            };
            let qualities: Vec<_> = column.values[first..].iter().map(of).collect();
            column.qualities_from(first).extend(qualities);
        }
        if block.times_s.len() < end || block.columns.iter().any(|column| column.values.len() < end) {
            return Err(ParquetError::EOF("a column has fewer rows than its group".to_owned()));
        }
        open.rows_left -= rows as u64;
        self.without_time += block.leave_out_without_time(first);
        Ok(())
    }
}

impl Stream for Groups<'_> {
    fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError> {
        let block = batch.block_of(&self.channels);
        let before = block.times_s.len();
        // The decoders of `parquet` 60.1 index and assert on what pages say (byte-stream split, for one), deeper than can be checked
        // before. What they leave behind is not used again: the stream ends here.
        let read = catch_unwind(AssertUnwindSafe(|| self.read(block)));
        let read = read.unwrap_or_else(|_| {
            let place = format!("row group {}", self.group + 1);
            Err(LogError::cut_or_damaged(&self.log.path, place, "the pages of a column contradict themselves"))
        });
        // What is not whole is not given.
        read.inspect_err(|_| block.truncate(before))
    }

    fn max_records(&self) -> usize {
        usize::try_from(self.log.reader.metadata().file_metadata().num_rows()).unwrap_or(0)
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.log.notes.clone();
        if self.without_time > 0 {
            notes.push(format!("{} rows have no time and are left out", self.without_time));
        }
        notes
    }
}

impl Groups<'_> {
    fn read(&mut self, block: &mut Block) -> Result<bool, LogError> {
        let place = format!("row group {}", self.group + 1);
        let mut open = match self.open.take() {
            Some(open) => open,
            None if self.group < self.log.reader.num_row_groups() => {
                self.open().map_err(|error| damaged(&self.log.path, &place, &error))?
            }
            None => return self.order.check(&self.log.path).map(|()| false),
        };
        self.decode(&mut open, block).map_err(|error| damaged(&self.log.path, &place, &error))?;
        if open.rows_left == 0 {
            self.group += 1;
        } else {
            self.open = Some(open);
        }
        Ok(true)
    }
}

/// Appends the next values of a column, and the level of each row; the number of rows.
fn records<D: DataType>(
    column: &mut ColumnReaderImpl<D>,
    rows: usize,
    levels: &mut Vec<i16>,
    values: &mut Vec<D::T>,
) -> Result<usize, ParquetError> {
    let mut got = 0;
    // A call may end with a page.
    while got < rows {
        let (records, ..) = column.read_records(rows - got, Some(levels), None, values)?;
        if records == 0 {
            break;
        }
        got += records;
    }
    Ok(got)
}

/// Appends the next numbers of a column that holds them as they are, without a copy; NaN where there is none.
fn doubles(column: &mut ColumnReaderImpl<DoubleType>, rows: usize, numbers: &mut Vec<f64>) -> Result<(), ParquetError> {
    let (mut levels, first) = (Vec::new(), numbers.len());
    let got = records(column, rows, &mut levels, numbers)?;
    let mut from = numbers.len();
    if from - first == got {
        return Ok(());
    }
    // Where values are absent, their level is below the highest: those that are there go to their rows, the last one first.
    let highest = levels.iter().copied().max().unwrap_or(0);
    numbers.resize(first + levels.len(), f64::NAN);
    for (row, level) in levels.iter().enumerate().rev() {
        let is_there = *level == highest && from > first;
        from -= usize::from(is_there);
        numbers[first + row] = if is_there { numbers[from] } else { f64::NAN };
    }
    Ok(())
}

/// Appends the next numbers of a column; NaN where there is none.
fn numbers(column: &mut ColumnReader, form: Form, rows: usize, numbers: &mut Vec<f64>) -> Result<(), ParquetError> {
    fn read<D: DataType>(
        column: &mut ColumnReaderImpl<D>,
        rows: usize,
        numbers: &mut Vec<f64>,
        number: impl Fn(&D::T) -> f64,
    ) -> Result<(), ParquetError> {
        let (mut levels, mut values) = (Vec::new(), Vec::new());
        let got = records(column, rows, &mut levels, &mut values)?;
        if values.len() == got {
            numbers.extend(values.iter().map(number));
            return Ok(());
        }
        // Where values are absent, their level is below the highest.
        let highest = levels.iter().copied().max().unwrap_or(0);
        let mut values = values.iter();
        let mut next = |level: &i16| if *level == highest { values.next().map(&number) } else { None };
        numbers.extend(levels.iter().map(|level| next(level).unwrap_or(f64::NAN)));
        Ok(())
    }
    match (column, form) {
        (ColumnReader::BoolColumnReader(column), _) => read(column, rows, numbers, |value| f64::from(u8::from(*value))),
        (ColumnReader::Int32ColumnReader(column), Form::Unsigned) => {
            read(column, rows, numbers, |value| f64::from(value.cast_unsigned()))
        }
        (ColumnReader::Int32ColumnReader(column), Form::Scaled(by)) => {
            read(column, rows, numbers, |value| f64::from(*value) / by)
        }
        (ColumnReader::Int32ColumnReader(column), _) => read(column, rows, numbers, |value| f64::from(*value)),
        (ColumnReader::Int64ColumnReader(column), Form::Unsigned) => {
            read(column, rows, numbers, |value| value.cast_unsigned() as f64)
        }
        (ColumnReader::Int64ColumnReader(column), Form::Scaled(by)) => {
            read(column, rows, numbers, |value| *value as f64 / by)
        }
        (ColumnReader::Int64ColumnReader(column), _) => read(column, rows, numbers, |value| *value as f64),
        (ColumnReader::Int96ColumnReader(column), _) => read(column, rows, numbers, stamp96_ns),
        (ColumnReader::FloatColumnReader(column), _) => read(column, rows, numbers, |value| f64::from(*value)),
        (ColumnReader::DoubleColumnReader(column), _) => doubles(column, rows, numbers),
        (ColumnReader::ByteArrayColumnReader(column), Form::Text) => {
            read(column, rows, numbers, |value| text::number_of(value.data()))
        }
        (ColumnReader::FixedLenByteArrayColumnReader(column), Form::Half) => {
            read(column, rows, numbers, |value| match value.data() {
                &[low, high] => f16::from_le_bytes([low, high]).to_f64(),
                _ => f64::NAN,
            })
        }
        (ColumnReader::FixedLenByteArrayColumnReader(column), Form::Scaled(by)) => {
            read(column, rows, numbers, |value| {
                let sign = if value.data().first().is_some_and(|byte| byte >> 7 == 1) { -1 } else { 0 };
                value.data().iter().fold(sign, |number: i128, byte| number << 8 | i128::from(*byte)) as f64 / by
            })
        }
        _ => Err(ParquetError::General("the column does not hold numbers".to_owned())),
    }
}

/// The time of a stamp of 96 bits, which are nanoseconds of a day and a Julian day, ns since 1970.
fn stamp96_ns(stamp: &Int96) -> f64 {
    const DAY_NS: f64 = 86_400e9;
    const JULIAN_DAY_OF_1970: f64 = 2_440_588.0;
    let [low, high, day] = [0, 1, 2].map(|i| stamp.data().get(i).map_or(0.0, |word| f64::from(*word)));
    (day - JULIAN_DAY_OF_1970) * DAY_NS + high * Real::powi(2.0, 32) + low
}
