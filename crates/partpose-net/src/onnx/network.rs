//! The network's layers as ONNX operators: what `MaskRcnn::detect` computes, from pixels to detections.

use super::boxes::{
    Scored, anchors, best, columns, decoded, exponentials, gather, is_wide, kept, proportions,
    soft_max, suppressed,
};
use super::graph::Attribute::{Int, Ints, Text};
use super::graph::{Axis, Element, Graph, Value};
use super::{BOXES, EXTENT_SIGMAS, EXTENTS, IMAGE, MODELS, PARTS, SCORES, regions};
use crate::anchors::LevelAnchors;
use crate::config::{Neck, NetConfig};
use crate::fpn::Fpn;
use crate::heads::{CHANNELS, Doubling, PartHead};
use crate::layers::{Conv, Linear, Norm, to_host};
use crate::mask_rcnn::MaskRcnn;
use crate::resnet::{Block, ResNet};
use crate::rpn::{LEAST_SIDE, RpnHead};
use crate::vehicle_head::{MOST, TYPICAL_DEVIATION, TYPICAL_EXTENTS, VehicleHead};

/// Adds the whole network; its normalisation is folded into convolutions first.
pub(super) fn add(g: &mut Graph, net: &MaskRcnn, size: Option<[usize; 2]>) {
    let net = burn::module::Module::valid(net).fold();
    let config = net.config();
    let [width, height] = match size {
        Some(size) => size.map(Axis::Fixed),
        None => [Axis::Free("width"), Axis::Free("height")],
    };
    let axes = [Axis::Fixed(1), Axis::Fixed(3), height, width];
    let image = g.input(IMAGE, Element::Float, &axes);
    let (input, limits) = prepared(g, config, &image);
    let maps = feature_maps(g, &net, &input);
    let proposals = proposals(g, &net.rpn, config, &maps, &limits);
    let found = detections(g, &net, &maps, &proposals, &limits);
    let features = part_features(g, &net, &maps, &found.corners);
    let hidden = part_hidden(g, &net.part_head, &features);
    let logits = part_logits(g, &net.part_head, &hidden);
    let parts = soft_max(g, &logits);
    let count = Axis::Free("vehicles");
    let kernel = Axis::Fixed(config.parts.kernel);
    g.output(&found.corners, BOXES, Element::Float, &[count, Axis::Fixed(4)]);
    g.output(&found.scores, SCORES, Element::Float, &[count]);
    let axes = [count, Axis::Fixed(CHANNELS), kernel, kernel];
    g.output(&parts, PARTS, Element::Float, &axes);
    if let Some(head) = &net.vehicle_head {
        add_vehicle_head(g, head, &hidden, &found.corners);
    }
}

/// Model and size of each vehicle, out of what the part head's convolutions found.
fn add_vehicle_head(g: &mut Graph, head: &VehicleHead, hidden: &Value, corners: &Value) {
    let x = conv(g, &head.conv, hidden);
    let x = relu(g, &x);
    let x = g.node("Flatten", &[&x], &[]);
    let proportions = proportions(g, corners);
    let x = g.node("Concat", &[&x, &proportions], &[("axis", Int(1))]);
    let x = linear(g, &head.fc, &x);
    let x = relu(g, &x);
    let count = Axis::Free("vehicles");
    if let Some(layer) = &head.model {
        let logits = linear(g, layer, &x);
        let models = soft_max(g, &logits);
        let names = layer.bias.val().dims()[0];
        g.output(&models, MODELS, Element::Float, &[count, Axis::Fixed(names)]);
    }
    if let Some(layer) = &head.extent {
        let values = linear(g, layer, &x);
        let [sides, sigmas] = [[0, 3], [3, 6]].map(|range| columns(g, &values, range));
        let sides = exponentials(g, &sides, MOST, &TYPICAL_EXTENTS);
        let sigmas = exponentials(g, &sigmas, MOST, &[TYPICAL_DEVIATION; 3]);
        g.output(&sides, EXTENTS, Element::Float, &[count, Axis::Fixed(3)]);
        g.output(&sigmas, EXTENT_SIGMAS, Element::Float, &[count, Axis::Fixed(3)]);
    }
}

