//! The TOML file that maps the names in a foreign model to parts.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use partpose::files;
use partpose::geometry::Extent;
use partpose::vehicle::import::{Axis, ImportMap, Pattern, Rule, Sides, Target, TargetError};
use toml::Spanned;

use crate::report::hint;

const REMEDY: &str = "`partpose zoo import FILE --template` prints a map to begin with; docs/cad.md tells the format";

/// A map and where its rules stand.
#[derive(Debug)]
pub(super) struct MapFile {
    pub(super) path: PathBuf,
    pub(super) map: ImportMap,
    /// The line of each rule, from 1.
    pub(super) lines: Vec<usize>,
}

/// What a map file may hold.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    name: String,
    category: String,
    body_style: String,
    scale: f64,
    forward: Spanned<String>,
    up: Spanned<String>,
    #[serde(default)]
    mirror: bool,
    sides: Option<Spanned<String>>,
    extent: Option<ExtentEntry>,
    #[serde(default)]
    mirrors_in_extent: bool,
    #[serde(default)]
    ignore: Vec<Spanned<String>>,
    #[serde(default)]
    unlabeled: Vec<Spanned<String>>,
    #[serde(default)]
    parts: BTreeMap<Spanned<String>, Vec<Spanned<String>>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct ExtentEntry {
    width: f64,
    height: f64,
    length: f64,
}

/// Reads a map; every error tells the file and the line.
pub(super) fn read(path: &Path) -> anyhow::Result<MapFile> {
    let text = files::read_text(path)?;
    let fault = |span: Range<usize>, what: &str, remedy: &str| {
        let error = anyhow::anyhow!("`{}` line {}: {what}", path.display(), line_of(&text, span));
        hint(error, remedy)
    };
    let content: Content = toml::from_str(&text).map_err(|error| {
        let what = error.message().lines().next().unwrap_or_default().to_owned();
        fault(error.span().unwrap_or(0..0), &what, REMEDY)
    })?;
    let axis = |entry: &Spanned<String>| {
        let what = format!("`{}` is no axis", printable(entry.get_ref()));
        let remedy = "axes are `+x`, `-x`, `+y`, `-y`, `+z` and `-z`";
        Axis::parse(entry.get_ref()).ok_or_else(|| fault(entry.span(), &what, remedy))
    };
    let sides = match content.sides.as_ref().map(|entry| (entry, entry.get_ref().as_str())) {
        None | Some((_, "names")) => Sides::Names,
        Some((_, "geometry")) => Sides::Geometry,
        Some((entry, other)) => {
            let what = format!("`{}` tells no sides", printable(other));
            let remedy = "`sides` is \"names\" or \"geometry\"";
            return Err(fault(entry.span(), &what, remedy));
        }
    };
    let (mut rules, mut lines) = (Vec::new(), Vec::new());
    let mut add = |patterns: &[Spanned<String>], target: &Target| {
        for pattern in patterns {
            let parsed = Pattern::parse(pattern.get_ref()).map_err(|error| {
                fault(
                    pattern.span(),
                    &error.to_string(),
                    "write a name, or several terms joined by ` + `",
                )
            })?;
            rules.push(Rule { pattern: parsed, target: target.clone() });
            lines.push(line_of(&text, pattern.span()));
        }
        anyhow::Ok(())
    };
    for (key, patterns) in &content.parts {
        let target = Target::parse(key.get_ref()).map_err(|error| {
            let remedy = match error {
                TargetError::Unknown { .. } => {
                    "docs/cad.md lists the 29 parts; `ignore` and `unlabeled` stand above `[parts]`"
                }
                _ => "join a left and a right part, a front and a rear one, or all four",
            };
            fault(key.span(), &error.to_string(), remedy)
        })?;
        add(patterns, &target)?;
    }
    add(&content.ignore, &Target::Ignore)?;
    add(&content.unlabeled, &Target::Unlabeled)?;
    let map = ImportMap {
        name: content.name,
        category: content.category,
        body_style: content.body_style,
        scale: content.scale,
        forward: axis(&content.forward)?,
        up: axis(&content.up)?,
        mirror: content.mirror,
        sides,
        extent: content.extent.map(|e| Extent::new(e.width, e.height, e.length)),
        mirrors_in_extent: content.mirrors_in_extent,
        rules,
    };
    Ok(MapFile { path: path.to_owned(), map, lines })
}

fn line_of(text: &str, span: Range<usize>) -> usize {
    1 + text.get(..span.start).unwrap_or(text).matches('\n').count()
}

fn printable(text: &str) -> String {
    text.chars().take(40).collect::<String>().escape_debug().to_string()
}
