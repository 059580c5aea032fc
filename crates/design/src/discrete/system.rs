//! The error system of a sampled observer, with all errors of the error budget as inputs.
//!
//! With `A = Phi - L G Psi`, errors `w` of the accelerations, `n` of the speed readings, and `v` of valve and twist, the error
//! of the estimate obeys
//!
//! ```text
//! e+ = A e - L (T H w + n+ - n) + v
//! ```
//!
//! The errors of two readings enter as a difference. If each difference is bounded alone, the bound of their sum grows with
//! the number of samples, and at a high sample rate no gain is worth its noise. But differences telescope: the sum over many
//! samples is the difference of the last reading and the first. The change of state `x = e + L n`, which is the error of the
//! observer's own variable `eta = z - L y` of Eq. (2.43), brings this into the bound:
//!
//! ```text
//! x+ = A x + (I - A) L n - L T H w + v,    e = x - L n
//! ```
//!
//! In this form `n` enters as itself, with `I - A`, which shrinks with the sample time as `1 - |A|` does. With one state and
//! `0 <= A <= 1`, `x+` is a mean of `x` and `L n`, so that readings within `n` cause an error of at most `2 |L| n`, at any
//! sample time; of bounded differences it is `2 |L| n/(1 - A)`.
//!
//! A gain that follows the friction has another value `L` at each sample, `L-` at the one before. With `x = e + L- n`
//!
//! ```text
//! x+ = A x + (I - A) L n + A (L - L-) n - L T H w + v,    e = x - L- n
//! ```
//!
//! so that it depends on how much the friction changes from sample to sample, see [`ErrorSystem::friction_step`].

use car::Vehicle;
use drivetrain::Real;
use nalgebra::{DMatrix, DVector};
use observer::{Discretisation, Phase};

use super::model::{Model, Quantity};
use crate::budget::{ValveErrors, grade_n_m, mass_n_m};
use crate::compliant::{PRESSURE_UNIT_PA, SHAFT_UNIT_N_M, SPEED_UNITS_RAD_S, compliant_model};
use crate::compliant::{given_error_matrix, outputs as compliant_outputs};
use crate::polytope::{distinct, valve_extremes};
use crate::rigid::rigid_model;

/// Name of the readings' errors as a cause.
pub(super) const READINGS: &str = "sensor quantisation";
/// The turbine-side inertia as a cause.
const INERTIA: &str = "turbine-side inertia";
/// Roundings that an observer adds up in a sample, in single precision.
const ROUNDINGS: f64 = 8.0;

/// The errors of `x` above, normalised as [`crate::compliant`] says.
#[derive(Debug, Clone)]
pub(crate) struct ErrorSystem {
    pub(crate) corners: Vec<Corner>,
    /// The readings' errors at their bounds, a column for each output that has one.
    pub(crate) readings: DMatrix<f64>,
    /// Largest change of the friction coefficient of the observer's model from one sample to the next, as a fraction of its range.
    pub(crate) friction_step: f64,
    /// Errors of the accelerations alone, a column for each cause: `H`.
    pub(crate) h: DMatrix<f64>,
}

/// A corner of the polytope.
#[derive(Debug, Clone)]
pub(crate) struct Corner {
    pub(crate) label: String,
    /// Friction coefficient.
    pub(crate) friction: f64,
    /// Which of the valve's extremes.
    pub(crate) valve: usize,
    pub(crate) phi: DMatrix<f64>,
    pub(crate) g_psi: DMatrix<f64>,
    /// What reaches the error through the gain, in the units of the outputs; but for the readings.
    pub(crate) through_gain: Vec<Cause>,
    /// The same as columns, those of one direction made one; as many at every corner.
    pub(crate) columns: DMatrix<f64>,
    /// What reaches it past the gain, in the units of the states.
    pub(crate) direct: Vec<Cause>,
    /// The same as columns.
    pub(crate) direct_columns: DMatrix<f64>,
}

