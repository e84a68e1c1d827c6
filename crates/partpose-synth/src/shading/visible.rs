//! Objects in front of the camera, and their triangles on the screen.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use partpose::geometry::{Camera, Pose};
use rayon::prelude::*;

use crate::scene::{Material, Object, Scene, SurfaceMesh, Texture};

/// Steps a pixel on the grid that corners are rounded to.
pub(super) const STEPS: i32 = 256;
/// Nearest depth that is drawn, metres.
const NEAR: f64 = 0.08;
/// Depth beyond which the inside of vehicles is left out, metres a pixel of focal length: 44 m at 725.
const INSIDE: f64 = 0.06;
/// The same for meshes with fewer faces, of things without parts: 40 m, and twice as far for those with still fewer.
const COARSE: f64 = 0.055;
/// The same for vehicles with parts, which differ by 3.5 cm and then by 7 cm, always less than a pixel: 33 and 65 m.
const COARSE_VEHICLE: f64 = 0.045;
/// Tangent of the angle beyond which triangles are clipped, so that coordinates stay small.
const GUARD: f64 = 24.0;

type V = Vector3<f32>;

/// An object that may be seen.
#[derive(Debug)]
pub(super) struct Seen<'a> {
    pub(super) object: &'a Object,
    /// Its mesh, or the one with fewer faces where it is far away.
    pub(super) mesh: &'a SurfaceMesh,
    /// Vertices in camera coordinates.
    pub(super) positions: Vec<V>,
    /// Takes normals to the axes of the world.
    pub(super) world_from_normal: Matrix3<f32>,
    /// Height of its origin below the camera, along the world's y.
    pub(super) ground: f32,
    /// Middle of its vertices, camera coordinates.
    pub(super) center: V,
    /// Too far away for what is inside to be seen.
    pub(super) is_far: bool,
}

/// A triangle on the screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// In steps; pixel centres lie at multiples of [`STEPS`].
    pub(super) x: [i32; 3],
    pub(super) y: [i32; 3],
    /// 1 / z.
    pub(super) inverse_depth: [f32; 3],
    /// Index into [`Triangles::coordinates`] for those that have holes, else [`SOLID`].
    pub(super) holes: u32,
    /// Index into the list of what is seen.
    pub(super) seen: u32,
    pub(super) face: u32,
}

/// A triangle without holes.
pub(super) const SOLID: u32 = u32::MAX;

/// All triangles, by the way they are drawn.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    /// Opaque ones and ones with holes: first those of all objects without part labels, then the others.
    pub(super) opaque: Vec<Triangle>,
    /// How many of `opaque` belong to objects without part labels.
    pub(super) unlabelled: usize,
    /// What light comes through.
    pub(super) glass: Vec<Triangle>,
    /// Texture coordinates of triangles with holes.
    pub(super) coordinates: Vec<[[f32; 2]; 3]>,
}

/// Middle and radius of a mesh.
pub(super) type Bounds = (V, f32);

/// The bounds of all meshes of a scene, each computed once.
pub(super) fn mesh_bounds(scene: &Scene) -> Vec<Bounds> {
    let mut places: HashMap<*const SurfaceMesh, usize> = HashMap::new();
    let mut meshes = Vec::new();
    let indices: Vec<usize> = scene
        .objects
        .iter()
        .map(|object| {
            *places.entry(Arc::as_ptr(&object.mesh)).or_insert_with(|| {
                meshes.push(&object.mesh);
                meshes.len() - 1
            })
        })
        .collect();
    let bounds: Vec<Bounds> = meshes
        .par_iter()
        .map(|mesh| {
            let mut vertices = mesh.vertices.iter().map(|p| p.coords);
            let first = vertices.next().unwrap_or_default();
            let (low, high) =
                vertices.fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
            (0.5 * (low + high), 0.5 * (high - low).norm())
        })
        .collect();
    indices.into_iter().map(|index| bounds[index]).collect()
}

