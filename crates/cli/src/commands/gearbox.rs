//! A gearbox file in `wetclutch check`: tables on standard output, diagrams as SVG.

use std::path::Path;

use config::GearboxFile;
use drivetrain::{PhaseOrder, ShiftKind};
use geartrain::{Capacity, Change, Gearbox, Shift};
use report::gearbox_figure::{gear_figure, train_figure};
use trace::ShownPath as _;

use crate::failure::Failure;
use crate::output;

pub(super) fn describe(file: &GearboxFile, folder: Option<&Path>) -> Result<(), Failure> {
    let gearbox = &file.gearbox;
    for warning in &file.warnings {
        output::note(&format!("warning: {warning}"));
    }
    output::line(&head(gearbox))?;
    gears(gearbox)?;
    capacities(gearbox, &gearbox.capacities)?;
    shifts(gearbox)?;
    order_of_phases()?;
    for remark in remarks(gearbox) {
        output::line(&format!("\n{remark}"))?;
    }
    match folder {
        Some(folder) => draw(gearbox, folder),
        None => Ok(()),
    }
}

/// What the file describes, and on which level.
pub(super) fn head(gearbox: &Gearbox) -> String {
    let known = match (&gearbox.train, gearbox.has_ratios_alone()) {
        (Some(train), _) => {
            let parts = [
                (train.shafts.len(), "shaft", "shafts"),
                (train.sets.len(), "planetary set", "planetary sets"),
                (train.pairs.len(), "gear pair", "gear pairs"),
                (train.elements.len(), "element", "elements"),
                (train.degrees_of_freedom(), "degree of freedom", "degrees of freedom"),
            ];
            let named = parts.iter().filter(|part| part.0 > 0);
            let named = named.map(|(count, one, more)| format!("{count} {}", if *count == 1 { one } else { more }));
            format!("stick diagram of {}", named.collect::<Vec<_>>().join(", "))
        }
        (None, false) => format!("ratios and holding torques of {} elements", gearbox.elements.len()),
        (None, true) => "ratios alone".to_owned(),
    };
    format!("gearbox \"{}\": {known}", gearbox.name)
}

/// A number, or nothing where it is zero within its digits.
fn short(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    text.strip_prefix('-').filter(|digits| digits.chars().all(|c| "0.".contains(c))).map(str::to_owned).unwrap_or(text)
}

/// The gears with their ratios and holding torques, after a row of titles.
pub(super) fn gear_rows(gearbox: &Gearbox) -> Vec<Vec<String>> {
    let forward = gearbox.forward_gears();
    let mut rows = vec![["gear", "ratio", "step"].map(str::to_owned).to_vec()];
    rows[0].extend(gearbox.elements.iter().map(|element| element.name.clone()));
    for (at, gear) in gearbox.gears.iter().enumerate() {
        let lower = forward.iter().position(|&other| other == at).and_then(|place| place.checked_sub(1));
        let step =
            lower.map_or_else(String::new, |lower| format!("{:.3}", gearbox.gears[forward[lower]].ratio / gear.ratio));
        let mut row = vec![gear.name.clone(), format!("{:.4}", gear.ratio), step];
        row.extend((0..gearbox.elements.len()).map(|element| {
            let holding = gear.holding.iter().find(|holding| holding.element == element);
            holding.map_or_else(String::new, |holding| short(holding.per_turbine_torque, 3))
        }));
        rows.push(row);
    }
    rows
}

/// Prints the gears with their ratios and holding torques.
pub(super) fn gears(gearbox: &Gearbox) -> Result<(), Failure> {
    let what = if gearbox.has_ratios_alone() {
        ""
    } else {
        ", holding torque of each engaged element per N m of turbine torque"
    };
    output::line(&format!("\ngears{what}"))?;
    output::list(1, &gear_rows(gearbox))?;
    let loose: Vec<&str> =
        gearbox.gears.iter().filter(|gear| !gear.holding_is_unique).map(|gear| gear.name.as_str()).collect();
    if !loose.is_empty() {
        output::line(&format!("in {} other torques are possible too; the smallest are shown", loose.join(", ")))?;
    }
    Ok(())
}

