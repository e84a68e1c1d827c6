//! Vehicles through the frames of a sequence: what `--track` of `run` and `fit` adds to results that are written.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use partpose::files;
use partpose::formats::{KittiRow, kitti_tracking_text, observations, with_tracks};
use partpose::geometry::Pose;
use partpose::track::{SequenceFrame, TrackOptions, TrackedPose, Tracker, smooth_sequence};
use partpose::vehicle::ModelZoo;

use crate::commands::result_files;
use crate::report::{hint, note};

/// Folder of the sequences' files below the output.
const TRACKS: &str = "tracks";
/// What the file of images without a folder is called.
const ONLY: &str = "sequence";

#[derive(clap::Args)]
pub(crate) struct TrackFlags {
    /// Take the images of a folder, in the order of their names, for the frames of a sequence: vehicles get numbers that
    /// they keep, and beside the pose of its frame each gets the one that the frames agree on: `smooth` looks at those
    /// before and after, `filter` only at those before
    #[arg(
        long, value_enum, value_name = "HOW", num_args = 0..=1, require_equals = true,
        default_missing_value = "smooth"
    )]
    pub(crate) track: Option<TrackMode>,
    /// Frames a second of sequences; frames that are missing count, where names end in numbers
    #[arg(long, value_name = "N", default_value_t = 10.0, value_parser = parse_rate)]
    fps: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TrackMode {
    /// From all frames of the sequence
    Smooth,
    /// From the frames up to each
    Filter,
}

pub(crate) fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=10_000.0).contains(&value) => Ok(value),
        _ => Err("frames a second, from 0.01 to 10000, are meant".to_owned()),
    }
}

/// An image whose results are written.
pub(crate) struct Frame {
    /// Its name with folders.
    pub(crate) name: String,
    /// Name of its files, without endings.
    pub(crate) stem: String,
    /// Where its camera stands, if that is known.
    pub(crate) world_from_camera: Option<Pose>,
}

/// Follows the vehicles of all sequences, adds their tracks to the results and writes a file a sequence.
///
/// Images without results are left out: they were reported when they could not be done.
pub(crate) fn track(
    out: &Path,
    frames: &[Frame],
    flags: &TrackFlags,
    zoo: &ModelZoo,
) -> anyhow::Result<()> {
    let Some(mode) = flags.track else { return Ok(()) };
    let mut sequences: BTreeMap<&str, Vec<&Frame>> = BTreeMap::new();
    for frame in frames.iter().filter(|frame| path_of(out, frame).is_file()) {
        let folder = frame.name.rsplit_once('/').map_or("", |(folder, _)| folder);
        sequences.entry(folder).or_default().push(frame);
    }
    let (mut vehicles, mut sightings) = (0, 0);
    for (folder, frames) in &mut sequences {
        let numbers = numbers(frames);
        let read = read(out, frames, &numbers, flags.fps)?;
        let tracked = match mode {
            TrackMode::Smooth => smooth_sequence(&read, &TrackOptions::default()),
            TrackMode::Filter => filter(&read),
        };
        let mut rows = Vec::new();
        let in_order = frames.iter().zip(&numbers).zip(read.iter().zip(&tracked));
        for ((frame, number), (read, tracked)) in in_order {
            let path = path_of(out, frame);
            let text = with_tracks(&path, &files::read(&path)?, tracked)?;
            files::write(&path, text.as_bytes())?;
            for (seen, tracked) in read.seen.iter().zip(tracked) {
                let Some(tracked) = tracked else { continue };
                let row = row(tracked, seen, zoo);
                rows.push((*number, tracked.track, row));
            }
        }
        let name = if folder.is_empty() { ONLY.to_owned() } else { result_files::stem(folder) };
        let path = out.join(TRACKS).join(format!("{name}.txt"));
        files::write(&path, kitti_tracking_text(&rows).as_bytes())?;
        sightings += rows.len();
        let mut ids: Vec<u32> = rows.iter().map(|(_, track, _)| *track).collect();
        ids.sort_unstable();
        ids.dedup();
        vehicles += ids.len();
    }
    note(format_args!(
        "followed {vehicles} vehicles through {sightings} sightings in {} sequences; wrote `{}`",
        sequences.len(),
        out.join(TRACKS).display()
    ));
    Ok(())
}

