//! Options of the commands that read measured logs, and of those that make a vehicle file.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use config::vehicle::short::ValveKind;
use trace::TableFormat;
use wetclutch::estimate::{GearPair, ShiftChoice};
use wetclutch::fitted::OIL_STEPS_K;

use super::{MethodChoice, ObserverChoice, OpenOutput, PageChoice, Threads, whole, within};

/// Which channels of a log are which signals.
#[derive(Debug, Clone, Args)]
pub(crate) struct Mapping {
    /// Messages and signals of a CAN log; replaces `dbc` of the map
    #[arg(long, value_name = "FILE.dbc")]
    pub(crate) dbc: Option<PathBuf>,
    /// Channel map
    #[arg(long, value_name = "MAP.toml")]
    pub(crate) map: Option<PathBuf>,
    /// Channel of a signal, such as `engine_speed="N_Eng [rpm]"`; replaces that of the map. May be given several times
    #[arg(long, value_name = "SIGNAL=NAME")]
    pub(crate) channel: Vec<String>,
}

impl Mapping {
    /// Whether anything is said of the channels.
    pub(crate) fn is_given(&self) -> bool {
        self.files().next().is_some() || !self.channel.is_empty()
    }

    /// The files that it names.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.dbc.iter().chain(&self.map)
    }
}

#[derive(Debug, Args)]
pub(crate) struct Inspect {
    /// Logs; `-` is standard input
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// Print a first channel map from names, units and values
    #[arg(long, conflicts_with_all = ["shifts", "map", "channel"])]
    pub(crate) suggest: bool,
    /// List the shifts; needs --map or --channel
    #[arg(long)]
    pub(crate) shifts: bool,
    /// With --shifts: write a page of the drive, with its shifts, converter, engine torque and turbine torque
    #[arg(short, long, value_name = "PAGE.html", requires = "shifts", conflicts_with = "suggest")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) open: OpenOutput,
    /// With --shifts: write the fitted converter as a table of a vehicle file; needs the engine torque
    #[arg(long, value_name = "OUT.toml", requires = "shifts", conflicts_with = "suggest")]
    pub(crate) write_converter: Option<PathBuf>,
    /// Ratios of the forward gears, 1st first; they replace those of the map
    #[arg(long, value_name = "R1,R2,...", value_delimiter = ',', requires = "shifts", conflicts_with = "suggest")]
    pub(crate) ratios: Vec<f64>,
    /// Print the channels, with --shifts the shifts, or with --suggest the map, as JSON
    #[arg(long, conflicts_with = "output")]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// Logs; `-` is standard input
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// The table; the ending .csv, .parquet or .mf4 gives the format. Or a folder, which gets a table of each log. No table is replaced without --force
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Format of files in a folder [default: csv]
    #[arg(long, value_enum)]
    pub(crate) format: Option<FormatChoice>,
    /// Print what was written as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Estimate {
    /// Logs; `-` is standard input. Several logs are estimated in parallel, each into a separate file
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// Vehicle file
    #[arg(long)]
    pub(crate) vehicle: PathBuf,
    /// Observer
    #[arg(long, value_enum, default_value_t = ObserverChoice::Best)]
    pub(crate) observer: ObserverChoice,
    /// Design method of the gains, for `--observer` rigid and compliant [default: iss]
    #[arg(long, value_enum)]
    pub(crate) method: Option<MethodChoice>,
    /// File whose table `sensors` describes the sensors of the log, such as an experiment file. The Kalman filters use their noise and
    /// delay; without the file they assume the noise of the error budget and no delay
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// File for the estimate; the ending .csv, .parquet or .mf4 gives the format. For several logs a folder, which gets a file for each log.
    /// Default: standard output, as CSV
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) open: OpenOutput,
    /// File with the values that the gearbox filter has learnt of the car: read before the first row if it exists, written after the last.
    /// Several logs are then estimated in sequence
    #[arg(long, value_name = "LEARNT.toml")]
    pub(crate) learnt: Option<PathBuf>,
    /// Columns of the estimate, in this order; time_s is always first. Readings can be included by their column names, such as
    /// turbine_speed_rad_s
    #[arg(long, value_name = "A,B,...", value_delimiter = ',')]
    pub(crate) columns: Vec<String>,
    /// Only the Nth shift of the log
    #[arg(long, value_name = "N", conflicts_with = "shifts", value_parser = whole(1..=u32::MAX))]
    pub(crate) shift: Option<u32>,
    /// Only shifts between these gears, named as in the table of shifts, such as 1-2,2-3
    #[arg(long, value_name = "FROM-TO,...", value_delimiter = ',')]
    pub(crate) shifts: Vec<GearPair>,
    /// Estimate a log while it is written, until Ctrl-C or the end of the pipe. The log is CSV or a bus log as text, a file or `-`
    #[arg(long)]
    pub(crate) follow: bool,
    /// Format of files in a folder [default: csv]; the ending of the file after -o sets its format
    #[arg(long, value_enum)]
    pub(crate) format: Option<FormatChoice>,
    /// Print the shifts of each log as JSON instead of the table; needs -o
    #[arg(long, requires = "output", conflicts_with = "follow")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) threads: Threads,
}

