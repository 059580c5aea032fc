//! `wetclutch compare`: two runs, or two files of cars, over each other.

use report::tables::number;
use serde_json::{Value, json};
use trace::ShownPath as _;
use trace::shown_units::quantity;
use wetclutch::compare::runs::{unit_of, words_of};
use wetclutch::compare::{
    Comparison, FileComparison, Matching, RunComparison, SIGNALS, ShiftOfRun, ShiftPair, compare as find,
};

use super::compare_page::sheet;
use super::written::{is_page, replaces_only};
use super::{check_output, not_an_input, write_text};
use crate::args::Compare;
use crate::browser;
use crate::failure::Failure;
use crate::output;

/// Rows of a table that a terminal shows.
const SHOWN: usize = 30;

pub(crate) fn compare(options: &Compare) -> Result<(), Failure> {
    check_output(options.output.as_ref())?;
    not_an_input(options.output.as_ref(), [&options.a, &options.b])?;
    options.output.as_deref().map_or(Ok(()), |page| replaces_only("page in HTML", page, is_page))?;
    let found = find(&options.a, &options.b)?;
    if let Some(page) = &options.output {
        write_text(page, &sheet(&found, [&options.a, &options.b]).html()?)?;
    }
    if options.json {
        output::json(&json_of(&found))?;
    } else {
        match &found {
            Comparison::Files(files) => print_files(files, options)?,
            Comparison::Runs(runs) => print_runs(runs)?,
        }
    }
    if let Some(page) = &options.output {
        output::note(&format!("page: {}", page.shown()));
        browser::open_if(options.open.is_wanted, page);
    }
    Ok(())
}

fn print_files(files: &FileComparison, options: &Compare) -> Result<(), Failure> {
    output::line(&format!("A: {}\nB: {}", options.a.shown(), options.b.shown()))?;
    output::line(&files_sentence(files))?;
    if files.differences.is_empty() {
        return Ok(());
    }
    let (titles, rows) = file_rows(files);
    output::line("")?;
    Ok(output::table(1, titles, rows)?)
}

/// How many keys differ, in a sentence.
pub(super) fn files_sentence(files: &FileComparison) -> String {
    match files.differences.len() {
        0 => format!("All {} keys have the same values.", files.same),
        1 => format!("1 key differs, and {} have the same values.", files.same),
        count => format!("{count} keys differ, and {} have the same values.", files.same),
    }
}

/// Titles and rows of the keys that differ.
pub(super) fn file_rows(files: &FileComparison) -> (Vec<String>, Vec<Vec<String>>) {
    let rows = files.differences.iter().map(|difference| {
        let value =
            |at: usize| difference.values[at].as_ref().map_or_else(|| "\u{2013}".to_owned(), |value| value.short());
        vec![
            difference.key.clone(),
            value(0),
            value(1),
            difference.unit.unwrap_or_default().to_owned(),
            difference.relative.map_or(String::new(), percent),
        ]
    });
    (["key", "A", "B", "unit", "B over A"].map(str::to_owned).to_vec(), rows.collect())
}

/// A relative difference with its sign.
fn percent(fraction: f64) -> String {
    let decimals = usize::from(fraction.abs() < 0.1);
    let text = format!("{:+.decimals$} %", 100.0 * fraction);
    if is_zero(&text) { text[1..].to_owned() } else { text }
}

fn print_runs(runs: &RunComparison) -> Result<(), Failure> {
    for (name, (path, shifts)) in ["A", "B"].iter().zip(runs.paths.iter().zip(runs.shifts)) {
        output::line(&format!("{name}: {}, {}", path.shown(), shifts_counted(shifts)))?;
    }
    for sentence in run_sentences(runs) {
        output::line(&sentence)?;
    }
    output::line("\nquantities over these shifts, the largest difference first\n")?;
    let (titles, rows) = quantity_rows(runs);
    output::table(1, titles, rows)?;
    output::line("\nshifts, the largest difference first\n")?;
    let (titles, mut rows) = pair_rows(runs);
    let more = rows.len().saturating_sub(SHOWN);
    rows.truncate(SHOWN);
    output::titled_lines(4, &titles, &rows).iter().try_for_each(|line| output::line(line))?;
    if more > 0 {
        output::line(&format!("and {more} more shifts"))?;
    }
    Ok(())
}