/// Prints what elements hold beside what is asked of them.
pub(super) fn capacities(gearbox: &Gearbox, capacities: &[Capacity]) -> Result<(), Failure> {
    if capacities.is_empty() {
        return Ok(());
    }
    let titles =
        ["element", "kind", "faces", "holds N m", "needed N m", "in gear", "factor"].map(str::to_owned).to_vec();
    let mut rows = Vec::new();
    for capacity in capacities {
        let element = &gearbox.elements[capacity.element];
        rows.push(vec![
            element.name.clone(),
            element.kind.name().to_owned(),
            element.pack.map_or_else(String::new, |pack| format!("{:.0}", pack.friction_faces)),
            format!("{:.0}", capacity.capacity_n_m),
            format!("{:.0}", capacity.wanted_n_m),
            gearbox.gears[capacity.gear].name.clone(),
            format!("{:.2}", capacity.ratio()),
        ]);
    }
    output::line("\ncapacity at line pressure and the largest torque of the gears")?;
    output::table(2, titles, rows)?;
    Ok(())
}

/// Pairs of gears in the order of the file, as the upshift where both gears turn forward.
fn pairs(gearbox: &Gearbox) -> impl Iterator<Item = &Shift> {
    gearbox.shifts.iter().filter(|shift| {
        let [from, to] = [shift.from, shift.to].map(|gear| gearbox.gears[gear].ratio);
        if from * to > 0.0 && from != to { from.abs() > to.abs() } else { shift.from < shift.to }
    })
}

/// Prints the shifts with their elements, and those that need more than one element off and on.
pub(super) fn shifts(gearbox: &Gearbox) -> Result<(), Failure> {
    let name = |element: usize| gearbox.elements[element].name.as_str();
    let names = |elements: &[usize]| elements.iter().map(|&element| name(element)).collect::<Vec<_>>().join(" ");
    let gear = |at: usize| gearbox.gears[at].name.as_str();
    let heads = ["shift", "off", "on", "held", "alpha off", "alpha on", "M11", "M12", "M22 kg m2", "1/(i_off - i_on)"];
    let mut rows = Vec::new();
    let mut others: Vec<(String, Vec<String>)> = Vec::new();
    for shift in pairs(gearbox) {
        let label = format!("{}-{}", gear(shift.from), gear(shift.to));
        let (off, on, held) = match &shift.change {
            Change::Single { offgoing, oncoming, held } => (name(*offgoing), name(*oncoming), names(held)),
            Change::Unknown => ("", "", String::new()),
            change => {
                let kind = change.name();
                match others.iter_mut().find(|other| other.0 == kind) {
                    Some((_, labels)) => labels.push(label),
                    None => others.push((kind, vec![label])),
                }
                continue;
            }
        };
        let mut row = vec![label, off.to_owned(), on.to_owned(), held];
        row.extend(match &shift.reduced {
            Some(reduced) => {
                let alpha = |slip: [f64; 2]| if off.is_empty() { String::new() } else { short(slip[0], 3) };
                let mass = reduced.mass_kg_m2;
                vec![
                    alpha(reduced.slip_offgoing),
                    alpha(reduced.slip_oncoming),
                    short(mass[0][0], 4),
                    short(mass[0][1], 4),
                    short(mass[1][1], 4),
                ]
            }
            None => vec![String::new(); 5],
        });
        let [i_off, i_on] = [shift.from, shift.to].map(|gear| gearbox.gears[gear].ratio);
        // Between forward and reverse, and between gears of one ratio, there is no torque phase.
        let has_gain = i_off * i_on > 0.0 && !gearbox.is_same_ratio(shift.from, shift.to);
        row.push(if has_gain { short(1.0 / (i_off - i_on), 2) } else { String::new() });
        rows.push(row);
    }
    output::line("\nshifts between one element and another; the way back exchanges off and on")?;
    output::table(4, heads.map(str::to_owned).to_vec(), rows)?;
    for (kind, labels) in others {
        let what = match kind.as_str() {
            "interrupted" => "only dogs change, no clutch takes the load over".to_owned(),
            kind => format!("{kind} transition"),
        };
        output::line(&format!("{what}: {}", labels.join(" ")))?;
    }
    Ok(())
}

