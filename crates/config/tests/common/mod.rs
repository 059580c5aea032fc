//! Mutations of the files that ship, one at a time.

#![allow(dead_code, reason = "each test takes what it needs")]

/// The vehicle, with what its file leaves out of the error budget.
pub(crate) const VEHICLE: &str = concat!(
    include_str!("../../../../vehicles/two_speed_at.toml"),
    r#"
[design.error_bounds.fill]
volume_factor = [0.9, 1.2]
preload_pressure_pa = [42e3, 48e3]
kiss_pressure_pa = [57e3, 63e3]
resistance_factor = [0.9, 1.1]
oil_temperature_degc = [70, 95]
flow_max_m3_s = 1.5e-4
leak_m3_s_pa = 3e-12
capacity_m3_pa = 5e-12
"#
);
/// An experiment that has everything: sensors, observers with gains of each kind, scenarios.
pub(crate) const EXPERIMENT: &str = concat!(
    include_str!("../../../../experiments/bench.toml"),
    r#"
[[observer]]
name = "given, rigid"
kind = "rigid"
discretisation = "euler"
gains = { torque_phase_pa_s_rad = -1.8e4, inertia_phase_pa_s_rad = [-320, -540] }

[[observer]]
name = "given, sliding"
kind = "sliding"
gains = { torque_speed_rad_s2 = 80, torque_pressure_pa_s = -1.5e6, inertia_speed_rad_s2 = [1000, 1600], inertia_pressure_pa_s = [-8e5, -1.2e6] }

[[observer]]
name = "given, compliant"
kind = "compliant"
sample_time_s = 0.001
gains = { torque_phase_normalised = [[-2.08, 30.49], [-6.46, -152.48]], inertia_phase_normalised = [[-0.023, 0.22, 56.9], [-1.74, -0.23, 1.73]] }

[[scenario]]
name = "errors of the sensors"
row_time_s = 0.002
[scenario.sensors]
row_offset_s = 0.009
missing_share = 0.03
outliers = 2
[scenario.sensors.wheel]
scale = 1.02
delay_s = 0.03
sample_time_s = 0.02
offset_s = 0.004
missing_share = 0.05
burst_s = 0.05
frozen_s = 0.06
outliers = 1
outlier_rad_s = 4
[scenario.sensors.current]
scale = 0.99
delay_s = 0.01
sample_time_s = 0.02
offset_s = 0.003
outliers = 1
outlier_a = 0.2

[[scenario]]
name = "everything that the observers do not know"
[scenario.off_nominal]
valve_hysteresis_pa = 0.01e6
piston_stroke = true
fill_volume_factor = 1.25
starved_flow_factor = 0.6
clutch_drag_n_m = 8
oil_temperature_degc = 5
shaft_stiffness_factor = 0.8
backlash_rad = 0.03
tip_out_s = [6.6, 7.1]
"#
);
/// The vehicle whose pistons have a stroke.
pub(crate) const STROKE: &str = include_str!("../../../../vehicles/two_speed_stroke.toml");
/// The experiment that fills its clutch.
pub(crate) const FILL: &str = include_str!("../../../../experiments/fill.toml");
/// A study with a factor of every kind.
pub(crate) const STUDY: &str = concat!(
    "name = \"s\"\ntitle = \"S\"\nexperiment = '",
    env!("CARGO_MANIFEST_DIR"),
    r#"/../../experiments/bench.toml'
plan = "latin-hypercube"
runs = 40
seed = 3
observers = ["Kalman", "open loop"]
[[factor]]
key = "car.vehicle.mass_kg"
range = [1300, 2000]
levels = 4
[[factor]]
key = "experiment.off_nominal.friction_factor"
normal = { mean = 1.0, deviation = 0.1 }
[[factor]]
key = "car.clutch.b.valve.gain.gain_pa_a"
change = "scale"
values = [0.9, 1.0, 1.1]
[[factor]]
key = "experiment.sensors.turbine.noise_rad_s"
name = "noise"
log_range = [0.03, 0.3]
[[factor]]
key = "experiment.sensors.wheel.scale"
range = [0.98, 1.02]
chance = 0.5
otherwise = 1.0
"#
);

/// What stands in place of a number.
const NUMBERS: [&str; 7] = ["0", "-1", "1e308", "nan", "inf", "1e-308", "0.5"];

/// The text with one thing changed, and what that is: each number another, each line dropped, each list empty, of one
/// element and of two that fall, each string empty.
pub(crate) fn mutations(text: &str) -> Vec<(String, String)> {
    let mut all = Vec::new();
    let mut start = 0;
    for (number, line) in text.lines().enumerate() {
        let mut replace = |what: &str, range: std::ops::Range<usize>, by: &str| {
            let changed = [&text[..start + range.start], by, &text[start + range.end..]].concat();
            all.push((format!("line {}: {what} {by}", number + 1), changed));
        };
        let code = line.split(" #").next().unwrap_or(line);
        let code = if code.starts_with('#') { "" } else { code };
        if !code.trim().is_empty() {
            replace("dropped", 0..line.len(), "");
        }
        let values = code.find('=').map_or(0, |at| at + 1);
        for range in numbers(code, values) {
            for by in NUMBERS {
                replace("number", range.clone(), by);
            }
        }
        for (open, _) in code.match_indices('[').filter(|(at, _)| *at >= values && !code.trim_start().starts_with('['))
        {
            if let Some(close) = code[open..].find(']') {
                for by in ["[]", "[0.5]", "[1.0, 0.5]", "[\"x\"]"] {
                    replace("list", open..open + close + 1, by);
                }
            }
        }
        let quotes: Vec<usize> = code.match_indices('"').map(|(at, _)| at).collect();
        for pair in quotes.chunks_exact(2) {
            replace("string", pair[0] + 1..pair[1], "");
            replace("string", pair[0] + 1..pair[1], "\\u0000");
            replace("string", pair[0]..pair[1] + 1, "7");
        }
        start += line.len() + 1;
    }
    all
}

/// Places of the numbers in a line, from a place on and outside of strings.
fn numbers(code: &str, from: usize) -> Vec<std::ops::Range<usize>> {
    let mut found = Vec::new();
    let (mut at, mut quoted, mut word) = (from, false, false);
    while at < code.len() {
        let letter = code.as_bytes()[at];
        quoted ^= letter == b'"';
        let begins =
            letter.is_ascii_digit() || (letter == b'-' && code[at + 1..].starts_with(|c: char| c.is_ascii_digit()));
        if begins && !quoted && !word {
            let length = code[at..].find([',', ' ', ']', '}']).unwrap_or(code.len() - at);
            found.push(at..at + length);
            at += length;
        } else {
            word = letter.is_ascii_alphanumeric() || letter == b'_';
            at += 1;
        }
    }
    found
}
