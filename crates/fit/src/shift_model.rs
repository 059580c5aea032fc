//! A shift as the fit sees it: its readings against the motion of a car, and their derivatives.

use car::Shaft;
use nalgebra::{DMatrix, DVector};

use crate::car::Car;
use crate::fill::{FillLog, fill_begin_s};
use crate::motion::{Circumstances, Inputs, Motion, Part, Run, STEP_S, State};
use crate::parameters::Prior;
use crate::pressure::{Grid, pressures};
use crate::record::{SHORTEST_S, Segment, SegmentKind, ShiftRecord, age_s};
use crate::shape::Map;
use crate::{Parameter as P, Series};

/// Steps of the differences for derivatives, in the unit of the unknown.
const DIFFERENCE: f64 = 1e-3;
/// Readings at the beginning of a segment may be of the time before it, s: those of the shafts, and those of the wheels.
const FIRST_READING_S: f64 = 0.005;
const FIRST_WHEEL_READING_S: f64 = 0.025;

/// A signal that is compared with the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Turbine speed.
    Turbine,
    /// Output speed.
    Output,
    /// Wheel speed.
    Wheel,
    /// Engine speed, where the engine torque is known.
    Engine,
    /// Pressure of the oncoming clutch.
    Pressure,
}

impl Channel {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Turbine, Self::Output, Self::Wheel, Self::Engine, Self::Pressure];

    /// A name for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Turbine => "turbine speed",
            Self::Output => "output speed",
            Self::Wheel => "wheel speed",
            Self::Engine => "engine speed",
            Self::Pressure => "pressure",
        }
    }
}

/// Readings of a channel in sequence, as a part of the rows of a shift.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Block {
    pub(crate) channel: Channel,
    /// None for a pressure, which does not depend on the motion.
    segment: Option<usize>,
    pub(crate) rows: std::ops::Range<usize>,
    readings: Vec<(f64, f64)>,
}

/// An unknown of one shift: what it starts from, the standard deviation around it, and its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OwnUnknown {
    pub(crate) mean: f64,
    pub(crate) sd: f64,
    /// The segment whose start it is; none if it counts in all.
    segment: Option<usize>,
}

/// Standard deviations \[chosen\] of what differs from shift to shift.
pub(crate) const MASS_FRACTION_SD: f64 = 0.035;
const LOAD_UNIT_N: f64 = 500.0;
const ENGINE_TORQUE_FRACTION_SD: f64 = 0.01;
/// The start of a segment is not known before: these are wide.
const SPEED_SD_RAD_S: f64 = 20.0;
const TWIST_UNIT_RAD: f64 = 0.01;
const TWIST_SD: f64 = 10.0;
const VEHICLE_UNIT_M_S: f64 = 0.1;
const VEHICLE_SD: f64 = 20.0;

/// A shift with its layout of rows and unknowns.
#[derive(Debug, Clone)]
pub(crate) struct ShiftModel {
    pub(crate) record: ShiftRecord,
    half_steps: Grid,
    parts: Vec<Part>,
    pub(crate) blocks: Vec<Block>,
    pub(crate) rows: usize,
    pub(crate) own: Vec<OwnUnknown>,
    has_engine_torque: bool,
    /// Readings of the engine speed at the half steps.
    engine_rad_s: Vec<f64>,
    offgoing_pa: Vec<f64>,
    directions: [f64; 2],
}

/// Residuals and their derivatives by the parameters and by the shift's own unknowns.
#[derive(Debug, Clone)]
pub(crate) struct Linearised {
    pub(crate) residuals: DVector<f64>,
    pub(crate) by_parameter: DMatrix<f64>,
    pub(crate) by_own: DMatrix<f64>,
}

