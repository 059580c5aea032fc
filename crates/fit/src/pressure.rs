//! Pressure of a clutch from the commands of its valve.

use drivetrain::{ClutchValve, Cylinder, Play, Real};

use crate::Series;

/// What is between the command of a clutch and the pressure on its plates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hydraulics {
    pub(crate) valve: ClutchValve<f64>,
    pub(crate) hysteresis_pa: f64,
    /// The cylinder of a piston with a stroke; none where the pressure of the valve acts on the plates.
    pub(crate) cylinder: Option<Cylinder<f64>>,
}

impl Hydraulics {
    /// Those of a clutch of a vehicle file.
    pub(crate) fn of(clutch: &car::ShiftClutch) -> Self {
        let cylinder = clutch.has_stroke.then_some(clutch.cylinder);
        Self { valve: clutch.valve, hysteresis_pa: clutch.hysteresis_pa, cylinder }
    }

    /// The same with a piston that has ended its stroke: the pressure is that of the valve, but for what the oil needs to flow.
    pub(crate) fn filled(&self) -> Self {
        let filled = |cylinder: Cylinder<f64>| Cylinder {
            stroke_m3: 0.0,
            preload_pa: cylinder.kiss_pa,
            home_capacity_m3_pa: cylinder.capacity_m3_pa,
            ..cylinder
        };
        Self { cylinder: self.cylinder.map(filled), ..*self }
    }

    /// With these logarithms of factors on lag and gain of the valve.
    pub(crate) fn with_valve(&self, log_lag: f64, log_gain: f64) -> Self {
        Self { valve: self.valve.changed(Real::exp(log_lag), Real::exp(log_gain), None), ..*self }
    }

    /// Multiplies the volume of the piston's stroke.
    pub(crate) fn scale_stroke(&mut self, factor: f64) {
        if let Some(cylinder) = &mut self.cylinder {
            cylinder.stroke_m3 *= factor;
        }
    }

    /// Multiplies the preload of its spring, which stays below the force at the kiss point.
    pub(crate) fn scale_preload(&mut self, factor: f64) {
        if let Some(cylinder) = &mut self.cylinder {
            cylinder.preload_pa = (factor * cylinder.preload_pa).min(cylinder.kiss_pa);
        }
    }

    /// Moves the kiss point of the cylinder, and the preload of its spring by the same factor.
    pub(crate) fn set_kiss(&mut self, kiss_pa: f64) {
        if let Some(cylinder) = &mut self.cylinder {
            // A spring without force has no ratio to another.
            let fraction = if cylinder.kiss_pa > 0.0 { cylinder.preload_pa / cylinder.kiss_pa } else { 0.0 };
            cylinder.kiss_pa = kiss_pa.max(0.0);
            cylinder.preload_pa = fraction * cylinder.kiss_pa;
        }
    }
}

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

    /// The value at a time between the points, by the line through the two next to it.
    pub(crate) fn at(&self, values: &[f64], time_s: f64) -> f64 {
        let place = (time_s - self.begin_s) / self.step_s;
        let before = (place.max(0.0) as usize).min(values.len().saturating_sub(2));
        values[before] + (place - before as f64) * (values[before + 1] - values[before])
    }
}

/// Pressure at the points of a grid, Pa, of a clutch whose commands arrive `late_s` after the delay of its valve.
///
/// Each command is held until the next arrives, at its exact time: rounded to the grid, the pressure would have no
/// derivative by the delay. Before the first command the valve rests, and so does the piston.
pub(crate) fn pressures(of: &Hydraulics, late_s: f64, commands: &Series, grid: Grid) -> Vec<f64> {
    let valve = &of.valve;
    let mut arrivals = arrivals(valve, late_s, commands).into_iter().peekable();
    let first = commands.value.first().map_or(0.0, |command| valve.settled_pressure(*command));
    let mut play = Play::new(of.hysteresis_pa, first);
    let (mut settled_pa, mut valve_pa) = (first, first);
    let mut piston = of.cylinder.map(|cylinder| Piston { cylinder, volume_m3: cylinder.volume(first.max(0.0)) });
    // The valve runs from its first command on, however long before the grid that is.
    let mut now_s = commands.time_s.first().copied().unwrap_or(grid.begin_s).min(grid.begin_s);
    let mut result = Vec::with_capacity(grid.points);
    for i in 0..grid.points {
        let until_s = grid.time_s(i);
        loop {
            let next_s = arrivals.peek().map_or(f64::INFINITY, |(time_s, _)| *time_s);
            let end_s = next_s.min(until_s);
            while now_s < end_s {
                let dt_s = (end_s - now_s).min(grid.step_s);
                let before_pa = valve_pa;
                valve_pa = step(valve, settled_pa, valve_pa, dt_s);
                if let Some(piston) = &mut piston {
                    piston.step(0.5 * (before_pa + valve_pa), dt_s);
                }
                now_s += dt_s;
            }
            if next_s > until_s {
                break;
            }
            if let Some((_, command)) = arrivals.next() {
                settled_pa = play.follow(valve.settled_pressure(command));
            }
        }
        result.push(piston.map_or(valve_pa, |piston| piston.cylinder.pressure(piston.volume_m3)));
    }
    result
}

