//! From an image to the network's input: scaled, normalised, padded.

use partpose::files::RgbImage;

use crate::config::InputConfig;
use crate::mask_rcnn::MaskRcnn;

/// An image as the network takes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// `[3, height, width]` of the padded image.
    pub values: Vec<f32>,
    /// Width and height of the scaled image.
    pub size: [usize; 2],
    /// Width and height with padding.
    pub padded: [usize; 2],
}

/// Scales an image by the configuration, normalises it, and pads it on the right and below with the mean.
pub fn prepare(image: &RgbImage, config: &InputConfig) -> Input {
    let size = scaled_size(image.size, config);
    let padded = size.map(|side| side.max(1).next_multiple_of(MaskRcnn::SIDE_STEP));
    let values = scaled(image, (size, padded), (config.mean, config.deviation));
    Input { values, size, padded }
}

/// `[3, height, width]` of an image that is scaled bilinearly to `size`, less `mean`, divided by `deviation`; zero between
/// `size` and `padded`, width and height both.
pub fn scaled(
    image: &RgbImage,
    (size, padded): ([usize; 2], [usize; 2]),
    (mean, deviation): ([f32; 3], [f32; 3]),
) -> Vec<f32> {
    let original = image.size.map(|side| side as usize);
    let mut values = vec![0.0; 3 * padded[0] * padded[1]];
    let axes = [0, 1].map(|i| axis(original[i], size[i]));
    let area = padded[0] * padded[1];
    let [columns, rows] = &axes;
    let offsets = [0, 1, 2].map(|c| (mean[c], 1.0 / deviation[c]));
    let row_of = |y: usize| &image.pixels[3 * y * original[0]..][..3 * original[0]];
    for (y, (top, bottom, down)) in rows.iter().enumerate() {
        let [upper, lower] = [row_of(*top), row_of(*bottom)];
        for (x, (left, right, along)) in columns.iter().enumerate() {
            for (c, (mean, factor)) in offsets.iter().enumerate() {
                let value = |row: &[u8], x: usize| f32::from(row[3 * x + c]);
                let across = |row: &[u8]| {
                    let left = value(row, *left);
                    left + along * (value(row, *right) - left)
                };
                let above = across(upper);
                let value = above + down * (across(lower) - above);
                values[c * area + y * padded[0] + x] = (value - mean) * factor;
            }
        }
    }
    values
}

/// Width and height that an image is scaled to.
pub fn scaled_size(size: [u32; 2], config: &InputConfig) -> [usize; 2] {
    let [shorter, longer] =
        [size[0].min(size[1]).max(1), size[0].max(size[1]).max(1)].map(f64::from);
    let mut scale = 1.0;
    if config.min_side > 0 {
        scale = f64::from(config.min_side) / shorter;
    }
    if config.max_side > 0 {
        scale = f64::min(scale, f64::from(config.max_side) / longer);
    }
    size.map(|side| ((f64::from(side) * scale).round() as usize).max(1))
}

/// For each place on the scaled axis the two it lies between and the share of the second; pixels are areas.
fn axis(from: usize, to: usize) -> Vec<(usize, usize, f32)> {
    let step = from as f64 / to as f64;
    let place = |i: usize| {
        let at = ((i as f64 + 0.5) * step - 0.5).clamp(0.0, from.saturating_sub(1) as f64);
        let low = at as usize;
        (low, (low + 1).min(from.saturating_sub(1)), (at - low as f64) as f32)
    };
    (0..to).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_height_is_600_pixels() {
        let config = crate::NetConfig::paper().input;
        assert_eq!(scaled_size([1242, 375], &config), [1987, 600]);
    }

    #[test]
    fn an_image_that_is_not_scaled_is_only_normalised_and_padded() {
        let image = RgbImage { size: [2, 1], pixels: vec![1, 2, 3, 4, 5, 6] };
        let config =
            InputConfig { mean: [1.0, 0.0, 0.0], deviation: [2.0; 3], ..InputConfig::default() };
        let input = prepare(&image, &config);
        assert_eq!(input.padded, [32, 32]);
        assert_eq!(input.values[..3], [0.0, 1.5, 0.0]);
        assert_eq!(input.values[1024..1026], [1.0, 2.5]);
    }
}
