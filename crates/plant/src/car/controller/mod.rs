//! The shift controller of any gearbox: commands of all elements and the fraction of engine torque, from measured speeds.
//!
//! A shift is run by the reduced shift of the gearbox: torques `U` at the turbine, `alpha` and ratio of both clutches, and the
//! 2 x 2 mass. With the offgoing slip `y = w_t - i_off w_0` and the oncoming slip `z = w_t - i_on w_0` at the turbine, one
//! speed controller serves the inertia phase of every kind of shift:
//!
//! ```text
//! U = T_t - M11 (dz_ref/dt + i_on dw_0/dt) - M12 dw_0/dt + k_p M11 (z - z_ref) + k_i M11 integral(z - z_ref)
//! ```
//!
//! The sum `U` goes to the clutch whose slip has the right sign: the oncoming one if `U (i_off - i_on) > 0`, else the
//! offgoing one. So the roles change by themselves when the turbine torque changes its sign during a shift. The controller knows
//! the nominal car; it does not know pressures, torques, or the errors of the valves.
//!
//! One of the two may be a one-way clutch. It has no command: it lets go when its torque is gone, and catches at synchronous speed. Or
//! it is a dog: it is put in at synchronous speed and taken out without load, while the engine drives.

mod calibration;
mod engine;
mod launch;
mod lock_up;
mod measured;
mod pressure;
mod shift;
mod strokes;
mod target;
mod track;

use std::collections::VecDeque;

use car::{Car, ShiftClutch};
use drivetrain::ReducedShift;
use geartrain::{Change, Shift};

use super::integrate::CarError;
use crate::gear_train::MAX_ELEMENTS;
pub use calibration::CarCalibration;
use engine::EngineControl;
use launch::Launch;
use lock_up::LockUpControl;
pub use measured::CarMeasured;
use pressure::Controlled;
pub use shift::ShiftStage;
use shift::{ActiveShift, ShiftVehicle};
use strokes::Strokes;
pub use target::{SlipCurve, SlipTarget, SlipTargets};
use track::Track;

/// Offgoing and oncoming clutch of a shift, with their places among the elements, and the reduced shift. One of them may be a
/// one-way clutch or a dog, which have no valve.
type Single<'c> = ([(usize, Option<ShiftClutch>); 2], &'c Shift, &'c ReducedShift<f64>);

/// Speed of the gearbox output below which a gear of the other direction may be engaged, rad/s \[chosen\].
const AT_REST_RAD_S: f64 = 10.0;

/// A clutch that opens into neutral counts as open after so long, s \[chosen\].
const OPENS_S: f64 = 0.2;

/// What the controller commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarCommands {
    /// Command of each friction element's valve: current in A, or duty cycle in %.
    pub elements: [f64; MAX_ELEMENTS],
    /// Which elements are dogs that are to be in.
    pub dogs: [bool; MAX_ELEMENTS],
    /// Fraction of the engine torque that the driver asks for.
    pub engine_share: f64,
    /// Throttle that the engine has at least, 0 to 1: a shift may need more torque than the driver asks for.
    pub engine_throttle: f64,
    /// Torque that the lock-up clutch is to hold, N m.
    pub lock_up_n_m: f64,
}

/// A shift that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShiftProgress {
    /// The gear before.
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// Place of the clutch that opens among the elements.
    pub offgoing: usize,
    /// Place of the clutch that closes.
    pub oncoming: usize,
    /// What the controller is about.
    pub stage: ShiftStage,
    /// Whether it begins in neutral; `from` is then a gear of the other direction, whose clutch is open.
    pub is_from_neutral: bool,
}

/// The gear that the controller has engaged, and what it changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct GearShown {
    /// The gear, before and during a shift the one that is left.
    pub(super) gear: usize,
    /// Whether no gear is engaged; `gear` is then one of those that follow by one clutch.
    pub(super) is_neutral: bool,
    /// The gear that is left for neutral, until its clutch is open.
    pub(super) left: Option<usize>,
    /// The shift that is under way.
    pub(super) shift: Option<ShiftProgress>,
}

/// The shift controller.
#[derive(Debug, Clone)]
pub struct CarShiftController {
    car: Car,
    calibration: CarCalibration,
    gear: usize,
    active: Option<ActiveShift>,
    /// Gears that follow the shift that is under way.
    route: VecDeque<usize>,
    is_neutral: bool,
    /// The gear that was left for neutral, and when that was asked for, s.
    left: Option<(usize, f64)>,
    completed: usize,
    preselected: Option<usize>,
    output: Track,
    engine: EngineControl,
    lock_up: LockUpControl,
    strokes: Strokes,
    /// The clutch of a car without a converter, while it is not closed.
    launch: Option<Launch>,
}

