//! Shafts, sets, gear pairs and elements, and beside them the speeds of a gear.

use geartrain::Member;
use geartrain::{Connection, ElementKind, GearTrain};

use crate::drawing::Anchor;

use super::canvas::{Canvas, Tone, text_width};
use super::layout::{ARROW, Column, LABEL, Layout, ROW, labels, members};
use super::{member_name, speed_text, tone};

/// Width of the speeds beside the shafts.
const SPEEDS: f64 = 200.0;
/// Half the gap between the plates of an open element, and half their length.
const PLATES: (f64, f64) = (3.5, 9.0);
/// Radius of a gear.
const GEAR: f64 = 4.5;
/// From the base line of a text up to its middle.
const MIDDLE: f64 = 4.5;

/// The elements of a gear.
pub(super) struct Engaged<'a> {
    /// The engaged elements with their torques per turbine torque.
    pub(super) torques: Vec<(usize, f64)>,
    /// Speed of each shaft per turbine speed.
    pub(super) speeds: &'a [Option<f64>],
}

impl Engaged<'_> {
    fn torque(&self, element: usize) -> Option<f64> {
        self.torques.iter().find(|torque| torque.0 == element).map(|torque| torque.1)
    }
}

pub(super) fn draw(canvas: &mut Canvas, train: &GearTrain, layout: &Layout, gear: Option<&Engaged<'_>>) {
    for shaft in 0..train.shafts.len() {
        draw_shaft(canvas, train, layout, shaft);
    }
    draw_housing(canvas, train, layout);
    for &(column, x) in &layout.columns {
        match column {
            Column::Set(_) => draw_set(canvas, train, layout, column, x),
            Column::Pair(pair) => draw_pair(canvas, train, layout, (pair, x), gear),
            Column::Element(element) => draw_element(canvas, train, layout, (element, x), gear),
        }
    }
    if let Some(gear) = gear {
        draw_speeds(canvas, train, layout, gear);
    }
}

/// The line of a shaft between its first and last dot, its name, and an arrow at input and output.
fn draw_shaft(canvas: &mut Canvas, train: &GearTrain, layout: &Layout, shaft: usize) {
    let member = Member::Shaft(shaft);
    let y = layout.y(member);
    let joined =
        layout.columns.iter().filter(|(column, _)| members(train, *column).contains(&member)).map(|column| column.1);
    let (from, to) = joined.fold((layout.right, layout.left), |(from, to), x| (from.min(x), to.max(x)));
    let (is_input, is_output) = (shaft == train.input, shaft == train.output);
    let from = if is_input { layout.left } else { from };
    let to = if is_output { layout.right } else { to };
    canvas.line((layout.left, y), (layout.right, y), Tone::Guide);
    canvas.line((from, y), (to, y), Tone::Dark);
    canvas.text((layout.left - 6.0, y + MIDDLE), member_name(train, member), Anchor::End, Tone::Dark);
    if is_input {
        arrow(canvas, layout.left - 6.0 - text_width(member_name(train, member), false) - 8.0, y, "input");
    }
    if is_output {
        arrow(canvas, layout.right + ARROW - 6.0, y, "output");
    }
}

/// An arrow to the right that ends here, with a text above it.
fn arrow(canvas: &mut Canvas, x: f64, y: f64, label: &str) {
    let start = x - ARROW + 12.0;
    canvas.line((start, y), (x, y), Tone::Dark);
    canvas.line((x - 6.0, y - 4.0), (x, y), Tone::Dark);
    canvas.line((x - 6.0, y + 4.0), (x, y), Tone::Dark);
    canvas.text((start, y - 7.0), label, Anchor::Start, Tone::Dark);
}

fn draw_housing(canvas: &mut Canvas, train: &GearTrain, layout: &Layout) {
    let y = layout.y(Member::Housing);
    canvas.line((layout.left, y), (layout.right, y), Tone::Dark);
    let mut x = layout.left + 8.0;
    while x <= layout.right {
        canvas.line((x, y), (x - 8.0, y + 8.0), Tone::Open);
        x += 10.0;
    }
    canvas.text((layout.left - 6.0, y + MIDDLE), member_name(train, Member::Housing), Anchor::End, Tone::Dark);
}

