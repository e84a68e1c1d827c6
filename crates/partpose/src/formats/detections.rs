//! Detections as safetensors: the seam between any detector and the pose stage.
//!
//! Tensors `boxes [N, 4]`, `scores [N]`, `part_probabilities [N, 30, m, m]`, optionally `unknown [N, m, m]`,
//! `image [N]` and what [`heads`] reads; the metadata key `images` holds the image names as a JSON list. Boxes are
//! `x_min, y_min, x_max, y_max` in pixels with pixel centres at integers; the metadata `pixel_origin = "corner"` says
//! that 0 is the first pixel's edge, as in torchvision and Ultralytics.

mod heads;

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

use crate::detection::Detection;
use crate::files::{self, FileError};
use crate::geometry::Rect;
use crate::parts::{CHANNELS, PartProbabilities, ProbabilityError};

use super::tensor_file::safetensors_bytes;

/// Largest kernel that is believed.
const MAX_KERNEL: usize = 512;

/// Why a file of detections could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectionFileError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not a safetensors file.
    #[error("`{path}` is not a safetensors file")]
    Container {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        source: safetensors::SafeTensorError,
    },
    /// A tensor is missing, or has another shape or type.
    #[error("`{path}`: tensor `{tensor}` {reason}")]
    Tensor {
        /// The file.
        path: PathBuf,
        /// Name of the tensor.
        tensor: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// One detection makes no sense.
    #[error("`{path}`: detection {index} {reason}")]
    Detection {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        index: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// One detection's probabilities are none.
    #[error("`{path}`: detection {index}")]
    Probabilities {
        /// The file.
        path: PathBuf,
        /// Counted from 0.
        index: usize,
        /// What is wrong with them.
        source: ProbabilityError,
    },
}

/// Detections by image.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionFile {
    /// Names of the images; one nameless image if the file names none.
    pub images: Vec<String>,
    /// Each with the index of its image, in the order of the file.
    pub detections: Vec<(usize, Detection)>,
}

/// Reads a file of detections.
pub fn read_detections(path: &Path) -> Result<DetectionFile, DetectionFileError> {
    let bytes = files::read(path)?;
    let container = |source| DetectionFileError::Container { path: path.to_owned(), source };
    let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(container)?;
    let tensors = SafeTensors::deserialize(&bytes).map_err(container)?;
    let reader = Reader { path, tensors };
    let metadata = metadata.metadata().clone().unwrap_or_default();

    let (shape, boxes) = reader.numbers("boxes")?;
    let count = shape.first().copied().unwrap_or(0);
    reader.expect_shape("boxes", &shape, &[count, 4])?;
    let (shape, scores) = reader.numbers("scores")?;
    reader.expect_shape("scores", &shape, &[count])?;
    let (shape, probabilities) = reader.numbers("part_probabilities")?;
    let m = shape.last().copied().unwrap_or(0);
    if shape != [count, CHANNELS, m, m] {
        let reason = format!("has the shape {shape:?}, but [{count}, {CHANNELS}, m, m] is needed");
        return Err(reader.tensor_error("part_probabilities", reason));
    }
    if m == 0 || m > MAX_KERNEL {
        let reason = format!("has kernels of {m} cells a side; 1 to {MAX_KERNEL} are read");
        return Err(reader.tensor_error("part_probabilities", reason));
    }
    check_sums(&reader, &probabilities, m)?;
    let unknown = match reader.optional("unknown")? {
        Some((shape, values)) => {
            reader.expect_shape("unknown", &shape, &[count, m, m])?;
            Some(values)
        }
        None => None,
    };
    let mut sizes = heads::read_sizes(&reader, count)?;
    let mut models = heads::read_models(&reader, &metadata, count)?;
    let images = image_names(&reader, &metadata)?;
    let image_of = reader.image_indices(count, images.len())?;
    let shift = match metadata.get("pixel_origin").map(String::as_str) {
        None | Some("center") => 0.0,
        Some("corner") => -0.5,
        Some(other) => {
            let reason =
                format!("has metadata `pixel_origin` = `{other}`; `center` or `corner` is meant");
            return Err(reader.tensor_error("boxes", reason));
        }
    };

    let mut detections = Vec::with_capacity(count);
    for index in 0..count {
        let b: [f64; 4] = std::array::from_fn(|i| f64::from(boxes[4 * index + i]) + shift);
        let bounds = Rect::new(b[0], b[1], b[2], b[3]);
        let score = f64::from(scores[index]);
        let wrong = |reason: String| reader.detection_error(index, reason);
        if !b.iter().all(|value| value.is_finite() && value.abs() < 1e6) {
            return Err(wrong(format!("has the box {b:?}, which is not four sensible numbers")));
        }
        if bounds.width() <= 0.0 || bounds.height() <= 0.0 {
            return Err(wrong(format!(
                "has the box {b:?}, whose maximum is not above its minimum"
            )));
        }
        if !(0.0..=1.0).contains(&score) {
            return Err(wrong(format!("has the score {score}, which is not between 0 and 1")));
        }
        let size = CHANNELS * m * m;
        let values = probabilities[index * size..(index + 1) * size].to_vec();
        let probabilities = PartProbabilities::new(m, values).map_err(|source| {
            DetectionFileError::Probabilities { path: path.to_owned(), index, source }
        })?;
        let unknown = unknown.as_ref().map(|all| all[index * m * m..(index + 1) * m * m].to_vec());
        if unknown.iter().flatten().any(|share| !(0.0..=1.0).contains(share)) {
            return Err(wrong("has an unknown share that is not between 0 and 1".to_owned()));
        }
        let (size, models) = (sizes[index].take(), models[index].take());
        let detection = Detection { bounds, score, probabilities, unknown, size, models };
        detections.push((image_of[index], detection));
    }
    Ok(DetectionFile { images, detections })
}

