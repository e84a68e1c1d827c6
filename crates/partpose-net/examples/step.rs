//! Times training steps and inferences, and tells the peak memory:
//! `cargo run --release -p partpose-net --example step -- [COUNT [training|inference [WIDTH HEIGHT IMAGES [KERNEL]]]]`.
//!
//! `COUNT FILE.onnx WIDTH HEIGHT IMAGES` writes the network for other runtimes instead.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use std::time::Instant;

use burn::Tensor;
use burn::module::Module;
use burn::optim::momentum::MomentumConfig;
use burn::optim::{GradientsParams, SgdConfig};
use burn::tensor::{Device, TensorData};
use partpose_net::{MaskRcnn, NetConfig, PreparedNet, Target, onnx};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A batch of noise with bright boxes, and its truth.
fn batch(count: usize, size: [usize; 2], device: &Device) -> (Tensor<4>, Vec<Target>) {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let [width, height] = size;
    let mut values = Vec::new();
    let mut targets = Vec::new();
    for _ in 0..count {
        let mut target = Target {
            size,
            labels: vec![0; width * height],
            owner: vec![0; width * height],
            ..Target::default()
        };
        let mut image: Vec<f32> =
            (0..3 * width * height).map(|_| rng.random::<f32>() - 0.5).collect();
        for i in 0..6 {
            let w = rng.random_range(30..160usize).min(width / 3);
            let h = w * 2 / 3;
            let x = rng.random_range(0..width - w);
            let y = rng.random_range(0..height - h);
            target.boxes.push([x, y, x + w, y + h].map(|v| v as f32));
            for v in 0..h {
                for u in 0..w {
                    let at = (y + v) * width + x + u;
                    target.owner[at] = i + 1;
                    let part = 1 + 4 * (v * 2 / h) + u * 4 / w;
                    target.labels[at] = part as u8;
                    for c in 0..3 {
                        image[c * width * height + at] =
                            if c == 0 { 1.5 } else { part as f32 / 4.0 - 1.0 };
                    }
                }
            }
        }
        values.extend(image);
        targets.push(target);
    }
    (Tensor::from_data(TensorData::new(values, [count, 3, height, width]), device), targets)
}

/// Processor time of all threads so far, ms, where the system tells.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = text.rsplit(") ").next().unwrap_or_default().split(' ').skip(11).take(2);
    // Ticks of a hundredth of a second.
    fields.filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() * 10.0
}

/// Most memory so far, MB, where the system tells.
fn peak_memory() -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let number = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    number.unwrap_or(f64::NAN) / 1000.0
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| arguments.get(i).map(|n| n.parse::<usize>().unwrap());
    let steps = number(0).unwrap_or(5);
    let modes = ["training", "inference"];
    let wanted = |what: &str| arguments.get(1).is_none_or(|asked| asked == what);
    // As many masks as a street has vehicles; a network of so few steps finds one everywhere.
    let mut config = NetConfig::default();
    config.boxes.max_detections = 10;
    if let Some(kernel) = number(5) {
        config.parts.kernel = kernel;
    }
    let sizes = match (number(2), number(3), number(4)) {
        (Some(width), Some(height), Some(count)) => vec![(count, [width, height])],
        _ => vec![(2, [640, 192]), (1, [1248, 384])],
    };
    for (count, size) in sizes {
        let device = Device::flex().autodiff();
        let mut net = config.init(&device, 1);
        if let Some(file) = arguments.get(1).filter(|what| !modes.contains(&what.as_str())) {
            std::fs::write(file, onnx::export(&net.valid(), Some(size)).unwrap()).unwrap();
            return;
        }
        let (images, targets) = batch(count, size, &device);
        if wanted("training") {
            net = train(net, &images, &targets, steps);
        }
        if wanted("inference") {
            let net = PreparedNet::new(&net);
            let image = images.without_autodiff().narrow(0, 0, 1);
            for _ in 0..steps {
                let (begin, used) = (Instant::now(), processor_time());
                let found = net.detect(image.clone(), size);
                let (all, used) = (begin.elapsed().as_secs_f64() * 1e3, processor_time() - used);
                println!("inference {all:.0} (processor {used:.0}) ms, {} found", found.len());
            }
        }
    }
    println!("peak memory {:.0} MB", peak_memory());
}

fn train(mut net: MaskRcnn, images: &Tensor<4>, targets: &[Target], steps: usize) -> MaskRcnn {
    let mut optimizer = SgdConfig::new().with_momentum(Some(MomentumConfig::new())).init();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for step in 0..steps {
        let (begin, used) = (Instant::now(), processor_time());
        let since = || begin.elapsed().as_secs_f64() * 1e3;
        let losses = net.losses(images.clone(), targets, &mut rng);
        let total = losses.total(&net.config().loss);
        let forward = since();
        let gradients = GradientsParams::from_grads(total.backward(), &net);
        let backward = since() - forward;
        net = optimizer.step(0.01, net, gradients);
        let (all, used) = (since(), processor_time() - used);
        let value = |t: &Tensor<1>| t.clone().into_scalar::<f32>();
        println!(
            "{} x {:?} step {step}: forward {forward:.0} backward {backward:.0} update {:.0} \
             all {all:.0} (processor {used:.0}) ms; loss {:.3} (rpn {:.3} {:.3}, class {:.3} \
             box {:.3} mask {:.3})",
            targets.len(),
            targets[0].size,
            all - forward - backward,
            value(&total),
            value(&losses.rpn_objectness),
            value(&losses.rpn_box),
            value(&losses.class),
            value(&losses.boxes),
            value(&losses.mask),
        );
    }
    net
}