/// One error at its bound; it may have either sign.
#[derive(Debug, Clone)]
pub(crate) struct Cause {
    pub(crate) name: &'static str,
    pub(crate) column: DVector<f64>,
}

/// Which of `(w_t, dw, w_w)` are outputs.
pub(crate) fn outputs(model: Model, phase: Phase) -> &'static [usize] {
    match (model, phase) {
        (Model::Compliant, _) => compliant_outputs(phase),
        (Model::Rigid, Phase::InertiaPhase) => &[0, 1],
        (Model::Rigid, _) => &[0],
    }
}

/// Units of the states.
pub(crate) fn state_units(model: Model) -> &'static [f64] {
    match model {
        Model::Rigid => &[PRESSURE_UNIT_PA],
        Model::Compliant => &[SHAFT_UNIT_N_M, PRESSURE_UNIT_PA],
    }
}

impl ErrorSystem {
    pub(crate) fn of(vehicle: &Vehicle, model: Model, quantity: Quantity, phase: Phase, sample_time_s: f64) -> Self {
        let mut corners = corners(vehicle, model, phase, sample_time_s, Discretisation::Exact);
        let outputs = outputs(model, phase);
        let accelerations = match model {
            Model::Rigid => rigid_errors(vehicle, phase),
            Model::Compliant => compliant_errors(vehicle, phase),
        };
        let h = DMatrix::from_columns(&accelerations.iter().map(|cause| cause.column.clone()).collect::<Vec<_>>());
        let mut through_gain: Vec<Cause> = (accelerations.into_iter())
            .map(|Cause { name, column }| Cause { name, column: column * sample_time_s })
            .collect();
        let rounding = ROUNDINGS * vehicle.error_bounds.float32_rounding * vehicle.settings.speed_max_rad_s;
        through_gain.extend((0..outputs.len()).map(|i| Cause {
            name: "float32 rounding",
            column: unit_vector(outputs.len(), i) * (rounding / SPEED_UNITS_RAD_S[outputs[i]]),
        }));
        for corner in &mut corners {
            corner.through_gain = [through_gain.clone(), seen(vehicle, quantity, &corner.g_psi)].concat();
            corner.columns = merged(&corner.through_gain, outputs.len());
            corner.direct = direct(vehicle, model, quantity, corner, sample_time_s);
            corner.direct_columns = merged(&corner.direct, state_units(model).len());
        }
        let readings = readings(vehicle, outputs);
        let friction_step = friction_step(vehicle, sample_time_s);
        Self { corners, readings, friction_step, h }
    }

    /// What the last reading adds to the error of the normalised pressure: `|L| n` of `e = x - L n`.
    pub(crate) fn last_reading(&self, gain: &DMatrix<f64>) -> f64 {
        (gain.row(self.states() - 1) * &self.readings).abs().sum()
    }

    /// States: the pressure is the last.
    pub(crate) fn states(&self) -> usize {
        self.corners[0].phi.nrows()
    }
}

impl Corner {
    /// `A = Phi - L G Psi` with this gain.
    pub(crate) fn error_dynamics(&self, gain: &DMatrix<f64>) -> DMatrix<f64> {
        &self.phi - gain * &self.g_psi
    }
}

fn unit_vector(length: usize, at: usize) -> DVector<f64> {
    DVector::from_fn(length, |i, _| if i == at { 1.0 } else { 0.0 })
}

/// Bound on the error of one reading, rad/s. The budget bounds the error of a change, which is the difference of two readings:
/// it is kept by all readings within half of that, whatever their signs.
fn reading_rad_s(quantum_rad_s: f64) -> f64 {
    0.5 * quantum_rad_s
}

