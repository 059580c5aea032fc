//! `wetclutch study` and `wetclutch merge`.

use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use config::Study;
use report::StudyPage;
use report::shift_figure::observers_of;
use report::tables::phase_name;
use study::campaign::PHASES;
use study::{Campaign, Row, Summary, estimates_trace, execute};
use trace::{ColumnKind, GrowingTable, partial_path, read_rows, units};

use crate::args::{Merge, Shard, StudyOptions};
use crate::commands::{progress, write_text, write_trace};
use crate::failure::Failure;
use crate::output;

const ROWS: &str = "runs.csv";
const MANIFEST: &str = "study.json";
/// Rows after which the table is flushed: what a kill can cost.
const FLUSH_EVERY: u64 = 64;

pub(crate) fn study(options: &StudyOptions) -> Result<(), Failure> {
    let campaign = Campaign::new(Study::read(&options.study)?)?;
    if let Some(run) = options.run {
        return one_run(&campaign, run, options);
    }
    let runs = options.shard.map_or(0..campaign.study.runs, |shard| shard.of(campaign.study.runs));
    let rows = options.output.join(ROWS);
    let manifest = manifest(&campaign.study, options.shard, &runs);
    let mut summary = Summary::new(&campaign.study);
    let header = campaign.layout.header().join(",");

    let mut next = runs.start;
    if rows.exists() {
        check_manifest(&options.output, &manifest)?;
        if !options.resume {
            return Err(Failure::Input(format!(
                "{}: the study is complete\nhint: choose another folder, or --resume to write its page anew",
                rows.display()
            )));
        }
        collect(&rows, &header, &campaign, runs.clone(), &mut summary)?;
        next = runs.end;
    }
    if next < runs.end {
        let mut table = open(&campaign, options, &header, &manifest, &runs, &mut summary, &mut next)?;
        let bar = progress(runs.end - runs.start, next - runs.start);
        execute::<Failure>(&campaign, next..runs.end, options.threads.count(), |row| {
            table.append(&row.line(&campaign.layout)).map_err(|error| Failure::writing(&rows, &error))?;
            if (row.run + 1).is_multiple_of(FLUSH_EVERY) {
                table.flush().map_err(|error| Failure::writing(&rows, &error))?;
            }
            summary.push(row);
            bar.inc(1);
            Ok(())
        })?;
        bar.finish_and_clear();
        table.finish().map_err(|error| Failure::writing(&rows, &error))?;
    }
    finish(&campaign, &summary, &options.output, &options.study)
}

/// The table to write to: a new one, or the one that was left unfinished.
fn open(
    campaign: &Campaign,
    options: &StudyOptions,
    header: &str,
    manifest: &str,
    runs: &Range<u64>,
    summary: &mut Summary,
    next: &mut u64,
) -> Result<GrowingTable, Failure> {
    let rows = options.output.join(ROWS);
    let writing = |error: io::Error| Failure::writing(&rows, &error);
    if !partial_path(&rows).exists() {
        if options.resume {
            output::note("nothing to resume here: starting anew");
        }
        write_text(&options.output.join(MANIFEST), manifest)?;
        return GrowingTable::create(&rows, header).map_err(writing);
    }
    if !options.resume {
        return Err(Failure::Input(format!(
            "{}: an unfinished study is here\nhint: --resume completes it; or choose another folder",
            options.output.display()
        )));
    }
    check_manifest(&options.output, manifest)?;
    let table = GrowingTable::resume(&rows, header, |line| {
        let row = Row::from_cells(line.split(','), &campaign.layout).filter(|row| row.run == *next && *next < runs.end);
        if let Some(row) = &row {
            summary.push(row);
            *next += 1;
        }
        row.is_some()
    });
    output::note(&format!("resuming after {} of {} runs", *next - runs.start, runs.end - runs.start));
    table.map_err(writing)
}

/// Reads the rows of these runs from a finished table.
fn collect(
    rows: &Path,
    header: &str,
    campaign: &Campaign,
    runs: Range<u64>,
    summary: &mut Summary,
) -> Result<(), Failure> {
    let mut expected = runs.start;
    let read = read_rows(rows, header, |line| {
        let row = Row::from_cells(line.split(','), &campaign.layout).filter(|row| row.run == expected);
        expected += 1;
        row.inspect(|row| summary.push(row)).is_some()
    });
    read.map_err(|error| Failure::Input(format!("{}: {error}", rows.display())))?;
    if expected != runs.end {
        let message = format!("{}: holds {} runs of {}", rows.display(), expected - runs.start, runs.end - runs.start);
        return Err(Failure::Input(message));
    }
    Ok(())
}

pub(crate) fn merge(options: &Merge) -> Result<(), Failure> {
    let campaign = Campaign::new(Study::read(&options.study)?)?;
    let rows = options.output.join(ROWS);
    if rows.exists() || partial_path(&rows).exists() {
        return Err(Failure::Input(format!("{}: there is a study already", options.output.display())));
    }
    let count = options.shards.len() as u64;
    let header = campaign.layout.header().join(",");
    let total = campaign.study.runs;
    // Every shard is looked at before anything is written.
    for (folder, shard) in options.shards.iter().zip(shards(count)) {
        check_manifest(folder, &manifest(&campaign.study, Some(shard), &shard.of(total))).map_err(|failure| {
            let order = format!("\nhint: give all {count} shards, in their order");
            Failure::Input(format!("{failure}{order}"))
        })?;
    }
    let mut summary = Summary::new(&campaign.study);
    let writing = |error: io::Error| Failure::writing(&rows, &error);
    let mut table = GrowingTable::create(&rows, &header).map_err(writing)?;
    for (folder, shard) in options.shards.iter().zip(shards(count)) {
        let part = folder.join(ROWS);
        collect(&part, &header, &campaign, shard.of(total), &mut summary)?;
        let copied = read_rows(&part, &header, |line| table.append(line).is_ok());
        copied.map_err(|error| Failure::writing(&rows, &error))?;
    }
    write_text(&options.output.join(MANIFEST), &manifest(&campaign.study, None, &(0..total)))?;
    table.finish().map_err(writing)?;
    finish(&campaign, &summary, &options.output, &options.study)
}

