//! Outputs of a model as plain numbers with their axes.

use ort::session::SessionOutputs;
use ort::value::{DynValue, TensorElementType};

use crate::OnnxError;

/// An output.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Output {
    pub(crate) name: String,
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f32>,
}

/// Reads an output by its name.
pub(crate) fn read(outputs: &SessionOutputs, name: &str) -> Result<Output, OnnxError> {
    let value = outputs.get(name).ok_or_else(|| OnnxError::Name {
        kind: "output",
        name: name.to_owned(),
        known: outputs.keys().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", "),
    })?;
    let wrong = |found: String| OnnxError::Shape {
        name: name.to_owned(),
        found,
        expected: "a tensor of 32-bit floats or of integers".to_owned(),
    };
    let (Some(shape), Some(kind)) = (value.dtype().tensor_shape(), value.dtype().tensor_type())
    else {
        return Err(wrong("no tensor".to_owned()));
    };
    let shape: Vec<usize> = shape.iter().map(|side| usize::try_from(*side).unwrap_or(0)).collect();
    // An empty tensor has no memory to read from.
    let values = if shape.contains(&0) { Vec::new() } else { numbers(value, kind, &wrong)? };
    Ok(Output { name: name.to_owned(), shape, values })
}

fn numbers(
    value: &DynValue,
    kind: TensorElementType,
    wrong: &dyn Fn(String) -> OnnxError,
) -> Result<Vec<f32>, OnnxError> {
    let values = match kind {
        TensorElementType::Float32 => value.try_extract_tensor::<f32>().map(|(_, v)| v.to_vec()),
        TensorElementType::Int64 => value
            .try_extract_tensor::<i64>()
            .map(|(_, v)| v.iter().map(|value| *value as f32).collect()),
        TensorElementType::Int32 => value
            .try_extract_tensor::<i32>()
            .map(|(_, v)| v.iter().map(|value| *value as f32).collect()),
        TensorElementType::Uint8 => value
            .try_extract_tensor::<u8>()
            .map(|(_, v)| v.iter().map(|value| f32::from(*value)).collect()),
        other => return Err(wrong(format!("of type {other}"))),
    };
    values.map_err(|error| wrong(error.to_string()))
}

impl Output {
    /// Takes off leading axes of length 1 until so many are left.
    pub(crate) fn with_axes(mut self, count: usize) -> Result<Self, OnnxError> {
        while self.shape.len() > count && self.shape[0] == 1 {
            self.shape.remove(0);
        }
        if self.shape.len() == count {
            return Ok(self);
        }
        Err(self.wrong(&format!("{count} axes, perhaps with leading ones of length 1")))
    }

    pub(crate) fn wrong(&self, expected: &str) -> OnnxError {
        let [name, expected] = [self.name.clone(), expected.to_owned()];
        OnnxError::Shape { name, found: format!("{:?}", self.shape), expected }
    }
}
