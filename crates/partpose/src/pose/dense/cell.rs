//! The samples of one cell, counted by label without a table: up to sixteen of them are one number, a byte each.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use super::raster::Raster;

const ONES: u128 = u128::from_le_bytes([1; 16]);
const HIGH: u128 = ONES << 7;

/// A cell of S x S samples, S at most 4.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packed<const S: usize>(u128);

impl<const S: usize> Packed<S> {
    /// The high bit of every sample's byte.
    const ALL: u128 = HIGH >> (128 - 8 * S * S);

    /// The cell whose first sample is `start`, in a picture of `size` samples a side.
    #[inline(always)]
    pub(super) fn new(labels: &[u8], size: usize, start: usize) -> Self {
        let mut bytes = [0u8; 16];
        for y in 0..S {
            bytes[y * S..][..S].copy_from_slice(&labels[start + y * size..][..S]);
        }
        Self(u128::from_le_bytes(bytes))
    }

    #[inline(always)]
    fn first(self) -> u8 {
        self.0 as u8
    }

    /// High bits of the samples that do not bear the label. Labels are below 32, so no sum carries over.
    #[inline(always)]
    fn others(self, label: u8) -> u128 {
        ((self.0 ^ (ONES * u128::from(label))) + (HIGH - ONES)) & Self::ALL
    }

    /// How many samples bear the label.
    #[inline(always)]
    pub(super) fn count(self, label: u8) -> u32 {
        (S * S) as u32 - self.others(label).count_ones()
    }

    /// The one label of all samples, if there is but one.
    #[inline(always)]
    pub(super) fn uniform(self) -> Option<u8> {
        (self.others(self.first()) == 0).then_some(self.first())
    }

    /// Calls `each` with every label that occurs and how often it does.
    #[inline(always)]
    pub(super) fn tally(self, mut each: impl FnMut(u8, u32)) {
        let mut left = Self::ALL;
        while left != 0 {
            let label = (self.0 >> (left.trailing_zeros() & !7)) as u8;
            let others = self.others(label);
            each(label, (left & !others).count_ones());
            left &= others;
        }
    }
}

/// Samples along a side of a cell.
pub(super) fn side(raster: &Raster, cells: usize) -> usize {
    raster.size / cells
}

/// The first sample of a cell.
#[inline(always)]
pub(super) fn start(raster: &Raster, cells: usize, cell: usize) -> usize {
    let s = raster.size / cells;
    (cell / cells) * s * raster.size + (cell % cells) * s
}
