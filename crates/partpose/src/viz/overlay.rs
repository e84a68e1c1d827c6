//! Results over the image they were found in, in the manner of the paper's figures 1 and 5.

use crate::files::RgbImage;
use crate::geometry::{Camera, Cuboid, Point2, Point3, Rect, Vector3};
use crate::parts::{PartClass, PartMask};
use crate::render::{Instance, NEAR, render_labels};

use super::birds_eye::{BirdsEyeOptions, birds_eye};
use super::canvas::{Canvas, Pen, TextStyle, text_size};
use super::contours::contours;
use super::labels::Labels;
use super::scene::{PointPair, ScenePicture, VehiclePicture, palette};

/// Height of the strip with the legend under the image, in pixels.
const STRIP: u32 = 18;
/// Opacity of part masks over a photograph and over plain ground.
const MASK_OPACITY: [f32; 2] = [0.5, 0.78];
/// Vehicles below this height, in pixels, show their outline only: more lines than pixels would be left of the rest.
const DETAILED_HEIGHT: u32 = 36;
/// Opacity of the contours that another vehicle's model hides.
const HIDDEN: f32 = 0.22;
/// Opacity of the dark beside outlines; neighbouring pixels of a line add up.
const HALO: f32 = 0.22;
/// Radii of the dots of correspondences, in pixels, and what share of a box's height they take between them.
const DOT_RADII: [f64; 2] = [1.5, 2.7];
const DOT_SHARE: f64 = 0.03;

/// The image with everything that is known of its vehicles; a strip below explains the colours.
pub fn overlay(scene: &ScenePicture) -> RgbImage {
    let [width, height] = scene.camera.size.map(|side| side.max(1));
    let mut canvas = Canvas::new([width, height + STRIP], palette::GROUND);
    let image = scene.image.filter(|image| image.size == scene.camera.size);
    if let Some(image) = image {
        canvas.paste(image, [0, 0]);
    }
    let opacity = MASK_OPACITY[usize::from(image.is_none())];
    let vehicles = from_far_to_near(&scene.vehicles);
    for mask in vehicles.iter().filter_map(|vehicle| vehicle.mask) {
        draw_mask(&mut canvas, mask, opacity);
    }
    let front = foremost(&scene.camera, &vehicles);
    for (id, vehicle) in (1..).zip(&vehicles) {
        if let Some(bounds) = &vehicle.bounds {
            let color = palette::with_opacity(palette::DETECTION, 210);
            canvas.rectangle(bounds, Pen { color, width: 1.0 });
        }
        draw_estimate(&mut canvas, &scene.camera, vehicle, |x, y| {
            let front = front[(y * width as i32 + x) as usize];
            if front == 0 || front == id { 1.0 } else { HIDDEN }
        });
        if let Some(cuboid) = &vehicle.truth {
            draw_cuboid(&mut canvas, &scene.camera, cuboid, palette::TRUTH, true);
        }
    }
    for vehicle in &vehicles {
        let radius = dot_radius(&scene.camera, vehicle);
        for pair in &vehicle.points {
            draw_pair(&mut canvas, pair, radius);
        }
    }
    let area = Rect::new(0.0, 0.0, f64::from(width) - 1.0, f64::from(height) - 1.0);
    let mut labels = Labels::new(area);
    for vehicle in vehicles.iter().rev() {
        if let Some(anchor) = anchor(&scene.camera, vehicle) {
            labels.place(&anchor, caption(vehicle));
        }
    }
    labels.draw(&mut canvas);
    let strip = Rect::new(-1.0, f64::from(height) - 0.5, f64::from(width), f64::from(height + 99));
    canvas.fill_rectangle(&strip, palette::with_opacity(palette::MARGIN, 255));
    legend(&mut canvas, scene, height as i32);
    canvas.into_rgb()
}

/// [`overlay`] with [`birds_eye`] on its right.
pub fn side_by_side(scene: &ScenePicture, options: &BirdsEyeOptions) -> RgbImage {
    let left = overlay(scene);
    let options = BirdsEyeOptions { size: [options.size[0], left.size[1]], ..*options };
    let right = birds_eye(scene, &options);
    let mut canvas = Canvas::new([left.size[0] + right.size[0], left.size[1]], palette::MARGIN);
    canvas.paste(&left, [0, 0]);
    canvas.paste(&right, [left.size[0] as i32, 0]);
    canvas.into_rgb()
}

fn from_far_to_near<'a, 'b>(vehicles: &'b [VehiclePicture<'a>]) -> Vec<&'b VehiclePicture<'a>> {
    let mut sorted: Vec<&VehiclePicture> = vehicles.iter().collect();
    let depth = |vehicle: &VehiclePicture| {
        let cuboid = vehicle.truth.or(vehicle.predicted);
        cuboid.map_or(f64::INFINITY, |cuboid| cuboid.center().z)
    };
    sorted.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
    sorted
}

fn caption(vehicle: &VehiclePicture) -> String {
    format!("{} {}", vehicle.id, vehicle.text).trim().to_owned()
}