fn draw_set(canvas: &mut Canvas, train: &GearTrain, layout: &Layout, column: Column, x: f64) {
    let heights: Vec<f64> = members(train, column).into_iter().map(|member| layout.y(member)).collect();
    let (top, bottom) = heights.iter().fold((f64::MAX, f64::MIN), |(top, bottom), &y| (top.min(y), bottom.max(y)));
    canvas.line((x, top), (x, bottom), Tone::Dark);
    let labels = labels(train, column);
    canvas.text((x - 4.0, layout.head()), &labels[0], Anchor::Start, Tone::Dark);
    for (&y, label) in heights.iter().zip(&labels[1..]) {
        canvas.dot((x, y), 4.5, Tone::Dark, true);
        canvas.text((x + LABEL, y - 5.0), label, Anchor::Start, Tone::Dark);
    }
}

/// Two circles that touch, three with an idler; the dog is a square on the driven shaft.
fn draw_pair(
    canvas: &mut Canvas,
    train: &GearTrain,
    layout: &Layout,
    (at, x): (usize, f64),
    gear: Option<&Engaged<'_>>,
) {
    let pair = &train.pairs[at];
    let dog = train.elements.iter().position(|element| element.connection == Connection::Pair(at));
    let torque = dog.and_then(|dog| gear?.torque(dog));
    // What is always in mesh is not an element.
    let tone = if dog.is_none() { Tone::Dark } else { tone(gear.is_some(), torque.is_some()) };
    let (driver, driven) = (layout.y(Member::Shaft(pair.driver)), layout.y(Member::Shaft(pair.driven)));
    let down = (driven - driver).signum();
    // In the gap next to the driver's shaft no other shaft is crossed.
    let mesh = driver + down * 0.5 * ROW;
    canvas.line((x, driver), (x, driven), tone);
    let gears: &[f64] = if pair.idler { &[-2.0 * GEAR, 0.0, 2.0 * GEAR] } else { &[-GEAR, GEAR] };
    for offset in gears {
        canvas.dot((x, mesh + offset), GEAR, tone, false);
    }
    canvas.dot((x, driver), 4.5, tone, true);
    match dog {
        None => canvas.dot((x, driven), 4.5, tone, true),
        Some(_) => canvas.square((x, driven), 5.0, tone, torque.is_some()),
    }
    let labels = labels(train, Column::Pair(at));
    canvas.text((x - 4.0, layout.head()), &labels[0], Anchor::Start, tone);
    let beside = if down > 0.0 { -5.0 } else { 14.0 };
    for (y, teeth) in [(driver, &labels[1]), (driven, &labels[2])] {
        canvas.text((x + LABEL, y + beside), teeth, Anchor::Start, tone);
    }
}

/// Two plates between the sides, together where the element is engaged.
fn draw_element(
    canvas: &mut Canvas,
    train: &GearTrain,
    layout: &Layout,
    (at, x): (usize, f64),
    gear: Option<&Engaged<'_>>,
) {
    let torque = gear.and_then(|gear| gear.torque(at));
    let tone = tone(gear.is_some(), torque.is_some());
    let heights: Vec<f64> = members(train, Column::Element(at)).into_iter().map(|member| layout.y(member)).collect();
    let (top, bottom) = heights.iter().fold((f64::MAX, f64::MIN), |(top, bottom), &y| (top.min(y), bottom.max(y)));
    let plates = bottom - ROW / 2.0;
    let (gap, half) = if torque.is_some() { (2.0, PLATES.1) } else { PLATES };
    canvas.line((x, top), (x, plates - gap), tone);
    canvas.line((x, plates + gap), (x, bottom), tone);
    let kind = train.elements[at].kind;
    match kind {
        ElementKind::Dog => canvas.square((x, plates), 5.0, tone, torque.is_some()),
        _ => {
            canvas.thick((x - half, plates - gap), (x + half, plates - gap), tone);
            canvas.thick((x - half, plates + gap), (x + half, plates + gap), tone);
        }
    }
    if kind == ElementKind::OneWayClutch {
        canvas.line((x - half, plates + 10.0), (x, plates + 4.0), tone);
        canvas.line((x + half, plates + 10.0), (x, plates + 4.0), tone);
    }
    for y in heights {
        canvas.dot((x, y), 4.5, tone, true);
    }
    let name = &labels(train, Column::Element(at))[0];
    canvas.text((x - 4.0, layout.head()), name, Anchor::Start, tone);
    if let Some(torque) = torque {
        canvas.text((x + LABEL + 2.0, plates - 6.0), &speed_text(Some(torque)), Anchor::Start, tone);
    }
}

