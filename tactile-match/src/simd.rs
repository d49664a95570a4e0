//! Runs a loop compiled for the best instruction set the processor turns out to have.
//!
//! The loops are plain Rust without fused operations: wider registers change their speed, not one bit of their result.

/// A loop: a closure, or a type of its own. Mark closure or `run`, and what it calls, `#[inline(always)]`: a function that is not inlined is
/// compiled for the least processor.
pub(crate) trait Loop {
    type Output;
    fn run(self) -> Self::Output;
}

impl<R, F: FnMut() -> R> Loop for F {
    type Output = R;
    #[inline(always)]
    fn run(mut self) -> R {
        // As `FnMut`: called as `FnOnce`, a closure goes through a function of the standard library that is not inlined.
        self()
    }
}

struct Vectorised<L>(L);

impl<L: Loop> pulp::WithSimd for Vectorised<L> {
    type Output = L::Output;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> L::Output {
        self.0.run()
    }
}

/// Runs the loop.
pub(crate) fn vectorised<L: Loop>(work: L) -> L::Output {
    pulp::Arch::new().dispatch(Vectorised(work))
}
