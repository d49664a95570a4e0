//! How fine the grid is on which a surface is reconstructed.
//!
//! A contact of 10⁵ pixels carries 200 control points; the heights between them are not asked for. Means over blocks of
//! pixels cost one pass, lower the noise by the block's width, and leave the reconstruction a small grid.
use super::contact::resize;
use crate::force::BoundingBox;
use ndarray::{Array2, ArrayView1, ArrayView2, ArrayViewMut2, Axis, Slice};
use std::ops::Range;

/// Pixels of the reconstruction's grid, inside the contact, for every control point: the points then stand four or
/// more pixels apart. Finer grids cost time, and neither heights nor strains become better.
const PIXELS_PER_POINT: usize = 16;

/// The grid of the surface stage.
///
/// ```
/// use tactile_imaging::pipeline::{Binning, Object, Pipeline};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// // A contact of some 1250 pixels. Ten points leave each 125 of them: blocks of 2 × 2 keep more than 16 a point.
/// let ten = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?.with_control_points(10);
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// for (binning, side) in [(Binning::Auto, 2), (Binning::Blocks(4), 4)] {
///     let pipeline = ten.clone().with_settings(|settings| settings.binning = binning)?;
///     let mut press = pipeline.press(reference.view())?;
///     press.add_frame(frame.view());
///     assert_eq!(press.surface(0)?.binning, side);
/// }
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Binning {
    /// Blocks as large as the control points allow: at least 16 of them inside the contact for every point.
    #[default]
    Auto,
    /// Blocks of n × n pixels; 1 for every pixel on its own (0 is refused).
    Blocks(usize),
}

impl Binning {
    /// Side of a block in pixels, for a contact of `pixels` with `points` control points.
    pub(super) fn side(self, pixels: usize, points: usize) -> usize {
        match self {
            Self::Auto => (pixels / (PIXELS_PER_POINT * points.max(1))).isqrt().max(1),
            Self::Blocks(side) => side.max(1),
        }
    }
}

/// The box that whole blocks make of a contact's box: grown to the right and downwards, cut at the frame's end.
pub(super) fn whole_blocks(
    region: BoundingBox,
    side: usize,
    (rows, columns): (usize, usize),
) -> BoundingBox {
    let end = |start: usize, end: usize, limit: usize| {
        let blocks = (end - start).div_ceil(side).min((limit - start) / side);
        start + blocks * side
    };
    BoundingBox {
        row_end: end(region.row_start, region.row_end, rows),
        column_end: end(region.column_start, region.column_end, columns),
        ..region
    }
}

/// Mean differences frame − reference of the blocks of `region`, times `scale`; O(pixels of the box).
pub(super) fn mean_difference(
    frame: ArrayView2<'_, u8>,
    reference: ArrayView2<'_, u8>,
    region: BoundingBox,
    side: usize,
    scale: f64,
    means: &mut Array2<f64>,
) {
    resize(means, (region.rows() / side, region.columns() / side));
    let (frame, reference) = (region.of(frame), region.of(reference));
    if side == 1 {
        // A block of one pixel is its own sum.
        let rows = means.rows_mut().into_iter();
        for ((mut means, frame), reference) in rows.zip(frame.rows()).zip(reference.rows()) {
            let pixels = means.iter_mut().zip(frame).zip(reference);
            pixels.for_each(|((mean, f), r)| {
                *mean = f64::from(i16::from(*f) - i16::from(*r)) * scale
            });
        }
        return;
    }
    let pairs = |row: usize, columns: Range<usize>, sums: &mut [i16]| {
        let frame = span_of(frame, row, columns.clone());
        let reference = span_of(reference, row, columns);
        match (frame.to_slice(), reference.to_slice()) {
            // Slices, where the layout allows, turn into wide instructions.
            (Some(frame), Some(reference)) => add_differences(sums, frame, reference),
            _ => add_differences(sums, frame, reference),
        }
    };
    sum_blocks(side, means.view_mut(), pairs, f64::from);
    let scale = scale / (side * side) as f64;
    means.mapv_inplace(|sum| sum * scale);
}

