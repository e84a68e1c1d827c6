//! Anchors, boxes and non-maximum suppression as ONNX operators: what `anchors.rs`, `boxes.rs` and `rpn.rs` compute.

use super::graph::Attribute::{Int, Ints};
use super::graph::{Graph, Value};
use crate::anchors::LevelAnchors;
use crate::boxes::{LEAST_SIZE, MOST_GROWTH};

/// Boxes, `[n, 4]`, and their scores, `[n]`.
#[derive(Clone, Debug)]
pub(super) struct Scored {
    pub(super) corners: Value,
    pub(super) scores: Value,
}

/// Columns `from..to` of `[n, k]`.
pub(super) fn columns(g: &mut Graph, of: &Value, [from, to]: [i64; 2]) -> Value {
    let [starts, ends, axes] = [from, to, 1].map(|value| g.ints(&[value]));
    g.node("Slice", &[of, &starts, &ends, &axes], &[])
}

/// Rows in the order of indices.
pub(super) fn gather(g: &mut Graph, of: &Value, indices: &Value) -> Value {
    g.node("Gather", &[of, indices], &[("axis", Int(0))])
}

/// Length of the first axis, `[1]`, but at most `most`.
fn count(g: &mut Graph, of: &Value, most: usize) -> Value {
    let shape = g.node("Shape", &[of], &[]);
    let zero = g.ints(&[0]);
    let first = gather(g, &shape, &zero);
    let most = g.ints(&[i64::try_from(most).unwrap_or(i64::MAX)]);
    g.node("Min", &[&first, &most], &[])
}

/// Scores of the best at most `most`, and their indices, best first.
pub(super) fn best(g: &mut Graph, scores: &Value, most: usize) -> [Value; 2] {
    let count = count(g, scores, most);
    g.node_with_two("TopK", &[scores, &count], &[("axis", Int(0))])
}

/// Anchors of a map, `[anchors, 4]`, in the order of its output.
pub(super) fn anchors(g: &mut Graph, map: &Value, level: &LevelAnchors) -> Value {
    let shape = g.node("Shape", &[map], &[]);
    let mut places = |axis: i64, stride: f32, shape_of: [i64; 4], unit: [f32; 4]| {
        let axis = g.int(axis);
        let length = gather(g, &shape, &axis);
        let [zero, one] = [g.int(0), g.int(1)];
        let cells = g.node("Range", &[&zero, &length, &one], &[]);
        let cells = g.node("Cast", &[&cells], &[("to", Int(1))]);
        let offset = g.float(level.offset);
        let cells = g.node("Add", &[&cells, &offset], &[]);
        let stride = g.float(stride);
        let cells = g.node("Mul", &[&cells, &stride], &[]);
        let shape_of = g.ints(&shape_of);
        let cells = g.node("Reshape", &[&cells, &shape_of], &[]);
        let unit = g.floats(&unit, &[4]);
        g.node("Mul", &[&cells, &unit], &[])
    };
    let y = places(2, level.stride[0], [1, -1, 1, 1], [0.0, 1.0, 0.0, 1.0]);
    let x = places(3, level.stride[1], [1, 1, -1, 1], [1.0, 0.0, 1.0, 0.0]);
    let shifts = g.node("Add", &[&y, &x], &[]);
    let kinds = g.floats(&level.kinds.concat(), &[level.kinds.len(), 1, 1, 4]);
    let all = g.node("Add", &[&kinds, &shifts], &[]);
    let rows = g.ints(&[-1, 4]);
    g.node("Reshape", &[&all, &rows], &[])
}

/// Boxes `[n, 4]` that `deltas` are of `from`, limited to the image: `limits` are its width, height, width, height.
pub(super) fn decoded(
    g: &mut Graph,
    [deltas, from, limits]: [&Value; 3],
    coder: [f32; 4],
) -> Value {
    let factors = g.floats(&coder, &[4]);
    let deltas = g.node("Div", &[deltas, &factors], &[]);
    let [first, second] = [columns(g, from, [0, 2]), columns(g, from, [2, 4])];
    let size = g.node("Sub", &[&second, &first], &[]);
    let least = g.float(LEAST_SIZE);
    let size = g.node("Max", &[&size, &least], &[]);
    let half = g.float(0.5);
    let centre = g.node("Add", &[&first, &second], &[]);
    let centre = g.node("Mul", &[&centre, &half], &[]);
    let [shift, growth] = [columns(g, &deltas, [0, 2]), columns(g, &deltas, [2, 4])];
    let shift = g.node("Mul", &[&shift, &size], &[]);
    let centre = g.node("Add", &[&centre, &shift], &[]);
    let most = g.float(MOST_GROWTH);
    let growth = g.node("Min", &[&growth, &most], &[]);
    let growth = g.node("Exp", &[&growth], &[]);
    let size = g.node("Mul", &[&size, &growth], &[]);
    let size = g.node("Mul", &[&size, &half], &[]);
    let first = g.node("Sub", &[&centre, &size], &[]);
    let second = g.node("Add", &[&centre, &size], &[]);
    let corners = g.node("Concat", &[&first, &second], &[("axis", Int(1))]);
    let zero = g.float(0.0);
    let corners = g.node("Max", &[&corners, &zero], &[]);
    g.node("Min", &[&corners, limits], &[])
}

