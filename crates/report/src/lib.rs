//! Figures and the HTML reports.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod adaptation_page;
mod axis;
pub mod car_sensitivity_page;
mod drawing;
pub mod drive_page;
pub mod figure;
pub mod fit_page;
pub mod gearbox_figure;
mod interactive;
mod legend;
mod live_page;
pub mod log_page;
pub mod map_figures;
pub mod matrix_page;
mod motion;
pub mod page;
pub mod palette;
mod panels;
pub mod reproduction;
pub mod sensitivity_page;
pub mod sheet;
pub mod shift_figure;
mod shown_figure;
mod simplified;
pub mod speeds_page;
pub mod study_page;
pub mod tables;
mod words;

pub use live_page::live_page;
pub use log_page::LogPage;
pub use page::{Page, PageError};
pub use reproduction::Reproduction;
pub use sensitivity_page::sensitivity_page;
pub use speeds_page::SpeedsPage;
pub use study_page::StudyPage;