/// Writes detections so that [`read_detections`] gives them back; all kernels must have one size.
pub fn write_detections(path: &Path, file: &DetectionFile) -> Result<(), DetectionFileError> {
    let count = file.detections.len();
    let m = file.detections.first().map_or(1, |(_, d)| d.probabilities.size());
    let bytes = |values: &mut dyn Iterator<Item = f32>| {
        values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>()
    };
    let all = || file.detections.iter().map(|(_, d)| d);
    if let Some(index) = all().position(|d| d.probabilities.size() != m) {
        let reason = format!("has a kernel of another size than the first, {m} x {m}");
        return Err(DetectionFileError::Detection { path: path.to_owned(), index, reason });
    }
    let boxes = bytes(&mut all().flat_map(|d| {
        [d.bounds.x_min, d.bounds.y_min, d.bounds.x_max, d.bounds.y_max].map(|value| value as f32)
    }));
    let scores = bytes(&mut all().map(|d| d.score as f32));
    let probabilities = bytes(&mut all().flat_map(|d| d.probabilities.values().iter().copied()));
    let known = vec![0.0; m * m];
    let unknown =
        bytes(&mut all().flat_map(|d| d.unknown.as_ref().unwrap_or(&known).iter().copied()));
    let (extents, sigmas) = heads::size_rows(all()).unzip();
    let extents = extents.map(|rows| bytes(&mut rows.into_iter()));
    let sigmas = sigmas.flatten().map(|rows| bytes(&mut rows.into_iter()));
    let (models, names_of_models) = heads::model_rows(all())
        .map_err(|index| {
            let reason = "has probabilities of other models than the detections before".to_owned();
            DetectionFileError::Detection { path: path.to_owned(), index, reason }
        })?
        .unzip();
    let models = models.map(|rows| bytes(&mut rows.into_iter()));
    let model_count = names_of_models.as_ref().map_or(0, |names| names.len());
    let image: Vec<u8> =
        file.detections.iter().flat_map(|(index, _)| (*index as i64).to_le_bytes()).collect();
    let view = |dtype, shape: &[usize], bytes| {
        TensorView::new(dtype, shape.to_vec(), bytes).expect("the bytes fill the shape")
    };
    let mut tensors = vec![
        ("boxes", view(Dtype::F32, &[count, 4], &boxes)),
        ("scores", view(Dtype::F32, &[count], &scores)),
        ("part_probabilities", view(Dtype::F32, &[count, CHANNELS, m, m], &probabilities)),
        ("image", view(Dtype::I64, &[count], &image)),
    ];
    if all().any(|d| d.unknown.is_some()) {
        tensors.push(("unknown", view(Dtype::F32, &[count, m, m], &unknown)));
    }
    for (name, width, bytes) in [
        ("extents", 3, &extents),
        ("extent_sigma", 3, &sigmas),
        ("model_probabilities", model_count, &models),
    ] {
        if let Some(bytes) = bytes {
            tensors.push((name, view(Dtype::F32, &[count, width], bytes)));
        }
    }
    let list = |names: &[String]| serde_json::to_string(names).expect("a list of texts is JSON");
    let mut metadata = BTreeMap::from([("images".to_owned(), list(&file.images))]);
    metadata.extend(names_of_models.map(|names| ("models".to_owned(), list(&names))));
    let bytes = safetensors_bytes(tensors, &metadata)
        .map_err(|source| DetectionFileError::Container { path: path.to_owned(), source })?;
    Ok(files::write(path, &bytes)?)
}

