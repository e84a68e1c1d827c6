//! Numbers that look random and are the same at the same place, for textures.

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
    let [fx, fy] = [x.floor(), y.floor()];
    let [ix, iy] = [fx as i32, fy as i32];
    let fade = |t: f32| t * t * (3.0 - 2.0 * t);
    let [u, v] = [fade(x - fx), fade(y - fy)];
    let [ix1, iy1] = [ix.wrapping_add(1), iy.wrapping_add(1)];
    let a = cell_share(ix, iy, seed);
    let b = cell_share(ix1, iy, seed);
    let c = cell_share(ix, iy1, seed);
    let d = cell_share(ix1, iy1, seed);
    let low = a + u * (b - a);
    low + v * (c + u * (d - c) - low)
}

/// Octaves of [`smooth`] that are not finer than the footprint (in units of the largest blotches); mean 0.5.
pub(crate) fn fractal(x: f32, y: f32, octaves: u32, footprint: f32, seed: u32) -> f32 {
    let [mut sum, mut weight, mut scale] = [0.5, 0.5, 1.0];
    for octave in 0..octaves {
        // Fades out between one and half a blotch a pixel.
        let seen = (2.0 - 2.0 * footprint * scale).clamp(0.0, 1.0);
        if seen <= 0.0 {
            break;
        }
        sum += seen * weight * (smooth(x * scale, y * scale, seed.wrapping_add(octave)) - 0.5);
        weight *= 0.55;
        scale *= 2.03;
    }
    sum
}
