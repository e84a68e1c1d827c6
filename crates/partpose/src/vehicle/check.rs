//! What is wrong with a model, and what to do about it.
//!
//! Pure functions of the model: nothing is repaired. A finding is an error where poses fitted with the model would be
//! wrong (swapped sides, wrong scale), a warning where something is probably not meant (holes, flecks), and a note
//! where it is worth knowing (a two-door car has no rear doors).

mod layout;
mod size;
mod surface;

use crate::geometry::{Extent, Point3};
use crate::parts::PartClass;

use super::{PartialModel, VehicleModel};

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth knowing.
    Note,
    /// Probably not meant.
    Warning,
    /// Poses fitted with the model would be wrong.
    Error,
}

impl Severity {
    /// In lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// Something found in a model; its text says what, with numbers. Lengths are metres, areas square metres.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the texts tell the fields")]
pub enum Finding {
    #[error("{faces} of {of} faces have no part")]
    Unlabeled { faces: usize, of: usize },
    #[error("there is no `{}`", .part.name())]
    MissingPart { part: PartClass },
    #[error("there is a `{}` but no `{}`", .part.opposite().name(), .part.name())]
    MissingCounterpart { part: PartClass },
    #[error("`{}` lies {:.2} m on the {} side", .part.name(), .x.abs(), if *.x > 0.0 { "right" } else { "left" })]
    WrongSide { part: PartClass, x: f64 },
    #[error("every part of the left lies on the right, and the other way round")]
    SidesSwapped,
    #[error("`{}` lies {by:.2} m ahead of `{}`", .rear.name(), .front.name())]
    WrongEnd { front: PartClass, rear: PartClass, by: f64 },
    #[error("every part of the front lies behind that of the rear")]
    EndsSwapped,
    #[error("the front is at the rear: sides and ends are exchanged")]
    Backwards,
    #[error("the wheels are above the body: it lies on its roof")]
    UpsideDown,
    #[error("`{}` has {ratio:.1} times the area of `{}`", .larger.name(), .larger.opposite().name())]
    Asymmetric { larger: PartClass, ratio: f64 },
    #[error("`{}` has an area of {:.2} cm2 only", .part.name(), .area * 1e4)]
    TinyPart { part: PartClass, area: f64 },
    #[error("the vehicle is {:.3} x {:.3} x {:.3} m large (width, height, length)", .extent.width, .extent.height, .extent.length)]
    Size {
        extent: Extent,
        /// What the coordinates would have to be multiplied with, where a usual unit explains it.
        factor: Option<f64>,
    },
    #[error("the vehicle is {width:.2} m wide and only {length:.2} m long")]
    Across { width: f64, length: f64 },
    #[error("the vehicle is {height:.2} m high, {width:.2} m wide and {length:.2} m long")]
    Upended { height: f64, width: f64, length: f64 },
    #[error("the mesh is {mesh:.2} m {along}, its cuboid {cuboid:.2} m")]
    CuboidSize { along: &'static str, mesh: f64, cuboid: f64 },
    #[error("the middle of the mesh lies {by:.2} m {direction} that of its cuboid")]
    CuboidPlace { by: f64, direction: &'static str },
    #[error("the lowest point lies {:.2} m {} the ground", .y.abs(), if *.y > 0.0 { "below" } else { "above" })]
    OffGround {
        /// Positive downwards.
        y: f64,
    },
    #[error("{count} of {of} faces have no area, such as that at {at:.2}")]
    Degenerate { count: usize, of: usize, at: Point3 },
    #[error("{count} faces are there twice, such as that at {at:.2}")]
    Duplicate { count: usize, at: Point3 },
    #[error("{open} of {pieces} pieces are open: {edges} edges have a face on one side only")]
    Open { open: usize, pieces: usize, edges: usize },
    #[error("{edges} edges have more than two faces")]
    NonManifold { edges: usize },
    #[error("{edges} edges have faces that are turned against each other")]
    Unoriented { edges: usize },
    #[error("{pieces} closed pieces are inside out")]
    InsideOut { pieces: usize },
    #[error("most faces look inwards")]
    MostlyInsideOut,
    #[error(
        "{count} small pieces lie {distance:.2} m or more from the rest, such as that at {at:.2}"
    )]
    Flecks { count: usize, distance: f64, at: Point3 },
}

impl Finding {
    /// How much it matters.
    pub fn severity(&self) -> Severity {
        match self {
            Self::Unlabeled { .. }
            | Self::MissingCounterpart { .. }
            | Self::WrongSide { .. }
            | Self::SidesSwapped
            | Self::WrongEnd { .. }
            | Self::EndsSwapped
            | Self::Backwards
            | Self::UpsideDown
            | Self::Size { .. }
            | Self::Across { .. }
            | Self::Upended { .. } => Severity::Error,
            Self::MissingPart { part } => layout::severity_of_missing(*part),
            // A few slivers come from every cut; many mean a broken export.
            Self::Degenerate { count, of, .. } if 20 * count < *of => Severity::Note,
            Self::NonManifold { .. } => Severity::Note,
            _ => Severity::Warning,
        }
    }

