//! Photographs as anybody's camera or program writes them: upright, in plain RGB, with the focal length where the file
//! tells it.
//!
//! Transparency is put on black, as most viewers show it; 16 bits become 8, grey three equal channels, CMYK RGB by its
//! decoder. The turn that the camera notes down is applied. Of EXIF (CIPA DC-008, *Exchangeable image file format*) only
//! the tag `FocalLengthIn35mmFilm` is read.

use std::io::Cursor;
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageReader, Limits};

use super::{FileError, MAX_IMAGE_ALLOC, MAX_IMAGE_SIDE, RgbImage, read};

/// Diagonal of 35 mm film, which is what its equivalent focal lengths refer to, millimetres.
const FILM_DIAGONAL: f64 = 43.266_615;
/// Tag of the pointer to the EXIF block.
const EXIF_BLOCK: u16 = 0x8769;
/// Tag `FocalLengthIn35mmFilm`, millimetres.
const FOCAL_35MM: u16 = 0xa405;

/// An upright picture and what its file says of the camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// The pixels.
    pub image: RgbImage,
    /// Focal length as if the film were 35 mm, millimetres, where the file tells it.
    pub focal_35mm: Option<f64>,
}

impl Photo {
    /// The focal length in pixels that the file implies: equal angles along the diagonals.
    pub fn focal_pixels(&self) -> Option<f64> {
        let [width, height] = self.image.size.map(f64::from);
        self.focal_35mm.map(|focal| focal * width.hypot(height) / FILM_DIAGONAL)
    }
}

/// Reads a PNG or JPEG picture within the limits of size.
pub fn read_photo(path: &Path) -> Result<Photo, FileError> {
    decode_photo(path, &read(path)?)
}

/// The same from the bytes of a file; `path` is for messages only.
pub fn decode_photo(path: &Path, bytes: &[u8]) -> Result<Photo, FileError> {
    let failed = |source| FileError::Image { path: path.to_owned(), source };
    let mut decoder = decoder(path, bytes)?;
    // Notes that cannot be read are none; the pixels count.
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let focal_35mm = decoder.exif_metadata().ok().flatten().and_then(|exif| focal_35mm(&exif));
    let mut image = DynamicImage::from_decoder(decoder).map_err(failed)?;
    image.apply_orientation(orientation);
    let image = if image.color().has_alpha() { on_black(&image) } else { image.into_rgb8() };
    let image = RgbImage { size: [image.width(), image.height()], pixels: image.into_raw() };
    Ok(Photo { image, focal_35mm })
}

/// Width and height of a PNG or JPEG picture as it is stored, from the beginning of its bytes.
pub fn photo_size(path: &Path, bytes: &[u8]) -> Result<[u32; 2], FileError> {
    let (width, height) = decoder(path, bytes)?.dimensions();
    Ok([width, height])
}

fn decoder<'a>(path: &Path, bytes: &'a [u8]) -> Result<impl ImageDecoder + 'a, FileError> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let mut reader = reader.map_err(|source| FileError::read(path, source))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_IMAGE_SIDE);
    limits.max_image_height = Some(MAX_IMAGE_SIDE);
    limits.max_alloc = Some(MAX_IMAGE_ALLOC);
    reader.limits(limits);
    reader.into_decoder().map_err(|source| FileError::Image { path: path.to_owned(), source })
}

fn on_black(image: &DynamicImage) -> image::RgbImage {
    let rgba = image.to_rgba8();
    let mut rgb = image::RgbImage::new(rgba.width(), rgba.height());
    for (to, from) in rgb.pixels_mut().zip(rgba.pixels()) {
        let [r, g, b, alpha] = from.0.map(u16::from);
        to.0 = [r, g, b].map(|value| ((value * alpha + 127) / 255) as u8);
    }
    rgb
}

/// The tag's value in a TIFF structure; `None` where it is absent, 0 (which stands for unknown) or the bytes make no
/// sense.
fn focal_35mm(bytes: &[u8]) -> Option<f64> {
    // JPEG's segments begin with a name that other containers leave out.
    let tiff = Tiff::new(bytes.strip_prefix(b"Exif\0\0").unwrap_or(bytes))?;
    let first = tiff.long(4)? as usize;
    let exif = tiff.entry(first, EXIF_BLOCK)?;
    let focal = tiff.entry(tiff.long(exif + 8)? as usize, FOCAL_35MM)?;
    let value = f64::from(tiff.short(focal + 8)?);
    (value > 0.0).then_some(value)
}

/// Numbers of a TIFF structure by offset, in its own order of bytes.
struct Tiff<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl<'a> Tiff<'a> {
    fn new(bytes: &'a [u8]) -> Option<Self> {
        let big_endian = match bytes.get(..2)? {
            b"II" => false,
            b"MM" => true,
            _ => return None,
        };
        Some(Self { bytes, big_endian })
    }

