//! The readings of one shift, and the segments in which its phase is known.

use car::SpeedSensor;
use drivetrain::ReducedShift;

use crate::Series;

/// Before the inertia phase so much is used, s: the torque phase, and some time in which the load of the road is seen.
const BEFORE_S: f64 = 1.0;
/// After lock-up so much is used, s: several periods of the drive-shaft oscillation.
const AFTER_S: f64 = 0.7;
/// So long before the offgoing clutch slips, it holds for sure, s.
const RELEASE_MARGIN_S: f64 = 0.015;
/// So long after the slip is gone, the oncoming clutch sticks for sure, s.
const LOCK_MARGIN_S: f64 = 0.04;
/// Slip of the offgoing clutch that is more than noise, rad/s, as long as the delay of the output speed is not known.
const RELEASED_RAD_S: f64 = 4.0;
/// The same when it is known: a clutch that creeps does not hold.
const CREEPING_RAD_S: f64 = 1.2;
/// Slip of the oncoming clutch above which it slips for sure, rad/s.
const SLIPPING_RAD_S: f64 = 8.0;
/// A segment that is shorter tells nothing, s.
pub(crate) const SHORTEST_S: f64 = 0.08;
/// Longest time without a reading in a segment, s.
const GAP_MAX_S: f64 = 0.1;

/// Which clutches stick in a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SegmentKind {
    /// The offgoing clutch holds: the gear before the shift and the torque phase.
    Held,
    /// Both clutches slip: the inertia phase.
    Slipping,
    /// The oncoming clutch holds.
    Locked,
}

/// How far a speed wheel turns while a reading ages, rad: a reading is the mean over some teeth, and the last of them passed
/// half a tooth ago. Zero where the sensor is not known; its delay then takes the mean.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReadingAges {
    /// Engine speed.
    pub engine_rad: f64,
    /// Turbine speed.
    pub turbine_rad: f64,
    /// Output speed.
    pub output_rad: f64,
    /// Wheel speed.
    pub wheel_rad: f64,
}

impl ReadingAges {
    /// Those of described sensors.
    pub fn of(sensors: &car::Sensors) -> Self {
        let age = |sensor: &SpeedSensor| 0.5 * (sensor.periods + 1.0) * std::f64::consts::TAU / sensor.teeth;
        Self {
            engine_rad: age(&sensors.engine),
            turbine_rad: age(&sensors.turbine),
            output_rad: age(&sensors.output),
            wheel_rad: age(&sensors.wheel),
        }
    }
}

/// A part of a shift in which the phase is known, so that the equations are smooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Which clutches stick.
    pub kind: SegmentKind,
    /// From when to when, s.
    pub span_s: [f64; 2],
}

/// The readings of one shift. Times count from the beginning of its inertia phase.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ShiftRecord {
    /// The log and the time of the shift in it, for messages.
    pub name: String,
    /// Engine speed, rad/s.
    pub engine: Series,
    /// Turbine speed, rad/s.
    pub turbine: Series,
    /// Gearbox output speed, rad/s.
    pub output: Series,
    /// Speed of the driven wheels, rad/s; may be empty.
    pub wheel: Series,
    /// Command of the oncoming clutch's valve, A or %.
    pub oncoming: Series,
    /// Command of the offgoing clutch's valve, A or %; may be empty.
    pub offgoing: Series,
    /// Measured pressure of the oncoming clutch, Pa; may be empty.
    pub pressure: Series,
    /// Engine torque signal, N m; may be empty.
    pub engine_torque: Series,
    /// About when the oncoming clutch locks, s.
    pub lock_s: f64,
    /// The segments, in the order of time.
    pub segments: Vec<Segment>,
}

/// How much later than the turbine speed the output speed is: its delay, and the ages of both readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OutputClock {
    pub(crate) delay_s: f64,
    pub(crate) ages: ReadingAges,
}

