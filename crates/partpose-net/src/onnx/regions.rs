//! Features of regions as ONNX operators: what `ops/roi_align.rs` computes.

use super::boxes::{columns, gather, levels};
use super::graph::Attribute::{Float, Int, Text};
use super::graph::{Graph, Value};
use super::network::max_pool;
use crate::config::{Neck, NetConfig, RegionKind};

/// Features of boxes `[n, 4]`, `[n, channels, cells, cells]`, each read from the map that suits its size.
pub(super) fn read(
    g: &mut Graph,
    config: &NetConfig,
    maps: &[Value],
    corners: &Value,
    cells: usize,
) -> Value {
    let strides = config.strides();
    match config.neck {
        Neck::C4 { .. } => read_map(g, config, (&maps[0], strides[0]), corners, cells),
        Neck::Fpn { finest, .. } => {
            let last = 5 - finest;
            let level = levels(g, corners, [finest, last]);
            let mut features = Vec::new();
            let mut places = Vec::new();
            for (index, map) in maps[..=last].iter().enumerate() {
                let own = g.int(index as i64);
                let is_own = g.node("Equal", &[&level, &own], &[]);
                let place = g.node("NonZero", &[&is_own], &[]);
                let flat = g.ints(&[-1]);
                let place = g.node("Reshape", &[&place, &flat], &[]);
                let corners = gather(g, corners, &place);
                features.push(read_map(g, config, (map, strides[index]), &corners, cells));
                places.push(place);
            }
            let features = concat(g, &features);
            let places = concat(g, &places);
            // Where each box's features went: the inverse of the permutation.
            let count = g.node("Shape", &[&places], &[]);
            let sorted = g.node_with_two("TopK", &[&places, &count], &[("largest", Int(0))]);
            gather(g, &features, &sorted[1])
        }
    }
}

fn concat(g: &mut Graph, values: &[Value]) -> Value {
    g.node("Concat", &values.iter().collect::<Vec<_>>(), &[("axis", Int(0))])
}

fn read_map(
    g: &mut Graph,
    config: &NetConfig,
    (map, stride): (&Value, usize),
    corners: &Value,
    cells: usize,
) -> Value {
    let scale = 1.0 / stride as f32;
    match config.regions.kind {
        RegionKind::RoiAlign => roi_align(g, [map, corners], (cells, config.regions.points), scale),
        RegionKind::CropAndResize => {
            let corners = around_points(g, [map, corners], 2 * cells, scale);
            let features = roi_align(g, [map, &corners], (2 * cells, 1), 1.0);
            max_pool(g, &features, [2, 2, 0])
        }
    }
}

fn roi_align(
    g: &mut Graph,
    [map, corners]: [&Value; 2],
    (cells, points): (usize, usize),
    scale: f32,
) -> Value {
    // All regions are of the first image.
    let first = columns(g, corners, [0, 1]);
    let shape = g.node("Shape", &[&first], &[]);
    let flat = g.ints(&[-1]);
    let images = g.node("ConstantOfShape", &[&shape], &[]);
    let images = g.node("Cast", &[&images], &[("to", Int(7))]);
    let images = g.node("Reshape", &[&images, &flat], &[]);
    let size = Int(cells as i64);
    g.node(
        "RoiAlign",
        &[map, corners, &images],
        &[
            ("output_height", size),
            ("output_width", size),
            ("sampling_ratio", Int(points as i64)),
            ("spatial_scale", Float(scale)),
            ("mode", Text("avg")),
            ("coordinate_transformation_mode", Text("half_pixel")),
        ],
    )
}

/// Boxes in cells whose bins' middles are the points of `crop_and_resize`: the outer ones on the box's edge, and a pixel
/// `scale * (cells - 1) / cells` of the map.
fn around_points(g: &mut Graph, [map, corners]: [&Value; 2], bins: usize, scale: f32) -> Value {
    let shape = g.node("Shape", &[map], &[]);
    let axes = g.ints(&[3, 2, 3, 2]);
    let cells = gather(g, &shape, &axes);
    let cells = g.node("Cast", &[&cells], &[("to", Int(1))]);
    let one = g.float(1.0);
    let less = g.node("Sub", &[&cells, &one], &[]);
    let share = g.node("Div", &[&less, &cells], &[]);
    let scale = g.float(scale);
    let share = g.node("Mul", &[&share, &scale], &[]);
    let in_cells = g.node("Mul", &[corners, &share], &[]);
    let [first, second] = [columns(g, &in_cells, [0, 2]), columns(g, &in_cells, [2, 4])];
    let extent = g.node("Sub", &[&second, &first], &[]);
    let half_bin = g.float(0.5 / (bins - 1) as f32);
    let margin = g.node("Mul", &[&extent, &half_bin], &[]);
    // `RoiAlign` takes half a cell off.
    let half = g.float(0.5);
    let first = g.node("Sub", &[&first, &margin], &[]);
    let second = g.node("Add", &[&second, &margin], &[]);
    let both = g.node("Concat", &[&first, &second], &[("axis", Int(1))]);
    g.node("Add", &[&both, &half], &[])
}
