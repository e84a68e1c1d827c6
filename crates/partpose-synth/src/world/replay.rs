//! Camera path and vehicles of a data set's sequence, so that poses, distances and occlusion are those of real labels.
//!
//! What is made so is for comparison only: it follows the labels of its data set, and so does their licence.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use partpose::dataset::{Dataset, DatasetError, Frame, SequenceId, VehicleLabel};
use partpose::geometry::{Camera, Pose};

use super::fleet::Fleet;
use super::path::Path;
use super::plan::SceneKind;
use super::population::Candidate;
use super::traffic::Place;

/// Distance within which vehicles tell the height of the ground under the camera, metres.
const NEAR: f64 = 25.0;
/// Height of the camera where no vehicle tells it, metres.
const HEIGHT: f64 = 1.5;

/// Why a layout cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LayoutError {
    /// The sequence cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Not a single frame has a camera pose.
    #[error("the sequence `{sequence}` has no frame with a camera pose in the world")]
    NoPoses {
        /// The sequence.
        sequence: SequenceId,
    },
}

/// The camera path and the vehicles of a sequence.
#[derive(Debug)]
pub struct Layout {
    sequence: SequenceId,
    frames: BTreeMap<u32, Frame>,
    /// The line on the ground along which the camera moves.
    path: Path,
    /// Places of the camera along it, by frame.
    stations: Vec<(u32, f64, Point3<f64>)>,
}

impl Layout {
    /// Reads a sequence; frames without a camera pose are left out.
    pub fn read(dataset: &Dataset, sequence: &SequenceId) -> Result<Self, LayoutError> {
        let frames: BTreeMap<u32, Frame> = dataset
            .frames(sequence)?
            .into_iter()
            .filter(|frame| frame.world_from_camera.is_some())
            .map(|frame| (frame.index, frame))
            .collect();
        let mut line: Vec<Point3<f64>> = Vec::new();
        let mut stations = Vec::new();
        let mut along = 0.0;
        let mut height = HEIGHT;
        for (index, frame) in &frames {
            let Some(pose) = frame.world_from_camera else { continue };
            height += 0.15 * (camera_height(frame, &pose).unwrap_or(height) - height);
            let at = Point3::from(pose.translation.vector + Vector3::y() * height);
            if let Some(before) = line.last() {
                let step = (at - before).norm();
                // A camera that stands does not make a path of its own trembling.
                if step > 0.2 {
                    along += step;
                    line.push(at);
                }
            } else {
                line.push(at);
            }
            stations.push((*index, along, at));
        }
        let Some(first) = frames.values().next().and_then(|frame| frame.world_from_camera) else {
            return Err(LayoutError::NoPoses { sequence: sequence.clone() });
        };
        // The ground goes on where the camera stops.
        let ahead = last_direction(&line).unwrap_or_else(|| level(first.rotation * Vector3::z()));
        if let Some(end) = line.last().copied() {
            line.push(end + ahead * 300.0);
        }
        let behind = first_direction(&line).unwrap_or(ahead);
        if let Some(start) = line.first().copied() {
            line.insert(0, start - behind * 60.0);
        }
        let path = Path::through(&line, -60.0);
        Ok(Self { sequence: sequence.clone(), frames, path, stations })
    }

    /// The indices of its frames.
    pub fn frame_indices(&self) -> Vec<u32> {
        self.frames.keys().copied().collect()
    }

    /// The sequence it was read from.
    pub fn sequence(&self) -> &SequenceId {
        &self.sequence
    }

    /// Surroundings like those of the world it comes from, as far as its number tells.
    pub(crate) fn kind(&self) -> SceneKind {
        match self.sequence.world.as_str() {
            "0018" => SceneKind::Forest,
            "0020" => SceneKind::Highway,
            _ => SceneKind::Urban,
        }
    }

    pub(crate) fn camera(&self) -> Camera {
        let first = self.frames.values().next();
        first.map_or_else(|| super::CameraOptions::default().camera, |frame| frame.camera)
    }

    pub(crate) fn path(&self) -> Path {
        self.path.clone()
    }

    /// Pose of the camera in a frame; in one that is missing, that of the frame before.
    pub(crate) fn camera_pose(&self, frame: u32) -> Pose {
        let before = self.frames.range(..=frame).next_back().or_else(|| self.frames.iter().next());
        before.and_then(|(_, frame)| frame.world_from_camera).unwrap_or_else(Pose::identity)
    }

