//! The page of a study: distributions, effects, the worst runs.

use config::{Study, Values};
use minijinja::{Value, context};
use study::campaign::PHASES;
use study::campaign::row::Run;
use study::campaign::summary::{Distribution, EFFECT_BINS};
use study::{Row, Summary};
use trace::units::mpa;

use crate::figure::{Axis, Figure, Panel, Series};
use crate::page::{PageError, origin, render};
use crate::palette::{FAMILY, observer_strokes};
use crate::shift_figure::observers_of;
use crate::tables::{COMPARED_NAMES, number, phase_name};

/// The page and its figures.
#[derive(Debug, Clone)]
pub struct StudyPage {
    /// The page; needs nothing but itself.
    pub html: String,
    /// The figures by file name, as SVG.
    pub figures: Vec<(String, String)>,
}

/// Points of a drawn distribution.
const CURVE_POINTS: u32 = 200;
/// Factors whose effect is drawn.
const DRAWN_FACTORS: usize = 6;
/// Fraction of the runs that a drawn distribution reaches to.
const DRAWN_FRACTION: f64 = 0.99;
/// Where the axis of the distributions ends if there are none, Pa.
const NO_RUNS_REACH_PA: f64 = 1e5;

impl StudyPage {
    /// The page of a study's rows. `worst` are its worst runs in full, in the order of the summary; `command` is
    /// what makes a run again but for its number.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn of(summary: &Summary, study: &Study, worst: &[Run], command: &str) -> Result<Self, PageError> {
        let layout = &summary.layout;
        let mut figures = vec![("errors.svg".to_owned(), distributions(summary, study))];
        for (i, phase) in PHASES.into_iter().enumerate() {
            figures.push((format!("effects_{}.svg", phase.name()), effects_figure(summary, i)));
        }
        let worst_runs: Vec<Value> = (summary.worst.iter().zip(worst))
            .map(|(row, run)| {
                let figure = observers_of(&run.observers, &run.trace, run.quality.as_ref());
                let shown = worst_run(row, summary, &figure, command);
                figures.push((format!("run_{}.svg", row.run), figure));
                shown
            })
            .collect();
        let html = render(
            "study.html",
            context! {
                name => &study.name,
                title => &study.title,
                version => env!("CARGO_PKG_VERSION"),
                vehicle_name => &study.vehicle.name,
                runs => summary.runs(),
                plan => study.plan.name(),
                seed => study.seed,
                factors => study.factors.iter().map(|factor| {
                    let [low, high] = factor.values.taken().ends();
                    context! {
                        name => &factor.name,
                        key => &factor.key,
                        low => short(low),
                        high => short(high),
                        sometimes => sometimes(&factor.values),
                    }
                }).collect::<Vec<_>>(),
                statuses => summary.statuses.iter()
                    .map(|(status, count)| context! { name => status.name().replace('_', " "), count => count })
                    .collect::<Vec<_>>(),
                scores => scores(summary),
                diverged => diverged(summary),
                relative => relative(summary),
                errors_figure => figures[0].1.html(),
                effects_figures => figures[1..3].iter().map(|(_, figure)| figure.html()).collect::<Vec<_>>(),
                observers => &layout.observers,
                effects => (0..PHASES.len()).map(|phase| context! {
                    phase => phase_name(PHASES[phase]),
                    rows => effect_rows(summary, phase),
                }).collect::<Vec<_>>(),
                has_total => summary.effects(0, 0).iter().any(|effect| effect.total.is_some()),
                has_sometimes => study.factors.iter().any(|factor| sometimes(&factor.values).is_some()),
                first_observer => layout.observers.first(),
                drawn_factors => DRAWN_FACTORS.min(layout.factors.len()),
                worst => worst_runs,
                inputs => origin(&[&study.source, &study.experiment.source, &study.vehicle.source]),
            },
        )?;
        let figures = figures.into_iter().map(|(name, figure)| (name, figure.svg())).collect();
        Ok(Self { html, figures })
    }
}

/// A number with four significant digits.
fn short(value: f64) -> String {
    format!("{:.3e}", value).parse::<f64>().map_or_else(|_| value.to_string(), |rounded| rounded.to_string())
}

/// The fraction of the runs in which a factor is, in per cent, and its value in the others, if it is not in all of them.
fn sometimes(values: &Values) -> Option<[String; 2]> {
    match values {
        Values::Sometimes(s) => Some([number(100.0 * s.chance, 0), short(s.otherwise)]),
        Values::List(_) | Values::Uniform(..) | Values::LogUniform(..) | Values::Normal(..) => None,
    }
}

