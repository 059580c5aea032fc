//! One shift of a car.

use car::{Car, ShiftCommand};
use drivetrain::PeakJerk;
use geartrain::Change;

use super::controller::{CarCalibration, ShiftStage};
use super::integrate::CarError;
use super::model::CarModel;
use super::run::{CarRun, Driver};
use super::sample::CarSample;

/// A shift to be simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarShift {
    /// The gear before.
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// Throttle throughout, 0 to 1; zero for a shift without power.
    pub throttle: f64,
    /// Vehicle speed at the start, m/s.
    pub vehicle_m_s: f64,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
    /// Time of the request, s: until then the car settles in the old gear.
    pub request_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Sample time, s.
    pub sample_time_s: f64,
}

impl CarShift {
    /// A shift from one gear to another at this throttle, with one second before its request and three after it, at the vehicle
    /// speed at which the gearbox input turns at 230 rad/s in the lower of the two gears.
    pub fn usual(car: &Car, from: usize, to: usize, throttle: f64) -> Self {
        const INPUT_RAD_S: f64 = 230.0;
        let ratio = |gear: usize| car.gearbox.gears.get(gear).map_or(1.0, |gear| gear.ratio.abs());
        let output = INPUT_RAD_S / ratio(from).max(ratio(to));
        let vehicle_m_s = output / car.driveline.final_ratio * car.road.wheel_radius_m;
        let (request_s, duration_s, sample_time_s) = (1.0, 4.0, 0.01);
        Self { from, to, throttle, vehicle_m_s, grade_rad: 0.0, request_s, duration_s, sample_time_s }
    }
}

/// How a shift went. Slips and torques are at the turbine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CarShiftQuality {
    /// Time from the request until the oncoming clutch sticks and the controller is done, s; `None` if it was not completed.
    pub complete_s: Option<f64>,
    /// Largest slip of the old gear in the wrong direction, rad/s; zero where a one-way clutch is to catch the turbine, which may
    /// fall before.
    pub flare_rad_s: f64,
    /// Largest slip beyond the new gear, rad/s.
    pub past_synchronous_rad_s: f64,
    /// Largest torque with which both clutches work against each other, N m.
    pub tie_up_n_m: f64,
    /// Largest slip of a clutch that is held through the shift, rad/s.
    pub held_slip_rad_s: f64,
    /// Jerk of the car, m/s^3, as [`drivetrain::jerk`] defines it.
    pub jerk_m_s3: f64,
    /// Turbine torque at the request, N m.
    pub turbine_n_m: f64,
}

/// Simulates one shift of a car and shows every sample to `record`. `nominal` is the car of the controller's model.
///
/// # Errors
/// The shift is not one between two clutches, the car cannot run in this gear at this speed, or the simulation fails.
pub fn simulate_car_shift(
    model: &CarModel,
    nominal: &Car,
    calibration: CarCalibration,
    shift: &CarShift,
    mut record: impl FnMut(&CarSample),
) -> Result<CarShiftQuality, CarError> {
    let driver = Driver { throttle: shift.throttle, brake: 0.0, grade_rad: shift.grade_rad };
    let state = model.in_gear(shift.from, Some(shift.to), shift.vehicle_m_s, shift.throttle)?;
    let mut run = CarRun::new(model, nominal, calibration, shift.from, state, (driver, shift.sample_time_s))?;
    run.preselect(Some(shift.to));
    let mut rating = CarShiftRating::new(model, ShiftCommand::between(shift.from, shift.to), shift.request_s);
    let mut requested = false;
    while run.time_s() < shift.duration_s - 1e-9 {
        if !requested && run.time_s() >= shift.request_s - 1e-9 {
            run.request(shift.to)?;
            requested = true;
        }
        run.advance(
            driver,
            |_| {},
            |sample| {
                rating.push(sample);
                record(sample);
            },
        )?;
    }
    Ok(rating.quality())
}

/// How far the turbine leaves the speeds between those of two gears.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeyondGears {
    /// Of the gear before and after.
    ratios: [f64; 2],
    /// Whether a one-way clutch is to catch the turbine. It may fall before, and cannot go beyond.
    catches: bool,
    /// Whether a one-way clutch that is held lets the turbine turn slower than in the gear before and after.
    is_one_sided: [bool; 2],
    /// Whether the turbine has been on the side of the old gear. Behind a one-way clutch that overruns it may begin on the other.
    was_before: bool,
}

