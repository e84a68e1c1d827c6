//! Time of label pictures: whole images and the small windows that fits are made in.

#[path = "../tests/common/mod.rs"]
mod common;

use divan::Bencher;
use nalgebra::UnitQuaternion;
use partpose::geometry::{Camera, Cuboid, Pose, Vector3};
use partpose::render::{Instance, LabelRenderer, RenderOptions};
use partpose::vehicle::Mesh;

const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
/// Cells a cube side is cut into: 12 * 29² = 10,092 faces.
const CELLS: u32 = 29;

fn main() {
    divan::main();
}

/// Ten cars at 8 to 40 m that a camera of 725 px focal length sees next to each other.
fn ten_poses() -> Vec<Pose> {
    (0..10)
        .map(|i| {
            let k = f64::from(i);
            let z = 8.0 + 32.0 * k / 9.0;
            let x = (k * 2.4).sin() * 0.6 * z;
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, k * 0.7, 0.0));
            Pose::from_parts(Vector3::new(x, 1.5, z).into(), rotation)
        })
        .collect()
}

fn instance(mesh: &Mesh, camera_from_vehicle: Pose, id: u16) -> Instance<'_> {
    Instance { mesh, scale: Vector3::repeat(1.0), camera_from_vehicle, id }
}

#[divan::bench(args = [false, true])]
fn ten_vehicles_of_10k_faces(bencher: Bencher, cull_back_faces: bool) {
    let mesh = common::car(CELLS);
    let poses = ten_poses();
    let instances: Vec<Instance> =
        (1..).zip(&poses).map(|(id, pose)| instance(&mesh, *pose, id)).collect();
    let options = RenderOptions { cull_back_faces };
    let mut renderer = LabelRenderer::default();
    bencher.bench_local(|| renderer.render(&CAMERA, &instances, &options).parts[0]);
}

#[divan::bench]
fn empty_picture(bencher: Bencher) {
    let mut renderer = LabelRenderer::default();
    bencher.bench_local(|| renderer.render(&CAMERA, &[], &RenderOptions::default()).parts[0]);
}

#[divan::bench(args = [(28, false), (56, false), (56, true), (112, false), (112, true)])]
fn one_vehicle_in_a_window(bencher: Bencher, (side, cull_back_faces): (u32, bool)) {
    let mesh = common::car(CELLS);
    let pose = ten_poses()[2];
    let cuboid = Cuboid { camera_from_vehicle: pose, extent: common::EXTENT };
    let bounds = cuboid.project(&CAMERA).expect("the vehicle stands in front of the camera");
    let camera = CAMERA.crop(&bounds, [side, side]);
    let options = RenderOptions { cull_back_faces };
    let mut renderer = LabelRenderer::default();
    let instances = [instance(&mesh, pose, 1)];
    bencher.bench_local(|| renderer.render(&camera, &instances, &options).parts[0]);
}