/// The readings' errors at their bounds, a column for each output that has one.
fn readings(vehicle: &Vehicle, outputs: &[usize]) -> DMatrix<f64> {
    let bounds = &vehicle.error_bounds;
    let quanta = [bounds.turbine_quantum_rad_s, bounds.slip_quantum_rad_s, bounds.wheel_quantum_rad_s];
    let sizes = outputs.iter().map(|&output| reading_rad_s(quanta[output]) / SPEED_UNITS_RAD_S[output]);
    let columns: Vec<DVector<f64>> = (sizes.enumerate().filter(|(_, size)| *size > 0.0))
        .map(|(i, size)| unit_vector(outputs.len(), i) * size)
        .collect();
    DMatrix::from_fn(outputs.len(), columns.len(), |i, j| columns[j][i])
}

/// Largest change of the friction coefficient of the observer's model from one sample to the next, as a fraction of the range
/// that a gain follows. The coefficient follows from the reading of the slip: it changes by the slope of its map times the
/// change of the slip, which the budget gives for the age of a reading, and the reading's own error.
fn friction_step(vehicle: &Vehicle, sample_time_s: f64) -> f64 {
    let (bounds, friction) = (&vehicle.error_bounds, &vehicle.oncoming.clutch.friction);
    let (slips, coefficients) = (friction.axis(), friction.values());
    let slopes = slips.windows(2).zip(coefficients.windows(2)).map(|(x, y)| ((y[1] - y[0]) / (x[1] - x[0])).abs());
    let slope = slopes.fold(0.0, f64::max);
    let (minimum, maximum) = vehicle.settings.uncertainty.friction;
    if slope == 0.0 || maximum <= minimum {
        return 0.0;
    }
    let moved_rad_s = bounds.slip_rad_s * sample_time_s / bounds.sampling_delay_s + bounds.slip_quantum_rad_s;
    // Without an age there is no rate: any change may come. `min` also drops what is not a number.
    (slope * moved_rad_s / (maximum - minimum)).min(1.0)
}

/// The columns of these causes, those of one direction made one: their errors may have any sign, so their sizes add up.
/// There are none if every error is zero.
fn merged(causes: &[Cause], rows: usize) -> DMatrix<f64> {
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for Cause { column, .. } in causes.iter().filter(|cause| cause.column.norm() > 0.0) {
        let along = |other: &DVector<f64>| {
            let cosine = other.dot(column) / (other.norm() * column.norm());
            (cosine.abs() > 1.0 - 1e-12).then_some(cosine.signum())
        };
        match columns.iter_mut().find_map(|other| along(other).map(|sign| (other, sign))) {
            Some((other, sign)) => *other += column * sign,
            None => columns.push(column.clone()),
        }
    }
    DMatrix::from_fn(rows, columns.len(), |i, j| columns[j][i])
}

/// The corners without what disturbs them.
pub(crate) fn corners(
    vehicle: &Vehicle,
    model: Model,
    phase: Phase,
    sample_time_s: f64,
    discretisation: Discretisation,
) -> Vec<Corner> {
    let (rigid, compliant) = (rigid_model(vehicle), compliant_model(vehicle));
    let (outputs, units) = (outputs(model, phase), state_units(model));
    let mut corners = Vec::new();
    for (valve, (valve_label, a22_per_s)) in
        valve_extremes(&rigid, &vehicle.settings.uncertainty).into_iter().enumerate()
    {
        let phi = match discretisation {
            Discretisation::Exact => Real::exp(a22_per_s * sample_time_s),
            Discretisation::Euler => 1.0 + a22_per_s * sample_time_s,
        };
        let psi = (phi - 1.0) / a22_per_s;
        for friction in distinct(vehicle.settings.uncertainty.friction) {
            let (phi, held, influence) = match model {
                Model::Rigid => {
                    let on_speeds = rigid.influence(phase, friction);
                    (vec![phi], vec![psi], vec![vec![on_speeds[0]], vec![on_speeds[1]]])
                }
                Model::Compliant => {
                    let on_speeds = compliant.influence(phase, friction);
                    (vec![1.0, phi], vec![sample_time_s, psi], on_speeds.iter().map(|row| row.to_vec()).collect())
                }
            };
            corners.push(Corner {
                label: format!("friction {friction}{valve_label}"),
                friction,
                valve,
                phi: DMatrix::from_diagonal(&DVector::from_vec(phi)),
                g_psi: DMatrix::from_fn(outputs.len(), units.len(), |i, j| {
                    influence[outputs[i]][j] * held[j] * units[j] / SPEED_UNITS_RAD_S[outputs[i]]
                }),
                through_gain: Vec::new(),
                columns: DMatrix::zeros(0, 0),
                direct: Vec::new(),
                direct_columns: DMatrix::zeros(0, 0),
            });
        }
    }
    corners
}

