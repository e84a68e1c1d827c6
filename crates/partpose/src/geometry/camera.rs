//! The pinhole camera.

use serde::{Deserialize, Serialize};

use super::{Point2, Point3, Rect, Vector3};

/// A pinhole camera without distortion; images of a real lens are undistorted before they come here.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Focal lengths `f_x`, `f_y` in pixels.
    pub focal: [f64; 2],
    /// Principal point `c_x`, `c_y` in pixels; pixel centres lie at integer coordinates.
    pub principal_point: [f64; 2],
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
}

impl Camera {
    /// A camera with square pixels.
    pub const fn pinhole(focal: f64, principal_point: [f64; 2], size: [u32; 2]) -> Self {
        Self { focal: [focal, focal], principal_point, size }
    }

    /// The pixel at which a point appears, or `None` if it does not lie in front of the camera.
    pub fn project(&self, point_in_camera: &Point3) -> Option<Point2> {
        (point_in_camera.z > 0.0).then(|| self.project_unchecked(point_in_camera))
    }

    /// The pixel of a point that is known to lie in front of the camera.
    pub fn project_unchecked(&self, point_in_camera: &Point3) -> Point2 {
        let inverse_depth = 1.0 / point_in_camera.z;
        Point2::new(
            self.focal[0] * point_in_camera.x * inverse_depth + self.principal_point[0],
            self.focal[1] * point_in_camera.y * inverse_depth + self.principal_point[1],
        )
    }

    /// The viewing ray of a pixel, scaled to z = 1, so that `depth * ray` is the point seen.
    pub fn ray(&self, pixel: &Point2) -> Vector3 {
        Vector3::new(
            (pixel.x - self.principal_point[0]) / self.focal[0],
            (pixel.y - self.principal_point[1]) / self.focal[1],
            1.0,
        )
    }

    /// The area that the image covers: from -0.5 to size - 0.5.
    pub fn image_rect(&self) -> Rect {
        Rect::new(-0.5, -0.5, f64::from(self.size[0]) - 0.5, f64::from(self.size[1]) - 0.5)
    }

    /// The camera whose image is `rect` of this one, resampled to `size` pixels.
    ///
    /// Rendering through it samples the rectangle on a regular grid; `rect` may lie partly outside the image.
    #[must_use]
    pub fn crop(&self, rect: &Rect, size: [u32; 2]) -> Self {
        let scale = [f64::from(size[0]) / rect.width(), f64::from(size[1]) / rect.height()];
        Self {
            focal: [self.focal[0] * scale[0], self.focal[1] * scale[1]],
            principal_point: [
                (self.principal_point[0] - rect.x_min) * scale[0] - 0.5,
                (self.principal_point[1] - rect.y_min) * scale[1] - 0.5,
            ],
            size,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);

    #[test]
    fn point_behind_camera_has_no_pixel() {
        assert_eq!(CAMERA.project(&Point3::new(0.0, 0.0, -1.0)), None);
        assert_eq!(CAMERA.project(&Point3::new(0.0, 0.0, 0.0)), None);
    }

    #[test]
    fn ray_undoes_projection() {
        let point = Point3::new(1.5, -0.7, 12.0);
        let pixel = CAMERA.project(&point).unwrap();
        assert!((CAMERA.ray(&pixel) * point.z - point.coords).norm() < 1e-12);
    }

    #[test]
    fn crop_sees_the_rect_it_was_cut_from() {
        let rect = Rect::new(99.5, 49.5, 199.5, 99.5);
        let crop = CAMERA.crop(&rect, [50, 50]);
        // The centre of the crop's first cell is 1 px right and 0.5 px below the corner of the rect.
        let ray = crop.ray(&Point2::new(0.0, 0.0));
        let pixel = CAMERA.project(&Point3::from(ray)).unwrap();
        assert!((pixel - Point2::new(100.5, 50.0)).norm() < 1e-9);
    }
}
