//! Stacked panels over one axis, drawn as SVG.
//!
//! Series are named in a column at the right, each with a piece of its stroke; phases of the shift are shaded through all
//! panels and named above the first. Margins and heights follow from the names, so that none is cut.

use std::borrow::Cow;

pub use crate::axis::Axis;
use crate::axis::{Scale, decimals, nice_step, ticks};
use crate::drawing::{Anchor, Drawing, Fill, Letters, Pen, TEXT};
use crate::legend::{Entry, Key, LINE, broken, placed, width};
pub use crate::palette::{Stroke, Weight};
use crate::simplified::{simplified, simplified_range};

const WIDTH: f64 = 900.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 10.0;
/// Space below the last panel for the time axis.
const AXIS: f64 = 44.0;
/// Space above the first panel for the names of the phases.
const NAMES: f64 = 24.0;
/// From the panel to the keys of its legend, and from a key to its name.
const GAP: f64 = 8.0;
/// Width of a key of the legend.
const KEY: f64 = 26.0;
/// Width of the ticks of an axis and of the gap to their labels.
const TICKS: f64 = 14.0;
/// Length of a tick.
const MARK: f64 = 5.0;
/// Labels of ticks.
const TICK: Letters = Letters { size: 12, ..Letters::label(TEXT) };
/// Distance of the ticks of a value axis, about, pixels.
const TICK_DISTANCE: f64 = 34.0;
/// Distance from a curve within which its points may be left out, pixels.
const TOLERANCE: f64 = 0.15;
/// Opacity of a shaded range.
const RANGE_OPACITY: f64 = 0.16;
/// Opacity of a span of the common axis.
const SPAN_OPACITY: f64 = 0.45;
const GRID: Pen<'_> = Pen { colour: "#CCCCCC", width: 0.5, dash: None };
const EDGE: Pen<'_> = Pen { colour: "#000000", width: 0.8, dash: None };
/// Colours of the names of spans, and of remarks.
const SPAN_NAME: &str = "#444444";
const REMARK: &str = "#666666";

/// One curve.
#[derive(Debug, Clone)]
pub struct Series {
    /// Its name.
    pub label: String,
    /// How it is drawn.
    pub stroke: Stroke,
    /// Points, by a rising first coordinate; a NaN value is a gap.
    pub points: Vec<(f64, f64)>,
}

/// A shaded range.
#[derive(Debug, Clone)]
pub struct Band {
    /// Its name.
    pub label: String,
    /// Its colour.
    pub colour: &'static str,
    /// Points and lower ends; NaN is a gap.
    pub lower: Vec<(f64, f64)>,
    /// Points and upper ends, at the same points.
    pub upper: Vec<(f64, f64)>,
}

/// One panel.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Quantity and unit.
    pub y_label: String,
    /// Height, pixels, or more if its legend needs that.
    pub height: f64,
    /// The curves, in the order of the legend.
    pub series: Vec<Series>,
    /// Ranges behind them, the widest first.
    pub bands: Vec<Band>,
    /// What the axis shows.
    pub axis: Axis,
}

/// A named span of the common axis.
#[derive(Debug, Clone)]
pub struct Span {
    /// Its name.
    pub label: String,
    /// Start.
    pub start: f64,
    /// End.
    pub end: f64,
    /// Its colour.
    pub colour: &'static str,
}

/// Panels over one axis.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Quantity and unit of the common axis.
    pub x_label: Cow<'static, str>,
    /// First and last value of the common axis.
    pub x_range: (f64, f64),
    /// Shaded spans.
    pub spans: Vec<Span>,
    /// The panels from top to bottom.
    pub panels: Vec<Panel>,
}

/// A panel with its place, what is visible of it, and its axis.
struct Placed<'a> {
    panel: &'a Panel,
    /// Visible points of each series.
    visible: Vec<Vec<(f64, f64)>>,
    /// Visible points of the lower and upper ends of each range.
    ranges: Vec<[Vec<(f64, f64)>; 2]>,
    /// Lowest and highest visible value.
    extremes: Option<(f64, f64)>,
    scale: Scale,
    height: f64,
}

