//! The widest vectors that the processor has, chosen at run time.

use pulp::WithSimd;

/// Runs an operation with AVX-512, AVX2 with FMA, or what the target always has.
#[cfg(target_arch = "x86_64")]
pub(super) fn dispatch<Op: WithSimd>(op: Op) -> Op::Output {
    if let Some(simd) = pulp::x86::V4::try_new() {
        pulp::Simd::vectorize(simd, op)
    } else if let Some(simd) = pulp::x86::V3::try_new() {
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
