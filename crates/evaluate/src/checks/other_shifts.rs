//! Shifts whose gear signals cannot be theirs.

use drivetrain::ShiftKind;
use plant::car::CarShiftQuality;

use super::check::{Check, EndedShift};

/// How far below the speeds of both gears the turbine has those of another shift, rad/s \[chosen\]: a flare is above them.
const OTHER_SHIFT_RAD_S: f64 = 30.0;
/// Shifts that last longer have other gear signals than theirs, s \[chosen\].
const LONGEST_S: f64 = 10.0;
/// Shifts that are named.
const NAMED: usize = 10;

/// Whether the gear signals can be those of a shift by its length, s, and the speeds of the turbine.
pub(crate) fn is_of_its_gears(kind: Option<ShiftKind>, quality: &CarShiftQuality, length_s: f64) -> bool {
    let below_rad_s = match kind {
        Some(ShiftKind::PowerOnUp | ShiftKind::PowerOffUp) => quality.past_synchronous_rad_s,
        Some(ShiftKind::PowerOnDown | ShiftKind::CoastDown) => quality.flare_rad_s,
        None => 0.0,
    };
    length_s <= LONGEST_S && (below_rad_s.is_nan() || below_rad_s <= OTHER_SHIFT_RAD_S)
}

/// The first shifts with other gear signals than theirs, and how many there are.
#[derive(Default)]
pub(crate) struct OtherShifts {
    first: Vec<String>,
    count: usize,
}

impl Check for OtherShifts {
    fn end(&mut self, EndedShift { shift, .. }: &EndedShift<'_>) {
        let [begin_s, end_s] = shift.time_s;
        let is_theirs = is_of_its_gears(shift.kind, &shift.quality, end_s - begin_s);
        if shift.is_garage || !shift.is_estimated() || is_theirs {
            return;
        }
        self.count += 1;
        if self.first.len() < NAMED {
            self.first.push(shift.number.to_string());
        }
    }

    fn warnings(&self) -> Vec<String> {
        let more = if self.count > NAMED { ", ..." } else { "" };
        let warning = (self.count > 0).then(|| {
            format!(
                "warning: {} of the shifts take longer than {LONGEST_S:.0} s, or the turbine is {OTHER_SHIFT_RAD_S:.0} rad/s and more below the speeds of both gears (number {}{more}): \
                 the values of these shifts in the table may be wrong, and it gives no friction work of them\nhint: check `gear` and `target_gear` there: they may \
                 be missing, late or wrong; else neither clutch held the turbine",
                self.count,
                self.first.join(", ")
            )
        });
        warning.into_iter().collect()
    }
}
