//! Colour differences against the reference, and the polynomial from them to normals.

use ndarray::{Array2, ArrayView3};
use tactile_core::vectorised;

/// Monomials up to the third degree of three colour differences.
const MONOMIALS: usize = 20;

/// Coefficients of one component of the normal: every monomial times 1, x and y.
pub const TERMS: usize = 3 * MONOMIALS;

/// Columns that are computed together, so that the compiler uses wide instructions.
const LANES: usize = 16;

/// An 8-bit colour image blurred by the binomial kernel (1, 4, 6, 4, 1)/16 along both axes.
///
/// The kernel has a standard deviation of one pixel. Samples are kept as whole numbers of 1/256
/// grey level, which 16 bits hold exactly. The border is continued by its last pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Blurred {
    rows: usize,
    columns: usize,
    samples: Vec<u16>,
}

impl Blurred {
    pub fn of(image: ArrayView3<'_, u8>) -> Self {
        let (rows, columns, _) = image.dim();
        let width = 3 * columns;
        let mut across = vec![0_u16; rows * width];
        let mut line = vec![0_u16; width + 12];
        for (row, out) in image.outer_iter().zip(across.chunks_exact_mut(width)) {
            for (to, from) in line[6..].iter_mut().zip(row.iter()) {
                *to = u16::from(*from);
            }
            for k in 0..6 {
                line[k] = line[6 + k % 3];
                line[6 + width + k] = line[3 + width + k % 3];
            }
            // Neighbours of one channel lie three samples apart.
            binomial([0, 1, 2, 3, 4].map(|k| &line[3 * k..][..width]), out);
        }
        let mut samples = vec![0_u16; rows * width];
        for (row, out) in samples.chunks_exact_mut(width).enumerate() {
            let near = |k: usize| (row + k).saturating_sub(2).min(rows - 1);
            binomial(
                [0, 1, 2, 3, 4].map(|k| &across[near(k) * width..][..width]),
                out,
            );
        }
        Self {
            rows,
            columns,
            samples,
        }
    }

    pub fn dim(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Levels of a pixel's channels.
    #[inline(always)]
    pub fn levels(&self, row: usize, column: usize) -> [f32; 3] {
        let at = 3 * (row * self.columns + column);
        [0, 1, 2].map(|k| f32::from(self.samples[at + k]) / 256.0)
    }

    /// The image at a `gain`-th of its exposure.
    pub fn divided_by(mut self, gain: f64) -> Self {
        if gain != 1.0 {
            let factor = (1.0 / gain) as f32;
            for sample in &mut self.samples {
                // Levels above 255 are beyond those that calibrations see.
                *sample = (f32::from(*sample) * factor).round().min(65535.0) as u16;
            }
        }
        self
    }

    /// Median difference to `reference` of each channel over the frame's border, in grey levels.
    ///
    /// Lamps and exposure change between frames. The border is the part that is touched least, and
    /// a median bears a contact that reaches it.
    fn offset(&self, reference: &Self) -> [f32; 3] {
        // A strip of a thirteenth and a sixteenth at each side is a quarter of the pixels.
        let (high, wide) = (self.rows.div_ceil(13), self.columns.div_ceil(16));
        let mut border: [Vec<i32>; 3] = Default::default();
        for row in 0..self.rows {
            let whole = row < high || row + high >= self.rows;
            // Every third pixel is enough for a median.
            for column in (row % 3..self.columns).step_by(3) {
                if whole || column < wide || column + wide >= self.columns {
                    let at = 3 * (row * self.columns + column);
                    for (channel, differences) in border.iter_mut().enumerate() {
                        let levels = [self, reference].map(|i| i32::from(i.samples[at + channel]));
                        differences.push(levels[0] - levels[1]);
                    }
                }
            }
        }
        border.map(|mut differences| {
            let middle = differences.len() / 2;
            match differences.is_empty() {
                true => 0.0,
                false => *differences.select_nth_unstable(middle).1 as f32 / 256.0,
            }
        })
    }

    /// Differences to `reference` less the offset, in units of 50 grey levels, for one row.
    #[inline(always)]
    fn differences(&self, reference: &Self, offset: [f32; 3], row: usize, out: &mut [Vec<f32>; 3]) {
        let width = 3 * self.columns;
        let lines = [self, reference].map(|image| &image.samples[row * width..][..width]);
        for (channel, out) in out.iter_mut().enumerate() {
            let pixels = lines[0].chunks_exact(3).zip(lines[1].chunks_exact(3));
            for (out, (pixel, flat)) in out.iter_mut().zip(pixels) {
                let difference = (f32::from(pixel[channel]) - f32::from(flat[channel])) / 256.0;
                *out = (difference - offset[channel]) / 50.0;
            }
        }
    }
}

/// The sum with weights 1, 4, 6, 4, 1. It is not divided by 16: of whole numbers it is exact, and of
/// two passes over 8-bit samples at most 255 · 256.
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

/// All monomials of one pixel's differences, from 1 to the third degree.
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

/// A pixel's place from −1 to 1 along both axes.
fn place(row: usize, column: usize, (rows, columns): (usize, usize)) -> [f32; 2] {
    let along = |k: usize, n: usize| (2.0 * k as f32 + 1.0) / n as f32 - 1.0;
    [along(column, columns), along(row, rows)]
}

/// Terms of the polynomial at the pixels that `wanted` takes, each given to `each`.
pub fn samples(
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

/// The components n_x and n_y of the unit normal at every pixel.
pub fn normals(
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
                // Along a row the coefficient of a monomial is a + b x.
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