impl ShiftRecord {
    /// The first of the shifts that has the same readings, whatever their times.
    pub(crate) fn copied_from<'a>(&self, shifts: &'a [Self]) -> Option<&'a Self> {
        shifts.iter().find(|other| other.engine.value == self.engine.value && other.turbine.value == self.turbine.value)
    }

    /// The first of the signals with times or values that are not finite.
    pub(crate) fn not_finite(&self) -> Option<&'static str> {
        let signals = [
            ("the engine speed", &self.engine),
            ("the turbine speed", &self.turbine),
            ("the output speed", &self.output),
            ("the wheel speed", &self.wheel),
            ("the oncoming clutch's command", &self.oncoming),
            ("the offgoing clutch's command", &self.offgoing),
            ("the pressure", &self.pressure),
            ("the engine torque", &self.engine_torque),
        ];
        let is_finite = |series: &Series| series.time_s.iter().chain(&series.value).all(|x| x.is_finite());
        signals.into_iter().find(|(_, series)| !is_finite(series)).map(|(name, _)| name)
    }

    /// Finds the segments; an error says why the shift cannot be used.
    ///
    /// # Errors
    /// The readings do not show the phases, or have holes.
    pub fn find_segments(&mut self, shift: &ReducedShift<f64>) -> Result<(), String> {
        self.find_by(shift, None)
    }

    /// As [`Self::find_segments`], where the clock of the output speed is known.
    pub(crate) fn find_by(&mut self, shift: &ReducedShift<f64>, clock: Option<OutputClock>) -> Result<(), String> {
        self.segments.clear();
        let lock_s = self.lock_s;
        let released_rad_s = if clock.is_some() { CREEPING_RAD_S } else { RELEASED_RAD_S };
        let begin_s = [&self.engine, &self.turbine, &self.output, &self.oncoming]
            .iter()
            .map(|series| series.time_s.first().copied().unwrap_or(f64::INFINITY))
            .fold(-BEFORE_S, f64::max);
        let end_s = [&self.engine, &self.turbine, &self.output]
            .iter()
            .map(|series| series.time_s.last().copied().unwrap_or(f64::NEG_INFINITY))
            .fold(lock_s + 1.0, f64::min);
        let slips: Vec<(f64, f64, f64)> = (self.turbine.between([begin_s, end_s]))
            .map(|(time_s, turbine)| {
                let late_s = clock.map_or(0.0, |clock| {
                    let output = self.output.at(time_s);
                    clock.delay_s + age_s(clock.ages.output_rad, output) - age_s(clock.ages.turbine_rad, turbine)
                });
                let output = self.output.at(time_s + late_s);
                (time_s, shift.offgoing_slip(turbine, output), shift.oncoming_slip(turbine, output))
            })
            .collect();
        let released = |slip: f64| slip.abs() > released_rad_s;
        // One reading beyond the limit is noise, two are a slip.
        let first = slips.windows(2).position(|pair| released(pair[0].1) && released(pair[1].1));
        let lasting = slips.iter().rposition(|(time_s, slip, _)| *time_s < lock_s && slip.abs() <= RELEASED_RAD_S);
        let locked =
            slips.iter().rposition(|(time_s, _, oncoming)| *time_s < lock_s + 0.5 && oncoming.abs() > SLIPPING_RAD_S);
        let (Some(first), Some(lasting), Some(locked)) = (first, lasting, locked) else {
            return Err("the speeds do not show where the clutches slip".to_owned());
        };
        let lock_s = slips.get(locked + 1).map_or(end_s, |(time_s, ..)| *time_s);
        let spans = [
            (SegmentKind::Held, [begin_s, slips[first].0 - RELEASE_MARGIN_S]),
            (SegmentKind::Slipping, [slips.get(lasting + 1).map_or(end_s, |(time_s, ..)| *time_s), slips[locked].0]),
            (SegmentKind::Locked, [lock_s + LOCK_MARGIN_S, (lock_s + LOCK_MARGIN_S + AFTER_S).min(end_s)]),
        ];
        for (kind, span_s) in spans {
            let needed = [("engine", &self.engine), ("turbine", &self.turbine), ("output", &self.output)];
            let hole = needed.into_iter().find(|(_, series)| series.longest_gap_s(span_s) > GAP_MAX_S);
            match hole {
                _ if span_s[1] - span_s[0] < SHORTEST_S => {}
                Some((name, _)) => return Err(format!("the {name} speed has a hole of more than {GAP_MAX_S} s")),
                None => self.segments.push(Segment { kind, span_s }),
            }
        }
        if self.segments.iter().any(|segment| segment.kind == SegmentKind::Slipping) {
            Ok(())
        } else {
            Err(format!("its inertia phase is shorter than {SHORTEST_S} s"))
        }
    }
}

/// How old a reading of this speed is, s.
pub(crate) fn age_s(age_rad: f64, speed_rad_s: f64) -> f64 {
    /// Slower wheels give readings that no fit can use.
    const SLOWEST_RAD_S: f64 = 5.0;
    age_rad / speed_rad_s.abs().max(SLOWEST_RAD_S)
}
