//! The equations of the car.

use car::{Car, ShiftClutch};
use drivetrain::clutch::drag_torque;
use drivetrain::{ColumnPlace, Driveline, Real};
use geartrain::ElementKind;

use super::contacts::Contacts;
use crate::Contact;
use crate::gear_train::{Limits, MAX_ELEMENTS, MAX_FREEDOMS, TrainError, TrainModel, UNLIMITED_N_M};
use crate::rosenbrock::StiffRow;

/// Most friction elements of a gearbox.
pub const MAX_PACKS: usize = 6;
/// Twist, wheel and vehicle come first in the state.
const TWIST: usize = 0;
const WHEEL: usize = 1;
const VEHICLE: usize = 2;
const MOTION: usize = 3;
/// Number of states of a car with room for the largest gearbox, whose pistons have no stroke.
pub(super) const STATES: usize = states(MAX_FREEDOMS, MAX_PACKS);
/// Number of states of a car with room for the largest gearbox, whose pistons have one: the oil in the cylinders is added.
pub(super) const STATES_WITH_STROKE: usize = STATES + MAX_PACKS;
/// Degrees of freedom, engine included, and friction elements of a small gearbox, as one with a planetary set and two gears.
pub(super) const SMALL_FREEDOMS: usize = 3;
/// Friction elements of a small gearbox.
pub(super) const SMALL_PACKS: usize = 2;

/// Number of states with these degrees of freedom and friction elements whose pistons have no stroke.
pub(super) const fn states(freedoms: usize, packs: usize) -> usize {
    MOTION + freedoms + packs
}

/// Speed of the wheel, rad/s, over which the torque of the brake turns around: the brakes of a standing car creep instead of
/// sticking, as its tyres do.
const BRAKE_TURN_RAD_S: f64 = 0.1;

/// Torque by which the synchroniser of a dog brings its gear to the speed of the shaft, N m \[chosen\].
const SYNCHRONISER_N_M: f64 = 40.0;

/// Torque above which a dog between the members of planetary sets cannot be taken out, N m \[chosen\].
const LOADED_DOG_N_M: f64 = 5.0;

/// The speed limiter takes the torque of the engine away within this fraction above the last speed of its map \[chosen\].
const LIMITER: f64 = 0.05;

/// What an element of the car is.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Part {
    /// A friction element with its valve; holds its place among the pressures.
    Friction(usize, Box<ShiftClutch>),
    /// A one-way clutch.
    OneWay,
    /// A dog clutch with synchroniser, and the torque above which it cannot be taken out, N m.
    Dog(f64),
    /// The clutch between engine and gearbox input.
    LockUp,
}

/// The continuous state. Pressures are gauge; twist is gearbox side minus wheel side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarState {
    /// Twist of the drive shafts, rad at the wheel.
    pub twist_rad: f64,
    /// Driven wheel speed, rad/s.
    pub wheel_rad_s: f64,
    /// Vehicle speed, m/s.
    pub vehicle_m_s: f64,
    /// Speeds of train and engine in the coordinates of [`crate::TrainModel::new`], rad/s.
    pub motion: [f64; MAX_FREEDOMS],
    /// Pressure at the outlet of the valve of each friction element, Pa; that of the element, if its piston has no stroke.
    pub valves_pa: [f64; MAX_PACKS],
    /// Oil in the cylinder of each friction element beyond that of a piston on its stop, m^3; unused without a stroke.
    pub volumes_m3: [f64; MAX_PACKS],
}

impl CarState {
    /// Size of each state that an absolute error is measured against.
    const SCALE: Self = Self {
        twist_rad: 0.1,
        wheel_rad_s: 10.0,
        vehicle_m_s: 10.0,
        motion: [100.0; MAX_FREEDOMS],
        valves_pa: [1e5; MAX_PACKS],
        volumes_m3: [1e-6; MAX_PACKS],
    };

    /// The size of each state.
    pub(super) fn scale<const N: usize, const F: usize, const P: usize>() -> [f64; N] {
        Self::SCALE.to_array::<N, F, P>()
    }