/// One row for each phase and observer.
fn scores(summary: &Summary) -> Vec<Value> {
    let mut rows = Vec::new();
    for (i, phase) in PHASES.into_iter().enumerate() {
        for (observer, name) in summary.layout.observers.iter().enumerate() {
            let (rms, chatter) = (summary.rms(observer, i), summary.chatter(observer, i));
            let pressure = |pascal: f64| number(mpa(pascal), 4);
            rows.push(context! {
                first => observer == 0,
                phase => phase_name(phase),
                observer => name,
                median => pressure(rms.quantile(0.5)),
                high => pressure(rms.quantile(0.95)),
                worst => pressure(rms.largest()),
                chatter => number(mpa(chatter.quantile(0.5)), 3),
                covered => coverage(summary.covered(observer, i)),
                width => pressure(summary.width(observer, i).quantile(0.5)),
            });
        }
    }
    rows
}

/// The errors over those of the open loop: one row for each error, phase and observer.
fn relative(summary: &Summary) -> Vec<Value> {
    let mut rows = Vec::new();
    for (compared, error) in COMPARED_NAMES.into_iter().enumerate() {
        for (i, phase) in PHASES.into_iter().enumerate() {
            let before = rows.len();
            for (observer, name) in summary.layout.observers.iter().enumerate() {
                let Some(r) = summary.relative(compared, observer, i) else { continue };
                let ratios = [r.median, r.high, r.largest, r.high_over_high, r.worst_over_worst];
                rows.push(context! {
                    first => rows.len() == before,
                    error => error,
                    phase => phase_name(phase),
                    observer => name,
                    ratios => ratios.map(|ratio| number(ratio, 2)),
                    better => format!("{:.0}", (100.0 * r.better).floor()),
                });
            }
        }
    }
    rows
}

/// Which estimates diverged, in how many runs; nothing if none did.
pub fn diverged(summary: &Summary) -> Option<String> {
    let mut found = Vec::new();
    for (observer, name) in summary.layout.observers.iter().enumerate() {
        for (i, phase) in PHASES.into_iter().enumerate() {
            let runs = summary.rms(observer, i);
            if runs.diverged() > 0 {
                let (diverged, all) = (runs.diverged(), runs.count());
                found.push(format!("{name} in the {} of {diverged} of {all} runs", phase_name(phase)));
            }
        }
    }
    (!found.is_empty()).then(|| found.join(", "))
}

/// Runs whose range held the truth, of those with a range.
fn coverage((covered, all): (u64, u64)) -> String {
    if all == 0 { "–".to_owned() } else { format!("{covered} of {all}") }
}

/// Fraction of the runs whose error is smaller, for each observer.
fn distributions(summary: &Summary, study: &Study) -> Figure {
    let observers = summary.layout.observers.len();
    let all = (0..observers).flat_map(|o| (0..PHASES.len()).map(move |p| (o, p)));
    let reach = reach(all.map(|(o, p)| summary.rms(o, p)));
    let strokes = observer_strokes(study.experiment.observers.iter());
    let panels = PHASES.into_iter().enumerate().map(|(i, phase)| {
        let series = (0..observers).map(|observer| Series {
            label: summary.layout.observers[observer].clone(),
            stroke: strokes[observer],
            points: (0..=CURVE_POINTS)
                .filter(|_| summary.rms(observer, i).count() > 0)
                .map(|n| reach * f64::from(n) / f64::from(CURVE_POINTS))
                .map(|x| (mpa(x), 100.0 * summary.rms(observer, i).fraction_below(x)))
                .collect(),
        });
        panel(&format!("{}: runs (%)", phase_name(phase)), 170.0, Axis::Fixed(0.0, 100.0), series.collect())
    });
    Figure {
        x_label: "RMS error of the pressure (MPa)".into(),
        x_range: (0.0, mpa(reach)),
        spans: Vec::new(),
        panels: panels.collect(),
    }
}

/// Where the axis of the distributions ends, Pa: it holds nearly all runs of every observer, but no error ten times as large
/// as is usual for the best, which a diverged observer has.
fn reach<'a>(errors: impl Iterator<Item = &'a Distribution>) -> f64 {
    let of_one = |d: &Distribution| d.quantile(DRAWN_FRACTION).min(10.0 * d.quantile(0.5));
    let reaches: Vec<f64> = errors.map(of_one).filter(|reach| reach.is_finite() && *reach > 0.0).collect();
    let minimum = reaches.iter().copied().fold(f64::INFINITY, f64::min);
    reaches.into_iter().filter(|&reach| reach <= 10.0 * minimum).reduce(f64::max).unwrap_or(NO_RUNS_REACH_PA)
}

