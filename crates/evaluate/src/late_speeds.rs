//! Speeds, and an acceleration, that come later than is stated.

/// A delay below this is within what the lag of a toothed wheel may be, s \[chosen\].
const REPORTED_S: f64 = 0.01;
/// Turbine, output and wheel speed.
const SPEEDS: [&str; 3] = ["turbine_speed", "output_speed", "wheel_speed"];

/// What the filter has found of the delays of turbine, output and wheel speed, s, of which these are the longest that it finds, in words.
pub(crate) fn warnings(late_s: [f64; 3], longest_s: [f64; 3]) -> impl Iterator<Item = String> {
    let speeds = SPEEDS.into_iter().zip(late_s.into_iter().zip(longest_s));
    speeds.filter(|(_, (late_s, _))| *late_s >= REPORTED_S).map(|(speed, (late_s, longest_s))| {
        let at_least = if late_s >= longest_s { "at least " } else { "" };
        format!(
            "warning: {speed} comes {at_least}{:.0} ms later than is stated, against the other speeds; the estimate takes it so once that is known\nhint: state it from \
             the first row on: `delay_s` of this channel in the channel map, or of its sensor in the file of --sensors",
            1e3 * late_s
        )
    })
}

/// Standard deviation above which the delay of the acceleration is not known, s \[chosen\].
const UNKNOWN_S: f64 = 0.005;

/// The same of the longitudinal acceleration, with its standard deviation. It is a lower limit: the estimate follows late readings.
pub(crate) fn acceleration_warning(late_s: Option<[f64; 2]>) -> Option<String> {
    let [late_s, _] = late_s.filter(|[late_s, std_dev_s]| *late_s >= REPORTED_S && *std_dev_s <= UNKNOWN_S)?;
    Some(format!(
        "warning: longitudinal_acceleration comes later than is stated, by {:.0} ms or more; the estimate takes it so once that is known\nhint: state it from \
         the first row on: `delay_s` of this channel in the channel map, or of its sensor in the file of --sensors",
        1e3 * late_s
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_delay_is_a_lower_limit() {
        let said: Vec<String> = warnings([0.02, 0.0, 0.031], [0.02, 0.02, 0.05]).collect();
        assert_eq!(said.len(), 2);
        assert!(
            said[0].starts_with("warning: turbine_speed comes at least 20 ms later") && said[1].contains("comes 31 ms")
        );
        assert_eq!(warnings([0.009, 0.0, f64::NAN], [0.02; 3]).count(), 0);
    }

    #[test]
    fn the_delay_of_an_acceleration_is_reported_once_it_is_known() {
        let said = acceleration_warning(Some([0.031, 0.003])).unwrap();
        assert!(said.contains("by 31 ms or more"));
        assert_eq!([Some([0.009, 0.003]), Some([0.04, 0.02]), None].map(acceleration_warning), [None, None, None]);
    }
}
