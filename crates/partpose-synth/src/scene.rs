//! What a picture is made of: objects with materials, light, air and a camera.
//!
//! This is the seam between the world, which places things, and the shading, which draws them; both only know these
//! plain types.

use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use partpose::geometry::{Camera, Pose};
use partpose::vehicle::Mesh;

/// One moment, ready to be drawn.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What there is.
    pub objects: Vec<Object>,
    /// Sun and sky.
    pub light: Light,
    /// Fog, rain, wetness.
    pub air: Air,
    /// The ideal pinhole camera.
    pub camera: Camera,
    /// Where it stands.
    pub world_from_camera: Pose,
    /// How far it moves and turns while the shutter is open: the pose at the end of the exposure.
    pub world_from_camera_after: Pose,
    /// The same for vehicles: where each is at the end of the exposure, by [`Object::instance`] - 1. Empty where nothing
    /// but the camera moves.
    pub world_from_vehicles_after: Vec<Pose>,
}

/// A mesh in its place.
#[derive(Clone, Debug)]
pub struct Object {
    /// Shared by all objects of its kind.
    pub mesh: Arc<SurfaceMesh>,
    /// The faces' materials, by [`SurfaceMesh::materials`].
    pub materials: Arc<[Material]>,
    /// Where it is.
    pub world_from_object: Pose,
    /// Factors per axis of the object's frame, applied first.
    pub scale: Vector3<f64>,
    /// Its class in `scenegt`.
    pub class: SegmentClass,
    /// Above 0 for vehicles that have a row in `motgt`: its place in the frame's list, counted from 1.
    pub instance: u16,
    /// Whether its part labels are drawn.
    pub has_parts: bool,
}

/// Triangles with what shading needs.
#[derive(Clone, Debug, Default)]
pub struct SurfaceMesh {
    /// Positions in the object's frame, metres.
    pub vertices: Vec<Point3<f32>>,
    /// Unit directions, one a vertex; shading interpolates them.
    pub normals: Vec<Vector3<f32>>,
    /// Texture coordinates in metres along the surface, one a vertex.
    pub coordinates: Vec<[f32; 2]>,
    /// Corners, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Index into [`Object::materials`] of every face.
    pub materials: Vec<u16>,
    /// Part id of every face, 0 for none.
    pub parts: Vec<u8>,
    /// Share of the sky that the object itself leaves open, one a vertex; empty where that is all of it.
    pub openness: Vec<f32>,
    /// Joints between panels and round windows; empty where there are none.
    pub joints: Joints,
    /// The mesh by which the labels are drawn; `None` for objects without parts.
    ///
    /// It is the model's own, so that labels made from poses and models equal these to the bit; the surface may only
    /// differ from it by what fits inside.
    pub labels: Option<Arc<Mesh>>,
    /// The same surface with fewer faces, for where it is far away and for shadows that fall there; it may have a still
    /// coarser one for twice that distance.
    pub coarse: Option<Arc<SurfaceMesh>>,
}

impl SurfaceMesh {
    /// The form for a distance, in units of that from which on fewer faces do.
    pub(crate) fn for_level(&self, distance: f64) -> &Self {
        match &self.coarse {
            Some(coarse) if distance > 1.0 => coarse.for_level(0.5 * distance),
            _ => self,
        }
    }
}

/// The joints of a mesh, by the faces that they come near.
#[derive(Clone, Debug, Default)]
pub struct Joints {
    /// Where the lines of every face begin, and after the last where they end.
    pub starts: Vec<u32>,
    /// The lines, face by face.
    pub lines: Vec<JointLine>,
}

impl Joints {
    /// Those near a face.
    pub(crate) fn near(&self, face: usize) -> &[JointLine] {
        let [Some(from), Some(to)] = [self.starts.get(face), self.starts.get(face + 1)] else {
            return &[];
        };
        self.lines.get(*from as usize..*to as usize).unwrap_or_default()
    }
}