/// How the shifts were matched, and which are of one run alone.
pub(super) fn run_sentences(runs: &RunComparison) -> Vec<String> {
    let by = match runs.matching {
        Matching::Time => "by their times and gears",
        Matching::Order => "by gears and kind, in the order in which they come",
    };
    let are = if runs.pairs.len() == 1 { "is" } else { "are" };
    let mut sentences = vec![format!("{} {are} in both runs, matched {by}.", shifts_counted(runs.pairs.len()))];
    for (name, only) in ["A", "B"].iter().zip(&runs.only) {
        if !only.is_empty() {
            sentences.push(format!("In {name} alone: {}.", listed(only)));
        }
    }
    if let Some(path) = &runs.without_signals {
        sentences.push(format!("The signals of {} are not there: no curves are compared.", path.shown()));
    }
    sentences
}

fn shifts_counted(count: usize) -> String {
    if count == 1 { "1 shift".to_owned() } else { format!("{count} shifts") }
}

fn listed(shifts: &[ShiftOfRun]) -> String {
    const LISTED: usize = 8;
    let one = |shift: &ShiftOfRun| format!("{} at {}", shift.name(), quantity(shift.time_s[0], "s", 2));
    let names: Vec<String> = shifts.iter().take(LISTED).map(one).collect();
    let more = shifts.len().saturating_sub(LISTED);
    if more > 0 { format!("{}, and {more} more", names.join(", ")) } else { names.join(", ") }
}

/// A value of a quantity with its unit.
fn shown(value: f64, name: &str) -> String {
    let text = match unit_of(name) {
        "" if name == "rating" => number(value, 1),
        "" => format!("{} %", number(100.0 * value, 1)),
        "Pa" => quantity(1e-3 * value, "kPa", 1),
        "J" => quantity(1e-3 * value, "kJ", 2),
        "s" => quantity(value, "s", 2),
        unit @ ("m/s^2" | "m/s^1.75") => quantity(value, unit, 2),
        unit => quantity(value, unit, 1),
    };
    // Zero has no sign.
    if is_zero(&text) { text.trim_start_matches('-').to_owned() } else { text }
}

/// Whether the number that a text begins with is zero.
fn is_zero(text: &str) -> bool {
    text.split(' ').next().is_some_and(|digits| !digits.contains(|c: char| ('1'..='9').contains(&c)))
}

/// The same of a difference, with its sign.
fn signed(value: f64, name: &str) -> String {
    let text = shown(value, name);
    if text.starts_with('-') || is_zero(&text) { text } else { format!("+{text}") }
}

/// Titles and rows of the quantities.
pub(super) fn quantity_rows(runs: &RunComparison) -> (Vec<String>, Vec<Vec<String>>) {
    let titles = ["quantity", "of", "A", "B", "B - A", "mean |B - A|", "largest", "in shift", "shifts"];
    let rows = runs.quantities.iter().map(|found| {
        let [a, b] = found.means;
        vec![
            words_of(&found.name),
            found.group.name().to_owned(),
            shown(a, &found.name),
            shown(b, &found.name),
            signed(b - a, &found.name),
            shown(found.mean_absolute, &found.name),
            signed(found.largest.1, &found.name),
            found.largest.0.to_string(),
            found.count.to_string(),
        ]
    });
    (titles.map(str::to_owned).to_vec(), rows.collect())
}

/// Titles and rows of the shifts.
pub(super) fn pair_rows(runs: &RunComparison) -> (Vec<String>, Vec<Vec<String>>) {
    let titles = [
        "# A",
        "# B",
        "shift",
        "kind",
        "begin s",
        "largest difference",
        "A",
        "B",
        "rating",
        "torque range",
        "curves: pressure kPa",
        "torque N m",
        "health",
    ];
    let mut titles = titles.map(str::to_owned).to_vec();
    let mut rows: Vec<Vec<String>> = runs.pairs.iter().map(pair_row).collect();
    // Columns that no shift fills.
    for at in (0..titles.len()).rev() {
        if !rows.is_empty() && rows.iter().all(|row| row[at].is_empty()) {
            titles.remove(at);
            rows.iter_mut().for_each(|row| drop(row.remove(at)));
        }
    }
    (titles, rows)
}

