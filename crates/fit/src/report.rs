//! What a fit has found, in words.

use drivetrain::Real;
use nalgebra::{DMatrix, DVector};

use crate::driving::MIN_SCALE;
use crate::fill::{FILL_IDENTIFIED_BY, FillFit};
use crate::freeing::LEVEL;
use crate::parameters::{DELAY_UNIT_S, HYSTERESIS_UNIT_PA, OFFSET_UNIT_PA};
use crate::verdict::SIDES;
use crate::{BacklashFit, Channel, Fit, Known, MapChange, MapKey, Measure, Parameter, ReportRow, Verdict, correlated};

/// A one-step gain of the turbine speed above this says that the model does not fit.
const MISFIT_GAIN: f64 = 0.6;
/// What driving does not tell of road load.
pub(crate) const MEAN_GRADE: &str = "Grade is not measured, and a mean grade acts like rolling resistance: coasting down both ways on a straight of \
     constant grade would identify it, and a fit does not read that";

impl Fit {
    /// How far the logs identify a parameter.
    pub fn verdict(&self, parameter: Parameter) -> Verdict {
        let Some(place) = self.place(parameter) else { return Verdict::NotIdentifiable };
        Verdict::of(self.sd(parameter).unwrap_or(f64::INFINITY), self.priors[place].sd)
    }

    /// How far the logs identify the factor that all torques have in common: an engine torque signal is a measurement of it.
    pub fn torque_scale_verdict(&self) -> Verdict {
        if self.available.engine_torque { Verdict::Partly } else { Verdict::NotIdentifiable }
    }

    /// The table: combinations first, then each parameter.
    pub fn report(&self) -> Vec<ReportRow> {
        use Parameter as P;
        let combinations = [
            ("friction x valve gain", vec![(P::Friction, 1.0), (P::Gain, 1.0)]),
            ("the same / converter capacity", vec![(P::Friction, 1.0), (P::Gain, 1.0), (P::Capacity, -1.0)]),
            ("spring / valve gain: command at the kiss point", vec![(P::Spring, 1.0), (P::Gain, -1.0)]),
        ];
        let combination = |(name, powers): (&str, Vec<(Parameter, f64)>)| {
            let value = powers.iter().map(|(p, power)| power * self.unknown(*p)).sum::<f64>();
            let [before, after] = self.combination_sd(&powers);
            row(name, value, after, before, Verdict::of(after, before), Measure::Factor)
        };
        let single = |(i, prior): (usize, &crate::Prior)| {
            let sd = self.precision.stated[(i, i)].sqrt();
            let measure = match prior.parameter {
                p if p.is_delay() => Measure::Delay,
                p if p.is_shape() => Measure::Fraction,
                Parameter::Hysteresis => Measure::Width,
                Parameter::PressureOffset => Measure::Offset,
                _ => Measure::Factor,
            };
            row(&prior.name, self.unknowns[i], sd, prior.sd, self.verdict(prior.parameter), measure)
        };
        let mut rows: Vec<ReportRow> = combinations.into_iter().map(combination).collect();
        rows.extend(self.priors.iter().enumerate().map(single));
        rows.extend(self.fill.as_ref().map(|fill| fill_row("fill volume of the oncoming clutch", fill)));
        rows
    }

    fn unknown(&self, parameter: Parameter) -> f64 {
        self.place(parameter).map_or(0.0, |i| self.unknowns[i])
    }

    /// What is to be said besides the table: torque scale, correlations, misfit, delays of the channels, and which drive
    /// would tell more.
    pub fn statements(&self) -> Vec<String> {
        let scale = 100.0 * SIDES * self.torque_scale_sd();
        let anchor = if self.available.engine_torque { "the engine torque signal and the" } else { "the" };
        let mut lines = vec![format!(
            "torque scale: {}, +- {scale:.1} %. Speeds fix the ratios of all torques and not their common factor; it comes from \
             {anchor} ranges of mass, inertias, stiffness and converter in the vehicle file",
            self.torque_scale_verdict().name()
        )];
        lines.extend(self.correlations());
        if !self.freed.is_empty() {
            let names: Vec<&str> = self.freed.iter().map(|map| map.name()).collect();
            lines.push(format!(
                "shape fitted too, because the shifts contradict the shape in the file: {} (level {LEVEL})",
                names.join(", ")
            ));
        }
        lines.extend(self.misfits());
        if self.freed.is_empty() && self.given_is_possible() {
            lines.push(
                "every value of the given vehicle file is within its interval: these logs do not contradict the file"
                    .to_owned(),
            );
        }
        lines.push(self.torque_said());
        lines.push(self.said_of_driving());
        lines.push(BacklashFit::statement(&self.backlash));
        lines.extend(cautions(self.is_converged, self.shifts));
        lines.extend(self.channel_map());
        lines.extend(self.proposals());
        lines
    }

