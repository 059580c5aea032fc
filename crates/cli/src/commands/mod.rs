//! One file for each subcommand.

mod check;
mod demo;
mod design;
mod estimate;
mod simulate;

pub(crate) use check::check;
pub(crate) use demo::demo;
pub(crate) use design::design;
pub(crate) use estimate::estimate;
pub(crate) use simulate::simulate;
