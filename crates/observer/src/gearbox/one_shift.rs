//! The gearbox filter of a vehicle of one shift, as an observer of its oncoming clutch.
//!
//! A log of such a vehicle has no gears. They follow from the command of the oncoming clutch and from the clutch that holds:
//!
//! | from | to | when |
//! |---|---|---|
//! | 1 | 1-2 | the command asks for a pressure above the kiss point |
//! | 1-2 | 2 | the oncoming clutch has held for 0.1 s |
//! | 2 | 2-1 | the command asks for less than half the pressure of the kiss point |
//! | 2-1 | 1 | the offgoing clutch of the vehicle has held for 0.1 s |
//!
//! A command that is taken back before its shift has ended leads to the other shift, or back to the gear that still holds.

use car::{Input, ShiftCommand};
use drivetrain::{Driveline, Real, ReducedShift};

use super::{
    AccelerationReading, FrictionElement, GearRow, GearboxFilter, GearboxState, GearboxTables, MAX_ELEMENTS,
    ShiftEstimate, ShiftInput, ShiftPhase, ShiftRow, ShiftUncertainty, TurbineTorque, UnheardTorque,
};
use crate::{
    EngineNoise, Estimate, Estimator, Health, InputLimits, Phase, Reading, SpeedReading, Supervisor, SupervisorState,
};

/// Place of the offgoing clutch among the elements, and of the gear before among the gears.
const OFFGOING: usize = 0;
/// The same of the oncoming clutch and of the gear after.
const ONCOMING: usize = 1;

/// Time for which a clutch has to hold until its gear counts as engaged, s \[chosen\]. Gears that are given 0 to 0.3 s after a shift change
/// an estimate by 2 % at most.
const HOLDS_S: f64 = 0.1;
/// Time for which readings may show a wrong slip, s: a flare lasts longer.
const FRESH_S: f64 = 0.025;
/// Time for which an earlier phase of the shift has to last until it is one, s \[chosen\]: a clutch that has let go or gripped by mistake of
/// the filter is back within some readings.
const BACK_S: f64 = 0.05;
/// Error of the ratio of turbine and output speed by their scales, as a fraction \[chosen\].
const RATIO_FRACTION: f64 = 0.02;

/// The tables of a vehicle of one shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneShiftTables<T> {
    /// The offgoing clutch, then the oncoming one.
    pub elements: [FrictionElement<T>; 2],
    /// The gear before the shift, then the one after.
    pub gears: [GearRow<T>; 2],
    /// The shift, then the one back.
    pub shifts: [ShiftRow<T>; 2],
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneShiftFilter<T> {
    tables: OneShiftTables<T>,
    parameters: Parameters<T>,
    shift: ReducedShift<T>,
    supervisor: Supervisor<T>,
    unheard: UnheardTorque<T>,
}

/// The parameters of a [`GearboxFilter`] beside its tables.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Parameters<T> {
    driveline: Driveline<T>,
    wheels_kg_m2: T,
    turbine: TurbineTorque<T>,
    uncertainty: ShiftUncertainty<T>,
    readings: [SpeedReading<T>; 3],
    engine: (SpeedReading<T>, EngineNoise<T>),
    acceleration: AccelerationReading<T>,
    limits: InputLimits<T>,
}

/// Memory of a [`OneShiftFilter`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneShiftState<T> {
    filter: GearboxState<T>,
    stage: Stage,
    /// For how long the oncoming clutch of the shift has held, s.
    holds_s: T,
    /// For how long the turbine has run away from the old gear, s.
    flares_s: T,
    /// For how long an earlier phase than that of the estimate has held, s.
    back_s: T,
    /// The phase of the estimate.
    phase: Phase,
    supervisor: SupervisorState<T>,
}

/// Where the vehicle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    First,
    Up,
    Second,
    Down,
}

