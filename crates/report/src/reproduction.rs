//! The source chapter's experiments on one page, and the same rows as Markdown.

use std::fmt::Write;

use config::{ExperimentFile, Study, VehicleFile};
use minijinja::{Value, context};
use study::statements::{BoundCheck, Case, Figure, Settings, Unit};
use study::{Chapter, Comparison, Statement};
use trace::ShownPath as _;
use trace::units::mpa;

use crate::map_figures::map_figures;
use crate::page::{PageError, render};
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
    pub fn of(
        chapter: &Chapter,
        vehicle: &VehicleFile,
        experiments: &[ExperimentFile; 4],
        study: &Study,
    ) -> Result<Self, PageError> {
        let mut figures: Vec<(String, crate::figure::Figure)> = (chapter.experiments.iter())
            .map(|comparison| {
                // E1 and E2 show the whole shift, E3 and E4 their observers.
                let figure = match comparison.experiment.name.as_str() {
                    "E1" | "E2" => shift_figure(comparison),
                    _ => observers_figure(comparison),
                };
                (format!("{}.svg", comparison.experiment.name.to_lowercase()), figure)
            })
            .collect();
        let maps = map_figures(vehicle, &design::rigid_model(vehicle));
        let experiments: Vec<_> = (chapter.experiments.iter().zip(&figures).zip(experiments))
            .map(|((comparison, (_, figure)), file)| {
                context! {
                    name => &comparison.experiment.name,
                    title => &comparison.experiment.title,
                    figure => figure.html(),
                    scores => score_rows(comparison),
                    quality => comparison.quality.as_ref().map(quality_rows),
                    seed => comparison.experiment.sensors.map(|sensors| sensors.seed),
                    source => file.source.path.shown().to_string(),
                    sha256 => file.source.sha256(),
                }
            })
            .collect();
        let html = render(
            "reproduction.html",
            context! {
                name => "E1 to E4",
                title => "The chapter’s experiments",
                version => env!("CARGO_PKG_VERSION"),
                vehicle_name => &vehicle.name,
                vehicle_source => vehicle.source.path.shown().to_string(),
                vehicle_sha256 => vehicle.source.sha256(),
                range_mpa => format!("{:.1}", mpa(chapter.experiments[0].experiment.shift.line_pressure_pa)),
                statements => groups(chapter).iter().filter(|rows| rows[0].bound.is_none()).map(|rows| statement_view(rows)).collect::<Vec<_>>(),
                offsets => chapter.statements.iter().filter_map(offset_view).map(|view| view.page()).collect::<Vec<_>>(),
                settings => settings_text(&chapter.settings),
                offset_tests => OFFSETS,
                agreeing => agreeing(chapter),
                experiments => experiments,
                study_source => study.source.path.shown().to_string(),
                study_sha256 => study.source.sha256(),
                study_seed => study.seed,
                maps => maps.iter().map(|(_, figure)| figure.html()).collect::<Vec<_>>(),
            },
        )?;
        figures.extend(maps.into_iter().map(|(name, figure)| (name.to_owned(), figure)));
        let figures = figures.into_iter().map(|(name, figure)| (name, figure.svg())).collect();
        Ok(Self { html, markdown: markdown(chapter), figures })
    }
}

/// How many of the statements agree, in words: one line for each reading of the torque-phase gain.
pub fn agreeing(chapter: &Chapter) -> Vec<String> {
    let line = |gain: Case| {
        let (agree, all) = chapter.agreeing(gain);
        format!("{}: {agree} of {all} statements agree", gain.label())
    };
    Case::GAINS.map(line).to_vec()
}

/// The settings that were tried, in words.
fn settings_text(settings: &Settings) -> String {
    let Settings { drawn, whole, no_shift, no_gains, refused } = settings;
    format!(
        "{drawn} settings sampled: {whole} with a whole shift in each experiment, {no_shift} without, {no_gains} without certified \
         gains, {refused} refused"
    )
}

/// Our number of a row, for people.
pub fn ours(row: &Statement) -> String {
    let value = text(row.ours, row.unit);
    if row.unit == Unit::Change {
        return format!("{}: {} {}", row.quantity, value.trim_start_matches('−'), lower_or_higher(row.ours));
    }
    format!("{}: {value}", row.quantity)
}

