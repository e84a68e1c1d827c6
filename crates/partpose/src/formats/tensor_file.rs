//! Safetensors whose bytes follow from what is in them.
//!
//! The crate `safetensors` writes metadata in a hash map's order, which is another one each time, so that the same
//! detections or weights would be another file each time. Here they stand in the order of their keys.

use std::collections::{BTreeMap, HashMap};

use safetensors::SafeTensorError;
use safetensors::tensor::TensorView;

/// What a file with metadata begins with, after eight bytes that say how long the header is.
const BEGINNING: &[u8] = br#"{"__metadata__":"#;
const LENGTH_BYTES: usize = 8;

/// The bytes of a file with these tensors and this metadata.
///
/// # Errors
///
/// Those of `safetensors`: names that occur twice, a header that is too large.
pub fn safetensors_bytes<'a>(
    tensors: impl IntoIterator<Item = (&'a str, TensorView<'a>)>,
    metadata: &BTreeMap<String, String>,
) -> Result<Vec<u8>, SafeTensorError> {
    let unordered: HashMap<String, String> = metadata.clone().into_iter().collect();
    let mut bytes = safetensors::serialize(tensors, Some(unordered))?;
    // The same entries in another order are as long.
    let ordered = serde_json::to_vec(metadata).unwrap_or_default();
    let begins = bytes.get(LENGTH_BYTES..).is_some_and(|header| header.starts_with(BEGINNING));
    let place = LENGTH_BYTES + BEGINNING.len();
    if let Some(written) = bytes.get_mut(place..place + ordered.len()).filter(|_| begins) {
        written.copy_from_slice(&ordered);
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::{Dtype, SafeTensors};

    #[test]
    fn the_same_content_is_the_same_bytes() {
        let data = 1.5f32.to_le_bytes();
        let entry = |i: usize| (format!("key {i}"), format!("[\"{i} \u{e9}\"]"));
        let metadata: BTreeMap<String, String> = (0..20).map(entry).collect();
        let write = || {
            let view = TensorView::new(Dtype::F32, vec![1], &data).unwrap();
            safetensors_bytes([("value", view)], &metadata).unwrap()
        };
        let bytes = write();
        for _ in 0..5 {
            assert_eq!(write(), bytes);
        }
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let read: BTreeMap<_, _> = header.metadata().clone().unwrap().into_iter().collect();
        assert_eq!(read, metadata);
        assert_eq!(SafeTensors::deserialize(&bytes).unwrap().tensor("value").unwrap().data(), data);
    }
}
