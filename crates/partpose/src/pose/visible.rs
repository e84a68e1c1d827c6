//! Centres of what can be seen of a part, in place of the centre of all of it.
//!
//! The projection of a part's centre is not the centre of its projection: half a wheel arch, one side of a bumper or a
//! part cut off by the image's border has its visible centre elsewhere. Drawing the model tells where. The paper names
//! this ("visibility analysis") as its first improvement.
//!
//! Two uses: a table by viewpoint, drawn once per model, which needs no pose to begin with; and, once there is a pose,
//! the model drawn at it, within the detection's box and only where the detection knows something.

use std::f64::consts::TAU;

use crate::detection::Detection;
use crate::geometry::{Camera, Extent, Point2, Point3, Pose, Rect, Vector3};
use crate::parts::{CHANNELS, PartClass, PartMap};
use crate::render::{Instance, LabelRenderer, RenderOptions};
use crate::vehicle::{Mesh, VehicleModel};

use super::Center2d;

/// Samples a side at which a model is drawn for its visible centres.
const GRID: u32 = 56;
/// Viewpoints around the vehicle in the table: 15 degrees apart.
const AZIMUTHS: usize = 24;
/// Distance of the table's viewpoints in metres; beyond it little changes.
const TABLE_DISTANCE: f64 = 18.0;
/// Height of the table's viewpoints above the ground in metres: that of a camera behind a windscreen.
const TABLE_HEIGHT: f64 = 1.6;

/// What the camera sees of a part of a drawn model.
#[derive(Clone, Copy, Debug)]
pub(super) struct VisiblePart {
    /// The point that projects to the centre of what is seen, at the mean depth, in the vehicle frame (metres).
    pub point_in_vehicle: Point3,
    /// Share of the window's samples that show the part.
    pub share: f64,
}

/// What is drawn: a mesh scaled by factors per axis, placed, and seen through a camera.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub camera: &'a Camera,
    pub mesh: &'a Mesh,
    pub scale: Vector3,
    pub camera_from_vehicle: Pose,
    /// Whether faces seen from behind may be left out: the mesh is closed.
    pub is_closed: bool,
}

/// Depth in metres beyond which no vehicle reaches the near plane.
const CLEAR_OF_NEAR_PLANE: f64 = 8.0;

/// The visible centres within a window of the image, where `is_known` of the sample's pixel.
pub(super) fn visible_parts(
    view: &View,
    window: &Rect,
    kind: Center2d,
    is_known: impl Fn(&Point2) -> bool,
    renderer: &mut LabelRenderer,
) -> PartMap<VisiblePart> {
    let crop = view.camera.crop(window, [GRID, GRID]);
    let instance = Instance {
        mesh: view.mesh,
        scale: view.scale,
        camera_from_vehicle: view.camera_from_vehicle,
        id: 1,
    };
    let is_clear = view.camera_from_vehicle.translation.z > CLEAR_OF_NEAR_PLANE;
    let options = RenderOptions { cull_back_faces: view.is_closed && is_clear };
    let image = renderer.render(&crop, &[instance], &options);
    let mut sums = [Sums::EMPTY; CHANNELS];
    let step = [window.width() / f64::from(GRID), window.height() / f64::from(GRID)];
    for (at, (label, depth)) in image.parts.iter().zip(&image.depths).enumerate() {
        if *label == 0 {
            continue;
        }
        let (column, row) = (at as u32 % GRID, at as u32 / GRID);
        let pixel = Point2::new(
            window.x_min + (f64::from(column) + 0.5) * step[0],
            window.y_min + (f64::from(row) + 0.5) * step[1],
        );
        if is_known(&pixel) {
            sums[usize::from(*label)].add(&pixel, f64::from(*depth));
        }
    }
    let vehicle_from_camera = view.camera_from_vehicle.inverse();
    let part = |sums: &Sums| {
        let (pixel, depth) = sums.center(kind)?;
        Some(VisiblePart {
            point_in_vehicle: vehicle_from_camera * Point3::from(view.camera.ray(&pixel) * depth),
            share: sums.count / f64::from(GRID * GRID),
        })
    };
    PartClass::ALL
        .into_iter()
        .filter_map(|class| Some((class, part(&sums[usize::from(class.id())])?)))
        .collect()
}

/// Whether a detection knows something of a pixel: inside the image, and not hidden by another vehicle.
pub(super) fn knows(detection: &Detection, image: &Rect, pixel: &Point2) -> bool {
    if !image.contains(pixel) {
        return false;
    }
    let Some(unknown) = &detection.unknown else { return true };
    let (bounds, m) = (&detection.bounds, detection.probabilities.size());
    let cell = |at: f64, low: f64, length: f64| {
        (((at - low) / length * m as f64).max(0.0) as usize).min(m - 1)
    };
    let column = cell(pixel.x, bounds.x_min, bounds.width());
    let row = cell(pixel.y, bounds.y_min, bounds.height());
    unknown[row * m + column] < 0.5
}