impl BeyondGears {
    /// Between the gears of a shift with these ratios.
    pub fn new(car: &Car, shift: ShiftCommand, ratios: [f64; 2]) -> Self {
        let single = car.single_shift(shift);
        let [overruns, catches] = single.map_or([false; 2], |elements| elements.map(|at| car.gearbox.is_one_way(at)));
        let found = shift.from.place().zip(shift.to.place()).and_then(|(from, to)| car.gearbox.shift(from, to));
        let is_one_sided = single
            .zip(found)
            .map_or([false; 2], |(elements, shift)| elements.map(|element| shift.is_one_sided(&car.gearbox, element)));
        Self { ratios, catches, is_one_sided, was_before: !(overruns || is_one_sided[0]) }
    }

    /// Takes the speeds of turbine and output, rad/s.
    pub fn push(&mut self, quality: &mut CarShiftQuality, [turbine, output]: [f64; 2]) {
        if self.catches {
            return;
        }
        let direction = (self.ratios[0] - self.ratios[1]).signum();
        let slip = |gear: usize| {
            let slip = turbine - self.ratios[gear] * output;
            direction * if self.is_one_sided[gear] { slip.max(0.0) } else { slip }
        };
        let [old, new] = [slip(0), slip(1)];
        quality.flare_rad_s = quality.flare_rad_s.max(old);
        self.was_before |= new > 0.0;
        if self.was_before {
            quality.past_synchronous_rad_s = quality.past_synchronous_rad_s.max(-new);
        }
    }
}

/// A shift is rated until this time after its end, s.
const RATED_AFTER_S: f64 = 0.5;

/// Rates a shift sample by sample.
#[derive(Debug, Clone)]
pub struct CarShiftRating {
    shift: ShiftCommand,
    request_s: f64,
    beyond: BeyondGears,
    alphas: [f64; 2],
    held: Vec<usize>,
    quality: CarShiftQuality,
    jerk: PeakJerk,
    was_requested: bool,
}

impl CarShiftRating {
    /// Of a shift between these gears that is requested at this time, s.
    pub fn new(model: &CarModel, shift: ShiftCommand, request_s: f64) -> Self {
        let gearbox = &model.car.gearbox;
        let found = shift.from.place().zip(shift.to.place()).and_then(|(from, to)| gearbox.shift(from, to));
        let (ratios, alphas) = found.and_then(|shift| shift.reduced).map_or(([1.0; 2], [1.0; 2]), |r| {
            ([r.ratio_offgoing(), r.ratio_oncoming()], [r.slip_offgoing[0], r.slip_oncoming[0]])
        });
        let held = match found.map(|shift| &shift.change) {
            // A one-way clutch overruns.
            Some(Change::Single { held, .. }) => held.iter().copied().filter(|&at| !gearbox.is_one_way(at)).collect(),
            _ => Vec::new(),
        };
        Self {
            shift,
            request_s,
            beyond: BeyondGears::new(&model.car, shift, ratios),
            alphas,
            held,
            quality: CarShiftQuality::default(),
            jerk: PeakJerk::default(),
            was_requested: false,
        }
    }

    /// So far.
    pub fn quality(&self) -> CarShiftQuality {
        self.quality
    }

    /// Takes the next sample.
    pub fn push(&mut self, sample: &CarSample) {
        let q = &mut self.quality;
        let after = sample.time_s >= self.request_s - 1e-9;
        let since_complete_s = q.complete_s.map_or(0.0, |complete_s| sample.time_s - self.request_s - complete_s);
        if since_complete_s > RATED_AFTER_S {
            return;
        }
        if !after {
            return;
        }
        self.jerk.acceleration(sample.time_s, sample.vehicle_m_s2);
        q.jerk_m_s3 = self.jerk.peak_m_s3().unwrap_or(0.0);
        if !self.was_requested {
            q.turbine_n_m = sample.turbine_n_m;
            self.was_requested = true;
        }
        self.beyond.push(q, [sample.torques.turbine_rad_s, sample.torques.output_rad_s]);
        let Some(shift) = &sample.shift else {
            if sample.gears() == (ShiftCommand { from: self.shift.to, ..self.shift }) {
                q.complete_s.get_or_insert(sample.time_s - self.request_s);
            }
            return;
        };
        for &element in &self.held {
            q.held_slip_rad_s = q.held_slip_rad_s.max(sample.slips_rad_s[element].abs());
        }
        let [off, on] = [self.alphas[0] * shift.offgoing.torque_n_m, self.alphas[1] * shift.oncoming.torque_n_m];
        if off * on < 0.0 && shift.stage != ShiftStage::Done {
            q.tie_up_n_m = q.tie_up_n_m.max(off.abs().min(on.abs()));
        }
    }
}