    /// How far along the path a camera is.
    pub(crate) fn along(&self, world_from_camera: &Pose) -> f64 {
        let at = Point3::from(world_from_camera.translation.vector);
        let nearest = self
            .stations
            .iter()
            .min_by(|a, b| (a.2 - at).norm_squared().total_cmp(&(b.2 - at).norm_squared()));
        nearest.map_or(0.0, |(_, along, _)| *along)
    }

    /// The vehicles of a frame.
    pub(crate) fn candidates(&self, index: u32, fleet: &Fleet, seed: u64) -> Vec<Candidate> {
        let Some(frame) = self.frames.get(&index) else { return Vec::new() };
        let Some(world_from_camera) = frame.world_from_camera else { return Vec::new() };
        let mut found = Vec::new();
        for (at, label) in frame.vehicles.iter().enumerate() {
            let number = label.track.unwrap_or(1_000_000 + at as u32) & 0x3f_ffff;
            // Fire trucks and ambulances bear no part labels there; they are left out here.
            if label.category != "Car" {
                continue;
            }
            let mesh = label.model.as_deref().unwrap_or_default();
            let words = [0x4e1, i64::from(number)];
            let Some(vehicle) =
                fleet.like(seed, &words, mesh, &label.category, label.cuboid.extent)
            else {
                continue;
            };
            let world_from_vehicle = world_from_camera * label.cuboid.camera_from_vehicle;
            let moving = self.moves(index, label, &world_from_vehicle);
            let place = Place {
                index: i64::from(number),
                world_from_vehicle,
                moving,
                speed: 0.0,
                braking: false,
                parked: !moving,
            };
            found.push(Candidate::Vehicle { vehicle, place, track: number });
        }
        found
    }

    fn moves(&self, index: u32, label: &VehicleLabel, world_from_vehicle: &Pose) -> bool {
        let next = || {
            let frame = self.frames.get(&(index + 1))?;
            let same = frame.vehicles.iter().find(|other| other.track == label.track)?;
            Some(frame.world_from_camera? * same.cuboid.camera_from_vehicle)
        };
        next().is_some_and(|next| {
            (next.translation.vector - world_from_vehicle.translation.vector).norm() > 0.01
        })
    }

    /// Metres beside the path that vehicles need, for every piece of it.
    pub(crate) fn clearances(&self, piece: f64) -> Vec<f64> {
        let last = self.stations.last().map_or(0.0, |(_, along, _)| *along);
        let mut clear = vec![0.0_f64; ((last + 300.0) / piece).ceil() as usize + 1];
        for frame in self.frames.values() {
            let Some(pose) = frame.world_from_camera else { continue };
            let own = self.along(&pose);
            for vehicle in &frame.vehicles {
                let at = vehicle.cuboid.camera_from_vehicle.translation.vector;
                let s = own + at.z;
                let world = pose * Point3::from(at);
                let beside = self.path.pose(s).inverse() * world;
                let i = (s / piece).floor();
                if i >= 0.0 && (i as usize) < clear.len() {
                    let i = i as usize;
                    clear[i] = clear[i].max(beside.x.abs() + 2.8);
                }
            }
        }
        clear
    }
}

/// Height of the camera above the bottoms of the vehicles near it, metres.
fn camera_height(frame: &Frame, world_from_camera: &Pose) -> Option<f64> {
    let bottom = |vehicle: &VehicleLabel| {
        let at = vehicle.cuboid.camera_from_vehicle.translation.vector;
        (at.norm() < NEAR).then(|| (world_from_camera.rotation * at).y)
    };
    let mut heights: Vec<f64> = frame.vehicles.iter().filter_map(bottom).collect();
    heights.sort_by(f64::total_cmp);
    heights.get(heights.len() / 2).copied()
}

fn level(direction: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(direction.x, 0.0, direction.z).try_normalize(1e-9).unwrap_or_else(Vector3::z)
}

fn last_direction(line: &[Point3<f64>]) -> Option<Vector3<f64>> {
    let [.., a, b] = line else { return None };
    (b - a).try_normalize(1e-9)
}

fn first_direction(line: &[Point3<f64>]) -> Option<Vector3<f64>> {
    let [a, b, ..] = line else { return None };
    (b - a).try_normalize(1e-9)
}