/// Margins that are common to all panels.
struct Margins {
    left: f64,
    right: f64,
}

/// Where a panel lies, and its axes.
struct Frame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    x_range: (f64, f64),
    scale: Scale,
}

impl Figure {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        self.in_shown_units().drawn()
    }

    fn drawn(&self) -> String {
        let panels: Vec<Placed<'_>> = self.panels.iter().map(|panel| self.place(panel)).collect();
        let margins = Margins {
            left: panels.iter().map(Placed::left).fold(0.0, f64::max),
            right: panels.iter().map(Placed::right).fold(0.0, f64::max),
        };
        let names = if self.spans.iter().any(|span| !span.label.is_empty()) { NAMES } else { 0.0 };
        let mut drawing = Drawing::default();
        let mut y = names;
        for (i, panel) in panels.iter().enumerate() {
            self.draw(&mut drawing, panel, &margins, y + TOP, i + 1 == panels.len());
            y += TOP + panel.height + BOTTOM;
        }
        self.name_spans(&mut drawing, &margins);
        drawing.document(WIDTH, y + AXIS)
    }

    fn place<'a>(&self, panel: &'a Panel) -> Placed<'a> {
        let visible: Vec<_> = panel.series.iter().map(|series| self.visible(&series.points)).collect();
        let ends_of = |band: &Band| [&band.lower, &band.upper].map(|ends| self.visible(ends));
        let ranges: Vec<_> = panel.bands.iter().map(ends_of).collect();
        let curves = extremes(visible.iter().flatten());
        let ends = extremes(ranges.iter().flatten().flatten());
        let scale = panel.axis.scale(curves, ends, panel.height / TICK_DISTANCE);
        let tolerance = TOLERANCE * (scale.high - scale.low) / panel.height;
        let visible = visible.iter().map(|points| simplified(points, tolerance)).collect();
        let ranges = ranges.into_iter().map(|ends| simplified_range(ends, tolerance)).collect();
        let extremes = curves.into_iter().chain(ends).reduce(|(a, b), (low, high)| (a.min(low), b.max(high)));
        let mut placed = Placed { panel, visible, ranges, extremes, scale, height: panel.height };
        placed.height = placed.legend(0.0).iter().map(Entry::height).sum::<f64>().max(panel.height);
        placed
    }

    /// The value axis of a panel, and what lies beyond it in words.
    pub(crate) fn scale_and_note(&self, panel: &Panel) -> (Scale, Option<String>) {
        let placed = self.place(panel);
        (placed.scale, placed.scale.beyond(placed.extremes))
    }

    /// The points within the common axis, no closer than half a pixel.
    fn visible(&self, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let (from, to) = self.x_range;
        let closest = 0.5 * (to - from) / WIDTH;
        let mut kept: Vec<(f64, f64)> = Vec::new();
        for &(x, value) in points.iter().filter(|(x, _)| (from..=to).contains(x)) {
            if kept.last().is_none_or(|last| x - last.0 >= closest || last.1.is_finite() != value.is_finite()) {
                kept.push((x, value));
            }
        }
        kept
    }

    /// The phases' names over their middles, moved right where they would touch.
    fn name_spans(&self, drawing: &mut Drawing, margins: &Margins) {
        let (from, to) = self.x_range;
        let mut free = margins.left;
        for span in self.spans.iter().filter(|span| !span.label.is_empty()) {
            let middle = ((span.start + span.end) / 2.0 - from) / (to - from);
            let half = width(&span.label) / 2.0;
            let x = (margins.left + middle * (WIDTH - margins.left - margins.right)).max(free + half);
            drawing.text((x, NAMES - 4.0), &span.label, Anchor::Middle, Letters::label(SPAN_NAME));
            free = x + half + GAP;
        }
    }

    fn draw(&self, drawing: &mut Drawing, placed: &Placed<'_>, margins: &Margins, top: f64, last: bool) {
        let frame = Frame {
            left: margins.left,
            right: WIDTH - margins.right,
            top,
            bottom: top + placed.height,
            x_range: self.x_range,
            scale: placed.scale,
        };
        self.draw_axes(drawing, placed, &frame, last);
        let (from, to) = self.x_range;
        for span in self.spans.iter().filter(|span| span.end > from && span.start < to) {
            let (start, end) = (frame.x(span.start.max(from)), frame.x(span.end.min(to)));
            let fill = Fill { colour: span.colour, opacity: SPAN_OPACITY };
            drawing.rectangle((start, top), (end - start, placed.height), fill);
        }
        placed.draw_curves(drawing, &frame);
        let lines = placed.y_label();
        for (n, line) in lines.iter().enumerate() {
            let x = frame.left - placed.ticks() - LINE * (lines.len() - n) as f64 + 11.0;
            let letters = Letters { upright: true, ..Letters::label(TEXT) };
            drawing.text((x, top + placed.height / 2.0), line, Anchor::Middle, letters);
        }
        for (at, entry) in self::placed(placed.legend(top), top, frame.bottom) {
            draw_entry(drawing, &entry, frame.right + GAP, at);
        }
    }

    /// The grid, the edges with their ticks, and below the last panel the common axis.
    fn draw_axes(&self, drawing: &mut Drawing, placed: &Placed<'_>, frame: &Frame, last: bool) {
        let &Frame { left, right, top, bottom, x_range: (from, to), scale } = frame;
        let x_step = nice_step((to - from) / 7.0);
        let x_ticks = ticks(from, to, x_step);
        let y_ticks = if placed.is_unmarked() { Vec::new() } else { ticks(scale.low, scale.high, scale.step) };
        let upright = x_ticks.iter().map(|&x| [(frame.x(x), top), (frame.x(x), bottom)]);
        let level = y_ticks.iter().map(|&y| [(left, frame.y(y)), (right, frame.y(y))]);
        let grid: Vec<_> = upright.chain(level).collect();
        drawing.lines(grid.iter().map(<[_; 2]>::as_slice), GRID);
        drawing.line(&[(left, top), (left, bottom), (right, bottom)], EDGE);
        let mut marks: Vec<_> = y_ticks.iter().map(|&y| [(left - MARK, frame.y(y)), (left, frame.y(y))]).collect();
        for &y in &y_ticks {
            let place = (left - MARK - 3.0, frame.y(y) + 4.4);
            drawing.text(place, &scale.text(y), Anchor::End, TICK);
        }
        if last {
            marks.extend(x_ticks.iter().map(|&x| [(frame.x(x), bottom), (frame.x(x), bottom + MARK)]));
            for &x in &x_ticks {
                let label = format!("{x:.*}", decimals(x_step));
                drawing.text((frame.x(x), bottom + 17.0), &label, Anchor::Middle, TICK);
            }
            let place = ((left + right) / 2.0, bottom + 36.0);
            drawing.text(place, &self.x_label, Anchor::Middle, Letters::label(TEXT));
        }
        drawing.lines(marks.iter().map(<[_; 2]>::as_slice), EDGE);
    }
}

