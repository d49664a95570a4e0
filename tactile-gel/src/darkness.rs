//! A gel that darkens where it is pressed: all contacts, and the depth of each from a table.

use ndarray::{Array2, ArrayView2};
use tactile_core::{Estimate, InvalidOption, Requirement, regions};
use tactile_sfs::DepthTable;

use crate::GelError;
use crate::error::same_shape;

/// Regions with fewer pixels are specks of noise.
const LEAST_PIXELS: usize = 12;

/// A gel that darkens with depth, with its table of darkness and depth.
///
/// ```
/// use ndarray::{Array2, s};
/// use tactile_gel::DarkGel;
/// use tactile_sfs::DepthTable;
/// // A hundred grey levels of darkening are half a millimetre of depth.
/// let gel = DarkGel::new(DepthTable::new(&[(0.0, 0.0), (100.0, 5e-4)])?, 3.0, [1e-4; 2])?;
/// let reference = Array2::from_elem((64, 64), 200_u8);
/// let mut frame = reference.clone();
/// frame.slice_mut(s![10..30, 10..30]).fill(140);
/// frame.slice_mut(s![40..50, 40..50]).fill(120);
/// let found = gel.read(frame.view(), reference.view())?;
/// let depths: Vec<f64> = found.contacts.iter().map(|c| 1e4 * c.depth_m.value).collect();
/// assert!((depths[0] - 3.0).abs() < 1e-9 && (depths[1] - 4.0).abs() < 1e-9);
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
#[derive(Clone, Debug)]
pub struct DarkGel {
    table: DepthTable<f64>,
    threshold_grey: f64,
    pixel_size_m: [f64; 2],
}

/// Results of one frame of a gel that darkens.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DarkFrame {
    /// Depth in metres, NaN outside contacts.
    pub depth_m: Array2<f64>,
    /// Number of each pixel's contact, counted from 1 in the order of [`contacts`](Self::contacts).
    /// 0 outside contacts.
    pub labels: Array2<u16>,
    /// Contacts, the widest first.
    pub contacts: Vec<DarkPatch>,
    /// Increase of the whole frame over the reference, in grey levels.
    pub background_step_grey: f64,
}

/// A contact of a gel that darkens.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct DarkPatch {
    /// Column and row of the centroid. The error corresponds to an outline that is uncertain by
    /// half a pixel at each pixel: for a disc it is 1/√(2 radius) of that.
    pub centroid_px: [Estimate; 2],
    /// Area in square metres.
    pub area_m2: f64,
    /// Maximum depth in metres, with the error from one grey level.
    pub depth_m: Estimate,
    /// Maximum darkness in grey levels.
    pub darkness_grey: f64,
    /// Whether the contact reaches the frame's border.
    pub touches_border: bool,
    /// Whether the darkness is outside the table, whose last depth is then used.
    pub beyond_table: bool,
}

impl DarkGel {
    /// Creates the gel from a table of darkness in grey levels and depth in metres, the darkness
    /// that counts as contact, and the size of a pixel.
    ///
    /// # Errors
    /// An error for a size or a threshold that is not positive.
    pub fn new(
        table: DepthTable<f64>,
        threshold_grey: f64,
        pixel_size_m: [f64; 2],
    ) -> Result<Self, InvalidOption> {
        Requirement::Positive.check("contact threshold", threshold_grey)?;
        for size in pixel_size_m {
            Requirement::Positive.check("pixel size", size)?;
        }
        Ok(Self {
            table,
            threshold_grey,
            pixel_size_m,
        })
    }

    /// All contacts of a frame, and the depths of their pixels. O(pixels).
    ///
    /// If all levels change by more than the threshold, measured along the border of the frame, the
    /// change is subtracted.
    ///
    /// # Errors
    /// [`GelError::ShapeMismatch`], [`GelError::EmptyImage`].
    pub fn read(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: ArrayView2<'_, u8>,
    ) -> Result<DarkFrame, GelError> {
        let (rows, columns) = frame.dim();
        if rows == 0 || columns == 0 {
            return Err(GelError::EmptyImage { rows, columns });
        }
        same_shape("frame", reference.dim(), frame.dim())?;
        let step = border_step(frame, reference);
        let step = if step.abs() > self.threshold_grey {
            step
        } else {
            0.0
        };
        let darkness = Array2::from_shape_fn(frame.dim(), |at| {
            f64::from(reference[at]) - f64::from(frame[at]) + step
        });
        let mut dark: Vec<bool> = darkness.iter().map(|d| *d > self.threshold_grey).collect();
        let patches = regions(&mut dark, columns).filter(|patch| patch.len() >= LEAST_PIXELS);
        let places = patches.map(|patch| patch.into_iter().map(|at| [at / columns, at % columns]));
        let mut patches: Vec<Vec<[usize; 2]>> = places.map(Iterator::collect).collect();
        patches.sort_by_key(|patch| core::cmp::Reverse(patch.len()));
        let mut depth_m = Array2::from_elem(frame.dim(), f64::NAN);
        let mut labels = Array2::zeros(frame.dim());
        for (k, patch) in patches.iter().enumerate() {
            for &at in patch {
                depth_m[at] = self.table.depth(darkness[at]).0;
                labels[at] = k as u16 + 1;
            }
        }
        let contacts = patches.iter().map(|patch| self.contact(patch, &darkness));
        Ok(DarkFrame {
            contacts: contacts.collect(),
            depth_m,
            labels,
            background_step_grey: step,
        })
    }

    fn contact(&self, patch: &[[usize; 2]], darkness: &Array2<f64>) -> DarkPatch {
        let n = patch.len() as f64;
        let mean = |axis: usize| patch.iter().map(|at| at[axis] as f64).sum::<f64>() / n;
        let radius_px = (n / core::f64::consts::PI).sqrt();
        let centroid_error = 0.5 / (2.0 * radius_px).sqrt();
        let darkest = patch.iter().map(|at| darkness[*at]).fold(0.0, f64::max);
        let (depth, inside) = self.table.depth(darkest);
        let level = (depth - self.table.depth(darkest - 1.0).0).abs();
        let [width, height] = self.pixel_size_m;
        let (rows, columns) = darkness.dim();
        let at_border =
            |&[r, c]: &[usize; 2]| r == 0 || c == 0 || r + 1 == rows || c + 1 == columns;
        DarkPatch {
            centroid_px: [mean(1), mean(0)].map(|value| Estimate::new(value, centroid_error)),
            area_m2: n * width * height,
            depth_m: Estimate::new(depth, level),
            darkness_grey: darkest,
            touches_border: patch.iter().any(at_border),
            beyond_table: !inside,
        }
    }
}

/// Median change of the levels along the border, a sixteenth of the frame on each side.
fn border_step(frame: ArrayView2<'_, u8>, reference: ArrayView2<'_, u8>) -> f64 {
    let (rows, columns) = frame.dim();
    let (high, wide) = (rows.div_ceil(16), columns.div_ceil(16));
    let border =
        |r: usize, c: usize| r < high || c < wide || r + high >= rows || c + wide >= columns;
    let steps = frame.indexed_iter().filter(|((r, c), _)| border(*r, *c));
    let steps = steps.map(|(at, level)| i16::from(*level) - i16::from(reference[at]));
    let mut steps: Vec<i16> = steps.collect();
    let middle = steps.len() / 2;
    f64::from(*steps.select_nth_unstable(middle).1)
}