fn path_of(out: &Path, frame: &Frame) -> PathBuf {
    out.join(format!("{}.json", frame.stem))
}

fn row(tracked: &TrackedPose, seen: &partpose::track::Observation, zoo: &ModelZoo) -> KittiRow {
    let category = zoo.get(&tracked.model).map_or("Car", |model| model.category());
    KittiRow {
        category: category.to_owned(),
        truncation: None,
        occluded: None,
        bounds: seen.bounds,
        cuboid: tracked.cuboid,
        score: seen.score,
    }
}

fn filter(frames: &[SequenceFrame]) -> Vec<Vec<Option<TrackedPose>>> {
    let mut tracker = Tracker::new(&TrackOptions::default());
    let step = |frame: &SequenceFrame| {
        tracker.step(frame.time, &frame.camera, &frame.camera_from_previous, &frame.seen)
    };
    frames.iter().map(step).collect()
}

/// The numbers in which the names end, if they do and rise; else 0, 1, 2. Frames are put in their order.
fn numbers(frames: &mut [&Frame]) -> Vec<u64> {
    let own: Option<Vec<u64>> = frames.iter().map(|frame| number(&frame.name)).collect();
    if let Some(own) = own {
        let mut order: Vec<(u64, &Frame)> = own.into_iter().zip(frames.iter().copied()).collect();
        order.sort_by_key(|(number, _)| *number);
        if order.windows(2).all(|pair| pair[0].0 < pair[1].0) {
            for (place, (_, frame)) in frames.iter_mut().zip(&order) {
                *place = frame;
            }
            return order.into_iter().map(|(number, _)| number).collect();
        }
    }
    (0..frames.len() as u64).collect()
}

/// The number in which a name without its ending ends.
fn number(name: &str) -> Option<u64> {
    let stem = Path::new(name).file_stem()?.to_str()?;
    let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    // Longer numbers are times of some clock, not of frames.
    (1..=9).contains(&digits).then(|| stem[stem.len() - digits..].parse().ok())?
}

fn read(
    out: &Path,
    frames: &[&Frame],
    numbers: &[u64],
    fps: f64,
) -> anyhow::Result<Vec<SequenceFrame>> {
    let mut before: Option<Pose> = None;
    let mut read = Vec::with_capacity(frames.len());
    for (frame, number) in frames.iter().zip(numbers) {
        let path = path_of(out, frame);
        let (camera, seen) = observations(&path, &files::read(&path)?).map_err(|error| {
            hint(error, "write it anew: run the same command without `--resume`")
        })?;
        let moved = match (&frame.world_from_camera, &before) {
            (Some(now), Some(before)) => now.inverse() * before,
            _ => Pose::identity(),
        };
        before = frame.world_from_camera;
        let time = (number - numbers[0]) as f64 / fps;
        read.push(SequenceFrame { time, camera, camera_from_previous: moved, seen });
    }
    Ok(read)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(names: &[&str]) -> (Vec<String>, Vec<u64>) {
        let frames: Vec<Frame> = names
            .iter()
            .map(|name| Frame {
                name: (*name).to_owned(),
                stem: String::new(),
                world_from_camera: None,
            })
            .collect();
        let mut frames: Vec<&Frame> = frames.iter().collect();
        let numbers = numbers(&mut frames);
        (frames.iter().map(|frame| frame.name.clone()).collect(), numbers)
    }

    #[test]
    fn frames_go_by_the_numbers_in_their_names() {
        let (names, numbers) = numbered(&["a/f10.png", "a/f9.png", "a/f12.png"]);
        assert_eq!(names, ["a/f9.png", "a/f10.png", "a/f12.png"]);
        assert_eq!(numbers, [9, 10, 12]);
        for names in
            [["x.png", "y1.png"], ["a1.png", "b1.png"], ["f16095879870000000.png", "f2.png"]]
        {
            assert_eq!(numbered(&names), (names.map(str::to_owned).to_vec(), vec![0, 1]));
        }
    }
}
