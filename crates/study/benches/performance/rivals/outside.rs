//! Rivals that are other programs: CVODE in C, LSODA in Python. Who has not got them reads so on the page.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use drivetrain::{AccelerationRow, ClutchValve, Engagement};
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::state::STATES;
use plant::{Mode, Powertrain, State};

use super::plot::Curve;
use super::{INPUTS, Problem, SPAN_S, START, TOLERANCES, error};

/// The problems as other programs get them.
pub(super) struct Outside {
    /// One field in a line: its name and its numbers.
    pub(super) parameters: String,
    /// Derivative at the start, which their equations must have too.
    slope: [f64; STATES],
}

/// A method of CVODE: of each problem its times, s, and end states, at falling tolerances.
pub(super) struct Rival {
    name: &'static str,
    runs: [Vec<(f64, [f64; STATES])>; 2],
}

impl Rival {
    /// Its errors and times in a problem.
    pub(super) fn curve(&self, problem: usize, reference: &[f64; STATES]) -> Curve {
        let points = self.runs[problem].iter().map(|(seconds, end)| (error(end, reference), *seconds));
        Curve { name: self.name, points: points.filter(|(error, _)| *error < 1.0).collect() }
    }
}

impl Outside {
    /// `shift` are the parameters of the shift.
    pub(super) fn new(powertrain: &Powertrain, mode: Mode, problems: &[Problem; 2], shift: &str) -> Self {
        let slope = powertrain.derivative(mode, &START.to_array(), &INPUTS);
        Self { parameters: parameters(powertrain, problems) + shift, slope }
    }

    /// CVODE's methods, where there is a C compiler with the library.
    pub(super) fn cvode(&self) -> Option<[Rival; 2]> {
        let program = compiled()?;
        let text = answer(&mut Command::new(program), &self.parameters)?;
        let mut lines = text.lines();
        self.check(&numbers(lines.next()?)?);
        let mut rivals = [("bdf", "CVODE, BDF"), ("adams", "CVODE, Adams")]
            .map(|(key, name)| (key, Rival { name, runs: [Vec::new(), Vec::new()] }));
        for line in lines {
            let (method, rest) = line.split_once(' ')?;
            let (problem, rest) = rest.split_once(' ')?;
            let (seconds, end) = numbers(rest)?.split_first().map(|(seconds, end)| (*seconds, end.to_vec()))?;
            let (_, rival) = rivals.iter_mut().find(|(key, _)| *key == method)?;
            rival.runs[usize::from(problem == "changing")].push((seconds, end.try_into().ok()?));
        }
        Some(rivals.map(|(_, rival)| rival))
    }

    /// The problem with constant inputs in SciPy: fastest time, s, and end state.
    pub(super) fn lsoda(&self) -> Option<(f64, [f64; STATES])> {
        let text = answer(Command::new("python3").arg(folder().join("lsoda.py")), &self.parameters)?;
        let mut lines = text.lines();
        self.check(&numbers(lines.next()?)?);
        let (seconds, end) = numbers(lines.next()?)?.split_first().map(|(seconds, end)| (*seconds, end.to_vec()))?;
        Some((seconds, end.try_into().ok()?))
    }

    /// Refuses another program's equations that are not ours.
    fn check(&self, theirs: &[f64]) {
        assert_eq!(theirs.len(), STATES, "a derivative by another program");
        for (own, theirs) in self.slope.iter().zip(theirs) {
            assert!((own - theirs).abs() <= 1e-9 * own.abs().max(1.0), "{own}, but {theirs} in another program");
        }
    }
}

/// What a program says to parameters.
pub(super) fn answer(command: &mut Command, parameters: &str) -> Option<String> {
    let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = command.spawn().ok()?;
    // A program that ends early reads not all of it.
    let _ = child.stdin.take()?.write_all(parameters.as_bytes());
    let output = child.wait_with_output().ok()?;
    output.status.success().then(|| String::from_utf8(output.stdout).ok())?
}

