//! Where shafts, sets, gear pairs and elements stand.

use geartrain::Member;
use geartrain::{Connection, GearTrain, Planets};

use super::MARGIN;
use super::canvas::text_width;

/// Distance between two shafts.
pub(super) const ROW: f64 = 46.0;
/// Height above the first shaft, for the heads of the columns.
const HEAD: f64 = 44.0;
/// From a vertical line to the label at its right.
pub(super) const LABEL: f64 = 9.0;
/// Free space between a label and the next column.
const SPACE: f64 = 20.0;
/// Width of the arrows at input and output.
pub(super) const ARROW: f64 = 56.0;

/// A vertical line of the diagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Column {
    /// A planetary set.
    Set(usize),
    /// A gear pair with its dog.
    Pair(usize),
    /// An element between two members.
    Element(usize),
}

/// Places of rows and columns.
pub(super) struct Layout {
    /// Row of each shaft.
    rows: Vec<usize>,
    /// The columns with their places.
    pub(super) columns: Vec<(Column, f64)>,
    /// Where the shafts begin.
    pub(super) left: f64,
    /// Where they end.
    pub(super) right: f64,
    top: f64,
}

impl Layout {
    /// The layout of a train below `top`, with or without room for the torques of engaged elements.
    pub(super) fn new(train: &GearTrain, top: f64, with_torques: bool) -> Self {
        let names = train.shafts.iter().map(|shaft| shaft.name.as_str()).chain([geartrain::HOUSING]);
        let widest = names.map(|name| text_width(name, false)).fold(0.0, f64::max);
        let left = MARGIN + ARROW + widest + 8.0;
        let sets = (0..train.sets.len()).map(Column::Set);
        let pairs = (0..train.pairs.len()).map(Column::Pair);
        let elements = (train.elements.iter().enumerate())
            .filter(|(_, element)| matches!(element.connection, Connection::Sides(..)))
            .map(|(at, _)| Column::Element(at));
        let mut x = left + SPACE;
        let mut columns = Vec::new();
        for column in sets.chain(pairs).chain(elements) {
            columns.push((column, x));
            let label = labels(train, column).iter().map(|label| text_width(label, true)).fold(0.0, f64::max);
            let torque =
                if with_torques && !matches!(column, Column::Set(_)) { text_width("-0.000", true) } else { 0.0 };
            x += LABEL + label.max(torque) + SPACE;
        }
        let mut layout = Self { rows: rows(train, &columns), columns, left, right: x, top: top + HEAD };
        layout.right = layout.right.max(layout.left + 60.0);
        layout
    }

    /// Height of a member.
    pub(super) fn y(&self, member: Member) -> f64 {
        let row = match member {
            Member::Housing => self.rows.len(),
            Member::Shaft(shaft) => self.rows[shaft],
        };

        self.top + ROW * row as f64
    }

    /// Lower edge, below the housing.
    pub(super) fn bottom(&self) -> f64 {
        self.y(Member::Housing) + 16.0
    }

    /// Base line of the heads of the columns.
    pub(super) fn head(&self) -> f64 {
        self.top - 32.0
    }
}

/// The members that a column joins.
pub(super) fn members(train: &GearTrain, column: Column) -> Vec<Member> {
    match column {
        Column::Set(at) => {
            let set = &train.sets[at];
            vec![set.sun, set.carrier, set.ring]
        }
        Column::Pair(at) => [train.pairs[at].driver, train.pairs[at].driven].map(Member::Shaft).to_vec(),
        Column::Element(at) => match train.elements[at].connection {
            Connection::Sides(input, output) => vec![input, output],
            Connection::Pair(_) => Vec::new(),
        },
    }
}

/// The texts at the right of a column: the head first, then those of its members in the order of [`members`].
pub(super) fn labels(train: &GearTrain, column: Column) -> Vec<String> {
    match column {
        Column::Set(at) => {
            let set = &train.sets[at];
            let planets = if set.planets == Planets::Double { ", double" } else { "" };
            let head = format!("set {}{planets}", at + 1);
            vec![head, format!("sun {}", set.sun_teeth), "carrier".to_owned(), format!("ring {}", set.ring_teeth)]
        }
        Column::Pair(at) => {
            let pair = &train.pairs[at];
            let idler = if pair.idler { ", idler" } else { "" };
            let head = pair.dog.clone().unwrap_or_default();
            vec![head, format!("{}{idler}", pair.driver_teeth), pair.driven_teeth.to_string()]
        }
        Column::Element(at) => vec![train.elements[at].name.clone()],
    }
}

/// Rows of the shafts with short vertical lines: the input on top, then exchanges of two rows as long as they help.
fn rows(train: &GearTrain, columns: &[(Column, f64)]) -> Vec<usize> {
    let housing = train.shafts.len();
    let joined: Vec<Vec<usize>> = (columns.iter())
        .map(|(column, _)| {
            let row = |member: Member| if let Member::Shaft(shaft) = member { shaft } else { housing };
            members(train, *column).into_iter().map(row).collect()
        })
        .collect();
    let length = |rows: &[usize]| -> usize {
        let span = |members: &Vec<usize>| {
            let at = || members.iter().map(|&member| rows.get(member).copied().unwrap_or(housing));
            at().max().unwrap_or(0) - at().min().unwrap_or(0)
        };
        joined.iter().map(span).sum()
    };
    // Of two shafts that are equally good, the order of the file stays.
    let mut rows: Vec<usize> = (0..housing).collect();
    let first = train.input;
    rows.iter_mut().take(first).for_each(|row| *row += 1);
    if let Some(row) = rows.get_mut(first) {
        *row = 0;
    }
    let mut best = length(&rows);
    loop {
        let before = best;
        for (a, b) in (0..housing).flat_map(|a| (a + 1..housing).map(move |b| (a, b))) {
            if a == first || b == first {
                continue;
            }
            rows.swap(a, b);
            let now = length(&rows);
            if now < best {
                best = now;
            } else {
                rows.swap(a, b);
            }
        }
        if best == before {
            return rows;
        }
    }
}