    fn correlations(&self) -> Option<String> {
        correlated::statement(&self.precision.stated, |at| self.priors.get(at).map(|prior| prior.name.clone()))
    }

    /// Whether the values of the given file lie in the region of the car's parameters that holds all in 95 %. The parameters count
    /// together: speeds tell ratios of parameters better than each of them.
    fn given_is_possible(&self) -> bool {
        let of_car = self.priors.iter().enumerate().filter(|(_, prior)| !prior.parameter.is_of_signals());
        let places: Vec<usize> = of_car.map(|(i, _)| i).collect();
        let count = places.len();
        let change = DVector::from_fn(count, |a, _| self.unknowns[places[a]] - self.priors[places[a]].mean);
        let covariance = DMatrix::from_fn(count, count, |a, b| self.precision.stated[(places[a], places[b])]);
        let distance = covariance.cholesky().map(|root| change.dot(&root.solve(&change)));
        distance.is_some_and(|distance| distance <= chi_squared_95(count))
    }

    /// How much the clutch torque changes, and whether the logs show that this is better.
    fn torque_said(&self) -> String {
        let change = &self.torque_change;
        let open = SIDES * change.open_n_m;
        let mut text = format!(
            "clutch torque in these shifts at the same commands: changed by {:.1} N m RMS, of which +- {open:.1} N m is not identified",
            change.rms_n_m
        );
        if change.rms_n_m <= open {
            text +=
                ". These logs have too little information to show that the fitted file is better than the given one";
        }
        text
    }

    /// What driving between shifts says of mass and road load, or why it says nothing.
    fn said_of_driving(&self) -> String {
        let reasons = match self.driving_left_out.as_slice() {
            [] => String::new(),
            [first] => format!("; not used: {first}"),
            all => format!("; not used: {}", all.join("; ")),
        };
        if self.driving_s == 0.0 {
            return format!(
                "driving between shifts is not fitted: no log has enough driving with the accelerator pressed in the gears of the file{reasons}. It would identify the mass"
            );
        }
        let [_, mass] = self.combination_sd(&[(Parameter::Mass, 1.0), (Parameter::Capacity, -1.0)]);
        format!(
            "driving between shifts: {:.0} s in gear with the accelerator pressed{reasons}. Mass over converter capacity is known within +- {:.1} %. {MEAN_GRADE}",
            self.driving_s,
            100.0 * SIDES * mass
        )
    }

    fn misfits(&self) -> Vec<String> {
        let wrong =
            self.channels.iter().any(|(channel, errors)| *channel == Channel::Turbine && errors.gain > MISFIT_GAIN);
        let warning = wrong.then(|| {
            "warning: the model does not follow the turbine speed: its errors do not decay. The intervals are too small\nhint: the converter or a valve may differ from the vehicle file in a way that the fit does not change; check their maps"
                .to_owned()
        });
        let limited = (!self.at_limit.is_empty()).then(|| {
            format!(
                "warning: at the limit of the prior (4 standard deviations): {}\nhint: check that the vehicle file is of this car, and the \
                 signals of the channel map; do not use the fitted values before the reason is known",
                self.at_limit.join(", ")
            )
        });
        let finer = (!self.misfits.is_empty()).then(|| {
            let names: Vec<&str> = self.misfits.iter().map(|map| map.name()).collect();
            format!(
                "warning: the shifts contradict the fitted model (Hotelling's T2 over the shifts, level {LEVEL}): the shape of {} differs from any that the fit can give it, or the car has an effect that no map of the vehicle file describes. The intervals contain the effect on the values\nhint: check this map of the vehicle file",
                names.join(", ")
            )
        });
        let fill = self.fill.and_then(|fill| fill.misfit("the oncoming clutch"));
        warning.into_iter().chain(finer).chain(limited).chain(fill).collect()
    }

