//! Made-up streets of the embedded models: labels, part mask and a picture that stands in for the photograph.

use partpose::dataset::{Frame, SequenceId, VehicleLabel};
use partpose::files::RgbImage;
use partpose::geometry::{Camera, Cuboid, EulerAngles, Extent, Pose, Rect, Vector3};
use partpose::parts::PartMask;
use partpose::render::render_labels;
use partpose::vehicle::ModelZoo;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Virtual KITTI's camera.
const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
/// Height of the camera above the road, metres.
const CAMERA_HEIGHT: f64 = 1.55;
/// Least height of a labelled vehicle's box, pixels, and least share of it that must be seen.
const MIN_HEIGHT: f64 = 25.0;
const MIN_VISIBLE: f64 = 0.35;

/// The camera as `partpose fit` reads it.
pub(super) fn camera_toml() -> String {
    let ([fx, fy], [cx, cy], [width, height]) = (CAMERA.focal, CAMERA.principal_point, CAMERA.size);
    format!(
        "width = {width}\nheight = {height}\nfx = {fx:?}\nfy = {fy:?}\ncx = {cx:?}\ncy = {cy:?}\n"
    )
}

/// Parked rows on both sides, traffic on two lanes and one that crosses.
pub(super) fn frame(zoo: &ModelZoo, index: u32, seed: u64) -> Frame {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1000) + u64::from(index));
    let sequence = SequenceId { world: "demo".to_owned(), variation: String::new() };
    let mut frame = Frame::new(sequence, index, CAMERA);
    let mut camera_angles = [0.02, 0.012].map(|range| range * (2.0 * rng.random::<f64>() - 1.0));
    camera_angles[0] += 0.01;
    let mut place = |x: f64, z: f64, yaw: f64, rng: &mut ChaCha8Rng| {
        let model = &zoo.models[rng.random_range(0..zoo.models.len())];
        let stretch = Vector3::from_fn(|_, _| 1.0 + 0.05 * (2.0 * rng.random::<f64>() - 1.0));
        let size = model.extent().to_vector().component_mul(&stretch);
        let extent = Extent::new(size.x, size.y, size.z);
        let yaw = yaw + 0.08 * (2.0 * rng.random::<f64>() - 1.0);
        let camera_from_world =
            EulerAngles { x: camera_angles[0], y: 0.0, z: camera_angles[1] }.to_rotation();
        let rotation = camera_from_world * EulerAngles { x: 0.0, y: yaw, z: 0.0 }.to_rotation();
        let position = camera_from_world * Vector3::new(x, CAMERA_HEIGHT, z);
        let camera_from_vehicle = Pose::from_parts(
            position.into(),
            nalgebra::UnitQuaternion::from_rotation_matrix(&rotation),
        );
        let cuboid = Cuboid { camera_from_vehicle, extent };
        let track = frame.vehicles.len() as u32;
        frame.vehicles.extend(label(cuboid, model.name(), track));
    };
    let mut z = 7.0 + 3.0 * rng.random::<f64>();
    while z < 45.0 {
        if rng.random::<f64>() < 0.75 {
            place(-5.2, z, 0.0, &mut rng);
        }
        if rng.random::<f64>() < 0.75 {
            place(5.6, z + 1.5, std::f64::consts::PI, &mut rng);
        }
        z += 5.8 + 1.5 * rng.random::<f64>();
    }
    place(0.3, 13.0 + 9.0 * rng.random::<f64>(), 0.0, &mut rng);
    place(-2.4, 20.0 + 15.0 * rng.random::<f64>(), std::f64::consts::PI, &mut rng);
    place(2.0 * rng.random::<f64>(), 42.0, std::f64::consts::FRAC_PI_2, &mut rng);
    mark_hidden(&mut frame, zoo);
    frame
}

/// A label if the box, cut at the image's border, shows enough of the vehicle.
fn label(cuboid: Cuboid, model: &str, track: u32) -> Option<VehicleLabel> {
    let whole = cuboid.project(&CAMERA)?;
    let bounds = whole.intersection(&CAMERA.image_rect())?;
    let truncation = 1.0 - bounds.area() / whole.area();
    let (x0, y0, x1, y1) = bounds.pixels(CAMERA.size);
    if x1 <= x0 || y1 <= y0 || truncation > 0.7 {
        return None;
    }
    let inclusive = [x0, y0, x1 - 1, y1 - 1].map(f64::from);
    Some(VehicleLabel {
        track: Some(track),
        category: "Car".to_owned(),
        dont_care: bounds.height() < MIN_HEIGHT,
        truncated: u8::from(truncation > 0.0),
        occluded: 0,
        truncation,
        occupancy: None,
        bounds: Rect::from_inclusive(inclusive[0], inclusive[1], inclusive[2], inclusive[3]),
        cuboid,
        model: Some(model.to_owned()),
        color: None,
    })
}

/// Sets occlusion, and asks to ignore what is mostly hidden.
fn mark_hidden(frame: &mut Frame, zoo: &ModelZoo) {
    let instances = frame.instances(zoo);
    let together = render_labels(&frame.camera, &instances).instances;
    let count = |image: &[u16], id: u16| image.iter().filter(|other| **other == id).count();
    let shares: Vec<f64> = instances
        .iter()
        .map(|instance| {
            let alone = render_labels(&frame.camera, std::slice::from_ref(instance)).instances;
            count(&together, instance.id) as f64 / count(&alone, instance.id).max(1) as f64
        })
        .collect();
    for (vehicle, share) in frame.vehicles.iter_mut().zip(shares) {
        vehicle.occluded = u8::from(share < 0.98) + u8::from(share < MIN_VISIBLE);
        vehicle.dont_care |= share < MIN_VISIBLE;
    }
}

/// The parts that the camera sees.
pub(super) fn part_mask(frame: &Frame, zoo: &ModelZoo) -> PartMask {
    let image = render_labels(&frame.camera, &frame.instances(zoo));
    PartMask { origin: [0, 0], size: image.size, labels: image.parts }
}

/// Grey sky, road and cars shaded by depth: enough to see what the overlay is laid over.
pub(super) fn photograph(frame: &Frame, zoo: &ModelZoo) -> RgbImage {
    let image = render_labels(&frame.camera, &frame.instances(zoo));
    let [width, height] = image.size;
    let mut pixels = Vec::with_capacity(width as usize * height as usize * 3);
    for (at, (part, depth)) in image.parts.iter().zip(&image.depths).enumerate() {
        let row = at as u32 / width;
        let grey = match part {
            0 if row < 180 => 96 + row / 4,
            0 => 58 + (row - 180) / 8,
            17..=24 => 44,
            5..=8 => 30,
            1..=4 => 215,
            _ => (190.0 - f64::from(*depth) * 1.6).max(110.0) as u32,
        };
        pixels.extend([grey as u8; 3]);
    }
    RgbImage { size: [width, height], pixels }
}
