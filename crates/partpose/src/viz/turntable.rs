//! A model from all sides on one sheet.

use nalgebra::{Rotation3, Translation3, UnitQuaternion};

use crate::files::RgbImage;
use crate::geometry::{Camera, Point2, Point3, Pose, Rect, Vector3};
use crate::parts::PartClass;
use crate::render::Instance;
use crate::vehicle::VehicleModel;

use super::canvas::{Canvas, Pen, TextStyle};
use super::shade::{ShadeOptions, shade};

/// How a sheet is laid out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurntableOptions {
    /// Width and height of a view in pixels.
    pub tile: [u32; 2],
    /// How far above the horizon the camera stands, in radians.
    pub elevation: f64,
    /// How each view is shaded.
    pub shade: ShadeOptions,
}

impl Default for TurntableOptions {
    fn default() -> Self {
        Self { tile: [380, 215], elevation: 0.26, shade: ShadeOptions::default() }
    }
}

/// Names of the views and where the camera stands: the angle from the front towards the vehicle's left, in eighths of
/// a turn, and whether it looks from above instead. Left and right stand where they do on the sheet.
pub(super) const VIEWS: [(&str, Option<u8>); 9] = [
    ("front right", Some(7)),
    ("front", Some(0)),
    ("front left", Some(1)),
    ("right", Some(6)),
    ("top (front is right)", None),
    ("left", Some(2)),
    ("rear right", Some(5)),
    ("rear", Some(4)),
    ("rear left", Some(3)),
];

pub(super) const INK: [u8; 3] = [32, 36, 44];
pub(super) const FAINT: [u8; 3] = [110, 116, 126];
const RULE: [u8; 4] = [208, 211, 217, 255];
pub(super) const HEADER: u32 = 44;
pub(super) const LEGEND: u32 = 150;
/// Distance of the camera in diagonals of the model: near enough for some perspective.
const DISTANCE: f64 = 3.2;
/// Share of a tile that the model fills.
const FILL: f64 = 0.86;
/// Rows of a line of the legend.
const LINE: i32 = 16;

/// Eight views around a model and one from above, with its name, size, faces and the colours of its parts.
pub fn turntable(model: &VehicleModel, options: &TurntableOptions) -> RgbImage {
    let [width, height] = options.tile.map(|side| side.clamp(16, 2048));
    let mut canvas =
        Canvas::new([3 * width + LEGEND, 3 * height + HEADER], options.shade.background);
    // One scale for all views: a vehicle's length must fit the width of a tile.
    let reach = longest(&model.mesh().vertices);
    for (i, (name, eighth)) in VIEWS.iter().enumerate() {
        let at = [(i as u32 % 3 * width) as i32, (HEADER + i as u32 / 3 * height) as i32];
        let camera_from_vehicle = view(model, *eighth, options.elevation);
        let instance = Instance {
            mesh: model.mesh(),
            scale: Vector3::repeat(1.0),
            camera_from_vehicle,
            id: 1,
        };
        let camera = framing(&instance, [width, height], reach);
        canvas.paste(&shade(&camera, &[instance], &options.shade), at);
        canvas.text([at[0] + 8, at[1] + 8], name, TextStyle::plain(FAINT));
    }
    rules(&mut canvas, [width, height]);
    header(&mut canvas, model);
    legend(&mut canvas, model, (3 * width) as i32);
    canvas.into_rgb()
}

