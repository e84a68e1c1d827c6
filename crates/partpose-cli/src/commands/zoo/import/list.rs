//! The names in a foreign model, as a table and as a map to begin with.

use std::fmt::Write;
use std::path::Path;

use partpose::geometry::Point3;
use partpose::parts::PartClass;
use partpose::vehicle::import::{ForeignGroup, ForeignScene};

/// One line a group: names, faces, and where it lies in the file's axes and unit.
pub(super) fn table(scene: &ForeignScene) -> String {
    let mut text = String::from("node\tmesh\tmaterial\tfaces\tcenter\tsize\tpath\n");
    for group in &scene.groups {
        let (low, high) = bounds(std::slice::from_ref(group));
        let (center, size) = (nalgebra::center(&low, &high), high - low);
        let _ = writeln!(
            text,
            "{}\t{}\t{}\t{}\t{}\t{}\t{}",
            group.node,
            group.mesh,
            group.material,
            group.faces.len(),
            triple([center.x, center.y, center.z]),
            triple([size.x, size.y, size.z]),
            group.path,
        );
    }
    text
}

/// A map in which every name that is not that of a part, or a part's colour, is unlabeled.
pub(super) fn template(path: &Path, scene: &ForeignScene) -> String {
    let (low, high) = bounds(&scene.groups);
    let size = high - low;
    let is_gltf = path.extension().is_some_and(|ending| {
        ending.to_ascii_lowercase() != "obj" && ending.to_ascii_lowercase() != "ply"
    });
    let up = if is_gltf { 1 } else { 2 };
    let along = (0..3).filter(|axis| *axis != up).max_by(|a, b| size[*a].total_cmp(&size[*b]));
    let axis = |index: usize| ["x", "y", "z"][index];
    let stem: String =
        path.file_stem().unwrap_or_default().to_string_lossy().chars().take(80).collect();
    let mut text = String::new();
    let _ = writeln!(
        text,
        "# The map of `{}` to parts; docs/cad.md tells all of the format.",
        path.file_name().unwrap_or_default().display()
    );
    let _ = writeln!(text, "name = {}", quoted(&stem));
    let _ = writeln!(text, "category = \"Car\"\nbody_style = \"sedan\"");
    let _ = writeln!(
        text,
        "# Metres in one unit of the file, in which the model is {} large along x, y and z.\nscale = 1.0",
        triple([size.x, size.y, size.z])
    );
    let _ = writeln!(
        text,
        "# Where the front and the roof point: look at the model, these are only the usual axes.\n\
         forward = \"+{}\"\nup = \"+{}\"",
        axis(along.unwrap_or(0)),
        axis(up)
    );
    let (mut named, mut other): (Vec<(PartClass, &str)>, Vec<(&ForeignGroup, usize)>) =
        (Vec::new(), Vec::new());
    for group in &scene.groups {
        let name = shortest_name(group);
        match part_named(group) {
            Some(found) if !named.contains(&found) => named.push(found),
            Some(_) => {}
            None => match other.iter_mut().find(|(known, _)| shortest_name(known) == name) {
                Some((_, faces)) => *faces += group.faces.len(),
                None => other.push((group, group.faces.len())),
            },
        }
    }
    text += "# What is not seen from outside, such as seats.\nignore = []\n";
    text += "# What holds several parts that no name tells apart, and what is not sorted yet.\nunlabeled = [\n";
    for (group, faces) in &other {
        let _ = writeln!(
            text,
            "  {}, # {faces} faces, material {}",
            quoted(shortest_name(group)),
            quoted(&group.material)
        );
    }
    text += "]\n\n[parts]\n";
    for part in PartClass::ALL {
        let names: Vec<String> =
            named.iter().filter(|(of, _)| *of == part).map(|(_, name)| quoted(name)).collect();
        let comment = if names.is_empty() { "# " } else { "" };
        let _ = writeln!(text, "{comment}{} = [{}]", part.name(), names.join(", "));
    }
    text += "# Parts in one group, told apart by where they lie:\n# \"wheels_RL|wheels_RR\" = []\n";
    text
}

/// The part that a group is named after exactly, or whose colour it has, and the name that says so.
fn part_named(group: &ForeignGroup) -> Option<(PartClass, &str)> {
    let names = [&group.material, &group.mesh, &group.node];
    names.into_iter().find_map(|name| {
        let color = |part: &PartClass| {
            let [r, g, b] = part.color();
            *name == format!("color={r},{g},{b}")
        };
        let part = PartClass::from_name(name).or_else(|| PartClass::ALL.into_iter().find(color));
        Some((part?, name.as_str()))
    })
}

/// The name that a pattern would use: the node's, the mesh's, the material's, whichever there is.
pub(super) fn shortest_name(group: &ForeignGroup) -> &str {
    let names = [&group.node, &group.mesh, &group.material, &group.path];
    names.into_iter().find(|name| !name.is_empty()).map_or("*", String::as_str)
}

/// A TOML string; JSON's escapes are TOML's.
pub(super) fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn bounds(groups: &[ForeignGroup]) -> (Point3, Point3) {
    let far = Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let points = groups.iter().flat_map(|group| &group.vertices);
    points.fold((far, -far), |(low, high), p| (low.inf(p), high.sup(p)))
}

fn triple(values: [f64; 3]) -> String {
    values.map(|value| format!("{value:.3}")).join(" ")
}
