//! What light a surface sends to the eye.
//!
//! Matt light by Lambert; rough reflections by the microfacets of B. Walter et al.: *Microfacet Models for Refraction
//! through Rough Surfaces* (EGSR 2007, "GGX"); Fresnel's factor by C. Schlick: *An Inexpensive BRDF Model for
//! Physically-Based Rendering* (1994); reflections of the surroundings by the split sum of B. Karis (2013) in Lazarov's
//! closed form. A clear coat is a second, smooth layer over it. All directions are in axes of the world, places relative
//! to the camera.

use nalgebra::{Matrix3, Vector3};

use crate::scene::{Air, Material, SegmentClass, Texture};

use super::contact::{self, Blocks};
use super::environment::Environment;
use super::noise;
use super::shadow::Shadows;
use super::sky::Sky;
use super::texture::{self, Local};
use super::visible::{Seen, material_of};

type V = Vector3<f32>;

/// Half the width of a gap between panels and of a window's seal, metres.
const GAP: f32 = 0.0028;
const SEAL: f32 = 0.011;
/// Colour of dust.
const DUST: [f32; 3] = [0.16, 0.135, 0.105];

/// What there is of light.
#[derive(Clone, Copy)]
pub(super) struct Lighting<'a> {
    pub(super) sky: &'a Sky,
    pub(super) environment: &'a Environment,
    pub(super) shadows: &'a Shadows,
    pub(super) blocks: &'a Blocks,
    pub(super) air: Air,
    pub(super) world_from_camera: Matrix3<f32>,
    /// Where the eye is, relative to the camera.
    pub(super) shift: V,
    /// Metres a pixel at a depth of one metre.
    pub(super) pixel: f32,
    /// Light of fog in front of the dark.
    pub(super) airlight: V,
}

/// A place on a surface.
pub(super) struct Spot<'a> {
    seen: &'a Seen<'a>,
    material: &'a Material,
    face: usize,
    /// On the viewing ray, camera coordinates; the weights that all else follows from stay inside of the face.
    on_ray: V,
    /// Relative to the camera, axes of the world.
    pub(super) place: V,
    pub(super) depth: f32,
    /// Unit direction to the eye.
    to_eye: V,
    normal: V,
    footprint: f32,
    coordinates: [f32; 2],
    open: f32,
    is_behind: bool,
    is_vehicle: bool,
}

/// Light towards the eye.
pub(super) struct Light {
    pub(super) color: V,
    /// How much of a place on the ground is a mirror of water; `None` for what is no ground.
    pub(super) water: Option<f32>,
}

/// What a pane of glass does.
pub(super) struct Pane {
    pub(super) reflected: V,
    /// Share that comes through one pane.
    pub(super) tint: V,
}

/// A face with what its places have in common, for neighbouring pixels that see the same.
pub(super) struct Facet<'a> {
    seen: &'a Seen<'a>,
    material: &'a Material,
    face: usize,
    /// First corner and the two edges from it, camera coordinates.
    corner: V,
    edges: [V; 2],
    /// Their products with which a ray gives the weights.
    weighing: [V; 3],
    /// Unit normal, axes of the world.
    flat: V,
    normals: Option<[V; 3]>,
    coordinates: [[f32; 2]; 3],
    open: [f32; 3],
    is_vehicle: bool,
}

