//! The ten variations of Virtual KITTI: five views and six kinds of weather and light.

use std::fmt;
use std::str::FromStr;

use nalgebra::{UnitQuaternion, Vector3};

use crate::scene::{Air, Light};

/// A variation of a world, by its name in Virtual KITTI.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Variation {
    /// As it is: a fine day.
    Clone,
    /// The camera turned by 15 degrees to the left.
    Left15,
    /// By 15 degrees to the right.
    Right15,
    /// By 30 degrees to the left.
    Left30,
    /// By 30 degrees to the right.
    Right30,
    /// Fog.
    Fog,
    /// A low sun in the morning.
    Morning,
    /// An even sky.
    Overcast,
    /// Rain on a wet road.
    Rain,
    /// The sun about to go down.
    Sunset,
}

impl Variation {
    /// All ten, sorted by name as a folder lists them.
    pub const ALL: [Self; 10] = [
        Self::Left15,
        Self::Right15,
        Self::Left30,
        Self::Right30,
        Self::Clone,
        Self::Fog,
        Self::Morning,
        Self::Overcast,
        Self::Rain,
        Self::Sunset,
    ];

    /// Its name in the folders of the data set.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clone => "clone",
            Self::Left15 => "15-deg-left",
            Self::Right15 => "15-deg-right",
            Self::Left30 => "30-deg-left",
            Self::Right30 => "30-deg-right",
            Self::Fog => "fog",
            Self::Morning => "morning",
            Self::Overcast => "overcast",
            Self::Rain => "rain",
            Self::Sunset => "sunset",
        }
    }

    /// What takes points of the clone's camera to this variation's: `R_y(+a)` for a turn to the left.
    pub fn turned_from_clone(self) -> UnitQuaternion<f64> {
        let degrees: f64 = match self {
            Self::Left15 => 15.0,
            Self::Right15 => -15.0,
            Self::Left30 => 30.0,
            Self::Right30 => -30.0,
            _ => 0.0,
        };
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians())
    }

    /// Sun and sky; `azimuth` is where the sun of the clone stands, radians from the z axis towards the x axis.
    /// `height` is its elevation, radians.
    pub(crate) fn light(self, azimuth: f64, height: f64) -> Light {
        let sun = |azimuth: f64, height: f64| {
            let (s, c) = azimuth.sin_cos();
            Vector3::new(s * height.cos(), -height.sin(), c * height.cos())
        };
        let (to_sun, turbidity, overcast) = match self {
            Self::Morning => (sun(azimuth + 1.9, 0.24), 3.5, 0.0),
            Self::Sunset => (sun(azimuth - 1.6, 0.10), 5.0, 0.0),
            Self::Overcast => (sun(azimuth, height), 6.0, 1.0),
            Self::Rain => (sun(azimuth, height), 8.0, 1.0),
            Self::Fog => (sun(azimuth, height), 8.0, 0.95),
            _ => (sun(azimuth, height), 2.8, 0.0),
        };
        Light { to_sun, turbidity, overcast }
    }

    /// Fog, rain, wetness.
    pub(crate) fn air(self) -> Air {
        match self {
            Self::Fog => Air { fog: 0.030, rain: 0.0, wetness: 0.15 },
            Self::Rain => Air { fog: 0.004, rain: 0.6, wetness: 0.85 },
            Self::Overcast | Self::Sunset => Air { fog: 0.0010, rain: 0.0, wetness: 0.0 },
            Self::Morning => Air { fog: 0.0015, rain: 0.0, wetness: 0.05 },
            _ => Air { fog: 0.0004, rain: 0.0, wetness: 0.0 },
        }
    }

    /// Whether drivers have their lights on.
    pub(crate) fn is_dim(self) -> bool {
        matches!(self, Self::Fog | Self::Rain | Self::Sunset | Self::Morning)
    }
}

impl fmt::Display for Variation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A word that is no variation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no variation; there are {names}", names = names())]
pub struct UnknownVariation(pub String);

fn names() -> String {
    Variation::ALL.map(Variation::name).join(", ")
}

impl FromStr for Variation {
    type Err = UnknownVariation;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|variation| variation.name() == text);
        found.ok_or_else(|| UnknownVariation(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_back_and_the_ten_are_sorted() {
        for variation in Variation::ALL {
            assert_eq!(variation.name().parse(), Ok(variation));
        }
        assert!(Variation::ALL.windows(2).all(|pair| pair[0].name() < pair[1].name()));
        assert!("dusk".parse::<Variation>().unwrap_err().to_string().contains("`dusk`"));
    }

    #[test]
    fn a_turn_to_the_left_moves_what_is_ahead_to_the_right() {
        let ahead = Variation::Left15.turned_from_clone() * Vector3::z();
        assert!(ahead.x > 0.25);
        assert!((Variation::Right30.turned_from_clone() * Vector3::z()).x < -0.49);
    }
}
