//! Which of any number of clutches stick, and in which direction the others slip.
//!
//! At an instant, let some clutches have no slip. With their torques `T`, the accelerations of their slips are `b - W T`:
//! `b` is what the other torques cause, `W = K M^-1 K'`. A clutch sticks if a torque within its capacity keeps its slip at
//! zero; otherwise its torque is at the capacity and its slip grows in the direction of the torque. These are the conditions of
//!
//! ```text
//! min 1/2 T' W T - b' T    subject to    lower <= T <= upper,
//! ```
//!
//! which always has a solution, and its accelerations are unique. A one-way clutch has `lower = 0`. Clutches that hold each
//! other (a tie-up) make `W` singular: then only their accelerations are unique, and of the torques the smallest are taken.

use crate::{Contact, Direction};

/// Most clutches without slip at one instant.
pub const MAX_CONTACTS: usize = 8;

/// Fraction of its largest diagonal element that is added to `W`: with it the programme is strictly convex, and of all
/// torques with the same accelerations the smallest are found.
const REGULARISATION: f64 = 1e-10;

/// Torques and accelerations beyond their limits by less than this fraction are within.
const TOLERANCE: f64 = 1e-9;

/// Clutches without slip.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactProblem {
    /// Number of clutches; further entries have no meaning.
    count: usize,
    /// `W`, rad/s^2 per N m.
    compliance: [[f64; MAX_CONTACTS]; MAX_CONTACTS],
    /// `b`, rad/s^2.
    free_rad_s2: [f64; MAX_CONTACTS],
    /// Limits of the torques, N m.
    limits_n_m: [(f64, f64); MAX_CONTACTS],
}

/// What the clutches do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactSolution {
    /// Whether each clutch sticks.
    pub contacts: [Contact; MAX_CONTACTS],
    /// Torque of each clutch, N m.
    pub torques_n_m: [f64; MAX_CONTACTS],
    /// Acceleration of the slip of each clutch, rad/s^2.
    pub slips_rad_s2: [f64; MAX_CONTACTS],
    /// Changes of contact on the way to the solution.
    pub changes: usize,
}

impl ContactProblem {
    /// Without clutches.
    pub fn new() -> Self {
        Self {
            count: 0,
            compliance: [[0.0; MAX_CONTACTS]; MAX_CONTACTS],
            free_rad_s2: [0.0; MAX_CONTACTS],
            limits_n_m: [(0.0, 0.0); MAX_CONTACTS],
        }
    }

    /// Adds a clutch whose slip has the acceleration `free_rad_s2` without the torques of the others, with its row of `W`
    /// up to itself. `false` if there are [`MAX_CONTACTS`] already, or if a number is not finite.
    #[must_use]
    pub fn add(&mut self, free_rad_s2: f64, compliance: &[f64], (lower_n_m, upper_n_m): (f64, f64)) -> bool {
        let at = self.count;
        let finite = compliance.iter().chain([&free_rad_s2, &lower_n_m, &upper_n_m]).all(|number| number.is_finite());
        if at == MAX_CONTACTS || compliance.len() != at + 1 || !finite || lower_n_m > upper_n_m {
            return false;
        }
        for (other, &value) in compliance.iter().enumerate() {
            self.compliance[at][other] = value;
            self.compliance[other][at] = value;
        }
        self.free_rad_s2[at] = free_rad_s2;
        self.limits_n_m[at] = (lower_n_m, upper_n_m);
        self.count += 1;
        true
    }

    /// Number of clutches.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The solution, sought from contacts that are likely: those of the step before.
    ///
    /// Murty's rule: the first clutch that breaks its condition changes its contact, until none does. As `W` is positive
    /// definite this ends after finitely many changes.
    pub fn solve(&self, guess: &[Contact]) -> ContactSolution {
        let mut contacts = [Contact::Stuck; MAX_CONTACTS];
        for (contact, &guess) in contacts.iter_mut().zip(guess).take(self.count) {
            *contact = guess;
        }
        // There are no more combinations than these.
        let maximum = 3_usize.pow(u32::try_from(self.count).unwrap_or(0));
        let mut changes = 0;
        loop {
            let (torques_n_m, slips_rad_s2) = self.balance(&contacts);
            let better = |at: usize| self.better(at, contacts[at], torques_n_m[at], slips_rad_s2[at]);
            match (0..self.count).find_map(|at| better(at).map(|contact| (at, contact))) {
                Some((at, contact)) if changes < maximum => contacts[at] = contact,
                _ => return ContactSolution { contacts, torques_n_m, slips_rad_s2, changes },
            }
            changes += 1;
        }
    }

