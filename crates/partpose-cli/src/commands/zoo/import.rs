//! `partpose zoo import`: reads a CAD model and gives its parts their classes by name.

mod list;
mod map_file;
mod record;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use partpose::parts::PartClass;
use partpose::vehicle::import::{ForeignScene, ImportError, Imported, apply_map, read_scene};
use partpose::vehicle::{ModelZoo, PartialModel};

use self::map_file::MapFile;
use crate::report::{self, Outcome, hint};

/// Most names that are told one by one.
const MAX_TOLD: usize = 20;

#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("what").required(true).args(["map", "list", "template"])))]
#[command(after_help = "\
Examples:
  partpose zoo import hatchback.obj --list
  partpose zoo import hatchback.obj --template > hatchback.toml
  partpose zoo import hatchback.obj --map hatchback.toml --out zoo")]
pub(crate) struct Arguments {
    /// Model to read: .glb, .gltf, .obj or .ply
    #[arg(value_name = "FILE")]
    model: PathBuf,
    /// TOML file that says which names are which parts, and the axes and the unit of the model
    #[arg(long, value_name = "MAP", requires = "out")]
    map: Option<PathBuf>,
    /// Folder to write the model to, beside those that are there
    #[arg(long, value_name = "ZOO", requires = "map")]
    out: Option<PathBuf>,
    /// Leave faces of names that the map does not know without a part, instead of stopping
    #[arg(long)]
    allow_unknown: bool,
    /// List the names in the model instead
    #[arg(long)]
    list: bool,
    /// Print a map to begin with instead
    #[arg(long)]
    template: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let path = &arguments.model;
    // A wrong map is told before a large model is read.
    let map = arguments.map.as_deref().map(map_file::read).transpose()?;
    let scene = read_scene(path).map_err(|error| {
        let remedy = error.remedy();
        match remedy {
            Some(remedy) => hint(error, remedy),
            None => ImportError::into(error),
        }
    })?;
    for remark in &scene.remarks {
        report::warn(format_args!("`{}`: {remark}", path.display()));
    }
    let (Some(map), Some(out)) = (map, &arguments.out) else {
        let text = if arguments.list { list::table(&scene) } else { list::template(path, &scene) };
        report::data(&text)?;
        return Ok(Outcome::Done);
    };
    let imported = apply_map(&scene, &map.map).map_err(|error| {
        let remedy = error.remedy();
        let context = format!("cannot use the map `{}`", map.path.display());
        hint(anyhow::Error::new(error).context(context), remedy)
    })?;
    let is_known = tell_unknown(path, &scene, &map, &imported, arguments.allow_unknown)?;
    for fault in &imported.wrong_sides {
        let side = if fault.x > 0.0 { "right" } else { "left" };
        report::warn(format_args!(
            "`{}` is mapped to `{}`, but lies {:.2} m on the {side}",
            scene.groups[fault.group].path,
            fault.part.name(),
            fault.x.abs(),
        ));
    }
    if !imported.wrong_sides.is_empty() {
        report::note(
            "hint: if `forward` and `up` are right, the names are wrong: exchange them, or write \
             `sides = \"geometry\"` into the map; `mirror = true` is for files with left-handed axes",
        );
    }
    let file = ModelZoo::add_to(out, &imported.model)?;
    record::write(out, path, &map, &imported)
        .with_context(|| format!("the model `{}` is written", file.display()))?;
    report::data(&table(&imported.model))?;
    tell_written(&file, &imported);
    let is_clean = is_known && imported.wrong_sides.is_empty();
    Ok(if is_clean { Outcome::Done } else { Outcome::Skipped })
}

/// Tells names that the map does not know and those that the model does not have; whether there were none.
fn tell_unknown(
    path: &Path,
    scene: &ForeignScene,
    map: &MapFile,
    imported: &Imported,
    allow: bool,
) -> anyhow::Result<bool> {
    let mut problems = Vec::new();
    for rule in &imported.unused {
        problems.push(format!(
            "`{}` line {}: no name in `{}` fits `{}`",
            map.path.display(),
            map.lines[*rule],
            path.display(),
            map.map.rules[*rule].pattern.text,
        ));
    }
    // Many groups may bear one name.
    let mut names: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for group in imported.unknown.iter().map(|at| &scene.groups[*at]) {
        *names.entry((&group.path, &group.material)).or_default() += group.faces.len();
    }
    for ((path, material), faces) in &names {
        problems
            .push(format!("the map does not know `{path}` (material `{material}`, {faces} faces)"));
    }
    if problems.is_empty() {
        return Ok(true);
    }
    for problem in problems.iter().take(MAX_TOLD) {
        report::warn(problem);
    }
    if problems.len() > MAX_TOLD {
        report::warn(format_args!("and {} more", problems.len() - MAX_TOLD));
    }
    if allow {
        return Ok(false);
    }
    let error = anyhow::anyhow!(
        "the map `{}` and the names in `{}` do not fit: {} unknown, {} without a use",
        map.path.display(),
        path.display(),
        names.len(),
        imported.unused.len(),
    );
    Err(hint(error, advice(scene, imported)))
}

/// Lines to put into the map.
fn advice(scene: &ForeignScene, imported: &Imported) -> String {
    if imported.unknown.is_empty() {
        return "correct or remove these patterns (`--list` shows the names), or give `--allow-unknown`"
            .to_owned();
    }
    let mut names: Vec<&str> = Vec::new();
    for group in imported.unknown.iter().map(|at| &scene.groups[*at]) {
        let name = list::shortest_name(group);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let mut text = "give each a part under `[parts]`, or put it into `ignore` (interior) or `unlabeled` (parts that no name \
                    tells apart); `--allow-unknown` takes all for unlabeled. To begin with:\n  unlabeled = ["
        .to_owned();
    for (at, name) in names.iter().take(MAX_TOLD).enumerate() {
        let _ = write!(text, "{}{}", if at > 0 { ", " } else { "" }, list::quoted(name));
    }
    text + "]"
}

/// How many faces each part has.
fn table(model: &PartialModel) -> String {
    let mut text = String::from("part\tfaces\n");
    for part in PartClass::ALL {
        let faces = model.parts.iter().filter(|of| **of == Some(part)).count();
        if faces > 0 {
            let _ = writeln!(text, "{}\t{faces}", part.name());
        }
    }
    if model.unlabeled() > 0 {
        let _ = writeln!(text, "unlabeled\t{}", model.unlabeled());
    }
    text
}

fn tell_written(file: &Path, imported: &Imported) {
    let (model, extent) = (&imported.model, imported.model.extent);
    report::note(format_args!(
        "wrote `{}`: {} faces, {:.2} x {:.2} x {:.2} m (width, height, length); left out {} ignored and {} without area",
        file.display(),
        model.faces.len(),
        extent.width,
        extent.height,
        extent.length,
        imported.ignored,
        imported.degenerate,
    ));
    if model.unlabeled() > 0 {
        report::note(format_args!(
            "hint: {} faces have no part yet: `partpose zoo annotate` gives them theirs",
            model.unlabeled()
        ));
    }
    report::note(format_args!(
        "hint: look for faults with `partpose zoo check {}`",
        file.display()
    ));
}
