//! How many shifts of which kind a log has, and how many of them a fit of one shift uses.

use drivetrain::ShiftKind;
use logs::{Direction, Load};

/// Shifts of a log by direction and load.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ShiftKinds {
    /// Power-on upshifts whose readings can be fitted, and those whose readings cannot.
    upshifts: [usize; 2],
    /// Upshifts of which no channel tells that they are power-off, among the above.
    unknown_load: usize,
    power_off_upshifts: usize,
    power_on_downshifts: usize,
    /// Power-off, and those of which no channel tells.
    coast_downshifts: usize,
    downshifts: usize,
}

impl ShiftKinds {
    /// Counts a shift, which `is_used` or not.
    pub(crate) fn count(&mut self, direction: Direction, load: Load, is_used: bool) {
        let place = match (direction, load) {
            (Direction::Up, Load::PowerOff) => &mut self.power_off_upshifts,
            (Direction::Up, _) => &mut self.upshifts[usize::from(!is_used)],
            (Direction::Down, Load::PowerOn) => &mut self.power_on_downshifts,
            (Direction::Down, Load::PowerOff) => &mut self.coast_downshifts,
            (Direction::Down, Load::Unknown) => &mut self.downshifts,
        };
        *place += 1;
        self.unknown_load += usize::from((direction, load) == (Direction::Up, Load::Unknown));
    }

    /// Adds those of another log.
    pub fn add(&mut self, more: Self) {
        let [used, unused] = &mut self.upshifts;
        let pairs = [
            (used, more.upshifts[0]),
            (unused, more.upshifts[1]),
            (&mut self.unknown_load, more.unknown_load),
            (&mut self.power_off_upshifts, more.power_off_upshifts),
            (&mut self.power_on_downshifts, more.power_on_downshifts),
            (&mut self.coast_downshifts, more.coast_downshifts),
            (&mut self.downshifts, more.downshifts),
        ];
        pairs.into_iter().for_each(|(sum, count)| *sum += count);
    }

    /// Which shifts the logs have, which of them are used, and why the others are not.
    pub fn statement(&self) -> String {
        let named = |some: &[(usize, &str)]| {
            let shifts = some.iter().filter(|(count, _)| *count > 0).map(|(count, name)| match count {
                1 => format!("1 {name}"),
                count => format!("{count} {name}s"),
            });
            shifts.collect::<Vec<_>>().join(", ")
        };
        let upshifts = named(&[(self.upshifts[0] + self.upshifts[1], ShiftKind::PowerOnUp.name())]);
        let mut text = match self.upshifts[0] + self.upshifts[1] {
            0 => format!("shifts used: none, because no {} was found", ShiftKind::PowerOnUp.name()),
            _ => format!("shifts used: {} of {upshifts}", self.upshifts[0]),
        };
        if self.unknown_load > 0 {
            text += &format!(" ({} of them by direction alone: no channel shows the load)", self.unknown_load);
        }
        let others = named(&[
            (self.power_off_upshifts, ShiftKind::PowerOffUp.name()),
            (self.power_on_downshifts, ShiftKind::PowerOnDown.name()),
            (self.coast_downshifts, ShiftKind::CoastDown.name()),
            (self.downshifts, "downshift of unknown load"),
        ]);
        if !others.is_empty() {
            text += &format!(
                ". Not used: {others}. The fit of one shift has the model of a power-on upshift: the offgoing clutch opens, and the oncoming one, \
                 whose values are fitted, drives the inertia phase. In those the other clutch does, or the converter is in overrun; a vehicle \
                 file with the whole gearbox fits all four kinds"
            );
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_statement_has_every_kind_that_there_is_and_no_other() {
        let mut kinds = ShiftKinds::default();
        assert_eq!(kinds.statement(), "shifts used: none, because no power-on upshift was found");
        for is_used in [true, true, false] {
            kinds.count(Direction::Up, Load::PowerOn, is_used);
        }
        assert_eq!(kinds.statement(), "shifts used: 2 of 3 power-on upshifts");
        let mut more = ShiftKinds::default();
        more.count(Direction::Down, Load::PowerOn, false);
        more.count(Direction::Down, Load::PowerOff, false);
        more.count(Direction::Down, Load::PowerOff, false);
        more.count(Direction::Up, Load::Unknown, true);
        kinds.add(more);
        let text = kinds.statement();
        let begin = "shifts used: 3 of 4 power-on upshifts (1 of them by direction alone: no channel shows the load). Not used: \
                     1 power-on downshift, 2 coast downshifts. The fit";
        assert!(text.starts_with(begin), "{text}");
    }
}
