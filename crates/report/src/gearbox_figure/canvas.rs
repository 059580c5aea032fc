//! Lines, texts and symbols in the colours of the diagrams.

use crate::drawing::{Anchor, Drawing, Fill, Letters, Pen, TEXT};
use crate::legend::width;

/// How strongly a part is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Tone {
    /// A part of the train.
    Dark,
    /// An engaged element.
    Engaged,
    /// An open element.
    Open,
    /// A guide for the eye.
    Guide,
}

impl Tone {
    fn colour(self) -> &'static str {
        match self {
            Self::Dark => TEXT,
            Self::Engaged => "#C04A00",
            Self::Open => "#8A8A8A",
            Self::Guide => "#D5D5D5",
        }
    }

    fn width(self) -> f64 {
        match self {
            Self::Dark => 1.8,
            Self::Engaged => 3.0,
            Self::Open => 1.4,
            Self::Guide => 1.0,
        }
    }

    /// The edge of a symbol.
    fn edge(self) -> Pen<'static> {
        Pen { colour: self.colour(), width: 1.4, dash: None }
    }

    /// The inside of a symbol.
    fn fill(self, filled: bool) -> &'static str {
        if filled { self.colour() } else { "#FFFFFF" }
    }
}

/// A drawing that grows with what is drawn.
#[derive(Debug, Default)]
pub(super) struct Canvas {
    drawing: Drawing,
    right: f64,
    bottom: f64,
}

impl Canvas {
    /// The drawing with a margin at its right and lower edge.
    pub(super) fn svg(self, margin: f64) -> String {
        self.drawing.document((self.right + margin).ceil(), (self.bottom + margin).ceil())
    }

    fn reach(&mut self, x: f64, y: f64) {
        (self.right, self.bottom) = (self.right.max(x), self.bottom.max(y));
    }

    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), tone: Tone) {
        self.stroke(from, to, Pen { colour: tone.colour(), width: tone.width(), dash: None });
    }

    pub(super) fn thick(&mut self, from: (f64, f64), to: (f64, f64), tone: Tone) {
        self.stroke(from, to, Pen { colour: tone.colour(), width: 4.0, dash: None });
    }

    pub(super) fn dashed(&mut self, from: (f64, f64), to: (f64, f64), tone: Tone) {
        self.stroke(from, to, Pen { colour: tone.colour(), width: 1.0, dash: Some("3 3") });
    }

    fn stroke(&mut self, from: (f64, f64), to: (f64, f64), pen: Pen<'_>) {
        self.reach(from.0.max(to.0), from.1.max(to.1));
        self.drawing.line(&[from, to], pen);
    }

    /// A filled dot, or a circle.
    pub(super) fn dot(&mut self, (x, y): (f64, f64), radius: f64, tone: Tone, filled: bool) {
        self.reach(x + radius, y + radius);
        self.drawing.circle((x, y), radius, tone.fill(filled), tone.edge());
    }

    /// A filled or empty square around a point.
    pub(super) fn square(&mut self, (x, y): (f64, f64), half: f64, tone: Tone, filled: bool) {
        self.reach(x + half, y + half);
        let (left, right, top, bottom) = (x - half, x + half, y - half, y + half);
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        self.drawing.area(&corners, Fill { colour: tone.fill(filled), opacity: 1.0 });
        self.drawing.line(&corners, tone.edge());
    }

    pub(super) fn bar(&mut self, (x, y): (f64, f64), (width, height): (f64, f64), tone: Tone) {
        self.reach(x + width, y + height);
        self.drawing.rectangle((x, y), (width, height), Fill { colour: tone.colour(), opacity: 0.35 });
    }

    /// A text with its base line at `y`.
    pub(super) fn text(&mut self, (x, y): (f64, f64), content: &str, anchor: Anchor, tone: Tone) {
        self.write((x, y), content, anchor, tone, tone == Tone::Engaged);
    }

    pub(super) fn title(&mut self, margin: f64, content: &str) {
        self.write((margin, margin + 13.0), content, Anchor::Start, Tone::Dark, true);
    }

    fn write(&mut self, (x, y): (f64, f64), content: &str, anchor: Anchor, tone: Tone, bold: bool) {
        let whole = text_width(content, bold);
        let right = match anchor {
            Anchor::Start => x + whole,
            Anchor::Middle => x + whole / 2.0,
            Anchor::End => x,
        };
        self.reach(right, y + 4.0);
        self.drawing.text((x, y), content, anchor, Letters { bold, ..Letters::label(tone.colour()) });
    }
}

/// Width of a text; bold letters are wider.
pub(super) fn text_width(content: &str, bold: bool) -> f64 {
    if bold { 1.2 * width(content) } else { width(content) }
}
