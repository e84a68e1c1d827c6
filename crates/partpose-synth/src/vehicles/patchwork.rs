//! A surface that is cut into patches of materials without changing its shape.
//!
//! A patch is where some functions of the point are negative. Faces through which a function changes its sign are
//! divided along the straight line of its linear root; new corners lie on old edges, so what a picture's sample hits
//! is the same as before, up to rounding. Corner normals are smooth over edges flatter than [`CREASE`].

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Point3, Vector3};
use partpose::parts::{CoarseClass, PartClass};
use partpose::vehicle::Mesh;

use crate::scene::{JointLine, SurfaceMesh};

use super::joints;
use super::slots::Slot;

/// Cosine of the angle between faces beyond which an edge is sharp.
const CREASE: f32 = 0.72;
/// Roots nearer to an end of an edge than this share of it do not divide it.
const NEAR_END: f32 = 0.03;

/// A corner of a facet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) point: u32,
    pub(super) normal: Vector3<f32>,
}

/// A face with what it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    pub(super) corners: [Corner; 3],
    /// `None` for what is inside.
    pub(super) part: Option<PartClass>,
    pub(super) slot: Slot,
}

/// Facets over shared points.
#[derive(Clone, Debug)]
pub(super) struct Patchwork {
    pub(super) points: Vec<Vector3<f32>>,
    pub(super) facets: Vec<Facet>,
    /// Height of the middle of the front and of the rear plate.
    pub(super) plates: [f32; 2],
}

