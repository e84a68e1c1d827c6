//! Matrix products on slices, safe to call.
//!
//! The `gemm` crate has the fastest pure-Rust kernels (AVX-512 or AVX2 chosen at run time) behind a raw-pointer
//! interface. This crate checks that every element which the kernel will touch lies in its slice, and makes the call.
//! It is the one crate of partpose with `unsafe` code, and has nothing else.

use std::marker::PhantomData;
use std::ptr::NonNull;

use gemm::Parallelism;

/// A matrix in a slice: element (i, j) lies at `i * row_stride + j * column_stride`.
#[derive(Clone, Copy, Debug)]
pub struct Matrix<'a> {
    /// The elements.
    pub data: &'a [f32],
    /// Rows and columns.
    pub size: [usize; 2],
    /// Distance of neighbours in a column, and in a row.
    pub strides: [usize; 2],
}

/// A matrix that can be written, alone or beside others of the same rows.
///
/// Invariant: the elements (i, j), at `start + i * row_stride + j`, are borrowed exclusively for `'a`, and no other
/// `MatrixMut` holds any of them.
#[derive(Debug)]
pub struct MatrixMut<'a> {
    start: NonNull<f32>,
    size: [usize; 2],
    row_stride: usize,
    elements: PhantomData<&'a mut [f32]>,
}

// SAFETY: it is an exclusive borrow of plain numbers, as `&mut [f32]` is.
unsafe impl Send for MatrixMut<'_> {}

impl<'a> Matrix<'a> {
    /// Row by row without gaps.
    pub fn dense(data: &'a [f32], size: [usize; 2]) -> Self {
        Self { data, size, strides: [size[1], 1] }
    }

    /// Rows and columns exchanged.
    #[must_use]
    pub fn transposed(self) -> Self {
        let [rows, columns] = self.size;
        let [down, along] = self.strides;
        Self { data: self.data, size: [columns, rows], strides: [along, down] }
    }
}

impl<'a> MatrixMut<'a> {
    /// Row by row without gaps.
    ///
    /// # Panics
    ///
    /// If the slice is shorter.
    pub fn dense(data: &'a mut [f32], size: [usize; 2]) -> Self {
        Self::with_stride(data, size, size[1])
    }

    /// Rows that begin `row_stride` apart.
    ///
    /// # Panics
    ///
    /// If rows overlap or the slice is shorter.
    pub fn with_stride(data: &'a mut [f32], size: [usize; 2], row_stride: usize) -> Self {
        assert!(fits(data.len(), size, [row_stride, 1]), "the matrix exceeds its slice");
        assert!(size[0] <= 1 || row_stride >= size[1], "rows overlap");
        let start = NonNull::from(data).cast();
        Self { start, size, row_stride, elements: PhantomData }
    }

    /// Rows and columns.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Blocks of `width` columns, the last one perhaps narrower, to be written by different threads.
    pub fn split_columns(self, width: usize) -> Vec<Self> {
        let [rows, columns] = self.size;
        let width = width.max(1);
        let block = |first: usize| Self {
            // SAFETY: `first` is less than the number of columns, so the pointer stays within the first row.
            start: unsafe { self.start.add(first) },
            size: [rows, width.min(columns - first)],
            row_stride: self.row_stride,
            elements: PhantomData,
        };
        // The blocks' columns are disjoint, rows do not overlap, and `self` is gone: the invariant holds for each.
        if rows == 0 { Vec::new() } else { (0..columns).step_by(width).map(block).collect() }
    }

    /// A row.
    ///
    /// # Panics
    ///
    /// If there is no such row.
    pub fn row_mut(&mut self, row: usize) -> &mut [f32] {
        assert!(row < self.size[0], "there is no row {row}");
        // SAFETY: by the invariant the elements of this row are ours, for as long as `self` is borrowed.
        unsafe {
            let first = self.start.add(row * self.row_stride);
            std::slice::from_raw_parts_mut(first.as_ptr(), self.size[1])
        }
    }
}