    /// Delays, scale and zero offset of channels, which belong into a channel map, each with its interval.
    fn channel_map(&self) -> Vec<String> {
        self.map_changes().iter().map(said_of_change).collect()
    }

    /// What belongs into the channel map: delays, scale and zero offset of channels.
    pub fn map_changes(&self) -> Vec<MapChange> {
        let delays = [
            (Parameter::OutputDelay, "output_speed"),
            (Parameter::EngineDelay, "engine_speed"),
            (Parameter::WheelDelay, "wheel_speed"),
            (Parameter::PressureDelay, "oncoming_pressure"),
        ];
        let known = |parameter| {
            let [low, value, high] = self.interval(parameter)?;
            Some(Known { value, sd: (high - low) / (2.0 * SIDES), before: f64::INFINITY })
        };
        let delay = |(parameter, signal): (Parameter, &str)| {
            known(parameter).filter(|late_s| late_s.is_off_by(0.0)).map(|late_s| MapChange::of_delay(signal, &late_s))
        };
        let scale = known(Parameter::WheelScale).filter(|reads| (reads.value - 1.0).abs() > MIN_SCALE);
        let scale = scale.map(|Known { value, sd, .. }| {
            MapChange::of_signal("wheel_speed", MapKey::Scale, value.recip(), sd / (value * value))
        });
        let offset = known(Parameter::PressureOffset)
            .and_then(|offset| change_of_offset("oncoming_pressure", offset.value, offset.sd));
        delays.into_iter().filter_map(delay).chain(scale).chain(offset).collect()
    }

    /// A value in its own unit between the ends of its interval of 95 %.
    fn interval(&self, parameter: Parameter) -> Option<[f64; 3]> {
        let (x, half) = (self.unknowns[self.place(parameter)?], SIDES * self.sd(parameter)?);
        Some([x - half, x, x + half].map(|x| parameter.value(x)))
    }

    /// Which measurement or drive would tell what these logs do not.
    fn proposals(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let mut when = |asked: bool, line: &str| {
            if asked {
                lines.push(format!("to know more: {line}"));
            }
        };
        when(
            !self.available.engine_torque,
            "for the torque scale, weigh the car and narrow `design.error_bounds.mass_kg`, or log an engine torque signal",
        );
        when(
            !self.available.pressure,
            "to separate valve gain, spring and friction, measure the pressure of the oncoming clutch in one shift; ten shifts show no more",
        );
        when(
            self.fill.is_some_and(|fill| fill.verdict() == Verdict::NotIdentifiable),
            &format!(
                "for the fill volume of the oncoming clutch, which is not identified by these logs, {FILL_IDENTIFIED_BY}"
            ),
        );
        when(!self.available.wheel, "for shafts, tyres and mass, log the speed of the driven wheels");
        when(
            self.verdict(Parameter::TorqueRatio) != Verdict::Measured,
            "for the torque ratio of the converter, shift early, at low speed, where the engine turns much faster than the turbine",
        );
        when(
            self.verdict(Parameter::Lag) == Verdict::NotIdentifiable && self.available.pressure,
            "for the lag of the valve, shifts with a longer inertia phase",
        );
        when(
            true,
            "for rolling resistance and air drag, coast down in neutral both ways on a straight of constant grade; a fit does not read it",
        );
        when(
            self.shifts < 15,
            "20 upshifts: 6 at light throttle (0.15), 6 early ones from low speed, 4 at medium throttle, 4 with a tip-in at the shift",
        );
        lines
    }
}

/// What a fit of one shift says of a channel.
fn said_of_change(change: &MapChange) -> String {
    let MapChange { channel, key, value, sd } = change;
    let (signal, half) = (channel.name(), SIDES * sd);
    match key {
        MapKey::Offset => said_of_offset(signal, change),
        MapKey::Scale => format!("{signal} x {value:.4} +- {half:.4} fits the other speeds: {}", change.instruction()),
        MapKey::Delay | MapKey::Late => {
            let [late_ms, half_ms] = [value, &half].map(|time_s| 1e3 * time_s);
            format!("{signal} is {late_ms:+.1} +- {half_ms:.1} ms behind the turbine speed: {}", change.instruction())
        }
    }
}

