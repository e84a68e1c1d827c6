//! The materials of a vehicle and their places in its list.

use std::sync::Arc;

use crate::scene::{Material, Texture};

use super::looks::{Lamps, Look, Riders};

/// Index of a material in the list that [`materials`] makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u16)]
pub(super) enum Slot {
    Paint,
    LowerTrim,
    Pillar,
    BlackPlastic,
    Underside,
    Grille,
    Frame,
    Handle,
    Emblem,
    Lining,
    Plate,
    Glass,
    RearGlass,
    Frit,
    Tyre,
    Rim,
    HeadLamp,
    HeadCore,
    Daytime,
    FrontIndicatorLeft,
    FrontIndicatorRight,
    TailLamp,
    BrakeLamp,
    HighBrakeLamp,
    RearIndicatorLeft,
    RearIndicatorRight,
    Reverse,
    MirrorGlass,
    Inside,
    Seat,
    Dashboard,
    DriverSkin,
    DriverHair,
    DriverClothes,
    BesideSkin,
    BesideHair,
    BesideClothes,
    BehindSkin,
    BehindHair,
    BehindClothes,
}

impl Slot {
    const ALL: [Self; 40] = [
        Self::Paint,
        Self::LowerTrim,
        Self::Pillar,
        Self::BlackPlastic,
        Self::Underside,
        Self::Grille,
        Self::Frame,
        Self::Handle,
        Self::Emblem,
        Self::Lining,
        Self::Plate,
        Self::Glass,
        Self::RearGlass,
        Self::Frit,
        Self::Tyre,
        Self::Rim,
        Self::HeadLamp,
        Self::HeadCore,
        Self::Daytime,
        Self::FrontIndicatorLeft,
        Self::FrontIndicatorRight,
        Self::TailLamp,
        Self::BrakeLamp,
        Self::HighBrakeLamp,
        Self::RearIndicatorLeft,
        Self::RearIndicatorRight,
        Self::Reverse,
        Self::MirrorGlass,
        Self::Inside,
        Self::Seat,
        Self::Dashboard,
        Self::DriverSkin,
        Self::DriverHair,
        Self::DriverClothes,
        Self::BesideSkin,
        Self::BesideHair,
        Self::BesideClothes,
        Self::BehindSkin,
        Self::BehindHair,
        Self::BehindClothes,
    ];
    /// Skin, hair and clothes of who drives, of who sits beside and behind.
    pub(super) const DRIVER: [Self; 3] = [Self::DriverSkin, Self::DriverHair, Self::DriverClothes];
    pub(super) const BESIDE: [Self; 3] = [Self::BesideSkin, Self::BesideHair, Self::BesideClothes];
    pub(super) const BEHIND: [Self; 3] = [Self::BehindSkin, Self::BehindHair, Self::BehindClothes];

    /// Whether it is somebody, who may not be there.
    pub(super) fn is_somebody(slot: u16) -> bool {
        slot >= Self::DriverSkin as u16
    }
}

/// Brightness of lamps; 1 is a white surface in full sun.
const HEAD: f32 = 6.0;
const BRAKE: f32 = 1.6;
const TAIL: f32 = 0.25;
const INDICATOR: f32 = 2.2;

/// The materials of a vehicle, in the order that its surface refers to.
pub fn materials(look: &Look, lamps: Lamps, riders: Riders) -> Arc<[Material]> {
    let people = look.people.iter().zip([riders.driver, riders.beside, riders.behind]);
    let people = people.flat_map(|(person, is_there)| {
        [person.skin, person.hair, person.clothes].map(|color| Material {
            dirt: 0.0,
            texture: if is_there { Texture::Plain } else { Texture::Nothing },
            ..plain(look, color, 0.8)
        })
    });
    let vehicle = Slot::ALL.iter().filter(|slot| !Slot::is_somebody(**slot as u16));
    vehicle.map(|slot| material(*slot, look, lamps)).chain(people).collect()
}

