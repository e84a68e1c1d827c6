//! Times our engine and ONNX Runtime on an image, by turns:
//! `cargo run --release -p partpose-onnx --example engines -- WEIGHTS IMAGE [TIMES]`.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use std::path::Path;
use std::time::Instant;

use burn::tensor::Device;
use partpose_net::{Detector, onnx, weights};
use partpose_onnx::mapping::Resize;
use partpose_onnx::{Mapping, OnnxDetector};

/// Processor time of all threads so far, ms, where the system tells.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = text.rsplit(") ").next().unwrap_or_default().split(' ').skip(11).take(2);
    // Ticks of a hundredth of a second.
    fields.filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() * 10.0
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, image] = [&arguments[0], &arguments[1]];
    let times: usize = arguments.get(2).map_or(8, |times| times.parse().unwrap());
    let net = weights::load(Path::new(file), &Device::flex()).unwrap();
    let image = partpose::files::read_rgb(Path::new(image)).unwrap();
    let mut mapping = Mapping::default();
    let input = net.config().input;
    mapping.input.resize = Resize::Keep { shorter: input.min_side, longer: input.max_side };
    let model = onnx::export(&net, None).unwrap();
    let theirs = OnnxDetector::new(&model, mapping, None).unwrap();
    let ours = Detector::new(&net);
    let run = |name: &str, detect: &dyn Fn() -> usize| {
        let (begin, used) = (Instant::now(), processor_time());
        let found = detect();
        let (all, used) = (begin.elapsed().as_secs_f64() * 1e3, processor_time() - used);
        println!("{name}: {all:.0} ms (processor {used:.0} ms), {found} found");
    };
    for _ in 0..times {
        run("own engine  ", &|| ours.detect(&image).unwrap().len());
        run("ONNX Runtime", &|| theirs.detect(&image).unwrap().len());
    }
}
