//! The widest vectors that the processor has, chosen at run time.
//!
//! Loops over short arrays are written so that the compiler makes vectors of them; inside [`dispatch`] it may use those
//! of AVX2. Products and sums are never fused, so all machines compute the same bits.

use pulp::WithSimd;

/// Runs an operation with AVX2, or what the target always has. Spans are a few samples wide: half of the lanes of AVX-512
/// would be empty.
#[cfg(target_arch = "x86_64")]
pub(super) fn dispatch<Op: WithSimd>(op: Op) -> Op::Output {
    if let Some(simd) = pulp::x86::V3::try_new() {
        pulp::Simd::vectorize(simd, op)
    } else {
        pulp::Simd::vectorize(pulp::Scalar, op)
    }
}

/// Runs an operation with the vectors of the target.
#[cfg(not(target_arch = "x86_64"))]
pub(super) fn dispatch<Op: WithSimd>(op: Op) -> Op::Output {
    pulp::Arch::new().dispatch(op)
}
