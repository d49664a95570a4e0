//! A matrix laid out for products with a few vectors: each entry is read once, in order, and summed in registers.

use pulp::{Arch, Simd, WithSimd};

/// Columns of a strip: three of the widest vectors, so that with three outputs the sums fill the pipelines.
const STRIP: usize = 24;
/// Vectors that are summed at a time.
const VECTORS: usize = 3;

/// A matrix cut into strips of columns, each row by row, padded with zeros.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packed {
    rows: usize,
    columns: usize,
    data: Vec<f64>,
}

impl Packed {
    pub(crate) fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let mut data = Vec::with_capacity(columns.div_ceil(STRIP) * rows * STRIP);
        for start in (0..columns).step_by(STRIP) {
            for i in 0..rows {
                let value = |j: usize| if j < columns { entry(i, j) } else { 0.0 };
                data.extend((start..start + STRIP).map(value));
            }
        }
        Self {
            rows,
            columns,
            data,
        }
    }

    /// Σᵢ factors[i] rowᵢ for each of `M` columns of factors, into `out` from `offset` on, columns `stride` apart.
    pub(crate) fn combine<const M: usize>(
        &self,
        factors: [&[f64]; M],
        out: &mut [f64],
        stride: usize,
        offset: usize,
    ) {
        let factors = factors.map(|column| &column[..self.rows]);
        Arch::new().dispatch(Combine {
            matrix: self,
            factors,
            out,
            stride,
            offset,
        });
    }
}

struct Combine<'a, const M: usize> {
    matrix: &'a Packed,
    factors: [&'a [f64]; M],
    out: &'a mut [f64],
    stride: usize,
    offset: usize,
}

impl<const M: usize> WithSimd for Combine<'_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            matrix,
            factors,
            out,
            stride,
            offset,
        } = self;
        let strips = matrix.data.chunks_exact((matrix.rows * STRIP).max(1));
        for (strip, start) in strips.zip((0..matrix.columns).step_by(STRIP)) {
            let used = STRIP.min(matrix.columns - start);
            let mut sums = [[0.0; STRIP]; M];
            let width = VECTORS * S::F64_LANES;
            for part in (0..STRIP).step_by(width) {
                sum::<S, M>(simd, strip, part, factors, &mut sums);
            }
            for (m, sums) in sums.iter().enumerate() {
                let at = m * stride + offset + start;
                out[at..at + used].copy_from_slice(&sums[..used]);
            }
        }
    }
}

/// The columns of a strip from `part` on, as many as fit the registers.
#[inline(always)]
fn sum<S: Simd, const M: usize>(
    simd: S,
    strip: &[f64],
    part: usize,
    factors: [&[f64]; M],
    sums: &mut [[f64; STRIP]; M],
) {
    let width = VECTORS * S::F64_LANES;
    let rows = strip.len() / STRIP;
    let factors = factors.map(|column| &column[..rows]);
    let mut total = [[simd.splat_f64s(0.0); VECTORS]; M];
    for (i, row) in strip.chunks_exact(STRIP).enumerate().take(rows) {
        let row = S::as_simd_f64s(&row[part..part + width]).0;
        let row: [S::f64s; VECTORS] = core::array::from_fn(|v| row[v]);
        for m in 0..M {
            let factor = simd.splat_f64s(factors[m][i]);
            for v in 0..VECTORS {
                total[m][v] = simd.mul_add_e_f64s(row[v], factor, total[m][v]);
            }
        }
    }
    for m in 0..M {
        S::as_mut_simd_f64s(&mut sums[m][part..part + width])
            .0
            .copy_from_slice(&total[m]);
    }
}
