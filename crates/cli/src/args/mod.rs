//! The command line.

mod design;
mod logs;
mod studies;
mod unused;

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Parser, Subcommand};
use trace::ShownUnits;

use crate::message::Colors;

pub(crate) use design::{Design, DesignChoice, MethodChoice, PhaseChoice};
pub(crate) use logs::{Convert, Estimate, Fit, FormatChoice, Init, Inspect, LaunchChoice, Mapping, Watch};
pub(crate) use studies::{
    Bench, ErrorBoundOptions, Merge, ObserverChoice, Reproduce, SensitivityOptions, Shard, StudyOptions, Threads,
    WorstCaseOptions,
};

const EXAMPLES: &str = "\
Examples:
  wetclutch demo                                              simulation, design, estimation and report for the built-in car
  wetclutch demo --vehicle vehicles/eight_speed.toml          a drive through all gears of any car, every shift with its estimate
  wetclutch reproduce                                         the source chapter's experiments, statement by statement
  wetclutch bench                                             all observers on many drives, ranked
  wetclutch bench --vehicle vehicles/eight_speed.toml         every shift of a gearbox, in every kind
  wetclutch study experiments/settings.toml -o out            two thousand shifts: errors and sensitivities
  wetclutch simulate experiments/e1.toml -o out               a simulated shift as CSV
  wetclutch design vehicles/two_speed_at.toml                 gains with their certificate
  wetclutch design vehicles/eight_speed.toml                  in which upshifts the pressure is not observable
  wetclutch inspect drive.mf4                                 channels, units, rates and gaps of a log
  wetclutch estimate log.csv --vehicle my_car.toml            pressure from measured signals
  wetclutch watch log.csv --vehicle my_car.toml               the same while the log is written
  wetclutch fit log.csv --vehicle my_car.toml -o fitted.toml  a vehicle file that fits the car
  wetclutch compare my_car.toml fitted.toml                   what differs between two files, or two runs

All files use SI units, which are part of keys and column names. Column names of measured files may also
end in _rpm, _bar, _mpa, _ma, _ms, _km_h; these columns are converted when they are read.
Exit codes: 0 done, 1 the work failed (infeasible, diverged), 2 wrong usage or input.";

/// The options of every command.
const GLOBAL: &str = "Global options";

/// The version, and the commit that a release is made of.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), env!("WETCLUTCH_OF_COMMIT"));

