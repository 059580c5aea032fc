//! `wetclutch study` and `wetclutch merge`.

use std::ops::Range;
use std::path::{Path, PathBuf};

use config::Study;
use report::StudyPage;
use report::shift_figure::observers_of;
use report::study_page::diverged;
use report::tables::{COMPARED_NAMES, number, phase_name};
use study::campaign::PHASES;
use study::{Campaign, Row, Summary, estimates_trace, execute};
use trace::{ColumnKind, Damage, FolderLock, GrowingTable, partial_path, read_rows, units};

use crate::args::{Merge, Shard, StudyOptions};
use crate::commands::{progress, shell_quoted, writable, write_text, write_trace};
use crate::failure::Failure;
use crate::output;

const ROWS: &str = "runs.csv";
const MANIFEST: &str = "study.json";
/// Number of rows after which the table is flushed: a killed program loses fewer rows than that.
const FLUSH_EVERY: u64 = 64;

/// A study, whole or a shard of it, and the folder with its rows.
struct Part<'a> {
    campaign: &'a Campaign,
    folder: &'a Path,
    shard: Option<Shard>,
}

pub(crate) fn study(options: &StudyOptions) -> Result<(), Failure> {
    let study = Study::read(&options.study)?;
    if let Some(run) = options.run {
        return one_run(&Campaign::new(study)?, run, options);
    }
    let _lock = lock(&options.output)?;
    writable(&options.output, &[ROWS, "runs.parquet", "study.html"])?;
    let figures = options.output.join("figures");
    if figures.exists() {
        writable(&figures, &[])?;
    }
    let campaign = Campaign::new(study)?;
    let part = Part { campaign: &campaign, folder: &options.output, shard: options.shard };
    let mut summary = Summary::new(&campaign.study);
    if part.table().exists() {
        part.check_manifest()?;
        if !options.resume {
            return Err(Failure::Input(format!(
                "{}: the study is complete\nhint: choose another folder, or use --resume to write the page again",
                part.table().display()
            )));
        }
        part.each_row(|row| {
            summary.push(row);
            Ok(())
        })?;
    } else {
        let mut table = part.open(options.resume, &mut summary)?;
        let writing = |error| Failure::writing(&partial_path(&part.table()), &error);
        let (all, done) = (part.runs(), summary.runs());
        let bar = progress(all.end - all.start, done);
        execute::<Failure>(&campaign, all.start + done..all.end, options.threads.count(), |row| {
            table.append(&row.line(&campaign.layout)).map_err(writing)?;
            if (row.run + 1).is_multiple_of(FLUSH_EVERY) {
                table.flush().map_err(writing)?;
            }
            summary.push(row);
            bar.inc(1);
            Ok(())
        })?;
        bar.finish_and_clear();
        table.finish().map_err(writing)?;
    }
    part.finish(&summary, &options.study)
}

pub(crate) fn merge(options: &Merge) -> Result<(), Failure> {
    let campaign = Campaign::new(Study::read(&options.study)?)?;
    let count = options.shards.len() as u64;
    let shards = (1..=count).map(|index| Some(Shard { index, count }));
    let parts: Vec<Part<'_>> =
        options.shards.iter().zip(shards).map(|(folder, shard)| Part { campaign: &campaign, folder, shard }).collect();
    for part in &parts {
        part.check_manifest()
            .map_err(|failure| Failure::Input(format!("{failure}\nhint: give all {count} shards, in their order")))?;
    }
    let whole = Part { campaign: &campaign, folder: &options.output, shard: None };
    let _lock = lock(whole.folder)?;
    if whole.table().exists() {
        return Err(Failure::Input(format!(
            "{}: there is already a study in this folder\nhint: choose another folder",
            whole.folder.display()
        )));
    }
    // An unfinished table of the same study may be replaced: the shards contain all of its rows.
    if partial_path(&whole.table()).exists() {
        whole.check_manifest()?;
    }
    // Every row is checked before anything is written.
    let mut summary = Summary::new(&campaign.study);
    for part in &parts {
        part.each_row(|row| {
            summary.push(row);
            Ok(())
        })?;
    }
    let writing = |error| Failure::writing(&partial_path(&whole.table()), &error);
    let mut table = whole.create()?;
    let copied = parts
        .iter()
        .try_for_each(|part| part.each_row(|row| table.append(&row.line(&campaign.layout)).map_err(writing)));
    if let Err(failure) = copied {
        table.discard();
        return Err(failure);
    }
    table.finish().map_err(writing)?;
    whole.finish(&summary, &options.study)
}

