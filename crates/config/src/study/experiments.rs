//! The factors of a study in its experiment, and in others.

use super::{Factor, Study, Target, changed};
use crate::tree::Tree;
use crate::{ConfigError, ExperimentFile, Source, VehicleFile};

impl Study {
    /// The study of the settings in which the source chapter's statements are tested, as it ships with the program.
    ///
    /// # Errors
    /// None in a released program; the tests read this file.
    pub fn plausible() -> Result<Self, ConfigError> {
        let text = include_str!("../../../../experiments/plausible.toml");
        let [.., e4] = ExperimentFile::built_in()?;
        Self::of(Source::built_in("experiments/plausible.toml", text), e4, VehicleFile::built_in()?)
    }

    /// Another experiment with these values of the study's factors. A factor of a table that this experiment does not
    /// have, as that of sensors, changes nothing in it.
    ///
    /// # Errors
    /// As [`Self::varied`].
    pub fn varied_experiment(&self, other: &ExperimentFile, values: &[f64]) -> Result<ExperimentFile, ConfigError> {
        let tree = experiment_tree(other)?;
        let changes = (self.factors.iter().zip(values.iter().copied()))
            .filter(|(factor, _)| factor.target == Target::Experiment && tree.has(&factor.path[0]));
        changed_experiment(other, &tree, changes)
    }
}

/// The values of an experiment file that the runs of a study change. Every run checks them again; tables that no run needs
/// would only take time.
pub(super) fn experiment_tree(experiment: &ExperimentFile) -> Result<Tree, ConfigError> {
    let mut tree = Tree::of(&experiment.source)?;
    for unused in ["scenario", "observer"] {
        tree.remove(unused);
    }
    Ok(tree)
}

/// The experiment with changed values, and with the observers and what they are told of the sensors as before.
pub(super) fn changed_experiment<'a>(
    experiment: &ExperimentFile,
    tree: &Tree,
    changes: impl Iterator<Item = (&'a Factor, f64)>,
) -> Result<ExperimentFile, ConfigError> {
    let mut changes = changes.peekable();
    if changes.peek().is_none() {
        return Ok(experiment.clone());
    }
    let source = &experiment.source;
    let mut changed = ExperimentFile::from_tree(source, &changed(source, tree, changes)?)?;
    changed.observers = experiment.observers.clone();
    changed.sensors_given = experiment.sensors_given;
    Ok(changed)
}
