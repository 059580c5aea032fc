//! Letters of gears among the numbers of a channel.

/// The number of the gear that a letter in a cell stands for: 0, no gear, of neutral and park, and -1 of reverse.
pub fn number_of_letter(cell: &[u8]) -> Option<f64> {
    match cell.trim_ascii() {
        b"N" | b"P" => Some(0.0),
        b"R" => Some(-1.0),
        _ => None,
    }
}