fn lower_or_higher(change: f64) -> &'static str {
    if change < 0.0 { "lower" } else { "higher" }
}

fn text(value: f64, unit: Unit) -> String {
    if value.is_nan() {
        return "–".to_owned();
    }
    match unit {
        Unit::Pascal => format!("{:.4} MPa", mpa(value)),
        Unit::NewtonMetre => format!("{value:.0} N m"),
        Unit::Second => format!("{:.0} ms", 1e3 * value),
        Unit::Ratio => format!("{value:.2}"),
        Unit::Change => format!("{:.0} %", 100.0 * value).replace('-', "−"),
    }
}

fn figures(figures: &[Figure]) -> String {
    figures.iter().map(|f| format!("{} {}", f.name, text(f.value, f.unit))).collect::<Vec<_>>().join("; ")
}

/// A fraction of the settings, in whole per cent that are 0 and 100 only where it is none and all of them.
fn fraction(fraction: Option<f64>) -> String {
    fraction.map_or_else(String::new, |fraction| {
        let percent = 100.0 * fraction;
        let percent = if fraction > 0.0 && fraction < 1.0 { percent.clamp(1.0, 99.0) } else { percent };
        format!("{percent:.0} %")
    })
}

/// The rows of each statement.
fn groups(chapter: &Chapter) -> Vec<&[Statement]> {
    chapter.statements.chunk_by(|a, b| a.id == b.id).collect()
}

/// A word for a verdict; empty where there is none.
fn agrees(verdict: Option<bool>) -> &'static str {
    verdict.map_or("", |agrees| if agrees { "agrees" } else { "differs" })
}

fn yes(holds: Option<bool>) -> &'static str {
    holds.map_or("", |holds| if holds { "yes" } else { "no" })
}

/// A statement with all its cases, for the page.
fn statement_view(rows: &[Statement]) -> Value {
    let first = &rows[0];
    let case = |row: &Statement| {
        context! {
            label => row.case.map(Case::label),
            ours => ours(row),
            figures => figures(&row.figures),
            agrees => agrees(row.agrees),
            fraction => fraction(row.share_of_settings.and_then(|fractions| fractions.agrees)),
        }
    };
    context! {
        experiment => first.experiment,
        claim => first.claim,
        chapter => first.chapter_says,
        criterion => first.criterion,
        because => &first.because,
        cases => rows.iter().map(case).collect::<Vec<_>>(),
    }
}

/// A tested offset, for page and Markdown.
struct OffsetView {
    experiment: &'static str,
    claim: String,
    chapter: &'static str,
    ours: String,
    agrees: &'static str,
    agrees_share: String,
    tests: [OffsetTest; 3],
}

/// One test of an offset.
struct OffsetTest {
    value: String,
    holds: &'static str,
    fraction: String,
}

impl OffsetView {
    fn page(&self) -> Value {
        let test = |t: &OffsetTest| context! { value => &t.value, holds => t.holds, fraction => &t.fraction };
        context! {
            experiment => self.experiment,
            claim => &self.claim,
            chapter => self.chapter,
            ours => &self.ours,
            agrees => self.agrees,
            agrees_share => &self.agrees_share,
            tests => self.tests.iter().map(test).collect::<Vec<_>>(),
        }
    }
}

fn offset_view(row: &Statement) -> Option<OffsetView> {
    let bound: &BoundCheck = row.bound.as_ref()?;
    let fractions = row.share_of_settings.unwrap_or_default();
    let test = |value, holds, of_settings| OffsetTest { value, holds: yes(holds), fraction: fraction(of_settings) };
    let claim = row.claim.trim_start_matches("Certified offset, ");
    Some(OffsetView {
        experiment: row.experiment,
        claim: row.case.map_or_else(|| claim.to_owned(), |case| format!("{claim}, {}", case.label())),
        chapter: row.chapter_says,
        ours: text(row.ours, row.unit),
        agrees: agrees(row.agrees),
        agrees_share: fraction(fractions.agrees),
        tests: [
            test(text(bound.largest_after_decay_pa, Unit::Pascal), bound.holds, fractions.holds),
            test(
                format!("{:.0} % of it", 100.0 * bound.largest_share_of_bound),
                Some(bound.holds_with_initial_error),
                fractions.holds_with_initial_error,
            ),
            test(text(bound.largest_from_start_pa, Unit::Pascal), Some(bound.holds_at_start), fractions.holds_at_start),
        ],
    })
}

