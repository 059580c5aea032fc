//! Numbers in sentences.

/// A count with commas between the thousands: 60,000,000.
pub fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut grouped = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_separated_by_commas() {
        assert_eq!([7, 950, 9501, 60_000_000].map(grouped), ["7", "950", "9,501", "60,000,000"]);
    }
}
