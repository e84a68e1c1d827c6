//! A BOP test set and a file of estimates.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Matrix4, Unit};
use serde::Deserialize;

use crate::eval::input::{InputError, number, read_json, shown};
use crate::files::{self, FileError};
use crate::geometry::Vector3;

use super::{
    BopEstimate, BopImage, BopObject, BopPose, BopSet, BopTruth, ContinuousSymmetry,
    parse_ply_vertices, symmetries,
};

/// Largest magnitude of a length in millimetres.
const ABSURD: f64 = 1e9;
/// How far a matrix may be from a rotation; files round to few digits.
const ROTATION_TOLERANCE: f64 = 0.01;
/// Most symmetries of one object; each multiplies the work.
const MAX_SYMMETRIES: usize = 1000;
/// An instance that is less visible is no target, where there is no list of targets.
const LEAST_VISIBLE: f64 = 0.1;

/// Where a test set lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BopFolders {
    /// Holds a folder `NNNNNN` a scene, or is such a folder itself.
    pub scenes: PathBuf,
    /// Holds `models_info.json` and `obj_NNNNNN.ply`.
    pub models: PathBuf,
    /// `test_targets_bop19.json`; without it all instances are targets that are visible by a tenth.
    pub targets: Option<PathBuf>,
}

#[derive(Deserialize)]
struct TruthRecord {
    obj_id: u32,
    #[serde(rename = "cam_R_m2c")]
    rotation: [f64; 9],
    #[serde(rename = "cam_t_m2c")]
    translation: [f64; 3],
}

#[derive(Deserialize)]
struct InfoRecord {
    visib_fract: f64,
}

#[derive(Deserialize)]
struct CameraRecord {
    #[serde(rename = "cam_K")]
    matrix: [f64; 9],
}

#[derive(Deserialize)]
struct ModelRecord {
    diameter: f64,
    #[serde(default)]
    symmetries_discrete: Vec<[f64; 16]>,
    #[serde(default)]
    symmetries_continuous: Vec<AxisRecord>,
}

#[derive(Deserialize)]
struct AxisRecord {
    axis: [f64; 3],
    offset: [f64; 3],
}

#[derive(Deserialize)]
struct TargetRecord {
    scene_id: u32,
    im_id: u32,
    obj_id: u32,
    inst_count: usize,
}

/// Reads the scenes, the models of the objects in them, and the targets.
///
/// `image_width` is that of the images in pixels.
pub fn read_bop(folders: &BopFolders, image_width: f64) -> Result<BopSet, InputError> {
    let mut images = Vec::new();
    for (id, folder) in scenes(&folders.scenes)? {
        images.extend(scene(id, &folder)?);
    }
    if let Some(path) = &folders.targets {
        set_targets(&mut images, path)?;
    }
    let wanted: BTreeSet<u32> =
        images.iter().flat_map(|image| image.targets.keys().copied()).collect();
    let mut objects = BTreeMap::new();
    let path = folders.models.join("models_info.json");
    let mut records: BTreeMap<u32, ModelRecord> = read_json(&path)?;
    for id in wanted {
        let record = records.remove(&id);
        let record =
            record.ok_or_else(|| InputError::content(&path, format!("has no object {id}")))?;
        objects.insert(id, object(&folders.models, (&path, id), &record)?);
    }
    Ok(BopSet { objects, images, image_width })
}

/// The scene folders below a folder, by id.
fn scenes(folder: &Path) -> Result<Vec<(u32, PathBuf)>, InputError> {
    let id = |path: &Path| path.file_name()?.to_str()?.parse::<u32>().ok();
    if folder.join("scene_gt.json").is_file() {
        let named = fs::canonicalize(folder).map_err(|source| FileError::read(folder, source))?;
        return Ok(vec![(id(&named).unwrap_or(0), folder.to_owned())]);
    }
    let failed = |source| FileError::read(folder, source);
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if let Some(id) = id(&path).filter(|_| path.join("scene_gt.json").is_file()) {
            found.push((id, path));
        }
    }
    found.sort();
    if found.is_empty() {
        let reason = "holds no scene: neither `scene_gt.json` nor a folder `NNNNNN` with one";
        return Err(InputError::content(folder, reason));
    }
    Ok(found)
}

