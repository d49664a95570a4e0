//! Buffers that are kept between calls, and the progress callback of long solutions.

use core::ops::ControlFlow;

use tactile_core::{Progress, StopReason};

use crate::PixelScalar;

type Callback = Box<dyn FnMut(Progress) -> ControlFlow<()> + Send + Sync>;

/// Buffers of every method, kept between calls: a second call of the same size does not allocate.
/// The only exception is the factorisation of [`MaskedLeastSquares`](crate::MaskedLeastSquares).
///
/// One workspace can be used with all methods. It may also contain a callback that receives the
/// progress of iterative solutions and can stop them.
///
/// ```
/// use core::ops::ControlFlow;
/// use ndarray::Array2;
/// use tactile_sfs::{
///     Domain, Frame, Image, Lighting, Progress, Surface, SurfaceReconstruction, SurfaceWorkspace,
///     TsaiShah,
/// };
/// let (send, receive) = std::sync::mpsc::channel();
/// let mut workspace = SurfaceWorkspace::default();
/// workspace.on_progress(move |progress: Progress| match send.send(progress) {
///     Ok(()) => ControlFlow::Continue(()),
///     Err(_) => ControlFlow::Break(()), // the receiver no longer exists
/// });
/// let image = Array2::from_elem((8, 8), 0.9);
/// let method = TsaiShah::new(Lighting::default()).with_iterations(20)?;
/// method.reconstruct_with(
///     &mut workspace,
///     Image::new(Frame::Real(image.view()), Domain::default()),
///     &mut Surface::default(),
/// )?;
/// let received: Vec<Progress> = receive.try_iter().collect();
/// assert!(!received.is_empty() && received.iter().all(|p| p.done <= p.total && p.total == 20));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Default)]
pub struct SurfaceWorkspace<T> {
    pub(crate) eikonal: crate::reconstruct::EikonalBuffers<T>,
    pub(crate) profile: crate::reconstruct::ProfileBuffers<T>,
    pub(crate) field: crate::reconstruct::FieldBuffers<T>,
    pub(crate) poisson: crate::integrate::PoissonBuffers,
    pub(crate) masked: crate::integrate::MaskedBuffers,
    pub(crate) points: crate::sample::SampleBuffers,
    callback: Option<Callback>,
}

impl<T> core::fmt::Debug for SurfaceWorkspace<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("SurfaceWorkspace").finish_non_exhaustive()
    }
}

impl<T: PixelScalar> SurfaceWorkspace<T> {
    /// Sets a `callback` that is called from time to time during iterative solutions. `Break` ends
    /// the solution with [`StopReason::Cancelled`] and the best result so far.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use tactile_sfs::SurfaceWorkspace;
    /// let mut workspace = SurfaceWorkspace::<f32>::default();
    /// workspace.on_progress(|progress| {
    ///     eprintln!("{} of at most {}", progress.done, progress.total);
    ///     ControlFlow::Continue(())
    /// });
    /// ```
    pub fn on_progress(
        &mut self,
        callback: impl FnMut(Progress) -> ControlFlow<()> + Send + Sync + 'static,
    ) {
        self.callback = Some(Box::new(callback));
    }

    /// Calls the callback. `Some(Cancelled)` if it requests a stop.
    pub(crate) fn report(&mut self, done: usize, total: usize, residual: T) -> Option<StopReason> {
        let callback = self.callback.as_mut()?;
        let progress = Progress::new(done, total).with_residual(residual.as_f64());
        callback(progress)
            .is_break()
            .then_some(StopReason::Cancelled)
    }
}
