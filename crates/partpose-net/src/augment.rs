//! From a sample to an image of a training step: cropped around vehicles, scaled, flipped, in other colours.
//!
//! A flip exchanges the left and right part classes; a network that learns from pixels flipped alone is told that a left
//! door is a right one. Everything random comes from the generator that is handed in.

use image::codecs::jpeg::JpegEncoder;
use partpose::parts::PartClass;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::boxes::{area, clipped};
use crate::config::NetConfig;
use crate::sample::{Sample, SampleVehicle};
use crate::target::{IGNORED_OWNER, NO_OWNER, Target};

/// How images are varied.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AugmentConfig {
    /// Probability of a flip.
    pub flip: f64,
    /// Probability that a crop is laid around a vehicle, not anywhere.
    pub around_vehicle: f64,
    /// Share of a vehicle's box that a crop must hold for the vehicle to be an example.
    pub least_share: f32,
    /// Height of a box below which its vehicle is no example, pixels of the input.
    pub least_height: f32,
    /// Changes of colour.
    pub color: ColorConfig,
}

/// How colours are varied: each value is the most that is added or taken away.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ColorConfig {
    /// Share of the range of values.
    pub brightness: f64,
    /// Logarithm of the factor around the mean.
    pub contrast: f64,
    /// Logarithm of the factor around grey.
    pub saturation: f64,
    /// Turn of the hues, degrees.
    pub hue: f64,
    /// Logarithm of the exponent.
    pub gamma: f64,
    /// Largest deviation of normally distributed noise, grey levels.
    pub noise: f64,
    /// Probability of a blur.
    pub blur: f64,
    /// Probability of a lossy compression.
    pub jpeg: f64,
}

impl Default for AugmentConfig {
    fn default() -> Self {
        Self {
            flip: 0.5,
            around_vehicle: 0.9,
            least_share: 0.3,
            least_height: 12.0,
            color: ColorConfig::default(),
        }
    }
}

impl Default for ColorConfig {
    fn default() -> Self {
        Self {
            brightness: 0.12,
            contrast: 0.25,
            saturation: 0.35,
            hue: 12.0,
            gamma: 0.25,
            noise: 6.0,
            blur: 0.15,
            jpeg: 0.15,
        }
    }
}

impl AugmentConfig {
    /// Flips alone, as the paper.
    pub fn flips_only() -> Self {
        let color = ColorConfig {
            brightness: 0.0,
            contrast: 0.0,
            saturation: 0.0,
            hue: 0.0,
            gamma: 0.0,
            noise: 0.0,
            blur: 0.0,
            jpeg: 0.0,
        };
        Self { color, least_height: 0.0, ..Self::default() }
    }
}

/// An image of a training step.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingImage {
    /// Name of the frame, for messages.
    pub name: String,
    /// `[3, height, width]`, normalised, padded with zeros on the right and below.
    pub values: Vec<f32>,
    /// What it shows.
    pub target: Target,
}

/// What of a sample is seen, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The upper left corner, pixels of the sample.
    pub origin: [f64; 2],
    /// Pixels of the view a pixel of the sample.
    pub scale: f64,
    /// Whether left and right are exchanged.
    pub flip: bool,
    /// Width and height in pixels of the view.
    pub size: [usize; 2],
}

/// Chooses a view of at most `most` pixels, width and height, whose scale lies in `scales`.
pub fn choose_view(
    sample: &Sample,
    most: [usize; 2],
    scales: [f64; 2],
    config: &AugmentConfig,
    rng: &mut ChaCha8Rng,
) -> View {
    let [low, high] = scales.map(f64::ln);
    let mut scale = (low + (high - low) * rng.random::<f64>()).exp();
    let examples: Vec<&SampleVehicle> = sample.vehicles.iter().filter(|v| v.learn).collect();
    let around = rng.random::<f64>() < config.around_vehicle && !examples.is_empty();
    let chosen = around.then(|| examples[rng.random_range(0..examples.len())].corners);
    if let Some([x0, y0, x1, y1]) = chosen {
        // Most of a vehicle that is larger than the view should be in it all the same.
        let fits = [x1 - x0, y1 - y0].map(|side| f64::from(side).max(1.0));
        let fits = (1.1 * most[0] as f64 / fits[0]).min(1.1 * most[1] as f64 / fits[1]);
        // And one that is lower than examples may be is brought nearer, or the view would show none.
        let seen = 1.01 * f64::from(config.least_height) / f64::from(y1 - y0).max(1.0);
        scale = scale.max(seen.min(scales[1])).min(fits.max(scales[0]));
    }
    let image = sample.image.size.map(f64::from);
    let mut origin = [0.0; 2];
    let mut size = [0; 2];
    for i in 0..2 {
        let window = most[i] as f64 / scale;
        let free = (image[i] - window).max(0.0);
        let share = rng.random::<f64>();
        origin[i] = match chosen {
            Some(corners) => {
                let [a, b] = [corners[i], corners[i + 2]].map(f64::from);
                // Anywhere so that the vehicle is inside, or inside the vehicle if that is larger.
                (b - window + share * (window - (b - a))).clamp(0.0, free)
            }
            None => share * free,
        };
        size[i] = (((image[i] - origin[i]) * scale).round() as usize).clamp(1, most[i]);
    }
    View { origin, scale, flip: rng.random::<f64>() < config.flip, size }
}