    pub(super) fn is_finite(&self) -> bool {
        self.to_array::<STATES_WITH_STROKE, MAX_FREEDOMS, MAX_PACKS>().iter().all(|x| x.is_finite())
    }

    /// `N` states of a gearbox with `F` degrees of freedom and `P` friction elements; the oil only if there is room for it.
    #[inline(always)]
    pub(super) fn to_array<const N: usize, const F: usize, const P: usize>(self) -> [f64; N] {
        let mut x = [0.0; N];
        x[TWIST] = self.twist_rad;
        x[WHEEL] = self.wheel_rad_s;
        x[VEHICLE] = self.vehicle_m_s;
        x[MOTION..MOTION + F].copy_from_slice(&self.motion[..F]);
        x[MOTION + F..states(F, P)].copy_from_slice(&self.valves_pa[..P]);
        if N > states(F, P) {
            x[states(F, P)..].copy_from_slice(&self.volumes_m3[..P]);
        }
        x
    }

    /// The state from the numbers of [`Self::to_array`]; the others are zero.
    #[inline(always)]
    pub(super) fn from_array<const N: usize, const F: usize, const P: usize>(x: &[f64; N]) -> Self {
        Self {
            twist_rad: x[TWIST],
            wheel_rad_s: x[WHEEL],
            vehicle_m_s: x[VEHICLE],
            motion: std::array::from_fn(|i| if i < F { x[MOTION + i] } else { 0.0 }),
            valves_pa: std::array::from_fn(|i| if i < P { x[MOTION + F + i] } else { 0.0 }),
            volumes_m3: std::array::from_fn(|i| if i < P && N > states(F, P) { x[states(F, P) + i] } else { 0.0 }),
        }
    }
}

/// What acts on the car, constant over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarInputs {
    /// Throttle, 0 to 1.
    pub throttle: f64,
    /// Fraction of the driving engine torque that the transmission controller leaves, 0 to 1.
    pub engine_share: f64,
    /// Torque of the brakes on the driven wheels, N m.
    pub brake_n_m: f64,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
    /// Pressure at which each friction element's valve settles, Pa.
    pub settled_pa: [f64; MAX_PACKS],
    /// Which elements are dogs that are in.
    pub dogs: [bool; MAX_ELEMENTS],
    /// Torque that the lock-up clutch holds, N m; without a converter it holds any torque.
    pub lock_up_n_m: f64,
}

/// Inputs with what follows from them alone, found once for a segment of the integration.
#[derive(Debug, Clone, Copy)]
pub(super) struct Acting<'u> {
    pub(super) inputs: &'u CarInputs,
    /// Where the throttle lies in the engine's map.
    throttle: ColumnPlace<f64>,
    /// Deceleration by the grade, m/s^2.
    grade_m_s2: f64,
}

/// Torques and speeds at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarTorques {
    /// Engine speed, rad/s.
    pub engine_rad_s: f64,
    /// Turbine speed, rad/s; without a converter that of the gearbox input.
    pub turbine_rad_s: f64,
    /// Gearbox output speed, rad/s.
    pub output_rad_s: f64,
    /// Torque of combustion and pumping at the crank, N m.
    pub engine_n_m: f64,
    /// Torque that the pump takes from the engine, N m; zero without a converter.
    pub pump_n_m: f64,
    /// Torque of the converter on the gearbox input, N m; zero without a converter.
    pub converter_n_m: f64,
    /// Torque of the drive shafts, N m at the wheel.
    pub shaft_n_m: f64,
    /// Torque of the brakes, N m.
    pub brake_n_m: f64,
    /// Force of the tyres, N.
    pub tyre_n: f64,
    /// Torque of each element, N m; of the sticking ones only after [`CarModel::torques`]. The last is the lock-up clutch.
    pub elements_n_m: [f64; MAX_ELEMENTS],
}

impl CarTorques {
    /// Torque on the gearbox input, N m: converter and lock-up clutch.
    pub fn turbine_n_m(&self, model: &CarModel) -> f64 {
        self.converter_n_m + self.elements_n_m[model.lock_up()]
    }
}

