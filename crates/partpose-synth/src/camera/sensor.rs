//! Exposure, noise, tone curve and file.

use std::io::Cursor;
use std::sync::LazyLock;

use image::codecs::jpeg::JpegEncoder;
use image::{ImageFormat, RgbImage};
use rayon::prelude::*;

use crate::shading::noise::mix;

use super::{CameraEffects, Frame};

/// Linear value that the picture's middle is brought to.
const KEY: f32 = 0.17;
/// Steps of the tone curve's table, over the square root of the value up to [`TABLE_END`].
const TABLE: usize = 4096;
const TABLE_END: f32 = 4.0;

/// Factors per channel from exposure and white balance.
pub(super) fn meter(
    [width, height]: [usize; 2],
    pixels: &[[f32; 3]],
    effects: &CameraEffects,
) -> [f32; 3] {
    let mut logs = [0.0_f64; 3];
    let mut count = 0.0_f64;
    // Every fourth pixel of every fourth row; the upper third is sky more often than not and counts less.
    for y in (0..height).step_by(4) {
        let weight = if y < height / 3 { 0.35 } else { 1.0 };
        for x in (0..width).step_by(4) {
            let pixel = pixels[y * width + x];
            for (sum, value) in logs.iter_mut().zip(pixel) {
                *sum += weight * f64::from(value.clamp(1e-3, 4.0)).ln();
            }
            count += weight;
        }
    }
    if count == 0.0 {
        return [1.0; 3];
    }
    let means = logs.map(|sum| (sum / count).exp() as f32);
    let level = 0.30 * means[0] + 0.59 * means[1] + 0.11 * means[2];
    let gain = KEY / level.max(1e-4) * effects.exposure.exp2();
    let shift = [1.0 + effects.warmth + effects.tint, 1.0 - effects.tint, 1.0 - effects.warmth];
    let mut gains = [0.0; 3];
    for i in 0..3 {
        // Half of what the mean differs from grey is the light's colour, half the world's.
        let neutral = (level / means[i].max(1e-4)).powf(0.5 * effects.white_balance);
        gains[i] = gain * neutral * shift[i].max(0.1);
    }
    gains
}

/// Noise, curve and rounding.
pub(super) fn develop(frame: &mut Frame, effects: &CameraEffects, seed: u64) -> RgbImage {
    let [width, height] = frame.size;
    let table = curve(effects);
    let noise = effects.noise;
    // Photon noise grows with the root of the light, what the electronics add does not; both equal at KEY.
    let [shot, read] = [noise * noise * 0.7 / KEY, noise * noise * 0.3 * 0.3];
    let seed = mix(seed as u32 ^ mix((seed >> 32) as u32));
    let mut bytes = vec![0_u8; width * height * 3];
    let rows =
        bytes.par_chunks_mut((3 * width).max(1)).zip(frame.pixels.par_chunks_mut(width.max(1)));
    rows.enumerate().for_each(|(y, (bytes, pixels))| {
        if noise > 0.0 {
            let start = mix(seed ^ (y as u32).wrapping_mul(0x9e37_79b1)) as usize % NORMALS.len();
            let mut normals = &NORMALS[start..];
            let mut values = pixels.as_flattened_mut();
            while !values.is_empty() {
                let (here, rest) = values.split_at_mut(values.len().min(normals.len()));
                for (value, normal) in here.iter_mut().zip(normals) {
                    *value += (shot * value.max(0.0) + read).sqrt() * normal;
                }
                (values, normals) = (rest, &NORMALS);
            }
        }
        // Places in the table first, which many at a time can be computed of.
        for value in pixels.as_flattened_mut() {
            let at = (value.clamp(0.0, TABLE_END) * (1.0 / TABLE_END)).sqrt();
            *value = at * (TABLE as f32 - 1.0);
        }
        for (bytes, pixel) in bytes.chunks_exact_mut(3).zip(pixels.iter()) {
            let developed = pixel.map(|place| table[place as usize]);
            let grey = 0.30 * developed[0] + 0.59 * developed[1] + 0.11 * developed[2];
            for (byte, value) in bytes.iter_mut().zip(developed) {
                let value = grey + effects.saturation * (value - grey);
                *byte = (255.0 * value + 0.5).clamp(0.0, 255.0) as u8;
            }
        }
    });
    if effects.sharpening > 0.0 {
        bytes = sharpened(&bytes, frame.size, effects.sharpening);
    }
    RgbImage::from_raw(width as u32, height as u32, bytes).unwrap_or_default()
}

/// Nearly normal numbers with mean 0 and variance 1, sums of four bytes: each row of a picture begins somewhere in them.
static NORMALS: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let normal = |i: u32| {
        let bytes = mix(i ^ 0x6e01_5e00).to_le_bytes();
        let sum: u32 = bytes.iter().map(|byte| u32::from(*byte)).sum();
        // Four even numbers of variance (256² - 1) / 12.
        (sum as f32 - 510.0) * (1.0 / 147.8)
    };
    (0..1 << 16).map(normal).collect()
});

fn curve(effects: &CameraEffects) -> Vec<f32> {
    let step = |i: usize| {
        let root = (i as f32 + 0.5) / (TABLE as f32 - 1.0);
        let value = (root * root * TABLE_END - effects.black).max(0.0);
        let film = 1.0 - (-value * 1.15).exp();
        let linear = value.min(1.0);
        let value = linear + effects.shoulder * (film - linear);
        let coded = if value <= 0.003_130_8 {
            12.92 * value
        } else {
            1.055 * value.powf(1.0 / 2.4) - 0.055
        };
        let s = coded * coded * (3.0 - 2.0 * coded);
        (coded + effects.contrast * (s - coded)).max(0.0)
    };
    (0..TABLE).map(step).collect()
}

/// Adds a share of the difference from the mean of the neighbours.
fn sharpened(bytes: &[u8], [width, height]: [usize; 2], share: f32) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let stride = 3 * width;
    out.par_chunks_mut(stride.max(1)).enumerate().for_each(|(y, row)| {
        if y == 0 || y + 1 >= height {
            return;
        }
        let [above, here, below] = [y - 1, y, y + 1].map(|y| &bytes[y * stride..(y + 1) * stride]);
        let inner = 3..stride.saturating_sub(3).max(3);
        let beside = here.iter().zip(here.iter().skip(6));
        let middle =
            above[inner.clone()].iter().zip(&below[inner.clone()]).zip(&here[inner.clone()]);
        for ((value, (left, right)), ((above, below), here)) in
            row[inner].iter_mut().zip(beside).zip(middle)
        {
            let around = [left, right, above, below].map(|value| u16::from(*value));
            let mean = f32::from(around.iter().sum::<u16>()) * 0.25;
            let here = f32::from(*here);
            *value = (here + share * (here - mean) + 0.5).clamp(0.0, 255.0) as u8;
        }
    });
    out
}

/// What is left of a picture that was stored as JPEG.
pub(super) fn through_jpeg(image: &RgbImage, quality: u8) -> Option<RgbImage> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(image).ok()?;
    let mut reader = image::ImageReader::new(Cursor::new(bytes));
    reader.set_format(ImageFormat::Jpeg);
    Some(reader.decode().ok()?.into_rgb8())
}
