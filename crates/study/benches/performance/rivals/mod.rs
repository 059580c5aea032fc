//! The plant's integrator beside those of a Rust library, a method of fixed step, CVODE and SciPy, on the same equations.

mod outside;
mod plot;
mod shift;

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Duration;

use differential_equations::prelude::*;
use plant::state::STATES;
use plant::{HybridIntegrator, Inputs, Mode, Powertrain, State};

use crate::shared::vehicle;
use crate::{Figure, fastest, time};
use outside::Outside;
use plot::{Curve, Panel};
use shift::Shift;

/// First gear under inputs that stay for a while.
struct FirstGear<'a> {
    powertrain: &'a Powertrain,
    mode: Mode,
    inputs: Inputs,
}

impl ODE<f64, [f64; STATES]> for FirstGear<'_> {
    fn diff(&self, _time: f64, x: &[f64; STATES], slope: &mut [f64; STATES]) {
        *slope = self.powertrain.derivative(self.mode, x, &self.inputs);
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

/// Two seconds as pieces of constant inputs: how long each is, s, and the inputs of each.
struct Problem {
    title: &'static str,
    piece_s: f64,
    inputs: Vec<Inputs>,
}

/// The same inputs throughout, and inputs that change every 10 ms as those of a controller do.
fn problems() -> [Problem; 2] {
    let changing = |piece: u32| Inputs { throttle: 0.22 + 0.03 * (0.1 * f64::from(piece)).sin(), ..INPUTS };
    [
        Problem { title: "constant inputs", piece_s: SPAN_S, inputs: vec![INPUTS] },
        Problem { title: "inputs that change every 10 ms", piece_s: 0.01, inputs: (0..200).map(changing).collect() },
    ]
}

/// Solves a problem at a tolerance, or with a step in s; nothing if the method fails.
type Solve<'a> = Box<dyn Fn(&Problem, f64) -> Option<[f64; STATES]> + 'a>;

/// Solves a piece of a problem from a state.
type Piece<'a> = &'a dyn Fn(&FirstGear<'_>, [f64; STATES]) -> Option<[f64; STATES]>;

/// A method and what it is tried with.
struct Method<'a> {
    name: &'static str,
    tried: &'static [f64],
    solve: Solve<'a>,
}

const TOLERANCES: [f64; 6] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// Steps of the method of fixed step, s, which divide a piece; the longest ones are unstable.
const STEPS_S: [f64; 5] = [5e-3, 2e-3, 1e-3, 5e-4, 2.5e-4];

fn ours(powertrain: &Powertrain, problem: &Problem, tolerance: f64) -> [f64; STATES] {
    let first = problem.inputs[0];
    let mut plant = HybridIntegrator::with_tolerance(powertrain, 0.0, START, &first, tolerance).unwrap();
    for (piece, inputs) in (1_u32..).zip(&problem.inputs) {
        plant.advance(powertrain, inputs, f64::from(piece) * problem.piece_s, &mut |_| {}).unwrap();
    }
    plant.state().to_array()
}

/// Runge-Kutta of order 4 with a fixed step, as in a model for a test bench.
fn rk4(gear: &FirstGear<'_>, mut x: [f64; STATES], span_s: f64, step_s: f64) -> [f64; STATES] {
    let f = |x: &[f64; STATES]| gear.powertrain.derivative(gear.mode, x, &gear.inputs);
    let moved = |x: &[f64; STATES], by: f64, k: &[f64; STATES]| std::array::from_fn(|i| x[i] + by * k[i]);
    for _ in 0..(span_s / step_s).round() as u32 {
        let a = f(&x);
        let b = f(&moved(&x, 0.5 * step_s, &a));
        let c = f(&moved(&x, 0.5 * step_s, &b));
        let d = f(&moved(&x, step_s, &c));
        x = std::array::from_fn(|i| x[i] + step_s / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
    }
    x
}

fn methods<'a>(powertrain: &'a Powertrain, mode: Mode) -> Vec<Method<'a>> {
    // Each piece anew: the inputs jump.
    let piecewise = move |problem: &Problem, piece: Piece<'_>| {
        let gear = |inputs: &Inputs| FirstGear { powertrain, mode, inputs: *inputs };
        problem.inputs.iter().try_fold(START.to_array(), |x, inputs| piece(&gear(inputs), x))
    };
    macro_rules! library {
        ($name:expr, $method:expr) => {
            Method {
                name: $name,
                tried: &TOLERANCES,
                solve: Box::new(move |problem, tolerance| {
                    piecewise(problem, &|gear, x| {
                        let method = $method.rtol(tolerance).atol(tolerance);
                        let solution = IVP::ode(gear, 0.0, problem.piece_s, x).method(method).solve();
                        solution.ok().and_then(|solution| solution.y.last().copied())
                    })
                }),
            }
        };
    }
    vec![
        Method {
            name: "wetclutch, with its events",
            tried: &TOLERANCES,
            solve: Box::new(|problem, tolerance| Some(ours(powertrain, problem, tolerance))),
        },
        library!("`differential-equations`, Dormand-Prince 5(4)", ExplicitRungeKutta::dopri5()),
        library!("`differential-equations`, Radau 5", ImplicitRungeKutta::radau5()),
        library!("`differential-equations`, Kvaerno 7(4)", DiagonallyImplicitRungeKutta::kvaerno745()),
        library!("`differential-equations`, BDF", BackwardDifferentiationFormula::adaptive()),
        Method {
            name: "Runge-Kutta of order 4, fixed step",
            tried: &STEPS_S,
            solve: Box::new(move |problem, step_s| {
                piecewise(problem, &|gear, x| Some(rk4(gear, x, problem.piece_s, step_s)))
            }),
        },
    ]
}

