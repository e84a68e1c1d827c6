//! Boxes as corners: overlap, encoding relative to each other, non-maximum suppression.
//!
//! Corners are `[x_min, y_min, x_max, y_max]`, pixel (i, j) covering `i..i+1`, `j..j+1`.

/// Largest logarithm of a size ratio that is decoded: a box grows at most to 1000 / 16 times its size, as in torchvision,
/// so that no network output becomes infinite.
pub(crate) const MOST_GROWTH: f32 = 4.135;

/// Side that a box without extent counts as having, so that it still has logarithms, pixels.
pub(crate) const LEAST_SIZE: f32 = 1e-3;

/// x and y of the upper left corner and of the lower right one.
pub type Corners = [f32; 4];

/// Area in square pixels; 0 for an inverted box.
pub fn area([x0, y0, x1, y1]: Corners) -> f32 {
    (x1 - x0).max(0.0) * (y1 - y0).max(0.0)
}

/// Area that two boxes share.
pub fn shared_area(a: Corners, b: Corners) -> f32 {
    area([a[0].max(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].min(b[3])])
}

/// Shared area over the area of both together, 0 to 1.
pub fn iou(a: Corners, b: Corners) -> f32 {
    let shared = shared_area(a, b);
    let together = area(a) + area(b) - shared;
    if together > 0.0 { shared / together } else { 0.0 }
}

/// A box limited to an image of `size`, width and height.
pub fn clipped(corners: Corners, size: [usize; 2]) -> Corners {
    [0, 1, 2, 3].map(|i| corners[i].clamp(0.0, size[i % 2] as f32))
}

/// A box as seen from another, `from`: shift of the centre in its sizes, and logarithms of the ratios of sizes, times
/// `factors` (x, y, width, height).
pub fn encode(corners: Corners, from: Corners, factors: [f32; 4]) -> [f32; 4] {
    let [x, y, w, h] = centre_and_size(corners);
    let [from_x, from_y, from_w, from_h] = centre_and_size(from);
    let values =
        [(x - from_x) / from_w, (y - from_y) / from_h, (w / from_w).ln(), (h / from_h).ln()];
    [0, 1, 2, 3].map(|i| values[i] * factors[i])
}

/// The box that [`encode`] made `deltas` of; sizes grow within a limit.
pub fn decode(deltas: [f32; 4], from: Corners, factors: [f32; 4]) -> Corners {
    let [x, y, w, h] = centre_and_size(from);
    let [dx, dy, dw, dh] = [0, 1, 2, 3].map(|i| deltas[i] / factors[i]);
    let [x, y] = [x + dx * w, y + dy * h];
    let [w, h] = [w * dw.min(MOST_GROWTH).exp(), h * dh.min(MOST_GROWTH).exp()];
    [x - 0.5 * w, y - 0.5 * h, x + 0.5 * w, y + 0.5 * h]
}

/// Indices of boxes kept by non-maximum suppression, best first, at most `limit`.
///
/// `boxes` come best first; one is dropped if its IoU with one kept before is above `threshold`.
pub fn suppress(boxes: &[Corners], threshold: f32, limit: usize) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::new();
    for (i, corners) in boxes.iter().enumerate() {
        if kept.len() >= limit {
            break;
        }
        if kept.iter().all(|k| iou(boxes[*k], *corners) <= threshold) {
            kept.push(i);
        }
    }
    kept
}

fn centre_and_size([x0, y0, x1, y1]: Corners) -> [f32; 4] {
    let [w, h] = [(x1 - x0).max(LEAST_SIZE), (y1 - y0).max(LEAST_SIZE)];
    [0.5 * (x0 + x1), 0.5 * (y0 + y1), w, h]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decode_undoes_encode() {
        let (a, b) = ([10.0, 20.0, 50.0, 45.0], [12.0, 14.0, 40.0, 60.0]);
        let back = decode(encode(a, b, [10.0, 10.0, 5.0, 5.0]), b, [10.0, 10.0, 5.0, 5.0]);
        assert!(a.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-4), "{back:?}");
    }

    #[test]
    fn no_output_of_a_network_makes_a_box_infinite() {
        let corners = decode([1e9, -1e9, 1e9, 1e9], [0.0, 0.0, 10.0, 10.0], [1.0; 4]);
        assert!(corners.iter().all(|value| value.is_finite()));
    }

    #[test]
    fn the_weaker_of_two_that_overlap_is_dropped() {
        let boxes = [[0.0, 0.0, 10.0, 10.0], [1.0, 0.0, 11.0, 10.0], [20.0, 0.0, 30.0, 10.0]];
        assert_eq!(suppress(&boxes, 0.5, 9), [0, 2]);
        assert_eq!(suppress(&boxes, 0.9, 9), [0, 1, 2]);
        assert_eq!(suppress(&boxes, 0.9, 1), [0]);
    }
}
