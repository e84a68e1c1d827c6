//! The values of a PLY file, one after another, as text or as bytes of either order.

use super::ply_header::{Encoding, Scalar};

/// Where reading stands.
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) encoding: Encoding,
}

/// Why there is no value.
pub(super) enum NoValue {
    /// The file ends.
    End,
    /// What stands there is no number, or not finite.
    Unreadable(String),
}

impl Cursor<'_> {
    /// The next value; every number that PLY knows is one of 64 bits exactly.
    pub(super) fn value(&mut self, scalar: Scalar) -> Result<f64, NoValue> {
        let value = match self.encoding {
            Encoding::Ascii => {
                let word = self.word()?;
                let unreadable = || {
                    let text = String::from_utf8_lossy(word);
                    NoValue::Unreadable(text.chars().filter(|c| !c.is_control()).take(40).collect())
                };
                let text = std::str::from_utf8(word).map_err(|_| unreadable())?;
                text.parse().map_err(|_| unreadable())?
            }
            Encoding::LittleEndian => self.number(scalar, false)?,
            Encoding::BigEndian => self.number(scalar, true)?,
        };
        if value.is_finite() { Ok(value) } else { Err(NoValue::Unreadable(value.to_string())) }
    }

    fn word(&mut self) -> Result<&[u8], NoValue> {
        let start = self.bytes.iter().position(|byte| !byte.is_ascii_whitespace());
        let rest = &self.bytes[start.ok_or(NoValue::End)?..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(length);
        self.bytes = rest;
        Ok(word)
    }

    fn number(&mut self, scalar: Scalar, is_big: bool) -> Result<f64, NoValue> {
        let (taken, rest) = self.bytes.split_at_checked(scalar.size()).ok_or(NoValue::End)?;
        self.bytes = rest;
        let mut word = [0; 8];
        word[..taken.len()].copy_from_slice(taken);
        if is_big {
            word[..taken.len()].reverse();
        }
        let [a, b, c, d, ..] = word;
        Ok(match scalar {
            Scalar::I8 => f64::from(a.cast_signed()),
            Scalar::U8 => f64::from(a),
            Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(word),
        })
    }
}
