//! What `wetclutch init --from-log` takes from a log.

use std::path::{Path, PathBuf};

use config::{VehicleFile, significant};
use fit::drive::{ConverterFit, DriveRecord, fit_converter};
use logs::{Log, Reading, Readings, Role, SeenGear, SeenGears};
use trace::{ShownPath as _, quantity};

use crate::args::{Init, LaunchChoice};
use crate::commands::{channel_map, or_own_names};
use crate::failure::Failure;
use crate::output;

/// Gears whose ratios are closer than this are not the same.
const FEWEST_GEARS: usize = 2;

/// The numbers of a car, given or by a log.
pub(super) struct Numbers {
    pub(super) wheel_radius_m: f64,
    pub(super) final_ratio: f64,
    pub(super) engine_torque_n_m: f64,
}

impl Numbers {
    /// Those that are given, and for the others those that the log shows.
    ///
    /// # Errors
    /// One is neither given nor in the log.
    pub(super) fn of(options: &Init, log: Option<&FromLog>) -> Result<Self, Failure> {
        let seen = log.map(|log| &log.seen);
        let per_m = seen.and_then(SeenGears::output_rad_per_m);
        let by_wheel = || seen.and_then(SeenGears::final_ratio);
        let final_ratio = options.final_ratio.or_else(by_wheel).or_else(|| Some(per_m? * options.wheel_radius_m?));
        let by_car = || Some(final_ratio? / per_m?);
        let wheel_radius_m =
            options.wheel_radius_m.or_else(|| seen.and_then(SeenGears::wheel_radius_m)).or_else(by_car);
        let torque = options.engine_torque_n_m.or_else(|| seen.and_then(SeenGears::engine_torque_n_m));
        let missing = |option: &str, needs: &str| {
            let log = log.map_or(String::new(), |log| format!("{}: ", log.path.shown()));
            Failure::Input(format!("{log}the log does not show this: {needs}\nhint: give it with {option}"))
        };
        let within = |value: Option<f64>, [low, high]: [f64; 2]| {
            value.map(significant).filter(|value| (low..=high).contains(value))
        };
        let numbers = Self {
            final_ratio: within(final_ratio, [0.5, 10.0]).ok_or_else(|| {
                missing(
                    "--final-ratio",
                    "the final ratio needs the speed of the wheels, or that of the car and their radius",
                )
            })?,
            wheel_radius_m: within(wheel_radius_m, [0.1, 1.0])
                .ok_or_else(|| missing("--wheel-radius-m", "the wheel radius needs the speed of the car"))?,
            engine_torque_n_m: within(torque, [20.0, 2000.0])
                .ok_or_else(|| missing("--engine-torque-n-m", "the maximum engine torque needs the engine torque"))?,
        };
        if let Some(log) = log {
            numbers.say(options, log);
        }
        Ok(numbers)
    }

    /// Says what is of the log, and what is not known by it.
    fn say(&self, options: &Init, log: &FromLog) {
        let mut found = Vec::new();
        if options.final_ratio.is_none() {
            found.push(format!("final ratio {:.3}", self.final_ratio));
        }
        if options.wheel_radius_m.is_none() {
            found.push(format!("wheel radius {:.3} m", self.wheel_radius_m));
        }
        if options.engine_torque_n_m.is_none() {
            found.push(format!(
                "engine torque {}, the largest in the log: the engine may have more",
                quantity(self.engine_torque_n_m, "N m", 0)
            ));
        }
        let has_converter = options.launch() == LaunchChoice::Converter;
        if has_converter && log.converter.is_ok() {
            found.push("capacity of the converter".to_owned());
        }
        if !found.is_empty() {
            output::note(&format!("from the log: {}", found.join(", ")));
        }
        let plates = if options.gearbox.is_some() { "" } else { "elements and plates of the gearbox, " };
        output::note(&format!(
            "not in {}, and so given or usual values: mass, {plates}inertias, {}valves and kiss points",
            log.path.shown(),
            if has_converter { "torque ratio of the converter, " } else { "" }
        ));
        if let (true, Err(reason)) = (has_converter, &log.converter) {
            output::note(&format!(
                "the capacity of the converter is that of a usual one, as the log does not show it: {reason}\nhint: replace [converter] where it is known"
            ));
        }
    }
}

