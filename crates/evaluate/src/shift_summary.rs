//! What the rows of a shift say together: what is left of it where it is not drawn.

use drivetrain::ShiftKind;
use observer::Health;

use crate::errors::{ErrorsByPhase, MatrixCounts, controlling_of, counts, errors_by_phase};
use crate::worth_a_look::{Measures, measures};
use crate::{ClutchRow, SAMPLE_S, ShiftScoreRow, TruePhase};

/// Sums and means over the rows of a shift.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ShiftSummary {
    /// Whether the true pressures and torques are known.
    pub has_truth: bool,
    /// Counts over the rows.
    pub counts: MatrixCounts,
    /// Errors by phase of the controlling and the other clutch; none where the shift has no kind.
    pub errors: Option<ErrorsByPhase>,
    /// Rows with each health, in the order of [`Health::ALL`].
    pub healths: [u64; Health::ALL.len()],
    /// How long torque and inertia phase last, s.
    pub lengths_s: [f64; 2],
    /// Rows of both phases in which the controlling clutch slips, and those of them in which the speeds show nothing of its torque.
    pub hidden: [u64; 2],
    /// Mean estimate of the inertia phase, and of the ends of its range, by clutch: pressure, Pa.
    pub mean_pressure_pa: [Option<[f64; 3]>; 2],
    /// The same of the torque, N m.
    pub mean_torque_n_m: [Option<[f64; 3]>; 2],
    /// Rows of the clutches with a measured pressure, and those of them in which it lies within its guaranteed range; of a shift whose true
    /// torques are not known.
    pub pressures: [u64; 2],
    /// Friction work by clutch, and by the ends of the torque's range, J; the ends are not numbers where a row has no range.
    pub friction_work_j: [Option<[f64; 3]>; 2],
    /// Largest torque with which both clutches work against each other, at the turbine, N m, by the estimate.
    pub tie_up_n_m: f64,
    /// Of a gearbox by its ratios alone: mean torque of the clutches together at the turbine in the inertia phase, and of its standard
    /// deviation, N m.
    pub mean_at_turbine_n_m: Option<[f64; 2]>,
    /// How much there is to see in it.
    pub(crate) measures: Measures,
}

impl ShiftSummary {
    /// That of a shift of this kind with these rows.
    pub(crate) fn of(rows: &[ShiftScoreRow], kind: Option<ShiftKind>) -> Self {
        let errors = kind.map(|kind| errors_by_phase(rows, kind));
        let length_s = |phase: TruePhase| {
            spans_s(rows, phase).iter().fold(0.0, |length_s, [from_s, to_s]| length_s + (to_s - from_s))
        };
        let with = |health: Health| rows.iter().filter(|row| row.health == health).count() as u64;
        let has_truth = rows.iter().any(|row| row.clutches[0].torque_n_m[0].is_finite());
        Self {
            has_truth,
            pressures: if has_truth { [0; 2] } else { pressures(rows) },
            friction_work_j: [0, 1].map(|clutch| friction_work_j(rows, clutch)),
            tie_up_n_m: tie_up_n_m(rows),
            counts: counts(rows, &errors.unwrap_or_default()),
            errors,
            healths: Health::ALL.map(with),
            lengths_s: [TruePhase::Torque, TruePhase::Inertia].map(length_s),
            hidden: kind.map_or([0; 2], |kind| hidden(rows, controlling_of(rows, kind))),
            mean_pressure_pa: [0, 1]
                .map(|clutch| mean(rows, clutch, |clutch| (clutch.pressure_pa[1], clutch.pressure_range_pa))),
            mean_torque_n_m: [0, 1]
                .map(|clutch| mean(rows, clutch, |clutch| (clutch.torque_n_m[1], clutch.torque_range_n_m))),
            mean_at_turbine_n_m: mean_at_turbine(rows),
            measures: measures(rows, kind),
        }
    }

    /// Rows with this health.
    pub fn rows_with(&self, health: Health) -> u64 {
        Health::ALL.iter().zip(self.healths).find(|(it, _)| **it == health).map_or(0, |(_, rows)| rows)
    }

    /// Clutches of all rows, and those whose pressure and torque lie within their guaranteed ranges.
    pub fn clutches(&self) -> [u64; 2] {
        let all = self.counts.values / 2;
        [all, all - self.counts.outside]
    }
}

/// Begin and end of every piece of a phase, s.
pub(crate) fn spans_s(rows: &[ShiftScoreRow], phase: TruePhase) -> Vec<[f64; 2]> {
    // A row lasts until the next one; the last one, and one behind which rows are missing, as long as is usual.
    const MISSING: f64 = 2.5;
    let mut steps_s: Vec<f64> = rows.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
    steps_s.sort_by(f64::total_cmp);
    let usual_s = steps_s.get(steps_s.len() / 2).copied().filter(|step_s| step_s.is_finite()).unwrap_or(SAMPLE_S);
    let end_s = |at: usize| {
        let next = rows.get(at + 1).map(|next| next.time_s);
        next.filter(|next| *next <= rows[at].time_s + MISSING * usual_s).unwrap_or(rows[at].time_s + usual_s)
    };
    let mut spans: Vec<[f64; 2]> = Vec::new();
    for (at, row) in rows.iter().enumerate().filter(|(_, row)| row.phase() == Some(phase)) {
        match spans.last_mut().filter(|[_, to_s]| *to_s == row.time_s) {
            Some(span) => span[1] = end_s(at),
            None => spans.push([row.time_s, end_s(at)]),
        }
    }
    spans
}

