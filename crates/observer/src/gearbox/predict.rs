//! The prediction over a step, and the phase.

use super::{
    CORE, ClutchTorque, Contact, ElementState, FRACTION, FRACTION_S, FRICTION, FrictionElement, GAP_S, GearboxFilter,
    GearboxState, LOAD, MAX_ELEMENTS, MODEL_FRACTION, Motion, N, OUTPUT, PRESSURE, RATE, Response, Running, SCALE,
    SPRING, ShiftClutch, ShiftElement, ShiftRow, TURBINE, TWIST_S, Torques, WHEEL, free, output_rate, pieces, square,
    tied, turbine,
};
use crate::gearbox::elements::positive_part;
use crate::gearbox::phases::is_strong;
use drivetrain::Real;

impl<T: Real> GearboxFilter<'_, T> {
    /// Response of turbine and output in the phase of the moment.
    pub(super) fn response(&self, running: &Running<T>) -> Response<T> {
        match (&running.shift, running.phase.phase.holding()) {
            (Some(shift), None) => free(&shift.mass_kg_m2),
            (Some(shift), Some(held)) => {
                let ratio = shift.clutches[held.min(1)].ratio;
                tied(ratio, shift.inertia_at(ratio))
            }
            (None, _) => match self.tables.gear(running.gear) {
                Some(gear) => tied(gear.ratio, gear.inertia_kg_m2),
                None => [[T::zero(); 2]; 2],
            },
        }
    }

    /// The torques now.
    pub(super) fn torques(
        &self,
        running: &Running<T>,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        found: &turbine::Found<T>,
        speeds: [T; 2],
    ) -> Torques<T> {
        let u = &self.uncertainty;
        let (mut clutches, mut inertia_n_m) = ([ClutchTorque::none(); 2], T::zero());
        let drag_n_m = running.shift.as_ref().map_or([T::zero(); 2], |shift| self.tables.drag_n_m(shift, speeds));
        if let Some(shift) = &running.shift {
            inertia_n_m = u.inertia_share * shift.mass_kg_m2[0][0] * running.rates[TURBINE];
            for (c, (torque, clutch)) in clutches.iter_mut().zip(&shift.clutches).enumerate() {
                let slip = self.slip(clutch.ratio, speeds);
                let direction = running.phase.direction(c, &slip);
                if let Some((memory, element)) = self.element(elements, clutch.element) {
                    let wrong = running.x.pressure_error(c.min(1));
                    *torque = memory.torque(element, clutch, [slip.value, direction], &wrong);
                }
            }
        }
        let fraction_n_m = running.slow_n_m;
        let slow_fraction_n_m = found.fraction * fraction_n_m;
        Torques { turbine_n_m: found.turbine_n_m, fraction_n_m, slow_fraction_n_m, drag_n_m, inertia_n_m, clutches }
    }

    pub(super) fn element<'s>(
        &'s self,
        elements: &'s [Option<ElementState<T>>; MAX_ELEMENTS],
        of: ShiftElement,
    ) -> Option<(&'s ElementState<T>, &'s FrictionElement<T>)> {
        elements.get(of.place()?)?.as_ref().zip(self.tables.element(of))
    }

    /// Predicts over the step, and decides which clutches hold. The noise of the turbine torque may be one error that has lasted for
    /// a time, s.
    pub(super) fn advance(
        &self,
        running: &mut Running<T>,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        (torque, same_s): (&turbine::Found<T>, Option<T>),
        (speeds, read): ([T; 2], [bool; 2]),
        dt_s: T,
    ) {
        let fraction = dt_s / (dt_s + T::of(FRACTION_S));
        running.slow_n_m = running.slow_n_m + fraction * (torque.turbine_n_m - running.slow_n_m);
        for (c, clutch) in running.shift.iter().flat_map(|shift| &shift.clutches).enumerate() {
            let lasts = self.element(elements, clutch.element).and_then(|(memory, _)| memory.error_lasts());
            if let Some(lasts) = lasts {
                // An error of the fill ends with it.
                running.x.fade(PRESSURE[c.min(1)], lasts);
                running.x.add(PRESSURE[c.min(1)], PRESSURE[c.min(1)], T::one() - lasts * lasts);
            }
        }
        let now = self.torques(running, elements, torque, speeds);
        let mean = running.torques.map_or(now, |before| before.mean(&now)).without(running.phase.phase.holding());
        if dt_s > T::zero() {
            let (pieces, piece_s) = pieces(dt_s);
            let noise = same_s.map_or(torque.noise, |same_s| torque.noise * T::of(2.0) * same_s / piece_s);
            for _ in 0..pieces {
                self.predict(running, &mean, noise, piece_s);
            }
        }
        running.pressures_before = PRESSURE.map(|state| running.x.of_state(state));
        for silent_s in &mut running.silent_s {
            *silent_s = *silent_s + dt_s;
        }
        self.find_phase(running, elements, &now, (speeds, read));
        // The phase may have changed the direction of a torque.
        running.torques = Some(self.torques(running, elements, torque, speeds));
    }

    pub(super) fn predict(&self, running: &mut Running<T>, torques: &Torques<T>, torque_noise: T, dt_s: T) {
        let (u, response) = (&self.uncertainty, self.response(running));
        running.motion.take_if(|motion| motion.of != (response, dt_s));
        let new = || Motion::new(response, &self.driveline, self.wheels_kg_m2, dt_s, u.fading_s());
        let motion = running.motion.get_or_insert_with(new);
        let (rows, rest) = motion.rows(torques);
        let (by_torque, [fraction, pressure]) = (motion.per_turbine_torque(), motion.stay);
        let x = &mut running.x;
        let twist_rate = self.driveline.twist_rate(x.mean[OUTPUT], x.mean[WHEEL]) + x.mean[RATE];
        let by_timing = torques.by_timing();
        x.timing.add_pressure(&by_timing);
        x.pass(&rows, &rest);
        x.timing.add_pressure(&by_timing.map(|by| by.map(|by| -by)));
        x.fade(FRACTION, fraction);
        // An error of the stiffness that does not last: in one direction of the torque it is another than in the other.
        let by_stiffness = u.stiffness_fraction * self.driveline.shaft_stiffness_n_m_rad * twist_rate;
        x.add(SPRING, SPRING, T::of(2.0 * TWIST_S) * dt_s * square(by_stiffness));
        if let Some(shift) = running.shift {
            for (c, clutch) in shift.clutches.iter().enumerate() {
                let c = c.min(1);
                let walked = self
                    .tables
                    .element(clutch.element)
                    .map_or(T::zero(), |element| u.friction_walk(element.uncertainty.slow_part, dt_s));
                x.fade(PRESSURE[c], pressure);
                x.add(FRICTION[c], FRICTION[c], walked);
                x.add(PRESSURE[c], PRESSURE[c], T::one() - pressure * pressure);
                if let Some(before) = &mut running.before {
                    before.covariance[c][c] = before.covariance[c][c] + walked;
                }
            }
        }
        for (state, walk) in [(LOAD, u.load_walk), (RATE, u.rate_walk), (SCALE, u.wheel_scale_walk)] {
            x.add(state, state, walk * walk * dt_s);
        }
        x.add(FRACTION, FRACTION, u.turbine_share * u.turbine_share * (T::one() - fraction * fraction));
        for i in 0..CORE {
            for j in i..CORE {
                x.add(i, j, torque_noise * by_torque[i] * by_torque[j]);
            }
        }
        // What the model leaves out moves both speeds alike while a clutch ties them.
        let model =
            |k: usize| T::of(MODEL_FRACTION * MODEL_FRACTION * 100.0) * dt_s * square(self.readings[k].std_dev_rad_s);
        x.add(WHEEL, WHEEL, model(WHEEL));
        x.add(OUTPUT, OUTPUT, model(OUTPUT));
        match self.tied_ratio(running) {
            Some(ratio) => {
                running.x.add(TURBINE, TURBINE, ratio * ratio * model(OUTPUT));
                running.x.add(TURBINE, OUTPUT, ratio * model(OUTPUT));
            }
            None => running.x.add(TURBINE, TURBINE, model(TURBINE)),
        }
    }

    /// The ratio that ties turbine and output now.
    pub(super) fn tied_ratio(&self, running: &Running<T>) -> Option<T> {
        match (&running.shift, running.phase.phase.holding()) {
            (Some(shift), held) => held.map(|held| shift.clutches[held.min(1)].ratio),
            (None, _) => self.tables.gear(running.gear).map(|gear| gear.ratio),
        }
    }

    /// Takes what the readings of the step before have shown of the fills of a shift: whether a piston has a stroke to make. The estimate of
    /// what presses the plates stays, and is another error of another mean.
    pub(super) fn take_fills(&self, state: &mut GearboxState<T>) {
        let (Some(running), true) = (&mut state.running, state.strokes) else { return };
        let Some(shift) = running.shift else { return };
        for (c, pressure) in PRESSURE.into_iter().enumerate() {
            let c = c.min(1);
            let at = shift.clutches[c].element.place();
            let Some(Some(memory)) = at.and_then(|at| state.elements.get_mut(at)) else { continue };
            let after = running.x.of_state(pressure);
            let Some([factor, added]) = memory.take_fill(running.pressures_before[c], after) else { continue };
            for x in core::iter::once(&mut running.x).chain(state.slipping.as_mut().map(|running| &mut running.x)) {
                x.fade(pressure, factor);
                let [mean, variance] = x.of_state(pressure);
                x.mean[pressure.min(N - 1)] = mean + added;
                if variance > T::one() {
                    x.replace(pressure, mean + added, T::one());
                }
            }
        }
    }

    /// Decides which clutches hold, and what follows for the speeds.
    pub(super) fn find_phase(
        &self,
        running: &mut Running<T>,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        torques: &Torques<T>,
        (speeds, read): ([T; 2], [bool; 2]),
    ) {
        let Some(shift) = running.shift else { return };
        let holding = running.phase.phase.holding();
        let contact = |c: usize| {
            let clutch = &shift.clutches[c.min(1)];
            let mut slip = self.slip(clutch.ratio, speeds);
            if holding.is_none() && running.has_turned(c, clutch) {
                slip.value = T::zero();
            }
            // Its slip alone decides.
            let by_slip = Contact { slip, needed_n_m: T::zero(), holds_n_m: T::zero(), is_strong: false };
            if holding.is_some_and(|held| held != c) || (slip.is_over() && holding.is_none()) {
                return by_slip;
            }
            let (row, rest) = self.held_torque(&shift, c, torques);
            let needed_n_m = running.x.value(&row) + rest;
            let by_load = |holds_n_m: T| {
                if slip.is_over() { by_slip } else { Contact { needed_n_m, holds_n_m, ..by_slip } }
            };
            if clutch.element.is_dog() {
                return by_load(T::infinity());
            }
            if clutch.is_one_way() {
                return by_load(if needed_n_m * clutch.alpha > T::zero() { T::infinity() } else { T::zero() });
            }
            if clutch.element.is_one_sided() && needed_n_m < T::zero() {
                return by_load(T::zero());
            }
            let Some((memory, element)) = self.element(elements, clutch.element) else { return by_load(T::zero()) };
            let (factor, wrong) = (running.x.mean[FRICTION[c.min(1)]], running.x.pressure_error(c));
            let holds_n_m = memory.holds(element, clutch, factor, &wrong);
            let most_n_m = clutch.alpha.abs() * element.most_n_m();
            Contact { is_strong: is_strong(holds_n_m, needed_n_m, most_n_m), ..by_load(holds_n_m) }
        };
        let contacts = [contact(0), contact(1)];
        let before = running.phase.phase;
        running.phase.step(&contacts, read);
        let after = running.phase.phase;
        if before == after {
            return;
        }
        if let Some(held) = before.holding() {
            Self::untie(running, shift.clutches[held.min(1)].ratio, contacts[held.min(1)].slip.value);
        }
        if let Some(held) = after.holding() {
            let held = held.min(1);
            running.phase.slips_yet = if !shift.clutches[held].has_pressure() {
                T::zero()
            } else {
                Self::slips_yet(running, &shift, held, torques)
            };
            Self::tie(running, &shift, shift.clutches[held].ratio);
        }
    }

    /// The probability that a clutch whose readings show no slip any more slips yet, by the speeds that the model carried on to now,
    /// with the sign of its torque. The readings are older.
    fn slips_yet(running: &Running<T>, shift: &ShiftRow<T>, held: usize, torques: &Torques<T>) -> T {
        let mut slip = [T::zero(); N];
        (slip[TURBINE], slip[OUTPUT]) = (T::one(), -shift.clutches[held.min(1)].ratio);
        let direction = torques.clutches[held.min(1)].per_friction_n_m.signum();
        let (_, probability) = positive_part(direction * running.x.value(&slip), running.x.variance(&slip));
        direction * probability
    }

    /// The speeds of a clutch that held and whose slip, rad/s, has begun unseen.
    pub(super) fn untie(running: &mut Running<T>, ratio: T, slip: T) {
        running.x.add(TURBINE, TURBINE, slip * slip);
        running.x.add(OUTPUT, OUTPUT, square(slip / ratio));
    }

    /// A clutch that grips ties both speeds with its ratio `i`. Its impulse acts between them, so that what is kept is the
    /// momentum of both along `(w_t, w_o) = (i, 1)`, whenever since the last sample it has gripped. Nothing else follows.
    pub(super) fn tie(running: &mut Running<T>, shift: &ShiftRow<T>, ratio: T) {
        let (m, per) = (&shift.mass_kg_m2, shift.inertia_at(ratio).recip());
        let fraction = [TURBINE, OUTPUT].map(|k| per * (ratio * m[0][k] + m[1][k]));
        running.x.tie(ratio, fraction);
    }

    /// The torque at the turbine with which a clutch holds, as a row over the states and what is left beside them:
    /// `U = X - M11 w_t' - M12 w_o'`.
    pub(super) fn held_torque(&self, shift: &ShiftRow<T>, held: usize, torques: &Torques<T>) -> ([T; N], T) {
        let ratio = shift.clutches[held.min(1)].ratio;
        let torques = torques.without(Some(held));
        let g = tied(ratio, shift.inertia_at(ratio));
        let (rates, rate) = output_rate(&g, &torques, &self.driveline, self.wheels_kg_m2);
        let (mut row, rest) = torques.row([T::one(), T::zero()]);
        // The turbine's rate is the ratio times that of the output.
        let mass = ratio * shift.mass_kg_m2[0][TURBINE] + shift.mass_kg_m2[0][OUTPUT];
        for (x, rate) in row.iter_mut().zip(&rates) {
            *x = *x - mass * *rate;
        }
        (row, rest - mass * rate)
    }
}

impl<T: Real> Running<T> {
    /// Whether the slip of a clutch by the model has another sign than that which its torque had, while a speed has not been read for long:
    /// it was zero then, where a clutch that carries its load grips.
    fn has_turned(&self, c: usize, clutch: &ShiftClutch<T>) -> bool {
        if self.silent_s[TURBINE].at_least(self.silent_s[OUTPUT]) <= T::of(GAP_S) {
            return false;
        }
        let slip = self.x.mean[TURBINE] - clutch.ratio * self.x.mean[OUTPUT];
        let direction = self.torques.map_or(T::zero(), |torques| torques.clutches[c.min(1)].per_friction_n_m);
        clutch.has_pressure() && slip * direction < T::zero()
    }
}
