//! How good the demo's boxes, masks and poses are: the paper's tables over a few images.

use partpose::dataset::Frame;
use partpose::detection::Detection;
use partpose::eval::boxes::{BoxFrame, score_boxes};
use partpose::eval::masks::{MaskScore, score_mask, summarize_masks};
use partpose::eval::matching::{MatchOptions, TruthBoxes};
use partpose::eval::{Scored, Table, pose_deviation, score_table, summarize};
use partpose::oracle::Oracle;
use partpose::parts::Scaling;
use serde_json::{Value, json};

use crate::commands::fitting::Estimated;

/// What was found, held against the truth.
#[derive(Default)]
pub(super) struct Scores {
    boxes: Vec<BoxFrame>,
    masks: Vec<MaskScore>,
    /// Poses as `run` finds them, and with the true sizes.
    poses: [Vec<Scored>; 2],
}

impl Scores {
    /// Scores boxes and masks; returns the vehicle that each detection found.
    pub(super) fn add_boxes(
        &mut self,
        frame: &Frame,
        oracle: &Oracle,
        found: &[Detection],
    ) -> Vec<Option<usize>> {
        let own = |i: usize| Some(frame.vehicles[i].bounds);
        let (truths, vehicles) = TruthBoxes::of_frame(frame, &own);
        let pairs = found.iter().map(|found| (found.bounds, found.score)).collect();
        let boxes = BoxFrame::new(pairs, truths, &MatchOptions::default());
        let verdicts = boxes.verdicts.iter();
        let matched: Vec<Option<usize>> =
            verdicts.map(|verdict| verdict.truth().map(|truth| vehicles[truth])).collect();
        for (detection, vehicle) in found.iter().zip(&matched) {
            if let Some(vehicle) = vehicle {
                let mask = detection.part_mask(frame.camera.size, Scaling::Bilinear);
                let truth = oracle.vehicle_mask(*vehicle, &detection.bounds);
                self.masks.push(score_mask(&mask, &truth));
            }
        }
        self.boxes.push(boxes);
        matched
    }

    /// Scores the poses of the vehicles that were found: as `run` finds them, and with the true sizes.
    pub(super) fn add_poses(
        &mut self,
        frame: &Frame,
        matched: &[Option<usize>],
        estimated: [&[Estimated]; 2],
    ) {
        for (scores, estimated) in self.poses.iter_mut().zip(estimated) {
            for ((_, estimate), vehicle) in estimated.iter().zip(matched) {
                let Some(vehicle) = vehicle else { continue };
                let label = &frame.vehicles[*vehicle];
                scores.push(estimate.as_ref().ok().map(|estimate| {
                    let right = label.model.as_deref() == Some(estimate.model.as_str());
                    pose_deviation(&estimate.cuboid(), &label.cuboid, right)
                }));
            }
        }
    }

    /// Tables to read and `metrics.json`, whose figures of poses are those without knowledge of sizes.
    pub(super) fn summary(self) -> (String, Value) {
        let boxes = score_boxes(&self.boxes, 0.0);
        let masks = summarize_masks(&self.masks);
        let [own, given] = self.poses.map(summarize);
        let columns =
            ["images", "vehicles", "found", "wrong", "precision %", "recall %", "mIoU %", "mPA %"];
        let mut table = Table::new("Vehicles found", &columns);
        let counts = [boxes.frames, boxes.vehicles, boxes.assigned, boxes.wrong];
        let shares = [boxes.precision, boxes.recall, boxes.mean_iou, masks.mpa];
        let cells = counts.map(|count| count.to_string()).into_iter();
        table.rows.push(cells.chain(shares.map(|share| format!("{:.2}", 100.0 * share))).collect());
        let rows = [("as found".to_owned(), own), ("true sizes given".to_owned(), given)];
        let poses = score_table("Their poses", &rows);
        let mut metrics = json!(own);
        let more = json!({
            "images": boxes.frames,
            "vehicles": boxes.vehicles,
            "assigned": boxes.assigned,
            "wrong": boxes.wrong,
            "precision": boxes.precision,
            "recall": boxes.recall,
            "mean_iou": boxes.mean_iou,
            "mpa": masks.mpa,
            "extent": "the network's, else the models'",
            "true_sizes_given": given,
        });
        if let (Some(all), Value::Object(more)) = (metrics.as_object_mut(), more) {
            all.extend(more);
        }
        (format!("{}\n{}", table.to_markdown(), poses.to_markdown()), metrics)
    }
}