impl Frame {
    /// Where a value of the common axis stands.
    fn x(&self, value: f64) -> f64 {
        let (from, to) = self.x_range;
        self.left + (value - from) / (to - from) * (self.right - self.left)
    }

    /// Where a value of the panel's axis stands.
    fn y(&self, value: f64) -> f64 {
        let Scale { low, high, .. } = self.scale;
        self.bottom - (value - low) / (high - low) * (self.bottom - self.top)
    }

    fn place(&self, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
        points.iter().map(|&(x, value)| (self.x(x), self.y(value))).collect()
    }
}

impl Placed<'_> {
    /// The ranges, and over them the curves, the strongest last.
    fn draw_curves(&self, drawing: &mut Drawing, frame: &Frame) {
        let Scale { low, high, .. } = self.scale;
        for (band, [lower, upper]) in self.panel.bands.iter().zip(&self.ranges) {
            for (lower, upper) in pieces(lower).into_iter().zip(pieces(upper)) {
                let around: Vec<_> =
                    (upper.iter().chain(lower.iter().rev())).map(|&(x, end)| (x, end.clamp(low, high))).collect();
                drawing.area(&frame.place(&around), Fill { colour: band.colour, opacity: RANGE_OPACITY });
            }
        }
        let mut order: Vec<usize> = (0..self.visible.len()).rev().collect();
        order.sort_by_key(|&n| self.panel.series[n].stroke.weight);
        for n in order {
            let parts: Vec<_> =
                within(&self.visible[n], self.scale.shown()).iter().map(|part| frame.place(part)).collect();
            if !parts.is_empty() {
                drawing.lines(parts.iter().map(Vec::as_slice), self.panel.series[n].stroke.pen());
            }
        }
    }

    /// The entries of the legend of a panel whose upper edge is at `top`.
    fn legend(&self, top: f64) -> Vec<Entry> {
        let Scale { low, high, .. } = self.scale;
        let map = |value: f64| top + (high - value.clamp(low, high)) / (high - low) * self.height;
        let end = |points: &[(f64, f64)]| points.iter().rev().map(|p| p.1).find(|value| value.is_finite()).map(map);
        let series = self.panel.series.iter().zip(&self.visible).filter_map(|(series, points)| {
            end(points).map(|wish| Entry::new(Key::Stroke(series.stroke), &series.label, wish))
        });
        let mut entries: Vec<Entry> = series.collect();
        for (band, [_, upper]) in self.panel.bands.iter().zip(&self.ranges).rev() {
            if upper.iter().any(|(_, value)| value.is_finite()) {
                // Below the curves.
                let wish = entries.iter().map(|entry| entry.wish).fold(top, f64::max);
                entries.push(Entry::new(Key::Range(band.colour), &band.label, wish));
            }
        }
        let remark = self.scale.beyond(self.extremes);
        entries.extend(remark.map(|remark| Entry::new(Key::Remark, &remark, top + self.height)));
        entries
    }

    fn y_label(&self) -> Vec<String> {
        broken(&self.panel.y_label, self.height)
    }

    /// Width of the labels of the ticks.
    fn ticks(&self) -> f64 {
        if self.is_unmarked() {
            return TICKS;
        }
        width(&self.scale.text(self.scale.low)).max(width(&self.scale.text(self.scale.high))) + TICKS
    }

    fn is_unmarked(&self) -> bool {
        matches!(self.panel.axis, Axis::Unmarked(..))
    }

    fn left(&self) -> f64 {
        self.ticks() + LINE * self.y_label().len() as f64 + 4.0
    }

    fn right(&self) -> f64 {
        let widest = self.legend(0.0).iter().map(Entry::width).fold(0.0, f64::max);
        GAP + KEY + GAP + widest + 4.0
    }
}

