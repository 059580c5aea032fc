//! Lookup tables with linear interpolation.
//!
//! Outside its breakpoints a table keeps its end value: a measured map has no values there, and a linear
//! extrapolation could give a negative torque.

use crate::Real;

/// Most breakpoints a [`Table1`], or the first axis of a [`Table2`], can hold.
pub const MAX_POINTS: usize = 24;
/// Most breakpoints on the second axis of a [`Table2`].
pub const MAX_COLUMNS: usize = 12;

/// Why a table cannot be made from the given numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TableError {
    /// Fewer than two breakpoints.
    TooShort,
    /// More breakpoints than fit; holds the largest number that does.
    TooLong(usize),
    /// Axis and values differ in length: axis, values.
    LengthMismatch(usize, usize),
    /// The axis does not rise at this position (counted from 0).
    NotIncreasing(usize),
    /// A number at this position (counted from 0) is infinite or not a number.
    NotFinite(usize),
}

impl core::fmt::Display for TableError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooShort => write!(f, "a table needs at least two breakpoints"),
            Self::TooLong(max) => write!(f, "a table holds at most {max} breakpoints"),
            Self::LengthMismatch(axis, values) => {
                write!(f, "the axis has {axis} breakpoints, but the table has {values} values")
            }
            Self::NotIncreasing(at) => write!(f, "breakpoint {} is not above the breakpoint before it", at + 1),
            Self::NotFinite(at) => write!(f, "number {} is not finite", at + 1),
        }
    }
}

impl core::error::Error for TableError {}

/// Bins of equal width that an axis is divided into for the search of a segment.
const BINS: usize = 32;
/// By how much of the axis rounding may move a value across the edge of a bin, in single precision.
const BIN_ROUNDING: f64 = 1e-5;

/// Breakpoints of one axis, strictly rising.
///
/// A value is sorted into one of [`BINS`] bins of equal width. Each bin has the segment of its left edge; the segment
/// of the value is this one or one of the next. Much of the simulation's computing time is spent here.
///
/// Every index is bounded by the size of an array and not by `len` alone: an observer's step must hold no panic.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Axis<T, const N: usize> {
    /// Past `len` infinity: no value is beyond it.
    #[cfg_attr(
        feature = "serde",
        serde(with = "serde_big_array::BigArray", bound(deserialize = "T: serde::Deserialize<'de>"))
    )]
    points: [T; N],
    len: usize,
    last: T,
    last_segment: usize,
    first_segment: [u8; BINS],
    bins_per_unit: T,
}

/// Whether these can be the breakpoints of an axis that holds at most `maximum` of them.
///
/// # Errors
/// Too few or too many, not rising, or not finite.
pub fn check_axis<T: Real>(points: &[T], maximum: usize) -> Result<(), TableError> {
    if points.len() < 2 {
        return Err(TableError::TooShort);
    }
    if points.len() > maximum {
        return Err(TableError::TooLong(maximum));
    }
    if let Some(at) = points.iter().position(|x| !x.is_finite()) {
        return Err(TableError::NotFinite(at));
    }
    match points.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(at) => Err(TableError::NotIncreasing(at + 1)),
        None => Ok(()),
    }
}

impl<T: Real, const N: usize> Axis<T, N> {
    fn new(points: &[T]) -> Result<Self, TableError> {
        check_axis(points, N)?;
        let mut held = [T::zero(); N];
        held[..points.len()].copy_from_slice(points);
        Ok(Self::with_bins(held, points.len()))
    }

    /// The axis of these points, which are known to rise.
    fn with_bins(mut points: [T; N], len: usize) -> Self {
        let (first, last) = (points[0], points[len - 1]);
        points[len..].fill(T::infinity());
        let span = last - first;
        let mut axis = Self {
            points,
            len,
            last,
            last_segment: len - 2,
            first_segment: [0; BINS],
            bins_per_unit: T::of(BINS as f64) / span,
        };
        for (bin, segment) in axis.first_segment.iter_mut().enumerate() {
            // A value that is rounded into this bin may be that much below its edge. In the precision of the table: a controller has no other.
            let fraction = T::of(bin as f64) / T::of(BINS as f64) - T::of(BIN_ROUNDING);
            let edge = first + span * fraction;
            let below = points[1..len - 1].iter().filter(|&&point| point <= edge).count();
            *segment = u8::try_from(below).unwrap_or(0);
        }
        axis
    }

