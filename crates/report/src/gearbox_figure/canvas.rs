//! Lines, texts and symbols in the colours of the diagrams.

use kuva::render::color::Color;
use kuva::render::render::{Primitive, Scene, TextAnchor};

use crate::figure::{FONT, TEXT, document};
use crate::legend::{LABEL_SIZE, width};

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
}

/// A drawing that grows with what is drawn.
pub(super) struct Canvas {
    scene: Scene,
    right: f64,
    bottom: f64,
}

impl Canvas {
    pub(super) fn new() -> Self {
        let mut scene = Scene::new(0.0, 0.0);
        scene.font_family = Some(FONT.to_owned());
        Self { scene, right: 0.0, bottom: 0.0 }
    }

    /// The drawing with a margin at its right and lower edge.
    pub(super) fn svg(mut self, margin: f64) -> String {
        (self.scene.width, self.scene.height) = ((self.right + margin).ceil(), (self.bottom + margin).ceil());
        document(&self.scene)
    }

    fn reach(&mut self, x: f64, y: f64) {
        (self.right, self.bottom) = (self.right.max(x), self.bottom.max(y));
    }

    pub(super) fn line(&mut self, (x1, y1): (f64, f64), (x2, y2): (f64, f64), tone: Tone) {
        self.stroke((x1, y1), (x2, y2), tone, tone.width(), None);
    }

    pub(super) fn thick(&mut self, from: (f64, f64), to: (f64, f64), tone: Tone) {
        self.stroke(from, to, tone, 4.0, None);
    }

    pub(super) fn dashed(&mut self, from: (f64, f64), to: (f64, f64), tone: Tone) {
        self.stroke(from, to, tone, 1.0, Some("3 3"));
    }

    fn stroke(&mut self, (x1, y1): (f64, f64), (x2, y2): (f64, f64), tone: Tone, width: f64, dash: Option<&str>) {
        self.reach(x1.max(x2), y1.max(y2));
        let (stroke, stroke_dasharray) = (Color::from(tone.colour()), dash.map(str::to_owned));
        self.scene.add(Primitive::Line { x1, y1, x2, y2, stroke, stroke_width: width, stroke_dasharray });
    }

    /// A filled dot, or a circle.
    pub(super) fn dot(&mut self, (cx, cy): (f64, f64), r: f64, tone: Tone, filled: bool) {
        self.reach(cx + r, cy + r);
        let fill = Color::from(if filled { tone.colour() } else { "#FFFFFF" });
        let stroke = Some(Color::from(tone.colour()));
        self.scene.add(Primitive::Circle { cx, cy, r, fill, fill_opacity: None, stroke, stroke_width: Some(1.4) });
    }

    /// A filled or empty square around a point.
    pub(super) fn square(&mut self, (x, y): (f64, f64), half: f64, tone: Tone, filled: bool) {
        self.reach(x + half, y + half);
        let fill = Color::from(if filled { tone.colour() } else { "#FFFFFF" });
        let (stroke, stroke_width) = (Some(Color::from(tone.colour())), Some(1.4));
        let (x, y, width) = (x - half, y - half, 2.0 * half);
        self.scene.add(Primitive::Rect { x, y, width, height: width, fill, stroke, stroke_width, opacity: None });
    }

    pub(super) fn bar(&mut self, (x, y): (f64, f64), (width, height): (f64, f64), tone: Tone) {
        self.reach(x + width, y + height);
        let fill = Color::from(tone.colour());
        self.scene.add(Primitive::Rect {
            x,
            y,
            width,
            height,
            fill,
            stroke: None,
            stroke_width: None,
            opacity: Some(0.35),
        });
    }

    /// A text with its base line at `y`.
    pub(super) fn text(&mut self, (x, y): (f64, f64), content: &str, anchor: TextAnchor, tone: Tone) {
        self.write((x, y), content, anchor, tone, tone == Tone::Engaged);
    }

    pub(super) fn title(&mut self, margin: f64, content: &str) {
        self.write((margin, margin + 13.0), content, TextAnchor::Start, Tone::Dark, true);
    }

    fn write(&mut self, (x, y): (f64, f64), content: &str, anchor: TextAnchor, tone: Tone, bold: bool) {
        let whole = text_width(content, bold);
        let right = match anchor {
            TextAnchor::Start => x + whole,
            TextAnchor::Middle => x + whole / 2.0,
            TextAnchor::End => x,
        };
        self.reach(right, y + 4.0);
        let (content, color) = (content.to_owned(), Some(Color::from(tone.colour())));
        self.scene.add(Primitive::Text { x, y, content, size: LABEL_SIZE, anchor, rotate: None, bold, color });
    }
}

/// Width of a text; bold letters are wider.
pub(super) fn text_width(content: &str, bold: bool) -> f64 {
    if bold { 1.2 * width(content) } else { width(content) }
}
