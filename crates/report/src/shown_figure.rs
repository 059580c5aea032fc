//! Figures in the units that the user wants.

use std::borrow::Cow;

use trace::shown_units::{Conversion, converted};

use crate::figure::{Axis, Band, Figure, Panel, Series};

impl Figure {
    /// The figure whose axes have the wanted units; itself where they have them.
    pub(crate) fn in_shown_units(&self) -> Cow<'_, Self> {
        let (axis, panels) = (converted(&self.x_label), self.panels.iter().map(|panel| converted(&panel.y_label)));
        let panels: Vec<_> = panels.collect();
        if axis.is_none() && panels.iter().all(Option::is_none) {
            return Cow::Borrowed(self);
        }
        let panels = self.panels.iter().zip(panels).map(|(panel, wanted)| match wanted {
            Some((y_label, conversion)) => {
                panel.converted(y_label, |(x, value)| (x, conversion.value(value)), Some(conversion))
            }
            None => panel.clone(),
        });
        let mut figure = Self { panels: panels.collect(), ..self.clone() };
        if let Some((x_label, conversion)) = axis {
            let (from, to) = self.x_range;
            let along = |(x, value)| (conversion.value(x), value);
            figure.panels =
                figure.panels.iter().map(|panel| panel.converted(panel.y_label.clone(), along, None)).collect();
            figure.x_range = (conversion.value(from), conversion.value(to));
            for span in &mut figure.spans {
                (span.start, span.end) = (conversion.value(span.start), conversion.value(span.end));
            }
            figure.x_label = x_label.into();
        }
        Cow::Owned(figure)
    }
}

impl Panel {
    /// The panel with other points, and with another value axis if its values are `converted`.
    fn converted(
        &self,
        y_label: String,
        point: impl Fn((f64, f64)) -> (f64, f64),
        conversion: Option<Conversion>,
    ) -> Self {
        let points = |points: &[(f64, f64)]| points.iter().copied().map(&point).collect();
        let value = |value: f64| conversion.map_or(value, |conversion| conversion.value(value));
        let series = self.series.iter().map(|series| Series { points: points(&series.points), ..series.clone() });
        let bands = self.bands.iter().map(|band| Band {
            lower: points(&band.lower),
            upper: points(&band.upper),
            ..band.clone()
        });
        let axis = match self.axis {
            Axis::All => Axis::All,
            Axis::Within(low, high) => Axis::Within(value(low), value(high)),
            Axis::Fixed(low, high) => Axis::Fixed(value(low), value(high)),
            Axis::Unmarked(low, high) => Axis::Unmarked(value(low), value(high)),
        };
        Self { y_label, series: series.collect(), bands: bands.collect(), axis, ..self.clone() }
    }
}
