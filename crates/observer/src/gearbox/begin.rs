//! Begin and end of the filter.

use super::running::TURBINE_ACTS;
use super::{
    Compared, FIRST_S, FRACTION, GATE, Gate, Gaussian, GearboxFilter, GearboxState, Health, LOAD, LOAD_START, LOST_S,
    MISFIT, N, NOT_CAUGHT, OUTPUT, PhaseMemory, RATE, Running, SCALE, SHAFT_START, SLIPS_IN_GEAR, SLOW_FRACTION,
    SPEEDS, SPRING, ShiftClutch, ShiftInput, ShiftPhase, ShiftRow, Slip, TURBINE, WHEEL, WHEEL_START_RAD_S, at_start,
    square, turbine,
};
use car::ShiftCommand;
use drivetrain::Real;

/// Of a speed of the filter this fraction has to be one that a reading can have \[chosen\]: a car that turns a little faster than its file
/// states has no readings then, and the filter goes on without them.
const SOUND: f64 = 0.5;

impl<T: Real> GearboxFilter<'_, T> {
    /// Ends a filter whose state is not possible, or whose gear does not fit; begins one in a gear.
    pub(super) fn settle(
        &self,
        state: &mut GearboxState<T>,
        input: &ShiftInput<T>,
        torque: Option<&turbine::Found<T>>,
    ) -> Health {
        let mut health = Health::Good;
        let speeds = self.measured(&state.newest, state.running.as_ref());
        let opens = self.is_open(state, input.gear);
        let overruns = self.overruns(input.gear, speeds);
        if let Some(running) = &mut state.running {
            let lost = T::of(LOST_S);
            // In a gear one speed is that of the other; in a shift it takes both to see which clutch holds.
            let [turbine_s, output_s] = [TURBINE, OUTPUT].map(|k| running.silent_s[k]);
            let silent_s = if running.shift.is_some() { turbine_s.max(output_s) } else { turbine_s.min(output_s) };
            let blind = silent_s > lost;
            let slow = running.x.mean[OUTPUT].abs() <= self.uncertainty.output_least_rad_s;
            let possible = running.x.is_sound()
                && self.limits.shaft_torque_possible(running.x.mean[SPRING])
                && running.x.mean[..SPEEDS].iter().all(|&speed| self.limits.speed_valid(T::of(SOUND) * speed));
            let ratio = self.tied_ratio(running).filter(|_| running.shift.is_none());
            let is_late = running.shift.is_some() && overruns;
            let unfit = is_late || ratio.is_some_and(|ratio| self.slip(ratio, speeds).is_over());
            state.unfit = if unfit { state.unfit.saturating_add(1) } else { 0 };
            if running.misfit > T::of(MISFIT) {
                health = match (opens, overruns || self.may_overrun(running, input.gear, speeds)) {
                    (true, _) => Health::ClutchOpen,
                    (_, true) => Health::OneWayOverruns,
                    _ => Health::HeldClutchSlips,
                };
                running.before = None;
            }
            let slips = state.unfit >= if is_late { NOT_CAUGHT } else { SLIPS_IN_GEAR };
            if slow && possible {
                self.keep_wheel_scale(running, &mut state.learnt);
            }
            if blind || slow || !possible || slips {
                state.lose();
                state.lost = blind || !possible;
            }
        }
        if state.running.is_none() {
            let (running, slips) = self.begin(state, input, torque);
            // In a match, and not moved through a filter: it is large, and there is none in most steps without speeds.
            match running {
                Some(running) if running.x.is_sound() => state.running = Some(running),
                _ => {}
            }
            let slow = self.is_slow(state);
            let stands = state.running.is_none();
            state.launches = stands && self.turbine.converter.is_none() && (state.launches || slow || opens);
            state.slips = stands && !slow && !state.launches && !overruns && (state.slips || slips);
            let neutral = input.gear == ShiftCommand::NEUTRAL;
            health = match (stands && neutral, stands && slow, state.launches && slips, state.slips) {
                (true, ..) => Health::ClutchOpen,
                (_, true, ..) => Health::TooSlow,
                (_, _, true, _) => Health::ClutchOpen,
                _ if stands && overruns => Health::OneWayOverruns,
                (.., true) => Health::HeldClutchSlips,
                _ => health,
            };
            if state.running.is_some() && core::mem::take(&mut state.lost) {
                health = Health::Restarted;
            }
        }
        health
    }

    /// Slip of the gear that is commanded.
    fn slip_in_gear(&self, gear: ShiftCommand, speeds: [T; 2]) -> Option<Slip<T>> {
        let row = self.tables.gear(gear.to).filter(|_| gear.is_steady())?;
        Some(self.slip(row.ratio, speeds))
    }

    /// Whether the turbine turns slower than the gear would let it, behind a one-way clutch that overruns.
    fn overruns(&self, gear: ShiftCommand, speeds: [T; 2]) -> bool {
        // The slip comes first: the tables are not searched in every step.
        let is_slower = self.slip_in_gear(gear, speeds).is_some_and(|slip| slip.is_over() && slip.value < T::zero());
        is_slower && self.tables.is_one_way(gear.to)
    }

    /// Whether it may begin to do so where the readings do not show it yet: an element that slips makes the turbine faster. In a shift
    /// it does while the car coasts.
    fn may_overrun(&self, running: &Running<T>, gear: ShiftCommand, speeds: [T; 2]) -> bool {
        let in_gear = self.slip_in_gear(gear, speeds).is_some_and(|slip| !slip.is_over() || slip.value < T::zero())
            && self.tables.is_one_way(gear.to);
        let coasts = running.phase.phase == ShiftPhase::BothSlip && running.slow_n_m <= T::zero();
        in_gear || coasts && running.shift.is_some_and(|shift| shift.clutches.iter().any(ShiftClutch::may_overrun))
    }

    /// Whether the newest reading of the output speed is too slow to be used.
    pub(super) fn is_slow(&self, state: &GearboxState<T>) -> bool {
        let newest = state.newest[OUTPUT].filter(|newest| newest.age_s <= T::of(LOST_S));
        newest.is_some_and(|newest| newest.value.abs() <= self.uncertainty.output_least_rad_s)
    }

    /// Whether the command opens the clutch that ties the engine of a car without a converter to a gear.
    pub(super) fn is_open(&self, state: &GearboxState<T>, gear: ShiftCommand) -> bool {
        if self.turbine.converter.is_some() || !gear.is_steady() {
            return false;
        }
        let found =
            self.tables.out_of(gear.from).and_then(|shift| self.element(&state.elements, shift.clutches[0].element));
        found.is_some_and(|(memory, element)| {
            let kiss_pa = element.clutch.kiss_pressure();
            !memory.is_unheard() && memory.lower_pa() < kiss_pa + element.above_kiss_pa()
        })
    }

    /// The first state, once the speeds are known and are those of a gear; and whether they are known and no gear fits.
    pub(super) fn begin(
        &self,
        state: &GearboxState<T>,
        input: &ShiftInput<T>,
        torque: Option<&turbine::Found<T>>,
    ) -> (Option<Running<T>>, bool) {
        let gear = input.gear;
        let first =
            |k: usize| state.newest[k].filter(|newest| newest.age_s <= T::of(FIRST_S)).map(|newest| newest.value);
        let (Some(turbine), Some(output), Some(torque)) = (first(TURBINE), first(OUTPUT), torque) else {
            return (None, false);
        };
        if output.abs() <= self.uncertainty.output_least_rad_s {
            return (None, false);
        }
        let shift = self.tables.commanded(gear).copied();
        let held = [(gear.from, ShiftPhase::OffgoingHolds), (gear.to, ShiftPhase::OncomingHolds)].into_iter().find_map(
            |(gear, phase)| {
                let ratio = self.tables.gear(gear)?.ratio;
                (!self.slip(ratio, [turbine, output]).is_over()).then_some((ratio, phase))
            },
        );
        // Of a gear that is in no table nothing can be said.
        let known = self.tables.gear(gear.from).is_some();
        // Behind a one-way clutch that overruns the turbine turns freely.
        let is_free = |shift: &ShiftRow<T>| {
            let [off, _] = &shift.clutches;
            off.may_overrun() && self.slip(off.ratio, [turbine, output]).value < T::zero()
        };
        let held = held.or(shift.as_ref().filter(|shift| is_free(shift)).map(|_| (T::zero(), ShiftPhase::BothSlip)));
        let Some((ratio, phase)) = held else { return (None, known && gear.is_steady()) };
        if !gear.is_steady() && shift.is_none() {
            return (None, false);
        }
        let phase = if shift.is_some() { phase } else { ShiftPhase::InGear };
        let mut running = Running {
            x: self.balanced(state, ratio, output, torque),
            gear: gear.from,
            shift: None,
            phase: PhaseMemory::new(phase),
            torques: None,
            slow_n_m: torque.turbine_n_m,
            motion: None,
            rates: [T::zero(); SPEEDS],
            pressures_before: [[T::zero(), T::one()]; 2],
            gates: [Gate::new(GATE); SPEEDS],
            silent_s: [T::zero(); SPEEDS],
            wheel_off_rad_s: T::zero(),
            misfit: T::one(),
            before: None,
            compared: Compared::nothing(),
            felt: state.felt,
        };
        running.renew_shift();
        if phase == ShiftPhase::BothSlip {
            running.x.renew(TURBINE, turbine, square(self.readings[TURBINE].std_dev_rad_s));
        }
        if let Some(shift) = shift {
            self.enter_shift(&mut running, shift, &state.learnt);
        }
        (Some(running), false)
    }

    /// Mean and covariance in a gear with this ratio, the drive shafts in balance with the torque at the gearbox input. With the ratio
    /// zero no torque passes.
    fn balanced(&self, state: &GearboxState<T>, ratio: T, output: T, torque: &turbine::Found<T>) -> Gaussian<T> {
        let u = &self.uncertainty;
        let shaft = torque.turbine_n_m * ratio * self.driveline.final_ratio;
        let mut mean = [T::zero(); N];
        (mean[TURBINE], mean[OUTPUT], mean[WHEEL]) = (ratio * output, output, output / self.driveline.final_ratio);
        (mean[SPRING], mean[LOAD]) = (shaft, shaft);
        let mut std_devs = [T::zero(); N];
        std_devs[OUTPUT] = self.readings[OUTPUT].std_dev_rad_s;
        std_devs[WHEEL] = T::of(WHEEL_START_RAD_S);
        std_devs[SPRING] = at_start(SHAFT_START, shaft);
        std_devs[LOAD] = at_start(LOAD_START, shaft);
        std_devs[RATE] = u.rate_rad_s;
        std_devs[FRACTION] = u.turbine_share;
        let mut x = Gaussian::of(mean, std_devs);
        let [scale, scale_variance] = state.learnt.known_wheel_scale();
        x.renew(SCALE, u.wheel_scale * scale, square(u.wheel_scale) * scale_variance);
        let known = self.known(&state.learnt, &self.acting_in_gear());
        x.renew(SLOW_FRACTION, known.mean[TURBINE_ACTS], known.covariance[TURBINE_ACTS][TURBINE_ACTS]);
        // Turbine and output are tied.
        let output_variance = square(std_devs[OUTPUT]);
        x.add(TURBINE, TURBINE, ratio * ratio * output_variance);
        x.add(TURBINE, OUTPUT, ratio * output_variance);
        // An error of the turbine torque is one of the shaft torque in balance with it.
        for (fraction, per) in [(FRACTION, shaft), (SLOW_FRACTION, torque.fraction * shaft)] {
            let variance = x.covariance[fraction][fraction];
            x.add(SPRING, SPRING, variance * per * per);
            x.add(SPRING, fraction, variance * per);
        }
        x
    }
}
