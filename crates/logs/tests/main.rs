//! Files of every format, readings, steps and shifts.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod apps;
mod bus_formats;
mod can;
mod columns;
mod common;
mod csv;
mod formats;
mod hostile;
mod mdf;
mod mdf_conversions;
mod parquet_times;
mod provoked;
mod readings;
mod shifts;
