//! The vertices of a PLY file, text or binary; faces and all else are passed over.
//!
//! Turk: *The PLY Polygon File Format*, 1994. Vertices must come before elements with lists, as they do everywhere.

use std::path::Path;

use crate::eval::input::{InputError, number, shown};
use crate::geometry::Point3;

/// Most vertices that are read.
const MAX_VERTICES: usize = 10_000_000;
/// Largest coordinate, millimetres.
const ABSURD: f64 = 1e9;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Text,
    Little,
    Big,
}

#[derive(Clone, Copy)]
enum Kind {
    Whole { bytes: usize, signed: bool },
    Float,
    Double,
}

impl Kind {
    fn of(name: &str) -> Option<Self> {
        let whole = |bytes, signed| Some(Self::Whole { bytes, signed });
        match name {
            "char" | "int8" => whole(1, true),
            "uchar" | "uint8" => whole(1, false),
            "short" | "int16" => whole(2, true),
            "ushort" | "uint16" => whole(2, false),
            "int" | "int32" => whole(4, true),
            "uint" | "uint32" => whole(4, false),
            "float" | "float32" => Some(Self::Float),
            "double" | "float64" => Some(Self::Double),
            _ => None,
        }
    }

    fn size(self) -> usize {
        match self {
            Self::Whole { bytes, .. } => bytes,
            Self::Float => 4,
            Self::Double => 8,
        }
    }

    /// The value of as many bytes as its size.
    fn value(self, bytes: &[u8], format: Format) -> f64 {
        let mut little = [0; 8];
        for (i, byte) in bytes.iter().enumerate() {
            let at = if format == Format::Big { bytes.len() - 1 - i } else { i };
            little[at] = *byte;
        }
        let bits = u64::from_le_bytes(little);
        match self {
            Self::Whole { bytes, signed } => {
                let unused = 64 - 8 * bytes as u32;
                if signed { ((bits << unused) as i64 >> unused) as f64 } else { bits as f64 }
            }
            Self::Float => f64::from(f32::from_bits(bits as u32)),
            Self::Double => f64::from_bits(bits),
        }
    }
}

/// What the header says.
struct Header {
    format: Format,
    /// Bytes of the header.
    length: usize,
    /// Lines of the header.
    lines: usize,
    /// Elements before the vertices and their number of values.
    before: Vec<(usize, Vec<Kind>)>,
    vertices: usize,
    properties: Vec<(String, Kind)>,
}

/// Reads the vertices; `path` is for messages only.
pub fn parse_ply_vertices(path: &Path, bytes: &[u8]) -> Result<Vec<Point3>, InputError> {
    let header = header(path, bytes)?;
    let wrong = |reason: String| InputError::content(path, reason);
    let axis = |name: &str| {
        let at = header.properties.iter().position(|(property, _)| property == name);
        at.ok_or_else(|| wrong(format!("has vertices without `{name}`")))
    };
    let axes = [axis("x")?, axis("y")?, axis("z")?];
    if header.vertices == 0 || header.vertices > MAX_VERTICES {
        let count = header.vertices;
        return Err(wrong(format!("has {count} vertices; 1 to {MAX_VERTICES} are read")));
    }
    match header.format {
        Format::Text => text_vertices(path, bytes, &header, axes),
        _ => binary_vertices(path, bytes, &header, axes),
    }
}

fn header(path: &Path, bytes: &[u8]) -> Result<Header, InputError> {
    const LONGEST: usize = 1 << 16;
    let wrong = |line: usize, reason: &str| InputError::line(path, line, reason);
    let end = bytes.len().min(LONGEST);
    let mut header = Header {
        format: Format::Text,
        length: 0,
        lines: 0,
        before: Vec::new(),
        vertices: 0,
        properties: Vec::new(),
    };
    let (mut in_vertices, mut seen_vertices) = (false, false);
    for line in bytes[..end].split_inclusive(|byte| *byte == b'\n') {
        header.length += line.len();
        header.lines += 1;
        let at = header.lines;
        let text = String::from_utf8_lossy(line);
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        if at == 1 && words != ["ply"] {
            return Err(wrong(1, "not a PLY file: it does not begin with `ply`"));
        }
        match words.as_slice() {
            ["format", format, ..] => {
                header.format = match *format {
                    "ascii" => Format::Text,
                    "binary_little_endian" => Format::Little,
                    "binary_big_endian" => Format::Big,
                    _ => return Err(wrong(at, "an unknown format")),
                };
            }
            ["element", name, count] => {
                let count: usize =
                    count.parse().map_err(|_| wrong(at, "an element without a count"))?;
                in_vertices = *name == "vertex";
                if in_vertices {
                    (seen_vertices, header.vertices) = (true, count);
                } else if !seen_vertices {
                    header.before.push((count, Vec::new()));
                }
            }
            ["property", "list", ..] if seen_vertices && !in_vertices => {}
            ["property", "list", ..] => {
                return Err(wrong(at, "a list before or in the vertices, which is not read"));
            }
            ["property", kind, name] => {
                let kind = Kind::of(kind);
                let kind = kind.ok_or_else(|| wrong(at, "a property of an unknown type"))?;
                if in_vertices {
                    header.properties.push(((*name).to_owned(), kind));
                } else if let (false, Some(last)) = (seen_vertices, header.before.last_mut()) {
                    last.1.push(kind);
                }
            }
            ["end_header"] => return Ok(header),
            _ => {}
        }
    }
    Err(InputError::content(path, "has a PLY header without `end_header`"))
}