/// The image normalised and padded on the right and below; and its width, height, width, height.
fn prepared(g: &mut Graph, config: &NetConfig, image: &Value) -> (Value, Value) {
    let shape = g.node("Shape", &[image], &[]);
    let axes = g.ints(&[3, 2, 3, 2]);
    let limits = gather(g, &shape, &axes);
    let limits = g.node("Cast", &[&limits], &[("to", Int(1))]);
    let [mean, deviation] =
        [config.input.mean, config.input.deviation].map(|values| g.floats(&values, &[3, 1, 1]));
    let x = g.node("Sub", &[image, &mean], &[]);
    let x = g.node("Div", &[&x, &deviation], &[]);
    // (32 - side mod 32) mod 32 on both axes.
    let step = g.ints(&[MaskRcnn::SIDE_STEP as i64; 2]);
    let sides = g.ints(&[2, 3]);
    let sides = gather(g, &shape, &sides);
    let rest = g.node("Mod", &[&sides, &step], &[]);
    let missing = g.node("Sub", &[&step, &rest], &[]);
    let missing = g.node("Mod", &[&missing, &step], &[]);
    let none = g.ints(&[0; 6]);
    let pads = g.node("Concat", &[&none, &missing], &[("axis", Int(0))]);
    (g.node("Pad", &[&x, &pads], &[]), limits)
}

/// Maps of all levels, finest first.
fn feature_maps(g: &mut Graph, net: &MaskRcnn, input: &Value) -> Vec<Value> {
    match (&net.fpn, net.config().neck) {
        (Some(fpn), Neck::Fpn { finest, .. }) => {
            let maps = backbone(g, &net.backbone, input, 4);
            pyramid(g, fpn, &maps[finest - 2..])
        }
        _ => backbone(g, &net.backbone, input, 3).split_off(2),
    }
}

fn conv(g: &mut Graph, conv: &Conv, x: &Value) -> Value {
    let weight = conv.weight.val();
    let [out, channels, height, width] = weight.dims();
    let weight = g.floats(&to_host(weight), &[out, channels, height, width]);
    let bias = match &conv.bias {
        Some(bias) => g.floats(&to_host(bias.val()), &[out]),
        None => Value::none(),
    };
    let [stride, padding, dilation] = [conv.stride, conv.padding, conv.dilation].map(|v| v as i64);
    let attributes = [
        ("kernel_shape", Ints(&[height as i64, width as i64])),
        ("strides", Ints(&[stride; 2])),
        ("pads", Ints(&[padding; 4])),
        ("dilations", Ints(&[dilation; 2])),
    ];
    g.node("Conv", &[x, &weight, &bias], &attributes)
}

fn relu(g: &mut Graph, x: &Value) -> Value {
    g.node("Relu", &[x], &[])
}

/// `size`, `stride` and `padding` along both axes.
pub(super) fn max_pool(g: &mut Graph, x: &Value, [size, stride, padding]: [i64; 3]) -> Value {
    let attributes = [
        ("kernel_shape", Ints(&[size; 2])),
        ("strides", Ints(&[stride; 2])),
        ("pads", Ints(&[padding; 4])),
    ];
    g.node("MaxPool", &[x], &attributes)
}

fn backbone(g: &mut Graph, net: &ResNet, input: &Value, stages: usize) -> Vec<Value> {
    let x = conv(g, &net.conv1, input);
    let x = relu(g, &x);
    let mut x = max_pool(g, &x, [3, 2, 1]);
    let mut maps = Vec::new();
    for layer in [&net.layer1, &net.layer2, &net.layer3, &net.layer4].into_iter().take(stages) {
        x = stage(g, layer, &x);
        maps.push(x.clone());
    }
    maps
}

fn stage(g: &mut Graph, blocks: &[Block], input: &Value) -> Value {
    blocks.iter().fold(input.clone(), |x, of| block(g, of, &x))
}

fn block(g: &mut Graph, block: &Block, input: &Value) -> Value {
    let residual = match &block.downsample {
        Some((downsample, _)) => conv(g, downsample, input),
        None => input.clone(),
    };
    let x = conv(g, &block.conv1, input);
    let x = relu(g, &x);
    let mut x = conv(g, &block.conv2, &x);
    if let Some(third) = &block.conv3 {
        x = relu(g, &x);
        x = conv(g, third, &x);
    }
    let sum = g.node("Add", &[&x, &residual], &[]);
    relu(g, &sum)
}

