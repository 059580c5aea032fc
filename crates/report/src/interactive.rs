//! A figure as a part of a page: its curves for the page's script, and the drawing for readers without scripts.
//!
//! Values are 16-bit steps between the lowest and the highest of their curve, which is finer than a screen shows.

use minijinja::Value;
use serde::Serialize;

use crate::figure::{Axis, Figure, Panel};

/// Bytes of the figures of shifts in a page, and of the drawings among them. The rest of a page takes less than one megabyte, and a page
/// stays below five.
const MAX_BYTES: usize = 4_100_000;
const MAX_DRAWING: usize = 300_000;
/// Points of a curve in a page.
const POINTS: usize = 2000;
/// Heights of an axis beyond which the values of a curve are cut: those of an observer that diverged.
const BEYOND: f64 = 10.0;
/// The step that stands for no value.
const GAP: u16 = u16::MAX;
/// The highest step of a value.
const TOP: f64 = (u16::MAX - 1) as f64;
/// Part of a step of time by which steps may differ that count as equal.
const EVEN: f64 = 1e-3;

/// A figure, as the script reads it.
#[derive(Serialize)]
struct Data<'a> {
    x: &'a str,
    from: f64,
    to: f64,
    times: Vec<Times>,
    spans: Vec<Phase<'a>>,
    panels: Vec<PanelData<'a>>,
}

/// The times of one or more curves: evenly from the first to the last, or as 32-bit steps between these.
#[derive(Serialize)]
struct Times {
    from: f64,
    to: f64,
    count: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    steps: Option<String>,
}

#[derive(Serialize)]
struct Phase<'a> {
    name: &'a str,
    from: f64,
    to: f64,
    colour: &'a str,
}

#[derive(Serialize)]
struct PanelData<'a> {
    name: &'a str,
    height: f64,
    low: f64,
    high: f64,
    /// Whether the axis may follow the visible values.
    free: bool,
    marked: bool,
    note: Option<String>,
    curves: Vec<Curve<'a>>,
    /// The widest first.
    ranges: Vec<Range<'a>>,
}

#[derive(Serialize)]
struct Curve<'a> {
    name: &'a str,
    colour: &'a str,
    width: f64,
    /// A curve of a higher layer lies over those of lower ones.
    layer: u8,
    dash: Option<&'a str>,
    #[serde(flatten)]
    values: Values,
}

#[derive(Serialize)]
struct Range<'a> {
    name: &'a str,
    colour: &'a str,
    lower: Values,
    upper: Values,
}

/// Values at the times of this place: `low` plus `step` times a number from 0 to 65534.
#[derive(Serialize)]
struct Values {
    time: usize,
    low: f64,
    step: f64,
    data: String,
}

/// The first figures, as many as a page has room for. The first of these have a drawing as well.
pub(crate) fn within_room(figures: impl Iterator<Item = Figure>) -> impl Iterator<Item = Value> {
    let (mut bytes, mut drawing) = (0, 0);
    figures.map_while(move |figure| {
        let data = figure.markup(drawing < MAX_DRAWING);
        drawing += data.split("<noscript>").nth(1).map_or(0, str::len);
        bytes += data.len();
        (bytes <= MAX_BYTES).then(|| Value::from_safe_string(data))
    })
}

impl Figure {
    /// The figure for a page.
    pub(crate) fn html(&self) -> Value {
        Value::from_safe_string(self.markup(true))
    }

    /// The figure as JSON, as the script of the pages reads it.
    pub(crate) fn json(&self) -> String {
        serde_json::to_string(&self.in_shown_units().data()).unwrap_or_default()
    }

    /// The text of a figure for a page, with its drawing for readers without scripts if that is `drawn`.
    fn markup(&self, drawn: bool) -> String {
        // A name may hold the end of a script.
        let data = self.json().replace('<', "\\u003c");
        let drawing =
            if drawn { self.svg() } else { "<p>This figure needs a browser that runs scripts.</p>".to_owned() };
        format!(
            "<div class=\"figure\"><script type=\"application/json\">{data}</script><noscript>{drawing}</noscript></div>"
        )
    }

