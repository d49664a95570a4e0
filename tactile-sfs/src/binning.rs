//! The image and mask of a contact on a coarser grid, ready for reconstruction.
//!
//! A contact of 10⁵ pixels has about 200 control points, and the heights between them are not used.
//! Means over blocks of pixels need one pass, reduce the noise by the block's width, and leave a
//! small grid for the reconstruction.

use ndarray::{Array2, ArrayView2, Axis, Slice, Zip, aview_mut1};

use crate::surface::fill_shape;

/// Distance from the contour, in pixels, within which a cell of the rim is left out. Without a
/// whole ring of pixels, the surface would lose a quarter of its height, and a smaller contact
/// more.
const RIM_DISTANCE_PX: f64 = 0.25;

/// Number of pixels per node of the reconstruction grid.
///
/// ```
/// use tactile_sfs::Binning;
/// // 3,200 pixels for 200 control points are 16 per point: every pixel is kept. Four times as
/// // many pixels allow blocks of 2 × 2.
/// assert_eq!(Binning::Auto.side(3_200, 200), 1);
/// assert_eq!(Binning::Auto.side(12_800, 200), 2);
/// assert_eq!(Binning::Blocks(5).side(10, 200), 5);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Binning {
    /// Blocks as large as the control points allow: at least 16 blocks inside the contact per
    /// point.
    #[default]
    Auto,
    /// Blocks of n × n pixels; 1 keeps every pixel.
    Blocks(usize),
}

impl Binning {
    /// Side of a block in pixels, for a contact of `pixels` with `points` control points. At least
    /// 1.
    pub fn side(self, pixels: usize, points: usize) -> usize {
        match self {
            // With 16 blocks per point, neighbouring points are four or more blocks apart. Finer
            // grids cost time and improve neither heights nor strains.
            Self::Auto => (pixels / (16 * points.max(1))).isqrt().max(1),
            Self::Blocks(side) => side.max(1),
        }
    }
}

/// Signal and mask of a contact on a grid of square blocks. Its memory is reused, so that filling
/// it again does not allocate.
///
/// ```
/// use ndarray::{Array2, array};
/// use tactile_sfs::BinnedContact;
/// let frame = array![[10_u8, 12, 30, 32], [14, 16, 34, 36]];
/// let reference = Array2::from_elem((2, 4), 10_u8);
/// let mask = array![[true, true, true, false], [true, false, true, false]];
/// let mut contact = BinnedContact::default();
/// contact.load([frame.view(), reference.view()], 2, 1.0);
/// contact.load_mask(mask.view(), 2);
/// assert_eq!(contact.signal, array![[3.0, 23.0]]);
/// assert_eq!(contact.mask, array![[true, false]]); // three and two of the four pixels
/// ```
#[derive(Clone, Debug, Default)]
pub struct BinnedContact {
    /// Mean difference frame − reference of each block, times the scale.
    pub signal: Array2<f64>,
    /// Blocks that belong to the contact.
    pub mask: Array2<bool>,
    sums: Vec<i32>,
    smoothed: Array2<f64>,
    line: Vec<f64>,
}

