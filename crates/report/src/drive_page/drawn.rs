//! A drive for a page that is drawn anew with every change of a setting.

use car::Car;
use serde::Serialize;
use study::gearbox::drive::{ScoredDrive, ScoredShift};

use super::figures::{overview_figure, shift_figure};
use super::shifts::{filled_columns, rows_of};
use super::{clutch_words, title};

/// The figures of a drive, each as the script of the pages reads it, and the table of its shifts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drawn {
    /// The whole drive.
    pub overview: String,
    /// Quantities of which the drive has no value.
    pub missing: Vec<String>,
    /// The shifts of which the rows are kept.
    pub shifts: Vec<DrawnShift>,
    /// Title and meaning of each column of the table.
    pub columns: Vec<[&'static str; 2]>,
    /// The rows of the table.
    pub rows: Vec<Vec<String>>,
}

/// A shift that is drawn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DrawnShift {
    /// Its number, from 1.
    pub number: usize,
    /// Its gears and its kind.
    pub title: String,
    /// What its clutches do.
    pub clutches: String,
    /// Its figure.
    pub figure: String,
}

/// The figures and the table of a drive.
pub fn drawn(drive: &ScoredDrive, car: &Car) -> Drawn {
    let (overview, missing) = overview_figure(drive, car);
    let one = |shift: &ScoredShift| DrawnShift {
        number: shift.number,
        title: title(shift, car),
        clutches: clutch_words(shift, car),
        figure: shift_figure(shift, drive, car).json(),
    };
    let columns = filled_columns(drive, car);
    Drawn {
        overview: overview.json(),
        missing,
        shifts: drive.shifts.iter().filter(|shift| shift.is_drawn).map(one).collect(),
        columns: columns.iter().map(|column| [column.title, column.meaning]).collect(),
        rows: rows_of(&columns, drive, car).1,
    }
}