    fn data(&self) -> Data<'_> {
        let (from, to) = self.x_range;
        // An axis has a length.
        let to = if to > from { to } else { from + 1.0 };
        let mut times = TimesOfCurves::default();
        let panels = self.panels.iter().map(|panel| self.panel_data(panel, &mut times)).collect();
        let spans = self.spans.iter().filter(|span| span.end >= from && span.start <= to);
        let spans = spans.map(|span| Phase {
            name: &span.label,
            from: span.start.max(from),
            to: span.end.min(to),
            colour: span.colour,
        });
        Data { x: &self.x_label, from, to, times: times.encoded(), spans: spans.collect(), panels }
    }

    fn panel_data<'a>(&self, panel: &'a Panel, times: &mut TimesOfCurves) -> PanelData<'a> {
        let (scale, note) = self.scale_and_note(panel);
        let (low, high) = (scale.low, scale.high);
        let beyond = BEYOND * (high - low);
        let mut values = |points: &[(f64, f64)]| {
            let points = self.shown(points);
            let cut = |value: f64| if value.is_nan() { value } else { value.clamp(low - beyond, high + beyond) };
            Values::of(times.place(points.iter().map(|point| point.0)), points.iter().map(|point| cut(point.1)))
        };
        let curves = panel.series.iter().map(|series| Curve {
            name: &series.label,
            colour: series.stroke.colour,
            width: series.stroke.weight.width(),
            layer: series.stroke.weight as u8,
            dash: series.stroke.dash,
            values: values(&series.points),
        });
        PanelData {
            name: &panel.y_label,
            height: panel.height,
            low,
            high,
            free: matches!(panel.axis, Axis::All | Axis::Within(..)),
            marked: !matches!(panel.axis, Axis::Unmarked(..)),
            note,
            curves: curves.collect(),
            ranges: panel
                .bands
                .iter()
                .map(|band| Range {
                    name: &band.label,
                    colour: band.colour,
                    lower: values(&band.lower),
                    upper: values(&band.upper),
                })
                .collect(),
        }
    }

    /// The points within the common axis, at most [`POINTS`] of them.
    fn shown(&self, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let (from, to) = self.x_range;
        let within = || points.iter().filter(|(x, _)| (from..=to).contains(x));
        let every = within().count().div_ceil(POINTS).max(1);
        within().step_by(every).copied().collect()
    }
}

/// The times of all curves; curves with the same share them.
#[derive(Default)]
struct TimesOfCurves(Vec<Vec<f64>>);

impl TimesOfCurves {
    fn place(&mut self, times: impl Iterator<Item = f64>) -> usize {
        let times: Vec<f64> = times.collect();
        let there = self.0.iter().position(|other| *other == times);
        there.unwrap_or_else(|| {
            self.0.push(times);
            self.0.len() - 1
        })
    }

    fn encoded(&self) -> Vec<Times> {
        self.0.iter().map(|times| Times::of(times)).collect()
    }
}

impl Times {
    fn of(times: &[f64]) -> Self {
        let (from, to) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
        let count = times.len();
        let step = (to - from) / count.saturating_sub(1).max(1) as f64;
        let is_even = times.iter().enumerate().all(|(i, time)| (time - from - i as f64 * step).abs() <= EVEN * step);
        let steps = (!is_even).then(|| {
            let unit = (to - from) / f64::from(u32::MAX);
            let bytes = times.iter().flat_map(|time| (((time - from) / unit).round() as u32).to_le_bytes());
            base64(&bytes.collect::<Vec<u8>>())
        });
        Self { from, to, count, steps }
    }
}

impl Values {
    fn of(time: usize, values: impl Iterator<Item = f64> + Clone) -> Self {
        let finite = values.clone().filter(|value| value.is_finite());
        let (low, high) =
            finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        let step = if high > low { (high - low) / TOP } else { 1.0 };
        let code = |value: f64| match value.is_finite() {
            true => ((value - low) / step).round().min(TOP) as u16,
            false => GAP,
        };
        let bytes: Vec<u8> = values.flat_map(|value| code(value).to_le_bytes()).collect();
        Self { time, low, step, data: base64(&bytes) }
    }
}