impl Stage {
    fn command(self) -> ShiftCommand {
        let [from, to] = match self {
            Self::First => [OFFGOING, OFFGOING],
            Self::Up => [OFFGOING, ONCOMING],
            Self::Second => [ONCOMING, ONCOMING],
            Self::Down => [ONCOMING, OFFGOING],
        };
        ShiftCommand::between(from, to)
    }
}

impl<T: Real> OneShiftTables<T> {
    /// As the filter takes them.
    fn as_slices(&self) -> GearboxTables<'_, T> {
        GearboxTables { elements: &self.elements, gears: &self.gears, shifts: &self.shifts }
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> OneShiftTables<U> {
        OneShiftTables {
            elements: self.elements.each_ref().map(FrictionElement::cast),
            gears: self.gears.each_ref().map(GearRow::cast),
            shifts: self.shifts.each_ref().map(ShiftRow::cast),
        }
    }
}

impl<T: Real> OneShiftFilter<T> {
    /// The filter of these tables. Only the parameters of `filter` count, and not its tables.
    pub fn new(
        tables: OneShiftTables<T>,
        filter: &GearboxFilter<'_, T>,
        shift: ReducedShift<T>,
        supervisor: Supervisor<T>,
        unheard: UnheardTorque<T>,
    ) -> Self {
        let GearboxFilter {
            tables: _,
            driveline,
            wheels_kg_m2,
            turbine,
            uncertainty,
            readings,
            engine,
            acceleration,
            limits,
        } = *filter;
        let parameters =
            Parameters { driveline, wheels_kg_m2, turbine, uncertainty, readings, engine, acceleration, limits };
        Self { tables, parameters, shift, supervisor, unheard }
    }

    /// Its tables.
    pub fn tables(&self) -> &OneShiftTables<T> {
        &self.tables
    }

    /// The same filter in another precision.
    pub fn cast<U: Real>(&self) -> OneShiftFilter<U> {
        OneShiftFilter::new(
            self.tables.cast(),
            &self.filter().cast(GearboxTables { elements: &[], gears: &[], shifts: &[] }),
            self.shift.cast(),
            self.supervisor.cast(),
            self.unheard.cast(),
        )
    }