/// Places the objects that a camera may see.
pub(super) fn seen<'a>(
    scene: &'a Scene,
    bounds: &[Bounds],
    camera: &Camera,
    world_from_camera: &Pose,
    concerns: impl Fn(&Object) -> bool + Sync,
) -> Vec<Seen<'a>> {
    let camera_from_world = world_from_camera.inverse();
    let outside = outside_planes(camera);
    let place = |(object, (center, radius)): (&'a Object, &Bounds)| {
        if !concerns(object) || object.mesh.faces.is_empty() {
            return None;
        }
        let camera_from_object = camera_from_world * object.world_from_object;
        let scaled = center.cast::<f64>().component_mul(&object.scale);
        let center = camera_from_object * nalgebra::Point3::from(scaled);
        let radius = f64::from(*radius) * object.scale.abs().max();
        if outside.iter().any(|plane| plane.dot(&center.coords) > radius)
            || center.z < NEAR - radius
        {
            return None;
        }
        let matrix =
            *camera_from_object.rotation.to_rotation_matrix().matrix() * diagonal(&object.scale);
        let offset = camera_from_object.translation.vector;
        let limit = if object.has_parts { COARSE_VEHICLE } else { COARSE };
        let mesh = object.mesh.for_level(center.z / (limit * camera.focal[0].abs()));
        let positions = mesh.vertices.iter();
        let positions =
            positions.map(|p| (matrix * p.coords.cast::<f64>() + offset).cast()).collect();
        let inverse = object.scale.map(|factor| 1.0 / factor);
        let rotation = object.world_from_object.rotation.to_rotation_matrix();
        let world_from_normal = (*rotation.matrix() * diagonal(&inverse)).cast();
        let ground = object.world_from_object.translation.y - world_from_camera.translation.y;
        Some(Seen {
            object,
            mesh,
            positions,
            world_from_normal,
            ground: ground as f32,
            center: center.coords.cast(),
            is_far: center.z > INSIDE * camera.focal[0].abs(),
        })
    };
    let pairs: Vec<_> = scene.objects.iter().zip(bounds).collect();
    let mut seen: Vec<Seen> = pairs.into_par_iter().filter_map(place).collect();
    // What is near hides what is far, which then costs no more than a comparison of depths.
    seen.sort_by(|a, b| a.center.norm_squared().total_cmp(&b.center.norm_squared()));
    seen
}

fn diagonal(values: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_diagonal(values)
}

/// Unit normals, pointing outwards, of the four planes through the camera and the image's border.
fn outside_planes(camera: &Camera) -> [Vector3<f64>; 4] {
    let [fx, fy] = camera.focal.map(f64::abs);
    let [cx, cy] = camera.principal_point;
    let [width, height] = camera.size.map(f64::from);
    [
        Vector3::new(-fx, 0.0, -cx - 1.0),
        Vector3::new(fx, 0.0, -(width - cx)),
        Vector3::new(0.0, -fy, -cy - 1.0),
        Vector3::new(0.0, fy, -(height - cy)),
    ]
    .map(|normal| normal.normalize())
}

pub(super) fn is_glass(material: &Material) -> bool {
    material.transmission > 0.0
}

pub(super) fn is_labelled(object: &Object) -> bool {
    object.has_parts
}

/// Material of a face; a black one where the scene names one that does not exist.
pub(super) fn material_of<'a>(seen: &Seen<'a>, face: u32) -> &'a Material {
    const NONE: Material = Material {
        color: [0.0; 3],
        texture: Texture::Plain,
        roughness: 1.0,
        metallic: 0.0,
        clear_coat: 0.0,
        transmission: 0.0,
        emission: [0.0; 3],
        dirt: 0.0,
    };
    let slot = seen.mesh.materials.get(face as usize).copied().unwrap_or(0);
    seen.object.materials.get(usize::from(slot)).unwrap_or(&NONE)
}

/// The triangles of what is seen that cover a sample of a grid of `step` steps.
pub(super) fn triangles(camera: &Camera, seen: &[Seen], step: i32) -> Triangles {
    let lists: Vec<Triangles> = seen
        .par_iter()
        .enumerate()
        .map(|(index, seen)| object_triangles(camera, seen, index as u32, step))
        .collect();
    let mut all = Triangles::default();
    all.opaque.reserve(lists.iter().map(|list| list.opaque.len()).sum());
    for labelled in [false, true] {
        if labelled {
            all.unlabelled = all.opaque.len();
        }
        for (list, seen) in lists.iter().zip(seen) {
            if is_labelled(seen.object) == labelled {
                let start = all.coordinates.len() as u32;
                let moved = |triangle: &Triangle| Triangle {
                    holes: if triangle.holes == SOLID { SOLID } else { triangle.holes + start },
                    ..*triangle
                };
                if list.coordinates.is_empty() {
                    all.opaque.extend_from_slice(&list.opaque);
                } else {
                    all.opaque.extend(list.opaque.iter().map(moved));
                }
                all.glass.extend_from_slice(&list.glass);
                all.coordinates.extend_from_slice(&list.coordinates);
            }
        }
    }
    all
}