/// Prevents other processes from writing to a folder, and checks that this one can.
fn lock(folder: &Path) -> Result<FolderLock, Failure> {
    let lock = FolderLock::take(folder).map_err(|error| Failure::writing(folder, &error))?;
    let lock = lock.ok_or_else(|| {
        let hint = "wait until the other process has ended, or choose another folder";
        Failure::Input(format!(
            "{}: another wetclutch process is writing to this folder\nhint: {hint}",
            folder.display()
        ))
    })?;
    if !lock.is_held {
        let folder = folder.display();
        output::note(&format!(
            "{folder}: this file system has no locks; do not start another wetclutch process with this folder"
        ));
    }
    Ok(lock)
}

impl Part<'_> {
    fn runs(&self) -> Range<u64> {
        let all = self.campaign.study.runs;
        self.shard.map_or(0..all, |shard| shard.of(all))
    }

    fn table(&self) -> PathBuf {
        self.folder.join(ROWS)
    }

    fn header(&self) -> String {
        self.campaign.layout.header().join(",")
    }

    /// Everything that determines the rows.
    fn manifest(&self) -> String {
        let (study, runs) = (&self.campaign.study, self.runs());
        let manifest = serde_json::json!({
            "wetclutch": env!("CARGO_PKG_VERSION"),
            "study": study.name,
            "sha256": study.fingerprint(),
            "shard": self.shard.map(|shard| shard.to_string()),
            "first_run": runs.start,
            "runs": runs.end - runs.start,
        });
        format!("{manifest:#}\n")
    }

    fn check_manifest(&self) -> Result<(), Failure> {
        let path = self.folder.join(MANIFEST);
        let found = std::fs::read_to_string(&path).map_err(|error| {
            Failure::Input(format!("{}: {error}\nhint: name the folder of a study", path.display()))
        })?;
        if found == self.manifest() {
            return Ok(());
        }
        let hint =
            "the study file, its experiment or vehicle, the program or the shard has changed; choose another folder";
        Err(Failure::Input(format!("{}: belongs to another study\nhint: {hint}", path.display())))
    }

    /// A new table of rows.
    fn create(&self) -> Result<GrowingTable, Failure> {
        write_text(&self.folder.join(MANIFEST), &self.manifest())?;
        let table = self.table();
        GrowingTable::create(&table, &self.header()).map_err(|error| Failure::writing(&partial_path(&table), &error))
    }

    /// The table to write to: a new one, or the unfinished one, after its rows.
    fn open(&self, resume: bool, summary: &mut Summary) -> Result<GrowingTable, Failure> {
        let path = self.table();
        if !partial_path(&path).exists() {
            if resume {
                output::note("no unfinished study in this folder: starting a new one");
            }
            return self.create();
        }
        if !resume {
            return Err(Failure::Input(format!(
                "{}: there is an unfinished study in this folder\nhint: use --resume to complete it, or choose another folder",
                self.folder.display()
            )));
        }
        self.check_manifest()?;
        let mut rows = self.checked_rows();
        let (table, damage) = GrowingTable::resume(&path, &self.header(), |line| {
            summary.push(&rows(line)?);
            Ok(())
        })?;
        if let Some(Damage { line, message }) = damage {
            let path = partial_path(&path);
            output::note(&format!("{}:{line}: {message}; the runs from this line on are made again", path.display()));
        }
        let all = self.runs();
        output::note(&format!("resuming after {} of {} runs", summary.runs(), all.end - all.start));
        Ok(table)
    }

    /// Reads the lines of the table as rows, in order; the error describes what is wrong with a line.
    fn checked_rows(&self) -> impl FnMut(&str) -> Result<Row, String> {
        let mut expected = self.runs();
        move |line| {
            let run = expected.next().ok_or("there is a row after the last run")?;
            self.campaign.row_of_line(run, line)
        }
    }

    /// Passes each row of the finished table to `sink`.
    fn each_row(&self, mut sink: impl FnMut(&Row) -> Result<(), Failure>) -> Result<(), Failure> {
        let (table, all) = (self.table(), self.runs());
        let (mut rows, mut count, mut failed) = (self.checked_rows(), 0, None);
        let read = read_rows(&table, &self.header(), |line| {
            count += 1;
            sink(&rows(line)?).map_err(|failure| failed.insert(failure).to_string())
        });
        if let Some(failure) = failed {
            return Err(failure);
        }
        let hint = "the table has been changed since it was written; make its runs again in another folder";
        read.map_err(|error| Failure::Input(format!("{error}\nhint: {hint}")))?;
        if count != all.end - all.start {
            let message = format!("{}: contains {count} of {} runs", table.display(), all.end - all.start);
            return Err(Failure::Input(format!("{message}\nhint: {hint}")));
        }
        Ok(())
    }

    /// Writes everything that is computed from the rows.
    fn finish(&self, summary: &Summary, file: &Path) -> Result<(), Failure> {
        let (campaign, table) = (self.campaign, self.table());
        let kind = |name: &str| match name {
            "run" | "seed" => ColumnKind::Whole,
            "status" => ColumnKind::Word,
            _ => ColumnKind::Number,
        };
        let parquet = table.with_extension("parquet");
        trace::write_parquet(&table, &parquet, kind).map_err(|error| Failure::writing(&parquet, &error))?;
        if summary.runs() == 0 {
            output::note("this shard has no runs: the table is empty, and no page is written");
            return Ok(());
        }
        let worst = summary.worst.iter().map(|row| campaign.run_in_full(row.run)).collect::<Result<Vec<_>, _>>()?;
        let command = format!("wetclutch study {}", shell_quoted(file));
        let page = StudyPage::of(summary, &campaign.study, &worst, &command)?;
        let html = self.folder.join("study.html");
        write_text(&html, &page.html)?;
        for (name, svg) in &page.figures {
            write_text(&self.folder.join("figures").join(name), svg)?;
        }
        print(summary, &html)
    }
}

