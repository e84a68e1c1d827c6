//! Time per call of the `PnP` solvers on made-up problems with a pixel of noise.

use divan::{Bencher, black_box};
use partpose::pnp::{
    self, RansacOptions, RefineOptions,
    synthetic::{SyntheticOptions, SyntheticProblem, synthetic_problem},
};

/// Problems that each benchmark cycles through, so that no branch is learnt by heart.
const PROBLEMS: u64 = 64;
/// Numbers of points.
const POINTS: [usize; 4] = [4, 8, 12, 29];

fn main() {
    divan::main();
}

fn each(bencher: Bencher<'_, '_>, points: usize, mut solve: impl FnMut(&SyntheticProblem)) {
    let options = SyntheticOptions { points, sigma: 1.0, ..SyntheticOptions::default() };
    let problems: Vec<_> = (0..PROBLEMS).map(|seed| synthetic_problem(seed, &options)).collect();
    let mut next = 0;
    bencher.bench_local(|| {
        next = (next + 1) % problems.len();
        solve(black_box(&problems[next]));
    });
}

#[divan::bench(args = POINTS)]
fn epnp(bencher: Bencher<'_, '_>, points: usize) {
    each(bencher, points, |p| {
        let _ = black_box(pnp::epnp(&p.correspondences, &p.camera));
    });
}

#[divan::bench(args = POINTS)]
fn sqpnp(bencher: Bencher<'_, '_>, points: usize) {
    each(bencher, points, |p| {
        let _ = black_box(pnp::sqpnp(&p.correspondences, &p.camera));
    });
}

#[divan::bench(args = POINTS)]
fn refine_from_the_truth(bencher: Bencher<'_, '_>, points: usize) {
    let options = RefineOptions::default();
    each(bencher, points, |p| {
        let start = &p.camera_from_object;
        let _ = black_box(pnp::refine(&p.correspondences, &p.camera, start, &options));
    });
}

#[divan::bench(args = POINTS)]
fn solve(bencher: Bencher<'_, '_>, points: usize) {
    let options = RefineOptions::default();
    each(bencher, points, |p| {
        let _ = black_box(pnp::solve(&p.correspondences, &p.camera, &options));
    });
}

#[divan::bench]
fn p3p(bencher: Bencher<'_, '_>) {
    each(bencher, 3, |p| {
        let three = [p.correspondences[0], p.correspondences[1], p.correspondences[2]];
        let _ = black_box(pnp::p3p(&three, &p.camera));
    });
}

#[divan::bench(args = POINTS)]
fn ransac(bencher: Bencher<'_, '_>, points: usize) {
    let options = RansacOptions::default();
    each(bencher, points, |p| {
        let _ = black_box(pnp::ransac(&p.correspondences, &p.camera, &options));
    });
}