#[derive(Debug, Args)]
pub(crate) struct Watch {
    /// Log that is being written: CSV or a bus log as text; `-` is standard input
    #[arg(value_name = "LOG")]
    pub(crate) log: PathBuf,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// Vehicle file
    #[arg(long)]
    pub(crate) vehicle: PathBuf,
    /// File whose table `sensors` describes the sensors of the log
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// Seconds that the figures show
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = within(1.0..=600.0))]
    pub(crate) window: f64,
    /// Also show a page in browsers on this computer, at this port of 127.0.0.1 [default: one that is free]
    #[arg(long, value_name = "PORT", num_args = 0..=1)]
    #[expect(clippy::option_option, reason = "the option may be given without a port")]
    pub(crate) serve: Option<Option<u16>>,
    /// With --serve: open the page in the browser
    #[arg(long, requires = "serve")]
    pub(crate) open: bool,
    /// Print the shifts as JSON when the log ends, and show nothing in the terminal until then
    #[arg(long)]
    pub(crate) json: bool,
}

impl Watch {
    /// The estimate that is watched.
    pub(crate) fn estimate(&self) -> Estimate {
        Estimate {
            logs: vec![self.log.clone()],
            mapping: self.mapping.clone(),
            vehicle: self.vehicle.clone(),
            observer: ObserverChoice::Best,
            method: None,
            sensors: self.sensors.clone(),
            output: None,
            open: OpenOutput { is_wanted: false },
            learnt: None,
            columns: Vec::new(),
            shift: None,
            shifts: Vec::new(),
            follow: true,
            format: None,
            json: self.json,
            threads: Threads::ALL,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatChoice {
    /// Comma-separated text
    Csv,
    /// Parquet
    Parquet,
    /// ASAM MDF 4.10
    Mf4,
}

impl Estimate {
    /// The shifts that are wanted.
    pub(crate) fn shift_choice(&self) -> ShiftChoice {
        match self.shift {
            Some(number) => ShiftChoice::Number(number as usize),
            None if self.shifts.is_empty() => ShiftChoice::All,
            None => ShiftChoice::Between(self.shifts.clone()),
        }
    }

    /// How many logs are estimated at a time: with `--learnt` one begins with what the one before has left.
    pub(crate) fn logs_at_a_time(&self) -> usize {
        if self.learnt.is_some() { 1 } else { self.threads.count().min(self.logs.len()).max(1) }
    }

    /// On how many threads one of the logs is read, estimated and written.
    pub(crate) fn threads_of_log(&self) -> usize {
        (self.threads.count() / self.logs_at_a_time()).max(1)
    }
}

impl From<FormatChoice> for TableFormat {
    fn from(choice: FormatChoice) -> Self {
        match choice {
            FormatChoice::Csv => Self::Csv,
            FormatChoice::Parquet => Self::Parquet,
            FormatChoice::Mf4 => Self::Mdf,
        }
    }
}

impl FormatChoice {
    /// The ending of its files.
    pub(crate) fn ending(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
            Self::Mf4 => "mf4",
        }
    }
}

#[derive(Debug, Args)]
#[command(group(ArgGroup::new("shifts").required(true).multiple(true).args(["gearbox", "ratios", "from_log"])))]
pub(crate) struct Init {
    /// Name of the car
    #[arg(long, default_value = "my car")]
    pub(crate) name: String,
    /// Log of a drive. Without --gearbox, the ratios in which the car was driven become the gearbox file. Final ratio, wheel radius and
    /// engine torque are those of the log, where it shows them and no option gives them
    #[arg(long, value_name = "LOG", conflicts_with_all = ["ratios", "complete"])]
    pub(crate) from_log: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// Mass with driver, kg: 200 to 60000
    #[arg(long, value_name = "KG", allow_negative_numbers = true, value_parser = within(200.0..=60e3))]
    pub(crate) mass_kg: f64,
    /// Rolling radius of the driven wheels, m: 0.1 to 1
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = within(0.1..=1.0), required_unless_present = "from_log")]
    pub(crate) wheel_radius_m: Option<f64>,
    /// The gearbox: 10_speed, 4l60e, 722_6, 8hp, 8hp45, 9g_tronic, 9hp48, a340e, a8lr1, c6, dual_clutch_7, fn4a, lepelletier_6, ravigneaux_4, tf80sc, th400, or a gearbox file
    #[arg(long, value_name = "NAME|FILE", conflicts_with_all = ["valve", "complete", "ratios"])]
    pub(crate) gearbox: Option<String>,
    /// What connects engine and gearbox [default: clutch for dual_clutch_7, else converter]
    #[arg(long, value_enum, conflicts_with = "ratios")]
    pub(crate) launch: Option<LaunchChoice>,
    /// For one upshift: ratios of the gears before and after it, such as 4.17,2.34; each 0.6 to 20
    #[arg(long, value_name = "BEFORE,AFTER", value_delimiter = ',', num_args = 1, allow_negative_numbers = true, value_parser = within(0.6..=20.0))]
    pub(crate) ratios: Vec<f64>,
    /// Ratio from gearbox output to wheels, 0.5 to 10; 1 for dual_clutch_7, whose ratios contain it
    #[arg(long, value_name = "RATIO", allow_negative_numbers = true, value_parser = within(0.5..=10.0), required_unless_present = "from_log")]
    pub(crate) final_ratio: Option<f64>,
    /// Maximum engine torque, N m: 20 to 2000
    #[arg(long, value_name = "N_M", allow_negative_numbers = true, value_parser = within(20.0..=2000.0), required_unless_present = "from_log")]
    pub(crate) engine_torque_n_m: Option<f64>,
    /// Kind of the clutches' valves
    #[arg(long, value_enum, default_value_t)]
    pub(crate) valve: ValveChoice,
    /// The pistons of the clutches have a stroke: the fill takes time
    #[arg(long)]
    pub(crate) stroke: bool,
    /// Write every key with the source of its value, instead of a short file
    #[arg(long)]
    pub(crate) complete: bool,
    /// The vehicle file
    #[arg(short, long, value_name = "CAR.toml")]
    pub(crate) output: PathBuf,
    /// Print the files as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl Init {
    /// Whether everything is given that a log could show.
    pub(crate) fn has_all_of_a_log(&self) -> bool {
        let numbers = [self.wheel_radius_m, self.final_ratio, self.engine_torque_n_m];
        // The converter is one more number of the log.
        self.gearbox.is_some() && numbers.iter().all(Option::is_some) && self.launch() == LaunchChoice::Clutch
    }
}