fn print(summary: &Summary, page: &Path) -> Result<(), Failure> {
    let statuses = summary.statuses.iter().map(|(status, count)| format!("{count} {}", status.name()));
    output::line(&format!("{}\n", statuses.collect::<Vec<_>>().join(", ")))?;
    let mut table = vec![["phase", "observer", "RMS MPa: median", "95 %", "worst"].map(str::to_owned).to_vec()];
    for (i, phase) in PHASES.into_iter().enumerate() {
        for (observer, name) in summary.layout.observers.iter().enumerate() {
            let rms = summary.rms(observer, i);
            let mpa = |pascal: f64| number(units::mpa(pascal), 4);
            let mut row = vec![phase_name(phase).to_owned(), name.clone()];
            row.extend([mpa(rms.quantile(0.5)), mpa(rms.quantile(0.95)), mpa(rms.largest())]);
            table.push(row);
        }
    }
    output::table(2, &table)?;
    print_relative(summary)?;
    if let Some(diverged) = diverged(summary) {
        output::line(&format!("\ndiverged: {diverged}"))?;
    }
    output::line(&format!("\npage: {}", page.display()))?;
    Ok(())
}

/// Prints the errors over those of the open loop, if the study has one.
fn print_relative(summary: &Summary) -> Result<(), Failure> {
    for (compared, name) in COMPARED_NAMES.into_iter().enumerate() {
        let head =
            ["phase", "observer", "in a run: median", "95 %", "worst", "95 % over 95 %", "worst over worst", "better"];
        let mut table = vec![head.map(str::to_owned).to_vec()];
        for (i, phase) in PHASES.into_iter().enumerate() {
            for (observer, name) in summary.layout.observers.iter().enumerate() {
                let Some(relative) = summary.relative(compared, observer, i) else { continue };
                let ratios = [
                    relative.median,
                    relative.high,
                    relative.largest,
                    relative.high_over_high,
                    relative.worst_over_worst,
                ];
                let mut row = vec![phase_name(phase).to_owned(), name.clone()];
                row.extend(ratios.map(|ratio| number(ratio, 2)));
                row.push(format!("{:.0} %", (100.0 * relative.better).floor()));
                table.push(row);
            }
        }
        if table.len() > 1 {
            output::line(&format!("\nRMS error of the {name}, relative to that of the open loop\n"))?;
            output::table(2, &table)?;
        }
    }
    Ok(())
}

/// Makes one run again, with every signal.
fn one_run(campaign: &Campaign, number: u64, options: &StudyOptions) -> Result<(), Failure> {
    if number >= campaign.study.runs {
        return Err(Failure::Input(format!(
            "the study has no run {number}; its runs are 0 to {}",
            campaign.study.runs - 1
        )));
    }
    let run = campaign.run_in_full(number)?;
    let at = |name: &str| -> PathBuf { options.output.join(format!("run_{number}{name}")) };
    write_trace(&at(".csv"), &run.trace)?;
    for observer in &run.observers {
        let name = observer.entry.column();
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
