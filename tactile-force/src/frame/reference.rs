//! The frame of the unpressed sensor, and the comparison of others with it.

use ndarray::{Array2, ArrayView2};

use super::pass::{Tiles, pixels_of, scan, tighten};
use super::{FrameStatistics, NoiseModel, TILE_ROWS};
use crate::ForceError;

/// Longest side for which every integer sum of the pass fits its type: 16384⁴/3 · 255 < 2⁶³.
const LONGEST_SIDE: usize = 16_384;

/// A frame of the unpressed sensor, its noise and its sums, prepared once and compared with many frames.
#[derive(Clone, Debug)]
pub struct ReferenceFrame {
    image: Array2<u8>,
    noise: NoiseModel,
    sums: FrameStatistics,
    tiles: Tiles,
    /// Brightest pixel of every band of eight rows.
    brightest: Vec<u8>,
}

/// Buffers of the pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct PassWorkspace {
    /// Σ (frame − reference) of every tile.
    pub(crate) tiles: Tiles,
    /// A copy of frames that are not in standard layout.
    copy: Vec<u8>,
}

impl ReferenceFrame {
    /// From one frame; its noise is estimated by [`NoiseModel::of_frame`].
    ///
    /// # Errors
    /// An empty image, or a side longer than 16384 pixels.
    pub fn new(image: ArrayView2<'_, u8>) -> Result<Self, ForceError> {
        let (rows, columns) = image.dim();
        if rows == 0 || columns == 0 {
            return Err(ForceError::EmptyImage { rows, columns });
        }
        if rows.max(columns) > LONGEST_SIDE {
            return Err(ForceError::ImageTooLarge { found: rows.max(columns), limit: LONGEST_SIDE });
        }
        let noise = NoiseModel::of_frame(image);
        let image = image.as_standard_layout().into_owned();
        let mut tiles = Tiles::default();
        let pixels = image.as_slice().unwrap_or_default();
        let sums = scan(pixels, None, (rows, columns), u8::MAX, &mut tiles);
        let band = |k: usize| pixels_of(k, pixels, columns).iter().copied().max().unwrap_or(0);
        let brightest = (0..rows.div_ceil(TILE_ROWS)).map(band).collect();
        Ok(Self { image, noise, sums, tiles, brightest })
    }

    /// The same reference with a known noise instead of the estimated one.
    pub fn with_noise(mut self, noise: NoiseModel) -> Self {
        self.noise = noise;
        self
    }

    /// The image.
    pub fn image(&self) -> ArrayView2<'_, u8> {
        self.image.view()
    }

    /// Noise of one pixel of one frame.
    pub fn noise(&self) -> NoiseModel {
        self.noise
    }

    /// Compares a frame with the reference: one pass over both, O(pixels), exact.
    ///
    /// # Errors
    /// The frame has not the reference's size.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::ReferenceFrame;
    /// let reference = ReferenceFrame::new(Array2::from_elem((40, 50), 7).view())?;
    /// let mut frame = Array2::from_elem((40, 50), 7);
    /// frame[[20, 30]] = 107;
    /// let statistics = reference.compare(frame.view(), 10)?;
    /// assert_eq!((statistics.sum, statistics.greatest), (100, 100));
    /// assert_eq!(statistics.centroid_px(), Some([30.0, 20.0]));
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn compare(&self, frame: ArrayView2<'_, u8>, threshold: u8) -> Result<FrameStatistics, ForceError> {
        self.check(frame)?;
        Ok(self.compare_with(&mut PassWorkspace::default(), frame, threshold))
    }

    /// The pass proper; the frame has the reference's size.
    pub(crate) fn compare_with(
        &self,
        workspace: &mut PassWorkspace,
        frame: ArrayView2<'_, u8>,
        threshold: u8,
    ) -> FrameStatistics {
        let PassWorkspace { tiles, copy } = workspace;
        let pixels = frame.to_slice().unwrap_or_else(|| {
            copy.clear();
            copy.extend(frame.iter());
            copy
        });
        let reference = (self.image.as_slice().unwrap_or_default(), &self.brightest[..]);
        let mut s = scan(pixels, Some(reference), frame.dim(), threshold, tiles);
        tiles.sums.iter_mut().zip(&self.tiles.sums).for_each(|(f, r)| *f -= r);
        s.subtract(&self.sums);
        s.bounding_box = s.bounding_box.map(|b| tighten(b, frame, self.image(), threshold));
        s.correct_extremes(frame, self.image());
        s
    }

    /// Variance of one pixel's difference frame − reference where nothing presses.
    pub(crate) fn difference_variance(&self) -> f64 {
        2.0 * self.noise.read_variance
    }

    pub(crate) fn check(&self, frame: ArrayView2<'_, u8>) -> Result<(), ForceError> {
        let (expected, found) = (self.image.dim(), frame.dim());
        if expected == found { Ok(()) } else { Err(ForceError::SizeMismatch { expected, found }) }
    }
}
