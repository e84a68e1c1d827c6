//! Draws a street with cars to look at: `cargo run --release --example one_picture OUT.png [SEED]`.

#![allow(
    clippy::all,
    clippy::pedantic,
    clippy::restriction,
    reason = "under construction, as the crate"
)]
#![expect(clippy::print_stdout, reason = "an example that reports times")]

use std::sync::Arc;
use std::time::Instant;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use partpose::geometry::{Camera, Pose};
use partpose::vehicle::ModelZoo;
use partpose_synth::camera::{CameraEffects, photograph};
use partpose_synth::scene::{
    Air, Light, Material, Object, Scene, SegmentClass, SurfaceMesh, Texture,
};
use partpose_synth::shading::{RenderOptions, render};
use partpose_synth::vehicles::{Lamps, VehicleKind, materials, random_look, vehicle_kind};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().unwrap_or_else(|| "out.png".to_owned());
    let seed = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(1);
    let start = Instant::now();
    let kinds: Vec<VehicleKind> = ModelZoo::embedded().models.iter().map(vehicle_kind).collect();
    println!("{} kinds: {:.0} ms", kinds.len(), start.elapsed().as_secs_f64() * 1e3);
    let scene = street(&kinds, seed);
    for (name, options) in [("cheap", RenderOptions::cheap()), ("fine", RenderOptions::default())] {
        let start = Instant::now();
        let picture = render(&scene, &options);
        println!("{name}: {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
        if name == "fine" {
            let start = Instant::now();
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let effects = CameraEffects::random(&mut rng, scene.air.rain);
            let image = photograph(&scene, &picture, &effects, seed);
            println!("camera: {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
            if let Err(error) = image.save(&out) {
                println!("{out}: {error}");
            }
        }
    }
}

fn street(kinds: &[VehicleKind], seed: u64) -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut objects = vec![
        quad(
            [-60.0, 60.0],
            [-20.0, 300.0],
            0.0,
            material([0.11, 0.13, 0.05], Texture::Grass),
            SegmentClass::Terrain,
        ),
        quad(
            [-5.2, 5.2],
            [-20.0, 300.0],
            -0.02,
            material([0.10, 0.10, 0.105], Texture::Asphalt),
            SegmentClass::Road,
        ),
        quad(
            [5.2, 7.6],
            [-20.0, 300.0],
            -0.12,
            material([0.24, 0.23, 0.22], Texture::Slabs { size: [0.5, 0.35], joint: 0.012 }),
            SegmentClass::Terrain,
        ),
        quad(
            [-7.6, -5.2],
            [-20.0, 300.0],
            -0.12,
            material([0.24, 0.23, 0.22], Texture::Slabs { size: [0.5, 0.35], joint: 0.012 }),
            SegmentClass::Terrain,
        ),
    ];
    for i in 0..40 {
        let z = 6.0 * f64::from(i);
        objects.push(quad(
            [-0.07, 0.07],
            [z, z + 3.0],
            -0.026,
            material([0.55; 3], Texture::Plain),
            SegmentClass::Road,
        ));
    }
    for i in 0..8 {
        let z = 8.0 + 15.0 * f64::from(i);
        let color = [
            0.35 + 0.3 * rng.random::<f32>(),
            0.33 + 0.2 * rng.random::<f32>(),
            0.28 + 0.1 * rng.random::<f32>(),
        ];
        let facade = Texture::Facade { field: [2.6, 3.0], window: [1.3, 1.6], seed: i as u32 };
        objects.push(block(
            [-15.0, -9.5],
            [z, z + 13.0],
            9.0 + f64::from(i % 3),
            material(color, facade),
            SegmentClass::Building,
        ));
        if i % 2 == 1 {
            objects.push(block(
                [10.5, 18.0],
                [z, z + 12.0],
                7.0,
                material(color, facade),
                SegmentClass::Building,
            ));
        } else {
            objects.push(tree([9.0, z + 5.0], &mut rng));
        }
    }
    let mut instance = 0;
    let mut add =
        |kind: &VehicleKind, x: f64, z: f64, turn: f64, lamps: Lamps, rng: &mut ChaCha8Rng| {
            instance += 1;
            let look = random_look(rng);
            let stretch = Vector3::new(
                rng.random_range(0.97..1.03),
                rng.random_range(0.97..1.04),
                rng.random_range(0.95..1.05),
            );
            objects.push(Object {
                mesh: kind.surface.clone(),
                materials: materials(&look, &lamps),
                world_from_object: Pose::from_parts(
                    nalgebra::Translation3::new(x, -0.02, z),
                    UnitQuaternion::from_euler_angles(0.0, turn, 0.0),
                ),
                scale: stretch,
                class: SegmentClass::Car,
                instance,
                has_parts: true,
            });
        };
    let pick = |rng: &mut ChaCha8Rng| rng.random_range(0..kinds.len());
    for i in 0..6 {
        let k = pick(&mut rng);
        let z = 9.0 + 6.8 * f64::from(i);
        add(&kinds[k], 4.1, z, 0.0, Lamps::default(), &mut rng);
        let k = pick(&mut rng);
        add(&kinds[k], -4.2, 8.0 + z, std::f64::consts::PI, Lamps::default(), &mut rng);
    }
    add(&kinds[0], 1.7, 12.5, 0.02, Lamps { brake: true, ..Lamps::default() }, &mut rng);
    add(
        &kinds[1 % kinds.len()],
        -1.8,
        11.0,
        3.10,
        Lamps { daytime: true, ..Lamps::default() },
        &mut rng,
    );
    add(&kinds[0], -1.9, 30.0, 3.13, Lamps { head: true, ..Lamps::default() }, &mut rng);
    add(&kinds[0], 0.5, 24.0, 1.2, Lamps { left: true, ..Lamps::default() }, &mut rng);
    let height = rng.random_range(0.35..1.1_f64);
    let turn = rng.random_range(0.0..std::f64::consts::TAU);
    let to_sun = Vector3::new(height.cos() * turn.cos(), -height.sin(), height.cos() * turn.sin());
    let pose = Pose::translation(1.2, -1.65, 0.0);
    Scene {
        objects,
        light: Light {
            to_sun,
            turbidity: 3.0,
            overcast: if seed.is_multiple_of(4) { 1.0 } else { 0.0 },
        },
        air: Air { wetness: if seed.is_multiple_of(5) { 0.8 } else { 0.0 }, ..Air::default() },
        camera: Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]),
        world_from_camera: pose,
        world_from_camera_after: pose,
    }
}