/// A straight piece of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointLine {
    /// The vertices that it joins.
    pub ends: [u32; 2],
    /// What it is.
    pub kind: Joint,
}

/// What runs where panels meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joint {
    /// A gap between panels, a few millimetres wide.
    Gap,
    /// A rubber seal, as round windows.
    Seal,
}

/// How a surface takes light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Share of the light that is scattered back, linear RGB.
    pub color: [f32; 3],
    /// What varies the colour over the surface.
    pub texture: Texture,
    /// 0 mirror, 1 chalk.
    pub roughness: f32,
    /// 0 dielectric, 1 metal.
    pub metallic: f32,
    /// Share of a smooth clear layer on top.
    pub clear_coat: f32,
    /// Share of the light that comes through, tinted by the colour; the surface behind shows.
    pub transmission: f32,
    /// Light of its own, linear RGB; 1 is a white surface in full sun.
    pub emission: [f32; 3],
    /// Dirt, 0 to 1, more towards the ground.
    pub dirt: f32,
}

/// Patterns, computed where they are seen; no image files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Texture {
    /// One colour.
    Plain,
    /// The face is not there.
    Nothing,
    /// Fractal noise between the colour and another.
    Noise {
        /// The other colour, linear RGB.
        other: [f32; 3],
        /// Size of the largest blotches, metres.
        size: f32,
    },
    /// Asphalt: fine grain, patches, cracks, wheel tracks along the first coordinate.
    Asphalt,
    /// Stones or slabs in rows, with joints.
    Slabs {
        /// Width and height of a slab, metres.
        size: [f32; 2],
        /// Width of the joints, metres.
        joint: f32,
    },
    /// Rows of windows in a wall.
    Facade {
        /// Width and height of a window's field, metres.
        field: [f32; 2],
        /// Width and height of the window itself, metres.
        window: [f32; 2],
        /// Chooses colours of curtains and which windows are lit.
        seed: u32,
    },
    /// Leaves: parts of the face are not there.
    Leaves {
        /// Share that is there.
        cover: f32,
        /// Size of a leaf, metres.
        size: f32,
    },
    /// Blades of grass as noise in two scales.
    Grass,
    /// Slats along the first coordinate over a dark inside.
    Grille {
        /// Distance of the slats, metres.
        pitch: f32,
    },
    /// A wheel in its plane: coordinates are shares of its radius.
    Rim {
        /// Number of spokes.
        spokes: u8,
        /// Share of the rim's face that is metal.
        cover: f32,
    },
    /// A number plate, coordinates from its middle.
    Plate {
        /// Chooses the characters.
        seed: u32,
    },
    /// The inner side of a door: plastic with an armrest, coordinates as on its outer side.
    Lining {
        /// Colour of the upholstered field, linear RGB.
        leather: [f32; 3],
    },
    /// The ribs and cells of a lamp's reflector.
    Lamp {
        /// Size of a cell, metres.
        cell: f32,
    },
}

/// Sun and sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit direction towards the sun, world frame (y down, so up is negative).
    pub to_sun: Vector3<f64>,
    /// Haze of the sky: 2 very clear, 10 hazy.
    pub turbidity: f64,
    /// 0 clear, 1 the sun is hidden and the sky even.
    pub overcast: f64,
}

/// What is in the air and on the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Air {
    /// Share of light lost a metre.
    pub fog: f64,
    /// Streaks of rain: 0 none, 1 heavy.
    pub rain: f64,
    /// How wet the road is: 0 dry, 1 mirroring.
    pub wetness: f64,
}

/// Classes of Virtual KITTI's `scenegt`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[expect(missing_docs, reason = "the names say it")]
pub enum SegmentClass {
    Sky,
    Terrain,
    Tree,
    Vegetation,
    Building,
    Road,
    GuardRail,
    TrafficSign,
    TrafficLight,
    Pole,
    Misc,
    Truck,
    Car,
    Van,
}
