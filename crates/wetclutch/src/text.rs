//! Numbers and paths in sentences.

use std::path::Path;

use trace::ShownPath as _;

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

/// A path as a shell takes it.
pub fn shell_quoted(path: &Path) -> String {
    let path = path.shown().to_string();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    // A path that begins with a dash would be read as an option.
    let path = if path.starts_with('-') { format!("./{path}") } else { path };
    if path.chars().all(is_plain) { path } else { format!("'{}'", path.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_separated_by_commas() {
        assert_eq!([7, 950, 9501, 60_000_000].map(grouped), ["7", "950", "9,501", "60,000,000"]);
    }
}
