//! A foreign scene made a model: turned, scaled, placed on the ground, its faces given their parts.

use std::collections::HashMap;

use nalgebra::Matrix3;

use crate::geometry::{Extent, Point3};
use crate::parts::PartClass;
use crate::vehicle::{
    MAX_COORDINATE, MAX_SIDE, MIN_SIDE, ModelError, PartialModel, glb, place::side_of,
};

use super::{ForeignGroup, ForeignScene, ImportMap, Sides, Target, split::split};

/// How far off the middle a part must lie on the other side to be told, metres.
const WRONG_SIDE: f64 = 0.05;

/// A model, and what of its file and map did not fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The model; faces that the map leaves open, and those of unknown names, have no part.
    pub model: PartialModel,
    /// Groups that no pattern names, as indices into the scene.
    pub unknown: Vec<usize>,
    /// Rules whose pattern names nothing, as indices into the map.
    pub unused: Vec<usize>,
    /// Parts that lie on the other side of the vehicle.
    pub wrong_sides: Vec<SideFault>,
    /// Faces left out because the map says so.
    pub ignored: usize,
    /// Faces left out because they have no area.
    pub degenerate: usize,
}

/// A part that lies on the other side of the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct SideFault {
    /// The part that the map gives.
    pub part: PartClass,
    /// Index of the group in the scene.
    pub group: usize,
    /// Where the middle of its faces lies: metres to the vehicle's right.
    pub x: f64,
}

/// Why a map makes no model of a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// `forward` and `up` along one axis.
    #[error("`forward` and `up` lie along the same axis")]
    Axes,
    /// A scale that is no positive number.
    #[error("the scale {0} is not a positive number")]
    Scale(f64),
    /// A text that a zoo cannot hold.
    #[error("the {0} is empty, longer than 100 bytes or not printable")]
    Text(&'static str),
    /// Two patterns that fit equally well and say different things.
    #[error("both `{first}` and `{second}` name the group `{group}`, and say different things")]
    Ambiguous {
        /// The path of the group.
        group: String,
        /// The pattern that comes first.
        first: String,
        /// The other.
        second: String,
    },
    /// Every group is ignored.
    #[error("the map leaves no face: every group is ignored")]
    Nothing,
    /// A vertex far off.
    #[error(
        "the group `{group}` has a vertex {distance:.0} m from the origin, more than {MAX_COORDINATE} m"
    )]
    Far {
        /// The path of the group.
        group: String,
        /// Metres.
        distance: f64,
    },
    /// No vehicle has such a size.
    #[error("the model would be {} x {} x {} m large (width, height, length), where sides are {MIN_SIDE} to {MAX_SIDE} m", .0.width, .0.height, .0.length)]
    Size(Extent),
    /// No model.
    #[error("the faces make no model")]
    Model(#[source] ModelError),
}

impl MapError {
    /// What to change in the map.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Axes => {
                "give the axes of the file that point to the front and to the roof, such as `forward = \"+x\"`, `up = \"+z\"`"
            }
            Self::Scale(_) | Self::Far { .. } | Self::Size(_) => {
                "`scale` is the length of the file's unit in metres: 1 for metres, 0.01 for centimetres, 0.001 for millimetres, \
                 0.0254 for inches; `ignore` leaves out what does not belong to the vehicle"
            }
            Self::Text(_) => "give `name`, `category` and `body_style` as short texts",
            Self::Ambiguous { .. } => {
                "make one of them more exact: by the name of the node, by `path:...`, or by `NODE + material:...`"
            }
            Self::Nothing => "take the groups of the body out of `ignore`",
            Self::Model(_) => "export the model again",
        }
    }
}

