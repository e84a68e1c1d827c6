//! Part probabilities of boxes from whatever a model says of parts.

use partpose::geometry::Rect;
use partpose::oracle::detection_from_labels;
use partpose::parts::{BACKGROUND, CHANNELS, PartMask, PartProbabilities};

use crate::OnnxError;
use crate::mapping::{Meaning, PartValues};
use crate::tensor::Output;

/// The grid of a vehicle out of `[n, classes, m, m]`, in our channels.
pub(crate) fn of_box(
    grids: &Output,
    vehicle: usize,
    values: PartValues,
    meanings: &[Meaning],
) -> Result<PartProbabilities, OnnxError> {
    let [_, classes, rows, columns] = grids.shape[..] else {
        return Err(grids.wrong("[n, classes, m, m]"));
    };
    if classes != meanings.len() || rows != columns || rows == 0 {
        return Err(grids.wrong(&format!("[n, {}, m, m]", meanings.len())));
    }
    let cells = rows * columns;
    let all = &grids.values[vehicle * classes * cells..][..classes * cells];
    let mut result = vec![0.0f32; CHANNELS * cells];
    let mut of_cell = vec![0.0f32; classes];
    for cell in 0..cells {
        for (class, value) in of_cell.iter_mut().enumerate() {
            *value = all[class * cells + cell];
        }
        if values == PartValues::Logits {
            soft_max(&mut of_cell);
        }
        for (value, meaning) in of_cell.iter().zip(meanings) {
            result[channel(*meaning) * cells + cell] += value;
        }
    }
    PartProbabilities::new(rows, result).map_err(|source| OnnxError::Probability {
        name: grids.name.clone(),
        vehicle,
        source,
    })
}

/// What is no part of the vehicle is background.
fn channel(meaning: Meaning) -> usize {
    match meaning {
        Meaning::Part(class) => usize::from(class.id()),
        Meaning::Background | Meaning::Vehicle | Meaning::Nothing => usize::from(BACKGROUND),
    }
}

fn soft_max(values: &mut [f32]) {
    let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut sum = 0.0;
    for value in values.iter_mut() {
        *value = (*value - most).exp();
        sum += *value;
    }
    for value in values {
        *value /= sum;
    }
}

/// The parts of the whole input, painted from masks: the surest last, so that it is seen.
///
/// `instances` are places in `masks`, `[n, height, width]` or `[n, 1, height, width]`, with score and class.
pub(crate) fn painted(
    masks: &Output,
    threshold: f32,
    mut instances: Vec<(usize, f32, Meaning)>,
) -> Result<PartMask, OnnxError> {
    let ([_, 1, height, width] | [_, height, width]) = masks.shape[..] else {
        return Err(masks.wrong("[n, height, width]"));
    };
    let mut labels = vec![BACKGROUND; width * height];
    instances.sort_by(|a, b| a.1.total_cmp(&b.1));
    for (place, _, meaning) in instances {
        let Meaning::Part(class) = meaning else { continue };
        let mask = &masks.values[place * width * height..][..width * height];
        for (label, value) in labels.iter_mut().zip(mask) {
            if *value >= threshold {
                *label = class.id();
            }
        }
    }
    Ok(PartMask { origin: [0, 0], size: [width as u32, height as u32], labels })
}

/// The parts of the whole input from `[1, classes, height, width]` or `[1, height, width]`.
pub(crate) fn of_image(classes: &Output, meanings: &[Meaning]) -> Result<PartMask, OnnxError> {
    let wrong = || classes.wrong(&format!("[1, {}, height, width]", meanings.len()));
    let id = |class: usize| meanings.get(class).map_or(BACKGROUND, |m| channel(*m) as u8);
    let (width, height, labels) = match classes.shape[..] {
        [1, count, height, width] if count == meanings.len() => {
            let area = width * height;
            let best = |at: usize| {
                let value = |class: usize| classes.values[class * area + at];
                (0..count).fold(0, |best, c| if value(c) > value(best) { c } else { best })
            };
            (width, height, (0..area).map(|at| id(best(at))).collect())
        }
        [1, height, width] | [1, 1, height, width] => (
            width,
            height,
            classes.values.iter().map(|value| id(value.max(0.0) as usize)).collect(),
        ),
        _ => return Err(wrong()),
    };
    Ok(PartMask { origin: [0, 0], size: [width as u32, height as u32], labels })
}

/// The grid of a box of the input out of a label image, which may be coarser than the input of `size`.
pub(crate) fn of_labels(
    labels: &PartMask,
    bounds: &Rect,
    size: [usize; 2],
    kernel: usize,
) -> PartProbabilities {
    let [x, y] = [0, 1].map(|i| f64::from(labels.size[i]) / size[i] as f64);
    let to = |at: f64, scale: f64| (at + 0.5) * scale - 0.5;
    let [left, right] = [bounds.x_min, bounds.x_max].map(|at| to(at, x));
    let [top, bottom] = [bounds.y_min, bounds.y_max].map(|at| to(at, y));
    let detection = detection_from_labels(labels, &Rect::new(left, top, right, bottom), kernel);
    match detection.unknown {
        Some(unknown) => detection.probabilities.with_unknown_as_background(&unknown),
        None => detection.probabilities,
    }
}
