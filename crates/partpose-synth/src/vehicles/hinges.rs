//! Doors and boots that stand open.
//!
//! The hinged parts of a model are turned about their hinge, in the mesh of the labels and in the surface alike, so that
//! labels follow by themselves: an open vehicle is a model of its own, with the extent of the closed one. Hinged faces
//! get a second side. What is seen through an opening counts as the body around it, as what is seen through glass counts
//! as glass: the label mesh has a lining there, a little further inside, which pictures do not show.

use std::collections::HashMap;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use partpose::parts::PartClass as P;
use partpose::vehicle::{Mesh, VehicleModel};

use crate::scene::{JointLine, Joints, SurfaceMesh};

use super::slots::Slot;

/// What stands open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Opening {
    DoorLeft,
    DoorRight,
    Boot,
}

/// How far doors stand open, radians.
const DOOR: f64 = 1.0;
/// How far boots do.
const BOOT: f64 = 1.25;
/// How far inside of the closed parts the lining of an opening lies, metres.
const INSIDE: f64 = 0.08;

impl Opening {
    pub(crate) const ALL: [Self; 3] = [Self::DoorLeft, Self::Boot, Self::DoorRight];

    /// What follows the name of the closed model.
    pub(crate) fn suffix(self) -> &'static str {
        match self {
            Self::DoorLeft => "-open-door-left",
            Self::DoorRight => "-open-door-right",
            Self::Boot => "-open-boot",
        }
    }

    /// The name of the closed model and what is open of one with a name.
    pub(crate) fn of_name(name: &str) -> Option<(&str, Self)> {
        Self::ALL
            .into_iter()
            .find_map(|opening| Some((name.strip_suffix(opening.suffix())?, opening)))
    }

    /// The parts that turn: the rear window too, but for bodies whose boot has a lid of its own.
    fn parts(self, body_style: &str) -> &'static [P] {
        match self {
            Self::DoorLeft => &[P::DoorFrontLeft, P::GlassFrontLeft, P::MirrorLeft],
            Self::DoorRight => &[P::DoorFrontRight, P::GlassFrontRight, P::MirrorRight],
            Self::Boot if matches!(body_style, "sedan" | "coupe" | "convertible") => &[P::Trunk],
            Self::Boot => &[P::Trunk, P::WindshieldRear],
        }
    }

    /// The part that an opening counts as.
    fn around(self) -> P {
        match self {
            Self::DoorLeft => P::SideLeft,
            Self::DoorRight => P::SideRight,
            Self::Boot => P::ApronRear,
        }
    }

    /// From the closed place of the hinged parts to the open one; `None` where a model has no such parts.
    fn turn(self, mesh: &Mesh, parts: &[P]) -> Option<Isometry3<f64>> {
        let leading = *parts.first()?;
        let hinged: Vec<Point3<f64>> = vertices(mesh, |part| parts.contains(&part)).collect();
        let (hinge, axis, angle) = match self {
            Self::DoorLeft | Self::DoorRight => {
                // Doors hang at their front edge.
                let front =
                    vertices(mesh, |part| part == leading).max_by(|a, b| a.z.total_cmp(&b.z))?;
                let angle = if self == Self::DoorLeft { DOOR } else { -DOOR };
                (front, Vector3::y_axis(), angle)
            }
            Self::Boot => {
                // The lid hangs at its upper front edge.
                let top = hinged.iter().map(|p| p.y).min_by(f64::total_cmp)?;
                let upper = hinged.iter().filter(|p| p.y < top + 0.03);
                let front = upper.max_by(|a, b| a.z.total_cmp(&b.z))?;
                (*front, Vector3::x_axis(), -BOOT)
            }
        };
        let to_hinge = Translation3::from(hinge.coords);
        let turn = UnitQuaternion::from_axis_angle(&axis, angle);
        Some(to_hinge * turn * to_hinge.inverse())
    }

    /// From a closed part to the lining of its opening.
    fn inwards(self) -> Vector3<f64> {
        match self {
            Self::DoorLeft => Vector3::new(INSIDE, 0.0, 0.0),
            Self::DoorRight => Vector3::new(-INSIDE, 0.0, 0.0),
            Self::Boot => Vector3::new(0.0, INSIDE, 1.5 * INSIDE),
        }
    }
}

/// A model with something open; `None` where it lacks the parts.
pub(crate) fn opened(model: &VehicleModel, opening: Opening) -> Option<VehicleModel> {
    let mesh = model.mesh();
    let parts = opening.parts(model.body_style());
    if parts.iter().any(|part| !mesh.parts.contains(part)) {
        return None;
    }
    let turn = opening.turn(mesh, parts)?;
    let mut open = Mesh { vertices: mesh.vertices.clone(), ..Mesh::default() };
    for (face, part) in mesh.faces.iter().zip(&mesh.parts) {
        if !parts.contains(part) {
            open.faces.push(*face);
            open.parts.push(*part);
            continue;
        }
        let corners = face.map(|i| mesh.vertices[i as usize]);
        let mut add = |corners: [Point3<f64>; 3], part: P| {
            let start = open.vertices.len() as u32;
            open.vertices.extend(corners);
            open.faces.push([start, start + 1, start + 2]);
            open.parts.push(part);
        };
        let [a, b, c] = corners.map(|p| turn * p);
        add([a, b, c], *part);
        if !is_mirror(*part) {
            add([a, c, b], *part);
            add(corners.map(|p| p + opening.inwards()), opening.around());
        }
    }
    let name = format!("{}{}", model.name(), opening.suffix());
    VehicleModel::new(&name, model.category(), model.body_style(), model.extent(), open).ok()
}

