//! The BLAS and LAPACK routines that the conic solver calls, over `nalgebra`.
//!
//! The solver's cone of positive semidefinite matrices links to 22 Fortran symbols. A system LAPACK would
//! need a Fortran compiler or a download; this crate exports just those symbols and leaves the
//! mathematics to `nalgebra`. Matrices here are small, so each call copies its operands.
//!
//! Link it by naming it: `use lapack_nalgebra as _;`.
//!
//! What differs from LAPACK: `gesv` returns the solution and leaves the matrix and the pivots as they
//! were; workspace queries answer 1. The solver reads neither.

mod dense;
mod routines;

pub use routines::*;
