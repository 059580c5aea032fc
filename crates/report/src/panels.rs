//! Panels that pages have in common.

use crate::figure::{Axis, Panel, Series};

/// A panel whose axis shows every value.
pub(crate) fn panel(y_label: &str, height: f64, series: Vec<Series>) -> Panel {
    Panel { y_label: y_label.to_owned(), height, series, bands: Vec::new(), axis: Axis::All }
}

/// The panels that show anything, and the quantities of the others.
pub(crate) fn with_values(panels: Vec<Panel>) -> (Vec<Panel>, Vec<String>) {
    let has_values = |series: &Series| series.points.iter().any(|(_, value)| value.is_finite());
    let (mut kept, mut empty) = (Vec::new(), Vec::new());
    for mut panel in panels {
        panel.series.retain(has_values);
        if panel.series.is_empty() {
            empty.push(panel.y_label.split(" (").next().unwrap_or_default().to_owned());
        } else {
            kept.push(panel);
        }
    }
    (kept, empty)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Stroke;

    #[test]
    fn a_panel_without_a_value_is_left_out_and_named() {
        let curve = |label: &str, value| Series {
            label: label.to_owned(),
            stroke: Stroke::SIGNAL,
            points: vec![(0.0, value), (1.0, value)],
        };
        let panels = vec![
            panel("speed (rpm)", 90.0, vec![curve("engine", f64::NAN), curve("turbine", 1.0)]),
            panel("pedals (0\u{a0}to\u{a0}1)", 70.0, vec![curve("throttle", f64::NAN)]),
            panel("gear", 70.0, Vec::new()),
        ];
        let (kept, empty) = with_values(panels);
        assert_eq!((kept.len(), kept[0].series.len(), kept[0].series[0].label.as_str()), (1, 1, "turbine"));
        assert_eq!(empty, ["pedals", "gear"]);
    }
}
