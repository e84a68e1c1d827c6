//! Signed distance to the edge of a set of pixels, at sub-pixel level.
//!
//! Exact squared distances by the lower envelope of parabolas, row by row and column by column (Felzenszwalb and
//! Huttenlocher: *Distance Transforms of Sampled Functions*, Theory of Computing 2012). The edge is taken to run half
//! way between the centres of neighbouring pixels of different kind, so a straight edge along an axis is exact and a
//! slanted one right on average.

/// Distances are cut off here, pixels; also what stands for "no edge at all".
pub(super) const FAR: f32 = 64.0;

/// Signed distance to the edge of a set of pixels: negative inside, positive outside.
#[derive(Clone, Debug)]
pub(super) struct EdgeDistance {
    pub(super) size: [usize; 2],
    pub(super) values: Vec<f32>,
}

impl EdgeDistance {
    /// Of the pixels that are `true`.
    pub(super) fn of(set: &[bool], size: [usize; 2]) -> Self {
        let to_set = distances(set, size, true);
        let to_rest = distances(set, size, false);
        let values = to_set
            .iter()
            .zip(&to_rest)
            .map(|(set, rest)| if *set > 0.0 { set - 0.5 } else { 0.5 - rest })
            .map(|value| value.clamp(-FAR, FAR))
            .collect();
        Self { size, values }
    }

    /// Bilinear at a point in pixels; `None` outside the outermost pixel centres.
    pub(super) fn at(&self, u: f32, v: f32) -> Option<f32> {
        let [width, height] = self.size;
        if !(u >= 0.0 && v >= 0.0 && u <= (width - 1) as f32 && v <= (height - 1) as f32) {
            return None;
        }
        let (x, y) = ((u as usize).min(width.max(2) - 2), (v as usize).min(height.max(2) - 2));
        let (a, b) = (u - x as f32, v - y as f32);
        let at = |x: usize, y: usize| self.values[y.min(height - 1) * width + x.min(width - 1)];
        let top = at(x, y) * (1.0 - a) + at(x + 1, y) * a;
        let bottom = at(x, y + 1) * (1.0 - a) + at(x + 1, y + 1) * a;
        Some(top * (1.0 - b) + bottom * b)
    }
}

/// Distance of every pixel to the nearest one with `set == kind`.
fn distances(set: &[bool], [width, height]: [usize; 2], kind: bool) -> Vec<f32> {
    let far = FAR * FAR;
    let mut squared: Vec<f32> = set.iter().map(|s| if *s == kind { 0.0 } else { far }).collect();
    let mut line = vec![0.0; width.max(height)];
    for x in 0..width {
        for y in 0..height {
            line[y] = squared[y * width + x];
        }
        let out = envelope(&line[..height]);
        for y in 0..height {
            squared[y * width + x] = out[y];
        }
    }
    for row in squared.chunks_exact_mut(width) {
        let out = envelope(row);
        row.copy_from_slice(&out);
    }
    squared.iter().map(|value| value.min(far).sqrt()).collect()
}

/// The lower envelope of parabolas that stand on a line's samples.
fn envelope(line: &[f32]) -> Vec<f32> {
    let n = line.len();
    let mut roots = vec![0usize; n];
    let mut starts = vec![f32::NEG_INFINITY; n + 1];
    let mut last = 0;
    let crossing = |p: usize, q: usize| {
        let (a, b) = (p as f32, q as f32);
        ((line[q] + b * b) - (line[p] + a * a)) / (2.0 * (b - a))
    };
    for q in 1..n {
        let mut start = crossing(roots[last], q);
        while start <= starts[last] && last > 0 {
            last -= 1;
            start = crossing(roots[last], q);
        }
        last += 1;
        roots[last] = q;
        starts[last] = start;
    }
    let mut at = 0;
    (0..n)
        .map(|q| {
            while at < last && starts[at + 1] < q as f32 {
                at += 1;
            }
            let away = q as f32 - roots[at] as f32;
            away * away + line[roots[at]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_edge_lies_half_way_between_pixel_centres() {
        let size = [12, 8];
        let set: Vec<bool> = (0..96).map(|i| i % 12 < 5).collect();
        let distance = EdgeDistance::of(&set, size);
        for u in [1.0f32, 3.25, 4.5, 6.75] {
            assert!((distance.at(u, 3.0).unwrap() - (u - 4.5)).abs() < 1e-5, "{u}");
        }
        assert_eq!(distance.at(-0.1, 0.0), None);
    }

    #[test]
    fn distances_are_those_of_a_search() {
        let size = [9, 7];
        let set: Vec<bool> = (0..63).map(|i| (i * 7919) % 11 == 3).collect();
        let found = distances(&set, size, true);
        for (i, found) in found.iter().enumerate() {
            let nearest = (0..63usize).filter(|j| set[*j]).map(|j| {
                let d = ((i % 9) as f32 - (j % 9) as f32, (i / 9) as f32 - (j / 9) as f32);
                d.0.hypot(d.1)
            });
            assert!((nearest.fold(FAR, f32::min) - found).abs() < 1e-4);
        }
    }
}
