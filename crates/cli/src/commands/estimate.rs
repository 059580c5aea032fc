//! `wetclutch estimate`.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use clap::ValueEnum;
use config::{ObserverKind, Sensors, Vehicle};
use design::{compliant_open_loop_phases, rigid_open_loop_phases};
use logs::Log;
use observer::{Estimate as Sample, Health};
use report::tables::phase_name;
use study::log::LogRow;
use study::{AnyObserver, ErrorScore, EstimateColumns, Passages};
use trace::{CsvWriter, WholeFile, units};

use crate::args::{Estimate, MethodChoice, ObserverChoice};
use crate::commands::measured::Measured;
use crate::commands::{channel_map, check_output, not_an_input};
use crate::failure::Failure;
use crate::output;

pub(crate) fn estimate(options: &Estimate) -> Result<(), Failure> {
    check_output(options.output.as_ref())?;
    not_an_input(options.output.as_ref(), options.sensors.iter().chain([&options.vehicle]))?;
    let vehicle = Vehicle::read(&options.vehicle)?;
    let map = channel_map(&options.mapping)?;
    let mut opened = None;
    let mut log = if map.channels.is_empty() {
        Measured::rows(&options.log, &vehicle)?
    } else {
        let opened = opened.insert(Log::open(&options.log, &map.open)?);
        Measured::channels(opened, &map, &vehicle)?
    };
    let has_wheel = log.has_wheel_speed();
    let designed = matches!(options.observer, ObserverChoice::Rigid | ObserverChoice::Compliant);
    if options.method.is_some() && !designed {
        return Err(Failure::Input(
            "--method has no effect with this observer\n\
             hint: use it with `--observer rigid` or `--observer compliant`"
                .to_owned(),
        ));
    }
    let (choice, method) = match options.observer {
        ObserverChoice::Best => best(has_wheel),
        chosen => (chosen, options.method.unwrap_or(MethodChoice::Iss)),
    };
    if options.observer == ObserverChoice::Best {
        output::note(if has_wheel {
            "observer: kalman, because the log has a wheel speed"
        } else {
            "observer: rigid with peak-to-peak gains, because the log has no wheel_speed_rad_s, which kalman needs"
        });
    }
    let kind = kind(choice);
    let filters = [ObserverKind::Kalman, ObserverKind::Extended, ObserverKind::Unscented];
    if options.sensors.is_some() && !filters.contains(&kind) {
        return Err(Failure::Input(
            "--sensors has no effect with this observer\nhint: use it with `--observer` kalman, extended or unscented"
                .to_owned(),
        ));
    }
    if filters.contains(&kind) || [ObserverKind::Compliant, ObserverKind::Inversion].contains(&kind) {
        log.require_wheel_speed()?;
    }
    let sensors = options.sensors.as_deref().map(sensors).transpose()?;
    let step_s = log.median_step_s();
    let (observer, missed) = AnyObserver::best(&vehicle, kind, method.into(), step_s, sensors.as_ref())?;
    for missed in &missed {
        output::note(&format!("warning: continuing with the best certified gain\n{missed}"));
    }
    if step_s > observer.sample_max_s() && !matches!(kind, ObserverKind::OpenLoop | ObserverKind::OpenLoopMaps) {
        output::note(&format!(
            "the sample time is {:.0} ms, and this observer corrects over at most {:.0} ms: using the open loop\n\
             hint: `--observer rigid --method peak-to-peak` designs gains for the sample time of the log",
            1e3 * step_s,
            1e3 * observer.sample_max_s(),
        ));
    }
    let open_loop = match &observer {
        AnyObserver::Rigid(rigid) if kind == ObserverKind::Rigid => {
            rigid_open_loop_phases(&vehicle, &rigid.gains, step_s)
        }
        AnyObserver::Compliant(compliant) => compliant_open_loop_phases(&vehicle, &compliant.gains, step_s),
        _ => Vec::new(),
    };
    for phase in open_loop {
        output::note(&match method {
            MethodChoice::Iss => {
                format!("{}: the gain is the open loop: the valve alone has the required decay", phase_name(phase))
            }
            _ => format!("{}: the gain is the open loop: no gain reduces the bound", phase_name(phase)),
        });
    }
    let columns = observer.columns(has_wheel);
    let estimates = Estimates { vehicle: &vehicle, observer: &observer, columns };
    let findings = match &options.output {
        Some(path) => {
            let writing = |error: io::Error| Failure::writing(path, &error);
            let (file, findings) = estimates.write(&mut log, WholeFile::create(path).map_err(writing)?, writing)?;
            log.finish()?;
            file.finish().map_err(writing)?;
            findings
        }
        None => {
            let (mut stdout, findings) =
                estimates.write(&mut log, BufWriter::new(io::stdout().lock()), Failure::from)?;
            stdout.flush()?;
            log.finish()?;
            findings
        }
    };
    findings.report();
    output::note(&format!("observer: {}", name_of(choice, method)));
    output::note(&match &options.output {
        Some(path) => format!("estimate: {}", path.display()),
        None => "estimate: on standard output".to_owned(),
    });
    Ok(())
}

