//! Shaded pictures of models, coloured by part.
//!
//! Several samples a pixel, lit by one lamp beside the camera and by the sky. The surface's direction comes from the
//! depths of neighbouring samples, so a mesh looks as it is, without smoothing: bumps show.

use crate::files::RgbImage;
use crate::geometry::{Camera, Point2, Vector3};
use crate::parts::PartClass;
use crate::render::{Instance, LabelImage, LabelRenderer, RenderOptions};

/// How models are shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadeOptions {
    /// Samples along the side of a pixel.
    pub samples: u32,
    /// Colour around the models.
    pub background: [u8; 3],
    /// Share of a part's colour that is left where no light falls, 0 to 1.
    pub ambient: f64,
    /// How much seams between parts and outlines are darkened, 0 to 1.
    pub seam: f64,
}

impl Default for ShadeOptions {
    fn default() -> Self {
        Self { samples: 3, background: [244, 245, 247], ambient: 0.42, seam: 0.6 }
    }
}

/// A picture of models in the colours of their parts.
pub fn shade(camera: &Camera, instances: &[Instance], options: &ShadeOptions) -> RgbImage {
    let color = |part: PartClass, _: u16| part.color();
    shade_colored(camera, instances, options, &color)
}

/// As [`shade`], in colours of choice: `color` gets the part and the instance's id.
pub(super) fn shade_colored(
    camera: &Camera,
    instances: &[Instance],
    options: &ShadeOptions,
    color: &dyn Fn(PartClass, u16) -> [u8; 3],
) -> RgbImage {
    let samples = options.samples.clamp(1, 8);
    let fine = camera.crop(&camera.image_rect(), camera.size.map(|side| side * samples));
    let mut renderer = LabelRenderer::default();
    let image = renderer.render(&fine, instances, &RenderOptions::default());
    let [width, height] = camera.size.map(|side| side as usize);
    let mut sums = vec![[0.0f64; 3]; width * height];
    let fine_width = image.size[0] as usize;
    for i in 0..image.parts.len() {
        let (x, y) = (i % fine_width, i / fine_width);
        let color = sample_color(&fine, image, [x, y], options, color);
        let sum = &mut sums[y / samples as usize * width + x / samples as usize];
        for (total, value) in sum.iter_mut().zip(color) {
            *total += value;
        }
    }
    let share = 1.0 / f64::from(samples * samples);
    let pixels = sums.iter().flatten().map(|value| (value * share).round() as u8).collect();
    RgbImage { size: camera.size, pixels }
}

/// Colour of one sample, 0 to 255.
fn sample_color(
    camera: &Camera,
    image: &LabelImage,
    [x, y]: [usize; 2],
    options: &ShadeOptions,
    color: &dyn Fn(PartClass, u16) -> [u8; 3],
) -> [f64; 3] {
    let [width, height] = image.size.map(|side| side as usize);
    let here = y * width + x;
    let seam = |other: usize| {
        image.parts[other] != image.parts[here] || image.instances[other] != image.instances[here]
    };
    let right = x + 1 < width && seam(here + 1);
    let below = y + 1 < height && seam(here + width);
    let Some(part) = PartClass::from_id(image.parts[here]) else {
        return options.background.map(f64::from);
    };
    let light = match normal(camera, image, [x, y]) {
        Some(normal) => light(&normal, &camera.ray(&Point2::new(x as f64, y as f64))),
        None => 0.5,
    };
    let darkening = if right || below { 1.0 - options.seam } else { 1.0 };
    let brightness = (options.ambient + (1.0 - options.ambient) * light) * darkening;
    // Black parts would show no shape at all: they get a little of the light as it is.
    let sheen = 34.0 * light * darkening;
    color(part, image.instances[here])
        .map(|value| (f64::from(value) * brightness * 0.92 + sheen).min(255.0))
}

/// How much light falls on a surface, 0 to 1: a lamp up to the left of the camera, and the sky.
fn light(normal: &Vector3, ray: &Vector3) -> f64 {
    let lamp = Vector3::new(-0.45, -0.75, -0.6).normalize();
    let eye = -ray.normalize();
    let sky = 0.5 - 0.5 * normal.y;
    0.6 * normal.dot(&lamp).max(0.0) + 0.2 * normal.dot(&eye).max(0.0) + 0.2 * sky
}

/// Direction of the surface at a sample, towards the camera; `None` where it has no neighbours of its own.
fn normal(camera: &Camera, image: &LabelImage, [x, y]: [usize; 2]) -> Option<Vector3> {
    let [width, height] = image.size.map(|side| side as usize);
    let point = |x: usize, y: usize| {
        let depth = f64::from(image.depths[y * width + x]);
        camera.ray(&Point2::new(x as f64, y as f64)) * depth
    };
    let here = point(x, y);
    // Of the differences to both sides the smaller one: the other may lead over an edge.
    let nearer = |before: Option<Vector3>, after: Option<Vector3>| -> Option<Vector3> {
        let before = before.filter(|p| p.z.is_finite()).map(|p| here - p);
        let after = after.filter(|p| p.z.is_finite()).map(|p| p - here);
        match (before, after) {
            (Some(a), Some(b)) => Some(if a.z.abs() < b.z.abs() { a } else { b }),
            (a, b) => a.or(b),
        }
    };
    let along_x =
        nearer((x > 0).then(|| point(x - 1, y)), (x + 1 < width).then(|| point(x + 1, y)))?;
    let along_y =
        nearer((y > 0).then(|| point(x, y - 1)), (y + 1 < height).then(|| point(x, y + 1)))?;
    // x points right and y down: their product points away from the camera.
    (-along_x.cross(&along_y)).try_normalize(0.0)
}
