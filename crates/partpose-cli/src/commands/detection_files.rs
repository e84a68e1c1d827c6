//! Detections on disk: one file or a folder of them, and which of them belong to a frame of a data set.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use anyhow::Context;
use partpose::dataset::Frame;
use partpose::detection::Detection;
use partpose::eval::files_with_ending;
use partpose::formats::{DetectionFile, DetectionFileError, read_detections};

use crate::network::hash;
use crate::report::hint;

/// What files of detections end in.
pub(crate) const ENDING: &str = "safetensors";

/// The detections of a file, or of all files of a folder as if they were one.
pub(crate) fn read(path: &Path) -> anyhow::Result<DetectionFile> {
    if !path.is_dir() {
        return read_one(path);
    }
    let paths = files_with_ending(path, ENDING)?;
    if paths.is_empty() {
        return Err(hint(
            anyhow::anyhow!("the folder `{}` holds no `*.{ENDING}`", path.display()),
            "`partpose run` writes detections into the folder `detections` of its output",
        ));
    }
    let mut all = DetectionFile { images: Vec::new(), detections: Vec::new() };
    for path in paths {
        let file = read_one(&path)?;
        let first = all.images.len();
        all.images.extend(file.images);
        all.detections.extend(file.detections.into_iter().map(|(i, found)| (first + i, found)));
    }
    Ok(all)
}

fn read_one(path: &Path) -> anyhow::Result<DetectionFile> {
    read_detections(path).map_err(|error| match error {
        DetectionFileError::File(_) => anyhow::Error::from(error),
        error => hint(
            error,
            "docs/formats.md, \"Detections\", lists the tensors, their shapes and types",
        ),
    })
}

/// Images by their names, to be found by the frames that they are of.
pub(crate) struct ImageIndex {
    names: Vec<String>,
    /// By the last part of the images' names, without the ending.
    by_stem: BTreeMap<String, Vec<usize>>,
}

impl ImageIndex {
    pub(crate) fn new(names: Vec<String>) -> Self {
        let mut by_stem: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, name) in names.iter().enumerate() {
            let stem = parts_of(Path::new(name)).pop().unwrap_or_default();
            by_stem.entry(stem).or_default().push(index);
        }
        Self { names, by_stem }
    }

    /// The image of a frame; `None` if no image is called like it.
    ///
    /// The name of an image and the path of the frame's, both from their ends and without endings, must agree as far
    /// as the shorter reaches: `00012.png`, `0001/clone/00012` and `vkitti_1.3.1_rgb/0001/clone/00012.png` all name
    /// frame 12 of world 0001, as long as no other image is meant by as much.
    pub(crate) fn of_frame(&self, frame: &Frame) -> anyhow::Result<Option<usize>> {
        let mut best: (usize, Vec<usize>) = (0, Vec::new());
        for name in &names_of(frame) {
            let Some(stem) = name.last() else { continue };
            for index in self.by_stem.get(stem).into_iter().flatten() {
                let image = parts_of(Path::new(&self.names[*index]));
                let shared = image.iter().rev().zip(name.iter().rev());
                let same = shared.take_while(|(a, b)| a == b).count();
                if same < image.len().min(name.len()) || same < best.0 {
                    continue;
                }
                if same > best.0 {
                    best = (same, Vec::new());
                }
                if !best.1.contains(index) {
                    best.1.push(*index);
                }
            }
        }
        match best.1.as_slice() {
            [] => Ok(None),
            [index] => Ok(Some(*index)),
            [a, b, ..] => Err(hint(
                anyhow::anyhow!(
                    "frame {} may be the image `{}` or `{}`",
                    frame.name(),
                    self.names[*a],
                    self.names[*b]
                ),
                "name images with the folders of their world and variation, such as `0001/clone/00012.png`",
            )),
        }
    }
}

/// Detections by the image that they were made of.
pub(crate) struct DetectionIndex {
    detections: Vec<Vec<Detection>>,
    images: ImageIndex,
}

impl DetectionIndex {
    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        let file = read(path)?;
        let mut detections = vec![Vec::new(); file.images.len()];
        for (image, detection) in file.detections {
            detections[image].push(detection);
        }
        Ok(Self { detections, images: ImageIndex::new(file.images) })
    }

    /// The name of the first image, for messages.
    pub(crate) fn first_name(&self) -> &str {
        self.images.names.first().map_or("", String::as_str)
    }

    /// Cells a side of the kernels, where there is a detection.
    pub(crate) fn kernel(&self) -> Option<usize> {
        let first = self.detections.iter().flatten().next();
        first.map(|detection| detection.probabilities.size())
    }

    /// A hash of all that is in it.
    pub(crate) fn identity(&self) -> String {
        let mut hashes: Vec<u8> = Vec::new();
        for (name, detections) in self.images.names.iter().zip(&self.detections) {
            hashes.extend(hash(name.as_bytes()).to_le_bytes());
            for found in detections {
                let Detection { bounds, score, probabilities, unknown, size, models } = found;
                let values = probabilities.values().iter();
                let values: Vec<u8> = values.flat_map(|value| value.to_le_bytes()).collect();
                let rest = format!("{bounds:?} {score} {unknown:?} {size:?} {models:?}");
                hashes.extend(hash(&values).to_le_bytes());
                hashes.extend(hash(rest.as_bytes()).to_le_bytes());
            }
        }
        format!("{:016x}", hash(&hashes))
    }

    /// The detections of a frame, found as [`ImageIndex::of_frame`] finds it.
    pub(crate) fn of_frame(&self, frame: &Frame) -> anyhow::Result<Option<&[Detection]>> {
        Ok(self.images.of_frame(frame)?.map(|index| self.detections[index].as_slice()))
    }
}