/// Pose of the vehicle before a camera that looks at the middle of its cuboid.
pub(super) fn view(model: &VehicleModel, eighth: Option<u8>, elevation: f64) -> Pose {
    let extent = model.extent();
    let center = Vector3::new(0.0, -0.5 * extent.height, 0.0);
    let rotation = match eighth {
        // The front to the right, the roof towards the camera.
        None => Rotation3::from_basis_unchecked(&[Vector3::y(), Vector3::z(), Vector3::x()]),
        Some(eighth) => {
            let turn = f64::from(eighth) * std::f64::consts::FRAC_PI_4;
            // Unturned, the front would look away from the camera.
            Rotation3::from_axis_angle(&Vector3::x_axis(), elevation)
                * Rotation3::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI + turn)
        }
    };
    let distance = DISTANCE * extent.to_vector().norm();
    let offset = Vector3::new(0.0, 0.0, distance) - rotation * center;
    Pose::from_parts(Translation3::from(offset), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// A camera that shows a vehicle so large that `reach` metres fill the width, if its height fits.
pub(super) fn framing(instance: &Instance, size: [u32; 2], reach: f64) -> Camera {
    let camera = Camera::pinhole(1000.0, [0.0, 0.0], [1, 1]);
    let seen: Vec<Point2> = instance
        .mesh
        .vertices
        .iter()
        .filter_map(|vertex| camera.project(&(instance.camera_from_vehicle * vertex)))
        .collect();
    let seen = Rect::around(&seen).unwrap_or(Rect::new(-1.0, -1.0, 1.0, 1.0));
    let [width, height] = size.map(f64::from);
    let depth = instance.camera_from_vehicle.translation.z.max(1e-3);
    let length_in_pixels = 1000.0 * reach / depth;
    let scale = FILL * (width / length_in_pixels.max(1e-9)).min(height / seen.height().max(1e-9));
    let middle = seen.center();
    Camera::pinhole(
        1000.0 * scale,
        [
            0.5 * (width - 1.0) - scale * middle.x,
            0.5 * (height - 1.0) - scale * middle.y + 0.02 * height,
        ],
        size,
    )
}

/// Longest side of the box around points.
pub(super) fn longest(points: &[Point3]) -> f64 {
    let around = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        high - low
    };
    (0..3).map(around).fold(1e-9, f64::max)
}

pub(super) fn rules(canvas: &mut Canvas, [width, height]: [u32; 2]) {
    let pen = Pen { color: RULE, width: 1.0 };
    let [right, bottom] = [3 * width, HEADER + 3 * height].map(f64::from);
    for i in 0..=3 {
        let y = f64::from(HEADER + i * height);
        canvas.line(&Point2::new(0.0, y), &Point2::new(right, y), pen);
        let x = f64::from(i * width);
        canvas.line(&Point2::new(x, f64::from(HEADER)), &Point2::new(x, bottom), pen);
    }
}

pub(super) fn header(canvas: &mut Canvas, model: &VehicleModel) {
    let title = TextStyle { scale: 2, ..TextStyle::plain(INK) };
    canvas.text([10, 7], model.name(), title);
    let extent = model.extent();
    let facts = format!(
        "{} {}   width {:.2} m  height {:.2} m  length {:.2} m   {} faces  {} vertices",
        model.category(),
        model.body_style(),
        extent.width,
        extent.height,
        extent.length,
        model.mesh().faces.len(),
        model.mesh().vertices.len(),
    );
    canvas.text([10, 29], &facts, TextStyle::plain(FAINT));
}

/// All parts with their colours; those that the model lacks are crossed out.
fn legend(canvas: &mut Canvas, model: &VehicleModel, left: i32) {
    let mut faces = [0usize; PartClass::COUNT];
    for part in &model.mesh().parts {
        faces[part.index()] += 1;
    }
    let present = faces.iter().filter(|count| **count > 0).count();
    let text = format!("{present} of {} parts", PartClass::COUNT);
    canvas.text([left + 12, 29], &text, TextStyle::plain(FAINT));
    for (i, part) in PartClass::ALL.into_iter().enumerate() {
        let y = HEADER as i32 + 10 + i as i32 * LINE;
        let [r, g, b] = part.color();
        let x = f64::from(left + 12);
        let swatch = Rect::new(x, f64::from(y) - 1.0, x + 14.0, f64::from(y) + 8.0);
        if faces[i] > 0 {
            canvas.fill_rectangle(&swatch, [r, g, b, 255]);
        }
        canvas.rectangle(&swatch, Pen { color: [120, 124, 132, 255], width: 1.0 });
        let color = if faces[i] > 0 { INK } else { [176, 180, 188] };
        canvas.text([left + 34, y], part.name(), TextStyle::plain(color));
    }
}
