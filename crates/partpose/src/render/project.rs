//! From mesh vertices to fixed-point screen coordinates.

use nalgebra::{Matrix3, Vector3};

use crate::geometry::{Camera, Point3};

use super::{Instance, NEAR};

/// Steps a pixel on the grid that vertices are rounded to. An edge moves by less than 1/300 px.
pub(super) const STEPS: i64 = 1 << STEP_BITS;
pub(super) const STEP_BITS: u32 = 8;
/// Screen coordinates beyond this, in pixels, are clipped, so that edge functions fit 64 bits: a coordinate has at
/// most 28 bits and a sign, a difference 29, an edge function 60. No image is that large.
pub(super) const GUARD: f64 = 1_048_576.0;

/// All samples lie to one side of the vertex, or it is not in front of the camera: a triangle whose three vertices
/// share such a bit shows nothing.
pub(super) const LEFT: u32 = 1;
pub(super) const RIGHT: u32 = 2;
pub(super) const ABOVE: u32 = 4;
pub(super) const BELOW: u32 = 8;
pub(super) const BEHIND: u32 = 16;
/// Beyond [`GUARD`]; with [`BEHIND`] what has no usable screen coordinates.
pub(super) const FAR_OUT: u32 = 32;

pub(super) const OUTSIDE: u32 = LEFT | RIGHT | ABOVE | BELOW | BEHIND;
pub(super) const TO_CLIP: u32 = BEHIND | FAR_OUT;

/// A projected vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScreenVertex {
    /// In steps; pixel centres lie at multiples of [`STEPS`].
    pub(super) x: i32,
    /// In steps.
    pub(super) y: i32,
    /// 1 / z.
    pub(super) inverse_depth: f32,
    /// Where it lies with respect to the image, and whether the rest is meaningless.
    pub(super) code: u32,
}

/// Takes mesh coordinates to homogeneous pixels `(u, v, z)`: the pixel is `(u / z, v / z)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    matrix: Matrix3<f64>,
    offset: Vector3<f64>,
    /// Position of the last samples, in pixels.
    last: [f64; 2],
    /// Whether scale or camera turn the faces inside out.
    pub(super) mirrored: bool,
}

impl Projection {
    pub(super) fn new(camera: &Camera, instance: &Instance) -> Self {
        let [fx, fy] = camera.focal;
        let [cx, cy] = camera.principal_point;
        let image_from_camera = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
        let rotation = instance.camera_from_vehicle.rotation.to_rotation_matrix();
        let matrix =
            image_from_camera * rotation.matrix() * Matrix3::from_diagonal(&instance.scale);
        let offset = image_from_camera * instance.camera_from_vehicle.translation.vector;
        let last = camera.size.map(|side| f64::from(side) - 1.0);
        Self { matrix, offset, last, mirrored: instance.scale.product() * fx * fy < 0.0 }
    }

    /// Homogeneous pixel coordinates.
    pub(super) fn homogeneous(&self, vertex: &Point3) -> Vector3<f64> {
        self.matrix * vertex.coords + self.offset
    }

    pub(super) fn project(&self, vertices: &[Point3], screen: &mut Vec<ScreenVertex>) {
        screen.clear();
        screen.extend(vertices.iter().map(|vertex| self.vertex(&self.homogeneous(vertex))));
    }

    /// The vertex at homogeneous pixel coordinates.
    pub(super) fn vertex(&self, p: &Vector3<f64>) -> ScreenVertex {
        // Written so that what is not a number counts as behind or far out.
        let inverse = 1.0 / p.z;
        let (x, y) = (p.x * inverse, p.y * inverse);
        let in_front = p.z >= NEAR;
        let on_grid = x.abs() <= GUARD && y.abs() <= GUARD;
        let bit = |set: bool, bit: u32| u32::from(set) * bit;
        let mut code = bit(x < 0.0, LEFT)
            | bit(x > self.last[0], RIGHT)
            | bit(y < 0.0, ABOVE)
            | bit(y > self.last[1], BELOW)
            | bit(!on_grid, FAR_OUT);
        if !in_front {
            code = BEHIND;
        }
        ScreenVertex { x: to_steps(x), y: to_steps(y), inverse_depth: inverse as f32, code }
    }
}

/// The nearest step; any number where the position is beyond [`GUARD`].
///
/// Adding 1.5 * 2^52 leaves the rounded integer in the low bits, which is several times faster than `round` where
/// the processor is not assumed to have an instruction for it.
fn to_steps(pixels: f64) -> i32 {
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    (pixels * STEPS as f64 + SHIFT).to_bits() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_rounded_to_the_nearest_step() {
        for pixels in [0.0, 1.0, -1.0, 0.3, -0.3, 1241.77, -99_999.123, GUARD, -GUARD] {
            assert_eq!(to_steps(pixels), (pixels * 256.0).round_ties_even() as i32, "{pixels}");
        }
    }
}