fn pyramid(g: &mut Graph, fpn: &Fpn, maps: &[Value]) -> Vec<Value> {
    let mut levels = Vec::new();
    let mut above: Option<Value> = None;
    let blocks: Vec<(&(Conv, Option<Norm>), &(Conv, Option<Norm>))> =
        fpn.inner_blocks.iter().zip(&fpn.layer_blocks).collect();
    for ((inner, layer), map) in blocks.into_iter().zip(maps).rev() {
        let mut sum = conv(g, &inner.0, map);
        if let Some(above) = above {
            let scales = g.floats(&[1.0, 1.0, 2.0, 2.0], &[4]);
            let attributes = [
                ("mode", Text("nearest")),
                ("coordinate_transformation_mode", Text("asymmetric")),
                ("nearest_mode", Text("floor")),
            ];
            let twice = g.node("Resize", &[&above, &Value::none(), &scales], &attributes);
            sum = g.node("Add", &[&sum, &twice], &[]);
        }
        levels.push(conv(g, &layer.0, &sum));
        above = Some(sum);
    }
    levels.reverse();
    for _ in 0..fpn.extra {
        let coarsest = levels[levels.len() - 1].clone();
        levels.push(max_pool(g, &coarsest, [1, 2, 0]));
    }
    levels
}

/// Proposals, `[n, 4]`, best first.
fn proposals(
    g: &mut Graph,
    head: &RpnHead,
    config: &NetConfig,
    maps: &[Value],
    limits: &Value,
) -> Value {
    let counts = config.rpn.inference;
    // Sizes of maps, which the model finds out when it runs, do not change the kinds.
    let unknown = vec![[0, 0]; maps.len()];
    let levels = LevelAnchors::all(&config.anchors, &unknown, &config.strides());
    let [mut all_corners, mut all_scores] = [Vec::new(), Vec::new()];
    for (map, level) in maps.iter().zip(&levels) {
        let x = conv(g, &head.conv, map);
        let x = relu(g, &x);
        let [logits, deltas] = [&head.cls_logits, &head.bbox_pred].map(|of| conv(g, of, &x));
        let flat = g.ints(&[-1]);
        let logits = g.node("Reshape", &[&logits, &flat], &[]);
        let by_kind = g.ints(&[level.kinds.len() as i64, 4, -1]);
        let deltas = g.node("Reshape", &[&deltas, &by_kind], &[]);
        let deltas = g.node("Transpose", &[&deltas], &[("perm", Ints(&[0, 2, 1]))]);
        let rows = g.ints(&[-1, 4]);
        let deltas = g.node("Reshape", &[&deltas, &rows], &[]);
        let [scores, chosen] = best(g, &logits, counts.before);
        let deltas = gather(g, &deltas, &chosen);
        let anchors = anchors(g, map, level);
        let anchors = gather(g, &anchors, &chosen);
        let corners = decoded(g, [&deltas, &anchors, limits], config.boxes.coder);
        let is_wide = is_wide(g, &corners, LEAST_SIDE);
        let [corners, scores] = [&corners, &scores].map(|rows| kept(g, rows, &is_wide));
        let of = Scored { corners, scores };
        let chosen = suppressed(g, &of, config.rpn.nms_iou, counts.after);
        all_corners.push(gather(g, &of.corners, &chosen));
        all_scores.push(gather(g, &of.scores, &chosen));
    }
    let [corners, scores] = [all_corners, all_scores]
        .map(|values| g.node("Concat", &values.iter().collect::<Vec<_>>(), &[("axis", Int(0))]));
    let [_, chosen] = best(g, &scores, counts.after);
    gather(g, &corners, &chosen)
}

