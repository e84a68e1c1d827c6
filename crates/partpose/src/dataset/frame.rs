//! One image with what is known of it.

use std::fmt;
use std::path::PathBuf;

use crate::files;
use crate::geometry::{Camera, Cuboid, Pose, Rect};
use crate::parts::{PartClass, PartMask};
use crate::render::Instance;
use crate::vehicle::ModelZoo;

use super::{DatasetError, Problem};

/// A run of consecutive frames: world and variation in Virtual KITTI's words (`0018`, `clone`).
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SequenceId {
    /// World or scene.
    pub world: String,
    /// Weather, light or camera variation; empty where a data set has none.
    pub variation: String,
}

impl fmt::Display for SequenceId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.variation.is_empty() {
            return f.write_str(&self.world);
        }
        write!(f, "{}/{}", self.world, self.variation)
    }
}

/// A labelled vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct VehicleLabel {
    /// Track id, unique in the sequence; a vehicle keeps it from frame to frame.
    pub track: Option<u32>,
    /// Type of the vehicle whatever its visibility: `Car`, `Van`, `Truck`.
    pub category: String,
    /// Whether the data set asks to ignore it (heavily occluded, truncated, tiny).
    pub dont_care: bool,
    /// 0 none, 1 truncated, 2 heavily.
    pub truncated: u8,
    /// 0 none, 1 occluded, 2 heavily.
    pub occluded: u8,
    /// Truncated share of the 2D extent, 0 to 1.
    pub truncation: f64,
    /// Visible pixels over pixels of the box, 0 to 1, where the data set has it.
    pub occupancy: Option<f64>,
    /// The annotated 2D box, clipped to the image.
    pub bounds: Rect,
    /// Pose and extent.
    pub cuboid: Cuboid,
    /// Name of the mesh that was rendered.
    pub model: Option<String>,
    /// Name of the paint.
    pub color: Option<String>,
}

/// What could be read of a sequence, and what could not.
#[derive(Clone, Debug, Default)]
pub struct SequenceFrames {
    /// The good frames in the order of their index.
    pub frames: Vec<Frame>,
    /// What was wrong, in the order of reading; at most [`super::MAX_PROBLEMS`].
    pub problems: Vec<Problem>,
    /// How many problems more there were.
    pub problems_omitted: usize,
    /// Indices of the frames that were left out because something in them is wrong.
    pub skipped: Vec<u32>,
    /// For every frame the lines of its vehicles.
    pub(super) lines: Vec<Vec<usize>>,
}

impl SequenceFrames {
    /// The line, counted from 1, that labels vehicle `vehicle` of frame `frame` (positions in the lists, which must
    /// be as they were read).
    pub fn line_of(&self, frame: usize, vehicle: usize) -> Option<usize> {
        self.lines.get(frame)?.get(vehicle).copied()
    }
}

/// One image with its camera, its labels, and where its files are.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The sequence it belongs to.
    pub sequence: SequenceId,
    /// Index in the sequence, from 0.
    pub index: u32,
    /// The camera of this frame.
    pub camera: Camera,
    /// Pose of the camera in the world, where it is known.
    pub world_from_camera: Option<Pose>,
    /// All labelled vehicles, those to ignore included.
    pub vehicles: Vec<VehicleLabel>,
    /// Areas where the data set neither confirms nor denies vehicles (KITTI's `DontCare`).
    pub ignored: Vec<Rect>,
    /// The RGB image, where it exists.
    pub image: Option<PathBuf>,
    /// The part mask, where it exists.
    pub parts: Option<PathBuf>,
    /// Depth along z in centimetres, 16-bit PNG, where it exists.
    pub depth: Option<PathBuf>,
    /// Class colours, where they exist; [`super::Dataset::segment_colors`] explains them.
    pub classes: Option<PathBuf>,
    /// Instances, where they exist: colours of [`super::Dataset::segment_colors`] in Virtual KITTI 1.3.1 (one image
    /// with the classes), track + 1 as palette index in 2.0.3.
    pub instances: Option<PathBuf>,
}

impl Frame {
    /// A frame without labels and files.
    pub fn new(sequence: SequenceId, index: u32, camera: Camera) -> Self {
        Self {
            sequence,
            index,
            camera,
            world_from_camera: None,
            vehicles: Vec::new(),
            ignored: Vec::new(),
            image: None,
            parts: None,
            depth: None,
            classes: None,
            instances: None,
        }
    }

    /// Name for messages: world, variation and index.
    pub fn name(&self) -> String {
        format!("{}/{:05}", self.sequence, self.index)
    }

    /// The vehicles whose models the zoo has, scaled to their labels' extents, ready to be drawn.
    ///
    /// The id of an instance is 1 + the index of the vehicle in [`Self::vehicles`].
    pub fn instances<'a>(&self, zoo: &'a ModelZoo) -> Vec<Instance<'a>> {
        // No more ids than 16 bits hold; readers leave frames out that have more vehicles.
        let labels = (1..u16::MAX).zip(&self.vehicles);
        let instances = labels.filter_map(|(id, vehicle)| {
            let model = zoo.get(vehicle.model.as_deref()?)?;
            Some(Instance {
                mesh: model.mesh(),
                scale: vehicle.cuboid.extent.ratio(&model.extent()),
                camera_from_vehicle: vehicle.cuboid.camera_from_vehicle,
                id,
            })
        });
        instances.collect()
    }

    /// Reads the part mask in the author's colours; an error where there is none or it has another size.
    pub fn read_parts(&self) -> Result<PartMask, DatasetError> {
        let path = self.parts.clone().ok_or_else(|| DatasetError::Image {
            path: PathBuf::from(self.name()),
            reason: "the frame has no part mask".to_owned(),
        })?;
        let image = files::read_rgb(&path)?;
        if image.size != self.camera.size {
            let reason =
                format!("{:?} pixels, but the camera has {:?}", image.size, self.camera.size);
            return Err(DatasetError::Image { path, reason });
        }
        let mut mask = PartMask::background([0, 0], image.size);
        let mut last = ([0; 3], 0u8);
        for (i, (label, rgb)) in
            mask.labels.iter_mut().zip(image.pixels.chunks_exact(3)).enumerate()
        {
            let color = [rgb[0], rgb[1], rgb[2]];
            if color != last.0 {
                let class = PartClass::ALL.into_iter().find(|class| class.color() == color);
                let id = class.map(PartClass::id).or((color == [0; 3]).then_some(0));
                let Some(id) = id else {
                    let (x, y) = (i as u32 % image.size[0], i as u32 / image.size[0]);
                    let reason =
                        format!("the colour {color:?} at ({x}, {y}) is not that of a part");
                    return Err(DatasetError::Image { path, reason });
                };
                last = (color, id);
            }
            *label = last.1;
        }
        Ok(mask)
    }
}
