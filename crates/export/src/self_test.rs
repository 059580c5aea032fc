//! The self-test of a car: readings of a simulated shift and what the observer makes of them, to the last bit.

use std::fmt::Write as _;

use car::Sensors;
use ecu::{Estimate, Input, OwnedObserver, Reading, crc32};

use crate::c_text::{hex_float, upper};
use crate::shift_inputs::shift_inputs;
use crate::{ExportError, ExportedFilter, Image};

/// Steps of the self-test, from 0.4 s before the request on.
const FIRST: usize = 60;
const STEPS: usize = 160;

/// What is compared in each step, one by one; everything is in the checksum.
const COMPARED: [&str; 6] = [
    "offgoing.pressure_pa",
    "offgoing.torque_n_m",
    "oncoming.pressure_pa",
    "oncoming.torque_n_m",
    "turbine_n_m",
    "shaft_n_m",
];

/// Readings of a simulated shift and the estimates for them.
pub(crate) struct SelfTest {
    /// The shift, by the places of its gears.
    pub(crate) shift: [usize; 2],
    inputs: Vec<Input>,
    estimates: Vec<Estimate>,
}

impl SelfTest {
    /// The first shift of a filter that can be simulated, of upshifts first: the filter learns from these.
    pub(crate) fn of(filter: &ExportedFilter, image: &Image, sensors: Option<&Sensors>) -> Result<Self, ExportError> {
        let usual = config::ExperimentFile::bench().ok().and_then(|file| file.experiment.sensors);
        let failed = |shift, message| ExportError::SelfTest { shift: filter.shift_name(shift), message };
        let mut why = None;
        let ratio = |place: usize| filter.car.gearbox.gears.get(place).map_or(0.0, |gear| gear.ratio);
        let is_upshift = |&[from, to]: &[usize; 2]| ratio(from) > ratio(to) && ratio(to) > 0.0;
        let (upshifts, others): (Vec<_>, Vec<_>) = filter.shifts().partition(is_upshift);
        for shift in upshifts.into_iter().chain(others) {
            let Some(sensors) = sensors.or(usual.as_ref()) else { break };
            match shift_inputs([&filter.car; 2], &filter.tables, shift, (sensors, 1)) {
                Ok(inputs) => {
                    let inputs = inputs.iter().skip(FIRST).take(STEPS).map(Input::of).collect();
                    return Self::run(shift, inputs, image).map_err(|status| {
                        failed(shift, format!("the observer refuses its image with status {status:#x}"))
                    });
                }
                Err(error) => why = why.or(Some(failed(shift, error.to_string()))),
            }
        }
        Err(why.unwrap_or(ExportError::NoShift(None)))
    }

    fn run(shift: [usize; 2], inputs: Vec<Input>, image: &Image) -> Result<Self, u32> {
        let mut observer = OwnedObserver::new(&image.words)?;
        let mut observer = observer.get()?;
        let estimates = inputs.iter().map(|input| *observer.step(input)).collect();
        Ok(Self { shift, inputs, estimates })
    }

    /// How many steps it has.
    pub(crate) fn steps(&self) -> usize {
        self.inputs.len()
    }

    /// CRC-32 of all words of all estimates.
    fn checksum(&self) -> u32 {
        crc32(self.estimates.iter().flat_map(|estimate| estimate.words().iter().copied()))
    }

    /// Its C source.
    pub(crate) fn c_source(&self, filter: &ExportedFilter) -> String {
        let elements = filter.filter().tables.elements.len();
        let rows: String = self.inputs.iter().fold(String::new(), |mut text, input| {
            let _ = writeln!(text, "  {{{}}},", row(input, elements));
            text
        });
        let expected = self.estimates.iter().fold(String::new(), |mut text, estimate| {
            let _ = writeln!(text, "  {{{}}},", compared(estimate).map(hex_float).join(", "));
            text
        });
        let members: String = COMPARED
            .iter()
            .enumerate()
            .fold(String::new(), |text, (at, name)| text + &format!("    got[{at}] = estimate.{name};\n"));
        include_str!("self_test.c")
            .replace("@CAR@", &filter.name)
            .replace("@CAR_UPPER@", &upper(&filter.name))
            .replace("@SHIFT@", &filter.shift_name(self.shift))
            .replace("@COMPARED@", &COMPARED.len().to_string())
            .replace("@NAMES@", &COMPARED.join(", "))
            .replace("@MEMBERS@", &members)
            .replace("@CHECKSUM@", &format!("0x{:08x}", self.checksum()))
            .replace("@INPUTS@", &rows)
            .replace("@EXPECTED@", &expected)
    }
}

fn compared(estimate: &Estimate) -> [f32; COMPARED.len()] {
    let Estimate { offgoing, oncoming, .. } = estimate;
    [
        offgoing.pressure_pa,
        offgoing.torque_n_m,
        oncoming.pressure_pa,
        oncoming.torque_n_m,
        estimate.turbine_n_m,
        estimate.shaft_n_m,
    ]
}

/// An input as the initialiser of a `wetclutch_input`.
fn row(input: &Input, elements: usize) -> String {
    let Input { engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s, engine_n_m, acceleration_m_s2, .. } = input;
    let speeds = [engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s, engine_n_m, acceleration_m_s2];
    let speeds = speeds.map(reading).join(", ");
    let commands: Vec<String> = input.commands.iter().take(elements.max(1)).map(reading).collect();
    format!(
        "{}, {speeds}, {}, {}u, {}, {}, {{{}}}",
        hex_float(input.dt_s),
        reading(&input.oil_degc),
        input.lock_up_applied,
        input.gear_from,
        input.gear_to,
        commands.join(", ")
    )
}

fn reading(reading: &Reading) -> String {
    if reading.came == 0 {
        return "NONE".to_owned();
    }
    format!("R({}, {})", hex_float(reading.value), hex_float(reading.age_s))
}
