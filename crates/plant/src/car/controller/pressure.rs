//! A shift clutch as its controller sees it: from torque at the turbine to the command of its valve. A one-way clutch has none: it
//! is asked for nothing. A dog is put in or taken out.

use car::{FastFill, ShiftClutch};

use super::CarCalibration;
use crate::fast_fill::{FillPlan, StrokeModel};

/// One of the two clutches of a shift.
#[derive(Debug, Clone)]
pub(super) struct Controlled {
    /// Its place among the elements.
    pub(super) element: usize,
    /// `None` for a one-way clutch or a dog.
    clutch: Option<ShiftClutch>,
    is_dog: bool,
    /// Whether a one-way clutch that is held through the shift holds its gear too: it holds the turbine in one direction alone.
    is_one_sided: bool,
    /// Its slip per turbine speed.
    alpha: f64,
    /// Turbine speed over output speed while it sticks.
    pub(super) ratio: f64,
    /// Pressure that the nominal valve has, Pa.
    modelled_pa: f64,
    /// How it is filled, if its piston has a stroke.
    pub(super) fill: Option<FillPlan>,
}

impl Controlled {
    pub(super) fn new(element: usize, clutch: Option<ShiftClutch>, slip_row: [f64; 2], modelled_pa: f64) -> Self {
        let [alpha, per_output] = slip_row;
        Self {
            element,
            clutch,
            is_dog: false,
            is_one_sided: false,
            alpha,
            ratio: -per_output / alpha,
            modelled_pa,
            fill: None,
        }
    }

    /// The same where a one-way clutch holds its gear too, or not.
    pub(super) fn one_sided(self, is_one_sided: bool) -> Self {
        Self { is_one_sided, ..self }
    }

    /// The same of a dog, or not.
    pub(super) fn dog(self, is_dog: bool) -> Self {
        Self { is_dog, ..self }
    }

    /// Whether it is a dog.
    pub(super) fn is_dog(&self) -> bool {
        self.is_dog
    }

    /// Whether it holds by itself, in one direction.
    pub(super) fn is_one_way(&self) -> bool {
        self.clutch.is_none() && !self.is_dog
    }

    /// Whether a one-way clutch lets the turbine turn slower than in its gear, itself or beside it.
    pub(super) fn may_overrun(&self) -> bool {
        self.is_one_way() || self.is_one_sided
    }

    /// The same, filled from this state of its piston. The plates touch gently: a clutch that counts much at the turbine has
    /// less pressure at the end of its fill.
    pub(super) fn filled_from(mut self, state: Option<&StrokeModel>, calibration: &CarCalibration) -> Self {
        let c = calibration;
        let gentle_pa = self.pressure_for(c.filled_n_m, 0.0) - self.kiss_pa();
        let stroke_over_kiss_pa = c.fast_fill.stroke_over_kiss_pa.min(gentle_pa);
        let fast_fill = FastFill { stroke_over_kiss_pa, ..c.fast_fill };
        let plan = |(clutch, state)| FillPlan::from_state(clutch, fast_fill, c.control_period_s, state);
        self.fill = self.clutch.as_ref().zip(state).map(plan);
        self
    }

    /// Its slip at the turbine, rad/s.
    pub(super) fn slip_at_turbine(&self, turbine_rad_s: f64, output_rad_s: f64) -> f64 {
        turbine_rad_s - self.ratio * output_rad_s
    }

    pub(super) fn kiss_pa(&self) -> f64 {
        self.clutch.as_ref().map_or(0.0, |clutch| clutch.clutch.kiss_pressure())
    }

    /// Pressure at which it carries this torque at the turbine, Pa.
    pub(super) fn pressure_for(&self, turbine_n_m: f64, slip_at_turbine_rad_s: f64) -> f64 {
        self.clutch.as_ref().map_or(0.0, |clutch| {
            clutch.clutch.pressure_for(turbine_n_m / self.alpha, self.alpha * slip_at_turbine_rad_s)
        })
    }

    /// Pressure at which the command must settle for the pressure to follow `wanted_pa`, Pa. The valve's lag is compensated by
    /// its nominal model, its delay is not. It is at least `min_pa`.
    pub(super) fn lead(&mut self, calibration: &CarCalibration, wanted_pa: f64, line_pa: f64, min_pa: f64) -> f64 {
        let (c, Some(clutch)) = (calibration, &self.clutch) else { return 0.0 };
        let to_go = wanted_pa - self.modelled_pa;
        let lag_s = clutch.valve.lag(self.modelled_pa, to_go / c.pressure_follow_s);
        let ahead = (lag_s / c.pressure_follow_s - 1.0).max(0.0) * to_go;
        let settled = wanted_pa + ahead.clamp(-c.pressure_lead_pa, c.pressure_lead_pa);
        self.without_lead(calibration, settled.max(min_pa), line_pa)
    }

    /// The pressure at which its command is to settle, Pa, within what the valve can give; the model follows.
    pub(super) fn without_lead(&mut self, calibration: &CarCalibration, settled_pa: f64, line_pa: f64) -> f64 {
        let Some(clutch) = &self.clutch else { return 0.0 };
        let settled = settled_pa.clamp(0.0, line_pa);
        let step = clutch.valve.step(settled, self.modelled_pa, calibration.control_period_s);
        self.modelled_pa = step.phi * self.modelled_pa + step.drift_pa;
        settled
    }

    /// Command at which its valve settles at this pressure, A or %; zero without a valve.
    pub(super) fn valve_command(&self, pressure_pa: f64) -> f64 {
        self.clutch.as_ref().map_or(0.0, |clutch| clutch.valve.command_for(pressure_pa))
    }
}