    /// The segment that `x` is in, and the nearest value on the axis.
    #[inline]
    fn locate(&self, x: T) -> (usize, T) {
        let (first, last) = (self.points[0], self.last);
        if x <= first {
            return (0, first);
        }
        if x >= last {
            return (self.last_segment.min(N - 2), last);
        }
        // NaN stays NaN.
        let bin = ((x - first) * self.bins_per_unit).whole();
        let mut segment = usize::from(self.first_segment[bin.min(BINS - 1)]).min(N - 2);
        while segment < N - 2 && self.points[segment + 1] <= x {
            segment += 1;
        }
        (segment, x)
    }

    #[inline]
    fn clamp(&self, x: T) -> T {
        let (first, last) = (self.points[0], self.last);
        // NaN stays NaN.
        if x < first {
            first
        } else if x > last {
            last
        } else {
            x
        }
    }

    fn points(&self) -> &[T] {
        &self.points[..self.len]
    }
}

/// A function of one variable given by breakpoints.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Table1<T> {
    axis: Axis<T, MAX_POINTS>,
    values: [T; MAX_POINTS],
    slopes: [T; MAX_POINTS],
}

/// An argument of a table: the segment that it is in, and the value there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place<T> {
    segment: usize,
    /// The value of the table.
    pub value: T,
}

impl<T: Real> Table1<T> {
    /// A table through the points `(axis[i], values[i])`, at most [`MAX_POINTS`] of them.
    ///
    /// # Errors
    /// Lengths that differ, too few or too many points, an axis that does not rise, non-finite numbers.
    pub fn new(axis: &[T], values: &[T]) -> Result<Self, TableError> {
        if axis.len() != values.len() {
            return Err(TableError::LengthMismatch(axis.len(), values.len()));
        }
        if let Some(at) = values.iter().position(|y| !y.is_finite()) {
            return Err(TableError::NotFinite(at));
        }
        let mut held = [T::zero(); MAX_POINTS];
        held.iter_mut().zip(values).for_each(|(held, value)| *held = *value);
        Ok(Self::with_slopes(Axis::new(axis)?, held))
    }

    /// The table of these values, with the slopes that follow from them.
    fn with_slopes(axis: Axis<T, MAX_POINTS>, values: [T; MAX_POINTS]) -> Self {
        let mut slopes = [T::zero(); MAX_POINTS];
        let points = axis.points.windows(2).zip(values.windows(2));
        for (slope, (x, y)) in slopes.iter_mut().zip(points).take(axis.len - 1) {
            *slope = (y[1] - y[0]) / (x[1] - x[0]);
        }
        Self { axis, values, slopes }
    }

    /// The same value everywhere.
    pub fn constant(value: T) -> Self {
        let mut points = [T::zero(); MAX_POINTS];
        points[1] = T::one();
        let axis = Axis::with_bins(points, 2);
        Self { axis, values: [value; MAX_POINTS], slopes: [T::zero(); MAX_POINTS] }
    }

    /// The value at `x`, linear between breakpoints, the end value outside them.
    #[inline]
    pub fn at(&self, x: T) -> T {
        self.place(x).value
    }

    /// The value at `x` and its derivative, which is zero outside the breakpoints.
    #[inline]
    pub fn at_with_slope(&self, x: T) -> (T, T) {
        let (i, within) = self.axis.locate(x);
        let slope = if within == x { self.slopes[i] } else { T::zero() };
        (self.on(i, within), slope)
    }

    /// Every value multiplied by `factor`, on the same axis.
    #[must_use]
    pub fn scaled(mut self, factor: T) -> Self {
        for y in self.values.iter_mut().chain(self.slopes.iter_mut()) {
            *y = *y * factor;
        }
        self
    }

    /// The breakpoints.
    pub fn axis(&self) -> &[T] {
        self.axis.points()
    }

    /// The values at the breakpoints.
    pub fn values(&self) -> &[T] {
        self.values.get(..self.axis.len).unwrap_or_default()
    }

    /// Where an argument is, for [`Self::range_from`].
    #[inline]
    pub fn place(&self, x: T) -> Place<T> {
        let (segment, x) = self.axis.locate(x);
        Place { segment, value: self.on(segment, x) }
    }

    /// The value at an argument on the axis that is in this segment.
    #[inline]
    fn on(&self, segment: usize, x: T) -> T {
        self.values[segment] + self.slopes[segment] * (x - self.axis.points[segment])
    }

    /// Smallest and largest value between two arguments, the first not above the second.
    #[inline]
    pub fn range_within(&self, from: T, to: T) -> (T, T) {
        self.range_from(&self.place(from), to)
    }

