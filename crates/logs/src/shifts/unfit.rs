//! Speeds that are in none of the given gears: a unit, a ratio or a channel is wrong.

use drivetrain::Real;

/// Ratios that are needed to say that most of them are in no gear \[chosen\], as for those that contradict a gear signal.
const ENOUGH: u64 = 100;
/// Width of the classes in which ratios are counted, of their natural logarithm: 1 %.
const CLASS: f64 = 0.01;
/// Classes on each side of a ratio of 1: to 3e-5 and 3e4.
const CLASSES: i32 = 1024;

/// The ratios of a drive, those in a gear and the others.
#[derive(Debug, Default)]
pub(super) struct Unfit {
    in_gear: u64,
    /// Whether a ratio stayed in a gear for long enough to count.
    pub(super) engaged: bool,
    /// How many of the others lie in each class; empty before the first.
    others: Vec<u64>,
}

impl Unfit {
    /// Takes a ratio.
    pub(super) fn push(&mut self, ratio: f64, is_in_gear: bool) {
        if is_in_gear {
            self.in_gear += 1;
            return;
        }
        if self.others.is_empty() {
            self.others.resize(2 * CLASSES.unsigned_abs() as usize + 1, 0);
        }
        let class = ((Real::ln(ratio) / CLASS).round() as i32).clamp(-CLASSES, CLASSES) + CLASSES;
        self.others[class.unsigned_abs() as usize] += 1;
    }

    /// The middle one of the ratios in no gear, to half a class, and how many there are.
    fn middle(&self) -> (f64, u64) {
        let all: u64 = self.others.iter().sum();
        let mut below = 0;
        let class = (-CLASSES..).zip(&self.others).find(|(_, count)| {
            below += **count;
            2 * below > all
        });
        (class.map_or(f64::NAN, |(class, _)| Real::exp(f64::from(class) * CLASS)), all)
    }

    /// Why the speeds cannot show the shifts between these gears, in a sentence with a hint.
    pub(super) fn reason(&self, ratios: &[f64], shaft: &str) -> Option<String> {
        let (first, last) = (ratios.first()?, ratios.last()?);
        let (middle, others) = self.middle();
        let all = self.in_gear + others;
        if all == 0 {
            return Some(format!(
                "the speeds show no shift: {shaft} and output never turn fast enough for a ratio at the same time\n\
                 hint: check their channels, units and signs, and whether both have readings at the same times"
            ));
        }
        if self.in_gear >= others {
            return (!self.engaged).then(|| {
                format!(
                    "the speeds show no shift: their ratio is in a gear {} times, and never for 0.1 s without a hole\n\
                     hint: check the unit of the time, and that the speeds are recorded at least every 0.05 s",
                    self.in_gear
                )
            });
        }
        let is_seldom = all >= ENOUGH || !self.engaged;
        is_seldom.then(|| {
            format!(
                "of {all} ratios of {shaft} and output speed {others} are in no gear, the middle one of them {middle:.3}; the gears have {first} \
                 to {last}\nhint: check the units of both speeds, the ratios (`gearbox.ratios` of the channel map, or --ratios), and \
                 `gearbox.output_rad_per_m`"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_ratio_outside_the_gears_is_told_to_one_percent() {
        let mut unfit = Unfit::default();
        for ratio in [1e-9, 0.26, 0.262, 0.264, 1e9] {
            unfit.push(ratio, false);
        }
        let (middle, count) = unfit.middle();
        assert!((middle / 0.262 - 1.0).abs() < 0.01 && count == 5, "{middle}");
    }

    #[test]
    fn ratios_in_a_gear_for_moments_are_named() {
        let mut unfit = Unfit::default();
        (0..9).for_each(|_| unfit.push(3.0, true));
        let reason = unfit.reason(&[3.0, 1.0], "turbine").unwrap();
        assert!(
            reason.contains("their ratio is in a gear 9 times, and never for 0.1 s without a hole\nhint: "),
            "{reason}"
        );
    }
}
