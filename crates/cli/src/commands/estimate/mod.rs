//! `wetclutch estimate`: one log, or several at a time.

mod earlier;
mod gearbox;
mod learnt;
mod one_shift;
mod outputs;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use logs::ChannelMap;
use serde_json::{Value, json};
use trace::{Cell, ShownPath as _};
use wetclutch::estimate::one_shift::observer::{has_gains, is_filter};
use wetclutch::estimate::{LiveRows, LogInput};
use wetclutch::{Destination, EstimateOptions, VehicleFile};

use self::earlier::replaces_only_estimates;
use self::outputs::{beside, remove_old};
use crate::args::{Estimate, FormatChoice};
use crate::browser;
use crate::commands::assumed::{detail_of_map, detail_of_vehicle};
use crate::commands::is_same_file;
use crate::commands::{
    JsonObject, channel_map_of_car, check_output, not_an_input, warn_without_effect, without_effect, write_text,
};
use crate::failure::Failure;
use crate::output;
use crate::signals::stop_then_end;

/// Rows of the table of shifts that a terminal shows.
const SHOWN: usize = 40;

/// What is common to all logs of a command.
struct Setup<'a> {
    arguments: &'a Estimate,
    /// The file of what was learnt, where the car uses it.
    learnt: Option<&'a Path>,
    /// Those who look at the rows, in place of standard output.
    live: Option<&'a dyn LiveRows>,
    vehicle: VehicleFile,
    map: ChannelMap,
    options: EstimateOptions,
}

