//! The converter that a drive shows, as a table of a vehicle file.

use drivetrain::Converter;
use trace::printable;

use super::ConverterFit;

/// How such a file begins.
pub const BEGIN: &str = "# The converter of ";

/// Two standard deviations are the half of an interval of 95 %.
const HALF_OF_95: f64 = 2.0;

/// A point of the two maps of a converter.
struct Point {
    speed_ratio: f64,
    capacity_n_m_s2: f64,
    torque_ratio: f64,
}

impl ConverterFit {
    /// The table `[converter]` of a vehicle file. What no log of speeds and engine torque shows is that of a `usual` converter: the torque
    /// ratio, and the capacity below the first knot and in overrun, scaled to the capacities that were found.
    pub fn vehicle_table(&self, log: &str, usual: &Converter<f64>) -> String {
        format!(
            "{BEGIN}{}, fitted by `wetclutch inspect --shifts --write-converter`: it replaces [converter] of a vehicle file.\n{}",
            printable(log),
            self.table(usual)
        )
    }

    /// The same without the line that says where it is from and what it is for.
    pub fn table(&self, usual: &Converter<f64>) -> String {
        let points = self.points(usual);
        let list = |value: &dyn Fn(&Point) -> String| points.iter().map(value).collect::<Vec<_>>().join(", ");
        let seen = self.seen();
        let found = seen.iter().map(|knot| {
            let half = HALF_OF_95 * knot.sd_n_m_s2;
            format!("#   {:.2}: {:.3e} +- {half:.1e}, {:.1} s\n", knot.speed_ratio, knot.capacity_n_m_s2, knot.time_s)
        });
        format!(
            "# From the log, speed ratio: capacity in N m s^2 with the half of its 95 % interval, time near it:\n{}\
             # Inertia of engine and pump {:.3} +- {:.3} kg m^2 ({}): [engine] inertia_kg_m2.\n\
             # Not in the log, and so those of a usual converter, scaled: the torque ratio, and the capacity below a speed ratio of {} and above 1.\n\
             [converter]\nspeed_ratio = [{}]\ncapacity_n_m_s2 = [{}]\ntorque_ratio = [{}]\n",
            found.collect::<String>(),
            self.inertia_kg_m2,
            HALF_OF_95 * self.inertia_sd_kg_m2,
            self.inertia_verdict().name(),
            seen.first().map_or(0.0, |knot| knot.speed_ratio),
            list(&|point| format!("{:?}", point.speed_ratio)),
            list(&|point| format!("{:.4e}", point.capacity_n_m_s2)),
            list(&|point| format!("{:.3}", point.torque_ratio)),
        )
    }

    /// The knots that the log shows; the last, at a speed ratio of 1, has no capacity by definition.
    fn seen(&self) -> &[super::Knot] {
        self.knots.split_last().map_or(&[], |(_, seen)| seen)
    }

    fn points(&self, usual: &Converter<f64>) -> Vec<Point> {
        let seen = self.seen();
        let ratio_to_usual = |knots: &[super::Knot]| {
            let sum = |value: &dyn Fn(&super::Knot) -> f64| knots.iter().map(value).sum::<f64>();
            sum(&|knot| knot.capacity_n_m_s2.max(0.0)) / sum(&|knot| usual.capacity_n_m_s2.at(knot.speed_ratio))
        };
        let (below, above) = (ratio_to_usual(&seen[..seen.len().min(1)]), ratio_to_usual(seen));
        let first = seen.first().map_or(1.0, |knot| knot.speed_ratio);
        let of_usual = |speed_ratio: f64| {
            let scale = if speed_ratio < first { below } else { above };
            (speed_ratio, scale * usual.capacity_n_m_s2.at(speed_ratio))
        };
        let outside = usual.capacity_n_m_s2.axis().iter().copied().filter(|ratio| *ratio < first || *ratio > 1.0);
        // A converter that slips takes torque from the engine, whatever the noise.
        let inside = self.knots.iter().map(|knot| (knot.speed_ratio, knot.capacity_n_m_s2.max(0.0)));
        let mut points: Vec<(f64, f64)> = outside.map(of_usual).chain(inside).collect();
        points.sort_by(|one, other| one.0.total_cmp(&other.0));
        let point = |(speed_ratio, capacity_n_m_s2): (f64, f64)| Point {
            speed_ratio,
            capacity_n_m_s2,
            torque_ratio: usual.torque_ratio.at(speed_ratio),
        };
        points.into_iter().map(point).collect()
    }
}
