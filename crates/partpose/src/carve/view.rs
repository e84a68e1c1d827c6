//! What one image says of one vehicle: a window of labels in which foreign pixels are marked as unknown.
//!
//! Masks carry no instance ids. A pixel that a nearer vehicle may cover is unknown; a part pixel that a farther vehicle
//! may have drawn is ambiguous: the vehicle is either there or not, but no background is seen. Vehicles are first taken
//! for their cuboids, later for their carved models. Label 0 on the vehicle itself, from trees and poles that the masks
//! cut out, is found later (`occluders.rs`).

use crate::dataset::Frame;
use crate::geometry::{Camera, Extent, Point3, Pose, Rect, Vector3};
use crate::parts::{PartClass, PartMask};
use crate::pose::dense::MaskBias;
use crate::render::{Instance, LabelImage, render_labels};
use crate::vehicle::Mesh;

/// Nothing is known of this pixel.
pub(super) const UNKNOWN: u8 = 255;
/// Added to the label of a part pixel that may belong to a farther vehicle.
pub(super) const AMBIGUOUS: u8 = 0x40;
/// Vehicles nearer than this, metres, are not used: their projection is too wide to be of use.
const MIN_DEPTH: f64 = 0.8;
/// Pixels by which a foreign model's silhouette is widened before its pixels are taken as foreign.
const FOREIGN_MARGIN: usize = 2;
/// Pixels around the cuboid's projection that belong to the window.
const WINDOW_MARGIN: f64 = 6.0;

/// A vehicle of another row in the same image.
#[derive(Clone, Debug)]
pub(super) struct Neighbour {
    /// Its mesh name.
    pub(super) model: Option<String>,
    pub(super) camera_from_vehicle: Pose,
    pub(super) extent: Extent,
    /// The annotated box, image coordinates.
    pub(super) bounds: Rect,
    /// Whether it stands in front of the vehicle of the view.
    pub(super) nearer: bool,
    /// Whether its cuboid lies wholly in front of the camera.
    pub(super) drawable: bool,
}

/// One vehicle in one image.
#[derive(Clone, Debug)]
pub(super) struct View {
    /// Number of the vehicle: rows of one track share it.
    pub(super) track: usize,
    /// The window's camera: that of the frame, with the principal point moved.
    pub(super) camera: Camera,
    /// Image coordinates of the window's first pixel.
    pub(super) origin: [i32; 2],
    pub(super) camera_from_vehicle: Pose,
    pub(super) extent: Extent,
    /// Height of the annotated box, pixels.
    pub(super) box_height: f64,
    /// Share of the box that the image cuts off.
    pub(super) truncation: f64,
    /// Labels as in the file.
    pub(super) raw: Vec<u8>,
    /// Labels with foreign pixels marked; see [`UNKNOWN`] and [`AMBIGUOUS`].
    pub(super) labels: Vec<u8>,
    pub(super) neighbours: Vec<Neighbour>,
    /// Part pixels over known pixels inside the cuboid's projection.
    pub(super) fill: f64,
    /// Known pixels over all pixels inside the cuboid's projection, the part beyond the image included.
    pub(super) known: f64,
    /// The pixels inside the cuboid's projection.
    pub(super) inside_cuboid: Vec<bool>,
}

impl View {
    /// Rows `[u z, v z, z]` of the projection of a point given in the coordinates of a model with extent `model`.
    pub(super) fn projection(&self, model: &Extent) -> [[f32; 4]; 3] {
        let scale = self.extent.ratio(model);
        let rotation = self.camera_from_vehicle.rotation.to_rotation_matrix();
        let t = self.camera_from_vehicle.translation.vector;
        let row = |r: usize| -> [f64; 4] {
            [
                rotation[(r, 0)] * scale.x,
                rotation[(r, 1)] * scale.y,
                rotation[(r, 2)] * scale.z,
                t[r],
            ]
        };
        let (x, y, z) = (row(0), row(1), row(2));
        let [fx, fy] = self.camera.focal;
        let [cx, cy] = self.camera.principal_point;
        [
            std::array::from_fn(|i| (fx * x[i] + cx * z[i]) as f32),
            std::array::from_fn(|i| (fy * y[i] + cy * z[i]) as f32),
            std::array::from_fn(|i| z[i] as f32),
        ]
    }

    /// Width and height of the window.
    pub(super) fn size(&self) -> [usize; 2] {
        self.camera.size.map(|side| side as usize)
    }