impl CarShiftController {
    /// A controller for this car, in a gear.
    ///
    /// # Errors
    /// There is no such gear.
    pub fn new(car: &Car, calibration: CarCalibration, gear: usize) -> Result<Self, CarError> {
        if gear >= car.gearbox.gears.len() {
            return Err(CarError::Request(format!("the gearbox has no gear number {gear}\nhint: gears count from 0")));
        }
        let output = Track::new(calibration.output_filter_s);
        Ok(Self {
            car: car.clone(),
            calibration,
            gear,
            active: None,
            route: VecDeque::new(),
            is_neutral: false,
            left: None,
            completed: 0,
            preselected: None,
            output,
            engine: EngineControl::new(),
            lock_up: LockUpControl::default(),
            strokes: Strokes::new(car, gear),
            launch: None,
        })
    }

    /// The gear, before and during a shift the one that is left.
    pub fn gear(&self) -> usize {
        self.gear
    }

    /// The shift that is under way.
    pub fn shift(&self) -> Option<ShiftProgress> {
        self.active.as_ref().map(|shift| ShiftProgress {
            from: self.gear,
            to: shift.to,
            offgoing: shift.offgoing.element,
            oncoming: shift.oncoming.element,
            stage: shift.stage,
            is_from_neutral: shift.is_from_neutral(),
        })
    }

    /// What it shows at this time of its gears.
    pub(super) fn shown(&self, time_s: f64) -> GearShown {
        let left = self.left.filter(|(_, since_s)| self.is_neutral && time_s < since_s + OPENS_S);
        let left = left.map(|(gear, _)| gear);
        GearShown { gear: self.gear, is_neutral: self.is_neutral, left, shift: self.shift() }
    }

    /// Puts in the dogs of this gear beside those of the gear that is engaged.
    pub fn preselect(&mut self, gear: Option<usize>) {
        self.preselected = gear.filter(|&gear| gear < self.car.gearbox.gears.len());
    }

    /// Shifts that were completed.
    pub fn completed(&self) -> usize {
        self.completed
    }

    /// Whether no gear is engaged.
    pub fn is_neutral(&self) -> bool {
        self.is_neutral
    }

    /// Asks for a gear: through gears between where the shift is not one between two clutches, back where the gear is the one
    /// that is being left, from neutral, and from one direction to the other at rest.
    ///
    /// # Errors
    /// The gear cannot be reached.
    pub fn request(&mut self, to: usize, time_s: f64) -> Result<(), CarError> {
        let Some(ratio) = self.car.gearbox.gears.get(to).map(|gear| gear.ratio) else {
            return Err(CarError::Request(format!("the gearbox has no gear number {to}\nhint: gears count from 0")));
        };
        let Some(active) = &self.active else {
            let turns = ratio * self.car.gearbox.gears[self.gear].ratio < 0.0;
            if turns && self.output.speed_rad_s().abs() > AT_REST_RAD_S {
                let message = format!(
                    "gear {} can be engaged only at rest\nhint: brake to a standstill before the direction changes",
                    self.name(to)
                );
                return Err(CarError::Request(message));
            }
            if self.is_neutral || turns {
                return self.engage(to, time_s);
            }
            self.route = self.way(self.gear, to)?;
            if self.launch.is_some() && to != self.gear {
                // The clutches are open: the dogs alone change.
                self.route.clear();
                self.completed += 1;
                (self.gear, self.launch) = (to, Launch::of(&self.car, to));
            }
            return Ok(());
        };
        if to == self.gear
            && let Some(mut back) = active.withdrawn(&self.calibration, to, time_s)
        {
            let piston = self.strokes.of(back.oncoming.element);
            back.oncoming = back.oncoming.filled_from(piston, &self.calibration);
            self.gear = active.to;
            self.active = Some(back);
            self.route.clear();
            return Ok(());
        }
        self.route = self.way(active.to, to)?;
        Ok(())
    }

