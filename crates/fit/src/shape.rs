//! Maps of the oncoming clutch whose shape a fit can free, and where it changes them.

use config::Vehicle;
use drivetrain::{ClutchValve, Table1};

use crate::Parameter;

/// A map of the oncoming clutch whose shape a fit frees where the residuals ask for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Map {
    /// Friction over slip.
    Friction,
    /// Lag of the valve over pressure.
    Lag,
    /// Gain of the valve over its command.
    Gain,
}

impl Map {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Friction, Self::Lag, Self::Gain];

    /// A name for the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Friction => "friction over slip",
            Self::Lag => "valve lag over pressure",
            Self::Gain => "valve gain over command",
        }
    }

    /// The two numbers of its freed shape.
    pub fn parameters(self) -> [Parameter; 2] {
        [Parameter::Shape(self, 0), Parameter::Shape(self, 1)]
    }
}

/// Slips at which a freed friction has a point of its own besides 0, 100 and 300 rad/s, rad/s; each change falls linearly
/// to none at the points beside it.
const FRICTION_POINTS_RAD_S: [[f64; 3]; 2] = [[0.0, 30.0, 100.0], [100.0, 200.0, 300.0]];

/// Where the freed shapes of the valve's maps change: below the first and beyond the last point the whole change, none at the middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Knots {
    pressure_pa: [f64; 3],
    /// None for a valve without maps.
    command: Option<[f64; 3]>,
}

impl Knots {
    /// The pressures of shifts: the kiss point, and by the error budget's `shift_pressure_pa` half and one and a half of what a shift
    /// at small throttle has above it.
    pub(crate) fn of(vehicle: &Vehicle) -> Self {
        let kiss_pa = vehicle.oncoming.clutch.kiss_pressure();
        let pressure_pa = [0.0, 0.5, 1.5].map(|share| kiss_pa + share * vehicle.error_bounds.shift_pressure_pa);
        let command = vehicle.oncoming.valve.maps().map(|maps| pressure_pa.map(|p| maps.current_for(p)));
        Self { pressure_pa, command: command.filter(|at| at[0] < at[1] && at[1] < at[2]) }
    }

    /// The maps that can be freed: a valve that is driven by its duty cycle has no lag and gain maps.
    pub(crate) fn maps(&self) -> &'static [Map] {
        if self.command.is_some() { &Map::ALL } else { &Map::ALL[..1] }
    }

    /// A name for tables.
    pub(crate) fn name(&self, map: Map, number: usize) -> String {
        let end = 2 * number;
        match map {
            Map::Friction => format!("friction at {} rad/s", FRICTION_POINTS_RAD_S[number][1]),
            Map::Lag => format!("valve lag at {:.0} kPa", 1e-3 * self.pressure_pa[end]),
            Map::Gain => format!("valve gain at {:.2} A", self.command.map_or(0.0, |command| command[end])),
        }
    }

    /// The friction with a relative change of its shape.
    pub(crate) fn friction(&self, table: &Table1<f64>, number: usize, change: f64) -> Table1<f64> {
        let [from, middle, to] = FRICTION_POINTS_RAD_S[number];
        let hat = |slip: f64| ((slip - from) / (middle - from)).min((to - slip) / (to - middle)).max(0.0);
        mapped(&refined(table, &FRICTION_POINTS_RAD_S.concat()), |slip, mu| mu * (1.0 + change * hat(slip)))
    }

    /// The valve with a relative change of the shape of its lag or gain.
    pub(crate) fn valve(&self, valve: ClutchValve<f64>, map: Map, number: usize, change: f64) -> ClutchValve<f64> {
        let points = if map == Map::Lag { self.pressure_pa } else { self.command.unwrap_or(self.pressure_pa) };
        let changed = |table: &Table1<f64>| {
            mapped(&refined(table, &points), |x, value| value * (1.0 + change * end_share(points, number, x)))
        };
        let mut valve = valve;
        if let ClutchValve::Proportional(maps) | ClutchValve::NormallyHigh { maps, .. } = &mut valve {
            match map {
                Map::Lag => maps.time_constant_s = changed(&maps.time_constant_s),
                Map::Gain => maps.gain_pa_a = changed(&maps.gain_pa_a),
                Map::Friction => {}
            }
        }
        valve
    }
}