impl<'a> Facet<'a> {
    pub(super) fn new(lighting: &Lighting, seen: &'a Seen<'a>, face: u32) -> Option<Self> {
        let mesh = seen.mesh;
        let corners = mesh.faces.get(face as usize)?;
        let [a, b, c] = corners.map(|i| seen.positions[i as usize]);
        let [ab, ac] = [b - a, c - a];
        let across = ab.cross(&ac);
        let flat = (lighting.world_from_camera * across).try_normalize(0.0);
        let normals = match corners.map(|i| mesh.normals.get(i as usize)) {
            [Some(a), Some(b), Some(c)] => Some([*a, *b, *c]),
            _ => None,
        };
        Some(Self {
            seen,
            material: material_of(seen, face),
            face: face as usize,
            corner: a,
            edges: [ab, ac],
            weighing: [across, ac.cross(&a), a.cross(&ab)],
            flat: flat.unwrap_or_else(|| -V::y()),
            normals,
            coordinates: corners
                .map(|i| mesh.coordinates.get(i as usize).copied().unwrap_or_default()),
            open: corners.map(|i| mesh.openness.get(i as usize).copied().unwrap_or(1.0)),
            is_vehicle: matches!(
                seen.object.class,
                SegmentClass::Car | SegmentClass::Van | SegmentClass::Truck
            ),
        })
    }

    /// Where a viewing ray (camera coordinates, z = 1) meets the plane of the face.
    pub(super) fn spot(&self, lighting: &Lighting, ray: &V) -> Option<Spot<'a>> {
        // Moeller and Trumbore, for a ray from the origin.
        let det = ray.dot(&self.weighing[0]);
        if det == 0.0 {
            return None;
        }
        let inverse = 1.0 / det;
        let wb = (ray.dot(&self.weighing[1]) * inverse).clamp(0.0, 1.0);
        let wc = (ray.dot(&self.weighing[2]) * inverse).clamp(0.0, 1.0 - wb);
        let weights = [1.0 - wb - wc, wb, wc];
        let place_in_camera = self.corner + self.edges[0] * wb + self.edges[1] * wc;
        let depth = place_in_camera.z.max(0.05);
        let from_eye = lighting.world_from_camera * place_in_camera;
        let to_eye = from_eye / -from_eye.norm().max(1e-6);
        let place = from_eye + lighting.shift;
        let flat = self.flat;
        let normal = self.normals.map_or(flat, |[a, b, c]| {
            let mixed = a * weights[0] + b * weights[1] + c * weights[2];
            (self.seen.world_from_normal * mixed).try_normalize(1e-12).unwrap_or(flat)
        });
        let facing_flat = flat.dot(&to_eye);
        let is_behind = facing_flat < 0.0;
        let mut normal = if is_behind { -normal } else { normal };
        // A smooth normal may look away where the face does not.
        let facing = normal.dot(&to_eye);
        if facing < 0.04 {
            normal = (normal + to_eye * (0.04 - facing)).normalize();
        }
        let mix = |values: [f32; 3]| {
            values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2]
        };
        let [a, b, c] = self.coordinates;
        Some(Spot {
            seen: self.seen,
            material: self.material,
            face: self.face,
            on_ray: ray * place_in_camera.z,
            place,
            depth,
            to_eye,
            normal,
            footprint: depth * lighting.pixel / facing_flat.abs().max(0.03).sqrt(),
            coordinates: [mix([a[0], b[0], c[0]]), mix([a[1], b[1], c[1]])],
            open: mix(self.open),
            is_behind,
            is_vehicle: self.is_vehicle,
        })
    }
}

impl<'a> Spot<'a> {
    /// Where a viewing ray (camera coordinates, z = 1) meets the plane of a face.
    pub(super) fn new(lighting: &Lighting, seen: &'a Seen<'a>, face: u32, ray: &V) -> Option<Self> {
        Facet::new(lighting, seen, face)?.spot(lighting, ray)
    }