impl ShiftModel {
    /// Lays out a shift that is seen from the car of the file.
    pub(crate) fn new(mut record: ShiftRecord, car: &Car) -> Self {
        record.segments = without_fill(&record, car);
        let segments = record.segments.clone();
        let begin_s = segments.iter().map(|segment| segment.span_s[0]).fold(f64::INFINITY, f64::min);
        let end_s = segments.iter().map(|segment| segment.span_s[1]).fold(f64::NEG_INFINITY, f64::max);
        let steps = |span_s: f64| (span_s / STEP_S).round().max(0.0) as usize;
        let part = |segment: &Segment| {
            let before = steps(segment.span_s[0] - begin_s);
            Part {
                begin_s: begin_s + STEP_S * before as f64,
                first: 2 * before,
                steps: steps(segment.span_s[1] - segment.span_s[0]).max(1),
            }
        };
        let parts: Vec<Part> = segments.iter().map(part).collect();
        let points = 1 + 2 * steps(end_s - begin_s).max(1) + 4;
        let half_steps = Grid { begin_s, step_s: 0.5 * STEP_S, points };
        let offgoing_pa = if record.offgoing.is_empty() {
            Vec::new()
        } else {
            pressures(&car.offgoing_hydraulics, 0.0, &record.offgoing, half_steps)
        };
        let has_engine_torque = !record.engine_torque.is_empty();
        let mut model = Self {
            half_steps,
            parts,
            blocks: Vec::new(),
            rows: 0,
            own: Vec::new(),
            has_engine_torque,
            engine_rad_s: (0..points).map(|i| record.engine.at(half_steps.time_s(i))).collect(),
            offgoing_pa,
            directions: directions(&record, car),
            record,
        };
        model.lay_out_rows(&segments, car);
        model.lay_out_unknowns(&segments, car);
        model
    }

    fn lay_out_rows(&mut self, segments: &[Segment], car: &Car) {
        let mut blocks = Vec::new();
        for (i, segment) in segments.iter().enumerate() {
            let [from_s, to_s] = segment.span_s;
            let mut block = |channel, series: &Series, after_s: f64| {
                let readings = series.between([from_s + after_s, to_s]).collect();
                blocks.push(Block { channel, segment: Some(i), rows: 0..0, readings });
            };
            block(Channel::Turbine, &self.record.turbine, FIRST_READING_S);
            block(Channel::Output, &self.record.output, FIRST_READING_S);
            block(Channel::Wheel, &self.record.wheel, FIRST_WHEEL_READING_S);
            if self.has_engine_torque {
                block(Channel::Engine, &self.record.engine, FIRST_READING_S);
            }
        }
        for span_s in self.valve_alone_s(segments, car) {
            let readings = self.record.pressure.between(span_s).collect();
            blocks.push(Block { channel: Channel::Pressure, segment: None, rows: 0..0, readings });
        }
        blocks.retain(|block| !block.readings.is_empty());
        for block in &mut blocks {
            block.rows = self.rows..self.rows + block.readings.len();
            self.rows = block.rows.end;
        }
        self.blocks = blocks;
    }

    /// When the pressure is that of the valve alone, s: of a piston with a stroke not while it may move.
    fn valve_alone_s(&self, segments: &[Segment], car: &Car) -> Vec<[f64; 2]> {
        let [begin_s, end_s] = [self.half_steps.begin_s, self.half_steps.time_s(self.half_steps.points - 1)];
        let slipping = segments.iter().find(|segment| segment.kind == SegmentKind::Slipping);
        let (Some(cylinder), Some(slipping)) = (car.cylinder, slipping) else { return vec![[begin_s, end_s]] };
        // Before its fill it rests: the readings show the zero offset of the sensor.
        let fill_s = fill_begin_s(&car.hydraulics, &cylinder, &self.record.oncoming).unwrap_or(begin_s);
        [[begin_s, fill_s], [slipping.span_s[0], end_s]].into_iter().filter(|span_s| span_s[0] < span_s[1]).collect()
    }

