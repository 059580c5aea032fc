//! The page of a study: distributions, effects, the worst runs.

use config::Study;
use minijinja::{Value, context};
use study::campaign::PHASES;
use study::campaign::row::Run;
use study::campaign::summary::EFFECT_BINS;
use study::{Row, Summary};
use trace::units::mpa;

use crate::figure::{Figure, Panel, Series};
use crate::page::{PageError, inline, origin, templates};
use crate::shift_figure::{OBSERVERS, observer_colours, observers_of};
use crate::tables::phase_name;

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
/// Share of the runs that a drawn distribution reaches to.
const DRAWN_SHARE: f64 = 0.99;

impl StudyPage {
    /// The page of a study's rows. `worst` are its worst runs in full, in the order of the summary; `command` is
    /// what makes a run again but for its number.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn of(summary: &Summary, study: &Study, worst: &[Run], command: &str) -> Result<Self, PageError> {
        let layout = &summary.layout;
        let mut figures = vec![("errors.svg".to_owned(), distributions(summary, study).svg())];
        for (i, phase) in PHASES.into_iter().enumerate() {
            figures.push((format!("effects_{}.svg", phase.name()), effects_figure(summary, i).svg()));
        }
        let worst_runs: Vec<Value> = (summary.worst.iter().zip(worst))
            .map(|(row, run)| {
                let svg = observers_of(&run.observers, &run.trace, run.quality.as_ref()).svg();
                let shown = worst_run(row, summary, &svg, command);
                figures.push((format!("run_{}.svg", row.run), svg));
                shown
            })
            .collect();
        let html = templates()?.get_template("study.html")?.render(context! {
            name => &study.name,
            title => &study.title,
            version => env!("CARGO_PKG_VERSION"),
            vehicle_name => &study.vehicle.name,
            runs => summary.runs(),
            plan => study.plan.name(),
            seed => study.seed,
            factors => study.factors.iter().map(|factor| {
                let [low, high] = factor.values.ends();
                context! { name => &factor.name, key => &factor.key, low => short(low), high => short(high) }
            }).collect::<Vec<_>>(),
            statuses => summary.statuses.iter()
                .map(|(status, count)| context! { name => status.name().replace('_', " "), count => count })
                .collect::<Vec<_>>(),
            scores => scores(summary),
            has_open_loop => layout.open_loop.is_some(),
            errors_figure => inline(&figures[0].1),
            effects_figures => figures[1..3].iter().map(|(_, svg)| inline(svg)).collect::<Vec<_>>(),
            observers => &layout.observers,
            effects => (0..PHASES.len()).map(|phase| context! {
                phase => phase_name(PHASES[phase]),
                rows => effect_rows(summary, phase),
            }).collect::<Vec<_>>(),
            has_total => summary.effects(0, 0).iter().any(|effect| effect.total.is_some()),
            first_observer => layout.observers.first(),
            drawn_factors => DRAWN_FACTORS.min(layout.factors.len()),
            worst => worst_runs,
            inputs => origin(&[&study.source, &study.experiment.source, &study.vehicle.source]),
        })?;
        Ok(Self { html, figures })
    }
}

/// A number with four significant digits.
fn short(value: f64) -> String {
    format!("{:.3e}", value).parse::<f64>().map_or_else(|_| value.to_string(), |rounded| rounded.to_string())
}

/// One row for each phase and observer.
fn scores(summary: &Summary) -> Vec<Value> {
    let mut rows = Vec::new();
    for (i, phase) in PHASES.into_iter().enumerate() {
        for (observer, name) in summary.layout.observers.iter().enumerate() {
            let (rms, ratio, chatter) =
                (summary.rms(observer, i), summary.ratio(observer, i), summary.chatter(observer, i));
            let pressure = |pascal: f64| format!("{:.4}", mpa(pascal));
            let is_open_loop = summary.layout.open_loop == Some(observer);
            rows.push(context! {
                first => observer == 0,
                phase => phase_name(phase),
                observer => name,
                median => pressure(rms.quantile(0.5)),
                high => pressure(rms.quantile(0.95)),
                worst => pressure(rms.largest()),
                ratio_median => (!is_open_loop).then(|| format!("{:.2}", ratio.quantile(0.5))),
                ratio_high => (!is_open_loop).then(|| format!("{:.2}", ratio.quantile(0.95))),
                ratio_worst => (!is_open_loop).then(|| format!("{:.2}", ratio.largest())),
                better => (!is_open_loop).then(|| format!("{:.0}", 100.0 * ratio.share_below(1.0))),
                chatter => format!("{:.3}", mpa(chatter.quantile(0.5))),
                covered => coverage(summary.covered(observer, i)),
                width => pressure(summary.width(observer, i).quantile(0.5)),
            });
        }
    }
    rows
}