    /// Pixels a metre at the vehicle's centre.
    pub(super) fn resolution(&self) -> f64 {
        let center = self.camera_from_vehicle * Point3::new(0.0, -0.5 * self.extent.height, 0.0);
        0.5 * (self.camera.focal[0] + self.camera.focal[1]) / center.z
    }

    /// Where the camera stands: azimuth about the vehicle's vertical axis, 0 ahead, positive to the right, +-pi behind.
    pub(super) fn azimuth(&self) -> f64 {
        let eye = self.camera_from_vehicle.inverse_transform_point(&Point3::origin());
        eye.x.atan2(eye.z)
    }

    /// Draws a mesh given in the coordinates of a model with extent `model` into the window.
    pub(super) fn render(&self, mesh: &Mesh, model: &Extent) -> LabelImage {
        let scale = self.extent.ratio(model);
        let camera_from_vehicle = self.camera_from_vehicle;
        render_labels(&self.camera, &[Instance { mesh, scale, camera_from_vehicle, id: 1 }])
    }
}

/// The view of one row of a frame; `None` where too little of it can be seen to be of use.
///
/// `bias` says how far masks lie off the true outlines; the view's camera sees the vehicle as the mask shows it.
pub(super) fn view_of_row(
    frame: &Frame,
    mask: &PartMask,
    row: usize,
    bias: Option<&MaskBias>,
) -> Option<View> {
    let vehicle = frame.vehicles.get(row)?;
    let cuboid = &vehicle.cuboid;
    let corners = cuboid.corners();
    if !cuboid.extent.is_valid() || corners.iter().any(|corner| corner.z < MIN_DEPTH) {
        return None;
    }
    let mut wide = *cuboid;
    let grown = cuboid.extent.to_vector().component_mul(&Vector3::new(1.30, 1.10, 1.06));
    wide.extent = Extent::new(grown.x, grown.y, grown.z);
    wide.camera_from_vehicle *= nalgebra::Translation3::new(0.0, 0.05 * cuboid.extent.height, 0.0);
    let rect = wide.project(&frame.camera).or_else(|| cuboid.project(&frame.camera))?;
    let rect = Rect::new(
        rect.x_min - WINDOW_MARGIN,
        rect.y_min - WINDOW_MARGIN,
        rect.x_max + WINDOW_MARGIN,
        rect.y_max + WINDOW_MARGIN,
    );
    let (x0, y0, x1, y1) = rect.pixels(frame.camera.size);
    if x1 <= x0 + 4 || y1 <= y0 + 4 {
        return None;
    }
    let mut camera = bias.map_or(frame.camera, |bias| bias.camera(&frame.camera, cuboid));
    camera.size = [x1 - x0, y1 - y0];
    camera.principal_point[0] -= f64::from(x0);
    camera.principal_point[1] -= f64::from(y0);
    let mut raw = Vec::with_capacity(((x1 - x0) * (y1 - y0)) as usize);
    for y in y0..y1 {
        raw.extend((x0..x1).map(|x| mask.at(x as i32, y as i32)));
    }
    let distance = cuboid.center().coords.norm();
    let window = Rect::new(f64::from(x0), f64::from(y0), f64::from(x1), f64::from(y1));
    let neighbours = frame.vehicles.iter().enumerate().filter(|(other, _)| *other != row);
    let neighbours = neighbours.filter_map(|(_, other)| {
        let projected = other.cuboid.project(&frame.camera);
        let drawable = projected.is_some() && other.cuboid.corners().iter().all(|c| c.z > 0.2);
        let reach = projected.unwrap_or(other.bounds);
        window.intersection(&reach).is_some().then(|| Neighbour {
            model: other.model.clone(),
            camera_from_vehicle: other.cuboid.camera_from_vehicle,
            extent: other.cuboid.extent,
            bounds: other.bounds,
            nearer: other.cuboid.center().coords.norm() < distance,
            drawable,
        })
    });
    let mut view = View {
        track: 0,
        camera,
        origin: [x0 as i32, y0 as i32],
        camera_from_vehicle: cuboid.camera_from_vehicle,
        extent: cuboid.extent,
        box_height: vehicle.bounds.height(),
        truncation: vehicle.truncation,
        labels: raw.clone(),
        raw,
        neighbours: neighbours.collect(),
        fill: 0.0,
        known: 0.0,
        inside_cuboid: Vec::new(),
    };
    let unit = cuboid_mesh(&Extent::new(1.0, 1.0, 1.0));
    let seen = view.render(&unit, &Extent::new(1.0, 1.0, 1.0));
    view.inside_cuboid = seen.parts.iter().map(|part| *part != 0).collect();
    mark_foreign(&mut view, &[]);
    (view.known > 0.0).then_some(view)
}

