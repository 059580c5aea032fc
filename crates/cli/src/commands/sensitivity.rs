//! `wetclutch sensitivity`.

use config::Vehicle;
use report::sensitivity_page;
use serde_json::json;
use study::sensitivity as find;
use study::sensitivity::{ShaftEffect, ValveEffect, shaft_level, valve_alone};

use crate::args::SensitivityOptions;
use crate::commands::write_text;
use crate::failure::Failure;
use crate::output;

pub(crate) fn sensitivity(options: &SensitivityOptions) -> Result<(), Failure> {
    let vehicle = match &options.vehicle {
        Some(path) => Vehicle::read(path)?,
        None => Vehicle::two_speed_at()?,
    };
    let (phases, valve, shaft) = (find(&vehicle), valve_alone(&vehicle), shaft_level(&vehicle));
    if let Some(folder) = &options.output {
        write_text(&folder.join("sensitivity.html"), &sensitivity_page(&phases, &valve, &shaft, &vehicle)?)?;
    }
    if options.json {
        output::line(&serde_json::to_string_pretty(&json!({ "phases": phases, "valve": valve, "shaft": shaft }))?)?;
        return Ok(());
    }
    for phase in &phases {
        output::line(&format!(
            "{}, {}: the accelerations change by {:.0} rad/s^2 per MPa\n",
            phase.phase.replace('_', " "),
            phase.view.name(),
            phase.influence_rad_s2_mpa
        ))?;
        let head = [
            "error",
            "bound",
            "unit",
            "equivalent pressure error, kPa",
            "per unit",
            "clutch torque per unit, N m",
            "angle to the pressure",
        ];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        rows.extend(phase.effects.iter().map(|effect| {
            vec![
                effect.error.to_owned(),
                effect.bound_text(),
                effect.unit.to_owned(),
                format!("{:.1}", 1e-3 * (effect.bound * effect.pressure_pa_per_unit).abs()),
                format!("{:.2}", 1e-3 * effect.pressure_pa_per_unit),
                format!("{:.2}", effect.clutch_n_m_per_unit),
                effect.angle_deg.map_or_else(|| "one speed".to_owned(), |angle| format!("{angle:.1} deg")),
            ]
        }));
        output::table(1, &rows)?;
        output::line("")?;
    }
    let kpa = |effect: &ValveEffect| format!("{} {:.1} kPa", effect.error, 1e-3 * effect.pressure_pa);
    output::line(&format!(
        "pressure error of the open loop in a shift: {}\n",
        valve.iter().map(kpa).collect::<Vec<_>>().join(", ")
    ))?;
    let n_m = |effect: &ShaftEffect| format!("{} {:.0} N m", effect.error, effect.torque_n_m);
    output::line(&format!(
        "error of the level of the shaft torque, which the speeds do not show: {}\n",
        shaft.iter().map(n_m).collect::<Vec<_>>().join(", ")
    ))?;
    if let Some(folder) = &options.output {
        output::line(&format!("page: {}", folder.join("sensitivity.html").display()))?;
    }
    Ok(())
}
