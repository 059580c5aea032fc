//! What `wetclutch check` says about the defaults of a vehicle file.

use config::{Change, Vehicle};
use study::{Influence, default_influences};
use trace::units;

use crate::failure::Failure;
use crate::output;

/// Defaults that are shown, if not all are asked for.
const SHOWN: usize = 12;
/// Longest value that is shown as it stands in the file.
const LONGEST: usize = 24;

/// Lists the defaults of a vehicle file, those that matter most to an estimate first.
pub(super) fn describe_defaults(vehicle: &Vehicle, all: bool) -> Result<(), Failure> {
    let taken = &vehicle.defaults_taken;
    if taken.is_empty() {
        return Ok(());
    }
    output::line(&format!("\n{} values are not in the file and are defaults", taken.len()))?;
    let Some(influences) = default_influences(vehicle)? else {
        output::line("the simulated car makes no whole upshift, so it cannot be said which of them matter")?;
        return all_names(vehicle, &[], true);
    };
    output::line(
        "which matter most: RMS change of pressure (kPa) and torque (N m) of the oncoming clutch, in the torque and inertia phase of a\n\
         simulated upshift, where one default is off, for the open loop and for the default observer (kalman)\n",
    )?;
    let shown = if all { influences.len() } else { SHOWN.min(influences.len()) };
    let titles = ["default", "value", "off by", "open kPa", "open N m", "kalman kPa", "kalman N m"];
    let rows = influences[..shown].iter().map(row);
    output::table(3, &std::iter::once(titles.map(str::to_owned).to_vec()).chain(rows).collect::<Vec<_>>())?;
    output::line("")?;
    all_names(vehicle, &influences[..shown], all)
}

fn row(influence: &Influence) -> Vec<String> {
    let value = &influence.taken.value;
    let value = if value.len() > LONGEST { "a map".to_owned() } else { value.clone() };
    let mut row = vec![influence.taken.key.clone(), value, off(influence)];
    for change in influence.changes {
        row.push(format!("{:.2}", 1e3 * units::mpa(change.pressure_pa)));
        row.push(format!("{:.2}", change.torque_n_m));
    }
    row
}

/// The limits in words: `-20 to +20 %`, `x0.5 to x2`, `-0.015 to +0.015`.
fn off(influence: &Influence) -> String {
    let limit = |limit: &f64| match influence.change {
        Change::Scale if (0.5..1.5).contains(limit) && *limit != 0.5 => format!("{:+.0} %", 100.0 * (limit - 1.0)),
        Change::Scale => format!("x {limit}"),
        Change::Add => format!("{limit:+}"),
        Change::Set => format!("{limit}"),
    };
    influence.limits.iter().map(limit).collect::<Vec<_>>().join(", ")
}

/// The defaults that are not in the table.
fn all_names(vehicle: &Vehicle, shown: &[Influence], all: bool) -> Result<(), Failure> {
    let is_shown = |key: &str| shown.iter().any(|influence| influence.taken.key == key);
    let others: Vec<_> = vehicle.defaults_taken.iter().filter(|taken| !is_shown(&taken.key)).collect();
    if !all {
        let count = others.len();
        output::line(&format!("{count} others matter less, or to no estimate: --all shows them"))?;
        return Ok(());
    }
    output::line("defaults on which no estimate depends, or of which nothing is known:")?;
    for taken in others {
        output::line(&format!("  {} = {}", taken.key, taken.value))?;
    }
    Ok(())
}
