//! Light of sun and sky.
//!
//! Clear: A. Preetham, P. Shirley and B. Smits: *A Practical Analytic Model for Daylight*, SIGGRAPH 1999; the sun's
//! colour from the same paper's extinction by molecules, aerosol and ozone. Overcast: the CIE's overcast sky (Moon and
//! Spencer 1942), with the illuminance that Krochmann and Seidl give for the height of the sun. Clouds are noise on a
//! plane, of four kinds from veils of ice to broken cover; what is thicker towards the sun shades what lies behind it.
//! Unit: 1 is the radiance of a white surface that a sun of 100 klx shines on at right angles.

use nalgebra::Vector3;

use crate::scene::Light;

use super::noise;

type V = Vector3<f32>;

/// Illuminance of a surface at right angles to the sun outside the atmosphere, in units of 100 klx.
const SUN: f32 = 1.28;
/// From kcd/m² to our unit: pi / 100.
const FROM_KILOCANDELA: f32 = 0.031_415_926;

/// A sky, ready to be asked.
#[derive(Clone, Debug)]
pub(crate) struct Sky {
    /// Towards the sun; y down.
    pub(crate) to_sun: V,
    /// Radiance that the sun alone gives a white surface at right angles to it.
    pub(crate) sun: V,
    overcast: f32,
    /// Zenith of the overcast sky.
    grey: f32,
    zenith: V,
    /// Perez' coefficients for Y, x, y.
    perez: [[f32; 5]; 3],
    /// Perez' function at the zenith.
    at_zenith: [f32; 3],
    seed: u32,
    clouds: Clouds,
}

/// What clouds look like.
#[derive(Clone, Copy, Debug)]
struct Clouds {
    /// Blotches a unit of the plane along x and z.
    scale: [f32; 2],
    /// How far a slow noise bends them.
    bend: f32,
    /// Noise above which there is a cloud, and how fast it becomes dense.
    low: f32,
    edge: f32,
    /// How much thickness towards the sun shades.
    relief: f32,
    opacity: f32,
}

/// Veils in streaks, fair-weather heaps, large heaps, broken cover.
const CLOUDS: [Clouds; 4] = [
    Clouds { scale: [0.35, 1.6], bend: 1.5, low: 0.46, edge: 2.6, relief: 0.5, opacity: 0.6 },
    Clouds { scale: [1.5, 1.5], bend: 0.8, low: 0.57, edge: 7.0, relief: 3.0, opacity: 0.95 },
    Clouds { scale: [0.8, 0.8], bend: 1.0, low: 0.54, edge: 7.0, relief: 3.0, opacity: 0.97 },
    Clouds { scale: [1.1, 1.4], bend: 1.2, low: 0.43, edge: 4.0, relief: 2.2, opacity: 0.95 },
];

