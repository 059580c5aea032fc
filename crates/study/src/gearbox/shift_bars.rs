//! Bars for the comfort of shifts, by kind, and the shifts that are compared with them.
//!
//! The bars are what a calibrator of a series transmission would accept of the nominal car \[chosen\].

use car::Car;
use drivetrain::ShiftKind;
use evaluate::shift_comfort::{FeltSample, ShiftComfort};
use plant::car::{CarCalibration, CarError, CarModel, CarShift, CarShiftQuality, simulate_car_shift};

/// Sample time of the acceleration, s.
const SAMPLE_S: f64 = 0.005;
/// Throttle of upshifts and downshifts with power, 0 to 1.
const UP_THROTTLE: f64 = 0.3;
const DOWN_THROTTLE: f64 = 0.5;

/// The gearbox input turns at least so fast in the higher gear, rad/s: no engine is brought below its idle speed.
const SLOWEST_RAD_S: f64 = 150.0;

/// A shift as it went and as it felt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Felt {
    /// Its kind.
    pub kind: ShiftKind,
    /// Speeds and torques.
    pub quality: CarShiftQuality,
    /// The acceleration.
    pub comfort: ShiftComfort,
}

impl Felt {
    /// Its rating from 10 to 1, [`ShiftComfort::rating`]; `None` of a shift that was not completed.
    pub fn rating(&self) -> Option<f64> {
        self.comfort.rating(&self.quality)
    }
}

/// The largest or smallest value of a quantity that is accepted.
#[derive(Debug, Clone, Copy)]
pub struct Bar {
    /// The quantity with its unit.
    pub name: &'static str,
    /// Its value of a shift.
    pub value: fn(&Felt) -> f64,
    /// Range of accepted values.
    pub accepted: [f64; 2],
}

impl Bar {
    /// The bars of a kind.
    pub fn of(kind: ShiftKind) -> Vec<Self> {
        let up_to = |name, most: f64, value| Self { name, value, accepted: [f64::NEG_INFINITY, most] };
        let mut bars = match kind {
            ShiftKind::PowerOnUp => vec![
                up_to("hole", 0.35, |felt| felt.comfort.hole),
                up_to("hole, s", 0.25, |felt| felt.comfort.hole_s),
                up_to("shock, m/s2", 1.0, |felt| felt.comfort.after_shock_m_s2),
            ],
            ShiftKind::PowerOffUp => vec![
                up_to("excurs., m/s2", 0.5, excursion),
                up_to("sign changes", 1.0, |felt| felt.comfort.sign_changes as f64),
            ],
            ShiftKind::PowerOnDown => {
                vec![Self { accepted: [0.4, f64::INFINITY], ..up_to("traction", 0.0, |felt| felt.comfort.traction) }]
            }
            ShiftKind::CoastDown => vec![
                up_to("step, m/s2", 0.5, excursion),
                Self { accepted: [0.3, 0.8], ..up_to("inertia ph, s", 0.0, |felt| felt.comfort.inertia_phase_s) },
            ],
        };
        bars.extend([
            up_to("flare, rad/s", 3.0, |felt| felt.quality.flare_rad_s),
            up_to("past, rad/s", 5.0, |felt| felt.quality.past_synchronous_rad_s),
            up_to("time, s", 1.4, |felt| felt.quality.complete_s.unwrap_or(f64::INFINITY)),
        ]);
        bars
    }

    /// Whether a shift is within the bar. A gear that a one-way clutch takes over may have no inertia phase: it is not a number then.
    pub fn is_met(&self, felt: &Felt) -> bool {
        let value = (self.value)(felt);
        value.is_nan() || (self.accepted[0] <= value && value <= self.accepted[1])
    }
}

fn excursion(felt: &Felt) -> f64 {
    let [below, above] = felt.comfort.beyond_m_s2;
    below.max(above)
}

/// Throttle at which shifts of this kind are made here, 0 to 1.
pub fn throttle(kind: ShiftKind) -> f64 {
    match kind {
        ShiftKind::PowerOnUp => UP_THROTTLE,
        ShiftKind::PowerOnDown => DOWN_THROTTLE,
        ShiftKind::PowerOffUp | ShiftKind::CoastDown => 0.0,
    }
}

/// Makes a shift of this kind between two gears; `nominal` is the car of the controller's model.
///
/// # Errors
/// The shift is not one between two clutches, or the simulation fails.
pub fn drive(
    model: &CarModel,
    nominal: &Car,
    calibration: CarCalibration,
    kind: ShiftKind,
    [from, to]: [usize; 2],
) -> Result<Felt, CarError> {
    let ratios = [from, to].map(|gear| nominal.gearbox.gears[gear].ratio);
    let usual = CarShift::usual(nominal, from, to, throttle(kind));
    let higher_rad_s =
        ratios[0].min(ratios[1]) * usual.vehicle_m_s / nominal.road.wheel_radius_m * nominal.driveline.final_ratio;
    let vehicle_m_s = usual.vehicle_m_s * (SLOWEST_RAD_S / higher_rad_s).max(1.0);
    let shift = CarShift { vehicle_m_s, sample_time_s: SAMPLE_S, ..usual };
    let mut samples = Vec::new();
    let quality = simulate_car_shift(model, nominal, calibration, &shift, |sample| {
        let (turbine, output) = (sample.torques.turbine_rad_s, sample.torques.output_rad_s);
        let slips_rad_s = ratios.map(|ratio| turbine - ratio * output);
        samples.push(FeltSample { time_s: sample.time_s, acceleration_m_s2: sample.vehicle_m_s2, slips_rad_s });
    })?;
    let end_s = quality.complete_s.map_or(shift.duration_s, |complete_s| shift.request_s + complete_s);
    let comfort = ShiftComfort::of(&samples, [shift.request_s, end_s])
        .ok_or_else(|| CarError::Request("the shift has no acceleration before its request".to_owned()))?;
    Ok(Felt { kind, quality, comfort })
}