    /// A word for programs.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Unlabeled { .. } => "unlabeled",
            Self::MissingPart { .. } => "missing-part",
            Self::MissingCounterpart { .. } => "missing-counterpart",
            Self::WrongSide { .. } => "wrong-side",
            Self::SidesSwapped => "sides-swapped",
            Self::WrongEnd { .. } => "wrong-end",
            Self::EndsSwapped => "ends-swapped",
            Self::Backwards => "backwards",
            Self::UpsideDown => "upside-down",
            Self::Asymmetric { .. } => "asymmetric",
            Self::TinyPart { .. } => "tiny-part",
            Self::Size { .. } => "size",
            Self::Across { .. } => "across",
            Self::Upended { .. } => "upended",
            Self::CuboidSize { .. } => "cuboid-size",
            Self::CuboidPlace { .. } => "cuboid-place",
            Self::OffGround { .. } => "off-ground",
            Self::Degenerate { .. } => "degenerate",
            Self::Duplicate { .. } => "duplicate",
            Self::Open { .. } => "open",
            Self::NonManifold { .. } => "non-manifold",
            Self::Unoriented { .. } => "unoriented",
            Self::InsideOut { .. } => "inside-out",
            Self::MostlyInsideOut => "mostly-inside-out",
            Self::Flecks { .. } => "flecks",
        }
    }

    /// What to do about it.
    pub fn remedy(&self) -> String {
        let text = match self {
            Self::Unlabeled { .. } => "give them their parts with `partpose zoo annotate`",
            Self::MissingPart { part } => layout::remedy_of_missing(*part),
            Self::MissingCounterpart { .. } => {
                "map the counterpart too; if one group holds both, write `\"LEFT|RIGHT\" = [...]`"
            }
            Self::WrongSide { .. } => {
                "exchange the names in the map, or write `sides = \"geometry\"` into it"
            }
            Self::SidesSwapped => {
                "the names are exchanged (`sides = \"geometry\"` in the map), or the file has left-handed axes (`mirror = true`)"
            }
            Self::WrongEnd { .. } => "exchange the names in the map",
            Self::EndsSwapped => "exchange front and rear in the names of the map",
            Self::Backwards => "turn `forward` of the map round",
            Self::UpsideDown => "turn `up` of the map round",
            Self::Asymmetric { .. } => "look whether a group of one side is missing in the map",
            Self::TinyPart { .. } => {
                "look whether the map names a fastener or the like instead of the part"
            }
            Self::Size { factor: Some(factor), .. } => {
                return format!("multiply the `scale` of the map by {factor}");
            }
            Self::Size { factor: None, .. } => {
                "correct the `scale` of the map, and `ignore` what does not belong to the vehicle"
            }
            Self::Across { .. } => "correct `forward` of the map",
            Self::Upended { .. } => "correct `up` of the map",
            Self::CuboidSize { .. } | Self::CuboidPlace { .. } => {
                "correct `extent` of the map, or leave it out so that the mesh tells it"
            }
            Self::OffGround { .. } => {
                "`ignore` what hangs below the wheels, or map the wheels if they are missing"
            }
            Self::Degenerate { .. } => {
                "harmless for drawing; delete them in a modeller (Blender: Merge by Distance)"
            }
            Self::Duplicate { .. } => {
                "delete doubles in a modeller, or `ignore` the group that repeats another"
            }
            Self::Open { .. } => {
                "harmless for drawing; close holes in a modeller if the volume or the inside matter"
            }
            Self::NonManifold { .. } => "harmless for drawing",
            Self::Unoriented { .. } | Self::InsideOut { .. } | Self::MostlyInsideOut => {
                "let a modeller turn normals outwards (Blender: Recalculate Outside)"
            }
            Self::Flecks { .. } => "`ignore` their groups in the map, or delete them in a modeller",
        };
        text.to_owned()
    }
}

