//! How an observer is carried over a sample.

/// How the frozen dynamics are carried over a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Discretisation {
    /// By the matrix exponential: exact for coefficients that stand still over the sample.
    Exact,
    /// By forward Euler, as the chapter did.
    Euler,
}
