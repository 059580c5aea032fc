//! `wetclutch init`.

use std::path::{Path, PathBuf};

use config::Source;
use config::gearbox::SHIPPED;
use config::vehicle::short::{CarFacts, Facts, complete_file, short_car_file, short_file, sized_gearbox};
use serde_json::json;
use trace::ShownPath as _;

use crate::args::{Init, LaunchChoice};
use crate::commands::init_from_log::{FromLog, Numbers};
use crate::commands::written::is_forced;
use crate::commands::{check_output, warn_without_effect, write_text};
use crate::failure::Failure;
use crate::output;
use wetclutch::shell_quoted;

pub(crate) fn init(options: &Init) -> Result<(), Failure> {
    check_output(Some(&options.output))?;
    let log = options.from_log.as_deref().map(|log| FromLog::read(log, options)).transpose()?;
    if log.is_none() && options.mapping.is_given() {
        warn_without_effect("a channel map", "it maps the channels of the log of --from-log");
    }
    if log.is_some() && options.has_all_of_a_log() {
        warn_without_effect("--from-log", "the gearbox and all numbers are given");
    }
    if options.stroke && log.is_some() && options.gearbox.is_none() {
        warn_without_effect("--stroke", "a gearbox with ratios alone has no pistons");
    }
    let numbers = Numbers::of(options, log.as_ref())?;
    let gearbox = match (&options.gearbox, &log) {
        (Some(gearbox), log) => car(options, &numbers, gearbox, log.as_ref())?,
        (None, Some(log)) => Some(by_ratios(options, &numbers, log)?),
        (None, None) => one_shift(options, &numbers).map(|()| None)?,
    };
    if options.json {
        let gearbox = gearbox.map(|path| path.shown().to_string());
        output::json(&json!({ "vehicle": options.output.shown().to_string(), "gearbox": gearbox }))?;
    }
    say_what_is_next(options);
    Ok(())
}

/// A vehicle file of one upshift.
fn one_shift(options: &Init, numbers: &Numbers) -> Result<(), Failure> {
    let [ratio_before, ratio_after] = options.ratios[..] else {
        let message = "--ratios needs two ratios, those of the gears before and after the shift\nhint: for example --ratios 4.17,2.34";
        return Err(Failure::Input(message.to_owned()));
    };
    let facts = Facts {
        name: options.name.clone(),
        mass_kg: options.mass_kg,
        wheel_radius_m: numbers.wheel_radius_m,
        ratio_before,
        ratio_after,
        final_ratio: numbers.final_ratio,
        engine_torque_n_m: numbers.engine_torque_n_m,
        valve: options.valve.into(),
    };
    let text = if options.complete { complete_file } else { short_file }(&facts, options.stroke)?;
    refuse_another(&options.output, &text)?;
    write_text(&options.output, &text)
}

/// A vehicle file with a gearbox, and the gearbox file beside it if it is one of the program's, which is returned.
fn car(options: &Init, numbers: &Numbers, gearbox: &str, log: Option<&FromLog>) -> Result<Option<PathBuf>, Failure> {
    let torque_n_m = numbers.engine_torque_n_m;
    let shipped = SHIPPED.iter().find(|(name, _)| *name == gearbox);
    let (source, named, beside) = match shipped {
        Some((name, text)) => {
            let file = format!("{name}.toml");
            let path = options.output.with_file_name(&file);
            if path == options.output {
                let message = format!(
                    "{}: the gearbox file has this name\nhint: choose another name after -o, such as `{}`",
                    path.shown(),
                    path.with_file_name("car.toml").shown()
                );
                return Err(Failure::Input(message));
            }
            let text = sized_gearbox(&Source::built_in(&file, text), torque_n_m)?;
            refuse_existing(&path, &text)?;
            (Source { path: path.clone(), text }, file, Some(path))
        }
        None => (read_gearbox(gearbox)?, from_folder_of(&options.output, gearbox)?, None),
    };
    let facts = CarFacts { converter: converter_of(log)?, ..facts(options, numbers, named, options.launch()) };
    let text = short_car_file(&facts, &source)?;
    refuse_another(&options.output, &text)?;
    if let Some(path) = &beside {
        write_text(path, &source.text)?;
        output::note(&format!("gearbox file: {}", path.shown()));
    }
    write_text(&options.output, &text)?;
    Ok(beside)
}

