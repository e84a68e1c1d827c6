//! Whether a model has the size of a vehicle, and lies in its cuboid.

use std::ops::RangeInclusive;

use crate::geometry::Point3;
use crate::parts::PartClass;
use crate::vehicle::PartialModel;

use super::Finding;

/// Length of a vehicle, metres: a small quadricycle to a long bus or truck. Chosen.
const LENGTH: RangeInclusive<f64> = 2.0..=12.5;
/// Width, mirrors included, metres. Chosen.
const WIDTH: RangeInclusive<f64> = 0.9..=3.5;
/// Height, metres. Chosen.
const HEIGHT: RangeInclusive<f64> = 0.8..=4.5;
/// Length of cars and vans, into which a wrong unit is brought back, metres.
const USUAL_LENGTH: RangeInclusive<f64> = 3.0..=7.0;
/// Centimetres, millimetres, inches and feet taken for metres, and the other way round.
const FACTORS: [f64; 8] = [0.01, 0.001, 0.0254, 0.3048, 100.0, 1000.0, 39.37, 3.281];
/// Share of a side by which mesh and cuboid may differ: annotated cuboids of data sets differ by a sixth. Chosen.
const TOLERANCE: f64 = 0.25;
/// How far off the ground the lowest point may be, metres.
const GROUND: f64 = 0.1;
/// Greatest height as a share of the width: high vans have 1.5.
const MAX_HEIGHT: f64 = 1.8;

pub(super) fn check(model: &PartialModel, findings: &mut Vec<Finding>) {
    let is_mirror = |part: &Option<PartClass>| {
        matches!(part, Some(PartClass::MirrorLeft | PartClass::MirrorRight))
    };
    let Some((low, high)) = bounds(model, &|_| true) else { return };
    let (body_low, body_high) = bounds(model, &|part| !is_mirror(part)).unwrap_or((low, high));
    let (extent, size, body) = (model.extent, high - low, body_high - body_low);
    if !(LENGTH.contains(&extent.length)
        && WIDTH.contains(&extent.width)
        && HEIGHT.contains(&extent.height))
    {
        let fits = |factor: &&f64| {
            USUAL_LENGTH.contains(&(**factor * extent.length))
                && WIDTH.contains(&(**factor * extent.width))
                && HEIGHT.contains(&(**factor * extent.height))
        };
        findings.push(Finding::Size { extent, factor: FACTORS.iter().find(fits).copied() });
    }
    let (width, height, length) = (body.x, body.y, body.z);
    if height > MAX_HEIGHT * width.min(length) {
        findings.push(Finding::Upended { height, width, length });
    } else if width > length {
        findings.push(Finding::Across { width, length });
    }
    // The cuboid may or may not take the mirrors in.
    let sides = [
        ("wide", extent.width, [body.x, size.x]),
        ("high", extent.height, [body.y, size.y]),
        ("long", extent.length, [body.z, size.z]),
    ];
    for (along, cuboid, meshes) in sides {
        if meshes.iter().all(|mesh| (mesh - cuboid).abs() > TOLERANCE * cuboid) {
            findings.push(Finding::CuboidSize { along, mesh: meshes[0], cuboid });
        }
    }
    let center = nalgebra::center(&body_low, &body_high);
    let places = [
        (center.x, extent.width, ["right of", "left of"]),
        (center.z, extent.length, ["ahead of", "behind"]),
    ];
    for (off, side, [positive, negative]) in places {
        if off.abs() > TOLERANCE * side {
            let direction = if off > 0.0 { positive } else { negative };
            findings.push(Finding::CuboidPlace { by: off.abs(), direction });
        }
    }
    if high.y.abs() > GROUND {
        findings.push(Finding::OffGround { y: high.y });
    }
}

fn bounds(
    model: &PartialModel,
    keep: &dyn Fn(&Option<PartClass>) -> bool,
) -> Option<(Point3, Point3)> {
    let faces = model.faces.iter().zip(&model.parts).filter(|(_, part)| keep(part));
    let points = faces.flat_map(|(face, _)| face).map(|at| model.vertices[*at as usize]);
    points.fold(None, |bounds, p| {
        let (low, high) = bounds.unwrap_or((p, p));
        Some((low.inf(&p), high.sup(&p)))
    })
}
