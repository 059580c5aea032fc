//! Maps whose shape a fit can free, and where it changes them.

use std::ops::Div;

use car::Vehicle;
use drivetrain::{ClutchValve, Table1};

use crate::Parameter;

/// A map whose shape a fit frees where the shifts ask for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Map {
    /// Friction over slip.
    Friction,
    /// Lag of the valve over pressure.
    Lag,
    /// Gain of the valve over its command.
    Gain,
    /// Capacity of the converter over its speed ratio.
    Capacity,
}

impl Map {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Friction, Self::Lag, Self::Gain, Self::Capacity];

    /// A name for the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Friction => "friction over slip",
            Self::Lag => "valve lag over pressure",
            Self::Gain => "valve gain over command",
            Self::Capacity => "converter capacity over speed ratio",
        }
    }

    /// The two numbers of its freed shape.
    pub fn parameters(self) -> [Parameter; 2] {
        [Parameter::Shape(self, 0), Parameter::Shape(self, 1)]
    }

    /// Pairs of numbers of a finer shape than a fit gives it.
    pub(crate) fn finer(self) -> &'static [[usize; 2]] {
        match self {
            Self::Capacity => &[[2, 3]],
            _ => &[[2, 3], [4, 5]],
        }
    }
}

/// A relative change of a map: whole at a point, and falling linearly to none at the points beside it. Without a point on one side the whole
/// change lasts to the end of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bend {
    from: f64,
    peak: f64,
    to: f64,
    /// Distance over which the map changes by what is known of it before, see [`Self::sd_fraction`].
    span: f64,
}

impl Bend {
    const fn between([from, peak, to]: [f64; 3], span: f64) -> Self {
        Self { from, peak, to, span }
    }

    fn at(self, x: f64) -> f64 {
        let (end, other) = if x < self.peak { (self.from, x - self.from) } else { (self.to, self.to - x) };
        if end.is_finite() { (other / (end - self.peak).abs()).clamp(0.0, 1.0) } else { 1.0 }
    }

    /// Standard deviation of a random walk at this point when its values at the points beside it are known, over that of its change along
    /// the span.
    fn sd_fraction(self) -> f64 {
        ((self.peak - self.from).recip() + (self.to - self.peak).recip()).recip().max(0.0).div(self.span).sqrt()
    }
}

/// Slips between which the friction changes, rad/s: those of the freed shape, and those of a finer one.
const FRICTION: [Bend; 6] = [
    Bend::between([0.0, 30.0, 100.0], 100.0),
    Bend::between([100.0, 200.0, 300.0], 200.0),
    Bend::between([0.0, 10.0, 30.0], 100.0),
    Bend::between([30.0, 60.0, 100.0], 100.0),
    Bend::between([100.0, 150.0, 200.0], 200.0),
    Bend::between([200.0, 250.0, 300.0], 200.0),
];

/// Speed ratios that power-on upshifts pass: as they end, in the middle, and as they begin \[chosen\].
const SPEED_RATIOS: [f64; 3] = [0.5, 0.75, 0.95];

/// Of a map that a factor scales at its middle point: the changes at the other two and beyond, those between the points, and those beyond.
fn bend_around([low, middle, high]: [f64; 3], number: usize) -> Bend {
    let (below, above) = (middle - low, high - middle);
    let between = |from: f64, to: f64| [from, 0.5 * (from + to), to];
    match number {
        0 => Bend::between([f64::NEG_INFINITY, low, middle], below),
        1 => Bend::between([middle, high, f64::INFINITY], above),
        2 => Bend::between(between(low, middle), below),
        3 => Bend::between(between(middle, high), above),
        4 => Bend::between([f64::NEG_INFINITY, 0.0, low], below),
        _ => Bend::between([high, high + above, f64::INFINITY], above),
    }
}