/// The image of a training step, `padded` pixels wide and high, that a view shows.
pub fn training_image(
    sample: &Sample,
    view: &View,
    padded: [usize; 2],
    (config, net): (&AugmentConfig, &NetConfig),
    rng: &mut ChaCha8Rng,
) -> TrainingImage {
    let mut pixels = resampled(sample, view);
    change_colors(&mut pixels, view.size, &config.color, rng);
    let mut values = vec![0.0; 3 * padded[0] * padded[1]];
    let input = &net.input;
    for (i, rgb) in pixels.chunks_exact(3).enumerate() {
        let at = i / view.size[0] * padded[0] + i % view.size[0];
        for c in 0..3 {
            values[c * padded[0] * padded[1] + at] = (rgb[c] - input.mean[c]) / input.deviation[c];
        }
    }
    TrainingImage { name: sample.name.clone(), values, target: target(sample, view, (config, net)) }
}

/// Which pixels of the sample a place on an axis of the view averages, with their weights: a triangle as wide as what a
/// pixel of the view covers, at least two pixels.
fn taps(view: &View, axis: usize, length: usize) -> Vec<(usize, Vec<f32>)> {
    let radius = (1.0 / view.scale).max(1.0);
    let place = |i: usize| {
        let center = source(view, axis, i) - 0.5;
        let first = (center - radius).ceil().max(0.0) as usize;
        let last = ((center + radius).floor().max(0.0) as usize).min(length - 1);
        let first = first.min(last);
        let weights: Vec<f64> =
            (first..=last).map(|j| (1.0 - (j as f64 - center).abs() / radius).max(1e-6)).collect();
        let sum: f64 = weights.iter().sum();
        (first, weights.into_iter().map(|weight| (weight / sum) as f32).collect())
    };
    (0..view.size[axis]).map(place).collect()
}

/// Where the centre of a pixel of the view lies in the sample.
fn source(view: &View, axis: usize, i: usize) -> f64 {
    let i = if axis == 0 && view.flip { view.size[0] - 1 - i } else { i };
    view.origin[axis] + (i as f64 + 0.5) / view.scale
}

/// Red, green, blue of the view's pixels, 0 to 255.
fn resampled(sample: &Sample, view: &View) -> Vec<f32> {
    let [width, height] = sample.image.size.map(|side| side as usize);
    let [columns, rows] = [taps(view, 0, width), taps(view, 1, height)];
    let top = rows.iter().map(|(first, _)| *first).min().unwrap_or(0);
    let bottom = rows.iter().map(|(first, weights)| first + weights.len()).max().unwrap_or(0);
    let line = 3 * view.size[0];
    let mut across = vec![0.0; line * (bottom - top)];
    for (y, out) in across.chunks_exact_mut(line).enumerate() {
        let row = &sample.image.pixels[3 * width * (top + y)..][..3 * width];
        for (rgb, (first, weights)) in out.chunks_exact_mut(3).zip(&columns) {
            for (pixel, weight) in row[3 * first..].chunks_exact(3).zip(weights) {
                (0..3).for_each(|c| rgb[c] += weight * f32::from(pixel[c]));
            }
        }
    }
    let mut pixels = vec![0.0; line * view.size[1]];
    for (out, (first, weights)) in pixels.chunks_exact_mut(line).zip(&rows) {
        for (row, weight) in across[line * (first - top)..].chunks_exact(line).zip(weights) {
            out.iter_mut().zip(row).for_each(|(out, value)| *out += weight * value);
        }
    }
    pixels
}

