//! What lies between the commands and the pressures at which the valves settle: the delay of each command, then the
//! hysteresis of its valve.

use drivetrain::valve::Play;

use super::model::{CarModel, MAX_PACKS, Part};
use crate::delay::DelayLine;
use crate::gear_train::MAX_ELEMENTS;

/// The valves of the friction elements.
#[derive(Debug, Clone)]
pub struct CarValves {
    inputs: Vec<(DelayLine, Play<f64>)>,
}

impl CarValves {
    /// Valves on which these commands of the elements, A or %, have stood for ever.
    pub fn new(model: &CarModel, commands: &[f64; MAX_ELEMENTS]) -> Self {
        let inputs = model.parts.iter().enumerate().filter_map(|(element, part)| match part {
            Part::Friction(_, clutch) => {
                let command = commands[element];
                let settled = clutch.valve.settled_pressure(command);
                Some((DelayLine::new(command), Play::new(clutch.hysteresis_pa, settled)))
            }
            _ => None,
        });
        Self { inputs: inputs.collect() }
    }

    /// Sends the commands of the elements, A or %.
    pub fn send(&mut self, model: &CarModel, now_s: f64, commands: &[f64; MAX_ELEMENTS]) {
        for (element, part) in model.parts.iter().enumerate() {
            if let Part::Friction(slot, clutch) = part
                && let Some((line, _)) = self.inputs.get_mut(*slot)
            {
                line.send(now_s, clutch.valve.delay(commands[element]), commands[element]);
            }
        }
    }

    /// Pressures at which the commands that have arrived by now settle, Pa.
    pub fn settled_pa(&mut self, model: &CarModel, now_s: f64) -> [f64; MAX_PACKS] {
        let mut settled = [0.0; MAX_PACKS];
        for part in &model.parts {
            if let Part::Friction(slot, clutch) = part
                && let Some((line, play)) = self.inputs.get_mut(*slot)
            {
                settled[*slot] = play.follow(clutch.valve.settled_pressure(line.arrive(now_s)));
            }
        }
        settled
    }

    /// Time of the next arrival of a command, s.
    pub fn next_arrival_s(&self) -> Option<f64> {
        self.inputs.iter().filter_map(|(line, _)| line.next_arrival_s()).min_by(f64::total_cmp)
    }
}
