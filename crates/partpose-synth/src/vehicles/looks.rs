//! How a vehicle looks: chosen at random, like what is met in traffic.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// The finish of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// Linear RGB.
    pub color: [f32; 3],
    /// Share of metal flakes: 0 for plain paint.
    pub flakes: f32,
}

/// Everything about a vehicle that is the same from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Of the body.
    pub paint: Paint,
    /// Sills and lower edges of the bumpers are black plastic instead of paint.
    pub plastic_trim: bool,
    /// Pillars between the side windows are black instead of painted.
    pub black_pillars: bool,
    /// Handles and frames of the grille are chrome.
    pub chrome: bool,
    /// Share of light that front and front side windows let through.
    pub glass: f32,
    /// The same for the windows behind.
    pub rear_glass: f32,
    /// Spokes of the wheels.
    pub spokes: u8,
    /// Share of the wheels' face that is metal.
    pub rim_cover: f32,
    /// Colour of the rims, linear RGB.
    pub rim_color: [f32; 3],
    /// Colour of seats and linings, linear RGB.
    pub inside_color: [f32; 3],
    /// Dirt, 0 to 1.
    pub dirt: f32,
    /// Chooses the plate's characters.
    pub plate: u32,
    /// Who may sit in it: at the wheel, beside, behind.
    pub people: [Person; 3],
}

/// Colours of somebody, linear RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Person {
    /// Of face and hands.
    pub skin: [f32; 3],
    /// Of the hair.
    pub hair: [f32; 3],
    /// Of the clothes.
    pub clothes: [f32; 3],
}

/// Who sits in a vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Riders {
    /// Somebody at the wheel.
    pub driver: bool,
    /// Somebody beside.
    pub beside: bool,
    /// Somebody behind.
    pub behind: bool,
}

/// Which lamps are lit.
#[expect(clippy::struct_excessive_bools, reason = "lamps are on or off, each by itself")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lamps {
    /// Head lamps, and the tail lamps with them.
    pub head: bool,
    /// Thin running lights in front only.
    pub daytime: bool,
    /// Brake lamps.
    pub brake: bool,
    /// Left indicators, in their bright half period.
    pub left: bool,
    /// Right indicators.
    pub right: bool,
    /// Reversing lamps.
    pub reverse: bool,
}

/// Shares of colours among cars on the road, with linear RGB values and their spread.
///
/// The shares follow the yearly reports of coating makers for Europe, rounded: white, black, grey and silver make
/// three quarters, blue and red most of the rest.
const COLORS: [(f32, [f32; 3], [f32; 3]); 11] = [
    (0.26, [0.72, 0.73, 0.72], [0.06, 0.06, 0.06]),
    (0.20, [0.012, 0.012, 0.014], [0.008, 0.008, 0.008]),
    (0.19, [0.11, 0.115, 0.12], [0.07, 0.07, 0.07]),
    (0.11, [0.42, 0.43, 0.44], [0.10, 0.10, 0.10]),
    (0.10, [0.020, 0.055, 0.17], [0.015, 0.035, 0.10]),
    (0.07, [0.34, 0.020, 0.022], [0.15, 0.012, 0.012]),
    (0.02, [0.025, 0.090, 0.045], [0.02, 0.05, 0.03]),
    (0.02, [0.20, 0.14, 0.085], [0.10, 0.06, 0.04]),
    (0.01, [0.55, 0.36, 0.03], [0.10, 0.08, 0.02]),
    (0.01, [0.50, 0.13, 0.02], [0.10, 0.05, 0.01]),
    (0.01, [0.16, 0.36, 0.52], [0.08, 0.10, 0.10]),
];

/// A look at random.
pub fn random_look(rng: &mut ChaCha8Rng) -> Look {
    let paint = random_paint(rng);
    let grey = rng.random_range(0.02_f32..0.09);
    let is_beige = rng.random_bool(0.15);
    let alloy = rng.random_range(0.25_f32..0.62);
    let rim_color = if rng.random_bool(0.18) { [0.03; 3] } else { [alloy, alloy, alloy * 1.01] };
    let glass = rng.random_range(0.62_f32..0.80);
    let privacy = rng.random_bool(0.3);
    Look {
        paint,
        plastic_trim: rng.random_bool(0.45),
        black_pillars: rng.random_bool(0.75),
        chrome: rng.random_bool(0.35),
        glass,
        rear_glass: if privacy { rng.random_range(0.10..0.25) } else { glass },
        spokes: [5, 5, 6, 7, 10, 12][rng.random_range(0..6)],
        rim_cover: rng.random_range(0.40..0.68),
        rim_color,
        inside_color: if is_beige {
            [grey * 3.2, grey * 2.7, grey * 2.0]
        } else {
            [grey, grey, grey * 1.04]
        },
        dirt: if rng.random_bool(0.6) {
            rng.random_range(0.02_f32..0.25)
        } else {
            rng.random_range(0.2..0.8)
        },
        plate: rng.random(),
        people: [(); 3].map(|()| random_person(rng)),
    }
}

fn random_person(rng: &mut ChaCha8Rng) -> Person {
    let light = rng.random_range(0.12_f32..1.0).sqrt();
    let shade = rng.random_range(0.0_f32..1.0);
    let hair =
        [[0.012, 0.010, 0.009], [0.05, 0.028, 0.015], [0.22, 0.14, 0.06], [0.30, 0.29, 0.28]];
    let clothes = [
        [0.015, 0.016, 0.020],
        [0.55, 0.55, 0.53],
        [0.03, 0.05, 0.13],
        [0.12, 0.12, 0.125],
        [0.30, 0.04, 0.04],
        [0.20, 0.30, 0.45],
        [0.05, 0.11, 0.07],
    ];
    Person {
        skin: [0.52 * light, 0.30 * light * light, 0.20 * light * light],
        hair: hair[rng.random_range(0..hair.len())],
        clothes: clothes[rng.random_range(0..clothes.len())].map(|v| v * (0.7 + 0.6 * shade)),
    }
}

fn random_paint(rng: &mut ChaCha8Rng) -> Paint {
    let total: f32 = COLORS.iter().map(|(share, ..)| share).sum();
    let mut at = rng.random_range(0.0..total);
    let mut chosen = &COLORS[0];
    for color in &COLORS {
        chosen = color;
        at -= color.0;
        if at < 0.0 {
            break;
        }
    }
    let (_, middle, spread) = *chosen;
    // One number for the shade, as paints differ in lightness more than in hue; a little of its own for each channel.
    let shade = rng.random_range(-1.0_f32..1.0);
    let mut color = [0.0; 3];
    for (value, (middle, spread)) in color.iter_mut().zip(middle.into_iter().zip(spread)) {
        let own = rng.random_range(-0.15_f32..0.15);
        *value = (middle + spread * (shade + own)).clamp(0.004, 0.85);
    }
    let is_light = middle[0] > 0.6;
    let flakes = if is_light || rng.random_bool(0.3) { 0.0 } else { rng.random_range(0.25..0.7) };
    Paint { color, flakes }
}
