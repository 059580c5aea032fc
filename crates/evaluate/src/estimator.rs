//! The gearbox filter step by step, for a log that is not there yet: on a test bench, in a loop, behind another language.

use car::{Car, ElementId, ErrorBudget, GearId, Sensors, ShiftCommand, Step};
use observer::gearbox::{
    GearboxFilter, GearboxState, GearboxTables, Learnt, MAX_ELEMENTS, ShiftElement, ShiftEstimate, ShiftInput,
};
use observer::{ShiftTables, gearbox_filter};

use crate::EvaluateError;

/// The gearbox filter of a car, with what it knows after the steps so far.
///
/// ```
/// use car::{Car, Reading, ShiftCommand, Step};
/// use evaluate::Estimator;
///
/// # let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/eight_speed.toml"));
/// let car: Car = config::CarFile::read(path)?.car;
/// let mut estimator = Estimator::new(&car, None, None)?;
/// let mut step = Step::none(0.01);
/// step.speeds.turbine = Some(Reading::now(150.0));
/// step.speeds.output = Some(Reading { value: 32.0, age_s: 0.004 });
/// step.shift = estimator.gear("1").map(ShiftCommand::in_gear);
/// let estimate = estimator.step(&step);
/// println!("{}", estimate.health.name());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Estimator {
    tables: ShiftTables<f64>,
    /// With tables of no gearbox; those of this one are put in for each step.
    filter: GearboxFilter<'static, f64>,
    state: GearboxState<f64>,
    gears: Vec<String>,
    elements: Vec<String>,
}

/// Of the memory.
const VERSION: &str = env!("CARGO_PKG_VERSION");

fn is_version(text: &str) -> bool {
    text.len() < 32 && text.starts_with(|c: char| c.is_ascii_digit())
}

fn broken() -> EvaluateError {
    EvaluateError::Memory("is damaged".to_owned())
}

/// Of no gearbox.
const NO_TABLES: GearboxTables<'static, f64> = GearboxTables { elements: &[], gears: &[], shifts: &[] };

impl Estimator {
    /// The filter of a car, for readings of these sensors, with what was learnt of it before.
    ///
    /// # Errors
    /// The gearbox has more clutches than the filter has room for.
    pub fn new(car: &Car, sensors: Option<&Sensors>, learnt: Option<&Learnt<f64>>) -> Result<Self, EvaluateError> {
        let budget = ErrorBudget::of_logged_car(car).read_by(car, sensors);
        let tables = ShiftTables::of_car(car, &budget).map_err(EvaluateError::TooManyElements)?;
        let (filter, state) = {
            let filter = gearbox_filter(car, &tables, &budget, sensors);
            let state = learnt.map_or_else(|| filter.start(), |learnt| filter.start_with(learnt));
            (without_tables(&filter), state)
        };
        let gears = car.gearbox.gears.iter().map(|gear| gear.name.clone()).collect();
        let elements = car.gearbox.elements.iter().map(|element| element.name.clone()).collect();
        Ok(Self { tables, filter, state, gears, elements })
    }

    /// The gear of this name.
    pub fn gear(&self, name: &str) -> Option<GearId> {
        self.gears.iter().position(|gear| gear == name).and_then(GearId::new)
    }

    /// The clutch, brake or one-way clutch of this name.
    pub fn element(&self, name: &str) -> Option<ElementId> {
        self.elements.iter().position(|element| element == name).and_then(ElementId::new)
    }

    /// The name of the element that a [`observer::gearbox::ClutchEstimate`] is of; `None` of a one-way clutch.
    pub fn name_of(&self, element: ShiftElement) -> Option<&str> {
        let place = element.place()?;
        let elements = self.elements.iter().enumerate();
        elements.filter(|(at, _)| self.tables.place(*at) == Some(place)).map(|(_, name)| name.as_str()).next()
    }

    /// Takes a step and returns the estimate for it. Readings of elements that the filter does not have are left out.
    pub fn step(&mut self, step: &Step) -> ShiftEstimate<f64> {
        let input = self.input(step);
        let filter = GearboxFilter { tables: self.tables.tables(), ..self.filter };
        filter.step(&mut self.state, &input)
    }

    /// Guaranteed range of the pressure of an element after the last step, Pa; `None` where there is none.
    pub fn pressure_range_pa(&self, element: ElementId) -> Option<[f64; 2]> {
        let filter = GearboxFilter { tables: self.tables.tables(), ..self.filter };
        filter.pressure_range_pa(&self.state, self.tables.place(element.place())?)
    }

    /// Takes the temperature of the oil in the gearbox, degC.
    pub fn take_oil_temperature(&mut self, degc: f64) {
        self.state.take_oil_temperature(degc);
    }

    /// What was learnt of the car so far.
    pub fn learnt(&self) -> &Learnt<f64> {
        self.state.learnt()
    }