/// Writes `lhs * rhs` to `out`, or adds it. One thread; the same inputs give the same bits on the same processor.
///
/// # Panics
///
/// If sizes do not fit each other or a matrix its slice: a bug of the caller.
pub fn multiply(out: &mut MatrixMut<'_>, lhs: Matrix<'_>, rhs: Matrix<'_>, add: bool) {
    let [m, k] = lhs.size;
    let n = rhs.size[1];
    assert_eq!(rhs.size[0], k, "inner sizes differ");
    assert_eq!(out.size, [m, n], "the product has another size");
    assert!(fits(lhs.data.len(), lhs.size, lhs.strides), "the left matrix exceeds its slice");
    assert!(fits(rhs.data.len(), rhs.size, rhs.strides), "the right matrix exceeds its slice");
    if m == 0 || n == 0 {
        return;
    }
    if k == 0 {
        if !add {
            (0..m).for_each(|row| out.row_mut(row).fill(0.0));
        }
        return;
    }
    let signed = |stride: usize| isize::try_from(stride).expect("slices are shorter");
    // SAFETY: `gemm` reads elements (i, l) of lhs, (l, j) of rhs and, if `add`, (i, j) of out, and writes (i, j) of out,
    // for i < m, j < n, l < k; `fits` has shown that the largest offset in lhs and rhs lies in its slice, the invariant of
    // `MatrixMut` that all of out is ours, and offsets are never negative. `out` is borrowed exclusively, so it overlaps
    // neither input. All elements are f32 that live for the call. With `Parallelism::None` no other thread takes part.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            out.start.as_ptr(),
            1,
            signed(out.row_stride),
            add,
            lhs.data.as_ptr(),
            signed(lhs.strides[1]),
            signed(lhs.strides[0]),
            rhs.data.as_ptr(),
            signed(rhs.strides[1]),
            signed(rhs.strides[0]),
            1.0f32,
            1.0f32,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

/// Whether every element of a matrix lies in a slice of `length` elements.
fn fits(length: usize, size: [usize; 2], strides: [usize; 2]) -> bool {
    if size[0] == 0 || size[1] == 0 {
        return true;
    }
    let offset = |i: usize| (size[i] - 1).checked_mul(strides[i]);
    let last = offset(0).and_then(|down| down.checked_add(offset(1)?));
    last.is_some_and(|last| last < length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, seed: u32) -> Vec<f32> {
        let hash = |i: u32| i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 16;
        (0..count as u32).map(|i| (hash(i) % 17) as f32 - 8.0).collect()
    }

    fn slow(lhs: Matrix<'_>, rhs: Matrix<'_>) -> Vec<f32> {
        let at = |m: &Matrix<'_>, i: usize, j: usize| m.data[i * m.strides[0] + j * m.strides[1]];
        let mut product = Vec::new();
        for i in 0..lhs.size[0] {
            for j in 0..rhs.size[1] {
                product.push((0..lhs.size[1]).map(|l| at(&lhs, i, l) * at(&rhs, l, j)).sum());
            }
        }
        product
    }

    #[test]
    fn products_of_small_integers_are_exact_in_every_layout() {
        for [m, n, k] in [[1, 1, 1], [3, 5, 7], [33, 17, 64], [64, 100, 9], [5, 1, 40]] {
            let [a, b] = [numbers(m * k, 1), numbers(k * n, 2)];
            let lhs = [Matrix::dense(&a, [m, k]), Matrix::dense(&a, [k, m]).transposed()];
            let rhs = [Matrix::dense(&b, [k, n]), Matrix::dense(&b, [n, k]).transposed()];
            for (l, r) in lhs.into_iter().flat_map(|l| rhs.into_iter().map(move |r| (l, r))) {
                let mut out = vec![f32::NAN; m * n];
                multiply(&mut MatrixMut::dense(&mut out, [m, n]), l, r, false);
                assert_eq!(out, slow(l, r));
                multiply(&mut MatrixMut::dense(&mut out, [m, n]), l, r, true);
                let twice: Vec<f32> = slow(l, r).iter().map(|value| 2.0 * value).collect();
                assert_eq!(out, twice);
            }
        }
    }

    #[test]
    fn gaps_between_rows_stay_untouched() {
        let (a, b) = (numbers(6, 3), numbers(6, 4));
        let mut out = vec![7.0; 9];
        let mut wide = MatrixMut::with_stride(&mut out, [2, 2], 6);
        multiply(&mut wide, Matrix::dense(&a, [2, 3]), Matrix::dense(&b, [3, 2]), false);
        assert_eq!(out[2..6], [7.0; 4]);
        assert_eq!(out[8], 7.0);
    }

    #[test]
    fn blocks_of_columns_make_up_the_whole_product() {
        let ([m, n, k], width) = ([7, 29, 13], 8);
        let (a, b) = (numbers(m * k, 5), numbers(k * n, 6));
        let lhs = Matrix::dense(&a, [m, k]);
        let mut out = vec![f32::NAN; m * n];
        let blocks = MatrixMut::dense(&mut out, [m, n]).split_columns(width);
        assert_eq!(blocks.len(), 4);
        for (i, mut block) in blocks.into_iter().enumerate() {
            let columns = block.size()[1];
            let rhs = Matrix { data: &b[i * width..], size: [k, columns], strides: [n, 1] };
            multiply(&mut block, lhs, rhs, false);
        }
        assert_eq!(out, slow(lhs, Matrix::dense(&b, [k, n])));
    }

    #[test]
    fn no_inner_size_gives_zero() {
        let mut out = vec![1.0; 4];
        let empty = Matrix { data: &[], size: [2, 0], strides: [0, 1] };
        multiply(&mut MatrixMut::dense(&mut out, [2, 2]), empty, empty.transposed(), false);
        assert_eq!(out, [0.0; 4]);
    }

    #[test]
    #[should_panic(expected = "the right matrix exceeds its slice")]
    fn a_matrix_larger_than_its_slice_is_refused() {
        let mut out = vec![0.0; 4];
        let short = Matrix { data: &[0.0; 3], size: [2, 2], strides: [2, 1] };
        let fine = Matrix::dense(&[0.0; 4], [2, 2]);
        multiply(&mut MatrixMut::dense(&mut out, [2, 2]), fine, short, false);
    }
}
