//! The dense fit of one vehicle: a known model, and fourteen.
//!
//! Vehicles are those of a made-up street at 8 to 40 m, seen from all around, with exact and with erring masks of 28 x
//! 28 cells; every sample fits the next one. `docs/dense-fit.md` has the medians over a world.

#[path = "../tests/common/street.rs"]
mod street;

use divan::{Bencher, black_box};
use partpose::dataset::{Frame, SequenceId, VehicleLabel};
use partpose::detection::Detection;
use partpose::geometry::Extent;
use partpose::oracle::{Degradation, Oracle, OracleOptions};
use partpose::parts::PartMask;
use partpose::pose::{ExtentSource, PnpMethod, PoseEstimator, PoseOptions};
use partpose::render::render_labels;
use partpose::vehicle::ModelZoo;
use street::CAMERA;

/// Vehicles of the street.
const VEHICLES: usize = 15;

fn main() {
    divan::main();
}

fn zoo(models: usize) -> ModelZoo {
    let mut zoo = ModelZoo::embedded();
    zoo.models.truncate(models);
    zoo
}

fn vehicle(zoo: &ModelZoo, index: usize) -> VehicleLabel {
    let depth = 8.0 + 32.0 * index as f64 / VEHICLES as f64;
    let side = 0.25 * depth * (1.7 * index as f64).sin();
    street::vehicle(zoo, index % zoo.models.len(), [side, depth], 2.4 * index as f64)
}

/// One vehicle a frame.
fn detections(zoo: &ModelZoo, strength: Option<f64>) -> Vec<(Detection, Extent)> {
    let one = |index: usize| {
        let sequence = SequenceId { world: "street".to_owned(), variation: String::new() };
        let mut frame = Frame::new(sequence, index as u32, CAMERA);
        frame.vehicles = vec![vehicle(zoo, index)];
        let image = render_labels(&CAMERA, &frame.instances(zoo));
        let parts = PartMask { origin: [0, 0], size: image.size, labels: image.parts };
        let oracle = Oracle::new(&frame, parts, zoo);
        let degradation = strength.map(|strength| Degradation { strength, seed: 3 });
        let options = OracleOptions { degradation, ..Default::default() };
        Some((oracle.detection(0, &options)?, frame.vehicles[0].cuboid.extent))
    };
    (0..VEHICLES).filter_map(one).collect()
}

fn bench_fit(bencher: Bencher, models: usize, strength: Option<f64>) {
    let zoo = zoo(models);
    let options = PoseOptions { method: PnpMethod::Dense, ..Default::default() };
    let estimator = PoseEstimator::new(&zoo, &options);
    let detections = detections(&zoo, strength);
    let mut next = 0;
    bencher.bench_local(|| {
        let (detection, extent) = &detections[next % detections.len()];
        next += 1;
        estimator.estimate(&CAMERA, black_box(detection), &ExtentSource::Given(*extent))
    });
}

#[divan::bench(args = [1, 14], sample_count = 60, sample_size = 1)]
fn exact(bencher: Bencher, models: usize) {
    bench_fit(bencher, models, None);
}

#[divan::bench(args = [1, 14], sample_count = 60, sample_size = 1)]
fn erring(bencher: Bencher, models: usize) {
    bench_fit(bencher, models, Some(0.9));
}