/// Whether both sides of boxes have at least so many pixels, `[n]`.
pub(super) fn is_wide(g: &mut Graph, corners: &Value, least: f32) -> Value {
    let [first, second] = [columns(g, corners, [0, 2]), columns(g, corners, [2, 4])];
    let size = g.node("Sub", &[&second, &first], &[]);
    let shorter = g.node("ReduceMin", &[&size], &[("axes", Ints(&[1])), ("keepdims", Int(0))]);
    let least = g.float(least);
    g.node("GreaterOrEqual", &[&shorter, &least], &[])
}

/// Rows where a condition holds.
pub(super) fn kept(g: &mut Graph, rows: &Value, condition: &Value) -> Value {
    g.node("Compress", &[rows, condition], &[("axis", Int(0))])
}

/// Indices of the boxes that non-maximum suppression keeps, best first, `[k]`.
pub(super) fn suppressed(g: &mut Graph, of: &Scored, iou: f32, most: usize) -> Value {
    let [one, all] = [g.ints(&[1, -1, 4]), g.ints(&[1, 1, -1])];
    let boxes = g.node("Reshape", &[&of.corners, &one], &[]);
    let scores = g.node("Reshape", &[&of.scores, &all], &[]);
    let most = g.ints(&[most as i64]);
    let iou = g.floats(&[iou], &[1]);
    let chosen = g.node("NonMaxSuppression", &[&boxes, &scores, &most, &iou], &[]);
    let last = columns(g, &chosen, [2, 3]);
    let flat = g.ints(&[-1]);
    g.node("Reshape", &[&last, &flat], &[])
}

/// The exponent of the stride of the map that suits each box, less `finest`, from 0 to `last`: `level_of` of the network.
pub(super) fn levels(g: &mut Graph, corners: &Value, [finest, last]: [usize; 2]) -> Value {
    let [first, second] = [columns(g, corners, [0, 2]), columns(g, corners, [2, 4])];
    let size = g.node("Sub", &[&second, &first], &[]);
    let area = g.node("ReduceProd", &[&size], &[("axes", Ints(&[1])), ("keepdims", Int(0))]);
    let side = g.node("Sqrt", &[&area], &[]);
    let usual = g.float(224.0);
    let ratio = g.node("Div", &[&side, &usual], &[]);
    let tiny = g.float(1e-6);
    let ratio = g.node("Add", &[&ratio, &tiny], &[]);
    let logarithm = g.node("Log", &[&ratio], &[]);
    let two = g.float(std::f32::consts::LN_2);
    let logarithm = g.node("Div", &[&logarithm, &two], &[]);
    let shift = g.float(4.0 - finest as f32);
    let level = g.node("Add", &[&logarithm, &shift], &[]);
    let level = g.node("Floor", &[&level], &[]);
    let [least, most] = [g.float(0.0), g.float(last as f32)];
    let level = g.node("Clip", &[&level, &least, &most], &[]);
    g.node("Cast", &[&level], &[("to", Int(7))])
}

/// Soft-max along an axis.
pub(super) fn soft_max(g: &mut Graph, logits: &Value) -> Value {
    g.node("Softmax", &[logits], &[("axis", Int(1))])
}

/// The exponential of values within `-most..most`, times a factor each.
pub(super) fn exponentials(g: &mut Graph, of: &Value, most: f32, factors: &[f32]) -> Value {
    let [low, high] = [g.float(-most), g.float(most)];
    let limited = g.node("Clip", &[of, &low, &high], &[]);
    let values = g.node("Exp", &[&limited], &[]);
    let factors = g.floats(factors, &[factors.len()]);
    g.node("Mul", &[&values, &factors], &[])
}

/// Logarithms of width over height, `[n, 1]`; sides count as at least a pixel.
pub(super) fn proportions(g: &mut Graph, corners: &Value) -> Value {
    let [first, second] = [columns(g, corners, [0, 2]), columns(g, corners, [2, 4])];
    let size = g.node("Sub", &[&second, &first], &[]);
    let pixel = g.float(1.0);
    let size = g.node("Max", &[&size, &pixel], &[]);
    let [width, height] = [columns(g, &size, [0, 1]), columns(g, &size, [1, 2])];
    let ratio = g.node("Div", &[&width, &height], &[]);
    g.node("Log", &[&ratio], &[])
}
