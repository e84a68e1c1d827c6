//! The images that are meant by files, folders and patterns, and what they are called in results.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fs;
use std::path::{self, Component, Path, PathBuf};

use glob::Pattern;
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
            let error = anyhow::anyhow!("no image matches `{text}`");
            let advice = "`[` begins a set of characters; `[[]` stands for the character itself";
            return Err(if text.contains('[') { hint(error, advice) } else { error });
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

/// The entries of a folder, sorted; hidden ones only if they are asked for.
fn entries(folder: &Path, hidden: bool) -> Result<Vec<PathBuf>, FileError> {
    let failed = |source| FileError::read(folder, source);
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if hidden || !name_of(&path).starts_with('.') {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// The last part of a path; what is no UTF-8 in it stands as replacement characters, which `*` and `?` match.
fn name_of(path: &Path) -> Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}

fn search(folder: &Path, depth: usize, paths: &mut BTreeSet<PathBuf>) -> Result<(), FileError> {
    for path in entries(folder, false)? {
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
    let mut root = PathBuf::new();
    let mut parts = Vec::new();
    for component in Path::new(pattern).components() {
        match component {
            Component::Prefix(_) | Component::RootDir => root.push(component),
            other => parts.push(other.as_os_str().to_str().unwrap_or_default()),
        }
    }
    // Below a file there is nothing of an empty name: a pattern that ends so means folders.
    if pattern.ends_with(path::is_separator) {
        parts.push("");
    }
    descend(&root, &parts, DEEPEST, paths)
}

/// Follows the parts of a pattern downwards. The crate `glob`, which could walk, too, panics at names that are no UTF-8
/// and leaves them out.
fn descend(
    place: &Path,
    parts: &[&str],
    depth: usize,
    paths: &mut BTreeSet<PathBuf>,
) -> anyhow::Result<()> {
    let Some((part, rest)) = parts.split_first() else {
        if place.is_dir() {
            search(place, DEEPEST, paths)?;
        } else {
            paths.insert(absolute(place));
        }
        return Ok(());
    };
    // What is there as it is written is meant as it is written: `photos [2024]`.
    let literal = place.join(part);
    if literal.exists() {
        return descend(&literal, rest, depth, paths);
    }
    let folder = if place.as_os_str().is_empty() { Path::new(".") } else { place };
    if !part.contains(['*', '?', '[']) || !folder.is_dir() {
        return Ok(());
    }
    if *part == "**" {
        descend(place, rest, depth, paths)?;
        // A loop of links ends at the deepest folder.
        for below in entries(folder, false)?.iter().filter(|path| depth > 0 && path.is_dir()) {
            descend(below, parts, depth - 1, paths)?;
        }
        return Ok(());
    }
    let wanted = Pattern::new(part)
        .map_err(|error| anyhow::anyhow!("the pattern `{part}` is wrong: {}", error.msg))?;
    for path in entries(folder, part.starts_with('.'))? {
        if wanted.matches(&name_of(&path)) {
            descend(&path, rest, depth, paths)?;
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
    fn hidden_files_must_be_named() {
        let folder = folder();
        fs::create_dir_all(folder.path().join(".cache/x")).unwrap();
        fs::write(folder.path().join(".cache/x/3.png"), b"").unwrap();
        assert_eq!(names(folder.path(), &["**/*.png"], None), ["a/1.png", "b/2.png"]);
        assert_eq!(names(folder.path(), &["a/.h*"], None), [".hidden.png"]);
        assert_eq!(names(folder.path(), &[".c*/**/*.png"], None), ["3.png"]);
    }

    #[test]
    fn a_folder_whose_name_looks_like_a_pattern_is_meant_as_it_is_written() {
        let folder = folder();
        for name in ["photos [2024]/1.png", "photos 2/1.png", "b/photos [2024]/1.png"] {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, b"").unwrap();
        }
        assert_eq!(names(folder.path(), &["photos [2024]/*.png"], None), ["1.png"]);
        assert_eq!(names(folder.path(), &["?/photos [2024]/?.png"], None), ["1.png"]);
        let all = ["photos 2/1.png", "photos [2024]/1.png"];
        assert_eq!(names(folder.path(), &["photos*/"], None), all);
    }

    #[cfg(unix)]
    #[test]
    fn names_that_are_no_text_are_images_like_others() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;
        let folder = folder();
        // Where the file system takes only text there is nothing to be tested.
        if fs::write(folder.path().join("a").join(OsStr::from_bytes(b"\xff.png")), b"").is_err() {
            return;
        }
        let expected = ["1.png", "\u{fffd}.png"];
        for pattern in ["a/*.png", "a", "**/a/?.png"] {
            assert_eq!(names(folder.path(), &[pattern], None), expected, "{pattern}");
        }
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
        let error = collect(&wanted("a/[2].png"), None).unwrap_err();
        assert!(format!("{error:#?}").contains("`[[]`"), "{error:#?}");
        fs::create_dir(folder.path().join("empty")).unwrap();
        assert!(collect(&wanted("empty"), None).is_err());
    }
}
