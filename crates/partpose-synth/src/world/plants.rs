//! Trees, bushes and hedges: trunks with branches, and leaves on cards that let light through.

use std::f32::consts::TAU;
use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::random::random;
use super::shapes::{P, Shape, V, p};
use super::stuff::{Prop, noisy, textured};
use crate::scene::{Material, SegmentClass, SurfaceMesh, Texture};

/// Slot of the leaves among a plant's materials.
const LEAVES: u16 = 1;

/// Kinds of trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Species {
    /// Round crown on a bare trunk, as along streets.
    Street,
    /// Tall and slender, leaves begin high.
    Forest,
    /// A conifer.
    Fir,
}

/// A tree of about 8 m (street), 16 m (forest) or 14 m (fir).
pub(crate) fn tree(seed: u64, species: Species) -> Prop {
    let mut rng = random(seed, &[0x7ee, species as i64]);
    let mut shape = Shape::default();
    let (bark, leaves) = match species {
        Species::Street => (3.0..3.6, [0.050, 0.082, 0.024]),
        Species::Forest => (7.0..10.0, [0.040, 0.070, 0.020]),
        Species::Fir => (13.0..14.0, [0.017, 0.036, 0.016]),
    };
    let height: f32 = rng.random_range(bark);
    let lean = V::new(rng.random_range(-0.03..0.03), -1.0, rng.random_range(-0.03..0.03));
    let top = p(0.0, 0.0, 0.0) + lean * height;
    let radius = match species {
        Species::Street => 0.16,
        Species::Forest => 0.22,
        Species::Fir => 0.18,
    };
    shape.tube([p(0.0, 0.3, 0.0), top], [radius, radius * 0.55], 8, 0);
    match species {
        Species::Fir => fir_crown(&mut shape, &mut rng, height),
        Species::Street => leafy_crown(&mut shape, &mut rng, top, [2.6, 2.4], [22, 24]),
        Species::Forest => leafy_crown(&mut shape, &mut rng, top, [2.9, 3.6], [22, 22]),
    }
    let tint = rng.random_range(0.8_f32..1.25);
    let warm = rng.random_range(0.9_f32..1.35);
    let leaf = [leaves[0] * tint * warm, leaves[1] * tint, leaves[2] * tint];
    let every = if species == Species::Fir { [2, 6] } else { [3, 9] };
    Prop {
        mesh: with_fewer_leaves(shape, every),
        materials: [
            noisy([0.10, 0.075, 0.055], [0.045, 0.036, 0.028], 0.25),
            foliage(leaf, if species == Species::Fir { 0.5 } else { 0.55 }, 0.10),
        ]
        .into(),
        class: SegmentClass::Tree,
    }
}

/// Leaves of a colour; light comes through between them.
fn foliage(color: [f32; 3], cover: f32, size: f32) -> Material {
    let leaves = textured(color, Texture::Leaves { cover, size });
    Material { roughness: 0.95, ..leaves }
}

/// Branches, and clusters of cards at their ends, within an ellipsoid around a point above `top`.
fn leafy_crown(
    shape: &mut Shape,
    rng: &mut ChaCha8Rng,
    top: P,
    [wide, tall]: [f32; 2],
    [clusters, cards]: [u32; 2],
) {
    let middle = top - V::y() * (tall * 0.55);
    for i in 0..clusters {
        let direction = direction(rng);
        let far = rng.random_range(0.55_f32..1.0);
        let at = middle + V::new(direction.x * wide, direction.y * tall, direction.z * wide) * far;
        if i % 2 == 0 {
            let from = top + V::y() * rng.random_range(0.0_f32..0.9);
            shape.tube([from, at], [0.06, 0.02], 4, 0);
        }
        let radius = rng.random_range(0.8_f32..1.25) * wide / 2.6;
        for _ in 0..cards {
            let out = self::direction(rng);
            let center = at + out * (radius * rng.random_range(0.35_f32..1.0));
            let half = rng.random_range(0.4_f32..0.7);
            // Lit as the crown is, with its own cluster a little.
            let from_middle = center - middle;
            let lit = from_middle.try_normalize(1e-3).unwrap_or(out) + out * 0.5;
            // The deeper inside, and the lower, the darker.
            let depth = V::new(from_middle.x / wide, from_middle.y / tall, from_middle.z / wide);
            let open = 0.12 + 0.62 * depth.norm_squared() - 0.22 * depth.y;
            card(shape, rng, center, (lit, open.clamp(0.1, 1.0)), half);
        }
    }
}