/// How much of the change at its lower (0) or upper (1) end a map has here.
fn end_share([low, middle, high]: [f64; 3], number: usize, x: f64) -> f64 {
    let share = if number == 0 { (middle - x) / (middle - low) } else { (x - middle) / (high - middle) };
    share.clamp(0.0, 1.0)
}

/// The same map with more points; as it is where a table has no room for them.
fn refined(table: &Table1<f64>, points: &[f64]) -> Table1<f64> {
    /// A point this near to another of the map, as a share of the whole axis, is the same: a file keeps five digits.
    const SAME: f64 = 1e-3;
    let mut axis = table.axis().to_vec();
    let near = SAME * (axis.last().copied().unwrap_or(0.0) - axis.first().copied().unwrap_or(0.0));
    for point in points {
        if axis.iter().all(|other| (other - point).abs() > near) {
            axis.push(*point);
        }
    }
    axis.sort_by(f64::total_cmp);
    let values: Vec<f64> = axis.iter().map(|x| table.at(*x)).collect();
    Table1::new(&axis, &values).unwrap_or(*table)
}

/// The table with other values on its axis.
pub(crate) fn mapped(table: &Table1<f64>, value: impl Fn(f64, f64) -> f64) -> Table1<f64> {
    let values: Vec<f64> = table.axis().iter().zip(table.values()).map(|(x, y)| value(*x, *y)).collect();
    // The axis is that of a table; only a value that is not finite can be refused, and the fit rejects such a step.
    Table1::new(table.axis(), &values).unwrap_or(*table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_freed_shape_without_a_change_is_the_map_of_the_file() {
        let vehicle = Vehicle::two_speed_at().unwrap();
        let knots = Knots::of(&vehicle);
        let clutch = &vehicle.oncoming.clutch;
        let friction = knots.friction(&clutch.friction, 0, 0.0);
        assert!(
            (0..500).all(|slip| (friction.at(f64::from(slip)) - clutch.friction.at(f64::from(slip))).abs() < 1e-15)
        );
        for map in [Map::Lag, Map::Gain] {
            let valve = knots.valve(vehicle.oncoming.valve, map, 0, 0.0);
            let (one, other) = (valve.maps().unwrap(), vehicle.oncoming.valve.maps().unwrap());
            for i in 0..100 {
                let (p, a) = (7e3 * f64::from(i), 0.01 * f64::from(i));
                assert!((one.time_constant_s.at(p) - other.time_constant_s.at(p)).abs() < 1e-15);
                assert!((one.settled_pressure(a) - other.settled_pressure(a)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_change_is_whole_at_its_point_and_none_at_the_next() {
        let vehicle = Vehicle::two_speed_at().unwrap();
        let knots = Knots::of(&vehicle);
        let before = vehicle.oncoming.clutch.friction;
        let after = knots.friction(&before, 1, -0.1);
        for (slip, factor) in [(0.0, 1.0), (100.0, 1.0), (200.0, 0.9), (300.0, 1.0), (400.0, 1.0)] {
            assert!((after.at(slip) / before.at(slip) - factor).abs() < 1e-12, "{slip}");
        }
        let [low, middle, high] = knots.pressure_pa;
        let lag = |valve: ClutchValve<f64>, p: f64| valve.lag(p, 0.0);
        let valve = knots.valve(vehicle.oncoming.valve, Map::Lag, 1, 0.2);
        for (p, factor) in [(0.5 * low, 1.0), (low, 1.0), (middle, 1.0), (high, 1.2), (2.0 * high, 1.2)] {
            assert!((lag(valve, p) / lag(vehicle.oncoming.valve, p) - factor).abs() < 1e-12, "{p}");
        }
    }
}
