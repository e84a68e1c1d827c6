//! The images that are meant by files, folders and patterns, and what they are called in results.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glob::{MatchOptions, glob_with};
use partpose::files::FileError;
use partpose::labeling::Shard;

use crate::commands::result_files;
use crate::report::hint;

/// Endings of images that are looked for in folders.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
/// Folders within folders that are searched; more is a loop or a mistake.
const DEEPEST: usize = 16;

/// An image to look at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Input {
    pub(super) path: PathBuf,
    /// Its path below the folder that all images share.
    pub(super) name: String,
    /// Name of its results, without an ending.
    pub(super) stem: String,
}

/// All images that are meant, sorted by path, each once; of a shard only its part.
pub(super) fn collect(wanted: &[String], shard: Option<Shard>) -> anyhow::Result<Vec<Input>> {
    let mut paths = BTreeSet::new();
    for text in wanted {
        expand(text, &mut paths)?;
    }
    let paths: Vec<PathBuf> = paths.into_iter().collect();
    let base = common_folder(&paths);
    let names: Vec<String> = paths
        .iter()
        .map(|path| {
            let below = path.strip_prefix(&base).unwrap_or(path);
            let parts = below.components().map(|part| part.as_os_str().to_string_lossy());
            parts.collect::<Vec<_>>().join("/")
        })
        .collect();
    let stems = result_files::stems(&names)?;
    let inputs = paths.into_iter().zip(names).zip(stems);
    let inputs = inputs.map(|((path, name), stem)| Input { path, name, stem });
    let all: Vec<Input> = match shard {
        Some(shard) => inputs
            .enumerate()
            .filter(|(index, _)| shard.has(*index))
            .map(|(_, input)| input)
            .collect(),
        None => inputs.collect(),
    };
    if all.is_empty() {
        anyhow::bail!("this shard has no image: there are fewer images than shards");
    }
    Ok(all)
}

/// Adds the images that one argument means, those that are known already included.
fn expand(text: &str, paths: &mut BTreeSet<PathBuf>) -> anyhow::Result<()> {
    let path = Path::new(text);
    let mut found = BTreeSet::new();
    if path.is_dir() {
        search(path, DEEPEST, &mut found)?;
        if found.is_empty() {
            return Err(hint(
                anyhow::anyhow!("the folder `{text}` holds no image"),
                "PNG and JPEG files are looked for in it and in its folders",
            ));
        }
    } else if path.exists() {
        found.insert(absolute(path));
    } else if text.contains(['*', '?', '[']) {
        matching(text, &mut found)?;
        if found.is_empty() {
            anyhow::bail!("no image matches `{text}`");
        }
    } else {
        anyhow::bail!("there is no image or folder `{text}`");
    }
    paths.append(&mut found);
    Ok(())
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

fn is_image(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
}

/// The entries of a folder, hidden ones left out.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let failed = |source| FileError::read(folder, source);
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with('.') {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

fn search(folder: &Path, depth: usize, paths: &mut BTreeSet<PathBuf>) -> Result<(), FileError> {
    for path in entries(folder)? {
        if path.is_dir() {
            // A loop of links ends at the deepest folder.
            if depth > 0 {
                search(&path, depth - 1, paths)?;
            }
        } else if is_image(&path) {
            paths.insert(absolute(&path));
        }
    }
    Ok(())
}

/// The files that a pattern means: `*`, `?` and `[0-9]` within a name, `**` for any folders; hidden ones must be named.
fn matching(pattern: &str, paths: &mut BTreeSet<PathBuf>) -> anyhow::Result<()> {
    let options = MatchOptions { require_literal_leading_dot: true, ..MatchOptions::new() };
    let found = glob_with(pattern, options)
        .map_err(|error| anyhow::anyhow!("the pattern `{pattern}` is wrong: {}", error.msg))?;
    for path in found {
        let path = path.map_err(|error| {
            let place = error.path().to_owned();
            FileError::read(&place, error.into())
        })?;
        if path.is_dir() {
            search(&path, DEEPEST, paths)?;
        } else {
            paths.insert(absolute(&path));
        }
    }
    Ok(())
}

/// The deepest folder that holds all files.
fn common_folder(paths: &[PathBuf]) -> PathBuf {
    let mut folders = paths.iter().filter_map(|path| path.parent());
    let Some(first) = folders.next() else { return PathBuf::new() };
    folders.fold(first.to_owned(), |common, folder| {
        let shared = common.components().zip(folder.components());
        shared.take_while(|(a, b)| a == b).map(|(a, _)| a).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b/2.png", "b/1.JPG", "a/1.png", "a/notes.txt", "a/.hidden.png"] {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, b"").unwrap();
        }
        folder
    }

    fn names(folder: &Path, wanted: &[&str], shard: Option<Shard>) -> Vec<String> {
        let wanted: Vec<String> =
            wanted.iter().map(|text| folder.join(text).display().to_string()).collect();
        let inputs = collect(&wanted, shard).unwrap();
        inputs.into_iter().map(|input| input.name).collect()
    }

    #[test]
    fn folders_patterns_and_files_are_images_by_their_paths() {
        let folder = folder();
        let all = ["a/1.png", "b/1.JPG", "b/2.png"];
        assert_eq!(names(folder.path(), &["."], None), all);
        assert_eq!(names(folder.path(), &["*/?.*"], None), all);
        assert_eq!(names(folder.path(), &["*/[12].*"], None), all);
        assert_eq!(names(folder.path(), &["**/*.[pJ]*"], None), all);
        assert_eq!(names(folder.path(), &["b/2.png"], None), ["2.png"]);
        assert_eq!(names(folder.path(), &["b/2.png", "b", "b/*.png"], None), ["1.JPG", "2.png"]);
    }

    #[test]
    fn shards_share_the_images() {
        let folder = folder();
        let part = |text: &str| names(folder.path(), &["."], Some(text.parse().unwrap()));
        assert_eq!(part("1/2"), ["a/1.png", "b/2.png"]);
        assert_eq!(part("2/2"), ["b/1.JPG"]);
    }

    #[test]
    fn what_names_no_image_is_an_error() {
        let folder = folder();
        let wanted = |text: &str| vec![folder.path().join(text).display().to_string()];
        for nothing in ["c", "*.png", "a/?", "a/[", "***"] {
            assert!(collect(&wanted(nothing), None).is_err(), "{nothing}");
        }
        fs::create_dir(folder.path().join("empty")).unwrap();
        assert!(collect(&wanted("empty"), None).is_err());
    }
}