/// Blocks of which at least three quarters lie in the contact (with fewer, the rim draws the surface down); `mask` covers
/// `contact`, blocks are those of `region`.
pub(super) fn block_mask(
    mask: ArrayView2<'_, bool>,
    contact: BoundingBox,
    region: BoundingBox,
    side: usize,
    blocks: &mut Array2<bool>,
) {
    resize(blocks, (region.rows() / side, region.columns() / side));
    if side == 1 && blocks.dim() == mask.dim() {
        blocks.assign(&mask);
        return;
    }
    let (rows, columns) = (contact.rows(), contact.columns());
    let inside = |row: usize, span: Range<usize>, counts: &mut [i16]| {
        if row < rows {
            let span = span.start.min(columns)..span.end.min(columns);
            let mask = span_of(mask, row, span);
            match mask.to_slice() {
                Some(mask) => add_inside(counts, mask),
                None => add_inside(counts, mask),
            }
        }
    };
    let three_quarters = |count: i32| 4 * count as usize >= 3 * side * side;
    sum_blocks(side, blocks.view_mut(), inside, three_quarters);
}

/// Adds frame − reference.
fn add_differences<'a>(
    sums: &mut [i16],
    frame: impl IntoIterator<Item = &'a u8>,
    reference: impl IntoIterator<Item = &'a u8>,
) {
    for ((sum, f), r) in sums.iter_mut().zip(frame).zip(reference) {
        *sum += i16::from(*f) - i16::from(*r);
    }
}

/// Counts the pixels inside.
fn add_inside<'a>(counts: &mut [i16], mask: impl IntoIterator<Item = &'a bool>) {
    for (count, inside) in counts.iter_mut().zip(mask) {
        *count += i16::from(*inside);
    }
}

/// Some columns of a row.
fn span_of<'a, T>(
    image: ArrayView2<'a, T>,
    row: usize,
    columns: Range<usize>,
) -> ArrayView1<'a, T> {
    let row = image.index_axis_move(Axis(0), row);
    row.slice_axis_move(Axis(0), Slice::from(columns))
}

/// Columns that are summed at a time.
const STRIP: usize = 128;

/// Rows that are summed in 16 bits, in which wide instructions hold twice as many numbers: 128 times 255 fits.
const ROWS: usize = 128;

/// Sums over square blocks: the rows of a band of blocks are added up column by column, in wide instructions, then the columns of each block.
/// `add` adds the pixels of a row, in a span of columns, to sums.
fn sum_blocks<T>(
    side: usize,
    mut blocks: ArrayViewMut2<'_, T>,
    add: impl Fn(usize, Range<usize>, &mut [i16]),
    result: impl Fn(i32) -> T,
) {
    // A block that is wider than the strip is laid over it several times.
    let per_strip = (STRIP / side).max(1);
    for (band, mut blocks) in blocks.rows_mut().into_iter().enumerate() {
        let strips = blocks.axis_chunks_iter_mut(Axis(0), per_strip);
        for (strip, mut blocks) in strips.enumerate() {
            let first = strip * per_strip * side;
            let mut sums = [0; STRIP];
            for start in (0..blocks.len() * side).step_by(STRIP) {
                let width = STRIP.min(blocks.len() * side - start);
                let columns = first + start..first + start + width;
                for above in (0..side).step_by(ROWS) {
                    let mut part = [0; STRIP];
                    for row in above..side.min(above + ROWS) {
                        add(band * side + row, columns.clone(), &mut part[..width]);
                    }
                    for (sum, part) in sums.iter_mut().zip(part) {
                        *sum += i32::from(part);
                    }
                }
            }
            let columns = STRIP.min(side);
            for (block, columns) in blocks.iter_mut().zip(sums.chunks(columns)) {
                *block = result(columns.iter().sum());
            }
        }
    }
}

/// How far inside the rim of a round contact, in pixels, the middle of a pixel must lie.
const RIM_PX: f64 = 0.25;