    fn lay_out_unknowns(&mut self, segments: &[Segment], car: &Car) {
        let mut own = vec![
            OwnUnknown { mean: 0.0, sd: MASS_FRACTION_SD, segment: None },
            OwnUnknown { mean: 0.0, sd: 1.0, segment: None },
        ];
        if self.has_engine_torque {
            own.push(OwnUnknown { mean: 0.0, sd: ENGINE_TORQUE_FRACTION_SD, segment: None });
        }
        for (i, segment) in segments.iter().enumerate() {
            let begin_s = self.parts[i].begin_s;
            let record = &self.record;
            let (engine, turbine, output) =
                (start(&record.engine, begin_s), start(&record.turbine, begin_s), start(&record.output, begin_s));
            let ratio = match segment.kind {
                SegmentKind::Locked => car.shift.ratio_oncoming(),
                _ => car.shift.ratio_offgoing(),
            };
            let shaft_n_m = car.converter.torques(engine, turbine).turbine_n_m * ratio * car.driveline.final_ratio;
            let twist_rad = shaft_n_m / car.driveline.shaft_stiffness_n_m_rad;
            let vehicle_m_s = output / car.driveline.final_ratio * car.road.wheel_radius_m;
            let mut push = |mean, sd| own.push(OwnUnknown { mean, sd, segment: Some(i) });
            push(turbine, SPEED_SD_RAD_S);
            if segment.kind == SegmentKind::Slipping {
                push(output, SPEED_SD_RAD_S);
            }
            push(twist_rad / TWIST_UNIT_RAD, TWIST_SD);
            push(vehicle_m_s / VEHICLE_UNIT_M_S, VEHICLE_SD);
            if self.has_engine_torque {
                push(engine, SPEED_SD_RAD_S);
            }
        }
        self.own = own;
    }

    /// Where the own unknowns start.
    pub(crate) fn start(&self) -> Vec<f64> {
        self.own.iter().map(|unknown| unknown.mean).collect()
    }

    /// The readings that drive the motion of a car.
    pub(crate) fn inputs(&self, car: &Car) -> Inputs {
        Inputs {
            engine_rad_s: self.engine(car),
            oncoming_pa: self.oncoming(car),
            offgoing_pa: self.offgoing_pa.clone(),
            engine_n_m: self.engine_torque(car),
        }
    }

    pub(crate) fn oncoming(&self, car: &Car) -> Vec<f64> {
        pressures(&car.hydraulics, car.command_delay_s, &self.record.oncoming, self.half_steps)
    }

    /// Torque of the oncoming clutch at the readings of the turbine speed before it locks, N m, of a car and the measured slip.
    pub(crate) fn oncoming_torque(&self, car: &Car) -> Vec<f64> {
        let pressures = self.oncoming(car);
        let before_lock = self.record.segments.iter().filter(|segment| segment.kind != SegmentKind::Locked);
        let readings = before_lock.flat_map(|segment| self.record.turbine.between(segment.span_s));
        let torque = |(time_s, turbine_rad_s): (f64, f64)| {
            let slip = car.shift.oncoming_slip(turbine_rad_s, self.record.output.at(time_s));
            car.oncoming_torque(self.on_grid(&pressures, time_s), slip)
        };
        readings.map(torque).collect()
    }

    fn engine(&self, car: &Car) -> Vec<f64> {
        let late = |speed: f64| car.engine_delay_s + age_s(car.ages.engine_rad, speed);
        let times = (0..self.half_steps.points).map(|i| self.half_steps.time_s(i));
        times.zip(&self.engine_rad_s).map(|(time_s, near)| self.record.engine.at(time_s + late(*near))).collect()
    }

    fn engine_torque(&self, car: &Car) -> Vec<f64> {
        if !self.has_engine_torque {
            return Vec::new();
        }
        let late_s = car.engine_torque_delay_s;
        (0..self.half_steps.points).map(|i| self.record.engine_torque.at(self.half_steps.time_s(i) + late_s)).collect()
    }

    /// Readings less what the model says.
    pub(crate) fn residuals(&self, car: &Car, inputs: &Inputs, own: &[f64]) -> DVector<f64> {
        self.compared(car, inputs, &self.motions(&Moved { car, inputs, own, by: By::Nothing }))
    }

    /// The motion in each segment.
    fn motions(&self, of: &Moved<'_>) -> Vec<Motion> {
        let parts = self.parts.iter().zip(&self.record.segments).enumerate();
        parts.map(|(i, (part, segment))| Motion::run(segment.kind, *part, &self.run(i, of))).collect()
    }

