//! Losses of single predictions with their derivatives.

/// Smooth L1 with a corner at 1 (Girshick: *Fast R-CNN*, ICCV 2015), and its derivative.
pub fn smooth_l1(error: f32) -> (f32, f32) {
    if error.abs() < 1.0 {
        (0.5 * error * error, error)
    } else {
        (error.abs() - 0.5, error.signum())
    }
}

/// Cross-entropy of a logit with the truth, and its derivative.
pub fn binary_cross_entropy(logit: f32, truth: bool) -> (f32, f32) {
    let probability = 1.0 / (1.0 + (-logit).exp());
    let signed = if truth { logit } else { -logit };
    // ln(1 + exp(-signed)) without overflow.
    let loss = (-signed).max(0.0) + (-signed.abs()).exp().ln_1p();
    (loss, probability - if truth { 1.0 } else { 0.0 })
}

/// Replaces logits by probabilities that sum to 1.
pub fn soft_max(values: &mut [f32]) {
    let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut sum = 0.0;
    for value in values.iter_mut() {
        *value = (*value - most).exp();
        sum += *value;
    }
    for value in values {
        *value /= sum;
    }
}

/// Cross-entropy of logits with the true class; the logits become its derivative, times `weight`.
pub fn cross_entropy(logits: &mut [f32], truth: usize, weight: f32) -> f32 {
    soft_max(logits);
    let loss = -logits[truth].max(f32::MIN_POSITIVE).ln();
    logits[truth] -= 1.0;
    for value in logits {
        *value *= weight;
    }
    loss * weight
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_losses() {
        let step = 1e-2;
        let slope = |f: &dyn Fn(f32) -> f32, x: f32| (f(x + step) - f(x - step)) / (2.0 * step);
        for x in [-3.0, -0.4, 0.2, 2.5] {
            assert!((slope(&|x| smooth_l1(x).0, x) - smooth_l1(x).1).abs() < 1e-3);
            for truth in [false, true] {
                let found = slope(&|x| binary_cross_entropy(x, truth).0, x);
                assert!((found - binary_cross_entropy(x, truth).1).abs() < 1e-3);
            }
            let mut logits = [x, 0.5, -1.0];
            let found = slope(&|x| cross_entropy(&mut [x, 0.5, -1.0], 1, 2.0), x);
            cross_entropy(&mut logits, 1, 2.0);
            assert!((found - logits[0]).abs() < 1e-3);
        }
    }
}