impl Setup<'_> {
    fn log<'l>(&'l self, path: &'l Path) -> LogInput<'l> {
        LogInput { path, memory: None, map: &self.map }
    }

    fn destination<'o>(&'o self, output: Option<&'o Path>) -> Destination<'o> {
        match (output, self.live) {
            (Some(output), _) => Destination::File(output),
            (None, Some(live)) => Destination::Live(live),
            (None, None) => Destination::Standard,
        }
    }

    /// Whether the table of shifts goes to standard output.
    fn is_output_free(&self, output: Option<&Path>) -> bool {
        output.is_some() || self.live.is_some()
    }

    /// The shifts of a log in JSON, where they are wanted.
    fn result(&self, (log, output): (&Path, Option<&Path>), shifts: &[Vec<(String, Cell<'_>)>]) -> Option<Value> {
        let objects = || shifts.iter().map(|cells| JsonObject::of(cells.iter().cloned())).collect::<Vec<_>>();
        self.arguments.json.then(|| {
            json!({
                "log": log.shown().to_string(),
                "estimate": output.map(|output| output.shown().to_string()),
                "shifts": objects(),
            })
        })
    }

    /// How a log is estimated whose estimates go there.
    fn options_for(&self, output: Option<&Path>) -> EstimateOptions {
        EstimateOptions { with_page: output.and_then(beside).is_some(), ..self.options.clone() }
    }
}

/// Estimates a log, and says what was found and where it is.
fn estimate_log(setup: &Setup<'_>, path: &Path, output: Option<&Path>, say: &mut Messages) -> Result<(), Failure> {
    output::detail(|| format!("estimating {}", path.shown()));
    match &setup.vehicle {
        VehicleFile::Gearbox(file) => gearbox::estimate(setup, file, path, output, say),
        VehicleFile::OneShift(file) => one_shift::estimate(setup, file, path, output, say),
    }
}

/// The table of shifts, its lines with the titles, and how many more there are.
fn shift_lines(titles: &[String], rows: &[Vec<String>], more: usize) -> Vec<String> {
    let mut lines = output::titled_lines(3, titles, rows);
    lines.extend((more > 0).then(|| format!("and {more} more shifts")));
    lines
}

/// Writes the page beside the tables of shifts, or removes what an earlier estimate left there, says where all is, and opens the page where that
/// is wanted.
fn finish(
    setup: &Setup<'_>,
    output: Option<&Path>,
    places: Option<&[PathBuf; 3]>,
    page: impl FnOnce() -> Result<Option<String>, Failure>,
    say: &mut Messages,
) -> Result<(), Failure> {
    let opens = setup.arguments.open.is_wanted;
    let Some(output) = output else {
        if setup.live.is_none() {
            say.note("estimate: on standard output");
        }
        return Ok(());
    };
    say.note(&format!("estimate: {}", output.shown()));
    let Some([csv, json, html]) = places else {
        if opens {
            say.note(&without_effect("--open", "there is no page without a shift"));
        }
        return beside(output).map_or(Ok(()), |old| remove_old(&old, |note| say.note(note)));
    };
    write_text(html, &page()?.unwrap_or_default())?;
    say.note(&format!("table of shifts: {}, {}", csv.shown(), json.shown()));
    say.note(&format!("report: {}", html.shown()));
    browser::open_if(opens, html);
    Ok(())
}

/// Messages of one log: shown as they come, or together when it is done.
pub(super) struct Messages {
    held: Option<Held>,
    /// Its shifts, where they are wanted in JSON.
    pub(super) result: Option<Value>,
}

/// What is shown when a log is done.
#[derive(Default)]
struct Held {
    /// On standard error.
    notes: Vec<String>,
    /// On standard output.
    lines: Vec<String>,
}

impl Messages {
    /// That are shown as they come.
    pub(super) fn at_once() -> Self {
        Self { held: None, result: None }
    }

    /// That are shown together.
    pub(super) fn held() -> Self {
        Self { held: Some(Held::default()), result: None }
    }

    pub(super) fn note(&mut self, message: &str) {
        match &mut self.held {
            None => output::note(message),
            Some(held) if output::is_shown(message) => held.notes.push(message.to_owned()),
            Some(_) => {}
        }
    }

    /// Lines of a table: on standard output where nothing else goes there, else a message.
    fn table(&mut self, lines: &[String], is_output_free: bool) -> Result<(), Failure> {
        match &mut self.held {
            _ if !is_output_free => lines.iter().for_each(|line| self.note(line)),
            None => lines.iter().try_for_each(|line| output::line(line))?,
            Some(held) => held.lines.extend_from_slice(lines),
        }
        Ok(())
    }

    /// Shows what was held, of the log with this name.
    pub(super) fn show(self, log: &Path) -> Result<(), Failure> {
        let Held { notes, lines } = self.held.unwrap_or_default();
        if !notes.is_empty() {
            output::say(&format!("log: {}\n{}\n", log.shown(), notes.join("\n")));
        }
        if !lines.is_empty() {
            output::line(&format!("{}:\n{}\n", log.shown(), lines.join("\n")))?;
        }
        Ok(())
    }
}

pub(crate) fn estimate(options: &Estimate) -> Result<(), Failure> {
    not_an_input(options.output.as_ref(), options.logs.iter().chain(inputs(options)))?;
    outputs::check_name(options)?;
    outputs::warn_of_format(options);
    if let Some(toml) = options.logs.iter().find(|log| log.extension().is_some_and(|ending| ending == "toml")) {
        let message =
            format!("{}: this is a TOML file, expected a log\nhint: check the order of the files", toml.shown());
        return Err(Failure::Input(message));
    }
    let stop = stop(options)?;
    each_log(options, || setup(options, None, stop.as_ref()), estimate_log)
}

/// Estimates a log while it is written, for those who look at the rows, until `stop` is set or the log ends.
pub(super) fn live(
    arguments: &Estimate,
    (rows, stop): (&dyn LiveRows, &Arc<AtomicBool>),
    say: &mut Messages,
) -> Result<(), Failure> {
    let [log] = arguments.logs.as_slice() else { return Ok(()) };
    let setup = setup(arguments, Some(rows), Some(stop))?;
    estimate_log(&setup, log, None, say)
}

/// Estimates the logs; `prepare` makes what is common to them.
fn each_log<S: Sync>(
    options: &Estimate,
    prepare: impl FnOnce() -> Result<S, Failure>,
    estimate: impl Fn(&S, &Path, Option<&Path>, &mut Messages) -> Result<(), Failure> + Sync,
) -> Result<(), Failure> {
    let [log] = options.logs.as_slice() else {
        return several(options, &options.logs, prepare, estimate);
    };
    let folder = options.output.as_ref().filter(|output| output.is_dir());
    let output = match folder {
        Some(folder) => names_in(folder, &options.logs, ending(options))?.pop(),
        None => options.output.clone(),
    };
    check_output(output.as_ref())?;
    for written in output.iter().filter_map(|output| outputs::beside(output)).flatten().chain(output.clone()) {
        not_an_input(Some(&written), inputs(options).chain([log]))?;
    }
    not_the_learnt(options, output.as_slice())?;
    output.as_deref().map(replaces_only_estimates).transpose()?;
    let mut messages = Messages::at_once();
    estimate(&prepare()?, log, output.as_deref(), &mut messages)?;
    print_json(options, messages.result.into_iter().collect())
}

/// Prints what is known of the logs, where it is wanted.
pub(super) fn print_json(options: &Estimate, logs: Vec<Value>) -> Result<(), Failure> {
    if options.json { output::json(&json!({ "logs": logs })) } else { Ok(()) }
}

/// The ending of files in a folder.
fn ending(options: &Estimate) -> &'static str {
    options.format.unwrap_or(FormatChoice::Csv).ending()
}

