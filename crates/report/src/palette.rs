//! Strokes of curves: black and grey for what is simulated, one colour for each kind and design of observer.
//!
//! The observers' colours are those of Okabe and Ito and of Tol, which colour-blind readers tell apart, with neighbours of
//! another lightness for observers of one kind. They follow from the experiment's entry alone, so that an observer has the
//! same colour in every figure. Entries of one kind and design, as with other gains, differ in their dashes.

use car::{GainMethod, ObserverEntry, ObserverKind};

use crate::drawing::Pen;

/// Black: the truth of the main quantity.
const BLACK: &str = "#000000";
/// The open loop, and signals beside the main quantity.
const GREY: &str = "#767676";

/// The guaranteed range, which is the same around every observer: the colour of the default one.
pub(crate) const RANGE: &str = "#0072B2";
/// That of a range around another one.
pub(crate) const WIDE_RANGE: &str = "#777777";

/// A family of curves over one parameter, from low to high: dark to light of the map viridis.
pub const FAMILY: [Stroke; 6] = [
    Stroke { colour: "#440154", weight: Weight::Equal, dash: None },
    Stroke { colour: "#414487", weight: Weight::Equal, dash: Some("8 3") },
    Stroke { colour: "#2A788E", weight: Weight::Equal, dash: Some("3 2") },
    Stroke { colour: "#22A884", weight: Weight::Equal, dash: None },
    Stroke { colour: "#5FB336", weight: Weight::Equal, dash: Some("8 3") },
    Stroke { colour: "#B8A50A", weight: Weight::Equal, dash: Some("3 2") },
];

/// Dashes of the second and further entries of one kind and design.
const DASHES: [Option<&str>; 4] = [None, Some("7 2.5"), Some("2.5 2"), Some("9 2.5 2 2.5")];

/// How strongly a curve is drawn; a stronger one lies above the weaker, and the truth above all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// One observer among others.
    Rival,
    /// One of several signals of equal interest.
    Equal,
    /// The observer that the figure is about.
    Main,
    /// The truth, drawn within the stroke of the main observer where the two coincide.
    Truth,
}

impl Weight {
    /// Width of the stroke, pixels.
    pub(crate) fn width(self) -> f64 {
        match self {
            Self::Rival => 1.25,
            Self::Equal => 1.7,
            Self::Main => 3.2,
            Self::Truth => 1.3,
        }
    }
}

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Its colour.
    pub colour: &'static str,
    /// How strongly.
    pub weight: Weight,
    /// Lengths of its dashes and gaps, pixels, if it is not solid.
    pub dash: Option<&'static str>,
}

impl Stroke {
    pub(crate) fn pen(&self) -> Pen<'_> {
        Pen { colour: self.colour, width: self.weight.width(), dash: self.dash }
    }

    /// The truth of the main quantity of a panel.
    pub const TRUTH: Self = Self { colour: BLACK, weight: Weight::Truth, dash: None };
    /// A signal.
    pub const SIGNAL: Self = Self { colour: BLACK, weight: Weight::Equal, dash: None };
    /// A second signal.
    pub const SECOND: Self = Self { colour: BLACK, weight: Weight::Equal, dash: Some("2 2.5") };
    /// A third signal.
    pub const THIRD: Self = Self { colour: GREY, weight: Weight::Equal, dash: None };
}

/// The observer that a figure is about: the Kalman filter, which is the default, or else the first that corrects.
pub fn main_observer<'a>(entries: impl Iterator<Item = &'a ObserverEntry> + Clone) -> usize {
    let first = |wanted: fn(ObserverKind) -> bool| entries.clone().position(|entry| wanted(entry.kind));
    let kalman = first(|kind| kind == ObserverKind::Kalman);
    kalman.or_else(|| first(|kind| kind != ObserverKind::OpenLoop)).unwrap_or(0)
}

/// The strokes of these observers in one figure.
pub fn observer_strokes<'a>(entries: impl Iterator<Item = &'a ObserverEntry> + Clone) -> Vec<Stroke> {
    let main = main_observer(entries.clone());
    let mut seen: Vec<&str> = Vec::new();
    entries
        .enumerate()
        .map(|(at, entry)| {
            let colour = observer_colour(entry.kind, entry.method);
            let earlier = seen.iter().filter(|&&other| other == colour).count();
            seen.push(colour);
            let dash = match entry.kind {
                ObserverKind::OpenLoop => Some("6 3"),
                _ => DASHES[earlier % DASHES.len()],
            };
            Stroke { colour, weight: if at == main { Weight::Main } else { Weight::Rival }, dash }
        })
        .collect()
}

