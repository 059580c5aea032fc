//! Figures and the HTML report of a comparison.

pub mod figure;
pub mod page;
pub mod shift_figure;

pub use page::{Page, PageError};
