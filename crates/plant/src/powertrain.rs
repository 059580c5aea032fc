//! The equations of the powertrain, smooth within a mode.

use car::{ShiftClutch, Vehicle};
use drivetrain::clutch::drag_torque;
use drivetrain::{Clutch, ColumnPlace, Driveline, Engagement, ShiftCoefficients, ShiftTorques};

use crate::mode::CLUTCHES;
use crate::rosenbrock::StiffRow;
use crate::state::{AT_THE_WHEEL, CYLINDERS, STATES, State, VALVE_TO_CYLINDER, WHEEL};
use crate::{Contact, ContactProblem, Direction, Mode};

/// What acts on the plant from outside, constant over a segment of the integration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inputs {
    /// Throttle, 0 closed to 1 open.
    pub throttle: f64,
    /// Pressure at which the command that has arrived at the offgoing clutch's valve settles, Pa, its hysteresis included.
    pub offgoing_settled_pa: f64,
    /// Pressure at which the command that has arrived at the oncoming clutch's valve settles, Pa, its hysteresis included.
    pub oncoming_settled_pa: f64,
}

impl Inputs {
    /// The inputs when these commands have arrived at the valves of this vehicle, without hysteresis.
    pub fn arrived(vehicle: &Vehicle, throttle: f64, offgoing: f64, oncoming: f64) -> Self {
        Self {
            throttle,
            offgoing_settled_pa: vehicle.offgoing.valve.settled_pressure(offgoing),
            oncoming_settled_pa: vehicle.oncoming.valve.settled_pressure(oncoming),
        }
    }
}

/// Inputs with what follows from them alone, found once for a segment of the integration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Acting {
    inputs: Inputs,
    /// Where the throttle lies in the engine's map.
    throttle: ColumnPlace<f64>,
}

/// Every torque and force of the powertrain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Torques {
    /// Engine torque `T_e`, N m.
    pub engine_n_m: f64,
    /// Pump torque `T_p`, N m.
    pub pump_n_m: f64,
    /// Torques on the gear train, N m; those of sticking clutches are their holding torques.
    pub shift: ShiftTorques<f64>,
    /// Drive-shaft torque `T_s`, N m.
    pub shaft_n_m: f64,
    /// Tyre force `F_x`, N.
    pub tyre_n: f64,
}

/// The powertrain of one vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Powertrain {
    /// The vehicle as simulated.
    pub vehicle: Vehicle,
    coefficients: [ShiftCoefficients<f64>; 4],
    grade_force_n: f64,
}

impl Powertrain {
    /// The powertrain of this vehicle.
    pub fn new(vehicle: Vehicle) -> Self {
        let of = |engagement| vehicle.shift.coefficients(engagement);
        Self {
            coefficients: [
                of(Engagement::BothSlipping),
                of(Engagement::OffgoingStuck),
                of(Engagement::OncomingStuck),
                of(Engagement::BothStuck),
            ],
            grade_force_n: vehicle.road.grade_force(),
            vehicle,
        }
    }

    /// Coefficients of the gear train in this engagement.
    #[inline]
    pub fn coefficients(&self, engagement: Engagement) -> &ShiftCoefficients<f64> {
        match engagement {
            Engagement::BothSlipping => &self.coefficients[0],
            Engagement::OffgoingStuck => &self.coefficients[1],
            Engagement::OncomingStuck => &self.coefficients[2],
            Engagement::BothStuck => &self.coefficients[3],
        }
    }

    /// Whether a piston has a stroke, so that the oil in the cylinders is part of the state.
    #[inline]
    pub fn has_stroke(&self) -> bool {
        self.vehicle.offgoing.has_stroke || self.vehicle.oncoming.has_stroke
    }

    /// Pressures in the cylinders of the offgoing and the oncoming clutch, Pa.
    #[inline]
    pub fn pressures(&self, x: &State) -> [f64; 2] {
        [
            self.vehicle.offgoing.pressure(x.offgoing_valve_pa, x.offgoing_m3),
            self.vehicle.oncoming.pressure(x.oncoming_valve_pa, x.oncoming_m3),
        ]
    }

    /// These inputs on this powertrain.
    #[inline]
    pub(crate) fn acting(&self, inputs: &Inputs) -> Acting {
        Acting { inputs: *inputs, throttle: self.vehicle.engine.torque_n_m.place(inputs.throttle) }
    }

    /// Every torque at this state.
    #[inline]
    pub fn torques(&self, mode: Mode, x: &State, inputs: &Inputs) -> Torques {
        self.with_holding_torques(mode, &self.applied_torques(mode, x, &self.acting(inputs)))
    }