    /// Share of the pixel that gaps between panels and seals cover.
    fn joints(&self) -> [f32; 2] {
        let lines = self.seen.mesh.joints.near(self.face);
        if lines.is_empty() {
            return [0.0; 2];
        }
        let at = |vertex: u32| self.seen.positions[vertex as usize];
        let mut squares = [f32::INFINITY; 2];
        for line in lines {
            let [from, to] = line.ends.map(at);
            let [along, away] = [to - from, self.on_ray - from];
            let share = (along.dot(&away) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
            let square = &mut squares[line.kind as usize];
            *square = square.min((away - along * share).norm_squared());
        }
        let pixel = 0.5 * self.footprint.max(1e-4);
        let mut covered = [0.0; 2];
        for ((covered, square), half) in covered.iter_mut().zip(squares).zip([GAP, SEAL]) {
            let distance = square.sqrt();
            let overlap = (distance + pixel).min(half) - (distance - pixel).max(-half);
            *covered = (overlap / (2.0 * pixel)).clamp(0.0, 1.0);
        }
        covered
    }

    /// Light towards the eye.
    pub(super) fn light(&self, lighting: &Lighting) -> Light {
        let is_ground =
            matches!(self.seen.object.class, SegmentClass::Road | SegmentClass::Terrain);
        if self.material.transmission > 0.0 {
            // A pane that nothing is drawn behind: the inside is dark.
            let pane = self.pane(lighting);
            let inside = lighting.environment.irradiance(&self.normal) * 0.045;
            let color = pane.reflected + pane.tint.component_mul(&inside);
            return Light { color, water: is_ground.then_some(0.0) };
        }
        let mut local = texture::local(self.material, self.coordinates, self.footprint);
        let mut open = self.open;
        if self.is_vehicle {
            if self.is_behind {
                // The lining of the shell.
                local = Local {
                    color: V::repeat(0.03),
                    roughness: 0.9,
                    metallic: 0.0,
                    clear_coat: 0.0,
                    emission: V::zeros(),
                };
                open = 0.45;
            } else {
                let [gap, seal] = self.joints();
                let shine = 1.0 - gap.max(seal);
                local.color *= 1.0 - 0.88 * gap;
                local.color = local.color.lerp(&V::repeat(0.012), seal);
                local.clear_coat *= shine;
                local.metallic *= shine;
            }
        }
        self.add_dirt(&mut local);
        let mut mirror = 0.0;
        if !self.is_vehicle && self.normal.y < -0.5 {
            open *= contact::openness(lighting.blocks, &self.place);
        }
        if is_ground && self.normal.y < -0.8 {
            mirror = self.wet(&mut local, lighting.air.wetness as f32);
        }
        let sun = lighting.sky.sun;
        let toward_sun = self.normal.dot(&lighting.sky.to_sun);
        let lit = if toward_sun > 0.0 && sun.x > 1e-4 {
            lighting.shadows.lit(&self.place, &self.normal, self.depth)
        } else {
            0.0
        };
        let sun = sun * lit;
        let cos_eye = self.normal.dot(&self.to_eye).clamp(0.02, 1.0);
        let matt = local.color * (1.0 - local.metallic);
        let mut ambient = lighting.environment.irradiance(&self.normal) * open;
        if self.is_vehicle && self.normal.y > -0.3 {
            // What looks down sees the road in the vehicle's own shade.
            let low = ((self.normal.y + 0.3) * 0.8).clamp(0.0, 1.0);
            ambient *= 1.0 - 0.45 * low;
        }
        let mut out = matt.component_mul(&(ambient + sun * toward_sun.max(0.0)));
        if matches!(self.material.texture, Texture::Leaves { .. }) {
            out += matt.component_mul(&self.through_leaf(lighting, toward_sun, &ambient));
        }
        let below = V::repeat(0.04).lerp(&local.color, local.metallic);
        let seen_open = open * (0.5 + 0.5 * open);
        if local.roughness < 0.75 || local.metallic > 0.0 {
            let (scale, offset) = split_sum(local.roughness, cos_eye);
            let share = below * scale + V::repeat(offset);
            let reflected = self.surroundings(lighting, local.roughness, lit);
            out += share.component_mul(&reflected) * seen_open;
            out += self.highlight(lighting, &sun, &below, local.roughness, toward_sun);
        }
        if local.clear_coat > 0.0 {
            let fresnel = local.clear_coat * (0.04 + 0.96 * (1.0 - cos_eye).powi(5));
            let reflected = self.surroundings(lighting, 0.04, lit);
            out = out * (1.0 - fresnel) + reflected * (fresnel * seen_open);
            out += self.highlight(lighting, &sun, &V::repeat(0.04), 0.09, toward_sun)
                * local.clear_coat;
        }
        if mirror > 0.0 {
            let fresnel = mirror * (0.02 + 0.98 * (1.0 - cos_eye).powi(5));
            let reflected = self.surroundings(lighting, 0.08, lit);
            out = out * (1.0 - fresnel) + reflected * (fresnel * seen_open);
        }
        Light { color: out + local.emission, water: is_ground.then_some(mirror) }
    }

    /// The light that comes through a leaf from behind.
    fn through_leaf(&self, lighting: &Lighting, toward_sun: f32, ambient: &V) -> V {
        let through = (-toward_sun).max(0.0) * 0.35;
        let mut light = ambient * 0.1;
        if through > 0.0 {
            let lit = lighting.shadows.lit(&self.place, &-self.normal, self.depth);
            light += lighting.sky.sun * (through * lit);
        }
        light
    }

    /// What a pane of glass adds and lets through.
    pub(super) fn pane(&self, lighting: &Lighting) -> Pane {
        let local = texture::local(self.material, self.coordinates, self.footprint);
        let cos_eye = self.normal.dot(&self.to_eye).clamp(0.02, 1.0);
        // Both faces of the pane reflect.
        let fresnel = (0.075 + 0.925 * (1.0 - cos_eye).powi(5)).min(1.0);
        let toward_sun = self.normal.dot(&lighting.sky.to_sun);
        let lit = if toward_sun > 0.0 && lighting.sky.sun.x > 1e-4 {
            lighting.shadows.lit(&self.place, &self.normal, self.depth)
        } else {
            0.0
        };
        let sun = lighting.sky.sun * lit;
        let open = self.open * (0.5 + 0.5 * self.open);
        let mut reflected = self.surroundings(lighting, 0.03, lit) * (fresnel * open);
        reflected += self.highlight(lighting, &sun, &V::repeat(0.06), 0.08, toward_sun);
        let [_, seal] = self.joints();
        let mut tint = local.color * (self.material.transmission * (1.0 - fresnel) * (1.0 - seal));
        reflected *= 1.0 - 0.9 * seal;
        // Dust on the glass scatters light.
        let dust = 0.10 * self.material.dirt;
        let light =
            lighting.environment.irradiance(&self.normal) * open + sun * toward_sun.max(0.0);
        reflected += V::from(DUST).component_mul(&light) * dust;
        tint *= 1.0 - dust;
        Pane { reflected, tint }
    }

    /// Fog between the place and the eye.
    pub(super) fn through_air(&self, lighting: &Lighting, color: V) -> V {
        let loss = lighting.air.fog.max(0.0) as f32 + 0.000_25;
        let share = (-loss * self.place.norm()).exp();
        color * share + lighting.airlight * (1.0 - share)
    }

    fn highlight(
        &self,
        lighting: &Lighting,
        sun: &V,
        below: &V,
        roughness: f32,
        cos_sun: f32,
    ) -> V {
        if cos_sun <= 0.0 || sun.x <= 1e-4 {
            return V::zeros();
        }
        let half = (lighting.sky.to_sun + self.to_eye).normalize();
        let alpha = (roughness * roughness).max(0.004);
        let a2 = alpha * alpha;
        let cos_half = self.normal.dot(&half).clamp(0.0, 1.0);
        let d = cos_half * cos_half * (a2 - 1.0) + 1.0;
        let spread = a2 / (std::f32::consts::PI * d * d);
        let cos_eye = self.normal.dot(&self.to_eye).max(0.02);
        let smith = |cos: f32| cos + (a2 + (1.0 - a2) * cos * cos).sqrt();
        let visible = 1.0 / (smith(cos_eye) * smith(cos_sun));
        let weight = (1.0 - half.dot(&self.to_eye).clamp(0.0, 1.0)).powi(5);
        let fresnel = below + (V::repeat(1.0) - below) * weight;
        // `sun` is irradiance over pi.
        let share = (std::f32::consts::PI * spread * visible * cos_sun).min(60.0);
        sun.component_mul(&fresnel) * share
    }

    /// What is seen in the mirror of the surface: surroundings, and the road with the vehicle's shade on it.
    fn surroundings(&self, lighting: &Lighting, roughness: f32, lit: f32) -> V {
        let mut direction = self.normal * (2.0 * self.normal.dot(&self.to_eye)) - self.to_eye;
        if !self.is_vehicle {
            return lighting.environment.reflected(&direction, roughness);
        }
        if direction.y <= 0.02 {
            return lighting.environment.reflected(&direction, roughness);
        }
        direction.y = direction.y.max(0.03);
        let far = lighting.environment.reflected(&direction, roughness);
        let drop = (self.seen.ground - self.place.y).max(0.02);
        let reach = drop / direction.y;
        let hit = self.place + direction * reach;
        let open = contact::openness(lighting.blocks, &hit);
        let sun_share = if lighting.sky.sun.x > 1e-4 {
            let lit_there = if reach < 12.0 {
                let depth = self.depth.max(0.1);
                lighting.shadows.lit(&hit, &-V::y(), depth)
            } else {
                lit.max(0.5)
            };
            0.35 * open + 0.65 * lit_there
        } else {
            open
        };
        far * sun_share
    }

    /// Dust gathers low and in blotches.
    fn add_dirt(&self, local: &mut Local) {
        let dirt = self.material.dirt;
        if dirt <= 0.0 {
            return;
        }
        let height = (self.seen.ground - self.place.y).max(0.0);
        let low = (1.0 - height / 0.75).clamp(0.0, 1.0);
        let [u, v] = self.coordinates;
        let blotch = noise::fractal(3.0 * u, 3.0 * v, 3, 3.0 * self.footprint, 41);
        let share = dirt * (0.10 + 0.95 * low * low) * (0.35 + 1.3 * blotch).clamp(0.0, 1.6);
        let share = share.clamp(0.0, 0.85);
        local.color = local.color.lerp(&V::from(DUST), share);
        local.clear_coat *= 1.0 - 0.8 * share;
        local.metallic *= 1.0 - share;
        local.roughness += (0.8 - local.roughness).max(0.0) * share;
    }

    /// Water darkens the ground and stands in hollows; returns how much of it mirrors.
    fn wet(&self, local: &mut Local, wetness: f32) -> f32 {
        if wetness <= 0.0 {
            return 0.0;
        }
        let [u, v] = self.coordinates;
        let hollow = noise::fractal(0.3 * u, 0.5 * v, 4, 0.4 * self.footprint, 51);
        let puddle = ((hollow - 0.62 + 0.22 * wetness) * 9.0).clamp(0.0, 1.0);
        local.color *= 1.0 - 0.55 * wetness;
        local.roughness = local.roughness * (1.0 - 0.6 * wetness) + 0.02;
        // Grass holds its water under the blades, soil and fields drink it.
        let is_paved = self.seen.object.class == SegmentClass::Road
            || matches!(self.material.texture, Texture::Slabs { .. });
        let share = if is_paved { 1.0 } else { 0.08 };
        (share * wetness * (0.25 + 0.75 * puddle)).clamp(0.0, 1.0)
    }
}

/// Scale and offset of the reflectance for light from all round (Karis 2014, after Lazarov).
fn split_sum(roughness: f32, cos: f32) -> (f32, f32) {
    let r = [
        -roughness + 1.0,
        -0.0275 * roughness + 0.0425,
        -0.572 * roughness + 1.04,
        0.022 * roughness - 0.04,
    ];
    let a = (r[0] * r[0]).min((-9.28 * cos).exp2()) * r[0] + r[1];
    (-1.04 * a + r[2], 1.04 * a + r[3])
}
