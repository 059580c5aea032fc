//! Ratios of the speeds that contradict the gear signal: the given ratios are those of another gearbox, or of other gears.

use std::collections::VecDeque;

/// The speeds count when the gear signal has been the same for so long, s \[chosen\]: a signal may change when the shift begins.
const STEADY_S: f64 = 1.0;
/// And when it stays the same for so long, s \[chosen\]: or a signal may change when the shift has ended.
const STAYS_S: f64 = 2.0;
/// A ratio is that of a gear within this fraction \[chosen\]: tyres are known to 3 %, and gears are further apart than twice as much.
const FITS: f64 = 0.05;
/// Points of a gear that are needed to judge \[chosen\]; more than half of them have to contradict.
const ENOUGH: usize = 100;
/// Points of a gear that are kept.
const MAXIMUM: usize = 20_000;

/// The ratios that were seen in each gear of the signal.
#[derive(Debug, Default)]
pub(super) struct SeenRatios {
    /// The gear and since when, s.
    gear: Option<(u32, f64)>,
    newest_s: f64,
    /// Times, s, and ratios for which the gear has not stayed the same long enough yet.
    waiting: VecDeque<(f64, f64)>,
    /// Of the first gear, the second, ...
    ratios: Vec<Vec<f64>>,
}

impl SeenRatios {
    /// The gear signal has this value.
    pub(super) fn gear(&mut self, time_s: f64, gear: Option<u32>) {
        if self.gear.map(|(gear, _)| gear) != gear {
            self.gear = gear.map(|gear| (gear, time_s));
            self.waiting.clear();
        }
    }

    /// Whether the gear signal has said a gear: without one no ratio contradicts it.
    pub(super) fn has_gear(&self) -> bool {
        self.gear.is_some()
    }

    /// Takes the newest ratio of the speeds; one that was taken already does not count again.
    pub(super) fn ratio(&mut self, time_s: f64, ratio: f64) {
        // Numbers of gears are small: `gear_number` lets no others through.
        let Some((gear, since_s)) = self.gear.filter(|_| time_s != self.newest_s) else { return };
        self.newest_s = time_s;
        if time_s - since_s >= STEADY_S {
            self.waiting.push_back((time_s, ratio));
        }
        let place = usize::try_from(gear).unwrap_or(usize::MAX).wrapping_sub(1);
        while let Some(&(_, ratio)) = self.waiting.front().filter(|(then_s, _)| *then_s < time_s - STAYS_S) {
            self.waiting.pop_front();
            if self.ratios.len() <= place {
                self.ratios.resize(place + 1, Vec::new());
            }
            if self.ratios[place].len() < MAXIMUM {
                self.ratios[place].push(ratio);
            }
        }
    }

    /// The gears whose given ratio is not that of the speeds, in a sentence.
    pub(super) fn contradiction(&self, given: &[f64]) -> Option<String> {
        let wrong = self.ratios.iter().zip(given).enumerate().filter_map(|(place, (seen, given))| {
            let unfit = seen.iter().filter(|ratio| (*ratio / given - 1.0).abs() > FITS).count();
            if seen.len() < ENOUGH || 2 * unfit <= seen.len() {
                return None;
            }
            let mut sorted = seen.clone();
            sorted.sort_by(f64::total_cmp);
            Some(format!(
                "in gear {} the speeds have {:.3} and {given:.3} is given",
                place + 1,
                sorted[sorted.len() / 2]
            ))
        });
        let wrong: Vec<String> = wrong.collect();
        (!wrong.is_empty()).then(|| {
            format!(
                "the gear signal contradicts the ratios of the gears: {}\nhint: check the ratios (`gearbox.ratios` of the channel map, or \
                 --ratios), `gearbox.output_rad_per_m`, and scale and offset of the gear",
                wrong.join(", ")
            )
        })
    }
}