fn material(color: [f32; 3], texture: Texture) -> Material {
    Material {
        color,
        texture,
        roughness: 0.85,
        metallic: 0.0,
        clear_coat: 0.0,
        transmission: 0.0,
        emission: [0.0; 3],
        dirt: 0.0,
    }
}

fn object(mesh: SurfaceMesh, material: Material, class: SegmentClass) -> Object {
    Object {
        mesh: Arc::new(mesh),
        materials: Arc::new([material]),
        world_from_object: Pose::identity(),
        scale: Vector3::repeat(1.0),
        class,
        instance: 0,
        has_parts: false,
    }
}

fn quad(x: [f64; 2], z: [f64; 2], y: f64, of: Material, class: SegmentClass) -> Object {
    let mut mesh = SurfaceMesh::default();
    let [x, z, y] = [x.map(|v| v as f32), z.map(|v| v as f32), [y as f32; 2]];
    add_quad(
        &mut mesh,
        [[x[0], y[0], z[0]], [x[1], y[0], z[0]], [x[1], y[0], z[1]], [x[0], y[0], z[1]]],
        -Vector3::y(),
        |p| [p[2], p[0]],
    );
    object(mesh, of, class)
}

fn add_quad(
    mesh: &mut SurfaceMesh,
    corners: [[f32; 3]; 4],
    normal: Vector3<f32>,
    coordinates: impl Fn([f32; 3]) -> [f32; 2],
) {
    let start = mesh.vertices.len() as u32;
    for corner in corners {
        mesh.vertices.push(Point3::from(corner));
        mesh.normals.push(normal);
        mesh.coordinates.push(coordinates(corner));
    }
    for face in [[0, 1, 2], [0, 2, 3]] {
        mesh.faces.push(face.map(|i| start + i));
        mesh.materials.push(0);
        mesh.parts.push(0);
    }
}

fn block(x: [f64; 2], z: [f64; 2], height: f64, of: Material, class: SegmentClass) -> Object {
    let mut mesh = SurfaceMesh::default();
    let [x, z] = [x, z].map(|pair| pair.map(|v| v as f32));
    let h = -(height as f32);
    for (i, side) in x.into_iter().enumerate() {
        let normal = Vector3::x() * if i == 0 { -1.0 } else { 1.0 };
        add_quad(
            &mut mesh,
            [[side, 0.0, z[0]], [side, 0.0, z[1]], [side, h, z[1]], [side, h, z[0]]],
            normal,
            |p| [p[2], -p[1]],
        );
    }
    for (i, end) in z.into_iter().enumerate() {
        let normal = Vector3::z() * if i == 0 { -1.0 } else { 1.0 };
        add_quad(
            &mut mesh,
            [[x[0], 0.0, end], [x[1], 0.0, end], [x[1], h, end], [x[0], h, end]],
            normal,
            |p| [p[0], -p[1]],
        );
    }
    object(mesh, of, class)
}

fn tree([x, z]: [f64; 2], rng: &mut ChaCha8Rng) -> Object {
    let mut mesh = SurfaceMesh::default();
    for _ in 0..160 {
        let direction = Vector3::new(
            rng.random_range(-1.0..1.0_f32),
            rng.random_range(-1.0..1.0),
            rng.random_range(-1.0..1.0),
        )
        .normalize();
        let center = Vector3::new(x as f32, -5.0, z as f32)
            + direction.component_mul(&Vector3::new(2.2, 2.6, 2.2)) * rng.random_range(0.4..1.0);
        let a = Vector3::new(
            rng.random_range(-1.0..1.0_f32),
            rng.random_range(-1.0..1.0),
            rng.random_range(-1.0..1.0),
        )
        .normalize();
        let b = a.cross(&direction).normalize();
        let corner = |i: f32, j: f32| -> [f32; 3] { (center + a * i * 0.8 + b * j * 0.8).into() };
        let [u, v] = [rng.random_range(0.0..50.0_f32), rng.random_range(0.0..50.0_f32)];
        let places = [[0.0, 0.0], [1.6, 0.0], [1.6, 1.6], [0.0, 1.6]];
        let mut at = places.into_iter().cycle();
        let cell = std::cell::RefCell::new(&mut at);
        add_quad(
            &mut mesh,
            [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            direction,
            |_| {
                let [x, y] = cell.borrow_mut().next().unwrap_or_default();
                [u + x, v + y]
            },
        );
    }
    object(
        mesh,
        material([0.075, 0.13, 0.03], Texture::Leaves { cover: 0.55, size: 0.12 }),
        SegmentClass::Tree,
    )
}
