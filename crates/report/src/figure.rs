//! Stacked panels over one axis, drawn as SVG.
//!
//! Series are labelled directly at their right end, in their own colour, and moved apart where they
//! would overlap; phases of the shift are shaded through all panels and named above the first.

use kuva::backend::svg::SvgBackend;
use kuva::plot::line::LinePlot;
use kuva::plot::{BandPlot, LineStyle};
use kuva::render::annotations::ShadedRegion;
use kuva::render::color::Color;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::{Primitive, Scene, TextAnchor, render_multiple};

/// Colours of Okabe and Ito, which remain distinct for colour-blind readers.
pub mod colour {
    /// Truth.
    pub const BLACK: &str = "#000000";
    /// The estimate of main interest.
    pub const BLUE: &str = "#0072B2";
    /// The open loop.
    pub const VERMILION: &str = "#D55E00";
    /// A third quantity.
    pub const GREEN: &str = "#009E73";
    /// A fourth quantity.
    pub const PURPLE: &str = "#AA4499";
    /// A fifth quantity.
    pub const ORANGE: &str = "#C98A00";
    /// A sixth quantity.
    pub const SKY: &str = "#3F9FD0";
    /// A seventh quantity.
    pub const GREY: &str = "#777777";
    /// An eighth quantity.
    pub const BROWN: &str = "#7A4A21";
    /// A ninth quantity.
    pub const PINK: &str = "#E0569A";
    /// A tenth quantity.
    pub const OLIVE: &str = "#5E6B1E";
}

const WIDTH: f64 = 900.0;
const LEFT: f64 = 74.0;
const RIGHT: f64 = 176.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 10.0;
/// Space below the last panel for the time axis.
const AXIS: f64 = 44.0;
/// Space above the first panel for the names of the phases.
const NAMES: f64 = 24.0;
const LABEL_SIZE: u32 = 13;
const TICK_SIZE: u32 = 12;
const FONT: &str = "Helvetica, Arial, 'Liberation Sans', sans-serif";

/// One curve.
#[derive(Debug, Clone)]
pub struct Series {
    /// Its name, written at its right end.
    pub label: String,
    /// Its colour.
    pub colour: &'static str,
    /// Whether it is drawn dashed.
    pub dashed: bool,
    /// Points, by a rising first coordinate; a NaN value is a gap.
    pub points: Vec<(f64, f64)>,
}

/// A shaded range.
#[derive(Debug, Clone)]
pub struct Band {
    /// Its name, written below its upper end.
    pub label: String,
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
    /// Height, pixels.
    pub height: f64,
    /// The curves.
    pub series: Vec<Series>,
    /// A range behind them.
    pub band: Option<Band>,
    /// Smallest and largest value shown, if not to follow from the curves.
    pub y_range: Option<(f64, f64)>,
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
    pub x_label: &'static str,
    /// First and last value of the common axis.
    pub x_range: (f64, f64),
    /// Shaded spans.
    pub spans: Vec<Span>,
    /// The panels from top to bottom.
    pub panels: Vec<Panel>,
}

