//! A car of a few numbers: a mid-size car, scaled to them.

use drivetrain::oil::WARM_OIL_DEGC;
use drivetrain::{
    Clutch, ClutchValve, Converter, Cylinder, Driveline, Engine, RoadLoad, Table1, Table2, TableError, Tyre, ValveMaps,
};
use geartrain::{ElementKind, Gearbox, GearboxElement};

use crate::one_shift::{ENGINE_TORQUE_N_M, FINAL_RATIO};
use crate::{Car, CarErrorBounds, ShiftClutch, ratios_alone};

/// Mass of the car that is scaled, kg. All of its values are those of `vehicles/eight_speed.toml`, whose comments have the sources.
pub const MASS_KG: f64 = 1500.0;
/// Rolling radius of its wheels, m.
pub const WHEEL_RADIUS_M: f64 = 0.3;
/// Ratio of its lowest gear.
pub const LOWEST_RATIO: f64 = 108.0 / 23.0;
/// Line pressure, Pa.
const LINE_PRESSURE_PA: f64 = 1.6e6;
/// Its engine map: throttle, speeds, rad/s, and torques, N m.
const THROTTLE: [f64; 9] = [0.0, 0.05, 0.10, 0.20, 0.30, 0.40, 0.50, 0.60, 1.00];
const ENGINE_RAD_S: [f64; 12] =
    [83.78, 136.14, 188.50, 240.86, 293.22, 345.58, 397.94, 450.29, 502.65, 555.01, 607.37, 659.73];
const ENGINE_N_M: [[f64; 9]; 12] = [
    [-13.3, 45.0, 90.0, 107.0, 109.0, 110.0, 111.0, 114.0, 116.0],
    [-22.7, 60.0, 105.0, 132.0, 133.0, 134.0, 136.0, 138.0, 141.0],
    [-32.7, 35.0, 89.0, 133.0, 141.0, 142.0, 144.0, 145.0, 149.0],
    [-43.8, 19.0, 70.0, 133.0, 147.0, 148.0, 150.0, 151.0, 155.0],
    [-55.4, 3.0, 55.0, 133.0, 153.0, 159.0, 161.0, 163.0, 165.0],
    [-67.9, 0.0, 41.0, 126.0, 152.0, 161.0, 165.0, 167.0, 171.0],
    [-81.0, 0.0, 33.0, 116.0, 150.0, 160.0, 167.0, 170.0, 175.0],
    [-95.1, 0.0, 26.0, 110.0, 155.0, 169.0, 176.0, 180.0, 184.0],
    [-109.8, 0.0, 18.0, 106.0, 155.0, 174.0, 179.0, 185.0, 190.0],
    [-125.6, 0.0, 12.0, 96.0, 147.0, 167.0, 175.0, 181.0, 187.0],
    [-142.1, 0.0, 4.0, 84.0, 136.0, 161.0, 170.0, 175.0, 183.0],
    [-158.6, 0.0, 0.0, 72.0, 120.0, 145.0, 153.0, 159.0, 171.0],
];
/// Its converter: speed ratio, capacity, N m s^2, and torque ratio.
const SPEED_RATIO: [f64; 18] =
    [0.0, 0.10, 0.20, 0.30, 0.40, 0.50, 0.60, 0.70, 0.80, 0.85, 0.90, 0.95, 1.00, 1.10, 1.22, 1.375, 1.57, 1.83];
const CAPACITY_N_M_S2: [f64; 18] = [
    4.3976e-3, 4.2200e-3, 4.1074e-3, 3.8955e-3, 3.6995e-3, 3.3904e-3, 3.0824e-3, 2.7230e-3, 2.3497e-3, 2.0482e-3,
    1.7697e-3, 0.98672e-3, 0.0, -0.4560e-3, -0.9119e-3, -1.5502e-3, -2.4735e-3, -3.8185e-3,
];
const TORQUE_RATIO: [f64; 18] =
    [2.00, 1.88, 1.77, 1.66, 1.55, 1.43, 1.32, 1.21, 1.10, 1.04, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00, 1.00];
/// Friction of its clutches over slip, rad/s, over the friction coefficient of the gearbox, and the same at rest.
const SLIP_RAD_S: [f64; 5] = [0.0, 10.0, 50.0, 150.0, 450.0];
const FRICTION_FACTOR: [f64; 5] = [1.0, 1.025, 1.08, 1.15, 1.21];
const STATIC_FACTOR: f64 = 1.08;
/// Peak of the drag of an open clutch, N m.
const DRAG_N_M: f64 = 1.1;
/// Its valves: lag, s, over pressure, Pa; gain, Pa/A, and delay, s, over current, A.
const LAG: [[f64; 7]; 2] =
    [[0.0, 0.05e6, 0.1e6, 0.2e6, 0.4e6, 0.7e6, 1.0e6], [0.20, 0.12, 0.08, 0.05, 0.035, 0.025, 0.02]];