/// What a log shows of a car.
pub(super) struct FromLog {
    path: PathBuf,
    seen: SeenGears,
    /// The converter, or why the log does not show it.
    converter: Result<ConverterFit, String>,
}

impl FromLog {
    /// Reads a whole log.
    pub(super) fn read(path: &Path, options: &Init) -> Result<Self, Failure> {
        let mut map = channel_map(&options.mapping)?;
        if let Some(radius_m) = options.wheel_radius_m {
            map.gearbox.wheel_radius_m.get_or_insert(radius_m);
        }
        let mut log = Log::open(path, &map.open)?.on_threads(wetclutch::available_threads());
        let map = or_own_names(map, &log)?;
        map.resolve(&log)?;
        let missing = [Role::TurbineSpeed, Role::OutputSpeed].into_iter().find(|role| !map.has(*role));
        if let Some(role) = missing {
            return Err(Failure::Input(format!(
                "--from-log needs the turbine and the output speed, and {} is not mapped\n\
                 hint: give --map MAP.toml (`inspect --suggest` writes a first one) or --channel",
                role.name()
            )));
        }
        let (mut seen, mut record, mut first_s) = (SeenGears::default(), DriveRecord::default(), None);
        let mut readings = Readings::new(&mut log, &map)?;
        while let Some(reading) = readings.next_or_refused() {
            let reading = reading?;
            seen.push(&reading);
            if !reading.is_refused() {
                let first_s = *first_s.get_or_insert(reading.time_s);
                record.push(&Reading { time_s: reading.time_s - first_s, ..reading });
            }
        }
        readings.check()?;
        record.complete(map.gearbox.output_rad_per_m.or_else(|| seen.output_rad_per_m()));
        let converter = fit_converter(&record, &record.moments());
        Ok(Self { path: path.to_owned(), seen, converter })
    }

    /// The table of the converter that the log shows.
    ///
    /// # Errors
    /// The program's own vehicle file is wrong.
    pub(super) fn converter_table(&self) -> Result<Option<String>, Failure> {
        let usual = VehicleFile::built_in()?;
        Ok(self.converter.as_ref().ok().map(|fitted| fitted.table(&usual.converter)))
    }

    /// A gearbox file with the ratios.
    ///
    /// # Errors
    /// The car was not driven in two gears.
    pub(super) fn gearbox_file(&self, name: &str) -> Result<String, Failure> {
        let gears = self.seen.gears();
        if gears.len() < FEWEST_GEARS {
            let path = self.path.shown();
            let found: Vec<String> = gears.iter().map(|gear| format!("{:.3}", gear.ratio)).collect();
            return Err(Failure::Input(format!(
                "{path}: the car was not driven in two gears for long enough: the ratios of turbine and output speed that stay are [{}]\n\
                 hint: check which channels are mapped, or give --gearbox",
                found.join(", ")
            )));
        }
        let names = names(&gears);
        let lines = gears.iter().zip(&names).map(|(gear, name)| {
            format!("  {{ name = {}, ratio = {:.4} }}, # {:.0} s\n", trace::toml_string(name), gear.ratio, gear.time_s)
        });
        output::note(&format!(
            "gears of the log: {}\nhint: a gear in which the car was not driven is missing: add it, and correct the names",
            gears
                .iter()
                .zip(&names)
                .map(|(gear, name)| format!("{name} {:.3}", gear.ratio))
                .collect::<Vec<_>>()
                .join(", ")
        ));
        Ok(format!(
            "# Ratios of turbine and output speed in which the car was driven in {}, and for how long; written by `wetclutch init --from-log`.\n\
             # A gear in which it was not driven is missing. docs/reference/gearbox-file.md says what else a gearbox file can have.\n\
             name = {}\nlevel = \"ratios\"\ngear = [\n{}]\n",
            self.path.shown(),
            trace::toml_string(&format!("gearbox of {name}")),
            lines.collect::<String>()
        ))
    }
}

/// The gears by the numbers of the gear signal, or in their order.
fn names(gears: &[SeenGear]) -> Vec<String> {
    let numbers: Option<Vec<u32>> = gears.iter().map(|gear| gear.number).collect();
    let rising = numbers.filter(|numbers| numbers.is_sorted_by(|one, next| one < next));
    let in_order = || (1..).take(gears.len()).collect::<Vec<u32>>();
    rising.unwrap_or_else(in_order).iter().map(u32::to_string).collect()
}
