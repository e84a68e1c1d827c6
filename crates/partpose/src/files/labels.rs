//! PNG files whose numbers are labels: palette indices, and 16-bit grey.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use super::{FileError, MAX_IMAGE_SIDE, read};

/// Why a PNG file holds no labels.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LabelImageError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not a PNG file, or a damaged one.
    #[error("cannot decode the image `{path}`")]
    Decode {
        /// The file.
        path: PathBuf,
        /// What the decoder says.
        source: png::DecodingError,
    },
    /// A PNG file of another kind, or one that is too large.
    #[error("`{path}` is {found}, but {expected} is needed")]
    Kind {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
        /// What it should hold.
        expected: &'static str,
    },
}

/// Labels row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels<T> {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// `width * height` numbers.
    pub values: Vec<T>,
}

/// Labels as the bytes of an 8-bit PNG file that shows each in its colour of the palette.
///
/// Each label must be less than the number of colours, of which there are 1 to 256. Rows are not filtered: long runs of
/// one label compress best as they are.
pub fn encode_indexed_png(size: [u32; 2], values: &[u8], palette: &[[u8; 3]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(palette.concat());
    finish(encoder, png::BitDepth::Eight, values);
    bytes
}

/// Labels as the bytes of a 16-bit grey PNG file.
pub fn encode_gray16_png(size: [u32; 2], values: &[u16]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(png::ColorType::Grayscale);
    let values: Vec<u8> = values.iter().flat_map(|value| value.to_be_bytes()).collect();
    finish(encoder, png::BitDepth::Sixteen, &values);
    bytes
}

fn finish(mut encoder: png::Encoder<&mut Vec<u8>>, depth: png::BitDepth, values: &[u8]) {
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_filter(png::Filter::NoFilter);
    let mut writer = encoder.write_header().expect("writing to memory does not fail");
    writer.write_image_data(values).expect("the labels fill the size");
    writer.finish().expect("writing to memory does not fail");
}

/// The indices of an 8-bit PNG file with a palette, or the values of an 8-bit grey one.
pub fn read_indices(path: &Path) -> Result<Labels<u8>, LabelImageError> {
    let (size, values) = decode(path, "an 8-bit image of indices or greys", |color, depth| {
        let single = matches!(color, png::ColorType::Indexed | png::ColorType::Grayscale);
        single && depth == png::BitDepth::Eight
    })?;
    Ok(Labels { size, values })
}

/// The values of a 16-bit grey PNG file.
pub fn read_gray16(path: &Path) -> Result<Labels<u16>, LabelImageError> {
    let (size, bytes) = decode(path, "a 16-bit grey image", |color, depth| {
        color == png::ColorType::Grayscale && depth == png::BitDepth::Sixteen
    })?;
    let values = bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    Ok(Labels { size, values })
}

fn decode(
    path: &Path,
    expected: &'static str,
    fits: fn(png::ColorType, png::BitDepth) -> bool,
) -> Result<([u32; 2], Vec<u8>), LabelImageError> {
    let failed = |source| LabelImageError::Decode { path: path.to_owned(), source };
    let mut decoder = png::Decoder::new(Cursor::new(read(path)?));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info().map_err(failed)?;
    let info = reader.info();
    let size = [info.width, info.height];
    let fits = fits(info.color_type, info.bit_depth);
    let wrong = || LabelImageError::Kind {
        path: path.to_owned(),
        found: format!(
            "{} x {} pixels, {:?}, {:?} bits",
            size[0], size[1], info.color_type, info.bit_depth
        ),
        expected,
    };
    if !fits || size.iter().any(|side| *side > MAX_IMAGE_SIDE) {
        return Err(wrong());
    }
    let Some(length) = reader.output_buffer_size() else { return Err(wrong()) };
    let mut bytes = vec![0; length];
    reader.next_frame(&mut bytes).map_err(failed)?;
    Ok((size, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{read_rgb, write};

    const PALETTE: [[u8; 3]; 3] = [[0, 0, 0], [255, 160, 122], [9, 8, 7]];

    #[test]
    fn indices_come_back_and_are_seen_in_their_colours() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let values = vec![0, 1, 2, 2, 1, 0];
        write(&path, &encode_indexed_png([3, 2], &values, &PALETTE)).unwrap();
        assert_eq!(read_indices(&path).unwrap(), Labels { size: [3, 2], values: values.clone() });
        let seen: Vec<u8> = values.iter().flat_map(|v| PALETTE[usize::from(*v)]).collect();
        assert_eq!(read_rgb(&path).unwrap().pixels, seen);
    }

    #[test]
    fn sixteen_bits_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let values = vec![0, 1, 65_535, 256];
        write(&path, &encode_gray16_png([2, 2], &values)).unwrap();
        assert_eq!(read_gray16(&path).unwrap(), Labels { size: [2, 2], values });
        let error = read_indices(&path).unwrap_err().to_string();
        assert!(error.ends_with("2 x 2 pixels, Grayscale, Sixteen bits, but an 8-bit image of indices or greys is needed"), "{error}");
    }

    #[test]
    fn damaged_images_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let png = encode_indexed_png([300, 200], &vec![1; 60_000], &PALETTE);
        for cut in [0, 8, 40, png.len() / 2] {
            write(&path, &png[..cut]).unwrap();
            let error = read_indices(&path).unwrap_err().to_string();
            assert_eq!(error, format!("cannot decode the image `{}`", path.display()), "{cut}");
        }
    }
}
