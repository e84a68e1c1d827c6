//! Normalisation of features on slices, with what usually follows it: a residual added, negative values cut off.
//!
//! Ioffe and Szegedy: *Batch Normalization*, ICML 2015; Wu and He: *Group Normalization*, ECCV 2018. One pass over memory
//! where a chain of tensor operations needs many.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use std::sync::{Arc, Mutex};

use burn::Tensor;
use rayon::prelude::*;

use pulp::{Simd, WithSimd};

use super::apply::{Backwards, Kernel, Output, View, apply};
use super::{chains, vector};
use crate::layers::to_host;

/// Added to variances.
pub const EPSILON: f32 = 1e-5;

/// A tensor to be normalised, `[batch, channels, height, width]`, and what is done with it then.
#[derive(Clone, Debug)]
pub struct Normalised {
    /// The tensor.
    pub input: Tensor<4>,
    /// Factor of each channel.
    pub gamma: Tensor<1>,
    /// Added to each channel.
    pub beta: Tensor<1>,
    /// Added at last, shaped like the input.
    pub residual: Option<Tensor<4>>,
    /// Whether negative values become zero at the end.
    pub relu: bool,
}

/// Normalises each channel by its mean and variance over the batch, and returns these: the variance that of the
/// distribution (the sum is divided by one less than the count), as running averages keep it.
pub fn batch_norm(of: Normalised) -> (Tensor<4>, [Vec<f32>; 2]) {
    if !chains::in_memory(&of.input.device()) {
        let (result, statistics) = chains::batch_norm(of);
        return (result, statistics.map(to_host));
    }
    let kernel = Arc::new(Norm {
        kind: Kind::Batch,
        relu: of.relu,
        statistics: Mutex::new([Vec::new(), Vec::new()]),
    });
    let result = run(&kernel, of);
    let statistics = std::mem::take(&mut *kernel.statistics.lock().expect("no kernel panicked"));
    (result, statistics)
}

/// Normalises each channel by a given mean and variance.
pub fn fixed_norm(of: Normalised, mean: Vec<f32>, variance: &[f32]) -> Tensor<4> {
    if !chains::in_memory(&of.input.device()) {
        return chains::fixed_norm(of, mean, variance);
    }
    let scale = variance.iter().map(|variance| 1.0 / (variance + EPSILON).sqrt()).collect();
    let (kind, relu) = (Kind::Fixed { mean, scale }, of.relu);
    run(&Arc::new(Norm { kind, relu, statistics: Mutex::default() }), of)
}

/// Normalises groups of channels of each image by their mean and variance.
///
/// # Panics
///
/// If the groups do not share out the channels: a bug of the network.
pub fn group_norm(of: Normalised, groups: usize) -> Tensor<4> {
    if !chains::in_memory(&of.input.device()) {
        return chains::group_norm(of, groups);
    }
    let (kind, relu) = (Kind::Group(groups), of.relu);
    run(&Arc::new(Norm { kind, relu, statistics: Mutex::default() }), of)
}

fn run(kernel: &Arc<Norm>, of: Normalised) -> Tensor<4> {
    let [gamma, beta] = [of.gamma, of.beta].map(Tensor::into_dispatch);
    let mut inputs = vec![of.input.into_dispatch(), gamma, beta];
    inputs.extend(of.residual.map(Tensor::into_dispatch));
    apply(kernel, inputs)
}

#[derive(Debug)]
enum Kind {
    Batch,
    Fixed { mean: Vec<f32>, scale: Vec<f32> },
    Group(usize),
}

#[derive(Debug)]
struct Norm {
    kind: Kind,
    relu: bool,
    /// Mean and variance of the channels, left here by `forward` in training.
    statistics: Mutex<[Vec<f32>; 2]>,
}

/// A set of planes, each with its channel, that share mean and variance.
struct Set<'a> {
    /// Index of the plane among all, `image * channels + channel`.
    planes: Vec<usize>,
    out: Vec<&'a mut [f32]>,
    residual_out: Vec<&'a mut [f32]>,
}

impl Norm {
    /// Shares out planes of results to the sets: by channel, or by image and group.
    fn sets<'a>(
        &self,
        [batch, channels, area]: [usize; 3],
        out: &'a mut [f32],
        residual_out: &'a mut [f32],
    ) -> Vec<Set<'a>> {
        let set_of = |plane: usize| match &self.kind {
            Kind::Group(groups) => plane / (channels / groups),
            _ => plane % channels,
        };
        let count = match &self.kind {
            Kind::Group(groups) => {
                assert_eq!(channels % groups, 0, "{channels} channels in {groups} groups");
                batch * groups
            }
            _ => channels,
        };
        let empty = || Set { planes: Vec::new(), out: Vec::new(), residual_out: Vec::new() };
        let mut sets: Vec<Set<'a>> = (0..count).map(|_| empty()).collect();
        for (plane, out) in out.chunks_mut(area).enumerate() {
            let set = &mut sets[set_of(plane)];
            set.planes.push(plane);
            set.out.push(out);
        }
        for (plane, out) in residual_out.chunks_mut(area).enumerate() {
            sets[set_of(plane)].residual_out.push(out);
        }
        sets
    }
}

