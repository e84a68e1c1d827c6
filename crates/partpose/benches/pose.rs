//! Stage II: upscaling of kernels, and the fit of fourteen models to one detection.

use divan::{Bencher, black_box};
use partpose::dataset::{Frame, SequenceId, VehicleLabel};
use partpose::detection::Detection;
use partpose::geometry::{Camera, Cuboid, EulerAngles, Extent, Pose, Rect, Vector3};
use partpose::oracle::{Degradation, Oracle, OracleOptions};
use partpose::parts::{PartMask, PartProbabilities, Scaling, upscale_labels};
use partpose::pose::{Center2d, Center3d, ExtentSource, PartFilters, PoseEstimator, PoseOptions};
use partpose::render::{Instance, render_labels};
use partpose::vehicle::{ModelZoo, VehicleModel};

const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
/// The box of the targets: 160 x 110 pixels.
const BOUNDS: Rect = Rect::new(399.5, 149.5, 559.5, 259.5);

fn main() {
    divan::main();
}

/// A sedan at 16 m seen from behind and the side.
fn detection(kernel: usize) -> (Detection, Extent) {
    let zoo = ModelZoo::embedded();
    let model = &zoo.models[0];
    let rotation = EulerAngles { x: 0.01, y: 0.5, z: 0.0 }.to_rotation();
    let cuboid = Cuboid {
        camera_from_vehicle: Pose::from_parts(
            Vector3::new(-2.0, 1.6, 16.0).into(),
            nalgebra::UnitQuaternion::from_rotation_matrix(&rotation),
        ),
        extent: model.extent(),
    };
    let bounds = cuboid.project(&CAMERA).expect("the car is in front of the camera");
    let instance = Instance {
        mesh: model.mesh(),
        scale: Vector3::repeat(1.0),
        camera_from_vehicle: cuboid.camera_from_vehicle,
        id: 1,
    };
    let image = render_labels(&CAMERA, &[instance]);
    let sequence = SequenceId { world: "bench".to_owned(), variation: String::new() };
    let mut frame = Frame::new(sequence, 0, CAMERA);
    frame.vehicles.push(VehicleLabel {
        track: Some(0),
        category: "Car".to_owned(),
        dont_care: false,
        truncated: 0,
        occluded: 0,
        truncation: 0.0,
        occupancy: None,
        bounds,
        cuboid,
        model: Some(model.name().to_owned()),
        color: None,
    });
    let parts = PartMask { origin: [0, 0], size: image.size, labels: image.parts };
    let oracle = Oracle::new(&frame, parts, &zoo);
    let degradation = Some(Degradation { strength: 0.7, seed: 1 });
    let options = OracleOptions { kernel, degradation, ..Default::default() };
    (oracle.detection(0, &options).expect("the car is seen"), model.extent())
}

/// The embedded models and stretched ones, fourteen in all.
fn zoo_of_fourteen() -> ModelZoo {
    let embedded = ModelZoo::embedded();
    let model = |index: usize| {
        let base = &embedded.models[index % embedded.models.len()];
        let mut mesh = base.mesh().clone();
        let stretch = 1.0 + 0.01 * index as f64;
        mesh.vertices.iter_mut().for_each(|vertex| vertex.z *= stretch);
        let e = base.extent();
        let extent = Extent::new(e.width, e.height, e.length * stretch);
        VehicleModel::new(&format!("{}-{index}", base.name()), "Car", "sedan", extent, mesh)
            .expect("a stretched model is a model")
    };
    ModelZoo { models: (0..14).map(model).collect() }
}

fn bench_fit(bencher: Bencher, options: &PoseOptions) {
    let (detection, extent) = detection(28);
    let estimator = PoseEstimator::new(&zoo_of_fourteen(), options);
    let extent = ExtentSource::Given(extent);
    bencher.bench_local(|| estimator.estimate(&CAMERA, black_box(&detection), &extent));
}

/// As in the paper: 28 x 28, nearest, EPnP.
#[divan::bench]
fn paper_fourteen_models(bencher: Bencher) {
    let options = PoseOptions {
        scaling: Scaling::Nearest,
        center_2d: Center2d::Rectangle,
        center_3d: Center3d::Cuboid,
        filters: PartFilters::ALL,
        ..Default::default()
    };
    bench_fit(bencher, &options);
}

/// Past the paper: visible centres with refinement.
#[divan::bench]
fn visible_fourteen_models(bencher: Bencher) {
    let options = PoseOptions {
        center_2d: Center2d::Mass,
        center_3d: Center3d::Visible,
        refine: true,
        ..Default::default()
    };
    bench_fit(bencher, &options);
}

fn kernel_56() -> PartProbabilities {
    detection(56).0.probabilities
}

#[divan::bench]
fn argmax_56(bencher: Bencher) {
    let probabilities = kernel_56();
    bencher.bench_local(|| black_box(&probabilities).labels());
}

#[divan::bench]
fn nearest_56_to_160_x_110(bencher: Bencher) {
    let labels = kernel_56().labels();
    bencher.bench_local(|| upscale_labels(black_box(&labels), 56, &BOUNDS, CAMERA.size));
}

#[divan::bench]
fn bilinear_56_to_160_x_110(bencher: Bencher) {
    let probabilities = kernel_56();
    bencher
        .bench_local(|| black_box(&probabilities).upscale(&BOUNDS, CAMERA.size, Scaling::Bilinear));
}

/// Noise in every cell: no two neighbours agree, so nothing can be skipped.
#[divan::bench]
fn bilinear_56_to_160_x_110_noise(bencher: Bencher) {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    let values = (0..30 * 56 * 56).map(|_| next()).collect();
    let probabilities = PartProbabilities::new(56, values).expect("all lie between 0 and 1");
    bencher
        .bench_local(|| black_box(&probabilities).upscale(&BOUNDS, CAMERA.size, Scaling::Bilinear));
}
