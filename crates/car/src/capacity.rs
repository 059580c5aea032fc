//! What the closed elements of a car hold at line pressure, beside the most that its engine asks of them.
//!
//! The most that is asked of a gear \[chosen\] is the larger of two turbine torques: the maximum engine torque, as it comes with
//! the lock-up clutch closed or without a converter; and the maximum that the converter makes of full throttle at steady speeds,
//! with the turbine at any speed that it has in this gear. In the lowest forward gear and in reverse a car starts: there the turbine may be at
//! rest, where a converter multiplies most. In the other gears it turns at [`SLOWEST_TURBINE_RAD_S`] or faster, since a gearbox controller
//! shifts down before.
//!
//! Left out: the torque of an engine that a shift slows down, and torque limits, with which a gearbox controller can protect an
//! element. So an element that slips by this rule is a warning, not an error.

use geartrain::Capacity;

use crate::{Car, ShiftClutch};

/// Slowest turbine in gears in which a car does not start, rad/s \[chosen\]: a little above idle speed, and below the downshifts of
/// `drives/city.toml`.
const SLOWEST_TURBINE_RAD_S: f64 = 100.0;
/// Turbine speeds at which the maximum torque is sought, from the slowest to the end of the engine map.
const TURBINE_SPEEDS: u32 = 40;
impl Car {
    /// The maximum turbine torque in a gear, N m.
    pub fn max_turbine_torque(&self, gear: usize) -> f64 {
        let direct_n_m = self.engine.largest_torque();
        let Some(converter) = &self.converter else { return direct_n_m };
        let is_reverse = self.gearbox.gears.get(gear).is_some_and(|gear| gear.ratio < 0.0);
        let starts = is_reverse
            || self.gearbox.forward_gears().first().is_some_and(|&lowest| self.gearbox.is_same_ratio(lowest, gear));
        let slowest = if starts { 0.0 } else { SLOWEST_TURBINE_RAD_S };
        let fastest = self.engine.torque_n_m.rows().last().map_or(slowest, |last| last.max(slowest));
        let step = (fastest - slowest) / f64::from(TURBINE_SPEEDS);
        (0..=TURBINE_SPEEDS)
            .map(|n| converter.full_throttle_turbine_torque(&self.engine, slowest + step * f64::from(n)))
            .fold(direct_n_m, f64::max)
    }

    /// What each element with plates holds at line pressure, in the gear that asks most of it.
    pub fn capacities(&self) -> Vec<Capacity> {
        let gears = &self.gearbox.gears;
        let turbine_n_m: Vec<f64> = (0..gears.len()).map(|gear| self.max_turbine_torque(gear)).collect();
        let of = |(element, clutch): (usize, &Option<ShiftClutch>)| {
            let holds_n_m = clutch.as_ref()?.clutch.static_capacity(self.line_pressure_pa);
            Capacity::where_most_is_asked(element, holds_n_m, gears, |gear| turbine_n_m.get(gear).copied())
        };
        self.clutches.iter().enumerate().filter_map(of).collect()
    }

    /// Why the car cannot be driven through its gears, with what can be done with it, where only dogs change between them.
    pub fn why_not_driven(&self) -> Option<String> {
        self.gearbox.only_dogs_change().then(|| {
            "only dogs change between the gears of this gearbox: no clutch takes the load over from another, so its shifts cannot be simulated, and \
             the filter has tables for none of them\nhint: `wetclutch check` lists gears, holding torques and capacities, and `wetclutch estimate` \
             gives the torques in gear from a log; a dual clutch has one clutch for each of two neighbouring gears"
                .to_owned()
        })
    }

    /// Line pressure at which an element holds what is asked of it, Pa.
    pub fn holding_pressure(&self, capacity: &Capacity) -> f64 {
        let kiss_pa = self.clutches[capacity.element].as_ref().map_or(0.0, |clutch| clutch.clutch.kiss_pressure());
        kiss_pa + (self.line_pressure_pa - kiss_pa) / capacity.ratio()
    }
}