fn material(slot: Slot, look: &Look, lamps: Lamps) -> Material {
    let paint = paint(look);
    let chrome = Material { metallic: 1.0, ..plain(look, [0.55, 0.56, 0.57], 0.12) };
    let plastic = plain(look, [0.022, 0.022, 0.023], 0.55);
    let gloss = Material { clear_coat: 1.0, ..plain(look, [0.008; 3], 0.5) };
    let clean =
        |color: [f32; 3], roughness| Material { dirt: 0.0, ..plain(look, color, roughness) };
    match slot {
        Slot::LowerTrim if look.plastic_trim => plastic,
        Slot::Pillar if look.black_pillars => gloss,
        Slot::Frame | Slot::Handle if look.chrome => chrome,
        Slot::Emblem => chrome,
        Slot::Lining => Material {
            texture: Texture::Lining { leather: look.inside_color.map(|v| 1.2 * v + 0.05) },
            ..clean(look.inside_color.map(|v| 0.6 * v + 0.03), 0.7)
        },
        Slot::Paint | Slot::LowerTrim | Slot::Pillar | Slot::Handle => paint,
        Slot::BlackPlastic => plastic,
        Slot::Frame => gloss,
        Slot::Underside => plain(look, [0.015; 3], 0.9),
        Slot::Grille => {
            Material { texture: Texture::Grille { pitch: 0.034 }, ..plain(look, [0.035; 3], 0.5) }
        }
        Slot::Plate => {
            Material { texture: Texture::Plate { seed: look.plate }, ..plain(look, [0.75; 3], 0.5) }
        }
        Slot::Glass => glass(look, look.glass),
        Slot::RearGlass => glass(look, look.rear_glass),
        Slot::Frit => Material { clear_coat: 1.0, ..plain(look, [0.006; 3], 0.4) },
        Slot::Tyre => plain(look, [0.018, 0.018, 0.019], 0.85),
        Slot::Rim => Material {
            texture: Texture::Rim { spokes: look.spokes, cover: look.rim_cover },
            metallic: 0.7,
            clear_coat: 0.4,
            ..plain(look, look.rim_color, 0.35)
        },
        Slot::MirrorGlass => Material { metallic: 1.0, ..clean([0.6; 3], 0.03) },
        Slot::Inside => clean(look.inside_color, 0.8),
        Slot::Seat => clean(look.inside_color.map(|v| 0.8 * v), 0.8),
        Slot::Dashboard => clean([0.020, 0.020, 0.021], 0.7),
        lamp => lamp_material(lamp, look, lamps),
    }
}

fn paint(look: &Look) -> Material {
    Material {
        color: look.paint.color,
        texture: Texture::Plain,
        roughness: if look.paint.flakes > 0.0 { 0.38 } else { 0.6 },
        metallic: look.paint.flakes,
        clear_coat: 1.0,
        transmission: 0.0,
        emission: [0.0; 3],
        dirt: look.dirt,
    }
}

fn plain(look: &Look, color: [f32; 3], roughness: f32) -> Material {
    Material { color, roughness, metallic: 0.0, clear_coat: 0.0, ..paint(look) }
}

fn glass(look: &Look, transmission: f32) -> Material {
    Material {
        clear_coat: 1.0,
        transmission,
        dirt: 0.6 * look.dirt,
        ..plain(look, [0.86, 0.94, 0.90], 0.02)
    }
}

fn lamp_material(slot: Slot, look: &Look, lamps: Lamps) -> Material {
    let lit = |on: bool, color: [f32; 3], light: [f32; 3], level: f32| Material {
        clear_coat: 1.0,
        texture: Texture::Lamp { cell: 0.022 },
        emission: if on { light.map(|value| value * level) } else { [0.0; 3] },
        dirt: 0.5 * look.dirt,
        ..plain(look, color, 0.25)
    };
    let [red, amber, white] = [[1.0, 0.025, 0.015], [1.0, 0.33, 0.01], [1.0, 0.95, 0.86]];
    let amber_off = [0.36, 0.13, 0.025];
    match slot {
        Slot::HeadCore => Material { metallic: 0.9, ..lit(lamps.head, [0.6; 3], white, HEAD) },
        Slot::Daytime => lit(lamps.daytime || lamps.head, [0.3; 3], [0.95, 0.98, 1.0], 0.35 * HEAD),
        Slot::FrontIndicatorLeft | Slot::RearIndicatorLeft => {
            lit(lamps.left, amber_off, amber, INDICATOR)
        }
        Slot::FrontIndicatorRight | Slot::RearIndicatorRight => {
            lit(lamps.right, amber_off, amber, INDICATOR)
        }
        Slot::TailLamp => lit(lamps.head, [0.24, 0.010, 0.012], red, TAIL),
        Slot::BrakeLamp if lamps.brake => lit(true, [0.24, 0.010, 0.012], red, BRAKE),
        Slot::HighBrakeLamp => lit(lamps.brake, [0.10, 0.008, 0.009], red, BRAKE),
        Slot::BrakeLamp => lit(lamps.head, [0.30, 0.012, 0.013], red, TAIL),
        Slot::Reverse => lit(lamps.reverse, [0.34, 0.31, 0.31], white, INDICATOR),
        _ => Material {
            metallic: 0.5,
            clear_coat: 1.0,
            texture: Texture::Lamp { cell: 0.05 },
            dirt: 0.4 * look.dirt,
            ..plain(look, [0.085, 0.088, 0.092], 0.3)
        },
    }
}
