//! The work-precision diagram as SVG: time over error, both on logarithmic axes.

use std::fmt::Write as _;
use std::ops::RangeInclusive;

/// A method's points, error and time in s, in the order in which they are joined.
pub(crate) struct Curve {
    pub(crate) name: &'static str,
    pub(crate) points: Vec<(f64, f64)>,
}

/// One problem.
pub(crate) struct Panel {
    pub(crate) title: &'static str,
    pub(crate) curves: Vec<Curve>,
}

const COLOURS: [&str; 8] = ["#0b6e99", "#c8553d", "#6a994e", "#8a5a9e", "#b07d12", "#555555", "#d16ba5", "#2b3a67"];
/// Size of a panel and its place, in pixels.
const WIDTH: f64 = 380.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 70.0;
const TOP: f64 = 40.0;
const STEP: f64 = WIDTH + 40.0;
/// Decades of the axes: error, and time in s.
const ERRORS: RangeInclusive<i32> = -10..=-2;
const TIMES: RangeInclusive<i32> = -5..=-1;

fn place(value: f64, decades: &RangeInclusive<i32>, length: f64) -> f64 {
    let (low, high) = (f64::from(*decades.start()), f64::from(*decades.end()));
    length * (value.log10() - low) / (high - low)
}

pub(crate) fn svg(panels: &[Panel]) -> String {
    let legend = panels.iter().map(|panel| panel.curves.len()).max().unwrap_or(0) as f64;
    let (width, height) = (LEFT + STEP * panels.len() as f64, TOP + HEIGHT + 60.0 + 20.0 * (legend / 2.0).ceil());
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"Helvetica, Arial, sans-serif\" \
         font-size=\"13\" fill=\"#222222\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
    );
    for (at, panel) in panels.iter().enumerate() {
        draw(&mut svg, panel, LEFT + STEP * at as f64, at == 0);
    }
    for (at, curve) in panels.iter().take(1).flat_map(|panel| &panel.curves).take(COLOURS.len()).enumerate() {
        let (x, y) = (LEFT + STEP * (at % 2) as f64, TOP + HEIGHT + 60.0 + 20.0 * (at / 2) as f64);
        let colour = COLOURS[at];
        let _ = writeln!(
            svg,
            "<line x1=\"{x}\" y1=\"{y}\" x2=\"{}\" y2=\"{y}\" stroke=\"{colour}\" stroke-width=\"2\"/>\
             <text x=\"{}\" y=\"{}\">{}</text>",
            x + 26.0,
            x + 34.0,
            y + 4.0,
            curve.name.replace('`', "")
        );
    }
    svg + "</svg>\n"
}

fn draw(svg: &mut String, panel: &Panel, left: f64, first: bool) {
    let bottom = TOP + HEIGHT;
    let _ = writeln!(svg, "<text x=\"{left}\" y=\"{}\" font-weight=\"bold\">{}</text>", TOP - 14.0, panel.title);
    for decade in ERRORS {
        let x = left + place(10_f64.powi(decade), &ERRORS, WIDTH);
        let _ = writeln!(
            svg,
            "<line x1=\"{x:.1}\" y1=\"{TOP}\" x2=\"{x:.1}\" y2=\"{bottom}\" stroke=\"#dddddd\"/>\
             <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">1e{decade}</text>",
            bottom + 18.0
        );
    }
    for decade in TIMES {
        let y = bottom - place(10_f64.powi(decade), &TIMES, HEIGHT);
        let label = ["10 µs", "0.1 ms", "1 ms", "10 ms", "0.1 s"][(decade - TIMES.start()) as usize];
        let _ = writeln!(
            svg,
            "<line x1=\"{left}\" y1=\"{y:.1}\" x2=\"{}\" y2=\"{y:.1}\" stroke=\"#dddddd\"/>",
            left + WIDTH
        );
        if first {
            let _ = writeln!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>", left - 8.0, y + 4.0);
        }
    }
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">largest relative error of a state at the end</text>",
        left + 0.5 * WIDTH,
        bottom + 38.0
    );
    for (curve, colour) in panel.curves.iter().zip(COLOURS) {
        let inside = |&&(error, seconds): &&(f64, f64)| {
            let within = |value: f64, of: &RangeInclusive<i32>| {
                (f64::from(*of.start())..=f64::from(*of.end())).contains(&value.log10())
            };
            within(error, &ERRORS) && within(seconds, &TIMES)
        };
        let points: Vec<(f64, f64)> = (curve.points.iter().filter(inside))
            .map(|&(error, seconds)| (left + place(error, &ERRORS, WIDTH), bottom - place(seconds, &TIMES, HEIGHT)))
            .collect();
        let path: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            path.join(" ")
        );
        for (x, y) in points {
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{colour}\"/>");
        }
    }
}
