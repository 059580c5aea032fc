//! The plant's integrator beside those of a Rust library and of SciPy, on the same equations.

use std::fmt::Write as _;
use std::hint::black_box;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use differential_equations::prelude::*;
use drivetrain::{AccelerationRow, ClutchValve, Engagement};
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::state::STATES;
use plant::{HybridIntegrator, Inputs, Mode, Powertrain, State};

use crate::{LONG, fastest, time, vehicle};

/// Two seconds in first gear under constant inputs.
struct FirstGear<'a> {
    powertrain: &'a Powertrain,
    mode: Mode,
}

impl ODE<f64, [f64; STATES]> for FirstGear<'_> {
    fn diff(&self, _time: f64, x: &[f64; STATES], slope: &mut [f64; STATES]) {
        *slope = self.powertrain.derivative(self.mode(), x, &INPUTS);
    }
}

const SPAN_S: f64 = 2.0;
const INPUTS: Inputs = Inputs { throttle: 0.22, offgoing_settled_pa: 1e6, oncoming_settled_pa: 0.0 };
const START: State = State {
    engine_rad_s: 250.0,
    turbine_rad_s: 225.0,
    output_rad_s: 90.0,
    twist_rad: 0.06,
    wheel_rad_s: 30.0,
    vehicle_m_s: 8.9,
    offgoing_valve_pa: 1e6,
    ..State::ZERO
};

/// Solves the problem; nothing if the method fails.
type Solve<'a> = &'a dyn Fn() -> Option<[f64; STATES]>;

pub(crate) fn integrators(page: &mut String) {
    let powertrain = Powertrain::new(vehicle());
    let mode = HybridIntegrator::new(&powertrain, 0.0, START, &INPUTS).unwrap().mode();
    let problem = FirstGear { powertrain: &powertrain, mode };
    let start = START.to_array();
    let ours = |tolerance: f64| {
        let mut plant = HybridIntegrator::with_tolerance(&powertrain, 0.0, START, &INPUTS, tolerance).unwrap();
        plant.advance(&powertrain, &INPUTS, SPAN_S, &mut |_| {}).unwrap();
        plant.state().to_array()
    };
    macro_rules! library {
        ($method:expr) => {
            || {
                let method = $method.rtol(RELATIVE_TOLERANCE).atol(RELATIVE_TOLERANCE);
                let solution = IVP::ode(&problem, 0.0, SPAN_S, start).method(method).solve();
                solution.ok().and_then(|solution| solution.y.last().copied())
            }
        };
    }
    let reference = ours(1e-11);
    let usual = || Some(ours(RELATIVE_TOLERANCE));
    let dopri5 = library!(ExplicitRungeKutta::dopri5());
    let radau5 = library!(ImplicitRungeKutta::radau5());
    let kvaerno = library!(DiagonallyImplicitRungeKutta::kvaerno745());
    let bdf = library!(BackwardDifferentiationFormula::adaptive());
    let rivals: [(&str, Solve<'_>); 5] = [
        ("wetclutch, with its events", &usual),
        ("`differential-equations`, Dormand-Prince 5(4)", &dopri5),
        ("`differential-equations`, Radau 5", &radau5),
        ("`differential-equations`, Kvaerno 7(4)", &kvaerno),
        ("`differential-equations`, BDF", &bdf),
    ];
    let mut jobs: Vec<Box<dyn FnMut()>> = Vec::new();
    for (_, solve) in rivals {
        jobs.push(Box::new(move || {
            black_box(solve());
        }));
    }
    let times = fastest(LONG, &mut jobs);
    page.push_str(
        "\n## The integrator compared with others\n\nTwo seconds in first gear on the same equations at a relative tolerance of \
         1e-5, without recording. Error: largest\nrelative error of a state at the end.\n\n\
         | integrator | time | relative to wetclutch | error |\n|---|---|---|---|\n",
    );
    let mut row = |name: &str, seconds: f64, end: Option<[f64; STATES]>| {
        let _ = match end {
            None => writeln!(page, "| {name} | fails | | |"),
            Some(end) => {
                let (ratio, error) = (seconds / times[0], error(&end, &reference));
                writeln!(page, "| {name} | {} | {ratio:.1} | {error:.0e} |", time(seconds))
            }
        };
    };
    for ((name, solve), &seconds) in rivals.iter().zip(&times) {
        row(name, seconds, solve());
    }
    match lsoda(&powertrain) {
        Some((seconds, end)) => row("SciPy `solve_ivp` with LSODA, equations in Python", seconds, Some(end)),
        None => page.push_str("| SciPy with LSODA | not measured: there is no python3 with scipy | | |\n"),
    }
}

/// Largest difference of a state, over its size.
fn error(end: &[f64; STATES], reference: &[f64; STATES]) -> f64 {
    let share = |i: usize| (end[i] - reference[i]).abs() / (State::SCALE.to_array()[i].max(reference[i].abs()));
    (0..STATES).map(share).fold(0.0, f64::max)
}

/// The same problem in SciPy: fastest time and end state.
fn lsoda(powertrain: &Powertrain) -> Option<(f64, [f64; STATES])> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/rivals/lsoda.py");
    let mut child = Command::new("python3")
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    child.stdin.take()?.write_all(parameters(powertrain).as_bytes()).ok()?;
    let output = child.wait_with_output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let mut numbers = text.split_whitespace().map(str::parse::<f64>);
    let mut next = || numbers.next()?.ok();
    let seconds = next()?;
    // The equations in Python are ours: their derivative at the start is the same.
    let mode = HybridIntegrator::new(powertrain, 0.0, START, &INPUTS).ok()?.mode();
    for slope in powertrain.derivative(mode, &START.to_array(), &INPUTS) {
        let theirs = next()?;
        assert!((slope - theirs).abs() <= 1e-9 * slope.abs().max(1.0), "{slope}, but {theirs} in Python");
    }
    let mut end = [0.0; STATES];
    for x in &mut end {
        *x = next()?;
    }
    Some((seconds, end))
}