/// The observer for a log, if the user names none.
pub(super) fn best(has_wheel_speed: bool) -> (ObserverChoice, MethodChoice) {
    if has_wheel_speed {
        (ObserverChoice::Kalman, MethodChoice::Iss)
    } else {
        (ObserverChoice::Rigid, MethodChoice::PeakToPeak)
    }
}

/// The kind of observer of a choice; the best is that of a log with a wheel speed.
pub(super) fn kind(choice: ObserverChoice) -> ObserverKind {
    match choice {
        ObserverChoice::Best | ObserverChoice::Kalman => ObserverKind::Kalman,
        ObserverChoice::Rigid => ObserverKind::Rigid,
        ObserverChoice::Compliant => ObserverKind::Compliant,
        ObserverChoice::Sliding => ObserverKind::Sliding,
        ObserverChoice::Extended => ObserverKind::Extended,
        ObserverChoice::Unscented => ObserverKind::Unscented,
        ObserverChoice::SuperTwisting => ObserverKind::SuperTwisting,
        ObserverChoice::Inversion => ObserverKind::Inversion,
        ObserverChoice::OpenLoop => ObserverKind::OpenLoop,
        ObserverChoice::OpenLoopMaps => ObserverKind::OpenLoopMaps,
    }
}

/// An observer and how its gains were found.
fn name_of(choice: ObserverChoice, method: MethodChoice) -> String {
    let name = |value: Option<clap::builder::PossibleValue>| value.map(|value| value.get_name().to_owned());
    let observer = name(choice.to_possible_value()).unwrap_or_default();
    match choice {
        ObserverChoice::Rigid | ObserverChoice::Compliant => {
            format!("{observer}, gains by the method {}", name(method.to_possible_value()).unwrap_or_default())
        }
        _ => observer,
    }
}

/// The sensors that a file describes.
pub(super) fn sensors(path: &Path) -> Result<Sensors, Failure> {
    Sensors::read(path)?.ok_or_else(|| {
        let path = path.display();
        Failure::Input(format!("{path}: there is no [sensors] table\nhint: add one, as in experiments/bench.toml"))
    })
}

/// Computes estimates from a log and writes them to a table.
struct Estimates<'a> {
    vehicle: &'a Vehicle,
    observer: &'a AnyObserver,
    columns: EstimateColumns,
}

impl Estimates<'_> {
    /// Writes an estimate for each row of a log; returns the writer and the findings.
    fn write<W: Write>(
        &self,
        log: &mut Measured<'_>,
        writer: W,
        writing: impl Fn(io::Error) -> Failure,
    ) -> Result<(W, Findings), Failure> {
        let mut findings = Findings::new();
        let mut table = CsvWriter::new(writer, self.columns.names()).map_err(&writing)?;
        self.observer.run_over(Some(self.vehicle), log, |row, estimate| {
            findings.push(&row, &estimate);
            table.row(row.time_s, self.columns.cells(&estimate)).map_err(&writing)
        })?;
        Ok((table.finish().map_err(&writing)?, findings))
    }
}

