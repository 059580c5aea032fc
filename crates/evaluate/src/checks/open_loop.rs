//! Whether a log has the engine speed, which the filter needs in front of a converter.

use car::Car;

use super::check::{Check, CheckedRow};

/// Whether an engine speed is needed, and has come.
pub(crate) struct OpenLoop {
    is_needed: bool,
    has_come: bool,
}

impl OpenLoop {
    pub(super) fn new(car: &Car) -> Self {
        Self { is_needed: car.converter.is_some() && !car.gearbox.has_ratios_alone(), has_come: false }
    }

    /// Whether the estimates are those of the valve models alone.
    pub(crate) fn is_open_loop(&self) -> bool {
        self.is_needed && !self.has_come
    }
}

impl Check for OpenLoop {
    fn row(&mut self, row: &CheckedRow<'_>) {
        self.has_come |= row.step.input.engine_rad_s.is_some_and(|reading| reading.value.is_finite());
    }

    fn warnings(&self) -> Vec<String> {
        let said = "warning: there is no engine speed, which gives the turbine torque: pressures and torques are those of the valve models alone (open loop)\nhint: map `engine_speed`, or record it";
        self.is_open_loop().then(|| said.to_owned()).into_iter().collect()
    }
}
