//! KITTI's calibration files (Geiger, Lenz, Urtasun: *Are We Ready for Autonomous Driving?*, CVPR 2012).
//!
//! Images of `image_2` follow `P2 = K [I | b]`: the left colour camera lies about 6 cm beside the left grey camera, in
//! whose frame the labels are. Who leaves `b` out is about 4 px off at 10 m.

use std::path::Path;

use nalgebra::{Matrix3, Vector3 as Column};

use crate::files;
use crate::geometry::{Camera, Vector3};

use super::DatasetError;
use super::problem::{Fault, Problem, shown};

/// The left colour camera of a KITTI calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KittiCalibration {
    /// Focal lengths `f_x`, `f_y` in pixels.
    pub focal: [f64; 2],
    /// Principal point `c_x`, `c_y` in pixels.
    pub principal_point: [f64; 2],
    /// What is added to a point in the frame of the labels (camera 0, rectified) to have it in the frame of the
    /// camera of `image_2`, metres.
    pub offset: Vector3,
}

impl KittiCalibration {
    /// The camera for images of a size, which the calibration does not hold.
    pub fn camera(&self, size: [u32; 2]) -> Camera {
        Camera { focal: self.focal, principal_point: self.principal_point, size }
    }

    /// Reads a file with a row `P2:` (or `P_rect_02:`, as in the raw recordings) of twelve numbers.
    pub fn read(path: &Path) -> Result<Self, DatasetError> {
        Ok(Self::parse(path, &files::read_text(path)?)?)
    }

    /// The same from the text of a file, whose path serves for messages.
    pub fn parse(path: &Path, text: &str) -> Result<Self, Problem> {
        for (i, line) in text.lines().enumerate() {
            let Some((name @ ("P2" | "P_rect_02"), numbers)) = line.split_once(':') else {
                continue;
            };
            let name = if name == "P2" { "P2" } else { "P_rect_02" };
            return Self::from_row(name, numbers).map_err(|fault| Problem {
                path: path.to_owned(),
                line: Some(i + 1),
                frame: None,
                fault,
            });
        }
        Err(Problem::of_file(path, None, Fault::NoMatrix { name: "P2:" }))
    }

    fn from_row(name: &'static str, text: &str) -> Result<Self, Fault> {
        /// Off-diagonal entries that count as zero, pixels.
        const SKEW: f64 = 1e-6;
        let mut p = Vec::with_capacity(12);
        for field in text.split_ascii_whitespace() {
            match field.parse::<f64>() {
                Ok(value) if value.is_finite() && value.abs() < 1e7 => p.push(value),
                _ => return Err(Fault::NotANumber { column: name, text: shown(field) }),
            }
        }
        if p.len() != 12 {
            return Err(Fault::Columns { given: p.len(), needed: 12 });
        }
        let pinhole = p[0] > 0.0
            && p[5] > 0.0
            && [p[1], p[4], p[8], p[9]].iter().all(|entry| entry.abs() < SKEW)
            && (p[10] - 1.0).abs() < SKEW;
        if !pinhole {
            return Err(Fault::NotAProjection { name });
        }
        let image_from_camera = Matrix3::new(p[0], 0.0, p[2], 0.0, p[5], p[6], 0.0, 0.0, 1.0);
        let offset = image_from_camera.try_inverse().map(|k| k * Column::new(p[3], p[7], p[11]));
        let offset = offset.ok_or(Fault::NotAProjection { name })?;
        Ok(Self { focal: [p[0], p[5]], principal_point: [p[2], p[6]], offset })
    }
}
