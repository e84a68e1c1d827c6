//! The reader of problem sets: one safetensors file a cell.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use safetensors::{Dtype, SafeTensorError, SafeTensors};

use crate::{
    files::{self, FileError},
    geometry::{Camera, Point2, Point3, Pose},
    pnp::Correspondence,
};

/// How far `R' R` may be from the identity in a file of truths.
const ORTHONORMAL: f64 = 1e-6;

/// Why a problem set could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// The file itself.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not safetensors, or damaged.
    #[error("`{path}` is not a whole safetensors file")]
    Format {
        /// The file.
        path: PathBuf,
        /// What the parser says.
        source: SafeTensorError,
    },
    /// A tensor that is not there.
    #[error("`{path}` has no tensor `{tensor}`")]
    NoTensor {
        /// The file.
        path: PathBuf,
        /// The tensor.
        tensor: &'static str,
    },
    /// A tensor of another type or shape.
    #[error("tensor `{tensor}` of `{path}` is {found}, expected {expected}")]
    Tensor {
        /// The file.
        path: PathBuf,
        /// The tensor.
        tensor: &'static str,
        /// Type and shape in the file.
        found: String,
        /// Type and shape that belong there.
        expected: String,
    },
    /// Metadata that is missing or no number.
    #[error("metadata `{key}` of `{path}` is missing or not a number")]
    Metadata {
        /// The file.
        path: PathBuf,
        /// The entry.
        key: &'static str,
    },
    /// A true pose that is none, or a point that is not finite.
    #[error("trial {trial} of `{path}` has numbers that are not a pose or not finite")]
    Trial {
        /// The file.
        path: PathBuf,
        /// Which trial, from 0.
        trial: usize,
    },
}

/// One trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// What a solver may see.
    pub correspondences: Vec<Correspondence>,
    /// The true pose.
    pub camera_from_object: Pose,
    /// Which correspondences are true matches; for scoring only.
    pub inliers: Vec<bool>,
}

/// The trials of one cell.
#[derive(Clone, Debug, PartialEq)]
pub struct ProblemSet {
    /// Name of the cell: the file's name without its ending.
    pub name: String,
    /// `spread` or `planar`.
    pub geometry: String,
    /// Points per trial.
    pub points: usize,
    /// Standard deviation of the pixels.
    pub sigma_px: f64,
    /// Share of gross outliers.
    pub outlier_fraction: f64,
    /// The camera of all trials.
    pub camera: Camera,
    /// The trials.
    pub problems: Vec<Problem>,
}

/// Reads one problem set.
pub fn read_problem_set(path: &Path) -> Result<ProblemSet, ProblemError> {
    let bytes = files::read(path)?;
    let format = |source| ProblemError::Format { path: path.to_owned(), source };
    let file = SafeTensors::deserialize(&bytes).map_err(format)?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(format)?;
    let empty = HashMap::new();
    let metadata = header.metadata().as_ref().unwrap_or(&empty);
    let number = |key: &'static str| -> Result<f64, ProblemError> {
        let value = metadata.get(key).and_then(|text| text.parse::<f64>().ok());
        let value = value.filter(|value| value.is_finite());
        value.ok_or_else(|| ProblemError::Metadata { path: path.to_owned(), key })
    };
    let reader = Reader { path, file: &file };
    let shape = reader.shape("points")?;
    let [trials, points, 3] = shape[..] else {
        return Err(reader.mismatch("points", "F32 [trials, points, 3]"));
    };
    let object: Vec<f64> = reader.floats("points", &[trials, points, 3])?;
    let pixels: Vec<f64> = reader.floats("pixels", &[trials, points, 2])?;
    let rotations: Vec<f64> = reader.doubles("R", &[trials, 3, 3])?;
    let translations: Vec<f64> = reader.doubles("t", &[trials, 3])?;
    let inlier = reader.bytes("inlier", &[trials, points])?;
    let mut problems = Vec::with_capacity(trials);
    for trial in 0..trials {
        let bad = || ProblemError::Trial { path: path.to_owned(), trial };
        let rotation = &rotations[9 * trial..9 * trial + 9];
        let translation = &translations[3 * trial..3 * trial + 3];
        let camera_from_object = pose(rotation, translation).ok_or_else(bad)?;
        let mut correspondences = Vec::with_capacity(points);
        for k in trial * points..(trial + 1) * points {
            let point = &object[3 * k..3 * k + 3];
            let pixel = &pixels[2 * k..2 * k + 2];
            if !point.iter().chain(pixel).all(|value| value.is_finite()) {
                return Err(bad());
            }
            correspondences.push(Correspondence {
                point_in_image: Point2::new(pixel[0], pixel[1]),
                point_in_object: Point3::new(point[0], point[1], point[2]),
            });
        }
        let inliers = inlier[trial * points..(trial + 1) * points].iter().map(|flag| *flag != 0);
        let inliers = inliers.collect();
        problems.push(Problem { correspondences, camera_from_object, inliers });
    }
    Ok(ProblemSet {
        name: path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default(),
        geometry: metadata.get("geometry").cloned().unwrap_or_default(),
        points,
        sigma_px: number("sigma_px")?,
        outlier_fraction: number("outlier_fraction")?,
        camera: Camera {
            focal: [number("fx")?, number("fy")?],
            principal_point: [number("cx")?, number("cy")?],
            size: [number("width")? as u32, number("height")? as u32],
        },
        problems,
    })
}