    /// All that it knows after the steps so far, as bytes: with them an estimator of the same car and sensors goes on ([`Self::go_on_from`]).
    ///
    /// # Errors
    /// There is no room for them.
    pub fn memory(&self) -> Result<Vec<u8>, EvaluateError> {
        postcard::to_allocvec(&(VERSION, &self.state))
            .map_err(|error| EvaluateError::Memory(format!("is not made: {error}")))
    }

    /// Refuses a memory of another version.
    ///
    /// # Errors
    /// It is one, or none at all.
    pub fn check_version(memory: &[u8]) -> Result<(), EvaluateError> {
        match postcard::take_from_bytes::<&str>(memory) {
            Ok((VERSION, _)) => Ok(()),
            Ok((version, _)) if is_version(version) => {
                let version = version.escape_debug();
                Err(EvaluateError::Memory(format!("is of version {version}, and this is {VERSION}")))
            }
            _ => Err(broken()),
        }
    }

    /// Goes on as the estimator of the same car and sensors whose [`Self::memory`] this was, to the last bit.
    ///
    /// # Errors
    /// The memory is of another version or of another gearbox, or is none; nothing has changed.
    pub fn go_on_from(&mut self, memory: &[u8]) -> Result<(), EvaluateError> {
        Self::check_version(memory)?;
        let read = postcard::take_from_bytes::<(&str, GearboxState<f64>)>(memory);
        let ((_, state), rest) = read.map_err(|_| broken())?;
        if !rest.is_empty() {
            return Err(broken());
        }
        if !state.fits(&self.tables.tables()) {
            return Err(EvaluateError::Memory("is of another gearbox".to_owned()));
        }
        self.state = state;
        Ok(())
    }

    /// The step as the filter takes it.
    fn input(&self, step: &Step) -> ShiftInput<f64> {
        let mut commands = [None; MAX_ELEMENTS];
        for (element, command) in step.commands.given() {
            if let Some(place) = self.tables.place(element.place()) {
                commands[place] = Some(*command);
            }
        }
        ShiftInput {
            dt_s: step.dt_s,
            engine_rad_s: step.speeds.engine,
            turbine_rad_s: step.speeds.turbine,
            output_rad_s: step.speeds.output,
            wheel_rad_s: step.speeds.wheel,
            engine_n_m: step.engine_torque_n_m,
            acceleration_m_s2: step.acceleration_m_s2,
            lock_up_applied: step.lock_up_applied,
            commands,
            gear: step.shift.unwrap_or(ShiftCommand::NEUTRAL),
        }
    }
}

