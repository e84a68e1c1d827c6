//! The learning rate over the steps of a training: a rise, then a fall.

use serde::{Deserialize, Serialize};

/// The course of the learning rate, as factors of the highest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScheduleConfig {
    /// Steps of the whole training.
    pub steps: u64,
    /// Steps over which the rate rises evenly from near zero.
    pub warmup: u64,
    /// How it falls.
    pub fall: Fall,
}

/// How a learning rate falls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Fall {
    /// Half a cosine, to `last` times the highest (Loshchilov and Hutter: *SGDR*, ICLR 2017).
    Cosine {
        /// Share of the highest rate at the end.
        last: f64,
    },
    /// Level, but at each milestone times `factor`.
    Step {
        /// Steps, ascending.
        milestones: Vec<u64>,
        /// At each of them.
        factor: f64,
    },
}

impl Default for ScheduleConfig {
    fn default() -> Self {
        Self { steps: 6000, warmup: 200, fall: Fall::Cosine { last: 0.01 } }
    }
}

impl ScheduleConfig {
    /// The factor of the learning rate at a step, counted from 0.
    pub fn factor(&self, step: u64) -> f64 {
        let rise =
            if step < self.warmup { (step + 1) as f64 / (self.warmup + 1) as f64 } else { 1.0 };
        rise * match &self.fall {
            Fall::Cosine { last } => {
                let progress = (step as f64 / self.steps.max(1) as f64).min(1.0);
                last + (1.0 - last) * 0.5 * (1.0 + (std::f64::consts::PI * progress).cos())
            }
            Fall::Step { milestones, factor } => {
                let passed = milestones.iter().filter(|milestone| step >= **milestone).count();
                factor.powi(passed as i32)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_rise_then_fall() {
        let schedule = ScheduleConfig { steps: 1000, warmup: 10, fall: Fall::Cosine { last: 0.0 } };
        assert!((schedule.factor(0) - 1.0 / 11.0).abs() < 1e-6);
        assert!(schedule.factor(10) > 0.99);
        assert!((schedule.factor(500) - 0.5).abs() < 1e-9);
        assert!(schedule.factor(1000) < 1e-9 && schedule.factor(9999) < 1e-9);
        let fall = Fall::Step { milestones: vec![100, 200], factor: 0.1 };
        let schedule = ScheduleConfig { steps: 1000, warmup: 0, fall };
        assert_eq!(
            [99, 100, 250].map(|step| (1e3 * schedule.factor(step)).round() as u32),
            [1000, 100, 10]
        );
    }
}
