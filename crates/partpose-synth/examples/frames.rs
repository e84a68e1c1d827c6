//! Draws frames of a world and says how long each step takes:
//! `cargo run --release -p partpose-synth --example frames -- OUT [SCENE] [VARIATION] [COUNT] [SEED] [cheap]`.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use partpose::vehicle::ModelZoo;
use partpose_synth::camera::{CameraEffects, photograph};
use partpose_synth::shading::{RenderOptions, render};
use partpose_synth::world::{CameraOptions, Fleet, SceneKind, Variation, World, WorldOptions};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

#[expect(clippy::print_stdout, clippy::print_stderr, reason = "an example that reports times")]
fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let argument = |i: usize| arguments.get(i).map(String::as_str);
    let out = Path::new(argument(0).unwrap_or("."));
    let kind: SceneKind =
        argument(1).and_then(|name| name.parse().ok()).unwrap_or(SceneKind::Urban);
    let variation: Variation =
        argument(2).and_then(|name| name.parse().ok()).unwrap_or(Variation::Clone);
    let count: u32 = argument(3).and_then(|text| text.parse().ok()).unwrap_or(4);
    let seed: u64 = argument(4).and_then(|text| text.parse().ok()).unwrap_or(1);
    let options = match argument(5) {
        Some("cheap") => RenderOptions::cheap(),
        _ => RenderOptions::default(),
    };
    let mut start = Instant::now();
    let mut lap = || std::mem::replace(&mut start, Instant::now()).elapsed();
    let fleet = Arc::new(Fleet::new(&ModelZoo::embedded()));
    println!("fleet {:?}", lap());
    let world = World::new(
        &WorldOptions {
            kind,
            index: 0,
            seed,
            duration: 60.0,
            camera: CameraOptions::default(),
            open: 0.04,
        },
        fleet,
    );
    println!("world {:?}", lap());
    let mut times = [Duration::ZERO; 4];
    // In a pool of its own, so that a profile of the stacks shows the steps.
    let pool = rayon::ThreadPoolBuilder::new().build().expect("threads can be started");
    pool.install(|| {
        for frame in 0..count {
            let moment = world.moment(frame, 0.7, variation);
            times[0] += lap();
            let picture = render(&moment.scene, &options);
            times[1] += lap();
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let effects = CameraEffects::random(&mut rng, moment.scene.air.rain);
            let image = photograph(&moment.scene, &picture, &effects, seed);
            times[2] += lap();
            let name = format!("{}-{}-{seed}-{frame:02}.png", kind.name(), variation.name());
            if let Err(error) = image.save(out.join(&name)) {
                eprintln!("{name}: {error}");
            }
            times[3] += lap();
        }
    });
    let [moment, draw, camera, file] =
        times.map(|time| time.as_secs_f64() * 1e3 / f64::from(count));
    println!("moment {moment:.0} ms, draw {draw:.0} ms, camera {camera:.0} ms, file {file:.0} ms");
}