    /// The contact that a clutch changes to if it breaks its condition.
    fn better(&self, at: usize, contact: Contact, torque_n_m: f64, slip_rad_s2: f64) -> Option<Contact> {
        let (lower, upper) = self.limits_n_m[at];
        let slack_n_m = |limit: f64| TOLERANCE * (1.0 + limit.abs());
        let slack_rad_s2 = TOLERANCE * (1.0 + self.free_rad_s2[at].abs() + self.compliance[at][at] * torque_n_m.abs());
        match contact {
            Contact::Stuck if torque_n_m > upper + slack_n_m(upper) => Some(Contact::Slipping(Direction::Forward)),
            Contact::Stuck if torque_n_m < lower - slack_n_m(lower) => Some(Contact::Slipping(Direction::Backward)),
            Contact::Slipping(direction) if direction.sign() * slip_rad_s2 < -slack_rad_s2 => Some(Contact::Stuck),
            _ => None,
        }
    }

    /// Torques and accelerations of the slips with these contacts.
    fn balance(&self, contacts: &[Contact; MAX_CONTACTS]) -> ([f64; MAX_CONTACTS], [f64; MAX_CONTACTS]) {
        let mut torques = [0.0; MAX_CONTACTS];
        for at in 0..self.count {
            torques[at] = match contacts[at] {
                Contact::Stuck => 0.0,
                Contact::Slipping(Direction::Forward) => self.limits_n_m[at].1,
                Contact::Slipping(Direction::Backward) => self.limits_n_m[at].0,
            };
        }
        let stuck = |at: usize| contacts[at] == Contact::Stuck;
        let slips = |torques: &[f64; MAX_CONTACTS]| {
            let mut slips = self.free_rad_s2;
            for (slip, row) in slips.iter_mut().zip(&self.compliance).take(self.count) {
                *slip -= row.iter().zip(torques).take(self.count).map(|(w, torque)| w * torque).sum::<f64>();
            }
            slips
        };
        // The second pass removes what the regularisation leaves.
        for _ in 0..2 {
            let more = self.solve_stuck(stuck, slips(&torques));
            for at in (0..self.count).filter(|&at| stuck(at)) {
                torques[at] += more[at];
            }
        }
        (torques, slips(&torques))
    }

    /// The torques of the sticking clutches that remove these accelerations, by Cholesky's factors.
    fn solve_stuck(&self, stuck: impl Fn(usize) -> bool, mut right: [f64; MAX_CONTACTS]) -> [f64; MAX_CONTACTS] {
        let diagonal = (0..self.count).map(|at| self.compliance[at][at]).fold(0.0, f64::max);
        let regular = REGULARISATION * diagonal + f64::MIN_POSITIVE;
        let mut factor = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
        for i in (0..self.count).filter(|&i| stuck(i)) {
            for j in (0..=i).filter(|&j| stuck(j)) {
                let known: f64 = (0..j).filter(|&k| stuck(k)).map(|k| factor[i][k] * factor[j][k]).sum();
                let rest = self.compliance[i][j] - known;
                factor[i][j] = if i == j { (rest + regular).max(regular).sqrt() } else { rest / factor[j][j] };
            }
            let known: f64 = (0..i).filter(|&k| stuck(k)).map(|k| factor[i][k] * right[k]).sum();
            right[i] = (right[i] - known) / factor[i][i];
        }
        for i in (0..self.count).rev().filter(|&i| stuck(i)) {
            let known: f64 = (i + 1..self.count).filter(|&k| stuck(k)).map(|k| factor[k][i] * right[k]).sum();
            right[i] = (right[i] - known) / factor[i][i];
        }
        right
    }
}

impl Default for ContactProblem {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivetrain::{Engagement, ReducedShift, ShiftTorques};