    /// Torque of the oncoming clutch at this state, N m, as in [`Self::torques`]: of one that slips no other has to be known.
    #[inline]
    pub fn oncoming_torque(&self, mode: Mode, x: &State, inputs: &Inputs) -> f64 {
        match mode.oncoming {
            Contact::Stuck => self.torques(mode, x, inputs).shift.oncoming_n_m,
            Contact::Slipping(_) => {
                let slip = self.vehicle.shift.oncoming_slip(x.turbine_rad_s, x.output_rad_s);
                friction(mode.oncoming, &self.vehicle.oncoming, self.pressures(x)[1], slip)
            }
        }
    }

    /// Drive-shaft torque at this state, N m.
    #[inline]
    pub fn shaft_torque(&self, x: &State) -> f64 {
        let v = &self.vehicle;
        let twist_rate = v.driveline.twist_rate(x.output_rad_s, x.wheel_rad_s);
        v.driveline.shaft_torque_with_backlash(x.twist_rad, twist_rate, v.backlash_rad)
    }

    /// Tyre force at this state, N.
    #[inline]
    fn tyre_force(&self, x: &State) -> f64 {
        self.vehicle.tyre.force(self.vehicle.road.wheel_radius_m * x.wheel_rad_s, x.vehicle_m_s)
    }

    /// The torques with those that the sticking clutches hold.
    #[inline]
    fn with_holding_torques(&self, mode: Mode, applied: &Torques) -> Torques {
        let mut torques = *applied;
        let coefficients = self.coefficients(mode.engagement());
        if mode.offgoing == Contact::Stuck {
            torques.shift.offgoing_n_m = coefficients.holding_offgoing.at(&applied.shift);
        }
        if mode.oncoming == Contact::Stuck {
            torques.shift.oncoming_n_m = coefficients.holding_oncoming.at(&applied.shift);
        }
        torques
    }

    /// Every torque but the holding torques, which stay zero: sticking clutches drop out of the
    /// equations of motion. Always inlined: it is most of the right-hand side of the integrator.
    #[inline(always)]
    fn applied_torques(&self, mode: Mode, x: &State, acting: &Acting) -> Torques {
        let v = &self.vehicle;
        let converter = v.converter.torques(x.engine_rad_s, x.turbine_rad_s);
        let shaft_n_m = self.shaft_torque(x);
        let [offgoing_pa, oncoming_pa] = self.pressures(x);
        let offgoing_slip = v.shift.offgoing_slip(x.turbine_rad_s, x.output_rad_s);
        let oncoming_slip = v.shift.oncoming_slip(x.turbine_rad_s, x.output_rad_s);
        Torques {
            engine_n_m: v.engine.torque_n_m.at_place(x.engine_rad_s, &acting.throttle),
            pump_n_m: converter.pump_n_m,
            shift: ShiftTorques {
                turbine_n_m: converter.turbine_n_m,
                offgoing_n_m: friction(mode.offgoing, &v.offgoing, offgoing_pa, offgoing_slip),
                oncoming_n_m: friction(mode.oncoming, &v.oncoming, oncoming_pa, oncoming_slip),
                output_n_m: shaft_n_m / v.driveline.final_ratio,
            },
            shaft_n_m,
            tyre_n: self.tyre_force(x),
        }
    }

    /// Time derivative of the state of a car whose pistons have no stroke.
    #[inline]
    pub fn derivative(&self, mode: Mode, x: &[f64; STATES], inputs: &Inputs) -> [f64; STATES] {
        self.derivative_with_torques(mode, x, &self.acting(inputs)).0
    }

    /// Time derivative of the state, and the torques that make it but for the holding torques.
    #[inline]
    pub(crate) fn derivative_with_torques<const N: usize>(
        &self,
        mode: Mode,
        x: &[f64; N],
        acting: &Acting,
    ) -> ([f64; N], Torques) {
        let x = State::from_array(*x);
        let (v, inputs) = (&self.vehicle, &acting.inputs);
        let torques = self.applied_torques(mode, &x, acting);
        let gear = self.coefficients(mode.engagement());
        let rates = State {
            engine_rad_s: v.engine.acceleration(x.engine_rad_s, torques.engine_n_m, torques.pump_n_m),
            turbine_rad_s: gear.turbine.at(&torques.shift),
            output_rad_s: gear.output.at(&torques.shift),
            twist_rad: v.driveline.twist_rate(x.output_rad_s, x.wheel_rad_s),
            wheel_rad_s: self.wheel_acceleration(&x, &torques),
            vehicle_m_s: self.acceleration_under(&x, torques.tyre_n),
            offgoing_valve_pa: v.offgoing.valve.pressure_rate(x.offgoing_valve_pa, inputs.offgoing_settled_pa),
            oncoming_valve_pa: v.oncoming.valve.pressure_rate(x.oncoming_valve_pa, inputs.oncoming_settled_pa),
            offgoing_m3: v.offgoing.volume_rate(x.offgoing_m3, x.offgoing_valve_pa),
            oncoming_m3: v.oncoming.volume_rate(x.oncoming_m3, x.oncoming_valve_pa),
        };
        (rates.to_vector(), torques)
    }

