//! What is labelled, and with which models.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

/// How a vehicle's model is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ModelChoice {
    /// The model of the same category with the smallest L1 distance of the sizes (paper, § III-A).
    #[default]
    Size,
    /// The model of the name that the data set gives; by size where the zoo lacks it.
    Name,
}

/// Which categories of vehicles get labels; the others hide what is behind them, and no more.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Categories {
    /// Those that the zoo has a model of.
    #[default]
    OfZoo,
    /// All; where the zoo has no model of a category, the nearest in size of any stands in.
    All,
    /// Those named.
    Named(Vec<String>),
}

/// What becomes of the vehicles that a data set asks to ignore.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DontCare {
    /// They are labelled, and marked in the annotations; as in the author's masks.
    #[default]
    Draw,
    /// They hide what is behind them, and no more.
    Occlude,
}

/// How frames are labelled.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LabelOptions {
    /// How models are chosen.
    pub models: ModelChoice,
    /// Which vehicles get labels.
    pub categories: Categories,
    /// What becomes of those to ignore.
    pub dont_care: DontCare,
}

/// One of several parts of the work, written `I/N` with I from 1 to N.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, from 1.
    pub index: usize,
    /// Into how many the work is divided.
    pub count: usize,
}

/// Text that is not a shard.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not a shard: write I/N with I from 1 to N, as in `1/4`")]
pub struct ShardError {
    /// What was given.
    pub text: String,
}

impl Shard {
    /// Whether a piece of work, counted from 0, belongs to this part.
    pub fn has(&self, piece: usize) -> bool {
        piece % self.count.max(1) + 1 == self.index
    }

    /// Whether a block of a sequence belongs to this part.
    pub(super) fn holds(&self, sequence: usize, block: usize) -> bool {
        self.has(sequence + block)
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let parts = text.split_once('/').and_then(|(index, count)| {
            Some(Self { index: index.parse().ok()?, count: count.parse().ok()? })
        });
        parts
            .filter(|shard| (1..=shard.count).contains(&shard.index))
            .ok_or_else(|| ShardError { text: text.to_owned() })
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_is_in_one_shard() {
        let shards: Vec<Shard> = ["1/3", "2/3", "3/3"].map(|text| text.parse().unwrap()).to_vec();
        for (sequence, block) in (0..5).flat_map(|s| (0..7).map(move |b| (s, b))) {
            assert_eq!(shards.iter().filter(|shard| shard.holds(sequence, block)).count(), 1);
        }
    }

    #[test]
    fn shard_is_written_from_1_to_its_number() {
        for wrong in ["", "0/4", "5/4", "1", "1/0", "-1/4", "a/b"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
        assert_eq!("2/4".parse::<Shard>().unwrap().to_string(), "2/4");
    }
}
