//! Whether the labels of a data set agree with each other: parts, segmentation, cuboids, and labels made anew.
//!
//! Three claims are checked pixel by pixel. Whatever the segmentation calls a vehicle with a row in the tables carries a
//! part, and nothing else does. Every such pixel lies on the vehicle's reprojected cuboid, but for its mirrors and for
//! doors and boots that stand open: a cuboid is that of the closed body. What stands open lies on a cuboid of its own, by
//! the model. And the labels that the labelling pipeline makes from the written rows, models and segmentation are those
//! that were drawn.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Point2, Point3, Translation3};
use partpose::dataset::{Dataset, Frame, SegmentColor, SequenceId, VehicleLabel};
use partpose::files::{self, RgbImage};
use partpose::geometry::{Camera, Cuboid, Extent};
use partpose::labeling::{LabelOptions, ModelChoice, Segmentation, Zoos, label_frame};
use partpose::parts::PartClass;
use partpose::render::LabelRenderer;
use partpose::vehicle::ModelZoo;
use rayon::prelude::*;

use super::{SynthError, ZOO};
use crate::vehicles::leaf;

/// How far beside a cuboid a pixel may lie, pixels: half of one, since a pixel is an area.
const BESIDE: f64 = 0.5;

/// What was counted over the frames of a sequence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verified {
    /// Frames.
    pub frames: usize,
    /// Pixels that the segmentation gives to a vehicle with a row.
    pub vehicle: u64,
    /// Those of them that carry no part.
    pub without_part: u64,
    /// Pixels with a part that the segmentation gives to something else.
    pub stray: u64,
    /// Pixels of vehicles, but for mirrors, that lie beside their reprojected cuboid; of what stands open those that lie
    /// beside its own cuboid too.
    pub outside: u64,
    /// Pixels of what stands open.
    pub open: u64,
    /// Pixels where labels made anew, with the segmentation, show another part or none.
    pub relabelled: u64,
    /// The same without the segmentation: what other things than vehicles hide is not known then.
    pub relabelled_blind: u64,
}

impl Verified {
    /// Whether all three claims hold.
    pub fn is_clean(&self) -> bool {
        self.without_part + self.stray + self.outside + self.relabelled == 0
    }

    /// The sum of two counts.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            vehicle: self.vehicle + other.vehicle,
            without_part: self.without_part + other.without_part,
            stray: self.stray + other.stray,
            outside: self.outside + other.outside,
            open: self.open + other.open,
            relabelled: self.relabelled + other.relabelled,
            relabelled_blind: self.relabelled_blind + other.relabelled_blind,
        }
    }
}

/// Checks every frame of a synthetic data set, by sequence.
pub fn verify(root: &Path) -> Result<Vec<(SequenceId, Verified)>, SynthError> {
    let path = root.join(ZOO);
    if !path.is_dir() {
        return Err(SynthError::NotSynthetic { path: root.to_owned(), missing: ZOO });
    }
    let zoo = ModelZoo::load(&path)?;
    let dataset = Dataset::open(root)?;
    let mut verified = Vec::new();
    for id in dataset.sequences() {
        let colors = dataset.segment_colors(id)?;
        let counts = dataset
            .frames(id)?
            .par_iter()
            .map_init(LabelRenderer::default, |renderer, one| frame(one, &colors, &zoo, renderer))
            .try_reduce(Verified::default, |a, b| Ok(a.plus(b)))?;
        verified.push((id.clone(), counts));
    }
    Ok(verified)
}

fn frame(
    frame: &Frame,
    colors: &[SegmentColor],
    zoo: &ModelZoo,
    renderer: &mut LabelRenderer,
) -> Result<Verified, SynthError> {
    let (Some(classes), Some(_)) = (&frame.classes, &frame.parts) else {
        let path = frame.image.clone().unwrap_or_default();
        return Err(SynthError::NotSynthetic { path, missing: "parts or scenegt of a frame" });
    };
    let parts = frame.read_parts()?.labels;
    let owners = owners(&files::read_rgb(classes)?, frame, colors);
    let leaves: Vec<_> = frame.vehicles.iter().map(|vehicle| leaf_cuboid(vehicle, zoo)).collect();
    let mut found = Verified { frames: 1, ..Verified::default() };
    let width = frame.camera.size[0].max(1) as usize;
    for (at, (owner, part)) in owners.iter().zip(&parts).enumerate() {
        let Some(owner) = owner else {
            found.stray += u64::from(*part != 0);
            continue;
        };
        found.vehicle += 1;
        found.without_part += u64::from(*part == 0);
        if PartClass::from_id(*part).is_some_and(is_mirror) {
            continue;
        }
        let pixel = Point2::new((at % width) as f64, (at / width) as f64);
        let mut inside = is_on(&frame.vehicles[*owner].cuboid, &frame.camera, pixel);
        if let Some((parts, cuboid)) = &leaves[*owner]
            && PartClass::from_id(*part).is_some_and(|part| parts.contains(&part))
        {
            found.open += 1;
            inside |= is_on(cuboid, &frame.camera, pixel);
        }
        found.outside += u64::from(!inside);
    }
    let zoos = Zoos::single(zoo);
    let options = LabelOptions { models: ModelChoice::Name, ..LabelOptions::default() };
    let segmentation = Segmentation::read(frame, colors)?;
    let mut differing = |segmentation: Option<&Segmentation>| -> Result<u64, SynthError> {
        let anew = label_frame(frame, &zoos, &options, segmentation, renderer)?;
        Ok(anew.parts.iter().zip(&parts).filter(|(anew, drawn)| anew != drawn).count() as u64)
    };
    found.relabelled = differing(segmentation.as_ref())?;
    found.relabelled_blind = differing(None)?;
    Ok(found)
}

