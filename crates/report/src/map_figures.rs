//! Figures of the maps: engine, converter, friction, and the observer's `f1` and `f2`.

use car::Vehicle;
use observer::{Phase, RigidModel};
use trace::units::rpm;

use crate::figure::{Axis, Figure, Panel, Series, Stroke};
use crate::palette::FAMILY;

/// Points of a curve.
const POINTS: u32 = 200;
/// Slip of the figure of `f1` and `f2`, rad/s; they hardly depend on it.
const SLIP_RAD_S: f64 = 150.0;

/// The figures by file name.
pub fn map_figures(vehicle: &Vehicle, model: &RigidModel<f64>) -> Vec<(&'static str, Figure)> {
    vec![
        ("map_engine.svg", engine(vehicle)),
        ("map_converter.svg", converter(vehicle)),
        ("map_friction.svg", friction(vehicle)),
        ("map_f1_f2.svg", observer_maps(vehicle, model)),
    ]
}

fn curve(label: &str, stroke: Stroke, (from, to): (f64, f64), value: impl Fn(f64) -> (f64, f64)) -> Series {
    let at = |i: u32| from + (to - from) * f64::from(i) / f64::from(POINTS);
    Series { label: label.to_owned(), stroke, points: (0..=POINTS).map(|i| value(at(i))).collect() }
}

fn figure(x_label: &'static str, x_range: (f64, f64), panels: Vec<(&str, Vec<Series>)>) -> Figure {
    let panel = |(y_label, series): (&str, Vec<Series>)| Panel {
        y_label: y_label.to_owned(),
        height: 210.0,
        series,
        bands: Vec::new(),
        axis: Axis::All,
    };
    Figure { x_label: x_label.into(), x_range, spans: Vec::new(), panels: panels.into_iter().map(panel).collect() }
}

/// First and last value of the axis of a table.
fn ends(axis: &[f64]) -> (f64, f64) {
    (axis.first().copied().unwrap_or(0.0), axis.last().copied().unwrap_or(1.0))
}

/// Fig. 2.2.
fn engine(vehicle: &Vehicle) -> Figure {
    let (from, to) = ends(vehicle.engine.torque_n_m.rows());
    let throttles = [0.0, 0.05, 0.1, 0.2, 0.4, 1.0];
    let series = (throttles.iter().zip(FAMILY))
        .map(|(&throttle, stroke)| {
            let label = format!("throttle {:.0} %", 100.0 * throttle);
            curve(&label, stroke, (from, to), |w| (rpm(w), vehicle.engine.torque(w, throttle)))
        })
        .collect();
    figure("engine speed (rpm)", (rpm(from), rpm(to)), vec![("engine torque (N m)", series)])
}

/// Fig. 2.3.
fn converter(vehicle: &Vehicle) -> Figure {
    let converter = &vehicle.converter;
    let range = ends(converter.capacity_n_m_s2.axis());
    let capacity =
        curve("capacity C", Stroke::SIGNAL, range, |ratio| (ratio, 1e3 * converter.capacity_n_m_s2.at(ratio)));
    let torque = curve("torque ratio t", Stroke::SIGNAL, range, |ratio| (ratio, converter.torque_ratio.at(ratio)));
    figure(
        "speed ratio, turbine speed over engine speed",
        range,
        vec![("capacity (10⁻³ N m s²)", vec![capacity]), ("torque ratio", vec![torque])],
    )
}

/// Fig. 2.5.
fn friction(vehicle: &Vehicle) -> Figure {
    let friction = &vehicle.oncoming.clutch.friction;
    let range = ends(friction.axis());
    let series = curve("oncoming clutch", Stroke::SIGNAL, range, |slip| (slip, friction.at(slip)));
    figure("slip speed (rad/s)", range, vec![("friction coefficient", vec![series])])
}

/// Fig. 2.6: `f1` and `f2` of Eq. (2.18) over the turbine speed for several engine speeds.
fn observer_maps(vehicle: &Vehicle, model: &RigidModel<f64>) -> Figure {
    let (_, highest) = ends(vehicle.engine.torque_n_m.rows());
    // Round speeds from a sixth to two thirds of the engine's highest.
    let of = |fraction: f64| 50.0 * (fraction * highest / 50.0).round().max(1.0);
    let range = (of(0.15), of(0.7));
    let family = |output: usize| -> Vec<Series> {
        ([0.45, 0.6, 0.75].into_iter().map(of).zip(FAMILY))
            .map(|(engine, stroke)| {
                curve(&format!("engine {engine:.0} rad/s"), stroke, range, |turbine| {
                    let at = model.speed_model(Phase::InertiaPhase, engine, turbine, SLIP_RAD_S);
                    (turbine, at.free_rad_s2[output])
                })
            })
            .collect()
    };
    figure("turbine speed (rad/s)", range, vec![("f1 (rad/s²)", family(0)), ("f2 (rad/s²)", family(1))])
}
