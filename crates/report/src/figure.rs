//! Stacked panels over one axis, drawn as SVG.
//!
//! Series are named in a column at the right, each with a piece of its stroke; phases of the shift are shaded through all
//! panels and named above the first. Margins and heights follow from the names, so that none is cut.

use std::borrow::Cow;
use std::sync::Arc;

use kuva::backend::svg::SvgBackend;
use kuva::plot::line::LinePlot;
use kuva::plot::{BandPlot, LineStyle};
use kuva::render::annotations::ShadedRegion;
use kuva::render::color::Color;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::{Primitive, Scene, TextAnchor, render_multiple};

pub use crate::axis::Axis;
use crate::axis::{Scale, decimals, nice_step};
use crate::legend::{Entry, Key, LABEL_SIZE, LINE, broken, placed, width};
pub use crate::palette::{Stroke, Weight};
use crate::simplified::{simplified, simplified_range};
use crate::svg_text::numbered;

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
const TICK_SIZE: u32 = 12;
/// Distance of the ticks of a value axis, about, pixels.
const TICK_DISTANCE: f64 = 34.0;
/// Distance from a curve within which its points may be left out, pixels.
const TOLERANCE: f64 = 0.15;
/// Opacity of a shaded range.
const RANGE_OPACITY: f64 = 0.16;
pub(crate) const TEXT: &str = "#222222";
pub(crate) const FONT: &str = "Helvetica, Arial, 'Liberation Sans', sans-serif";

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

impl Figure {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        numbered(&self.drawing())
    }

    /// The same with clip paths that no other figure of this process has: a part of a page, which numbers them ([`numbered`]).
    pub(crate) fn drawing(&self) -> String {
        self.in_shown_units().drawn()
    }

    fn drawn(&self) -> String {
        let panels: Vec<Placed<'_>> = self.panels.iter().map(|panel| self.place(panel)).collect();
        let margins = Margins {
            left: panels.iter().map(Placed::left).fold(0.0, f64::max),
            right: panels.iter().map(Placed::right).fold(0.0, f64::max),
        };
        let whole = |panel: &Placed<'_>| panel.height + TOP + BOTTOM;
        let names = if self.spans.iter().any(|span| !span.label.is_empty()) { NAMES } else { 0.0 };
        let height = names + panels.iter().map(whole).sum::<f64>() + AXIS;
        let mut scene = Scene::new(WIDTH, height);
        scene.font_family = Some(FONT.to_owned());
        let mut y = names;
        for (i, panel) in panels.iter().enumerate() {
            self.draw(&mut scene, panel, &margins, y, i + 1 == panels.len());
            y += whole(panel);
        }
        self.name_spans(&mut scene, &margins);
        document(&scene)
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
    fn name_spans(&self, scene: &mut Scene, margins: &Margins) {
        let (from, to) = self.x_range;
        let mut free = margins.left;
        for span in self.spans.iter().filter(|span| !span.label.is_empty()) {
            let middle = ((span.start + span.end) / 2.0 - from) / (to - from);
            let half = width(&span.label) / 2.0;
            let x = (margins.left + middle * (WIDTH - margins.left - margins.right)).max(free + half);
            scene.add(text(x, NAMES - 4.0, &span.label, "#444444", TextAnchor::Middle));
            free = x + half + GAP;
        }
    }

    fn draw(&self, scene: &mut Scene, placed: &Placed<'_>, margins: &Margins, y: f64, last: bool) {
        let bottom = if last { AXIS } else { BOTTOM };
        let panel_scene = render_multiple(placed.plots(), self.layout(placed, margins, bottom, last));
        scene.add(Primitive::GroupStart {
            transform: Some(format!("translate(0,{y})")),
            title: None,
            extra_attrs: None,
        });
        scene.elements.extend(panel_scene.elements);
        scene.defs.extend(panel_scene.defs);
        scene.add(Primitive::GroupEnd);

        let lines = placed.y_label();
        for (n, line) in lines.iter().enumerate() {
            let x = margins.left - placed.ticks() - LINE * (lines.len() - n) as f64 + 11.0;
            scene.add(Primitive::Text {
                x,
                y: y + TOP + placed.height / 2.0,
                content: line.clone(),
                size: LABEL_SIZE,
                anchor: TextAnchor::Middle,
                rotate: Some(-90.0),
                bold: false,
                color: Some(Color::from(TEXT)),
            });
        }
        if last {
            let middle = (margins.left + WIDTH - margins.right) / 2.0;
            scene.add(text(middle, y + TOP + placed.height + 36.0, &self.x_label, TEXT, TextAnchor::Middle));
        }
        let top = y + TOP;
        for (at, entry) in self::placed(placed.legend(top), top, top + placed.height) {
            draw_entry(scene, &entry, WIDTH - margins.right + GAP, at);
        }
    }

    fn layout(&self, placed: &Placed<'_>, margins: &Margins, bottom: f64, last: bool) -> Layout {
        let (from, to) = self.x_range;
        let x_step = nice_step((to - from) / 7.0);
        let scale = placed.scale;
        let mut layout = Layout::new((from, to), (scale.low, scale.high))
            .with_width(WIDTH)
            .with_height(TOP + placed.height + bottom)
            .with_force_margins(margins.left, margins.right)
            .with_force_margins_y(TOP, bottom)
            .with_x_axis_min(from)
            .with_x_axis_max(to)
            .with_y_axis_min(scale.low)
            .with_y_axis_max(scale.high)
            .with_y_tick_step(scale.step)
            .with_x_tick_step(x_step)
            .with_x_tick_format(TickFormat::Fixed(decimals(x_step)))
            .with_y_tick_format(TickFormat::Custom(Arc::new(move |value| scale.text(value))))
            .with_tick_size(TICK_SIZE)
            .with_label_size(LABEL_SIZE)
            .with_grid_line_width(0.5)
            .with_axis_line_width(0.8);
        if placed.is_unmarked() {
            layout = layout.with_y_tick_format(TickFormat::Custom(Arc::new(|_| String::new())));
        }
        layout.suppress_x_ticks = !last;
        layout.show_legend = false;
        for span in &self.spans {
            let (start, end) = (span.start.max(from), span.end.min(to));
            layout = layout
                .with_shaded_region(ShadedRegion::vertical(start, end).with_color(span.colour).with_opacity(0.45));
        }
        layout
    }
}

