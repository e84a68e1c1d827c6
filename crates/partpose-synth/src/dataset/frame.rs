//! One frame: drawn, turned into files.

use std::path::Path;

use partpose::dataset::SequenceId;
use partpose::files::{self, RgbImage};
use partpose::geometry::Camera;
use partpose::parts::PartClass;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::rows::{self, FrameRows};
use super::sequences::PlannedWorld;
use super::{Effect, SynthError, SynthOptions, effects, fragments};
use crate::camera::{CameraEffects, photograph};
use crate::shading::{self, Rendered};
use crate::world::{CameraOptions, Moment, Variation, World, hash};

/// Depth that stands for the sky, centimetres.
const FAR: u16 = u16::MAX;

/// Which picture is meant.
pub(super) struct Shot<'a> {
    pub(super) id: &'a SequenceId,
    pub(super) index: u32,
    pub(super) variation: Variation,
}

/// Draws a frame and writes its images and then its rows.
pub(super) fn write(
    out: &Path,
    shot: &Shot,
    world: &World,
    options: &SynthOptions,
) -> Result<(), SynthError> {
    let Shot { id, index, variation } = *shot;
    let mut moment = world.moment(index, options.interval, variation);
    if !options.effects.contains(&Effect::Fog) {
        moment.scene.air.fog = 0.0;
    }
    let rendered = shading::render(&moment.scene, &options.render);
    let file = |archive: &str| {
        out.join(archive).join(&id.world).join(&id.variation).join(format!("{index:05}.png"))
    };
    let picture = photographed(&moment, &rendered, shot, options);
    files::write(&file("vkitti_1.3.1_rgb"), &fast_png(&picture))?;
    files::write(&file("vkitti_1.3.1_scenegt"), &fast_png(&segments(&rendered, &moment)))?;
    files::write(&file("parts"), &fast_png(&parts(&rendered)))?;
    files::write(&file("vkitti_1.3.1_depthgt"), &depth_png(&rendered))?;
    fragments::keep(out, id, index, &frame_rows(index, &rendered, &moment))?;
    Ok(())
}

/// The camera, where it is another than every reader takes for granted.
pub(super) fn other_camera(options: &SynthOptions, planned: &[PlannedWorld]) -> Option<Camera> {
    let of_layout = planned.iter().find_map(PlannedWorld::camera_of_layout);
    let camera = of_layout.unwrap_or(options.camera.camera);
    (camera != CameraOptions::default().camera).then_some(camera)
}

/// The rows of a frame: its camera, and the vehicles of which anything is seen.
pub(super) fn frame_rows(index: u32, rendered: &Rendered, moment: &Moment) -> FrameRows {
    let mut pixels = vec![0_usize; moment.vehicles.len() + 1];
    for instance in &rendered.instances {
        if let Some(count) = pixels.get_mut(usize::from(*instance)) {
            *count += 1;
        }
    }
    let scene = &moment.scene;
    let seen = moment.vehicles.iter().zip(&pixels[1..]).filter(|(_, pixels)| **pixels > 0);
    let row = |(vehicle, pixels): (_, &usize)| {
        rows::vehicle(index, vehicle, &scene.world_from_camera, &scene.camera, *pixels)
    };
    FrameRows {
        extrinsics: rows::extrinsics(index, &scene.world_from_camera),
        vehicles: seen.filter_map(row).collect(),
    }
}

/// The picture as the camera of the sequence takes it.
fn photographed(
    moment: &Moment,
    rendered: &Rendered,
    shot: &Shot,
    options: &SynthOptions,
) -> RgbImage {
    let words: Vec<i64> = shot.id.to_string().bytes().map(i64::from).collect();
    let seed = hash(options.seed, &words);
    let camera = CameraEffects::random(&mut ChaCha8Rng::seed_from_u64(seed), moment.scene.air.rain);
    let effects = effects::only(&options.effects, camera);
    let seed = hash(seed, &[i64::from(shot.index)]);
    let image = photograph(&moment.scene, rendered, &effects, seed);
    RgbImage { size: [image.width(), image.height()], pixels: image.into_raw() }
}

fn segments(rendered: &Rendered, moment: &Moment) -> RgbImage {
    let colors: Vec<[u8; 3]> =
        moment.vehicles.iter().map(|vehicle| rows::track_color(vehicle.track)).collect();
    let of_classes: [[u8; 3]; 256] = std::array::from_fn(|class| rows::class_color(class as u8));
    let color = |(class, instance): (&u8, &u16)| {
        let of_class = of_classes[usize::from(*class)];
        let own = usize::from(*instance).checked_sub(1).and_then(|place| colors.get(place));
        own.copied().unwrap_or(of_class)
    };
    let pixels: Vec<[u8; 3]> =
        rendered.classes.iter().zip(&rendered.instances).map(color).collect();
    RgbImage { size: rendered.size, pixels: pixels.into_flattened() }
}

fn parts(rendered: &Rendered) -> RgbImage {
    let mut colors = [[0_u8; 3]; 256];
    for class in PartClass::ALL {
        colors[usize::from(class.id())] = class.color();
    }
    let pixels: Vec<[u8; 3]> =
        rendered.parts.iter().map(|part| colors[usize::from(*part)]).collect();
    RgbImage { size: rendered.size, pixels: pixels.into_flattened() }
}

/// A picture as PNG, packed fast: the noise of its last bits cannot be packed by any effort, and even labels have so
/// little in them that they become small anyhow.
fn fast_png(picture: &RgbImage) -> Vec<u8> {
    packed(&picture.pixels, picture.size, image::ExtendedColorType::Rgb8)
}

fn packed(bytes: &[u8], [width, height]: [u32; 2], color: image::ExtendedColorType) -> Vec<u8> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let mut file = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Up);
    // Writing to memory cannot fail for an image whose pixels fill its size.
    let written = image::ImageEncoder::write_image(encoder, bytes, width, height, color);
    debug_assert!(written.is_ok());
    file
}

fn depth_png(rendered: &Rendered) -> Vec<u8> {
    let centimetres = |depth: &f32| {
        let value = (f64::from(*depth) * 100.0).round();
        if value < f64::from(FAR) { value.max(0.0) as u16 } else { FAR }
    };
    // The encoder takes the machine's own order of bytes.
    let bytes: Vec<[u8; 2]> =
        rendered.depths.iter().map(|depth| centimetres(depth).to_ne_bytes()).collect();
    packed(bytes.as_flattened(), rendered.size, image::ExtendedColorType::L16)
}
