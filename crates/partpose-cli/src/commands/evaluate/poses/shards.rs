//! Parts of an evaluation, done by several processes, and the tables of all of them.
//!
//! A part leaves the rows of its frames in `shards/I-of-N.json`. Whoever finds the files of all parts puts the rows
//! together, in the order in which one process would have made them: the tables are the same, byte by byte.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use anyhow::Context;
use partpose::dataset::Frame;
use partpose::eval::Configuration;
use partpose::files;
use partpose::labeling::Shard;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Arguments, Evaluated, Row, output};
use crate::report::{hint, note};

/// What made the detections, what tells it from others of that name, and what is done with them.
type Compared<'a> = (&'a str, &'a str, &'a [Configuration]);

/// What a part leaves for the others.
#[derive(Serialize, Deserialize)]
struct Part {
    settings: Value,
    skipped: usize,
    /// One list a configuration.
    rows: Vec<Vec<Row>>,
}

/// The frames of this part, all without one, once the folder is known to be good. What is wrong with the data set all
/// parts find; the first counts it.
pub(super) fn own<'a>(
    arguments: &Arguments,
    frames: &'a [Frame],
    settings: Compared,
    skipped: &mut usize,
) -> anyhow::Result<Cow<'a, [Frame]>> {
    let Some(shard) = arguments.shard else { return Ok(Cow::Borrowed(frames)) };
    check(arguments, shard, settings)?;
    if shard.index > 1 {
        *skipped = 0;
    }
    let all = frames.iter().enumerate();
    Ok(all.filter(|(index, _)| shard.has(*index)).map(|(_, frame)| frame.clone()).collect())
}

/// The number among all frames of a part's frame.
pub(super) fn place(index: usize, shard: Option<Shard>) -> usize {
    shard.map_or(index, |shard| index * shard.count + shard.index - 1)
}

/// Refuses a folder with parts of other settings, before any work is done.
fn check(arguments: &Arguments, shard: Shard, compared: Compared) -> anyhow::Result<()> {
    let settings = settings(arguments, compared)?;
    for index in 1..=shard.count {
        let path = path(arguments, Shard { index, ..shard });
        if path.exists() && read(&path)?.settings != settings {
            return Err(hint(
                anyhow::anyhow!("`{}` is of an evaluation with other settings", path.display()),
                "give another folder as `--out`, or delete its `shards`",
            ));
        }
    }
    Ok(())
}

/// Writes down this part and, if it was the last one to be done, puts all into `evaluated`; false if others are not
/// done.
pub(super) fn join(
    arguments: &Arguments,
    shard: Shard,
    evaluated: &mut Evaluated,
) -> anyhow::Result<bool> {
    let Evaluated { detections, identity, configurations, .. } = &*evaluated;
    let settings = settings(arguments, (detections, identity, configurations))?;
    let part = Part {
        settings: settings.clone(),
        skipped: evaluated.skipped,
        rows: std::mem::take(&mut evaluated.rows),
    };
    files::write(&path(arguments, shard), &serde_json::to_vec(&part)?)?;
    let parts = (1..=shard.count).map(|index| path(arguments, Shard { index, ..shard }));
    let parts: Vec<PathBuf> = parts.collect();
    let missing = parts.iter().filter(|path| !path.exists()).count();
    if missing > 0 {
        note(format_args!(
            "part {shard} is done; missing: {missing}; the last to be done writes the tables"
        ));
        return Ok(false);
    }
    evaluated.rows = evaluated.configurations.iter().map(|_| Vec::new()).collect();
    evaluated.skipped = 0;
    for path in parts {
        let part = read(&path)?;
        if part.settings != settings || part.rows.len() != evaluated.rows.len() {
            anyhow::bail!("`{}` is of an evaluation with other settings", path.display());
        }
        evaluated.skipped += part.skipped;
        for (all, rows) in evaluated.rows.iter_mut().zip(part.rows) {
            all.extend(rows);
        }
    }
    for rows in &mut evaluated.rows {
        rows.sort_by_key(|row| row.place);
    }
    Ok(true)
}

fn path(arguments: &Arguments, shard: Shard) -> PathBuf {
    arguments.out.join(format!("shards/{}-of-{}.json", shard.index, shard.count))
}

fn read(path: &Path) -> anyhow::Result<Part> {
    let damaged = || format!("`{}` is no part of an evaluation", path.display());
    serde_json::from_slice(&files::read(path)?).with_context(damaged)
}

/// What parts must agree on. The bias of masks, which is measured on the way, follows from the rest.
fn settings(
    arguments: &Arguments,
    (detections, identity, configurations): Compared,
) -> anyhow::Result<Value> {
    let row = |configuration: &Configuration| {
        let mut pose = configuration.pose;
        pose.dense.mask_bias = None;
        json!({
            "name": configuration.name,
            "kernel": configuration.kernel,
            "pose": pose,
            "degradation": configuration.degradation.map(|degradation| degradation.strength),
        })
    };
    let rows: Vec<Value> = configurations.iter().map(row).collect();
    // Another file of the same name is another list.
    let names = arguments.model_names.as_deref().map(files::read_text).transpose()?;
    Ok(json!({
        "settings": output::settings(arguments, detections),
        "identity": identity,
        "model_names": names,
        "rows": rows,
    }))
}
