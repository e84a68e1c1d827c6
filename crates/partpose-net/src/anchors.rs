//! Anchors: boxes of each size and ratio on every cell of the feature maps.

use crate::boxes::Corners;
use crate::config::AnchorConfig;

/// The anchors of one feature map.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelAnchors {
    /// Height and width of the map.
    pub size: [usize; 2],
    /// Pixels of the input a cell, down and to the right.
    pub stride: [f32; 2],
    /// Place of a cell's anchors in it, as a share of the cell.
    pub offset: f32,
    /// Boxes around the origin, one a kind.
    pub kinds: Vec<Corners>,
}

impl LevelAnchors {
    /// Anchors of maps whose sizes are given, finest first, of an input of `input` height and width.
    ///
    /// The configuration's sizes are shared out over the maps.
    pub fn all(config: &AnchorConfig, sizes: &[[usize; 2]], strides: &[usize]) -> Vec<Self> {
        let per_level = config.sizes.len().div_ceil(sizes.len()).max(1);
        let levels = sizes.iter().zip(strides).enumerate();
        levels
            .map(|(i, (size, stride))| {
                let of_level = config.sizes.iter().skip(i * per_level).take(per_level);
                let kinds = of_level.flat_map(|side| {
                    let kind = move |ratio: &f32| {
                        let [w, h] = [side * ratio.sqrt(), side / ratio.sqrt()];
                        [-0.5 * w, -0.5 * h, 0.5 * w, 0.5 * h]
                    };
                    config.ratios.iter().map(kind)
                });
                Self {
                    size: *size,
                    stride: [*stride as f32; 2],
                    offset: config.offset,
                    kinds: kinds.collect(),
                }
            })
            .collect()
    }

    /// Number of anchors.
    pub fn len(&self) -> usize {
        self.kinds.len() * self.size[0] * self.size[1]
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The anchor at an index, ordered by kind, then row, then column: the order of a network's output.
    pub fn corners(&self, index: usize) -> Corners {
        let [height, width] = self.size;
        let kind = self.kinds[index / (height * width)];
        let [row, column] = [index / width % height, index % width];
        let y = (row as f32 + self.offset) * self.stride[0];
        let x = (column as f32 + self.offset) * self.stride[1];
        [kind[0] + x, kind[1] + y, kind[2] + x, kind[3] + y]
    }
}

/// Anchors that a configuration puts on one cell of one map out of `levels`.
pub fn kinds_of_cell(config: &AnchorConfig, levels: usize) -> usize {
    config.sizes.len().div_ceil(levels).max(1) * config.ratios.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_lie_on_their_cells() {
        let config = AnchorConfig { sizes: vec![8.0, 16.0], ratios: vec![1.0, 4.0], offset: 0.5 };
        let levels = LevelAnchors::all(&config, &[[2, 3], [1, 2]], &[4, 8]);
        assert_eq!(levels[0].len(), 12);
        let found = [levels[0].corners(4), levels[1].corners(3)].concat();
        assert_eq!(found, [2.0, 2.0, 10.0, 10.0, -4.0, 0.0, 28.0, 8.0]);
    }
}