/// Least pixels of its own that a vehicle must show to be an example.
const LEAST_PIXELS: usize = 16;

/// Boxes and labels of what a view shows.
fn target(sample: &Sample, view: &View, (config, net): (&AugmentConfig, &NetConfig)) -> Target {
    let swap = swaps(view.flip);
    let [width, height] = sample.image.size.map(|side| side as usize);
    let nearest = |axis: usize, length: usize| -> Vec<usize> {
        let place = |i| (source(view, axis, i).max(0.0) as usize).min(length - 1);
        (0..view.size[axis]).map(place).collect()
    };
    let [columns, rows] = [nearest(0, width), nearest(1, height)];
    let places = || rows.iter().flat_map(|y| columns.iter().map(move |x| y * width + x));
    let labels: Vec<u8> = places().map(|at| swap[usize::from(sample.labels[at])]).collect();
    let mut owner: Vec<u16> = places().map(|at| sample.owners[at]).collect();
    let mut pixels = vec![0; sample.vehicles.len() + 1];
    for owner in &owner {
        pixels[usize::from(*owner)] += 1;
    }
    let mut target = Target { size: view.size, labels, ..Target::default() };
    let mut renamed = vec![NO_OWNER; sample.vehicles.len() + 1];
    for (i, vehicle) in sample.vehicles.iter().enumerate() {
        let whole = in_view(vehicle.corners, view);
        let seen = clipped(whole, view.size);
        let enough = area(seen) >= config.least_share * area(whole)
            && seen[3] - seen[1] >= config.least_height
            && pixels[i + 1] >= LEAST_PIXELS;
        if vehicle.learn && enough {
            target.boxes.push(seen);
            if net.extents {
                target.extents.push(vehicle.extent);
            }
            if !net.models.is_empty() {
                let own = vehicle.model.as_ref();
                target.models.push(own.and_then(|own| net.models.iter().position(|m| m == own)));
            }
            renamed[i + 1] = target.boxes.len() as u16;
        } else {
            renamed[i + 1] = IGNORED_OWNER;
            if area(seen) > 0.0 {
                target.ignore.push(seen);
            }
        }
    }
    let ignored = sample.ignored.iter().map(|corners| clipped(in_view(*corners, view), view.size));
    target.ignore.extend(ignored.filter(|corners| area(*corners) > 0.0));
    for owner in &mut owner {
        *owner = renamed[usize::from(*owner)];
    }
    target.owner = owner;
    target
}

/// What each label becomes.
fn swaps(flip: bool) -> [u8; 256] {
    std::array::from_fn(|id| match PartClass::from_id(id as u8) {
        Some(class) if flip => class.opposite().id(),
        _ => id as u8,
    })
}

fn in_view(corners: [f32; 4], view: &View) -> [f32; 4] {
    let place = |i: usize| (f64::from(corners[i]) - view.origin[i % 2]) * view.scale;
    let [x0, y0, x1, y1] = [0, 1, 2, 3].map(place);
    let width = view.size[0] as f64;
    let [x0, x1] = if view.flip { [width - x1, width - x0] } else { [x0, x1] };
    [x0, y0, x1, y1].map(|value| value as f32)
}

