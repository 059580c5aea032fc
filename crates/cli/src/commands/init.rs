//! `wetclutch init`.

use config::vehicle::short::{Facts, complete_file, short_file};

use crate::args::Init;
use crate::commands::{check_output, shell_quoted, write_text};
use crate::failure::Failure;
use crate::output;

pub(crate) fn init(options: &Init) -> Result<(), Failure> {
    check_output(Some(&options.output))?;
    // A file that somebody has filled in is not to be lost by a second call.
    if options.output.exists() {
        let message =
            format!("{}: the file is there already\nhint: choose another name after -o", options.output.display());
        return Err(Failure::Input(message));
    }
    let [ratio_before, ratio_after] = options.ratios[..] else {
        let message = "--ratios needs two ratios, those of the gears before and after the shift\nhint: for example --ratios 4.17,2.34";
        return Err(Failure::Input(message.to_owned()));
    };
    let facts = Facts {
        name: options.name.clone(),
        mass_kg: options.mass_kg,
        wheel_radius_m: options.wheel_radius_m,
        ratio_before,
        ratio_after,
        final_ratio: options.final_ratio,
        engine_torque_n_m: options.engine_torque_n_m,
        valve: options.valve.into(),
    };
    let text = if options.complete { complete_file } else { short_file }(&facts, options.stroke)?;
    write_text(&options.output, &text)?;
    let file = shell_quoted(&options.output);
    output::note(&format!(
        "vehicle file: {}\nnext: `wetclutch check {file}` says which of its defaults matter most; `wetclutch fit LOG --vehicle {file} -o fitted.toml`, \
         or `wetclutch estimate LOG --vehicle {file}`",
        options.output.display()
    ));
    Ok(())
}
