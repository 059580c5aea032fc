//! Pressure of a clutch from the commands of its valve.

use drivetrain::{ClutchValve, Play};

use crate::Series;

/// A time grid that begins at `begin_s`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Grid {
    pub(crate) begin_s: f64,
    pub(crate) step_s: f64,
    pub(crate) points: usize,
}

impl Grid {
    pub(crate) fn time_s(&self, i: usize) -> f64 {
        self.begin_s + self.step_s * i as f64
    }
}

/// Pressure at the points of a grid, Pa, of a valve whose commands arrive `late_s` after their own delay.
///
/// Each command is held until the next arrives, at its exact time: rounded to the grid, the pressure would have no
/// derivative by the delay. Before the first command the valve rests.
pub(crate) fn pressures(
    valve: &ClutchValve<f64>,
    hysteresis_pa: f64,
    late_s: f64,
    commands: &Series,
    grid: Grid,
) -> Vec<f64> {
    let mut arrival_s = f64::NEG_INFINITY;
    let mut arrivals = (commands.time_s.iter().zip(&commands.value))
        .map(|(time_s, command)| {
            // Commands stay in their order, as in the plant.
            arrival_s = arrival_s.max(time_s + valve.delay(*command) + late_s);
            (arrival_s, *command)
        })
        .peekable();
    let first = commands.value.first().map_or(0.0, |command| valve.settled_pressure(*command));
    let mut play = Play::new(hysteresis_pa, first);
    let (mut settled_pa, mut pressure_pa) = (first, first);
    // The valve runs from its first command on, however long before the grid that is.
    let mut now_s = commands.time_s.first().copied().unwrap_or(grid.begin_s).min(grid.begin_s);
    let mut go_to = |until_s: f64, now_s: &mut f64, pressure_pa: &mut f64| {
        loop {
            let next_s = arrivals.peek().map_or(f64::INFINITY, |(time_s, _)| *time_s);
            let end_s = next_s.min(until_s);
            while *now_s < end_s {
                let dt_s = (end_s - *now_s).min(grid.step_s);
                *pressure_pa = step(valve, settled_pa, *pressure_pa, dt_s);
                *now_s += dt_s;
            }
            if next_s > until_s {
                return;
            }
            if let Some((_, command)) = arrivals.next() {
                settled_pa = play.follow(valve.settled_pressure(command));
            }
        }
    };
    let mut result = Vec::with_capacity(grid.points);
    for i in 0..grid.points {
        go_to(grid.time_s(i), &mut now_s, &mut pressure_pa);
        result.push(pressure_pa);
    }
    result
}

/// The pressure after a short time. The lag of a proportional valve is taken at the middle of the step: at its beginning
/// it would be a quarter of a percent too long on a ramp.
fn step(valve: &ClutchValve<f64>, settled_pa: f64, pressure_pa: f64, dt_s: f64) -> f64 {
    match valve {
        ClutchValve::Proportional(maps) | ClutchValve::NormallyHigh { maps, .. } => {
            let middle_pa = pressure_pa + 0.5 * dt_s * maps.pressure_rate(pressure_pa, settled_pa);
            settled_pa + (pressure_pa - settled_pa) * (-dt_s / maps.time_constant_s.at(middle_pa)).exp()
        }
        ClutchValve::PulseWidth { .. } => {
            let step = valve.step(settled_pa, pressure_pa, dt_s);
            step.phi * pressure_pa + step.drift_pa
        }
    }
}