    /// Smallest and largest value between an argument and another on either side of it, which mostly is near.
    #[inline]
    pub fn range_from(&self, from: &Place<T>, to: T) -> (T, T) {
        let (points, to) = (&self.axis.points, self.axis.clamp(to));
        let (mut low, mut high) = (from.value, from.value);
        let mut segment = from.segment.min(MAX_POINTS - 2);
        while segment < self.axis.last_segment.min(MAX_POINTS - 2) && points[segment + 1] <= to {
            segment += 1;
            (low, high) = (low.at_most(self.values[segment]), high.at_least(self.values[segment]));
        }
        while segment > 0 && points[segment] > to {
            (low, high) = (low.at_most(self.values[segment]), high.at_least(self.values[segment]));
            segment -= 1;
        }
        let end = self.on(segment, to);
        (low.at_most(end), high.at_least(end))
    }

    /// Smallest and largest value.
    pub fn range(&self) -> (T, T) {
        self.values().iter().fold((self.values[0], self.values[0]), |(lo, hi), &y| (lo.at_most(y), hi.at_least(y)))
    }

    /// The same table in another precision: through the same points, as [`Self::new`] would make it of them.
    pub fn cast<U: Real>(&self) -> Table1<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Table1::with_slopes(Axis::with_bins(self.axis.points.map(to), self.axis.len), self.values.map(to))
    }
}

/// A function of two variables given on a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Table2<T> {
    rows: Axis<T, MAX_POINTS>,
    columns: Axis<T, MAX_COLUMNS>,
    values: [[T; MAX_COLUMNS]; MAX_POINTS],
}

/// Where a value lies on the columns of a [`Table2`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColumnPlace<T> {
    segment: usize,
    /// Fraction of the segment, 0 to 1.
    fraction: T,
}

impl<T: Real> Table2<T> {
    /// A table with `values[i][j]` at `(rows[i], columns[j])`.
    ///
    /// # Errors
    /// As [`Table1::new`], on either axis; every row must have as many values as there are columns.
    pub fn new<R: AsRef<[T]>>(rows: &[T], columns: &[T], values: &[R]) -> Result<Self, TableError> {
        if rows.len() != values.len() {
            return Err(TableError::LengthMismatch(rows.len(), values.len()));
        }
        let mut table = Self {
            rows: Axis::new(rows)?,
            columns: Axis::new(columns)?,
            values: [[T::zero(); MAX_COLUMNS]; MAX_POINTS],
        };
        for (row, given) in table.values.iter_mut().zip(values) {
            let given = given.as_ref();
            if given.len() != columns.len() {
                return Err(TableError::LengthMismatch(columns.len(), given.len()));
            }
            if let Some(at) = given.iter().position(|y| !y.is_finite()) {
                return Err(TableError::NotFinite(at));
            }
            row[..given.len()].copy_from_slice(given);
        }
        Ok(table)
    }

    /// The value at `(row, column)`, bilinear inside the grid, the edge value outside it.
    #[inline]
    pub fn at(&self, row: T, column: T) -> T {
        self.at_place(row, &self.place(column))
    }

    /// Where a value of the column lies, for [`Self::at_place`].
    #[inline]
    pub fn place(&self, column: T) -> ColumnPlace<T> {
        let (j, column) = self.columns.locate(column);
        let fraction = (column - self.columns.points[j]) / (self.columns.points[j + 1] - self.columns.points[j]);
        ColumnPlace { segment: j, fraction }
    }

    /// As [`Self::at`], for many rows at one value of the column.
    #[inline]
    pub fn at_place(&self, row: T, column: &ColumnPlace<T>) -> T {
        let (i, row) = self.rows.locate(row);
        let (j, c) = (column.segment.min(MAX_COLUMNS - 2), column.fraction);
        let r = (row - self.rows.points[i]) / (self.rows.points[i + 1] - self.rows.points[i]);
        let across = |k: usize| self.values[k][j] + c * (self.values[k][j + 1] - self.values[k][j]);
        across(i) + r * (across(i + 1) - across(i))
    }

    /// Every value multiplied by `factor`, on the same grid.
    #[must_use]
    pub fn scaled(mut self, factor: T) -> Self {
        for y in self.values.iter_mut().flatten() {
            *y = *y * factor;
        }
        self
    }

    /// Breakpoints of the rows.
    pub fn rows(&self) -> &[T] {
        self.rows.points()
    }

