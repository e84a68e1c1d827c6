//! The label renderer against a ray caster that knows no rounding.

use nalgebra::{Translation3, UnitQuaternion};
use partpose::geometry::{Camera, Point2, Point3, Pose, Rect, Vector3};
use partpose::parts::PartClass;
use partpose::render::{Instance, LabelImage, LabelRenderer, NEAR, RenderOptions, render_labels};
use partpose::vehicle::Mesh;
use proptest::prelude::*;
use rayon::prelude::*;

/// Vertices are rounded to 1/256 px, so an edge moves by at most 0.0028 px; samples nearer than this to a projected
/// edge may fall on either side.
const EDGE_TOLERANCE: f64 = 0.01;
/// Relative error of depth beyond that of the rounded position: it is kept in `f32`.
const DEPTH_TOLERANCE: f64 = 1e-5;

const CAMERA: Camera =
    Camera { focal: [40.0, 36.0], principal_point: [15.3, 10.9], size: [32, 24] };

/// What the caster says of a pixel.
enum Expected {
    /// It lies too close to an edge, or two surfaces are too close to each other.
    Unsure,
    Background,
    /// Part, instance, the least and greatest depth within the tolerance.
    Hit(u8, u16, f64, f64),
}

struct Caster {
    faces: Vec<CastFace>,
}

struct CastFace {
    part: u8,
    instance: u16,
    corners: [Vector3; 3],
    /// The projected edges of what lies in front of the near plane; near the cut itself, depth tells.
    edges: Vec<[Point2; 2]>,
}

impl Caster {
    fn new(camera: &Camera, instances: &[Instance]) -> Self {
        let mut faces = Vec::new();
        for instance in instances {
            for (face, part) in instance.mesh.faces.iter().zip(&instance.mesh.parts) {
                let corners = face.map(|i| {
                    let vertex = instance.mesh.vertices[i as usize];
                    let scaled = Point3::from(vertex.coords.component_mul(&instance.scale));
                    (instance.camera_from_vehicle * scaled).coords
                });
                let edges = near_edges(camera, &corners);
                faces.push(CastFace { part: part.id(), instance: instance.id, corners, edges });
            }
        }
        Self { faces }
    }

    fn look(&self, camera: &Camera, pixel: &Point2) -> Expected {
        let ray = camera.ray(pixel);
        let mut hits = Vec::new();
        for face in &self.faces {
            if face.edges.iter().any(|edge| distance(pixel, edge) < EDGE_TOLERANCE) {
                return Expected::Unsure;
            }
            let Some(depth) = cast(&ray, &face.corners) else { continue };
            // The depth changes by this much where the rounding moves the surface.
            let mut range = [depth, depth];
            for (dx, dy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                let near = pixel + EDGE_TOLERANCE * nalgebra::Vector2::new(dx, dy);
                let depth = plane_depth(&camera.ray(&near), &face.corners);
                range = [range[0].min(depth), range[1].max(depth)];
            }
            range[0] *= 1.0 - DEPTH_TOLERANCE;
            range[1] *= 1.0 + DEPTH_TOLERANCE;
            if (range[0]..=range[1]).contains(&NEAR) {
                return Expected::Unsure;
            }
            if depth >= NEAR {
                hits.push((face, range));
            }
        }
        hits.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        match hits.as_slice() {
            [] => Expected::Background,
            [first, second, ..] if second.1[0] <= first.1[1] => Expected::Unsure,
            [(face, range), ..] => Expected::Hit(face.part, face.instance, range[0], range[1]),
        }
    }
}

fn near_edges(camera: &Camera, corners: &[Vector3; 3]) -> Vec<[Point2; 2]> {
    let mut edges = Vec::new();
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        let at_near = |a: Vector3, b: Vector3| a + (b - a) * ((NEAR - a.z) / (b.z - a.z));
        let (a, b) = match (a.z >= NEAR, b.z >= NEAR) {
            (true, true) => (a, b),
            (true, false) => (a, at_near(a, b)),
            (false, true) => (at_near(a, b), b),
            (false, false) => continue,
        };
        edges.push([a, b].map(|p| camera.project_unchecked(&Point3::from(p))));
    }
    edges
}