/// The car as JSON.
fn parameters(powertrain: &Powertrain) -> String {
    let v = &powertrain.vehicle;
    let numbers = |values: &[f64]| format!("{values:?}");
    let row =
        |row: &AccelerationRow<f64>| numbers(&[row.per_turbine_torque, row.per_oncoming_torque, row.per_output_torque]);
    let gear = v.shift.coefficients(Engagement::OffgoingStuck);
    let map = &v.engine.torque_n_m;
    let torque: Vec<f64> = map.rows().iter().map(|&speed| map.at(speed, INPUTS.throttle)).collect();
    let ClutchValve::Proportional(valve) = &v.oncoming.valve else {
        panic!("the built-in car has proportional valves")
    };
    let (clutch, lag) = (&v.oncoming.clutch, &valve.time_constant_s);
    let line = &v.driveline;
    let road = &v.road;
    let shafts =
        [line.final_ratio, line.shaft_stiffness_n_m_rad, line.shaft_damping_n_m_s_rad, line.wheel_inertia_kg_m2];
    let rolling = road.rolling_moment(START.wheel_rad_s);
    let vehicle = [road.mass_kg, road.wheel_radius_m, road.drag_force(1.0), rolling, road.grade_force()];
    let fields = [
        ("engine", numbers(&[v.engine.inertia_kg_m2, v.engine.drag_n_m_s])),
        ("engine_speed", numbers(map.rows())),
        ("engine_torque", numbers(&torque)),
        ("speed_ratio", numbers(v.converter.capacity_n_m_s2.axis())),
        ("capacity", numbers(v.converter.capacity_n_m_s2.values())),
        ("torque_ratio", numbers(v.converter.torque_ratio.values())),
        ("turbine_row", row(&gear.turbine)),
        ("output_row", row(&gear.output)),
        ("slip_row", numbers(&[v.shift.oncoming_slip(1.0, 0.0), v.shift.oncoming_slip(0.0, 1.0)])),
        ("friction_slip", numbers(clutch.friction.axis())),
        ("friction", numbers(clutch.friction.values())),
        ("clutch", numbers(&[clutch.lever(), clutch.piston_area_m2, clutch.return_spring_n])),
        ("lag_pressure", numbers(lag.axis())),
        ("lag", numbers(lag.values())),
        ("settled", numbers(&[INPUTS.offgoing_settled_pa, INPUTS.oncoming_settled_pa])),
        ("driveline", numbers(&shafts)),
        ("tyre", numbers(&[v.tyre.max_force_n, v.tyre.slip_scale, v.tyre.floor_m_s])),
        ("road", numbers(&vehicle)),
        ("start", numbers(&START.to_array())),
        ("scale", numbers(&State::SCALE.to_array())),
        ("span", numbers(&[SPAN_S, RELATIVE_TOLERANCE])),
    ];
    let json: Vec<String> = fields.iter().map(|(name, value)| format!("{name:?}: {value}")).collect();
    format!("{{{}}}", json.join(", "))
}
