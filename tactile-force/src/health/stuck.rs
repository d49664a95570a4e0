//! Pixels that no longer follow the light.

use ndarray::{Array2, ArrayView2};

use crate::error::ForceError;

/// Finds pixels whose grey level does not change while their neighbours' do: dead, hot or stuck ones.
///
/// Feed it frames some time apart, loads among them: a pixel is stuck if it has kept one grey level over all frames while at least
/// five of its eight neighbours have changed in a quarter of them. O(pixels) a frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::StuckPixels;
///
/// let mut stuck = StuckPixels::new((40, 40))?;
/// for k in 0..32_u32 {
///     let mut frame = Array2::from_shape_fn((40, 40), |(y, x)| 50 + ((y * 7 + x * 13 + k as usize * 5) % 4) as u8);
///     frame[[12, 30]] = 255;
///     stuck.update(frame.view())?;
/// }
/// assert_eq!(stuck.pixels(), [(12, 30)]);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct StuckPixels {
    last: Option<Array2<u8>>,
    changes: Array2<u16>,
    frames: u16,
}

/// Fewest frames before a pixel can be called stuck. Of a healthy pixel that rounds to one of two levels at random all
/// differences between 16 frames vanish once in 2¹⁵.
const FEWEST_FRAMES: u16 = 16;

impl StuckPixels {
    /// A search in frames of the given size (rows, columns).
    ///
    /// # Errors
    /// A size without pixels.
    pub fn new((rows, columns): (usize, usize)) -> Result<Self, ForceError> {
        if rows == 0 || columns == 0 {
            return Err(ForceError::EmptyImage { rows, columns });
        }
        Ok(Self {
            last: None,
            changes: Array2::zeros((rows, columns)),
            frames: 0,
        })
    }

    /// Takes a frame.
    ///
    /// # Errors
    /// A frame of another size.
    pub fn update(&mut self, frame: ArrayView2<'_, u8>) -> Result<(), ForceError> {
        let (expected, found) = (self.changes.dim(), frame.dim());
        if expected != found {
            return Err(ForceError::SizeMismatch { expected, found });
        }
        match &mut self.last {
            None => self.last = Some(frame.to_owned()),
            Some(last) => {
                ndarray::Zip::from(&mut self.changes)
                    .and(&mut *last)
                    .and(frame)
                    .for_each(|changes, last, now| {
                        *changes = changes.saturating_add(u16::from(*last != *now));
                        *last = *now;
                    });
            }
        }
        self.frames = self.frames.saturating_add(1);
        Ok(())
    }

    /// The stuck pixels as (row, column); none before sixteen frames.
    pub fn pixels(&self) -> Vec<(usize, usize)> {
        if self.frames < FEWEST_FRAMES {
            return Vec::new();
        }
        let unchanged = self.changes.indexed_iter().filter(|(_, c)| **c == 0);
        unchanged
            .map(|(place, _)| place)
            .filter(|place| self.lively_neighbours(*place) >= 5)
            .collect()
    }

    /// Number of neighbours that changed in a quarter of the frames; those beyond the frame's edge count as the others do.
    fn lively_neighbours(&self, (row, column): (usize, usize)) -> usize {
        let (mut lively, mut all) = (0, 0);
        for y in row.saturating_sub(1)..=row + 1 {
            for x in column.saturating_sub(1)..=column + 1 {
                let Some(changes) = self.changes.get((y, x)) else {
                    continue;
                };
                if (y, x) != (row, column) {
                    all += 1;
                    lively += usize::from(4 * changes >= self.frames);
                }
            }
        }
        (8 * lively).checked_div(all).unwrap_or(0)
    }
}