impl BinnedContact {
    /// Computes the mean differences frame − reference of blocks of `side` × `side` pixels, times
    /// `scale`.
    ///
    /// Both images start at the first block. Rows and columns that do not fill a whole block are
    /// left out. O(pixels).
    ///
    /// # Panics
    /// If the images differ in shape.
    pub fn load(&mut self, [frame, reference]: [ArrayView2<'_, u8>; 2], side: usize, scale: f64) {
        let side = side.max(1);
        let (rows, columns) = (frame.nrows() / side, frame.ncols() / side);
        fill_shape(&mut self.signal, (rows, columns), 0.0);
        let pixels = Slice::from(..columns * side);
        let frame = frame.slice_axis_move(Axis(1), pixels);
        let reference = reference.slice_axis_move(Axis(1), pixels);
        let scale = scale / (side * side) as f64;
        for (band, mut blocks) in self.signal.rows_mut().into_iter().enumerate() {
            // Integers are summed over the rows of a band, which is exact and uses SIMD
            // instructions.
            self.sums.clear();
            self.sums.resize(columns * side, 0);
            for row in band * side..(band + 1) * side {
                Zip::from(aview_mut1(&mut self.sums))
                    .and(frame.row(row))
                    .and(reference.row(row))
                    .for_each(|sum, &f, &r| *sum += i32::from(f) - i32::from(r));
            }
            let sums = self.sums.chunks_exact(side);
            for (block, sums) in blocks.iter_mut().zip(sums) {
                *block = f64::from(sums.iter().sum::<i32>()) * scale;
            }
        }
    }

    /// Marks the blocks of the loaded signal of which at least three quarters lie in `mask`.
    /// O(pixels).
    ///
    /// With a lower fraction, the rim of the contact would lower the surface. The mask starts at
    /// the first block. It may be smaller than the blocks: nothing outside it is contact.
    pub fn load_mask(&mut self, mask: ArrayView2<'_, bool>, side: usize) {
        let side = side.max(1);
        fill_shape(&mut self.mask, self.signal.dim(), false);
        let width = self.mask.ncols() * side;
        let covered = mask.ncols().min(width);
        for (band, mut blocks) in self.mask.rows_mut().into_iter().enumerate() {
            self.sums.clear();
            self.sums.resize(width, 0);
            for row in band * side..((band + 1) * side).min(mask.nrows()) {
                let row = mask.index_axis(Axis(0), row);
                Zip::from(aview_mut1(&mut self.sums[..covered]))
                    .and(row.slice_axis(Axis(0), Slice::from(..covered)))
                    .for_each(|sum, &inside| *sum += i32::from(inside));
            }
            let sums = self.sums.chunks_exact(side);
            for (block, sums) in blocks.iter_mut().zip(sums) {
                *block = 4 * sums.iter().sum::<i32>() as usize >= 3 * side * side;
            }
        }
    }

    /// Removes from the mask the pixels at the rim of a round contact that are lit only by the
    /// blur.
    ///
    /// At the distance d from the rim of its contact of radius a, a hemisphere has the reflectance
    /// √(2d/a). Pixels darker than that a quarter of a pixel inside the rim are partly covered and
    /// would become cliffs of the surface. The signal must lie between 0 and 1, on a grid of single
    /// pixels. O(pixels).
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::BinnedContact;
    /// let mut contact = BinnedContact::default();
    /// contact.signal = array![[0.02, 0.7, 1.0, 0.7]];
    /// contact.mask = array![[true, true, true, true]];
    /// contact.trim_rim();
    /// assert_eq!(contact.mask, array![[false, true, true, true]]);
    /// ```
    pub fn trim_rim(&mut self) {
        let pixels = self.mask.iter().filter(|inside| **inside).count();
        let radius_px = (pixels as f64 / core::f64::consts::PI).sqrt();
        let least = (2.0 * RIM_DISTANCE_PX / radius_px).sqrt();
        self.mask
            .zip_mut_with(&self.signal, |inside, &light| *inside &= light >= least);
    }

    /// Smooths the signal by two passes of a moving average over `width` pixels along both axes.
    ///
    /// The result is nearly that of a Gaussian of standard deviation √((width² − 1)/6). `width`
    /// must be odd, and 1 changes nothing. Each value is moved from the sharp towards the smoothed
    /// one by the fraction `share(smoothed)`. The edge pixels are repeated beyond the edge.
    /// O(pixels × width).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::BinnedContact;
    /// let mut contact = BinnedContact::default();
    /// contact.signal = Array2::zeros((21, 21));
    /// contact.signal[[10, 10]] = 1.0;
    /// contact.smooth(5, |_| 1.0);
    /// assert!((contact.signal[[10, 10]] - 0.04_f64).abs() < 1e-12); // (1/5)² after two passes
    /// ```
    pub fn smooth(&mut self, width: usize, share: impl Fn(f64) -> f64) {
        // A box of one pixel changes nothing.
        if width < 2 || self.signal.is_empty() {
            return;
        }
        self.smoothed.clone_from(&self.signal);
        for _ in 0..2 {
            for mut row in self.smoothed.rows_mut() {
                if let Some(row) = row.as_slice_mut() {
                    mean_along(row, &mut self.line, width);
                }
            }
            let columns = self.smoothed.ncols();
            if let Some(pixels) = self.smoothed.as_slice_mut() {
                mean_across(pixels, columns, &mut self.line, width);
            }
        }
        self.signal.zip_mut_with(&self.smoothed, |sharp, &level| {
            *sharp += share(level) * (level - *sharp)
        });
    }
}

/// Means over `width` neighbours along a row. Shifted copies of the row are added. For usual widths
/// that takes a fifth of the time of a running sum, in which each step depends on the previous one.
fn mean_along(row: &mut [f64], line: &mut Vec<f64>, width: usize) {
    let (half, columns) = (width / 2, row.len());
    line.clear();
    line.resize(half, row[0]);
    line.extend_from_slice(row);
    line.resize(columns + 2 * half, row[columns - 1]);
    row.copy_from_slice(&line[..columns]);
    for shift in 1..width {
        add(row, &line[shift..shift + columns]);
    }
    let width = width as f64;
    row.iter_mut().for_each(|pixel| *pixel /= width);
}

/// Means over `width` neighbours along every column.
fn mean_across(pixels: &mut [f64], columns: usize, image: &mut Vec<f64>, width: usize) {
    image.clear();
    image.extend_from_slice(pixels);
    let (half, last) = (width / 2, pixels.len() / columns - 1);
    let line = |row: usize| &image[row * columns..(row + 1) * columns];
    for (row, means) in pixels.chunks_exact_mut(columns).enumerate() {
        // Counted from the row half a width above this one.
        let near = |shift: usize| (row + shift).saturating_sub(half).min(last);
        means.copy_from_slice(line(near(0)));
        for shift in 1..width {
            add(means, line(near(shift)));
        }
        let width = width as f64;
        means.iter_mut().for_each(|pixel| *pixel /= width);
    }
}

fn add(sums: &mut [f64], line: &[f64]) {
    for (sum, value) in sums.iter_mut().zip(line) {
        *sum += value;
    }
}
