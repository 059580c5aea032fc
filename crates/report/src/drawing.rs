//! A drawing of lines, areas, symbols and texts, as SVG. Places are in pixels from the upper left corner, and written to a tenth of one.

use std::fmt::{self, Display, Formatter, Write as _};

use crate::legend::LABEL_SIZE;

/// The colour of texts.
pub(crate) const TEXT: &str = "#222222";
const FONT: &str = "Helvetica, Arial, 'Liberation Sans', sans-serif";

/// Which point of a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Anchor {
    /// Its first letter.
    Start,
    /// Its middle.
    Middle,
    /// Its last letter.
    End,
}

/// How a text is written.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Letters {
    pub(crate) colour: &'static str,
    /// Height, pixels.
    pub(crate) size: u32,
    pub(crate) bold: bool,
    /// Written from below upwards.
    pub(crate) upright: bool,
}

impl Letters {
    /// A label of this colour.
    pub(crate) const fn label(colour: &'static str) -> Self {
        Self { colour, size: LABEL_SIZE, bold: false, upright: false }
    }
}

/// Colour, width and dashes of a line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pen<'a> {
    pub(crate) colour: &'a str,
    /// Pixels.
    pub(crate) width: f64,
    /// Lengths of dashes and gaps, if the line is not solid.
    pub(crate) dash: Option<&'a str>,
}

/// How an area is filled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fill<'a> {
    pub(crate) colour: &'a str,
    /// From 0 to 1.
    pub(crate) opacity: f64,
}

/// Elements of an SVG document, in their order.
#[derive(Debug, Default)]
pub(crate) struct Drawing {
    elements: String,
}

impl Drawing {
    /// The SVG document of this size, which scales with the page around it.
    pub(crate) fn document(self, width: f64, height: f64) -> String {
        let (width, height, elements) = (Pixels(width), Pixels(height), self.elements);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
             font-family=\"{FONT}\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>{elements}</svg>"
        )
    }

    /// Straight lines through these points.
    pub(crate) fn line(&mut self, points: &[(f64, f64)], pen: Pen<'_>) {
        self.lines([points], pen);
    }

    /// Several of the same kind.
    pub(crate) fn lines<'a>(&mut self, lines: impl IntoIterator<Item = &'a [(f64, f64)]>, pen: Pen<'_>) {
        self.add(format_args!("<path d=\""));
        lines.into_iter().for_each(|points| self.path(points));
        let Pen { colour, width, dash } = pen;
        self.add(format_args!("\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\""));
        if let Some(dash) = dash {
            self.add(format_args!(" stroke-dasharray=\"{dash}\""));
        }
        self.add(format_args!("/>"));
    }

    /// The area within these points.
    pub(crate) fn area(&mut self, points: &[(f64, f64)], fill: Fill<'_>) {
        self.add(format_args!("<path d=\""));
        self.path(points);
        self.add(format_args!("Z\"{fill}/>"));
    }

    /// A rectangle from its upper left corner.
    pub(crate) fn rectangle(&mut self, (x, y): (f64, f64), (width, height): (f64, f64), fill: Fill<'_>) {
        let [x, y, width, height] = [x, y, width, height].map(Pixels);
        self.add(format_args!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{fill}/>"));
    }

    /// A filled circle with its edge.
    pub(crate) fn circle(&mut self, (x, y): (f64, f64), radius: f64, fill: &str, edge: Pen<'_>) {
        let [x, y, radius] = [x, y, radius].map(Pixels);
        let Pen { colour, width, .. } = edge;
        self.add(format_args!(
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
        ));
    }

    /// A text with its base line at a place; it may hold any letter.
    pub(crate) fn text(&mut self, (x, y): (f64, f64), content: &str, anchor: Anchor, letters: Letters) {
        let (x, y) = (Pixels(x), Pixels(y));
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let Letters { colour, size, bold, upright } = letters;
        self.add(format_args!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{colour}\""
        ));
        if bold {
            self.add(format_args!(" font-weight=\"bold\""));
        }
        if upright {
            self.add(format_args!(" transform=\"rotate(-90,{x},{y})\""));
        }
        self.add(format_args!(">{}</text>", quick_xml::escape::partial_escape(content)));
    }

    /// Adds the commands of a path; the first point begins it.
    fn path(&mut self, points: &[(f64, f64)]) {
        for (n, &(x, y)) in points.iter().enumerate() {
            let command = if n == 0 { 'M' } else { 'L' };
            self.add(format_args!("{command}{} {}", Pixels(x), Pixels(y)));
        }
    }

    fn add(&mut self, text: fmt::Arguments<'_>) {
        // A string takes any text.
        let _ = self.elements.write_fmt(text);
    }
}

impl Display for Fill<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, " fill=\"{}\"", self.colour)?;
        if self.opacity < 1.0 { write!(f, " fill-opacity=\"{}\"", self.opacity) } else { Ok(()) }
    }
}

/// A length to a tenth of a pixel, which nobody sees.
struct Pixels(f64);

impl Display for Pixels {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // A number beyond those that can be drawn is the largest of them.
        let tenths = (10.0 * self.0).round() as i64;
        let (whole, tenth) = ((tenths / 10).unsigned_abs(), tenths % 10);
        let sign = if tenths < 0 { "-" } else { "" };
        write!(f, "{sign}{whole}")?;
        if tenth == 0 { Ok(()) } else { write!(f, ".{}", tenth.unsigned_abs()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_written_to_a_tenth_of_a_pixel() {
        for (value, expected) in [
            (74.81, "74.8"),
            (8.0, "8"),
            (-35.000_000_004, "-35"),
            (-0.26, "-0.3"),
            (-0.01, "0"),
            (0.95, "1"),
            (f64::NAN, "0"),
        ] {
            assert_eq!(Pixels(value).to_string(), expected);
        }
        assert!(!Pixels(f64::INFINITY).to_string().contains("inf"));
    }

    #[test]
    fn a_drawing_is_an_svg_document_and_a_name_stays_text() {
        let mut drawing = Drawing::default();
        drawing.line(&[(1.0, 2.0), (3.25, -4.0)], Pen { colour: "#000000", width: 1.7, dash: Some("2 3") });
        drawing.area(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], Fill { colour: "#FFFFFF", opacity: 0.5 });
        drawing.text((5.0, 6.0), "<script>&\"a\" b", Anchor::End, Letters::label("#222222"));
        let svg = drawing.document(100.0, 50.5);
        for part in [
            "viewBox=\"0 0 100 50.5\"",
            "<path d=\"M1 2L3.3 -4\" fill=\"none\" stroke=\"#000000\" stroke-width=\"1.7\" stroke-dasharray=\"2 3\"/>",
            "<path d=\"M0 0L1 0L1 1Z\" fill=\"#FFFFFF\" fill-opacity=\"0.5\"/>",
            " text-anchor=\"end\" fill=\"#222222\">&lt;script&gt;&amp;\"a\" b</text></svg>",
        ] {
            assert!(svg.contains(part), "{part}: {svg}");
        }
    }
}