    /// The equations that are stiff: that of the wheel, and with a stroke those of the oil in the cylinders, as many as
    /// are asked for. `tyre_n` is the tyre's force at this state.
    #[inline]
    pub(crate) fn stiff_rows<const N: usize, const ROWS: usize>(&self, x: &State, tyre_n: f64) -> [StiffRow<N>; ROWS] {
        let v = &self.vehicle;
        std::array::from_fn(|row| match row {
            0 => StiffRow::of_states(WHEEL, AT_THE_WHEEL, self.wheel_gradient(x, tyre_n).to_vector()),
            1 => {
                let (own, valve) = v.offgoing.volume_rate_slopes(x.offgoing_m3, x.offgoing_valve_pa);
                let gradient = State { offgoing_m3: own, offgoing_valve_pa: valve, ..State::ZERO };
                StiffRow::of_states(CYLINDERS[0], VALVE_TO_CYLINDER[0].clone(), gradient.to_vector())
            }
            _ => {
                let (own, valve) = v.oncoming.volume_rate_slopes(x.oncoming_m3, x.oncoming_valve_pa);
                let gradient = State { oncoming_m3: own, oncoming_valve_pa: valve, ..State::ZERO };
                StiffRow::of_states(CYLINDERS[1], VALVE_TO_CYLINDER[1].clone(), gradient.to_vector())
            }
        })
    }

    /// The wheel's equation by wheel, vehicle, output and twist: the row that the tyre makes stiff. `tyre_n`
    /// is the tyre's force at this state.
    pub fn stiff_row(&self, x: &State, tyre_n: f64) -> StiffRow<STATES> {
        StiffRow::of_states(WHEEL, AT_THE_WHEEL, self.wheel_gradient(x, tyre_n).to_array())
    }

    #[inline]
    fn wheel_gradient(&self, x: &State, tyre_n: f64) -> State {
        let (road, line) = (&self.vehicle.road, &self.vehicle.driveline);
        let radius = road.wheel_radius_m;
        let grip = self.vehicle.tyre.damping(radius * x.wheel_rad_s, x.vehicle_m_s, tyre_n);
        let in_gap = Driveline::spring_twist(x.twist_rad, self.vehicle.backlash_rad).is_none();
        let (damping, stiffness) =
            if in_gap { (0.0, 0.0) } else { (line.shaft_damping_n_m_s_rad, line.shaft_stiffness_n_m_rad) };
        let by_inertia = |torque: f64| torque / line.wheel_inertia_kg_m2;
        State {
            wheel_rad_s: by_inertia(-(radius * radius * grip + damping)),
            vehicle_m_s: by_inertia(radius * grip),
            output_rad_s: by_inertia(damping / line.final_ratio),
            twist_rad: by_inertia(stiffness),
            ..State::ZERO
        }
    }

    /// `I_w dw_w/dt = T_s - T_w - R_w F_x`, rad/s^2.
    #[inline]
    fn wheel_acceleration(&self, x: &State, torques: &Torques) -> f64 {
        let road = &self.vehicle.road;
        (torques.shaft_n_m - road.rolling_moment(x.wheel_rad_s) - road.wheel_radius_m * torques.tyre_n)
            / self.vehicle.driveline.wheel_inertia_kg_m2
    }

    /// Acceleration of the vehicle at this state, m/s^2.
    #[inline]
    pub fn vehicle_acceleration(&self, x: &State) -> f64 {
        self.acceleration_under(x, self.tyre_force(x))
    }

    /// `m dv/dt = F_x - F_A - F_G`, m/s^2.
    #[inline]
    pub(crate) fn acceleration_under(&self, x: &State, tyre_n: f64) -> f64 {
        let road = &self.vehicle.road;
        (tyre_n - road.drag_force(x.vehicle_m_s) - self.grade_force_n) / road.mass_kg
    }

