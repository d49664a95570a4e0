//! Loops that are compiled for the instruction sets of the processor.

/// A loop: a closure or a user-defined type. Mark the closure or `run`, and the functions that it
/// calls, `#[inline(always)]`: a function that is not inlined is compiled for the baseline
/// processor.
pub trait Loop {
    /// Result of the loop.
    type Output;

    /// Runs the loop.
    fn run(self) -> Self::Output;
}

impl<R, F: FnMut() -> R> Loop for F {
    type Output = R;
    #[inline(always)]
    fn run(mut self) -> R {
        // The closure is called as `FnMut`, because a call as `FnOnce` goes through a function of
        // the standard library that is not inlined.
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

/// Runs a loop that is compiled for the widest SIMD instructions of the processor.
///
/// The loop is plain Rust without fused operations: wider registers change its speed, but not its
/// result.
///
/// ```
/// use tactile_core::vectorised;
/// let (a, mut b) = ([1.0_f32; 100], [0.5_f32; 100]);
/// vectorised(
///     #[inline(always)]
///     || b.iter_mut().zip(&a).for_each(|(b, a)| *b += a),
/// );
/// assert_eq!(b, [1.5; 100]);
/// ```
pub fn vectorised<L: Loop>(work: L) -> L::Output {
    pulp::Arch::new().dispatch(Vectorised(work))
}