/// A car whose equations are ready to be integrated.
#[derive(Debug, Clone)]
pub struct CarModel {
    /// The car.
    pub car: Car,
    pub(super) train: TrainModel,
    pub(super) parts: Vec<Part>,
    has_stroke: bool,
    is_small: bool,
    /// Last speed of the engine's map, rad/s.
    map_rad_s: f64,
}

impl CarModel {
    /// Prepares a car.
    ///
    /// # Errors
    /// The gearbox has no stick diagram, is too large, or its inertia cannot be inverted.
    pub fn new(car: Car) -> Result<Self, TrainError> {
        let train = car.gearbox.train.as_ref().ok_or(TrainError::NoDiagram)?;
        // The dogs of gear pairs come last, and change while their clutch is open.
        let of_pairs = train.pairs.iter().filter(|pair| pair.dog.is_some()).count();
        let first_of_pairs = car.gearbox.elements.len().saturating_sub(of_pairs);
        let train = TrainModel::new(train, car.engine.inertia_kg_m2)?;
        let mut packs = 0;
        let mut parts = Vec::new();
        for (at, (element, clutch)) in car.gearbox.elements.iter().zip(&car.clutches).enumerate() {
            parts.push(match (element.kind, clutch) {
                (ElementKind::OneWayClutch, _) => Part::OneWay,
                (ElementKind::Dog, _) if at < first_of_pairs => Part::Dog(LOADED_DOG_N_M),
                (ElementKind::Dog, _) => Part::Dog(f64::INFINITY),
                (_, Some(clutch)) => {
                    packs += 1;
                    Part::Friction(packs - 1, Box::new(*clutch))
                }
                (_, None) => return Err(TrainError::NoPack),
            });
        }
        parts.push(Part::LockUp);
        if packs > MAX_PACKS {
            return Err(TrainError::TooManyPacks { packs, room: MAX_PACKS });
        }
        if parts.len() != train.elements {
            return Err(TrainError::TooLarge);
        }
        let has_stroke = car.clutches.iter().flatten().any(|clutch| clutch.has_stroke);
        let is_small = train.freedoms <= SMALL_FREEDOMS && packs <= SMALL_PACKS;
        let map_rad_s = car.engine.torque_n_m.rows().last().copied().unwrap_or(f64::MAX);
        Ok(Self { car, train, parts, has_stroke, is_small, map_rad_s })
    }

    /// Place of the clutch between engine and gearbox input among the elements.
    pub fn lock_up(&self) -> usize {
        self.parts.len() - 1
    }

    /// Place of a friction element among the pressures, and its clutch.
    pub fn friction(&self, element: usize) -> Option<(usize, &ShiftClutch)> {
        match self.parts.get(element)? {
            Part::Friction(slot, clutch) => Some((*slot, clutch)),
            _ => None,
        }
    }

    /// Last speed of the engine's map, rad/s: a limiter takes the torque away beyond.
    pub fn engine_map_rad_s(&self) -> f64 {
        self.map_rad_s
    }

    /// Whether a piston has a stroke, so that the oil in the cylinders is part of the state.
    #[inline]
    pub(super) fn has_stroke(&self) -> bool {
        self.has_stroke
    }

    /// Whether the state of a small gearbox has room for that of this one.
    #[inline]
    pub(super) fn is_small(&self) -> bool {
        self.is_small
    }

    /// Pressure on the plates of the friction element that has this place among the pressures, Pa.
    #[inline]
    pub(super) fn plates_pa(slot: usize, clutch: &ShiftClutch, state: &CarState) -> f64 {
        clutch.pressure(state.valves_pa[slot], state.volumes_m3[slot])
    }

    /// Pressure on the plates of an element, Pa; zero for one without.
    pub fn pressure_pa(&self, state: &CarState, element: usize) -> f64 {
        self.friction(element).map_or(0.0, |(slot, clutch)| Self::plates_pa(slot, clutch, state))
    }

