//! The KServe V2 protocol (Open Inference Protocol) with binary tensors, as Triton's clients speak it.
//!
//! One model, `partpose`. Inputs: `image`, either `UINT8 [height, width, 3]` in RGB or `BYTES [1]` with a PNG or JPEG
//! file, and, if wanted, `camera`, `FP64` or `FP32 [4]`: fx, fy, cx, cy. Outputs have one row a vehicle with a pose;
//! `result` is the JSON of `partpose run` with everything.
//!
//! A request with binary tensors is JSON, whose length a header tells, and behind it the tensors one after the other.

use hyper::StatusCode;
use hyper::body::Bytes;
use partpose::files::RgbImage;
use partpose::formats::ImageResult;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::estimate::check_score;
use super::workers::{Picture, Question, Refusal};

/// Name of the one model.
pub(super) const MODEL: &str = "partpose";
/// Its one version.
pub(super) const VERSION: &str = "1";

#[derive(Deserialize)]
struct Request {
    id: Option<String>,
    #[serde(default)]
    parameters: Map<String, Value>,
    inputs: Vec<Input>,
    #[serde(default)]
    outputs: Vec<Wanted>,
}

#[derive(Deserialize)]
struct Input {
    name: String,
    shape: Vec<u64>,
    datatype: String,
    #[serde(default)]
    parameters: Map<String, Value>,
    data: Option<Value>,
}

#[derive(Deserialize)]
struct Wanted {
    name: String,
    #[serde(default)]
    parameters: Map<String, Value>,
}

/// How an answer is to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Form {
    id: Option<String>,
    /// Names of the outputs, each with whether it is to be binary.
    outputs: Vec<(String, bool)>,
}

/// The outputs' names, types and shapes, -1 for the number of vehicles.
const OUTPUTS: [(&str, &str, &[i64]); 8] = [
    ("boxes", "FP64", &[-1, 4]),
    ("scores", "FP64", &[-1]),
    ("translations", "FP64", &[-1, 3]),
    ("rotations", "FP64", &[-1, 3, 3]),
    ("extents", "FP64", &[-1, 3]),
    ("models", "BYTES", &[-1]),
    ("confidences", "FP64", &[-1]),
    ("result", "BYTES", &[1]),
];

/// What the server says of itself.
pub(super) fn server() -> Value {
    json!({ "name": MODEL, "version": env!("CARGO_PKG_VERSION"), "extensions": ["binary_tensor_data"] })
}

/// What it says of the model.
pub(super) fn model() -> Value {
    let tensor = |(name, datatype, shape): (&str, &str, &[i64])| json!({ "name": name, "datatype": datatype, "shape": shape });
    json!({
        "name": MODEL,
        "versions": [VERSION],
        "platform": MODEL,
        "inputs": [tensor(("image", "UINT8", &[-1, -1, 3])), tensor(("camera", "FP64", &[4]))],
        "outputs": OUTPUTS.map(tensor),
    })
}

/// The question of a request; `header` is the length of its JSON where tensors follow it.
pub(super) fn question(header: Option<usize>, body: &Bytes) -> Result<(Question, Form), Refusal> {
    let length = header.unwrap_or(body.len());
    if length > body.len() {
        let (told, is) = (length, body.len());
        return Err(Refusal::bad(format!(
            "the JSON should have {told} bytes, but the body has {is}"
        )));
    }
    let request: Request = serde_json::from_slice(&body[..length])
        .map_err(|error| Refusal::bad(format!("this is no inference request: {error}")))?;
    let mut rest = body.slice(length..);
    let mut question = Question {
        name: request.id.clone().filter(|id| !id.is_empty()).unwrap_or_else(|| "image".to_owned()),
        picture: Picture::File(Bytes::new()),
        camera: None,
        min_score: request.parameters.get("min_score").and_then(Value::as_f64),
    };
    check_score(question.min_score)?;
    let mut has_image = false;
    for input in &request.inputs {
        let binary = match input.parameters.get("binary_data_size") {
            Some(size) => Some(take(&mut rest, input, size)?),
            None => None,
        };
        match input.name.as_str() {
            "image" => {
                question.picture = picture(input, binary)?;
                has_image = true;
            }
            "camera" => question.camera = Some(camera(input, binary)?),
            name => return Err(Refusal::bad(format!("the model has no input `{name}`"))),
        }
    }
    if !has_image {
        return Err(Refusal::bad("the input `image` is missing"));
    }
    if !rest.is_empty() {
        let left = rest.len();
        return Err(Refusal::bad(format!("{left} bytes at the end belong to no input")));
    }
    Ok((question, form(request)?))
}

