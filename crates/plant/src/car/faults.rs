//! Faults of the gearbox on a drive: what becomes of commands and pressures, and how the car changes, once something is broken.
//!
//! The controller does not know of them: it commands as in the nominal car, and its commands are those that a log has.

use car::{Car, Fault, FaultKind, GLAZED_RAD_S};
use drivetrain::Table1;

use super::integrate::CarError;
use super::model::{CarModel, MAX_PACKS};
use crate::gear_train::MAX_ELEMENTS;

/// What lies between the controller and the plates, with the places of the elements.
#[derive(Debug, Clone, PartialEq)]
enum Broken {
    /// The valve of an element, and the command, A or %, once it has stuck.
    Stuck(usize, Option<f64>),
    Swapped([usize; 2]),
    /// The piston of an element, and the fraction of the pressure that is left.
    Leaks(usize, f64),
    /// The highest pressure, Pa.
    Line(f64),
}

/// The faults between the controller and the plates, each with the time from which on it is there, s.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Faults {
    broken: Vec<(f64, Broken)>,
}

impl Faults {
    /// Those of a drive of this car.
    ///
    /// # Errors
    /// The gearbox has no clutch or brake of such a name.
    pub(super) fn of(car: &Car, faults: &[Fault]) -> Result<Self, CarError> {
        let mut broken = Vec::new();
        for Fault { kind, from_s } in faults {
            let kind = match kind {
                FaultKind::StuckSolenoid { element, command } => Broken::Stuck(place(car, element)?, *command),
                FaultKind::SwappedSolenoids([one, other]) => Broken::Swapped([place(car, one)?, place(car, other)?]),
                FaultKind::LeakingPiston { element, pressure_fraction } => {
                    Broken::Leaks(place(car, element)?, *pressure_fraction)
                }
                FaultKind::LinePressure { pressure_pa } => Broken::Line(*pressure_pa),
                FaultKind::Friction { .. }
                | FaultKind::Aeration { .. }
                | FaultKind::GlazedPlates { .. }
                | FaultKind::SpeedSensor { .. } => continue,
            };
            broken.push((*from_s, kind));
        }
        Ok(Self { broken })
    }

    /// The commands that reach the valves of those that were sent, A or %.
    pub(super) fn arriving(&mut self, now_s: f64, sent: &[f64; MAX_ELEMENTS]) -> [f64; MAX_ELEMENTS] {
        let mut commands = *sent;
        for (_, broken) in self.broken.iter_mut().filter(|(from_s, _)| now_s >= *from_s) {
            match broken {
                Broken::Stuck(element, command) => commands[*element] = *command.get_or_insert(sent[*element]),
                Broken::Swapped([one, other]) => commands.swap(*one, *other),
                Broken::Leaks(..) | Broken::Line(_) => (),
            }
        }
        commands
    }

    /// The pressures at which the plates settle, Pa, of those of sound valves.
    pub(super) fn settled_pa(
        &self,
        model: &CarModel,
        now_s: f64,
        mut settled_pa: [f64; MAX_PACKS],
    ) -> [f64; MAX_PACKS] {
        for (_, broken) in self.broken.iter().filter(|(from_s, _)| now_s >= *from_s) {
            match broken {
                Broken::Leaks(element, fraction) => {
                    if let Some((slot, _)) = model.friction(*element) {
                        settled_pa[slot] *= fraction;
                    }
                }
                Broken::Line(highest_pa) => settled_pa.iter_mut().for_each(|pa| *pa = pa.min(*highest_pa)),
                Broken::Stuck(..) | Broken::Swapped(_) => (),
            }
        }
        settled_pa
    }
}

/// The car as it is from each time on, s, at which plates or valves change, in the order of these times.
///
/// # Errors
/// The gearbox has no clutch or brake of such a name.
pub(super) fn changed(model: &CarModel, faults: &[Fault]) -> Result<Vec<(f64, CarModel)>, CarError> {
    let changes = |fault: &&Fault| {
        matches!(fault.kind, FaultKind::Friction { .. } | FaultKind::Aeration { .. } | FaultKind::GlazedPlates { .. })
    };
    let mut ordered: Vec<&Fault> = faults.iter().filter(changes).collect();
    ordered.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    let mut car = model.car.clone();
    let mut models = Vec::new();
    for Fault { kind, from_s } in ordered {
        match kind {
            FaultKind::Friction { element: Some(element), factor } => {
                let element = place(&car, element)?;
                if let Some(clutch) = &mut car.clutches[element] {
                    clutch.clutch.friction = clutch.clutch.friction.scaled(*factor);
                    clutch.clutch.static_friction *= factor;
                }
            }
            FaultKind::Friction { element: None, factor } => car = car.with_friction(*factor),
            FaultKind::GlazedPlates { element, friction_factor } => {
                let element = place(&car, element)?;
                if let Some(clutch) = &mut car.clutches[element] {
                    clutch.clutch.friction = glazed(&clutch.clutch.friction, *friction_factor)?;
                }
            }
            FaultKind::Aeration { lag_factor } => {
                for clutch in car.clutches.iter_mut().flatten() {
                    clutch.valve = clutch.valve.changed(*lag_factor, 1.0, None);
                }
            }
            _ => (),
        }
        models.push((*from_s, CarModel::new(car.clone())?));
    }
    Ok(models)
}

/// Friction over slip that falls to a part of what it was, along a line up to [`GLAZED_RAD_S`].
fn glazed(friction: &Table1<f64>, factor: f64) -> Result<Table1<f64>, CarError> {
    /// Slips at which the new table has points, rad/s.
    const SLIPS_RAD_S: [f64; 16] =
        [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 50.0, 75.0, 100.0, 150.0, 250.0, 450.0, 700.0];
    let part = |slip: f64| 1.0 + (factor - 1.0) * (slip / GLAZED_RAD_S).min(1.0);
    let values = SLIPS_RAD_S.map(|slip| part(slip) * friction.at(slip));
    Table1::new(&SLIPS_RAD_S, &values).map_err(|error| CarError::Request(error.to_string()))
}

/// The place of a clutch or brake.
fn place(car: &Car, name: &str) -> Result<usize, CarError> {
    let has_plates = |at: &usize| car.clutches.get(*at).is_some_and(Option::is_some);
    let elements = || car.gearbox.elements.iter().enumerate().filter(|(at, _)| has_plates(at));
    let found = elements().find(|(_, element)| element.name == name).map(|(at, _)| at);
    found.ok_or_else(|| {
        let names: Vec<&str> = elements().map(|(_, element)| element.name.as_str()).collect();
        let names = names.join(", ");
        CarError::Request(format!(
            "a [[fault]] names \"{name}\", which is no clutch or brake of the gearbox\nhint: it has {names}"
        ))
    })
}
