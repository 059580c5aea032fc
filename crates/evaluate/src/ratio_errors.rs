//! Gears in which turbine over output speed is not the ratio of the vehicle file.

/// An error below this may be one of sensors that are not stated, as a fraction \[chosen\].
const REPORTED: f64 = 2e-3;

/// What the filter has found of the ratios of these gears, as fractions, in words.
pub(crate) fn warning<'a>(gears: impl Iterator<Item = (&'a str, f64)>) -> Option<String> {
    let off = gears.filter(|(_, error)| error.abs() >= REPORTED);
    let off: Vec<String> = off.map(|(name, error)| format!("{name} ({:+.1} %)", 100.0 * error)).collect();
    (!off.is_empty()).then(|| {
        format!(
            "warning: turbine over output speed is off the ratio of the vehicle file in gear {}; the estimate takes it so once that is known\nhint: correct the \
             ratios of the vehicle file; where all gears are off alike, the scale of turbine_speed or of output_speed in the channel map",
            off.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gears_are_named_with_what_their_ratios_are_off() {
        let said = warning([("1", 0.0051), ("2", 0.0019), ("R", -0.01)].into_iter()).unwrap();
        assert!(said.contains("in gear 1 (+0.5 %), R (-1.0 %);"), "{said}");
        assert_eq!(warning([("1", -1.9e-3)].into_iter()), None);
        assert_eq!(warning(std::iter::empty()), None);
    }
}