/// Tiers of cards that hang outwards, narrower towards the top.
fn fir_crown(shape: &mut Shape, rng: &mut ChaCha8Rng, height: f32) {
    let tiers = 15;
    for tier in 0..tiers {
        let share = tier as f32 / tiers as f32;
        let y = -(0.13 + 0.87 * share) * height;
        let reach = 2.7 * (1.0 - share) + 0.25;
        let count = 5 + (9.0 * (1.0 - share)) as u32;
        let turn = rng.random_range(0.0_f32..1.0);
        for i in 0..count {
            let (s, c) = (TAU * (i as f32 + turn) / count as f32).sin_cos();
            let out = V::new(c, 0.0, s);
            let side = V::new(-s, 0.0, c);
            let drop = rng.random_range(0.25_f32..0.55) * reach;
            let far = reach * rng.random_range(0.85_f32..1.1);
            let (near, tip) = (p(0.0, y, 0.0), p(0.0, y + drop, 0.0) + out * far);
            let half = 0.30 * far + 0.15;
            let corners = [
                near - side * (half * 0.4),
                near + side * (half * 0.4),
                tip + side * half,
                tip - side * half,
            ];
            shape.panel(corners, [i as f32, tier as f32 * 3.0], -V::y() + out * 0.3, 1);
        }
    }
}

/// The mesh with its far forms, which keep every so manieth card of leaves.
fn with_fewer_leaves(shape: Shape, [far, farther]: [usize; 2]) -> Arc<SurfaceMesh> {
    let mut mesh = Arc::unwrap_or_clone(shape.finish());
    let mut coarse = fewer_leaves(&mesh, far);
    coarse.coarse = Some(Arc::new(fewer_leaves(&mesh, farther)));
    mesh.coarse = Some(Arc::new(coarse));
    Arc::new(mesh)
}

/// One of `every` cards, grown so that nearly the same area is left, and of the wood what comes before the first card.
fn fewer_leaves(mesh: &SurfaceMesh, every: usize) -> SurfaceMesh {
    const LEFT: f32 = 0.75;
    let growth = (LEFT * every as f32).sqrt();
    let mut fewer = SurfaceMesh::default();
    let copy = |fewer: &mut SurfaceMesh, face: &[u32; 3], place: &dyn Fn(V) -> V| {
        let start = fewer.vertices.len() as u32;
        for vertex in face.map(|i| i as usize) {
            fewer.vertices.push(place(mesh.vertices[vertex].coords).into());
            fewer.normals.push(mesh.normals[vertex]);
            fewer.coordinates.push(mesh.coordinates[vertex]);
            fewer.openness.push(mesh.openness[vertex]);
        }
        fewer.faces.push([start, start + 1, start + 2]);
        fewer.parts.push(0);
    };
    let wood = mesh.materials.iter().position(|slot| *slot == LEAVES).unwrap_or(mesh.faces.len());
    for face in &mesh.faces[..wood] {
        copy(&mut fewer, face, &|p| p);
        fewer.materials.push(0);
    }
    let leaves = mesh.faces.iter().zip(&mesh.materials).filter(|(_, slot)| **slot == LEAVES);
    let leaves: Vec<&[u32; 3]> = leaves.map(|(face, _)| face).collect();
    // A card is two faces that share their first corner and the one opposite of it.
    for card in leaves.chunks_exact(2).step_by(every) {
        let corner = |i: u32| mesh.vertices[i as usize].coords;
        let across = card[0].iter().filter(|i| card[1].contains(i)).map(|i| corner(*i));
        let middle = across.sum::<V>() * 0.5;
        for face in card {
            copy(&mut fewer, face, &|p| middle + (p - middle) * growth);
            fewer.materials.push(LEAVES);
        }
    }
    fewer
}

/// A bush about 1.5 m wide and 1.2 m high.
pub(crate) fn bush(seed: u64) -> Prop {
    let mut rng = random(seed, &[0xb05]);
    let mut shape = Shape::default();
    for _ in 0..170 {
        let out = direction(&mut rng);
        let up = -out.y.abs();
        let far = rng.random_range(0.5_f32..1.0);
        let at = p(out.x * 0.75 * far, up * 1.05 * far - 0.05, out.z * 0.75 * far);
        let size = rng.random_range(0.2_f32..0.36);
        let open = (0.05 + 0.55 * far * far + 0.35 * -up).clamp(0.1, 1.0);
        card(&mut shape, &mut rng, at, (out, open), size);
    }
    let tint = rng.random_range(0.75_f32..1.2);
    let leaf = [0.05 * tint, 0.10 * tint, 0.022 * tint];
    let material = foliage(leaf, 0.6, 0.05);
    let materials = [material, material].into();
    Prop { mesh: with_fewer_leaves(shape, [3, 9]), materials, class: SegmentClass::Vegetation }
}