    fn short(&self, at: usize) -> Option<u16> {
        let bytes = self.bytes.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if self.big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn long(&self, at: usize) -> Option<u32> {
        let bytes = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// Where the entry of a tag in a directory starts: tag, type, count, value, 12 bytes in all.
    fn entry(&self, directory: usize, tag: u16) -> Option<usize> {
        let count = usize::from(self.short(directory)?);
        let start = |index: usize| directory + 2 + 12 * index;
        (0..count).map(start).find(|start| self.short(*start) == Some(tag))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write;

    /// A TIFF structure that holds nothing but a focal length.
    fn exif(focal: u16, big_endian: bool) -> Vec<u8> {
        let short = |v: u16| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        let long = |v: u32| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        let mut bytes = if big_endian { b"MM".to_vec() } else { b"II".to_vec() };
        bytes.extend(short(42));
        bytes.extend(long(8));
        // One entry, a pointer to the block behind it (8 + 2 + 12 + 4 = 26).
        bytes.extend(short(1));
        bytes.extend(short(EXIF_BLOCK).into_iter().chain(short(4)));
        bytes.extend(long(1).into_iter().chain(long(26)).chain(long(0)));
        bytes.extend(short(1));
        bytes.extend(short(FOCAL_35MM).into_iter().chain(short(3)));
        bytes.extend(long(1).into_iter().chain(short(focal)).chain(short(0)).chain(long(0)));
        bytes
    }

    fn photo(bytes: &[u8]) -> Result<Photo, FileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.image");
        write(&path, bytes).unwrap();
        read_photo(&path)
    }

    fn png(size: [u32; 2], color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    }

    #[test]
    fn focal_length_is_read_in_both_orders_of_bytes() {
        assert_eq!(focal_35mm(&exif(28, false)), Some(28.0));
        assert_eq!(focal_35mm(&exif(28, true)), Some(28.0));
        assert_eq!(focal_35mm(&[b"Exif\0\0".to_vec(), exif(50, true)].concat()), Some(50.0));
        assert_eq!(focal_35mm(&exif(0, true)), None);
        for length in 0..exif(28, false).len() - 8 {
            assert_eq!(focal_35mm(&exif(28, false)[..length]), None);
        }
        // A pointer beyond any address.
        let mut wild = exif(28, false);
        wild[4..8].fill(255);
        assert_eq!(focal_35mm(&wild), None);
    }

    #[test]
    fn equal_diagonals_see_equal_angles() {
        let image = RgbImage { size: [3600, 2400], pixels: Vec::new() };
        let photo = Photo { image, focal_35mm: Some(50.0) };
        // 3:2, as the film itself: 100 pixels a millimetre.
        assert!((photo.focal_pixels().unwrap() - 5000.0).abs() < 0.1);
    }

    #[test]
    fn transparency_is_put_on_black() {
        let rgba = [200, 100, 50, 255, 200, 100, 50, 0, 200, 100, 50, 51];
        let image = photo(&png([3, 1], png::ColorType::Rgba, png::BitDepth::Eight, &rgba)).unwrap();
        assert_eq!(image.image.pixels, [200, 100, 50, 0, 0, 0, 40, 20, 10]);
        assert_eq!(image.focal_35mm, None);
    }

    #[test]
    fn grey_and_sixteen_bits_become_rgb() {
        let grey =
            photo(&png([2, 1], png::ColorType::Grayscale, png::BitDepth::Eight, &[7, 9])).unwrap();
        assert_eq!(grey.image.pixels, [7, 7, 7, 9, 9, 9]);
        let deep =
            png([1, 1], png::ColorType::Rgb, png::BitDepth::Sixteen, &[255, 255, 128, 0, 0, 0]);
        assert_eq!(photo(&deep).unwrap().image.pixels, [255, 128, 0]);
    }

    /// A red square that Pillow saved: `Image.new("CMYK", (16, 16), (0, 255, 255, 0))`.
    const CMYK: &[u8] = include_bytes!("../../tests/data/cmyk.jpg");

    #[test]
    fn inks_become_rgb() {
        let image = photo(CMYK).unwrap().image;
        let far = |(a, b): (&u8, u8)| a.abs_diff(b) > 3;
        assert_eq!(image.size, [16, 16]);
        let red = [255, 0, 0].into_iter().cycle();
        assert!(!image.pixels.iter().zip(red).any(far), "{:?}", &image.pixels[..3]);
        assert!(photo(&CMYK[..CMYK.len() / 2]).is_err());
    }

    #[test]
    fn what_is_no_picture_or_half_of_one_is_an_error() {
        assert!(photo(b"").is_err());
        assert!(photo(b"GIF89a and so on").is_err());
        let whole = png([8, 8], png::ColorType::Grayscale, png::BitDepth::Eight, &[5; 64]);
        assert!(photo(&whole[..whole.len() / 2]).is_err());
    }

    #[test]
    fn huge_picture_is_refused_by_its_header() {
        // 60,000 x 60,000 grey pixels are announced; nothing of them follows.
        let mut bytes = png([1, 1], png::ColorType::Grayscale, png::BitDepth::Eight, &[0]);
        bytes[16..20].copy_from_slice(&60_000u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&60_000u32.to_be_bytes());
        assert!(photo(&bytes).is_err());
    }
}