/// What a vehicle's label stands beside.
fn anchor(camera: &Camera, vehicle: &VehiclePicture) -> Option<Rect> {
    let cuboid = vehicle.truth.or(vehicle.predicted);
    let projected = cuboid.and_then(|cuboid| cuboid.project(camera));
    vehicle.bounds.or(projected).and_then(|rect| rect.intersection(&camera.image_rect()))
}

fn draw_mask(canvas: &mut Canvas, mask: &PartMask, opacity: f32) {
    for (y, row) in (mask.origin[1]..).zip(mask.rows()) {
        for (x, label) in (mask.origin[0]..).zip(row) {
            if let Some(part) = PartClass::from_id(*label) {
                canvas.blend(x, y, part.color(), opacity);
            }
        }
    }
}

/// Which of the vehicles' models stands in front at each pixel: its place in the list from 1, or 0.
fn foremost(camera: &Camera, vehicles: &[&VehiclePicture]) -> Vec<u16> {
    let models = (1..)
        .zip(vehicles)
        .filter_map(|(id, vehicle)| vehicle.model.map(|model| Instance { id, ..model }));
    render_labels(camera, &models.collect::<Vec<_>>()).instances
}

/// The fitted model's contours, or its cuboid where only that is known; `opacity` is that of a pixel.
fn draw_estimate(
    canvas: &mut Canvas,
    camera: &Camera,
    vehicle: &VehiclePicture,
    opacity: impl Fn(i32, i32) -> f32,
) {
    let Some(model) = &vehicle.model else {
        if let Some(cuboid) = &vehicle.predicted {
            draw_cuboid(canvas, camera, cuboid, palette::PREDICTED, false);
        }
        return;
    };
    let contours = contours(camera, model);
    let width = contours.size[0].max(1) as usize;
    let inner = if contours.size[1] >= DETAILED_HEIGHT { 0.75 } else { 0.0 };
    let at = |i: usize| {
        [contours.origin[0] + (i % width) as i32, contours.origin[1] + (i / width) as i32]
    };
    // Dark beside the outline, so that it stands out from bright ground.
    for (i, _) in contours.outline.iter().enumerate().filter(|(_, outline)| **outline > 0.4) {
        let [x, y] = at(i);
        for [dx, dy] in [[-1, 0], [1, 0], [0, -1], [0, 1]] {
            if camera.image_rect().contains(&Point2::new(f64::from(x + dx), f64::from(y + dy))) {
                canvas.blend(x + dx, y + dy, palette::GROUND, HALO * opacity(x, y));
            }
        }
    }
    for (i, (outline, seam)) in contours.outline.iter().zip(&contours.inner).enumerate() {
        let [x, y] = at(i);
        let coverage = outline.max(inner * seam);
        if coverage > 0.0 {
            canvas.blend(x, y, palette::PREDICTED, coverage * opacity(x, y));
        }
    }
}

/// The edges of a cuboid: those behind it faint, the face in front tinted and crossed.
fn draw_cuboid(
    canvas: &mut Canvas,
    camera: &Camera,
    cuboid: &Cuboid,
    color: [u8; 3],
    mark_front: bool,
) {
    let corners = cuboid.corners();
    let near = |a: usize, b: usize| project_edge(camera, &corners[a], &corners[b]);
    let faces = visible_faces(cuboid);
    for first in 0..8 {
        for axis in 0..3 {
            let second = first | 1 << axis;
            if second == first {
                continue;
            }
            let seen =
                (0..3).filter(|other| *other != axis).any(|other| faces[other][first >> other & 1]);
            let opacity = if seen { 235 } else { 70 };
            let pen = Pen { color: palette::with_opacity(color, opacity), width: 1.0 };
            if let Some([from, to]) = near(first, second) {
                canvas.line(&from, &to, pen);
            }
        }
    }
    if !mark_front {
        return;
    }
    let front = [4, 5, 7, 6].map(|i| camera.project(&corners[i]).filter(|_| corners[i].z > NEAR));
    if let [Some(a), Some(b), Some(c), Some(d)] = front {
        canvas.fill(&[a, b, c, d], palette::with_opacity(color, 38));
    }
    for [a, b] in [[4, 7], [5, 6]] {
        let pen = Pen { color: palette::with_opacity(color, 150), width: 1.0 };
        if let Some([from, to]) = near(a, b) {
            canvas.line(&from, &to, pen);
        }
    }
}

/// For each axis of the vehicle whether the faces at the corners with bit 0 and with bit 1 are turned to the camera.
fn visible_faces(cuboid: &Cuboid) -> [[bool; 2]; 3] {
    let eye = cuboid.camera_from_vehicle.inverse() * Point3::origin();
    let extent = cuboid.extent;
    let [right, front] = [0.5 * extent.width, 0.5 * extent.length];
    // Bit 1 of a corner's index is the top, where y is least.
    [
        [eye.x < -right, eye.x > right],
        [eye.y > 0.0, eye.y < -extent.height],
        [eye.z < -front, eye.z > front],
    ]
}