    /// Numbers from -1 to 1.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let value = (*state >> 33) as f64;
        value / f64::from(1_u32 << 30) - 1.0
    }

    /// A problem of clutches whose rows depend on each other if there are more than `freedoms`.
    fn problem(state: &mut u64, count: usize, freedoms: usize) -> ContactProblem {
        let rows: Vec<Vec<f64>> = (0..count).map(|_| (0..freedoms).map(|_| 3.0 * random(state)).collect()).collect();
        let force: Vec<f64> = (0..freedoms).map(|_| 50.0 * random(state)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let mut problem = ContactProblem::new();
        for (at, row) in rows.iter().enumerate() {
            let compliance: Vec<f64> = rows[..=at].iter().map(|other| dot(row, other)).collect();
            let capacity = 10.0 * random(state).abs();
            let lower = if random(state) > 0.7 { 0.0 } else { -capacity };
            assert!(problem.add(dot(row, &force), &compliance, (lower, capacity)));
        }
        problem
    }

    const ANY: [Contact; 3] =
        [Contact::Stuck, Contact::Slipping(Direction::Forward), Contact::Slipping(Direction::Backward)];

    /// The contacts of a combination.
    fn combination(mut number: usize, count: usize) -> [Contact; MAX_CONTACTS] {
        let mut contacts = [Contact::Stuck; MAX_CONTACTS];
        for contact in contacts.iter_mut().take(count) {
            *contact = ANY[number % 3];
            number /= 3;
        }
        contacts
    }

    #[test]
    fn every_problem_has_a_solution_and_its_accelerations_are_those_of_every_consistent_combination() {
        let mut state = 7;
        let mut several = 0;
        for case in 0..600 {
            let (count, freedoms) = (1 + case % 6, 1 + case % 4);
            let problem = problem(&mut state, count, freedoms);
            let solution = problem.solve(&[]);
            let all = (0..3_usize.pow(u32::try_from(count).unwrap())).map(|number| combination(number, count));
            let mut consistent = 0;
            for contacts in all {
                let (torques, slips) = problem.balance(&contacts);
                if (0..count).any(|at| problem.better(at, contacts[at], torques[at], slips[at]).is_some()) {
                    continue;
                }
                consistent += 1;
                for ((slip, found), free) in
                    slips.iter().zip(solution.slips_rad_s2).zip(problem.free_rad_s2).take(count)
                {
                    assert!((slip - found).abs() < 1e-6 * (1.0 + free.abs()), "{problem:?}");
                }
            }
            assert!(consistent > 0, "{problem:?}");
            several += usize::from(consistent > 1);
        }
        assert!(several > 0, "some have several combinations");
    }

    #[test]
    fn the_solution_does_not_depend_on_the_guess_and_a_good_guess_needs_no_change() {
        let mut state = 11;
        for case in 0..300 {
            let count = 1 + case % MAX_CONTACTS;
            let problem = problem(&mut state, count, 5);
            let solution = problem.solve(&[]);
            assert_eq!(problem.solve(&solution.contacts).changes, 0);
            let other = problem.solve(&combination(case * 97, count));
            for at in 0..count {
                let scale = 1.0 + problem.free_rad_s2[at].abs();
                assert!((other.slips_rad_s2[at] - solution.slips_rad_s2[at]).abs() < 1e-6 * scale);
            }
        }
    }

    #[test]
    fn each_clutch_sticks_within_its_limits_or_slips_in_the_direction_of_its_torque() {
        let mut state = 5;
        for case in 0..500 {
            let count = 1 + case % 7;
            let problem = problem(&mut state, count, 4);
            let solution = problem.solve(&[]);
            for at in 0..count {
                let (lower, upper) = problem.limits_n_m[at];
                let (torque, slip) = (solution.torques_n_m[at], solution.slips_rad_s2[at]);
                let slack = 1e-6 * (1.0 + problem.free_rad_s2[at].abs());
                assert!(torque >= lower - 1e-6 && torque <= upper + 1e-6);
                match solution.contacts[at] {
                    Contact::Stuck => assert!(slip.abs() < slack, "{slip}"),
                    Contact::Slipping(direction) => assert!(direction.sign() * slip > -slack),
                }
                // Friction takes power from a slip that begins; a one-way clutch that opens has no torque.
                assert!(torque * slip > -slack * (1.0 + upper));
            }
        }
    }

    #[test]
    fn two_clutches_are_those_of_the_reduced_shift() {
        let shift = ReducedShift {
            mass_kg_m2: [[0.0644, -0.0111], [-0.0111, 0.1778]],
            slip_offgoing: [2.0 / 3.0, -5.0 / 3.0],
            slip_oncoming: [5.0 / 3.0, -5.0 / 3.0],
        };
        let [[a, b], [_, d]] = shift.mass_kg_m2;
        let det = a * d - b * b;
        let accelerate = |k: [f64; 2]| [(d * k[0] - b * k[1]) / det, (a * k[1] - b * k[0]) / det];
        let dot = |k: [f64; 2], x: [f64; 2]| k[0] * x[0] + k[1] * x[1];
        let (off, on) = (shift.slip_offgoing, shift.slip_oncoming);
        let mut state = 3;
        for _ in 0..400 {
            let (turbine_n_m, output_n_m) = (300.0 * random(&mut state), 600.0 * random(&mut state));
            let capacity = [400.0, 400.0].map(|largest| largest * random(&mut state).abs());
            let free = accelerate([turbine_n_m, -output_n_m]);
            let mut problem = ContactProblem::new();
            assert!(problem.add(dot(off, free), &[dot(off, accelerate(off))], (-capacity[0], capacity[0])));
            let row = [dot(on, accelerate(off)), dot(on, accelerate(on))];
            assert!(problem.add(dot(on, free), &row, (-capacity[1], capacity[1])));
            let solution = problem.solve(&[]);
            let stuck = [0, 1].map(|at| solution.contacts[at] == Contact::Stuck);
            let coefficients = shift.coefficients(Engagement::of(stuck[0], stuck[1]));
            let torques = ShiftTorques {
                turbine_n_m,
                offgoing_n_m: solution.torques_n_m[0],
                oncoming_n_m: solution.torques_n_m[1],
                output_n_m,
            };
            let slip = coefficients.slip_oncoming.at(&torques);
            assert!((slip - solution.slips_rad_s2[1]).abs() < 1e-5 * (1.0 + slip.abs()), "{solution:?}");
            let held = [coefficients.holding_offgoing.at(&torques), coefficients.holding_oncoming.at(&torques)];
            for at in 0..2 {
                assert!(!stuck[at] || (held[at] - solution.torques_n_m[at]).abs() < 1e-5 * (1.0 + held[at].abs()));
            }
        }
    }

    #[test]
    fn two_clutches_side_by_side_share_their_torque() {
        let mut problem = ContactProblem::new();
        assert!(problem.add(8.0, &[1.0], (-10.0, 10.0)));
        assert!(problem.add(8.0, &[1.0, 1.0], (-10.0, 10.0)));
        let solution = problem.solve(&[]);
        assert!((solution.torques_n_m[0] - 4.0).abs() < 1e-6 && (solution.torques_n_m[1] - 4.0).abs() < 1e-6);
        // One of them is too weak: the other holds what is left.
        problem.limits_n_m[0] = (-1.0, 1.0);
        let solution = problem.solve(&[]);
        assert!((solution.torques_n_m[1] - 7.0).abs() < 1e-6 && solution.contacts[1] == Contact::Stuck, "{solution:?}");
    }

    #[test]
    fn a_one_way_clutch_holds_in_one_direction_and_opens_in_the_other() {
        let with = |free: f64| {
            let mut problem = ContactProblem::new();
            assert!(problem.add(free, &[2.0], (0.0, 1e4)));
            problem.solve(&[])
        };
        assert_eq!((with(6.0).contacts[0], with(6.0).torques_n_m[0].round()), (Contact::Stuck, 3.0));
        assert_eq!(with(-6.0).contacts[0], Contact::Slipping(Direction::Backward));
        assert_eq!((with(-6.0).torques_n_m[0], with(-6.0).slips_rad_s2[0]), (0.0, -6.0));
    }

    #[test]
    fn what_is_no_number_and_what_is_too_much_is_refused() {
        let mut problem = ContactProblem::default();
        assert!(!problem.add(f64::NAN, &[1.0], (0.0, 1.0)) && !problem.add(1.0, &[f64::INFINITY], (0.0, 1.0)));
        assert!(!problem.add(1.0, &[1.0], (2.0, 1.0)) && !problem.add(1.0, &[1.0, 2.0], (0.0, 1.0)));
        assert_eq!(problem.solve(&[]).changes, 0);
        for at in 0..MAX_CONTACTS {
            let mut row = vec![0.0; at];
            row.push(1.0);
            assert!(problem.add(1.0, &row, (-1.0, 1.0)));
        }
        assert!(!problem.add(1.0, &[0.0; MAX_CONTACTS + 1], (-1.0, 1.0)) && problem.count() == MAX_CONTACTS);
        let nothing = ContactProblem { compliance: [[0.0; MAX_CONTACTS]; MAX_CONTACTS], ..problem };
        assert!(nothing.solve(&[]).torques_n_m.iter().all(|torque| torque.is_finite()));
    }
}
