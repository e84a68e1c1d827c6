//! A list that stays on the stack while it is short.

use nalgebra::Vector3;

/// Longest list that is kept on the stack; the 29 part classes fit.
const INLINE: usize = 32;

/// A list of at most [`INLINE`] items on the stack, or any number on the heap.
pub(super) enum Buffer<T> {
    Stack([T; INLINE], usize),
    Heap(Vec<T>),
}

impl<T: Copy> Buffer<T> {
    /// `len` items, each a function of its index; `blank` fills what is not used.
    pub(super) fn from_fn(len: usize, blank: T, mut item: impl FnMut(usize) -> T) -> Self {
        if len > INLINE {
            return Self::Heap((0..len).map(item).collect());
        }
        let mut items = [blank; INLINE];
        for (index, slot) in items.iter_mut().take(len).enumerate() {
            *slot = item(index);
        }
        Self::Stack(items, len)
    }
}

impl<T> std::ops::Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match self {
            Self::Stack(items, len) => &items[..*len],
            Self::Heap(items) => items,
        }
    }
}

/// Component-wise finite.
pub(super) fn is_finite(vector: &Vector3<f64>) -> bool {
    vector.iter().all(|value| value.is_finite())
}
