//! The only loop that runs an observer over samples, simulated or measured, in memory or read row by row.

use std::convert::Infallible;

use car::Vehicle;
use drivetrain::{CommandKind, ReducedShift};
use observer::{Estimate, Input, Reading};
use trace::{Trace, TraceError, signal};

/// The signals that the observers read. `C` is where one is found: the values of a column, or its place in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Signals<C> {
    engine_rad_s: Option<Channel<C>>,
    turbine_rad_s: Channel<C>,
    output: Output<C>,
    wheel_rad_s: Option<Channel<C>>,
    command: Channel<C>,
    offgoing_command: Option<Channel<C>>,
    engine_torque_n_m: Option<Channel<C>>,
    shift: ReducedShift<f64>,
}

/// A signal, with the age of its readings where there is a column of it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Channel<C> {
    value: C,
    age_s: Option<C>,
}

impl<C: Copy> Channel<C> {
    fn new(name: &str, value: C, find: impl Fn(&str) -> Option<C>) -> Self {
        Self { value, age_s: signal::age_of(name).and_then(find) }
    }

    /// Its reading; a cell without a number is one that did not come.
    #[inline]
    fn reading<E>(&self, value: impl Fn(C) -> Result<f64, E>) -> Result<Option<Reading<f64>>, E> {
        let read = value(self.value)?;
        let age_s = self.age_s.map_or(Ok(0.0), value)?;
        Ok((!read.is_nan()).then_some(Reading { value: read, age_s: if age_s.is_nan() { 0.0 } else { age_s } }))
    }
}

/// Where the output speed comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Output<C> {
    Speed(Channel<C>),
    /// From turbine speed and slip of the oncoming clutch.
    OncomingSlip(C),
}

impl<C: Copy> Signals<C> {
    /// Chooses the columns. Where the output speed was not recorded it follows from the turbine speed and the slip of the
    /// oncoming clutch. The open loop does without the engine speed.
    ///
    /// # Errors
    /// A signal that is needed is missing.
    pub fn choose(
        vehicle: &Vehicle,
        find: impl Fn(&str) -> Option<C>,
        require: impl Fn(&str) -> Result<C, TraceError>,
    ) -> Result<Self, TraceError> {
        let required = |name: &str| require(name).map(|value| Channel::new(name, value, &find));
        let found = |name: &str| find(name).map(|value| Channel::new(name, value, &find));
        let kind = vehicle.settings.valve.command_kind();
        let command_name = command(kind, &find, &require)?;
        Ok(Self {
            turbine_rad_s: required(signal::TURBINE_SPEED)?,
            output: match (find(signal::OUTPUT_SPEED), find(signal::ONCOMING_SLIP)) {
                (None, Some(slip)) => Output::OncomingSlip(slip),
                _ => Output::Speed(required(signal::OUTPUT_SPEED)?),
            },
            engine_rad_s: found(signal::ENGINE_SPEED),
            wheel_rad_s: found(signal::WHEEL_SPEED),
            command: required(command_name)?,
            offgoing_command: found(command_signals(kind).1),
            engine_torque_n_m: found(signal::REPORTED_ENGINE_TORQUE),
            shift: vehicle.shift,
        })
    }

    /// Whether the wheel speed is among them.
    pub fn has_wheel_speed(&self) -> bool {
        self.wheel_rad_s.is_some()
    }

    /// Input of an observer, `dt_s` after the sample before.
    ///
    /// # Errors
    /// What `value` meets.
    #[inline]
    pub fn input<E>(&self, dt_s: f64, value: impl Fn(C) -> Result<f64, E>) -> Result<Input<f64>, E> {
        let turbine_rad_s = self.turbine_rad_s.reading(&value)?;
        let output_rad_s = match self.output {
            Output::Speed(output) => output.reading(&value)?,
            Output::OncomingSlip(slip) => {
                let slip = value(slip)?;
                let known = turbine_rad_s.filter(|_| !slip.is_nan());
                known.map(|turbine| Reading { value: self.shift.output_speed(turbine.value, slip), ..turbine })
            }
        };
        let optional = |channel: Option<Channel<C>>| channel.map_or(Ok(None), |channel| channel.reading(&value));
        Ok(Input {
            dt_s,
            engine_rad_s: optional(self.engine_rad_s)?,
            turbine_rad_s,
            output_rad_s,
            wheel_rad_s: optional(self.wheel_rad_s)?,
            command: self.command.reading(&value)?,
            offgoing_command: optional(self.offgoing_command)?,
            engine_torque_n_m: optional(self.engine_torque_n_m)?,
        })
    }
}

/// The name of the signal of the oncoming clutch's command.
fn command<C>(
    kind: CommandKind,
    find: impl Fn(&str) -> Option<C>,
    require: impl Fn(&str) -> Result<C, TraceError>,
) -> Result<&'static str, TraceError> {
    let [(wanted, _), (other, _)] = match kind {
        CommandKind::Current => [CommandKind::Current, CommandKind::DutyCycle],
        CommandKind::DutyCycle => [CommandKind::DutyCycle, CommandKind::Current],
    }
    .map(command_signals);
    require(wanted).map(|_| wanted).map_err(|error| match error {
        TraceError::MissingColumn { path, .. } if find(other).is_some() => {
            TraceError::OtherCommand { path, wanted: wanted.to_owned(), found: other.to_owned() }
        }
        error => error,
    })
}

/// The signals of the commands of the oncoming and the offgoing clutch's valve.
pub(crate) fn command_signals(kind: CommandKind) -> (&'static str, &'static str) {
    match kind {
        CommandKind::Current => (signal::ONCOMING_CURRENT, signal::OFFGOING_CURRENT),
        CommandKind::DutyCycle => (signal::ONCOMING_DUTY, signal::OFFGOING_DUTY),
    }
}

/// The signals of a trace in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct RunColumns<'a> {
    time_s: &'a [f64],
    signals: Signals<&'a [f64]>,
}

impl<'a> RunColumns<'a> {
    /// Finds the columns, see [`Signals::choose`].
    ///
    /// # Errors
    /// A signal that is needed is missing.
    pub fn of(trace: &'a Trace, vehicle: &Vehicle) -> Result<Self, TraceError> {
        let signals = Signals::choose(vehicle, |name| trace.get(name), |name| trace.require(name))?;
        Ok(Self { time_s: &trace.time_s, signals })
    }

    /// The samples.
    pub fn samples(&self) -> impl ExactSizeIterator<Item = Result<(Input<f64>, ()), Infallible>> {
        (0..self.time_s.len()).map(|i| {
            let dt_s = if i == 0 { 0.0 } else { self.time_s[i] - self.time_s[i - 1] };
            self.signals.input(dt_s, |column| Ok(column[i])).map(|input| (input, ()))
        })
    }
}

/// Runs an observer over samples: `step` makes one step of it, and `take` gets the estimate with what came along with the sample. Ends at the
/// first error.
///
/// # Errors
/// Those of the samples and of `take`.
pub fn run<S, E>(
    samples: impl Iterator<Item = Result<(Input<f64>, S), E>>,
    mut step: impl FnMut(&Input<f64>) -> Estimate<f64>,
    mut take: impl FnMut(S, Estimate<f64>) -> Result<(), E>,
) -> Result<(), E> {
    for sample in samples {
        let (input, along) = sample?;
        take(along, step(&input))?;
    }
    Ok(())
}