/// Torque of an error of the turbine-side inertia, N m, where the budget has one.
fn inertia_n_m(vehicle: &Vehicle) -> Option<f64> {
    Some(vehicle.error_bounds.inertia_torque_n_m).filter(|size| *size > 0.0)
}

/// Errors of the accelerations that the rigid model has, over the units of its outputs.
fn rigid_errors(vehicle: &Vehicle, phase: Phase) -> Vec<Cause> {
    let model = rigid_model(vehicle);
    let (bounds, rows) = (&vehicle.error_bounds, model.coefficients(phase));
    let (turbine, slip) = (&rows.turbine, &rows.slip_oncoming);
    let outputs = outputs(Model::Rigid, phase).len();
    let cause = |name, on_turbine: f64, on_slip: f64, size: f64| Cause {
        name,
        column: DVector::from_fn(outputs, |i, _| [on_turbine, on_slip][i] * size / SPEED_UNITS_RAD_S[i]),
    };
    let load = |name, wheel_n_m: f64| {
        cause(name, turbine.per_output_torque, slip.per_output_torque, wheel_n_m / final_ratio(vehicle))
    };
    let mut causes = vec![
        cause("turbine torque", turbine.per_turbine_torque, slip.per_turbine_torque, bounds.turbine_torque_n_m),
        load("mass", mass_n_m(vehicle)),
        load("grade", grade_n_m(vehicle)),
        load("shaft torsion, tyre slip", bounds.output_torque_n_m * final_ratio(vehicle)),
    ];
    if phase == Phase::InertiaPhase {
        causes.push(cause(
            "offgoing clutch",
            turbine.per_offgoing_torque,
            slip.per_offgoing_torque,
            bounds.offgoing_torque_n_m,
        ));
        let [on_turbine, on_slip] = [turbine.per_turbine_torque, slip.per_turbine_torque];
        causes.extend(inertia_n_m(vehicle).map(|size| cause(INERTIA, on_turbine, on_slip, size)));
    }
    causes
}

/// The same of the compliant model; given ones of the vehicle file stand in place of turbine torque and load.
fn compliant_errors(vehicle: &Vehicle, phase: Phase) -> Vec<Cause> {
    let model = compliant_model(vehicle);
    let outputs = outputs(Model::Compliant, phase);
    let column = |on_speeds: [f64; 3]| {
        DVector::from_fn(outputs.len(), |i, _| on_speeds[outputs[i]] / SPEED_UNITS_RAD_S[outputs[i]])
    };
    if let Some(given) = given_error_matrix(vehicle, phase) {
        return given.column_iter().map(|c| Cause { name: "model error", column: c.into_owned() }).collect();
    }
    let bounds = &vehicle.error_bounds;
    let rows = if phase == Phase::InertiaPhase { &model.inertia_phase } else { &model.torque_phase };
    let (turbine, slip) = (&rows.turbine, &rows.slip_oncoming);
    let wheel = |name, n_m: f64| Cause { name, column: column([0.0, 0.0, model.wheel_per_torque * n_m]) };
    let gearbox = |name, on_turbine: f64, on_slip: f64, size: f64| Cause {
        name,
        column: column([on_turbine * size, on_slip * size, 0.0]),
    };
    let mut causes = vec![
        gearbox("turbine torque", turbine.per_turbine_torque, slip.per_turbine_torque, bounds.turbine_torque_n_m),
        wheel("mass", mass_n_m(vehicle)),
        wheel("grade", grade_n_m(vehicle)),
    ];
    if phase == Phase::InertiaPhase {
        let on = [turbine.per_offgoing_torque, slip.per_offgoing_torque];
        causes.push(gearbox("offgoing clutch", on[0], on[1], bounds.offgoing_torque_n_m));
        let on = [turbine.per_turbine_torque, slip.per_turbine_torque];
        causes.extend(inertia_n_m(vehicle).map(|size| gearbox(INERTIA, on[0], on[1], size)));
    }
    causes
}

