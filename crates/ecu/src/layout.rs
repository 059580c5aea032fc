//! The order of a car's parameters in an image. It is the only place of this order, for writing as for reading.
//!
//! A change here, or of a type below, is another [`super::FORMAT_VERSION`]; a test compares the names.

use car::FillBudget;
use drivetrain::table::MAX_POINTS;
use drivetrain::{Clutch, ClutchValve, Converter, Cylinder, Driveline, Passage, PulseWidth, Table1, ValveMaps};
use observer::gearbox::{
    AccelerationReading, ElementUncertainty, FrictionElement, GearRow, Piston, ShiftClutch, ShiftElement, ShiftRow,
    ShiftUncertainty, TurbineTorque, ValveLimits,
};
use observer::{Budget, EngineNoise, GearboxFilter, GearboxTables, InputLimits, SpeedReading, ValveModel};

use crate::words::{Layout, Sink, Words};

/// The fields of a type in their order.
macro_rules! layout {
    ($($type:ident { $($field:ident),+ $(,)? })+) => { $(
        impl Layout for $type<f32> {
            fn put(&self, name: &'static str, sink: &mut impl Sink) {
                sink.begin(name);
                $(self.$field.put(stringify!($field), sink);)+
                sink.end();
            }

            fn take(words: &mut Words<'_>) -> Option<Self> {
                Some(Self { $($field: Layout::take(words)?),+ })
            }
        }
    )+ };
}

layout! {
    Driveline { final_ratio, shaft_stiffness_n_m_rad, shaft_damping_n_m_s_rad, wheel_inertia_kg_m2 }
    Converter { capacity_n_m_s2, torque_ratio }
    TurbineTorque { converter, engine_inertia_kg_m2, converter_share, engine_share }
    ShiftUncertainty {
        torque_fraction_s, pressure_s, turbine_share, turbine_share_s, inertia_share, stiffness_fraction, wheel_scale,
        wheel_scale_walk, rate_rad_s, rate_walk, channel_skew_s, load_walk, output_least_rad_s,
    }
    SpeedReading { std_dev_rad_s, lag_rad, pitch_rad, delay_s }
    EngineNoise { reading_rad_s, acceleration_walk, acceleration_max_rad_s2 }
    AccelerationReading { std_dev_m_s2, bias_m_s2, scale_fraction, delay_s, delay_std_dev_s, is_stated, per_torque }
    InputLimits { speed_max_rad_s, command_max, command_error, pressure_max_pa, shaft_torque_max_n_m }
    Clutch { mean_radius_m, friction_faces, piston_area_m2, return_spring_n, friction, static_friction }
    ValveMaps { time_constant_s, gain_pa_a, delay_s }
    PulseWidth { flow_sqrt_pa_s, line_pressure_pa }
    ValveModel { valve, delay_s }
    ValveLimits { command_max, command_error, pressure_max_pa }
    Passage { laminar_pa_s2_m5, orifice_pa_s2_m6 }
    Cylinder {
        stroke_m3, preload_pa, kiss_pa, home_capacity_m3_pa, capacity_m3_pa, supply, exhaust, flow_max_m3_s, leak_m3_s_pa,
        viscosity_m2_s,
    }
    Piston { cylinder, each }
    FillBudget {
        volume_m3, preload_pressure_pa, kiss_pressure_pa, supply, exhaust, viscosity_m2_s, flow_max_m3_s, leak_m3_s_pa,
        capacity_m3_pa,
    }
    Budget {
        valve, lag_factor, gain_factor, delay_s, hysteresis_pa, command, command_age_s, line_pressure_pa, pressure_max_pa, fill,
        friction_factor, drag_n_m, slip_rad_s,
    }
    ElementUncertainty { torque_fraction, slow_part, valve_gain, kiss_point_pa, valve_lag_fraction, valve_delay_s, pressure_pa, drag_n_m, widths }
    FrictionElement { clutch, valve, limits, piston, budget, uncertainty }
    GearRow { ratio, inertia_kg_m2, holding }
    ShiftClutch { element, alpha, ratio }
    ShiftRow { from, to, clutches, mass_kg_m2, slips, has_dog }
}

/// Words of an element of a shift that is no clutch or brake with a place in the tables.
const ONE_WAY: u32 = u32::MAX;
const UNKNOWN: u32 = u32::MAX - 1;
const DOG: u32 = u32::MAX - 2;
/// Added to the place of one whose gear a one-way clutch holds too.
const ONE_SIDED: u32 = 1 << 31;