const GAIN: [[f64; 7]; 2] =
    [[0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0], [1.00e6, 1.14e6, 1.26e6, 1.34e6, 1.43e6, 1.50e6, 1.57e6]];
const DELAY: [[f64; 4]; 2] = [[0.0, 0.2, 0.5, 1.0], [0.030, 0.022, 0.012, 0.0]];

/// The numbers of a car that all other values are scaled to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarSize {
    /// Mass with driver, kg.
    pub mass_kg: f64,
    /// Maximum engine torque, N m.
    pub engine_torque_n_m: f64,
    /// Rolling radius of the driven wheels, m.
    pub wheel_radius_m: f64,
    /// Ratio from the gearbox output to the wheels.
    pub final_ratio: f64,
}

/// Factors on values that depend on the size of a car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// On torque and inertia of the engine, and on the capacity of the converter.
    pub engine: f64,
    /// On stiffness and damping of the drive shafts: by the torque at the wheels in the lowest gear.
    pub shafts: f64,
    /// On the inertia of the wheels.
    pub wheels: f64,
    /// On the largest force of the tyres.
    pub tyres: f64,
    /// On the moment of the rolling resistance.
    pub rolling: f64,
}

/// Why there is no car of these numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TemplateError {
    /// A number is zero, negative or not finite.
    #[error("`{name}` is {value}, expected a number above zero")]
    NotPositive {
        /// The number.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A clutch or brake of the gearbox has no plates.
    #[error(
        "element {element} of the gearbox has no plates\n\
         hint: give its `pack`: faces, radius, friction, piston and return spring"
    )]
    NoPlates {
        /// Its name.
        element: String,
    },
    /// A table of the template cannot be right.
    #[error(transparent)]
    Table(#[from] TableError),
}

impl CarSize {
    /// The usual size of a car of this mass, kg: engine torque in proportion to the mass, wheels and final ratio of a mid-size car.
    pub fn of_mass(mass_kg: f64) -> Self {
        let engine_torque_n_m = ENGINE_TORQUE_N_M * mass_kg / MASS_KG;
        Self { mass_kg, engine_torque_n_m, wheel_radius_m: WHEEL_RADIUS_M, final_ratio: FINAL_RATIO }
    }

    /// What to scale the values of the template by, with a gearbox of this ratio in the lowest gear.
    pub fn scales(&self, lowest_ratio: f64) -> Scales {
        let engine = self.engine_torque_n_m / ENGINE_TORQUE_N_M;
        let (mass, radius) = (self.mass_kg / MASS_KG, self.wheel_radius_m / WHEEL_RADIUS_M);
        Scales {
            engine,
            shafts: engine * lowest_ratio * self.final_ratio / (LOWEST_RATIO * FINAL_RATIO),
            wheels: mass * radius * radius,
            tyres: mass,
            rolling: mass * radius,
        }
    }

    fn check(&self) -> Result<(), TemplateError> {
        let numbers = [
            ("mass_kg", self.mass_kg),
            ("engine_torque_n_m", self.engine_torque_n_m),
            ("wheel_radius_m", self.wheel_radius_m),
            ("final_ratio", self.final_ratio),
        ];
        match numbers.into_iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            Some((name, value)) => Err(TemplateError::NotPositive { name, value }),
            None => Ok(()),
        }
    }
}

impl Car {
    /// A car of this mass, kg, with this gearbox, a torque converter and usual values for everything else.
    ///
    /// ```
    /// use car::Car;
    /// use geartrain::{Description, Gearbox, Given, Ratio, Ratios};
    ///
    /// let gears = [("1", 4.17), ("2", 2.34), ("3", 1.52), ("4", 1.14), ("5", 0.87), ("6", 0.69)];
    /// let gears = gears.map(|(name, ratio)| Ratio { name: name.to_owned(), ratio }).to_vec();
    /// let given = Given::Ratios(Ratios { gears, masses: Vec::new() });
    /// let description = Description { name: "six speeds".to_owned(), line_pressure_pa: None, given };
    /// let car = Car::template(Gearbox::new(&description)?, 1900.0)?;
    /// assert_eq!((car.gearbox.gears.len(), car.road.mass_kg), (6, 1900.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The mass is not above zero, or a clutch of the gearbox has no plates.
    pub fn template(gearbox: Gearbox, mass_kg: f64) -> Result<Self, TemplateError> {
        Self::of_size(gearbox, &CarSize::of_mass(mass_kg))
    }

