//! The page of a model-error study: how large the errors are, and their causes.

use config::Study;
use minijinja::{Value, context};
use study::ErrorBound;
use study::campaign::PHASES;
use study::error_bound::{PARTS, PhaseErrors, Size};

use crate::page::{PageError, origin, render};
use crate::tables::phase_name;

/// Every error of one phase with its name: the rigid model's size, channels and parts, the compliant model's channels.
pub fn named(phase: &PhaseErrors) -> Vec<(String, &Size)> {
    let compliant: &[&str] =
        if phase.compliant_channels.len() == 3 { &["turbine", "slip", "wheel"] } else { &["turbine", "wheel"] };
    let channels = ["turbine", "slip"].iter().zip(&phase.rigid_channels);
    let mut rows = vec![("rigid model, |w|".to_owned(), &phase.rigid)];
    rows.extend(channels.map(|(name, size)| (format!("  {name} acceleration"), size)));
    rows.extend(PARTS.iter().zip(&phase.rigid_parts).map(|(part, size)| (format!("  due to {part}"), size)));
    let channels = compliant.iter().zip(&phase.compliant_channels);
    rows.extend(channels.map(|(name, size)| (format!("compliant model, {name} acceleration"), size)));
    rows
}

/// The page; it needs nothing but itself.
///
/// # Errors
/// None in a released program; the tests render the template.
pub fn error_bound_page(found: &ErrorBound, study: &Study) -> Result<String, PageError> {
    let phases = PHASES.into_iter().zip(&found.phases).map(|(phase, errors)| {
        let rows: Vec<Value> = named(errors)
            .into_iter()
            .map(|(name, size)| {
                let numbers = [size.largest, size.quantiles[0], size.quantiles[1], size.quantiles[2]];
                context! {
                    name => name.trim_start(),
                    part => name.starts_with(' '),
                    fraction => format!("{:.2}", 0.6 * (size.largest / errors.rigid.largest.max(1e-9)).min(1.0)),
                    numbers => numbers.map(|value| format!("{value:.1}")),
                    settled => size.settled_after,
                }
            })
            .collect();
        context! { phase => phase_name(phase), runs => errors.runs, rows => rows }
    });
    render(
        "error_bound.html",
        context! {
            name => &study.name,
            title => &study.title,
            version => env!("CARGO_PKG_VERSION"),
            vehicle_name => &study.vehicle.name,
            runs => found.runs,
            unfinished => found.unfinished,
            phases => phases.collect::<Vec<_>>(),
            toml => found.toml(study),
            factors => study.factors.iter().map(|factor| {
                let [low, high] = factor.values.ends();
                context! { name => &factor.name, low => low, high => high }
            }).collect::<Vec<_>>(),
            inputs => origin(&[&study.source, &study.experiment.source, &study.vehicle.source]),
        },
    )
}