/// Varies colours, adds noise, blurs, compresses.
fn change_colors(
    pixels: &mut Vec<f32>,
    size: [usize; 2],
    config: &ColorConfig,
    rng: &mut ChaCha8Rng,
) {
    let mut either = |most: f64| most * (2.0 * rng.random::<f64>() - 1.0);
    let brightness = 255.0 * either(config.brightness);
    let [contrast, saturation, gamma] =
        [config.contrast, config.saturation, config.gamma].map(|most| either(most).exp());
    let turn = hue_turn(either(config.hue).to_radians(), saturation);
    let count = (pixels.len() / 3).max(1) as f64;
    let mean: f64 = pixels.iter().map(|value| f64::from(*value)).sum::<f64>() / (3.0 * count);
    let shift = (mean * (1.0 - contrast) + brightness) as f32;
    let turn = turn.map(|row| row.map(|value| (value * contrast) as f32));
    // Powers are slow: a table of a quarter of a grey level's step.
    let table: Vec<f32> =
        (0..=1020).map(|i| 255.0 * (f64::from(i) / 1020.0).powf(gamma) as f32).collect();
    for rgb in pixels.chunks_exact_mut(3) {
        let old = [rgb[0], rgb[1], rgb[2]];
        for (value, row) in rgb.iter_mut().zip(&turn) {
            let new = row[0] * old[0] + row[1] * old[1] + row[2] * old[2] + shift;
            *value = table[(4.0 * new.clamp(0.0, 255.0) + 0.5) as usize];
        }
    }
    let chances = [rng.random::<f64>() < config.blur, rng.random::<f64>() < config.jpeg];
    if chances[0] {
        blur(pixels, size, rng.random::<f32>());
    }
    if config.noise > 0.0 {
        let deviation = (config.noise * rng.random::<f64>().powi(2)) as f32;
        add_noise(pixels, deviation, rng);
    }
    if chances[1] {
        compress(pixels, size, rng.random_range(30..95));
    }
}

/// The matrix that turns hues and scales the distance from grey.
fn hue_turn(angle: f64, saturation: f64) -> [[f64; 3]; 3] {
    let (sin, cos) = angle.sin_cos();
    let third = 1.0 / 3.0;
    // A turn about the axis of greys (Rodrigues).
    let along = third * (1.0 - saturation * cos);
    let across = saturation * sin * third.sqrt();
    let diagonal = along + saturation * cos;
    [
        [diagonal, along - across, along + across],
        [along + across, diagonal, along - across],
        [along - across, along + across, diagonal],
    ]
}

/// Mixes each pixel with the mean of its neighbours, `strength` 0 to 1.
fn blur(pixels: &mut Vec<f32>, [width, height]: [usize; 2], strength: f32) {
    let [side, center] = [strength / 3.0, 1.0 - 2.0 * strength / 3.0];
    let mut across = pixels.clone();
    for (out, row) in across.chunks_exact_mut(3 * width).zip(pixels.chunks_exact(3 * width)) {
        for i in 3..(3 * width).saturating_sub(3) {
            out[i] = center * row[i] + side * (row[i - 3] + row[i + 3]);
        }
    }
    pixels.clone_from(&across);
    let line = 3 * width;
    for y in 1..height.saturating_sub(1) {
        for i in y * line..(y + 1) * line {
            pixels[i] = center * across[i] + side * (across[i - line] + across[i + line]);
        }
    }
}

/// Adds noise; four bytes summed are normal enough.
fn add_noise(pixels: &mut [f32], deviation: f32, rng: &mut ChaCha8Rng) {
    // Variance of one of 256 values is (256^2 - 1) / 12.
    let factor = deviation / (4.0 * 65_535.0_f32 / 12.0).sqrt();
    for value in pixels {
        let sum: u32 = rng.random::<u32>().to_le_bytes().into_iter().map(u32::from).sum();
        *value = (*value + factor * (sum as f32 - 510.0)).clamp(0.0, 255.0);
    }
}

