//! Sources of the frames of a stream.
use ndarray::Array2;

/// A source of frames of one size: a camera, a video, the simulator.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::pipeline::FrameSource;
/// /// A camera that always sees the same grey.
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
    /// The error of the source.
    type Error: std::error::Error;

    /// Writes the next frame into `frame`, replacing it if the size differs, and returns its time
    /// in seconds. `None` at the end.
    ///
    /// # Errors
    /// The error of the source.
    fn next_frame(&mut self, frame: &mut Array2<u8>) -> Result<Option<f64>, Self::Error>;
}
