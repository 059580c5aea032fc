//! From a source of samples through observers to scores.
//!
//! A simulated drive and a measured log are two sources of the same [`trace::Trace`]; [`run()`] carries an
//! observer over either, and [`score()`] holds the estimates against the truth where there is one.

pub mod bench;
pub mod campaign;
pub mod comparison;
pub mod drive;
pub mod error_bound;
pub mod observers;
pub mod run;
pub mod sampling;
pub mod score;
pub mod sensitivity;
pub mod statements;
pub mod worst_case;

pub use bench::{Bench, bench};
pub use campaign::{Campaign, Row, Status, Summary, execute};
pub use comparison::{Comparison, ObserverRun, StudyError, compare};
pub use drive::{simulate_drive, simulate_shift, true_phases};
pub use error_bound::{ErrorBound, error_bound};
pub use observers::AnyObserver;
pub use run::{RunColumns, estimates_trace, run};
pub use score::{PhaseScore, RangeScore, ShiftQuality, score};
pub use sensitivity::{PhaseSensitivity, sensitivity};
pub use statements::{Chapter, Statement, Verdict, reproduce};
pub use worst_case::{Target, WorstCase, worst_case};
