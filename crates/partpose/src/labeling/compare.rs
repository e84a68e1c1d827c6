//! Labels beside reference masks in the author's folder layout, `<world>/<variation>/%05d.png`.

use std::path::{Path, PathBuf};

use crate::dataset::{Frame, SequenceId};
use crate::files::{RgbImage, read_gray16, read_indices};
use crate::geometry::Camera;
use crate::parts::{PartClass, PartMask};

use super::store::{instances_file, parts_file};
use super::{Agreement, LabelError, LabelStore, Tally};

/// Colours of the difference: same part, other part, vehicle in the reference alone, vehicle in the labels alone.
const SAME: [u8; 3] = [60, 90, 60];
const OTHER: [u8; 3] = [230, 40, 40];
const MISSED: [u8; 3] = [60, 120, 255];
const SURPLUS: [u8; 3] = [255, 220, 40];

/// A frame's score, to find those worth looking at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compared {
    /// The frame's sequence.
    pub sequence: SequenceId,
    /// The frame's index.
    pub index: u32,
    /// Pixels that both masks give to a vehicle.
    pub inside: Tally,
    /// Pixels that only one of them gives to a vehicle.
    pub outline: u64,
}

/// The file with the reference of a frame.
pub(super) fn reference_file(root: &Path, sequence: &SequenceId, index: u32) -> PathBuf {
    root.join(&sequence.world).join(&sequence.variation).join(format!("{index:05}.png"))
}

/// Compares a frame's labels with its reference; `None` where there is none.
pub(super) fn compare(
    reference: &Path,
    frame: &Frame,
    parts: &[u8],
    instances: &[u16],
) -> Result<Option<Agreement>, LabelError> {
    let path = reference_file(reference, &frame.sequence, frame.index);
    if !path.is_file() {
        return Ok(None);
    }
    let truth = read_reference(path, &frame.sequence, frame.index, &frame.camera)?;
    Ok(Some(Agreement::of_frame(frame, parts, instances, &truth.labels)))
}

/// The same with the labels of an earlier run.
pub(super) fn compare_written(
    reference: &Path,
    frame: &Frame,
    store: &LabelStore,
) -> Result<Option<Agreement>, LabelError> {
    let [parts, instances] = [parts_file(frame), instances_file(frame)].map(|p| store.path(&p));
    let (parts, instances) = (read_indices(&parts)?, read_gray16(&instances)?);
    compare(reference, frame, &parts.values, &instances.values)
}

fn read_reference(
    path: PathBuf,
    sequence: &SequenceId,
    index: u32,
    camera: &Camera,
) -> Result<PartMask, LabelError> {
    let mut frame = Frame::new(sequence.clone(), index, *camera);
    frame.parts = Some(path);
    Ok(frame.read_parts()?)
}

/// Labels, reference and difference, one above the other.
///
/// In the difference same parts are dark green, other parts red, vehicle pixels that the labels lack blue, and
/// those that the reference lacks yellow.
pub fn comparison_picture(
    store: &LabelStore,
    reference: &Path,
    sequence: &SequenceId,
    index: u32,
) -> Result<RgbImage, LabelError> {
    let camera = |size| Camera::pinhole(1.0, [0.0; 2], size);
    let mut frame = Frame::new(sequence.clone(), index, camera([0; 2]));
    let labels = read_indices(&store.path(&parts_file(&frame)))?;
    frame.camera.size = labels.size;
    let truth =
        read_reference(reference_file(reference, sequence, index), sequence, index, &frame.camera)?;
    let color = |label: &u8| PartClass::from_id(*label).map_or([0; 3], PartClass::color);
    let difference =
        labels.values.iter().zip(&truth.labels).map(|(label, truth)| match (*label, *truth) {
            (0, 0) => [0; 3],
            (label, truth) if label == truth => SAME,
            (0, _) => MISSED,
            (_, 0) => SURPLUS,
            _ => OTHER,
        });
    let rows = labels.values.iter().map(color).chain(truth.labels.iter().map(color));
    let pixels = rows.chain(difference).flatten().collect();
    Ok(RgbImage { size: [labels.size[0], 3 * labels.size[1]], pixels })
}