fn pose(rotation: &[f64], translation: &[f64]) -> Option<Pose> {
    let matrix = Matrix3::from_row_slice(rotation);
    let error = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    let finite = translation.iter().all(|value| value.is_finite());
    let proper = error < ORTHONORMAL && matrix.determinant() > 0.0;
    (finite && proper).then(|| {
        let rotation = Rotation3::from_matrix_unchecked(matrix);
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        Pose::from_parts(Vector3::from_column_slice(translation).into(), rotation)
    })
}

struct Reader<'a> {
    path: &'a Path,
    file: &'a SafeTensors<'a>,
}

impl<'a> Reader<'a> {
    fn view(
        &self,
        tensor: &'static str,
    ) -> Result<safetensors::tensor::TensorView<'a>, ProblemError> {
        let path = self.path.to_owned();
        self.file.tensor(tensor).map_err(|_| ProblemError::NoTensor { path, tensor })
    }

    fn shape(&self, tensor: &'static str) -> Result<Vec<usize>, ProblemError> {
        Ok(self.view(tensor)?.shape().to_vec())
    }

    fn mismatch(&self, tensor: &'static str, expected: &str) -> ProblemError {
        let found = self.view(tensor).map(|v| format!("{:?} {:?}", v.dtype(), v.shape()));
        let found = found.unwrap_or_default();
        ProblemError::Tensor {
            path: self.path.to_owned(),
            tensor,
            found,
            expected: expected.to_owned(),
        }
    }

    /// The bytes of a tensor that must have this type and shape.
    fn raw(
        &self,
        tensor: &'static str,
        dtype: Dtype,
        shape: &[usize],
    ) -> Result<&'a [u8], ProblemError> {
        let view = self.view(tensor)?;
        if view.dtype() != dtype || view.shape() != shape {
            return Err(self.mismatch(tensor, &format!("{dtype:?} {shape:?}")));
        }
        Ok(view.data())
    }

    fn floats(&self, tensor: &'static str, shape: &[usize]) -> Result<Vec<f64>, ProblemError> {
        let (chunks, _) = self.raw(tensor, Dtype::F32, shape)?.as_chunks::<4>();
        Ok(chunks.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect())
    }

    fn doubles(&self, tensor: &'static str, shape: &[usize]) -> Result<Vec<f64>, ProblemError> {
        let (chunks, _) = self.raw(tensor, Dtype::F64, shape)?.as_chunks::<8>();
        Ok(chunks.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
    }

    fn bytes(&self, tensor: &'static str, shape: &[usize]) -> Result<&'a [u8], ProblemError> {
        self.raw(tensor, Dtype::U8, shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(bytes: &[u8]) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cell.safetensors");
        std::fs::write(&path, bytes).unwrap();
        let text = read_problem_set(&path).unwrap_err().to_string();
        text.replace(&folder.path().display().to_string(), "DIR")
    }

    /// A file with the tensor `points`, of which `data` zeros are there.
    fn file(shape: &str, bytes: usize, data: usize) -> Vec<u8> {
        let header =
            format!(r#"{{"points":{{"dtype":"F32","shape":{shape},"data_offsets":[0,{bytes}]}}}}"#);
        let mut file = (header.len() as u64).to_le_bytes().to_vec();
        file.extend(header.as_bytes());
        file.resize(file.len() + data, 0);
        file
    }

    #[test]
    fn damage_is_named() {
        assert_eq!(message(b"x"), "`DIR/cell.safetensors` is not a whole safetensors file");
        assert_eq!(
            message(&file("[1,4,3]", 48, 40)),
            "`DIR/cell.safetensors` is not a whole safetensors file"
        );
    }

    #[test]
    fn missing_and_misshapen_tensors_are_named() {
        assert_eq!(
            message(&file("[4,3]", 48, 48)),
            "tensor `points` of `DIR/cell.safetensors` is F32 [4, 3], expected F32 [trials, points, 3]"
        );
        assert_eq!(
            message(&file("[1,4,3]", 48, 48)),
            "`DIR/cell.safetensors` has no tensor `pixels`"
        );
    }
}
