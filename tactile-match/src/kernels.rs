//! Dense kernels on padded columns: normal equations, Cholesky factors, combinations of columns.

/// Columns are padded with zeros to a multiple of this length, so that they consist of whole SIMD
/// vectors.
pub(crate) const LANES: usize = 8;

// All kernels sum in the order of the plain loops. Several columns or rows are processed together
// only to share loads and to hide the latency of the additions.

pub(crate) type Block = [f64; LANES];
/// Values of a column for the rows that are whitened together.
pub(crate) type Stripe = [Block; TOGETHER];

/// Number of columns or rows processed together: their running sums stay in registers.
pub(crate) const TOGETHER: usize = 4;

/// Number of rows of all columns processed together: half a megabyte, so that they stay in cache
/// while each column is multiplied with each other. Without tiles, sets of 100,000 points take
/// three times as long.
const TILE: usize = 1024;

/// Writes the lower triangle of `AᵀWA` into `gram`, row by row, and `AᵀWz` into `moments`, for the
/// `count` columns of A and the `D` columns of z: `O(I count²)`. `weighted` is memory for one
/// column.
#[inline(always)]
pub(crate) fn normal_equations<'a, const D: usize>(
    column: impl Fn(usize) -> &'a [f64],
    count: usize,
    weights: &[f64],
    targets: &[Vec<f64>; D],
    weighted: &mut [f64],
    gram: &mut [f64],
    moments: &mut Vec<[f64; D]>,
) {
    moments.clear();
    moments.resize(count, [0.0; D]);
    gram.fill(0.0);
    for start in (0..weights.len()).step_by(TILE) {
        let rows = start..(start + TILE).min(weights.len());
        let weighted = &mut weighted[..rows.len()];
        let column = |p: usize| &column(p)[rows.clone()];
        let mut axes: [&[f64]; D] = [&[]; D];
        for d in 0..D {
            axes[d] = &targets[d][rows.clone()];
        }
        for p in 0..count {
            for ((v, l), w) in weighted
                .iter_mut()
                .zip(column(p))
                .zip(&weights[rows.clone()])
            {
                *v = l * w;
            }
            let (groups, rest) = gram[p * count..=p * count + p].as_chunks_mut::<TOGETHER>();
            let mut q = 0;
            for group in groups {
                let columns = [column(q), column(q + 1), column(q + 2), column(q + 3)];
                add(group, dots(weighted, columns));
                q += TOGETHER;
            }
            for value in rest {
                *value += dots(weighted, [column(q)])[0];
                q += 1;
            }
            add(&mut moments[p], dots(weighted, axes));
        }
    }
}

#[inline(always)]
fn add<const N: usize>(sums: &mut [f64; N], terms: [f64; N]) {
    for n in 0..N {
        sums[n] += terms[n];
    }
}

/// Dot products of `a` with each column of `b`.
#[inline(always)]
fn dots<const N: usize>(a: &[f64], b: [&[f64]; N]) -> [f64; N] {
    let a = a.as_chunks::<LANES>().0;
    let mut blocks: [&[Block]; N] = [&[]; N];
    for n in 0..N {
        blocks[n] = &b[n].as_chunks().0[..a.len()];
    }
    let mut sums = [[0.0; LANES]; N];
    for i in 0..a.len() {
        for n in 0..N {
            for l in 0..LANES {
                sums[n][l] += a[i][l] * blocks[n][i][l];
            }
        }
    }
    totals(sums)
}

/// Sums of the lanes by halves. It is not inlined: otherwise the compiler arranges the running sums
/// for these few additions rather than for the loop before.
#[inline(never)]
fn totals<const L: usize, const N: usize>(sums: [[f64; L]; N]) -> [f64; N] {
    let mut totals = [0.0; N];
    for n in 0..N {
        let mut values = sums[n];
        let mut half = L / 2;
        while half > 0 {
            for l in 0..half {
                values[l] += values[l + half];
            }
            half /= 2;
        }
        totals[n] = values[0];
    }
    totals
}

/// `u = Σ cₚ aₚ` for the columns `a`, with one coefficient per column and axis.
#[inline(always)]
pub(crate) fn combine<'a, const D: usize>(
    column: impl Fn(usize) -> &'a [f64],
    coefficients: &[[f64; D]],
    u: &mut [Vec<f64>; D],
    stride: usize,
) {
    u.iter_mut().for_each(|axis| axis.resize(stride, 0.0));
    let blocks = stride / LANES;
    let mut start = 0;
    while start + 2 <= blocks {
        combine_blocks::<2, D>(&column, coefficients, u, start);
        start += 2;
    }
    if start < blocks {
        combine_blocks::<1, D>(&column, coefficients, u, start);
    }
}

#[inline(always)]
fn combine_blocks<'a, const B: usize, const D: usize>(
    column: &impl Fn(usize) -> &'a [f64],
    coefficients: &[[f64; D]],
    u: &mut [Vec<f64>; D],
    start: usize,
) {
    let mut sums = [[[0.0; LANES]; B]; D];
    for (p, c) in coefficients.iter().enumerate() {
        let blocks: &[Block] = column(p).as_chunks().0;
        let blocks = &blocks[start..start + B];
        for d in 0..D {
            for b in 0..B {
                for l in 0..LANES {
                    sums[d][b][l] += c[d] * blocks[b][l];
                }
            }
        }
    }
    for (axis, sums) in u.iter_mut().zip(&sums) {
        axis[start * LANES..(start + B) * LANES].copy_from_slice(sums.as_flattened());
    }
}