/// Where the shapes of the maps change.
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
        let pressure_pa = [0.0, 0.5, 1.5].map(|fraction| kiss_pa + fraction * vehicle.error_bounds.shift_pressure_pa);
        let command = vehicle.oncoming.valve.maps().map(|maps| pressure_pa.map(|p| maps.current_for(p)));
        Self { pressure_pa, command: command.filter(|at| at[0] < at[1] && at[1] < at[2]) }
    }

    /// The maps that can be freed: a valve that is driven by its duty cycle has no lag and gain maps.
    pub(crate) fn maps(&self) -> &'static [Map] {
        if self.command.is_some() { &Map::ALL } else { &[Map::Friction, Map::Capacity] }
    }

    fn bend(&self, map: Map, number: usize) -> Bend {
        match map {
            Map::Friction => FRICTION[number.min(FRICTION.len() - 1)],
            Map::Lag => bend_around(self.pressure_pa, number),
            Map::Gain => bend_around(self.command.unwrap_or(self.pressure_pa), number),
            Map::Capacity => bend_around(SPEED_RATIOS, number),
        }
    }

    /// A name for tables.
    pub(crate) fn name(&self, map: Map, number: usize) -> String {
        let at = self.bend(map, number).peak;
        match map {
            Map::Friction => format!("friction at {at} rad/s"),
            Map::Lag => format!("valve lag at {:.0} kPa", 1e-3 * at),
            Map::Gain => format!("valve gain at {at:.2} A"),
            Map::Capacity => format!("converter capacity at {at}"),
        }
    }

    /// Standard deviation of a number of a shape over that of the change along the map, which is a random walk.
    pub(crate) fn sd_fraction(&self, map: Map, number: usize) -> f64 {
        self.bend(map, number).sd_fraction()
    }

    /// Relative change of a map at a point where a number of its shape changes by 1.
    pub(crate) fn change_at(&self, map: Map, number: usize, x: f64) -> f64 {
        self.bend(map, number).at(x)
    }

    /// A map with a relative change of its shape, at points of its own where the file's axis has none.
    pub(crate) fn changed(&self, table: &Table1<f64>, map: Map, number: usize, change: f64) -> Table1<f64> {
        let bend = self.bend(map, number);
        let points = [bend.from, bend.peak, bend.to];
        // The converter's maps share an axis.
        let table = if map == Map::Capacity { *table } else { refined(table, &points) };
        mapped(&table, |x, value| value * (1.0 + change * bend.at(x)))
    }

    /// The friction with the points at which its numbers count, so that each is the change at its point.
    pub(crate) fn with_points(friction: &Table1<f64>) -> Table1<f64> {
        refined(friction, &FRICTION[..2].iter().flat_map(|bend| [bend.from, bend.peak, bend.to]).collect::<Vec<_>>())
    }

    /// The valve with a relative change of the shape of its lag or gain.
    pub(crate) fn valve(&self, valve: ClutchValve<f64>, map: Map, number: usize, change: f64) -> ClutchValve<f64> {
        let mut valve = valve;
        if let ClutchValve::Proportional(maps) | ClutchValve::NormallyHigh { maps, .. } = &mut valve {
            match map {
                Map::Lag => maps.time_constant_s = self.changed(&maps.time_constant_s, map, number, change),
                Map::Gain => maps.gain_pa_a = self.changed(&maps.gain_pa_a, map, number, change),
                Map::Friction | Map::Capacity => {}
            }
        }
        valve
    }
}

/// The same map with more points; as it is where a table has no room for them.
fn refined(table: &Table1<f64>, points: &[f64]) -> Table1<f64> {
    /// A point this near to another of the map, as a fraction of the whole axis, is the same: a file keeps five digits.
    const SAME: f64 = 1e-3;
    let mut axis = table.axis().to_vec();
    let near = SAME * (axis.last().copied().unwrap_or(0.0) - axis.first().copied().unwrap_or(0.0));
    for point in points.iter().filter(|point| point.is_finite()) {
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
    use config::VehicleFile;

    #[test]
    fn a_freed_shape_without_a_change_is_the_map_of_the_file() {
        let vehicle = VehicleFile::built_in().unwrap();
        let knots = Knots::of(&vehicle);
        let clutch = &vehicle.oncoming.clutch;
        let friction = knots.changed(&clutch.friction, Map::Friction, 0, 0.0);
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
        let vehicle = VehicleFile::built_in().unwrap();
        let knots = Knots::of(&vehicle);
        let before = vehicle.oncoming.clutch.friction;
        let after = knots.changed(&before, Map::Friction, 1, -0.1);
        for (slip, factor) in [(0.0, 1.0), (100.0, 1.0), (200.0, 0.9), (300.0, 1.0), (400.0, 1.0)] {
            assert!((after.at(slip) / before.at(slip) - factor).abs() < 1e-12, "{slip}");
        }
        // A random walk that is known 100 rad/s below and above, of the change along 200 rad/s.
        assert!((knots.sd_fraction(Map::Friction, 1) - 0.5).abs() < 1e-12);
        assert!((knots.sd_fraction(Map::Lag, 1) - 1.0).abs() < 1e-12);
        let [low, middle, high] = knots.pressure_pa;
        let lag = |valve: ClutchValve<f64>, p: f64| valve.lag(p, 0.0);
        let valve = knots.valve(vehicle.oncoming.valve, Map::Lag, 1, 0.2);
        for (p, factor) in [(0.5 * low, 1.0), (low, 1.0), (middle, 1.0), (high, 1.2), (2.0 * high, 1.2)] {
            assert!((lag(valve, p) / lag(vehicle.oncoming.valve, p) - factor).abs() < 1e-12, "{p}");
        }
    }
}