/// A vehicle file, and a gearbox file beside it with the ratios that a log shows.
fn by_ratios(options: &Init, numbers: &Numbers, log: &FromLog) -> Result<PathBuf, Failure> {
    let stem = options.output.file_stem().map_or("car".into(), |stem| stem.to_string_lossy());
    let file = format!("{stem}_gearbox.toml");
    let path = options.output.with_file_name(&file);
    let source = Source { path: path.clone(), text: log.gearbox_file(&options.name)? };
    refuse_existing(&path, &source.text)?;
    let converter = log.converter_table()?;
    let facts = CarFacts { has_stroke: false, converter, ..facts(options, numbers, file, options.launch()) };
    let text = short_car_file(&facts, &source)?;
    refuse_another(&options.output, &text)?;
    write_text(&path, &source.text)?;
    output::note(&format!("gearbox file: {}", path.shown()));
    write_text(&options.output, &text)?;
    Ok(path)
}

/// The converter of a log, if it shows it.
fn converter_of(log: Option<&FromLog>) -> Result<Option<String>, Failure> {
    Ok(log.map(FromLog::converter_table).transpose()?.flatten())
}

fn facts(options: &Init, numbers: &Numbers, gearbox: String, launch: LaunchChoice) -> CarFacts {
    CarFacts {
        name: options.name.clone(),
        gearbox,
        has_converter: launch == LaunchChoice::Converter,
        converter: None,
        has_stroke: options.stroke,
        mass_kg: options.mass_kg,
        wheel_radius_m: numbers.wheel_radius_m,
        final_ratio: numbers.final_ratio,
        engine_torque_n_m: numbers.engine_torque_n_m,
    }
}

/// The gearbox file of a car, and what may be given where there is none.
fn read_gearbox(named: &str) -> Result<Source, Failure> {
    let path = Path::new(named);
    if path.exists() {
        return Ok(Source::read(path)?);
    }
    let names = SHIPPED.map(|(name, _)| name).join(", ");
    Err(Failure::Input(format!("--gearbox {named}: no such file\nhint: give a gearbox file, or one of {names}")))
}

/// A path as a file in the folder of `output` names it.
fn from_folder_of(output: &Path, named: &str) -> Result<String, Failure> {
    let folder = output.parent().unwrap_or(Path::new(""));
    if folder.as_os_str().is_empty() || Path::new(named).is_absolute() {
        return Ok(named.to_owned());
    }
    let whole = Path::new(named).canonicalize();
    let whole = whole.map_err(|error| Failure::Input(format!("--gearbox {named}: {error}")))?;
    Ok(whole.to_string_lossy().into_owned())
}

/// A vehicle file that somebody has filled in is not to be lost by a second call.
fn refuse_another(path: &Path, text: &str) -> Result<(), Failure> {
    if path.exists() && !is_forced() && !trace::read_text(path).is_ok_and(|there| there == text) {
        let message = format!(
            "{}: the file is there already, and is another one\nhint: choose another name after -o; --force replaces it",
            path.shown()
        );
        return Err(Failure::Input(message));
    }
    Ok(())
}

/// Refuses to write over a gearbox file that somebody has changed.
fn refuse_existing(path: &Path, text: &str) -> Result<(), Failure> {
    match trace::read_text(path) {
        Ok(there) if there == text => Ok(()),
        _ if !path.exists() || is_forced() => Ok(()),
        _ => Err(Failure::Input(format!(
            "{0}: the file is there already, and is another gearbox\nhint: use it by `--gearbox {1}`, or write into another folder",
            path.shown(),
            shell_quoted(path),
        ))),
    }
}

fn say_what_is_next(options: &Init) {
    let file = shell_quoted(&options.output);
    output::note(&format!(
        "vehicle file: {}\nnext: `wetclutch check {file}` lists the values that matter most; `wetclutch fit LOG --vehicle {file} -o fitted.toml`, \
         or `wetclutch estimate LOG --vehicle {file}`",
        options.output.shown()
    ));
}
