//! Colour differences from the reference, and the polynomial that maps them to normals.

use ndarray::{Array2, ArrayView2, ArrayView3, Axis};
use tactile_core::vectorised;

/// Monomials up to the third degree of three colour differences.
const MONOMIALS: usize = 20;

/// Number of coefficients of one component of the normal: each monomial times 1, x and y.
pub(crate) const TERMS: usize = 3 * MONOMIALS;

/// Number of columns computed together, so that the compiler uses SIMD instructions.
const LANES: usize = 16;

/// Maximum number of border samples for a median. More samples hardly change it.
const BORDER_SAMPLES: usize = 6400;

/// An 8-bit colour image, blurred by the binomial kernel (1, 4, 6, 4, 1)/16 along both axes in each
/// channel.
///
/// The kernel has a standard deviation of one pixel. Samples are stored as integers of 1/256 grey
/// level, which fit exactly in 16 bits. The border is extended by its last pixel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Blurred {
    rows: usize,
    columns: usize,
    channels: [Vec<u16>; 3],
}

impl Blurred {
    pub(crate) fn of(image: ArrayView3<'_, u8>) -> Self {
        let (rows, columns, _) = image.dim();
        let mut channels = [(); 3].map(|()| vec![0_u16; rows * columns]);
        // Rows blurred along themselves. Five are needed at a time.
        let mut ring = [(); 5].map(|()| [(); 3].map(|()| vec![0_u16; columns]));
        let mut lines = [(); 3].map(|()| vec![0_u16; columns + 4]);
        let mut ready = 0;
        for row in 0..rows {
            while ready < (row + 3).min(rows) {
                parted(image.index_axis(Axis(0), ready), &mut lines);
                for (line, out) in lines.iter_mut().zip(&mut ring[ready % 5]) {
                    let (first, last) = (line[2], line[columns + 1]);
                    line[..2].fill(first);
                    line[columns + 2..].fill(last);
                    binomial([0, 1, 2, 3, 4].map(|k| &line[k..][..columns]), out);
                }
                ready += 1;
            }
            let near = |k: usize| (row + k).saturating_sub(2).min(rows - 1) % 5;
            for (channel, out) in channels.iter_mut().enumerate() {
                let taps = [0, 1, 2, 3, 4].map(|k| &ring[near(k)][channel][..]);
                binomial(taps, &mut out[row * columns..][..columns]);
            }
        }
        Self {
            rows,
            columns,
            channels,
        }
    }

