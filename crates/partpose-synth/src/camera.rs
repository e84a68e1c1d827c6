//! From linear light to a photograph: what lenses, sensors, weather and files add.
//!
//! Every effect can be switched off by itself and follows from a seed. That pictures differ in them from frame to frame
//! is domain randomisation (Tobin et al. 2017): a network that has seen many cameras carries over to others. The order
//! is that of the light: rain, motion, lens, drops on it, sensor, curve, file.

mod lens;
mod motion;
mod rain;
mod sensor;

use image::RgbImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scene::Scene;
use crate::shading::Rendered;

/// What the camera does; [`CameraEffects::default`] is a clean one that only exposes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraEffects {
    /// Stops above or below what the meter says.
    pub exposure: f32,
    /// Share of the light's colour that white balance removes.
    pub white_balance: f32,
    /// Colour shift that is left: warmer above 0, colder below.
    pub warmth: f32,
    /// Shift towards magenta above 0, green below.
    pub tint: f32,
    /// 0 clips highlights hard, 1 rolls them off like film.
    pub shoulder: f32,
    /// Steepness of the tone curve in the middle; 0 for none, 1 to 1.5 is as hard as cameras for machines are set.
    pub contrast: f32,
    /// Linear value below which all is black.
    pub black: f32,
    /// 1 leaves colours as they are.
    pub saturation: f32,
    /// Noise of the sensor: standard deviation at middle grey.
    pub noise: f32,
    /// Share of the way between [`Scene::world_from_camera`] and the pose after that blurs the picture.
    pub motion_blur: f32,
    /// Standard deviation of the lens' softness, pixels.
    pub softness: f32,
    /// Share of the difference from a blurred picture that is added, as cameras do.
    pub sharpening: f32,
    /// Loss of light in the corners.
    pub vignette: f32,
    /// How far red and blue part in the corners, pixels.
    pub aberration: f32,
    /// Glare around bright places and ghosts of the sun.
    pub flare: f32,
    /// Drops of water on the lens or the windscreen before it.
    pub drops: u32,
    /// Streaks of falling rain: 0 none, 1 heavy.
    pub rain: f32,
    /// Quality of the JPEG file that the picture has been through; `None` for none.
    pub jpeg: Option<u8>,
}

impl Default for CameraEffects {
    fn default() -> Self {
        Self {
            exposure: 0.0,
            white_balance: 0.7,
            warmth: 0.0,
            tint: 0.0,
            shoulder: 0.4,
            contrast: 0.25,
            black: 0.0,
            saturation: 1.0,
            noise: 0.0,
            motion_blur: 0.0,
            softness: 0.0,
            sharpening: 0.0,
            vignette: 0.0,
            aberration: 0.0,
            flare: 0.0,
            drops: 0,
            rain: 0.0,
            jpeg: None,
        }
    }
}

impl CameraEffects {
    /// A camera at random, the same for a sequence; `rain` is that of the air.
    pub fn random(rng: &mut ChaCha8Rng, rain: f64) -> Self {
        let rain = rain.clamp(0.0, 1.0) as f32;
        let sometimes = |rng: &mut ChaCha8Rng, share: f64, low: f32, high: f32| {
            let value = rng.random_range(low..high);
            if rng.random_bool(share) { value } else { 0.0 }
        };
        let drops = if rain > 0.0 { rng.random_range(0.0..40.0 * rain) as u32 } else { 0 };
        let camera = Self {
            exposure: rng.random_range(-0.6..0.7),
            white_balance: rng.random_range(0.35..1.0),
            warmth: rng.random_range(-0.12..0.12),
            tint: rng.random_range(-0.04..0.04),
            shoulder: rng.random_range(0.0..0.9),
            contrast: rng.random_range(0.0..1.0),
            black: sometimes(rng, 0.6, 0.002, 0.03),
            saturation: rng.random_range(0.75..1.2),
            noise: 0.002 + 0.026 * rng.random::<f32>().powi(2),
            motion_blur: sometimes(rng, 0.5, 0.1, 1.0),
            softness: rng.random_range(0.0..0.7),
            sharpening: sometimes(rng, 0.5, 0.1, 0.7),
            vignette: sometimes(rng, 0.6, 0.05, 0.4),
            aberration: sometimes(rng, 0.5, 0.1, 0.9),
            flare: sometimes(rng, 0.6, 0.1, 1.0),
            drops,
            rain,
            jpeg: rng.random_bool(0.4).then(|| rng.random_range(55..96)),
        };
        if !rng.random_bool(0.35) {
            return camera;
        }
        // As cameras for machines often are, those of KITTI too: black shadows, skies clipped to white, coloured edges.
        Self {
            exposure: rng.random_range(-0.1..0.6),
            shoulder: rng.random_range(0.0..0.15),
            contrast: rng.random_range(0.9..1.5),
            black: rng.random_range(0.008..0.03),
            aberration: rng.random_range(0.5..1.7),
            ..camera
        }
    }
}

/// Linear RGB in rows, as the effects work on it.
pub(crate) struct Frame {
    pub(crate) size: [usize; 2],
    pub(crate) pixels: Vec<[f32; 3]>,
    /// What the pixels were before an effect that looks at neighbours.
    pub(crate) old: Vec<[f32; 3]>,
}

/// The photograph of a rendered scene.
pub fn photograph(
    scene: &Scene,
    rendered: &Rendered,
    effects: &CameraEffects,
    seed: u64,
) -> RgbImage {
    let size = rendered.size.map(|side| side as usize);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Drawn in any case, so that one effect does not change another's numbers.
    let [rain_seed, drop_seed, noise_seed] = [rng.random::<u64>(), rng.random(), rng.random()];
    let gain = sensor::meter(size, &rendered.color, effects);
    let exposed = |pixel: &[f32; 3]| [0, 1, 2].map(|i| pixel[i] * gain[i]);
    let pixels = rendered.color.iter().map(exposed).collect();
    let mut frame = Frame { size, pixels, old: Vec::new() };
    if effects.rain > 0.0 {
        rain::add_streaks(&mut frame, effects.rain, rain_seed);
    }
    if effects.motion_blur > 0.0 {
        motion::blur(&mut frame, scene, rendered, effects.motion_blur);
    }
    if effects.flare > 0.0 {
        lens::flare(&mut frame, scene, gain, effects.flare);
    }
    if effects.drops > 0 {
        rain::add_drops(&mut frame, effects.drops, drop_seed);
    }
    if effects.aberration > 0.0 {
        lens::part_colors(&mut frame, effects.aberration);
    }
    if effects.softness > 0.05 {
        lens::soften(&mut frame, effects.softness);
    }
    if effects.vignette > 0.0 {
        lens::vignette(&mut frame, effects.vignette);
    }
    let image = sensor::develop(&mut frame, effects, noise_seed);
    effects
        .jpeg
        .map_or(image.clone(), |quality| sensor::through_jpeg(&image, quality).unwrap_or(image))
}