/// Bars and numbers at the right end of the shafts.
fn draw_speeds(canvas: &mut Canvas, train: &GearTrain, layout: &Layout, gear: &Engaged<'_>) {
    let left = layout.right + ARROW + 24.0;
    let width = SPEEDS - 64.0;
    let known = || gear.speeds.iter().filter_map(|speed| *speed);
    let (low, high) = known().fold((0.0_f64, 1.0_f64), |(low, high), speed| (low.min(speed), high.max(speed)));
    let x = |speed: f64| left + width * (speed - low) / (high - low);
    let (top, bottom) = (layout.head() + 6.0, layout.y(Member::Housing));
    canvas.text((left, layout.head()), "speed / turbine speed", Anchor::Start, Tone::Dark);
    canvas.line((x(0.0), top), (x(0.0), bottom), Tone::Open);
    canvas.dashed((x(1.0), top), (x(1.0), bottom), Tone::Open);
    for (value, label) in [(0.0, "0"), (1.0, "1")] {
        canvas.text((x(value), bottom + 15.0), label, Anchor::Middle, Tone::Dark);
    }
    for shaft in 0..train.shafts.len() {
        let (y, speed) = (layout.y(Member::Shaft(shaft)), gear.speeds.get(shaft).copied().flatten());
        if let Some(speed) = speed {
            let (from, to) = (x(0.0).min(x(speed)), x(0.0).max(x(speed)));
            canvas.bar((from, y - 5.0), (to - from, 10.0), Tone::Dark);
            canvas.dot((x(speed), y), 4.0, Tone::Dark, true);
        }
        canvas.text((left + width + 62.0, y + MIDDLE), &speed_text(speed), Anchor::End, Tone::Dark);
    }
}

/// What the symbols mean, as far as the train has them.
pub(super) fn legend(canvas: &mut Canvas, train: &GearTrain, (left, top): (f64, f64), speeds: Option<&[Option<f64>]>) {
    let is_gear = speeds.is_some();
    let has = |kind: ElementKind| train.elements.iter().any(|element| element.kind == kind);
    let plates = train.elements.iter().any(|element| element.kind != ElementKind::Dog);
    let sets = !train.sets.is_empty();
    let is_free = speeds.is_some_and(|speeds| speeds.contains(&None));
    let lines = [
        (true, "Horizontal lines: shafts; the hatched line is the housing. Dots connect; lines that cross do not."),
        (
            sets,
            "Vertical lines named \"set\": planetary sets, with the teeth of sun and ring; \"double\" has pairs of planets.",
        ),
        (
            !train.pairs.is_empty(),
            "Vertical lines with two circles: gear pairs with their teeth; three circles: with an idler.",
        ),
        (has(ElementKind::Dog), "Squares: dogs, named above."),
        (
            plates,
            "Vertical lines with two plates: clutches and brakes, named above; the lower half of a brake is the housing.",
        ),
        (has(ElementKind::OneWayClutch), "Plates with an arrow: one-way clutches."),
        (
            is_gear,
            "Orange: engaged elements, with their torque per N m of turbine torque; positive drives the output side. Grey: open.",
        ),
        (is_free, "free: the speed of the shaft does not follow from the gear."),
        (
            is_gear && sets,
            "Levers: the members of a set lie at distances of 1/teeth from the carrier; their speeds are on a straight line.",
        ),
    ];
    let mut y = top + 12.0;
    for (_, line) in lines.iter().filter(|line| line.0) {
        canvas.text((left, y), line, Anchor::Start, Tone::Dark);
        y += 17.0;
    }
}
