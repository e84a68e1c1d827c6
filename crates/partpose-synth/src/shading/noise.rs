//! Numbers that look random and are the same at the same place, for textures.
//!
//! Noise is looked up in one table of 256 x 256 numbers, made once; a seed shifts the place in it. It repeats after 256
//! blotches, which nobody sees in a picture and which costs a tenth of hashing every corner.

use std::sync::LazyLock;

/// Cells along a side of the table; a power of two.
const SIDE: usize = 256;

/// The numbers at the four corners of every cell, a byte each: here, right, below, right below.
static LATTICE: LazyLock<Box<[u32; SIDE * SIDE]>> = LazyLock::new(|| {
    let value = |x: usize, y: usize| cell((x % SIDE) as i32, (y % SIDE) as i32, 0x51ed) >> 24;
    let mut table = Box::new([0; SIDE * SIDE]);
    for (i, corners) in table.iter_mut().enumerate() {
        let [x, y] = [i % SIDE, i / SIDE];
        *corners =
            value(x, y) | value(x + 1, y) << 8 | value(x, y + 1) << 16 | value(x + 1, y + 1) << 24;
    }
    table
});

/// The largest whole number that is not above `x`, for what fits an `i32`; without a call of the C library.
#[inline]
pub(crate) fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole - i32::from(x < whole as f32)
}

/// The low bits of the largest whole number that is not above `x`, and what `x` has beyond it, up to 1; for numbers
/// below two millions.
///
/// Adding 1.5 * 2^23 leaves the whole number in the low bits of the sum, rounded: no conversion with its bounds.
#[inline]
pub(crate) fn whole(x: f32) -> (u32, f32) {
    const SHIFT: f32 = 12_582_912.0;
    let shifted = (x - 0.5) + SHIFT;
    (shifted.to_bits(), x - (shifted - SHIFT))
}

/// The smallest whole number that is not below `x`.
#[inline]
pub(crate) fn ceil(x: f32) -> i32 {
    let whole = x as i32;
    whole + i32::from(x > whole as f32)
}

/// Mixes the bits of a number (the finaliser of `lowbias32`, C. Wellons).
pub(crate) fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A number of a cell of a grid.
pub(crate) fn cell(x: i32, y: i32, seed: u32) -> u32 {
    mix((x as u32).wrapping_mul(0x9e37_79b1) ^ mix(y as u32 ^ seed.wrapping_mul(0x85eb_ca6b)))
}

/// The same from 0 to 1.
pub(crate) fn cell_share(x: i32, y: i32, seed: u32) -> f32 {
    (cell(x, y, seed) >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Smooth noise from 0 to 1 with blotches of size 1.
pub(crate) fn smooth(x: f32, y: f32, seed: u32) -> f32 {
    smooth_in(&LATTICE, x, y, seed)
}

#[inline]
fn smooth_in(lattice: &[u32; SIDE * SIDE], x: f32, y: f32, seed: u32) -> f32 {
    let [(ix, u), (iy, v)] = [whole(x), whole(y)];
    let fade = |t: f32| t * t * (3.0 - 2.0 * t);
    let [u, v] = [fade(u), fade(v)];
    let shift = seed.wrapping_mul(0x9e37_79b1);
    let column = ix.wrapping_add(shift >> 16) as usize % SIDE;
    let row = iy.wrapping_add(shift >> 24) as usize % SIDE;
    let corners = lattice[row * SIDE + column];
    let corner = |i: u32| ((corners >> (8 * i)) & 255) as i32 as f32;
    let [a, b, c, d] = [corner(0), corner(1), corner(2), corner(3)];
    let low = a + u * (b - a);
    (low + v * (c + u * (d - c) - low)) * (1.0 / 255.0)
}

/// Octaves of [`smooth`] that are not finer than the footprint (in units of the largest blotches); mean 0.5.
pub(crate) fn fractal(x: f32, y: f32, octaves: u32, footprint: f32, seed: u32) -> f32 {
    let lattice = &**LATTICE;
    let [mut sum, mut weight, mut scale] = [0.5, 0.5, 1.0];
    for octave in 0..octaves {
        // Fades out between one and half a blotch a pixel.
        let seen = (2.0 - 2.0 * footprint * scale).clamp(0.0, 1.0);
        if seen <= 0.0 {
            break;
        }
        let value = smooth_in(lattice, x * scale, y * scale, seed.wrapping_add(octave));
        sum += seen * weight * (value - 0.5);
        weight *= 0.55;
        scale *= 2.03;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_those_of_the_library() {
        for x in [-2.5_f32, -2.0, -0.1, 0.0, 0.1, 1.0, 7.9, 1e9, -1e9] {
            assert_eq!(floor(x), x.floor() as i32, "{x}");
            assert_eq!(ceil(x), x.ceil() as i32, "{x}");
            let (bits, beyond) = whole(x.clamp(-1e6, 1e6));
            let down = x.clamp(-1e6, 1e6) - beyond;
            assert!((0.0..=1.0).contains(&beyond), "{x}: {beyond}");
            assert_eq!(bits & 0xffff, down as i32 as u32 & 0xffff, "{x}");
        }
    }

    #[test]
    fn noise_is_smooth_and_has_a_mean_of_a_half() {
        let mut sum = 0.0;
        for i in 0..10_000 {
            let [x, y] = [0.37 * i as f32, 1.71 * (i % 100) as f32];
            let value = smooth(x, y, 5);
            assert!((0.0..=1.0).contains(&value));
            assert!((smooth(x + 1e-3, y, 5) - value).abs() < 0.01);
            sum += value;
        }
        assert!((sum / 10_000.0 - 0.5).abs() < 0.03, "{sum}");
    }
}