fn draw_entry(drawing: &mut Drawing, entry: &Entry, x: f64, top: f64) {
    let middle = top + LINE / 2.0;
    match entry.key {
        Key::Stroke(stroke) => drawing.line(&[(x, middle), (x + KEY, middle)], stroke.pen()),
        Key::Range(colour) => {
            drawing.rectangle((x, middle - 5.0), (KEY, 10.0), Fill { colour, opacity: RANGE_OPACITY });
        }
        Key::Remark => {}
    }
    let colour = if entry.key == Key::Remark { REMARK } else { TEXT };
    for (n, line) in entry.lines.iter().enumerate() {
        let y = middle + 4.5 + LINE * n as f64;
        drawing.text((x + KEY + GAP, y), line, Anchor::Start, Letters::label(colour));
    }
}

/// Lowest and highest finite value.
pub(crate) fn extremes<'a>(points: impl Iterator<Item = &'a (f64, f64)>) -> Option<(f64, f64)> {
    let finite = points.map(|point| point.1).filter(|value| value.is_finite());
    finite.map(|value| (value, value)).reduce(|(low, high), (value, _)| (low.min(value), high.max(value)))
}

/// The runs of finite values.
fn pieces(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    points.split(|(_, v)| !v.is_finite()).filter(|piece| piece.len() > 1).map(<[_]>::to_vec).collect()
}

