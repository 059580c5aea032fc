//! Rows per second and memory of the program's commands.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use crate::Figure;
use crate::bars::{self, Bar};
use crate::command::{Ran, program, run};
use crate::shared::write_log;

/// Rows of the logs: one for the time, and ten times as many for the memory.
const ROWS: [u32; 2] = [1_000_000, 10_000_000];
/// The fastest of so many runs counts.
const TRIES: usize = 5;

/// A command over the log: name of the observer, what is written, its option, and the ending of its output.
const COMMANDS: [(&str, &str, &str, &str); 7] = [
    ("kalman", "CSV, all columns", "", "csv"),
    ("kalman", "CSV, `--columns` of pressure and health", COLUMNS, "csv"),
    ("kalman", "Parquet, all columns", "", "parquet"),
    ("rigid", "CSV, all columns", "", "csv"),
    ("open-loop", "CSV, all columns", "", "csv"),
    ("open-loop", "CSV, `--columns` of pressure and health", COLUMNS, "csv"),
    ("open-loop", "Parquet, all columns", "", "parquet"),
];
const COLUMNS: &str = "oncoming_pressure_estimate_pa,health";

/// The log of so many rows, as a file that is removed in the end.
struct LogFile(PathBuf);

impl LogFile {
    fn of(rows: u32) -> Self {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("log_{rows}.csv"));
        let file = BufWriter::new(File::create(&path).unwrap());
        write_log(file, rows).flush().unwrap();
        Self(path)
    }
}

impl Drop for LogFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// The commands with their figure.
pub(crate) fn commands(page: &mut String) -> Figure {
    let program = program();
    let log = LogFile::of(ROWS[0]);
    page.push_str(
        "\n## Estimates of logs\n\n`wetclutch estimate` of a log of a million rows in CSV, the same 3.3 s with a shift again and again, with the guaranteed range, shifts and page: read, \
         estimated, written. A core is kept busy; by the clock the disk is waited for besides, which gets 200 MB of CSV.\n\n\
         ![Rows per second and core of each observer](../figures/estimates.svg)\n\n| observer | output | rows per second and core | by the clock |\n|---|---|---|---|\n",
    );
    let mut bars = Vec::new();
    let run = |(observer, _, columns, ending)| estimate(&program, &log, observer, columns, ending);
    // In turns: a slow time of the machine meets all of them.
    let tries: Vec<_> = (0..TRIES).map(|_| COMMANDS.map(run)).collect();
    for (at, (observer, written, ..)) in COMMANDS.into_iter().enumerate() {
        let runs: Vec<&Ran> = tries.iter().map(|runs| &runs[at]).collect();
        let best =
            |time: fn(&Ran) -> f64| f64::from(ROWS[0]) / runs.iter().map(|ran| time(ran)).fold(f64::INFINITY, f64::min);
        let (rate, by_clock) = (best(|ran| ran.processor_s), best(|ran| ran.seconds));
        let _ = writeln!(page, "| {observer} | {written} | {rate:.0} | {by_clock:.0} |");
        bars.push(Bar { label: format!("{observer}, {}", written.replace('`', "")), parts: vec![1e-3 * rate] });
    }
    memory(page, &program, log);
    ("estimates.svg", bars::svg("thousand rows per second and core", &[], &bars))
}

fn estimate(program: &Path, log: &LogFile, observer: &str, columns: &str, ending: &str) -> Ran {
    let output = log.0.with_file_name(format!("estimate.{ending}"));
    let (log, written) = (log.0.to_str().unwrap(), output.to_str().unwrap());
    let vehicle = "vehicles/two_speed_at.toml";
    let mut arguments = vec!["estimate", log, "--vehicle", vehicle, "--observer", observer, "-o", written];
    if !columns.is_empty() {
        arguments.extend(["--columns", columns]);
    }
    let ran = run(program, &arguments);
    std::fs::remove_file(&output).unwrap();
    ran
}

fn memory(page: &mut String, program: &Path, log: LogFile) {
    page.push_str(
        "\n## Memory\n\nPeak of the resident memory of a command, on one thread.\n\n| command | peak |\n|---|---|\n",
    );
    let mut row = |command: &str, mib: f64| {
        let _ = writeln!(page, "| {command} | {mib:.0} MiB |");
    };
    let mut of_log = |log: &LogFile, rows: &str| {
        for (output, ending) in [("CSV", "csv"), ("Parquet", "parquet")] {
            row(
                &format!("`estimate` of {rows} rows to {output}"),
                estimate(program, log, "kalman", "", ending).peak_mib,
            );
        }
    };
    of_log(&log, "1,000,000");
    drop(log);
    of_log(&LogFile::of(ROWS[1]), "10,000,000");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("study");
    let written = folder.to_str().unwrap();
    let ran = run(program, &["study", "experiments/settings.toml", "--threads", "1", "-o", written]);
    std::fs::remove_dir_all(&folder).unwrap();
    row("`study` of 2,000 runs with five observers", ran.peak_mib);
}
