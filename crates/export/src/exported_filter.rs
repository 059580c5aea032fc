//! The filter of a car in single precision, for a controller.

use car::{Car, ErrorBudget, Sensors};
use config::CarFile;
use drivetrain::CommandKind;
use observer::gearbox::{GearboxTables, MAX_ELEMENTS, ShiftRow};
use observer::{GearboxFilter, ShiftTables, gearbox_filter};

use crate::c_text;
use crate::error::ExportError;
use crate::portable::CSource;

/// What is exported of a car.
#[derive(Debug, Clone, Default)]
pub struct ExportOptions {
    /// One shift by its gears, such as `1-2`; without it all shifts of the car.
    pub shift: Option<String>,
    /// How the speeds are read; without it as usual sensors read them.
    pub sensors: Option<Sensors>,
    /// A linked program with the parameters: its addresses go into the description for calibration tools.
    pub program: Option<Vec<u8>>,
    /// `wetclutch.c` as `embedded/portable` makes it, for the same folder: with it no library is needed.
    pub c_source: Option<CSource>,
    /// Shared libraries of `embedded/fmu`, each for another platform: with one of them models for co-simulation are written too.
    pub fmu_libraries: Vec<Vec<u8>>,
    /// The same of `embedded/car_fmu`: models of the simulated car with its shift controller.
    pub car_fmu_libraries: Vec<Vec<u8>>,
}

/// The filter of a car in single precision, and where it is from.
#[derive(Debug, Clone)]
pub struct ExportedFilter {
    /// The car.
    pub car: Car,
    /// Bounds of its errors.
    pub budget: ErrorBudget,
    /// The tables in double precision, by which steps are made.
    pub tables: ShiftTables<f64>,
    single: ShiftTables<f32>,
    filter: GearboxFilter<'static, f32>,
    shifts: Vec<ShiftRow<f32>>,
    /// Name of the car in C: lower case, digits, underscores.
    pub name: String,
    /// SHA-256 of its vehicle file.
    pub vehicle_sha256: String,
    /// That of its gearbox file.
    pub gearbox_sha256: String,
}

/// Of no gearbox.
const NO_TABLES: GearboxTables<'static, f32> = GearboxTables { elements: &[], gears: &[], shifts: &[] };

impl ExportedFilter {
    /// The filter of a car's file.
    ///
    /// # Errors
    /// The gearbox has more clutches than the filter has room for; there is no such shift, or none between two clutches.
    pub fn new(file: &CarFile, options: &ExportOptions) -> Result<Self, ExportError> {
        let car = file.car.clone();
        let sensors = options.sensors.as_ref();
        let budget = ErrorBudget::of_logged_car(&car).read_by(&car, sensors);
        let too_many = |elements| ExportError::TooManyElements { elements, most: MAX_ELEMENTS };
        let tables = ShiftTables::of_car(&car, &budget).map_err(too_many)?;
        let single = tables.cast::<f32>();
        let filter = gearbox_filter(&car, &tables, &budget, sensors).cast(NO_TABLES);
        let mut shifts = single.tables().shifts.to_vec();
        if let Some(name) = &options.shift {
            let [from, to] = car.shift_named(name).map_err(|error| ExportError::Shift(error.to_string()))?;
            shifts.retain(|shift| (shift.from, shift.to) == (from, to));
        }
        if shifts.is_empty() {
            return Err(ExportError::NoShift(options.shift.clone()));
        }
        let [vehicle_sha256, gearbox_sha256] = [&file.source, &file.gearbox_source].map(|source| source.sha256());
        let name = c_text::identifier(&file_name(file));
        Ok(Self { car, budget, tables, single, filter, shifts, name, vehicle_sha256, gearbox_sha256 })
    }

    /// The filter with its tables.
    pub fn filter(&self) -> GearboxFilter<'_, f32> {
        GearboxFilter { tables: GearboxTables { shifts: &self.shifts, ..self.single.tables() }, ..self.filter }
    }

    /// The shifts as pairs of places of gears.
    pub fn shifts(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.shifts.iter().map(|shift| [shift.from, shift.to])
    }

    /// Name of a gear.
    pub(crate) fn gear(&self, place: usize) -> &str {
        self.car.gearbox.gears.get(place).map_or("", |gear| gear.name.as_str())
    }

    /// Names of the elements, in the order of the tables.
    pub(crate) fn elements(&self) -> Vec<&str> {
        self.in_places().into_iter().map(|at| self.car.gearbox.elements[at].name.as_str()).collect()
    }

    /// What the valves of the elements are commanded by, in the same order.
    pub(crate) fn command_kinds(&self) -> Vec<CommandKind> {
        let kind = |at: usize| self.car.clutches.get(at)?.as_ref().map(|clutch| clutch.valve.command_kind());
        self.in_places().into_iter().map(|at| kind(at).unwrap_or(CommandKind::Current)).collect()
    }

    /// The elements of the gearbox that are in the tables, in the order of the tables.
    fn in_places(&self) -> Vec<usize> {
        let elements = 0..self.car.gearbox.elements.len();
        let mut placed: Vec<_> = elements.filter_map(|at| Some((self.tables.place(at)?, at))).collect();
        placed.sort_unstable();
        placed.into_iter().map(|(_, at)| at).collect()
    }
}

/// The name of a file without its ending; of a text that came from no file, that of the car.
fn file_name(file: &CarFile) -> String {
    let stem = file.source.path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    stem.filter(|stem| !stem.is_empty()).unwrap_or_else(|| file.car.name.clone())
}