/// The files that an estimate reads beside its logs.
fn inputs(options: &Estimate) -> impl Iterator<Item = &PathBuf> {
    options.sensors.iter().chain([&options.vehicle]).chain(&options.learnt).chain(options.mapping.files())
}

fn setup<'a>(
    arguments: &'a Estimate,
    live: Option<&'a dyn LiveRows>,
    stop: Option<&Arc<AtomicBool>>,
) -> Result<Setup<'a>, Failure> {
    let vehicle = VehicleFile::read(&arguments.vehicle)?;
    let mut options = EstimateOptions {
        observer: arguments.observer.kind(),
        method: arguments.method.map(Into::into),
        sensors: arguments.sensors.as_deref().map(wetclutch::read_sensors).transpose()?,
        columns: arguments.columns.clone(),
        shifts: arguments.shift_choice(),
        learnt: None,
        threads: arguments.threads_of_log(),
        with_page: false,
        interrupt: None,
        rows_done: None,
        follow: stop.cloned(),
    };
    let mut learnt = arguments.learnt.as_deref();
    without_unused(&mut options, &mut learnt, &vehicle);
    match &vehicle {
        VehicleFile::Gearbox(file) => gearbox::check(learnt, file, &options)?,
        VehicleFile::OneShift(file) => drop(wetclutch::estimate::one_shift::Setup::new(file, &options)?),
    }
    let map = channel_map_of_car(&arguments.mapping, vehicle.wheel_radius_m())?;
    detail_of_vehicle(&vehicle);
    detail_of_map(&map);
    Ok(Setup { arguments, learnt, live, vehicle, map, options })
}

/// Takes out the options that have no effect with a car, and warns of them.
fn without_unused(options: &mut EstimateOptions, learnt: &mut Option<&Path>, vehicle: &VehicleFile) {
    let mut unused: Vec<(&str, &str)> = Vec::new();
    let mut take = |is_given: bool, option, why| {
        if is_given {
            unused.push((option, why));
        }
    };
    match vehicle {
        VehicleFile::Gearbox(file) => {
            let only =
                "a car with a gearbox has the gearbox filter, which also writes the estimate of the valve model alone";
            take(options.observer.take().is_some(), "--observer", only);
            take(options.method.take().is_some(), "--method", only);
            if file.gearbox.has_ratios_alone() {
                let why = "what is learnt is of clutches and valves, and the ratios alone are known of this gearbox";
                take(learnt.take().is_some(), "--learnt", why);
            }
        }
        VehicleFile::OneShift(_) => {
            let why = "a vehicle file of one shift keeps nothing that is learnt; the file of a car with a gearbox does";
            take(learnt.take().is_some(), "--learnt", why);
            if !options.observer.is_some_and(has_gains) {
                take(options.method.take().is_some(), "--method", "it is for `--observer rigid` and `compliant`");
            }
            if options.observer.is_some_and(|observer| !is_filter(observer)) {
                let why = "it is for `--observer` gearbox, kalman, extended and unscented";
                take(options.sensors.take().is_some(), "--sensors", why);
            }
        }
    }
    unused.into_iter().for_each(|(option, why)| warn_without_effect(option, why));
}

/// What is set when a log that is followed is to end.
fn stop(options: &Estimate) -> Result<Option<Arc<AtomicBool>>, Failure> {
    if !options.follow {
        return Ok(None);
    }
    let stop = Arc::new(AtomicBool::new(false));
    stop_then_end(&stop)?;
    Ok(Some(stop))
}

