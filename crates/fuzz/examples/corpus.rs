//! Makes the files of `corpus/` that are not text, or too long to write by hand: `cargo run -p fuzz --example corpus`.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use config::{CarFile, write_learnt};
use fuzz::{Depth, Fuzzer};
use study::gearbox::logged::LoggedDrive;
use trace::{Cell, ColumnKind, TableWriter};

fn main() -> Result<(), Box<dyn Error>> {
    let corpus = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("corpus");
    table(&corpus.join("parquet/words_and_nulls.parquet"))?;
    table(&corpus.join("mdf/words.mf4"))?;
    fs::write(corpus.join("blf/unpacked.blf"), blf())?;
    fs::write(corpus.join("table/runs.csv"), Fuzzer::new(Depth::Short)?.table())?;
    let car = CarFile::eight_speed()?;
    let tables = LoggedDrive::tables(&car, None)?;
    let drive = LoggedDrive::new(&car, &tables, None, None);
    fs::write(corpus.join("learnt/nothing_yet.toml"), write_learnt(&car.gearbox, drive.filter.learnt().1))?;
    Ok(())
}

/// A table of numbers, whole numbers and words, some of them absent.
fn table(path: &Path) -> Result<(), Box<dyn Error>> {
    let columns = [
        ("engine_speed_rad_s", ColumnKind::Number),
        ("turbine_speed_rad_s", ColumnKind::Number),
        ("run", ColumnKind::Whole),
        ("health", ColumnKind::Word),
    ];
    let mut writer = TableWriter::create(path, columns)?;
    for row in 0..12_u32 {
        let at = f64::from(row);
        let turbine = if row % 4 == 3 { f64::NAN } else { 140.0 + 0.25 * at };
        let word = if row < 6 { "good" } else { "too_slow" };
        let cells = [Cell::Number(150.0 + at), Cell::Number(turbine), Cell::Whole(row.into()), Cell::Word(word)];
        writer.row(0.01 * at, cells)?;
    }
    Ok(writer.finish()?)
}

/// A BLF file with objects of each kind that holds frames, in a container that is not packed and outside of it.
fn blf() -> Vec<u8> {
    const HEAD: u32 = 144;
    let mut file = b"LOGG".to_vec();
    file.extend(HEAD.to_le_bytes());
    file.resize(HEAD as usize, 0);
    // Bus, flags, length, identifier, data: as `bus.dbc` of the tests of the logs has them.
    let data = [0x80, 0x0c, 0xff, 0x38, 0, 0, 0x64, 0];
    let message = |length: u8| [&[1, 0, 0, length][..], &256_u32.to_le_bytes(), &data].concat();
    let fd = [&[1, 0, 0, 8][..], &256_u32.to_le_bytes(), &[0; 6], &[8, 0, 0, 0, 0, 0], &data].concat();
    let mut fd_64 = vec![1, 8, 8, 0];
    fd_64.extend(256_u32.to_le_bytes());
    fd_64.resize(40, 0);
    fd_64.extend(data);
    // Time in units of 10 us, then of 1 ns.
    let inner = [object(1, 1, 100, &message(8)), object(86, 2, 20_000_000, &message(4))].concat();
    let mut container = vec![0; 16];
    container[8..12].copy_from_slice(&u32::try_from(inner.len()).unwrap_or(0).to_le_bytes());
    container.extend(inner);
    let outer = [&b"LOBJ\x10\0\x01\0"[..], &size(16 + container.len()), &10_u32.to_le_bytes(), &container].concat();
    file.extend(outer);
    file.extend(object(100, 2, 30_000_000, &fd));
    file.extend(object(101, 2, 40_000_000, &fd_64));
    // One that holds no frame.
    file.extend(object(65, 2, 50_000_000, &[0; 16]));
    file
}

fn size(bytes: usize) -> [u8; 4] {
    u32::try_from(bytes).unwrap_or(0).to_le_bytes()
}

/// An object of this kind, at so many units of time.
fn object(kind: u32, unit: u32, stamp: u64, body: &[u8]) -> Vec<u8> {
    const HEAD: usize = 32;
    let mut object = b"LOBJ".to_vec();
    object.extend(32_u16.to_le_bytes());
    object.extend(1_u16.to_le_bytes());
    object.extend(size(HEAD + body.len()));
    object.extend(kind.to_le_bytes());
    object.extend(unit.to_le_bytes());
    object.extend([0; 4]);
    object.extend(stamp.to_le_bytes());
    object.extend(body);
    object
}
