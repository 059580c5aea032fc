//! Keys that are spelt nearly as others.

/// Whether a key may be another one with one or two letters wrong, missing, too many or in the place of the next one: not where the digits alone
/// differ.
pub(crate) fn is_near(written: &str, key: &str) -> bool {
    const LETTERS: usize = 2;
    let without_digits = |name: &str| name.chars().filter(|c| !c.is_ascii_digit()).collect::<String>();
    let (written_letters, key_letters) = (without_digits(written), without_digits(key));
    written_letters != key_letters && strsim::osa_distance(written, key) <= LETTERS.min(key.chars().count() / 3)
}
