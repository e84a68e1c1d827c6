//! Weights of the parts in the mask loss, from how often they are seen.

use partpose::dataset::DatasetError;
use partpose::parts::{BACKGROUND, CHANNELS};
use partpose::vehicle::ModelZoo;

use crate::sample::{self, Item};

/// Frames that are counted at most.
const MOST_FRAMES: usize = 100;
/// Rare parts weigh at most this many times what the most frequent channel does.
const MOST_RATIO: f64 = 8.0;

/// One weight a channel, background first: the inverse of the square root of its share of the pixels of vehicles' boxes,
/// within limits, scaled so that the mean over pixels is 1.
pub fn class_weights(items: &[Item], zoo: &ModelZoo) -> Result<Vec<f32>, DatasetError> {
    let mut counts = vec![0_u64; CHANNELS];
    for item in items.iter().step_by(items.len().div_ceil(MOST_FRAMES).max(1)) {
        let sample = sample::read(item, false, zoo)?;
        for (i, vehicle) in item.frame.vehicles.iter().enumerate().filter(|(_, v)| !v.dont_care) {
            let (x0, y0, x1, y1) = vehicle.bounds.pixels(sample.image.size);
            for at in (y0..y1)
                .flat_map(|y| (x0..x1).map(move |x| (x, y)))
                .map(|(x, y)| y as usize * sample.image.size[0] as usize + x as usize)
            {
                let own = usize::from(sample.owners[at]) == i + 1;
                counts[usize::from(if own { sample.labels[at] } else { BACKGROUND })] += 1;
            }
        }
    }
    Ok(weights_of(&counts))
}

fn weights_of(counts: &[u64]) -> Vec<f32> {
    let total: u64 = counts.iter().sum();
    let most = counts.iter().max().copied().unwrap_or(1).max(1) as f64;
    let raw = |count: u64| (most / count.max(1) as f64).sqrt().min(MOST_RATIO);
    let mean =
        counts.iter().map(|count| raw(*count) * *count as f64).sum::<f64>() / total.max(1) as f64;
    let mean = if mean > 0.0 { mean } else { 1.0 };
    counts.iter().map(|count| (raw(*count) / mean) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rare_parts_weigh_more_and_the_mean_is_one() {
        let counts = [9000, 900, 90, 0];
        let weights = weights_of(&counts);
        assert!((weights[1] / weights[0] - 10.0_f32.sqrt()).abs() < 1e-4);
        assert!((weights[2] / weights[0] - 8.0).abs() < 1e-4);
        assert_eq!(weights[2].to_bits(), weights[3].to_bits());
        let sum: f64 = counts.iter().zip(&weights).map(|(n, w)| *n as f64 * f64::from(*w)).sum();
        assert!((sum / 9990.0 - 1.0).abs() < 1e-5);
    }
}
