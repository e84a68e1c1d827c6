//! The header of a PLY file: elements and their properties.
//!
//! Turk: *The PLY Polygon File Format*, Stanford, 1994.

use super::PlyFault;

/// Most lines that a header may have.
const MAX_LINES: usize = 1000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

pub(super) struct Property {
    pub(super) name: String,
    /// Of the number of values in front of them, for a list.
    pub(super) count: Option<Scalar>,
    pub(super) scalar: Scalar,
}

pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    pub(super) fn property(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|property| names.contains(&property.name.as_str()))
    }

    /// The fewest bytes that one element takes in a file.
    pub(super) fn least_size(&self, encoding: Encoding) -> usize {
        let of = |property: &Property| match encoding {
            Encoding::Ascii => 1,
            _ => property.count.unwrap_or(property.scalar).size(),
        };
        self.properties.iter().map(of).sum()
    }
}

pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Where the content begins.
    pub(super) end: usize,
}

pub(super) fn read_header(bytes: &[u8]) -> Result<Header, PlyFault> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut start = 0;
    for number in 1..=MAX_LINES {
        let Some(length) = bytes[start..].iter().position(|byte| *byte == b'\n') else {
            return Err(if number == 1 { PlyFault::Magic } else { PlyFault::NoEnd(MAX_LINES) });
        };
        let text = String::from_utf8_lossy(&bytes[start..start + length]);
        start += length + 1;
        let words: Vec<&str> = text.split_whitespace().collect();
        let unknown = || PlyFault::Header {
            line: number,
            text: text.trim().chars().filter(|c| !c.is_control()).take(60).collect(),
        };
        match words.as_slice() {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return Err(PlyFault::Magic),
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, "1.0"] => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => return Err(unknown()),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| unknown())?;
                elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ["property", rest @ ..] => {
                let (count, scalar, name) = match rest {
                    ["list", count, scalar, name] => (Some(*count), scalar, name),
                    [scalar, name] => (None, scalar, name),
                    _ => return Err(unknown()),
                };
                let count = match count.map(Scalar::from_name) {
                    None => None,
                    Some(Some(Scalar::F32 | Scalar::F64) | None) => return Err(unknown()),
                    Some(count) => count,
                };
                let scalar = Scalar::from_name(scalar).ok_or_else(unknown)?;
                let element = elements.last_mut().ok_or_else(unknown)?;
                element.properties.push(Property { name: (*name).to_owned(), count, scalar });
            }
            ["end_header"] => {
                let encoding = encoding.ok_or(PlyFault::Missing("`format`"))?;
                return Ok(Header { encoding, elements, end: start });
            }
            _ => return Err(unknown()),
        }
    }
    Err(PlyFault::NoEnd(MAX_LINES))
}