/// The part of an edge that lies before the near plane, in pixels.
fn project_edge(camera: &Camera, a: &Point3, b: &Point3) -> Option<[Point2; 2]> {
    let cut = |inside: &Point3, outside: &Point3| -> Point3 {
        let along: Vector3 = outside - inside;
        inside + along * ((inside.z - NEAR) / (inside.z - outside.z))
    };
    let (a, b) = match (a.z >= NEAR, b.z >= NEAR) {
        (true, true) => (*a, *b),
        (true, false) => (*a, cut(a, b)),
        (false, true) => (cut(b, a), *b),
        (false, false) => return None,
    };
    Some([camera.project_unchecked(&a), camera.project_unchecked(&b)])
}

fn dot_radius(camera: &Camera, vehicle: &VehiclePicture) -> f32 {
    let height = anchor(camera, vehicle).map_or(f64::INFINITY, |rect| rect.height());
    (DOT_SHARE * height).clamp(DOT_RADII[0], DOT_RADII[1]) as f32
}

/// A dot in the part's colour and a line to where the pose puts the part; the dot is hollow if it was not used.
fn draw_pair(canvas: &mut Canvas, pair: &PointPair, radius: f32) {
    let red = palette::with_opacity(palette::RESIDUAL, 255);
    let dark = palette::with_opacity([0, 0, 0], 190);
    let [from, to] = [&pair.observed, &pair.reprojected];
    canvas.line(from, to, Pen { color: dark, width: 0.5 * radius + 1.2 });
    canvas.line(from, to, Pen { color: red, width: 0.5 * radius });
    canvas.disc(from, radius + 1.1, [0, 0, 0, 255]);
    canvas.disc(from, radius + 0.3, [255, 255, 255, 255]);
    let color = if pair.inlier { pair.class.color() } else { palette::GROUND };
    canvas.disc(from, radius - 0.5, palette::with_opacity(color, 255));
}

/// Explains what the picture shows, and no more.
fn legend(canvas: &mut Canvas, scene: &ScenePicture, top: i32) {
    let any = |has: &dyn Fn(&VehiclePicture) -> bool| scene.vehicles.iter().any(has);
    let middle = f64::from(top) + 8.0;
    let mut x = 8;
    let mut entry = |canvas: &mut Canvas, text: &str, symbol: &dyn Fn(&mut Canvas, f64)| {
        symbol(canvas, f64::from(x));
        canvas.text([x + 22, top + 5], text, TextStyle::plain(palette::TEXT));
        x += 22 + text_size(text, 1)[0] + 18;
    };
    let line = |color: [u8; 3]| {
        move |canvas: &mut Canvas, x: f64| {
            let pen = Pen { color: palette::with_opacity(color, 255), width: 1.4 };
            canvas.rectangle(&Rect::new(x + 1.0, middle - 4.0, x + 15.0, middle + 4.0), pen);
        }
    };
    if any(&|vehicle| vehicle.bounds.is_some()) {
        entry(canvas, "detection", &line(palette::DETECTION));
    }
    if any(&|vehicle| vehicle.mask.is_some()) {
        entry(canvas, "part mask", &|canvas: &mut Canvas, x| {
            let parts = [PartClass::Hood, PartClass::DoorFrontLeft, PartClass::GlassFrontLeft];
            for (i, part) in parts.into_iter().enumerate() {
                let x = x + 5.0 * i as f64;
                let swatch = Rect::new(x, middle - 4.5, x + 5.0, middle + 4.5);
                canvas.fill_rectangle(&swatch, palette::with_opacity(part.color(), 255));
            }
        });
    }
    let example = |inlier: bool| {
        move |canvas: &mut Canvas, x: f64| {
            let observed = Point2::new(x + 4.0, middle + 2.0);
            let reprojected = Point2::new(x + 14.0, middle - 3.0);
            let class = PartClass::Hood;
            draw_pair(canvas, &PointPair { observed, reprojected, class, inlier }, 2.7);
        }
    };
    let has_pair = |inlier: bool| {
        scene.vehicles.iter().flat_map(|vehicle| &vehicle.points).any(|pair| pair.inlier == inlier)
    };
    if has_pair(true) {
        entry(canvas, "part centre and where the pose puts it", &example(true));
    }
    if has_pair(false) {
        entry(canvas, "rejected", &example(false));
    }
    if any(&|vehicle| vehicle.model.is_some() || vehicle.predicted.is_some()) {
        entry(canvas, "estimate", &line(palette::PREDICTED));
    }
    if any(&|vehicle| vehicle.truth.is_some()) {
        entry(canvas, "ground truth (front crossed)", &|canvas: &mut Canvas, x| {
            line(palette::TRUTH)(canvas, x);
            let pen = Pen { color: palette::with_opacity(palette::TRUTH, 150), width: 1.0 };
            for side in [-4.0, 4.0] {
                let (from, to) = (middle - side, middle + side);
                canvas.line(&Point2::new(x + 1.0, from), &Point2::new(x + 15.0, to), pen);
            }
        });
    }
    let right = canvas.size()[0] as i32 - text_size(&scene.title, 1)[0] - 8;
    canvas.text([right.max(x), top + 5], &scene.title, TextStyle::plain(palette::DIM));
}
