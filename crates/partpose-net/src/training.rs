//! What a training is: network, data, augmentation, optimiser, schedule, in one file that each run keeps.

use serde::{Deserialize, Serialize};

use crate::augment::AugmentConfig;
use crate::config::NetConfig;
use crate::input::scaled_size;
use crate::mask_rcnn::MaskRcnn;
use crate::optimizer::OptimizerConfig;
use crate::schedule::{Fall, ScheduleConfig};

/// Everything that decides the weights besides the data and the initial weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainConfig {
    /// Seed of everything random.
    pub seed: u64,
    /// The network.
    pub net: NetConfig,
    /// What is learnt from.
    pub data: DataConfig,
    /// How images are varied.
    pub augment: AugmentConfig,
    /// How weights follow gradients.
    pub optimizer: OptimizerConfig,
    /// The learning rate's course.
    pub schedule: ScheduleConfig,
    /// Sizes of images and batches, one after the other; the last one's `until` counts as 1.
    pub phases: Vec<Phase>,
    /// What is kept and reported.
    pub report: ReportConfig,
}

/// What is learnt from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DataConfig {
    /// Whether cars that the data set asks to ignore are examples.
    pub with_dontcare: bool,
    /// Whether rare parts weigh more in the loss.
    pub balance: Balance,
    /// Threads that read and vary images, 0 for as many as there are processors; the result does not depend on it.
    pub threads: usize,
}

/// Weights of the parts in the loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Balance {
    /// Those of the network's configuration: equal if it says nothing.
    #[default]
    None,
    /// The inverse of the square root of a part's share of the pixels, within limits, so that their mean over pixels is 1.
    InverseSquareRoot,
}

/// A stretch of a training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// Share of the steps at which it ends.
    pub until: f64,
    /// Width and height of images, multiples of 32; 0, 0 for whole frames.
    pub size: [usize; 2],
    /// Images a step.
    pub batch: usize,
    /// Smallest and largest scale, relative to how the network sees whole frames.
    pub scales: [f64; 2],
}

/// What is kept and reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReportConfig {
    /// Steps between lines of the loss curve.
    pub every: u64,
    /// Steps between checkpoints.
    pub checkpoint_every: u64,
    /// Checkpoints kept.
    pub keep: usize,
    /// Steps between validations; 0 for none.
    pub validate_every: u64,
    /// Images of a validation, spread evenly.
    pub validation_images: usize,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            net: NetConfig::default(),
            data: DataConfig::default(),
            augment: AugmentConfig::default(),
            optimizer: OptimizerConfig::default(),
            schedule: ScheduleConfig::default(),
            phases: vec![
                Phase { until: 0.7, size: [512, 256], batch: 2, scales: [0.5, 1.5] },
                Phase { until: 1.0, size: [0, 0], batch: 1, scales: [0.8, 1.25] },
            ],
            report: ReportConfig::default(),
        }
    }
}

impl Default for DataConfig {
    fn default() -> Self {
        Self { with_dontcare: false, balance: Balance::None, threads: 0 }
    }
}

impl Default for ReportConfig {
    fn default() -> Self {
        Self {
            every: 20,
            checkpoint_every: 250,
            keep: 2,
            validate_every: 500,
            validation_images: 40,
        }
    }
}

impl TrainConfig {
    /// The paper's training: 400,000 steps of one whole image from a pretrained detector, flips alone.
    pub fn paper() -> Self {
        Self {
            net: NetConfig::paper(),
            augment: AugmentConfig { around_vehicle: 0.0, ..AugmentConfig::flips_only() },
            optimizer: OptimizerConfig::paper(),
            schedule: ScheduleConfig {
                steps: 400_000,
                warmup: 0,
                fall: Fall::Step { milestones: vec![900_000, 1_200_000], factor: 0.1 },
            },
            phases: vec![Phase { until: 1.0, size: [0, 0], batch: 1, scales: [1.0, 1.0] }],
            report: ReportConfig {
                checkpoint_every: 5000,
                validate_every: 20_000,
                validation_images: 200,
                ..ReportConfig::default()
            },
            ..Self::default()
        }
    }

    /// What is impossible in it, if anything.
    pub fn fault(&self) -> Option<String> {
        if self.phases.is_empty() {
            return Some("`phases` is empty".to_owned());
        }
        for phase in &self.phases {
            if phase.size.iter().any(|side| side % MaskRcnn::SIDE_STEP != 0) {
                return Some(format!("`phases`: {:?} are no multiples of 32", phase.size));
            }
            if phase.batch == 0 {
                return Some("`phases`: `batch` is 0".to_owned());
            }
            let [low, high] = phase.scales;
            if !(low >= 0.05 && low <= high && high <= 20.0) {
                return Some(format!("`phases`: `scales` are {:?}", phase.scales));
            }
        }
        if self.schedule.steps == 0 {
            return Some("`schedule.steps` is 0".to_owned());
        }
        if self.report.every == 0 || self.report.checkpoint_every == 0 || self.report.keep == 0 {
            return Some(
                "`report`: `every`, `checkpoint_every` and `keep` must be above 0".to_owned(),
            );
        }
        None
    }

    /// The phase of a step, counted from 0.
    pub fn phase(&self, step: u64) -> &Phase {
        let share = step as f64 / self.schedule.steps.max(1) as f64;
        let phase = self.phases.iter().find(|phase| share < phase.until);
        phase.unwrap_or(&self.phases[self.phases.len() - 1])
    }

    /// Width and height of the images of a phase, for frames of a size.
    pub fn image_size(&self, phase: &Phase, frame: [u32; 2]) -> [usize; 2] {
        if phase.size == [0, 0] {
            scaled_size(frame, &self.net.input)
                .map(|side| side.next_multiple_of(MaskRcnn::SIDE_STEP))
        } else {
            phase.size
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_follow_each_other() {
        let mut config = TrainConfig::default();
        config.schedule.steps = 100;
        assert_eq!(config.phase(0), &config.phases[0]);
        assert_eq!(config.phase(69), &config.phases[0]);
        assert_eq!(config.phase(70), &config.phases[1]);
        assert_eq!(config.phase(1000), &config.phases[1]);
        assert_eq!(config.image_size(&config.phases[1], [1242, 375]), [1248, 384]);
        let paper = TrainConfig::paper();
        assert_eq!(paper.image_size(&paper.phases[0], [1242, 375]), [2016, 608]);
        assert_eq!([config.fault(), paper.fault()], [None, None]);
    }

    #[test]
    fn impossible_configurations_are_told() {
        let mut config = TrainConfig::default();
        config.phases[0].size = [500, 256];
        assert!(config.fault().unwrap().contains("no multiples of 32"));
        config.phases.clear();
        assert_eq!(config.fault().unwrap(), "`phases` is empty");
    }
}