impl Init {
    /// What connects engine and gearbox, given or usual.
    pub(crate) fn launch(&self) -> LaunchChoice {
        let usual = if self.gearbox.as_deref() == Some("dual_clutch_7") {
            LaunchChoice::Clutch
        } else {
            LaunchChoice::Converter
        };
        self.launch.unwrap_or(usual)
    }
}

/// What connects the engine with the gearbox.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LaunchChoice {
    /// A torque converter
    Converter,
    /// A clutch of the gearbox, which slips at a launch
    Clutch,
}

/// Kind of a clutch's valve.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
pub(crate) enum ValveChoice {
    /// The pressure follows a current
    #[default]
    Proportional,
    /// The pressure follows a duty cycle
    PulseWidth,
}

impl From<ValveChoice> for ValveKind {
    fn from(choice: ValveChoice) -> Self {
        match choice {
            ValveChoice::Proportional => Self::Proportional,
            ValveChoice::PulseWidth => Self::PulseWidth,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct Fit {
    /// Logs of drives with shifts, or folders of logs
    #[arg(required = true)]
    pub(crate) logs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// Vehicle file to start from; its error budget bounds the errors of its values
    #[arg(long)]
    pub(crate) vehicle: PathBuf,
    /// File whose table `sensors` describes the teeth of the speed sensors, such as an experiment file
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// The fitted vehicle file
    #[arg(short, long, value_name = "FITTED.toml")]
    pub(crate) output: PathBuf,
    /// Write the channel map of --map with the fitted delays, scales and zero offsets
    #[arg(long, value_name = "OUT.toml", requires = "map", conflicts_with = "channel")]
    pub(crate) write_map: Option<PathBuf>,
    /// Also fit fill time, kiss point, valve lag and friction by clutch, gears and oil temperature, and write them as a table
    ///
    /// A row has the value, its interval, the number of shifts, and what the logs lack for it. The temperature is that of the channel `oil_temperature`.
    #[arg(long, value_name = "TABLE.csv")]
    pub(crate) adaptation_table: Option<PathBuf>,
    /// Step of the oil temperature in that table, K
    #[arg(long, value_name = "K", default_value_t = 20.0, requires = "adaptation_table", allow_negative_numbers = true, value_parser = within(OIL_STEPS_K))]
    pub(crate) oil_step: f64,
    #[command(flatten)]
    pub(crate) page: PageChoice,
    /// Print what was found as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
