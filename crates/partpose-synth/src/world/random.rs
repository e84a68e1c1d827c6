//! Random numbers that depend on what they are for, not on the order in which they are asked for.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A generator for one purpose: the same seed and words always give the same numbers.
pub(crate) fn random(seed: u64, words: &[i64]) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(hash(seed, words))
}

/// A number between 0 and 1, where one is all that is needed.
pub(crate) fn unit(seed: u64, words: &[i64]) -> f64 {
    (hash(seed, words) >> 11) as f64 / (1_u64 << 53) as f64
}

/// `SplitMix64` over the words (Steele, Lea, Flood: *Fast Splittable Pseudorandom Number Generators*, OOPSLA 2014).
pub(crate) fn hash(seed: u64, words: &[i64]) -> u64 {
    words.iter().fold(mix(seed), |state, word| mix(state ^ mix(*word as u64)))
}

fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_and_their_order_count() {
        let all = [
            hash(1, &[2, 3]),
            hash(1, &[3, 2]),
            hash(2, &[2, 3]),
            hash(1, &[2]),
            hash(1, &[2, 3, 0]),
        ];
        for (i, one) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|other| other != one));
        }
        assert!((0..100).all(|i| (0.0..1.0).contains(&unit(7, &[i]))));
    }
}