fn distance(p: &Point2, [a, b]: &[Point2; 2]) -> f64 {
    let along = b - a;
    let length2 = along.norm_squared();
    let s = if length2 > 0.0 { ((p - a).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (p - (a + s * along)).norm()
}

fn plane_depth(ray: &Vector3, [a, b, c]: &[Vector3; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    normal.dot(a) / normal.dot(ray)
}

/// Depth at which a ray through the origin meets a triangle.
fn cast(ray: &Vector3, corners: &[Vector3; 3]) -> Option<f64> {
    let [a, b, c] = corners;
    // Signed volumes with the ray: it passes inside if all three agree.
    let sides = [ray.dot(&a.cross(b)), ray.dot(&b.cross(c)), ray.dot(&c.cross(a))];
    let inside = sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0);
    let depth = plane_depth(ray, corners);
    (inside && depth > 0.0).then_some(depth)
}

fn check(camera: &Camera, instances: &[Instance]) -> Result<usize, TestCaseError> {
    let image = render_labels(camera, instances);
    let caster = Caster::new(camera, instances);
    let mut sure = 0;
    for y in 0..camera.size[1] {
        for x in 0..camera.size[0] {
            let i = (y * camera.size[0] + x) as usize;
            let drawn = (image.parts[i], image.instances[i]);
            match caster.look(camera, &Point2::new(f64::from(x), f64::from(y))) {
                Expected::Unsure => continue,
                Expected::Background => prop_assert_eq!(drawn, (0, 0), "at ({}, {})", x, y),
                Expected::Hit(part, id, least, greatest) => {
                    prop_assert_eq!(drawn, (part, id), "at ({}, {})", x, y);
                    let depth = f64::from(image.depths[i]);
                    prop_assert!(
                        (least..=greatest).contains(&depth),
                        "depth {} not in {}..{} at ({}, {})",
                        depth,
                        least,
                        greatest,
                        x,
                        y
                    );
                }
            }
            sure += 1;
        }
    }
    Ok(sure)
}

fn part(i: usize) -> PartClass {
    PartClass::ALL[i % PartClass::COUNT]
}

/// Triangles of their own, the part of each by its index.
fn soup(vertices: Vec<Point3>) -> Mesh {
    let count = vertices.len() / 3;
    let faces = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh { vertices, faces, parts: (0..count).map(part).collect() }
}

fn at_origin(mesh: &Mesh) -> Instance<'_> {
    Instance { mesh, scale: Vector3::repeat(1.0), camera_from_vehicle: Pose::identity(), id: 7 }
}

fn any_point(z: std::ops::Range<f64>) -> impl Strategy<Value = Point3> {
    (-4.0..4.0f64, -3.0..3.0f64, z).prop_map(|(x, y, z)| Point3::new(x, y, z))
}

fn any_soup(z: std::ops::Range<f64>, count: usize) -> impl Strategy<Value = Mesh> {
    prop::collection::vec(any_point(z), 3 * count).prop_map(soup)
}

fn any_pose() -> impl Strategy<Value = Pose> {
    (any_point(2.0..12.0), prop::array::uniform3(-3.0..3.0f64)).prop_map(|(at, angles)| {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(angles));
        Pose::from_parts(Translation3::from(at), rotation)
    })
}