/// Writes `A L⁻ᵀ` of the rows of one stripe into `whitened`, for the lower Cholesky factor L of
/// `count` columns: `O(count²)`. Blocks beyond the last are not written.
#[inline(always)]
pub(crate) fn whiten(
    columns: &[Block],
    blocks: usize,
    factor: &[f64],
    count: usize,
    whitened: &mut [Stripe],
    start: usize,
) {
    if start + TOGETHER <= blocks {
        whiten_blocks::<TOGETHER>(columns, blocks, factor, count, whitened, (start, 0));
        return;
    }
    for at in 0..blocks - start {
        whiten_blocks::<1>(columns, blocks, factor, count, whitened, (start, at));
    }
}

/// Whitens `B` blocks of a stripe, starting at `at`. `B` is a constant so that the compiler
/// vectorises over the blocks.
#[inline(always)]
fn whiten_blocks<const B: usize>(
    columns: &[Block],
    blocks: usize,
    factor: &[f64],
    count: usize,
    whitened: &mut [Stripe],
    (start, at): (usize, usize),
) {
    for p in 0..count {
        let row = &factor[p * count..=p * count + p];
        let place = p * blocks + start + at;
        let mut current = [[0.0; LANES]; B];
        current.copy_from_slice(&columns[place..place + B]);
        for (a, done) in row[..p].iter().zip(&*whitened) {
            let done = &done[at..at + B];
            for b in 0..B {
                for l in 0..LANES {
                    current[b][l] -= a * done[b][l];
                }
            }
        }
        let scale = 1.0 / row[p];
        let set = &mut whitened[p][at..at + B];
        for b in 0..B {
            for l in 0..LANES {
                set[b][l] = current[b][l] * scale;
            }
        }
    }
}

/// Overwrites the lower triangle with the Cholesky factor. The diagonal contains σ², so pivots stay
/// positive; a floor guards against rounding.
#[inline(always)]
pub(crate) fn cholesky(a: &mut [f64], n: usize) {
    let mut first = 0;
    while first + TOGETHER <= n {
        eliminate::<TOGETHER>(a, n, first);
        first += TOGETHER;
    }
    while first < n {
        eliminate::<1>(a, n, first);
        first += 1;
    }
}

/// Computes rows `first..first + R` of the factor from the rows above.
#[inline(always)]
fn eliminate<const R: usize>(a: &mut [f64], n: usize, first: usize) {
    let (above, below) = a.split_at_mut(first * n);
    for j in 0..first {
        let row = &above[j * n..=j * n + j];
        let mut rows: [&[f64]; R] = [&[]; R];
        for r in 0..R {
            rows[r] = &below[r * n..r * n + j];
        }
        let sums = short_dots(&row[..j], rows);
        for r in 0..R {
            below[r * n + j] = (below[r * n + j] - sums[r]) / row[j];
        }
    }
    for r in 0..R {
        let (above, current) = below.split_at_mut(r * n);
        for j in first..first + r {
            let row = &above[(j - first) * n..=(j - first) * n + j];
            let [sum] = short_dots(&row[..j], [&current[..j]]);
            current[j] = (current[j] - sum) / row[j];
        }
        let i = first + r;
        let [sum] = short_dots(&current[..i], [&current[..i]]);
        current[i] = (current[i] - sum).max(f64::MIN_POSITIVE).sqrt();
    }
}

/// Dot products of `a` with each column of `b`, with four running sums each. The remainder is
/// summed one by one.
#[inline(always)]
fn short_dots<const N: usize>(a: &[f64], b: [&[f64]; N]) -> [f64; N] {
    let whole = a.len() / 4;
    let mut rest = [0.0; N];
    for n in 0..N {
        for i in 4 * whole..a.len() {
            rest[n] += a[i] * b[n][i];
        }
    }
    let a = &a.as_chunks::<4>().0[..whole];
    let mut blocks: [&[[f64; 4]]; N] = [&[]; N];
    for n in 0..N {
        blocks[n] = &b[n].as_chunks().0[..whole];
    }
    let mut sums = [[0.0; 4]; N];
    for i in 0..whole {
        for n in 0..N {
            for l in 0..4 {
                sums[n][l] += a[i][l] * blocks[n][i][l];
            }
        }
    }
    let mut totals = totals(sums);
    for n in 0..N {
        totals[n] += rest[n];
    }
    totals
}

/// Solves `L Lᵀ x = b` in place, for the lower factor of [`cholesky`].
#[inline(always)]
pub(crate) fn solve<const D: usize>(factor: &[f64], n: usize, b: &mut [[f64; D]]) {
    for i in 0..n {
        let row = &factor[i * n..=i * n + i];
        let mut value = b[i];
        for j in 0..i {
            for d in 0..D {
                value[d] -= row[j] * b[j][d];
            }
        }
        for d in 0..D {
            b[i][d] = value[d] / row[i];
        }
    }
    for i in (0..n).rev() {
        let row = &factor[i * n..=i * n + i];
        for d in 0..D {
            b[i][d] /= row[i];
        }
        let done = b[i];
        for j in 0..i {
            for d in 0..D {
                b[j][d] -= row[j] * done[d];
            }
        }
    }
}