    /// Torques that the offgoing and the oncoming clutch can hold at this state, N m.
    pub(crate) fn capacities_n_m(&self, x: &State) -> [f64; CLUTCHES] {
        let [offgoing_pa, oncoming_pa] = self.pressures(x);
        let v = &self.vehicle;
        [v.offgoing.clutch.static_capacity(offgoing_pa), v.oncoming.clutch.static_capacity(oncoming_pa)]
    }

    /// What decides which clutches without slip stick: those with a capacity, N m. The others slip as in `mode`. `None` if a number is not
    /// finite.
    pub(crate) fn contact_problem(
        &self,
        mode: Mode,
        capacities_n_m: [Option<f64>; CLUTCHES],
        x: &State,
        inputs: &Inputs,
    ) -> Option<ContactProblem> {
        let v = &self.vehicle;
        let asked = || (0..CLUTCHES).filter(|&clutch| capacities_n_m[clutch].is_some());
        // A clutch that sticks has no torque among the applied ones.
        let mut others = mode.contacts();
        asked().for_each(|clutch| others[clutch] = Contact::Stuck);
        let applied = self.applied_torques(Mode::of(others), x, &self.acting(inputs)).shift;
        let slips = [v.shift.slip_offgoing, v.shift.slip_oncoming];
        let gear = self.coefficients(Engagement::BothSlipping);
        // Acceleration of the slip of a clutch by these torques, rad/s^2.
        let by = |clutch: usize, torques: &ShiftTorques<f64>| {
            slips[clutch][0] * gear.turbine.at(torques) + slips[clutch][1] * gear.output.at(torques)
        };
        let nothing = ShiftTorques { turbine_n_m: 0.0, offgoing_n_m: 0.0, oncoming_n_m: 0.0, output_n_m: 0.0 };
        let one_n_m = [ShiftTorques { offgoing_n_m: 1.0, ..nothing }, ShiftTorques { oncoming_n_m: 1.0, ..nothing }];
        let mut problem = ContactProblem::new();
        for (clutch, capacity_n_m) in capacities_n_m.into_iter().enumerate() {
            let Some(capacity_n_m) = capacity_n_m else { continue };
            let row: Vec<f64> =
                asked().filter(|&other| other <= clutch).map(|other| -by(clutch, &one_n_m[other])).collect();
            if !problem.add(by(clutch, &applied), &row, (-capacity_n_m, capacity_n_m)) {
                return None;
            }
        }
        Some(problem)
    }

    /// How far the offgoing and the oncoming clutch are from a change of mode: the slip of a slipping
    /// clutch in its direction, rad/s, what a sticking one could hold beyond what it does, N m. The mode
    /// ends where one of them turns negative.
    #[inline]
    pub fn margins(&self, mode: Mode, x: &State, inputs: &Inputs) -> [f64; 2] {
        self.margins_under(mode, x, &self.applied_torques(mode, x, &self.acting(inputs)))
    }

    /// As [`Self::margins`], under torques that are known but for the holding torques.
    #[inline]
    pub(crate) fn margins_under(&self, mode: Mode, x: &State, applied: &Torques) -> [f64; 2] {
        let v = &self.vehicle;
        let slips = [
            v.shift.offgoing_slip(x.turbine_rad_s, x.output_rad_s),
            v.shift.oncoming_slip(x.turbine_rad_s, x.output_rad_s),
        ];
        let torques = self.with_holding_torques(mode, applied).shift;
        let [offgoing_pa, oncoming_pa] = self.pressures(x);
        let margin = |contact, slip: f64, clutch: &Clutch<f64>, pressure_pa: f64, holding: f64| match contact {
            Contact::Slipping(direction) => Direction::sign(direction) * slip,
            Contact::Stuck => clutch.static_capacity(pressure_pa) - holding.abs(),
        };
        [
            margin(mode.offgoing, slips[0], &v.offgoing.clutch, offgoing_pa, torques.offgoing_n_m),
            margin(mode.oncoming, slips[1], &v.oncoming.clutch, oncoming_pa, torques.oncoming_n_m),
        ]
    }
}

/// Friction and drag of a clutch that slips, N m; nothing of one that sticks.
#[inline]
fn friction(contact: Contact, clutch: &ShiftClutch, pressure_pa: f64, slip: f64) -> f64 {
    match contact {
        Contact::Stuck => 0.0,
        Contact::Slipping(direction) => {
            let torque_n_m = direction.sign() * clutch.clutch.torque_capacity(pressure_pa, slip);
            if clutch.drag_n_m > 0.0 { torque_n_m + drag_torque(clutch.drag_n_m, slip) } else { torque_n_m }
        }
    }
}