    pub(crate) fn dim(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// A row of a channel, in units of 1/256 grey level.
    pub(crate) fn line(&self, channel: usize, row: usize) -> &[u16] {
        &self.channels[channel][row * self.columns..][..self.columns]
    }

    /// The image with its exposure divided by `gain`.
    pub(crate) fn divided_by(mut self, gain: f64) -> Self {
        if gain != 1.0 {
            let factor = (1.0 / gain) as f32;
            for sample in self.channels.iter_mut().flatten() {
                // Levels above 255 are outside the range of calibrations.
                *sample = (f32::from(*sample) * factor).round().min(65535.0) as u16;
            }
        }
        self
    }

    /// Median difference of each channel from `reference` over the border of the frame, in grey
    /// levels.
    ///
    /// Lamps and exposure change between frames. The border is the part that is touched least, and
    /// a median tolerates a contact that reaches it.
    fn offset(&self, reference: &Self) -> [f32; 3] {
        // Strips of a thirteenth and a sixteenth on each side contain a quarter of the pixels.
        let (high, wide) = (self.rows.div_ceil(13), self.columns.div_ceil(16));
        // Every third pixel is enough for a median; for large frames fewer.
        let step = (self.rows * self.columns / (4 * BORDER_SAMPLES)).max(3);
        [0, 1, 2].map(|channel| {
            let mut differences = Vec::new();
            for row in 0..self.rows {
                let [own, flat] = [self, reference].map(|image| image.line(channel, row));
                let whole = row < high || row + high >= self.rows;
                for column in (row % step..self.columns).step_by(step) {
                    if whole || column < wide || column + wide >= self.columns {
                        differences.push(i32::from(own[column]) - i32::from(flat[column]));
                    }
                }
            }
            let middle = differences.len() / 2;
            match differences.is_empty() {
                true => 0.0,
                false => *differences.select_nth_unstable(middle).1 as f32 / 256.0,
            }
        })
    }

    /// Differences from `reference` minus the offset, in units of 50 grey levels, for one row.
    #[inline(always)]
    fn differences(&self, reference: &Self, offset: [f32; 3], row: usize, out: &mut [Vec<f32>; 3]) {
        for (channel, out) in out.iter_mut().enumerate() {
            let [own, flat] = [self, reference].map(|image| image.line(channel, row));
            for ((out, own), flat) in out.iter_mut().zip(own).zip(flat) {
                let difference = (f32::from(*own) - f32::from(*flat)) / 256.0;
                *out = (difference - offset[channel]) / 50.0;
            }
        }
    }
}

/// The channels of a row, with space for two samples on either side.
fn parted(row: ArrayView2<'_, u8>, lines: &mut [Vec<u16>; 3]) {
    let [a, b, c] = lines.each_mut().map(|line| &mut line[2..]);
    let places = a.iter_mut().zip(b).zip(c);
    if let Some(bytes) = row.as_slice() {
        for (((a, b), c), pixel) in places.zip(bytes.chunks_exact(3)) {
            (*a, *b, *c) = (pixel[0].into(), pixel[1].into(), pixel[2].into());
        }
    } else {
        for (((a, b), c), pixel) in places.zip(row.outer_iter()) {
            (*a, *b, *c) = (pixel[0].into(), pixel[1].into(), pixel[2].into());
        }
    }
}

/// The sum with weights 1, 4, 6, 4, 1, without the division by 16. It is exact for integers, and
/// two passes over 8-bit samples give at most 255 · 256.
fn binomial(taps: [&[u16]; 5], out: &mut [u16]) {
    let [a, b, c, d, e] = taps.map(|tap| &tap[..out.len()]);
    vectorised(
        #[inline(always)]
        || {
            for (i, out) in out.iter_mut().enumerate() {
                *out = a[i] + e[i] + 4 * (b[i] + d[i]) + 6 * c[i];
            }
        },
    );
}

/// All monomials of one pixel's differences, from 1 to third degree.
#[inline(always)]
fn monomials([r, g, b]: [f32; 3]) -> [f32; MONOMIALS] {
    let (rr, rg, rb, gg, gb, bb) = (r * r, r * g, r * b, g * g, g * b, b * b);
    [
        1.0,
        r,
        g,
        b,
        rr,
        rg,
        rb,
        gg,
        gb,
        bb,
        rr * r,
        rr * g,
        rr * b,
        rg * g,
        rg * b,
        rb * b,
        gg * g,
        gg * b,
        gb * b,
        bb * b,
    ]
}

/// The terms of the polynomial at a pixel, in the order of the coefficients.
fn terms(differences: [f32; 3], [x, y]: [f32; 2]) -> [f64; TERMS] {
    let colour = monomials(differences);
    core::array::from_fn(|k| {
        let place = [1.0, x, y][k / MONOMIALS];
        f64::from(colour[k % MONOMIALS] * place)
    })
}

/// Position of a pixel, from −1 to 1 along both axes.
fn place(row: usize, column: usize, (rows, columns): (usize, usize)) -> [f32; 2] {
    let along = |k: usize, n: usize| (2.0 * k as f32 + 1.0) / n as f32 - 1.0;
    [along(column, columns), along(row, rows)]
}

/// Calls `each` with the terms of the polynomial at each pixel for which `wanted` is true.
pub(crate) fn samples(
    frame: &Blurred,
    reference: &Blurred,
    mut each: impl FnMut(usize, usize, &dyn Fn() -> [f64; TERMS]),
) {
    let offset = frame.offset(reference);
    let mut line: [Vec<f32>; 3] = core::array::from_fn(|_| vec![0.0; frame.columns]);
    for row in 0..frame.rows {
        frame.differences(reference, offset, row, &mut line);
        let [red, green, blue] = &line;
        let pixels = red.iter().zip(green).zip(blue).enumerate();
        for (column, ((r, g), b)) in pixels {
            let at = || terms([*r, *g, *b], place(row, column, frame.dim()));
            each(row, column, &at);
        }
    }
}

/// The components n_x and n_y of the unit normal at each pixel.
pub(crate) fn normals(
    frame: &Blurred,
    reference: &Blurred,
    coefficients: &[Vec<f64>; 2],
) -> [Array2<f32>; 2] {
    let (rows, columns) = frame.dim();
    let offset = frame.offset(reference);
    // Padded to whole groups of lanes.
    let padded = columns.next_multiple_of(LANES);
    let mut line: [Vec<f32>; 3] = core::array::from_fn(|_| vec![0.0; padded]);
    let mut out = [(); 2].map(|()| Array2::zeros((rows, columns)));
    let weight = |component: usize, k: usize| coefficients[component][k] as f32;
    vectorised(
        #[inline(always)]
        || {
            for row in 0..rows {
                frame.differences(reference, offset, row, &mut line);
                let [_, y] = place(row, 0, (rows, columns));
                // Along a row, the coefficient of a monomial is a + b x.
                let fixed: [[f32; MONOMIALS]; 2] = core::array::from_fn(|component| {
                    core::array::from_fn(|k| {
                        weight(component, k) + y * weight(component, k + 2 * MONOMIALS)
                    })
                });
                let along: [[f32; MONOMIALS]; 2] = core::array::from_fn(|component| {
                    core::array::from_fn(|k| weight(component, k + MONOMIALS))
                });
                for start in (0..padded).step_by(LANES) {
                    let lanes: [&[f32]; 3] = core::array::from_fn(|k| &line[k][start..][..LANES]);
                    let mut sums = [[0.0; LANES]; 2];
                    for lane in 0..LANES {
                        let colour = monomials([lanes[0][lane], lanes[1][lane], lanes[2][lane]]);
                        let x = (2.0 * (start + lane) as f32 + 1.0) / columns as f32 - 1.0;
                        for (sums, (fixed, along)) in sums.iter_mut().zip(fixed.iter().zip(&along))
                        {
                            let (mut a, mut b) = (0.0, 0.0);
                            for (k, monomial) in colour.iter().enumerate() {
                                a += fixed[k] * monomial;
                                b += along[k] * monomial;
                            }
                            sums[lane] = a + x * b;
                        }
                    }
                    for (out, sums) in out.iter_mut().zip(&sums) {
                        let mut row = out.row_mut(row);
                        if let Some(row) = row.as_slice_mut() {
                            let row = &mut row[start..];
                            let lanes = LANES.min(row.len());
                            row[..lanes].copy_from_slice(&sums[..lanes]);
                        }
                    }
                }
            }
        },
    );
    out
}