/// Rows of both clutches with a measured pressure, and those of them in which it lies within its range.
fn pressures(rows: &[ShiftScoreRow]) -> [u64; 2] {
    let clutches = rows.iter().flat_map(|row| row.clutches);
    let measured = clutches.filter(|clutch| clutch.pressure_pa[0].is_finite());
    measured.fold([0; 2], |[all, inside], clutch| [all + 1, inside + u64::from(clutch.in_range)])
}

/// Torque of a clutch times its slip over the shift, with the estimated torque and with the ends of its range, J; none where its slip is not
/// known. While a speed does not come, the ends are those of any slip that it can have.
fn friction_work_j(rows: &[ShiftScoreRow], clutch: usize) -> Option<[f64; 3]> {
    let power_w = |row: &ShiftScoreRow| {
        let ClutchRow { torque_n_m: [_, torque, _], torque_range_n_m, slip_rad_s, slip_range_rad_s, sticks, .. } =
            row.clutches[clutch];
        if let Some(slips) = slip_range_rad_s {
            // It may slip by as much, or not at all.
            let [low, high] = torque_range_n_m.unwrap_or([torque; 2]);
            let most = low.abs().max(high.abs()) * slips[0].abs().max(slips[1].abs());
            let slip = if sticks || slip_rad_s.is_nan() { 0.0 } else { slip_rad_s };
            return (row.time_s, [(torque * slip).abs().min(most), 0.0, most]);
        }
        if sticks {
            return (row.time_s, [0.0; 3]);
        }
        // Friction takes power and gives none.
        let ends = torque_range_n_m.unwrap_or([f64::NAN; 2]).map(|n_m| n_m * slip_rad_s);
        let [low, high] = if ends[0] <= ends[1] { ends } else { [ends[1], ends[0]] };
        let at_least_zero = |power: f64| if power < 0.0 { 0.0 } else { power };
        (row.time_s, [torque * slip_rad_s, low, high].map(at_least_zero))
    };
    let shown = || rows.iter().filter(|row| row.at_turbine_n_m.is_none());
    let is_unread = |clutch: &ClutchRow| {
        let is_unknown = match clutch.slip_range_rad_s {
            Some(slips) => slips[0].is_nan(),
            None => !clutch.sticks && clutch.slip_rad_s.is_nan(),
        };
        is_unknown && clutch.torque_n_m[1].is_finite()
    };
    if shown().any(|row| is_unread(&row.clutches[clutch])) {
        return None;
    }
    let known: Vec<_> = shown().map(power_w).filter(|(_, [power, ..])| power.is_finite()).collect();
    let work = known.windows(2).fold([0.0; 3], |work, pair| {
        let ((from_s, from), (to_s, to)) = (pair[0], pair[1]);
        core::array::from_fn(|end| work[end] + 0.5 * (to_s - from_s) * (from[end] + to[end]))
    });
    (known.len() > 1).then_some(work)
}

/// Largest torque with which both clutches work against each other, at the turbine, N m.
fn tie_up_n_m(rows: &[ShiftScoreRow]) -> f64 {
    let against = rows.iter().map(|row| {
        let [off, on] = row.clutches.map(|clutch| clutch.alpha * clutch.torque_n_m[1]);
        if off * on < 0.0 { off.abs().min(on.abs()) } else { (off * on).abs() * 0.0 }
    });
    against.filter(|n_m| n_m.is_finite()).fold(f64::NAN, f64::max)
}

/// Rows of both phases in which a clutch slips, and those of them in which the speeds show nothing of its torque.
fn hidden(rows: &[ShiftScoreRow], clutch: usize) -> [u64; 2] {
    let shown = |row: &&ShiftScoreRow| row.at_turbine_n_m.is_none() && row.phase().is_some();
    let rows = rows.iter().filter(shown).map(|row| &row.clutches[clutch]);
    rows.filter(|clutch| !clutch.sticks)
        .fold([0; 2], |[all, hidden], clutch| [all + 1, hidden + u64::from(clutch.hidden)])
}

fn mean(rows: &[ShiftScoreRow], clutch: usize, of: impl Fn(&ClutchRow) -> (f64, Option<[f64; 2]>)) -> Option<[f64; 3]> {
    let (mut sum, mut count) = ([0.0; 3], 0_usize);
    let inertia = |row: &&ShiftScoreRow| row.at_turbine_n_m.is_none() && row.phase() == Some(TruePhase::Inertia);
    for row in rows.iter().filter(inertia) {
        let (value, range) = of(&row.clutches[clutch]);
        let [low, high] = range.unwrap_or([f64::NAN; 2]);
        [value, low, high].iter().zip(&mut sum).for_each(|(value, sum)| *sum += value);
        count += 1;
    }
    (count > 0).then(|| sum.map(|sum| sum / count as f64))
}

fn mean_at_turbine(rows: &[ShiftScoreRow]) -> Option<[f64; 2]> {
    let inertia = rows.iter().filter(|row| row.phase() == Some(TruePhase::Inertia));
    let torques: Vec<[f64; 2]> = inertia.filter_map(|row| row.at_turbine_n_m).collect();
    let mean = |which: usize| torques.iter().map(|torque| torque[which]).sum::<f64>() / torques.len() as f64;
    (!torques.is_empty()).then(|| [mean(0), mean(1)])
}