/// What stands open of a vehicle: its parts, and the cuboid around them with the axes of the vehicle.
fn leaf_cuboid(vehicle: &VehicleLabel, zoo: &ModelZoo) -> Option<(&'static [PartClass], Cuboid)> {
    let model = zoo.get(vehicle.model.as_deref()?)?;
    let (parts, faces) = leaf(model)?;
    let scale = vehicle.cuboid.extent.ratio(&model.extent());
    let corners = || faces.iter().flatten().map(|corner| corner.coords.component_mul(&scale));
    let first = corners().next()?;
    let (low, high) = corners().fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
    let side = high - low;
    // The origin of a cuboid is the middle of its bottom face, and y points down.
    let middle = 0.5 * (low + high);
    let bottom = Translation3::new(middle.x, high.y, middle.z);
    let cuboid = Cuboid {
        camera_from_vehicle: vehicle.cuboid.camera_from_vehicle * bottom,
        extent: Extent::new(side.x, side.y, side.z),
    };
    Some((parts, cuboid))
}

fn is_mirror(part: PartClass) -> bool {
    matches!(part, PartClass::MirrorLeft | PartClass::MirrorRight)
}

/// The vehicle of every pixel, by its position in the frame.
fn owners(image: &RgbImage, frame: &Frame, colors: &[SegmentColor]) -> Vec<Option<usize>> {
    let rows: BTreeMap<u32, usize> = frame
        .vehicles
        .iter()
        .enumerate()
        .filter_map(|(at, vehicle)| Some((vehicle.track?, at)))
        .collect();
    let known: BTreeMap<[u8; 3], usize> =
        colors.iter().filter_map(|color| Some((color.rgb, *rows.get(&color.track?)?))).collect();
    let pixels = image.pixels.chunks_exact(3);
    pixels.map(|rgb| known.get(&[rgb[0], rgb[1], rgb[2]]).copied()).collect()
}

/// Whether a pixel sees a cuboid, at its middle or half a pixel beside it.
fn is_on(cuboid: &Cuboid, camera: &Camera, pixel: Point2<f64>) -> bool {
    let steps = [[0.0, 0.0], [-BESIDE, 0.0], [BESIDE, 0.0], [0.0, -BESIDE], [0.0, BESIDE]];
    steps.iter().any(|[x, y]| sees(cuboid, camera, Point2::new(pixel.x + x, pixel.y + y)))
}

/// Whether the ray of a point in the image meets a cuboid: the slabs of its three pairs of faces.
fn sees(cuboid: &Cuboid, camera: &Camera, pixel: Point2<f64>) -> bool {
    let vehicle_from_camera = cuboid.camera_from_vehicle.inverse();
    let from = vehicle_from_camera * Point3::origin();
    let along = vehicle_from_camera * camera.ray(&pixel);
    let side = cuboid.extent;
    let low = [-0.5 * side.width, -side.height, -0.5 * side.length];
    let high = [0.5 * side.width, 0.0, 0.5 * side.length];
    let (mut enters, mut leaves) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let [a, b] = [low, high].map(|face| (face[axis] - from[axis]) / along[axis]);
        if along[axis] == 0.0 {
            if from[axis] < low[axis] || from[axis] > high[axis] {
                return false;
            }
        } else {
            enters = enters.max(a.min(b));
            leaves = leaves.min(a.max(b));
        }
    }
    enters <= leaves
}

#[cfg(test)]
mod tests {
    use super::*;
    use partpose::geometry::{Pose, Vector3};

    const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);

    #[test]
    fn a_cuboid_is_seen_within_its_projection_and_not_beside_it() {
        let cuboid = Cuboid {
            camera_from_vehicle: Pose::new(Vector3::new(2.0, 1.6, 14.0), Vector3::y() * 0.7),
            extent: Extent::new(1.8, 1.5, 4.3),
        };
        let center = CAMERA.project(&cuboid.center()).unwrap();
        assert!(is_on(&cuboid, &CAMERA, center));
        let rect = cuboid.project(&CAMERA).unwrap();
        let corner = cuboid.corners().map(|corner| CAMERA.project(&corner).unwrap());
        let left = corner.iter().min_by(|a, b| a.x.total_cmp(&b.x)).unwrap();
        assert!((left.x - rect.x_min).abs() < 1e-9);
        assert!(is_on(&cuboid, &CAMERA, Point2::new(left.x - 0.4, left.y)));
        assert!(!is_on(&cuboid, &CAMERA, Point2::new(left.x - 0.6, left.y)));
        assert!(!is_on(&cuboid, &CAMERA, Point2::new(center.x, rect.y_max + 1.0)));
    }

    #[test]
    fn a_cuboid_around_the_camera_is_seen_everywhere_and_one_behind_nowhere() {
        let at = |z: f64| Cuboid {
            camera_from_vehicle: Pose::translation(0.0, 1.0, z),
            extent: Extent::new(2.0, 2.0, 4.0),
        };
        let pixel = Point2::new(1200.0, 3.0);
        assert!(sees(&at(0.0), &CAMERA, pixel));
        assert!(!sees(&at(-8.0), &CAMERA, Point2::new(620.5, 187.0)));
    }
}
