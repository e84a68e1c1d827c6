//! Folders of `ApolloCar3D` JSON, one list of cars an image, and the table of similarities.

use std::path::Path;

use serde::Deserialize;

use crate::eval::input::{InputError, files_with_ending, number};
use crate::files;

use super::{A3dpCar, A3dpImage, Similarity};

/// Largest magnitude of an angle or a coordinate.
const ABSURD: f64 = 1e6;
/// Most models that similarities are read for.
const MAX_MODELS: usize = 10_000;

/// All images of a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct A3dpFiles {
    /// In the order of their names.
    pub images: Vec<A3dpImage>,
    /// Result files without a truth, which are not read.
    pub without_labels: usize,
}

#[derive(Deserialize)]
struct Car {
    #[serde(rename = "car_id")]
    model: usize,
    pose: [f64; 6],
    area: f64,
    score: Option<f64>,
}

/// Reads the truths of a folder and, for each image, the results of the same name.
pub fn read_a3dp(
    labels: &Path,
    results: &Path,
    similarity: &Similarity,
) -> Result<A3dpFiles, InputError> {
    let label_files = files_with_ending(labels, "json")?;
    let result_files = files_with_ending(results, "json")?;
    if label_files.is_empty() {
        return Err(InputError::content(labels, "holds no file `*.json`"));
    }
    let mut found = A3dpFiles::default();
    for path in &label_files {
        let result = results.join(path.file_name().unwrap_or_default());
        if !result.is_file() {
            let reason = "is missing: an image without results has the file `[]`";
            return Err(InputError::content(&result, reason));
        }
        found.images.push(A3dpImage {
            truths: parse_a3dp(path, &files::read(path)?, false, similarity.models())?,
            results: parse_a3dp(&result, &files::read(&result)?, true, similarity.models())?,
        });
    }
    found.without_labels = result_files.len().saturating_sub(found.images.len());
    Ok(found)
}

/// Reads the cars of one file; `scored` says that each has a score.
///
/// `path` is for messages only; `models` is the number of models that there are.
pub fn parse_a3dp(
    path: &Path,
    bytes: &[u8],
    scored: bool,
    models: usize,
) -> Result<Vec<A3dpCar>, InputError> {
    let cars: Vec<Car> = serde_json::from_slice(bytes)
        .map_err(|source| InputError::Json { path: path.to_owned(), source })?;
    let check = |(index, car): (usize, Car)| {
        let wrong = |reason: String| InputError::entry(path, format!("car {index}"), reason);
        if car.model >= models {
            let id = car.model;
            return Err(wrong(format!("has the `car_id` {id}, but there are {models} models")));
        }
        if car.pose.iter().any(|value| value.abs() > ABSURD) {
            return Err(wrong(format!("has the pose {:?}", car.pose)));
        }
        if scored && car.score.is_none() {
            return Err(wrong("has no `score`".to_owned()));
        }
        let [roll, pitch, yaw, x, y, z] = car.pose;
        Ok(A3dpCar {
            model: car.model,
            rotation: [roll, pitch, yaw],
            translation: [x, y, z],
            area: car.area,
            score: car.score.unwrap_or(0.0),
        })
    };
    cars.into_iter().enumerate().map(check).collect()
}

/// Reads a square table of numbers; `path` is for messages only.
pub fn parse_similarity(path: &Path, text: &str) -> Result<Similarity, InputError> {
    let mut values = Vec::new();
    let mut models = 0;
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let before = values.len();
        for field in line.split_ascii_whitespace() {
            let value =
                number(field, 1e3).map_err(|reason| InputError::line(path, i + 1, reason))?;
            values.push(value);
        }
        models += 1;
        let width = values.len() - before;
        if models > MAX_MODELS || width > MAX_MODELS {
            return Err(InputError::content(path, format!("has more than {MAX_MODELS} models")));
        }
        if width * models != values.len() {
            let reason = format!("{width} numbers, but the lines before have another count");
            return Err(InputError::line(path, i + 1, reason));
        }
    }
    let reason = format!("is not a square table: {models} lines with {} numbers", values.len());
    Similarity::new(models, values).ok_or_else(|| InputError::content(path, reason))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const CARS: &str =
        r#"[{"area": 9, "car_id": 1, "pose": [0.1, 0, 3, 1, 2, 9], "score": 0.5, "x": 1}]"#;

    fn parse(text: &str) -> Result<Vec<A3dpCar>, String> {
        parse_a3dp(Path::new("a.json"), text.as_bytes(), true, 2).map_err(|e| e.to_string())
    }

    #[test]
    fn cars_are_read_and_bad_ones_named() {
        assert_eq!(parse(CARS).unwrap()[0].translation.to_vec(), [1.0, 2.0, 9.0]);
        assert_eq!(
            parse(&CARS.replace("\"car_id\": 1", "\"car_id\": 2")).unwrap_err(),
            "`a.json`: car 0 has the `car_id` 2, but there are 2 models"
        );
        let said = parse(&CARS.replace("score", "certainty")).unwrap_err();
        assert_eq!(said, "`a.json`: car 0 has no `score`");
        assert!(parse("{").is_err());
    }

    #[test]
    fn a_table_that_is_not_square_is_refused() {
        let parse = |text: &str| parse_similarity(Path::new("s.txt"), text);
        assert_eq!(parse("1 0.5\n0.5 1\n").unwrap().models(), 2);
        for bad in ["", "1 0.5\n", "1 2\n3\n", "1 x\n1 1\n"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn damaged_json_is_read_or_refused(at in 0usize..80, byte in any::<u8>(), cut in 0usize..90) {
            let mut bytes = CARS.as_bytes().to_vec();
            let count = bytes.len();
            bytes[at % count] = byte;
            bytes.truncate(cut);
            let _ = parse_a3dp(Path::new("a.json"), &bytes, true, 2);
        }
    }
}
