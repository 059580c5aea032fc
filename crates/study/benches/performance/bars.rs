//! Horizontal bars as SVG.

use std::fmt::Write as _;

/// A bar of parts that follow one another.
pub(crate) struct Bar {
    pub(crate) label: String,
    pub(crate) parts: Vec<f64>,
}

/// Colours of the parts.
const COLOURS: [&str; 3] = ["#0b6e99", "#c8a15a", "#8f8f8f"];
/// Sizes, in pixels.
const LABELS: f64 = 330.0;
const WIDTH: f64 = 420.0;
const STEP: f64 = 24.0;
const TOP: f64 = 46.0;

/// The longest value of an axis and the distance of its marks: 1, 2 or 5 times a power of ten, four to ten of them.
fn axis(maximum: f64) -> (f64, f64) {
    let power = 10_f64.powf((maximum / 4.0).log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|factor| factor * power).find(|step| maximum / step <= 8.0);
    let step = step.unwrap_or(power);
    (step * (maximum / step).ceil(), step)
}

/// The bars over an axis with this title; `parts` are the names of their parts, if there are several.
pub(crate) fn svg(title: &str, parts: &[&str], bars: &[Bar]) -> String {
    let longest = bars.iter().map(|bar| bar.parts.iter().sum::<f64>()).fold(0.0, f64::max);
    let (maximum, step) = axis(longest);
    let bottom = TOP + STEP * bars.len() as f64;
    let (width, height) = (LABELS + WIDTH + 80.0, bottom + 54.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"Helvetica, Arial, sans-serif\" \
         font-size=\"13\" fill=\"#222222\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
    );
    legend(&mut svg, parts);
    let mut mark = 0.0;
    while mark <= maximum * (1.0 + 1e-9) {
        let x = LABELS + WIDTH * mark / maximum;
        let _ = writeln!(
            svg,
            "<line x1=\"{x:.1}\" y1=\"{TOP}\" x2=\"{x:.1}\" y2=\"{bottom}\" stroke=\"#dddddd\"/>\
             <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            bottom + 18.0,
            short(mark)
        );
        mark += step;
    }
    for (at, bar) in bars.iter().enumerate() {
        let y = TOP + STEP * at as f64;
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            LABELS - 8.0,
            y + 16.5,
            bar.label.replace('&', "&amp;").replace('<', "&lt;")
        );
        let mut x = LABELS;
        for (&part, colour) in bar.parts.iter().zip(COLOURS) {
            let length = WIDTH * part.max(0.0) / maximum;
            let _ = writeln!(
                svg,
                "<rect x=\"{x:.1}\" y=\"{}\" width=\"{length:.1}\" height=\"16\" fill=\"{colour}\"/>",
                y + 4.0
            );
            x += length;
        }
        let whole: f64 = bar.parts.iter().sum();
        // White around it covers the lines of the axis.
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{}\" stroke=\"#ffffff\" stroke-width=\"4\" paint-order=\"stroke\">{}</text>",
            x + 6.0,
            y + 16.5,
            short(whole)
        );
    }
    let middle = LABELS + 0.5 * WIDTH;
    let _ = writeln!(svg, "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{title}</text>", bottom + 40.0);
    svg + "</svg>\n"
}

/// The names of the parts with their colours.
fn legend(svg: &mut String, parts: &[&str]) {
    for (at, part) in parts.iter().enumerate() {
        let x = LABELS + 150.0 * at as f64;
        let _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"14\" width=\"14\" height=\"14\" fill=\"{}\"/><text x=\"{}\" y=\"26\">{part}</text>",
            COLOURS[at % COLOURS.len()],
            x + 20.0
        );
    }
}

/// A number with three digits, as far as it has decimals.
fn short(value: f64) -> String {
    let digits = if value >= 100.0 || value == value.round() { 0 } else { usize::from(value < 10.0) + 1 };
    format!("{value:.digits$}")
}