/// A closed box around the origin whose faces look outwards, each cut into `n` x `n` squares of two triangles.
fn cube(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    // Origin, first and second direction: first x second looks outwards.
    let sides = [
        ([1., -1., -1.], [0., 1., 0.], [0., 0., 1.]),
        ([-1., -1., -1.], [0., 0., 1.], [0., 1., 0.]),
        ([-1., 1., -1.], [0., 0., 1.], [1., 0., 0.]),
        ([-1., -1., -1.], [1., 0., 0.], [0., 0., 1.]),
        ([-1., -1., 1.], [1., 0., 0.], [0., 1., 0.]),
        ([-1., -1., -1.], [0., 1., 0.], [1., 0., 0.]),
    ];
    for (side, (origin, first, second)) in sides.iter().enumerate() {
        let at = |i: u32, j: u32| {
            let step = |k: u32| 2.0 * f64::from(k) / f64::from(n);
            Point3::from(
                Vector3::from(*origin)
                    + Vector3::from(*first) * step(i)
                    + Vector3::from(*second) * step(j),
            )
        };
        let start = mesh.vertices.len() as u32;
        for j in 0..=n {
            for i in 0..=n {
                mesh.vertices.push(at(i, j));
            }
        }
        for j in 0..n {
            for i in 0..n {
                let v = |di: u32, dj: u32| start + (j + dj) * (n + 1) + i + di;
                mesh.faces.push([v(0, 0), v(1, 0), v(1, 1)]);
                mesh.faces.push([v(0, 0), v(1, 1), v(0, 1)]);
                mesh.parts.extend([part(side), part(side)]);
            }
        }
    }
    mesh
}

proptest! {
    #[test]
    fn triangles_in_front_match_the_ray_caster(mesh in any_soup(0.5..9.0, 6)) {
        check(&CAMERA, &[at_origin(&mesh)])?;
    }

    #[test]
    fn triangles_across_the_near_plane_match_the_ray_caster(mesh in any_soup(-3.0..4.0, 6)) {
        check(&CAMERA, &[at_origin(&mesh)])?;
    }

    #[test]
    fn slivers_match_the_ray_caster(
        starts in prop::collection::vec((any_point(1.0..9.0), any_point(1.0..9.0)), 5),
        width in 1e-4..0.1f64,
    ) {
        let corners = |(a, b): &(Point3, Point3)| [*a, *b, b + Vector3::new(width, width, 0.0)];
        let mesh = soup(starts.iter().flat_map(corners).collect());
        check(&CAMERA, &[at_origin(&mesh)])?;
    }

    #[test]
    fn placed_scaled_instances_match_the_ray_caster(
        poses in prop::collection::vec(any_pose(), 1..4),
        scale in prop::array::uniform3(0.2..1.5f64),
        mirrored: bool,
    ) {
        let mesh = cube(2);
        let scale = Vector3::from(scale).component_mul(&Vector3::new(
            if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0));
        let instances: Vec<Instance> = (1..).zip(poses)
            .map(|(id, camera_from_vehicle)| Instance { mesh: &mesh, scale, camera_from_vehicle, id })
            .collect();
        check(&CAMERA, &instances)?;
    }

    #[test]
    fn crops_match_the_ray_caster(
        pose in any_pose(),
        corner in (-20.0..30.0f64, -20.0..20.0f64),
        side in (2.0..40.0f64, 2.0..40.0f64),
    ) {
        let rect = Rect::new(corner.0, corner.1, corner.0 + side.0, corner.1 + side.1);
        let mesh = cube(3);
        let instance = Instance { camera_from_vehicle: pose, ..at_origin(&mesh) };
        check(&CAMERA.crop(&rect, [14, 14]), &[instance])?;
    }

    #[test]
    fn reused_renderer_on_any_number_of_threads_draws_the_same(
        mesh in any_soup(-1.0..6.0, 40),
        poses in prop::collection::vec(any_pose(), 6),
    ) {
        let cube = cube(4);
        let instances = |pose: &Pose| {
            [at_origin(&mesh), Instance { camera_from_vehicle: *pose, id: 3, ..at_origin(&cube) }]
        };
        let alone: Vec<LabelImage> =
            poses.iter().map(|pose| render_labels(&CAMERA, &instances(pose))).collect();
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let draw = |renderer: &mut LabelRenderer, pose: &Pose| {
                renderer.render(&CAMERA, &instances(pose), &RenderOptions::default()).clone()
            };
            let together: Vec<LabelImage> = pool.install(|| {
                poses.par_iter().map_init(LabelRenderer::default, draw).collect()
            });
            for (one, other) in alone.iter().zip(&together) {
                prop_assert_eq!(bits(one), bits(other));
            }
        }
    }

    #[test]
    fn culling_does_not_change_closed_meshes(pose in any_pose(), mirrored: bool) {
        let mesh = cube(5);
        let scale = Vector3::new(if mirrored { -0.7 } else { 0.7 }, 1.0, 1.2);
        let instance = Instance { scale, camera_from_vehicle: pose, ..at_origin(&mesh) };
        prop_assume!(pose.translation.z > 3.0);
        let mut renderer = LabelRenderer::default();
        let culled = RenderOptions { cull_back_faces: true };
        let culled = renderer.render(&CAMERA, &[instance], &culled);
        // At the outline a sample on the shared edge belongs to either face, and both lie equally deep.
        let all = render_labels(&CAMERA, &[instance]);
        let same = culled.instances.iter().zip(&all.instances).filter(|(a, b)| a == b).count();
        prop_assert_eq!(same, all.instances.len());
        let same = culled.parts.iter().zip(&all.parts).filter(|(a, b)| a == b).count();
        prop_assert!(same + 1 >= all.parts.len());
    }

    #[test]
    fn a_fan_covers_each_sample_once(
        center in (4.0..28.0f64, 4.0..20.0f64),
        radii in prop::collection::vec(2.0..12.0f64, 3..9),
        on_grid: bool,
    ) {
        // Each triangle alone, so that a sample hit twice or never shows.
        let snap = |v: f64| if on_grid { v.round() } else { v };
        let camera = Camera::pinhole(1.0, [0.0, 0.0], [32, 24]);
        let rim: Vec<Point3> = radii.iter().enumerate().map(|(i, radius)| {
            let angle = std::f64::consts::TAU * i as f64 / radii.len() as f64;
            Point3::new(
                snap(center.0 + radius * angle.cos()), snap(center.1 + radius * angle.sin()), 1.0)
        }).collect();
        let hub = Point3::new(snap(center.0), snap(center.1), 1.0);
        let count = |vertices: Vec<Point3>| {
            let mesh = soup(vertices);
            render_labels(&camera, &[at_origin(&mesh)]).parts.iter().map(|p| u32::from(*p > 0)).collect::<Vec<u32>>()
        };
        let mut hits = vec![0; 32 * 24];
        let mut together = Vec::new();
        for (i, point) in rim.iter().enumerate() {
            let triangle = vec![hub, *point, rim[(i + 1) % rim.len()]];
            together.extend(triangle.clone());
            for (total, hit) in hits.iter_mut().zip(count(triangle)) {
                *total += hit;
            }
        }
        prop_assert!(hits.iter().all(|n| *n <= 1));
        prop_assert_eq!(hits, count(together));
    }
}

