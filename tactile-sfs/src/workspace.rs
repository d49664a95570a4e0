//! Buffers that outlive a call, and the progress callback of long solves.

use core::ops::ControlFlow;

use crate::{Scalar, StopReason};

/// How far a long solve has come.
///
/// ```
/// use core::ops::ControlFlow;
/// use ndarray::Array2;
/// use tactile_sfs::{BrooksHorn, Domain, Frame, Lighting, Progress, Surface, SurfaceReconstruction, Workspace};
/// let (send, receive) = std::sync::mpsc::channel();
/// let mut workspace = Workspace::default();
/// workspace.on_progress(move |progress: Progress| match send.send(progress) {
///     Ok(()) => ControlFlow::Continue(()),
///     Err(_) => ControlFlow::Break(()), // nobody listens any more
/// });
/// let image = Array2::from_elem((8, 8), 0.9);
/// let method = BrooksHorn::new(Lighting::default()).with_iterations(20, 5)?;
/// method.reconstruct_with(&mut workspace, Frame::Real(image.view()), &Domain::default(), &mut Surface::default())?;
/// let heard: Vec<Progress> = receive.try_iter().collect();
/// assert!(!heard.is_empty() && heard.iter().all(|p| p.iterations <= p.limit && p.limit == 20));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Iterations done.
    pub iterations: usize,
    /// Most iterations the solve may take.
    pub limit: usize,
    /// Residual or change of the last iteration.
    pub residual: f64,
}

type Callback = Box<dyn FnMut(Progress) -> ControlFlow<()> + Send>;

/// Buffers of every method, kept between calls: a second call of the same size does not allocate.
///
/// One workspace serves any of the methods; it may also carry a callback that hears of the progress of iterative
/// solves and may stop them.
///
/// ```
/// use core::ops::ControlFlow;
/// use tactile_sfs::Workspace;
/// let mut workspace = Workspace::<f32>::default();
/// workspace.on_progress(|progress| {
///     eprintln!("{} of at most {}", progress.iterations, progress.limit);
///     ControlFlow::Continue(())
/// });
/// ```
#[derive(Default)]
pub struct Workspace<T> {
    pub(crate) eikonal: crate::reconstruct::EikonalBuffers<T>,
    pub(crate) profile: crate::reconstruct::ProfileBuffers<T>,
    pub(crate) poisson: crate::integrate::PoissonBuffers<T>,
    pub(crate) field: crate::reconstruct::FieldBuffers<T>,
    pub(crate) slopes: crate::reconstruct::SlopeBuffers<T>,
    pub(crate) fourier: crate::integrate::FourierBuffers<T>,
    pub(crate) masked: crate::integrate::MaskedBuffers<T>,
    pub(crate) points: crate::sample::SampleBuffers,
    callback: Option<Callback>,
}

impl<T> core::fmt::Debug for Workspace<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Workspace").finish_non_exhaustive()
    }
}

impl<T: Scalar> Workspace<T> {
    /// Calls `callback` from time to time during iterative solves; `Break` ends the solve with
    /// [`StopReason::Cancelled`] and the best answer so far.
    pub fn on_progress(
        &mut self,
        callback: impl FnMut(Progress) -> ControlFlow<()> + Send + 'static,
    ) {
        self.callback = Some(Box::new(callback));
    }

    /// Calls the callback; `Some(Cancelled)` if it asks to stop.
    pub(crate) fn report(
        &mut self,
        iterations: usize,
        limit: usize,
        residual: T,
    ) -> Option<StopReason> {
        let callback = self.callback.as_mut()?;
        let progress = Progress {
            iterations,
            limit,
            residual: residual.as_f64(),
        };
        callback(progress)
            .is_break()
            .then_some(StopReason::Cancelled)
    }
}