fn shards(count: u64) -> impl Iterator<Item = Shard> {
    (1..=count).map(move |index| Shard { index, count })
}

/// What a folder's rows follow from.
fn manifest(study: &Study, shard: Option<Shard>, runs: &Range<u64>) -> String {
    let manifest = serde_json::json!({
        "wetclutch": env!("CARGO_PKG_VERSION"),
        "study": study.name,
        "sha256": study.fingerprint(),
        "shard": shard.map(|shard| shard.to_string()),
        "first_run": runs.start,
        "runs": runs.end - runs.start,
    });
    format!("{manifest:#}\n")
}

fn check_manifest(folder: &Path, expected: &str) -> Result<(), Failure> {
    let path = folder.join(MANIFEST);
    let found = std::fs::read_to_string(&path).map_err(|error| {
        Failure::Input(format!("{}: {error}\nhint: is this the folder of a study?", path.display()))
    })?;
    if found == expected {
        return Ok(());
    }
    let hint =
        "the study file, its experiment or vehicle, the program or the shard changed since; choose another folder";
    Err(Failure::Input(format!("{}: belongs to another study\nhint: {hint}", path.display())))
}

/// Everything that follows from the rows.
fn finish(campaign: &Campaign, summary: &Summary, folder: &Path, file: &Path) -> Result<(), Failure> {
    let rows = folder.join(ROWS);
    let kind = |name: &str| match name {
        "run" | "seed" => ColumnKind::Whole,
        "status" => ColumnKind::Word,
        _ => ColumnKind::Number,
    };
    let parquet = rows.with_extension("parquet");
    trace::write_parquet(&rows, &parquet, kind).map_err(|error| Failure::writing(&parquet, &error))?;
    let worst = summary.worst.iter().map(|row| campaign.run_in_full(row.run)).collect::<Result<Vec<_>, _>>()?;
    let command = format!("wetclutch study {}", file.display());
    let page = StudyPage::of(summary, &campaign.study, &worst, &command)?;
    let html = folder.join("study.html");
    write_text(&html, &page.html)?;
    for (name, svg) in &page.figures {
        write_text(&folder.join("figures").join(name), svg)?;
    }
    print(summary, &html)
}

fn print(summary: &Summary, page: &Path) -> Result<(), Failure> {
    let statuses = summary.statuses.iter().map(|(status, count)| format!("{count} {}", status.name()));
    output::line(&format!("{}\n", statuses.collect::<Vec<_>>().join(", ")))?;
    let head = ["phase", "observer", "RMS MPa: median", "95 %", "worst", "over open loop: median", "worst", "better"];
    let mut table = vec![head.map(str::to_owned).to_vec()];
    for (i, phase) in PHASES.into_iter().enumerate() {
        for (observer, name) in summary.layout.observers.iter().enumerate() {
            let (rms, ratio) = (summary.rms(observer, i), summary.ratio(observer, i));
            let mpa = |pascal: f64| format!("{:.4}", units::mpa(pascal));
            let mut row = vec![phase_name(phase).to_owned(), name.clone()];
            row.extend([mpa(rms.quantile(0.5)), mpa(rms.quantile(0.95)), mpa(rms.largest())]);
            if summary.layout.open_loop.is_some_and(|open_loop| open_loop != observer) {
                let better = format!("{:.0} %", 100.0 * ratio.share_below(1.0));
                row.extend([format!("{:.2}", ratio.quantile(0.5)), format!("{:.2}", ratio.largest()), better]);
            }
            table.push(row);
        }
    }
    output::table(2, &table)?;
    output::line(&format!("\npage: {}", page.display()))?;
    Ok(())
}

/// One run again, with every signal.
fn one_run(campaign: &Campaign, number: u64, options: &StudyOptions) -> Result<(), Failure> {
    if number >= campaign.study.runs {
        return Err(Failure::Input(format!("the study's runs are 0 to {}", campaign.study.runs - 1)));
    }
    let run = campaign.run_in_full(number)?;
    let at = |name: &str| -> PathBuf { options.output.join(format!("run_{number}{name}")) };
    write_trace(&at(".csv"), &run.trace)?;
    for observer in &run.observers {
        let name = observer.entry.name.replace([' ', ',', '/'], "_");
        write_trace(&at(&format!("_{name}.csv")), &estimates_trace(&observer.time_s, &observer.estimates))?;
    }
    let figure = at(".svg");
    write_text(&figure, &observers_of(&run.observers, &run.trace, run.quality.as_ref()).svg())?;
    let row = campaign.row(number)?;
    let names = campaign.layout.header();
    let cells = row.line(&campaign.layout);
    for (name, cell) in names.iter().zip(cells.split(',')).filter(|(_, cell)| !cell.is_empty()) {
        output::line(&format!("{name} {cell}"))?;
    }
    output::line(&format!("figure: {}", figure.display()))?;
    Ok(())
}