/// What is found, without parts, best first.
fn detections(
    g: &mut Graph,
    net: &MaskRcnn,
    maps: &[Value],
    proposals: &Value,
    limits: &Value,
) -> Scored {
    let config = net.config();
    let features = regions::read(g, config, maps, proposals, config.regions.box_cells);
    let features = match config.neck {
        Neck::C4 { .. } => {
            let features = stage(g, &net.backbone.layer4, &features);
            g.node("GlobalAveragePool", &[&features], &[])
        }
        Neck::Fpn { .. } => features,
    };
    let mut x = g.node("Flatten", &[&features], &[]);
    let head = &net.box_head;
    for layer in [&head.fc6, &head.fc7].into_iter().flatten() {
        x = linear(g, layer, &x);
        x = relu(g, &x);
    }
    let logits = linear(g, &head.cls_score, &x);
    let scores = soft_max(g, &logits);
    let scores = columns(g, &scores, [1, 2]);
    let flat = g.ints(&[-1]);
    let scores = g.node("Reshape", &[&scores, &flat], &[]);
    let deltas = linear(g, &head.bbox_pred, &x);
    let corners = decoded(g, [&deltas, proposals, limits], config.boxes.coder);
    let threshold = g.float(config.boxes.score_threshold);
    let is_sure = g.node("GreaterOrEqual", &[&scores, &threshold], &[]);
    let is_wide = is_wide(g, &corners, 1.0);
    let is_good = g.node("And", &[&is_sure, &is_wide], &[]);
    let [corners, scores] = [&corners, &scores].map(|rows| kept(g, rows, &is_good));
    let of = Scored { corners, scores };
    let chosen = suppressed(g, &of, config.boxes.nms_iou, config.boxes.max_detections);
    Scored { corners: gather(g, &of.corners, &chosen), scores: gather(g, &of.scores, &chosen) }
}

fn linear(g: &mut Graph, layer: &Linear, x: &Value) -> Value {
    let weight = layer.weight.val();
    let [out, inputs] = weight.dims();
    let weight = g.floats(&to_host(weight), &[out, inputs]);
    let bias = g.floats(&to_host(layer.bias.val()), &[out]);
    g.node("Gemm", &[x, &weight, &bias], &[("transB", Int(1))])
}

fn part_features(g: &mut Graph, net: &MaskRcnn, maps: &[Value], corners: &Value) -> Value {
    let config = net.config();
    match config.neck {
        Neck::C4 { .. } => {
            let features = regions::read(g, config, maps, corners, config.regions.box_cells);
            stage(g, &net.backbone.layer4, &features)
        }
        Neck::Fpn { .. } => regions::read(g, config, maps, corners, config.regions.part_cells),
    }
}

/// What the part head's convolutions find.
fn part_hidden(g: &mut Graph, head: &PartHead, features: &Value) -> Value {
    let mut x = features.clone();
    if head.upscale_first {
        x = resize(g, &x, head.kernel, "align_corners");
    }
    for (of, _) in &head.convs {
        x = conv(g, of, &x);
        x = relu(g, &x);
    }
    x
}

/// `[n, 30, m, m]`.
fn part_logits(g: &mut Graph, head: &PartHead, hidden: &Value) -> Value {
    let mut x = hidden.clone();
    if let Some(of) = &head.conv5_mask {
        x = doubled(g, of, &x);
    } else if !head.upscale_first {
        x = resize(g, &x, head.kernel, "half_pixel");
    }
    conv(g, &head.mask_fcn_logits, &x)
}

fn doubled(g: &mut Graph, of: &Doubling, x: &Value) -> Value {
    let weight = of.weight.val();
    let shape = weight.dims();
    let weight = g.floats(&to_host(weight), &shape);
    let bias = g.floats(&to_host(of.bias.val()), &[shape[1]]);
    let attributes = [("kernel_shape", Ints(&[2; 2])), ("strides", Ints(&[2; 2]))];
    let x = g.node("ConvTranspose", &[x, &weight, &bias], &attributes);
    relu(g, &x)
}

/// Bilinear, to `size` cells a side.
fn resize(g: &mut Graph, x: &Value, size: usize, corners: &str) -> Value {
    let shape = g.node("Shape", &[x], &[]);
    let first = g.ints(&[0, 1]);
    let first = gather(g, &shape, &first);
    let sides = g.ints(&[size as i64; 2]);
    let target = g.node("Concat", &[&first, &sides], &[("axis", Int(0))]);
    let attributes = [("mode", Text("linear")), ("coordinate_transformation_mode", Text(corners))];
    let none = Value::none();
    g.node("Resize", &[x, &none, &none, &target], &attributes)
}
