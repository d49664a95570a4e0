//! Where the frames of a stream come from.
use ndarray::Array2;

/// A source of frames of one size: a camera, a video, the simulator.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::pipeline::FrameSource;
/// /// A camera that sees the same grey for ever.
/// struct Grey(u64);
/// impl FrameSource for Grey {
///     type Error = std::convert::Infallible;
///     fn next_frame(&mut self, frame: &mut Array2<u8>) -> Result<Option<f64>, Self::Error> {
///         frame.fill(12);
///         self.0 += 1;
///         Ok(Some(self.0 as f64 / 80.0))
///     }
/// }
/// let mut frame = Array2::zeros((4, 6));
/// assert_eq!(Grey(0).next_frame(&mut frame)?, Some(1.0 / 80.0));
/// # Ok::<(), std::convert::Infallible>(())
/// ```
pub trait FrameSource {
    /// What can go wrong.
    type Error: std::error::Error;

    /// Writes the next frame into `frame` (of another size: replaces it) and returns its time in
    /// seconds. `None` at the end.
    ///
    /// # Errors
    /// What the source meets.
    fn next_frame(&mut self, frame: &mut Array2<u8>) -> Result<Option<f64>, Self::Error>;
}
