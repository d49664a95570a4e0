//! Loops over many pixels by the widest instructions that the processor has.

/// Runs `work`, whose loops are compiled for AVX2 as well where its `call` is inlined, and takes those where the processor has them. No result
/// depends on it: sums are taken in the same order, and nothing is fused.
#[inline]
pub(crate) fn vectorized<W: pulp::NullaryFnOnce>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(work);
    }
    work.call()
}
