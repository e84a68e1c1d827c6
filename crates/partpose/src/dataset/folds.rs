//! Folds of tracks, so that a vehicle is never judged by a model that was made from its own pictures.
//!
//! Consecutive frames of a track look alike, hence tracks are divided, not frames. The tracks of each model are dealt
//! by falling number of rows, in rounds in which every fold gets one; within a round the fold with the fewest rows so
//! far takes the next. So every fold has each model that has enough tracks, and about as many rows as the others. A
//! world's variations show the same vehicles: a track is in the same fold in all of them.
//!
//! The folds depend on the worlds they are made of; who carves and who evaluates must name the same ones.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use super::{Dataset, DatasetError, SequenceFrames, SequenceId};

/// The variation whose rows are counted, where a world has it; else its first.
const COUNTED: &str = "clone";
/// Most folds that tracks are divided into; no data set has as many tracks of one model.
pub const MAX_FOLDS: usize = 1000;

/// One of several parts of the tracks, written `I/K` with I from 1 to K.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fold {
    /// Which part, from 1.
    pub index: usize,
    /// Into how many the tracks are divided.
    pub count: usize,
}

/// Text that is not a fold.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{text}` is not a fold: write I/K with I from 1 to K and K up to {MAX_FOLDS}, as in `1/4`"
)]
pub struct FoldError {
    /// What was given.
    pub text: String,
}

impl Fold {
    /// Parses `I/K`; K is limited to [`MAX_FOLDS`].
    pub fn parse(text: &str) -> Result<Self, FoldError> {
        let parts = text.split_once('/').and_then(|(index, count)| {
            Some(Self { index: index.parse().ok()?, count: count.parse().ok()? })
        });
        parts
            .filter(|fold| fold.count <= MAX_FOLDS && (1..=fold.count).contains(&fold.index))
            .ok_or_else(|| FoldError { text: text.to_owned() })
    }
}

impl FromStr for Fold {
    type Err = FoldError;

    fn from_str(text: &str) -> Result<Self, FoldError> {
        Self::parse(text)
    }
}

impl fmt::Display for Fold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// A vehicle as far as dealing needs to know it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrackSummary {
    /// The world it drives in.
    pub world: String,
    /// Its id there.
    pub track: u32,
    /// Name of its mesh; empty where unknown.
    pub model: String,
    /// Rows that are not to be ignored.
    pub rows: usize,
}

/// The fold of every track of some worlds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folds {
    count: usize,
    by_track: BTreeMap<(String, u32), usize>,
}

impl Folds {
    /// Deals tracks into 1 to [`MAX_FOLDS`] folds; the order in which they are given does not matter.
    pub fn deal(tracks: &[TrackSummary], count: usize) -> Self {
        let count = count.clamp(1, MAX_FOLDS);
        let mut by_model: BTreeMap<&str, Vec<&TrackSummary>> = BTreeMap::new();
        for track in tracks {
            by_model.entry(&track.model).or_default().push(track);
        }
        let mut by_track = BTreeMap::new();
        let mut rows_of_fold = vec![0; count];
        for tracks in by_model.values_mut() {
            tracks.sort_by_key(|track| (usize::MAX - track.rows, &track.world, track.track));
            let mut rows_of_model = vec![0; count];
            for round in tracks.chunks(count) {
                let mut free: Vec<usize> = (0..count).collect();
                for track in round {
                    let lightest =
                        |fold: &usize| (rows_of_model[*fold], rows_of_fold[*fold], *fold);
                    let Some(at) = (0..free.len()).min_by_key(|at| lightest(&free[*at])) else {
                        break;
                    };
                    let fold = free.remove(at);
                    rows_of_model[fold] += track.rows;
                    rows_of_fold[fold] += track.rows;
                    by_track.insert((track.world.clone(), track.track), fold + 1);
                }
            }
        }
        Self { count, by_track }
    }

    /// Deals the tracks of the worlds of some sequences.
    ///
    /// Counts the rows of the variation `clone`, whichever variations are chosen, so that the folds of a world do not
    /// depend on them.
    pub fn of(
        dataset: &Dataset,
        sequences: &[SequenceId],
        count: usize,
    ) -> Result<Self, DatasetError> {
        let mut worlds: Vec<&str> = sequences.iter().map(|id| id.world.as_str()).collect();
        worlds.sort_unstable();
        worlds.dedup();
        let mut tracks = Vec::new();
        for world in worlds {
            let mut variations = dataset.sequences().iter().filter(|id| id.world == world);
            let counted = variations.clone().find(|id| id.variation == COUNTED);
            if let Some(id) = counted.or_else(|| variations.next()) {
                tracks.extend(summarize(world, &dataset.read(id)?));
            }
        }
        Ok(Self::deal(&tracks, count))
    }

