//! The gearbox filter over a drive: three minutes in town with the eight-speed car, which twenty times are an hour with
//! more than 200 shifts.

use std::hint::black_box;

use car::ErrorBudget;
use car::{Car, Drive, Sensors};
use config::{CarFile, DriveFile, ExperimentFile};
use observer::gearbox::{FrictionElement, GearboxFilter, GearboxTables, ShiftInput};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarShift, simulate_car_drive};
use study::gearbox::recording::Recording;
use study::gearbox::{RECORD_S, ShiftDraw, inputs, simulated};

use crate::shared::root;

/// Steps of one shift, a third of them in the shift, and of the drive.
pub(crate) const SHIFT_STEPS: u64 = 300;
pub(crate) const DRIVE_STEPS: u64 = 18_000;

/// A car with what its filter is made from.
struct Known {
    car: Car,
    tables: ShiftTables<f64>,
    sensors: Sensors,
}

impl Known {
    fn eight_speed() -> &'static Self {
        let car = CarFile::eight_speed().unwrap().car;
        let tables = ShiftTables::of_car(&car, &ErrorBudget::of_car(&car)).unwrap();
        Box::leak(Box::new(Self { car, tables, sensors: ExperimentFile::bench().unwrap().experiment.sensors.unwrap() }))
    }

    fn filter(&self) -> GearboxFilter<'_, f64> {
        gearbox_filter(&self.car, &self.tables, &ErrorBudget::of_car(&self.car), Some(&self.sensors))
    }

    fn truth(&self) -> Car {
        ShiftDraw::none(&self.car).car(&self.car)
    }

    fn drive(&self) -> Vec<ShiftInput<f64>> {
        let drive = DriveFile::read(&root().join("drives/city.toml")).unwrap().drive;
        let once = Drive { sample_time_s: RECORD_S, repetitions: 1, ..drive };
        let (model, mut recording) = (CarModel::new(self.truth()).unwrap(), Recording::default());
        simulate_car_drive(&model, &self.car, CarCalibration::STANDARD, &once, |sample| recording.push(sample))
            .unwrap();
        recording.inputs(&self.car, &self.tables, &self.sensors, 1).collect()
    }
}

/// The filter over its inputs, of which there are so many.
fn steps(filter: GearboxFilter<'static, f64>, mut inputs: Vec<ShiftInput<f64>>, count: u64) -> Box<dyn FnMut()> {
    inputs.truncate(usize::try_from(count).unwrap());
    assert_eq!(inputs.len() as u64, count);
    let mut state = filter.start();
    Box::new(move || {
        for input in &inputs {
            black_box(filter.step(&mut state, black_box(input)));
        }
    })
}

/// One shift, from the start of the filter.
pub(crate) fn shift() -> Box<dyn FnMut()> {
    let known = Known::eight_speed();
    let gear = |name: &str| known.car.gearbox.gear(name).unwrap();
    let shift = CarShift::usual(&known.car, gear("1"), gear("2"), 0.3);
    let samples = simulated(&known.car, &known.truth(), &shift).unwrap();
    let inputs = inputs(&known.car, &known.tables, &samples, &known.sensors, 1);
    steps(known.filter(), inputs.into_iter().map(|(_, input)| input).collect(), SHIFT_STEPS)
}

/// The drive.
pub(crate) fn drive() -> Box<dyn FnMut()> {
    let known = Known::eight_speed();
    steps(known.filter(), known.drive(), DRIVE_STEPS)
}

/// The same without speeds and ranges: the valve models alone, which are the open loop.
pub(crate) fn open_loop() -> Box<dyn FnMut()> {
    let known = Known::eight_speed();
    let tables = known.tables.tables();
    let elements: Vec<_> = tables.elements.iter().map(|element| FrictionElement { budget: None, ..*element }).collect();
    let mut inputs = known.drive();
    for input in &mut inputs {
        (input.engine_rad_s, input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s) = (None, None, None, None);
    }
    let filter = known.filter();
    steps(
        GearboxFilter { tables: GearboxTables { elements: elements.leak(), ..tables }, ..filter },
        inputs,
        DRIVE_STEPS,
    )
}