/// A piece of hedge, 4 m long along z, 1.5 m high.
pub(crate) fn hedge(seed: u64) -> Prop {
    let mut rng = random(seed, &[0x6ed6]);
    let mut shape = Shape::default();
    shape.block(p(-0.32, -1.35, -2.0), p(0.32, 0.1, 2.0), 0);
    for _ in 0..260 {
        let z = rng.random_range(-2.0_f32..2.0);
        let face = rng.random_range(0..4);
        let (at, out) = match face {
            0 => (p(-0.34, -rng.random_range(0.05_f32..1.4), z), -V::x()),
            1 => (p(0.34, -rng.random_range(0.05_f32..1.4), z), V::x()),
            _ => (p(rng.random_range(-0.35_f32..0.35), -1.38, z), -V::y()),
        };
        let tilted = out + direction(&mut rng) * 0.6;
        let size = rng.random_range(0.2_f32..0.36);
        let open = 0.45 + 0.3 * (-at.y / 1.4);
        card(&mut shape, &mut rng, at, (tilted, open), size);
    }
    let tint = rng.random_range(0.7_f32..1.15);
    let leaf = [0.035 * tint, 0.075 * tint, 0.018 * tint];
    let inside = noisy([leaf[0] * 0.5, leaf[1] * 0.5, leaf[2] * 0.5], [0.008, 0.014, 0.006], 0.2);
    Prop {
        mesh: with_fewer_leaves(shape, [3, 9]),
        materials: [inside, foliage(leaf, 0.6, 0.045)].into(),
        class: SegmentClass::Vegetation,
    }
}

/// A tuft of high grass.
pub(crate) fn tuft(seed: u64) -> Prop {
    let mut rng = random(seed, &[0x74f7]);
    let mut shape = Shape::default();
    for _ in 0..22 {
        let (s, c) = rng.random_range(0.0..TAU).sin_cos();
        let at = p(rng.random_range(-0.4_f32..0.4), 0.0, rng.random_range(-0.4_f32..0.4));
        let side = V::new(c, 0.0, s) * rng.random_range(0.10_f32..0.25);
        let up = V::new(rng.random_range(-0.1_f32..0.1), -rng.random_range(0.2_f32..0.5), 0.0);
        shape.panel(
            [at - side, at + side, at + side + up, at - side + up],
            [0.0, 0.0],
            V::new(-s, -0.2, c),
            1,
        );
    }
    let dry = rng.random_range(0.0_f32..1.0);
    let blade = [0.06 + 0.10 * dry, 0.11 + 0.05 * dry, 0.025 + 0.02 * dry];
    let material = foliage(blade, 0.45, 0.05);
    Prop {
        mesh: with_fewer_leaves(shape, [3, 8]),
        materials: [material, material].into(),
        class: SegmentClass::Vegetation,
    }
}

/// A square of leaves around a point, facing about `out`, to which a share of the sky is open.
fn card(shape: &mut Shape, rng: &mut ChaCha8Rng, center: P, (out, open): (V, f32), half: f32) {
    let normal = (out + direction(rng) * 0.8).try_normalize(1e-6).unwrap_or(out);
    let u = normal.cross(&direction(rng)).try_normalize(1e-6).unwrap_or_else(V::x);
    let v = normal.cross(&u);
    // Their own place in the pattern, so that no two cards are alike.
    let start = [rng.random_range(0.0_f32..50.0), rng.random_range(0.0_f32..50.0)];
    let corners = [
        center - (u + v) * half,
        center + (u - v) * half,
        center + (u + v) * half,
        center - (u - v) * half,
    ];
    shape.leaf_card(corners, start, (out, open), LEAVES);
}

/// A unit vector, every direction as likely.
fn direction(rng: &mut ChaCha8Rng) -> V {
    let y = rng.random_range(-1.0_f32..1.0);
    let (s, c) = rng.random_range(0.0..TAU).sin_cos();
    let r = (1.0 - y * y).sqrt();
    V::new(r * c, y, r * s)
}