impl Figure {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let panel_height = |panel: &Panel| panel.height + TOP + BOTTOM;
        let height = NAMES + self.panels.iter().map(panel_height).sum::<f64>() + AXIS;
        let mut scene = Scene::new(WIDTH, height);
        scene.font_family = Some(FONT.to_owned());
        let mut y = NAMES;
        for (i, panel) in self.panels.iter().enumerate() {
            let last = i + 1 == self.panels.len();
            self.draw(&mut scene, panel, y, last);
            y += panel_height(panel);
        }
        for span in &self.spans {
            scene.add(text(
                self.x((span.start + span.end) / 2.0),
                NAMES - 4.0,
                &span.label,
                "#444444",
                TextAnchor::Middle,
            ));
        }
        let svg = SvgBackend::new().render_scene(&scene);
        // A view box lets the figure scale with the page around it.
        svg.replacen("<svg ", &format!("<svg viewBox=\"0 0 {WIDTH} {height}\" "), 1)
    }

    fn x(&self, value: f64) -> f64 {
        let (from, to) = self.x_range;
        LEFT + (value - from) / (to - from) * (WIDTH - LEFT - RIGHT)
    }

    fn draw(&self, scene: &mut Scene, panel: &Panel, y: f64, last: bool) {
        let (from, to) = self.x_range;
        let visible = |points: &[(f64, f64)]| thinned(points, from, to);
        let (low, high, step) = panel.y_axis(from, to);
        let bottom = if last { AXIS } else { BOTTOM };
        let whole = TOP + panel.height + bottom;
        let map_y = |value: f64| y + TOP + (high - value) / (high - low) * panel.height;

        let mut plots = Vec::new();
        if let Some(band) = &panel.band {
            let ends = pieces(&visible(&band.lower)).into_iter().zip(pieces(&visible(&band.upper)));
            for (lower, upper) in ends {
                let clamp = |v: f64| v.clamp(low, high);
                plots.push(Plot::Band(
                    BandPlot::new(
                        lower.iter().map(|p| p.0),
                        lower.iter().map(|p| clamp(p.1)),
                        upper.iter().map(|p| clamp(p.1)),
                    )
                    .with_color(colour::BLUE)
                    .with_opacity(0.13),
                ));
            }
        }
        let labels = panel.series.iter().filter_map(|series| {
            let last = visible(&series.points).into_iter().rev().map(|p| p.1).find(|v| v.is_finite());
            last.map(|value| (map_y(value.clamp(low, high)), series))
        });
        // The first series lies on top.
        for series in panel.series.iter().rev() {
            for piece in pieces(&visible(&series.points)) {
                let style = if series.dashed { LineStyle::Custom("6 3".into()) } else { LineStyle::Solid };
                let line = LinePlot::new().with_data(piece).with_color(series.colour).with_line_style(style);
                plots.push(Plot::Line(line.with_stroke_width(1.7)));
            }
        }

        let x_step = nice_step((to - from) / 7.0);
        let mut layout = Layout::auto_from_plots(&plots)
            .with_width(WIDTH)
            .with_height(whole)
            .with_force_margins(LEFT, RIGHT)
            .with_force_margins_y(TOP, bottom)
            .with_x_axis_min(from)
            .with_x_axis_max(to)
            .with_y_axis_min(low)
            .with_y_axis_max(high)
            .with_y_tick_step(step)
            .with_x_tick_step(x_step)
            .with_x_tick_format(TickFormat::Fixed(decimals(x_step)))
            .with_y_tick_format(TickFormat::Fixed(decimals(step)))
            .with_tick_size(TICK_SIZE)
            .with_label_size(LABEL_SIZE)
            .with_grid_line_width(0.5)
            .with_axis_line_width(0.8);
        layout.suppress_x_ticks = !last;
        layout.show_legend = false;
        for span in &self.spans {
            let (start, end) = (span.start.max(from), span.end.min(to));
            layout = layout
                .with_shaded_region(ShadedRegion::vertical(start, end).with_color(span.colour).with_opacity(0.35));
        }
        let panel_scene = render_multiple(plots, layout);
        scene.add(Primitive::GroupStart {
            transform: Some(format!("translate(0,{y})")),
            title: None,
            extra_attrs: None,
        });
        scene.elements.extend(panel_scene.elements);
        scene.defs.extend(panel_scene.defs);
        scene.add(Primitive::GroupEnd);

        scene.add(Primitive::Text {
            x: 16.0,
            y: y + TOP + panel.height / 2.0,
            content: panel.y_label.clone(),
            size: LABEL_SIZE,
            anchor: TextAnchor::Middle,
            rotate: Some(-90.0),
            bold: false,
            color: Some(Color::from("#000000")),
        });
        if last {
            let middle = LEFT + (WIDTH - LEFT - RIGHT) / 2.0;
            scene.add(text(middle, y + TOP + panel.height + 36.0, self.x_label, "#000000", TextAnchor::Middle));
        }
        let inside = (y + TOP + 4.0, y + TOP + panel.height - 2.0);
        for (label_y, series) in spread(labels.collect(), f64::from(LABEL_SIZE) + 2.0, inside) {
            scene.add(text(WIDTH - RIGHT + 7.0, label_y + 4.0, &series.label, series.colour, TextAnchor::Start));
        }
        if let Some(band) = &panel.band
            && let Some((time, end)) = visible(&band.upper).into_iter().rev().find(|(_, end)| end.is_finite())
        {
            let at = map_y(end.min(high)) + 14.0;
            scene.add(text(self.x(time) - 6.0, at, &band.label, colour::BLUE, TextAnchor::End));
        }
    }
}

