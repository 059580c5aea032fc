//! Torques at the turbine in a shift, as far as speeds, engine torque and ratios tell them.
//!
//! With `U = alpha T` of a clutch, its torque as felt at the turbine, and the inertia `M11` of the gearbox's input side:
//!
//! ```text
//! U_off + U_on = T_t - M11 dw_t/dt            friction work of a clutch = integral U (w_t - i w_o) dt
//! ```
//!
//! In the inertia phase of a power-on upshift the offgoing clutch is open and the sum is the oncoming one's. `alpha` of the gearbox is not needed for
//! the work. The torque ratio of the converter and `M11` are not known here: they lie in ranges, which make the ranges of the results.

use car::TURBINE_SIDE_INERTIA_KG_M2;
use logs::{Direction, Load, Shift};

use super::converter::ConverterFit;
use super::record::{DriveRecord, Moment};

/// Torque ratio of the converter at stall, at most \[chosen: passenger cars have 1.8 to 2.2\].
const STALL_RATIO_MAX: f64 = 2.2;
/// Speed ratio from which on it is 1, at most.
const COUPLING: f64 = 0.9;
/// Time before and after a shift that is shown, s.
const BEFORE_S: f64 = 0.6;
const AFTER_S: f64 = 0.9;

/// Torques at one time, N m: minimum, middle and maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurbineTorque {
    /// Time, s.
    pub time_s: f64,
    /// Of the turbine.
    pub turbine_n_m: [f64; 3],
    /// The sum of the shift's clutches, at the turbine.
    pub clutches_n_m: [f64; 3],
}

/// Torques of a shift.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftTorque {
    /// Shown before and after the shift too.
    pub window_s: [f64; 2],
    /// The torques, where they are known.
    pub torques: Vec<TurbineTorque>,
    /// Mean of the clutches' torque in the inertia phase, N m: minimum, middle, maximum.
    pub mean_n_m: Option<[f64; 3]>,
    /// Friction work of the clutch that controls the inertia phase, J: minimum, middle, maximum.
    pub work_j: Option<[f64; 3]>,
    /// Lowest engine torque that the gearbox asked for, N m at the flywheel, and for how long it asked, s.
    pub reduction: Option<[f64; 2]>,
    /// Mean size of the difference of engine torque and request while it was asked for, N m.
    pub reduction_error_n_m: Option<f64>,
    /// Fraction of the inertia phase without slip of the converter, 0 to 1.
    pub no_slip_fraction: f64,
}

/// Minimum, middle and maximum of some values.
fn three(values: impl IntoIterator<Item = f64>) -> [f64; 3] {
    let (minimum, maximum) =
        values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    [minimum, 0.5 * (minimum + maximum), maximum]
}

impl ConverterFit {
    /// Torques at a moment; none where they are not known.
    pub fn torques(&self, record: &DriveRecord, moment: &Moment) -> Option<TurbineTorque> {
        let turbine_n_m = match self.by_converter(moment) {
            Some([pump_n_m, sd_n_m]) => {
                let maximum = 1.0 + (STALL_RATIO_MAX - 1.0) * (1.0 - moment.speed_ratio() / COUPLING).max(0.0);
                let pumps = [pump_n_m - 2.0 * sd_n_m, pump_n_m + 2.0 * sd_n_m];
                three(pumps.into_iter().flat_map(|pump_n_m| [pump_n_m, maximum * pump_n_m]))
            }
            None if moment.no_slip || moment.speed_ratio() > super::converter::COUPLED => {
                let by_engine = self.by_engine(record, moment);
                three([by_engine - self.scale_n_m, by_engine + self.scale_n_m])
            }
            None => return None,
        };
        let inertial = TURBINE_SIDE_INERTIA_KG_M2.map(|inertia| inertia * moment.turbine_rad_s2);
        let ends = inertial.into_iter().flat_map(|inertial| turbine_n_m.map(|turbine| turbine - inertial));
        Some(TurbineTorque { time_s: moment.time_s, turbine_n_m, clutches_n_m: three(ends) })
    }

    /// Torques of a shift between gears of these ratios, 1st first.
    pub fn shift(&self, record: &DriveRecord, moments: &[Moment], shift: &Shift, ratios: &[f64]) -> ShiftTorque {
        let window_s = [shift.start_s() - BEFORE_S, shift.end_s().max(shift.gear_s.unwrap_or(f64::NAN)) + AFTER_S];
        let within = |[from_s, to_s]: [f64; 2]| {
            let first = moments.partition_point(|moment| moment.time_s < from_s);
            moments[first..].iter().take_while(move |moment| moment.time_s <= to_s)
        };
        let torques = within(window_s).filter_map(|moment| self.torques(record, moment)).collect();
        let mut found = ShiftTorque {
            window_s,
            torques,
            mean_n_m: None,
            work_j: None,
            reduction: None,
            reduction_error_n_m: None,
            no_slip_fraction: 0.0,
        };
        if let Some(inertia_s) = shift.inertia_s {
            let moments: Vec<&Moment> = within(inertia_s).collect();
            let count = moments.len() as f64;
            let known: Vec<_> = moments.iter().filter_map(|m| Some((**m, self.torques(record, m)?))).collect();
            // With holes a mean would be that of the rest.
            if known.len() == moments.len() && count >= 3.0 {
                let mean = |end: usize| known.iter().map(|(_, torque)| torque.clutches_n_m[end]).sum::<f64>() / count;
                found.mean_n_m = Some([0, 1, 2].map(mean));
                found.work_j = controlling(shift).and_then(|gear| {
                    let ratio = *ratios.get(usize::try_from(gear).ok()?.checked_sub(1)?)?;
                    let slip = |m: &Moment| m.turbine_rad_s - ratio * record.output.at(m.time_s);
                    let work = |end: usize| {
                        let power = known.iter().map(|(m, torque)| torque.clutches_n_m[end] * slip(m));
                        power.sum::<f64>() * (inertia_s[1] - inertia_s[0]) / count
                    };
                    let work = [work(0), work(1), work(2)];
                    (!record.output.is_empty()).then(|| three(work))
                });
                found.no_slip_fraction = known.iter().map(|(m, _)| f64::from(u8::from(m.no_slip))).sum::<f64>() / count;
            }
        }
        found.reduction(record);
        found
    }
}

/// The gear whose clutch controls the inertia phase; none where the load is not known.
fn controlling(shift: &Shift) -> Option<u32> {
    match (shift.load, shift.direction) {
        (Load::PowerOn, Direction::Up) | (Load::PowerOff, Direction::Down) => Some(shift.to),
        (Load::PowerOff, Direction::Up) | (Load::PowerOn, Direction::Down) => Some(shift.from),
        (Load::Unknown, _) => None,
    }
}

impl ShiftTorque {
    /// What the gearbox asked of the engine.
    fn reduction(&mut self, record: &DriveRecord) {
        let asked: Vec<(f64, f64)> = record.torque_request.between(self.window_s).collect();
        let (Some(first), Some(last)) = (asked.first(), asked.last()) else { return };
        let net = |(time_s, asked): (f64, f64)| asked - record.friction_torque.at(time_s);
        let minimum = asked.iter().map(|point| net(*point)).fold(f64::INFINITY, f64::min);
        self.reduction = Some([minimum, last.0 - first.0]);
        let count = asked.len() as f64;
        let error = |point: &(f64, f64)| (record.engine_torque.at(point.0) - net(*point)).abs();
        self.reduction_error_n_m = Some(asked.iter().map(error).sum::<f64>() / count);
    }
}