impl Patchwork {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let points: Vec<_> = mesh.vertices.iter().map(|p| p.coords.cast::<f32>()).collect();
        let normals = corner_normals(mesh, &points);
        let facet = |i: usize| {
            let corner = |j: usize| Corner { point: mesh.faces[i][j], normal: normals[i][j] };
            Facet {
                corners: [0, 1, 2].map(corner),
                part: Some(mesh.parts[i]),
                slot: first_slot(mesh.parts[i]),
            }
        };
        let facets = (0..mesh.faces.len()).map(facet).collect();
        Self { points, facets, plates: [0.5, 0.8] }
    }

    /// The smallest and the largest coordinates of the faces of some parts.
    pub(super) fn bounds(&self, parts: &[PartClass]) -> Option<[Vector3<f32>; 2]> {
        let mut bounds: Option<[Vector3<f32>; 2]> = None;
        for facet in &self.facets {
            if facet.part.is_some_and(|part| parts.contains(&part)) {
                for corner in facet.corners {
                    let p = self.points[corner.point as usize];
                    bounds = Some(bounds.map_or([p, p], |[low, high]| [low.inf(&p), high.sup(&p)]));
                }
            }
        }
        bounds
    }

    pub(super) fn normal(&self, facet: &Facet) -> Vector3<f32> {
        let [a, b, c] = facet.corners.map(|corner| self.points[corner.point as usize]);
        (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default()
    }

    pub(super) fn middle(&self, facet: &Facet) -> Vector3<f32> {
        facet.corners.iter().map(|c| self.points[c.point as usize]).sum::<Vector3<f32>>() / 3.0
    }

    /// Gives `slot` to what lies inside all the bounds, of the faces that `concerns` holds for.
    pub(super) fn paint(
        &mut self,
        slot: Slot,
        concerns: impl Fn(&Facet) -> bool,
        bounds: &[&dyn Fn(&Vector3<f32>) -> f32],
    ) {
        for done in 0..bounds.len() {
            self.cut(&concerns, bounds, done);
        }
        for i in 0..self.facets.len() {
            let facet = self.facets[i];
            if concerns(&facet) && self.is_inside(&facet, bounds) {
                self.facets[i].slot = slot;
            }
        }
    }

    /// Divides the faces that `concerns` holds for along the root of a function.
    pub(super) fn divide_along(
        &mut self,
        concerns: impl Fn(&Facet) -> bool,
        bound: &dyn Fn(&Vector3<f32>) -> f32,
    ) {
        self.cut(&concerns, &[bound], 0);
    }

    /// Turns normals: adds to each corner's what a function says for its place and normal.
    pub(super) fn bend(
        &mut self,
        concerns: impl Fn(&Facet) -> bool,
        by: impl Fn(&Vector3<f32>, &Vector3<f32>) -> Vector3<f32>,
    ) {
        for i in 0..self.facets.len() {
            let facet = self.facets[i];
            if !concerns(&facet) {
                continue;
            }
            for corner in &mut self.facets[i].corners {
                let place = &self.points[corner.point as usize];
                let bent = corner.normal + by(place, &corner.normal);
                corner.normal = bent.try_normalize(1e-3).unwrap_or(corner.normal);
            }
        }
    }

    fn is_inside(&self, facet: &Facet, bounds: &[&dyn Fn(&Vector3<f32>) -> f32]) -> bool {
        let middle = self.middle(facet);
        bounds.iter().all(|bound| bound(&middle) < 0.0)
    }

    /// Divides the faces along the root of a bound, where the bounds before it leave anything.
    fn cut(
        &mut self,
        concerns: &impl Fn(&Facet) -> bool,
        bounds: &[&dyn Fn(&Vector3<f32>) -> f32],
        index: usize,
    ) {
        // Only where faces are concerned: vehicles have many points and bounds.
        let mut values = vec![f32::NAN; self.points.len()];
        let mut splits: BTreeMap<[u32; 2], (u32, f32)> = BTreeMap::new();
        for facet in &self.facets {
            if !concerns(facet) || !self.is_inside(facet, &bounds[..index]) {
                continue;
            }
            let [a, b, c] = facet.corners.map(|corner| corner.point);
            for point in [a, b, c].map(|point| point as usize) {
                if values[point].is_nan() {
                    values[point] = bounds[index](&self.points[point]);
                }
            }
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let key = [from.min(to), from.max(to)];
                let [low, high] = key.map(|i| values[i as usize]);
                let share = low / (low - high);
                if low * high < 0.0 && (NEAR_END..1.0 - NEAR_END).contains(&share) {
                    splits.entry(key).or_insert((0, share));
                }
            }
        }
        for ([a, b], (index, share)) in &mut splits {
            *index = self.points.len() as u32;
            let [a, b] = [a, b].map(|i| self.points[*i as usize]);
            self.points.push(a.lerp(&b, *share));
        }
        if splits.is_empty() {
            return;
        }
        // Only faces with a split edge are looked up.
        let mut is_end = vec![false; self.points.len()];
        for point in splits.keys().flatten() {
            is_end[*point as usize] = true;
        }
        // The first piece takes the facet's place, the others come last.
        let mut pieces = Vec::new();
        for i in 0..self.facets.len() {
            let facet = self.facets[i];
            if facet.corners.iter().filter(|corner| is_end[corner.point as usize]).count() >= 2 {
                divide(&facet, &splits, &mut pieces);
                self.facets[i] = pieces[0];
                self.facets.extend(pieces.drain(..).skip(1));
            }
        }
    }

    pub(super) fn into_surface(self) -> SurfaceMesh {
        let mut surface = SurfaceMesh::default();
        let mut vertex_of = vec![0; self.points.len()];
        let mut seen: HashMap<(u32, [u32; 3], u16), u32> = HashMap::new();
        let wheels = PartClass::ALL.map(|part| {
            (part.coarse() == CoarseClass::Wheels).then(|| self.bounds(&[part])).flatten()
        });
        for facet in &self.facets {
            let face = facet.corners.map(|corner| {
                let key = (corner.point, corner.normal.map(f32::to_bits).into(), facet.slot as u16);
                *seen.entry(key).or_insert_with(|| {
                    let p = self.points[corner.point as usize];
                    let wheel = facet.part.and_then(|part| wheels[part.index()]);
                    surface.vertices.push(Point3::from(p));
                    surface.normals.push(corner.normal);
                    surface.coordinates.push(self.coordinate(&p, facet.slot, wheel));
                    vertex_of[corner.point as usize] = surface.vertices.len() as u32 - 1;
                    surface.vertices.len() as u32 - 1
                })
            });
            surface.faces.push(face);
            surface.materials.push(facet.slot as u16);
            surface.parts.push(facet.part.map_or(0, PartClass::id));
        }
        let lines = joints::edges_between_parts(&self.facets).into_iter().map(|(edge, kind)| {
            JointLine { ends: edge.map(|point| vertex_of[point as usize]), kind }
        });
        surface.joints = joints::near_faces(&surface, &lines.collect::<Vec<_>>());
        surface
    }

    fn coordinate(
        &self,
        p: &Vector3<f32>,
        slot: Slot,
        wheel: Option<[Vector3<f32>; 2]>,
    ) -> [f32; 2] {
        if let Some([low, high]) = wheel {
            let middle = 0.5 * (low + high);
            let radius = 0.5 * (high.y - low.y);
            return [(p.z - middle.z) / radius, (p.y - middle.y) / radius];
        }
        match slot {
            Slot::Plate if p.z > 0.0 => [-p.x, -p.y - self.plates[0]],
            Slot::Plate => [p.x, -p.y - self.plates[1]],
            Slot::Grille => [p.x, -p.y],
            _ => [p.x + p.z, -p.y],
        }
    }
}

