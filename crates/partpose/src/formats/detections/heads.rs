//! What optional heads of a network say of a detection, in files: its size and its model.
//!
//! `extents [N, 3]` with `extent_sigma [N, 3]`, the standard deviations of the logarithms (sizes are exact without), and
//! `model_probabilities [N, M]` with the models' names in the metadata `models`. A row of NaN says nothing.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use crate::detection::{DetectedSize, Detection, ModelProbabilities};
use crate::geometry::Extent;

use super::{DetectionFileError, Reader};

/// Largest side of a vehicle that is believed, metres.
const MAX_SIDE: f32 = 100.0;
/// Largest standard deviation of a side's logarithm; beyond it nothing is said.
const MAX_SIGMA: f32 = 10.0;
/// How far the probabilities of a detection's models may miss 1.
const MAX_SUM_ERROR: f32 = 0.05;

/// One size a detection, where the file says any.
pub(super) fn read_sizes(
    reader: &Reader,
    count: usize,
) -> Result<Vec<Option<DetectedSize>>, DetectionFileError> {
    let Some((shape, extents)) = reader.optional("extents")? else {
        if reader.optional("extent_sigma")?.is_some() {
            let reason = "needs the tensor `extents` beside it".to_owned();
            return Err(reader.tensor_error("extent_sigma", reason));
        }
        return Ok(vec![None; count]);
    };
    reader.expect_shape("extents", &shape, &[count, 3])?;
    let sigmas = match reader.optional("extent_sigma")? {
        Some((shape, sigmas)) => {
            reader.expect_shape("extent_sigma", &shape, &[count, 3])?;
            sigmas
        }
        None => vec![0.0; 3 * count],
    };
    let rows = extents.chunks_exact(3).zip(sigmas.chunks_exact(3)).enumerate();
    rows.map(|(index, (sides, sigma))| {
        if sides.iter().all(|side| side.is_nan()) {
            return Ok(None);
        }
        if !sides.iter().all(|side| *side > 0.0 && *side <= MAX_SIDE) {
            return Err(reader.detection_error(index, format!("has the extent {sides:?}")));
        }
        if !sigma.iter().all(|sigma| (0.0..=MAX_SIGMA).contains(sigma)) {
            let reason = format!(
                "has the extent_sigma {sigma:?}; standard deviations of logarithms, 0 to {MAX_SIGMA}, are meant"
            );
            return Err(reader.detection_error(index, reason));
        }
        let [width, height, length] = [sides[0], sides[1], sides[2]].map(f64::from);
        let sigma = [sigma[0], sigma[1], sigma[2]].map(f64::from);
        Ok(Some(DetectedSize { extent: Extent::new(width, height, length), sigma }))
    })
    .collect()
}

/// One distribution over models a detection, where the file says any.
pub(super) fn read_models(
    reader: &Reader,
    metadata: &HashMap<String, String>,
    count: usize,
) -> Result<Vec<Option<ModelProbabilities>>, DetectionFileError> {
    let name = "model_probabilities";
    let Some((shape, values)) = reader.optional(name)? else { return Ok(vec![None; count]) };
    let names: Option<Vec<String>> =
        metadata.get("models").and_then(|text| serde_json::from_str(text).ok());
    let different = |names: &Vec<String>| {
        !names.is_empty() && names.iter().collect::<BTreeSet<_>>().len() == names.len()
    };
    let Some(names) = names.filter(different) else {
        let reason = "needs the metadata `models` to be a JSON list of different names".to_owned();
        return Err(reader.tensor_error(name, reason));
    };
    reader.expect_shape(name, &shape, &[count, names.len()])?;
    let names: Arc<[String]> = names.into();
    let rows = values.chunks_exact(names.len()).enumerate();
    rows.map(|(index, row)| {
        if row.iter().all(|value| value.is_nan()) {
            return Ok(None);
        }
        let sum: f32 = row.iter().sum();
        let are_shares = row.iter().all(|value| (0.0..=1.0).contains(value));
        if !are_shares || (sum - 1.0).abs() > MAX_SUM_ERROR {
            let reason = format!(
                "has model_probabilities that are no distribution: {row:?}; a soft-max is meant"
            );
            return Err(reader.detection_error(index, reason));
        }
        Ok(Some(ModelProbabilities { names: Arc::clone(&names), values: row.to_vec() }))
    })
    .collect()
}

/// `extents` and `extent_sigma`, row by row; `None` where no detection has a size, no sigmas where all are exact.
pub(super) fn size_rows<'a>(
    all: impl Iterator<Item = &'a Detection> + Clone,
) -> Option<(Vec<f32>, Option<Vec<f32>>)> {
    all.clone().any(|one| one.size.is_some()).then(|| {
        let sides = |one: &Detection| {
            one.size.map_or([f32::NAN; 3], |size| {
                [size.extent.width, size.extent.height, size.extent.length].map(|side| side as f32)
            })
        };
        let sigma =
            |one: &Detection| one.size.map_or([0.0; 3], |size| size.sigma.map(|s| s as f32));
        let are_exact = all.clone().all(|one| one.size.is_none_or(|size| size.is_exact()));
        let sigmas = (!are_exact).then(|| all.clone().flat_map(sigma).collect());
        (all.flat_map(sides).collect(), sigmas)
    })
}

/// `model_probabilities`, row by row, with the names; `None` where no detection has any. The error is the index of a
/// detection with other names than those before.
pub(super) fn model_rows<'a>(
    all: impl Iterator<Item = &'a Detection> + Clone,
) -> Result<Option<(Vec<f32>, Arc<[String]>)>, usize> {
    let Some(first) = all.clone().find_map(|one| one.models.as_ref()) else { return Ok(None) };
    let fits = |models: &ModelProbabilities| {
        models.names == first.names && models.values.len() == first.names.len()
    };
    if let Some(index) = all.clone().position(|one| !one.models.as_ref().is_none_or(fits)) {
        return Err(index);
    }
    let nothing = vec![f32::NAN; first.names.len()];
    let rows = all.flat_map(|one| match &one.models {
        Some(models) => models.values.clone(),
        None => nothing.clone(),
    });
    Ok(Some((rows.collect(), Arc::clone(&first.names))))
}
