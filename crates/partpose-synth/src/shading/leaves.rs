//! Where the leaves of a card are, and how light each is.
//!
//! A table of overlapping pointed leaves is made once and repeats over the plane. Every texel knows the rank of the first
//! leaf that covers it, and ranks are spread evenly, so that the share that is there is exactly what a material asks for.
//! Leaves of the same rank as their neighbours' form clumps with gaps between them, as twigs do.

use std::sync::{LazyLock, OnceLock};

use super::noise::{cell_share, smooth, whole};

/// Texels along a side of the table; a power of two.
const SIDE: usize = 512;
/// Texels a unit, which is about the width of a leaf.
const TEXELS: f32 = 10.0;
/// Leaves in the table.
const LEAVES: usize = 9000;

/// A texel of the table.
#[derive(Clone, Copy, Debug, Default)]
struct Texel {
    /// Least cover at which a leaf is there, in 255ths.
    rank: u8,
    /// How light the leaf is, in 255ths.
    shade: u8,
}

static TABLE: LazyLock<Vec<Texel>> = LazyLock::new(table);

/// Where leaves are at one cover, a bit a texel: small enough to stay in a core's nearest cache.
#[derive(Debug)]
pub(super) struct Mask(Vec<u64>);

/// Masks by the rank below which leaves are there, each made when it is first asked for.
static MASKS: [OnceLock<Mask>; 257] = [const { OnceLock::new() }; 257];

impl Mask {
    /// The mask of a cover, the share that is there.
    pub(super) fn of(cover: f32) -> &'static Self {
        let below = (255.0 * cover).ceil().clamp(0.0, 256.0) as usize;
        MASKS[below].get_or_init(|| {
            let mut words = vec![0_u64; SIDE * SIDE / 64];
            for (i, texel) in TABLE.iter().enumerate() {
                words[i / 64] |= u64::from(usize::from(texel.rank) < below) << (i % 64);
            }
            Self(words)
        })
    }

    /// Whether a leaf is at a place, in texels.
    #[inline]
    pub(super) fn is_leaf(&self, [u, v]: [f32; 2]) -> bool {
        let [column, row] = [u, v].map(|x| whole(x).0 as usize % SIDE);
        let at = row * SIDE + column;
        self.0[at / 64] >> (at % 64) & 1 == 1
    }
}

/// Texels a metre for leaves of a size.
#[inline]
pub(super) fn texels(size: f32) -> f32 {
    TEXELS / size.max(1e-3)
}

/// How light the leaf at a place is: 0 to 1, a half in the mean.
pub(super) fn shade(u: f32, v: f32, size: f32) -> f32 {
    let scale = texels(size);
    let place = |x: f32| whole(x * scale).0 as usize % SIDE;
    f32::from(TABLE[place(v) * SIDE + place(u)].shade) * (1.0 / 255.0)
}

fn table() -> Vec<Texel> {
    let side = SIDE as f32;
    // Rank from 0 to about 2, and shade.
    let mut found = vec![(9.0_f32, 0.5_f32); SIDE * SIDE];
    for leaf in 0..LEAVES {
        let random = |what: i32| cell_share(leaf as i32, what, 0x1eaf);
        let [x, y] = [side * random(0), side * random(1)];
        let (sin, cos) = (std::f32::consts::TAU * random(2)).sin_cos();
        let length = TEXELS * (0.75 + 0.6 * random(3));
        let width = length * (0.30 + 0.16 * random(4));
        let clump = 0.5 * (smooth(x * 8.0 / side, y * 8.0 / side, 3) - 0.5);
        let rank = random(5) + 1.6 * clump;
        let own = random(6);
        let reach = length as i32 + 1;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let [p, q] = [dx as f32 * cos + dy as f32 * sin, dy as f32 * cos - dx as f32 * sin];
                let along = p / length;
                // Two arcs that meet in points.
                let half = width * (1.0 - along * along);
                if along.abs() > 1.0 || q.abs() > half {
                    continue;
                }
                let [column, row] = [x as i32 + dx, y as i32 + dy].map(|i| i as usize % SIDE);
                let texel = &mut found[row * SIDE + column];
                if rank < texel.0 {
                    // Lighter on one side of the rib.
                    let side = if q > 0.0 { 0.08 } else { -0.08 };
                    *texel = (rank, (0.15 + 0.7 * own + side).clamp(0.0, 1.0));
                }
            }
        }
    }
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|a, b| found[*a].0.total_cmp(&found[*b].0).then(a.cmp(b)));
    let mut texels = vec![Texel::default(); found.len()];
    for (place, i) in order.iter().enumerate() {
        let rank = (place * 255 / order.len()) as u8;
        texels[*i] = Texel { rank, shade: (255.0 * found[*i].1) as u8 };
    }
    texels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_much_is_there_as_is_asked_for() {
        for cover in [0.3_f32, 0.5, 0.8] {
            let count = (0..200 * 200)
                .filter(|i| {
                    let place = [i % 200, i / 200].map(|k| k as f32 * 0.0256 * texels(0.1));
                    Mask::of(cover).is_leaf(place)
                })
                .count();
            let share = count as f32 / 40_000.0;
            assert!((share - cover).abs() < 0.03, "{share} of {cover}");
        }
        assert!(!Mask::of(0.0).is_leaf([30.0, 20.0]));
    }
}
