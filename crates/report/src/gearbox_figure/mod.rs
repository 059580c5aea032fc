//! Diagrams of a gear train: how its parts are connected, and how they turn in a gear.
//!
//! Each shaft is a horizontal line, the housing the hatched line below them. A vertical line with dots is a planetary set,
//! a gear pair or an element; a dot connects it with a shaft. In the diagram of a gear, engaged elements are coloured, the
//! shaft speeds are drawn beside the shafts, and each planetary set is a lever: its members lie at distances of one over
//! their teeth, so that their speeds are on a straight line.

mod canvas;
mod connections;
mod layout;
mod levers;

use geartrain::{GearTrain, Gearbox};

use canvas::{Canvas, Tone};
use connections::Engaged;
use layout::Layout;

/// Space around the drawing, and between its parts.
const MARGIN: f64 = 16.0;
/// Height of the title.
const TITLE: f64 = 34.0;

/// The diagram of the train, where the gearbox has one.
pub fn train_figure(gearbox: &Gearbox) -> Option<String> {
    let train = gearbox.train.as_ref()?;
    let layout = Layout::new(train, MARGIN + TITLE, false);
    let mut canvas = Canvas::default();
    canvas.title(MARGIN, &gearbox.name);
    connections::draw(&mut canvas, train, &layout, None);
    connections::legend(&mut canvas, train, (MARGIN, layout.bottom() + MARGIN), None);
    Some(canvas.svg(MARGIN))
}

/// The diagram of a gear, where the gearbox has a stick diagram and the gear exists.
pub fn gear_figure(gearbox: &Gearbox, gear: usize) -> Option<String> {
    let (train, gear) = (gearbox.train.as_ref()?, gearbox.gears.get(gear)?);
    let torques = gear.holding.iter().map(|holding| (holding.element, holding.per_turbine_torque));
    let engaged = Engaged { torques: torques.collect(), speeds: &gear.shaft_speeds };
    let layout = Layout::new(train, MARGIN + TITLE, true);
    let mut canvas = Canvas::default();
    let names: Vec<&str> = gear.holding.iter().map(|holding| gearbox.elements[holding.element].name.as_str()).collect();
    canvas.title(
        MARGIN,
        &format!("{}, gear {}: ratio {:.4}, engaged {}", gearbox.name, gear.name, gear.ratio, names.join(", ")),
    );
    connections::draw(&mut canvas, train, &layout, Some(&engaged));
    let mut bottom = layout.bottom() + MARGIN;
    if !train.sets.is_empty() {
        bottom = levers::draw(&mut canvas, train, &gear.shaft_speeds, MARGIN, bottom) + MARGIN;
    }
    connections::legend(&mut canvas, train, (MARGIN, bottom), Some(&gear.shaft_speeds));
    Some(canvas.svg(MARGIN))
}

/// Name of a member.
fn member_name(train: &GearTrain, member: geartrain::Member) -> &str {
    match member {
        geartrain::Member::Housing => geartrain::HOUSING,
        geartrain::Member::Shaft(shaft) => &train.shafts[shaft].name,
    }
}

/// A speed with its digits; "free" where the gear leaves it open.
fn speed_text(speed: Option<f64>) -> String {
    speed.map_or_else(|| "free".to_owned(), |speed| format!("{:.3}", if speed.abs() < 5e-4 { 0.0 } else { speed }))
}

/// Colour of a part: coloured in its gear, grey where it is open.
fn tone(is_gear: bool, is_engaged: bool) -> Tone {
    match (is_gear, is_engaged) {
        (false, _) => Tone::Dark,
        (true, true) => Tone::Engaged,
        (true, false) => Tone::Open,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::{GearboxFile, Source};

    fn gearbox(text: &str) -> Gearbox {
        GearboxFile::from_source(Source::built_in("gearbox.toml", text)).unwrap().gearbox
    }

    const EIGHT_SPEED: &str = include_str!("../../../../gearboxes/8hp.toml");
    const DUAL_CLUTCH: &str = include_str!("../../../../gearboxes/dual_clutch_7.toml");

    #[test]
    fn the_diagram_names_every_shaft_element_and_tooth_count() {
        let svg = train_figure(&gearbox(EIGHT_SPEED)).unwrap();
        for part in [">sun12<", ">r2<", ">housing<", ">A<", ">E<", "sun 48", "ring 111", ">input<", ">output<"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(svg.ends_with("</svg>") && !svg.contains("NaN"));
    }

    #[test]
    fn the_diagram_of_a_gear_has_its_speeds_and_torques() {
        let svg = gear_figure(&gearbox(EIGHT_SPEED), 3).unwrap();
        // Third gear: output speed 1/2.1039, torque of C -0.656.
        for part in [">0.475<", ">-0.656<", "ratio 2.1039", "engaged B, C, E", "turbine speed"] {
            assert!(svg.contains(part), "{part}");
        }
    }

    #[test]
    fn a_shaft_that_the_gear_leaves_open_is_free() {
        let svg = gear_figure(&gearbox(DUAL_CLUTCH), 0).unwrap();
        assert!(svg.contains(">free<") && svg.contains(">D1<"));
        assert_eq!(gear_figure(&gearbox(DUAL_CLUTCH), 99), None);
    }

    /// Left and right end, base line and content of every text.
    fn texts(svg: &str) -> Vec<(f64, f64, f64, String)> {
        let attribute = |tag: &str, name: &str| {
            let from = tag.find(&format!(" {name}=\"")).unwrap() + name.len() + 3;
            tag[from..].split('"').next().unwrap().to_owned()
        };
        (svg.split("<text").skip(1))
            .map(|text| {
                let (tag, content) = text.split_once('>').unwrap();
                let content = content.split('<').next().unwrap().replace("&quot;", "\"");
                let [x, y] = ["x", "y"].map(|name| attribute(tag, name).parse::<f64>().unwrap());
                let width = crate::legend::width(&content);
                let left = match attribute(tag, "text-anchor").as_str() {
                    "middle" => x - width / 2.0,
                    "end" => x - width,
                    _ => x,
                };
                (left, left + width, y, content)
            })
            .collect()
    }

    #[test]
    fn no_text_lies_over_another_or_beyond_the_edge() {
        let others = [
            include_str!("../../../../gearboxes/10_speed.toml"),
            include_str!("../../../../gearboxes/lepelletier_6.toml"),
            include_str!("../../../../gearboxes/ravigneaux_4.toml"),
            include_str!("../../../../gearboxes/two_speed.toml"),
        ];
        for text in [EIGHT_SPEED, DUAL_CLUTCH].into_iter().chain(others) {
            let gearbox = gearbox(text);
            let gears = (0..gearbox.gears.len()).map(|gear| gear_figure(&gearbox, gear).unwrap());
            for svg in gears.chain(train_figure(&gearbox)) {
                let texts = texts(&svg);
                assert!(texts.iter().all(|text| text.0 >= 0.0 && text.2 >= 10.0), "{texts:?}");
                for (at, a) in texts.iter().enumerate() {
                    for b in &texts[at + 1..] {
                        let over = (a.2 - b.2).abs() < 12.0 && a.0 < b.1 && b.0 < a.1;
                        assert!(!over, "{}: {a:?} {b:?}", gearbox.name);
                    }
                }
            }
        }
    }

    #[test]
    fn names_are_text_and_never_markup() {
        let text = EIGHT_SPEED.replace("sun12", "<b>&").replace("8-speed (8HP70)", "<script>");
        let svg = train_figure(&gearbox(&text)).unwrap();
        assert!(svg.contains("&lt;b&gt;&amp;") && !svg.contains("<script>"));
    }
}
