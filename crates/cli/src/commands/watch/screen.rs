//! The picture in the terminal.

use anstream::ColorChoice;
use anstyle::{AnsiColor, Style};
use console::Term;
use trace::printable;

use super::view::{self, CURVES, DRIVELINE, PANELS, PRESSURE, SPEED, Shift, State, TORQUE, Value};

/// Height of the figure, lines: what the terminal has room for within these.
const FIGURE: [usize; 2] = [3, 16];
/// Shifts that are listed.
const SHIFTS: usize = 4;
/// Width of the labels of the figure.
const LABELS: usize = 8;
/// Dots of a character: columns and rows.
const DOTS: [usize; 2] = [2, 4];
/// The first of the 256 characters with dots, and the bits of the dots of a character, row by row.
const NO_DOT: u32 = 0x2800;
const BITS: [[u32; 2]; 4] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];

const OFFGOING: Style = AnsiColor::Yellow.on_default();
const ONCOMING: Style = AnsiColor::Cyan.on_default();
const WARNING: Style = AnsiColor::Red.on_default().bold();
const TITLE: Style = Style::new().bold();

/// The picture, which is drawn over the one before it.
pub(super) struct Screen<'a> {
    terminal: Term,
    title: &'a str,
    page: Option<&'a str>,
    is_coloured: bool,
    /// Lines of the picture before.
    lines: usize,
}

impl<'a> Screen<'a> {
    pub(super) fn new(terminal: Term, title: &'a str, page: Option<&'a str>) -> Self {
        let is_coloured = anstream::AutoStream::choice(&std::io::stdout()) != ColorChoice::Never;
        Self { terminal, title, page, is_coloured, lines: 0 }
    }

    /// The lines of the picture, as many as the terminal has room for.
    pub(super) fn lines(&self, state: &State) -> Vec<String> {
        let (rows, columns) = self.terminal.size_checked().unwrap_or((24, 80));
        // The cursor has a line.
        let height = usize::from(rows).saturating_sub(1).max(1);
        let mut lines = picture(state, (self.title, self.page), ([usize::from(columns), height], self.is_coloured));
        lines.truncate(height);
        lines
    }

    /// Draws these lines. A terminal that cannot be written to gets none.
    pub(super) fn draw(&mut self, lines: &[String]) {
        // In one piece, so that no half of a picture is seen. What is left of the one before is removed.
        let mut text = if self.lines > 1 { format!("\r\x1b[{}A", self.lines - 1) } else { "\r".to_owned() };
        text += &lines.join("\x1b[K\n");
        text += "\x1b[J";
        self.lines = lines.len();
        let _ = self.terminal.write_str(&text).and_then(|()| self.terminal.flush());
    }
}

impl Drop for Screen<'_> {
    fn drop(&mut self) {
        if self.lines > 0 {
            let _ = self.terminal.write_line("");
        }
    }
}

/// Text in a style, where there are colours.
fn styled(text: &str, style: Style, is_coloured: bool) -> String {
    if is_coloured { format!("{style}{text}{style:#}") } else { text.to_owned() }
}

/// The lines of the picture.
fn picture(
    state: &State,
    (title, page): (&str, Option<&str>),
    ([width, height], is_coloured): ([usize; 2], bool),
) -> Vec<String> {
    let style = |text: &str, style: Style| styled(text, style, is_coloured);
    let values = state.values();
    let health = state.word("health");
    let health = match health {
        "" => String::new(),
        "good" => "health good".to_owned(),
        other => format!("health {}", style(&plain(other), WARNING)),
    };
    let rate = match state.rate() {
        None => ", no new rows".to_owned(),
        Some(rate) if rate > 0.0 => format!(", {rate:.0} rows/s"),
        Some(_) => String::new(),
    };
    let time = style(&format!("{:.2} s", state.time_s - state.origin_s), TITLE);
    let mut lines = vec![
        format!("{}{rate}", printable(title)),
        format!("{time}  {}{health}", gear_words(state)),
        of_panel(state, &values, SPEED),
        of_panel(state, &values, DRIVELINE),
        String::new(),
    ];
    lines.extend(clutches(state, &values, is_coloured));
    let elements = state.elements();
    if !elements.is_empty() {
        let decimals = PANELS[PRESSURE].decimals.min(2);
        let all = elements.iter().map(|(name, value)| format!("{name} {}", number(value.value, decimals)));
        lines.push(format!("by the command   {}", all.collect::<Vec<_>>().join("   ")));
    }
    lines.push(String::new());
    let mut below = Vec::new();
    if !state.shifts.is_empty() {
        below.push(String::new());
        below.extend(state.shifts.iter().rev().take(SHIFTS).map(|shift| shift_line(shift, state.origin_s)));
    }
    below.push(match page {
        Some(page) => format!("Ctrl-C ends it   page: {page}"),
        None => "Ctrl-C ends it".to_owned(),
    });
    let [low, high] = FIGURE;
    // Its title has a line.
    let rows = height.saturating_sub(lines.len() + below.len() + 1).clamp(low, high);
    lines.extend(figure(state, [width, rows], is_coloured));
    lines.extend(below);
    // A line that goes on below would be drawn over only in part.
    lines.iter().map(|line| cut(line, width)).collect()
}