    /// Opens the clutch that distinguishes forward from reverse, from this time on.
    ///
    /// # Errors
    /// A shift is under way, or the gear is neither the lowest nor reverse.
    pub fn request_neutral(&mut self, time_s: f64) -> Result<(), CarError> {
        if self.is_neutral {
            return Ok(());
        }
        let Some(partner) = self.partner(self.gear).filter(|_| self.active.is_none()) else {
            let gear = self.name(self.gear);
            let message = format!(
                "no neutral from gear {gear}\nhint: it is reached from the lowest gear or reverse, which differ by one clutch, between shifts"
            );
            return Err(CarError::Request(message));
        };
        (self.gear, self.is_neutral, self.left) = (partner, true, Some((self.gear, time_s)));
        Ok(())
    }

    fn name(&self, gear: usize) -> &str {
        self.car.gearbox.gears.get(gear).map_or("?", |gear| gear.name.as_str())
    }

    /// The gear of the other direction that differs from this one by one clutch: neutral is what they have in common. Where a dog
    /// distinguishes the directions, neutral is what the two lowest gears have in common.
    fn partner(&self, gear: usize) -> Option<usize> {
        let gears = &self.car.gearbox.gears;
        let by_one_clutch = |a: usize, b: usize| self.single(a, b).is_some();
        let turns = |other: &usize| gears[*other].ratio * gears[gear].ratio < 0.0;
        let candidates = (0..gears.len()).filter(turns).filter(|&other| by_one_clutch(other, gear));
        let largest = candidates.max_by(|&a, &b| gears[a].ratio.abs().total_cmp(&gears[b].ratio.abs()));
        largest.or_else(|| {
            let is_dog =
                |gear: usize| gears[gear].holding.iter().any(|holding| self.car.gearbox.is_dog(holding.element));
            let [first, second] = *self.car.gearbox.forward_gears().first_chunk()?;
            let other = [(first, second), (second, first)].into_iter().find(|&(from, _)| from == gear)?.1;
            // Both have a valve: what distinguishes these gears opens and closes by a command.
            let both = self.single(other, gear)?.0;
            let have_valves = both.iter().all(|(_, clutch)| clutch.is_some());
            (self.car.converter.is_some() && is_dog(gear) && have_valves).then_some(other)
        })
    }

    /// Engages a gear from neutral.
    fn engage(&mut self, to: usize, time_s: f64) -> Result<(), CarError> {
        let shift = self.partner(to).and_then(|partner| Some((partner, self.leg(partner, to, time_s)?)));
        let Some((partner, shift)) = shift else {
            let follows = (0..self.car.gearbox.gears.len()).filter(|gear| self.partner(*gear).is_some());
            let message = format!(
                "gear {} does not follow from neutral by one clutch\nhint: these gears do: {}",
                self.name(to),
                follows.map(|gear| self.name(gear)).collect::<Vec<_>>().join(", ")
            );
            return Err(CarError::Request(message));
        };
        let neutral_s = if self.is_neutral { 0.0 } else { self.calibration.neutral_s };
        (self.gear, self.is_neutral, self.active) = (partner, false, Some(shift.out_of_neutral(neutral_s)));
        Ok(())
    }