fn bits(image: &LabelImage) -> (&[u8], &[u16], Vec<u32>) {
    (&image.parts, &image.instances, image.depths.iter().map(|d| d.to_bits()).collect())
}

#[test]
fn most_pixels_are_checked_against_the_caster() {
    let mesh = cube(2);
    let pose = Pose::translation(0.0, 0.0, 4.0);
    let sure = check(&CAMERA, &[Instance { camera_from_vehicle: pose, ..at_origin(&mesh) }]);
    assert!(sure.unwrap() > 700, "of {} pixels", 32 * 24);
}

#[test]
fn square_on_pixel_centres_covers_its_upper_left_samples_only() {
    let camera = Camera::pinhole(1.0, [0.0, 0.0], [6, 5]);
    let corners = [(1., 1.), (4., 1.), (4., 3.), (1., 3.)].map(|(x, y)| Point3::new(x, y, 1.0));
    let mesh = Mesh {
        vertices: corners.to_vec(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![PartClass::Roof, PartClass::Hood],
    };
    let image = render_labels(&camera, &[at_origin(&mesh)]);
    let rows: Vec<String> = image
        .parts
        .chunks(6)
        .map(|row| row.iter().map(|p| if *p == 0 { '.' } else { '#' }).collect())
        .collect();
    assert_eq!(rows, ["......", ".###..", ".###..", "......", "......"]);
}

#[test]
fn outward_face_is_one_that_runs_counter_clockwise_seen_from_outside() {
    // The rear of a vehicle ahead that drives away: seen from behind, its right is on the right.
    let rear = [(-1., 0.), (1., 0.), (1., -1.), (-1., -1.)].map(|(x, y)| Point3::new(x, y, 5.0));
    // Bottom left, bottom right, top right, top left: counter-clockwise to the eye.
    let mesh = Mesh {
        vertices: rear.to_vec(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![PartClass::Trunk; 2],
    };
    let drawn = |mesh: &Mesh, cull_back_faces| {
        let mut renderer = LabelRenderer::default();
        let options = RenderOptions { cull_back_faces };
        let image = renderer.render(&CAMERA, &[at_origin(mesh)], &options);
        image.parts.iter().filter(|part| **part != 0).count()
    };
    assert!(drawn(&mesh, true) > 50);
    assert_eq!(drawn(&mesh, true), drawn(&mesh, false));
    let mut turned = mesh.clone();
    turned.faces.iter_mut().for_each(|face| face.swap(1, 2));
    assert_eq!(drawn(&turned, true), 0);
}

#[test]
fn of_equally_deep_surfaces_the_first_stays() {
    let mesh = cube(1);
    let pose = Pose::translation(0.0, 0.0, 4.0);
    let instance = |id| Instance { id, camera_from_vehicle: pose, ..at_origin(&mesh) };
    let image = render_labels(&CAMERA, &[instance(5), instance(6)]);
    assert!(image.instances.iter().all(|id| *id == 0 || *id == 5));
}

#[test]
fn background_is_infinitely_deep() {
    let image = render_labels(&CAMERA, &[]);
    assert_eq!(image.size, CAMERA.size);
    assert!(image.depths.iter().all(|depth| *depth == f32::INFINITY));
    assert!(image.parts.iter().all(|part| *part == 0));
}

#[test]
fn numbers_without_sense_draw_nothing_and_do_not_panic() {
    let values = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 0.0, 1e-300, 2.0];
    let points: Vec<Point3> =
        values.iter().flat_map(|x| values.iter().map(move |z| Point3::new(*x, *z, *z))).collect();
    let mut corners = Vec::new();
    for i in 0..points.len() {
        corners.extend([points[i], points[(i * 7 + 1) % 64], points[(i * 29 + 3) % 64]]);
    }
    let mesh = soup(corners);
    render_labels(&CAMERA, &[at_origin(&mesh)]);
    let mesh = Mesh { faces: vec![[0, 1, 99]], ..cube(1) };
    render_labels(&CAMERA, &[at_origin(&mesh)]);
    let empty = Camera { size: [0, 7], ..CAMERA };
    assert!(render_labels(&empty, &[at_origin(&mesh)]).parts.is_empty());
    let pose = Pose::translation(f64::NAN, 0.0, 4.0);
    let mesh = cube(1);
    let nowhere = Instance { camera_from_vehicle: pose, ..at_origin(&mesh) };
    assert!(render_labels(&CAMERA, &[nowhere]).parts.iter().all(|part| *part == 0));
}

#[test]
fn vertices_far_beyond_the_image_do_not_bend_edges() {
    // A ground plane from under the camera to the horizon.
    let far = 1e6;
    let corners = [(-far, 0.01), (far, 0.01), (far, far), (-far, far)];
    let mesh = Mesh {
        vertices: corners.iter().map(|(x, z)| Point3::new(*x, 1.5, *z)).collect(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        parts: vec![PartClass::Roof, PartClass::Roof],
    };
    let image = render_labels(&CAMERA, &[at_origin(&mesh)]);
    for (i, part) in image.parts.iter().enumerate() {
        let below_horizon = (i / 32) as f64 > CAMERA.principal_point[1];
        assert_eq!(*part != 0, below_horizon, "pixel {i}");
    }
}