/// Makes a model of a scene.
pub fn apply_map(scene: &ForeignScene, map: &ImportMap) -> Result<Imported, MapError> {
    check(map)?;
    let (targets, unused) = targets(scene, map)?;
    let unknown: Vec<usize> =
        (0..targets.len()).filter(|group| targets[*group].is_none()).collect();
    let groups = placed(scene, map, &targets)?;
    let extent = match map.extent {
        Some(extent) => extent,
        None => groups.extent,
    };
    if !extent.to_vector().iter().all(|side| (MIN_SIDE..=MAX_SIDE).contains(side)) {
        return Err(MapError::Size(extent));
    }
    let mut builder = Builder::default();
    let mut wrong_sides = Vec::new();
    for placed in &groups.groups {
        let faces = &scene.groups[placed.group].faces;
        let parts: Vec<Option<PartClass>> = match (&placed.parts[..], map.sides) {
            ([], _) => vec![None; faces.len()],
            ([part], Sides::Names) => {
                wrong_sides.extend(wrong_side(placed, faces, *part));
                vec![Some(*part); faces.len()]
            }
            ([part], Sides::Geometry) if side_of(*part) != 0 => {
                let both = [*part, part.opposite()];
                split(&both, &placed.vertices, faces, 0.0).into_iter().map(Some).collect()
            }
            (parts, _) => {
                let middle = groups.middle(&placed.parts);
                split(parts, &placed.vertices, faces, middle).into_iter().map(Some).collect()
            }
        };
        builder.add(&placed.vertices, faces, &parts, map.mirror);
    }
    let model = PartialModel {
        name: map.name.clone(),
        category: map.category.clone(),
        body_style: map.body_style.clone(),
        extent,
        vertices: builder.vertices,
        faces: builder.faces,
        parts: builder.parts,
    };
    model.check().map_err(MapError::Model)?;
    let ignored = |target: &&Option<&Target>| target.is_some_and(|is| *is == Target::Ignore);
    let ignored = targets.iter().zip(&scene.groups).filter(|(target, _)| ignored(target));
    Ok(Imported {
        model,
        unknown,
        unused,
        wrong_sides,
        ignored: ignored.map(|(_, group)| group.faces.len()).sum(),
        degenerate: builder.degenerate,
    })
}

fn check(map: &ImportMap) -> Result<(), MapError> {
    if map.forward.index == map.up.index {
        return Err(MapError::Axes);
    }
    if !(map.scale.is_finite() && map.scale > 0.0) {
        return Err(MapError::Scale(map.scale));
    }
    let texts = [("name", &map.name), ("category", &map.category), ("body style", &map.body_style)];
    match texts.iter().find(|(_, text)| !glb::is_text(text)) {
        Some((field, _)) => Err(MapError::Text(field)),
        None => Ok(()),
    }
}

/// What becomes of every group, `None` where no pattern fits; and the rules that fit nowhere.
fn targets<'a>(
    scene: &ForeignScene,
    map: &'a ImportMap,
) -> Result<(Vec<Option<&'a Target>>, Vec<usize>), MapError> {
    let mut is_used = vec![false; map.rules.len()];
    let mut targets = Vec::with_capacity(scene.groups.len());
    for group in &scene.groups {
        let mut best = None;
        let mut rival = None;
        for (at, rule) in map.rules.iter().enumerate() {
            let Some(closeness) = rule.pattern.closeness(group) else { continue };
            is_used[at] = true;
            match best {
                Some((other, _)) if other > closeness => {}
                Some((other, first)) if other == closeness => {
                    let first: &super::Rule = first;
                    if first.target != rule.target && rival.is_none() {
                        rival = Some(rule);
                    }
                }
                _ => (best, rival) = (Some((closeness, rule)), None),
            }
        }
        if let (Some((_, first)), Some(second)) = (best, rival) {
            return Err(MapError::Ambiguous {
                group: group.path.clone(),
                first: first.pattern.text.clone(),
                second: second.pattern.text.clone(),
            });
        }
        targets.push(best.map(|(_, rule)| &rule.target));
    }
    let unused = (0..map.rules.len()).filter(|at| !is_used[*at]).collect();
    Ok((targets, unused))
}

/// A group in the vehicle frame.
struct Placed {
    group: usize,
    vertices: Vec<Point3>,
    /// None for faces without a part, one, or several to be told apart.
    parts: Vec<PartClass>,
}

struct PlacedGroups {
    groups: Vec<Placed>,
    extent: Extent,
}

impl PlacedGroups {
    /// Half way along the vehicle between the ends of all that is to be split into these parts.
    fn middle(&self, parts: &[PartClass]) -> f64 {
        let alike = self.groups.iter().filter(|placed| placed.parts == parts);
        let z = alike.flat_map(|placed| &placed.vertices).map(|p| p.z);
        let (low, high) =
            z.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
        f64::midpoint(low, high)
    }
}