impl Sky {
    pub(crate) fn new(light: &Light) -> Self {
        let to_sun = light.to_sun.cast::<f32>().try_normalize(1e-6).unwrap_or_else(|| -V::y());
        let t = (light.turbidity as f32).clamp(1.8, 10.0);
        let overcast = (light.overcast as f32).clamp(0.0, 1.0);
        // Below two degrees the model leaves its range.
        let height = (-to_sun.y).clamp(0.035, 1.0);
        let theta = height.acos();
        let perez = [
            [
                0.1787 * t - 1.4630,
                -0.3554 * t + 0.4275,
                -0.0227 * t + 5.3251,
                0.1206 * t - 2.5771,
                -0.0670 * t + 0.3703,
            ],
            [
                -0.0193 * t - 0.2592,
                -0.0665 * t + 0.0008,
                -0.0004 * t + 0.2125,
                -0.0641 * t - 0.8989,
                -0.0033 * t + 0.0452,
            ],
            [
                -0.0167 * t - 0.2608,
                -0.0950 * t + 0.0092,
                -0.0079 * t + 0.2102,
                -0.0441 * t - 1.6537,
                -0.0109 * t + 0.0529,
            ],
        ];
        let chi = (4.0 / 9.0 - t / 120.0) * (std::f32::consts::PI - 2.0 * theta);
        let luminance = ((4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192).max(0.05);
        let cubic = |c: [f32; 4]| ((c[0] * theta + c[1]) * theta + c[2]) * theta + c[3];
        let chroma = |a, b, c| (cubic(a) * t + cubic(b)) * t + cubic(c);
        let zenith = V::new(
            luminance * FROM_KILOCANDELA,
            chroma(
                [0.00166, -0.00375, 0.00209, 0.0],
                [-0.02903, 0.06377, -0.03202, 0.00394],
                [0.11693, -0.21196, 0.06052, 0.25886],
            ),
            chroma(
                [0.00275, -0.00610, 0.00317, 0.0],
                [-0.04214, 0.08970, -0.04153, 0.00516],
                [0.15346, -0.26756, 0.06670, 0.26688],
            ),
        );
        let above = ((-to_sun.y + 0.01) / 0.03).clamp(0.0, 1.0);
        let shown = (1.0 - overcast * 1.15).clamp(0.0, 1.0);
        let sun = transmittance(theta, t) * (SUN * above * shown * shown);
        // 0.3 klx + 21 klx times the height of the sun; the zenith is 9/7 of the mean.
        let illuminance = 0.3 + 21.0 * height;
        let grey = 9.0 / 7.0 * illuminance / std::f32::consts::PI * FROM_KILOCANDELA;
        let seed =
            noise::mix(light.to_sun.x.to_bits() as u32 ^ (light.turbidity.to_bits() >> 20) as u32);
        let at_zenith = perez.map(|coefficients| distribution(coefficients, 1.0, theta, height));
        let clouds = CLOUDS[(noise::mix(seed) >> 8) as usize % CLOUDS.len()];
        Self { to_sun, sun, overcast, grey, zenith, perez, at_zenith, seed, clouds }
    }

    /// Radiance from a direction (y down), without the sun's disc; what lies below the horizon is as the horizon.
    pub(crate) fn radiance(&self, direction: &V) -> V {
        let up = (-direction.y).max(0.0);
        let grey = self.grey * (1.0 + 2.0 * up) / 3.0;
        let overcast = V::new(0.93, 0.98, 1.06) * grey;
        if self.overcast >= 1.0 {
            return overcast;
        }
        let clear = self.clear(direction, up);
        clear.lerp(&overcast, self.overcast)
    }

    fn clear(&self, direction: &V, up: f32) -> V {
        let cos_theta = up.max(0.01);
        let cos_gamma = direction.dot(&self.to_sun).clamp(-1.0, 1.0);
        let gamma = cos_gamma.acos();
        let mut value = V::zeros();
        for i in 0..3 {
            let share = distribution(self.perez[i], cos_theta, gamma, cos_gamma);
            value[i] = self.zenith[i] * share / self.at_zenith[i];
        }
        let color = to_rgb(value[0], value[1], value[2]);
        // The model's horizon is too pink: haze there scatters all colours alike.
        let grey = 0.30 * color.x + 0.59 * color.y + 0.11 * color.z;
        let haze = 0.75 * (-7.0 * up).exp();
        color.lerp(&(V::new(0.96, 1.0, 1.05) * grey), haze)
    }

    /// [`Self::radiance`] with clouds.
    pub(crate) fn radiance_with_clouds(&self, direction: &V) -> V {
        let sky = self.radiance(direction);
        let up = -direction.y;
        if up < 0.015 {
            return sky;
        }
        // On a plane, 1 unit high.
        let [x, z] = [direction.x / (up + 0.08), direction.z / (up + 0.08)];
        let footprint = 0.004 / (up * up + 0.002);
        let clouds = &self.clouds;
        let density = |x: f32, z: f32, octaves: u32| {
            let [along, across] = clouds.scale;
            let bend =
                clouds.bend * (noise::fractal(0.7 * x, 0.7 * z, 2, 0.0, self.seed ^ 1) - 0.5);
            let [x, z] = [along * x + bend, across * z + bend];
            noise::fractal(x, z, octaves, footprint * across, self.seed)
        };
        let value = density(x, z, 7);
        let low = clouds.low - 0.12 * self.overcast;
        let share = ((value - low) * clouds.edge).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share) * (up * 12.0).min(1.0);
        if share <= 0.0 {
            return sky;
        }
        let thick = ((value - low) * 2.2).clamp(0.0, 1.0);
        // Sides towards the sun are bright, those away from it in the shade of the rest.
        let to_sun = self.to_sun * (0.16 / self.to_sun.xz().norm().max(0.2));
        let before = density(x + to_sun.x, z + to_sun.z, 4);
        let shaded = (0.5 + clouds.relief * (before - value)).clamp(0.0, 1.0);
        let lit = self.sun * (0.62 - 0.34 * shaded - 0.14 * thick);
        let shade = 0.5 * (1.0 - self.overcast) + (1.12 - 0.45 * thick) * self.overcast;
        sky.lerp(&(lit + sky * shade), clouds.opacity * share)
    }

    /// The sun's disc with its glow, in a direction.
    pub(crate) fn disc(&self, direction: &V) -> V {
        let cos = direction.dot(&self.to_sun);
        if cos < 0.995 {
            return V::zeros();
        }
        let angle = cos.min(1.0).acos();
        let disc = ((0.0055 - angle) / 0.001).clamp(0.0, 1.0) * 400.0;
        let glow = 2.0 * (-(angle / 0.02).powi(2)).exp();
        self.sun * (disc + glow)
    }
}

/// Perez' function of the angle to the zenith and to the sun.
fn distribution([a, b, c, d, e]: [f32; 5], cos_theta: f32, gamma: f32, cos_gamma: f32) -> f32 {
    (1.0 + a * (b / cos_theta).exp()) * (1.0 + c * (d * gamma).exp() + e * cos_gamma * cos_gamma)
}

/// Share of the sun's light that reaches the ground, red, green and blue.
fn transmittance(theta: f32, turbidity: f32) -> V {
    let degrees = theta.to_degrees();
    let mass = 1.0 / (theta.cos() + 0.15 * (93.885 - degrees).max(0.5).powf(-1.253));
    let beta = 0.046_08 * turbidity - 0.045_86;
    let share = |wavelength: f32, ozone: f32| {
        let rayleigh = 0.008_735 * wavelength.powf(-4.08);
        let aerosol = beta * wavelength.powf(-1.3);
        (-mass * (rayleigh + aerosol + 0.35 * ozone)).exp()
    };
    V::new(share(0.615, 0.10), share(0.535, 0.07), share(0.455, 0.005))
}

/// From CIE xyY to linear RGB of sRGB's primaries.
fn to_rgb(luminance: f32, x: f32, y: f32) -> V {
    let y = y.max(1e-3);
    let [big_x, big_z] = [luminance * x / y, luminance * (1.0 - x - y) / y];
    V::new(
        3.2406 * big_x - 1.5372 * luminance - 0.4986 * big_z,
        -0.9689 * big_x + 1.8758 * luminance + 0.0415 * big_z,
        0.0557 * big_x - 0.2040 * luminance + 1.0570 * big_z,
    )
    .sup(&V::zeros())
}