    /// Breakpoints of the columns.
    pub fn columns(&self) -> &[T] {
        self.columns.points()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_at_breakpoints_are_exact_and_between_them_linear() {
        let table = Table1::new(&[0.0, 1.0, 3.0], &[10.0, 20.0, 0.0]).unwrap();
        assert_eq!([0.0, 1.0, 3.0].map(|x| table.at(x)), [10.0, 20.0, 0.0]);
        assert_eq!(table.at(2.0), 10.0);
    }

    #[test]
    fn a_table_in_single_precision_is_the_one_through_its_points() {
        let table = Table1::new(&[0.1, 0.35, 1.7, 2.0], &[3.3e5, 4.1e5, 2.7e6, 1.9e6]).unwrap().cast::<f32>();
        assert_eq!(Table1::new(table.axis(), table.values()), Ok(table));
    }

    #[test]
    fn outside_the_axis_the_end_value_holds() {
        let table = Table1::new(&[0.0, 1.0, 3.0], &[10.0, 20.0, 0.0]).unwrap();
        assert_eq!((table.at(-5.0), table.at(9.0)), (10.0, 0.0));
    }

    #[test]
    fn a_place_on_the_columns_stands_for_its_value_at_every_row() {
        let table =
            Table2::new(&[0.0, 10.0, 40.0], &[0.0, 0.3, 1.0], &[[1.0, 2.0, 5.0], [0.0, 7.0, 3.0], [4.0, 4.0, 9.0]])
                .unwrap();
        for column in [-1.0, 0.0, 0.2999, 0.3, 0.71, 1.0, 2.0] {
            let place = table.place(column);
            for row in [-5.0, 0.0, 3.3, 10.0, 39.9, 50.0] {
                assert_eq!(table.at_place(row, &place), table.at(row, column), "{row} {column}");
            }
        }
        assert!(table.at_place(5.0, &table.place(f64::NAN)).is_nan());
    }

    #[test]
    fn the_segment_is_found_whatever_the_spacing() {
        let axis = [-3.0_f64, -2.99, -2.98, 0.0, 0.1, 0.100_001, 50.0, 1e4];
        let values = [0.0, 5.0, -5.0, 7.0, 1.0, 2.0, 3.0, -1.0];
        let table = Table1::new(&axis, &values).unwrap();
        for (segment, ends) in axis.windows(2).enumerate() {
            for fraction in [0.0, 1e-9, 0.3, 0.999_999] {
                let x = ends[0] + fraction * (ends[1] - ends[0]);
                let expected = values[segment] + fraction * (values[segment + 1] - values[segment]);
                assert!((table.at(x) - expected).abs() < 1e-6, "at {x}");
            }
        }
    }

    #[test]
    fn the_range_from_an_argument_to_another_on_either_side_holds_all_values_between() {
        let axis = [-1.0_f64, 0.0, 0.3, 0.35, 2.0, 2.1, 5.0];
        let table = Table1::new(&axis, &[0.0, 3.0, -2.0, 4.0, 1.0, -5.0, 6.0]).unwrap();
        let ends = [-2.0, -1.0, -0.4, 0.0, 0.1, 0.3, 0.32, 0.35, 1.7, 2.05, 2.1, 4.0, 5.0, 9.0];
        for from in ends {
            for to in ends {
                let (low, high) = table.range_from(&table.place(from), to);
                let (minimum, maximum) = (from.min(to), from.max(to));
                let between = axis.into_iter().filter(|x| (minimum..=maximum).contains(x)).chain([from, to]);
                let values = between.map(|x| table.at(x));
                let expected =
                    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], y| [low.min(y), high.max(y)]);
                assert!((low - expected[0]).abs() < 1e-12 && (high - expected[1]).abs() < 1e-12, "{from} {to}");
                assert_eq!(table.range_within(minimum, maximum), table.range_from(&table.place(minimum), maximum));
            }
        }
    }

    #[test]
    fn a_grid_is_bilinear_and_holds_its_edges() {
        let table = Table2::new(&[0.0, 1.0], &[0.0, 2.0], &[[0.0, 2.0], [10.0, 12.0]]).unwrap();
        assert_eq!(table.at(0.5, 1.0), 6.0);
        assert_eq!(table.at(-1.0, 5.0), 2.0);
    }

    #[test]
    fn a_malformed_table_is_refused_with_its_reason() {
        assert_eq!(Table1::new(&[0.0], &[0.0]), Err(TableError::TooShort));
        assert_eq!(Table1::new(&[0.0, 0.0], &[0.0, 1.0]), Err(TableError::NotIncreasing(1)));
        assert_eq!(Table1::new(&[0.0, 1.0], &[0.0]), Err(TableError::LengthMismatch(2, 1)));
        assert_eq!(Table1::new(&[0.0, 1.0], &[0.0, f64::NAN]), Err(TableError::NotFinite(1)));
        assert_eq!(Table1::new(&[0.0; 99], &[0.0; 99]), Err(TableError::TooLong(MAX_POINTS)));
    }
}
