//! A square matrix with more rows than serde knows of arrays.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_big_array::{Array, BigArray};

pub(super) fn serialize<S: Serializer, T: Serialize, const N: usize>(
    rows: &[[T; N]; N],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    BigArray::serialize(&rows.each_ref().map(|row| Array(row.each_ref())), serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    deserializer: D,
) -> Result<[[T; N]; N], D::Error> {
    let rows: [Array<T, N>; N] = BigArray::deserialize(deserializer)?;
    Ok(rows.map(|Array(row)| row))
}