    /// The filter with its tables.
    fn filter(&self) -> GearboxFilter<'_, T> {
        let Parameters { driveline, wheels_kg_m2, turbine, uncertainty, readings, engine, acceleration, limits } =
            self.parameters;
        let tables = self.tables.as_slices();
        GearboxFilter { tables, driveline, wheels_kg_m2, turbine, uncertainty, readings, engine, acceleration, limits }
    }

    /// Follows the command of the oncoming clutch before a step.
    fn take_command(&self, state: &mut OneShiftState<T>, command: Option<Reading<T>>) {
        let oncoming = &self.tables.elements[ONCOMING];
        let Some(reading) = command.and_then(|reading| oncoming.limits.usable(&reading)) else { return };
        let asked_pa = oncoming.valve.valve.settled_pressure(reading.value);
        let kiss_pa = self.supervisor.kiss_pressure_pa;
        let still_holds = state.filter.estimate.phase == Some(ShiftPhase::OffgoingHolds);
        let stage =
            match state.stage {
                Stage::First | Stage::Down if asked_pa > kiss_pa => {
                    if state.stage == Stage::Down && still_holds {
                        Stage::Second
                    } else {
                        Stage::Up
                    }
                }
                Stage::Second | Stage::Up if asked_pa < T::of(0.5) * kiss_pa => {
                    if state.stage == Stage::Up && still_holds { Stage::First } else { Stage::Down }
                }
                same => same,
            };
        state.enter(stage);
    }

    /// Ends a shift whose oncoming clutch holds.
    fn follow_shift(state: &mut OneShiftState<T>, found: &ShiftEstimate<T>, dt_s: T) {
        let holds = found.phase == Some(ShiftPhase::OncomingHolds);
        state.holds_s = if holds { state.holds_s + dt_s } else { T::zero() };
        if state.holds_s >= T::of(HOLDS_S) {
            let stage = match state.stage {
                Stage::Up => Stage::Second,
                Stage::Down => Stage::First,
                same => same,
            };
            state.enter(stage);
        }
    }

    /// The phase of the shift: by the clutch that holds, and by the readings where the filter does not run.
    fn phase(
        &self,
        state: &mut OneShiftState<T>,
        found: &ShiftEstimate<T>,
        [turbine, output]: [T; 2],
        dt_s: T,
    ) -> Phase {
        let valve_pa = found.valve_pa[ONCOMING];
        let slips = [self.shift.offgoing_slip(turbine, output), self.shift.oncoming_slip(turbine, output)];
        let by_readings = self.supervisor.step(&mut state.supervisor, dt_s, valve_pa, slips[0], slips[1]);
        let kiss_pa = self.supervisor.kiss_pressure_pa;
        let before_or_torque = if valve_pa > kiss_pa { Phase::TorquePhase } else { Phase::BeforeShift };
        let is_released = valve_pa < T::of(0.5) * kiss_pa;
        let then = state.phase;
        // A slip that only the estimate shows, or one below that of a release, ends no phase.
        let release = self.supervisor.release_slip_rad_s;
        let has_let_go = match then {
            Phase::BeforeShift | Phase::TorquePhase => slips[0].abs() > release,
            Phase::InertiaPhase => true,
            // A clutch that has gripped slips again only where no error of the ratio shows it.
            Phase::AfterShift => slips[1].abs() > release.at_least(T::of(RATIO_FRACTION) * turbine.abs()),
        };
        let phase = match (state.stage, found.phase) {
            (_, None) => by_readings,
            (_, Some(_)) if is_released => Phase::BeforeShift,
            (_, Some(ShiftPhase::BothSlip)) if has_let_go => Phase::InertiaPhase,
            (Stage::Second, Some(_))
            | (Stage::Up, Some(ShiftPhase::OncomingHolds))
            | (Stage::Down, Some(ShiftPhase::OffgoingHolds)) => Phase::AfterShift,
            (_, Some(ShiftPhase::BothSlip)) if then == Phase::AfterShift => then,
            _ => before_or_torque,
        };
        let is_back = phase != Phase::BeforeShift && (phase as u8) < then as u8;
        state.back_s = if is_back { state.back_s + dt_s } else { T::zero() };
        state.phase = if is_back && state.back_s < T::of(BACK_S) { then } else { phase };
        state.supervisor.phase = state.phase;
        state.phase
    }
}

impl<T: Real> OneShiftState<T> {
    fn enter(&mut self, stage: Stage) {
        if stage != self.stage {
            (self.stage, self.holds_s) = (stage, T::zero());
        }
    }
}

impl<T: Real> OneShiftFilter<T> {
    /// Pressure and torque of the oncoming clutch, Pa and N m.
    fn oncoming(
        &self,
        filter: &GearboxFilter<'_, T>,
        state: &OneShiftState<T>,
        (taken, found): (&ShiftInput<T>, &ShiftEstimate<T>),
    ) -> [T; 2] {
        let in_shift = found.clutches.into_iter().flatten().find(|clutch| clutch.element.place() == Some(ONCOMING));
        let [pressure_pa, torque_n_m] = match in_shift {
            Some(clutch) => [clutch.pressure_pa, clutch.torque_n_m],
            None => {
                let by_valve = filter.unshifted(&state.filter, &self.tables.shifts[0], ONCOMING);
                [by_valve.pressure_pa, by_valve.torque_n_m]
            }
        };
        let held_n_m =
            if state.phase == Phase::AfterShift { self.held_n_m(filter, state, (taken, found)) } else { None };
        [pressure_pa, held_n_m.unwrap_or(torque_n_m)]
    }

