//! Part labels of the pixels of a rectangle.

use super::{BACKGROUND, PartClass};

/// One label a pixel (0 background, 1 to 29 the parts) over a rectangle of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartMask {
    /// Image coordinates of the upper left pixel; may be negative.
    pub origin: [i32; 2],
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Row by row, `width * height` labels.
    pub labels: Vec<u8>,
}

impl PartMask {
    /// A mask without parts.
    pub fn background(origin: [i32; 2], size: [u32; 2]) -> Self {
        Self { origin, size, labels: vec![BACKGROUND; size[0] as usize * size[1] as usize] }
    }

    /// The label at image coordinates; background outside the rectangle.
    pub fn at(&self, x: i32, y: i32) -> u8 {
        let (i, j) = (x - self.origin[0], y - self.origin[1]);
        if i < 0 || j < 0 || i >= self.size[0] as i32 || j >= self.size[1] as i32 {
            return BACKGROUND;
        }
        self.labels[j as usize * self.size[0] as usize + i as usize]
    }

    /// The rows of labels, top to bottom.
    pub fn rows(&self) -> impl Iterator<Item = &[u8]> {
        self.labels.chunks_exact((self.size[0] as usize).max(1))
    }

    /// The share of this mask's pixels whose label is the same in the other, 0 to 1: the paper's PA when `self` is the
    /// prediction on the detection box and `other` the truth, background included.
    pub fn agreement(&self, other: &Self) -> f64 {
        let width = self.size[0].max(1);
        let same = self.labels.iter().enumerate().filter(|(i, label)| {
            let (x, y) = ((*i as u32 % width) as i32, (*i as u32 / width) as i32);
            other.at(self.origin[0] + x, self.origin[1] + y) == **label
        });
        same.count() as f64 / self.labels.len().max(1) as f64
    }

    /// RGB bytes in the author's colours, black for background.
    pub fn to_rgb(&self) -> Vec<u8> {
        let color = |label: &u8| PartClass::from_id(*label).map_or([0; 3], PartClass::color);
        self.labels.iter().flat_map(color).collect()
    }
}