/// What a frame may be called: by its place in the sequence, and by the path of its image.
fn names_of(frame: &Frame) -> Vec<Vec<String>> {
    let mut names = vec![parts_of(Path::new(&frame.name()))];
    names.extend(frame.image.as_deref().map(parts_of));
    names
}

/// The parts of a path without the ending of a picture.
fn parts_of(path: &Path) -> Vec<String> {
    let is_image = path.extension().is_some_and(|ending| {
        ["png", "jpg", "jpeg"].iter().any(|known| ending.eq_ignore_ascii_case(known))
    });
    let path = if is_image { path.with_extension("") } else { path.to_owned() };
    let normal = path.components().filter_map(|component| match component {
        Component::Normal(part) => Some(part.to_string_lossy().into_owned()),
        _ => None,
    });
    normal.collect()
}

/// The name of a source of detections in tables: that of its file or folder.
pub(crate) fn title(path: &Path) -> String {
    let absolute: PathBuf = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let stem = if absolute.is_dir() { absolute.file_name() } else { absolute.file_stem() };
    let name = |stem: &std::ffi::OsStr| stem.to_string_lossy().into_owned();
    match (stem.map(name), absolute.parent().and_then(Path::file_name).map(name)) {
        // What `run` writes is told apart by the folder above.
        (Some(stem), Some(parent)) if stem == "detections" => parent,
        (Some(stem), _) => stem,
        (None, _) => "detections".to_owned(),
    }
}

/// Reads an index and says of which file it is if it cannot.
pub(crate) fn index(path: &Path) -> anyhow::Result<DetectionIndex> {
    DetectionIndex::read(path).with_context(|| format!("no detections from `{}`", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use partpose::dataset::SequenceId;
    use partpose::formats::write_detections;
    use partpose::geometry::{Camera, Rect};
    use partpose::parts::{CHANNELS, PartProbabilities};

    fn frame(world: &str, variation: &str, index: u32) -> Frame {
        let id = SequenceId { world: world.to_owned(), variation: variation.to_owned() };
        let mut frame = Frame::new(id, index, Camera::pinhole(700.0, [10.0, 10.0], [20, 20]));
        let path = format!("/data/vkitti_1.3.1_rgb/{world}/{variation}/{index:05}.png");
        frame.image = Some(PathBuf::from(path));
        frame
    }

    /// One detection an image, told apart by its score.
    fn file(images: &[&str]) -> DetectionFile {
        let mut values = vec![0.0; CHANNELS];
        values[0] = 1.0;
        let found = |score: usize| {
            let probabilities = PartProbabilities::new(1, values.clone()).unwrap();
            Detection::new(Rect::new(0.0, 0.0, 5.0, 5.0), score as f64 / 16.0, probabilities)
        };
        DetectionFile {
            images: images.iter().map(|name| (*name).to_owned()).collect(),
            detections: (0..images.len()).map(|index| (index, found(index))).collect(),
        }
    }

    fn index_of(images: &[&str]) -> DetectionIndex {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.safetensors");
        write_detections(&path, &file(images)).unwrap();
        DetectionIndex::read(&path).unwrap()
    }

    fn found(index: &DetectionIndex, frame: &Frame) -> Option<usize> {
        let detections = index.of_frame(frame).unwrap()?;
        Some((detections[0].score * 16.0) as usize)
    }

    #[test]
    fn frames_are_found_by_what_their_images_are_called() {
        let frame = frame("0001", "fog", 12);
        for name in
            ["00012.png", "fog/00012", "0001/fog/00012.jpg", "vkitti_1.3.1_rgb/0001/fog/00012.png"]
        {
            assert_eq!(found(&index_of(&["other/a.png", name]), &frame), Some(1), "{name}");
        }
        for name in ["00013.png", "0002/fog/00012.png", "clone/00012.png", "scene-1.png"] {
            assert_eq!(found(&index_of(&[name]), &frame), None, "{name}");
        }
    }

    #[test]
    fn longer_name_wins_and_equals_are_refused() {
        let fog = frame("0001", "fog", 3);
        assert_eq!(found(&index_of(&["00003.png", "0001/fog/00003.png"]), &fog), Some(1));
        let clash = index_of(&["fog/00003.png", "fog/00003.jpg"]);
        assert!(clash.of_frame(&fog).is_err());
    }

    #[test]
    fn identity_is_that_of_the_content() {
        let identity = |images: &[&str]| index_of(images).identity();
        assert_eq!(identity(&["a.png", "b.png"]), identity(&["a.png", "b.png"]));
        assert_ne!(identity(&["a.png", "b.png"]), identity(&["a.png", "c.png"]));
        let mut other = index_of(&["a.png", "b.png"]);
        other.detections[1][0].score = 0.5;
        assert_ne!(other.identity(), identity(&["a.png", "b.png"]));
    }

    #[test]
    fn folder_of_files_is_one_source() {
        let folder = tempfile::tempdir().unwrap();
        for (name, images) in [("a", vec!["x.png", "y.png"]), ("b", vec!["z.png"])] {
            let path = folder.path().join(name).with_extension(ENDING);
            write_detections(&path, &file(&images)).unwrap();
        }
        let all = read(folder.path()).unwrap();
        assert_eq!(all.images, ["x.png", "y.png", "z.png"]);
        let images: Vec<usize> = all.detections.iter().map(|(image, _)| *image).collect();
        assert_eq!(images, [0, 1, 2]);
        assert!(read(tempfile::tempdir().unwrap().path()).is_err());
    }
}
