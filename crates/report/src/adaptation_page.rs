//! Fill time, kiss point, lag and friction of each clutch by gears and temperature of the oil, on the page of a fit.

use fit::Verdict;
use fit::gearbox::{Adaptation, Adaptations, Adapted, AdaptedShift};

use crate::figure::{Axis, Band, Figure, Panel, Series, Stroke};
use crate::palette::FAMILY;
use crate::panels::with_values;
use crate::sheet::{Content, Part};

/// The quantities, each with its name and unit for readers, the factor on its SI value, and decimals.
const SHOWN: [(Adapted, &str, f64, usize); 5] = [
    (Adapted::FillTime, "fill time (ms)", 1e3, 0),
    (Adapted::KissPoint, "kiss point (kPa)", 1e-3, 0),
    (Adapted::ValveLag, "valve lag (ms)", 1e3, 0),
    (Adapted::ValveDelay, "valve delay (ms)", 1e3, 0),
    (Adapted::Friction, "friction x valve gain", 1.0, 2),
];

/// The parts of the page: curves over the temperature of the oil where there are several, and the tables of all shifts and of those between two gears.
pub fn adaptation_parts(adaptations: &Adaptations) -> Vec<Part> {
    let (of_all, of_gears): (Vec<&Adaptation>, Vec<&Adaptation>) =
        adaptations.rows.iter().partition(|row| row.shift.is_none());
    let mut heading = Some("Adaptation table".to_owned());
    let mut parts = Vec::new();
    if let Some(figure) = over_temperature(&of_all) {
        parts.push(Part {
            heading: heading.take(),
            content: Content::Figure(figure),
            caption: "Each clutch in all shifts in which it slips, at the middle of each step of the oil temperature; shaded: the interval of 95 %."
                .to_owned(),
        });
    }
    for (rows, of) in [
        (of_all, "Each clutch in all shifts in which it slips."),
        (of_gears, "Each clutch in the shifts between two gears."),
    ] {
        if rows.is_empty() {
            continue;
        }
        parts.push(Part {
            heading: heading.take(),
            content: table(&rows),
            caption: format!(
                "{of} In brackets the interval of 95 %; with * the value is limited by the interval before the fit, and - is not identifiable by these \
                 shifts. Fill time: from a step of the command to 150 kPa above the kiss point until the plates touch. Friction x valve gain: a factor on \
                 the given file. `--adaptation-table` writes the same as CSV, with what the logs lack."
            ),
        });
    }
    parts
}

/// What the rows of one line of the table have in common.
type Line<'a> = (&'a str, Option<&'a AdaptedShift>, Option<[f64; 2]>, usize);

fn line(row: &Adaptation) -> Line<'_> {
    (&row.element, row.shift.as_ref(), row.oil_degc, row.shifts)
}

fn table(rows: &[&Adaptation]) -> Content {
    let has_shift = rows.iter().any(|row| row.shift.is_some());
    let has_oil = rows.iter().any(|row| row.oil_degc.is_some());
    let mut titles = vec!["clutch".to_owned()];
    titles.extend(has_shift.then(|| ["shift", "role"].map(str::to_owned)).into_iter().flatten());
    titles.extend(has_oil.then(|| "oil (degC)".to_owned()));
    titles.push("shifts".to_owned());
    titles.extend(SHOWN.map(|(_, name, ..)| name.to_owned()));
    let lines = rows.chunk_by(|one, next| line(one) == line(next)).map(|rows| {
        let (element, shift, oil_degc, shifts) = line(rows[0]);
        let mut cells = vec![element.to_owned()];
        if has_shift {
            let words = shift.map(|shift| [shift.gears.join("-"), shift.role.name().to_owned()]);
            cells.extend(words.unwrap_or_default());
        }
        cells.extend(has_oil.then(|| oil_degc.map_or_else(String::new, |[low, high]| format!("{low} to {high}"))));
        cells.push(shifts.to_string());
        cells.extend(SHOWN.map(|(quantity, _, factor, decimals)| {
            let row = rows.iter().find(|row| row.quantity == quantity);
            row.map_or_else(String::new, |row| cell(row, factor, decimals))
        }));
        cells
    });
    Content::Table(titles, lines.collect())
}

fn cell(row: &Adaptation, factor: f64, decimals: usize) -> String {
    let Some(found) = row.found.filter(|found| found.verdict != Verdict::NotIdentifiable) else {
        return "-".to_owned();
    };
    let mark = if found.verdict == Verdict::Partly { "*" } else { "" };
    let [value, low, high] = [found.value, found.interval[0], found.interval[1]].map(|value| factor * value);
    format!("{value:.decimals$}{mark} ({low:.decimals$} to {high:.decimals$})")
}