fn scene(id: u32, folder: &Path) -> Result<Vec<BopImage>, InputError> {
    let gt_path = folder.join("scene_gt.json");
    let truths: BTreeMap<u32, Vec<TruthRecord>> = read_json(&gt_path)?;
    let camera_path = folder.join("scene_camera.json");
    let cameras: BTreeMap<u32, CameraRecord> = read_json(&camera_path)?;
    let info_path = folder.join("scene_gt_info.json");
    let info: Option<BTreeMap<u32, Vec<InfoRecord>>> =
        if info_path.is_file() { Some(read_json(&info_path)?) } else { None };
    let mut images = Vec::new();
    for (image, records) in truths {
        let camera = cameras.get(&image);
        let camera = camera
            .ok_or_else(|| InputError::content(&camera_path, format!("has no image {image}")))?;
        let visible = info.as_ref().and_then(|info| info.get(&image));
        let mut found = Vec::with_capacity(records.len());
        let mut targets = BTreeMap::new();
        for (at, record) in records.iter().enumerate() {
            let pose = pose(&record.rotation, &record.translation).map_err(|reason| {
                InputError::entry(&gt_path, format!("image {image}, object {at}"), reason)
            })?;
            let visible = visible.and_then(|info| info.get(at)).map(|info| info.visib_fract);
            found.push(BopTruth { object: record.obj_id, pose, visible });
            if visible.is_none_or(|visible| visible >= LEAST_VISIBLE) {
                *targets.entry(record.obj_id).or_default() += 1;
            }
        }
        let camera = Matrix3::from_row_slice(&camera.matrix);
        images.push(BopImage { scene: id, image, camera, truths: found, targets });
    }
    Ok(images)
}

/// Replaces the targets of all images by those of a list.
fn set_targets(images: &mut [BopImage], path: &Path) -> Result<(), InputError> {
    let records: Vec<TargetRecord> = read_json(path)?;
    for image in images.iter_mut() {
        image.targets.clear();
    }
    let index: BTreeMap<(u32, u32), usize> =
        images.iter().enumerate().map(|(i, image)| ((image.scene, image.image), i)).collect();
    for record in records {
        // The list may name scenes that are not in the folder.
        if let Some(image) = index.get(&(record.scene_id, record.im_id)) {
            images[*image].targets.insert(record.obj_id, record.inst_count);
        }
    }
    if images.iter().all(|image| image.targets.is_empty()) {
        return Err(InputError::content(path, "names no image of the scenes"));
    }
    Ok(())
}

fn object(
    models: &Path,
    (info, id): (&Path, u32),
    record: &ModelRecord,
) -> Result<BopObject, InputError> {
    let wrong = |reason: String| InputError::entry(info, format!("object {id}"), reason);
    if !(record.diameter > 0.0 && record.diameter <= ABSURD) {
        return Err(wrong(format!("has the diameter {}", record.diameter)));
    }
    if record.symmetries_discrete.len() > MAX_SYMMETRIES || record.symmetries_continuous.len() > 3 {
        return Err(wrong(format!("has more symmetries than {MAX_SYMMETRIES} poses and 3 axes")));
    }
    let discrete: Vec<Matrix4<f64>> =
        record.symmetries_discrete.iter().map(|values| Matrix4::from_row_slice(values)).collect();
    let mut continuous = Vec::new();
    for axis in &record.symmetries_continuous {
        let direction = Unit::try_new(Vector3::from(axis.axis), 1e-9);
        let axis = direction
            .map(|direction| ContinuousSymmetry { axis: direction, offset: axis.offset.into() });
        continuous.push(axis.ok_or_else(|| wrong("has an axis without direction".to_owned()))?);
    }
    let path = models.join(format!("obj_{id:06}.ply"));
    let points = parse_ply_vertices(&path, &files::read(&path)?)?;
    let symmetries = symmetries(&discrete, &continuous);
    Ok(BopObject { diameter: record.diameter, points, symmetries })
}