/// Largest mean distance of a cell's sum from 1; rounding to half precision stays far below.
const MAX_SUM_ERROR: f64 = 0.05;

/// Sigmoids and logits look like probabilities one by one; their sums tell.
fn check_sums(reader: &Reader, probabilities: &[f32], m: usize) -> Result<(), DetectionFileError> {
    let cells = m * m;
    let mut distance = 0.0;
    for kernel in probabilities.chunks_exact(CHANNELS * cells) {
        for cell in 0..cells {
            let sum: f32 = (0..CHANNELS).map(|channel| kernel[channel * cells + cell]).sum();
            distance += f64::from((sum - 1.0).abs());
        }
    }
    let mean = distance / (probabilities.len() / CHANNELS).max(1) as f64;
    // Values that are no numbers at all are named by their detection.
    if mean.is_nan() || mean <= MAX_SUM_ERROR {
        return Ok(());
    }
    let reason = format!(
        "does not sum to 1 over the 30 channels of a cell: it misses by {mean:.2} on average; a soft-max is meant"
    );
    Err(reader.tensor_error("part_probabilities", reason))
}

fn image_names(
    reader: &Reader,
    metadata: &HashMap<String, String>,
) -> Result<Vec<String>, DetectionFileError> {
    let Some(names) = metadata.get("images") else { return Ok(vec![String::new()]) };
    match serde_json::from_str::<Vec<String>>(names) {
        Ok(names) if !names.is_empty() => Ok(names),
        _ => {
            let reason = "needs the metadata `images` to be a JSON list of at least one name";
            Err(reader.tensor_error("image", reason.to_owned()))
        }
    }
}

/// Shape and values of a tensor.
type Numbers = (Vec<usize>, Vec<f32>);

struct Reader<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
}

impl Reader<'_> {
    fn tensor_error(&self, tensor: &'static str, reason: String) -> DetectionFileError {
        DetectionFileError::Tensor { path: self.path.to_owned(), tensor, reason }
    }

    fn detection_error(&self, index: usize, reason: String) -> DetectionFileError {
        DetectionFileError::Detection { path: self.path.to_owned(), index, reason }
    }

    fn expect_shape(
        &self,
        tensor: &'static str,
        shape: &[usize],
        expected: &[usize],
    ) -> Result<(), DetectionFileError> {
        if shape == expected {
            return Ok(());
        }
        let reason = format!("has the shape {shape:?}, but {expected:?} is needed");
        Err(self.tensor_error(tensor, reason))
    }

    fn optional(
        &self,
        name: &'static str,
    ) -> Result<Option<(Vec<usize>, Vec<f32>)>, DetectionFileError> {
        if self.tensors.names().contains(&name) { self.numbers(name).map(Some) } else { Ok(None) }
    }

    /// Shape and values of a tensor of floating-point numbers.
    fn numbers(&self, name: &'static str) -> Result<Numbers, DetectionFileError> {
        let Ok(view) = self.tensors.tensor(name) else {
            return Err(self.tensor_error(name, "is missing".to_owned()));
        };
        let data = view.data();
        let values = match view.dtype() {
            Dtype::F32 => numbers_of(data, f32::from_le_bytes),
            Dtype::F64 => numbers_of(data, |bytes| f64::from_le_bytes(bytes) as f32),
            other => {
                let reason = format!("has the type {other:?}; F32 and F64 are read");
                return Err(self.tensor_error(name, reason));
            }
        };
        Ok((view.shape().to_vec(), values))
    }

    /// The image of each detection; without the tensor all belong to the first.
    fn image_indices(&self, count: usize, images: usize) -> Result<Vec<usize>, DetectionFileError> {
        let Ok(view) = self.tensors.tensor("image") else {
            if images > 1 {
                let reason = "is missing, but there are several images";
                return Err(self.tensor_error("image", reason.to_owned()));
            }
            return Ok(vec![0; count]);
        };
        self.expect_shape("image", view.shape(), &[count])?;
        let data = view.data();
        let indices: Vec<i64> = match view.dtype() {
            Dtype::I64 => numbers_of(data, i64::from_le_bytes),
            Dtype::I32 => numbers_of(data, |bytes| i64::from(i32::from_le_bytes(bytes))),
            Dtype::U32 => numbers_of(data, |bytes| i64::from(u32::from_le_bytes(bytes))),
            other => {
                let reason = format!("has the type {other:?}; I64, I32 and U32 are read");
                return Err(self.tensor_error("image", reason));
            }
        };
        let valid = |index: &i64| usize::try_from(*index).ok().filter(|index| *index < images);
        indices
            .iter()
            .map(|index| {
                valid(index).ok_or_else(|| {
                    let reason =
                        format!("holds {index}, but the metadata `images` has {images} names");
                    self.tensor_error("image", reason)
                })
            })
            .collect()
    }
}

