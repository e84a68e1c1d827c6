//! What a camera adds to pictures, by names, so that each can be left out.

use std::fmt;
use std::str::FromStr;

use crate::camera::CameraEffects;

/// Something that lenses, sensors, weather and files add to a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Effect {
    /// Pictures lighter or darker than the meter says.
    Exposure,
    /// A shift of the colours that is left after white balance.
    WhiteBalance,
    /// How light becomes a picture: contrast, how highlights end, saturation.
    Tone,
    /// Noise of the sensor.
    Noise,
    /// Blur of what moves while the shutter is open.
    MotionBlur,
    /// Softness, sharpening, dark corners, coloured edges.
    Lens,
    /// Glare and ghosts of the sun.
    Flare,
    /// Drops on the lens, where it rains.
    Drops,
    /// Streaks of falling rain, where it rains.
    Rain,
    /// Haze and fog, which grow with the distance.
    Fog,
    /// What is lost in a JPEG file.
    Jpeg,
}

impl Effect {
    /// All of them, in the order of the light.
    pub const ALL: [Self; 11] = [
        Self::Fog,
        Self::Rain,
        Self::MotionBlur,
        Self::Lens,
        Self::Flare,
        Self::Drops,
        Self::Exposure,
        Self::WhiteBalance,
        Self::Noise,
        Self::Tone,
        Self::Jpeg,
    ];

    /// Its name in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exposure => "exposure",
            Self::WhiteBalance => "white-balance",
            Self::Tone => "tone",
            Self::Noise => "noise",
            Self::MotionBlur => "motion-blur",
            Self::Lens => "lens",
            Self::Flare => "flare",
            Self::Drops => "drops",
            Self::Rain => "rain",
            Self::Fog => "fog",
            Self::Jpeg => "jpeg",
        }
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A word that is no effect.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no effect; there are {names}", names = Effect::ALL.map(Effect::name).join(", "))]
pub struct UnknownEffect(pub String);

impl FromStr for Effect {
    type Err = UnknownEffect;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|effect| effect.name() == text);
        found.ok_or_else(|| UnknownEffect(text.to_owned()))
    }
}

/// A camera of which all but the effects named is clean.
pub(super) fn only(effects: &[Effect], camera: CameraEffects) -> CameraEffects {
    let mut kept = CameraEffects::default();
    for effect in effects {
        match effect {
            Effect::Exposure => kept.exposure = camera.exposure,
            Effect::WhiteBalance => {
                kept.white_balance = camera.white_balance;
                kept.warmth = camera.warmth;
                kept.tint = camera.tint;
            }
            Effect::Tone => {
                kept.shoulder = camera.shoulder;
                kept.contrast = camera.contrast;
                kept.black = camera.black;
                kept.saturation = camera.saturation;
            }
            Effect::Noise => kept.noise = camera.noise,
            Effect::MotionBlur => kept.motion_blur = camera.motion_blur,
            Effect::Lens => {
                kept.softness = camera.softness;
                kept.sharpening = camera.sharpening;
                kept.vignette = camera.vignette;
                kept.aberration = camera.aberration;
            }
            Effect::Flare => kept.flare = camera.flare,
            Effect::Drops => kept.drops = camera.drops,
            Effect::Rain => kept.rain = camera.rain,
            // Fog is in the air: the world is drawn without it.
            Effect::Fog => {}
            Effect::Jpeg => kept.jpeg = camera.jpeg,
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn every_effect_is_read_back_by_its_name() {
        for effect in Effect::ALL {
            assert_eq!(effect.name().parse(), Ok(effect));
        }
        assert!("glow".parse::<Effect>().unwrap_err().to_string().contains("motion-blur"));
    }

    #[test]
    fn all_effects_together_are_the_camera_and_none_is_a_clean_one() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let camera = CameraEffects::random(&mut rng, 0.6);
        assert_eq!(only(&Effect::ALL, camera), camera);
        assert_eq!(only(&[], camera), CameraEffects::default());
        let noisy = only(&[Effect::Noise], camera);
        assert_eq!(noisy, CameraEffects { noise: camera.noise, ..CameraEffects::default() });
    }
}
