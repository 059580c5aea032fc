//! The rows of a study, whole or a shard of it, in a folder: made, resumed, checked.

use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use study::campaign::in_blocks;
use trace::{ColumnKind, Damage, FolderLock, GrowingTable, ShownPath as _, partial_path, read_rows};
use wetclutch::studies::Runs;

use super::manifest::{Manifest, in_order};
use crate::args::{Merge, Shard, StudyOptions};
use crate::commands::{progress, write_text};
use crate::failure::Failure;
use crate::output;

const ROWS: &str = "runs.csv";

/// A study, whole or a shard of it, and the folder with its rows.
pub(super) struct Part<'a, R> {
    pub(super) campaign: &'a R,
    pub(super) folder: &'a Path,
    pub(super) shard: Option<Shard>,
}

/// Prevents other processes from writing to a folder, and checks that this one can.
pub(super) fn lock(folder: &Path) -> Result<FolderLock, Failure> {
    let lock = FolderLock::take(folder).map_err(|error| Failure::writing(folder, &error))?;
    let lock = lock.ok_or_else(|| {
        let hint = "wait until the other process has ended, or choose another folder";
        Failure::Input(format!("{}: another wetclutch process is writing to this folder\nhint: {hint}", folder.shown()))
    })?;
    if !lock.is_held {
        let folder = folder.shown();
        output::note(&format!(
            "{folder}: this file system has no locks; do not start another wetclutch process with this folder"
        ));
    }
    Ok(lock)
}

impl<R: Runs> Part<'_, R> {
    pub(super) fn runs(&self) -> Range<u64> {
        let all = self.campaign.count();
        self.shard.map_or(0..all, |shard| shard.of(all))
    }

    pub(super) fn table(&self) -> PathBuf {
        self.folder.join(ROWS)
    }

    /// Writes the complete table as Parquet, too.
    pub(super) fn write_parquet(&self) -> Result<(), Failure> {
        let kind = |name: &str| match name {
            "run" | "seed" => ColumnKind::Whole,
            "status" => ColumnKind::Word,
            _ => ColumnKind::Number,
        };
        let (table, parquet) = (self.table(), self.table().with_extension("parquet"));
        trace::write_parquet(&table, &parquet, kind).map_err(|error| Failure::writing(&parquet, &error))
    }

    /// Makes the runs that are missing, or reads those of a complete table, and shows every row in its order.
    pub(super) fn make(&self, options: &StudyOptions, mut push: impl FnMut(&R::Row)) -> Result<(), Failure> {
        if self.table().exists() {
            self.check_manifest()?;
            if !options.resume {
                return Err(Failure::Input(format!(
                    "{}: the study is complete\nhint: choose another folder, or use --resume to write the page again",
                    self.table().shown()
                )));
            }
            return self.each_row(|row| {
                push(row);
                Ok(())
            });
        }
        let (mut table, done) = self.open(options.resume, &mut push)?;
        let writing = |error| self.writing(&error);
        let all = self.runs();
        let bar = progress(all.end - all.start, done);
        let mut number = all.start + done;
        let work = |run| self.campaign.make(run);
        let [block, flush_every] = self.campaign.at_once();
        in_blocks::<_, Failure>(block, number..all.end, options.threads.count(), work, |row| {
            let row = row?;
            table.append(&self.campaign.line(&row)).map_err(writing)?;
            number += 1;
            if number.is_multiple_of(flush_every) {
                table.flush().map_err(writing)?;
            }
            push(&row);
            bar.inc(1);
            Ok(())
        })?;
        bar.finish_and_clear();
        table.finish().map_err(writing)
    }

    /// The growing table could not be written; the rows so far are not lost.
    fn writing(&self, error: &io::Error) -> Failure {
        match Failure::writing(&partial_path(&self.table()), error) {
            Failure::Work(message) if error.kind() == io::ErrorKind::StorageFull => {
                let message = message.split('\n').next().unwrap_or_default();
                Failure::Work(format!(
                    "{message}\nhint: make room on the disk; --resume then continues after the rows that are complete"
                ))
            }
            failure => failure,
        }
    }

    fn header(&self) -> String {
        self.campaign.header().join(",")
    }

    /// Everything that determines the rows.
    fn manifest(&self) -> Manifest {
        let whole = Manifest::of(self.campaign);
        match self.shard {
            Some(shard) => whole.of_shard(shard, self.campaign.count()),
            None => whole,
        }
    }

    pub(super) fn check_manifest(&self) -> Result<(), Failure> {
        Manifest::read(self.folder)?.check(&self.manifest(), self.folder)
    }

    /// A new table of rows.
    pub(super) fn create(&self) -> Result<GrowingTable, Failure> {
        write_text(&Manifest::path(self.folder), &self.manifest().text()?)?;
        let table = self.table();
        GrowingTable::create(&table, &self.header()).map_err(|error| Failure::writing(&partial_path(&table), &error))
    }

    /// The table to write to: a new one, or the unfinished one, after its rows.
    fn open(&self, resume: bool, mut push: impl FnMut(&R::Row)) -> Result<(GrowingTable, u64), Failure> {
        let path = self.table();
        if !partial_path(&path).exists() {
            if resume {
                output::note("no unfinished study in this folder: starting a new one");
            }
            return Ok((self.create()?, 0));
        }
        if !resume {
            return Err(Failure::Input(format!(
                "{}: there is an unfinished study in this folder\nhint: use --resume to complete it, or choose another folder",
                self.folder.shown()
            )));
        }
        self.check_manifest()?;
        let (mut rows, mut done) = (self.checked_rows(), 0);
        let (table, damage) = GrowingTable::resume(&path, &self.header(), |line| {
            push(&rows(line)?);
            done += 1;
            Ok(())
        })?;
        if let Some(Damage { line, message }) = damage {
            let path = partial_path(&path);
            output::note(&format!("{}:{line}: {message}; the runs from this line on are made again", path.shown()));
        }
        let all = self.runs();
        output::note(&format!("resuming after {done} of {} runs", all.end - all.start));
        Ok((table, done))
    }

    /// Reads the lines of the table as rows, in order; the error describes what is wrong with a line.
    fn checked_rows(&self) -> impl FnMut(&str) -> Result<R::Row, String> {
        let mut expected = self.runs();
        move |line| {
            let run = expected.next().ok_or("there is a row after the last run")?;
            self.campaign.row_of_line(run, line)
        }
    }

    /// Passes each row of the finished table to `sink`.
    pub(super) fn each_row(&self, mut sink: impl FnMut(&R::Row) -> Result<(), Failure>) -> Result<(), Failure> {
        let (table, all) = (self.table(), self.runs());
        let (mut rows, mut count, mut failed) = (self.checked_rows(), 0, None);
        let read = read_rows(&table, &self.header(), |line| {
            count += 1;
            sink(&rows(line)?).map_err(|failure| failed.insert(failure).to_string())
        });
        if let Some(failure) = failed {
            return Err(failure);
        }
        let hint = "the table has been changed or removed since it was written; make its runs again in another folder";
        read.map_err(|error| Failure::Input(format!("{error}\nhint: {hint}")))?;
        if count != all.end - all.start {
            let message = format!("{}: contains {count} of {} runs", table.shown(), all.end - all.start);
            return Err(Failure::Input(format!("{message}\nhint: {hint}")));
        }
        Ok(())
    }
}