/// Takes away pixels at the rim, on the frame's own grid: those that are darker than a hemisphere's, √(2d/a), at `RIM_PX` from its
/// rim. The contact covers them partly, or they have their light from the blur: they would be cliffs. A whole ring less
/// would cost the surface a quarter of its height, and more of a smaller contact's.
pub(super) fn trim_rim(mask: &mut Array2<bool>, shading: &Array2<f64>) {
    let pixels = mask.iter().filter(|inside| **inside).count();
    let radius = (pixels as f64 / std::f64::consts::PI).sqrt();
    let least = (2.0 * RIM_PX / radius).sqrt();
    mask.zip_mut_with(shading, |inside, &light| *inside &= light >= least);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_no_larger_than_the_points_allow() {
        assert_eq!(Binning::Auto.side(3_199, 200), 1);
        assert_eq!(Binning::Auto.side(4 * 3_200, 200), 2);
        assert_eq!(Binning::Auto.side(9 * 3_200 - 1, 200), 2);
        assert_eq!(Binning::Blocks(0).side(10, 0), 1);
    }

    #[test]
    fn means_of_blocks_are_those_of_their_pixels() {
        let frame = Array2::from_shape_fn((9, 11), |(r, c)| (7 * r + 3 * c) as u8);
        let reference = Array2::from_elem((9, 11), 5_u8);
        let contact = BoundingBox {
            row_start: 1,
            row_end: 8,
            column_start: 2,
            column_end: 9,
        };
        let region = whole_blocks(contact, 3, frame.dim());
        assert_eq!(
            (region.row_end, region.column_end),
            (7, 11),
            "two blocks down to the frame's end, three across"
        );
        let mut means = Array2::zeros((0, 0));
        mean_difference(frame.view(), reference.view(), region, 3, 2.0, &mut means);
        // The mean of a linear function is its value in the block's middle; all sums are exact in f64.
        let middle = |(r, c): (usize, usize)| {
            2.0 * (7.0 * (3 * r + 2) as f64 + 3.0 * (3 * c + 3) as f64 - 5.0)
        };
        for (at, mean) in means.indexed_iter() {
            assert!((mean - middle(at)).abs() < 1e-12, "{at:?}: {mean}");
        }
    }

    #[test]
    fn blocks_of_one_pixel_are_the_pixels() {
        let frame = Array2::from_shape_fn((5, 7), |(r, c)| (7 * r + 3 * c) as u8);
        let reference = Array2::from_elem((5, 7), 9_u8);
        let region = BoundingBox {
            row_start: 1,
            row_end: 4,
            column_start: 2,
            column_end: 7,
        };
        let mut means = Array2::zeros((0, 0));
        mean_difference(frame.view(), reference.view(), region, 1, -0.5, &mut means);
        let expected = |(r, c): (usize, usize)| {
            -0.5 * (f64::from(frame[[r + 1, c + 2]]) - f64::from(reference[[r + 1, c + 2]]))
        };
        assert_eq!(means, Array2::from_shape_fn((3, 5), expected));
        let mask = Array2::from_shape_fn((3, 5), |(r, c)| r != c);
        let mut blocks = Array2::default((0, 0));
        block_mask(mask.view(), region, region, 1, &mut blocks);
        assert_eq!(blocks, mask);
    }

    #[test]
    fn a_block_is_inside_if_three_quarters_of_it_are() {
        let contact = BoundingBox {
            row_start: 0,
            row_end: 2,
            column_start: 0,
            column_end: 6,
        };
        let mask = Array2::from_shape_fn((2, 6), |(r, c)| c <= 2 || c == 4 || (c == 5 && r == 0));
        let mut blocks = Array2::default((0, 0));
        block_mask(mask.view(), contact, contact, 2, &mut blocks);
        assert_eq!(blocks.as_slice(), Some(&[true, false, true][..]));
    }

    #[test]
    fn pixels_too_near_the_rim_of_a_hemisphere_are_trimmed() {
        let distance = |(r, c): (usize, usize)| (r as f64 - 25.3).hypot(c as f64 - 24.8);
        let shading = Array2::from_shape_fn((50, 50), |at| {
            (1.0 - (distance(at) / 20.0).powi(2)).max(0.0).sqrt()
        });
        // A blur's light reaches half a pixel beyond the rim.
        let mut mask = Array2::from_shape_fn((50, 50), |at| distance(at) < 20.5);
        trim_rim(&mut mask, &shading);
        for (at, inside) in mask.indexed_iter() {
            // The radius from the pixels is half a pixel too large at most: a fortieth of the quarter pixel.
            let inner = 20.0 - distance(at);
            assert!(
                if inner > 0.26 {
                    *inside
                } else {
                    !*inside || inner > 0.23
                },
                "{at:?}: {inner}"
            );
        }
        let mut flat = Array2::from_elem((6, 6), true);
        trim_rim(&mut flat, &Array2::from_elem((6, 6), 1.0));
        assert!(
            flat.iter().all(|inside| *inside),
            "a flat contact has no dark rim"
        );
    }
}