/// Error that a method may have at most to be compared in the table.
const EQUAL_ERROR: f64 = 1e-4;

/// Says which rivals that are other programs are there, and whether all are. Where one has other equations, this ends with an
/// error.
pub(crate) fn check() -> bool {
    let powertrain = Powertrain::new(vehicle());
    let mode = HybridIntegrator::new(&powertrain, 0.0, START, &INPUTS).unwrap().mode();
    let shift = Shift::new(&powertrain);
    let outside = Outside::new(&powertrain, mode, &problems(), &shift.parameters());
    let there = [outside.cvode().is_some(), outside.lsoda().is_some(), shift.scipy(&outside.parameters).is_some()];
    let needs = ["`cc` with SUNDIALS (Debian: `libsundials-dev`)", "`python3` with `scipy`", "the same"];
    for ((rival, needs), there) in ["CVODE", "SciPy's LSODA", "A shift in SciPy"].iter().zip(needs).zip(there) {
        let said = if there { "has our equations".to_owned() } else { format!("is not there: it needs {needs}") };
        println!("{rival} {said}");
    }
    there.iter().all(|there| *there)
}

/// The integrator beside its rivals: a table for the page, and the diagram.
pub(crate) fn integrators(page: &mut String) -> Figure {
    let powertrain = Powertrain::new(vehicle());
    let mode = HybridIntegrator::new(&powertrain, 0.0, START, &INPUTS).unwrap().mode();
    let (methods, problems) = (methods(&powertrain, mode), problems());
    let references = problems.each_ref().map(|problem| ours(&powertrain, problem, 1e-11));
    let shift = Shift::new(&powertrain);
    let outside = Outside::new(&powertrain, mode, &problems, &shift.parameters());
    let cvode = outside.cvode();
    let panels: Vec<Panel> = (problems.iter().zip(&references).enumerate())
        .map(|(at, (problem, reference))| {
            let mut curves: Vec<Curve> = methods.iter().map(|method| curve(method, problem, reference)).collect();
            curves.extend(cvode.iter().flatten().map(|rival| rival.curve(at, reference)));
            Panel { title: problem.title, curves }
        })
        .collect();
    page.push_str(
        "\n## The integrator compared with others\n\nTwo seconds in first gear on the same equations, without recording. Error: largest relative \
         error of a state at the\nend. Each method is run at several tolerances, that of fixed step with several steps; the table has the \
         shortest time with an error of at\nmost 1e-4.\n\n![Time over error of each method](../figures/work_precision.svg)\n\n\
         | integrator | constant inputs | relative to wetclutch | inputs that change every 10 ms | relative |\n|---|---|---|---|---|\n",
    );
    let at = |panel: usize, method: usize| time_at(&panels[panel].curves[method].points, EQUAL_ERROR);
    for (number, curve) in panels[0].curves.iter().enumerate() {
        let _ = write!(page, "| {} ", curve.name);
        for panel in 0..panels.len() {
            let _ = match (at(panel, number), at(panel, 0)) {
                (Some(seconds), Some(own)) => write!(page, "| {} | {:.1} ", time(seconds), seconds / own),
                _ => write!(page, "| does not reach it | "),
            };
        }
        page.push_str("|\n");
    }
    page.push_str(match cvode {
        Some(_) => {
            "\nCVODE is the C library of SUNDIALS; its equations are compiled C, and it starts anew where the inputs jump.\n"
        }
        None => "\nCVODE is not measured: there is no `cc` with SUNDIALS (Debian: `libsundials-dev`).\n",
    });
    let _ = match outside.lsoda() {
        Some((seconds, end)) => writeln!(
            page,
            "SciPy `solve_ivp` with LSODA, which calls the equations in Python, takes {} for the constant inputs at a relative tolerance of 1e-5, \
             with an error of {:.0e}: most of that is Python.",
            time(seconds),
            error(&end, &references[0])
        ),
        None => writeln!(page, "SciPy's LSODA is not measured: there is no python3 with scipy."),
    };
    page.push('\n');
    shift.write(page, &outside.parameters);
    ("work_precision.svg", plot::svg(&panels))
}

/// Errors and times of a method at all that it is tried with.
fn curve(method: &Method<'_>, problem: &Problem, reference: &[f64; STATES]) -> Curve {
    let mut points = Vec::new();
    for &tried in method.tried {
        let Some(end) = (method.solve)(problem, tried) else { continue };
        let error = error(&end, reference);
        // A step beyond the limit of stability ends anywhere.
        if error.is_finite() && error < 1.0 {
            let job = || {
                black_box((method.solve)(problem, black_box(tried)));
            };
            points.push((error, fastest(EACH, &mut [Box::new(job)])[0]));
        }
    }
    Curve { name: method.name, points }
}

/// How long each point is measured.
const EACH: Duration = Duration::from_millis(150);

/// The shortest time with an error that is at most this.
fn time_at(points: &[(f64, f64)], error: f64) -> Option<f64> {
    points.iter().filter(|point| point.0 <= error).map(|point| point.1).min_by(f64::total_cmp)
}

/// Largest difference of a state, over its size.
fn error(end: &[f64; STATES], reference: &[f64; STATES]) -> f64 {
    let fraction = |i: usize| (end[i] - reference[i]).abs() / (State::SCALE.to_array()[i].max(reference[i].abs()));
    (0..STATES).map(fraction).fold(0.0, f64::max)
}