/// The identified values over the temperature of the oil; none where there are not two temperatures.
fn over_temperature(rows: &[&Adaptation]) -> Option<Figure> {
    let middle = |row: &Adaptation| row.oil_degc.map(|[low, high]| 0.5 * (low + high));
    let middles = || rows.iter().filter_map(|row| middle(row));
    let (first, last) = (middles().reduce(f64::min)?, middles().reduce(f64::max)?);
    if first >= last {
        return None;
    }
    let mut elements: Vec<&str> = rows.iter().map(|row| row.element.as_str()).collect();
    elements.sort_unstable();
    elements.dedup();
    let panels = SHOWN.map(|(quantity, name, factor, _)| {
        let mut panel =
            Panel { y_label: name.to_owned(), height: 110.0, series: Vec::new(), bands: Vec::new(), axis: Axis::All };
        for (element, stroke) in elements.iter().zip(FAMILY.iter().cycle()) {
            let of = |value: fn(&fit::gearbox::AdaptedValue) -> f64| -> Vec<(f64, f64)> {
                let mut points: Vec<(f64, f64)> = rows
                    .iter()
                    .filter(|row| row.quantity == quantity && row.element == **element)
                    .filter_map(|row| {
                        let found = row.found.as_ref().filter(|found| found.verdict != Verdict::NotIdentifiable)?;
                        Some((middle(row)?, factor * value(found)))
                    })
                    .collect();
                points.sort_by(|one, other| one.0.total_cmp(&other.0));
                points
            };
            let points = of(|found| found.value);
            // One temperature is a point, and no curve.
            if points.len() > 1 {
                panel.series.push(Series { label: (*element).to_owned(), stroke: Stroke { ..*stroke }, points });
                panel.bands.push(Band {
                    label: format!("{element}, 95 %"),
                    colour: stroke.colour,
                    lower: of(|found| found.interval[0]),
                    upper: of(|found| found.interval[1]),
                });
            }
        }
        panel.axis = around(&panel.bands);
        panel
    });
    let (panels, _) = with_values(panels.into());
    let figure =
        Figure { x_label: "temperature of the oil (degC)".into(), x_range: (first, last), spans: Vec::new(), panels };
    (!figure.panels.is_empty()).then_some(figure)
}

/// An axis that shows all intervals.
fn around(bands: &[Band]) -> Axis {
    /// Room beyond them, as a fraction of their height.
    const ROOM: f64 = 0.05;
    let ends = || bands.iter().flat_map(|band| band.lower.iter().chain(&band.upper)).map(|(_, value)| *value);
    let (Some(low), Some(high)) = (ends().reduce(f64::min), ends().reduce(f64::max)) else { return Axis::All };
    let room = ROOM * (high - low);
    Axis::Fixed(low - room, high + room)
}

#[cfg(test)]
mod tests {
    use fit::gearbox::{AdaptedValue, ShiftRole};

    use super::*;

    fn row(shift: Option<[&str; 2]>, oil_degc: Option<[f64; 2]>, quantity: Adapted, value: f64) -> Adaptation {
        let (interval, verdict) = ([0.9 * value, 1.2 * value], Verdict::Partly);
        let shift = shift.map(|gears| AdaptedShift { gears: gears.map(str::to_owned), role: ShiftRole::Oncoming });
        let found = Some(AdaptedValue { value, interval, alone: value, fraction: 0.5, verdict });
        Adaptation { element: "<B>".to_owned(), shift, oil_degc, shifts: 7, quantity, found, lacks: String::new() }
    }

    fn parts(rows: Vec<Adaptation>) -> Vec<Part> {
        adaptation_parts(&Adaptations { rows, warnings: Vec::new() })
    }

    #[test]
    fn curves_are_drawn_where_there_are_two_temperatures() {
        let at = |oil, value| row(None, Some(oil), Adapted::FillTime, value);
        let found = parts(vec![at([60.0, 80.0], 0.08), at([20.0, 40.0], 0.12)]);
        let [Part { content: Content::Figure(figure), heading: Some(_), .. }, Part { heading: None, .. }] = &found[..]
        else {
            panic!("{} parts", found.len())
        };
        assert_eq!((figure.x_range, figure.panels.len()), ((30.0, 70.0), 1));
        let [panel] = &figure.panels[..] else { panic!() };
        assert_eq!(panel.series[0].points, [(30.0, 120.0), (70.0, 80.0)]);
        // The intervals are shown to their ends.
        let Axis::Fixed(low, high) = panel.axis else { panic!("{:?}", panel.axis) };
        assert!(low < 72.0 && high > 144.0, "{low} {high}");
        for rows in [vec![at([20.0, 40.0], 0.12)], vec![row(None, None, Adapted::FillTime, 0.1)], Vec::new()] {
            assert!(parts(rows).iter().all(|part| !matches!(part.content, Content::Figure(_))));
        }
    }

    #[test]
    fn a_line_of_the_table_has_all_quantities_of_a_clutch_in_a_shift() {
        let not_identifiable = |mut row: Adaptation| {
            row.found = row.found.map(|found| AdaptedValue { verdict: Verdict::NotIdentifiable, ..found });
            row
        };
        let of = |gears, quantity, value| row(Some(gears), None, quantity, value);
        let found = parts(vec![
            of(["1", "2"], Adapted::KissPoint, 1e5),
            not_identifiable(of(["1", "2"], Adapted::Friction, 1.1)),
            of(["2", "3"], Adapted::Friction, 1.05),
        ]);
        let [Part { content: Content::Table(titles, rows), heading: Some(_), .. }] = &found[..] else { panic!() };
        assert_eq!(titles[..4], ["clutch", "shift", "role", "shifts"]);
        assert_eq!(rows[0], ["<B>", "1-2", "oncoming", "7", "", "100* (90 to 120)", "", "", "-"]);
        assert_eq!(rows[1], ["<B>", "2-3", "oncoming", "7", "", "", "", "", "1.05* (0.95 to 1.26)"]);
    }
}
