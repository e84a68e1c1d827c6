//! The scene from above: the camera at the bottom looks up.

use crate::files::RgbImage;
use crate::geometry::{Camera, Cuboid, Point2, Point3, Rect};

use super::canvas::{Canvas, Pen, TextStyle, text_size};
use super::scene::{ScenePicture, VehiclePicture, palette};

/// What a view from above shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BirdsEyeOptions {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Metres from the camera to the upper border; `None` for as many as the vehicles need.
    pub range: Option<f64>,
}

impl Default for BirdsEyeOptions {
    fn default() -> Self {
        Self { size: [420, 393], range: None }
    }
}

/// Shortest and longest range that is chosen by itself, in metres.
const RANGES: [f64; 2] = [20.0, 120.0];
/// Where rings are labelled, from straight ahead to the right, in radians.
const RING_LABEL_ANGLE: f64 = 0.78;
/// Pixels under the camera.
const FOOT: f64 = 22.0;

/// The vehicles from above: ground truth outlined, estimates filled, both with an arrow to their front.
pub fn birds_eye(scene: &ScenePicture, options: &BirdsEyeOptions) -> RgbImage {
    let mut canvas = Canvas::new(options.size, palette::GROUND);
    let [width, height] = canvas.size().map(f64::from);
    let range = options.range.filter(|range| *range > 0.0 && range.is_finite());
    let range = range.unwrap_or_else(|| needed_range(&scene.vehicles));
    let map =
        Map { camera: Point2::new(0.5 * width, height - FOOT), scale: (height - FOOT) / range };
    draw_grid(&mut canvas, &map, range);
    draw_field_of_view(&mut canvas, &map, &scene.camera, range);
    for vehicle in &scene.vehicles {
        if let Some(cuboid) = &vehicle.predicted {
            draw_predicted(&mut canvas, &map, cuboid);
        }
    }
    for vehicle in &scene.vehicles {
        if let Some(cuboid) = &vehicle.truth {
            draw_truth(&mut canvas, &map, cuboid);
        }
    }
    write_ids(&mut canvas, &map, &scene.vehicles);
    legend(&mut canvas, scene);
    canvas.into_rgb()
}

/// From the camera frame to pixels, seen from above.
struct Map {
    camera: Point2,
    /// Pixels a metre.
    scale: f64,
}

impl Map {
    fn pixel(&self, x: f64, z: f64) -> Point2 {
        Point2::new(self.camera.x + self.scale * x, self.camera.y - self.scale * z)
    }

    fn point(&self, point: &Point3) -> Point2 {
        self.pixel(point.x, point.z)
    }

    /// The ground face: rear left, rear right, front right, front left.
    fn footprint(&self, cuboid: &Cuboid) -> [Point2; 4] {
        let corners = cuboid.corners();
        [0, 1, 5, 4].map(|i| self.point(&corners[i]))
    }
}

fn needed_range(vehicles: &[VehiclePicture]) -> f64 {
    let cuboids = vehicles.iter().flat_map(|vehicle| [vehicle.truth, vehicle.predicted]).flatten();
    let farthest = cuboids.map(|cuboid| cuboid.center().z).fold(0.0, f64::max);
    let step = if farthest > 50.0 { 20.0 } else { 10.0 };
    (((farthest + 5.0) / step).ceil() * step).clamp(RANGES[0], RANGES[1])
}

/// Squares of 5 m where there is room, else of 10 m, and rings around the camera.
fn draw_grid(canvas: &mut Canvas, map: &Map, range: f64) {
    let cell = if range > 50.0 { 10.0 } else { 5.0 };
    let ring = if range > 50.0 { 20.0 } else { 10.0 };
    let reach = 0.5 * f64::from(canvas.size()[0]) / map.scale;
    let pen = Pen { color: [40, 44, 52, 255], width: 1.0 };
    let snapped = |p: Point2| Point2::new(p.x.round(), p.y.round());
    for i in 0..=(range / cell) as i32 {
        let z = f64::from(i) * cell;
        canvas.line(&snapped(map.pixel(-reach, z)), &snapped(map.pixel(reach, z)), pen);
    }
    let columns = (reach / cell) as i32;
    for i in -columns..=columns {
        let x = f64::from(i) * cell;
        canvas.line(&snapped(map.pixel(x, 0.0)), &snapped(map.pixel(x, range)), pen);
    }
    let pen = Pen { color: [70, 76, 88, 255], width: 1.0 };
    for i in 1..=(range / ring) as i32 {
        let radius = f64::from(i) * ring;
        let at = |k: i32| {
            let angle = f64::from(k) * std::f64::consts::PI / 96.0;
            map.pixel(radius * angle.cos(), radius * angle.sin())
        };
        for k in 0..96 {
            canvas.line(&at(k), &at(k + 1), pen);
        }
        // Beside the field of view, or at the border: where vehicles are rare.
        let x = (radius * RING_LABEL_ANGLE.sin()).min(reach - 32.0 / map.scale).max(0.0);
        let at = map.pixel(x, (radius * radius - x * x).max(0.0).sqrt());
        let text = format!("{radius} m");
        let style = TextStyle::outlined(palette::DIM, palette::GROUND);
        canvas.text([at.x as i32 + 2, at.y as i32 + 5], &text, style);
    }
}