/// The colour of an observer in all figures.
fn observer_colour(kind: ObserverKind, method: GainMethod) -> &'static str {
    match (kind, method) {
        (ObserverKind::OpenLoop, _) => GREY,
        (ObserverKind::OpenLoopMaps, _) => "#4D4D4D",
        (ObserverKind::Gearbox, _) => "#003F72",
        (ObserverKind::Kalman, _) => "#0072B2",
        (ObserverKind::Extended, _) => "#56B4E9",
        (ObserverKind::Unscented, _) => "#332288",
        (ObserverKind::Rigid, GainMethod::Iss) => "#D55E00",
        (ObserverKind::Rigid, GainMethod::IssDiscrete) => "#882255",
        (ObserverKind::Rigid, GainMethod::PeakToPeak) => "#E69F00",
        (ObserverKind::Rigid, GainMethod::Scheduled) => "#8C510A",
        (ObserverKind::Rigid, GainMethod::Interval) => "#B8A50A",
        (ObserverKind::Compliant, GainMethod::Iss) => "#009E73",
        (ObserverKind::Compliant, GainMethod::IssDiscrete) => "#44AA99",
        (ObserverKind::Compliant, GainMethod::PeakToPeak) => "#117733",
        (ObserverKind::Compliant, GainMethod::Scheduled) => "#66A61E",
        (ObserverKind::Compliant, GainMethod::Interval) => "#6B6B00",
        (ObserverKind::Sliding, _) => "#CC79A7",
        (ObserverKind::SuperTwisting, _) => "#6A3D9A",
        (ObserverKind::Inversion, _) => "#DC267F",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [ObserverKind; 11] = [
        ObserverKind::OpenLoop,
        ObserverKind::OpenLoopMaps,
        ObserverKind::Rigid,
        ObserverKind::Compliant,
        ObserverKind::Sliding,
        ObserverKind::Gearbox,
        ObserverKind::Kalman,
        ObserverKind::Extended,
        ObserverKind::Unscented,
        ObserverKind::SuperTwisting,
        ObserverKind::Inversion,
    ];

    fn entry(kind: ObserverKind, method: GainMethod) -> ObserverEntry {
        ObserverEntry {
            name: "any".into(),
            kind,
            method,
            sample_time_s: 0.01,
            discretisation: observer::Discretisation::Exact,
            real_sensors: false,
            gains: None,
        }
    }

    /// Contrast to white as the Web Content Accessibility Guidelines define it.
    fn contrast(colour: &str) -> f64 {
        let channel = |at: usize| {
            let c = f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        1.05 / (0.05 + 0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5))
    }

    #[test]
    fn every_kind_and_design_has_a_colour_of_its_own_that_shows_on_white() {
        let mut colours = Vec::new();
        for kind in KINDS {
            let designed = matches!(kind, ObserverKind::Rigid | ObserverKind::Compliant);
            let methods = if designed { &GainMethod::ALL[..] } else { &GainMethod::ALL[..1] };
            colours.extend(methods.iter().map(|&method| observer_colour(kind, method)));
        }
        // Orange and sky of Okabe and Ito have a contrast of 2.2 and 2.3.
        assert!(colours.iter().all(|colour| contrast(colour) > 2.0 && *colour != BLACK));
        let all = colours.len();
        colours.sort_unstable();
        colours.dedup();
        assert_eq!((colours.len(), all), (19, 19));
    }

    #[test]
    fn the_kalman_filter_is_strongest_wherever_it_stands_and_keeps_its_colour() {
        let kalman = entry(ObserverKind::Kalman, GainMethod::Iss);
        let open_loop = entry(ObserverKind::OpenLoop, GainMethod::Iss);
        let rigid = entry(ObserverKind::Rigid, GainMethod::Iss);
        let last = observer_strokes([&open_loop, &rigid, &kalman].into_iter());
        let first = observer_strokes([&kalman, &rigid].into_iter());
        assert_eq!((last[2], last[1]), (first[0], first[1]));
        assert_eq!(last.iter().map(|s| s.weight).max(), Some(Weight::Main));
        assert_eq!((last[2].weight, last[1].weight), (Weight::Main, Weight::Rival));
        // Without it the first that corrects is.
        assert_eq!(main_observer([&open_loop, &rigid].into_iter()), 1);
        assert_eq!(main_observer([&open_loop].into_iter()), 0);
        assert_eq!(main_observer([].into_iter()), 0);
    }

    #[test]
    fn observers_of_one_design_differ_in_their_dashes() {
        let compliant = entry(ObserverKind::Compliant, GainMethod::Iss);
        let strokes = observer_strokes([&compliant, &compliant, &compliant].into_iter());
        assert!(strokes[0].colour == strokes[1].colour && strokes[1].colour == strokes[2].colour);
        assert!(strokes[0].dash != strokes[1].dash && strokes[1].dash != strokes[2].dash);
    }
}