    /// Torque of the oncoming clutch after the shift, N m: what the turbine torque by the converter's maps leaves beside the inertia. What the
    /// filter has learnt of that torque in the shift is not used: after it, the speeds show neither.
    fn held_n_m(
        &self,
        filter: &GearboxFilter<'_, T>,
        state: &OneShiftState<T>,
        (taken, found): (&ShiftInput<T>, &ShiftEstimate<T>),
    ) -> Option<T> {
        let ([_, gear], [up, _]) = (&self.tables.gears, &self.tables.shifts);
        let side = filter.input_side(&state.filter, taken, T::zero())?;
        let turbine_n_m = filter.turbine.at(&side)?.turbine_n_m;
        let [[m11, m12], _] = up.mass_kg_m2;
        let inertia_n_m = found.shaft_n_m.map_or(T::zero(), |shaft_n_m| {
            let output_n_m = shaft_n_m / self.parameters.driveline.final_ratio;
            (m11 * gear.ratio + m12) * (gear.ratio * turbine_n_m - output_n_m) / gear.inertia_kg_m2
        });
        Some((turbine_n_m - inertia_n_m) / up.clutches[ONCOMING].alpha)
    }

    /// Whether the turbine has run away from the old gear for longer than wrong readings can show it.
    fn flares(&self, state: &mut OneShiftState<T>, found: &ShiftEstimate<T>, dt_s: T) -> bool {
        let flares =
            found.phase == Some(ShiftPhase::BothSlip) && found.flare_rad_s > self.supervisor.release_slip_rad_s;
        state.flares_s = if flares { state.flares_s + dt_s } else { T::zero() };
        self.supervisor.is_held_longer(state.flares_s, T::of(FRESH_S))
    }
}

impl<T: Real> Estimator<T> for OneShiftFilter<T> {
    type State = OneShiftState<T>;

    fn start(&self) -> OneShiftState<T> {
        let mut filter = self.filter().start();
        if let Some(offgoing) = &mut filter.elements[OFFGOING] {
            offgoing.take_unheard(&self.unheard);
        }
        OneShiftState {
            filter,
            stage: Stage::First,
            holds_s: T::zero(),
            flares_s: T::zero(),
            back_s: T::zero(),
            phase: Phase::BeforeShift,
            supervisor: SupervisorState::new(),
        }
    }

    fn step(&self, state: &mut OneShiftState<T>, input: &Input<T>) -> Estimate<T> {
        let dt_s = if input.dt_s >= T::zero() && input.dt_s.is_finite() { input.dt_s } else { T::zero() };
        self.take_command(state, input.command);
        let filter = self.filter();
        let taken = Self::shift_input(state, input);
        let found = filter.step(&mut state.filter, &taken);
        Self::follow_shift(state, &found, dt_s);
        let speeds = filter.measured(&state.filter.newest, None);
        let phase = self.phase(state, &found, speeds, dt_s);
        let [pressure_pa, clutch_torque_n_m] = self.oncoming(&filter, state, (&taken, &found));
        let flare = if self.flares(state, &found, dt_s) { Health::Flare } else { Health::Good };
        let mut channels = found.channels;
        [channels.offgoing_command, channels.command] = [OFFGOING, ONCOMING].map(|at| found.commands[at]);
        Estimate {
            pressure_pa,
            clutch_torque_n_m,
            shaft_torque_n_m: found.shaft_n_m,
            phase,
            health: found.health.max(flare),
            channels,
            bounds: None,
        }
    }
}

impl<T: Real> OneShiftFilter<T> {
    fn shift_input(state: &OneShiftState<T>, input: &Input<T>) -> ShiftInput<T> {
        let mut commands = [None; MAX_ELEMENTS];
        (commands[OFFGOING], commands[ONCOMING]) = (input.offgoing_command, input.command);
        ShiftInput {
            dt_s: input.dt_s,
            engine_rad_s: input.engine_rad_s,
            turbine_rad_s: input.turbine_rad_s,
            output_rad_s: input.output_rad_s,
            wheel_rad_s: input.wheel_rad_s,
            engine_n_m: input.engine_torque_n_m,
            acceleration_m_s2: None,
            lock_up_applied: false,
            commands,
            gear: state.stage.command(),
        }
    }
}