/// Marks the pixels of other vehicles, which are drawn as their models where `models` has them, else as cuboids.
pub(super) fn mark_foreign(view: &mut View, models: &[(&str, &Mesh, Extent)]) {
    let [width, height] = view.size();
    let mut labels = view.raw.clone();
    let own = dilate(&view.inside_cuboid, [width, height], FOREIGN_MARGIN);
    for (label, own) in labels.iter_mut().zip(&own) {
        if *label != 0 && !own {
            *label = UNKNOWN;
        }
    }
    let unit = Extent::new(1.0, 1.0, 1.0);
    let cuboid = cuboid_mesh(&unit);
    for neighbour in &view.neighbours {
        let model = models.iter().find(|(name, ..)| Some(*name) == neighbour.model.as_deref());
        let covered = if neighbour.drawable {
            let (mesh, extent) =
                model.map_or((&cuboid, unit), |(_, mesh, extent)| (*mesh, *extent));
            let instance = Instance {
                mesh,
                scale: neighbour.extent.ratio(&extent),
                camera_from_vehicle: neighbour.camera_from_vehicle,
                id: 1,
            };
            render_labels(&view.camera, &[instance]).parts.iter().map(|part| *part != 0).collect()
        } else {
            pixels_of_rect(view, &neighbour.bounds)
        };
        for (label, covered) in
            labels.iter_mut().zip(dilate(&covered, [width, height], FOREIGN_MARGIN))
        {
            if covered && neighbour.nearer {
                *label = UNKNOWN;
            } else if covered && *label != 0 && *label < AMBIGUOUS {
                *label |= AMBIGUOUS;
            }
        }
    }
    view.labels = labels;
    let (mut part, mut known, mut all) = (0, 0, 0);
    for (label, _) in view.labels.iter().zip(&view.inside_cuboid).filter(|(_, inside)| **inside) {
        all += 1;
        known += usize::from(*label != UNKNOWN);
        part += usize::from(*label != UNKNOWN && *label != 0);
    }
    view.fill = part as f64 / (known as f64).max(1.0);
    view.known = known as f64 / f64::from(all).max(1.0) * (1.0 - view.truncation);
}

fn pixels_of_rect(view: &View, rect: &Rect) -> Vec<bool> {
    let [width, height] = view.size();
    let mut inside = vec![false; width * height];
    for y in 0..height {
        for x in 0..width {
            let (u, v) =
                (f64::from(x as i32 + view.origin[0]), f64::from(y as i32 + view.origin[1]));
            inside[y * width + x] =
                (rect.x_min..=rect.x_max).contains(&u) && (rect.y_min..=rect.y_max).contains(&v);
        }
    }
    inside
}

/// Widens a set of pixels by a square of the given radius.
pub(super) fn dilate(set: &[bool], [width, height]: [usize; 2], radius: usize) -> Vec<bool> {
    let mut rows = vec![false; set.len()];
    for y in 0..height {
        let row = &set[y * width..(y + 1) * width];
        for x in 0..width {
            let range = x.saturating_sub(radius)..(x + radius + 1).min(width);
            rows[y * width + x] = row[range].contains(&true);
        }
    }
    let mut wide = vec![false; set.len()];
    for y in 0..height {
        for near in y.saturating_sub(radius)..(y + radius + 1).min(height) {
            for x in 0..width {
                wide[y * width + x] |= rows[near * width + x];
            }
        }
    }
    wide
}

/// The twelve triangles of a cuboid that stands on the origin.
pub(super) fn cuboid_mesh(extent: &Extent) -> Mesh {
    const QUADS: [[u32; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let corner = |i: usize| {
        let unit = Vector3::new(
            if i & 1 == 1 { 0.5 } else { -0.5 },
            if i >> 1 & 1 == 1 { -1.0 } else { 0.0 },
            if i >> 2 & 1 == 1 { 0.5 } else { -0.5 },
        );
        Point3::from(unit.component_mul(&extent.to_vector()))
    };
    let faces: Vec<_> =
        QUADS.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    let parts = vec![PartClass::Roof; faces.len()];
    Mesh { vertices: (0..8).map(corner).collect(), faces, parts }
}