    /// A car of this size with this gearbox, a torque converter and usual values for everything else. Plates, pistons and inertias of
    /// the gearbox are as they are: they are not scaled to the engine.
    ///
    /// # Errors
    /// A number is not above zero, or a clutch of the gearbox has no plates.
    pub fn of_size(mut gearbox: Gearbox, size: &CarSize) -> Result<Self, TemplateError> {
        size.check()?;
        let lowest = gearbox.forward_gears().first().map_or(LOWEST_RATIO, |&gear| gearbox.gears[gear].ratio);
        let scales = size.scales(lowest);
        let engine = engine(scales.engine)?;
        let assumed = gearbox.has_ratios_alone().then(|| ratios_alone::assume_masses(&mut gearbox, &engine)).flatten();
        let clutches = gearbox.elements.iter().map(clutch).collect::<Result<Vec<_>, _>>()?;
        let elements = vec![crate::ElementErrorBounds::default(); clutches.len()];
        Ok(Self {
            name: gearbox.name.clone(),
            gearbox,
            error_bounds: CarErrorBounds { inertia_share: assumed, elements, ..CarErrorBounds::default() },
            clutches,
            line_pressure_pa: LINE_PRESSURE_PA,
            engine,
            converter: Some(Converter {
                capacity_n_m_s2: Table1::new(&SPEED_RATIO, &CAPACITY_N_M_S2)?.scaled(scales.engine),
                torque_ratio: Table1::new(&SPEED_RATIO, &TORQUE_RATIO)?,
            }),
            lock_up: None,
            driveline: Driveline {
                final_ratio: size.final_ratio,
                shaft_stiffness_n_m_rad: scales.shafts * 13_000.0,
                shaft_damping_n_m_s_rad: scales.shafts * 20.0,
                wheel_inertia_kg_m2: scales.wheels * 2.4,
            },
            backlash_rad: 0.0,
            tyre: Tyre { max_force_n: scales.tyres * 13_200.0, slip_scale: 0.1, floor_m_s: 2.0 },
            road: RoadLoad {
                mass_kg: size.mass_kg,
                wheel_radius_m: size.wheel_radius_m,
                front_area_m2: 2.0,
                drag_coefficient: 0.3,
                air_density_kg_m3: 1.2,
                rolling_moment_n_m: scales.rolling * 100.0,
                grade_rad: 0.0,
            },
            oil_temperature_degc: WARM_OIL_DEGC,
        })
    }
}

/// The engine, times this factor.
fn engine(size: f64) -> Result<Engine<f64>, TemplateError> {
    let rows: Vec<&[f64]> = ENGINE_N_M.iter().map(<[f64; 9]>::as_slice).collect();
    let torque_n_m = Table2::new(&ENGINE_RAD_S, &THROTTLE, &rows)?.scaled(size);
    Ok(Engine { inertia_kg_m2: size * 0.17, drag_n_m_s: 0.047, torque_n_m })
}

/// A clutch or brake with the plates of the gearbox; `None` for a one-way clutch or a dog.
fn clutch(element: &GearboxElement) -> Result<Option<ShiftClutch>, TemplateError> {
    if !matches!(element.kind, ElementKind::Clutch | ElementKind::Brake) {
        return Ok(None);
    }
    let pack = element.pack.ok_or_else(|| TemplateError::NoPlates { element: element.name.clone() })?;
    let clutch = Clutch {
        friction: Table1::new(&SLIP_RAD_S, &FRICTION_FACTOR)?.scaled(pack.static_friction),
        static_friction: STATIC_FACTOR * pack.static_friction,
        ..pack
    };
    let maps = ValveMaps {
        time_constant_s: Table1::new(&LAG[0], &LAG[1])?,
        gain_pa_a: Table1::new(&GAIN[0], &GAIN[1])?,
        delay_s: Table1::new(&DELAY[0], &DELAY[1])?,
    };
    Ok(Some(ShiftClutch {
        clutch,
        valve: ClutchValve::Proportional(maps),
        hysteresis_pa: 0.0,
        cylinder: Cylinder::of_clutch(&clutch).with_oil(WARM_OIL_DEGC),
        has_stroke: false,
        drag_n_m: DRAG_N_M,
        steel_mass_kg: None,
    }))
}