/// A virtual pressure sensor for the wet clutches of automatic transmissions.
///
/// Estimates the hydraulic pressure in an engaging clutch from the speeds and the valve command that
/// a car already has, with a bound on the error.
#[derive(Debug, Parser)]
#[command(name = "wetclutch", version = VERSION, about, after_help = EXAMPLES, arg_required_else_help = true)]
pub(crate) struct Arguments {
    /// Print only errors and warnings, and the results
    #[arg(short, long, global = true, help_heading = GLOBAL)]
    pub(crate) quiet: bool,
    /// Also print the files that are read and written, the assumptions, and each stage of the work with the time since the start
    #[arg(short, long, global = true, help_heading = GLOBAL, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    /// Replace existing output files that this program did not write
    #[arg(long, global = true, help_heading = GLOBAL)]
    pub(crate) force: bool,
    /// When messages are coloured; results never are
    #[arg(long, global = true, help_heading = GLOBAL, value_enum, value_name = "WHEN", default_value_t)]
    pub(crate) color: Colors,
    /// Units of tables, messages and pages, such as rpm,bar,degC: one for each quantity; files and JSON keep SI units
    #[arg(long, global = true, help_heading = GLOBAL, value_name = "UNIT,...", env = "WETCLUTCH_UNITS", hide_env_values = true)]
    pub(crate) units: Option<ShownUnits>,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Simulate a shift, design the observer, estimate the pressure, write the report
    ///
    /// Simulates a launch from rest and a power-on 1st to 2nd upshift of the built-in car,
    /// designs the observer's gains for it, runs the observer and the open loop on the same samples, prints
    /// their errors, and writes:
    ///
    ///   report.html    the report; opens from disk, needs no network
    ///   shift.svg, drive.svg    its figures
    ///   trace.csv      every simulated signal, true values included
    ///   measured.csv   only the signals that a car measures
    ///   estimate.csv   the output of `estimate measured.csv`
    ///
    /// With the vehicle file of a car with a gearbox it drives through all gears: upshifts with the accelerator pressed,
    /// downshifts with it released, then the reverse. --drive gives another drive. The car differs from the vehicle file.
    /// The gearbox filter reads the speeds by toothed wheels and estimates pressure and torque of both clutches. Prints every
    /// shift with its quality and the errors of filter and open loop, and writes:
    ///
    ///   report.html    the drive, the shifts, a figure of each shift
    ///   shifts.csv     the shifts as numbers
    ///   drive.csv, drive_measured.csv    the signals, as `simulate` writes them
    ///
    ///   wetclutch demo --vehicle vehicles/eight_speed.toml -o out
    ///   wetclutch demo --vehicle vehicles/ten_speed.toml --drive drives/city.toml -o out
    #[command(verbatim_doc_comment)]
    Demo(Demo),
    /// Simulate an experiment or a drive and write its signals as CSV
    ///
    /// Simulates an experiment and writes two files: NAME.csv with every signal, true values included, and
    /// NAME_measured.csv with only the signals that a car measures. The same experiment gives the same bytes. Rows are
    /// written during the simulation; the size is printed first if it is more than 1 GB. If the experiment has scenarios,
    /// the drive is simulated without them, or with the scenario given by --scenario. With a table of sensors NAME_measured.csv
    /// has the readings of the sensors.
    ///
    /// A drive file (with segments) gives throttle, brake and grade over time, a shift schedule or a list of shifts, and a
    /// vehicle file with a gearbox. All its shifts are simulated. The columns of the offgoing and oncoming clutch are empty
    /// between shifts. NAME_shifts.csv has a row for each shift: its score, friction work and temperature of the plates;
    /// `wetclutch compare A B` compares those of two calibrations.
    ///
    ///   wetclutch simulate drives/city.toml -o out
    ///   wetclutch simulate drives/city.toml --vehicle vehicles/ten_speed.toml -o out
    #[command(verbatim_doc_comment)]
    Simulate(Simulate),
    /// Design observer gains and print them with their certificate
    ///
    /// Designs the gains of an observer by the five-step procedure: the decay rate follows from the settling
    /// time; the gain is the smallest one with this decay rate at every vertex of the polytope; kappa1 is
    /// increased until the bound on the remaining error is small enough. Requirements come from the vehicle
    /// file; options replace them. If no gain meets a requirement, the best certified gain is printed, with
    /// its error bound and the settling time that would meet the requirement; the exit code is then 1.
    ///
    /// For a car with a gearbox it prints a table of all upshifts from each gear to the next, with the certified bounds
    /// of the open loop and of the best gain; `--shift` prints the gains of one of them. The requirements of such a car
    /// are defaults, and the exit code is 0 also where they are not met. Gains are for power-on upshifts.
    ///
    ///   wetclutch design vehicles/eight_speed.toml
    ///   wetclutch design vehicles/eight_speed.toml --shift 1-2
    ///
    /// To use bounds on the model errors that were found by simulation:
    ///   wetclutch error-bound experiments/error_bound.toml -o bounds.toml
    ///   wetclutch design vehicles/two_speed_at.toml --bounds bounds.toml
    #[command(verbatim_doc_comment)]
    Design(Design),
    /// List what is in a log, suggest a channel map, find the shifts
    ///
    /// Reads a log of any of these formats: CSV (any delimiter, decimal comma, units in names or in a row), Parquet, ASAM MDF 4,
    /// CAN logs (candump, ASC, BLF, PCAN, SavvyCAN, python-can) with a DBC, also of J1939. `-` is standard input. Lists channels, units, groups,
    /// samples, rates, spans, values, gaps, and samples that cannot be used.
    ///
    ///   wetclutch inspect drive.mf4
    ///   wetclutch inspect drive.blf --dbc bus.dbc --suggest > map.toml
    ///   wetclutch inspect drive.blf --map map.toml --shifts -o drive.html
    #[command(verbatim_doc_comment)]
    Inspect(Inspect),
    /// Write the channels of logs as tables: CSV, Parquet or MDF 4
    ///
    /// Writes the decoded channels of logs with their names and units. Logs have the formats that `inspect` reads. A row has the
    /// values of one time; the cell of a channel without a value at that time is empty. Samples that are not good, such as
    /// repeated ones, are left out.
    ///
    /// With --map or --channel only the mapped channels are written, under the names of their signals and in SI units. Next to the
    /// table is OUT_map.toml, a channel map with delays and ranges. With it the table gives the same estimates as the log.
    ///
    ///   wetclutch convert drive.blf --dbc bus.dbc -o drive.parquet
    ///   wetclutch convert drive.mf4 --map map.toml -o drive.csv
    ///   wetclutch estimate drive.csv --map drive_map.toml --vehicle car.toml
    #[command(verbatim_doc_comment)]
    Convert(Convert),
    /// Estimate pressure and torque from a file of measured signals
    ///
    /// Runs an observer over a file of measured signals. The file needs the columns
    ///
    ///   time_s, engine_speed_rad_s, turbine_speed_rad_s,
    ///   oncoming_current_a, or oncoming_duty_percent for pulse-width-modulated valves,
    ///   oncoming_slip_rad_s or output_speed_rad_s,
    ///   and for some observers wheel_speed_rad_s (or wheel_speed_km_h, read with the wheel radius of the vehicle file)
    ///
    /// in any order and in the units rad/s or rpm, A or mA, s or ms. An empty cell or `nan` means that
    /// there is no reading. If the file also contains the true pressure (a simulated drive), the error is reported.
    ///
    /// A log with other names, or of another format (Parquet, MDF 4, CAN with a DBC), needs a channel map, see `inspect
    /// --suggest`; every reading then comes with its own time.
    ///
    /// Shifts are found by the ratio of the speeds, and by gear signals where a channel map has them. For the shifts of the
    /// vehicle file the summary gives pressure, torque and friction work with their range, the lowest shaft torque, and the
    /// error where pressure or torque was measured. With -o OUT.csv, and if there is a shift, it also writes
    ///
    ///   OUT_report.html   the drive and each shift as figures; opens from disk
    ///   OUT_shifts.csv, OUT_shifts.json   the shifts as numbers
    ///
    /// --shift and --shifts choose shifts; the estimate then has only their rows.
    ///
    /// With the vehicle file of a car with a gearbox, both clutches of every shift are estimated from a log with the
    /// columns that `simulate` writes for a drive, or by a channel map with the commands of all elements:
    ///
    ///   wetclutch estimate city_measured.csv --vehicle vehicles/eight_speed.toml -o out.csv
    ///
    /// Rows are read and written one by one: a log may have any length, or be a pipe. Methods that design
    /// gains for a sample time use the median time step of the first 10,000 rows. A file given with -o
    /// appears when it contains all rows; it cannot be the log itself. A log is refused if a signal is unusable in most of
    /// its samples, or if the values of a signal contradict its unit.
    #[command(verbatim_doc_comment)]
    Estimate(Estimate),
    /// Show the estimate of a log while it is written: in the terminal, and on a page
    ///
    /// Estimates a log that grows, or a pipe, as `estimate --follow` does, and shows the latest speeds, pressures and torques with
    /// their ranges, the health, the last seconds as a figure, and the shifts. The screen is redrawn 20 times a second. The estimate is about
    /// half a second behind the log: wrong readings are recognised by those after them. Ctrl-C ends it and prints the table of shifts.
    ///
    /// --serve shows the same on a page, to browsers on this computer alone: at 127.0.0.1, without requests of other sites, and nothing
    /// can be changed there. With it no terminal is needed.
    ///
    ///   wetclutch watch drive.csv --vehicle car.toml
    ///   candump -L can0 | wetclutch watch - --map map.toml --vehicle car.toml --serve --open
    #[command(verbatim_doc_comment)]
    Watch(Watch),
    /// Fit a vehicle file to logs of measured shifts
    ///
    /// Fits converter, clutches, valves, inertias, shafts, mass and delays to the logs. For a car with a gearbox it uses every
    /// shift from one clutch to another and the driving between them; for a vehicle file of one shift its power-on upshifts.
    /// Prints each value with its interval, what these logs do not identify, and which measurement would. Writes the vehicle
    /// file with the fitted values; comments and all other keys stay, and the error budget follows from the fit.
    ///
    /// Needs the signals of `estimate`. Used where the log has them: wheel speed, engine torque, measured pressures. Columns
    /// with the names of `estimate` need no channel map. A fifth of the shifts is held out to check the result.
    ///
    /// If the fitted values are worse on the shifts that are held out, or end at the limit of their prior, the given values are
    /// kept. The new file then has the reason in its first line, a warning reports it, and the exit code is 0. Without a fit no
    /// file is written, and the exit code is 1 or 2.
    ///
    ///   wetclutch fit drive1.mf4 drive2.mf4 --map map.toml --vehicle car.toml -o fitted.toml
    #[command(verbatim_doc_comment)]
    Fit(Fit),
    /// Write a first vehicle file for a car from a few numbers
    ///
    /// Writes a short vehicle file: with --gearbox for all gears of an automatic, with --ratios for one upshift. All other
    /// values are defaults, scaled to the size of the car. Comments in the file list values that you may know and that change the
    /// estimate. `check` lists the defaults and shows which values matter most for the estimate; `fit` identifies them from logs.
    ///
    ///   wetclutch init --gearbox 8hp --mass-kg 1900 --wheel-radius-m 0.33 --final-ratio 2.8 --engine-torque-n-m 400 -o car.toml
    ///   wetclutch init --ratios 4.17,2.34 --mass-kg 1650 --wheel-radius-m 0.32 --final-ratio 3.2 --engine-torque-n-m 250 -o car.toml
    ///
    /// A shipped gearbox is written next to the vehicle file, with pistons and springs for the engine torque. With --ratios and
    /// --complete, the file has every key, and a comment gives the source of each value.
    #[command(verbatim_doc_comment)]
    Init(Init),
    /// Run the source chapter's experiments and compare the results with its statements
    ///
    /// Runs experiments E1 to E4 of the source chapter on the built-in car, and again in the settings that the
    /// chapter leaves open (experiments/plausible.toml). Writes
    ///
    ///   reproduction.html   statements, figures, scores; opens from disk
    ///   reproduction.md     statements and scores as Markdown
    ///   reproduction.json   statements as numbers
    ///   e1.svg ... e4.svg, map_*.svg    the figures
    #[command(verbatim_doc_comment)]
    Reproduce(Reproduce),
    /// Run all observers over many scenarios and rank them against the open loop
    ///
    /// Runs every observer of an experiment file on every scenario of the file. All observers get the same drives; the
    /// built-in bench runs them at 100 Hz with real sensors. Prints the RMS error of each observer in each phase, and its
    /// ratio to the RMS error of the open loop; with -o, also writes them as a page. experiments/field.toml is a bench of
    /// errors of the readings: scale, delays, outliers, lost readings, channels with separate clocks.
    ///
    /// With the vehicle file of a car with a gearbox: every shift between neighbouring gears, up and down, with power and
    /// without, each in --draws cars, estimated by the gearbox filter and by the open loop. Prints the RMS errors of the
    /// clutch torques (N m) by phase and their ratio, by shift and by kind; with -o, also writes bench.html and bench.csv.
    ///
    ///   wetclutch bench --vehicle vehicles/eight_speed.toml --draws 10 -o out
    #[command(verbatim_doc_comment)]
    Bench(Bench),
    /// Run thousands of shifts with varied parameters
    ///
    /// Runs a study file. A study of one shift varies any numbers of car, drive, controller, valves and sensors of an
    /// experiment. A study of cars with a gearbox simulates a drive, or shifts, of many cars that differ in friction, valves
    /// and converter; it writes no page and no figures. Writes
    ///
    ///   runs.csv, runs.parquet    one row for each run: factors, seed, status, shift quality, scores
    ///   study.html                distributions, sensitivity of the error, worst runs; opens from disk
    ///   figures/                  its figures
    ///
    /// In runs.csv `inf` means that an estimate was not finite. The same study gives the same bytes on any number of
    /// threads, in one run or resumed, whole or in shards. One process at a time writes to a folder (wetclutch.lock).
    #[command(verbatim_doc_comment)]
    Study(StudyOptions),
    /// Merge the shards of a study
    ///
    /// Merges the results of `study --shard 1/N` to `study --shard N/N`. The result has the same bytes as the study
    /// in one run.
    #[command(verbatim_doc_comment)]
    Merge(Merge),
    /// Find bounds on the errors of the observers' models by simulation
    ///
    /// Runs a study and computes, at every instant of its shifts, the difference between the accelerations of the
    /// simulated car and those of the rigid and the compliant model. The result is |w| and H, which the gain design
    /// needs, and the part of each cause.
    #[command(verbatim_doc_comment)]
    ErrorBound(ErrorBoundOptions),
    /// Search a study's factors for the run with the largest error of an observer
    ///
    /// Runs the study, then continues from its worst runs with the simplex method of Nelder and Mead.
    #[command(verbatim_doc_comment)]
    WorstCase(WorstCaseOptions),
    /// Show the effect of the pressure, and of each error, on the speeds
    ///
    /// Reads the error bounds of a vehicle file. For each phase it prints the equivalent pressure error of each of them,
    /// and whether an observer can distinguish the error from a pressure.
    ///
    /// For a car with a gearbox it prints the effect of each error on the estimate of every shift between neighbouring gears.
    /// It also lists the shifts in which the clutch torque is not observable by the speeds; there the estimate is the valve
    /// model's.
    #[command(verbatim_doc_comment)]
    Sensitivity(SensitivityOptions),
    /// Compare two runs, or two files of cars
    ///
    /// A run is what `estimate`, `demo` or `simulate` has written: its folder, its table of shifts (OUT_shifts.csv), or its signals (CSV,
    /// Parquet or MDF 4). Shifts are matched by time and gears; where the times do not agree, by gears and kind in the order in which they come.
    /// Prints how scores, errors, ranges and estimates of these shifts differ, the largest difference first. The page also has the curves of the
    /// shifts over each other.
    ///
    /// Of two vehicle files, or two gearbox files: the keys whose values differ, defaults included, the largest relative difference first.
    ///
    ///   wetclutch compare before_shifts.csv after_shifts.csv -o compared.html --open
    ///   wetclutch compare my_car.toml fitted.toml
    #[command(verbatim_doc_comment)]
    Compare(Compare),
    /// Check vehicle, gearbox, experiment, drive and study files
    ///
    /// Checks vehicle, gearbox, experiment, drive and study files, and the files that they name, and prints a summary. Also checks
    /// bounds files for `design --bounds`, sensors files for `estimate --sensors` and channel maps for --map. Names all unknown
    /// and missing keys and all values outside their ranges. All files are checked; the exit code is that of the worst.
    /// Warns of given gains that are unstable at a vertex.
    ///
    /// For a vehicle file it lists the values that are defaults, and which of them matter most. The measure is the RMS change of
    /// the estimated pressure and clutch torque in a simulated upshift when one default is wrong by its error bound, or by a
    /// stated fraction. --all shows every one.
    ///
    /// For a gearbox file, or a vehicle file that names one, it prints the gears with ratios and holding torques, the capacity of
    /// the elements, and the shifts with their elements. Warns of elements that slip at full throttle. With -o it draws the
    /// gearbox:
    ///
    ///   train.svg      shafts, planetary sets, gear pairs and elements
    ///   gear_NAME.svg  the same in a gear: engaged elements, shaft speeds, levers of the sets
    #[command(verbatim_doc_comment)]
    Check(Check),
    /// Write the observer of a car for a transmission controller
    ///
    /// Writes the gearbox filter of a car in single precision into a folder, for a controller that links the static library
    /// libwetclutch.a with C code, or compiles wetclutch.c:
    ///
    ///   wetclutch.h                     functions, input, estimate and status, with units
    ///   wetclutch_CAR.h                 places of elements and gears, memory, the parameters as a struct
    ///   wetclutch_CAR_parameters.c      the parameters as a constant
    ///   wetclutch_CAR_parameters.bin    the same bytes as an image, with version, size and checksum
    ///   wetclutch_CAR.a2l               parameters and estimate for calibration tools (ASAP2 1.61)
    ///   wetclutch_CAR_selftest.c        a simulated shift and its estimates to the last bit
    ///   wetclutch_CAR_sfunction.c       the observer as a block of Simulink
    ///   example.c, README.md            the observer in a task, and how it is built
    ///   certificate.md, report.md       what the ranges assume; sizes
    ///   wetclutch.c, CMakeLists.txt     with --c: the observer itself in C99, instead of the library
    ///   wetclutch_CAR_fmi2.fmu, ...fmi3.fmu    with --fmu: the observer for co-simulation (FMI 2.0, FMI 3.0)
    ///   wetclutch_CAR_car_fmi2.fmu, ...    with --car-fmu: the car itself, which shifts
    ///
    /// The same car gives the same bytes. Library and wetclutch.c are the same for all cars; README.md says how they are built.
    ///
    ///   wetclutch export vehicles/eight_speed.toml -o out
    ///   wetclutch export vehicles/eight_speed.toml --shift 1-2 -o out
    ///   wetclutch export vehicles/eight_speed.toml --shift 1-2 --check-elf firmware.elf -o out
    #[command(verbatim_doc_comment)]
    Export(Export),
    /// Print completions for a shell
    Completions(Completions),
    /// Write the manual pages into a folder
    Man(Man),
}