impl Placed<'_> {
    fn plots(&self) -> Vec<Plot> {
        let Scale { low, high, .. } = self.scale;
        // Without any plot there would be no axes.
        let mut plots = vec![Plot::Line(LinePlot::new())];
        for (band, [lower, upper]) in self.panel.bands.iter().zip(&self.ranges) {
            for (lower, upper) in pieces(lower).into_iter().zip(pieces(upper)) {
                let clamped = |ends: &[(f64, f64)]| ends.iter().map(|p| p.1.clamp(low, high)).collect::<Vec<_>>();
                plots.push(Plot::Band(
                    BandPlot::new(lower.iter().map(|p| p.0), clamped(&lower), clamped(&upper))
                        .with_color(band.colour)
                        .with_opacity(RANGE_OPACITY),
                ));
            }
        }
        let mut order: Vec<usize> = (0..self.visible.len()).rev().collect();
        order.sort_by_key(|&n| self.panel.series[n].stroke.weight);
        // Coordinates of a diverged curve would be beyond what a viewer can draw; the panel's edge cuts these as well.
        let far = |value: f64| value.clamp(low - (high - low), high + (high - low));
        for n in order {
            let Stroke { colour, weight, dash } = self.panel.series[n].stroke;
            let style = dash.map_or(LineStyle::Solid, |dash| LineStyle::Custom(dash.into()));
            for piece in pieces(&self.visible[n]) {
                let data = piece.into_iter().map(|(x, value)| (x, far(value)));
                let line = LinePlot::new().with_data(data).with_color(colour).with_line_style(style.clone());
                plots.push(Plot::Line(line.with_stroke_width(weight.width())));
            }
        }
        plots
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

/// The scene as an SVG document that scales with the page around it.
pub(crate) fn document(scene: &Scene) -> String {
    let svg = SvgBackend::new().render_scene(scene);
    svg.replacen("<svg ", &format!("<svg viewBox=\"0 0 {} {}\" ", scene.width, scene.height), 1)
}

fn draw_entry(scene: &mut Scene, entry: &Entry, x: f64, top: f64) {
    let middle = top + LINE / 2.0;
    match entry.key {
        Key::Stroke(stroke) => scene.add(Primitive::Line {
            x1: x,
            y1: middle,
            x2: x + KEY,
            y2: middle,
            stroke: Color::from(stroke.colour),
            stroke_width: stroke.weight.width(),
            stroke_dasharray: stroke.dash.map(str::to_owned),
        }),
        Key::Range(colour) => scene.add(Primitive::Rect {
            x,
            y: middle - 5.0,
            width: KEY,
            height: 10.0,
            fill: Color::from(colour),
            stroke: None,
            stroke_width: None,
            opacity: Some(RANGE_OPACITY),
        }),
        Key::Remark => {}
    }
    let colour = if entry.key == Key::Remark { "#666666" } else { TEXT };
    for (n, line) in entry.lines.iter().enumerate() {
        let y = middle + 4.5 + LINE * n as f64;
        scene.add(text(x + KEY + GAP, y, line, colour, TextAnchor::Start));
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

fn text(x: f64, y: f64, content: &str, colour: &str, anchor: TextAnchor) -> Primitive {
    Primitive::Text {
        x,
        y,
        content: content.to_owned(),
        size: LABEL_SIZE,
        anchor,
        rotate: None,
        bold: false,
        color: Some(Color::from(colour)),
    }
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
        let widths: Vec<f64> = (figure.place(&figure.panels[0]).plots().into_iter().skip(1))
            .map(|plot| if let Plot::Line(line) = plot { line.stroke_width } else { f64::NAN })
            .collect();
        assert_eq!(widths, [Weight::Rival, Weight::Main, Weight::Truth].map(Weight::width));
    }

    #[test]
    fn a_diverged_curve_is_cut_and_the_figure_says_where() {
        let wild = line("sliding", Weight::Rival, vec![(0.0, 0.1), (0.5, -3e10), (1.0, f64::INFINITY)]);
        let truth = line("true", Weight::Truth, vec![(0.0, 0.0), (1.0, 0.3)]);
        let figure = figure(vec![truth, wild], Axis::Within(-0.2, 0.5));
        assert!(figure.svg().contains("axis ends at -0.2"));
        for plot in figure.place(&figure.panels[0]).plots() {
            let Plot::Line(line) = plot else { continue };
            assert!(line.data.iter().all(|point| (-1.0..1.0).contains(&point.y)), "coordinates that a viewer can draw");
        }
    }
}