impl Layout for ShiftElement {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        let word = match *self {
            Self::Friction(place) => u32::from(place),
            Self::OneSided(place) => ONE_SIDED + u32::from(place),
            Self::OneWay => ONE_WAY,
            Self::Dog => DOG,
            Self::Unknown => UNKNOWN,
        };
        sink.whole(name, word);
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        Some(match words.whole()? {
            ONE_WAY => Self::OneWay,
            UNKNOWN => Self::Unknown,
            DOG => Self::Dog,
            word if word >= ONE_SIDED => Self::one_sided((word - ONE_SIDED) as usize),
            place => Self::at(place as usize),
        })
    }
}

/// Its points alone: slopes follow from them.
impl Layout for Table1<f32> {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        sink.begin(name);
        sink.whole("points", self.axis().len() as u32);
        sink.reals("axis", self.axis());
        sink.reals("values", self.values());
        sink.end();
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        let points = words.whole()? as usize;
        let mut columns = [[0.0; MAX_POINTS]; 2];
        for column in &mut columns {
            for value in column.get_mut(..points)? {
                *value = words.real()?;
            }
        }
        let [axis, values] = &columns;
        Self::new(axis.get(..points)?, values.get(..points)?).ok()
    }
}

const PROPORTIONAL: u32 = 0;
const NORMALLY_HIGH: u32 = 1;
const PULSE_WIDTH: u32 = 2;

impl Layout for ClutchValve<f32> {
    fn put(&self, name: &'static str, sink: &mut impl Sink) {
        sink.begin(name);
        match self {
            Self::Proportional(maps) => {
                sink.whole("kind", PROPORTIONAL);
                maps.put("maps", sink);
            }
            Self::NormallyHigh { maps, zero_pressure_a } => {
                sink.whole("kind", NORMALLY_HIGH);
                maps.put("maps", sink);
                zero_pressure_a.put("zero_pressure_a", sink);
            }
            Self::PulseWidth { law, delay_s } => {
                sink.whole("kind", PULSE_WIDTH);
                law.put("law", sink);
                delay_s.put("delay_s", sink);
            }
        }
        sink.end();
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        Some(match words.whole()? {
            PROPORTIONAL => Self::Proportional(Layout::take(words)?),
            NORMALLY_HIGH => Self::NormallyHigh { maps: Layout::take(words)?, zero_pressure_a: words.real()? },
            PULSE_WIDTH => Self::PulseWidth { law: Layout::take(words)?, delay_s: Layout::take(words)? },
            _ => return None,
        })
    }
}

/// A gearbox filter without its tables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Parameters<T> {
    driveline: Driveline<T>,
    wheels_kg_m2: T,
    turbine: TurbineTorque<T>,
    uncertainty: ShiftUncertainty<T>,
    readings: [SpeedReading<T>; 3],
    engine: SpeedReading<T>,
    engine_noise: EngineNoise<T>,
    acceleration: AccelerationReading<T>,
    limits: InputLimits<T>,
}

layout! {
    Parameters { driveline, wheels_kg_m2, turbine, uncertainty, readings, engine, engine_noise, acceleration, limits }
}

impl Parameters<f32> {
    /// Those of a filter.
    pub(crate) fn of(filter: &GearboxFilter<'_, f32>) -> Self {
        let GearboxFilter {
            tables: _,
            driveline,
            wheels_kg_m2,
            turbine,
            uncertainty,
            readings,
            engine,
            acceleration,
            limits,
        } = *filter;
        let (engine, engine_noise) = engine;
        Self { driveline, wheels_kg_m2, turbine, uncertainty, readings, engine, engine_noise, acceleration, limits }
    }

    /// The filter with these tables.
    pub(crate) fn filter<'a>(&self, tables: GearboxTables<'a, f32>) -> GearboxFilter<'a, f32> {
        let Self {
            driveline,
            wheels_kg_m2,
            turbine,
            uncertainty,
            readings,
            engine,
            engine_noise,
            acceleration,
            limits,
        } = *self;
        let engine = (engine, engine_noise);
        GearboxFilter { tables, driveline, wheels_kg_m2, turbine, uncertainty, readings, engine, acceleration, limits }
    }
}
