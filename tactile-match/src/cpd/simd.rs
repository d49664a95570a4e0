//! Runs a loop compiled for the best instruction set the processor turns out to have.
//!
//! The loops are plain Rust without fused operations: wider registers change their speed, not one bit of their result.

/// A loop; mark `run` and what it calls `#[inline(always)]`.
pub(super) trait Loop {
    fn run(self);
}

struct Vectorised<L>(L);

impl<L: Loop> pulp::WithSimd for Vectorised<L> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.0.run();
    }
}

/// Runs the loop.
pub(super) fn vectorised(work: impl Loop) {
    pulp::Arch::new().dispatch(Vectorised(work));
}