    /// The clutches of a shift between two clutches, offgoing and oncoming, with the reduced shift. At least one of them has a valve.
    fn single(&self, from: usize, to: usize) -> Option<Single<'_>> {
        let shift = self.car.gearbox.shift(from, to)?;
        let (Change::Single { offgoing, oncoming, .. }, Some(reduced)) = (&shift.change, &shift.reduced) else {
            return None;
        };
        let clutch = |element: usize| {
            let clutch = self.car.clutches.get(element).copied().flatten();
            let is_form_fit = self.car.gearbox.is_one_way(element) || self.car.gearbox.is_dog(element);
            (clutch.is_some() || is_form_fit).then_some((element, clutch))
        };
        if !shift.changes_dog_under_power(&self.car.gearbox) {
            return None;
        }
        let clutches = [clutch(*offgoing)?, clutch(*oncoming)?];
        clutches.iter().any(|(_, clutch)| clutch.is_some()).then_some((clutches, shift, reduced))
    }

    /// The gears to go through, each one further on than the one before, by the fewest shifts between two clutches.
    fn way(&self, from: usize, to: usize) -> Result<VecDeque<usize>, CarError> {
        if self.car.gearbox.is_same_ratio(from, to) && from != to && self.single(from, to).is_some() {
            return Ok(VecDeque::from([to]));
        }
        let gears = &self.car.gearbox.gears;
        let ahead =
            |a: usize, b: usize| (gears[a].ratio - gears[b].ratio) * (gears[from].ratio - gears[to].ratio) > 0.0;
        let mut ways = VecDeque::from([vec![from]]);
        let mut seen = vec![false; gears.len()];
        while let Some(way) = ways.pop_front() {
            let last = way[way.len() - 1];
            if last == to {
                return Ok(way.into_iter().skip(1).collect());
            }
            for next in 0..gears.len() {
                let leads_on = ahead(last, next) && (next == to || ahead(next, to));
                if leads_on
                    && !seen[next]
                    && gears[next].ratio * gears[to].ratio > 0.0
                    && self.single(last, next).is_some()
                {
                    seen[next] = true;
                    ways.push_back(way.iter().copied().chain([next]).collect());
                }
            }
        }
        if let Some(why) = self.car.why_not_driven() {
            return Err(CarError::Request(why));
        }
        let (from_name, to_name) = (self.name(from), self.name(to));
        let hint = [from, to].into_iter().find_map(|gear| self.one_way_hint(gear)).unwrap_or_else(|| {
            "`wetclutch check` of the gearbox file lists its shifts, and the elements that open and close in each"
                .to_owned()
        });
        let message = format!("there is no way from gear {from_name} to gear {to_name} by shifts between two clutches");
        Err(CarError::Request(format!("{message}\nhint: {hint}")))
    }

    /// What to do about a gear that a one-way clutch holds.
    fn one_way_hint(&self, gear: usize) -> Option<String> {
        let gearbox = &self.car.gearbox;
        let one_way = gearbox.elements.get(gearbox.one_way_clutch_of(gear)?)?;
        Some(format!(
            "gear {} is held by the one-way clutch {}: a shift from or to it is driven where one clutch or brake, no dog and no other \
             one-way clutch, closes or opens; `wetclutch check` lists what changes",
            self.name(gear),
            one_way.name
        ))
    }

    /// A shift between two clutches.
    fn leg(&self, from: usize, to: usize, time_s: f64) -> Option<ActiveShift> {
        let ([(offgoing, off), (oncoming, on)], shift, reduced) = self.single(from, to)?;
        let line_pa = self.car.line_pressure_pa;
        let is_one_sided = |element: usize| shift.is_one_sided(&self.car.gearbox, element);
        let off = Controlled::new(offgoing, off, reduced.slip_offgoing, line_pa);
        let on = Controlled::new(oncoming, on, reduced.slip_oncoming, 0.0);
        let is_dog = |element: usize| self.car.gearbox.is_dog(element);
        let offgoing = off.one_sided(is_one_sided(offgoing)).dog(is_dog(offgoing));
        let on = on.one_sided(is_one_sided(oncoming)).dog(is_dog(oncoming));
        let oncoming = on.filled_from(self.strokes.of(oncoming), &self.calibration);
        let shift = ActiveShift::new(to, [offgoing, oncoming], reduced.mass_kg_m2, line_pa, time_s);
        let (car, road) = (&self.car, &self.car.road);
        let engine_kg_m2 = car.engine.inertia_kg_m2;
        let is_behind_converter = car.converter.is_some();
        let is_counted = !is_behind_converter && self.calibration.counts_engine;
        Some(shift.in_vehicle(ShiftVehicle {
            output_n_m_per_m_s2: road.mass_kg * road.wheel_radius_m / car.driveline.final_ratio,
            engine_kg_m2: if is_behind_converter { engine_kg_m2 } else { 0.0 },
            engine_at_turbine_kg_m2: if is_counted { engine_kg_m2 } else { 0.0 },
        }))
    }

    /// Commands for the period that begins at `time_s`.
    pub fn step(&mut self, time_s: f64, throttle: f64, measured: &CarMeasured) -> CarCommands {
        if self.active.is_none()
            && let Some(next) = self.route.pop_front()
        {
            self.active = self.leg(self.gear, next, time_s);
        }
        let period_s = self.calibration.control_period_s;
        self.output.follow(measured.wheel_rad_s * self.car.driveline.final_ratio, period_s);
        let request = self.active.as_ref().map(ActiveShift::engine);
        let engine = self.engine.step((&self.car, &self.calibration), throttle, request, measured);
        let turbine_n_m = self.engine.turbine_n_m(&self.car, measured);
        let (mut elements, dogs) = self.held();
        let line_pa = self.car.line_pressure_pa;
        for opened in self.open_at_low_speed(measured).into_iter().flatten() {
            elements[opened] = self.open_command(opened);
        }
        let c = &self.calibration;
        if let Some(launch) = &mut self.launch {
            let piston = self.strokes.of(launch.element());
            let (element, command) = launch.step((&self.car, c), time_s, throttle, measured, piston);
            elements[element] = command;
            if launch.is_over(c, time_s, measured) {
                self.launch = None;
            }
        }
        if let Some(shift) = &mut self.active {
            let pressures = shift.step(&self.calibration, time_s, turbine_n_m, measured, &self.output);
            for (clutch, pressure_pa) in [&shift.offgoing, &shift.oncoming].into_iter().zip(pressures) {
                elements[clutch.element] = clutch.valve_command(pressure_pa.clamp(0.0, line_pa));
            }
            shift.choose_engine(&self.calibration, turbine_n_m, measured);
            if shift.stage == ShiftStage::Done {
                self.gear = shift.to;
                self.active = None;
                self.completed += 1;
            }
        }
        let engine_n_m = self.engine.torque_n_m(&self.car, measured);
        let in_gear = self.active.is_none().then_some(self.gear).filter(|_| !self.is_neutral);
        let lock_up_n_m = self.lock_up.torque_n_m((&self.car, &self.calibration), in_gear, engine_n_m, measured);
        self.strokes.follow(&self.car, &elements, period_s);
        CarCommands { elements, dogs, engine_share: engine.fraction, engine_throttle: engine.throttle, lock_up_n_m }
    }

    /// Commands of the elements that the gear holds, and the dogs that are in; the clutches of a shift are open.
    fn held(&self) -> ([f64; MAX_ELEMENTS], [bool; MAX_ELEMENTS]) {
        let mut elements: [f64; MAX_ELEMENTS] = std::array::from_fn(|element| self.open_command(element));
        let mut dogs = [false; MAX_ELEMENTS];
        let line_pa = self.car.line_pressure_pa;
        let partner = self.partner(self.gear).filter(|_| self.is_neutral);
        let opened = partner.and_then(|partner| self.single(self.gear, partner)).map(|(clutches, ..)| clutches[0].0);
        // The clutches of a shift get their commands from it, and so does a dog that changes.
        for holding in &self.car.gearbox.gears[self.gear].holding {
            let element = holding.element;
            match &self.car.clutches[element] {
                Some(clutch) if opened != Some(element) => elements[element] = clutch.valve.command_for(line_pa),
                Some(_) => (),
                None => dogs[element] = self.car.gearbox.is_dog(element),
            }
        }
        let next = self.active.as_ref().map_or(self.preselected, |shift| Some(shift.to));
        let change = next.and_then(|next| self.car.gearbox.shift(self.gear, next)).map(|shift| &shift.change);
        if let Some(Change::Single { held, .. }) = change {
            for &element in held.iter().filter(|&&element| self.car.gearbox.is_dog(element)) {
                dogs[element] = true;
            }
        }
        if let Some(shift) = &self.active {
            for (clutch, is_in) in
                [(&shift.offgoing, shift.is_offgoing_in()), (&shift.oncoming, shift.is_oncoming_in())]
            {
                if clutch.is_dog() {
                    dogs[clutch.element] = is_in;
                }
            }
        }
        // What holds through the shift may not be of the gear before, where a one-way clutch does the same.
        let to = self.active.as_ref().map(|shift| shift.to).or(partner);
        let change = to.and_then(|to| self.car.gearbox.shift(self.gear, to)).map(|shift| &shift.change);
        if let Some(Change::Single { held, .. }) = change {
            for &element in held {
                if let Some(clutch) = &self.car.clutches[element] {
                    elements[element] = clutch.valve.command_for(line_pa);
                }
            }
        }
        (elements, dogs)
    }

    /// Command of an element that is open; zero without a valve.
    fn open_command(&self, element: usize) -> f64 {
        self.car.clutches.get(element).and_then(Option::as_ref).map_or(0.0, |clutch| clutch.valve.command_for(0.0))
    }

    /// Without a converter the clutch opens before the engine turns too slowly, in a shift too. The clutches of the shift that it ends.
    fn open_at_low_speed(&mut self, measured: &CarMeasured) -> Option<[usize; 2]> {
        if self.car.converter.is_some() || self.launch.is_some() {
            return None;
        }
        let gears = &self.car.gearbox.gears;
        let slow = |gear: usize| gears[gear].ratio * measured.output_rad_s < self.calibration.launch_open_rad_s;
        let to = self.active.as_ref().map_or(self.gear, |shift| shift.to);
        if !(slow(self.gear) && slow(to)) {
            return None;
        }
        self.launch = Launch::of(&self.car, to);
        self.gear = to;
        self.route.clear();
        self.active.take().map(|shift| [shift.offgoing.element, shift.oncoming.element])
    }
}
