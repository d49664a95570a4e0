//! The differences of a frame from its reference inside a box, corrected for drift and vignetting.

use ndarray::ArrayView2;

use crate::drift::{DriftLine, IlluminationDrift};
use crate::frame::{FlatField, FlatLine, Levels};
use crate::simd::vectorized;
use tactile_core::BoundingBox;

/// The rows of a box, and how their differences are corrected.
pub(super) struct Rows<'a> {
    pub(super) frame: ArrayView2<'a, u8>,
    pub(super) levels: Levels<'a>,
    pub(super) place: BoundingBox,
    pub(super) drift: Option<&'a IlluminationDrift>,
    pub(super) flat: Option<FlatField>,
    /// −1 where contact darkens.
    pub(super) sign: f32,
}

impl Rows<'_> {
    /// Writes the differences and returns the greatest of them, zero if none is positive.
    pub(super) fn take(&self, differences: &mut [f32]) -> f32 {
        match self.levels {
            Levels::Whole(levels) => self.take_from(levels, differences),
            Levels::Fine(levels) => self.take_from(levels, differences),
        }
    }

    fn take_from<P: Copy + Into<f32>>(
        &self,
        levels: ArrayView2<'_, P>,
        differences: &mut [f32],
    ) -> f32 {
        let (frame, levels) = (self.place.of(self.frame), self.place.of(levels));
        let first_column = self.place.column_start;
        let rows = differences.chunks_exact_mut(self.place.columns());
        let mut greatest = 0.0;
        for ((y, differences), (frame, levels)) in rows
            .enumerate()
            .zip(frame.rows().into_iter().zip(levels.rows()))
        {
            let row = self.place.row_start + y;
            let (drift, flat) = (
                self.drift.map(|drift| drift.line(row, first_column)),
                self.flat.map(|flat| flat.line(row, first_column)),
            );
            let mut take = |frame: &[u8], levels: &[P]| {
                let row = Row {
                    frame,
                    levels,
                    drift,
                    flat,
                    sign: self.sign,
                    differences,
                };
                greatest = larger(greatest, vectorized(row));
            };
            match (frame.to_slice(), levels.to_slice()) {
                (Some(frame), Some(levels)) => take(frame, levels),
                _ => take(&frame.to_vec(), &levels.to_vec()),
            }
        }
        greatest
    }
}

/// One row; the greatest difference is taken while the row is in the nearest cache.
struct Row<'a, P> {
    frame: &'a [u8],
    levels: &'a [P],
    drift: Option<DriftLine>,
    flat: Option<FlatLine>,
    sign: f32,
    differences: &'a mut [f32],
}

impl<P: Copy + Into<f32>> pulp::NullaryFnOnce for Row<'_, P> {
    type Output = f32;

    #[inline(always)]
    fn call(self) -> f32 {
        let Self {
            differences, sign, ..
        } = self;
        let n = differences.len();
        let (frame, levels) = (&self.frame[..n], &self.levels[..n]);
        match self.drift {
            None => {
                for x in 0..n {
                    differences[x] = sign * (f32::from(frame[x]) - levels[x].into());
                }
            }
            Some(line) => {
                for x in 0..n {
                    let (frame, level) = (f32::from(frame[x]), levels[x].into());
                    differences[x] = sign * line.difference(x, frame, level);
                }
            }
        }
        if let Some(flat) = self.flat {
            for (x, difference) in differences.iter_mut().enumerate() {
                *difference /= flat.at(x);
            }
        }
        greatest_of(differences)
    }
}

/// Greatest of the values, zero if none is positive.
pub(super) fn greatest(values: &[f32]) -> f32 {
    vectorized(Greatest(values))
}

struct Greatest<'a>(&'a [f32]);

impl pulp::NullaryFnOnce for Greatest<'_> {
    type Output = f32;

    #[inline(always)]
    fn call(self) -> f32 {
        greatest_of(self.0)
    }
}

#[inline(always)]
fn greatest_of(values: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 16];
    let (chunks, rest) = values.as_chunks::<16>();
    for chunk in chunks {
        lanes = std::array::from_fn(|k| larger(lanes[k], chunk[k]));
    }
    lanes.iter().chain(rest).copied().fold(0.0, larger)
}

/// A comparison, which has a wide instruction; the first where the second is not a number.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}