impl Kernel for Norm {
    fn forward(&self, inputs: &[View<'_>], tracked: bool) -> Output {
        let [batch, channels, height, width] = inputs[0].dims4();
        let area = height * width;
        let [input, gamma, beta] = [0, 1, 2].map(|i| inputs[i].values);
        let residual = inputs.get(3).map(|view| view.values);
        let mut values = vec![0.0; input.len()];
        if values.is_empty() {
            return Output { values, shape: inputs[0].shape.clone(), saved: Vec::new() };
        }
        let sets = self.sets([batch, channels, area], &mut values, &mut []);
        let of_sets: Vec<[f32; 3]> = sets
            .into_par_iter()
            .enumerate()
            .map(|(i, set)| {
                let count = (set.planes.len() * area) as f64;
                let planes = || set.planes.iter().map(|plane| &input[plane * area..][..area]);
                let [mean, scale, variance] = if let Kind::Fixed { mean, scale } = &self.kind {
                    [mean[i], scale[i], 0.0]
                } else {
                    let total =
                        |moment| planes().map(|x| vector::dispatch(Moment(x, moment))).sum::<f64>();
                    let mean = (total(None) / count) as f32;
                    let squares = total(Some(mean));
                    let scale = 1.0 / (squares / count + f64::from(EPSILON)).sqrt();
                    [mean, scale as f32, (squares / (count - 1.0).max(1.0)) as f32]
                };
                for (plane, out) in set.planes.iter().zip(set.out) {
                    let channel = plane % channels;
                    let factor = gamma[channel] * scale;
                    let offset = beta[channel] - mean * factor;
                    let input = &input[plane * area..][..area];
                    let residual = residual.map(|values| &values[plane * area..][..area]);
                    let factors = [factor, offset];
                    vector::dispatch(Forth { input, factors, residual, relu: self.relu, out });
                }
                [mean, scale, variance]
            })
            .collect();
        if matches!(self.kind, Kind::Batch) {
            let statistics = [0, 2].map(|k| of_sets.iter().map(|set| set[k]).collect());
            *self.statistics.lock().expect("no kernel panicked") = statistics;
        }
        let saved = if tracked {
            of_sets.iter().flat_map(|set| [set[0], set[1]]).collect()
        } else {
            Vec::new()
        };
        Output { values, shape: inputs[0].shape.clone(), saved }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let [batch, channels, height, width] = state.inputs[0].dims4();
        let area = height * width;
        let [input, gamma] = [0, 1].map(|i| state.inputs[i].values);
        // Where nothing is added, the gradient after the cut is kept nowhere but in the result.
        let has_residual = state.inputs.len() > 3;
        let mut of_input = vec![0.0; input.len()];
        let mut of_residual = vec![0.0; if has_residual { input.len() } else { 0 }];
        let sets = self.sets([batch, channels, area], &mut of_input, &mut of_residual);
        let of_sets: Vec<Vec<(usize, [f32; 2])>> = sets
            .into_par_iter()
            .enumerate()
            .map(|(i, mut set)| {
                let [mean, scale] = [state.saved[2 * i], state.saved[2 * i + 1]];
                let mut sums = Vec::new();
                for (plane, out) in set.planes.iter().zip(&mut set.out) {
                    let range = plane * area..(plane + 1) * area;
                    let gradient = &state.gradient[range.clone()];
                    let output = &state.output[range.clone()];
                    let output = self.relu.then_some(output);
                    let input = &input[range];
                    let [sum, product] =
                        vector::dispatch(Masked { gradient, output, input, mean, out });
                    sums.push((plane % channels, [sum, product * f64::from(scale)]));
                }
                for (residual, out) in set.residual_out.iter_mut().zip(&set.out) {
                    residual.copy_from_slice(out);
                }
                let [mut level, mut slope] = [0.0; 2];
                if !matches!(self.kind, Kind::Fixed { .. }) {
                    let count = (set.planes.len() * area) as f64;
                    for (channel, [sum, product]) in &sums {
                        level += f64::from(gamma[*channel]) * sum / count;
                        slope += f64::from(gamma[*channel]) * product / count;
                    }
                }
                // scale * (gamma * g - level - slope * (x - mean) * scale), as g * a + x * b + c.
                let b = -(slope as f32) * scale * scale;
                let c = -(level as f32) * scale - b * mean;
                for (plane, out) in set.planes.iter().zip(set.out) {
                    let a = gamma[plane % channels] * scale;
                    let input = &input[plane * area..][..area];
                    vector::dispatch(Combine { out, input, factors: [a, b, c] });
                }
                sums.into_iter().map(|(channel, sums)| (channel, sums.map(|s| s as f32))).collect()
            })
            .collect();
        let [mut of_gamma, mut of_beta] = [vec![0.0; channels], vec![0.0; channels]];
        for (channel, [sum, product]) in of_sets.into_iter().flatten() {
            of_beta[channel] += sum;
            of_gamma[channel] += product;
        }
        let wanted = |i: usize| state.wanted.get(i) == Some(&true);
        let mut gradients = vec![
            wanted(0).then_some(of_input),
            wanted(1).then_some(of_gamma),
            wanted(2).then_some(of_beta),
            wanted(3).then_some(of_residual),
        ];
        gradients.truncate(state.inputs.len());
        gradients
    }
}

// Loops over memory, compiled for the processor's vectors; written without closures, which would not be.

/// `input * factor + offset`, plus the residual, cut off at zero if `relu`.
struct Forth<'a> {
    input: &'a [f32],
    factors: [f32; 2],
    residual: Option<&'a [f32]>,
    relu: bool,
    out: &'a mut [f32],
}

