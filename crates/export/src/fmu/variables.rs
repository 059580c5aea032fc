//! The variables of the observer: inputs, then estimates.

use drivetrain::CommandKind;
use ecu::Input;

use crate::ExportedFilter;
use crate::estimate_members::{Kind, Member, members};
use crate::input_members::input_members;

/// First reference of the words of the input, and of the estimate, as the shared library has them.
const INPUTS: usize = 1000;
const ESTIMATES: usize = 2000;

/// A variable of a model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Variable {
    pub(crate) name: String,
    pub(crate) reference: usize,
    /// Of an input its start value; an output has none.
    pub(crate) start: Option<f64>,
    pub(crate) is_real: bool,
    pub(crate) unit: &'static str,
    pub(crate) meaning: String,
}

/// All variables of the observer. Of elements that the car does not have there are none.
pub(crate) fn variables(filter: &ExportedFilter) -> Vec<Variable> {
    let elements = filter.elements();
    let kinds = filter.command_kinds();
    let start = Input::usual();
    let of_input = |member: Member| {
        let word = start.words()[member.offset / 4];
        let is_real = member.kind == Kind::Float;
        let start = if is_real { f64::from(f32::from_bits(word)) } else { f64::from(word.cast_signed()) };
        let unit = match kinds.get(member.command().unwrap_or(usize::MAX)) {
            Some(CommandKind::Current) => "A",
            Some(CommandKind::DutyCycle) => "%",
            None => member.unit,
        };
        Variable {
            reference: INPUTS + member.offset / 4,
            start: Some(start),
            is_real,
            unit,
            meaning: member.meaning_with(&elements),
            name: member.name,
        }
    };
    let of_estimate = |member: Member| Variable {
        reference: ESTIMATES + member.offset / 4,
        start: None,
        is_real: member.kind == Kind::Float,
        unit: member.unit,
        meaning: member.meaning_with(&elements),
        name: format!("estimate.{}", member.name),
    };
    let is_there = |member: &Member| member.element().is_none_or(|at| at < elements.len());
    let inputs = input_members().into_iter().filter(is_there).map(of_input);
    inputs.chain(members().into_iter().filter(is_there).map(of_estimate)).collect()
}

impl Member {
    /// The place in an array of this name.
    fn place_in(&self, array: &str) -> Option<usize> {
        self.name.strip_prefix(array)?.split('.').next()?.parse().ok()
    }

    /// The element of a command as it is read.
    fn command(&self) -> Option<usize> {
        self.place_in("command_").filter(|_| self.name.ends_with(".value"))
    }

    /// The element that it is of, if it is of one.
    fn element(&self) -> Option<usize> {
        let of_pair = self.place_in("element_range_pa_").map(|at| at / 2);
        let arrays = ["element_pa_", "commands_", "command_"];
        of_pair.or_else(|| arrays.into_iter().find_map(|array| self.place_in(array)))
    }

    /// Its meaning with the name of its element.
    fn meaning_with(&self, elements: &[&str]) -> String {
        let element = self.element().and_then(|at| elements.get(at));
        element.map_or_else(|| self.meaning.to_owned(), |element| format!("{}: {element}", self.meaning))
    }
}

#[cfg(test)]
mod tests {
    use ecu::{ESTIMATE_WORDS, Estimate, INPUT_WORDS};

    use super::*;

    #[test]
    fn a_variable_is_a_real_number_where_its_word_is_one() {
        let kinds = |members: Vec<Member>| -> Vec<(usize, bool)> {
            members.iter().map(|member| (member.offset / 4, member.kind == Kind::Float)).collect()
        };
        let inputs: Vec<_> = (1..INPUT_WORDS).map(|at| (at, Input::is_real(at))).collect();
        assert_eq!(kinds(input_members()), inputs);
        let estimates: Vec<_> = (0..ESTIMATE_WORDS).map(|at| (at, Estimate::is_real(at))).collect();
        assert_eq!(kinds(members()), estimates);
    }
}