/// Puts the shards of a study together, given in any order, and shows every row in its order. The folder is locked as long as the lock lives.
pub(super) fn merged<'a, R: Runs>(
    campaign: &'a R,
    options: &'a Merge,
    mut push: impl FnMut(&R::Row),
) -> Result<(Part<'a, R>, FolderLock), Failure> {
    let parts: Vec<Part<'_, R>> = in_order(campaign, &options.shards)?
        .into_iter()
        .map(|(folder, shard)| Part { campaign, folder, shard: Some(shard) })
        .collect();
    let whole = Part { campaign, folder: &options.output, shard: None };
    let lock = lock(whole.folder)?;
    if whole.table().exists() {
        return Err(Failure::Input(format!(
            "{}: there is already a study in this folder\nhint: choose another folder",
            whole.folder.shown()
        )));
    }
    // An unfinished table of the same study may be replaced: the shards contain all of its rows.
    if partial_path(&whole.table()).exists() {
        whole.check_manifest()?;
    }
    // Every row is checked before anything is written.
    for part in &parts {
        part.each_row(|row| {
            push(row);
            Ok(())
        })?;
    }
    let writing = |error| Failure::writing(&partial_path(&whole.table()), &error);
    let mut table = whole.create()?;
    let copied =
        parts.iter().try_for_each(|part| part.each_row(|row| table.append(&campaign.line(row)).map_err(writing)));
    if let Err(failure) = copied {
        table.discard();
        return Err(failure);
    }
    table.finish().map_err(writing)?;
    Ok((whole, lock))
}
