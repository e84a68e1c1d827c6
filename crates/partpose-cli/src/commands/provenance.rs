//! What a zoo was carved from, so that nobody judges vehicles by models of their own pictures unawares.

use std::collections::BTreeSet;
use std::path::Path;

use partpose::dataset::SequenceId;
use partpose::dataset::folds::Fold;
use partpose::files;
use serde::{Deserialize, Serialize};

/// Name of the record in the folder of a zoo.
const RECORD: &str = "carved.json";

/// The record that `zoo carve` leaves beside the models.
#[derive(Debug, Serialize, Deserialize)]
struct Carved {
    version: String,
    dataset: String,
    worlds: BTreeSet<String>,
    /// The part of the tracks that was left out, `I/K`.
    left_out: Option<String>,
}

fn worlds(sequences: &[SequenceId]) -> BTreeSet<String> {
    sequences.iter().map(|id| id.world.clone()).collect()
}

/// Writes the record.
pub(crate) fn write(
    zoo: &Path,
    dataset: &Path,
    sequences: &[SequenceId],
    left_out: Option<Fold>,
) -> anyhow::Result<()> {
    let carved = Carved {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        dataset: dataset.display().to_string(),
        worlds: worlds(sequences),
        left_out: left_out.map(|fold| fold.to_string()),
    };
    let text = serde_json::to_string_pretty(&carved)?;
    Ok(files::write(&zoo.join(RECORD), text.as_bytes())?)
}

/// What is wrong with judging these tracks by this zoo, if anything; a zoo without a record is trusted.
pub(crate) fn objection(
    zoo: &Path,
    sequences: &[SequenceId],
    scored: Option<Fold>,
) -> Option<String> {
    let carved: Carved = serde_json::from_slice(&files::read(&zoo.join(RECORD)).ok()?).ok()?;
    let scored_worlds = worlds(sequences);
    let shared: Vec<&str> =
        carved.worlds.intersection(&scored_worlds).map(String::as_str).collect();
    let scored = scored.map(|fold| fold.to_string());
    let same_folds = carved.worlds == scored_worlds && carved.left_out == scored;
    if shared.is_empty() || (carved.left_out.is_some() && same_folds) {
        return None;
    }
    let left_out = carved.left_out.map_or(String::new(), |fold| format!(", fold {fold} left out,"));
    Some(format!(
        "`{}` was carved from what is scored: from {}{left_out} of which {} is scored too; folds hold only with the \
         same worlds and the same fold",
        zoo.display(),
        carved.worlds.iter().cloned().collect::<Vec<_>>().join(", "),
        shared.join(", "),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequences(worlds: &[&str]) -> Vec<SequenceId> {
        let id =
            |world: &&str| SequenceId { world: (*world).to_owned(), variation: "clone".to_owned() };
        worlds.iter().map(id).collect()
    }

    #[test]
    fn only_tracks_that_were_left_out_are_judged_without_objection() {
        let folder = tempfile::tempdir().unwrap();
        let zoo = folder.path();
        assert_eq!(objection(zoo, &sequences(&["0001"]), None), None);
        let fold = |text: &str| Some(Fold::parse(text).unwrap());
        write(zoo, Path::new("d"), &sequences(&["0001", "0018"]), fold("1/4")).unwrap();
        let objects =
            |worlds: &[&str], scored| objection(zoo, &sequences(worlds), scored).is_some();
        assert!(!objects(&["0001", "0018"], fold("1/4")));
        assert!(objects(&["0001", "0018"], fold("2/4")));
        assert!(objects(&["0018"], fold("1/4")));
        assert!(objects(&["0018"], None));
        assert!(!objects(&["0002"], None));
    }
}
