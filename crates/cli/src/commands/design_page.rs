//! The page of `wetclutch design`: bound, gain and decay of the error over the settling time.

use car::Vehicle;
use config::Source;
use design::compliant::{best_compliant_phase, compliant_requirement};
use design::rigid::best_phase;
use design::{IssRequirement, Model, open_loop_bound_pa, requirement};
use observer::Phase;
use report::figure::{Axis, Figure, Panel, Series, Stroke};
use report::palette::FAMILY;
use report::sheet::{Content, Part, Sheet};
use report::tables::{capital, phase_name};
use trace::units::mpa;
use wetclutch::gains::SAMPLE_TIME_S;

use crate::args::{Design, DesignChoice, MethodChoice};

/// Settling times of the curves, over that of the design.
const FACTORS: [f64; 11] = [0.25, 0.35, 0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 3.0, 4.0];

/// A design for another settling time.
struct Point {
    settling_s: f64,
    offset_pa: f64,
    /// Entries of the gain, each with its name.
    gain: Vec<(String, f64)>,
    /// Slowest decay of the error at each vertex, 1/s.
    decays: Vec<(String, f64)>,
}

/// The page; `text` is what the command prints.
pub(super) fn sheet<'a>(
    vehicle: &'a Vehicle,
    source: &'a Source,
    options: &Design,
    (about, text): (&[String], &[String]),
) -> Sheet<'a> {
    let is_swept = options.method() == MethodChoice::Iss && options.observer != DesignChoice::Sliding;
    let phases = options.phases().iter().filter(|_| is_swept);
    let mut parts: Vec<Part> = phases.filter_map(|&phase| phase_part(vehicle, phase, options)).collect();
    parts.push(Part {
        heading: Some("Gains and certificates".to_owned()),
        content: Content::Lines(text.to_vec()),
        caption: String::new(),
    });
    Sheet {
        name: &vehicle.name,
        title: "design",
        lead: format!("gains of the {} observer, with their certificates", options.observer.name()),
        sentences: about.to_vec(),
        parts,
        sources: vec![source],
    }
}

fn phase_part(vehicle: &Vehicle, phase: Phase, options: &Design) -> Option<Part> {
    let required = options.library().replaced(IssRequirement::from(requirement(vehicle, phase)));
    let model = if options.observer == DesignChoice::Rigid { Model::Rigid } else { Model::Compliant };
    let settling_s = 4.0 / required.kappa2_per_s;
    let points: Vec<Point> =
        FACTORS.iter().filter_map(|factor| point(vehicle, phase, options, factor * settling_s)).collect();
    let first = points.first()?;
    let open_loop_pa = open_loop_bound_pa(vehicle, model, phase, SAMPLE_TIME_S);
    let curve = |label: &str, stroke: Stroke, value: &dyn Fn(&Point) -> f64| Series {
        label: label.to_owned(),
        stroke,
        points: points.iter().map(|point| (point.settling_s, value(point))).collect(),
    };
    let bounds = vec![
        curve("certified", FAMILY[2], &|point| mpa(point.offset_pa)),
        curve("open loop", Stroke::THIRD, &|_| mpa(open_loop_pa)),
        curve("required", Stroke::SECOND, &|_| mpa(required.offset_max_pa)),
    ];
    let named = |names: &[(String, f64)], of: fn(&Point) -> &[(String, f64)]| -> Vec<Series> {
        let strokes = names.iter().zip(FAMILY.iter().cycle()).enumerate();
        strokes.map(|(at, ((name, _), stroke))| curve(name, *stroke, &|point| of(point)[at].1)).collect()
    };
    let panel = |y_label: &str, series| Panel {
        y_label: y_label.to_owned(),
        height: 140.0,
        series,
        bands: Vec::new(),
        axis: Axis::All,
    };
    let unit = if model == Model::Rigid { "gain (Pa s/rad)" } else { "gain, normalised" };
    let figure = Figure {
        x_label: "settling time (s)".into(),
        x_range: (first.settling_s, points.last()?.settling_s),
        spans: Vec::new(),
        panels: vec![
            panel("steady-state bound (MPa)", bounds),
            panel(unit, named(&first.gain, |point| &point.gain)),
            panel("decay of the error (1/s)", named(&first.decays, |point| &point.decays)),
        ],
    };
    Some(Part {
        heading: Some(format!("{}, settling time {settling_s:.3} s", capital(phase_name(phase)))),
        content: Content::Figure(figure),
        caption: "Bound on the error of the pressure, gain, and slowest decay of the error (the real part of the pole, with the other sign) at each \
                  vertex, for designs with other settling times. The certified bound is for model errors and an exact valve model; that of the open loop is for \
                  every error of the budget. Where there is no curve, no gain is certified."
            .to_owned(),
    })
}

/// The design for a settling time; none where no gain is certified.
fn point(vehicle: &Vehicle, phase: Phase, options: &Design, settling_s: f64) -> Option<Point> {
    let kappa2_per_s = 4.0 / settling_s;
    if options.observer == DesignChoice::Rigid {
        let required = options.library().replaced(IssRequirement::from(requirement(vehicle, phase)));
        let (certificate, _) = best_phase(vehicle, phase, &IssRequirement { kappa2_per_s, ..required }).ok()?;
        let names = ["turbine speed", "slip"].map(str::to_owned).into_iter().zip(certificate.gain_pa_s_rad);
        let outputs = if phase == Phase::TorquePhase { 1 } else { 2 };
        let decays = certificate.vertices.iter().map(|vertex| (vertex.vertex.label.clone(), vertex.decay_per_s));
        return Some(Point {
            settling_s,
            offset_pa: certificate.offset_pa,
            gain: names.take(outputs).collect(),
            decays: decays.collect(),
        });
    }
    let mut required = options.library().replaced_compliant(compliant_requirement(vehicle, phase));
    required.kappa2_per_s = kappa2_per_s;
    let (certificate, _) = best_compliant_phase(vehicle, phase, &required).ok()?;
    let rows = ["shaft torque", "pressure"].iter().zip(&certificate.gain_normalised);
    let entries = rows.flat_map(|(row, gains)| {
        gains.iter().enumerate().map(move |(output, gain)| (format!("{row}, output {}", output + 1), *gain))
    });
    let decays = certificate.vertices.iter().map(|vertex| (vertex.label.clone(), vertex.decay_per_s));
    Some(Point { settling_s, offset_pa: certificate.offset_pa, gain: entries.collect(), decays: decays.collect() })
}