fn pose(rotation: &[f64; 9], translation: &[f64; 3]) -> Result<BopPose, String> {
    let rotation = Matrix3::from_row_slice(rotation);
    let miss = (rotation * rotation.transpose() - Matrix3::identity()).abs().max();
    if !(miss <= ROTATION_TOLERANCE) || rotation.determinant() < 0.0 {
        return Err("has a matrix that is not a rotation".to_owned());
    }
    if translation.iter().any(|value| !(value.abs() <= ABSURD)) {
        return Err(format!("has the translation {translation:?}"));
    }
    Ok(BopPose { rotation, translation: Vector3::from(*translation) })
}

/// Reads estimates, `scene_id,im_id,obj_id,score,R,t,time` a line, with or without that header.
///
/// `path` is for messages only.
pub fn parse_estimates(path: &Path, text: &str) -> Result<Vec<BopEstimate>, InputError> {
    let mut estimates = Vec::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        if i == 0 && line.contains("scene_id,im_id,obj_id,score,R,t,time") {
            continue;
        }
        let read = estimate(line).map_err(|reason| InputError::line(path, i + 1, reason));
        estimates.push(read?);
    }
    Ok(estimates)
}

fn estimate(line: &str) -> Result<BopEstimate, String> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let [scene, image, object, score, rotation, translation, time] = fields.as_slice() else {
        return Err(format!("{} fields between commas, but 7 are needed", fields.len()));
    };
    let id =
        |text: &str| text.parse::<u32>().map_err(|_| format!("`{}` is not an id", shown(text)));
    let (rotation, translation) = (numbers::<9>(rotation)?, numbers::<3>(translation)?);
    Ok(BopEstimate {
        scene: id(scene)?,
        image: id(image)?,
        object: id(object)?,
        score: number(score, f64::MAX)?,
        pose: pose(&rotation, &translation).map_err(|reason| format!("the pose {reason}"))?,
        time: number(time, ABSURD)?,
    })
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values: Vec<f64> = text
        .split_ascii_whitespace()
        .map(|field| number(field, ABSURD))
        .collect::<Result<_, _>>()?;
    values
        .try_into()
        .map_err(|values: Vec<f64>| format!("{} numbers, but {N} are needed", values.len()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LINES: &str =
        "scene_id,im_id,obj_id,score,R,t,time\n1,2,3,0.5,1 0 0 0 1 0 0 0 1,1 2 900,-1\n";

    fn parse(text: &str) -> Result<Vec<BopEstimate>, String> {
        parse_estimates(Path::new("a.csv"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn lines_are_read_with_and_without_header() {
        let found = parse(LINES).unwrap();
        assert_eq!((found[0].image, found[0].pose.translation.z, found[0].time), (2, 900.0, -1.0));
        assert_eq!(parse(LINES.lines().nth(1).unwrap()).unwrap(), found);
        assert_eq!(parse("").unwrap(), []);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (from, to, said) in [
            ("1 0 0 0 1", "2 0 0 0 1", "line 2: the pose has a matrix that is not a rotation"),
            (" 900", "", "line 2: 2 numbers, but 3 are needed"),
            (",-1", "", "line 2: 6 fields between commas, but 7 are needed"),
            ("0.5", "nan", "line 2: `nan` is not a number of sensible size"),
            ("\n1,", "\n-1,", "line 2: `-1` is not an id"),
        ] {
            let message = parse(&LINES.replacen(from, to, 1)).unwrap_err();
            assert!(message.ends_with(said), "{message}");
        }
    }

    proptest! {
        #[test]
        fn damaged_lines_are_read_or_refused(at in 0usize..90, byte in any::<u8>(), cut in 0usize..95) {
            let mut bytes = LINES.as_bytes().to_vec();
            let at = at % bytes.len();
            bytes[at] = byte;
            bytes.truncate(cut);
            let _ = parse(&String::from_utf8_lossy(&bytes));
        }
    }
}