fn divide(facet: &Facet, splits: &BTreeMap<[u32; 2], (u32, f32)>, divided: &mut Vec<Facet>) {
    let [a, b, c] = facet.corners;
    let split = |from: Corner, to: Corner| {
        let key = [from.point.min(to.point), from.point.max(to.point)];
        splits.get(&key).map(|(point, share)| {
            let share = if from.point < to.point { *share } else { 1.0 - share };
            Corner { point: *point, normal: from.normal.lerp(&to.normal, share).normalize() }
        })
    };
    let cut = [split(a, b), split(b, c), split(c, a)];
    let [p, q, r] = [cut[0].unwrap_or(a), cut[1].unwrap_or(b), cut[2].unwrap_or(c)];
    let triangles: &[[Corner; 3]] = match cut.map(|corner| corner.is_some()) {
        [false, false, false] => &[[a, b, c]],
        [true, false, false] => &[[a, p, c], [p, b, c]],
        [false, true, false] => &[[b, q, a], [q, c, a]],
        [false, false, true] => &[[c, r, b], [r, a, b]],
        [true, true, false] => &[[p, b, q], [a, p, q], [a, q, c]],
        [false, true, true] => &[[q, c, r], [b, q, r], [b, r, a]],
        [true, false, true] => &[[r, a, p], [c, r, p], [c, p, b]],
        [true, true, true] => &[[a, p, r], [p, b, q], [r, q, c], [p, q, r]],
    };
    divided.extend(triangles.iter().map(|corners| Facet { corners: *corners, ..*facet }));
}

/// The material that a part is made of, for the most part.
fn first_slot(part: PartClass) -> Slot {
    use PartClass as P;
    match part {
        P::WindshieldFront | P::GlassFrontLeft | P::GlassFrontRight => Slot::Glass,
        P::WheelFrontLeft | P::WheelFrontRight | P::WheelRearLeft | P::WheelRearRight => Slot::Tyre,
        P::LightFrontLeft | P::LightFrontRight => Slot::HeadLamp,
        P::LightRearLeft | P::LightRearRight => Slot::TailLamp,
        _ if part.coarse() == CoarseClass::Glass => Slot::RearGlass,
        _ => Slot::Paint,
    }
}

/// Per face and corner the mean direction of the faces round it that are not turned away, weighted by area.
fn corner_normals(mesh: &Mesh, points: &[Vector3<f32>]) -> Vec<[Vector3<f32>; 3]> {
    let area = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| points[i as usize]);
        (b - a).cross(&(c - a))
    };
    let areas: Vec<_> = mesh.faces.iter().map(area).collect();
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for (i, face) in mesh.faces.iter().enumerate() {
        for point in face {
            around[*point as usize].push(i as u32);
        }
    }
    let unit = |v: &Vector3<f32>| v.try_normalize(0.0).unwrap_or_default();
    let corner = |i: usize, point: u32| {
        let own = unit(&areas[i]);
        let near = around[point as usize].iter().map(|j| areas[*j as usize]);
        let sum: Vector3<f32> = near.filter(|other| unit(other).dot(&own) > CREASE).sum();
        sum.try_normalize(0.0).unwrap_or(own)
    };
    (0..mesh.faces.len()).map(|i| mesh.faces[i].map(|point| corner(i, point))).collect()
}
