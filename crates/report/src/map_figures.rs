//! Figures of the maps: engine, converter, friction, and the observer's `f1` and `f2`.

use config::Vehicle;
use observer::{Phase, RigidModel};
use trace::units::rpm;

use crate::figure::{Figure, Panel, Series, colour};

/// Colours of families of curves.
const FAMILY: [&str; 6] = [colour::BLUE, colour::SKY, colour::GREEN, colour::ORANGE, colour::VERMILION, colour::PURPLE];
/// Points of a curve.
const POINTS: u32 = 200;
/// Slip of the figure of `f1` and `f2`, rad/s; they hardly depend on it.
const SLIP_RAD_S: f64 = 150.0;

/// The figures by file name.
pub fn map_figures(vehicle: &Vehicle, model: &RigidModel<f64>) -> Vec<(&'static str, String)> {
    vec![
        ("map_engine.svg", engine(vehicle).svg()),
        ("map_converter.svg", converter(vehicle).svg()),
        ("map_friction.svg", friction(vehicle).svg()),
        ("map_f1_f2.svg", observer_maps(model).svg()),
    ]
}

fn curve(label: &str, colour: &'static str, from: f64, to: f64, value: impl Fn(f64) -> (f64, f64)) -> Series {
    let at = |i: u32| from + (to - from) * f64::from(i) / f64::from(POINTS);
    let points = (0..=POINTS).map(|i| value(at(i))).collect();
    Series { label: label.to_owned(), colour, dashed: false, points }
}

fn figure(x_label: &'static str, x_range: (f64, f64), panels: Vec<(&str, Vec<Series>)>) -> Figure {
    let panel = |(y_label, series): (&str, Vec<Series>)| Panel {
        y_label: y_label.to_owned(),
        height: 210.0,
        series,
        band: None,
        y_range: None,
    };
    Figure { x_label, x_range, spans: Vec::new(), panels: panels.into_iter().map(panel).collect() }
}

/// Fig. 2.2.
fn engine(vehicle: &Vehicle) -> Figure {
    let speeds = vehicle.engine.torque_n_m.rows();
    let (from, to) = (speeds[0], speeds[speeds.len() - 1]);
    let throttles = [0.0, 0.05, 0.1, 0.2, 0.4, 1.0];
    let series = (throttles.iter().zip(FAMILY))
        .map(|(&throttle, colour)| {
            let label = format!("throttle {:.0} %", 100.0 * throttle);
            curve(&label, colour, from, to, |w| (rpm(w), vehicle.engine.torque(w, throttle)))
        })
        .collect();
    figure("engine speed (rpm)", (rpm(from), rpm(to)), vec![("torque (N m)", series)])
}

/// Fig. 2.3.
fn converter(vehicle: &Vehicle) -> Figure {
    let converter = &vehicle.converter;
    let capacity =
        curve("capacity C", colour::BLUE, 0.0, 1.5, |ratio| (ratio, 1e3 * converter.capacity_n_m_s2.at(ratio)));
    let torque = curve("torque ratio t", colour::BLUE, 0.0, 1.5, |ratio| (ratio, converter.torque_ratio.at(ratio)));
    figure(
        "speed ratio, turbine over engine",
        (0.0, 1.5),
        vec![("C (10⁻³ N m s²)", vec![capacity]), ("torque ratio", vec![torque])],
    )
}

/// Fig. 2.5.
fn friction(vehicle: &Vehicle) -> Figure {
    let friction = &vehicle.oncoming.clutch.friction;
    let series = curve("clutch B", colour::BLUE, 0.0, 400.0, |slip| (slip, friction.at(slip)));
    let mut figure = figure("slip speed (rad/s)", (0.0, 400.0), vec![("friction coefficient", vec![series])]);
    figure.panels[0].y_range = Some((0.10, 0.16));
    figure
}

/// Fig. 2.6: `f1` and `f2` of Eq. (2.18) over the turbine speed for several engine speeds.
fn observer_maps(model: &RigidModel<f64>) -> Figure {
    let family = |output: usize| -> Vec<Series> {
        ([300.0, 400.0, 500.0].iter().zip(FAMILY))
            .map(|(&engine, colour)| {
                curve(&format!("engine {engine:.0} rad/s"), colour, 100.0, 450.0, |turbine| {
                    let at = model.speed_model(Phase::InertiaPhase, engine, turbine, SLIP_RAD_S);
                    (turbine, at.free_rad_s2[output])
                })
            })
            .collect()
    };
    figure("turbine speed (rad/s)", (100.0, 450.0), vec![("f1 (rad/s²)", family(0)), ("f2 (rad/s²)", family(1))])
}