/// Runs whose range held the truth, of those with a range.
fn coverage((covered, all): (u64, u64)) -> String {
    if all == 0 { "–".to_owned() } else { format!("{covered} of {all}") }
}

/// Share of the runs whose error is smaller, for each observer.
fn distributions(summary: &Summary, study: &Study) -> Figure {
    let observers = summary.layout.observers.len();
    let all = (0..observers).flat_map(|o| (0..PHASES.len()).map(move |p| (o, p)));
    let reach = all.map(|(o, p)| summary.rms(o, p).quantile(DRAWN_SHARE)).filter(|x| x.is_finite()).fold(1.0, f64::max);
    let colours = observer_colours(study.experiment.observers.iter().map(|entry| entry.kind));
    let panels = PHASES.into_iter().enumerate().map(|(i, phase)| {
        let series = (0..observers).map(|observer| Series {
            label: summary.layout.observers[observer].clone(),
            colour: colours[observer],
            dashed: summary.layout.open_loop == Some(observer),
            points: (0..=CURVE_POINTS)
                .map(|n| reach * f64::from(n) / f64::from(CURVE_POINTS))
                .map(|x| (mpa(x), 100.0 * summary.rms(observer, i).share_below(x)))
                .collect(),
        });
        panel(&format!("{}: runs (%)", phase_name(phase)), 170.0, series.collect()).within(0.0, 100.0)
    });
    Figure {
        x_label: "RMS error of the pressure below (MPa)",
        x_range: (0.0, mpa(reach)),
        spans: Vec::new(),
        panels: panels.collect(),
    }
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
                colour: OBSERVERS[n % OBSERVERS.len()],
                dashed: false,
                points: (effects[factor].means.iter().enumerate())
                    .filter(|(_, mean)| mean.is_finite())
                    .map(|(bin, &mean)| (100.0 * (bin as f64 + 0.5) / EFFECT_BINS as f64, mpa(mean)))
                    .collect(),
            })
            .collect()
    };
    let names = &summary.layout.observers;
    let shown = std::iter::once(0).chain(summary.layout.open_loop.filter(|&open_loop| open_loop != 0));
    let panels = shown.map(|observer| panel(&format!("{} (MPa)", names[observer]), 150.0, curves(observer)));
    let panels: Vec<Panel> = panels.collect();
    Figure {
        x_label: "factor, from its smallest (0 %) to its largest value (100 %)",
        x_range: (0.0, 100.0),
        spans: Vec::new(),
        panels,
    }
}

fn panel(y_label: &str, height: f64, series: Vec<Series>) -> Panel {
    Panel { y_label: y_label.to_owned(), height, series, band: None, y_range: None }
}

/// Sobol indices: one row for each factor, the first order (and total) of each observer.
fn effect_rows(summary: &Summary, phase: usize) -> Vec<Value> {
    let observers = 0..summary.layout.observers.len();
    let effects: Vec<_> = observers.map(|observer| summary.effects(observer, phase)).collect();
    // A negative estimate is chance: the share is zero.
    let percent = |share: f64| format!("{:.0}", 100.0 * share.max(0.0));
    (summary.layout.factors.iter().enumerate())
        .map(|(i, factor)| {
            let cells = effects.iter().map(|effects| {
                let effect = &effects[i];
                context! {
                    first => percent(effect.first_order),
                    total => effect.total.map(percent),
                    shade => format!("{:.2}", 0.6 * effect.first_order.clamp(0.0, 1.0)),
                }
            });
            context! { factor => factor, cells => cells.collect::<Vec<_>>() }
        })
        .collect()
}

fn worst_run(row: &Row, summary: &Summary, svg: &str, command: &str) -> Value {
    let layout = &summary.layout;
    let rms = |observer, phase| row.numbers[layout.score(observer, phase, study::campaign::Metric::PressureRms)];
    let errors = layout.observers.iter().enumerate().map(|(observer, name)| {
        context! {
            observer => name,
            errors => (0..PHASES.len()).map(|phase| format!("{:.4}", mpa(rms(observer, phase)))).collect::<Vec<_>>(),
        }
    });
    let factors = layout.factors.iter().zip(&row.numbers);
    context! {
        run => row.run,
        status => row.status.name().replace('_', " "),
        factors => factors.map(|(name, &value)| context! { name, value => short(value) }).collect::<Vec<_>>(),
        errors => errors.collect::<Vec<_>>(),
        command => format!("{command} --run {}", row.run),
        figure => inline(svg),
    }
}