    /// What makes the motion in a segment.
    fn run<'a>(&self, i: usize, of: &Moved<'a>) -> Run<'a> {
        let Moved { car, inputs, own, .. } = *of;
        let (of, start) = self.circumstances(i, self.record.segments[i].kind, car, own);
        Run { car, of, inputs, start }
    }

    /// Readings less what these motions say.
    fn compared(&self, car: &Car, inputs: &Inputs, motions: &[Motion]) -> DVector<f64> {
        let mut rows = DVector::zeros(self.rows);
        for (i, motion) in motions.iter().enumerate() {
            self.segment(i, car, motion, rows.as_mut_slice());
        }
        self.pressure(car, inputs, rows.as_mut_slice());
        rows
    }

    /// The rows of one segment.
    fn segment(&self, i: usize, car: &Car, motion: &Motion, rows: &mut [f64]) {
        let ages = car.ages;
        for block in self.blocks.iter().filter(|block| block.segment == Some(i)) {
            for (row, (time_s, reading)) in block.rows.clone().zip(&block.readings) {
                let seen = |delay_s: f64, age_rad: f64| time_s - delay_s - age_s(age_rad, *reading);
                rows[row] = reading
                    - match block.channel {
                        Channel::Turbine => motion.turbine_at(seen(0.0, ages.turbine_rad)),
                        Channel::Output => motion.output_at(seen(car.output_delay_s, ages.output_rad)),
                        Channel::Wheel => car.wheel_scale * motion.wheel_at(seen(car.wheel_delay_s, ages.wheel_rad)),
                        Channel::Engine | Channel::Pressure => {
                            motion.engine_at(seen(car.engine_delay_s, ages.engine_rad))
                        }
                    };
            }
        }
    }

    fn pressure(&self, car: &Car, inputs: &Inputs, rows: &mut [f64]) {
        for block in self.blocks.iter().filter(|block| block.segment.is_none()) {
            for (row, (time_s, reading)) in block.rows.clone().zip(&block.readings) {
                let seen_s = time_s - car.pressure_delay_s;
                let pressure_pa = self.on_grid(&inputs.oncoming_pa, seen_s);
                rows[row] = reading - car.pressure_offset_pa - car.pressure_scale * pressure_pa;
            }
        }
    }

    /// What this shift shows of a fill; none without a measured pressure.
    pub(crate) fn fill_log(&self) -> Option<FillLog<'_>> {
        let slipping = self.record.segments.iter().find(|segment| segment.kind == SegmentKind::Slipping)?;
        let (commands, pressure) = (&self.record.oncoming, &self.record.pressure);
        (!pressure.is_empty()).then_some(FillLog { commands, pressure, until_s: slipping.span_s[0] })
    }

    /// A value between the half steps.
    pub(crate) fn on_grid(&self, values: &[f64], time_s: f64) -> f64 {
        let steps = ((time_s - self.half_steps.begin_s) / self.half_steps.step_s).max(0.0);
        let i = (steps as usize).min(values.len().saturating_sub(2));
        let fraction = (steps - i as f64).min(1.0);
        values[i] + fraction * (values[i + 1] - values[i])
    }

    /// What the own unknowns say of a segment.
    fn circumstances(&self, segment: usize, kind: SegmentKind, car: &Car, own: &[f64]) -> (Circumstances, State) {
        let mut of = Circumstances {
            mass_share: own[0],
            load_n: LOAD_UNIT_N * own[1],
            engine_torque_share: 0.0,
            directions: self.directions,
        };
        if self.has_engine_torque {
            of.engine_torque_share = own[2];
        }
        let mut starts =
            self.own.iter().zip(own).filter(|(unknown, _)| unknown.segment == Some(segment)).map(|(_, value)| *value);
        let mut next = || starts.next().unwrap_or(0.0);
        let turbine_rad_s = next();
        let output_rad_s = match kind {
            SegmentKind::Held => turbine_rad_s / car.shift.ratio_offgoing(),
            SegmentKind::Locked => turbine_rad_s / car.shift.ratio_oncoming(),
            SegmentKind::Slipping => next(),
        };
        let (twist_rad, vehicle_m_s) = (TWIST_UNIT_RAD * next(), VEHICLE_UNIT_M_S * next());
        let engine_rad_s = if self.has_engine_torque { next() } else { 0.0 };
        (of, State { turbine_rad_s, output_rad_s, twist_rad, vehicle_m_s, engine_rad_s })
    }

    /// Residuals and their derivatives, by forward differences: those of a car by its own unknowns, and by the parameters which these other
    /// cars have changed.
    pub(crate) fn linearised(&self, car: &Car, changed: &[Changed], own: &[f64]) -> Linearised {
        let inputs = self.inputs(car);
        let base = Moved { car, inputs: &inputs, own, by: By::Nothing };
        let changed_inputs: Vec<Option<Inputs>> =
            changed.iter().map(|changed| self.changed_inputs(&inputs, changed)).collect();
        let changed_own: Vec<Vec<f64>> = (0..own.len())
            .map(|j| own.iter().enumerate().map(|(i, x)| if i == j { x + DIFFERENCE } else { *x }).collect())
            .collect();
        let by_parameter = changed.iter().zip(&changed_inputs).map(|(changed, own_inputs)| Moved {
            car: &changed.car,
            inputs: own_inputs.as_ref().unwrap_or(&inputs),
            own,
            by: By::Parameter(changed.parameter),
        });
        let by_own = self.own.iter().zip(&changed_own);
        let by_own = by_own.map(|(unknown, own)| Moved { own, by: By::Own(unknown.segment), ..base });
        let moved: Vec<Moved<'_>> = by_parameter.chain(by_own).collect();
        let (residuals, differences) = self.differences(&base, &moved);
        let by_own = differences.columns(changed.len(), own.len()).into_owned();
        Linearised { residuals, by_parameter: differences.remove_columns(changed.len(), own.len()), by_own }
    }

    /// The inputs of a changed car where they are others.
    fn changed_inputs(&self, inputs: &Inputs, Changed { parameter, car }: &Changed) -> Option<Inputs> {
        let mut changed = None;
        match parameter {
            P::Gain | P::Lag | P::CommandDelay | P::Hysteresis | P::Shape(Map::Lag | Map::Gain, _) => {
                changed.get_or_insert_with(|| inputs.clone()).oncoming_pa = self.oncoming(car);
            }
            P::EngineDelay => changed.get_or_insert_with(|| inputs.clone()).engine_rad_s = self.engine(car),
            P::EngineTorqueDelay => changed.get_or_insert_with(|| inputs.clone()).engine_n_m = self.engine_torque(car),
            _ => {}
        }
        changed
    }

    /// Residuals, and how they change per unit of what is moved.
    fn differences(&self, base: &Moved<'_>, moved: &[Moved<'_>]) -> (DVector<f64>, DMatrix<f64>) {
        let motions: Vec<Vec<Motion>> = (0..self.parts.len()).map(|i| self.motions_of(i, base, moved)).collect();
        let mut residuals = DVector::zeros(self.rows);
        for (i, motions) in motions.iter().enumerate() {
            self.segment(i, base.car, &motions[0], residuals.as_mut_slice());
        }
        self.pressure(base.car, base.inputs, residuals.as_mut_slice());
        let mut others: Vec<_> = motions.iter().map(|motions| motions[1..].iter()).collect();
        let mut columns = DMatrix::zeros(self.rows, moved.len());
        for (mut column, moved) in columns.column_iter_mut().zip(moved) {
            column.copy_from(&residuals);
            for (i, segment) in self.record.segments.iter().enumerate() {
                let other = if moved.acts_in(i, segment.kind) { others[i].next() } else { None };
                if other.is_some() || moved.leaves_motion() {
                    self.segment(i, moved.car, other.unwrap_or(&motions[i][0]), column.as_mut_slice());
                }
            }
            self.pressure(moved.car, moved.inputs, column.as_mut_slice());
            column.iter_mut().zip(&residuals).for_each(|(row, base)| *row = (*row - base) / DIFFERENCE);
        }
        (residuals, columns)
    }

    /// The motion in a segment, and those of everything moved that acts in it.
    fn motions_of(&self, i: usize, base: &Moved<'_>, moved: &[Moved<'_>]) -> Vec<Motion> {
        let kind = self.record.segments[i].kind;
        let acting = moved.iter().filter(|moved| moved.acts_in(i, kind));
        let runs: Vec<Run<'_>> = std::iter::once(base).chain(acting).map(|of| self.run(i, of)).collect();
        Motion::run_all(kind, self.parts[i], &runs)
    }
}