fn pair_row(pair: &ShiftPair) -> Vec<String> {
    let [a, b] = &pair.shifts;
    let change = |name: &str| {
        let of = pair.differences.iter().find(|difference| difference.name == name);
        of.map(|of| of.values)
    };
    let widths = ["oncoming_torque_range_n_m", "offgoing_torque_range_n_m"].map(change);
    let widened = widths.into_iter().flatten().map(|[a, b]| b / a - 1.0).filter(|by| by.is_finite());
    let widened = widened.max_by(|a, b| a.abs().total_cmp(&b.abs()));
    let of_curves = |unit: &str, size: f64, decimals: usize| {
        let of =
            SIGNALS.iter().zip(&pair.rms).filter(|(signal, _)| signal.unit == unit && signal.title.contains("clutch"));
        let largest = of.filter_map(|(_, rms)| *rms).reduce(f64::max);
        largest.map_or(String::new(), |rms| number(size * rms, decimals))
    };
    let words = |of: [&str; 2]| of.map(|word| word.replace('_', " ")).join(" -> ");
    let (kind, health) = ([&*a.kind, &*b.kind], [&*a.health, &*b.health]);
    let both = |[a, b]: [&str; 2]| {
        if a == b || b.is_empty() {
            a.replace('_', " ")
        } else if a.is_empty() {
            b.replace('_', " ")
        } else {
            words([a, b])
        }
    };
    let largest = pair.differences.first().filter(|difference| difference.size > 0.0);
    vec![
        a.number.to_string(),
        b.number.to_string(),
        a.name(),
        both(kind),
        number(a.time_s[0], 2),
        largest.map_or("none".to_owned(), |of| words_of(&of.name)),
        largest.map_or(String::new(), |of| shown(of.values[0], &of.name)),
        largest.map_or(String::new(), |of| shown(of.values[1], &of.name)),
        change("rating").map_or(String::new(), |[a, b]| signed(b - a, "rating")),
        widened.map_or(String::new(), percent),
        of_curves("Pa", 1e-3, 1),
        of_curves("N m", 1.0, 1),
        both(health),
    ]
}

/// The comparison in SI units.
fn json_of(found: &Comparison) -> Value {
    match found {
        Comparison::Files(files) => json!({
            "compared": "files",
            "kind": files.kind,
            "same": files.same,
            "differences": files.differences.iter().map(|difference| {
                let value = |at: usize| difference.values[at].as_ref().map(|value| json!({
                    "value": value.text,
                    "default": value.is_default,
                }));
                json!({
                    "key": difference.key,
                    "a": value(0),
                    "b": value(1),
                    "unit": difference.unit,
                    "relative": difference.relative,
                })
            }).collect::<Vec<_>>(),
        }),
        Comparison::Runs(runs) => json!({
            "compared": "runs",
            "a": runs.paths[0].shown().to_string(),
            "b": runs.paths[1].shown().to_string(),
            "matched_by": match runs.matching { Matching::Time => "time", Matching::Order => "order" },
            "quantities": runs.quantities.iter().map(|found| json!({
                "name": found.name,
                "group": found.group.name(),
                "mean_a": found.means[0],
                "mean_b": found.means[1],
                "mean_absolute_difference": found.mean_absolute,
                "largest_difference": found.largest.1,
                "in_shift": found.largest.0,
                "shifts": found.count,
            })).collect::<Vec<_>>(),
            "shifts": runs.pairs.iter().map(json_of_pair).collect::<Vec<_>>(),
            "only_a": runs.only[0].iter().map(json_of_shift).collect::<Vec<_>>(),
            "only_b": runs.only[1].iter().map(json_of_shift).collect::<Vec<_>>(),
        }),
    }
}

fn json_of_shift(shift: &ShiftOfRun) -> Value {
    json!({
        "number": shift.number,
        "time_s": shift.time_s[0],
        "from_gear": shift.gears[0],
        "to_gear": shift.gears[1],
        "kind": shift.kind,
        "worst_health": shift.health,
    })
}

fn json_of_pair(pair: &ShiftPair) -> Value {
    let [a, b] = &pair.shifts;
    let differences = pair.differences.iter().map(|difference| {
        let [a, b] = difference.values;
        (difference.name.clone(), json!({ "a": a, "b": b }))
    });
    let curves = SIGNALS.iter().zip(&pair.rms).filter_map(|(signal, rms)| {
        Some(json!({ "signal": signal.title, "unit": signal.unit, "rms_difference": (*rms)? }))
    });
    json!({
        "a": json_of_shift(a),
        "b": json_of_shift(b),
        "differences": differences.collect::<serde_json::Map<_, _>>(),
        "curves": curves.collect::<Vec<_>>(),
    })
}
