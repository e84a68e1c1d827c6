//! How far one sees in blocks of samples: what lies beyond need not be drawn.

/// Side of a block in samples.
const SIDE: usize = 8;

/// The least 1 / z in every block of a band of rows, as of the last look.
///
/// Depths only come nearer, so that what was hidden then is hidden still.
pub(super) struct Blocks {
    width: usize,
    columns: usize,
    farthest: Vec<f32>,
    /// The least of each column of a row of blocks.
    columns_least: Vec<f32>,
}

impl Blocks {
    /// For an empty band of `height` rows of `width` samples.
    pub(super) fn new(width: usize, height: usize) -> Self {
        let columns = width.div_ceil(SIDE);
        let farthest = vec![0.0; columns * height.div_ceil(SIDE)];
        Self { width, columns, farthest, columns_least: vec![0.0; width] }
    }

    /// Looks at the band's 1 / z, row by row.
    pub(super) fn look(&mut self, inverse_depths: &[f32]) {
        let rows = inverse_depths.chunks((self.width * SIDE).max(1));
        for (samples, blocks) in rows.zip(self.farthest.chunks_mut(self.columns.max(1))) {
            self.columns_least.fill(f32::INFINITY);
            for row in samples.chunks(self.width.max(1)) {
                for (least, value) in self.columns_least.iter_mut().zip(row) {
                    *least = if *value < *least { *value } else { *least };
                }
            }
            for (block, columns) in blocks.iter_mut().zip(self.columns_least.chunks(SIDE)) {
                *block = columns.iter().fold(f32::INFINITY, |a, b| a.min(*b));
            }
        }
    }

    /// Whether a triangle with corners of these 1 / z lies behind all samples between two columns and two rows.
    #[inline]
    pub(super) fn hide(
        &self,
        columns: [usize; 2],
        rows: [usize; 2],
        inverse_depths: &[f32; 3],
    ) -> bool {
        let [a, b, c] = *inverse_depths;
        let nearest = a.max(b).max(c);
        let [left, right] = columns.map(|x| x / SIDE);
        let [top, bottom] = rows.map(|y| y / SIDE);
        for row in top..=bottom {
            let blocks = &self.farthest[row * self.columns + left..=row * self.columns + right];
            if blocks.iter().any(|farthest| !(nearest <= *farthest)) {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_behind_everything_is_hidden_and_nothing_else() {
        let mut blocks = Blocks::new(20, 10);
        let mut depths = vec![0.5_f32; 200];
        assert!(!blocks.hide([0, 19], [0, 9], &[0.1; 3]), "nothing was looked at");
        // A gap in the second block of the first row of blocks.
        depths[3 * 20 + 9] = 0.0;
        blocks.look(&depths);
        assert!(blocks.hide([0, 7], [0, 9], &[0.5, 0.2, 0.1]));
        assert!(!blocks.hide([0, 7], [0, 9], &[0.1, 0.2, 0.51]));
        assert!(!blocks.hide([4, 11], [2, 4], &[0.1; 3]));
        assert!(blocks.hide([8, 19], [8, 9], &[0.1; 3]));
    }
}
