//! What the filter of `estimate` says of a drive with a vehicle file.

use car::ErrorBudget;
use car::{Car, Drive};
use observer::gearbox_filter;
use plant::car::CarModel;
use study::gearbox::drive::{DriveScorer, ScoredDrive};

use super::drawn::{Drawn, sensors, tables};

/// Largest drag of an open element in the drawn cars, N m; the ranges hold that of the given file alone.
const DRAG_N_M: f64 = 1.7;

/// Sums over rows in which a clutch of a shift slips.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Estimated {
    pub(crate) rows: f64,
    /// Squared error of the torque, N m squared.
    pub(crate) square: f64,
    /// The same of the torque by the valve model alone.
    pub(crate) square_of_valves: f64,
    /// Widths of the ranges.
    pub(crate) width_n_m: f64,
    pub(crate) width_pa: f64,
    /// Rows with the true pressure, and with the true torque outside.
    pub(crate) outside: [f64; 2],
}

/// Lets the filter of each car estimate a drive of the drawn one.
pub(crate) fn estimated(drawn: &Drawn, drive: &Drive, cars: &[Car]) -> Vec<Estimated> {
    let (all_tables, sensors) = (cars.iter().map(tables).collect::<Vec<_>>(), sensors());
    let filters: Vec<_> = (cars.iter().zip(&all_tables))
        .map(|(car, tables)| gearbox_filter(car, tables, &ErrorBudget::of_car(car), Some(&sensors)))
        .collect();
    let model = CarModel::new(drawn.truth.clone()).unwrap();
    let mut scorers: Vec<_> = (cars.iter().zip(&all_tables).zip(&filters))
        .map(|((car, tables), filter)| DriveScorer::new(car, &model, tables, filter))
        .collect();
    drawn.each_measured(
        drive,
        !drawn.seed,
        |_| (),
        |row| {
            for ((car, tables), scorer) in cars.iter().zip(&all_tables).zip(&mut scorers) {
                scorer.push(&row.sample, &row.input(car, tables));
            }
        },
    );
    scorers.into_iter().map(|scorer| summed(&scorer.finish())).collect()
}

fn summed(drive: &ScoredDrive) -> Estimated {
    let mut sum = Estimated::default();
    let rows = drive.shifts.iter().flat_map(|shift| &shift.rows).filter(|row| row.phase().is_some());
    for clutch in rows.flat_map(|row| &row.clutches).filter(|clutch| !clutch.sticks) {
        let (Some(torque), Some(pressure)) = (clutch.torque_range_n_m, clutch.pressure_range_pa) else { continue };
        sum.rows += 1.0;
        sum.square += (clutch.torque_n_m[1] - clutch.torque_n_m[0]).powi(2);
        sum.square_of_valves += (clutch.torque_n_m[2] - clutch.torque_n_m[0]).powi(2);
        sum.width_n_m += torque[1] - torque[0];
        sum.width_pa += pressure[1] - pressure[0];
        let is_outside =
            |[minimum, maximum]: [f64; 2], value: f64, room: f64| value < minimum - room || value > maximum + room;
        sum.outside[0] += f64::from(u8::from(is_outside(pressure, clutch.pressure_pa[0], 1.0)));
        sum.outside[1] += f64::from(u8::from(is_outside(torque, clutch.torque_n_m[0], DRAG_N_M)));
    }
    sum
}