/// Errors with the effect of a pressure: delayed speeds, which depend on an earlier pressure, and, if the quantity is the
/// pressure, an error of the friction.
fn seen(vehicle: &Vehicle, quantity: Quantity, g_psi: &DMatrix<f64>) -> Vec<Cause> {
    let bounds = &vehicle.error_bounds;
    let influence = g_psi.column(g_psi.ncols() - 1).into_owned();
    let as_pressure = |name, pascal: f64| Cause { name, column: &influence * (pascal / PRESSURE_UNIT_PA) };
    let mut causes = vec![as_pressure("sampling delay", bounds.sampling_delay_s * bounds.shift_ramp_pa_s)];
    if quantity == Quantity::Pressure {
        causes.push(as_pressure("friction", friction_pa(vehicle)));
    }
    causes
}

/// Pressure that a friction error at its bound is worth in a shift, Pa.
fn friction_pa(vehicle: &Vehicle) -> f64 {
    let bounds = &vehicle.error_bounds;
    let fraction = bounds.friction_factor.map(|factor| (factor - 1.0).abs()).into_iter().fold(0.0, f64::max);
    fraction * bounds.shift_pressure_pa
}

/// Errors of the valve model at this corner, and of the twist of the shafts that follows from the readings. An error of the
/// valve's rate, and the effect of a friction error, act for as long as this valve remembers them: the bound of the open loop
/// does not depend on the sample time.
fn direct(vehicle: &Vehicle, model: Model, quantity: Quantity, corner: &Corner, sample_time_s: f64) -> Vec<Cause> {
    let bounds = &vehicle.error_bounds;
    let states = state_units(model).len();
    let on = |name, state: usize, size: f64| {
        let mut column = DVector::zeros(states);
        column[state] = size / state_units(model)[state];
        Cause { name, column }
    };
    let pressure = states - 1;
    let phi = corner.phi[(pressure, pressure)];
    let acts_s = if phi < 1.0 { (phi - 1.0) / (Real::ln(phi) / sample_time_s) } else { sample_time_s };
    let valve = ValveErrors::of(vehicle);
    let rounding = ROUNDINGS * bounds.float32_rounding;
    let mut causes = vec![
        on("valve lag", pressure, acts_s * valve.lag_pa_s),
        on("valve gain", pressure, acts_s * valve.gain_pa_s),
        on("valve delay", pressure, acts_s * valve.delay_pa_s),
        on("float32 rounding", pressure, rounding * bounds.pressure_max_pa),
    ];
    if quantity == Quantity::ClutchTorque {
        // With another friction the same pressure is another torque: the valve model is off by that fraction.
        causes.push(on("friction", pressure, (1.0 - phi) * friction_pa(vehicle)));
    }
    if model == Model::Compliant {
        let output_rad_s = reading_rad_s(bounds.output_quantum_rad_s) / final_ratio(vehicle);
        let twist_rad_s = reading_rad_s(bounds.wheel_quantum_rad_s) + output_rad_s;
        let stiffness = vehicle.driveline.shaft_stiffness_n_m_rad;
        causes.push(on(READINGS, 0, stiffness * sample_time_s * twist_rad_s));
        causes.push(on("float32 rounding", 0, rounding * bounds.shaft_torque_n_m));
    }
    causes
}

fn final_ratio(vehicle: &Vehicle) -> f64 {
    vehicle.driveline.final_ratio
}