fn form(request: Request) -> Result<Form, Refusal> {
    let is_binary =
        |parameters: &Map<String, Value>, key: &str| parameters.get(key).and_then(Value::as_bool);
    let all = is_binary(&request.parameters, "binary_data_output").unwrap_or(false);
    let mut outputs = Vec::new();
    for wanted in &request.outputs {
        if !OUTPUTS.iter().any(|(name, _, _)| *name == wanted.name) {
            return Err(Refusal::bad(format!("the model has no output `{}`", wanted.name)));
        }
        let binary = is_binary(&wanted.parameters, "binary_data").unwrap_or(all);
        outputs.push((wanted.name.clone(), binary));
    }
    if outputs.is_empty() {
        outputs = OUTPUTS.iter().map(|(name, _, _)| ((*name).to_owned(), all)).collect();
    }
    Ok(Form { id: request.id, outputs })
}

/// The next bytes of what follows the JSON.
fn take(rest: &mut Bytes, input: &Input, size: &Value) -> Result<Bytes, Refusal> {
    let size = size.as_u64().and_then(|size| usize::try_from(size).ok());
    let size = size.filter(|size| *size <= rest.len());
    let name = &input.name;
    let size = size.ok_or_else(|| {
        Refusal::bad(format!("`binary_data_size` of `{name}` is more than what follows the JSON"))
    })?;
    Ok(rest.split_to(size))
}