fn numbers_of<const N: usize, T>(data: &[u8], read: impl Fn([u8; N]) -> T) -> Vec<T> {
    data.as_chunks::<N>().0.iter().map(|bytes| read(*bytes)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detection::{DetectedSize, ModelProbabilities};
    use crate::geometry::Extent;
    use proptest::prelude::*;

    fn file() -> DetectionFile {
        let detection = |x: f64, unknown| {
            let mut values = vec![0.0; CHANNELS * 4];
            values[..4].fill(0.25);
            values[4 * 5..4 * 6].fill(0.75);
            let probabilities = PartProbabilities::new(2, values).unwrap();
            let bounds = Rect::new(x, 2.0, x + 30.0, 20.5);
            Detection { unknown, ..Detection::new(bounds, 0.5, probabilities) }
        };
        let mut looked_at = detection(7.5, Some(vec![0.0; 4]));
        looked_at.size = Some(DetectedSize {
            extent: Extent::new(1.75, 1.5, 4.5),
            sigma: [0.0625, 0.125, 0.25],
        });
        let names = ["sedan".to_owned(), "van".to_owned()].into();
        looked_at.models = Some(ModelProbabilities { names, values: vec![0.75, 0.25] });
        DetectionFile {
            images: vec!["a.png".to_owned(), "b.png".to_owned()],
            detections: vec![(1, detection(1.0, Some(vec![0.0, 0.5, 1.0, 0.0]))), (0, looked_at)],
        }
    }

    fn bytes_of(file: &DetectionFile) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.safetensors");
        write_detections(&path, file).unwrap();
        std::fs::read(path).unwrap()
    }

    fn read_bytes(bytes: &[u8]) -> Result<DetectionFile, DetectionFileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.safetensors");
        std::fs::write(&path, bytes).unwrap();
        read_detections(&path)
    }

    #[test]
    fn detections_survive_a_round_trip() {
        assert_eq!(read_bytes(&bytes_of(&file())).unwrap(), file());
    }

    #[test]
    fn sigmoids_are_refused() {
        let mut bad = file();
        for (_, detection) in &mut bad.detections {
            detection.probabilities = PartProbabilities::new(2, vec![0.9; CHANNELS * 4]).unwrap();
        }
        let error = read_bytes(&bytes_of(&bad)).unwrap_err().to_string();
        assert!(error.contains("does not sum to 1") && error.contains("26.00"), "{error}");
    }

    #[test]
    fn impossible_detections_are_named() {
        let mut bad = file();
        bad.detections[1].1.bounds.x_max = 0.0;
        let error = read_bytes(&bytes_of(&bad)).unwrap_err().to_string();
        assert!(error.contains("detection 1 has the box"), "{error}");
        let mut bad = file();
        bad.detections[0].0 = 9;
        let error = read_bytes(&bytes_of(&bad)).unwrap_err().to_string();
        assert!(
            error.contains("tensor `image` holds 9, but the metadata `images` has 2 names"),
            "{error}"
        );
    }

    #[test]
    fn sizes_without_deviations_are_exact() {
        let mut exact = file();
        for (_, detection) in &mut exact.detections {
            detection.size = Some(DetectedSize::exact(Extent::new(1.75, 1.5, 4.5)));
            detection.models = None;
        }
        let bytes = bytes_of(&exact);
        assert!(!String::from_utf8_lossy(&bytes).contains("extent_sigma"));
        assert_eq!(read_bytes(&bytes).unwrap(), exact);
    }

    #[test]
    fn heads_that_say_nonsense_are_named() {
        let said = |change: &dyn Fn(&mut Detection)| {
            let mut bad = file();
            change(&mut bad.detections[1].1);
            read_bytes(&bytes_of(&bad)).unwrap_err().to_string()
        };
        let error = said(&|one| one.size.as_mut().unwrap().extent.height = -1.0);
        assert!(error.contains("detection 1 has the extent [1.75, -1.0, 4.5]"), "{error}");
        let error = said(&|one| one.size.as_mut().unwrap().sigma[0] = -0.1);
        assert!(error.contains("detection 1 has the extent_sigma"), "{error}");
        let error = said(&|one| one.models.as_mut().unwrap().values[0] = 0.2);
        assert!(error.contains("no distribution: [0.2, 0.25]"), "{error}");
    }

    proptest! {
        #[test]
        fn reader_never_panics(at in 0..2000usize, value in any::<u8>(), cut in 0..3000usize) {
            let mut bytes = bytes_of(&file());
            let at = at % bytes.len();
            bytes[at] = value;
            bytes.truncate(cut.max(1));
            let _ = read_bytes(&bytes);
        }
    }
}