/// Which phase comes first in each kind of shift.
fn order_of_phases() -> Result<(), Failure> {
    output::line("\norder of the phases")?;
    let order = |kind: ShiftKind| {
        let phases = match kind.order() {
            PhaseOrder::TorqueFirst => "torque phase, then inertia phase by the oncoming element",
            PhaseOrder::InertiaFirst => "inertia phase by the offgoing element, then torque phase",
        };
        vec![kind.name().to_owned(), phases.to_owned()]
    };
    output::list(2, &ShiftKind::ALL.map(order))?;
    Ok(())
}

/// What the description does not tell.
fn remarks(gearbox: &Gearbox) -> Vec<String> {
    let mut remarks = Vec::new();
    if gearbox.has_ratios_alone() {
        remarks.push(
            "With ratios alone, clutch torques are known as torques at the turbine. Clutch torques need the holding torques \
             of the elements (level = \"shares\"), pressures need their plates and pistons (`pack`) as well."
                .to_owned(),
        );
        return remarks;
    }
    let without: Vec<&str> = (gearbox.elements.iter())
        .filter(|element| {
            element.pack.is_none()
                && matches!(element.kind, geartrain::ElementKind::Clutch | geartrain::ElementKind::Brake)
        })
        .map(|element| element.name.as_str())
        .collect();
    if !without.is_empty() {
        let names = without.join(", ");
        remarks.push(format!(
            "Without a `pack` the torque of an element is known, its pressure and capacity are not: {names}."
        ));
    }
    if gearbox.shifts.iter().any(|shift| matches!(shift.change, Change::Single { .. }) && shift.reduced.is_none()) {
        remarks.push(
            "A shift without M11, M12 and M22 cannot be simulated or observed: give it in `shift_mass`, or describe the stick \
             diagram."
                .to_owned(),
        );
    }
    remarks
}

/// Drawings of the train and of each gear, with what they show; none without a stick diagram.
pub(super) fn drawings(gearbox: &Gearbox) -> Option<Vec<(String, String)>> {
    let mut drawings = vec![("Train".to_owned(), train_figure(gearbox)?)];
    let gears = gearbox.gears.iter().enumerate();
    drawings.extend(gears.filter_map(|(at, gear)| Some((format!("Gear {}", gear.name), gear_figure(gearbox, at)?))));
    Some(drawings)
}

/// Writes the diagrams of the train and of each gear.
pub(super) fn draw(gearbox: &Gearbox, folder: &Path) -> Result<(), Failure> {
    let Some(train) = train_figure(gearbox) else {
        let message = "only a stick diagram can be drawn\nhint: leave -o out, or describe shafts, sets and elements";
        return Err(Failure::Input(message.to_owned()));
    };
    let mut figures = vec![("train.svg".to_owned(), train)];
    for (at, gear) in gearbox.gears.iter().enumerate() {
        let Some(figure) = gear_figure(gearbox, at) else { continue };
        let name = format!("gear_{}.svg", file_part(&gear.name));
        // Some file systems take R and r for the same.
        let is_taken = figures.iter().any(|other| other.0.to_lowercase() == name.to_lowercase());
        let name = if is_taken { format!("gear_{}_{}.svg", file_part(&gear.name), at + 1) } else { name };
        figures.push((name, figure));
    }
    let names: Vec<&str> = figures.iter().map(|figure| figure.0.as_str()).collect();
    super::replaceable(folder, &names)?;
    for (name, svg) in &figures {
        super::write_text(&folder.join(name), svg)?;
    }
    output::line(&format!("\nwrote {} and {} gears to {}", names[0], names.len() - 1, folder.shown()))?;
    Ok(())
}

/// The name of a gear as a part of the name of a file.
fn file_part(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-.".contains(c) { c } else { '_' }).collect()
}
