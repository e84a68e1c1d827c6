//! What fitting measures of a vehicle brings, on vehicles that are not in the zoo.
//!
//! `shape_fits [SHARE]`: vehicles between each model that comes with the library and the one nearest in size (`SHARE` of
//! the way, half by default) are drawn from all around at two distances; masks are exact. The zoo is fitted with and
//! without measures (`DenseOptions::fit_shape`), the size given or free. Tells 3D IoU, the energy, how far the measures
//! lie from the true ones in standard deviations of what is expected, and the time a vehicle on one thread.

use std::time::Instant;

use partpose::eval::pose_deviation;
use partpose::geometry::{Camera, Cuboid, EulerAngles, Pose, Vector3};
use partpose::oracle::detection_from_labels;
use partpose::parts::PartMask;
use partpose::pose::dense::{DenseOptions, SizePrior};
use partpose::pose::{ExtentSource, PnpMethod, PoseEstimator, PoseOptions};
use partpose::render::{Instance, render_labels};
use partpose::vehicle::{ModelZoo, ParametricVehicle, VehicleModel};

const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
/// Distances, metres, and headings.
const DISTANCES: [f64; 2] = [10.0, 20.0];
const HEADINGS: usize = 5;

/// What the fits of one kind came to, summed.
#[derive(Default)]
struct Sums {
    count: f64,
    iou: f64,
    energy: f64,
    /// Of measures in standard deviations: the models' own off the true ones, the fitted ones, and how many.
    off: [f64; 2],
    measures: f64,
    seconds: f64,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let share = std::env::args().nth(1).map_or(Ok(0.5), |text| text.parse::<f64>())?;
    let zoo = ModelZoo::embedded();
    let estimators = [false, true].map(|fit_shape| {
        let dense = DenseOptions { fit_shape, ..Default::default() };
        let method = PnpMethod::Dense;
        PoseEstimator::new(&zoo, &PoseOptions { method, dense, ..Default::default() })
    });
    let mut sums: [[Sums; 2]; 2] = Default::default();
    for vehicle in between(share) {
        let Ok(model) = vehicle.build() else { continue };
        for (distance, i) in DISTANCES.iter().flat_map(|d| (0..HEADINGS).map(move |i| (d, i))) {
            let yaw = (i as f64 + 0.37) / HEADINGS as f64 * std::f64::consts::TAU;
            for free in 0..2 {
                for shaped in 0..2 {
                    fit(
                        &estimators[shaped],
                        (&vehicle, &model),
                        (*distance, yaw),
                        free == 1,
                        &mut sums[free][shaped],
                    );
                }
            }
        }
    }
    tell(&sums);
    Ok(())
}

/// Each model mixed with the one nearest to it in size.
fn between(share: f64) -> Vec<ParametricVehicle> {
    let all = ParametricVehicle::all();
    let far = |a: &ParametricVehicle, b: &ParametricVehicle| {
        (a.length - b.length).abs() + (a.width - b.width).abs() + (a.height - b.height).abs()
    };
    let mixed = all.iter().filter_map(|own| {
        let others = all.iter().filter(|other| other.name != own.name);
        let near = others.min_by(|a, b| far(own, a).total_cmp(&far(own, b)))?;
        Some(own.lerp(near, share))
    });
    mixed.collect()
}

fn fit(
    estimator: &PoseEstimator,
    (vehicle, model): (&ParametricVehicle, &VehicleModel),
    (distance, yaw): (f64, f64),
    free: bool,
    sums: &mut Sums,
) {
    let rotation = EulerAngles { x: 0.01, y: yaw, z: -0.01 }.to_rotation();
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
    let place = Vector3::new(0.1 * distance, 1.6, distance);
    let truth = Cuboid {
        camera_from_vehicle: Pose::from_parts(place.into(), rotation),
        extent: model.extent(),
    };
    let Some(bounds) = truth.project(&CAMERA) else { return };
    let instance = Instance {
        mesh: model.mesh(),
        scale: Vector3::repeat(1.0),
        camera_from_vehicle: truth.camera_from_vehicle,
        id: 1,
    };
    let image = render_labels(&CAMERA, &[instance]);
    let parts = PartMask { origin: [0, 0], size: image.size, labels: image.parts };
    let detection = detection_from_labels(&parts, &bounds, 28);
    let extent = if free {
        ExtentSource::Free(SizePrior::around(None))
    } else {
        ExtentSource::Given(truth.extent)
    };
    let start = Instant::now();
    let found = estimator.estimate(&CAMERA, &detection, &extent);
    sums.seconds += start.elapsed().as_secs_f64();
    sums.count += 1.0;
    let Ok(found) = found else { return };
    sums.iou += pose_deviation(&found.cuboid(), &truth, true).iou3d;
    let Some(report) = &found.dense else { return };
    sums.energy += report.energy;
    let mut true_vehicle = vehicle.clone();
    let measures = true_vehicle.measures_mut();
    for fitted in &report.shape {
        let true_value = measures.iter().find(|(name, _)| *name == fitted.name);
        if let Some((_, true_value)) = true_value {
            for (sum, value) in sums.off.iter_mut().zip([fitted.of_model, fitted.value]) {
                *sum += (value - **true_value).abs() / fitted.spread;
            }
            sums.measures += 1.0;
        }
    }
}

#[allow(clippy::print_stdout)]
fn tell(sums: &[[Sums; 2]; 2]) {
    for (sums, extent) in sums.iter().zip(["size given", "size free"]) {
        for (sums, shape) in sums.iter().zip(["the models' shapes", "measures fitted"]) {
            println!(
                "{extent}, {shape}: {} vehicles, 3D IoU {:.4}, energy {:.4}, measures off {:.2} before and {:.2} after, {:.0} ms",
                sums.count,
                sums.iou / sums.count,
                sums.energy / sums.count,
                sums.off[0] / sums.measures,
                sums.off[1] / sums.measures,
                1e3 * sums.seconds / sums.count,
            );
        }
    }
}