/// When commands arrive at a valve, each with its command.
///
/// A reading that would arrive after a later one is left out: a command that is only held was sent long before, and does not hold back the
/// next one, which may have less delay. In the plant commands keep their order; that differs where a command changes twice within the
/// difference of the delays.
fn arrivals(valve: &ClutchValve<f64>, late_s: f64, commands: &Series) -> Vec<(f64, f64)> {
    let mut arrivals: Vec<(f64, f64)> = Vec::with_capacity(commands.len());
    for (time_s, command) in commands.time_s.iter().zip(&commands.value) {
        let arrival_s = time_s + valve.delay(*command) + late_s;
        while arrivals.last().is_some_and(|(before_s, _)| *before_s >= arrival_s) {
            arrivals.pop();
        }
        arrivals.push((arrival_s, *command));
    }
    arrivals
}

/// A piston with the oil behind it.
#[derive(Clone, Copy)]
struct Piston {
    cylinder: Cylinder<f64>,
    volume_m3: f64,
}

impl Piston {
    /// Goes on by a short time under a constant pressure of the valve.
    ///
    /// The rate of the oil is stiff where the plates touch, and its slope jumps at the ends of the stroke. Between them it is taken as a line, whose
    /// solution is known (exponential Euler, second order), and a step ends where it meets an end of the stroke: so the pressure is a continuous
    /// function of every parameter.
    fn step(&mut self, valve_pa: f64, dt_s: f64) {
        /// A volume that lies beyond an end of the stroke for sure, m^3.
        const BEYOND_M3: f64 = 1e-16;
        let cylinder = self.cylinder;
        let mut left_s = dt_s;
        // Three ends, each passed at most once, and the rest of the way.
        for _ in 0..4 {
            let rate = cylinder.volume_rate(self.volume_m3, valve_pa);
            let (slope, _) = cylinder.volume_rate_slopes(self.volume_m3, valve_pa);
            let sign = rate.signum();
            let ends = [-cylinder.preload_pa * cylinder.home_capacity_m3_pa, 0.0, cylinder.stroke_m3];
            let ahead = ends.into_iter().map(|end| end + sign * BEYOND_M3 - self.volume_m3);
            let end = ahead.filter(|way| way * sign > 0.0).min_by(|one, other| one.abs().total_cmp(&other.abs()));
            let way =
                if (slope * left_s).abs() > 1e-9 { rate * Real::exp_m1(slope * left_s) / slope } else { rate * left_s };
            match end {
                Some(end) if way.abs() > end.abs() => {
                    let fraction = slope * end / rate;
                    let passed_s = if fraction.abs() > 1e-9 { Real::ln_1p(fraction) / slope } else { end / rate };
                    self.volume_m3 += end;
                    left_s -= passed_s;
                }
                _ => {
                    self.volume_m3 += way;
                    return;
                }
            }
        }
    }
}

/// The pressure after a short time. The lag of a proportional valve is taken at the middle of the step: at its beginning
/// it would be a quarter of a percent too long on a ramp.
fn step(valve: &ClutchValve<f64>, settled_pa: f64, pressure_pa: f64, dt_s: f64) -> f64 {
    match valve {
        ClutchValve::Proportional(maps) | ClutchValve::NormallyHigh { maps, .. } => {
            let middle_pa = pressure_pa + 0.5 * dt_s * maps.pressure_rate(pressure_pa, settled_pa);
            settled_pa + (pressure_pa - settled_pa) * Real::exp(-dt_s / maps.time_constant_s.at(middle_pa))
        }
        ClutchValve::PulseWidth { .. } => {
            let step = valve.step(settled_pa, pressure_pa, dt_s);
            step.phi * pressure_pa + step.drift_pa
        }
    }
}

#[cfg(test)]
mod tests {
    use config::VehicleFile;

    use super::*;

    fn clutch() -> car::ShiftClutch {
        let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_stroke.toml"));
        VehicleFile::read(path).unwrap().oncoming
    }