fn shift_line(shift: &Shift, origin_s: f64) -> String {
    let Shift { number, gears, begin_s, end_s, health } = shift;
    let time = end_s.map_or("goes on".to_owned(), |end_s| format!("{:.2} s", end_s - begin_s));
    let health = if health.is_empty() { "good".to_owned() } else { health.join(", ") };
    format!("shift {number:<4} {gears:<6} at {:>9.2} s   {time:<8} {}", begin_s - origin_s, plain(&health))
}

/// A word of a table in plain words.
fn plain(word: &str) -> String {
    word.replace('_', " ")
}

/// As much of a line as is no wider; what sets a style takes no room and stays.
fn cut(line: &str, width: usize) -> String {
    let (mut shown, mut is_style) = (0, false);
    let fits = |c: &char| {
        is_style |= *c == '\x1b';
        if is_style {
            is_style = *c != 'm';
            return true;
        }
        shown += 1;
        shown <= width
    };
    line.chars().filter(fits).collect()
}

fn gear_words(state: &State) -> String {
    let [gear, target, phase] = ["gear", "target_gear", "phase"].map(|column| state.word(column));
    let gears = match (gear, target) {
        ("", "") if !state.has("gear") => String::new(),
        ("", "") => "neutral   ".to_owned(),
        (gear, target) if gear == target => format!("gear {gear}   "),
        (gear, "") => format!("gear {gear} to neutral   "),
        ("", target) => format!("neutral to gear {target}   "),
        (gear, target) => format!("gear {gear} to {target}   "),
    };
    let phase = if phase.is_empty() { String::new() } else { format!("{}   ", plain(phase)) };
    gears + &phase
}

fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}") } else { "-".to_owned() }
}

/// The unit of a panel.
fn unit(panel: usize) -> String {
    let label = view::label(panel);
    label.split_once('(').map_or(String::new(), |(_, unit)| unit.trim_end_matches(')').to_owned())
}

/// The latest values of curves of a panel on a line.
fn of_panel(state: &State, values: &[Value], panel: usize) -> String {
    let of = |(curve, value): (&view::Curve, &Value)| {
        (curve.panel == panel && state.has_curve(curve))
            .then(|| format!("{} {:>6}", curve.name, number(value.value, PANELS[panel].decimals)))
    };
    let shown: Vec<String> = CURVES.iter().zip(values).filter_map(of).collect();
    let quantity = if panel == SPEED { "speeds" } else { "torques" };
    format!("{quantity:<8} {}  {}", shown.join("   "), unit(panel))
}

/// The latest pressures and torques of both clutches.
fn clutches(state: &State, values: &[Value], is_coloured: bool) -> Vec<String> {
    let cell = |name: &str, panel: usize| {
        let at = CURVES.iter().position(|curve| curve.panel == panel && curve.name == name);
        let Value { value, range: [low, high] } = at.map(|at| values[at]).filter(|value| value.value.is_finite())?;
        let of = |value| number(value, PANELS[panel].decimals);
        Some(format!("{} ({} to {})", of(value), of(low), of(high)))
    };
    let titles = format!("{:<16} {:<30} {}", "", view::label(PRESSURE), view::label(TORQUE));
    let rows = [("offgoing", OFFGOING), ("oncoming", ONCOMING)].map(|(name, style)| {
        let is_known =
            CURVES.iter().any(|curve| curve.panel == PRESSURE && curve.name == name && state.has_curve(curve));
        is_known.then(|| {
            let [pressure, torque] =
                [PRESSURE, TORQUE].map(|panel| cell(name, panel).unwrap_or_else(|| "-".to_owned()));
            let key = styled(&format!("{name:<9}"), style, is_coloured);
            format!("{key}{:<7} {pressure:<30} {torque}", state.word(name))
        })
    });
    std::iter::once(titles).chain(rows.into_iter().flatten()).collect()
}