const HEAD: &str = "\
<!-- Written by `cargo run --release -- reproduce`; do not edit. -->
# The chapter's experiments, reproduced

Experiments E1 to E4 of `experiments/` on `vehicles/two_speed_at.toml`, compared with H. Chen, B. Gao, *Nonlinear
Estimation and Control of Automotive Drivetrains*, Springer 2014, chapter 2.

The chapter's plant, its shift controller and some of its parameters are not published, and the available scan of it drops
the digit 1. Statements about the rigid observer are therefore tested with three torque-phase gains: the gain designed
here, and both readings of the chapter's. *Settings* is the fraction of the settings of `experiments/plausible.toml` in which
a row agrees or holds: there every value that is chosen or has more than one reading varies, and the observers are built for the
setting.
";

fn markdown(chapter: &Chapter) -> String {
    let mut text = String::from(HEAD);
    // Writing to a string cannot fail.
    let _ = writeln!(text, "\n{}.\n", settings_text(&chapter.settings));
    for line in agreeing(chapter) {
        let _ = writeln!(text, "- {line}");
    }
    text.push_str(
        "\n## Statements\n\n\
         | | statement | chapter | agrees if | with | this program | | settings |\n|---|---|---|---|---|---|---|---|\n",
    );
    for rows in groups(chapter).iter().filter(|rows| rows[0].bound.is_none()) {
        for (i, row) in rows.iter().enumerate() {
            let once = |text: &'static str| if i == 0 { text } else { "" };
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} ({}) | **{}** | {} |",
                once(row.experiment),
                once(row.claim),
                once(row.chapter_says),
                once(row.criterion),
                row.case.map_or("", Case::label),
                ours(row),
                figures(&row.figures),
                agrees(row.agrees),
                fraction(row.share_of_settings.and_then(|fractions| fractions.agrees)),
            );
        }
    }
    text.push_str("\nWhat else the numbers say:\n\n");
    for row in chapter.statements.iter().filter(|row| !row.because.is_empty()) {
        let _ = writeln!(text, "- {}: {}.", row.claim, row.because);
    }
    offsets_markdown(&mut text, chapter);
    for comparison in &chapter.experiments {
        scores_markdown(&mut text, comparison);
    }
    text
}

/// How the offsets are tested, on the page and in the Markdown.
pub(crate) const OFFSETS: &str = "A certificate bounds the error that remains, Eq. (2.42) and (2.81), for a valve that behaves as its \
    model; delay and lag of the real valve are not included. Each offset is tested in three ways. After decay: the largest error \
    from 4/kappa2 on, the settling time of the certificate, after which 2 % of the initial error remain. With the initial error: the \
    error at all times, as a fraction of the bound (2.40) that contains the initial error. From the start: the largest error of \
    the whole phase, which the theorem does not bound by the offset. With H of Eq. (2.86) the error is that of the chapter’s printed \
    gain, which is within 2 % of the certified one.";

fn offsets_markdown(text: &mut String, chapter: &Chapter) {
    let _ = writeln!(text, "\n## Certified offsets\n\n{OFFSETS}\n");
    text.push_str(
        "| | offset | chapter | certified | | settings | after decay | holds | settings | with the initial error | holds | settings \
         | from the start | holds | settings |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for view in chapter.statements.iter().filter_map(offset_view) {
        let OffsetView { experiment, claim, chapter, ours, agrees, agrees_share, tests } = view;
        let _ = write!(text, "| {experiment} | {claim} | {chapter} | {ours} | **{agrees}** | {agrees_share} |");
        for OffsetTest { value, holds, fraction } in tests {
            let _ = write!(text, " {value} | {holds} | {fraction} |");
        }
        text.push('\n');
    }
    *text = text.replace("| **** |", "| |");
}

fn scores_markdown(text: &mut String, comparison: &Comparison) {
    let experiment = &comparison.experiment;
    let _ = writeln!(text, "\n## {}: {}\n", experiment.name, experiment.title);
    text.push_str(
        "| phase | observer | peak MPa | RMS MPa | mean absolute MPa | chatter MPa | clutch torque RMS N m | shaft torque RMS N m |\n\
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