/// What is found in a model, what matters most first.
pub fn check_model(model: &VehicleModel) -> Vec<Finding> {
    check_partial(&PartialModel::from(model))
}

/// What is found in a model of which faces may have no part; the missing parts are then left out.
///
/// It must be consistent, as [`PartialModel::check`] tells.
pub fn check_partial(model: &PartialModel) -> Vec<Finding> {
    let mut findings = Vec::new();
    if model.unlabeled() > 0 {
        let (faces, of) = (model.unlabeled(), model.faces.len());
        findings.push(Finding::Unlabeled { faces, of });
    }
    layout::check(model, &mut findings);
    size::check(model, &mut findings);
    surface::check(model, &mut findings);
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity()));
    findings
}

/// Corners of a face.
fn corners(model: &PartialModel, face: [u32; 3]) -> [Point3; 3] {
    face.map(|at| model.vertices[at as usize])
}

/// Area of a triangle.
fn area([a, b, c]: [Point3; 3]) -> f64 {
    0.5 * (b - a).cross(&(c - a)).norm()
}

/// Middle of a triangle.
fn middle([a, b, c]: [Point3; 3]) -> Point3 {
    Point3::from((a.coords + b.coords + c.coords) / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::{ModelZoo, ParametricVehicle};

    fn sedan() -> PartialModel {
        PartialModel::from(&ParametricVehicle::sedan().build().unwrap())
    }

    /// The kinds found, without notes.
    fn kinds(model: &PartialModel) -> Vec<&'static str> {
        let found = check_partial(model);
        let grave = found.iter().filter(|finding| finding.severity() > Severity::Note);
        grave.map(Finding::kind).collect()
    }

    fn moved(change: impl Fn(&Point3) -> Point3) -> PartialModel {
        let mut model = sedan();
        model.vertices.iter_mut().for_each(|p| *p = change(p));
        model
    }

    fn relabeled(change: impl Fn(PartClass) -> PartClass) -> PartialModel {
        let mut model = sedan();
        model.parts.iter_mut().flatten().for_each(|part| *part = change(*part));
        model
    }

    #[test]
    fn nothing_is_wrong_with_the_models_that_come_along() {
        for model in ModelZoo::embedded().models {
            let found = check_model(&model);
            assert!(
                found.iter().all(|f| f.severity() == Severity::Note),
                "{}: {found:?}",
                model.name()
            );
        }
    }

    #[test]
    fn a_model_the_wrong_way_round_is_told_as_a_whole() {
        assert_eq!(kinds(&moved(|p| Point3::new(-p.x, p.y, -p.z))), ["backwards"]);
        assert_eq!(kinds(&relabeled(PartClass::opposite)), ["sides-swapped"]);
        let roof = moved(|p| Point3::new(-p.x, -1.45 - p.y, p.z));
        assert_eq!(kinds(&roof), ["sides-swapped", "upside-down"]);
        let mirrored = kinds(&moved(|p| Point3::new(-p.x, p.y, p.z)));
        assert_eq!(mirrored, ["sides-swapped", "mostly-inside-out"]);
    }

    #[test]
    fn single_parts_in_the_wrong_place_are_named() {
        let swapped = relabeled(|part| match part {
            PartClass::WheelFrontLeft | PartClass::WheelFrontRight => part.opposite(),
            other => other,
        });
        let texts: Vec<String> = check_partial(&swapped).iter().map(ToString::to_string).collect();
        assert!(
            texts[0].starts_with("`wheels_FL` lies 0.") && texts[0].ends_with("on the right side"),
            "{texts:?}"
        );
        assert!(texts[1].starts_with("`wheels_FR`"), "{texts:?}");
        let ends = relabeled(|part| match part {
            PartClass::Hood => PartClass::Trunk,
            PartClass::Trunk => PartClass::Hood,
            other => other,
        });
        assert_eq!(kinds(&ends), ["wrong-end"]);
    }

    #[test]
    fn wrong_units_are_told_with_the_factor() {
        for (unit, expected) in [(100.0, "0.01"), (1000.0, "0.001"), (0.001, "1000")] {
            let mut model = sedan();
            model.vertices.iter_mut().for_each(|p| *p *= unit);
            let e = model.extent;
            model.extent = Extent::new(e.width * unit, e.height * unit, e.length * unit);
            let found = check_partial(&model);
            let size = found.iter().find(|finding| finding.kind() == "size").unwrap();
            assert_eq!(size.remedy(), format!("multiply the `scale` of the map by {expected}"));
        }
    }

    #[test]
    fn wrong_axes_and_cuboids_are_told() {
        let across = moved(|p| Point3::new(-p.z, p.y, p.x));
        assert!(kinds(&across).contains(&"across"));
        let upended = moved(|p| Point3::new(p.x, -p.z - 2.35, p.y));
        assert!(kinds(&upended).contains(&"upended"));
        let mut small = sedan();
        small.extent.length *= 0.5;
        assert!(kinds(&small).contains(&"cuboid-size"));
        assert_eq!(kinds(&moved(|p| Point3::new(p.x, p.y, p.z + 2.0))), ["cuboid-place"]);
        assert_eq!(kinds(&moved(|p| Point3::new(p.x, p.y - 0.5, p.z))), ["off-ground"]);
    }

    #[test]
    fn missing_and_tiny_and_uneven_parts_are_told() {
        let without = |gone: &[PartClass]| {
            let mut model = sedan();
            let keep: Vec<bool> = model
                .parts
                .iter()
                .map(|part| part.is_none_or(|part| !gone.contains(&part)))
                .collect();
            let mut at = keep.iter();
            model.faces.retain(|_| *at.next().unwrap());
            let mut at = keep.iter();
            model.parts.retain(|_| *at.next().unwrap());
            model
        };
        let found = check_partial(&without(&[PartClass::DoorRearLeft, PartClass::DoorRearRight]));
        let doors: Vec<_> = found.iter().filter(|f| f.kind() == "missing-part").collect();
        assert_eq!(doors.len(), 2);
        assert!(doors.iter().all(|finding| finding.severity() == Severity::Note));
        let found = kinds(&without(&[PartClass::MirrorLeft]));
        assert!(found.contains(&"missing-counterpart"), "{found:?}");
        assert!(kinds(&without(&[PartClass::Hood])).contains(&"missing-part"));
        let uneven = relabeled(|part| match part {
            PartClass::DoorRearLeft => PartClass::DoorFrontLeft,
            other => other,
        });
        assert!(kinds(&uneven).contains(&"asymmetric"));
    }

    #[test]
    fn faults_of_the_surface_are_counted() {
        let mut open = sedan();
        open.faces.pop();
        open.parts.pop();
        assert_eq!(kinds(&open), ["open"]);
        let mut turned = sedan();
        turned.faces[0].swap(1, 2);
        assert_eq!(kinds(&turned), ["unoriented"]);
        let mut inside_out = sedan();
        inside_out.faces.iter_mut().for_each(|face| face.swap(1, 2));
        assert_eq!(kinds(&inside_out), ["mostly-inside-out"]);
        let mut doubled = sedan();
        let (face, part) = (doubled.faces[0], doubled.parts[0]);
        doubled.faces.push(face);
        doubled.parts.push(part);
        assert!(kinds(&doubled).contains(&"duplicate"));
        let mut flat = sedan();
        let [a, b, _] = flat.faces[0];
        let many = flat.faces.len() / 10;
        flat.faces.extend(vec![[a, b, b]; many]);
        flat.parts.extend(vec![flat.parts[0]; many]);
        assert_eq!(kinds(&flat), ["degenerate"]);
        let mut fleck = sedan();
        let start = fleck.vertices.len() as u32;
        let corner = |x: f64, z: f64| Point3::new(x, -0.1, z);
        fleck.vertices.extend([corner(0.0, 9.0), corner(0.05, 9.0), corner(0.0, 9.05)]);
        fleck.faces.push([start, start + 1, start + 2]);
        fleck.parts.push(Some(PartClass::Hood));
        assert!(kinds(&fleck).contains(&"flecks"));
    }
}