/// Turns, scales and moves what is kept, so that the middle of its bottom lies at the origin.
fn placed(
    scene: &ForeignScene,
    map: &ImportMap,
    targets: &[Option<&Target>],
) -> Result<PlacedGroups, MapError> {
    let (forward, up) = (map.forward.to_vector(), map.up.to_vector());
    let right = if map.mirror { up.cross(&forward) } else { forward.cross(&up) };
    let vehicle_from_file =
        Matrix3::from_rows(&[right.transpose(), -up.transpose(), forward.transpose()]) * map.scale;
    let mut groups = Vec::new();
    let mut all = Bounds::default();
    let mut without_mirrors = Bounds::default();
    for (index, (group, target)) in scene.groups.iter().zip(targets).enumerate() {
        let parts = match target {
            Some(Target::Ignore) => continue,
            Some(Target::Parts(parts)) => parts.clone(),
            Some(Target::Unlabeled) | None => Vec::new(),
        };
        let vertices = turned(group, &vehicle_from_file)?;
        let is_mirror =
            |part: &PartClass| [PartClass::MirrorLeft, PartClass::MirrorRight].contains(part);
        // Only vertices of faces are kept by readers, so that stray points do not count.
        vertices.iter().for_each(|p| all.add(p));
        if !parts.iter().any(is_mirror) {
            vertices.iter().for_each(|p| without_mirrors.add(p));
        }
        groups.push(Placed { group: index, vertices, parts });
    }
    let wanted = if map.mirrors_in_extent { &all } else { &without_mirrors };
    let Some((low, high)) = wanted.0.or(all.0) else { return Err(MapError::Nothing) };
    let size = high - low;
    let bottom = Point3::new(f64::midpoint(low.x, high.x), high.y, f64::midpoint(low.z, high.z));
    for p in groups.iter_mut().flat_map(|group| &mut group.vertices) {
        // What the file will hold: 32 bits. Adding zero turns -0 into 0.
        *p = Point3::from((*p - bottom).map(|value| f64::from(value as f32) + 0.0));
    }
    Ok(PlacedGroups { groups, extent: Extent::new(size.x, size.y, size.z) })
}

fn turned(group: &ForeignGroup, vehicle_from_file: &Matrix3<f64>) -> Result<Vec<Point3>, MapError> {
    let turn = |p: &Point3| {
        let p = vehicle_from_file * p;
        let distance = p.coords.amax();
        if distance <= MAX_COORDINATE {
            return Ok(p);
        }
        Err(MapError::Far { group: group.path.clone(), distance })
    };
    group.vertices.iter().map(turn).collect()
}

#[derive(Default)]
struct Bounds(Option<(Point3, Point3)>);

impl Bounds {
    fn add(&mut self, p: &Point3) {
        let (low, high) = self.0.unwrap_or((*p, *p));
        self.0 = Some((low.inf(p), high.sup(p)));
    }
}

/// The fault, if the middle of a group lies on the other side than its part belongs to.
fn wrong_side(placed: &Placed, faces: &[[u32; 3]], part: PartClass) -> Option<SideFault> {
    let (mut sum, mut area) = (0.0, 0.0);
    for face in faces {
        let [a, b, c] = face.map(|at| placed.vertices[at as usize]);
        let weight = (b - a).cross(&(c - a)).norm();
        sum += weight * (a.x + b.x + c.x) / 3.0;
        area += weight;
    }
    let x = if area > 0.0 { sum / area } else { 0.0 };
    let is_wrong = f64::from(side_of(part)) * x < -WRONG_SIDE;
    is_wrong.then_some(SideFault { part, group: placed.group, x })
}

#[derive(Default)]
struct Builder {
    vertices: Vec<Point3>,
    faces: Vec<[u32; 3]>,
    parts: Vec<Option<PartClass>>,
    vertex_at: HashMap<[u64; 3], u32>,
    degenerate: usize,
}

impl Builder {
    /// Appends faces; vertices at one position become one, as reading the file would make them.
    fn add(
        &mut self,
        vertices: &[Point3],
        faces: &[[u32; 3]],
        parts: &[Option<PartClass>],
        mirror: bool,
    ) {
        for (corners, part) in faces.iter().zip(parts) {
            let mut face = corners.map(|at| {
                let p = vertices[at as usize];
                let key = [p.x, p.y, p.z].map(f64::to_bits);
                *self.vertex_at.entry(key).or_insert_with(|| {
                    self.vertices.push(p);
                    self.vertices.len() as u32 - 1
                })
            });
            if face[0] == face[1] || face[1] == face[2] || face[2] == face[0] {
                self.degenerate += 1;
                continue;
            }
            if mirror {
                face.swap(1, 2);
            }
            self.faces.push(face);
            self.parts.push(*part);
        }
    }
}