/// What a JPEG file of a quality, 1 to 100, keeps.
fn compress(pixels: &mut [f32], [width, height]: [usize; 2], quality: u8) {
    let bytes: Vec<u8> = pixels.iter().map(|value| (value + 0.5) as u8).collect();
    let mut file = Vec::new();
    let color = image::ExtendedColorType::Rgb8;
    let written = JpegEncoder::new_with_quality(&mut file, quality).encode(
        &bytes,
        width as u32,
        height as u32,
        color,
    );
    let read = written.and_then(|()| image::load_from_memory(&file));
    // What cannot be compressed (too small, say) stays as it is.
    if let Ok(image) = read {
        let values = image.into_rgb8();
        pixels.iter_mut().zip(values.as_raw()).for_each(|(out, new)| *out = f32::from(*new));
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use partpose::files::RgbImage;
    use rand::SeedableRng;

    /// A picture with a vehicle whose left half is a left door, whose right half a right one.
    pub(crate) fn sample() -> Sample {
        let size = [60, 40];
        let mut labels = vec![0; 2400];
        let mut owners = vec![0; 2400];
        let mut pixels = vec![90; 7200];
        for y in 10..30 {
            for x in 10..40 {
                let at = y * 60 + x;
                labels[at] = if x < 25 { 11 } else { 12 };
                owners[at] = 1;
                pixels[3 * at] = if x < 25 { 250 } else { 10 };
            }
        }
        let vehicle = SampleVehicle {
            corners: [10.0, 10.0, 40.0, 30.0],
            learn: true,
            model: None,
            extent: [1.8, 1.5, 4.0],
        };
        Sample {
            name: "s".to_owned(),
            image: RgbImage { size, pixels },
            labels,
            owners,
            vehicles: vec![vehicle],
            ignored: Vec::new(),
        }
    }

    fn whole(flip: bool) -> View {
        View { origin: [0.0; 2], scale: 1.0, flip, size: [60, 40] }
    }

    #[test]
    fn a_flip_moves_box_and_pixels_and_exchanges_left_and_right() {
        let config = AugmentConfig::flips_only();
        let straight = target(&sample(), &whole(false), (&config, &NetConfig::default()));
        let flipped = target(&sample(), &whole(true), (&config, &NetConfig::default()));
        assert_eq!(straight.boxes, [[10.0, 10.0, 40.0, 30.0]]);
        assert_eq!(flipped.boxes, [[20.0, 10.0, 50.0, 30.0]]);
        // The left of the flipped vehicle was its right, whose door is now a left one.
        let at = |target: &Target, x: usize| target.labels[20 * 60 + x];
        assert_eq!([at(&straight, 12), at(&straight, 38)], [11, 12]);
        assert_eq!([at(&flipped, 22), at(&flipped, 48)], [11, 12]);
        let [a, b] = [false, true].map(|flip| resampled(&sample(), &whole(flip)));
        assert_eq!(a[3 * (20 * 60 + 12)].to_bits(), b[3 * (20 * 60 + 47)].to_bits());
    }

    #[test]
    fn scaled_views_keep_box_labels_and_picture_together() {
        let view = View { origin: [5.0, 5.0], scale: 2.0, flip: false, size: [100, 60] };
        let target =
            target(&sample(), &view, (&AugmentConfig::flips_only(), &NetConfig::default()));
        assert_eq!(target.boxes, [[10.0, 10.0, 70.0, 50.0]]);
        let inside = |x: usize, y: usize| target.owner[y * 100 + x] == 1;
        assert!(inside(10, 10) && inside(69, 49) && !inside(9, 10) && !inside(70, 49));
        let pixels = resampled(&sample(), &view);
        assert!((pixels[3 * (30 * 100 + 20)] - 250.0).abs() < 1e-3);
        let half = View { origin: [0.0; 2], scale: 0.5, flip: false, size: [30, 20] };
        let pixels = resampled(&sample(), &half);
        assert!((pixels[3 * (10 * 30 + 8)] - 250.0).abs() < 1e-3, "{}", pixels[924]);
    }

    #[test]
    fn what_is_hardly_in_view_is_neither_example_nor_background() {
        let view = View { origin: [36.0, 0.0], scale: 1.0, flip: false, size: [24, 40] };
        let target = target(&sample(), &view, (&AugmentConfig::default(), &NetConfig::default()));
        assert!(target.boxes.is_empty());
        assert_eq!(target.ignore, [[0.0, 10.0, 4.0, 30.0]]);
        assert_eq!(target.owner[20 * 24], IGNORED_OWNER);
    }

    #[test]
    fn chosen_views_show_the_vehicle_and_the_same_seed_the_same_image() {
        let sample = sample();
        let config = AugmentConfig { around_vehicle: 1.0, ..AugmentConfig::default() };
        let net = NetConfig::default();
        for seed in 0..50 {
            let image = |seed| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let view = choose_view(&sample, [32, 32], [0.5, 2.0], &config, &mut rng);
                training_image(&sample, &view, [32, 32], (&config, &net), &mut rng)
            };
            let image = (image(seed), image(seed));
            assert_eq!(image.0, image.1);
            assert!(image.0.values.iter().all(|value| value.is_finite()));
            assert_eq!(image.0.target.boxes.len(), 1, "seed {seed}");
        }
    }

    #[test]
    fn no_change_of_colours_changes_nothing() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut pixels = resampled(&sample(), &whole(false));
        let before = pixels.clone();
        change_colors(&mut pixels, [60, 40], &AugmentConfig::flips_only().color, &mut rng);
        assert!(before.iter().zip(&pixels).all(|(a, b)| (a - b).abs() < 0.2));
    }
}