impl WithSimd for Forth<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { input, factors: [a, b], residual, relu, out } = self;
        let floor = if relu { 0.0 } else { f32::NEG_INFINITY };
        if let Some(residual) = residual {
            for ((out, x), r) in out.iter_mut().zip(input).zip(residual) {
                let value = x * a + b + r;
                *out = if value > floor { value } else { floor };
            }
        } else {
            for (out, x) in out.iter_mut().zip(input) {
                let value = x * a + b;
                *out = if value > floor { value } else { floor };
            }
        }
    }
}

/// The gradient where the output was not cut off; its sum, and that of its product with what the input differs from the
/// mean by.
struct Masked<'a> {
    gradient: &'a [f32],
    /// If it was cut off at zero.
    output: Option<&'a [f32]>,
    input: &'a [f32],
    mean: f32,
    out: &'a mut [f32],
}

impl WithSimd for Masked<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [f64; 2] {
        let Self { gradient, output, input, mean, out } = self;
        match output {
            Some(output) => {
                for ((out, g), y) in out.iter_mut().zip(gradient).zip(output) {
                    *out = if *y > 0.0 { *g } else { 0.0 };
                }
            }
            None => out.copy_from_slice(gradient),
        }
        let mut total = [0.0f64; 2];
        for (out, input) in out.chunks(RUN).zip(input.chunks(RUN)) {
            let mut lanes = [[0.0f32; LANES]; 2];
            let whole = out.len() / LANES * LANES;
            for (g, x) in out[..whole].chunks_exact(LANES).zip(input.chunks_exact(LANES)) {
                for lane in 0..LANES {
                    lanes[0][lane] += g[lane];
                    lanes[1][lane] += g[lane] * (x[lane] - mean);
                }
            }
            for (i, (g, x)) in out[whole..].iter().zip(&input[whole..]).enumerate() {
                lanes[0][i] += g;
                lanes[1][i] += g * (x - mean);
            }
            for lane in 0..LANES {
                total[0] += f64::from(lanes[0][lane]);
                total[1] += f64::from(lanes[1][lane]);
            }
        }
        total
    }
}

/// `out * a + input * b + c`.
struct Combine<'a> {
    out: &'a mut [f32],
    input: &'a [f32],
    factors: [f32; 3],
}

impl WithSimd for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { out, input, factors: [a, b, c] } = self;
        for (g, x) in out.iter_mut().zip(input) {
            *g = *g * a + *x * b + c;
        }
    }
}

/// Values that are summed side by side.
const LANES: usize = 16;
/// Values that are summed in single precision before double takes over.
const RUN: usize = 1024;

/// The sum of some values, or of the squares of their differences from a mean.
struct Moment<'a>(&'a [f32], Option<f32>);

impl WithSimd for Moment<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Self(values, mean) = self;
        let mut total = 0.0f64;
        for run in values.chunks(RUN) {
            let mut lanes = [0.0f32; LANES];
            let whole = run.len() / LANES * LANES;
            if let Some(mean) = mean {
                for x in run[..whole].chunks_exact(LANES) {
                    for lane in 0..LANES {
                        lanes[lane] += (x[lane] - mean) * (x[lane] - mean);
                    }
                }
                for (i, x) in run[whole..].iter().enumerate() {
                    lanes[i] += (x - mean) * (x - mean);
                }
            } else {
                for x in run[..whole].chunks_exact(LANES) {
                    for lane in 0..LANES {
                        lanes[lane] += x[lane];
                    }
                }
                for (i, x) in run[whole..].iter().enumerate() {
                    lanes[i] += x;
                }
            }
            for lane in lanes {
                total += f64::from(lane);
            }
        }
        total
    }
}
