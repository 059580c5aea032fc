//! A row of a log, measured or simulated.

use observer::gearbox::{MAX_ELEMENTS, ShiftInput};
use observer::{Reading, ShiftTables};

/// A row of a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogStep {
    /// Time, s.
    pub time_s: f64,
    /// What the filter is shown.
    pub input: ShiftInput<f64>,
    /// Throttle and brake, 0 to 1; not a number where the log has none.
    pub pedals: [f64; 2],
    /// Vehicle speed, m/s; by the wheels where the log has none.
    pub vehicle_m_s: f64,
    /// Temperature of the oil in the gearbox, degC, where there is a reading of it.
    pub oil_degc: Option<f64>,
    /// Engine torque as the engine's controller reports it, N m, also where the filter is not shown it.
    pub reported_n_m: Option<Reading<f64>>,
    /// Speed of the car, m/s, where this row has a reading of it.
    pub speed_m_s: Option<Reading<f64>>,
    /// Measured pressures of elements, Pa, by their places in the filter's tables.
    pub pressures: [Option<Reading<f64>>; MAX_ELEMENTS],
    /// Pressure, Pa, torque, N m, and slip, rad/s, of offgoing and oncoming clutch; not a number where the log has none.
    pub truth: [[f64; 3]; 2],
}

impl LogStep {
    /// A row with nothing beside what the filter is shown.
    pub fn of(time_s: f64, input: ShiftInput<f64>) -> Self {
        Self {
            time_s,
            input,
            pedals: [f64::NAN; 2],
            vehicle_m_s: f64::NAN,
            oil_degc: None,
            reported_n_m: None,
            speed_m_s: None,
            pressures: [None; MAX_ELEMENTS],
            truth: [[f64::NAN; 3]; 2],
        }
    }

    /// Measured pressures of the offgoing and the oncoming clutch of the shift that is under way, Pa, where this row has readings of them.
    pub fn shift_pressures(&self, tables: &ShiftTables<f64>) -> [Option<Reading<f64>>; 2] {
        let clutches = tables.tables().commanded(self.input.gear).map(|row| row.clutches);
        [0, 1].map(|c| {
            let of_shift = self.truth[c][0];
            if of_shift.is_finite() {
                return Some(Reading { value: of_shift, age_s: 0.0 });
            }
            *self.pressures.get(clutches?[c].element.place()?)?
        })
    }
}