/// A projected vertex.
#[derive(Clone, Copy)]
struct Projected {
    x: i32,
    y: i32,
    inverse_depth: f32,
    /// Bits for left, right, above, below; 16 where it has no usable coordinates, 32 behind the camera.
    code: u8,
}

fn object_triangles(camera: &Camera, seen: &Seen, index: u32, step: i32) -> Triangles {
    let mesh = seen.mesh;
    let projected: Vec<Projected> = seen.positions.iter().map(|p| project(camera, p)).collect();
    let mut list = Triangles::default();
    list.opaque.reserve(mesh.faces.len());
    let materials = Slots::new(seen);
    let shift = step.trailing_zeros();
    let misses = |a: i32, b: i32, c: i32| {
        let [low, high] = [a.min(b).min(c), a.max(b).max(c)];
        (low + step - 1) >> shift > high >> shift
    };
    for (i, face) in mesh.faces.iter().enumerate() {
        let [Some(a), Some(b), Some(c)] = face.map(|vertex| projected.get(vertex as usize)) else {
            continue;
        };
        if a.code & b.code & c.code & !16 != 0 {
            continue;
        }
        let is_inside = seen.object.has_parts && mesh.parts.get(i).is_none_or(|part| *part == 0);
        if is_inside && seen.is_far {
            continue;
        }
        let kind = materials.of(i);
        if kind == Kind::Nothing {
            continue;
        }
        // What is far is drawn with dark panes, which spares its inside.
        let is_pane = kind == Kind::Glass && !seen.is_far;
        let shows_back = !seen.object.has_parts
            || (!seen.is_far && kind == Kind::Solid && is_lining(mesh.parts.get(i)));
        if (a.code | b.code | c.code) & 16 == 0 {
            if misses(a.x, b.x, c.x) || misses(a.y, b.y, c.y) {
                continue;
            }
            let area = i64::from(b.x - a.x) * i64::from(c.y - a.y)
                - i64::from(b.y - a.y) * i64::from(c.x - a.x);
            if area == 0 || (area > 0 && !shows_back) {
                continue;
            }
            let holes = match kind {
                Kind::Holes => {
                    list.coordinates.push(face.map(|vertex| coordinate(mesh, vertex)));
                    list.coordinates.len() as u32 - 1
                }
                _ => SOLID,
            };
            let triangle = Triangle {
                x: [a.x, b.x, c.x],
                y: [a.y, b.y, c.y],
                inverse_depth: [a.inverse_depth, b.inverse_depth, c.inverse_depth],
                holes,
                seen: index,
                face: i as u32,
            };
            if is_pane { list.glass.push(triangle) } else { list.opaque.push(triangle) }
        } else {
            let corner = |vertex: u32| {
                (seen.positions[vertex as usize].cast::<f64>(), coordinate(mesh, vertex))
            };
            clip(camera, face.map(corner), [index, i as u32], kind, &mut list);
        }
    }
    list
}

/// Whether a part's inner side is seen through the windows.
fn is_lining(part: Option<&u8>) -> bool {
    // What is inside has no part; doors, sides and roof.
    part.is_none_or(|part| matches!(part, 0 | 11..=16 | 25 | 26))
}

fn coordinate(mesh: &SurfaceMesh, vertex: u32) -> [f32; 2] {
    mesh.coordinates.get(vertex as usize).copied().unwrap_or_default()
}

/// How a material is drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Nothing,
    Solid,
    Holes,
    Glass,
}

/// The kinds of an object's materials.
struct Slots<'a> {
    kinds: Vec<Kind>,
    of_faces: &'a [u16],
}

impl<'a> Slots<'a> {
    fn new(seen: &Seen<'a>) -> Self {
        let kind = |material: &Material| match material.texture {
            Texture::Nothing => Kind::Nothing,
            Texture::Leaves { .. } => Kind::Holes,
            _ if is_glass(material) => Kind::Glass,
            _ => Kind::Solid,
        };
        Self {
            kinds: seen.object.materials.iter().map(kind).collect(),
            of_faces: &seen.mesh.materials,
        }
    }

