//! Which shifts of a drive without true values are worth a look: the first of each kind, and those with the most to see.

use drivetrain::{Real, ShiftKind};
use observer::Health;

use crate::errors::controlling_of;
use crate::scored_shift::ScoredShift;
use crate::{ClutchRow, ShiftScoreRow, TruePhase};

/// Shifts that are chosen by each of the measures: with the first of each kind they are at most 60.
pub const BY_EACH: usize = 18;

/// Measures of how much there is to see in a shift: fraction of the samples whose health is not good, width of the torque's guaranteed range in
/// the mean of the inertia phase, N m, and distance of the estimated torque from the valve model's in both phases, N m (RMS). The torques are
/// those of the controlling clutch where it slips.
pub(crate) type Measures = [f64; 3];

/// The measures of a shift of this kind with these rows.
pub(crate) fn measures(rows: &[ShiftScoreRow], kind: Option<ShiftKind>) -> Measures {
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) =
            values.filter(|value| value.is_finite()).fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
        if count > 0 { sum / f64::from(count) } else { 0.0 }
    };
    // A delay of the commands and a quantity of the car are of all shifts.
    let of_all = [Health::Good, Health::BeyondBounds, Health::CommandsMistimed];
    let is_remarked = |row: &&ShiftScoreRow| !of_all.contains(&row.health);
    let remarked = rows.iter().filter(is_remarked).count() as f64 / rows.len().max(1) as f64;
    let at_turbine = rows.iter().filter(|row| row.phase() == Some(TruePhase::Inertia));
    let mut at_turbine = at_turbine.filter_map(|row| row.at_turbine_n_m.map(|[_, std_dev]| std_dev)).peekable();
    if at_turbine.peek().is_some() {
        return [remarked, mean(&mut at_turbine), 0.0];
    }
    let Some(kind) = kind else { return [remarked, 0.0, 0.0] };
    let which = controlling_of(rows, kind);
    let slips = |row: &&ShiftScoreRow| row.phase().is_some() && !row.clutches[which].sticks;
    let clutch = |row: &ShiftScoreRow| row.clutches[which];
    let width =
        |ClutchRow { torque_range_n_m, .. }: ClutchRow| torque_range_n_m.map_or(f64::NAN, |[low, high]| high - low);
    let in_inertia = rows.iter().filter(|row| row.phase() == Some(TruePhase::Inertia));
    let widths = &mut in_inertia.filter(slips).map(clutch).map(width);
    let squares =
        &mut rows.iter().filter(slips).map(clutch).map(|of| Real::powi(of.torque_n_m[1] - of.torque_n_m[2], 2));
    [remarked, mean(widths), mean(squares).sqrt()]
}

/// Those of these shifts, by their places and in their order, that are worth a look.
pub(crate) fn chosen(shifts: &[ScoredShift], places: &[usize]) -> Vec<usize> {
    let mut chosen: Vec<usize> = Vec::new();
    for &place in places {
        let kind = |place: usize| (shifts[place].is_garage, shifts[place].kind);
        if !chosen.iter().any(|other| kind(*other) == kind(place)) {
            chosen.push(place);
        }
    }
    for which in 0..3 {
        let measure = |place: usize| shifts[place].summary.measures[which];
        let mut ranked: Vec<usize> = places.iter().copied().filter(|place| measure(*place) > 0.0).collect();
        // Of equal ones the first.
        ranked.sort_by(|a, b| measure(*b).total_cmp(&measure(*a)));
        chosen.extend(ranked.into_iter().take(BY_EACH));
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}
