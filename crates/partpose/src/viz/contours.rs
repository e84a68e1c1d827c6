//! The lines that a model's shape is recognised by: its outline, the seams between its parts, and where one of its
//! surfaces hides another.
//!
//! They are read from a label picture with three samples a pixel side, not from the mesh's edges: what is hidden or
//! behind the camera drops out by itself, and a mesh of ten thousand faces, bumpy or with vertices that are not
//! shared, gives the same few lines as a clean one.

use crate::geometry::{Camera, Point3, Rect};
use crate::render::{Instance, LabelImage, LabelRenderer, NEAR, RenderOptions};

/// Samples along the side of a pixel.
const SAMPLES: u32 = 3;
/// Depth, in metres, by which a surface must lie in front of another to count as hiding it.
const STEP: f32 = 0.08;

/// Line coverage of the pixels of a rectangle, 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Contours {
    /// Image coordinates of the upper left pixel.
    pub(super) origin: [i32; 2],
    /// Width and height in pixels.
    pub(super) size: [u32; 2],
    /// Outline, row by row.
    pub(super) outline: Vec<f32>,
    /// Seams and hiding edges, row by row.
    pub(super) inner: Vec<f32>,
}

/// The contours of a model in an image; empty where it is not seen.
pub(super) fn contours(camera: &Camera, instance: &Instance) -> Contours {
    let [x0, y0, x1, y1] = window(camera, instance);
    let size = [(x1 - x0).max(0) as u32, (y1 - y0).max(0) as u32];
    let count = size[0] as usize * size[1] as usize;
    let mut contours =
        Contours { origin: [x0, y0], size, outline: vec![0.0; count], inner: vec![0.0; count] };
    if count == 0 {
        return contours;
    }
    let edge = |pixel: i32| f64::from(pixel) - 0.5;
    let camera = camera
        .crop(&Rect::new(edge(x0), edge(y0), edge(x1), edge(y1)), size.map(|side| side * SAMPLES));
    let mut renderer = LabelRenderer::default();
    let image = renderer.render(&camera, &[*instance], &RenderOptions::default());
    let kinds = kinds(image);
    // A straight line marks two samples of three across: half as much again fills the pixel.
    let weight = 1.5 / (SAMPLES * SAMPLES) as f32;
    let width = image.size[0] as usize;
    for (i, kind) in kinds.iter().enumerate() {
        let pixel = [i % width, i / width].map(|at| at / SAMPLES as usize);
        let at = pixel[1] * size[0] as usize + pixel[0];
        match kind {
            Kind::None => {}
            Kind::Inner => contours.inner[at] = (contours.inner[at] + weight).min(1.0),
            Kind::Outline => contours.outline[at] = (contours.outline[at] + weight).min(1.0),
        }
    }
    contours
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    None,
    Inner,
    Outline,
}

/// Pixels `x0..x1`, `y0..y1` that may show the model.
fn window(camera: &Camera, instance: &Instance) -> [i32; 4] {
    let [width, height] = camera.size.map(|side| side as i32);
    let mut rect: Option<Rect> = None;
    for vertex in &instance.mesh.vertices {
        let scaled = Point3::from(vertex.coords.component_mul(&instance.scale));
        let point = instance.camera_from_vehicle * scaled;
        if point.z < NEAR {
            return [0, 0, width, height];
        }
        let pixel = camera.project_unchecked(&point);
        let seen = rect.get_or_insert(Rect::new(pixel.x, pixel.y, pixel.x, pixel.y));
        seen.x_min = seen.x_min.min(pixel.x);
        seen.y_min = seen.y_min.min(pixel.y);
        seen.x_max = seen.x_max.max(pixel.x);
        seen.y_max = seen.y_max.max(pixel.y);
    }
    let Some(rect) = rect else { return [0; 4] };
    [
        (rect.x_min as i32).saturating_sub(2).clamp(0, width),
        (rect.y_min as i32).saturating_sub(2).clamp(0, height),
        (rect.x_max as i32).saturating_add(3).clamp(0, width),
        (rect.y_max as i32).saturating_add(3).clamp(0, height),
    ]
}

fn kinds(image: &LabelImage) -> Vec<Kind> {
    let [width, height] = image.size.map(|side| side as usize);
    let mut kinds = vec![Kind::None; width * height];
    for y in 0..height {
        for x in 0..width {
            let here = y * width + x;
            if x + 1 < width {
                mark(image, &mut kinds, here, 1, [x > 0, x + 2 < width]);
            }
            if y + 1 < height {
                mark(image, &mut kinds, here, width, [y > 0, y + 2 < height]);
            }
        }
    }
    kinds
}

/// Marks a sample and the next one along a step if a line runs between them; `beyond` says whether there are samples
/// before the first and after the second.
fn mark(image: &LabelImage, kinds: &mut [Kind], here: usize, step: usize, beyond: [bool; 2]) {
    let there = here + step;
    let (a, b) = (image.parts[here], image.parts[there]);
    let kind = if (a == 0) != (b == 0) {
        Kind::Outline
    } else if a != b || (a != 0 && hides(image, here, step, beyond)) {
        Kind::Inner
    } else {
        return;
    };
    kinds[here] = kinds[here].max(kind);
    kinds[there] = kinds[there].max(kind);
}

/// Whether depth jumps between two samples of a part by more than the slopes on both sides explain.
fn hides(image: &LabelImage, here: usize, step: usize, [before, after]: [bool; 2]) -> bool {
    let inverse = |i: usize| 1.0 / image.depths[i];
    let (a, b) = (inverse(here), inverse(here + step));
    let jump = (a - b).abs();
    if jump < STEP * a * b {
        return false;
    }
    let slope_before = if before { (a - inverse(here - step)).abs() } else { 0.0 };
    let slope_after = if after { (inverse(here + 2 * step) - b).abs() } else { 0.0 };
    jump > 4.0 * slope_before.max(slope_after)
}