/// Mean error of the first observer over the factors that move it most, and of the open loop over the same.
fn effects_figure(summary: &Summary, phase: usize) -> Figure {
    let effects = summary.effects(0, phase);
    let mut strongest: Vec<usize> = (0..effects.len()).collect();
    strongest.sort_by(|&a, &b| effects[b].first_order.total_cmp(&effects[a].first_order));
    strongest.truncate(DRAWN_FACTORS);
    let curves = |observer: usize| -> Vec<Series> {
        let effects = summary.effects(observer, phase);
        (strongest.iter().enumerate())
            .map(|(n, &factor)| Series {
                label: effects[factor].factor.clone(),
                stroke: FAMILY[n % FAMILY.len()],
                points: (effects[factor].means.iter().enumerate())
                    .filter(|(_, mean)| mean.is_finite())
                    .map(|(bin, &mean)| (100.0 * (bin as f64 + 0.5) / EFFECT_BINS as f64, mpa(mean)))
                    .collect(),
            })
            .collect()
    };
    let names = &summary.layout.observers;
    let shown = std::iter::once(0).chain(summary.layout.open_loop.filter(|&open_loop| open_loop != 0));
    let panels = shown.map(|observer| {
        let curves = curves(observer);
        let mut means: Vec<f64> = curves.iter().flat_map(|curve| &curve.points).map(|point| point.1).collect();
        means.sort_by(f64::total_cmp);
        // One diverged run lifts the mean of its bin out of all proportion.
        let axis = means.get(means.len() / 2).map_or(Axis::All, |median| Axis::Within(0.0, 10.0 * median));
        panel(&format!("{}, error (MPa)", names[observer]), 150.0, axis, curves)
    });
    let panels: Vec<Panel> = panels.collect();
    Figure {
        x_label: "factor, from its smallest (0 %) to its largest value (100 %)".into(),
        x_range: (0.0, 100.0),
        spans: Vec::new(),
        panels,
    }
}

fn panel(y_label: &str, height: f64, axis: Axis, series: Vec<Series>) -> Panel {
    Panel { y_label: y_label.to_owned(), height, series, bands: Vec::new(), axis }
}

/// Sobol indices: one row for each factor, the first order (and total) of each observer.
fn effect_rows(summary: &Summary, phase: usize) -> Vec<Value> {
    let observers = 0..summary.layout.observers.len();
    let effects: Vec<_> = observers.map(|observer| summary.effects(observer, phase)).collect();
    // A fraction that is not known has no shade.
    let shade = |fraction: f64| format!("{:.2}", 0.6 * if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 1.0) });
    // A negative estimate is chance: the fraction is zero.
    let percent = |fraction: f64| number(if fraction < 0.0 { 0.0 } else { 100.0 * fraction }, 0);
    (summary.layout.factors.iter().enumerate())
        .map(|(i, factor)| {
            let cells = effects.iter().map(|effects| {
                let effect = &effects[i];
                context! {
                    first => percent(effect.first_order),
                    total => effect.total.map(percent),
                    shade => shade(effect.first_order),
                }
            });
            context! { factor => factor, cells => cells.collect::<Vec<_>>() }
        })
        .collect()
}

fn worst_run(row: &Row, summary: &Summary, figure: &Figure, command: &str) -> Value {
    let layout = &summary.layout;
    let rms = |observer, phase| row.numbers[layout.score(observer, phase, study::campaign::Metric::PressureRms)];
    let errors = layout.observers.iter().enumerate().map(|(observer, name)| {
        context! {
            observer => name,
            errors => (0..PHASES.len()).map(|phase| number(mpa(rms(observer, phase)), 4)).collect::<Vec<_>>(),
        }
    });
    let factors = layout.factors.iter().zip(&row.numbers);
    context! {
        run => row.run,
        status => row.status.name().replace('_', " "),
        factors => factors.map(|(name, &value)| context! { name, value => short(value) }).collect::<Vec<_>>(),
        errors => errors.collect::<Vec<_>>(),
        command => format!("{command} --run {}", row.run),
        figure => figure.html(),
    }
}