    /// Speeds of engine, gearbox input and gearbox output, rad/s.
    #[inline]
    pub fn speeds(&self, state: &CarState) -> [f64; 3] {
        let [turbine, output] = self.train.ends(&state.motion);
        [state.motion[self.train.freedoms - 1], turbine, output]
    }

    /// Slip of an element, rad/s.
    #[inline]
    pub fn slip(&self, state: &CarState, element: usize) -> f64 {
        self.train.slip(&state.motion, element)
    }

    /// Lowest and highest torque of an element that sticks, N m; `None` for one that is open.
    #[inline]
    pub(super) fn holding_limits(&self, element: usize, state: &CarState, inputs: &CarInputs) -> Option<Limits> {
        let capacity = match &self.parts[element] {
            Part::Friction(slot, clutch) => clutch.clutch.static_capacity(Self::plates_pa(*slot, clutch, state)),
            Part::OneWay => return Some((0.0, UNLIMITED_N_M)),
            Part::Dog(_) if inputs.dogs[element] => UNLIMITED_N_M,
            Part::Dog(_) => 0.0,
            Part::LockUp if self.car.converter.is_none() => UNLIMITED_N_M,
            Part::LockUp => inputs.lock_up_n_m,
        };
        (capacity > 0.0).then_some((-capacity, capacity))
    }

    /// Lowest and highest torque of an element that begins to slip, N m; `None` for one that is open.
    pub(super) fn sliding_limits(&self, element: usize, state: &CarState, inputs: &CarInputs) -> Option<Limits> {
        match self.friction(element) {
            Some((slot, clutch)) => {
                let capacity = clutch.clutch.torque_capacity(Self::plates_pa(slot, clutch, state), 0.0);
                (capacity > 0.0).then_some((-capacity, capacity))
            }
            None => self.holding_limits(element, state, inputs),
        }
    }

    /// Torque of an element that slips or is open, N m. `plates_pa` gives the pressure on the plates of a friction element, Pa. Plates whose slip
    /// others keep at zero have the friction of plates that stick.
    #[inline(always)]
    fn sliding_torque(
        &self,
        element: usize,
        (contact, is_kept): (Option<Contact>, bool),
        slip: f64,
        plates_pa: impl Fn(usize, &ShiftClutch) -> f64,
        u: &CarInputs,
    ) -> f64 {
        let direction = match contact {
            Some(Contact::Slipping(direction)) => direction.sign(),
            _ => 0.0,
        };
        match &self.parts[element] {
            Part::Friction(slot, clutch) => {
                let torque = match contact {
                    None => 0.0,
                    Some(_) if is_kept => direction * clutch.clutch.static_capacity(plates_pa(*slot, clutch)),
                    Some(_) => direction * clutch.clutch.torque_capacity(plates_pa(*slot, clutch), slip),
                };
                if clutch.drag_n_m > 0.0 { torque + drag_torque(clutch.drag_n_m, slip) } else { torque }
            }
            Part::OneWay => 0.0,
            Part::Dog(_) => direction * SYNCHRONISER_N_M,
            Part::LockUp => direction * u.lock_up_n_m,
        }
    }

