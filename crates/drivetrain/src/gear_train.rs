//! Any planetary gear train, described by its parts and reduced to a shift between two clutches.
//!
//! A gear train is a list of shafts with inertias, planetary sets that connect three shafts and
//! clutches that connect two members. During a clutch-to-clutch shift all other clutches are held or
//! open, which leaves two degrees of freedom. This module eliminates the constraints: every shaft speed
//! is a linear combination of turbine and output speed, and the kinetic energy is a 2 x 2 quadratic form of them.

use crate::ReducedShift;

/// Most shafts a gear train may have.
pub const MAX_SHAFTS: usize = 12;

/// One side of a clutch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Member {
    /// The gearbox housing, at rest.
    Housing,
    /// A shaft, by its position in the list of shafts.
    Shaft(usize),
}

/// A planetary set with single planets: `Z_r w_r + Z_s w_s = (Z_r + Z_s) w_c`, Eq. (2.5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanetarySet {
    /// Shaft of the sun.
    pub sun: usize,
    /// Shaft of the ring.
    pub ring: usize,
    /// Shaft of the carrier.
    pub carrier: usize,
    /// Teeth of the sun.
    pub sun_teeth: f64,
    /// Teeth of the ring.
    pub ring_teeth: f64,
}

/// Input and output side of a clutch. Slip is input minus output.
pub type Sides = (Member, Member);

/// A gear train as a list of its parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GearTrain<'a> {
    /// Inertia of each shaft, kg m^2.
    pub inertias_kg_m2: &'a [f64],
    /// The planetary sets.
    pub sets: &'a [PlanetarySet],
    /// Clutches and brakes that stay engaged during the shift.
    pub held: &'a [Sides],
    /// Shaft of the turbine.
    pub input: usize,
    /// Shaft of the gearbox output.
    pub output: usize,
}

/// Why a gear train cannot be reduced to a shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GearTrainError {
    /// More than [`MAX_SHAFTS`] shafts.
    TooManyShafts,
    /// A part names a shaft that does not exist.
    UnknownShaft(usize),
    /// Sets and held clutches leave this many degrees of freedom; a shift needs two.
    DegreesOfFreedom(i32),
    /// The constraints do not determine every shaft from turbine and output speed.
    Dependent,
    /// A shift clutch whose slip does not depend on turbine or output speed.
    IdleClutch,
    /// Both shift clutches have the same slip, so that a change between them cannot change the ratio.
    SameClutch,
}

impl core::fmt::Display for GearTrainError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooManyShafts => write!(f, "a gear train has at most {MAX_SHAFTS} shafts"),
            Self::UnknownShaft(i) => write!(f, "there is no shaft number {}", i + 1),
            Self::DegreesOfFreedom(n) => write!(
                f,
                "the planetary sets and the held clutches leave {n} degrees of freedom, but a shift needs exactly 2"
            ),
            Self::Dependent => write!(f, "turbine and output speed do not determine the speed of every shaft"),
            Self::IdleClutch => write!(f, "the two sides of a shift clutch always have the same speed"),
            Self::SameClutch => write!(f, "offgoing and oncoming clutch always have the same slip"),
        }
    }
}

impl core::error::Error for GearTrainError {}

