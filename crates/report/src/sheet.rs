//! A page of figures, drawings and tables, for commands whose result is not a drive.

use config::Source;
use minijinja::{Value, context};
use trace::shown_units::{convert_table, sentence};

use crate::figure::Figure;
use crate::page::{PageError, inline, origin, render};
use crate::words::found;

/// A page.
pub struct Sheet<'a> {
    /// What it is of, such as the name of a car.
    pub name: &'a str,
    /// What it shows.
    pub title: &'a str,
    /// The line below the name.
    pub lead: String,
    /// What was found, in sentences; those with a hint are shown as warnings.
    pub sentences: Vec<String>,
    /// The parts, from top to bottom.
    pub parts: Vec<Part>,
    /// The files that it follows from.
    pub sources: Vec<&'a Source>,
}

/// A part of a page.
pub struct Part {
    /// Its heading; none where it belongs to the part above.
    pub heading: Option<String>,
    /// What it shows.
    pub content: Content,
    /// What a reader has to know of it.
    pub caption: String,
}

/// What a part shows.
pub enum Content {
    /// Curves.
    Figure(Figure),
    /// A drawing, as SVG, and what it shows in words.
    Drawing(String, String),
    /// A table that is sorted by its titles.
    Table(Vec<String>, Vec<Vec<String>>),
    /// Intervals of parameters.
    Intervals(Vec<Interval>),
    /// Lines as a terminal shows them.
    Lines(Vec<String>),
}

/// A parameter with its interval.
pub struct Interval {
    /// Its name.
    pub name: String,
    /// Its value, and its interval of 95 % after the fit.
    pub cells: [String; 2],
    /// Value and half of the interval after the fit, in halves of the interval before it, if they are known.
    pub bar: Option<[f64; 2]>,
    /// What the logs tell of it.
    pub verdict: &'static str,
    /// 0 for identifiable, 1 for limited by what was known before, 2 for not identifiable.
    pub rank: usize,
}

impl Sheet<'_> {
    /// The page; it needs nothing but itself.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn html(&self) -> Result<String, PageError> {
        render(
            "sheet.html",
            context! {
                name => self.name,
                title => self.title,
                version => env!("CARGO_PKG_VERSION"),
                lead => &self.lead,
                found => found(&self.sentences.iter().map(|text| sentence(text)).collect::<Vec<_>>()),
                parts => self.parts.iter().map(Part::view).collect::<Vec<_>>(),
                inputs => origin(&self.sources),
            },
        )
    }
}

impl Part {
    fn view(&self) -> Value {
        let (heading, caption) = (&self.heading, &self.caption);
        match &self.content {
            Content::Figure(figure) => context! { heading, caption, figure => figure.html() },
            Content::Drawing(svg, words) => context! { heading, caption, drawing => inline(svg), words },
            Content::Table(titles, rows) => {
                let (mut titles, mut rows) = (titles.clone(), rows.clone());
                convert_table(&mut titles, &mut rows);
                context! { heading, caption, titles, rows }
            }
            Content::Intervals(rows) => {
                context! { heading, caption, intervals => rows.iter().map(Interval::view).collect::<Vec<_>>() }
            }
            Content::Lines(lines) => context! { heading, caption, lines => lines.join("\n") },
        }
    }
}

impl Interval {
    fn view(&self) -> Value {
        /// Halves of the interval before that the bar shows on each side.
        const SHOWN: f64 = 2.0;
        let percent = |value: f64| 50.0 * (1.0 + value.clamp(-SHOWN, SHOWN) / SHOWN);
        let bar = self.bar.filter(|bar| bar.iter().all(|value| value.is_finite())).map(|[value, half]| {
            let [low, high] = [percent(value - half), percent(value + half)];
            context! { low => format!("{low:.1}"), wide => format!("{:.1}", high - low), value => format!("{:.1}", percent(value)) }
        });
        context! { name => &self.name, cells => &self.cells, bar, verdict => self.verdict, rank => self.rank }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{Series, Stroke};
    use crate::panels::panel;

    fn sheet(parts: Vec<Content>) -> String {
        let part = |content| Part { heading: Some("<b>".to_owned()), content, caption: String::new() };
        let sheet = Sheet {
            name: "<script>alert(1)</script>",
            title: "check",
            lead: String::new(),
            sentences: vec!["warning: a\nhint: b".to_owned()],
            parts: parts.into_iter().map(part).collect(),
            sources: Vec::new(),
        };
        sheet.html().unwrap()
    }

    #[test]
    fn every_part_is_in_the_page_and_names_are_text() {
        let series = Series { label: "a".to_owned(), stroke: Stroke::SIGNAL, points: vec![(0.0, 1.0), (1.0, 2.0)] };
        let figure = Figure {
            x_label: "settling time (s)".into(),
            x_range: (0.0, 1.0),
            spans: Vec::new(),
            panels: vec![panel("bound (MPa)", 90.0, vec![series])],
        };
        let words = |text: &str| vec![text.to_owned()];
        let interval = |bar| Interval {
            name: "friction".to_owned(),
            cells: ["x 1.02", "0.98 to 1.06"].map(str::to_owned),
            bar,
            verdict: "identifiable",
            rank: 0,
        };
        let html = sheet(vec![
            Content::Figure(figure),
            Content::Drawing("<svg></svg>".to_owned(), "the train".to_owned()),
            Content::Table(words("gear"), vec![words("<i>1")]),
            Content::Intervals(vec![interval(Some([0.5, 0.25])), interval(Some([f64::NAN, 1.0])), interval(None)]),
            Content::Lines(words("L = [1 & 2]")),
        ]);
        for expected in [
            "class=\"figure\"",
            "<svg></svg>",
            "&lt;i&gt;1",
            "left: 56.2%; width: 12.5%",
            "L = [1 &amp; 2]",
            "class=\"warning\"",
        ] {
            assert!(html.contains(expected), "{expected}");
        }
        assert_eq!(html.matches("class=\"interval\"").count(), 1);
        assert!(!html.contains("<script>alert") && !html.contains("NaN%"));
    }

    #[test]
    fn a_page_without_parts_is_a_page() {
        assert!(sheet(Vec::new()).trim_end().ends_with("</html>"));
    }
}
