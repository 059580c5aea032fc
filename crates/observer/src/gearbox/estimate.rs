//! What the filter says after a step.

use car::ShiftCommand;
use drivetrain::Real;

use super::elements::{ElementState, PressureError};
use super::phases::{STRONG, STRONGER_THAN_SHOWN, Slip};
use super::powertrain::{ClutchTorque, Torques};
use super::turbine::MIN_N_M;
use super::{
    ClutchesAtTurbine, FIRST_S, FRACTION, FRICTION, GearboxFilter, GearboxState, InputClutch, KISS, MAX_ELEMENTS, N,
    Newest, OUTPUT, PRESSURE, SLOW_FRACTION, SPEEDS, SPRING, ShiftClutch, ShiftElement, ShiftInput, ShiftPhase,
    ShiftRow, TURBINE, WHEEL, square,
};
use crate::{ChannelHealth, Channels, Health};

/// Fraction of the valve model's uncertainty above which the speeds have shown nothing of a clutch's torque \[chosen\].
const HIDDEN: f64 = 0.9;

/// Pressure and torque of one clutch of a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClutchEstimate<T> {
    /// The element.
    pub element: ShiftElement,
    /// Cylinder pressure, Pa.
    pub pressure_pa: T,
    /// Torque, N m, positive when it drives its output side.
    pub torque_n_m: T,
    /// Standard deviation of the torque, N m: of the filter's states, and of one that slips or is open its drag.
    pub std_dev_n_m: T,
    /// Standard deviation of the pressure, Pa: of the filter's states, and what these leave of the gain of the valve.
    pub pressure_std_dev_pa: T,
    /// Pressure by the models of valve and piston alone, Pa.
    pub valve_pa: T,
    /// Torque by these models and friction alone, N m; of a clutch that holds, the torque up to which it does, in the direction of
    /// its load.
    pub open_loop_n_m: T,
    /// Whether it holds.
    pub holds: bool,
    /// Whether the speeds show nothing of its torque: the estimate is that of the valve model.
    pub hidden: bool,
    /// Lowest and highest pressure, Pa, for errors within the budget.
    pub pressure_range_pa: Option<[T; 2]>,
    /// Lowest and highest torque, N m, for errors within the budget. Its direction is that of the slip, if that is larger than its
    /// error; else, where an element that is engaged in both gears may slip by the bounds of the errors, and where a speed has not been read twice within 50 ms or its last reading was refused, either direction is
    /// possible. The slip errs by 7 standard deviations and 0.6 rad/s, by twice its change since the older reading, by the spread of
    /// the readings' ages times the rate of each speed, and by an acceleration that changes by up to 10,000 rad/s^3.
    pub torque_range_n_m: Option<[T; 2]>,
}

/// Output of the filter after one step.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShiftEstimate<T> {
    /// The gear or shift that the filter is in; none while it has only the valve models.
    pub gear: Option<ShiftCommand>,
    /// Which clutches hold.
    pub phase: Option<ShiftPhase>,
    /// The offgoing and the oncoming clutch of the shift; none in a gear.
    pub clutches: Option<[ClutchEstimate<T>; 2]>,
    /// Pressures of all elements by the models of their valves and pistons, Pa.
    pub valve_pa: [T; MAX_ELEMENTS],
    /// Slip of the offgoing clutch away from the new gear, at the turbine, rad/s, where the readings show one: a flare. Else
    /// zero.
    pub flare_rad_s: T,
    /// Torque at the gearbox input, N m, as corrected.
    pub turbine_n_m: Option<T>,
    /// Torque of the drive shafts, N m.
    pub shaft_n_m: Option<T>,
    /// The lock-up clutch of the converter while it is applied; without a converter, the clutch of the gear while there is no shift.
    pub input_clutch: Option<InputClutch<T>>,
    /// All clutches together as the turbine feels them, of a gearbox without elements: one of which the ratios alone are known.
    pub at_turbine: Option<ClutchesAtTurbine<T>>,
    /// Whether the input could be used, and whether the estimate can be believed.
    pub health: Health,
    /// What became of the reading of each channel; of the commands together a refused one, or a lost one
    /// of an element that shifts.
    pub channels: Channels<ChannelHealth>,
    /// The same of the command of each element.
    pub commands: [ChannelHealth; MAX_ELEMENTS],
}