/// The row of a zero offset, Pa.
pub(crate) fn offset_row(name: String, offset: Known) -> ReportRow {
    let [value, sd, before] = [offset.value, offset.sd, offset.before].map(|pa| pa / OFFSET_UNIT_PA);
    row(&name, value, sd, before, offset.verdict(), Measure::Offset)
}

/// The change of the channel map for a pressure that reads this without a pressure, Pa, where its interval is not about zero.
pub(crate) fn change_of_offset(signal: &str, offset_pa: f64, sd_pa: f64) -> Option<MapChange> {
    let change = MapChange::of_signal(signal, MapKey::Offset, -offset_pa, sd_pa);
    (offset_pa.abs() > SIDES * sd_pa).then_some(change)
}

/// What a fit says of the zero offset of the channel of a pressure.
pub(crate) fn said_of_offset(channel: &str, change: &MapChange) -> String {
    let [offset, half] = [-change.value, SIDES * change.sd].map(|pa| 1e-3 * pa);
    let [low, high] = [offset - half, offset + half];
    format!(
        "{channel} reads {offset:+.1} kPa (95 % {low:+.1} to {high:+.1} kPa) without a pressure: {}. The fit has counted with it",
        change.instruction()
    )
}

/// The row of a fill volume.
pub(crate) fn fill_row(name: &str, fill: &FillFit) -> ReportRow {
    row(name, fill.log_volume, fill.sd[0], fill.sd[1], fill.verdict(), Measure::Factor)
}

/// The row of an unknown of a fit, with its standard deviations after and before.
fn row(name: &str, x: f64, sd: f64, before: f64, verdict: Verdict, measure: Measure) -> ReportRow {
    let si = |x: f64| match measure {
        Measure::Factor => Real::exp(x),
        Measure::Delay => DELAY_UNIT_S * x,
        Measure::Offset => OFFSET_UNIT_PA * x,
        Measure::Width => HYSTERESIS_UNIT_PA * x.max(0.0),
        Measure::Fraction | Measure::Torque => x,
    };
    let half = SIDES * sd;
    let interval = [si(x - half), si(x + half)];
    ReportRow { name: name.to_owned(), measure, value: si(x), interval, fraction: sd / before, verdict }
}

/// Why intervals may be too small.
pub(crate) fn cautions(is_converged: bool, shifts: usize) -> impl Iterator<Item = String> {
    let used_up = "warning: not converged: the iterations were used up while the values still changed; the intervals do not hold\nhint: start from a vehicle file that is nearer to the car, or give more shifts";
    let one = "one shift only: nothing shows how much shifts differ, so the intervals may be too small";
    [(!is_converged, used_up), (shifts == 1, one)]
        .into_iter()
        .filter(|(is_so, _)| *is_so)
        .map(|(_, text)| text.to_owned())
}

/// What the sum of the squares of so many independent normal numbers is below in 95 %, by the cube root of Wilson and Hilferty.
fn chi_squared_95(count: usize) -> f64 {
    let (count, ninth) = (count as f64, 2.0 / (9.0 * count as f64));
    count * Real::powi(1.0 - ninth + 1.645 * ninth.sqrt(), 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_that_has_not_ended_and_one_of_one_shift_say_so() {
        assert_eq!(cautions(true, 2).count(), 0);
        let said: Vec<String> = cautions(false, 1).collect();
        assert!(
            said[0].starts_with("warning: not converged: the iterations were used up") && said.len() == 2,
            "{said:?}"
        );
    }

    #[test]
    fn quantiles_of_chi_squared_are_those_of_tables() {
        for (count, limit) in [(2, 5.99), (5, 11.07), (10, 18.31), (20, 31.41)] {
            let found = chi_squared_95(count);
            assert!((found / limit - 1.0).abs() < 0.01, "{count}: {found}");
        }
    }
}