    /// How many folds there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The fold of a track, from 1.
    ///
    /// Tracks that were not dealt (turned cameras show vehicles that `clone` never lists) go by their id.
    pub fn fold_of(&self, sequence: &SequenceId, track: u32) -> usize {
        let key = (sequence.world.clone(), track);
        self.by_track.get(&key).copied().unwrap_or(track as usize % self.count + 1)
    }

    /// Whether a track belongs to a fold; its `count` must be that of the dealing.
    pub fn contains(&self, fold: Fold, sequence: &SequenceId, track: u32) -> bool {
        self.fold_of(sequence, track) == fold.index
    }
}

fn summarize(world: &str, read: &SequenceFrames) -> Vec<TrackSummary> {
    let mut found: BTreeMap<u32, TrackSummary> = BTreeMap::new();
    for vehicle in read.frames.iter().flat_map(|frame| &frame.vehicles) {
        let Some(track) = vehicle.track else { continue };
        let summary = found.entry(track).or_insert_with(|| TrackSummary {
            world: world.to_owned(),
            track,
            model: vehicle.model.clone().unwrap_or_default(),
            rows: 0,
        });
        summary.rows += usize::from(!vehicle.dont_care);
    }
    found.into_values().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(world: &str, track: u32, model: &str, rows: usize) -> TrackSummary {
        TrackSummary { world: world.to_owned(), track, model: model.to_owned(), rows }
    }

    fn some_tracks() -> Vec<TrackSummary> {
        let models = ["Small", "Large", "Odd"];
        let make = |i: u32| {
            let world = if i.is_multiple_of(3) { "0018" } else { "0001" };
            track(world, i, models[i as usize % 3], (i as usize * 37) % 101)
        };
        (0..60).map(make).collect()
    }

    fn id(world: &str, variation: &str) -> SequenceId {
        SequenceId { world: world.to_owned(), variation: variation.to_owned() }
    }

    #[test]
    fn fold_is_written_from_1_to_its_count() {
        assert_eq!(Fold::parse("2/4"), Ok(Fold { index: 2, count: 4 }));
        assert_eq!(Fold::parse("1000/1000"), Ok(Fold { index: 1000, count: 1000 }));
        for wrong in ["", "0/4", "5/4", "1", "1/0", "-1/4", "a/b", "1/4/2", "1.5/4", "1/1001"] {
            assert!(Fold::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_count_beyond_memory_is_refused_in_words_and_never_dealt() {
        let error = Fold::parse("1/99999999999").unwrap_err();
        assert_eq!(
            error.to_string(),
            "`1/99999999999` is not a fold: write I/K with I from 1 to K and K up to 1000, as in `1/4`"
        );
        assert_eq!(Folds::deal(&some_tracks(), usize::MAX).count(), MAX_FOLDS);
    }

    #[test]
    fn every_fold_has_each_model_in_near_equal_number() {
        let tracks = some_tracks();
        let folds = Folds::deal(&tracks, 4);
        for model in ["Small", "Large", "Odd"] {
            let mut count = [0; 4];
            for track in tracks.iter().filter(|track| track.model == model) {
                count[folds.fold_of(&id(&track.world, "clone"), track.track) - 1] += 1;
            }
            assert_eq!(count, [5; 4], "{model}");
        }
    }

    #[test]
    fn folds_have_similar_numbers_of_rows() {
        let tracks = some_tracks();
        let folds = Folds::deal(&tracks, 4);
        let mut rows = [0; 4];
        for track in &tracks {
            rows[folds.fold_of(&id(&track.world, "clone"), track.track) - 1] += track.rows;
        }
        let (least, most) = (rows.iter().min().unwrap(), rows.iter().max().unwrap());
        // Dealing in rounds leaves at most one track of difference a model; a track has up to 100 rows.
        assert!(most - least < 100, "{rows:?}");
    }

    #[test]
    fn order_of_the_tracks_and_variation_do_not_matter() {
        let mut tracks = some_tracks();
        let folds = Folds::deal(&tracks, 4);
        tracks.reverse();
        assert_eq!(Folds::deal(&tracks, 4), folds);
        let fold = |variation| folds.fold_of(&id("0001", variation), 7);
        assert_eq!(fold("clone"), fold("15-deg-left"));
    }

    #[test]
    fn a_track_unknown_to_the_dealing_still_has_one_fold() {
        let folds = Folds::deal(&some_tracks(), 4);
        assert_eq!(folds.fold_of(&id("0001", "30-deg-left"), 1002), 3);
    }
}