/// A car in which one parameter is changed by the step of the differences.
pub(crate) struct Changed {
    parameter: P,
    car: Car,
}

impl Changed {
    /// One for each of the parameters.
    pub(crate) fn all(file: &Car, shafts: &[Shaft], priors: &[Prior], unknowns: &[f64]) -> Vec<Self> {
        let mut moved = unknowns.to_vec();
        let mut changed = |(j, prior): (usize, &Prior)| {
            moved[j] += DIFFERENCE;
            let car = file.with(shafts, priors, &moved);
            moved[j] = unknowns[j];
            Self { parameter: prior.parameter, car }
        };
        priors.iter().enumerate().map(&mut changed).collect()
    }
}

/// A shift with one thing changed.
#[derive(Clone, Copy)]
struct Moved<'a> {
    car: &'a Car,
    inputs: &'a Inputs,
    own: &'a [f64],
    by: By,
}

/// What is changed.
#[derive(Clone, Copy)]
enum By {
    Nothing,
    Parameter(P),
    /// An own unknown, with the segment that it is of.
    Own(Option<usize>),
}

impl Moved<'_> {
    /// Whether the motion in a segment is another one.
    fn acts_in(&self, segment: usize, kind: SegmentKind) -> bool {
        match self.by {
            By::Nothing => false,
            By::Parameter(parameter) => !parameter.leaves_motion() && acts_in(parameter, kind),
            By::Own(of) => of.is_none_or(|of| of == segment),
        }
    }

    /// Whether it changes only how a motion is read.
    fn leaves_motion(&self) -> bool {
        matches!(self.by, By::Parameter(parameter) if parameter.leaves_motion())
    }
}

