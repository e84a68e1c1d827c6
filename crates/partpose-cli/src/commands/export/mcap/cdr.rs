//! ROS 2's encoding of messages: OMG's CDR (DDSI-RTPS, `PLAIN_CDR`), little-endian.
//!
//! Values are aligned to their own size, counted from the end of the four bytes that name the encoding; texts end in a
//! zero byte that their length counts.

/// A message that is being written.
pub(super) struct Message {
    bytes: Vec<u8>,
}

/// Bytes that name the encoding.
const HEAD: [u8; 4] = [0, 1, 0, 0];

impl Message {
    pub(super) fn new() -> Self {
        Self { bytes: HEAD.to_vec() }
    }

    pub(super) fn finish(self) -> Vec<u8> {
        self.bytes
    }

    fn aligned(&mut self, bytes: &[u8]) {
        while !(self.bytes.len() - HEAD.len()).is_multiple_of(bytes.len()) {
            self.bytes.push(0);
        }
        self.bytes.extend_from_slice(bytes);
    }

    pub(super) fn bool(&mut self, value: bool) {
        self.bytes.push(u8::from(value));
    }

    pub(super) fn i32(&mut self, value: i32) {
        self.aligned(&value.to_le_bytes());
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.aligned(&value.to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.aligned(&value.to_le_bytes());
    }

    /// Numbers one after the other, as those of a fixed count.
    pub(super) fn numbers(&mut self, values: &[f64]) {
        for value in values {
            self.f64(*value);
        }
    }

    /// How many elements a sequence has.
    pub(super) fn count(&mut self, count: usize) {
        self.u32(count as u32);
    }

    pub(super) fn text(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.bytes.extend_from_slice(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_aligned_from_the_end_of_the_head() {
        let mut message = Message::new();
        message.text("ab");
        message.f64(1.0);
        message.bool(true);
        message.u32(7);
        let expected: Vec<u8> = [
            &HEAD[..],
            &[3, 0, 0, 0],
            b"ab\0",
            &[0],
            &1f64.to_le_bytes(),
            &[1, 0, 0, 0],
            &[7, 0, 0, 0],
        ]
        .concat();
        assert_eq!(message.finish(), expected);
    }
}
