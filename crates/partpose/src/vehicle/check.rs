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
    #[error("{count} faces have no area, such as that at {at:.2}")]
    Degenerate { count: usize, at: Point3 },
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