    /// These inputs on this car.
    #[inline]
    pub(super) fn acting<'u>(&self, inputs: &'u CarInputs) -> Acting<'u> {
        Acting {
            inputs,
            throttle: self.car.engine.torque_n_m.place(inputs.throttle),
            grade_m_s2: grade_m_s2(inputs.grade_rad),
        }
    }

    /// Every torque but those of the sticking elements, which stay zero.
    #[inline]
    pub(super) fn applied(&self, contacts: &Contacts, x: &CarState, acting: &Acting<'_>) -> CarTorques {
        let x = x.to_array::<STATES_WITH_STROKE, MAX_FREEDOMS, MAX_PACKS>();
        let mut torques = self.sources::<STATES_WITH_STROKE, MAX_FREEDOMS>(&x, acting);
        for &element in contacts.driven() {
            torques.elements_n_m[element] =
                self.sliding::<STATES_WITH_STROKE, MAX_FREEDOMS, MAX_PACKS>(element, contacts, &x, acting);
        }
        torques
    }

    /// Speeds, and every torque but those of the elements, which stay zero. Always inlined: it is most of the right-hand side of the integrator.
    #[inline(always)]
    fn sources<const N: usize, const F: usize>(&self, x: &[f64; N], acting: &Acting<'_>) -> CarTorques {
        let (car, u) = (&self.car, acting.inputs);
        let engine_rad_s = x[MOTION + self.train.freedoms - 1];
        let [turbine_rad_s, output_rad_s] = self.train.ends_of::<F>(&x[MOTION..]);
        let (pump_n_m, converter_n_m) = match &car.converter {
            Some(converter) => {
                let torques = converter.torques(engine_rad_s, turbine_rad_s);
                (torques.pump_n_m, torques.turbine_n_m)
            }
            None => (0.0, 0.0),
        };
        let engine_n_m = car.engine.torque_n_m.at_place(engine_rad_s, &acting.throttle);
        let twist_rate = car.driveline.twist_rate(output_rad_s, x[WHEEL]);
        CarTorques {
            engine_rad_s,
            turbine_rad_s,
            output_rad_s,
            engine_n_m: if engine_n_m > 0.0 {
                engine_n_m * u.engine_share * self.limited(engine_rad_s)
            } else {
                engine_n_m
            },
            pump_n_m,
            converter_n_m,
            shaft_n_m: car.driveline.shaft_torque_with_backlash(x[TWIST], twist_rate, car.backlash_rad),
            brake_n_m: brake(u.brake_n_m, x[WHEEL]),
            tyre_n: car.tyre.force(car.road.wheel_radius_m * x[WHEEL], x[VEHICLE]),
            elements_n_m: [0.0; MAX_ELEMENTS],
        }
    }

    /// Fraction of the driving engine torque that the speed limiter leaves.
    #[inline(always)]
    fn limited(&self, engine_rad_s: f64) -> f64 {
        (1.0 - (engine_rad_s - self.map_rad_s) / (LIMITER * self.map_rad_s)).clamp(0.0, 1.0)
    }

    /// Torque of an element that slips or is open, N m.
    #[inline(always)]
    fn sliding<const N: usize, const F: usize, const P: usize>(
        &self,
        element: usize,
        contacts: &Contacts,
        x: &[f64; N],
        acting: &Acting<'_>,
    ) -> f64 {
        let slip = self.train.slip_of::<F>(&x[MOTION..], element);
        let plates_pa = |slot: usize, clutch: &ShiftClutch| {
            let volume_m3 = if N > states(F, P) { x[states(F, P) + slot] } else { 0.0 };
            clutch.pressure(x[MOTION + F + slot], volume_m3)
        };
        self.sliding_torque(element, (contacts.of(element), contacts.is_kept(element)), slip, plates_pa, acting.inputs)
    }

    /// Torques on engine, gearbox input and gearbox output, N m, without those of the elements.
    #[inline(always)]
    pub(super) fn ends_n_m(&self, torques: &CarTorques) -> [f64; 3] {
        let drag = self.car.engine.drag_n_m_s * torques.engine_rad_s;
        [
            torques.engine_n_m - torques.pump_n_m - drag,
            torques.converter_n_m,
            -torques.shaft_n_m / self.car.driveline.final_ratio,
        ]
    }

    /// Every torque at this state.
    pub fn torques(&self, contacts: &Contacts, x: &CarState, u: &CarInputs) -> CarTorques {
        let mut torques = self.applied(contacts, x, &self.acting(u));
        let ends = self.ends_n_m(&torques);
        let held: [f64; MAX_ELEMENTS] = contacts.holding_n_m(&ends, &torques.elements_n_m);
        for &element in contacts.stuck() {
            torques.elements_n_m[element] = held[element];
        }
        torques
    }

    /// Time derivative of the state, and the torques that make it but for those of the sticking elements.
    #[inline]
    pub(super) fn rates<const N: usize, const F: usize, const P: usize>(
        &self,
        contacts: &Contacts,
        x: &[f64; N],
        acting: &Acting<'_>,
    ) -> ([f64; N], CarTorques) {
        let mut elements_n_m = [0.0; MAX_ELEMENTS];
        let (rates, torques) =
            self.rates_with::<N, F, P>(contacts, x, acting, |element, torque_n_m| elements_n_m[element] = torque_n_m);
        (rates, CarTorques { elements_n_m, ..torques })
    }

    /// Time derivative of the state.
    #[inline]
    pub(super) fn slope<const N: usize, const F: usize, const P: usize>(
        &self,
        contacts: &Contacts,
        x: &[f64; N],
        acting: &Acting<'_>,
    ) -> [f64; N] {
        self.rates_with::<N, F, P>(contacts, x, acting, |_, _| {}).0
    }

    /// Time derivative of the state, and the torques without those of the elements, which are shown one after another.
    #[inline(always)]
    fn rates_with<const N: usize, const F: usize, const P: usize>(
        &self,
        contacts: &Contacts,
        x: &[f64; N],
        acting: &Acting<'_>,
        mut show: impl FnMut(usize, f64),
    ) -> ([f64; N], CarTorques) {
        let (car, u) = (&self.car, acting.inputs);
        let torques = self.sources::<N, F>(x, acting);
        let mut motion = contacts.by_ends::<F>(&self.ends_n_m(&torques));
        for &element in contacts.driven() {
            let torque_n_m = self.sliding::<N, F, P>(element, contacts, x, acting);
            contacts.add_element(element, torque_n_m, &mut motion);
            show(element, torque_n_m);
        }
        let mut rates = [0.0; N];
        for part in &self.parts {
            let Part::Friction(slot, clutch) = part else { continue };
            let (now, settled) = (x[MOTION + F + slot], u.settled_pa[*slot]);
            // Most of a drive most pressures rest.
            if now != settled {
                rates[MOTION + F + slot] = clutch.valve.pressure_rate(now, settled);
            }
            if N > states(F, P) {
                rates[states(F, P) + slot] = clutch.volume_rate(x[states(F, P) + slot], now);
            }
        }
        let road = &car.road;
        let wheel_n_m = torques.shaft_n_m
            - road.rolling_moment(x[WHEEL])
            - torques.brake_n_m
            - road.wheel_radius_m * torques.tyre_n;
        rates[TWIST] = car.driveline.twist_rate(torques.output_rad_s, x[WHEEL]);
        rates[WHEEL] = wheel_n_m / car.driveline.wheel_inertia_kg_m2;
        rates[VEHICLE] = self.acceleration_under(x[VEHICLE], torques.tyre_n, acting.grade_m_s2);
        rates[MOTION..MOTION + F].copy_from_slice(&motion);
        (rates, torques)
    }

    /// Acceleration of the vehicle under this force of the tyres, m/s^2.
    #[inline]
    pub fn vehicle_acceleration(&self, x: &CarState, tyre_n: f64, u: &CarInputs) -> f64 {
        self.acceleration_under(x.vehicle_m_s, tyre_n, grade_m_s2(u.grade_rad))
    }

    /// `m dv/dt = F_x - F_A - F_G`, m/s^2.
    #[inline]
    fn acceleration_under(&self, vehicle_m_s: f64, tyre_n: f64, grade_m_s2: f64) -> f64 {
        let road = &self.car.road;
        (tyre_n - road.drag_force(vehicle_m_s)) / road.mass_kg - grade_m_s2
    }

    /// The equations that are stiff: that of the wheel, and with a stroke those of the oil in the cylinders, as many as are
    /// asked for. `tyre_n` is the tyre's force at this state.
    #[inline]
    pub(super) fn stiff_rows<const N: usize, const F: usize, const P: usize, const ROWS: usize>(
        &self,
        x: &CarState,
        tyre_n: f64,
        acting: &Acting<'_>,
    ) -> [StiffRow<N>; ROWS] {
        let mut rows = [StiffRow::none(); ROWS];
        rows[0] = self.wheel_row::<N, F>(x, tyre_n, acting.inputs.brake_n_m);
        for part in &self.parts {
            if let Part::Friction(slot, clutch) = part
                && let Some(row) = rows.get_mut(1 + slot)
            {
                let (own, valve) = clutch.volume_rate_slopes(x.volumes_m3[*slot], x.valves_pa[*slot]);
                let mut gradient = [0.0; N];
                gradient[states(F, P) + slot] = own;
                gradient[MOTION + F + slot] = valve;
                *row = StiffRow::new(states(F, P) + slot, gradient);
            }
        }
        rows
    }

    /// The wheel's equation, which tyre and brake make stiff.
    #[inline]
    fn wheel_row<const N: usize, const F: usize>(&self, x: &CarState, tyre_n: f64, brake_n_m: f64) -> StiffRow<N> {
        let (road, line) = (&self.car.road, &self.car.driveline);
        let radius = road.wheel_radius_m;
        let grip = self.car.tyre.damping(radius * x.wheel_rad_s, x.vehicle_m_s, tyre_n);
        let in_gap = Driveline::spring_twist(x.twist_rad, self.car.backlash_rad).is_none();
        let (damping, stiffness) =
            if in_gap { (0.0, 0.0) } else { (line.shaft_damping_n_m_s_rad, line.shaft_stiffness_n_m_rad) };
        let by_inertia = |torque: f64| torque / line.wheel_inertia_kg_m2;
        let mut gradient = [0.0; N];
        gradient[WHEEL] = by_inertia(-(radius * radius * grip + damping + brake_slope(brake_n_m, x.wheel_rad_s)));
        gradient[VEHICLE] = by_inertia(radius * grip);
        gradient[TWIST] = by_inertia(stiffness);
        let by_output = by_inertia(damping / line.final_ratio);
        for (entry, output) in gradient[MOTION..MOTION + F].iter_mut().zip(&self.train.ends[1]) {
            *entry = by_output * output;
        }
        // Of few states all may differ from zero: the compiler then knows where the row lies.
        if F == SMALL_FREEDOMS {
            StiffRow::of_states(WHEEL, TWIST..MOTION + F, gradient)
        } else {
            StiffRow::new(WHEEL, gradient)
        }
    }

    /// Kinetic energy of engine and gearbox, J.
    pub(super) fn rotating_energy(&self, x: &CarState) -> f64 {
        self.train.kinetic_energy(&x.motion)
    }

    /// The motion in which the shafts of the gearbox have these speeds, rad/s, and the engine its own. `None` if there is not one
    /// speed for each shaft.
    pub fn motion_of(&self, shafts_rad_s: &[f64], engine_rad_s: f64) -> Option<[f64; MAX_FREEDOMS]> {
        let train = self.car.gearbox.train.as_ref()?.motion(shafts_rad_s)?;
        let mut motion = [0.0; MAX_FREEDOMS];
        motion.get_mut(..train.len())?.copy_from_slice(&train);
        *motion.get_mut(train.len())? = engine_rad_s;
        Some(motion)
    }
}

fn grade_m_s2(grade_rad: f64) -> f64 {
    drivetrain::road::GRAVITY_M_S2 * Real::sin(grade_rad)
}

fn brake(torque_n_m: f64, wheel_rad_s: f64) -> f64 {
    if torque_n_m == 0.0 { 0.0 } else { torque_n_m * Real::tanh(wheel_rad_s / BRAKE_TURN_RAD_S) }
}

/// Derivative of the brake's torque by the wheel speed, N m s/rad.
fn brake_slope(torque_n_m: f64, wheel_rad_s: f64) -> f64 {
    if torque_n_m == 0.0 {
        return 0.0;
    }
    let fraction = Real::tanh(wheel_rad_s / BRAKE_TURN_RAD_S);
    torque_n_m / BRAKE_TURN_RAD_S * (1.0 - fraction * fraction)
}

/// Response of the motion to unit torques on engine, gearbox input and gearbox output.
pub(super) fn end_responses(train: &TrainModel) -> [[f64; MAX_FREEDOMS]; 3] {
    let mut engine = [0.0; MAX_FREEDOMS];
    engine[train.freedoms - 1] = 1.0;
    [engine, train.ends[0], train.ends[1]].map(|force| train.accelerate(&force))
}
