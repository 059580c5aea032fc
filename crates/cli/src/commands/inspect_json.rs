//! What `wetclutch inspect --json` prints.

use std::path::Path;

use logs::{Channel, ChannelSummary, Inspection, Log, Quality, Shift};
use serde_json::{Map, Value, json};
use trace::ShownPath as _;

/// The channels of a log. Times are those of the log's clock.
pub(super) fn channels(path: &Path, log: &Log, inspection: &Inspection) -> Value {
    let channels: Vec<Value> = log
        .channels()
        .iter()
        .zip(&inspection.channels)
        .map(|(channel, summary)| of_channel(channel, summary))
        .collect();
    json!({
        "log": path.shown().to_string(),
        "format": log.format(),
        "channels": channels,
        "warnings": inspection.notes,
    })
}

/// The shifts of a log. Times are those of the log's clock.
pub(super) fn shifts(path: &Path, span_s: [f64; 2], shifts: &[Shift], notes: &[String]) -> Value {
    json!({
        "log": path.shown().to_string(),
        "from_s": span_s[0],
        "to_s": span_s[1],
        "shifts": shifts.iter().map(of_shift).collect::<Vec<_>>(),
        "warnings": notes,
    })
}

fn of_channel(channel: &Channel, summary: &ChannelSummary) -> Value {
    let counts = &summary.counts;
    let faults = Quality::ALL.into_iter().skip(1).filter(|quality| counts.of(*quality) > 0);
    let not_usable: Map<String, Value> =
        faults.map(|quality| (quality.name().to_owned(), json!(counts.of(quality)))).collect();
    let [from_s, to_s] = ends(summary.span_s);
    let [minimum, maximum] = ends(summary.range);
    json!({
        "name": channel.name,
        "group": channel.group,
        "unit": channel.unit,
        "samples": counts.total(),
        "rate_hz": summary.period_s.map(|period_s| 1.0 / period_s),
        "from_s": from_s,
        "to_s": to_s,
        "minimum": minimum,
        "maximum": maximum,
        "gaps": summary.gaps,
        "longest_gap_s": (summary.gaps > 0).then_some(summary.longest_s),
        "not_usable": not_usable,
    })
}

fn of_shift(shift: &Shift) -> Value {
    let [from_s, to_s] = ends(shift.inertia_s);
    let quality = &shift.quality;
    json!({
        "from": shift.from,
        "to": shift.to,
        "kind": shift.kind_name(),
        "command_s": shift.command_s,
        "gear_signal_s": shift.gear_s,
        "inertia_from_s": from_s,
        "inertia_to_s": to_s,
        "inertia_half_interval_s": quality.inertia_half_s,
        "flare_rad_s": quality.flare_rad_s,
        "flare_half_interval_rad_s": quality.flare_half_rad_s,
        "jerk_m_s3": quality.jerk_m_s3,
        "jerk_half_interval_m_s3": quality.jerk_half_m_s3,
    })
}

fn ends(range: Option<[f64; 2]>) -> [Option<f64>; 2] {
    range.map_or([None; 2], |range| range.map(Some))
}
