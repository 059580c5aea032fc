//! The page of a fit: intervals of the parameters, and what was found.

use std::collections::HashMap;

use fit::gearbox::GearboxFit;
use fit::{Fit, ReportRow, Verdict};

use crate::sheet::{Content, Interval, Part};

/// Standard deviations on either side of a value that its interval of 95 % has.
const SIDES: f64 = 2.0;

/// Values and halves of intervals after a fit, by the names of the parameters, in halves of the intervals before it.
type Bars = HashMap<String, [f64; 2]>;

/// The intervals of a fit to the shift of a vehicle file.
pub fn intervals(found: &Fit) -> Part {
    let bar = |(prior, unknown): (&fit::Prior, &f64)| {
        let after = found.sd(prior.parameter)? / prior.sd;
        Some((prior.name.clone(), [(unknown - prior.mean) / (SIDES * prior.sd), after]))
    };
    part(&found.report(), &found.priors.iter().zip(&found.unknowns).filter_map(bar).collect())
}

/// The intervals of a fit to the shifts of a gearbox.
pub fn gearbox_intervals(found: &GearboxFit) -> Part {
    let quantities = &found.quantities;
    let bar = |(place, quantity): (usize, &fit::gearbox::Quantity)| {
        let before = quantities.sd_before(place);
        let after = found.sd(*quantity) / before;
        (quantities.name(*quantity), [found.unknown(*quantity) / (SIDES * before), after])
    };
    part(&found.report(), &quantities.all.iter().enumerate().map(bar).collect())
}

fn part(rows: &[ReportRow], bars: &Bars) -> Part {
    let interval = |row: &ReportRow| Interval {
        name: row.name.clone(),
        cells: [row.value_text(), row.interval_text()],
        bar: bars.get(&row.name).copied(),
        verdict: row.verdict.name(),
        rank: match row.verdict {
            Verdict::Measured => 0,
            Verdict::Partly => 1,
            Verdict::NotIdentifiable => 2,
        },
    };
    Part {
        heading: Some("Parameters".to_owned()),
        content: Content::Intervals(rows.iter().map(interval).collect()),
        caption: "Value: a factor on that of the given file, or what is added to it. Bar: the interval of 95 % after the fit, with the value as a \
                  line, on the interval before it, which is grey; the middle of the grey one is the given file. Green: identifiable; orange: limited by \
                  the interval before the fit; grey frame: not identifiable."
            .to_owned(),
    }
}