#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub(crate) struct Man {
    /// Folder for the pages: `wetclutch.1`, and one of each command
    pub(crate) folder: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Vehicle file with a gearbox: a drive through all of its gears
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Drive file in place of the drive through all gears
    #[arg(long, value_name = "FILE", requires = "vehicle")]
    pub(crate) drive: Option<PathBuf>,
    /// Seed of the driven car, whose friction, valve gains, converter and strokes of pistons differ from those of the vehicle
    /// file, and of the noise
    #[arg(long, value_name = "N", default_value_t = 1, requires = "vehicle")]
    pub(crate) seed: u64,
    /// Folder for the report
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-demo")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) open: Open,
    /// Print files and errors as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Experiment file, or drive file
    pub(crate) experiment: PathBuf,
    /// Vehicle file with a gearbox, for a drive file; it replaces the one that the drive file names
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Scenario of the experiment to simulate; the files are then called NAME.SCENARIO
    #[arg(long, value_name = "NAME")]
    pub(crate) scenario: Option<String>,
    /// Folder for the signals
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Print files and drive as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// Run, vehicle file or gearbox file
    #[arg(value_name = "A")]
    pub(crate) a: PathBuf,
    /// The one that it is compared with
    #[arg(value_name = "B")]
    pub(crate) b: PathBuf,
    /// Page of the comparison, with figures
    #[arg(short, long, value_name = "PAGE.html")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) open: OpenOutput,
    /// Print the differences as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Check {
    /// Vehicle, gearbox, experiment, drive, study, bounds or sensors files, or channel maps
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// File whose table `sensors` describes the sensors of a car with a gearbox; default: those of experiments/bench.toml
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// Folder for the diagrams of a gearbox
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Show every default of a vehicle file
    #[arg(long)]
    pub(crate) all: bool,
    #[command(flatten)]
    pub(crate) page: PageChoice,
    /// Print kind, errors, warnings and defaults of each file as JSON
    #[arg(long, conflicts_with_all = ["sensors", "output", "all", "page"])]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// Vehicle file of a car with a gearbox
    pub(crate) vehicle: PathBuf,
    /// One shift by its gears; without it all shifts of the car
    #[arg(long, value_name = "FROM-TO")]
    pub(crate) shift: Option<String>,
    /// All shifts of the car, as without --shift
    #[arg(long, conflicts_with = "shift")]
    pub(crate) all: bool,
    /// File whose table `sensors` describes the sensors; default: readings without delay, with usual noise
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// Linked program of the controller: its addresses go into the .a2l. Fails if it has the parameters of another car or version
    #[arg(long, value_name = "FIRMWARE.elf")]
    pub(crate) check_elf: Option<PathBuf>,
    /// Also write the C99 of the observer, this wetclutch.c, for a compiler that Rust has no target for: no library is needed then
    #[arg(long, value_name = "wetclutch.c")]
    pub(crate) c: Option<PathBuf>,
    /// Also write the filter for co-simulation (FMI 2.0 and 3.0), with this shared library of embedded/fmu; repeat it for another platform
    #[arg(long, value_name = "LIBRARY")]
    pub(crate) fmu: Vec<PathBuf>,
    /// Also write the simulated car with its shift controller for co-simulation, with this shared library of embedded/car_fmu
    #[arg(long, value_name = "LIBRARY")]
    pub(crate) car_fmu: Vec<PathBuf>,
    /// Folder for the files
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Print the files as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Whether a page that is written always is opened.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Open {
    /// Open the page in the browser
    #[arg(id = "open", long = "open")]
    pub(crate) is_wanted: bool,
}

/// Whether a page that is written to the place of `--output` is opened.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct OpenOutput {
    /// Open the page in the browser
    #[arg(id = "open", long = "open", requires = "output")]
    pub(crate) is_wanted: bool,
}

/// A page of what a command prints.
#[derive(Debug, Clone, Args)]
pub(crate) struct PageChoice {
    /// Page of the result, with figures
    #[arg(long, value_name = "PAGE.html")]
    pub(crate) page: Option<PathBuf>,
    /// Open the page in the browser
    #[arg(id = "open", long = "open", requires = "page")]
    pub(crate) is_opened: bool,
}

/// A whole number within these limits.
fn whole<N>(range: RangeInclusive<N>) -> impl Fn(&str) -> Result<N, String> + Clone
where
    N: Copy + PartialOrd + Display + FromStr,
{
    move |text| match text.parse::<N>() {
        Ok(value) if range.contains(&value) => Ok(value),
        _ => Err(format!("expected a whole number from {} to {}", range.start(), range.end())),
    }
}

/// A number in this range, as a vehicle file has it.
fn within(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse::<f64>() {
        Ok(value) if range.contains(&value) => Ok(value),
        _ => Err(format!("expected a number from {} to {}", range.start(), range.end())),
    }
}
