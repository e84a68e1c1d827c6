//! Training, validation and test frames in the proportions of the paper.
//!
//! The paper (Barowski et al., ITSC 2019) has 13,743 training, 1,527 validation and 4,540 test images of Virtual KITTI
//! and publishes no lists. The sizes fit one rule: a stretch in the middle of every world is the test, the same in all
//! ten variations, images without vehicles do not count, and a tenth of the rest validates. On the released masks it
//! gives 13,774, 1,530 and 4,539. That the paper did it so is our inference.
//!
//! At ten frames a second, neighbours of the test stretch look almost like it. One guard frame on either side is left
//! out by default; 10 to 20 separate better. Validation frames are drawn from the same stretches as the training ones
//! and resemble them closely.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::SequenceId;

/// Start of the test stretch as a share of a world's frames.
const TEST_START: f64 = 0.45;
/// Its end.
const TEST_END: f64 = 0.665;

/// How frames are divided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitOptions {
    /// Frames left out on either side of the test stretch.
    pub guard: u32,
    /// Share of the remaining frames that validates.
    pub validation: f64,
    /// Seed of the `ChaCha8` generator that draws them.
    pub seed: u64,
}

impl Default for SplitOptions {
    fn default() -> Self {
        Self { guard: 1, validation: 0.1, seed: 0 }
    }
}

/// A frame by its sequence and index.
pub type FrameId = (SequenceId, u32);

/// Frames by what they are used for, each list sorted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// To learn from.
    pub train: Vec<FrameId>,
    /// To choose parameters with.
    pub validation: Vec<FrameId>,
    /// To report on.
    pub test: Vec<FrameId>,
    /// Beside the test stretch, used for nothing.
    pub guard: Vec<FrameId>,
}

/// Divides frames as the paper seems to have done.
///
/// `sequences` gives every sequence with its number of frames, counted from index 0; `shows_vehicles` says whether a
/// frame counts (in the paper: whether its mask has a vehicle pixel).
pub fn split_like_paper(
    sequences: &BTreeMap<SequenceId, u32>,
    options: &SplitOptions,
    mut shows_vehicles: impl FnMut(&SequenceId, u32) -> bool,
) -> Split {
    let mut split = Split::default();
    for (id, count) in sequences {
        let (start, end) = test_stretch(*count);
        let guarded = start.saturating_sub(options.guard)..end.saturating_add(options.guard);
        for index in 0..*count {
            if !shows_vehicles(id, index) {
                continue;
            }
            let list = if (start..end).contains(&index) {
                &mut split.test
            } else if guarded.contains(&index) {
                &mut split.guard
            } else {
                &mut split.train
            };
            list.push((id.clone(), index));
        }
    }
    let drawn = (split.train.len() as f64 * options.validation.clamp(0.0, 1.0)).round() as usize;
    let chosen = draw(split.train.len(), drawn, options.seed);
    let pool = std::mem::take(&mut split.train);
    for (frame, chosen) in pool.into_iter().zip(chosen) {
        if chosen { split.validation.push(frame) } else { split.train.push(frame) }
    }
    split
}

/// First test frame and the one after the last of a world with `count` frames.
pub fn test_stretch(count: u32) -> (u32, u32) {
    let at = |share: f64| (share * f64::from(count)).round() as u32;
    (at(TEST_START), at(TEST_END))
}

/// Marks `count` of `len` items, all choices equally likely up to 1 in 2³²: the start of a Fisher-Yates shuffle.
///
/// Written out because the draws of `rand`'s own sampling may change between its releases; those of `ChaCha8` do not.
fn draw(len: usize, count: usize, seed: u64) -> Vec<bool> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let mut order: Vec<usize> = (0..len).collect();
    let mut marked = vec![false; len];
    for i in 0..count.min(len) {
        let rest = (len - i) as u128;
        let offset = (u128::from(generator.next_u64()) * rest) >> 64;
        order.swap(i, i + offset as usize);
        marked[order[i]] = true;
    }
    marked
}

#[cfg(test)]
mod tests {
    use super::*;

    fn virtual_kitti() -> BTreeMap<SequenceId, u32> {
        let variations = [
            "15-deg-left",
            "15-deg-right",
            "30-deg-left",
            "30-deg-right",
            "clone",
            "fog",
            "morning",
            "overcast",
            "rain",
            "sunset",
        ];
        let worlds = [("0001", 447), ("0002", 233), ("0006", 270), ("0018", 339), ("0020", 837)];
        let mut found = BTreeMap::new();
        for (world, count) in worlds {
            for variation in variations {
                let (world, variation) = (world.to_owned(), variation.to_owned());
                found.insert(SequenceId { world, variation }, count);
            }
        }
        found
    }

    #[test]
    fn counts_are_those_of_the_rule_on_all_of_virtual_kitti() {
        let sequences = virtual_kitti();
        let split = split_like_paper(&sequences, &SplitOptions::default(), |_, _| true);
        let counts = (split.train.len(), split.validation.len(), split.test.len());
        // 21,260 images; 456 test frames and 10 guard frames in each of ten variations.
        assert_eq!(counts, (14_940, 1_660, 4_560));
        assert_eq!(split.guard.len(), 100);
    }

    #[test]
    fn every_frame_with_vehicles_is_used_once() {
        let sequences = virtual_kitti();
        let shows = |_: &SequenceId, index: u32| index % 7 != 3;
        let split = split_like_paper(&sequences, &SplitOptions::default(), shows);
        let mut all = [&split.train, &split.validation, &split.test, &split.guard]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>();
        all.sort();
        all.dedup();
        let expected: usize = sequences
            .values()
            .map(|count| (0..*count).filter(|index| index % 7 != 3).count())
            .sum();
        assert_eq!(all.len(), expected);
    }

    #[test]
    fn test_stretch_is_the_same_in_all_variations() {
        assert_eq!(test_stretch(447), (201, 297));
        assert_eq!(test_stretch(233), (105, 155));
        assert_eq!(test_stretch(270), (122, 180));
        assert_eq!(test_stretch(339), (153, 225));
        assert_eq!(test_stretch(837), (377, 557));
    }

    #[test]
    fn guard_frames_keep_their_distance() {
        let sequences = virtual_kitti();
        let options = SplitOptions { guard: 15, ..SplitOptions::default() };
        let split = split_like_paper(&sequences, &options, |_, _| true);
        let near = |(id, index): &FrameId| {
            let (start, end) = test_stretch(sequences[id]);
            *index + 15 >= start && *index < end + 15
        };
        assert!(!split.train.iter().chain(&split.validation).any(near));
        assert_eq!(split.guard.len(), 1_500);
    }

    #[test]
    fn seed_decides_the_validation_frames() {
        let sequences = virtual_kitti();
        let with = |seed| {
            let options = SplitOptions { seed, ..SplitOptions::default() };
            split_like_paper(&sequences, &options, |_, _| true).validation
        };
        assert_eq!(with(1), with(1));
        assert_ne!(with(1), with(2));
        // Pinned, so that results of different releases stay comparable.
        let first: Vec<u32> = with(0).iter().take(4).map(|(_, index)| *index).collect();
        assert_eq!(first, [29, 30, 60, 70]);
    }

    #[test]
    fn a_world_without_frames_gives_nothing() {
        let id = SequenceId { world: "0001".to_owned(), variation: "clone".to_owned() };
        let options = SplitOptions { guard: u32::MAX, ..SplitOptions::default() };
        let split = split_like_paper(&BTreeMap::from([(id, 0)]), &options, |_, _| true);
        assert_eq!(split, Split::default());
    }
}
