//! Where the leaves of a card are, and how light each is.
//!
//! A table of overlapping pointed leaves is made once and repeats over the plane. Every texel knows the rank of the first
//! leaf that covers it, and ranks are spread evenly, so that the share that is there is exactly what a material asks for.
//! Leaves of the same rank as their neighbours' form clumps with gaps between them, as twigs do.

use std::sync::LazyLock;

use super::noise::{cell_share, floor, smooth};

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

/// Whether a leaf is at a place, metres; `cover` is the share that is there.
#[inline]
pub(super) fn is_leaf(u: f32, v: f32, cover: f32, size: f32) -> bool {
    f32::from(at(&TABLE, u, v, size).rank) < 255.0 * cover
}

/// How light the leaf at a place is: 0 to 1, a half in the mean.
pub(super) fn shade(u: f32, v: f32, size: f32) -> f32 {
    f32::from(at(&TABLE, u, v, size).shade) * (1.0 / 255.0)
}

#[inline]
fn at(table: &[Texel], u: f32, v: f32, size: f32) -> Texel {
    let scale = TEXELS / size.max(1e-3);
    let place = |x: f32| floor(x * scale) as usize % SIDE;
    table[place(v) * SIDE + place(u)]
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
                    is_leaf((i % 200) as f32 * 0.0256, (i / 200) as f32 * 0.0256, cover, 0.1)
                })
                .count();
            let share = count as f32 / 40_000.0;
            assert!((share - cover).abs() < 0.03, "{share} of {cover}");
        }
        assert!(!is_leaf(0.3, 0.2, 0.0, 0.1));
    }
}