/// The parts that stand open of an opened model, and the corners of their faces; `None` for models that are closed.
pub(crate) fn leaf(model: &VehicleModel) -> Option<(&'static [P], Vec<[Point3<f64>; 3]>)> {
    let (_, opening) = Opening::of_name(model.name())?;
    let parts = opening.parts(model.body_style());
    let mesh = model.mesh();
    let faces = mesh.faces.iter().zip(&mesh.parts).filter(|(_, part)| parts.contains(part));
    let corners = faces.map(|(face, _)| face.map(|i| mesh.vertices[i as usize]));
    Some((parts, corners.collect()))
}

fn vertices(mesh: &Mesh, concerns: impl Fn(P) -> bool) -> impl Iterator<Item = Point3<f64>> {
    let faces = mesh.faces.iter().zip(&mesh.parts).filter(move |(_, part)| concerns(**part));
    faces.flat_map(|(face, _)| face.map(|i| mesh.vertices[i as usize]))
}

fn is_mirror(part: P) -> bool {
    matches!(part, P::MirrorLeft | P::MirrorRight)
}

/// The surface of a closed model opened in the same way; `closed` is its label mesh.
pub(super) fn opened_surface(
    surface: &SurfaceMesh,
    closed: &Mesh,
    opening: Opening,
    body_style: &str,
) -> SurfaceMesh {
    let parts = opening.parts(body_style);
    let Some(turn) = opening.turn(closed, parts) else { return surface.clone() };
    let turn: Isometry3<f32> = turn.cast();
    let mut open = surface.clone();
    open.labels = None;
    open.joints = Joints { starts: vec![0], lines: Vec::new() };
    let mut moved: HashMap<u32, u32> = HashMap::new();
    open.coarse = surface
        .coarse
        .as_ref()
        .map(|coarse| std::sync::Arc::new(opened_surface(coarse, closed, opening, body_style)));
    for face in 0..surface.faces.len() {
        let part = surface.parts.get(face).copied().and_then(P::from_id);
        let lines = surface.joints.near(face);
        let Some(part) = part.filter(|part| parts.contains(part)) else {
            open.joints.lines.extend_from_slice(lines);
            open.joints.starts.push(open.joints.lines.len() as u32);
            continue;
        };
        // The joints of what turns turn with it.
        for line in lines {
            let ends = line.ends.map(|end| {
                *moved.entry(end).or_insert_with(|| {
                    copied(surface, &mut open, [end as usize], |p| turn * p, |n| turn * n)
                })
            });
            open.joints.lines.push(JointLine { ends, ..*line });
        }
        open.joints.starts.push(open.joints.lines.len() as u32);
        let corners = surface.faces[face].map(|i| i as usize);
        let first = copied(surface, &mut open, corners, |p| turn * p, |n| turn * n);
        open.faces[face] = [first, first + 1, first + 2];
        if is_mirror(part) {
            continue;
        }
        let [a, b, c] = corners;
        let first = copied(surface, &mut open, [a, c, b], |p| turn * p, |n| turn * -n);
        open.faces.push([first, first + 1, first + 2]);
        open.parts.push(part as u8);
        let slot = surface.materials.get(face).copied().unwrap_or(0);
        let is_glass = slot == Slot::Glass as u16 || slot == Slot::RearGlass as u16;
        open.materials.push(if is_glass { slot } else { Slot::Lining as u16 });
    }
    open
}

/// Adds vertices like some of `surface`, elsewhere; gives the first.
fn copied<const N: usize>(
    surface: &SurfaceMesh,
    open: &mut SurfaceMesh,
    corners: [usize; N],
    place: impl Fn(Point3<f32>) -> Point3<f32>,
    turn: impl Fn(Vector3<f32>) -> Vector3<f32>,
) -> u32 {
    let first = open.vertices.len() as u32;
    for i in corners {
        open.vertices.push(place(surface.vertices[i]));
        open.normals.push(turn(surface.normals.get(i).copied().unwrap_or_default()));
        open.coordinates.push(surface.coordinates.get(i).copied().unwrap_or_default());
        if !surface.openness.is_empty() {
            open.openness.push(surface.openness.get(i).copied().unwrap_or(1.0));
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use partpose::vehicle::ModelZoo;

    #[test]
    fn what_is_open_stands_out_of_the_body_and_nothing_else_changes() {
        for model in ModelZoo::embedded().models.iter().take(3) {
            for opening in Opening::ALL {
                let open = opened(model, opening).unwrap();
                assert_eq!(Opening::of_name(open.name()), Some((model.name(), opening)));
                assert_eq!(open.extent(), model.extent());
                assert_eq!(open.missing_parts(), model.missing_parts());
                let leading = &opening.parts(model.body_style())[..1];
                let reach = |mesh: &Mesh| {
                    let places = vertices(mesh, |part| leading.contains(&part));
                    let ahead = places.map(|p| match opening {
                        Opening::DoorLeft => -p.x,
                        Opening::DoorRight => p.x,
                        Opening::Boot => -p.y,
                    });
                    ahead.fold(f64::MIN, f64::max)
                };
                let further = reach(open.mesh()) - reach(model.mesh());
                assert!(further > 0.1, "{}: {further} m", open.name());
                let closed = super::super::vehicle_kind(model);
                let kind = super::super::opened_kind(&open, &closed, opening);
                let surface = &kind.surface;
                assert_eq!(surface.vertices.len(), surface.normals.len());
                assert_eq!(surface.faces.len(), surface.materials.len());
                assert_eq!(surface.faces.len(), surface.parts.len());
            }
        }
        assert_eq!(Opening::of_name("sedan"), None);
    }
}
