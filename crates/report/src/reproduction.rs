//! The source chapter's experiments on one page, and the same rows as Markdown.

use std::fmt::Write;

use config::Vehicle;
use minijinja::context;
use study::{Chapter, Comparison, Verdict};
use trace::units::mpa;

use crate::map_figures::map_figures;
use crate::page::{PageError, inline, templates};
use crate::shift_figure::{observers_figure, shift_figure};
use crate::tables::{phase_name, quality_rows, score_rows};

/// The page, the Markdown, and the figures.
#[derive(Debug, Clone)]
pub struct Reproduction {
    /// The page; needs nothing but itself.
    pub html: String,
    /// The statements and scores as Markdown.
    pub markdown: String,
    /// The figures by file name, as SVG.
    pub figures: Vec<(String, String)>,
}

impl Reproduction {
    /// The page of the chapter's experiments on this vehicle.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn of(chapter: &Chapter, vehicle: &Vehicle) -> Result<Self, PageError> {
        let mut figures: Vec<(String, String)> = (chapter.experiments.iter())
            .map(|comparison| {
                // E1 and E2 show the whole shift, E3 and E4 their observers.
                let figure = match comparison.experiment.name.as_str() {
                    "E1" | "E2" => shift_figure(comparison),
                    _ => observers_figure(comparison),
                };
                (format!("{}.svg", comparison.experiment.name.to_lowercase()), figure.svg())
            })
            .collect();
        let maps = map_figures(vehicle, &design::rigid_model(vehicle));
        let experiments: Vec<_> = (chapter.experiments.iter().zip(&figures))
            .map(|(comparison, (_, svg))| {
                context! {
                    name => &comparison.experiment.name,
                    title => &comparison.experiment.title,
                    figure => inline(svg),
                    scores => score_rows(comparison),
                    quality => quality_rows(comparison),
                    seed => comparison.experiment.sensors.map(|sensors| sensors.seed),
                    source => comparison.experiment.source.path.display().to_string(),
                    sha256 => comparison.experiment.source.sha256(),
                }
            })
            .collect();
        let html = templates()?.get_template("reproduction.html")?.render(context! {
            name => "E1 to E4",
            title => "The chapter’s experiments",
            version => env!("CARGO_PKG_VERSION"),
            vehicle_name => &vehicle.name,
            vehicle_source => vehicle.source.path.display().to_string(),
            vehicle_sha256 => vehicle.source.sha256(),
            range_mpa => format!("{:.1}", mpa(chapter.experiments[0].experiment.shift.line_pressure_pa)),
            statements => chapter.statements.iter().map(|s| context! {
                experiment => s.experiment,
                claim => s.claim,
                chapter => s.chapter,
                ours => &s.ours,
                verdict => s.verdict.word(),
                because => &s.because,
            }).collect::<Vec<_>>(),
            agreeing => agreeing(chapter),
            experiments => experiments,
            maps => maps.iter().map(|(_, svg)| inline(svg)).collect::<Vec<_>>(),
        })?;
        figures.extend(maps.into_iter().map(|(name, svg)| (name.to_owned(), svg)));
        Ok(Self { html, markdown: markdown(chapter), figures })
    }
}

/// How many of the statements agree, in words.
pub fn agreeing(chapter: &Chapter) -> String {
    let count = chapter.statements.iter().filter(|s| s.verdict == Verdict::Agrees).count();
    format!("{count} of {} statements agree", chapter.statements.len())
}

fn markdown(chapter: &Chapter) -> String {
    let mut text = String::from(
        "<!-- Written by `cargo run --release -- reproduce`; do not edit. -->\n\
         # The chapter's experiments, reproduced\n\n\
         Experiments E1 to E4 of `experiments/` on `vehicles/two_speed_at.toml`, held against H. Chen, B. Gao, *Nonlinear\n\
         Estimation and Control of Automotive Drivetrains*, Springer 2014, chapter 2.\n\n",
    );
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}.\n", agreeing(chapter));
    text.push_str("| experiment | statement | chapter | here | | because |\n|---|---|---|---|---|---|\n");
    for s in &chapter.statements {
        let word = s.verdict.word();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | **{word}** | {} |",
            s.experiment, s.claim, s.chapter, s.ours, s.because
        );
    }
    for comparison in &chapter.experiments {
        scores_markdown(&mut text, comparison);
    }
    text
}

fn scores_markdown(text: &mut String, comparison: &Comparison) {
    let experiment = &comparison.experiment;
    let _ = writeln!(text, "\n## {}: {}\n", experiment.name, experiment.title);
    text.push_str(
        "| phase | observer | peak MPa | RMS MPa | mean MPa | chatter MPa | clutch torque RMS N m | shaft torque RMS N m |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    for phase in 0..comparison.runs.first().map_or(0, |run| run.pressure.len()) {
        for run in comparison.runs.iter().filter(|run| run.pressure[phase].samples > 0) {
            let (pressure, torque) = (&run.pressure[phase], &run.torque[phase]);
            let shaft = run.shaft.as_ref().map_or_else(|| "–".to_owned(), |shaft| format!("{:.0}", shaft[phase].rms));
            let _ = writeln!(
                text,
                "| {} | {} | {:.4} | {:.4} | {:.4} | {:.3} | {:.1} | {shaft} |",
                phase_name(pressure.phase),
                run.entry.name,
                mpa(pressure.peak),
                mpa(pressure.rms),
                mpa(pressure.mean),
                mpa(pressure.chatter),
                torque.rms,
            );
        }
    }
}