#[derive(Clone, Copy)]
struct Sums {
    count: f64,
    pixel: [f64; 2],
    depth: f64,
    low: [f64; 2],
    high: [f64; 2],
}

impl Sums {
    const EMPTY: Self =
        Self { count: 0.0, pixel: [0.0; 2], depth: 0.0, low: [f64::MAX; 2], high: [f64::MIN; 2] };

    fn add(&mut self, pixel: &Point2, depth: f64) {
        self.count += 1.0;
        self.depth += depth;
        for axis in 0..2 {
            self.pixel[axis] += pixel[axis];
            self.low[axis] = self.low[axis].min(pixel[axis]);
            self.high[axis] = self.high[axis].max(pixel[axis]);
        }
    }

    fn center(&self, kind: Center2d) -> Option<(Point2, f64)> {
        if self.count == 0.0 {
            return None;
        }
        let at = |axis: usize| match kind {
            Center2d::Mass => self.pixel[axis] / self.count,
            Center2d::Rectangle => 0.5 * (self.low[axis] + self.high[axis]),
        };
        Some((Point2::new(at(0), at(1)), self.depth / self.count))
    }
}

/// The direction in which the camera lies from the vehicle: 0 ahead of it, growing to its right.
pub(super) fn azimuth(camera_from_vehicle: &Pose) -> f64 {
    let camera_in_vehicle = camera_from_vehicle.inverse().translation.vector;
    camera_in_vehicle.x.atan2(camera_in_vehicle.z)
}

/// One viewpoint of the table.
#[derive(Clone, Debug)]
pub(super) struct Viewpoint {
    /// As [`azimuth`].
    pub azimuth: f64,
    /// Visible centres in the coordinates of the model, and the share of the vehicle's pixels that each part has.
    pub parts: PartMap<(Point3, f64)>,
}

/// The visible centres of a model from viewpoints all around it.
pub(super) fn viewpoint_table(model: &VehicleModel, kind: Center2d) -> Vec<Viewpoint> {
    let camera = Camera::pinhole(1000.0, [0.0, 0.0], [1, 1]);
    let mut renderer = LabelRenderer::default();
    let viewpoint = |index: usize| {
        let azimuth = index as f64 / AZIMUTHS as f64 * TAU;
        let camera_from_vehicle = table_pose(azimuth, &model.extent());
        let cuboid = crate::geometry::Cuboid { camera_from_vehicle, extent: model.extent() };
        let window = cuboid.project(&camera)?;
        let view = View {
            camera: &camera,
            mesh: model.mesh(),
            scale: Vector3::repeat(1.0),
            camera_from_vehicle,
            is_closed: false,
        };
        let seen = visible_parts(&view, &window, kind, |_| true, &mut renderer);
        let total: f64 = seen.iter().map(|(_, part)| part.share).sum();
        let parts = seen.map(|_, part| (part.point_in_vehicle, part.share / total.max(1e-9)));
        Some(Viewpoint { azimuth, parts })
    };
    (0..AZIMUTHS).filter_map(viewpoint).collect()
}

/// A level vehicle seen from `azimuth`, with its middle on the viewing axis.
fn table_pose(azimuth: f64, extent: &Extent) -> Pose {
    let eye =
        Point3::new(TABLE_DISTANCE * azimuth.sin(), -TABLE_HEIGHT, TABLE_DISTANCE * azimuth.cos());
    let target = Point3::new(0.0, -0.5 * extent.height, 0.0);
    let forward = (target - eye).normalize();
    // y is down in the vehicle frame, so right is down x forward.
    let right = Vector3::y().cross(&forward).normalize();
    let down = forward.cross(&right);
    let camera_from_vehicle =
        nalgebra::Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(
        &nalgebra::Rotation3::from_matrix_unchecked(camera_from_vehicle),
    );
    Pose::from_parts((rotation * -eye.coords).into(), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_pose_looks_at_the_vehicle_from_its_azimuth() {
        let extent = Extent::new(1.8, 1.5, 4.5);
        for turn in [0.0, 0.7, -1.9, 3.0] {
            let pose = table_pose(turn, &extent);
            assert!((azimuth(&pose) - turn).abs() < 1e-9);
            let middle = pose * Point3::new(0.0, -0.75, 0.0);
            assert!(middle.x.abs() < 1e-9 && middle.y.abs() < 1e-9 && middle.z > 17.0);
            // Down stays down.
            assert!((pose * Vector3::y()).y > 0.99);
        }
    }
}
