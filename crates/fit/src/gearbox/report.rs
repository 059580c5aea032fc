//! What a fit has found, in words.

use drivetrain::{Real, ShiftKind};

use super::command_delay::said_of_commands;
use super::fitting::GearboxFit;
use super::quantities::{DELAY_UNIT_S, KISS_UNIT_PA, Quantity};
use crate::driving::{Balance, DRAG_UNIT_N_M, MIN_DELAY_S, change_of_delay, said_of_delay};
use crate::fill::{FILL_IDENTIFIED_BY, FillFit};
use crate::report::{MEAN_GRADE, cautions, change_of_offset, fill_row, offset_row, said_of_offset};
use crate::verdict::SIDES;
use crate::{BacklashFit, Known, MapChange, Measure, ReportRow, Verdict, WheelFit, correlated};

/// Errors of the torque at the turbine, in their standard deviations, above which the shifts are not those of the model \[chosen\].
const MISFIT: f64 = 2.0;
/// Standard deviations on either side that 99.9 % lie within: 5 % over some 40 quantities.
const SIDES_OF_ALL: f64 = 3.3;

/// What no shift tells, or no fit looks for, and which manoeuvre would identify it.
const NOT_FITTED: &str = "not fitted, and as in the given file: wheel radius, damping of the drive shafts, tyres, hysteresis of the valves and the shapes of all maps. \
     The intervals contain the effect of any hysteresis within the error bounds; a smaller `valve_hysteresis_pa`, where it is known, narrows them";

impl GearboxFit {
    /// The table: each quantity of which a fitted shift can tell something.
    pub fn report(&self) -> Vec<ReportRow> {
        let all = self.quantities.all.iter().enumerate();
        // Zero offsets have rows of their own, wherever they come from.
        all.filter(|(_, quantity)| self.is_seen(**quantity) && !matches!(quantity, Quantity::PressureOffset(_)))
            .map(|(place, quantity)| self.row(place, *quantity))
            .chain(self.offset_rows())
            .chain(self.seen_fills().map(|(name, fill)| fill_row(&format!("{name}: fill volume"), fill)))
            .collect()
    }

    /// Fill volumes of the elements with a stroke that slipped in a fitted shift, with their names.
    fn seen_fills(&self) -> impl Iterator<Item = (&str, &FillFit)> {
        let all = self.quantities.elements.iter().zip(&self.fills).zip(&self.elements_seen);
        all.filter(|(_, seen)| **seen).filter_map(|((name, fill), _)| Some((name.as_str(), fill.as_ref()?)))
    }