/// Summary of the estimates for the user, updated with each estimate.
struct Findings {
    rows: u64,
    first_s: f64,
    last_s: f64,
    passages: Passages,
    /// Samples of each health that was seen.
    health: Vec<(Health, u64)>,
    /// None if a row has no true value.
    errors: Option<ErrorScore>,
}

impl Findings {
    fn new() -> Self {
        Self {
            rows: 0,
            first_s: f64::NAN,
            last_s: f64::NAN,
            passages: Passages::default(),
            health: Vec::new(),
            errors: Some(ErrorScore::new(0.0)),
        }
    }

    fn push(&mut self, row: &LogRow, estimate: &Sample<f64>) {
        if self.rows == 0 {
            self.first_s = row.time_s;
        }
        self.rows += 1;
        self.last_s = row.time_s;
        self.passages.push(row.time_s, estimate.phase);
        match self.health.iter_mut().find(|(health, _)| *health == estimate.health) {
            Some((_, count)) => *count += 1,
            None => self.health.push((estimate.health, 1)),
        }
        self.errors = self.errors.take().zip(row.truth).map(|(mut errors, truth)| {
            errors.push(row.time_s, truth.phase, truth.pressure_pa, estimate.pressure_pa);
            errors
        });
    }

    /// Prints the summary on standard error.
    fn report(&self) {
        for (health, count) in &self.health {
            let meaning = match health {
                Health::Good => continue,
                Health::ReadingRefused => "a reading that was refused: it is impossible, or it contradicts all others",
                Health::ChannelLost => "a channel without usable readings: the estimate is less certain",
                Health::Flare => {
                    "a flare: both clutches slip and the turbine runs away; the oncoming clutch carries too little"
                }
                // A few are normal while the cylinder fills: there the observers' valve model is faster than the
                // valve maps.
                Health::OutsideRange | Health::LimitedToRange if 100 * count <= self.rows => continue,
                Health::OutsideRange => {
                    "an estimate outside its range: the observer has a large error, or the car is outside its error budget"
                }
                Health::LimitedToRange => {
                    "an estimate outside its guaranteed range, replaced by the nearest end: the observer has a large error, or the car is outside its error budget"
                }
                Health::CommandRejected => "an unusable valve command: the last usable command is used",
                Health::PressureLimited => "a pressure outside 0 to `pressure_max_pa`: the estimate is that limit",
                Health::SpeedsRejected => "an unusable speed: the estimate is from the valve model alone",
                Health::Restarted => "a restart: the observer lost its state and starts again",
                Health::TimeRejected => "an unusable time step: the estimate is that of the sample before",
            };
            output::note(&format!(
                "{} of {} samples have {meaning}",
                output::grouped(*count),
                output::grouped(self.rows)
            ));
        }
        let scores = self.errors.as_ref().map(ErrorScore::finish).unwrap_or_default();
        for score in scores.iter().filter(|score| score.samples > 0) {
            output::note(&format!(
                "error against the true pressure, {}: peak {:.4} MPa, RMS {:.4} MPa",
                phase_name(score.phase),
                units::mpa(score.peak),
                units::mpa(score.rms),
            ));
        }
        let rows = output::grouped(self.rows);
        output::note(&format!("rows: {rows}, from {:.3} to {:.3} s", self.first_s, self.last_s));
        output::note(&format!("shifts: {}", self.shifts()));
        #[expect(clippy::cast_precision_loss, reason = "a share to a tenth of a percent")]
        let share = |count: u64| 100.0 * count as f64 / self.rows as f64;
        let shares = self.health.iter().map(|(health, count)| format!("{} {:.1} %", health.name(), share(*count)));
        output::note(&format!("health: {}", shares.collect::<Vec<_>>().join(", ")));
    }

    fn shifts(&self) -> String {
        let Passages { count, first_s, .. } = &self.passages;
        let times = first_s.iter().map(|[from_s, to_s]| format!("{from_s:.3} to {to_s:.3} s"));
        let mut parts: Vec<String> = times.collect();
        match count - parts.len() as u64 {
            0 => {}
            more => parts.push(format!("and {} more", output::grouped(more))),
        }
        if parts.is_empty() { "none".to_owned() } else { format!("{} ({})", output::grouped(*count), parts.join(", ")) }
    }
}
