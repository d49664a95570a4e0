//! Run-time dispatch of a loop to the best instruction set of the processor.
//!
//! The loops are plain Rust over slices of one scalar; inlined into a function with wider vectors enabled, the
//! compiler vectorises them. The arithmetic is written out (fused or not), so that the result does not depend on how.

use crate::real::{Lane, Scalar};

/// Work on lanes of `T`. Mark `run` and what it calls `#[inline(always)]`.
pub(crate) trait Job<T: Scalar> {
    type Output;
    fn run<L: Lane<T>>(self) -> Self::Output;
}

struct Dispatched<T, J>(J, core::marker::PhantomData<T>);

impl<T: Scalar, J: Job<T>> pulp::WithSimd for Dispatched<T, J> {
    type Output = J::Output;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> J::Output {
        if S::IS_SCALAR || cfg!(target_arch = "wasm32") {
            self.0.run::<T::Plain>()
        } else {
            self.0.run::<T::Fused>()
        }
    }
}

/// Runs the job.
pub(crate) fn dispatch<T: Scalar, J: Job<T>>(job: J) -> J::Output {
    pulp::Arch::new().dispatch(Dispatched(job, core::marker::PhantomData))
}