/// The segments without a fill: how long it lasts differs from shift to shift, by what is left of the oil. It is over before both clutches slip.
fn without_fill(record: &ShiftRecord, car: &Car) -> Vec<Segment> {
    let Some(fill_s) = car.cylinder.and_then(|cylinder| fill_begin_s(&car.hydraulics, &cylinder, &record.oncoming))
    else {
        return record.segments.clone();
    };
    let before = |segment: &Segment| match (segment.kind, segment.span_s) {
        (SegmentKind::Held, [from_s, to_s]) => Segment { span_s: [from_s, to_s.min(fill_s)], ..*segment },
        _ => *segment,
    };
    let cut = record.segments.iter().map(before);
    cut.filter(|segment| segment.span_s[1] - segment.span_s[0] >= SHORTEST_S).collect()
}

/// Signs of the slips of the oncoming and the offgoing clutch while both slip.
fn directions(record: &ShiftRecord, car: &Car) -> [f64; 2] {
    let slipping = record.segments.iter().filter(|segment| segment.kind == SegmentKind::Slipping);
    let readings = slipping.flat_map(|segment| record.turbine.between(segment.span_s));
    let sums = readings.fold([0.0, 0.0], |[oncoming, offgoing], (time_s, turbine)| {
        let output = record.output.at(time_s);
        [oncoming + car.shift.oncoming_slip(turbine, output), offgoing + car.shift.offgoing_slip(turbine, output)]
    });
    sums.map(drivetrain::clutch::direction)
}

/// Whether the motion in a segment depends on a parameter: a clutch that sticks or is open has no say.
fn acts_in(parameter: P, kind: SegmentKind) -> bool {
    match parameter {
        P::Friction | P::FrictionAtRest | P::FrictionSlope | P::Spring => kind != SegmentKind::Locked,
        P::Gain | P::Lag | P::CommandDelay | P::Hysteresis => kind != SegmentKind::Locked,
        P::Shape(map, _) => map == Map::Capacity || kind != SegmentKind::Locked,
        P::OffgoingFriction => kind == SegmentKind::Slipping,
        _ => true,
    }
}

/// The value of a noisy series at a time: the middle of the readings around it.
fn start(series: &Series, time_s: f64) -> f64 {
    const AROUND_S: f64 = 0.02;
    let (count, sum) = series
        .between([time_s - AROUND_S, time_s + AROUND_S])
        .fold((0.0, 0.0), |(count, sum), (_, value)| (count + 1.0, sum + value));
    if count > 0.0 { sum / count } else { series.at(time_s) }
}