fn text_vertices(
    path: &Path,
    bytes: &[u8],
    header: &Header,
    axes: [usize; 3],
) -> Result<Vec<Point3>, InputError> {
    let skipped = header.before.iter().fold(0usize, |sum, (count, _)| sum.saturating_add(*count));
    let body = String::from_utf8_lossy(&bytes[header.length..]);
    let mut points = Vec::new();
    for (i, line) in body.lines().enumerate().skip(skipped).take(header.vertices) {
        let wrong = |reason: String| InputError::line(path, header.lines + i + 1, reason);
        let fields: Vec<&str> = line.split_ascii_whitespace().collect();
        if fields.len() < header.properties.len() {
            return Err(wrong(format!("`{}` is not a vertex", shown(line))));
        }
        let mut point = [0.0; 3];
        for (value, axis) in point.iter_mut().zip(axes) {
            *value = number(fields[axis], ABSURD).map_err(wrong)?;
        }
        points.push(Point3::from(point));
    }
    all(path, points, header)
}

fn binary_vertices(
    path: &Path,
    bytes: &[u8],
    header: &Header,
    axes: [usize; 3],
) -> Result<Vec<Point3>, InputError> {
    let width = |kinds: &mut dyn Iterator<Item = Kind>| kinds.map(Kind::size).sum::<usize>();
    let skipped = header.before.iter().fold(0usize, |sum, (count, kinds)| {
        sum.saturating_add(count.saturating_mul(width(&mut kinds.iter().copied())))
    });
    let row = width(&mut header.properties.iter().map(|(_, kind)| *kind));
    let offset = |property: usize| width(&mut header.properties[..property].iter().map(|p| p.1));
    let offsets = axes.map(offset);
    let body = bytes.get(header.length.saturating_add(skipped)..).unwrap_or(&[]);
    let mut points = Vec::new();
    for (i, record) in body.chunks_exact(row.max(1)).take(header.vertices).enumerate() {
        let mut point = [0.0; 3];
        for ((value, axis), offset) in point.iter_mut().zip(axes).zip(offsets) {
            let kind = header.properties[axis].1;
            *value = kind.value(&record[offset..offset + kind.size()], header.format);
            if !(value.abs() <= ABSURD) {
                return Err(InputError::entry(path, format!("vertex {i}"), "is not a point"));
            }
        }
        points.push(Point3::from(point));
    }
    all(path, points, header)
}

fn all(path: &Path, points: Vec<Point3>, header: &Header) -> Result<Vec<Point3>, InputError> {
    if points.len() == header.vertices {
        return Ok(points);
    }
    let reason = format!("ends after {} of {} vertices", points.len(), header.vertices);
    Err(InputError::content(path, reason))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TEXT: &str = "ply\nformat ascii 1.0\ncomment a\nelement vertex 2\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\n\
        end_header\n1 2 3\n4 5 -6\n3 0 1 0\n";

    fn binary(little: bool) -> Vec<u8> {
        let name = if little { "little" } else { "big" };
        let mut bytes = format!(
            "ply\r\nformat binary_{name}_endian 1.0\r\nelement vertex 2\r\nproperty uchar red\r\n\
             property double x\r\nproperty float y\r\nproperty short z\r\nend_header\r\n"
        )
        .into_bytes();
        for (x, y, z) in [(1.0f64, 2.0f32, 3i16), (4.0, 5.0, -6)] {
            bytes.push(9);
            if little {
                bytes.extend(x.to_le_bytes());
                bytes.extend(y.to_le_bytes());
                bytes.extend(z.to_le_bytes());
            } else {
                bytes.extend(x.to_be_bytes());
                bytes.extend(y.to_be_bytes());
                bytes.extend(z.to_be_bytes());
            }
        }
        bytes
    }

    fn parse(bytes: &[u8]) -> Result<Vec<Point3>, InputError> {
        parse_ply_vertices(Path::new("a.ply"), bytes)
    }

    #[test]
    fn text_and_both_binary_orders_hold_the_same() {
        let expected = vec![Point3::new(1.0, 2.0, 3.0), Point3::new(4.0, 5.0, -6.0)];
        for bytes in [TEXT.as_bytes().to_vec(), binary(true), binary(false)] {
            assert_eq!(parse(&bytes).unwrap(), expected);
        }
    }

    #[test]
    fn files_that_are_cut_off_or_forged_are_refused() {
        let cut = binary(true);
        let said = parse(&cut[..cut.len() - 1]).unwrap_err().to_string();
        assert_eq!(said, "`a.ply` ends after 1 of 2 vertices");
        for bad in [
            TEXT.replace("vertex 2", "vertex 4000000000"),
            TEXT.replace("vertex 2", "vertex 2000000"),
            TEXT.replace("float y", "list uchar int y"),
            TEXT.replace("4 5", "4 inf"),
            TEXT.replace("ply\n", "obj\n"),
            TEXT.replace("property float x\n", ""),
            String::new(),
        ] {
            assert!(parse(bad.as_bytes()).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn damaged_files_are_read_or_refused(
            at in 0usize..200, byte in any::<u8>(), cut in 0usize..220, which in 0..3usize,
        ) {
            let mut bytes = [TEXT.as_bytes().to_vec(), binary(true), binary(false)][which].clone();
            let at = at % bytes.len();
            bytes[at] = byte;
            bytes.truncate(cut);
            let _ = parse(&bytes);
        }
    }
}
