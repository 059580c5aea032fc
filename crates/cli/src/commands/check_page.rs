//! The page of `wetclutch check`: drawings of a gearbox, its gears, and the defaults of a vehicle file.

use config::DefaultTaken;
use config::{CarFile, GearboxFile, Source, VehicleFile};
use geartrain::Gearbox;
use report::map_figures::map_figures;
use report::sheet::{Content, Part, Sheet};

use super::gearbox::{drawings, gear_rows, head};

/// The page of a gearbox file.
pub(super) fn of_gearbox(file: &GearboxFile) -> Sheet<'_> {
    sheet(&file.gearbox.name, head(&file.gearbox), warnings(&file.warnings), gearbox_parts(&file.gearbox), &file.source)
}

/// The page of a vehicle file with a gearbox.
pub(super) fn of_car(car: &CarFile) -> Sheet<'_> {
    let mut found = warnings(&car.implausible());
    found.extend(warnings(car.why_not_driven().as_slice()));
    let mut parts = gearbox_parts(&car.gearbox);
    parts.extend(defaults(&car.defaults_taken));
    sheet(&car.name, head(&car.gearbox), found, parts, &car.source)
}

/// The page of a vehicle file of one shift.
pub(super) fn of_vehicle(file: &VehicleFile) -> Sheet<'_> {
    let lead = format!("ratio {:.3} to {:.3}", file.shift.ratio_offgoing(), file.shift.ratio_oncoming());
    let maps = map_figures(file, &design::rigid_model(file)).into_iter().enumerate();
    let mut parts: Vec<Part> = maps
        .map(|(at, (_, figure))| Part {
            heading: (at == 0).then(|| "Maps".to_owned()),
            content: Content::Figure(figure),
            caption: String::new(),
        })
        .collect();
    parts.extend(defaults(&file.defaults_taken));
    sheet(&file.name, lead, warnings(&file.implausible()), parts, &file.source)
}

fn sheet<'a>(name: &'a str, lead: String, sentences: Vec<String>, parts: Vec<Part>, source: &'a Source) -> Sheet<'a> {
    Sheet { name, title: "check", lead, sentences, parts, sources: vec![source] }
}

fn warnings(texts: &[String]) -> Vec<String> {
    texts.iter().map(|text| format!("warning: {text}")).collect()
}

/// Gears as a table, train and gears as drawings.
fn gearbox_parts(gearbox: &Gearbox) -> Vec<Part> {
    let mut rows = gear_rows(gearbox).into_iter();
    let titles = rows.next().unwrap_or_default();
    let mut parts = vec![Part {
        heading: Some("Gears".to_owned()),
        content: Content::Table(titles, rows.collect()),
        caption: "Holding torque of each engaged element per N m of turbine torque.".to_owned(),
    }];
    if gearbox.has_ratios_alone() {
        parts[0].caption = String::new();
    }
    let drawn = drawings(gearbox).unwrap_or_default().into_iter().enumerate();
    parts.extend(drawn.map(|(at, (title, svg))| Part {
        heading: Some(title.clone()),
        content: Content::Drawing(svg, title),
        caption: match at {
            0 => "Shafts, planetary sets, gear pairs and elements.".to_owned(),
            1 => "Engaged elements, speeds of the shafts, and levers of the sets.".to_owned(),
            _ => String::new(),
        },
    }));
    parts
}

/// The values that are not in the file.
fn defaults(taken: &[DefaultTaken]) -> Option<Part> {
    /// Longest value that is shown as it stands in a file.
    const LONGEST: usize = 40;
    let value = |taken: &DefaultTaken| match taken.value.len() {
        0..=LONGEST => taken.value.clone(),
        _ => format!("a map of {} values", taken.numbers.len()),
    };
    let rows = taken.iter().map(|taken| vec![taken.key.clone(), value(taken)]);
    (!taken.is_empty()).then(|| Part {
        heading: Some(format!("{} defaults", taken.len())),
        content: Content::Table(["key", "value"].map(str::to_owned).to_vec(), rows.collect()),
        caption:
            "Values that are not in the file. The command without --page lists those that matter most to an estimate."
                .to_owned(),
    })
}