/// Several logs, each into a file of its own. One that fails does not stop the others.
fn several<S: Sync>(
    options: &Estimate,
    logs: &[PathBuf],
    prepare: impl FnOnce() -> Result<S, Failure>,
    estimate: impl Fn(&S, &Path, Option<&Path>, &mut Messages) -> Result<(), Failure> + Sync,
) -> Result<(), Failure> {
    let Some(folder) = &options.output else {
        return Err(Failure::Input(
            "several logs need a folder for their estimates\nhint: name one with -o; each log gets a file in it"
                .to_owned(),
        ));
    };
    if options.open.is_wanted {
        return Err(Failure::Input(
            "--open takes one log\nhint: leave it out, and open the pages that you want".to_owned(),
        ));
    }
    if options.follow {
        return Err(Failure::Input("--follow takes one log\nhint: start the command once for each".to_owned()));
    }
    let outputs = names_in(folder, logs, ending(options))?;
    crate::commands::writable(folder, &[])?;
    for output in &outputs {
        check_output(Some(output))?;
        for output in outputs::beside(output).iter().flatten().chain([output]) {
            not_an_input(Some(output), logs.iter().chain(inputs(options)))?;
        }
        replaces_only_estimates(output)?;
    }
    not_the_learnt(options, &outputs)?;
    let setup = prepare()?;
    let next = AtomicUsize::new(0);
    let failures: Mutex<Vec<(usize, Failure)>> = Mutex::new(Vec::new());
    let results: Mutex<Vec<(usize, Value)>> = Mutex::new(Vec::new());
    let work = || {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let (Some(log), Some(output)) = (logs.get(at), outputs.get(at)) else { return };
            let mut messages = Messages::held();
            let result = estimate(&setup, log, Some(output), &mut messages);
            let found = messages.result.take().map(|found| (at, found));
            results.lock().unwrap_or_else(PoisonError::into_inner).extend(found);
            if let Err(failure) = result.and(messages.show(log)) {
                output::error(&failure.to_string());
                failures.lock().unwrap_or_else(PoisonError::into_inner).push((at, failure));
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..options.logs_at_a_time() {
            scope.spawn(work);
        }
        work();
    });
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.sort_by_key(|(at, _)| *at);
    print_json(options, results.into_iter().map(|(_, found)| found).collect())?;
    let mut failures = failures.into_inner().unwrap_or_else(PoisonError::into_inner);
    if failures.is_empty() {
        return Ok(());
    }
    failures.sort_by_key(|(at, _)| *at);
    let failed: Vec<String> = failures.iter().map(|(at, _)| logs[*at].shown().to_string()).collect();
    let message = format!("{} of {} logs have no estimate: {}", failed.len(), logs.len(), failed.join(", "));
    Err(match failures.iter().any(|(_, failure)| matches!(failure, Failure::Work(_))) {
        true => Failure::Work(message),
        false => Failure::Input(message),
    })
}

/// Refuses a file of `--learnt` that an estimate would go into. It need not be there yet.
fn not_the_learnt(options: &Estimate, outputs: &[PathBuf]) -> Result<(), Failure> {
    let Some(learnt) = &options.learnt else { return Ok(()) };
    let written = |output: &PathBuf| outputs::beside(output).into_iter().flatten().chain([output.clone()]);
    match outputs.iter().flat_map(written).any(|written| is_same_file(&written, learnt)) {
        false => Ok(()),
        true => Err(Failure::Input(format!(
            "{}: an estimate goes into this file\nhint: choose another name after --learnt",
            learnt.shown()
        ))),
    }
}

/// A file in the folder for each log, with the log's name.
fn names_in(folder: &Path, logs: &[PathBuf], ending: &str) -> Result<Vec<PathBuf>, Failure> {
    let mut taken: HashMap<PathBuf, &PathBuf> = HashMap::new();
    logs.iter()
        .map(|log| {
            let stem = log.file_stem().filter(|_| log.as_path() != Path::new("-")).ok_or_else(|| {
                let log = log.shown();
                Failure::Input(format!("{log}: this is no file\nhint: standard input can only be the one log"))
            })?;
            let mut name = stem.to_owned();
            name.push(".");
            name.push(ending);
            let output = folder.join(name);
            for name in outputs::beside(&output).into_iter().flatten().chain([output.clone()]) {
                let both = name.shown().to_string();
                if let Some(other) = taken.insert(name, log) {
                    return Err(Failure::Input(format!(
                        "{} and {} would both give {both}\nhint: estimate them one by one",
                        other.shown(),
                        log.shown()
                    )));
                }
            }
            Ok(output)
        })
        .collect()
}