/// The filter without its gearbox.
fn without_tables(filter: &GearboxFilter<'_, f64>) -> GearboxFilter<'static, f64> {
    filter.cast(NO_TABLES)
}

#[cfg(test)]
mod tests {
    use car::{Gear, Reading};

    use super::*;

    fn six_speed() -> Car {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vehicles/six_speed.toml");
        config::CarFile::read(&path).unwrap().car
    }

    #[test]
    fn a_step_is_what_the_filter_takes_of_it() {
        let car = six_speed();
        let budget = ErrorBudget::of_logged_car(&car);
        let tables = ShiftTables::of_car(&car, &budget).unwrap();
        let filter = gearbox_filter(&car, &tables, &budget, None);
        let mut state = filter.start();
        let mut estimator = Estimator::new(&car, None, None).unwrap();
        let [first, second] = ["1", "2"].map(|name| estimator.gear(name).unwrap());
        let ratio = |gear: GearId| car.gearbox.gears[gear.place()].ratio;
        for at in 0..300_u32 {
            let output = 40.0 + 0.05 * f64::from(at);
            let is_shifting = (150..200).contains(&at);
            let gear = if at < 150 { first } else { second };
            let mut step = Step::none(0.01);
            step.speeds.engine = Some(Reading::now(230.0));
            step.speeds.turbine = Some(Reading { value: output * ratio(gear), age_s: 0.003 });
            step.speeds.output = Some(Reading::now(output));
            step.shift = Some(if is_shifting {
                ShiftCommand { from: Gear::In(first), to: Gear::In(second) }
            } else {
                ShiftCommand::in_gear(gear)
            });
            for element in (0..car.gearbox.elements.len()).filter_map(ElementId::new) {
                step.commands[element] = Some(Reading::now(0.02 * element.place() as f64));
            }
            let input = estimator.input(&step);
            let [from, to] = if is_shifting { [first, second] } else { [gear; 2] }.map(Gear::In);
            assert_eq!(input.gear, ShiftCommand { from, to });
            let expected = filter.step(&mut state, &input);
            assert_eq!(format!("{:?}", estimator.step(&step)), format!("{expected:?}"), "step {at}");
            for element in (0..car.gearbox.elements.len()).filter_map(ElementId::new) {
                let place = tables.place(element.place());
                let range = place.and_then(|place| filter.pressure_range_pa(&state, place));
                assert_eq!(estimator.pressure_range_pa(element), range);
            }
        }
    }

    /// Takes step after step of an upshift: in gear, in the shift, in the next gear.
    fn take_steps(estimator: &mut Estimator, car: &Car, steps: std::ops::Range<u32>) -> Vec<String> {
        let [first, second] = ["1", "2"].map(|name| estimator.gear(name).unwrap());
        let ratio = |gear: GearId| car.gearbox.gears[gear.place()].ratio;
        let taken = steps.map(|at| {
            let output = 40.0 + 0.05 * f64::from(at);
            let after = (f64::from(at) - 150.0).clamp(0.0, 50.0) / 50.0;
            let mut step = Step::none(0.01);
            step.speeds.engine = Some(Reading::now(230.0));
            let turbine = output * (ratio(first) + after * (ratio(second) - ratio(first)));
            step.speeds.turbine = Some(Reading { value: turbine, age_s: 0.003 });
            step.speeds.output = Some(Reading::now(output));
            let gears = if at < 200 { [first, if at < 150 { first } else { second }] } else { [second; 2] };
            step.shift = Some(ShiftCommand { from: Gear::In(gears[0]), to: Gear::In(gears[1]) });
            for element in (0..car.gearbox.elements.len()).filter_map(ElementId::new) {
                step.commands[element] = Some(Reading::now(0.1 + 0.02 * f64::from(at % 7)));
            }
            format!("{:?}", estimator.step(&step))
        });
        taken.collect()
    }

    #[test]
    fn a_memory_goes_on_to_the_last_bit_from_any_step() {
        let car = six_speed();
        for at in [0, 1, 100, 170, 199, 230] {
            let mut estimator = Estimator::new(&car, None, None).unwrap();
            take_steps(&mut estimator, &car, 0..at);
            let memory = estimator.memory().unwrap();
            let mut other = Estimator::new(&car, None, None).unwrap();
            other.go_on_from(&memory).unwrap();
            assert_eq!(other.memory().unwrap(), memory);
            let after = take_steps(&mut estimator, &car, at..300);
            assert_eq!(take_steps(&mut other, &car, at..300), after, "from step {at}");
            assert_eq!(other.memory().unwrap(), estimator.memory().unwrap());
        }
    }

    #[test]
    fn a_memory_of_another_version_or_gearbox_is_refused() {
        let car = six_speed();
        let mut estimator = Estimator::new(&car, None, None).unwrap();
        take_steps(&mut estimator, &car, 0..170);
        let memory = estimator.memory().unwrap();
        let refused = |memory: &[u8]| {
            let mut other = Estimator::new(&car, None, None).unwrap();
            let before = other.memory().unwrap();
            let error = other.go_on_from(memory).unwrap_err().to_string();
            assert_eq!(other.memory().unwrap(), before);
            error
        };
        let mut old = memory.clone();
        old[1] = b'9';
        assert!(refused(&old).contains("is of version 9.1.0, and this is 0.1.0\nhint: "), "{}", refused(&old));
        for bytes in [&memory[..memory.len() - 1], &[memory.as_slice(), &[0]].concat(), b"", b"\xff\xff", &[7; 50_000]]
        {
            assert!(refused(bytes).contains("damaged"));
        }
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vehicles/dual_clutch.toml");
        let mut other = Estimator::new(&config::CarFile::read(&path).unwrap().car, None, None).unwrap();
        assert!(other.go_on_from(&memory).unwrap_err().to_string().contains("another gearbox"));
    }

    #[test]
    fn a_memory_with_wrong_bytes_is_refused_or_steps_without_a_panic() {
        let car = six_speed();
        let mut estimator = Estimator::new(&car, None, None).unwrap();
        take_steps(&mut estimator, &car, 0..170);
        let memory = estimator.memory().unwrap();
        let mut taken = 0;
        for at in (0..memory.len()).step_by(97) {
            for byte in [0, 1, 127, 255] {
                let mut wrong = memory.clone();
                wrong[at] = byte;
                let mut other = Estimator::new(&car, None, None).unwrap();
                if other.go_on_from(&wrong).is_ok() {
                    taken += 1;
                    take_steps(&mut other, &car, 170..175);
                }
            }
        }
        assert!(taken > 100);
    }

    #[test]
    fn steps_without_anything_and_with_what_is_no_number_have_an_estimate() {
        let car = six_speed();
        let mut estimator = Estimator::new(&car, None, None).unwrap();
        for value in [f64::NAN, f64::INFINITY, -1e300, 0.0] {
            for dt_s in [0.01, 0.0, -1.0, f64::NAN, 1e9] {
                let mut step = Step::none(dt_s);
                estimator.step(&step);
                step.speeds.turbine = Some(Reading { value, age_s: value });
                step.speeds.output = Some(Reading { value, age_s: dt_s });
                step.shift = estimator.gear("2").map(ShiftCommand::in_gear);
                step.commands[ElementId::new(15).unwrap()] = Some(Reading::now(value));
                estimator.step(&step);
            }
        }
        assert_eq!(estimator.gear("9"), None);
        assert_eq!(estimator.name_of(ShiftElement::OneWay), None);
    }
}
