//! Register tiles of a blocked factorisation, and the copies that feed them.

use pulp::Simd;

use crate::layout::PANEL;

/// Columns of a block.
pub(crate) const BLOCK: usize = 64;
/// Depth to which tiles gather before they are written back, so that a packed strip stays in the first-level cache.
pub(crate) const DEPTH: usize = 128;
/// Rows of the tallest strip: three vectors of eight.
const TALL: usize = 24;

/// Copies that bring what a tile reads next to each other: columns lie pages apart.
pub(crate) struct Strips {
    strip: [f64; TALL * DEPTH],
    block: [f64; BLOCK * DEPTH],
}

impl Strips {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            strip: [0.0; TALL * DEPTH],
            block: [0.0; BLOCK * DEPTH],
        }
    }

    /// Subtracts what the columns `earlier` contribute to the `columns`, strip of rows by strip of rows.
    #[inline(always)]
    pub(crate) fn update<S: Simd>(
        &mut self,
        simd: S,
        l: &mut [f64],
        stride: usize,
        order: usize,
        earlier: core::ops::Range<usize>,
        columns: core::ops::Range<usize>,
    ) {
        let depth = earlier.len();
        let (left, right) = l.split_at_mut(columns.start * stride);
        let left = &left[earlier.start * stride..earlier.end * stride];
        for (panel, block) in columns
            .clone()
            .step_by(PANEL)
            .zip(self.block.chunks_exact_mut(PANEL * DEPTH))
        {
            pack(block, PANEL, left, stride, panel);
        }
        let tall = 3 * S::F64_LANES;
        let mut row = columns.start;
        while row < order {
            let height = if row + tall <= order {
                tall
            } else {
                S::F64_LANES
            };
            pack(&mut self.strip[..depth * height], height, left, stride, row);
            self.subtract(simd, right, stride, columns.clone(), row, [depth, height]);
            row += height;
        }
    }

    /// Subtracts what the packed strip of `height` rows from `row` on contributes to every panel it meets.
    #[inline(always)]
    fn subtract<S: Simd>(
        &self,
        simd: S,
        right: &mut [f64],
        stride: usize,
        columns: core::ops::Range<usize>,
        row: usize,
        [depth, height]: [usize; 2],
    ) {
        let strip = &self.strip[..depth * height];
        let whole = height > S::F64_LANES;
        // Panels that begin below the strip's last row lie above the diagonal.
        let panels = columns
            .clone()
            .step_by(PANEL)
            .take_while(|&column| column < row + height);
        for (column, block) in panels.zip(self.block.chunks_exact(PANEL * DEPTH)) {
            let (block, panel) = (
                &block[..depth * PANEL],
                &mut right[(column - columns.start) * stride..],
            );
            if whole {
                wide::<S, 3>(simd, strip, block, panel, stride, row);
            } else {
                wide::<S, 1>(simd, strip, block, panel, stride, row);
            }
        }
    }
}

/// Copies `height` rows from `row` on of each column next to each other.
#[inline(always)]
fn pack(to: &mut [f64], height: usize, columns: &[f64], stride: usize, row: usize) {
    for (to, from) in to
        .chunks_exact_mut(height)
        .zip(columns.chunks_exact(stride))
    {
        to.copy_from_slice(&from[row..row + height]);
    }
}

/// One packed strip of one panel: as wide a tile as the registers hold.
#[inline(always)]
fn wide<S: Simd, const V: usize>(
    simd: S,
    a: &[f64],
    b: &[f64],
    panel: &mut [f64],
    stride: usize,
    row: usize,
) {
    let steps = || a.chunks_exact(V * S::F64_LANES).zip(b.chunks_exact(PANEL));
    if S::F64_LANES >= 8 {
        tile::<S, V, 8>(simd, steps(), panel, stride, row);
    } else {
        tile::<S, V, 4>(simd, steps().map(|(a, b)| (a, &b[..4])), panel, stride, row);
        tile::<S, V, 4>(
            simd,
            steps().map(|(a, b)| (a, &b[4..])),
            &mut panel[4 * stride..],
            stride,
            row,
        );
    }
}

/// Subtracts Σ a bᵀ over the steps from `N` columns of the panel, `V` vectors from `row` on.
#[inline(always)]
pub(crate) fn tile<'a, S: Simd, const V: usize, const N: usize>(
    simd: S,
    steps: impl Iterator<Item = (&'a [f64], &'a [f64])>,
    panel: &mut [f64],
    stride: usize,
    row: usize,
) {
    let mut sum = [[simd.splat_f64s(0.0); V]; N];
    for (a, b) in steps {
        let a = load::<S, V>(a, 0);
        let b = &b[..N];
        for j in 0..N {
            let b = simd.splat_f64s(b[j]);
            for v in 0..V {
                sum[j][v] = simd.mul_add_e_f64s(a[v], b, sum[j][v]);
            }
        }
    }
    for j in 0..N {
        let at = j * stride + row;
        let target = S::as_mut_simd_f64s(&mut panel[at..at + V * S::F64_LANES]).0;
        for v in 0..V {
            target[v] = simd.sub_f64s(target[v], sum[j][v]);
        }
    }
}

/// `V` vectors of `simd` from `column[row..]`.
#[inline(always)]
pub(crate) fn load<S: Simd, const V: usize>(column: &[f64], row: usize) -> [S::f64s; V] {
    let vectors = S::as_simd_f64s(&column[row..row + V * S::F64_LANES]).0;
    core::array::from_fn(|v| vectors[v])
}
