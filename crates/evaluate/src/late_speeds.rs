//! Speeds that come later than is stated.

/// A delay below this is within what the lag of a toothed wheel may be, s \[chosen\].
const SAID_S: f64 = 0.01;
/// Turbine, output and wheel speed, each with that which it was compared with.
const SPEEDS: [[&str; 2]; 3] =
    [["turbine_speed", "output_speed"], ["output_speed", "turbine_speed"], ["wheel_speed", "output_speed"]];

/// What the filter has found of the delays of turbine, output and wheel speed, s, in words.
pub(crate) fn warnings(late_s: [f64; 3]) -> impl Iterator<Item = String> {
    let late = SPEEDS.into_iter().zip(late_s).filter(|(_, late_s)| *late_s >= SAID_S);
    late.map(|([speed, other], late_s)| {
        format!(
            "warning: {speed} is {:.0} ms later than {other}, beyond what is stated; the estimate takes it so once that is known\nhint: state it from the first row on: `delay_s` of this \
             channel in the channel map, or of its sensor in the file of --sensors",
            1e3 * late_s
        )
    })
}
