//! Studies: thousands of shifts with varied parameters, one row each.
//!
//! The study and the number of a run determine the run. Therefore runs can be made on any number of threads or machines,
//! stopped and resumed, and give the same rows.

pub mod execute;
pub mod layout;
pub mod plan;
pub mod row;
pub mod scored;
pub mod summary;

pub use execute::{BLOCK, execute, in_blocks, in_order};
pub use layout::{Layout, Metric, PHASES};
pub use plan::{factor_values, run_seed};
pub use row::{Campaign, Row, Run, Status};
pub use scored::{ScoredShift, scored_shift};
pub use summary::{COMPARED, Distribution, FactorEffect, Relative, Summary};
