//! Pictures of evaluated frames.

use partpose::dataset::Frame;
use partpose::detection::Detection;
use partpose::eval::VehicleOutcome;
use partpose::files;
use partpose::pose::PoseEstimate;
use partpose::vehicle::ModelZoo;

use super::Arguments;
use crate::commands::result_files::{self, Pictured};
use crate::report::warn_error;

/// A vehicle to draw, with the zoo that its model is of: folds have different ones.
struct Kept<'a> {
    vehicle: usize,
    zoo: &'a ModelZoo,
    detection: Detection,
    estimate: Option<PoseEstimate>,
}

/// The frames that are drawn, with what was found in them.
pub(super) struct Pictures<'a> {
    frames: Vec<(&'a Frame, Vec<Kept<'a>>)>,
}

impl<'a> Pictures<'a> {
    /// `count` frames with vehicles, evenly spread.
    pub(super) fn new(frames: &'a [Frame], count: usize) -> Self {
        let shown: Vec<&Frame> =
            frames.iter().filter(|frame| frame.vehicles.iter().any(|v| !v.dont_care)).collect();
        let step = shown.len().div_ceil(count.max(1)).max(1);
        let chosen = shown.into_iter().step_by(step).take(count);
        Self { frames: chosen.map(|frame| (frame, Vec::new())).collect() }
    }

    /// Whether a frame is drawn.
    pub(super) fn shows(&self, frame: &Frame) -> bool {
        self.frames.iter().any(|(shown, _)| std::ptr::eq(*shown, frame))
    }

    /// Keeps what was found; without its detection a vehicle is not drawn.
    pub(super) fn add(
        &mut self,
        frame: &Frame,
        zoo: &'a ModelZoo,
        detection: Option<Detection>,
        outcome: &VehicleOutcome,
    ) {
        let Some(detection) = detection else { return };
        let shown = self.frames.iter_mut().find(|(shown, _)| std::ptr::eq(*shown, frame));
        if let Some((_, kept)) = shown {
            let estimate = outcome.estimate.as_ref().ok().cloned();
            kept.push(Kept { vehicle: outcome.vehicle, zoo, detection, estimate });
        }
    }

    /// Writes the pictures; returns how many had to do without their image.
    pub(super) fn write(&self, arguments: &Arguments) -> anyhow::Result<usize> {
        let mut without = 0;
        for (frame, kept) in &self.frames {
            if kept.is_empty() {
                continue;
            }
            let image = match frame.image.as_deref().map(files::read_rgb).transpose() {
                Ok(image) => image,
                Err(error) => {
                    let context = format!("drew frame {} without its image", frame.name());
                    warn_error(context, &error);
                    without += 1;
                    None
                }
            };
            let pictured: Vec<Pictured> = kept
                .iter()
                .map(|kept| Pictured {
                    detection: &kept.detection,
                    estimate: kept.estimate.as_ref(),
                    zoo: kept.zoo,
                    truth: Some(frame.vehicles[kept.vehicle].cuboid),
                })
                .collect();
            let (name, scaling) = (frame.name(), arguments.pose.options().scaling);
            let picture =
                result_files::picture(&name, &frame.camera, image.as_ref(), (&pictured, scaling));
            let file = format!("{}.png", result_files::stem(&name));
            files::write_png(&arguments.out.join("pictures").join(file), &picture)?;
        }
        Ok(without)
    }
}