/// A field of the parameters.
pub(super) fn field(name: &str, values: &[f64]) -> String {
    let values: String = values.iter().map(|value| format!(" {value:?}")).collect();
    format!("{name}{values}\n")
}

pub(super) fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/performance/rivals")
}

/// The program with CVODE.
fn compiled() -> Option<PathBuf> {
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cvode");
    let mut compiler = Command::new("cc");
    compiler.arg("-O3").arg(folder().join("cvode.c")).arg("-o").arg(&program);
    for library in ["sundials_cvode", "sundials_nvecserial", "m"] {
        compiler.arg(format!("-l{library}"));
    }
    let done = compiler.stderr(Stdio::null()).status().ok()?;
    done.success().then_some(program)
}

pub(super) fn numbers(line: &str) -> Option<Vec<f64>> {
    line.split_whitespace().map(|number| number.parse().ok()).collect()
}

/// The car and the problems.
fn parameters(powertrain: &Powertrain, problems: &[Problem; 2]) -> String {
    let v = &powertrain.vehicle;
    let row = |row: &AccelerationRow<f64>| vec![row.per_turbine_torque, row.per_oncoming_torque, row.per_output_torque];
    let gear = v.shift.coefficients(Engagement::OffgoingStuck);
    let map = &v.engine.torque_n_m;
    let ClutchValve::Proportional(valve) = &v.oncoming.valve else {
        panic!("the built-in car has proportional valves")
    };
    let (clutch, lag) = (&v.oncoming.clutch, &valve.time_constant_s);
    let (line, road) = (&v.driveline, &v.road);
    let of_speed = |&speed: &f64| map.columns().iter().map(move |&throttle| map.at(speed, throttle));
    let throttle = |problem: &Problem| problem.inputs.iter().map(|inputs| inputs.throttle).collect();
    let fields: Vec<(&str, Vec<f64>)> = vec![
        ("engine", vec![v.engine.inertia_kg_m2, v.engine.drag_n_m_s]),
        ("engine_speed", map.rows().to_vec()),
        ("throttle", map.columns().to_vec()),
        ("engine_map", map.rows().iter().flat_map(of_speed).collect()),
        ("speed_ratio", v.converter.capacity_n_m_s2.axis().to_vec()),
        ("capacity", v.converter.capacity_n_m_s2.values().to_vec()),
        ("torque_ratio", v.converter.torque_ratio.values().to_vec()),
        ("turbine_row", row(&gear.turbine)),
        ("output_row", row(&gear.output)),
        ("slip_row", vec![v.shift.oncoming_slip(1.0, 0.0), v.shift.oncoming_slip(0.0, 1.0)]),
        ("friction_slip", clutch.friction.axis().to_vec()),
        ("friction", clutch.friction.values().to_vec()),
        ("clutch", vec![clutch.lever(), clutch.piston_area_m2, clutch.return_spring_n]),
        ("lag_pressure", lag.axis().to_vec()),
        ("lag", lag.values().to_vec()),
        ("settled", vec![INPUTS.offgoing_settled_pa, INPUTS.oncoming_settled_pa]),
        (
            "driveline",
            vec![
                line.final_ratio,
                line.shaft_stiffness_n_m_rad,
                line.shaft_damping_n_m_s_rad,
                line.wheel_inertia_kg_m2,
            ],
        ),
        ("tyre", vec![v.tyre.max_force_n, v.tyre.slip_scale, v.tyre.floor_m_s]),
        (
            "road",
            vec![
                road.mass_kg,
                road.wheel_radius_m,
                road.drag_force(1.0),
                road.rolling_moment(START.wheel_rad_s),
                road.grade_force(),
            ],
        ),
        ("start", START.to_array().to_vec()),
        ("scale", State::SCALE.to_array().to_vec()),
        ("span", vec![SPAN_S, RELATIVE_TOLERANCE]),
        ("tolerances", TOLERANCES.to_vec()),
        ("constant", throttle(&problems[0])),
        ("changing", throttle(&problems[1])),
    ];
    fields.into_iter().map(|(name, values)| field(name, &values)).collect()
}
