//! Falling rain, and drops on the glass before the lens.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Frame;
use super::lens::between;

/// Bright, thin, nearly upright streaks; near ones are long and faint.
pub(super) fn add_streaks(frame: &mut Frame, rain: f32, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let [width, height] = frame.size;
    let area = (width * height) as f32 / (1242.0 * 375.0);
    let count = (900.0 * rain * area) as usize;
    let wind: f32 = rng.random_range(-0.25..0.25);
    let mean = mean(frame);
    for _ in 0..count {
        let [x, y] = [rng.random_range(0.0..width as f32), rng.random_range(-40.0..height as f32)];
        let nearness: f32 = rng.random::<f32>().powi(2);
        let length = 6.0 + 46.0 * nearness;
        let alpha = (0.10 + 0.25 * rng.random::<f32>()) * (1.0 - 0.6 * nearness);
        let thick = 0.6 + 1.3 * nearness;
        for step in 0..length as usize {
            let at = [x + wind * step as f32, y + step as f32];
            let end = (step as f32 / length - 0.5).abs() * 2.0;
            blend(frame, at, thick, alpha * (1.0 - end * end), mean);
        }
    }
}

fn mean(frame: &Frame) -> [f32; 3] {
    let mut sum = [0.0_f32; 3];
    let mut count = 0.0;
    for pixel in frame.pixels.iter().step_by(97) {
        for (sum, value) in sum.iter_mut().zip(pixel) {
            *sum += value.min(1.5);
        }
        count += 1.0;
    }
    // A drop shows the bright sky upside down.
    sum.map(|v| 1.5 * v / f32::max(count, 1.0))
}

fn blend(frame: &mut Frame, [x, y]: [f32; 2], thick: f32, alpha: f32, color: [f32; 3]) {
    let [width, height] = frame.size;
    if !(y >= 0.0) || y >= height as f32 {
        return;
    }
    let row = y as usize * width;
    for i in (x - thick).floor() as i64..=(x + thick).ceil() as i64 {
        if i < 0 || i >= width as i64 {
            continue;
        }
        let cover = (0.5 * thick + 0.5 - (i as f32 + 0.5 - x).abs()).clamp(0.0, 1.0) * alpha;
        let pixel = &mut frame.pixels[row + i as usize];
        for (value, other) in pixel.iter_mut().zip(color) {
            *value += cover * (other - *value);
        }
    }
}

/// Round lenses of water that show the picture turned over and out of focus.
pub(super) fn add_drops(frame: &mut Frame, count: u32, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let [width, height] = frame.size;
    frame.old.clone_from(&frame.pixels);
    let scale = width as f32 / 1242.0;
    for _ in 0..count {
        let center = [rng.random_range(0.0..width as f32), rng.random_range(0.0..height as f32)];
        let radius = scale * (3.0 + 16.0 * rng.random::<f32>().powi(3));
        let stretch = rng.random_range(1.0..1.35_f32);
        let [left, right] = [center[0] - radius, center[0] + radius];
        let [top, bottom] = [center[1] - radius * stretch, center[1] + radius * stretch];
        for y in top.max(0.0) as usize..(bottom.max(0.0) as usize + 1).min(height) {
            for x in left.max(0.0) as usize..(right.max(0.0) as usize + 1).min(width) {
                let u = (x as f32 - center[0]) / radius;
                let v = (y as f32 - center[1]) / (radius * stretch);
                let r = u.hypot(v);
                if r >= 1.0 {
                    continue;
                }
                let edge = ((1.0 - r) * 2.2).min(1.0);
                // Further out the drop bends light more.
                let reach = 5.0 + 22.0 * r * r;
                let at = [center[0] - u * radius * reach, center[1] - v * radius * reach];
                let blur = 0.6 * radius;
                let around = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
                let around = around.map(|[a, b]: [f32; 2]| {
                    between(&frame.old, frame.size, [at[0] + a * blur, at[1] + b * blur])
                });
                let shade = 0.75 + 0.35 * v;
                let pixel = &mut frame.pixels[y * width + x];
                for (i, value) in pixel.iter_mut().enumerate() {
                    let seen = around.iter().map(|color| color[i]).sum::<f32>() * 0.25;
                    *value += 0.85 * edge * (seen * shade - *value);
                }
            }
        }
    }
}
