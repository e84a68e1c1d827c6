//! The plain endpoint: an image and perhaps a camera in, the JSON of `partpose run` out.
//!
//! The image is the body itself, the camera in the query; or both are in a JSON object, the image in base64.

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use hyper::StatusCode;
use hyper::body::Bytes;
use serde::Deserialize;

use super::workers::{Picture, Question, Refusal};

/// What images without a name are called.
const UNNAMED: &str = "image";
/// Base64 with padding or without.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Body {
    image: String,
    name: Option<String>,
    camera: Option<CameraBody>,
    min_score: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraBody {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

/// The question of a request, by its query, the type of its content and its body.
pub(super) fn question(
    query: &str,
    content_type: Option<&str>,
    body: Bytes,
) -> Result<Question, Refusal> {
    let mut question = of_query(query)?;
    let kind = content_type.unwrap_or("application/octet-stream");
    let kind = kind.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    match kind.as_str() {
        "application/json" => {
            let body: Body = serde_json::from_slice(&body).map_err(|error| {
                Refusal::bad(format!("the body is not as it should be: {error}"))
            })?;
            let bytes = BASE64
                .decode(&body.image)
                .map_err(|error| Refusal::bad(format!("`image` is not base64: {error}")))?;
            question.picture = Picture::File(bytes.into());
            question.name = body.name.unwrap_or(question.name);
            question.min_score = body.min_score.or(question.min_score);
            if let Some(CameraBody { fx, fy, cx, cy }) = body.camera {
                question.camera = Some([fx, fy, cx, cy]);
            }
        }
        // What `curl --data-binary` says unless told otherwise.
        "application/octet-stream" | "application/x-www-form-urlencoded" => {
            question.picture = Picture::File(body);
        }
        kind if kind.starts_with("image/") => question.picture = Picture::File(body),
        kind => {
            let reason = format!(
                "`{kind}` is not understood: send the bytes of a PNG or JPEG file as they are, or JSON with `image` in base64"
            );
            return Err(Refusal::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, reason));
        }
    }
    check_score(question.min_score)?;
    Ok(question)
}

/// Refuses what is no score.
pub(super) fn check_score(min_score: Option<f64>) -> Result<(), Refusal> {
    match min_score {
        Some(score) if !(0.0..=1.0).contains(&score) => {
            Err(Refusal::bad(format!("`min_score` is {score}, but must be 0 to 1")))
        }
        _ => Ok(()),
    }
}

fn of_query(query: &str) -> Result<Question, Refusal> {
    let mut camera: [Option<f64>; 4] = [None; 4];
    let mut question = Question {
        name: UNNAMED.to_owned(),
        picture: Picture::File(Bytes::new()),
        camera: None,
        min_score: None,
    };
    for pair in query.split('&').filter(|pair| !pair.is_empty()) {
        let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
        let number = || {
            value
                .parse::<f64>()
                .map_err(|_| Refusal::bad(format!("`{key}` of the query is no number")))
        };
        match key {
            "fx" => camera[0] = Some(number()?),
            "fy" => camera[1] = Some(number()?),
            "cx" => camera[2] = Some(number()?),
            "cy" => camera[3] = Some(number()?),
            "min_score" => question.min_score = Some(number()?),
            "name" => value.clone_into(&mut question.name),
            _ => {
                let known = "`fx`, `fy`, `cx`, `cy`, `min_score` and `name`";
                return Err(Refusal::bad(format!("the query knows {known}, not `{key}`")));
            }
        }
    }
    question.camera = match camera {
        [Some(fx), Some(fy), Some(cx), Some(cy)] => Some([fx, fy, cx, cy]),
        [None, None, None, None] => None,
        _ => return Err(Refusal::bad("a camera has all of `fx`, `fy`, `cx` and `cy`")),
    };
    Ok(question)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(query: &str, kind: Option<&str>, body: &str) -> Result<Question, Refusal> {
        question(query, kind, Bytes::from(body.to_owned()))
    }

    #[test]
    fn image_and_camera_come_as_body_and_query_or_as_json() {
        let query = "fx=1&fy=2&cx=3&cy=4&min_score=0.25&name=a.png";
        let plain = ask(query, Some("image/png"), "xyz").unwrap();
        let json = r#"{"image": "eHl6", "name": "a.png", "min_score": 0.25,
                       "camera": {"fx": 1, "fy": 2, "cx": 3, "cy": 4}}"#;
        let json = ask("", Some("application/json; charset=utf-8"), json).unwrap();
        for question in [plain, json] {
            assert_eq!(question.camera, Some([1.0, 2.0, 3.0, 4.0]));
            assert_eq!((question.name.as_str(), question.min_score), ("a.png", Some(0.25)));
            assert!(matches!(question.picture, Picture::File(bytes) if &bytes[..] == b"xyz"));
        }
        assert!(ask("", None, "xyz").unwrap().camera.is_none());
    }

    #[test]
    fn what_is_not_understood_is_said() {
        let json = Some("application/json");
        for (query, kind, body, status, word) in [
            ("fx=1", None, "", 400, "all of"),
            ("fx=a", None, "", 400, "no number"),
            ("focal=1", None, "", 400, "`focal`"),
            ("min_score=2", None, "", 400, "0 to 1"),
            ("min_score=nan", None, "", 400, "0 to 1"),
            ("", json, "{", 400, "body"),
            ("", json, r#"{"image": "%"}"#, 400, "base64"),
            ("", json, r#"{"picture": ""}"#, 400, "picture"),
            ("", Some("text/html"), "", 415, "text/html"),
            ("", Some("multipart/form-data; boundary=x"), "", 415, "multipart"),
        ] {
            let refusal = ask(query, kind, body).unwrap_err();
            assert_eq!(refusal.status.as_u16(), status, "{query} {body}");
            assert!(refusal.reason.contains(word), "{}", refusal.reason);
        }
    }
}
