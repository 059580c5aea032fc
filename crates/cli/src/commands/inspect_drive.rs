//! The page of a drive and the converter of `wetclutch inspect --shifts`.

use std::path::Path;

use config::VehicleFile;
use fit::drive::{ConverterFit, DriveRecord, Moment, fit_converter};
use logs::{ChannelMap, Role, Shift};
use report::SpeedsPage;
use trace::ShownPath as _;

use crate::args::Inspect;
use crate::browser;
use crate::commands::write_text;
use crate::failure::Failure;
use crate::output;

/// What the signals of a drive show.
pub(super) struct Drive {
    record: DriveRecord,
    moments: Vec<Moment>,
    /// The converter, or why there is none.
    converter: Result<ConverterFit, String>,
}

impl Drive {
    pub(super) fn of(mut record: DriveRecord, map: &ChannelMap) -> Self {
        record.complete(map.gearbox.output_rad_per_m);
        let moments = record.moments();
        let converter = fit_converter(&record, &moments);
        Self { record, moments, converter }
    }
}

/// Writes the converter that a log shows.
pub(super) fn write_converter(path: &Path, log: &Path, drive: &Drive) -> Result<(), Failure> {
    let fitted = drive
        .converter
        .as_ref()
        .map_err(|reason| Failure::Work(format!("{}: the converter cannot be fitted: {reason}", log.shown())))?;
    let usual = VehicleFile::built_in()?;
    write_text(path, &fitted.vehicle_table(&log.shown().to_string(), &usual.converter))?;
    output::note(&format!("converter: {}", path.shown()));
    Ok(())
}

/// Writes the page of the drive.
pub(super) fn page(
    (path, log): (&Path, &Path),
    options: &Inspect,
    map: &ChannelMap,
    shifts: &[Shift],
    drive: &Drive,
    mut faults: Vec<String>,
) -> Result<(), Failure> {
    let map_file = options.mapping.map.as_deref().map(config::Source::read).transpose()?;
    if drive.record.is_cut {
        faults.push("The page shows the first five hours: the drive is longer.".to_owned());
    }
    let page = SpeedsPage {
        log,
        map: map_file.as_ref(),
        record: &drive.record,
        moments: &drive.moments,
        ratios: &map.gearbox.ratios,
        shifts,
        converter: &drive.converter,
        has_command: has_command(map),
        faults: &faults,
    };
    write_text(path, &page.html()?)?;
    for sentence in page.findings(&page.torques()) {
        output::line(&sentence)?;
    }
    output::note(&format!("page: {}", path.shown()));
    browser::open_if(options.open.is_wanted, path);
    Ok(())
}

/// Whether a pressure can be estimated by a channel map.
pub(super) fn has_command(map: &ChannelMap) -> bool {
    let commands = [
        Role::OncomingCurrent,
        Role::OncomingDuty,
        Role::OncomingPressureCommand,
        Role::ElementCurrent,
        Role::ElementDuty,
        Role::ElementPressureCommand,
    ];
    commands.into_iter().any(|role| map.has(role))
}