/// The pressures of both clutches over the last seconds, in dots.
fn figure(state: &State, [width, rows]: [usize; 2], is_coloured: bool) -> Vec<String> {
    let of = |name: &str| CURVES.iter().position(|curve| curve.panel == PRESSURE && curve.name == name);
    let curves = [("offgoing", OFFGOING), ("oncoming", ONCOMING)];
    let curves: Vec<(usize, Style)> = curves.into_iter().filter_map(|(name, style)| Some((of(name)?, style))).collect();
    let (Some(first), Some(last)) = (state.samples.front(), state.samples.back()) else { return Vec::new() };
    let span_s = (last.time_s - first.time_s).max(1e-9);
    let values = || state.samples.iter().flat_map(|sample| curves.iter().map(|(at, _)| sample.values[*at].value));
    let largest = values().filter(|value| value.is_finite()).fold(0.0, f64::max);
    let columns = width.saturating_sub(LABELS + 3).clamp(10, 200);
    let end = round_above(largest);
    // Which dots of a character are set, and by which curve last.
    let mut dots: Vec<(u32, Option<Style>)> = vec![(0, None); columns * rows];
    for sample in &state.samples {
        let x = ((sample.time_s - first.time_s) / span_s * (columns * DOTS[0] - 1) as f64).round() as usize;
        for (at, style) in &curves {
            let value = sample.values[*at].value;
            if !value.is_finite() {
                continue;
            }
            let height = (rows * DOTS[1] - 1) as f64;
            let y = (height * (1.0 - (value / end).clamp(0.0, 1.0))).round() as usize;
            let (bits, of) = &mut dots[y / DOTS[1] * columns + x / DOTS[0]];
            *bits |= BITS[y % DOTS[1]][x % DOTS[0]];
            *of = Some(*style);
        }
    }
    let decimals = PANELS[PRESSURE].decimals.min(2);
    let line = |row: usize| {
        let label = match row {
            0 => number(end, decimals),
            row if row + 1 == rows => number(0.0, decimals),
            _ => String::new(),
        };
        let cells = dots[row * columns..(row + 1) * columns].iter().map(|(bits, style)| {
            let dots = char::from_u32(NO_DOT + bits).unwrap_or(' ').to_string();
            style.map_or(dots.clone(), |style| styled(&dots, style, is_coloured))
        });
        format!("{label:>LABELS$} |{}", cells.collect::<String>())
    };
    let title = format!(
        "{}, last {span_s:.0} s: {}, {}",
        view::label(PRESSURE),
        styled("offgoing", OFFGOING, is_coloured),
        styled("oncoming", ONCOMING, is_coloured)
    );
    std::iter::once(title).chain((0..rows).map(line)).collect()
}

/// The end of an axis from zero.
fn round_above(largest: f64) -> f64 {
    const ENDS: [f64; 4] = [1.0, 2.0, 5.0, 10.0];
    if !(largest > 0.0 && largest.is_finite()) {
        return 1.0;
    }
    let mut decade = 1.0;
    while decade > largest {
        decade /= 10.0;
    }
    while decade * 10.0 < largest {
        decade *= 10.0;
    }
    ENDS.into_iter().map(|end| end * decade).find(|end| *end >= largest).unwrap_or(largest)
}

#[cfg(test)]
mod tests {
    use wetclutch::estimate::{LiveCell, LiveRows as _};

    use super::super::view::View;
    use super::*;

    #[test]
    fn the_picture_has_what_is_known_within_the_width_of_the_terminal() {
        let view = View::new(10.0);
        let names = [
            "gear",
            "target_gear",
            "health",
            "oncoming",
            "engine_speed_rad_s",
            "oncoming_pressure_estimate_pa",
            "oncoming_pressure_least_pa",
            "oncoming_pressure_greatest_pa",
            "element_b_valve_model_pressure_pa",
        ];
        view.begin(&names);
        for step in 0..300 {
            let word = |word: &str| LiveCell::Word(word.to_owned());
            let pressure_pa = 5e3 * f64::from(step);
            let shifts = ["1", if step > 100 { "2" } else { "1" }, if step > 200 { "reading_refused" } else { "good" }];
            let numbers = [200.0, pressure_pa, 0.9 * pressure_pa, 1.1 * pressure_pa, 1.6e6].map(LiveCell::Number);
            let cells: Vec<LiveCell> = shifts.map(word).into_iter().chain([word("E")]).chain(numbers).collect();
            view.row(0.01 * f64::from(step), &cells);
        }
        let lines = |width: usize, is_coloured: bool| {
            view.with(|state| picture(state, ("a log", Some("http://127.0.0.1:1/")), ([width, 23], is_coloured)))
                .unwrap()
        };
        let plain = lines(90, false);
        let text = plain.join("\n");
        assert_eq!(plain.len(), 23, "{text}");
        for part in [
            "2.99 s  gear 1 to 2   health reading refused",
            "engine  200.0  rad/s",
            "oncoming E       1.495 (1.345 to 1.645)",
            "by the command   B 1.60",
            "    2.00 |",
            "shift 1    1-2    at      1.01 s   goes on  reading refused",
            "page: http://127.0.0.1:1/",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(!text.contains('\x1b') && lines(90, true).join("").contains("\x1b[36m"));
        for width in [0, 5, 20, 40, 90, 300] {
            assert!(lines(width, false).iter().all(|line| line.chars().count() <= width), "{width}");
        }
    }

    #[test]
    fn a_line_is_cut_to_the_width_of_the_terminal_and_keeps_its_styles() {
        assert_eq!(cut("speeds", 80), "speeds");
        assert_eq!(cut("speeds", 3), "spe");
        assert_eq!(cut("\x1b[33moff\x1b[0m and on", 5), "\x1b[33moff\x1b[0m a");
        assert_eq!(cut("", 0), "");
    }

    #[test]
    fn an_axis_ends_at_a_round_number_above() {
        for (largest, end) in
            [(0.0, 1.0), (f64::NAN, 1.0), (0.31, 0.5), (1.0, 1.0), (1.76, 2.0), (16.0, 20.0), (99.0, 100.0)]
        {
            assert!((round_above(largest) - end).abs() < 1e-9, "{largest}: {}", round_above(largest));
        }
    }
}
