//! Studies: thousands of shifts with varied parameters, one row each.
//!
//! A run follows from the study and its number alone. That is why runs can be made on any number of threads or
//! machines, broken off and taken up again, and still give the same rows.

pub mod execute;
pub mod layout;
pub mod plan;
pub mod row;
pub mod summary;

pub use execute::{execute, in_order};
pub use layout::{Layout, Metric, PHASES};
pub use plan::{factor_values, run_seed};
pub use row::{Campaign, Row, Run, Status};
pub use summary::{Distribution, FactorEffect, Summary};