impl Panel {
    /// The panel with this range of values.
    #[must_use]
    pub fn within(self, low: f64, high: f64) -> Self {
        Self { y_range: Some((low, high)), ..self }
    }

    /// Lowest and highest value of the axis and the distance of its ticks.
    fn y_axis(&self, from: f64, to: f64) -> (f64, f64, f64) {
        let step_of = |low: f64, high: f64| nice_step((high - low) / (self.height / 34.0));
        if let Some((low, high)) = self.y_range {
            return (low, high, step_of(low, high));
        }
        let (low, high) = {
            let values = self.series.iter().flat_map(|series| &series.points);
            values
                .filter(|(t, v)| (from..=to).contains(t) && v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, v)| (low.min(*v), high.max(*v)))
        };
        let (low, high) = if low < high { (low, high) } else { (low.min(0.0) - 1.0, high.max(0.0) + 1.0) };
        let step = step_of(low, high);
        ((low / step - 0.02).floor() * step, (high / step + 0.02).ceil() * step, step)
    }
}

/// The next larger number of the form 1, 2 or 5 times a power of ten.
fn nice_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|&step| step >= least * 0.999).unwrap_or(least)
}

/// Decimals that tell multiples of a step apart.
fn decimals(step: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a small count")]
    let digits = (-(step * 1.001).log10().floor()).clamp(0.0, 6.0) as usize;
    digits
}

/// The points within a range, no closer than half a pixel.
fn thinned(points: &[(f64, f64)], from: f64, to: f64) -> Vec<(f64, f64)> {
    let closest = 0.5 * (to - from) / (WIDTH - LEFT - RIGHT);
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for &(time, value) in points.iter().filter(|(t, _)| (from..=to).contains(t)) {
        if kept.last().is_none_or(|last| time - last.0 >= closest || last.1.is_nan() != value.is_nan()) {
            kept.push((time, value));
        }
    }
    kept
}

/// The runs of finite values.
fn pieces(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    points.split(|(_, v)| !v.is_finite()).filter(|piece| piece.len() > 1).map(<[_]>::to_vec).collect()
}

/// Moves labels apart so that they keep at least `distance` and stay inside a range if it can hold
/// them, without changing their order.
fn spread(mut labels: Vec<(f64, &Series)>, distance: f64, inside: (f64, f64)) -> Vec<(f64, &Series)> {
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    for _ in 0..200 {
        for label in &mut labels {
            label.0 = label.0.clamp(inside.0, inside.1);
        }
        for i in 1..labels.len() {
            let overlap = distance - (labels[i].0 - labels[i - 1].0);
            if overlap > 0.01 {
                labels[i - 1].0 -= overlap / 2.0;
                labels[i].0 += overlap / 2.0;
            }
        }
    }
    labels
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

    #[test]
    fn steps_are_one_two_or_five_times_a_power_of_ten() {
        assert_eq!([0.3, 0.11, 7.0, 1.0].map(nice_step), [0.5, 0.2, 10.0, 1.0]);
        assert_eq!([0.5, 0.02, 10.0].map(decimals), [1, 2, 0]);
    }

    #[test]
    fn labels_are_moved_apart_and_keep_their_order() {
        let series = |name: &str| Series { label: name.into(), colour: colour::BLACK, dashed: false, points: vec![] };
        let (a, b, c) = (series("a"), series("b"), series("c"));
        let spread = spread(vec![(10.0, &b), (9.0, &a), (10.5, &c)], 15.0, (0.0, 100.0));
        assert_eq!(spread.iter().map(|(_, s)| s.label.as_str()).collect::<String>(), "abc");
        assert!(spread.windows(2).all(|pair| pair[1].0 - pair[0].0 > 14.5));
    }

    #[test]
    fn a_gap_splits_a_curve() {
        assert_eq!(pieces(&[(0.0, 1.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 1.0)]).len(), 2);
    }
}