    fn of(&self, face: usize) -> Kind {
        let slot = self.of_faces.get(face).copied().unwrap_or(0);
        self.kinds.get(usize::from(slot)).copied().unwrap_or(Kind::Solid)
    }
}

fn project(camera: &Camera, p: &V) -> Projected {
    let [x, y, z] = [f64::from(p.x), f64::from(p.y), f64::from(p.z)];
    let out_of_reach = !(z >= NEAR && x.abs() <= GUARD * z && y.abs() <= GUARD * z);
    let inverse = 1.0 / z;
    let u = camera.focal[0] * x * inverse + camera.principal_point[0];
    let v = camera.focal[1] * y * inverse + camera.principal_point[1];
    let bit = |set: bool, bit: u8| u8::from(set) * bit;
    let mut code = bit(u < -1.0, 1)
        | bit(u > f64::from(camera.size[0]), 2)
        | bit(v < -1.0, 4)
        | bit(v > f64::from(camera.size[1]), 8)
        | bit(out_of_reach, 16);
    if !(z >= NEAR) {
        // 32: all three behind shows nothing.
        code = 16 | 32;
    }
    let steps = |pixels: f64| (pixels * f64::from(STEPS)).round_ties_even() as i32;
    Projected { x: steps(u), y: steps(v), inverse_depth: inverse as f32, code }
}

/// A vertex of the polygon that is clipped.
type Corner = (Vector3<f64>, [f32; 2]);

/// Clips to the near plane and the guard (Sutherland and Hodgman 1974) and adds what is left as a fan.
fn clip(
    camera: &Camera,
    corners: [Corner; 3],
    [seen, face]: [u32; 2],
    kind: Kind,
    list: &mut Triangles,
) {
    let planes: [fn(&Vector3<f64>) -> f64; 5] = [
        |p| p.z - NEAR,
        |p| GUARD * p.z - p.x,
        |p| GUARD * p.z + p.x,
        |p| GUARD * p.z - p.y,
        |p| GUARD * p.z + p.y,
    ];
    let mut polygon: Vec<Corner> = corners.to_vec();
    for height in planes {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, corner) in polygon.iter().enumerate() {
            let next = &polygon[(i + 1) % polygon.len()];
            let [here, there] = [height(&corner.0), height(&next.0)];
            if here >= 0.0 {
                kept.push(*corner);
                if there < 0.0 {
                    kept.push(cut(corner, here, next, there));
                }
            } else if there >= 0.0 {
                kept.push(cut(next, there, corner, here));
            }
        }
        polygon = kept;
    }
    let projected: Vec<_> = polygon
        .iter()
        .map(|(p, coordinate)| {
            let inverse = 1.0 / p.z;
            let steps = |f: f64, x: f64, c: f64| ((f * x * inverse + c) * f64::from(STEPS)) as i32;
            let x = steps(camera.focal[0], p.x, camera.principal_point[0]);
            let y = steps(camera.focal[1], p.y, camera.principal_point[1]);
            (x, y, inverse as f32, *coordinate)
        })
        .collect();
    for i in 2..projected.len() {
        let corners = [projected[0], projected[i - 1], projected[i]];
        let holes = if kind == Kind::Holes {
            list.coordinates.push(corners.map(|corner| corner.3));
            list.coordinates.len() as u32 - 1
        } else {
            SOLID
        };
        let triangle = Triangle {
            x: corners.map(|corner| corner.0),
            y: corners.map(|corner| corner.1),
            inverse_depth: corners.map(|corner| corner.2),
            holes,
            seen,
            face,
        };
        if kind == Kind::Glass { list.glass.push(triangle) } else { list.opaque.push(triangle) }
    }
}

fn cut(inside: &Corner, above: f64, outside: &Corner, below: f64) -> Corner {
    let share = above / (above - below);
    let mix = |a: f32, b: f32| a + share as f32 * (b - a);
    let [a, b] = [inside.1, outside.1];
    (inside.0 + (outside.0 - inside.0) * share, [mix(a[0], b[0]), mix(a[1], b[1])])
}
