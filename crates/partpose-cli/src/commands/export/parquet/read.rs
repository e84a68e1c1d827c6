//! The table read back: that of `export --to parquet`, or what others wrote with its columns.
//!
//! Rows become results and go through their reader, which refuses what makes no sense; so each thing is checked in one
//! place.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::RowGroupMetaData;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::record::{Field, Row};
use anyhow::{Context, bail};
use partpose::files;
use partpose::formats::{PosedImage, parse_result};
use serde_json::{Value, json};

use crate::report::hint;

/// Most bytes that a table may unpack to.
const MOST_BYTES: i64 = 2 << 30;
/// Most rows.
const MOST_ROWS: i64 = 10_000_000;

/// What a row needs; the other columns may be missing.
const NEEDED: [&str; 28] = [
    "image",
    "width_px",
    "height_px",
    "fx",
    "fy",
    "cx",
    "cy",
    "model",
    "score",
    "x_min",
    "y_min",
    "x_max",
    "y_max",
    "x",
    "y",
    "z",
    "r00",
    "r01",
    "r02",
    "r10",
    "r11",
    "r12",
    "r20",
    "r21",
    "r22",
    "width",
    "height",
    "length",
];

/// All images that have a row, in the order of their first.
pub(crate) fn read(path: &Path) -> anyhow::Result<Vec<PosedImage>> {
    let bytes = files::read(path)?;
    let what = || format!("`{}` cannot be read as Parquet", path.display());
    // The decoder is not ours, and it has not been made for files that somebody made to break it.
    let rows = catch_unwind(AssertUnwindSafe(|| rows(bytes)))
        .map_err(|_| anyhow::anyhow!("the file is damaged"))
        .and_then(|rows| rows)
        .with_context(what)?;
    let mut order: Vec<String> = Vec::new();
    let mut images: BTreeMap<String, (Value, Vec<Value>)> = BTreeMap::new();
    for (number, row) in rows.iter().enumerate() {
        let in_row = || format!("row {number} of `{}`", path.display());
        let (name, camera, vehicle) = result(row).with_context(in_row)?;
        let image = images.entry(name).or_insert_with_key(|name| {
            order.push(name.clone());
            (camera.clone(), Vec::new())
        });
        if image.0 != camera {
            bail!("{} has another camera than the rows of its image before", in_row());
        }
        image.1.push(vehicle);
    }
    let image = |name: String| {
        let (camera, vehicles) = images.remove(&name).context("an image is missing")?;
        let result = json!({"image": name, "camera": camera, "vehicles": vehicles});
        let at = path.join(&name);
        Ok(parse_result(&at, result.to_string().as_bytes(), &|_| "Car".to_owned())?)
    };
    order.into_iter().map(image).collect()
}

/// A row's values by name.
type Values = BTreeMap<String, Field>;

fn rows(bytes: Vec<u8>) -> anyhow::Result<Vec<Values>> {
    let file = SerializedFileReader::new(::bytes::Bytes::from(bytes))?;
    let metadata = file.metadata();
    let schema = metadata.file_metadata().schema();
    let has = |name: &&str| schema.get_fields().iter().any(|field| field.name() == *name);
    let missing: Vec<&str> = NEEDED.into_iter().filter(|name| !has(name)).collect();
    if !missing.is_empty() {
        return Err(hint(
            anyhow::anyhow!("it lacks the columns {}", missing.join(", ")),
            "`export --to parquet` writes such a table, docs/guide/7-deployment.md lists its columns",
        ));
    }
    let groups = metadata.row_groups();
    let sum = |of: fn(&RowGroupMetaData) -> i64| {
        groups.iter().map(of).fold(0i64, |sum, one| sum.saturating_add(one.max(0)))
    };
    if sum(RowGroupMetaData::total_byte_size) > MOST_BYTES
        || sum(RowGroupMetaData::num_rows) > MOST_ROWS
    {
        bail!("it unpacks to more than 2 GiB or ten million rows");
    }
    let values = |row: Result<Row, ParquetError>| -> anyhow::Result<Values> {
        Ok(row?.into_columns().into_iter().collect())
    };
    file.get_row_iter(None)?.map(values).collect()
}

/// Image, camera and vehicle of a row, in the form of results.
fn result(row: &Values) -> anyhow::Result<(String, Value, Value)> {
    let number = |name: &str| match row.get(name) {
        Some(Field::Double(value)) => Ok(json!(value)),
        Some(Field::Float(value)) => Ok(json!(value)),
        Some(Field::Int(value)) => Ok(json!(value)),
        Some(Field::Long(value)) => Ok(json!(value)),
        Some(Field::UInt(value)) => Ok(json!(value)),
        Some(Field::Null) | None => Ok(Value::Null),
        Some(other) => bail!("`{name}` is `{other}`, no number"),
    };
    let numbers =
        |names: &[&str]| names.iter().map(|name| number(name)).collect::<Result<Vec<_>, _>>();
    let text = |name: &str| match row.get(name) {
        Some(Field::Str(text)) => Ok(Some(text.clone())),
        Some(Field::Bytes(bytes)) => Ok(Some(std::str::from_utf8(bytes.data())?.to_owned())),
        Some(Field::Null) | None => Ok(None),
        Some(other) => bail!("`{name}` is `{other}`, no text"),
    };
    let name = text("image")?.context("`image` is missing")?;
    let camera = json!({
        "focal": numbers(&["fx", "fy"])?,
        "principal_point": numbers(&["cx", "cy"])?,
        "size": numbers(&["width_px", "height_px"])?,
    });
    let rotation = [["r00", "r01", "r02"], ["r10", "r11", "r12"], ["r20", "r21", "r22"]];
    let mut pose = json!({
        "model": text("model")?,
        "category": text("category")?,
        "translation": numbers(&["x", "y", "z"])?,
        "rotation": rotation.iter().map(|row| numbers(row)).collect::<Result<Vec<_>, _>>()?,
        "extent": {
            "width": number("width")?, "height": number("height")?, "length": number("length")?,
        },
    });
    // With `--tracked` the row is the track's pose; without it nothing else is known of that either.
    let track = number("track")?;
    let track = if track.is_null() {
        track
    } else {
        let mut of_track = pose.clone();
        of_track["id"] = track;
        of_track
    };
    pose["reprojection_rmse"] = number("reprojection_rmse")?;
    pose["dense"] = json!({"confidence": number("confidence")?});
    let vehicle = json!({
        "bounds": numbers(&["x_min", "y_min", "x_max", "y_max"])?,
        "score": number("score")?,
        "pose": pose,
        "track": track,
    });
    Ok((name, camera, vehicle))
}
