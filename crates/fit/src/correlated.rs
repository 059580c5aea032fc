//! Pairs of fitted quantities that the logs hardly tell apart.

use nalgebra::DMatrix;

/// Correlation of the stated errors of two quantities from which on they are named.
const CORRELATED: f64 = 0.8;
/// Pairs that are named: those with the strongest correlation.
const NAMED: usize = 10;

/// The pairs with the strongest correlations, in a sentence; none where all are weak. `name` of a place is none where it is not to be named.
pub(crate) fn statement(covariance: &DMatrix<f64>, name: impl Fn(usize) -> Option<String>) -> Option<String> {
    let of = |i: usize, j: usize| covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
    let names: Vec<(usize, String)> = (0..covariance.nrows()).filter_map(|i| Some((i, name(i)?))).collect();
    let pairs = names.iter().enumerate().flat_map(|(at, one)| names[at + 1..].iter().map(move |other| (one, other)));
    let mut strong: Vec<(&str, &str, f64)> = pairs
        .map(|((i, one), (j, other))| (one.as_str(), other.as_str(), of(*i, *j)))
        .filter(|(.., correlation)| correlation.abs() > CORRELATED)
        .collect();
    strong.sort_by(|one, other| other.2.abs().total_cmp(&one.2.abs()));
    let more = match strong.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!("; and {more} more pairs above {CORRELATED}"),
    };
    let named =
        strong.iter().take(NAMED).map(|(one, other, correlation)| format!("{one} and {other} {correlation:+.2}"));
    let named: Vec<String> = named.collect();
    (!named.is_empty()).then(|| format!("correlated: {}{more}", named.join("; ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_pairs_are_named_and_the_others_counted() {
        let name = |at: usize| Some(format!("q{at}"));
        // Six quantities with one common error: fifteen pairs.
        let common = |size: f64| DMatrix::from_fn(6, 6, |i, j| if i == j { 1.0 + 0.01 * i as f64 } else { size });
        let text = statement(&common(0.9), name).unwrap_or_default();
        assert!(text.starts_with("correlated: q0 and q1 +0.90; "), "{text}");
        assert!(text.ends_with("; and 5 more pairs above 0.8") && text.matches(" and q").count() == 10, "{text}");
        assert_eq!(statement(&common(0.5), name), None);
        let some = statement(&common(-0.9), |at| name(at).filter(|_| at > 3));
        assert_eq!(some.as_deref(), Some("correlated: q4 and q5 -0.86"));
        assert_eq!(statement(&DMatrix::zeros(0, 0), name), None);
    }
}