/// The parts of a curve between two values; its lines end where they cross these.
fn within(points: &[(f64, f64)], (low, high): (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let mut parts: Vec<Vec<(f64, f64)>> = Vec::new();
    for line in points.windows(2) {
        let (from, to) = (line[0], line[1]);
        let is_finite = from.1.is_finite() && to.1.is_finite();
        if !is_finite || from.1.max(to.1) < low || from.1.min(to.1) > high {
            continue;
        }
        let cut = |end: (f64, f64)| {
            let value = end.1.clamp(low, high);
            if value == end.1 { end } else { (from.0 + (value - from.1) / (to.1 - from.1) * (to.0 - from.0), value) }
        };
        match parts.last_mut().filter(|part| part.last() == Some(&cut(from))) {
            Some(part) => part.push(cut(to)),
            None => parts.push(vec![cut(from), cut(to)]),
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(label: &str, weight: Weight, points: Vec<(f64, f64)>) -> Series {
        Series { label: label.into(), stroke: Stroke { weight, ..Stroke::SIGNAL }, points }
    }

    fn figure(series: Vec<Series>, axis: Axis) -> Figure {
        let panel = Panel { y_label: "pressure (MPa)".into(), height: 150.0, series, bands: Vec::new(), axis };
        Figure { x_label: "time (s)".into(), x_range: (0.0, 1.0), spans: Vec::new(), panels: vec![panel] }
    }

    #[test]
    fn a_gap_splits_a_curve() {
        assert_eq!(pieces(&[(0.0, 1.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 1.0)]).len(), 2);
    }

    #[test]
    fn a_panel_without_curves_is_drawn() {
        let svg = figure(Vec::new(), Axis::All).svg();
        assert!(svg.contains("pressure (MPa)") && svg.contains(">0.5</text>"), "label and ticks");
        assert!(figure(vec![line("a", Weight::Main, vec![(0.5, f64::NAN)])], Axis::All).svg().ends_with("</svg>"));
    }

    #[test]
    fn names_of_any_length_and_number_stay_within_the_figure() {
        let name = |n: usize| format!("observer {n} of the second supplier with another set of gains, 100 Hz, sensors");
        let series = (0..13).map(|n| line(&name(n), Weight::Rival, vec![(0.0, 0.0), (1.0, 1.0)])).collect();
        let figure = figure(series, Axis::All);
        let placed = figure.place(&figure.panels[0]);
        // Three lines each need more than the 150 pixels asked for.
        assert!(placed.height > 13.0 * 2.0 * LINE);
        for (at, entry) in super::placed(placed.legend(0.0), 0.0, placed.height) {
            assert!(at >= 0.0 && at + entry.height() <= placed.height + 1e-9);
            assert!(entry.width() + KEY + 2.0 * GAP <= placed.right());
        }
        assert!(WIDTH - placed.left() - placed.right() > 0.5 * WIDTH, "the panel keeps most of the width");
    }

    #[test]
    fn the_main_observer_lies_over_its_rivals_and_the_truth_over_it() {
        let along = |value| vec![(0.0, value), (1.0, value)];
        let series = vec![
            line("true", Weight::Truth, along(1.0)),
            line("main", Weight::Main, along(2.0)),
            line("rival", Weight::Rival, along(3.0)),
        ];
        let figure = figure(series, Axis::All);
        let svg = figure.svg();
        let at = |weight: Weight| svg.find(&format!("stroke-width=\"{}\"", weight.width())).unwrap();
        assert!(at(Weight::Rival) < at(Weight::Main) && at(Weight::Main) < at(Weight::Truth), "{svg}");
    }

    #[test]
    fn a_diverged_curve_is_cut_and_the_figure_says_where() {
        let wild = line("sliding", Weight::Rival, vec![(0.0, 0.1), (0.5, -3e10), (1.0, f64::INFINITY)]);
        let truth = line("true", Weight::Truth, vec![(0.0, 0.0), (1.0, 0.3)]);
        let figure = figure(vec![truth, wild], Axis::Within(-0.2, 0.5));
        let svg = figure.svg();
        assert!(svg.contains("axis ends at -0.2"));
        let height: f64 = svg.split("viewBox=\"0 0 900 ").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
        for path in svg.split(" d=\"").skip(1).map(|rest| rest.split('"').next().unwrap()) {
            for point in path.split(['M', 'L', 'Z']).filter(|point| !point.is_empty()) {
                let y: f64 = point.split_once(' ').unwrap().1.parse().unwrap();
                assert!((0.0..height).contains(&y), "a line ends where it leaves the panel: {path}");
            }
        }
    }

    #[test]
    fn a_figure_without_a_length_and_spans_beyond_its_axis_have_finite_places() {
        let span = |start, end| Span { label: "fill".into(), start, end, colour: "#EDEDED" };
        for x_range in [(1.0, 1.0), (0.0, 1.0), (1.0, 0.0), (f64::NAN, f64::NAN), (0.0, f64::INFINITY)] {
            let curve = line("a", Weight::Main, vec![(0.0, 1.0), (1.0, 2.0)]);
            let spans = vec![span(-2.0, -1.0), span(-1.0, 0.5), span(2.0, f64::NAN)];
            let svg = Figure { x_range, spans, ..figure(vec![curve], Axis::All) }.svg();
            assert!(svg.ends_with("</svg>") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            let shaded = svg.matches("fill=\"#EDEDED\"").count();
            assert_eq!(shaded, usize::from(x_range == (0.0, 1.0) || x_range == (0.0, f64::INFINITY)), "{x_range:?}");
        }
    }

    #[test]
    fn a_curve_a_little_beyond_the_end_of_the_axis_is_there() {
        let highest = line("a", Weight::Main, vec![(0.0, 0.0), (0.2, 100.3), (1.0, 100.3)]);
        let figure = figure(vec![highest], Axis::All);
        let panel = figure.place(&figure.panels[0]);
        assert!(panel.scale.high < 100.3, "{:?}", panel.scale);
        let parts = within(&panel.visible[0], panel.scale.shown());
        assert_eq!(parts.iter().map(|part| part.last().copied()).collect::<Vec<_>>(), [Some((1.0, 100.3))]);
    }

    #[test]
    fn a_curve_ends_where_it_leaves_the_panel_and_begins_where_it_comes_back() {
        let points = [(0.0, 1.0), (1.0, 3.0), (2.0, 4.0), (3.0, 0.0), (4.0, f64::NAN), (5.0, 1.0), (6.0, 2.0)];
        let expected = [vec![(0.0, 1.0), (0.5, 2.0)], vec![(2.5, 2.0), (3.0, 0.0)], vec![(5.0, 1.0), (6.0, 2.0)]];
        assert_eq!(within(&points, (0.0, 2.0)), expected);
        // Through the whole panel, along its edge, and beyond it.
        assert_eq!(within(&[(0.0, -1.0), (1.0, 3.0)], (0.0, 2.0)), [[(0.25, 0.0), (0.75, 2.0)]]);
        assert_eq!(within(&[(0.0, 2.0), (1.0, 2.0), (2.0, 2.0)], (0.0, 2.0)), [[(0.0, 2.0), (1.0, 2.0), (2.0, 2.0)]]);
        assert!(
            within(&[(0.0, 3.0), (1.0, 1e300)], (0.0, 2.0)).is_empty() && within(&[(0.0, 1.0)], (0.0, 2.0)).is_empty()
        );
    }
}