    /// Commands every 10 ms: empty, a pulse, a hold above the kiss point, a higher pressure and empty again.
    fn commands(clutch: &car::ShiftClutch) -> Series {
        let course = [(0.1, 0.0), (0.2, 0.21e6), (0.3, 0.08e6), (0.3, 0.4e6), (1.0, 0.0)];
        let mut series = Series::default();
        let mut begin = 0.0;
        for (length_s, pressure_pa) in course {
            let mut time_s = begin;
            while time_s < begin + length_s - 1e-9 {
                series.push(time_s, clutch.valve.command_for(pressure_pa));
                time_s += 0.01;
            }
            begin += length_s;
        }
        series
    }

    fn on_grid(of: &Hydraulics, commands: &Series, step_s: f64) -> Vec<f64> {
        let every = (2e-3 / step_s).round() as usize;
        let grid = Grid { begin_s: 0.0, step_s, points: 1 + 950 * every };
        pressures(of, 0.0, commands, grid).into_iter().step_by(every).collect()
    }

    #[test]
    fn the_pressure_behind_a_piston_does_not_depend_on_the_step() {
        let clutch = clutch();
        let (of, commands) = (Hydraulics::of(&clutch), commands(&clutch));
        let (coarse, fine) = (on_grid(&of, &commands, 2e-3), on_grid(&of, &commands, 2e-5));
        // Near an end of the stroke it rises by 20 kPa within a millisecond.
        let errors: Vec<f64> = coarse.iter().zip(&fine).map(|(one, other)| (one - other).abs()).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!(
            mean < 100.0 && errors.iter().all(|error| *error < 6e3),
            "{mean} {:?}",
            errors.iter().cloned().fold(0.0, f64::max)
        );
        assert!(fine.iter().any(|pressure| *pressure > 0.35e6) && fine.iter().all(|pressure| *pressure >= 0.0));
        // The time on the plateau is that of the fill: at least the stroke over the flow of the pulse.
        let plateau = fine.iter().filter(|p| (clutch.cylinder.preload_pa..clutch.cylinder.kiss_pa).contains(p)).count();
        assert!(plateau > 70, "{plateau}");
    }

    /// A step that jumped over an end of the stroke would make the pressure a rough function of the volume.
    #[test]
    fn the_derivative_by_the_volume_is_that_of_a_smaller_difference() {
        let clutch = clutch();
        let commands = commands(&clutch);
        let with = |factor: f64| {
            let mut of = Hydraulics::of(&clutch);
            of.scale_stroke(factor);
            on_grid(&of, &commands, 2e-3)
        };
        let base = with(1.0);
        let slopes = |h: f64| -> Vec<f64> { with(1.0 + h).iter().zip(&base).map(|(a, b)| (a - b) / h).collect() };
        let (one, other) = (slopes(1e-3), slopes(1e-4));
        let norm = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
        let difference: Vec<f64> = one.iter().zip(&other).map(|(a, b)| a - b).collect();
        assert!(norm(&one) > 1e6 && norm(&difference) < 0.1 * norm(&one), "{} {}", norm(&one), norm(&difference));
    }

    /// A log at any rate shows the same step: the command before it is held and was sent long ago.
    #[test]
    fn a_command_that_is_held_does_not_hold_back_the_next_one() {
        let of = Hydraulics { cylinder: None, ..Hydraulics::of(&clutch()) };
        let at_rate = |step_s: f64| {
            let mut series = Series::default();
            (0..(0.3 / step_s).round() as u32).for_each(|i| {
                let time_s = step_s * f64::from(i);
                series.push(time_s, if time_s < 0.2 - 1e-9 { 0.0 } else { 0.3 });
            });
            pressures(&of, 0.0, &series, Grid { begin_s: 0.0, step_s: 2e-3, points: 140 })
        };
        let slow = at_rate(0.1);
        for rate in [0.01, 0.001] {
            let fast = at_rate(rate);
            let maximum = slow.iter().zip(&fast).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // Steps are cut at every arrival, which changes the integral by some pascals.
            assert!(maximum < 50.0 && fast[139] > 30e3, "{rate}: {maximum}");
        }
    }

    #[test]
    fn a_kiss_point_moves_with_the_preload() {
        let mut of = Hydraulics::of(&clutch());
        let fraction = of.cylinder.unwrap().preload_pa / of.cylinder.unwrap().kiss_pa;
        of.set_kiss(80e3);
        let cylinder = of.cylinder.unwrap();
        assert!((cylinder.kiss_pa - 80e3).abs() < 1e-9 && (cylinder.preload_pa - fraction * 80e3).abs() < 1e-9);
        of.set_kiss(-1.0);
        assert_eq!(of.cylinder.unwrap().preload_pa, 0.0);
    }
}
