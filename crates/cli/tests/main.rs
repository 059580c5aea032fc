//! The command as a user meets it: what it writes, prints, and exits with.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod acceleration;
mod adaptation_table;
mod any_car;
mod any_car_checks;
mod any_car_logs;
mod arrows;
mod attacks;
mod car_check;
mod commands;
mod compare;
mod convert;
mod day_of_logs;
mod design_car;
mod documented;
mod drives;
mod equations;
mod excerpts;
mod export;
mod failing_channels;
mod first_words;
mod fit;
mod fit_gearbox;
mod from_log;
mod garage;
mod gear_ratios;
mod hostile_files;
mod json;
mod late_commands;
mod late_speeds;
mod layshaft;
mod learnt;
mod links;
#[cfg(unix)]
mod log_to_fit;
mod logs;
mod long_logs;
mod measured;
mod measured_pressures;
#[cfg(unix)]
mod open_page;
mod other_cars;
mod own_car;
mod pages;
mod piped_bus;
mod pressure_commands;
mod provoked;
mod replaced;
mod results;
mod same_bits;
mod studies;
mod support;
mod tables;
mod units;
mod unstated_sensors;
mod watch;
mod whole_drives;
mod write_map;
mod wrong_maps;
