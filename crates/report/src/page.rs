//! The report of a comparison as one self-contained page.

use config::{Source, VehicleFile};
use minijinja::{Environment, Value, context};
use observer::Phase;
use study::Comparison;
use trace::ShownPath as _;
use trace::shown_units::sentence;
use trace::units::mpa;

use crate::shift_figure::{drive_figure, page_figure, shift_figure};
use crate::tables::{compliant_certificates, phase_name, quality_rows, rigid_certificates, score_rows};

/// Why a page could not be made.
#[derive(Debug, thiserror::Error)]
#[error("the report's template failed: {0}")]
pub struct PageError(#[from] minijinja::Error);

/// A report: the page and its figures.
#[derive(Debug, Clone)]
pub struct Page {
    /// The page; needs nothing but itself.
    pub html: String,
    /// The figures by file name, as SVG.
    pub figures: Vec<(String, String)>,
}

/// The templates of all pages.
pub(crate) fn templates() -> Result<Environment<'static>, minijinja::Error> {
    let mut environment = Environment::new();
    environment.add_template("base.html", include_str!("../templates/base.html"))?;
    environment.add_template("style.css", include_str!("../templates/style.css"))?;
    environment.add_template("found.html", include_str!("../templates/found.html"))?;
    environment.add_template("origin.html", include_str!("../templates/origin.html"))?;
    environment.add_template("scores.html", include_str!("../templates/scores.html"))?;
    environment.add_template("report.html", include_str!("../templates/report.html"))?;
    environment.add_template("reproduction.html", include_str!("../templates/reproduction.html"))?;
    environment.add_template("drive.html", include_str!("../templates/drive.html"))?;
    environment.add_template("log.html", include_str!("../templates/log.html"))?;
    environment.add_template("matrix.html", include_str!("../templates/matrix.html"))?;
    environment.add_template("car_sensitivity.html", include_str!("../templates/car_sensitivity.html"))?;
    environment.add_template("sheet.html", include_str!("../templates/sheet.html"))?;
    environment.add_template("sensitivity.html", include_str!("../templates/sensitivity.html"))?;
    environment.add_template("speeds.html", include_str!("../templates/speeds.html"))?;
    environment.add_template("study.html", include_str!("../templates/study.html"))?;
    environment.add_template("watch.html", include_str!("../templates/watch.html"))?;
    Ok(environment)
}

/// The library that draws figures.
pub(crate) const PLOTS: &str = include_str!("../vendor/uplot/uPlot.iife.min.js");
pub(crate) const PLOTS_STYLE: &str = include_str!("../vendor/uplot/uPlot.min.css");
/// What the page does with it, and with tables.
const SCRIPT: &str = concat!(
    "(() => {\n\"use strict\";\n",
    include_str!("page/data.js"),
    include_str!("page/figure.js"),
    include_str!("page/files.js"),
    include_str!("page/table.js"),
    include_str!("page/start.js"),
    "})();\n"
);

/// A page from its template, with the scripts of its figures and tables.
pub(crate) fn render(template: &str, context: Value) -> Result<String, PageError> {
    let html = templates()?.get_template(template)?.render(context)?;
    let has_figures = html.contains("<div class=\"figure\">");
    let plots =
        if has_figures { format!("<style>{PLOTS_STYLE}</style>\n<script>{PLOTS}</script>\n") } else { String::new() };
    let html = html.replacen("</head>", &format!("{plots}</head>"), 1);
    if !has_figures && !html.contains("sortable\"") {
        return Ok(html);
    }
    Ok(html.replacen("</body>", &format!("<script>\n{SCRIPT}</script>\n</body>"), 1))
}

/// The files that a page follows from, for the end of the page.
pub(crate) fn origin(sources: &[&Source]) -> Vec<Value> {
    let one = |source: &&Source| context! { path => source.path.shown().to_string(), sha256 => source.sha256() };
    sources.iter().map(one).collect()
}

/// A figure as part of a page.
pub(crate) fn inline(svg: &str) -> Value {
    Value::from_safe_string(svg.to_owned())
}

impl Page {
    /// The report of a comparison on this vehicle; `source` is the text of its experiment.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn of(comparison: &Comparison, vehicle: &VehicleFile, source: &Source) -> Result<Self, PageError> {
        let (shift, drive) = (shift_figure(comparison), drive_figure(comparison));
        let experiment = &comparison.experiment;
        let html = render(
            "report.html",
            context! {
                title => &experiment.title,
                name => &experiment.name,
                vehicle_name => &vehicle.name,
                version => env!("CARGO_PKG_VERSION"),
                shift_figure => page_figure(comparison).html(),
                drive_figure => drive.html(),
                findings => findings(comparison),
                scores => score_rows(comparison),
                range_mpa => format!("{:.1}", mpa(experiment.shift.line_pressure_pa)),
                certificates => rigid_certificates(comparison),
                compliant => compliant_certificates(comparison),
                quality => comparison.quality.as_ref().map(quality_rows),
                inputs => origin(&[&vehicle.source, source]),
                seed => experiment.sensors.map(|sensors| sensors.seed),
                certified => comparison.runs.first().filter(|_| !comparison.bound_pa.is_empty()).map(|run| &run.entry.name),
            },
        )?;
        Ok(Self { html, figures: vec![("shift.svg".into(), shift.svg()), ("drive.svg".into(), drive.svg())] })
    }
}

/// `ours` compared with `theirs`, in words.
pub(crate) fn change(ours: f64, theirs: f64) -> String {
    let percent = 100.0 * (ours / theirs - 1.0);
    if percent.abs() < 1.0 {
        return "the same as open loop".to_owned();
    }
    format!("{:.0} % {} than open loop", percent.abs(), if percent < 0.0 { "lower" } else { "higher" })
}

/// The results in sentences, also where an observer is worse than the open loop.
pub fn findings(comparison: &Comparison) -> Vec<String> {
    let Some(open_loop) = comparison.open_loop() else { return Vec::new() };
    let observers = comparison.runs.iter().filter(|run| run.entry.kind != car::ObserverKind::OpenLoop);
    let mut sentences: Vec<String> = observers
        .map(|run| {
            let parts: Vec<String> = [Phase::TorquePhase, Phase::InertiaPhase]
                .into_iter()
                .filter_map(|phase| Some((phase, run.pressure_in(phase)?, open_loop.pressure_in(phase)?)))
                .map(|(phase, score, open)| {
                    let name = phase_name(phase);
                    format!("{:.4} MPa in the {name}, {}", mpa(score.rms), change(score.rms, open.rms))
                })
                .collect();
            format!("{}: RMS error {}.", run.entry.name, parts.join("; "))
        })
        .collect();
    for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
        let Some((fraction, excess)) = comparison.bound_coverage(phase) else { continue };
        let (name, observer) = (phase_name(phase), &comparison.runs[0].entry.name);
        sentences.push(if fraction >= 1.0 {
            format!("In the {name} the error of {observer} is always within its certified band.")
        } else {
            format!(
                "In the {name} the error of {observer} is within its certified band for {:.0} % of the time and outside it by \
                 up to {:.3} MPa: the certificate assumes a valve that behaves as its model, but here delay, lag and gain \
                 of the valve vary.",
                100.0 * fraction,
                mpa(excess),
            )
        });
    }
    sentences.iter().map(|text| sentence(text)).collect()
}