impl GearTrain<'_> {
    /// Reduces the train to the shift from `offgoing` to `oncoming`.
    ///
    /// # Errors
    /// Parts that name no shaft, or constraints that do not leave two independent degrees of freedom.
    pub fn reduce(&self, offgoing: Sides, oncoming: Sides) -> Result<ReducedShift<f64>, GearTrainError> {
        let speeds = self.shaft_speeds()?;
        let mut mass = [[0.0; 2]; 2];
        for (inertia, p) in self.inertias_kg_m2.iter().zip(&speeds) {
            for i in 0..2 {
                for j in 0..2 {
                    mass[i][j] += inertia * p[i] * p[j];
                }
            }
        }
        let slip_of = |sides: Sides| -> Result<[f64; 2], GearTrainError> {
            let speed = |member| match member {
                Member::Housing => Ok([0.0; 2]),
                Member::Shaft(i) => self.check(i).map(|i| speeds[i]),
            };
            let (input, output) = (speed(sides.0)?, speed(sides.1)?);
            let slip = [input[0] - output[0], input[1] - output[1]];
            if slip[0].abs() + slip[1].abs() < 1e-12 { Err(GearTrainError::IdleClutch) } else { Ok(slip) }
        };
        let (slip_offgoing, slip_oncoming) = (slip_of(offgoing)?, slip_of(oncoming)?);
        if (slip_offgoing[0] * slip_oncoming[1] - slip_offgoing[1] * slip_oncoming[0]).abs() < 1e-12 {
            return Err(GearTrainError::SameClutch);
        }
        Ok(ReducedShift { mass_kg_m2: mass, slip_offgoing, slip_oncoming })
    }

    /// Speed of every shaft as `(per turbine speed, per output speed)`.
    fn shaft_speeds(&self) -> Result<[[f64; 2]; MAX_SHAFTS], GearTrainError> {
        let n = self.inertias_kg_m2.len();
        if n > MAX_SHAFTS {
            return Err(GearTrainError::TooManyShafts);
        }
        let constraints = self.sets.len() + self.held.len();
        if n != constraints + 2 {
            #[expect(
                clippy::cast_possible_wrap,
                clippy::cast_possible_truncation,
                reason = "counts of gearbox parts are small"
            )]
            return Err(GearTrainError::DegreesOfFreedom(n as i32 - constraints as i32));
        }
        let mut system =
            System { n, matrix: [[0.0; MAX_SHAFTS]; MAX_SHAFTS], right: [[0.0; 2]; MAX_SHAFTS], filled: 0 };
        for set in self.sets {
            let row = system.next_row();
            row[self.check(set.sun)?] += set.sun_teeth;
            row[self.check(set.ring)?] += set.ring_teeth;
            row[self.check(set.carrier)?] -= set.sun_teeth + set.ring_teeth;
        }
        for &(a, b) in self.held {
            let row = system.next_row();
            for (member, sign) in [(a, 1.0), (b, -1.0)] {
                if let Member::Shaft(i) = member {
                    row[self.check(i)?] += sign;
                }
            }
        }
        for (column, shaft) in [self.input, self.output].into_iter().enumerate() {
            let at = system.filled;
            system.next_row()[self.check(shaft)?] = 1.0;
            system.right[at][column] = 1.0;
        }
        system.solve().ok_or(GearTrainError::Dependent)
    }

    fn check(&self, shaft: usize) -> Result<usize, GearTrainError> {
        if shaft < self.inertias_kg_m2.len() { Ok(shaft) } else { Err(GearTrainError::UnknownShaft(shaft)) }
    }
}

/// Linear equations for the shaft speeds with two right-hand sides.
struct System {
    n: usize,
    matrix: [[f64; MAX_SHAFTS]; MAX_SHAFTS],
    right: [[f64; 2]; MAX_SHAFTS],
    filled: usize,
}

impl System {
    fn next_row(&mut self) -> &mut [f64; MAX_SHAFTS] {
        self.filled += 1;
        &mut self.matrix[self.filled - 1]
    }

