//! The planetary sets of a gear as levers.

use geartrain::Member;
use geartrain::{GearTrain, PlanetarySet, Planets};

use crate::drawing::Anchor;

use super::canvas::{Canvas, Tone, text_width};
use super::{MARGIN, member_name};

/// Height of a lever, and width of its speeds.
const LEVER: (f64, f64) = (96.0, 120.0);
/// Height of the title of a lever, and of the axis below it.
const HEAD: f64 = 26.0;
const AXIS: f64 = 40.0;

/// Members of a set with their places along its lever, the carrier at zero.
fn places(set: &PlanetarySet<Member>) -> [(&'static str, Member, f64); 3] {
    let [sun, ring] = [set.sun_teeth, set.ring_teeth].map(|teeth| 1.0 / f64::from(teeth));
    let ring = match set.planets {
        Planets::Single => -ring,
        Planets::Double => ring,
    };
    [("sun", set.sun, sun), ("carrier", set.carrier, 0.0), ("ring", set.ring, ring)]
}

/// Draws the levers beside each other; returns the lower edge.
pub(super) fn draw(canvas: &mut Canvas, train: &GearTrain, speeds: &[Option<f64>], left: f64, top: f64) -> f64 {
    let known = || speeds.iter().filter_map(|speed| *speed);
    let (low, high) = known().fold((0.0_f64, 1.0_f64), |(low, high), speed| (low.min(speed), high.max(speed)));
    let speed_of = |member: Member| match member {
        Member::Housing => Some(0.0),
        Member::Shaft(shaft) => speeds.get(shaft).copied().flatten(),
    };
    let mut x = left;
    for (at, set) in train.sets.iter().enumerate() {
        let places = places(set);
        let label = |member: (&str, Member, f64)| format!("{} {}", member.0, member_name(train, member.1));
        let widest = places.iter().map(|&place| text_width(&label(place), false)).fold(0.0, f64::max);
        let origin = x + widest + 16.0;
        let at_speed = |speed: f64| origin + LEVER.1 * (speed - low) / (high - low);
        let ends = places.iter().fold((0.0_f64, 0.0_f64), |(low, high), place| (low.min(place.2), high.max(place.2)));
        let y = |place: f64| top + HEAD + LEVER.0 * (ends.1 - place) / (ends.1 - ends.0);
        let (upper, lower) = (top + HEAD - 8.0, top + HEAD + LEVER.0 + 8.0);
        canvas.text((x, top + 8.0), &format!("lever of set {}", at + 1), Anchor::Start, Tone::Dark);
        canvas.line((at_speed(0.0), upper), (at_speed(0.0), lower), Tone::Open);
        canvas.dashed((at_speed(1.0), upper), (at_speed(1.0), lower), Tone::Open);
        for (value, label) in [(0.0, "0"), (1.0, "1")] {
            canvas.text((at_speed(value), lower + 14.0), label, Anchor::Middle, Tone::Dark);
        }
        canvas.text((origin, lower + 30.0), "speed / turbine speed", Anchor::Start, Tone::Dark);
        let points: Option<Vec<(f64, f64)>> =
            places.iter().map(|place| Some((at_speed(speed_of(place.1)?), y(place.2)))).collect();
        for &place in &places {
            canvas.line((origin, y(place.2)), (origin + LEVER.1, y(place.2)), Tone::Guide);
            canvas.text((origin - 12.0, y(place.2) + 4.5), &label(place), Anchor::End, Tone::Dark);
        }
        if let Some(points) = points {
            let highest = points.iter().copied().fold(points[0], |a, b| if b.1 < a.1 { b } else { a });
            let lowest = points.iter().copied().fold(points[0], |a, b| if b.1 > a.1 { b } else { a });
            canvas.line(highest, lowest, Tone::Dark);
            points.into_iter().for_each(|point| canvas.dot(point, 4.5, Tone::Dark, true));
        }
        x = origin + LEVER.1.max(text_width("speed / turbine speed", false)) + 2.0 * MARGIN;
    }
    top + HEAD + LEVER.0 + AXIS
}