/// Standard deviation of the part of a load that one of two clutches carries while both hold: any from none to all of it, uniform.
const SHARED: f64 = 0.29;
/// A clutch that could carry more than so many times the load, with one standard deviation added to it, does not slip \[chosen\].
const STRONGER: f64 = 1.5;
/// Standard deviation of the rate of a speed near a standstill that is not read, rad/s^2 \[chosen\].
const UNREAD_RAD_S2: f64 = 100.0;

impl<T: Real> ShiftEstimate<T> {
    pub(super) fn nothing() -> Self {
        Self {
            gear: None,
            phase: None,
            clutches: None,
            valve_pa: [T::zero(); MAX_ELEMENTS],
            flare_rad_s: T::zero(),
            turbine_n_m: None,
            shaft_n_m: None,
            input_clutch: None,
            at_turbine: None,
            health: Health::SpeedsRejected,
            channels: Channels::all(ChannelHealth::Lost),
            commands: [ChannelHealth::Lost; MAX_ELEMENTS],
        }
    }
}

/// Limits the torques by the valve models of clutches that hold, as the readings show no slip, or one that is doubted: such a clutch carries what the
/// other one leaves of the load of both at the turbine, N m, which is given with its standard deviation; two of them share it as they could hold it. The
/// drag of other plates is left out.
fn limit_to_load<T: Real>(
    clutches: &mut [ClutchEstimate<T>; 2],
    shift: &ShiftRow<T>,
    holds: [bool; 2],
    [load_n_m, std_dev_n_m]: [T; 2],
) {
    let alpha = shift.clutches.each_ref().map(|clutch| clutch.alpha);
    let at_turbine_n_m: [T; 2] = core::array::from_fn(|c| alpha[c] * clutches[c].torque_n_m);
    let [off_n_m, on_n_m] = at_turbine_n_m.map(T::abs);
    let both_n_m = off_n_m + on_n_m;
    for c in 0..2 {
        let (other, can_n_m) = (1 - c, at_turbine_n_m[c].abs());
        let (carries_n_m, shared_n_m) = match holds {
            [true, true] if both_n_m > T::zero() => (load_n_m * can_n_m / both_n_m, T::of(SHARED) * load_n_m.abs()),
            _ => (load_n_m - at_turbine_n_m[other], T::zero()),
        };
        if holds[c] && carries_n_m.abs() < can_n_m {
            let clutch = &mut clutches[c];
            let is_against = shift.clutches[c].element.is_one_sided() && carries_n_m < T::zero();
            clutch.torque_n_m = if is_against { T::zero() } else { carries_n_m / alpha[c] };
            let std_dev_n_m = (square(std_dev_n_m) + square(shared_n_m)).sqrt() / alpha[c].abs();
            (clutch.std_dev_n_m, clutch.hidden) = (clutch.std_dev_n_m.at_most(std_dev_n_m), false);
        }
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    pub(super) fn conclude(
        &self,
        state: &mut GearboxState<T>,
        input: &ShiftInput<T>,
        (channels, commands): (&Channels<ChannelHealth>, &[ChannelHealth; MAX_ELEMENTS]),
        mut health: Health,
        turbine_n_m: Option<T>,
    ) {
        let refused = channels.each().contains(&ChannelHealth::Refused);
        let lost = channels.each().contains(&ChannelHealth::Lost);
        health = health.max(match (channels.command == ChannelHealth::Refused, lost, refused) {
            (true, _, _) => Health::CommandRejected,
            (_, true, _) => Health::ChannelLost,
            (_, _, true) => Health::ReadingRefused,
            _ => Health::Good,
        });
        if state.evidence.is_found() {
            health = health.max(Health::BeyondBounds);
        }
        let (_, since_s) = state.gears;
        let mut valve_pa =
            state.elements.each_ref().map(|element| element.as_ref().map_or(T::zero(), |element| element.valve_pa));
        if state.strokes {
            valve_pa = state.elements.each_ref().map(|of| of.as_ref().map_or(T::zero(), ElementState::pressure_pa));
        }
        let estimate = &mut state.estimate;
        *estimate = ShiftEstimate { valve_pa, channels: *channels, commands: *commands, ..ShiftEstimate::nothing() };
        match &state.running {
            Some(running) => {
                let (x, line) = (&running.x.mean, &self.driveline);
                let damper = line.shaft_damping_n_m_s_rad * line.twist_rate(x[OUTPUT], x[WHEEL]);
                // In its first step it has no torques yet.
                let turbine_n_m = running.torques.map_or(turbine_n_m.unwrap_or(running.slow_n_m), |torques| {
                    torques.turbine_n_m
                        + x[FRACTION] * torques.fraction_n_m
                        + x[SLOW_FRACTION] * torques.slow_fraction_n_m
                });
                estimate.gear = Some(match &running.shift {
                    Some(shift) => shift.command(),
                    None => ShiftCommand { from: running.gear, to: running.gear },
                });
                estimate.phase = Some(running.phase.phase);
                estimate.shaft_n_m = Some(x[SPRING] + damper);
                estimate.turbine_n_m = Some(turbine_n_m);
                estimate.flare_rad_s = match &running.shift {
                    Some(shift) if self.are_read(&state.newest) => {
                        self.flare(shift, self.measured(&state.newest, None))
                    }
                    _ => T::zero(),
                };
                estimate.clutches = running.shift.map(|shift| {
                    [0, 1].map(|c| {
                        let estimate = self.of_clutch(running, &state.elements, &shift, c);
                        // A slip of a clutch that holds may be a wrong reading until it is believed.
                        let is_doubted = estimate.holds && running.phase.is_in_doubt();
                        let is_tied = !state.held_may_slip && shift.is_tied(c, since_s) && !is_doubted;
                        self.in_range(estimate, &state.elements, (&shift.clutches[c.min(1)], is_tied), &state.newest)
                    })
                });
            }
            None => {
                let shift = self.tables.commanded(input.gear);
                let at_turbine = !input.gear.is_steady() && self.is_at_turbine(input.gear);
                let is_modelled = input.gear.is_steady() || at_turbine || shift.is_some();
                let without = match is_modelled || !self.are_read(&state.newest) {
                    true => Health::SpeedsRejected,
                    false => Health::ShiftNotModelled,
                };
                let phase = self.phase_at_turbine(state, input.gear).filter(|_| at_turbine && turbine_n_m.is_some());
                let estimate = &mut state.estimate;
                if phase.is_some() {
                    (estimate.phase, estimate.turbine_n_m) = (phase, turbine_n_m);
                } else if health < Health::TooSlow {
                    health = without;
                }
                state.estimate.clutches = shift.map(|shift| self.by_valves(state, shift, turbine_n_m));
            }
        }
        state.estimate.health = health;
    }

    /// Lowest and highest pressure of an element by its command alone, Pa, for errors within the budget, by its place in
    /// [`super::GearboxTables::elements`]; in a gear as in a shift. `None` if there is no such element, or no budget of it.
    pub fn pressure_range_pa(&self, state: &GearboxState<T>, at: usize) -> Option<[T; 2]> {
        match state.late.waits() {
            true => state.late.pressure_range_pa.get(at).copied().flatten(),
            false => self.range_of_element(state, at),
        }
    }

    /// The same at the time of the state.
    pub(super) fn range_of_element(&self, state: &GearboxState<T>, at: usize) -> Option<[T; 2]> {
        self.element(&state.elements, ShiftElement::at(at))
            .and_then(|(memory, element)| memory.pressure_range_pa(element))
    }

    /// Torque of both clutches of a shift together at the turbine, N m, and its standard deviation, by the rates of both speeds, near a standstill.
    fn load_of_both(&self, state: &GearboxState<T>, shift: &ShiftRow<T>, turbine_n_m: T) -> [T; 2] {
        let [by_turbine, by_output] = shift.mass_kg_m2[0];
        let is_fresh = |k: usize| state.newest[k].is_some_and(|newest| newest.age_s <= T::of(FIRST_S));
        let rate = |k: usize| self.rate(state, k).filter(|_| is_fresh(k));
        let [(turbine, of_turbine), (output, of_output)] =
            [TURBINE, OUTPUT].map(|k| rate(k).unwrap_or((T::zero(), square(T::of(UNREAD_RAD_S2)))));
        let share = self.turbine.converter_share.max(self.turbine.engine_share);
        let variance = square(share * turbine_n_m.abs().at_least(T::of(MIN_N_M)))
            + square(by_turbine) * of_turbine
            + square(by_output) * of_output;
        [turbine_n_m - by_turbine * turbine - by_output * output, variance.sqrt()]
    }

    /// Slip of the offgoing clutch away from the new gear, where the readings show one.
    fn flare(&self, shift: &ShiftRow<T>, speeds: [T; 2]) -> T {
        let [off, on] = shift.clutches.map(|clutch| clutch.ratio);
        let slip = self.slip(off, speeds);
        // Towards the new gear the turbine goes from `i_off w_o` to `i_on w_o`.
        let away = slip.value * (off - on) * speeds[OUTPUT] > T::zero();
        if away && slip.is_over() { slip.value.abs() } else { T::zero() }
    }

    /// In which direction a clutch carries where the filter does not run: that of its slip, and where none is read or seen that of the load, as
    /// far as it is known. The sign of a slip below the noise of the speeds changes from step to step.
    fn direction_by_valve(is_read: bool, slip: &Slip<T>, turbine_n_m: Option<T>) -> T {
        match (turbine_n_m, is_read) {
            (Some(load), is_read) if !is_read || !slip.is_over() => load.signum(),
            (None, false) => T::one(),
            _ => slip.direction(),
        }
    }

    /// Both clutches of a shift while the filter does not run.
    #[inline(never)]
    fn by_valves(
        &self,
        state: &GearboxState<T>,
        shift: &ShiftRow<T>,
        turbine_n_m: Option<T>,
    ) -> [ClutchEstimate<T>; 2] {
        let (_, since_s) = state.gears;
        let (then, is_read) = (self.measured(&state.newest, None), self.are_read(&state.newest));
        let learnt = state.learnt.known_mean(&self.acting(shift));
        let is_tied = |c: usize| !state.held_may_slip && shift.is_tied(c, since_s);
        let load = turbine_n_m.filter(|_| self.is_slow(state) && !state.held_may_slip);
        let load = load.map(|turbine_n_m| self.load_of_both(state, shift, turbine_n_m));
        // Of readings without bound there is none.
        let load = load.filter(|[load_n_m, std_dev_n_m]| load_n_m.is_finite() && std_dev_n_m.is_finite());
        let slips = shift.clutches.each_ref().map(|clutch| self.slip(clutch.ratio, then));
        let driving_n_m = load.map(|[load_n_m, _]| load_n_m).or(turbine_n_m);
        // Of a shaft that stands, a toothed wheel gives no reading.
        let is_read = is_read || load.is_some();
        let mut clutches = [0, 1].map(|c: usize| {
            let (c, clutch) = (c.min(1), &shift.clutches[c.min(1)]);
            let lasting = [learnt[c], learnt[c + 2]];
            let direction = Self::direction_by_valve(is_read, &slips[c], driving_n_m);
            self.by_valve(&state.elements, clutch, [slips[c].value, direction], lasting)
        });
        // A clutch that seems to slip, and could carry far more than there is to carry, does not: nothing follows from that slip.
        let mut is_doubted = [false; 2];
        if let Some(load) = load {
            let may_hold = |c: usize| is_tied(c) && shift.clutches[c.min(1)].has_pressure();
            let at_turbine_n_m: [T; 2] =
                core::array::from_fn(|c: usize| shift.clutches[c.min(1)].alpha * clutches[c.min(1)].torque_n_m);
            let [load_n_m, std_dev_n_m] = load;
            is_doubted = core::array::from_fn(|c| {
                let c = c.min(1);
                let bounded = self.bounded_slip(shift.clutches[c].ratio, &state.newest);
                let is_shown = bounded.is_some_and(|[slip, error]| slip.abs() > error);
                let times = T::of(if is_shown { STRONGER_THAN_SHOWN } else { STRONGER });
                let is_stronger =
                    at_turbine_n_m[c].abs() > times * ((load_n_m - at_turbine_n_m[1 - c]).abs() + std_dev_n_m);
                let is_strong = self.is_strong(&state.elements, &shift.clutches[c], &clutches[c]);
                may_hold(c) && slips[c].is_over() && is_strong && is_stronger
            });
            let holds = core::array::from_fn(|c| may_hold(c) && (!slips[c.min(1)].is_over() || is_doubted[c.min(1)]));
            limit_to_load(&mut clutches, shift, holds, load);
        }
        [0, 1].map(|c: usize| {
            let c = c.min(1);
            let is_tied = is_tied(c) && !is_doubted[c];
            self.in_range(clutches[c], &state.elements, (&shift.clutches[c], is_tied), &state.newest)
        })
    }

    /// Whether a clutch carries more than a part of its largest torque by its valve model: less is within what slow wheels show of the load.
    fn is_strong(
        &self,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        clutch: &ShiftClutch<T>,
        estimate: &ClutchEstimate<T>,
    ) -> bool {
        self.element(elements, clutch.element)
            .is_some_and(|(_, element)| estimate.torque_n_m.abs() > T::of(STRONG) * element.most_n_m())
    }

    /// A clutch by its valve model and what is learnt of it, where the speeds cannot be used; `slip` is the slip at the turbine and the
    /// direction of the torque.
    fn by_valve(
        &self,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        clutch: &ShiftClutch<T>,
        slip: [T; 2],
        [f, k]: [T; 2],
    ) -> ClutchEstimate<T> {
        let zero = T::zero();
        let nothing = (ClutchTorque::none(), zero, zero, zero, [zero; 3]);
        let (torque, valve_pa, pressure_pa, both, [drag, std_dev, variance]) =
            self.element(elements, clutch.element).map_or(nothing, |found| {
                let (memory, element) = found;
                let torque = memory.torque(element, clutch, slip, &PressureError::unseen(k));
                let valve_pa = memory.pressure_pa();
                let pressure_pa = element.limits.possible_pressure(valve_pa * (T::one() + element.gain_error(f, k)));
                let u = &element.uncertainty;
                let variance = square(valve_pa * u.valve_gain) + square(memory.error_std_dev_pa(element));
                let drag = element.drag_n_m(clutch.alpha * slip[0]);
                (torque, valve_pa, pressure_pa, element.correlation_in_shift(), [drag, u.drag_n_m, variance])
            });
        let corrected = torque.base_n_m + f * torque.per_friction_n_m + k * torque.per_kiss_n_m;
        ClutchEstimate {
            element: clutch.element,
            pressure_pa,
            torque_n_m: corrected / clutch.alpha + drag,
            std_dev_n_m: (torque.unlearnt_variance(both) / square(clutch.alpha) + square(std_dev)).sqrt(),
            pressure_std_dev_pa: variance.sqrt(),
            valve_pa,
            open_loop_n_m: torque.open_loop_n_m / clutch.alpha,
            holds: false,
            hidden: true,
            pressure_range_pa: None,
            torque_range_n_m: None,
        }
    }

    /// A clutch of a shift while there is none, by its valve model and what is learnt of it.
    pub(super) fn unshifted(&self, state: &GearboxState<T>, shift: &ShiftRow<T>, c: usize) -> ClutchEstimate<T> {
        let (c, clutch) = (c.min(1), &shift.clutches[c.min(1)]);
        let learnt = state.learnt.known_mean(&self.acting(shift));
        let slip = self.slip(clutch.ratio, self.measured(&state.newest, None));
        self.by_valve(&state.elements, clutch, [slip.value, slip.direction()], [learnt[c], learnt[c + 2]])
    }

    fn of_clutch(
        &self,
        running: &super::Running<T>,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        shift: &ShiftRow<T>,
        c: usize,
    ) -> ClutchEstimate<T> {
        let (x, zero) = (&running.x, T::zero());
        let (c, clutch) = (c.min(1), &shift.clutches[c.min(1)]);
        let Some(torques) = running.torques else {
            let lasting = [x.mean[FRICTION[c]], x.mean[KISS[c]]];
            let slip = self.slip(clutch.ratio, [x.mean[0], x.mean[1]]);
            return self.by_valve(elements, clutch, [slip.value, slip.direction()], lasting);
        };
        let own = torques.clutches[c];
        let holds = running.phase.phase.holding() == Some(c);
        let (row, rest) = self.torque_row(running, shift, c, &torques);
        let mut torque = x.value(&row) + rest;
        if !holds && torque * own.per_pressure_n_m <= zero {
            // A slipping clutch does not push.
            torque = zero;
        }
        let std_dev = x.variance(&row).sqrt();
        let nothing = (zero, zero, zero, [zero; 3]);
        let (valve_pa, pressure_pa, both, [drag, drag_std_dev, variance]) =
            self.element(elements, clutch.element).map_or(nothing, |(memory, element)| {
                let slip = clutch.alpha * (x.mean[TURBINE] - clutch.ratio * x.mean[OUTPUT]);
                if memory.is_unheard() {
                    // By the torque: without a command nothing else is known of it.
                    let (plates, at_element) = (&element.clutch, T::one() / clutch.alpha.abs());
                    let pressure_pa = plates.pressure_for(at_element * torque, slip);
                    let per_pa = plates.torque_per_force(slip) * plates.piston_area_m2;
                    let variance = square(at_element * std_dev / per_pa);
                    let possible_pa = element.limits.possible_pressure(pressure_pa);
                    return (memory.pressure_pa(), possible_pa, zero, [zero, zero, variance]);
                }
                let modelled_pa = memory.pressure_pa();
                let gain = modelled_pa * element.gain_error(x.mean[FRICTION[c]], x.mean[KISS[c]]);
                // The error of the pressure itself.
                let itself = memory.error_pa(element, x.mean[PRESSURE[c]]);
                let pressure_pa = modelled_pa + gain + if holds { zero } else { itself };
                let possible_pa = element.limits.possible_pressure(pressure_pa);
                let left = square(modelled_pa) * element.gain_left();
                let [by_f, by_k] = element.gain_by(element.uncertainty.slow_part.sqrt());
                let of_itself = memory.error_std_dev_pa(element);
                let mut pressure = [zero; N];
                (pressure[FRICTION[c]], pressure[KISS[c]]) = (modelled_pa * by_f, modelled_pa * by_k);
                // Of one that holds the speeds show nothing of it.
                let unseen = if holds { square(of_itself) } else { zero };
                pressure[PRESSURE[c]] = if holds { zero } else { of_itself };
                let drag =
                    [element.drag_n_m(slip), element.uncertainty.drag_n_m].map(|drag| if holds { zero } else { drag });
                let variance = x.variance(&pressure) + left + unseen;
                (modelled_pa, possible_pa, element.correlation_in_shift(), [drag[0], drag[1], variance])
            });
        let open_loop_n_m = if holds { own.open_loop_n_m.abs() * torque.signum() } else { own.open_loop_n_m };
        let alone = own.unlearnt_variance(both).sqrt();
        ClutchEstimate {
            element: clutch.element,
            pressure_pa,
            torque_n_m: torque / clutch.alpha + drag,
            std_dev_n_m: (square(std_dev / clutch.alpha) + square(drag_std_dev)).sqrt(),
            pressure_std_dev_pa: variance.at_least(zero).sqrt(),
            valve_pa,
            open_loop_n_m: open_loop_n_m / clutch.alpha,
            holds,
            hidden: !holds && clutch.has_pressure() && std_dev >= T::of(HIDDEN) * alone,
            pressure_range_pa: None,
            torque_range_n_m: None,
        }
    }

    /// The torque at the turbine as a row over the states, and what is left beside them: of a clutch that slips that of its
    /// pressure, of one that holds its load; of one that has just gripped the mean of both, weighted by the probability that it slips
    /// yet.
    fn torque_row(
        &self,
        running: &super::Running<T>,
        shift: &ShiftRow<T>,
        c: usize,
        torques: &Torques<T>,
    ) -> ([T; N], T) {
        let own = &torques.clutches[c.min(1)];
        let holds = running.phase.phase.holding() == Some(c);
        let slips = if holds { running.phase.slips_yet.abs() } else { T::one() };
        let (mut row, mut rest) = if holds { self.held_torque(shift, c, torques) } else { ([T::zero(); N], T::zero()) };
        if slips > T::zero() {
            let held = T::one() - slips;
            row.iter_mut().for_each(|x| *x = held * *x);
            row[FRICTION[c.min(1)]] = row[FRICTION[c.min(1)]] + slips * own.per_friction_n_m;
            row[KISS[c.min(1)]] = row[KISS[c.min(1)]] + slips * own.per_kiss_n_m;
            row[PRESSURE[c.min(1)]] = row[PRESSURE[c.min(1)]] + slips * own.per_pressure_n_m;
            rest = held * rest + slips * own.base_n_m;
        }
        (row, rest)
    }

    /// Brings an estimate into the guaranteed ranges, where there are some. Before the dog of its gear is in, a clutch is not tied to the
    /// output, and the direction of its slip is not known.
    fn in_range(
        &self,
        mut estimate: ClutchEstimate<T>,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        (clutch, is_tied): (&ShiftClutch<T>, bool),
        newest: &[Option<Newest<T>>; SPEEDS],
    ) -> ClutchEstimate<T> {
        // Behind a one-way clutch that overruns an element has another slip.
        let is_tied = |slip: T, error: T| is_tied && (!clutch.element.is_one_sided() || slip > error);
        let slip = self.bounded_slip(clutch.ratio, newest).filter(|[slip, error]| is_tied(*slip, *error)).map(
            |[slip, error]| {
                let (middle, half) = (clutch.alpha * slip, clutch.alpha.abs() * error);
                [middle - half, middle + half]
            },
        );
        let element = self.element(elements, clutch.element);
        let ranges = element.and_then(|(memory, element)| memory.ranges(element, slip));
        if let Some((pressure, torque)) = ranges {
            let nearest = |[low, high]: [T; 2], value: T| value.max(low).min(high);
            estimate.pressure_pa = nearest(pressure, estimate.pressure_pa);
            estimate.torque_n_m = nearest(torque, estimate.torque_n_m);
            estimate.pressure_range_pa = Some(pressure);
            estimate.torque_range_n_m = Some(torque);
        }
        estimate
    }
}