    /// Gauss elimination with row pivoting; `None` for a singular system.
    fn solve(mut self) -> Option<[[f64; 2]; MAX_SHAFTS]> {
        for k in 0..self.n {
            let size = |row: usize| self.matrix[row][k].abs();
            let pivot = (k..self.n).max_by(|&a, &b| size(a).total_cmp(&size(b)))?;
            if size(pivot) < 1e-12 {
                return None;
            }
            self.matrix.swap(k, pivot);
            self.right.swap(k, pivot);
            let (row_k, right_k) = (self.matrix[k], self.right[k]);
            for row in (0..self.n).filter(|&row| row != k) {
                let factor = self.matrix[row][k] / row_k[k];
                for (x, y) in self.matrix[row].iter_mut().zip(row_k) {
                    *x -= factor * y;
                }
                for (x, y) in self.right[row].iter_mut().zip(right_k) {
                    *x -= factor * y;
                }
            }
        }
        for k in 0..self.n {
            let pivot = self.matrix[k][k];
            self.right[k] = self.right[k].map(|x| x / pivot);
        }
        Some(self.right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Engagement;

    /// The chapter's set: sun = turbine (0), ring (1), carrier = output (2).
    fn two_speed(output_inertia: f64) -> ReducedShift<f64> {
        let set = PlanetarySet { sun: 0, ring: 1, carrier: 2, sun_teeth: 40.0, ring_teeth: 60.0 };
        GearTrain { inertias_kg_m2: &[0.06, 0.01, output_inertia], sets: &[set], held: &[], input: 0, output: 2 }
            .reduce((Member::Housing, Member::Shaft(1)), (Member::Shaft(0), Member::Shaft(1)))
            .unwrap()
    }

    /// Equal when `value` rounds to `printed` at the number of digits that were printed.
    fn assert_printed(value: f64, printed: f64, digits: i32) {
        let half = 0.5 * 10f64.powi(-digits) * 1.0001;
        assert!((value - printed).abs() <= half, "{value} does not print as {printed}");
    }

    #[test]
    fn chapter_rigid_coefficients_of_table_2_2() {
        let shift = two_speed(15.0);
        let both = shift.coefficients(Engagement::BothSlipping);
        assert_printed(both.turbine.per_turbine_torque, 15.52, 2);
        assert_printed(both.turbine.per_oncoming_torque, -25.85, 2);
        assert_printed(both.turbine.per_output_torque, -0.01, 2);
        let ring = |f: fn(&crate::AccelerationRow<f64>) -> f64| f(&both.turbine) - f(&both.slip_oncoming);
        assert_printed(ring(|r| r.per_turbine_torque), -10.33, 2);
        assert_printed(ring(|r| r.per_oncoming_torque), 17.38, 2);
        assert_printed(ring(|r| r.per_output_torque), -0.10, 2);
        let first = shift.coefficients(Engagement::OffgoingStuck);
        assert_printed(first.turbine.per_turbine_torque, 0.4065, 4);
        assert_printed(first.turbine.per_oncoming_torque, -0.4065, 4);
        assert_printed(first.turbine.per_output_torque, -0.163, 3);
    }

    #[test]
    fn chapter_compliant_coefficients_of_table_2_4() {
        let shift = two_speed(0.15);
        let both = shift.coefficients(Engagement::BothSlipping);
        assert_printed(both.turbine.per_turbine_torque, 15.69, 2);
        assert_printed(both.turbine.per_oncoming_torque, -24.51, 2);
        assert_printed(both.turbine.per_output_torque, -0.98, 2);
        let ring = |f: fn(&crate::AccelerationRow<f64>) -> f64| f(&both.turbine) - f(&both.slip_oncoming);
        assert_printed(ring(|r| r.per_turbine_torque), -8.82, 2);
        assert_printed(ring(|r| r.per_oncoming_torque), 29.41, 2);
        assert_printed(ring(|r| r.per_output_torque), -8.82, 2);
        let first = shift.coefficients(Engagement::OffgoingStuck);
        assert_printed(first.turbine.per_turbine_torque, 11.90, 2);
        assert_printed(first.turbine.per_oncoming_torque, -11.90, 2);
        assert_printed(first.turbine.per_output_torque, -4.76, 2);
    }

    #[test]
    fn coefficients_equal_the_closed_forms_of_eq_2_10() {
        let (it, ir, io, rg) = (0.06, 0.01, 0.15, 2.5);
        let d = rg * rg * it * ir + (rg - 1.0) * (rg - 1.0) * it * io + ir * io;
        let both = two_speed(io).coefficients(Engagement::BothSlipping);
        let row = |r: &crate::AccelerationRow<f64>| {
            [r.per_turbine_torque, r.per_offgoing_torque, r.per_oncoming_torque, r.per_output_torque]
        };
        let turbine = [
            (rg * rg * ir + (rg - 1.0) * (rg - 1.0) * io) / d,
            -(rg - 1.0) * io / d,
            -rg * ((rg - 1.0) * io + rg * ir) / d,
            -rg * ir / d,
        ];
        let output = [
            rg * ir / d,
            rg * (rg - 1.0) * it / d,
            rg * ((rg - 1.0) * it - ir) / d,
            -((rg - 1.0) * (rg - 1.0) * it + ir) / d,
        ];
        let (found_turbine, found_output, found_slip) =
            (row(&both.turbine), row(&both.output), row(&both.slip_oncoming));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * b.abs(), "{a} {b}");
        for i in 0..4 {
            near(found_turbine[i], turbine[i]);
            near(found_output[i], output[i]);
            // The slip of clutch B is the turbine's speed less the ring's: rg/(rg - 1) (w_t - w_0).
            near(found_slip[i], rg / (rg - 1.0) * (turbine[i] - output[i]));
        }
    }

    #[test]
    fn gear_ratios_follow_from_tooth_counts() {
        let shift = two_speed(0.15);
        assert!((shift.ratio_offgoing() - 2.5).abs() < 1e-14);
        assert!((shift.ratio_oncoming() - 1.0).abs() < 1e-14);
    }

    /// A Simpson train: common sun (1), front ring = forward clutch side (0 = turbine here), rear
    /// carrier and front ring's partner joined as output. 1st: reaction carrier held; 2nd: sun held.
    #[test]
    fn a_simpson_train_gives_its_textbook_ratios() {
        // Shafts: 0 turbine = front ring, 1 common sun, 2 output = front carrier + rear ring, 3 rear carrier.
        let sets = [
            PlanetarySet { sun: 1, ring: 0, carrier: 2, sun_teeth: 33.0, ring_teeth: 72.0 },
            PlanetarySet { sun: 1, ring: 2, carrier: 3, sun_teeth: 33.0, ring_teeth: 72.0 },
        ];
        let train = GearTrain { inertias_kg_m2: &[0.06, 0.02, 0.1, 0.03], sets: &sets, held: &[], input: 0, output: 2 };
        let shift = train.reduce((Member::Housing, Member::Shaft(3)), (Member::Housing, Member::Shaft(1))).unwrap();
        let (zs, zr) = (33.0, 72.0);
        assert!((shift.ratio_offgoing() - (2.0 * zr + zs) / zr).abs() < 1e-12);
        assert!((shift.ratio_oncoming() - (zr + zs) / zr).abs() < 1e-12);
    }

    #[test]
    fn a_train_with_the_wrong_freedom_is_refused() {
        let train = GearTrain { inertias_kg_m2: &[0.06, 0.01, 0.1], sets: &[], held: &[], input: 0, output: 2 };
        let sides = (Member::Housing, Member::Shaft(1));
        assert_eq!(train.reduce(sides, sides), Err(GearTrainError::DegreesOfFreedom(3)));
    }

    #[test]
    fn a_clutch_between_the_same_members_twice_is_refused() {
        let set = PlanetarySet { sun: 0, ring: 1, carrier: 2, sun_teeth: 40.0, ring_teeth: 60.0 };
        let train = GearTrain { inertias_kg_m2: &[0.06, 0.01, 0.1], sets: &[set], held: &[], input: 0, output: 2 };
        let a = (Member::Housing, Member::Shaft(1));
        assert_eq!(train.reduce(a, a), Err(GearTrainError::SameClutch));
        assert_eq!(train.reduce(a, (Member::Housing, Member::Housing)), Err(GearTrainError::IdleClutch));
        assert_eq!(train.reduce(a, (Member::Housing, Member::Shaft(7))), Err(GearTrainError::UnknownShaft(7)));
    }
}