fn picture(input: &Input, binary: Option<Bytes>) -> Result<Picture, Refusal> {
    if input.datatype == "BYTES" {
        if input.shape.iter().product::<u64>() != 1 {
            return Err(Refusal::bad("`image` of type BYTES has one element, the bytes of a file"));
        }
        let mut bytes = binary
            .ok_or_else(|| Refusal::bad("`image` of type BYTES must be sent as a binary tensor"))?;
        // An element of BYTES begins with its length in four bytes.
        let told = bytes.get(..4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
        if told != Some(bytes.len().saturating_sub(4)) {
            return Err(Refusal::bad("the length before the bytes of `image` is not theirs"));
        }
        return Ok(Picture::File(bytes.split_off(4)));
    }
    let &[height, width, 3] = input.shape.as_slice() else {
        return Err(Refusal::bad("`image` has the shape [height, width, 3] or, as BYTES, [1]"));
    };
    if input.datatype != "UINT8" {
        let kind = &input.datatype;
        return Err(Refusal::bad(format!("`image` is UINT8 or BYTES, not `{kind}`")));
    }
    let side = |side: u64| u32::try_from(side).ok().filter(|side| (1..=16_384).contains(side));
    let (Some(width), Some(height)) = (side(width), side(height)) else {
        return Err(Refusal::new(
            StatusCode::PAYLOAD_TOO_LARGE,
            "`image` has a side of 0 or of more than 16384 pixels",
        ));
    };
    let pixels: Vec<u8> = match binary {
        Some(bytes) => bytes.to_vec(),
        None => numbers(input)?
            .into_iter()
            .map(|value| {
                let whole = value.fract() == 0.0 && (0.0..=255.0).contains(&value);
                whole
                    .then_some(value as u8)
                    .ok_or_else(|| Refusal::bad("`image` has a value that is not 0 to 255"))
            })
            .collect::<Result<_, _>>()?,
    };
    if pixels.len() as u64 != 3 * u64::from(width) * u64::from(height) {
        let is = pixels.len();
        return Err(Refusal::bad(format!("`image` of {height} x {width} x 3 has {is} values")));
    }
    Ok(Picture::Pixels(RgbImage { size: [width, height], pixels }))
}

fn camera(input: &Input, binary: Option<Bytes>) -> Result<[f64; 4], Refusal> {
    let wrong = || Refusal::bad("`camera` has four values, FP64 or FP32: fx, fy, cx, cy");
    let values: Vec<f64> = match (binary, input.datatype.as_str()) {
        (None, "FP64" | "FP32") => numbers(input)?,
        (Some(bytes), "FP64") => {
            let (all, rest) = bytes.as_chunks::<8>();
            if !rest.is_empty() {
                return Err(wrong());
            }
            all.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
        }
        (Some(bytes), "FP32") => {
            let (all, rest) = bytes.as_chunks::<4>();
            if !rest.is_empty() {
                return Err(wrong());
            }
            all.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect()
        }
        _ => return Err(wrong()),
    };
    values.try_into().map_err(|_| wrong())
}

/// The numbers of a tensor in JSON, flat or nested.
fn numbers(input: &Input) -> Result<Vec<f64>, Refusal> {
    fn flatten(value: &Value, into: &mut Vec<f64>) -> Option<()> {
        match value {
            Value::Array(values) => values.iter().try_for_each(|value| flatten(value, into)),
            value => {
                into.push(value.as_f64()?);
                Some(())
            }
        }
    }
    let mut values = Vec::new();
    let name = &input.name;
    let data = input.data.as_ref().ok_or_else(|| {
        Refusal::bad(format!("`{name}` has neither `data` nor `binary_data_size`"))
    })?;
    flatten(data, &mut values).ok_or_else(|| {
        Refusal::bad(format!("`data` of `{name}` holds something that is no number"))
    })?;
    Ok(values)
}

/// The values of an output.
enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

/// The body of an answer, and the length of its JSON where binary tensors follow.
pub(super) fn answer(form: &Form, result: &ImageResult) -> (Vec<u8>, Option<usize>) {
    let (mut outputs, mut binary) = (Vec::new(), Vec::new());
    let mut any = false;
    for (name, is_binary) in &form.outputs {
        let Some((_, datatype, shape)) = OUTPUTS.iter().find(|(other, _, _)| other == name) else {
            continue;
        };
        let vehicles = result.vehicles.iter().filter(|vehicle| vehicle.pose.is_some()).count();
        let shape: Vec<i64> =
            shape.iter().map(|side| if *side < 0 { vehicles as i64 } else { *side }).collect();
        let mut output = json!({ "name": name, "datatype": datatype, "shape": shape });
        let values = values(name, result);
        if *is_binary {
            any = true;
            let before = binary.len();
            append(&mut binary, &values);
            output["parameters"] = json!({ "binary_data_size": binary.len() - before });
        } else {
            output["data"] = match values {
                Values::Numbers(values) => json!(values),
                Values::Texts(values) => json!(values),
            };
        }
        outputs.push(output);
    }
    let mut answer = json!({ "model_name": MODEL, "model_version": VERSION, "outputs": outputs });
    if let Some(id) = &form.id {
        answer["id"] = json!(id);
    }
    let mut body = answer.to_string().into_bytes();
    let length = body.len();
    body.append(&mut binary);
    (body, any.then_some(length))
}

fn append(bytes: &mut Vec<u8>, values: &Values) {
    match values {
        Values::Numbers(values) => {
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        Values::Texts(values) => {
            for text in values {
                bytes.extend((text.len() as u32).to_le_bytes());
                bytes.extend(text.as_bytes());
            }
        }
    }
}

fn values(name: &str, result: &ImageResult) -> Values {
    let posed = || result.vehicles.iter().filter_map(|v| Some((v, v.pose.as_ref()?)));
    Values::Numbers(match name {
        "boxes" => posed().flat_map(|(vehicle, _)| vehicle.bounds).collect(),
        "scores" => posed().map(|(vehicle, _)| vehicle.score).collect(),
        "translations" => posed().flat_map(|(_, pose)| pose.translation).collect(),
        "rotations" => posed().flat_map(|(_, pose)| pose.rotation.concat()).collect(),
        "extents" => posed()
            .flat_map(|(_, pose)| [pose.extent.width, pose.extent.height, pose.extent.length])
            .collect(),
        // A fit of centres says nothing of itself.
        "confidences" => posed()
            .map(|(_, pose)| pose.dense.as_ref().map_or(0.5, |dense| dense.confidence))
            .collect(),
        "models" => {
            return Values::Texts(posed().map(|(_, pose)| pose.model.clone()).collect());
        }
        _ => return Values::Texts(vec![json!(result).to_string()]),
    })
}