/// Bytes as text, RFC 4648.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let bits = group.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - group.len()));
        for digit in 0..4 {
            let is_there = digit <= group.len();
            text.push(if is_there { char::from(DIGITS[(bits >> (18 - 6 * digit) & 63) as usize]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{Series, Span, Stroke};

    fn figure(label: &str, points: Vec<(f64, f64)>) -> Figure {
        let series = Series { label: label.to_owned(), stroke: Stroke::SIGNAL, points };
        let panel = Panel {
            y_label: "torque (N m)".to_owned(),
            height: 90.0,
            series: vec![series],
            bands: Vec::new(),
            axis: Axis::All,
        };
        let span = Span { label: "torque phase".to_owned(), start: 0.2, end: 9.0, colour: "#fff" };
        Figure { x_label: "time (s)".into(), x_range: (0.0, 1.0), spans: vec![span], panels: vec![panel] }
    }

    #[test]
    fn a_page_takes_as_many_figures_as_it_has_room_for() {
        let wild = |seed: u32| (0..2000_u32).map(move |i| (f64::from(i) / 2e3, f64::from(i.wrapping_mul(seed) % 4999)));
        let figures = |count: u32| (1..=count).map(|i| figure("a", wild(2_654_435_761 + 2 * i).collect()));
        let size = figures(1).map(|figure| figure.markup(false).len()).sum::<usize>();
        let all: Vec<String> = within_room(figures(1000)).map(|figure| figure.to_string()).collect();
        assert!(all.len() < 1000 && all.iter().map(String::len).sum::<usize>() > MAX_BYTES - 10 * size);
        let drawn = all.iter().filter(|figure| figure.contains("<svg")).count();
        assert!(drawn > 0 && drawn < all.len() && all[0].contains("<svg"));
        assert_eq!(within_room(figures(3)).count(), 3);
    }

    #[test]
    fn base64_is_that_of_the_standard() {
        let texts = ["", "f", "fo", "foo", "foob", "fooba", "foobar"].map(|text| base64(text.as_bytes()));
        assert_eq!(texts, ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"]);
    }

    #[test]
    fn values_keep_their_ends_and_their_gaps() {
        let values = Values::of(0, [1.0, f64::NAN, 3.0, 2.0, f64::INFINITY].into_iter());
        // 0, gap, 65534, 32767, gap.
        let bytes = [[0_u8, 0], [255, 255], [254, 255], [255, 127], [255, 255]].concat();
        assert_eq!((values.low, values.step, values.data), (1.0, 2.0 / 65534.0, base64(&bytes)));
    }

    #[test]
    fn values_that_are_constant_or_missing_have_a_step() {
        for values in [vec![], vec![f64::NAN], vec![5.0, 5.0]] {
            let values = Values::of(0, values.into_iter());
            assert!(values.step == 1.0 && values.low.is_finite());
        }
    }

    #[test]
    fn even_times_take_no_room_and_curves_share_theirs() {
        let mut times = TimesOfCurves::default();
        let even = || (0..100).map(|i| 0.01 * f64::from(i));
        let places = [times.place(even()), times.place([0.0, 0.1, 0.5].into_iter()), times.place(even())];
        assert_eq!(places, [0, 1, 0]);
        let encoded = times.encoded();
        assert!(encoded[0].steps.is_none() && encoded[0].count == 100);
        // A fifth of 2^32 - 1.
        let bytes = [0_u32, 858_993_459, u32::MAX].map(u32::to_le_bytes).concat();
        assert_eq!(encoded[1].steps, Some(base64(&bytes)));
    }

    #[test]
    fn a_name_in_a_script_does_not_end_it() {
        let html = figure("</script><script>alert(1)</script>", vec![(0.0, 1.0), (1.0, 2.0)]).markup(true);
        assert_eq!(html.matches("<script").count(), 1);
        assert_eq!(html.matches("</script>").count(), 1);
        assert!(html.contains("\\u003c/script>"));
    }

    #[test]
    fn a_figure_without_a_number_is_data_without_one() {
        let nothing = figure("a", vec![(0.0, f64::NAN), (1.0, f64::NEG_INFINITY)]).markup(false);
        assert!(!nothing.contains("NaN") && !nothing.contains("inf") && !nothing.contains("null,\"step"), "{nothing}");
        assert!(figure("a", Vec::new()).markup(false).contains("\"count\":0"));
        let one_time = Figure { x_range: (3.0, 3.0), ..figure("a", vec![(3.0, 1.0)]) };
        assert!(one_time.markup(false).contains("\"from\":3.0,\"to\":4.0"));
    }

    #[test]
    fn a_million_points_are_thinned_to_what_a_screen_shows() {
        let points = (0..1_000_000).map(|i| (1e-6 * f64::from(i), f64::from(i % 7))).collect();
        assert!(figure("a", points).markup(false).len() < 20_000);
    }
}
