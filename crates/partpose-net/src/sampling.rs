//! Which boxes a training step learns from: matching with the truth, and a balanced choice.

use rand_chacha::ChaCha8Rng;

use crate::boxes::{Corners, area, iou, shared_area};
use crate::target::Target;

/// Share of a box inside a region to be ignored from which the box says nothing.
const IGNORED_SHARE: f32 = 0.5;

/// What a box is in training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Match {
    /// A vehicle's, by its index in the target.
    Vehicle(usize),
    /// Background.
    Background,
    /// Neither: too little overlap for the one, too much for the other, or in a region to be ignored.
    Neither,
}

/// The IoU from which a box is a vehicle's, and the one below which it is background.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchOptions {
    /// From this on a vehicle's.
    pub positive: f32,
    /// Below this background.
    pub negative: f32,
    /// Whether the boxes that overlap a vehicle most are its own however little that is.
    pub force_best: bool,
}

/// What each box is.
pub fn match_boxes(boxes: &[Corners], target: &Target, options: &MatchOptions) -> Vec<Match> {
    let mut best_of_vehicle = vec![0.0f32; target.boxes.len()];
    let mut matches = Vec::with_capacity(boxes.len());
    let mut best = Vec::with_capacity(boxes.len());
    for corners in boxes {
        let overlaps = target.boxes.iter().map(|vehicle| iou(*corners, *vehicle)).enumerate();
        let mut most = (0, 0.0);
        for (i, overlap) in overlaps {
            best_of_vehicle[i] = best_of_vehicle[i].max(overlap);
            if overlap > most.1 {
                most = (i, overlap);
            }
        }
        best.push(most);
        matches.push(match most {
            (i, overlap) if overlap >= options.positive && overlap > 0.0 => Match::Vehicle(i),
            (_, overlap) if overlap < options.negative => Match::Background,
            _ => Match::Neither,
        });
    }
    if options.force_best {
        for (corners, (result, _)) in boxes.iter().zip(matches.iter_mut().zip(&best)) {
            for (i, vehicle) in target.boxes.iter().enumerate() {
                let most = best_of_vehicle[i];
                if most > 0.0
                    && !matches!(result, Match::Vehicle(_))
                    && iou(*corners, *vehicle) >= most
                {
                    *result = Match::Vehicle(i);
                }
            }
        }
    }
    for (corners, result) in boxes.iter().zip(&mut matches) {
        let own = area(*corners);
        let inside = |region: &Corners| shared_area(*corners, *region) >= IGNORED_SHARE * own;
        if *result == Match::Background && target.ignore.iter().any(inside) {
            *result = Match::Neither;
        }
    }
    matches
}

/// Indices of a random choice of at most `count` boxes, at most `positive_share` of them vehicles'; these come first.
pub fn sample(
    matches: &[Match],
    count: usize,
    positive_share: f32,
    rng: &mut ChaCha8Rng,
) -> Vec<usize> {
    let of = |wanted: fn(&Match) -> bool| -> Vec<usize> {
        (0..matches.len()).filter(|i| wanted(&matches[*i])).collect()
    };
    let positive = of(|m| matches!(m, Match::Vehicle(_)));
    let negative = of(|m| *m == Match::Background);
    let most = (count as f32 * positive_share) as usize;
    let mut chosen = choose(&positive, most, rng);
    chosen.extend(choose(&negative, count - chosen.len(), rng));
    chosen
}

/// At most `count` of some indices at random, ascending.
pub fn choose(from: &[usize], count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let places = rand::seq::index::sample(rng, from.len(), count.min(from.len()));
    let mut chosen: Vec<usize> = places.iter().map(|place| from[place]).collect();
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPTIONS: MatchOptions = MatchOptions { positive: 0.7, negative: 0.3, force_best: true };

    #[test]
    fn the_best_box_of_a_vehicle_is_its_own_and_ignored_regions_are_no_background() {
        let target = Target {
            boxes: vec![[0.0, 0.0, 10.0, 10.0], [50.0, 0.0, 60.0, 10.0]],
            ignore: vec![[100.0, 0.0, 120.0, 20.0]],
            ..Target::default()
        };
        let boxes = [
            [0.0, 0.0, 10.0, 9.0],
            [50.0, 0.0, 70.0, 10.0],
            [5.0, 0.0, 15.0, 10.0],
            [101.0, 1.0, 110.0, 9.0],
            [200.0, 0.0, 210.0, 10.0],
        ];
        let found = match_boxes(&boxes, &target, &OPTIONS);
        let vehicle = Match::Vehicle;
        assert_eq!(
            found,
            [vehicle(0), vehicle(1), Match::Neither, Match::Neither, Match::Background]
        );
    }

    #[test]
    fn a_choice_is_filled_up_with_background() {
        use rand::SeedableRng;
        let mut matches = vec![Match::Vehicle(0); 2];
        matches.extend([Match::Background; 20]);
        matches.push(Match::Neither);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let chosen = sample(&matches, 8, 0.5, &mut rng);
        assert_eq!(chosen[..2], [0, 1]);
        assert_eq!(chosen.len(), 8);
        assert!(chosen[2..].iter().all(|i| (2..22).contains(i)));
    }
}
