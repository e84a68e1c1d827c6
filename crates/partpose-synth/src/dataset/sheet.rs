//! Contact sheets: all variations of a world side by side, once as pictures and once with their part labels.

use std::path::{Path, PathBuf};

use partpose::dataset::Dataset;
use partpose::files::{self, RgbImage};

use super::SynthError;

/// Width of one picture on a sheet, pixels.
const WIDTH: usize = 480;
/// Pictures beside each other.
const COLUMNS: usize = 2;
/// Space between them, pixels.
const GAP: usize = 4;
/// Quality of the files: pictures of noise and leaves are several times larger without loss.
const QUALITY: u8 = 85;

/// Draws the middle frame of every sequence of a data set, by world and variation; gives the two files,
/// `NAME-rgb.jpg` and `NAME-parts.jpg`.
pub fn contact_sheets(dataset: &Path, name: &Path) -> Result<[PathBuf; 2], SynthError> {
    let dataset = Dataset::open(dataset)?;
    let mut pictures = Vec::new();
    let mut labelled = Vec::new();
    for id in dataset.sequences() {
        let frames = dataset.frames(id)?;
        let Some(frame) = frames.get(frames.len() / 2) else { continue };
        let (Some(image), Some(parts)) = (&frame.image, &frame.parts) else { continue };
        let picture = files::read_rgb(image)?;
        let mask = files::read_rgb(parts)?;
        labelled.push(small(&with_parts(&picture, &mask)));
        pictures.push(small(&picture));
    }
    if pictures.is_empty() {
        let path = dataset.root().to_owned();
        return Err(SynthError::NotSynthetic { path, missing: "images with part masks" });
    }
    let stem = name.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let [rgb, parts] =
        ["rgb", "parts"].map(|kind| name.with_file_name(format!("{stem}-{kind}.jpg")));
    files::write(&rgb, &jpeg(&sheet(&pictures)))?;
    files::write(&parts, &jpeg(&sheet(&labelled)))?;
    Ok([rgb, parts])
}

/// The picture in grey with its part labels in colour.
fn with_parts(picture: &RgbImage, mask: &RgbImage) -> RgbImage {
    let mut mixed = picture.clone();
    for (pixel, part) in mixed.pixels.chunks_exact_mut(3).zip(mask.pixels.chunks_exact(3)) {
        let grey = (u32::from(pixel[0]) * 3 + u32::from(pixel[1]) * 6 + u32::from(pixel[2])) / 10;
        let seen = part.iter().any(|value| *value > 0);
        for (value, part) in pixel.iter_mut().zip(part) {
            *value =
                if seen { ((u32::from(*part) * 4 + grey) / 5) as u8 } else { (grey * 2 / 3) as u8 };
        }
    }
    mixed
}

/// The picture scaled to [`WIDTH`], every pixel the mean of those it covers.
fn small(picture: &RgbImage) -> RgbImage {
    let [width, height] = picture.size.map(|side| side as usize);
    let to = [WIDTH, (height * WIDTH / width.max(1)).max(1)];
    let mut pixels = Vec::with_capacity(to[0] * to[1] * 3);
    for y in 0..to[1] {
        for x in 0..to[0] {
            let range = |at: usize, side: usize, to: usize| {
                let from = at * side / to;
                from..((at + 1) * side / to).max(from + 1).min(side)
            };
            let (rows, columns) = (range(y, height, to[1]), range(x, width, to[0]));
            let mut sum = [0_u32; 3];
            let count = (rows.len() * columns.len()).max(1) as u32;
            for row in rows {
                for column in columns.clone() {
                    let at = 3 * (row * width + column);
                    sum.iter_mut()
                        .zip(&picture.pixels[at..at + 3])
                        .for_each(|(sum, value)| *sum += u32::from(*value));
                }
            }
            pixels.extend(sum.map(|sum| (sum / count) as u8));
        }
    }
    RgbImage { size: to.map(|side| side as u32), pixels }
}

fn sheet(pictures: &[RgbImage]) -> RgbImage {
    let height = pictures.iter().map(|picture| picture.size[1] as usize).max().unwrap_or(1);
    let columns = COLUMNS.min(pictures.len()).max(1);
    let rows = pictures.len().div_ceil(columns).max(1);
    let size = [columns * (WIDTH + GAP) - GAP, rows * (height + GAP) - GAP];
    let mut pixels = vec![255_u8; size[0] * size[1] * 3];
    for (i, picture) in pictures.iter().enumerate() {
        let corner = [i % columns * (WIDTH + GAP), i / columns * (height + GAP)];
        for (row, line) in picture.pixels.chunks_exact(3 * WIDTH).enumerate() {
            let at = 3 * ((corner[1] + row) * size[0] + corner[0]);
            pixels[at..at + line.len()].copy_from_slice(line);
        }
    }
    RgbImage { size: size.map(|side| side as u32), pixels }
}

fn jpeg(image: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, QUALITY);
    let [width, height] = image.size;
    // Writing to memory fails for none but sizes beyond 65,535, which no sheet has.
    let written = encoder.encode(&image.pixels, width, height, image::ExtendedColorType::Rgb8);
    debug_assert!(written.is_ok());
    bytes
}