fn draw_field_of_view(canvas: &mut Canvas, map: &Map, camera: &Camera, range: f64) {
    let rect = camera.image_rect();
    let pen = Pen { color: palette::with_opacity(palette::DIM, 200), width: 1.0 };
    for x in [rect.x_min, rect.x_max] {
        let ray = camera.ray(&Point2::new(x, 0.0)) * (2.0 * range);
        canvas.line(&map.camera, &map.pixel(ray.x, ray.z), pen);
    }
    canvas.disc(&map.camera, 3.0, palette::with_opacity(palette::TEXT, 255));
}

fn draw_predicted(canvas: &mut Canvas, map: &Map, cuboid: &Cuboid) {
    let footprint = map.footprint(cuboid);
    canvas.fill(&footprint, palette::with_opacity(palette::PREDICTED, 120));
    draw_heading(canvas, map, cuboid, palette::PREDICTED);
}

fn draw_truth(canvas: &mut Canvas, map: &Map, cuboid: &Cuboid) {
    let color = palette::with_opacity(palette::TRUTH, 255);
    canvas.outline(&map.footprint(cuboid), Pen { color, width: 1.2 });
    draw_heading(canvas, map, cuboid, palette::TRUTH);
}

/// An arrow from the middle to beyond the front.
fn draw_heading(canvas: &mut Canvas, map: &Map, cuboid: &Cuboid, color: [u8; 3]) {
    let length = cuboid.extent.length;
    let at = |x: f64, z: f64| map.point(&(cuboid.camera_from_vehicle * Point3::new(x, 0.0, z)));
    let tip = at(0.0, 0.5 * length + 0.9);
    let pen = Pen { color: palette::with_opacity(color, 255), width: 1.2 };
    canvas.line(&at(0.0, 0.0), &tip, pen);
    for side in [-0.55, 0.55] {
        canvas.line(&at(side, 0.5 * length + 0.1), &tip, pen);
    }
}

/// Ids beside the vehicles, on the side where there is room.
fn write_ids(canvas: &mut Canvas, map: &Map, vehicles: &[VehiclePicture]) {
    let [width, height] = canvas.size().map(f64::from);
    let area = Rect::new(0.0, 0.0, width - 1.0, height - 1.0);
    let boxes: Vec<Rect> = vehicles
        .iter()
        .flat_map(|vehicle| [vehicle.truth, vehicle.predicted])
        .flatten()
        .filter_map(|cuboid| Rect::around(&map.footprint(&cuboid)))
        .collect();
    let mut taken = boxes;
    for vehicle in vehicles {
        let Some(cuboid) = vehicle.truth.or(vehicle.predicted) else { continue };
        let Some(around) = Rect::around(&map.footprint(&cuboid)) else { continue };
        if vehicle.id.is_empty() || around.intersection(&area).is_none() {
            continue;
        }
        let [w, h] = text_size(&vehicle.id, 1).map(f64::from);
        let center = around.center();
        let places = [
            (around.x_max + 3.0, center.y - 0.5 * h),
            (around.x_min - 3.0 - w, center.y - 0.5 * h),
            (center.x - 0.5 * w, around.y_max + 3.0),
            (center.x - 0.5 * w, around.y_min - 3.0 - h),
        ]
        .map(|(x, y)| Rect::new(x, y, x + w, y + h));
        let inside = |place: &&Rect| {
            place.x_min >= 0.0
                && place.x_max <= width
                && place.y_min >= 0.0
                && place.y_max <= height
        };
        let is_free = |place: &&Rect| taken.iter().all(|other| other.intersection(place).is_none());
        let place = places.iter().filter(inside).find(is_free);
        let place = *place.or(places.iter().find(inside)).unwrap_or(&places[0]);
        let style = TextStyle::outlined(palette::TEXT, palette::GROUND);
        canvas.text([place.x_min.round() as i32, place.y_min.round() as i32], &vehicle.id, style);
        taken.push(place);
    }
}

fn legend(canvas: &mut Canvas, scene: &ScenePicture) {
    let [width, height] = canvas.size().map(f64::from);
    let plate = Rect::new(-1.0, height - 18.5, width, height);
    canvas.fill_rectangle(&plate, palette::with_opacity(palette::MARGIN, 255));
    let (mut x, middle) = (8.0, height - 10.0);
    let has = |get: fn(&VehiclePicture) -> bool| scene.vehicles.iter().any(get);
    if has(|vehicle| vehicle.predicted.is_some()) {
        let swatch = Rect::new(x, middle - 4.0, x + 14.0, middle + 4.0);
        canvas.fill_rectangle(&swatch, palette::with_opacity(palette::PREDICTED, 140));
        let at = [x as i32 + 20, middle as i32 - 3];
        canvas.text(at, "estimate", TextStyle::plain(palette::TEXT));
        x += 86.0;
    }
    if has(|vehicle| vehicle.truth.is_some()) {
        let swatch = Rect::new(x, middle - 4.0, x + 14.0, middle + 4.0);
        let color = palette::with_opacity(palette::TRUTH, 255);
        canvas.rectangle(&swatch, Pen { color, width: 1.2 });
        let at = [x as i32 + 20, middle as i32 - 3];
        canvas.text(at, "ground truth", TextStyle::plain(palette::TEXT));
    }
    let text = "seen from above";
    let at = [width as i32 - text_size(text, 1)[0] - 8, middle as i32 - 3];
    canvas.text(at, text, TextStyle::plain(palette::DIM));
}
