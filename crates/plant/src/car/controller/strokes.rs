//! Where the pistons are, as the controller models them: what a fill needs depends on what is left of the one before.

use car::Car;

use crate::fast_fill::StrokeModel;
use crate::gear_train::MAX_ELEMENTS;

/// A model for each clutch whose piston has a stroke.
#[derive(Debug, Clone)]
pub(super) struct Strokes {
    models: Vec<Option<StrokeModel>>,
}

impl Strokes {
    /// In this gear, with everything at rest.
    pub(super) fn new(car: &Car, gear: usize) -> Self {
        let holds = |element: usize| car.gearbox.gears[gear].holding.iter().any(|holding| holding.element == element);
        let model = |(element, clutch): (usize, &Option<car::ShiftClutch>)| {
            let clutch = clutch.as_ref().filter(|clutch| clutch.has_stroke)?;
            Some(StrokeModel::new(clutch, if holds(element) { car.line_pressure_pa } else { 0.0 }))
        };
        Self { models: car.clutches.iter().enumerate().map(model).collect() }
    }

    /// What is known of the piston of an element; `None` without a stroke.
    pub(super) fn of(&self, element: usize) -> Option<&StrokeModel> {
        self.models.get(element)?.as_ref()
    }

    /// Takes the commands of the elements, A or %, of a period.
    pub(super) fn follow(&mut self, car: &Car, commands: &[f64; MAX_ELEMENTS], period_s: f64) {
        for ((model, clutch), command) in self.models.iter_mut().zip(&car.clutches).zip(commands) {
            if let (Some(model), Some(clutch)) = (model, clutch) {
                model.send(clutch, *command);
                model.advance(clutch, period_s);
            }
        }
    }
}