    /// The zero offsets of the pressure sensors, with their places.
    fn offsets(&self) -> impl Iterator<Item = (usize, Known)> + '_ {
        (0..self.quantities.elements.len()).filter_map(|at| Some((at, self.zero_offset_pa(at)?)))
    }

    fn offset_rows(&self) -> impl Iterator<Item = ReportRow> + '_ {
        self.offsets().map(|(at, offset)| offset_row(self.quantities.offset_name(at), offset))
    }

    fn row(&self, place: usize, quantity: Quantity) -> ReportRow {
        let by_driving = if quantity == Quantity::EngineDelay { self.channels.late_s()[1] / DELAY_UNIT_S } else { 0.0 };
        let (x, sd) = (self.unknowns[place] + by_driving, self.sd(quantity));
        let half = SIDES * sd;
        let (measure, si): (_, &dyn Fn(f64) -> f64) = match quantity {
            Quantity::Delay(_) | Quantity::InputDelay | Quantity::EngineDelay | Quantity::ReportedDelay => {
                (Measure::Delay, &|x| DELAY_UNIT_S * x)
            }
            Quantity::Kiss(_) => (Measure::Offset, &|x| KISS_UNIT_PA * x),
            Quantity::Drag(_) => (Measure::Torque, &|x| DRAG_UNIT_N_M * x),
            _ => (Measure::Factor, &Real::exp),
        };
        ReportRow {
            name: self.quantities.name(quantity),
            measure,
            value: si(x),
            interval: [si(x - half), si(x + half)],
            fraction: sd / self.quantities.sd_before(place),
            verdict: self.verdict(quantity),
        }
    }

    /// Whether a fitted shift depends on a quantity.
    pub(crate) fn is_seen(&self, quantity: Quantity) -> bool {
        match quantity {
            Quantity::Torque(at) | Quantity::Kiss(at) | Quantity::Lag(at) => self.elements_seen[at],
            Quantity::Delay(at) => self.elements_seen[at],
            Quantity::Gain(at) => self.quantities.measured[at],
            // Of one that is always open or held in these shifts the drag may be identified too.
            Quantity::Drag(at) => self.elements_seen[at] || self.is_identifiable(quantity),
            Quantity::Inertia(at) => self.by_pair[at].iter().any(|count| *count > 0),
            _ => true,
        }
    }

    /// What is to be said besides the table: torque scale, what is not identified, misfit, and which drive would tell more.
    pub fn statements(&self) -> Vec<String> {
        let scale = 100.0 * SIDES * self.torque_scale_sd();
        let beside = |at: usize| {
            let half = 100.0 * SIDES * self.sd_beside_scale(Quantity::Torque(at));
            format!("{} {half:.1} %", self.quantities.elements[at])
        };
        let seen: Vec<String> =
            (0..self.elements_seen.len()).filter(|at| self.elements_seen[*at]).map(beside).collect();
        let mut lines = vec![
            format!(
                "torque scale: not identified by these logs, +- {scale:.1} %. Speeds fix the ratios of all torques and inertias and not their common \
                 factor; it follows from the prior of {} together, and is in every interval",
                self.anchors()
            ),
            format!("apart from that factor, friction x valve gain is known within +- {}", seen.join(", ")),
            self.said_of_gain(),
        ];
        lines.extend(correlated::statement(&self.stated, |at| {
            let quantity = self.quantities.all.get(at).filter(|quantity| self.is_seen(**quantity))?;
            Some(self.quantities.name(*quantity))
        }));
        lines.extend(self.said_of_driving());
        lines.push(BacklashFit::statement(&self.backlash));
        lines.extend(self.said_of_channels());
        lines.extend(WheelFit::statements(&self.wheel, self.channels.output_late_s()));
        lines.extend(self.offsets().filter_map(|(at, offset)| {
            let change = self.change_of_offset(at, offset)?;
            Some(said_of_offset(&format!("the pressure of {}", self.quantities.elements[at]), &change))
        }));
        lines.extend(self.given_is_possible().then(|| {
            "every value of the given vehicle file is within its interval: these logs do not contradict the file"
                .to_owned()
        }));
        lines.extend(self.said_of_kept());
        lines.extend(self.warnings());
        lines.extend(self.proposals());
        lines.push(NOT_FITTED.to_owned());
        lines
    }

    /// What belongs into the channel map: delays and scale of the speeds, the times of the commands, and zero offsets of pressures.
    pub fn map_changes(&self) -> Vec<MapChange> {
        let output = self.channels.output_late_s();
        let engine = self.engine_late_s().or_else(|| self.channels.engine_late_s());
        let mut changes: Vec<MapChange> =
            output.map(|late_s| MapChange::of_delay("output_speed", &late_s)).into_iter().collect();
        changes.extend(engine.and_then(|late_s| change_of_delay("engine_speed", &late_s)));
        changes.extend(self.wheel.iter().flat_map(|wheel| wheel.changes(output)));
        changes.extend(self.commands_late_s().map(|late_s| MapChange::of_commands(&late_s)));
        changes.extend(self.offsets().filter_map(|(at, offset)| self.change_of_offset(at, offset)));
        changes
    }

    fn change_of_offset(&self, at: usize, offset: Known) -> Option<MapChange> {
        let element = self.quantities.elements[at].to_lowercase();
        change_of_offset(&format!("element_{element}_pressure"), offset.value, offset.sd)
    }

    /// What the common factor of all torques comes from.
    fn anchors(&self) -> String {
        let has = |quantity| self.quantities.place(quantity).is_some();
        let mut all =
            vec![if self.quantities.has_converter { "converter" } else { "reported engine torque" }, "friction"];
        all.extend(has(Quantity::ReportedScale).then_some("reported engine torque"));
        all.extend(has(Quantity::Mass).then_some("mass"));
        format!("{} and inertias", all.join(", "))
    }

    /// What driving between shifts says of mass, road load and engine torque, or why it says nothing.
    fn said_of_driving(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let beside = |quantity| 100.0 * SIDES * self.sd_beside_scale(quantity);
        match self.balances.reason(Balance::Car) {
            None => lines.push(format!(
                "mass and road load from {:.0} s in gear with the accelerator pressed: apart from the common factor of all torques, the mass is known within +- \
                 {:.1} %. {MEAN_GRADE}",
                self.driving_s[0],
                beside(Quantity::Mass)
            )),
            Some(reason) => lines.push(format!(
                "mass and road load are not identified by these logs: {reason}. Accelerating and rolling in gear without the brake would identify them"
            )),
        }
        match self.balances.reason(Balance::Engine) {
            None => lines.push(format!(
                "the reported engine torque is used in {:.0} s in gear: its prior scale is within +- {:.1} %, which bounds the common factor of all torques",
                self.driving_s[1],
                100.0 * SIDES * self.sd_before(Quantity::ReportedScale)
            )),
            Some(reason) if self.quantities.has_converter => {
                lines.push(format!("no reported engine torque is used: {reason}"));
            }
            Some(_) => (),
        }
        lines
    }

    fn sd_before(&self, quantity: Quantity) -> f64 {
        self.quantities.place(quantity).map_or(f64::NAN, |place| self.quantities.sd_before(place))
    }

    /// Of which elements friction and gain are identified separately.
    fn said_of_gain(&self) -> String {
        let names = |is_measured: bool| {
            let elements = self.quantities.elements.iter().enumerate();
            let some =
                elements.filter(|(at, _)| self.elements_seen[*at] && self.quantities.measured[*at] == is_measured);
            some.map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ")
        };
        let (measured, others) = (names(true), names(false));
        let mut text = String::new();
        if !measured.is_empty() {
            text += &format!("the measured pressure identifies friction and valve gain separately for {measured}");
        }
        if !others.is_empty() {
            let between = if text.is_empty() { "" } else { "; " };
            text += &format!(
                "{between}friction and valve gain are not identified separately for {others}: the file has their product as friction, and the kiss point is that of the valve's maps. A measured pressure of an element would identify them"
            );
        }
        text
    }

    /// Delays of output and engine speed, for the channel map.
    fn said_of_channels(&self) -> Vec<String> {
        const IDENTIFIED_BY: &str = "shifts in which the engine changes its speed quickly would identify it";
        let mut lines = self.channels.statements();
        let engine = self.engine_late_s();
        lines.extend(engine.map(|late_s| {
            let change = change_of_delay("engine_speed", &late_s);
            said_of_delay("engine_speed", "the turbine speed", &late_s, change.as_ref(), IDENTIFIED_BY)
        }));
        let is_off = engine.is_some_and(|late_s| late_s.is_off_by(MIN_DELAY_S));
        if is_off || self.channels.late_s() != [0.0; 2] {
            lines.push(
                "the fit used these delays of output and engine speed; `estimate` needs them in the channel map"
                    .to_owned(),
            );
        }
        lines
    }

    /// Whether the values of the given file lie in intervals that all hold in 95 %, by Bonferroni; those with the common factor of all
    /// torques also beside it.
    fn given_is_possible(&self) -> bool {
        use Quantity as Q;
        let is_of_signals = |quantity| {
            matches!(
                quantity,
                Q::InputDelay
                    | Q::EngineDelay
                    | Q::PressureScale
                    | Q::PressureOffset(_)
                    | Q::ReportedDelay
                    | Q::ReportedScale
            )
        };
        let is_of_car = |quantity| !matches!(quantity, Q::Drag(_)) && !is_of_signals(quantity);
        let seen = || self.quantities.all.iter().copied().filter(|quantity| self.is_seen(*quantity));
        let mut car = seen().filter(|quantity| is_of_car(*quantity));
        let mut torques = seen().filter(|quantity| quantity.has_torque_scale() && is_of_car(*quantity));
        let scale = self.torque_scale();
        car.all(|quantity| self.unknown(quantity).abs() <= SIDES_OF_ALL * self.sd(quantity))
            && torques
                .all(|quantity| (self.unknown(quantity) - scale).abs() <= SIDES_OF_ALL * self.sd_beside_scale(quantity))
    }

    /// What is said of inertias that stay those of the file.
    fn said_of_kept(&self) -> Option<String> {
        let name = |(pair, x): &(usize, f64)| {
            format!("{} (x {:.2}, not identifiable)", self.quantities.pair_names[*pair], Real::exp(*x))
        };
        let kept: Vec<String> = self.drawn_off.iter().map(name).collect();
        (!kept.is_empty()).then(|| {
            format!(
                "M11 of {} stays as in the given file: these logs do not identify it, and the fitted value is outside the 95 % interval of its prior. Where the turbine changes its speed slowly, the inertia torque is as small as the errors of the clutch torques, such as a hysteresis. A smaller \
                 `valve_hysteresis_pa` in the error bounds, where it is known, or quicker shifts would identify it",
                kept.join(", ")
            )
        })
    }

    fn warnings(&self) -> Vec<String> {
        let mut lines = Vec::new();
        lines.extend(self.commands_late_s().map(|late_s| {
            format!(
                "warning: {}. The values above are those with corrected times of the commands",
                said_of_commands(late_s)
            )
        }));
        if !self.contradicted.is_empty() {
            let names = self.contradicted.iter().filter_map(|place| self.quantities.elements.get(*place));
            lines.push(format!(
                "warning: the measured pressure of {} contradicts its command for every valve within the error bounds: it is not used\nhint: check unit, sign, offset and element of the channel",
                names.map(String::as_str).collect::<Vec<_>>().join(", ")
            ));
        }
        if self.torque_misfit > MISFIT {
            lines.push(format!(
                "warning: the shifts contradict the model: the errors of the torques are {:.1} times those that drag and the converter's maps explain, and the \
                 intervals are too small\nhint: check that the vehicle file is of this car, the shape of its maps, and the signals of the channel map",
                self.torque_misfit
            ));
        }
        if !self.at_limit.is_empty() {
            lines.push(format!(
                "warning: at the limit of the prior (4 standard deviations): {}\nhint: check that the vehicle file is of this car, and the \
                 signals of the channel map; do not use the fitted values before the reason is known",
                self.at_limit.join(", ")
            ));
        }
        lines.extend(self.seen_fills().filter_map(|(name, fill)| fill.misfit(name)));
        lines.extend(cautions(self.is_converged, self.shifts));
        lines
    }

    /// Which drive would tell what these logs do not.
    fn proposals(&self) -> Vec<String> {
        let quantities = &self.quantities;
        let mut lines = Vec::new();
        let without: Vec<&str> = (quantities.elements.iter().zip(&self.elements_seen))
            .filter(|(_, seen)| !**seen)
            .map(|(name, _)| name.as_str())
            .collect();
        if !without.is_empty() {
            lines.push(format!("no fitted shift uses {}: their values are not changed", without.join(", ")));
        }
        let names = |is: &dyn Fn(usize) -> bool| {
            let named =
                quantities.pair_names.iter().enumerate().filter(|(at, _)| is(*at)).map(|(_, name)| name.as_str());
            named.collect::<Vec<_>>()
        };
        let missing = names(&|at| self.by_pair[at].iter().sum::<usize>() == 0);
        if !missing.is_empty() {
            lines.push(format!(
                "to know more: drive shifts between gears {}; none of them is fitted",
                missing.join(", ")
            ));
        }
        let some = |at: usize, kinds: [ShiftKind; 2]| {
            let of_kind = |kind: &ShiftKind| ShiftKind::ALL.iter().position(|other| other == kind);
            kinds.iter().filter_map(of_kind).any(|kind| self.by_pair[at][kind] > 0)
        };
        let is_open = |at: usize| self.verdict(Quantity::Inertia(at)) != Verdict::Measured;
        let one_way = names(&|at| {
            let (on, off) = (
                some(at, [ShiftKind::PowerOnUp, ShiftKind::PowerOnDown]),
                some(at, [ShiftKind::PowerOffUp, ShiftKind::CoastDown]),
            );
            on != off && is_open(at)
        });
        if !one_way.is_empty() {
            lines.push(format!(
                "to know more: to separate inertia and friction, shifts with the accelerator pressed and released between {}: these logs have only one of the two",
                one_way.join(", ")
            ));
        }
        let of_element = |quantity: fn(usize) -> Quantity| {
            let is_open = |at: usize| {
                quantities.place(quantity(at)).is_some() && self.verdict(quantity(at)) == Verdict::NotIdentifiable
            };
            let open = (0..quantities.elements.len()).filter(|at| self.elements_seen[*at] && is_open(*at));
            open.map(|at| quantities.elements[at].as_str()).collect::<Vec<_>>().join(", ")
        };
        let kiss = of_element(Quantity::Kiss);
        if !kiss.is_empty() {
            lines.push(format!(
                "to know more: for the kiss point of {kiss}, shifts at light throttle and coasting in which it slips"
            ));
        }
        let torque = of_element(Quantity::Torque);
        let open = self.seen_fills().filter(|(_, fill)| fill.verdict() == Verdict::NotIdentifiable);
        let fill = open.map(|(name, _)| name).collect::<Vec<_>>().join(", ");
        if !fill.is_empty() {
            lines.push(format!(
                "to know more: for the fill volume of {fill}, which is not identified by these logs, {FILL_IDENTIFIED_BY}"
            ));
        }
        if !torque.is_empty() {
            lines.push(format!("to know more: for the friction of {torque}, shifts at high throttle in which it drives the change of speed"));
        }
        lines
    }
}
