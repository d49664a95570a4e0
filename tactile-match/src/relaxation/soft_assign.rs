//! Soft assignment: the match matrix M from distances, made doubly stochastic with slack (Sinkhorn).
//!
//! `m_ij = aᵢ bⱼ exp(−|yᵢ − tⱼ|²/2σ²)` with `aᵢ`, `bⱼ` such that every row and every column sums to one together with its
//! slack, whose weight is the density of stray points seen through the same Gaussian. Worked in single precision: the
//! weights need no more, and the positions they lead to are refined in double precision.

use pulp::Arch;

/// Columns are padded to a multiple of this, so that rows are whole vectors.
pub(crate) const LANES: usize = 16;

/// Where the padding lies: no Gaussian reaches it, and its square is finite.
const FAR: f32 = 1e15;

/// The match matrix in factored form, with the moments of its rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct SoftAssignment<const D: usize> {
    axes: Vec<f32>,
    targets: usize,
    width: usize,
    pub(crate) kernel: Vec<f32>,
    pub(crate) row_scale: Vec<f32>,
    pub(crate) column_scale: Vec<f32>,
    column_sum: Vec<f32>,
    /// Row sums without the slack.
    pub(crate) weight: Vec<f64>,
    /// Mean of `tⱼ − yᵢ` under row i.
    pub(crate) shift: Vec<[f64; D]>,
    /// Sum of `m_ij |tⱼ − yᵢ|²` over row i.
    pub(crate) spread: Vec<f64>,
}

impl<const D: usize> SoftAssignment<D> {
    /// Takes the target points, one array an axis.
    pub(crate) fn set_targets(&mut self, targets: &[[f64; D]]) {
        self.targets = targets.len();
        self.width = targets.len().next_multiple_of(LANES);
        self.axes.clear();
        for k in 0..D {
            self.axes.extend(targets.iter().map(|t| t[k] as f32));
            self.axes.resize((k + 1) * self.width, FAR);
        }
    }

    /// Number of target points.
    pub(crate) fn targets(&self) -> usize {
        self.targets
    }

    /// The Gaussian affinities of `warped` at variance `variance`.
    pub(crate) fn affinities(&mut self, warped: &[[f64; D]], variance: f64) {
        let width = self.width;
        self.kernel.resize(warped.len() * width, 0.0);
        let scale = (-0.5 / variance) as f32;
        Arch::new().dispatch(|| {
            for (row, y) in self.kernel.chunks_exact_mut(width).zip(warped) {
                gaussian_row(row, &self.axes, width, &y.map(|v| v as f32), scale);
            }
        });
    }

    /// Alternates row and column normalisation `sweeps` times.
    pub(crate) fn normalise(&mut self, sweeps: usize, row_slack: f32, column_slack: f32) {
        let (width, rows) = (self.width, self.kernel.len() / self.width);
        self.row_scale.clear();
        self.row_scale.resize(rows, 1.0);
        self.column_scale.clear();
        self.column_scale.resize(width, 1.0);
        self.column_sum.resize(width, 0.0);
        Arch::new().dispatch(|| {
            for _ in 0..sweeps {
                self.column_sum.fill(column_slack);
                for (row, a) in self.kernel.chunks_exact(width).zip(&mut self.row_scale) {
                    *a = 1.0 / (dot(row, &self.column_scale) + row_slack);
                    let a = *a;
                    for (s, k) in self.column_sum.iter_mut().zip(row) {
                        *s += a * k;
                    }
                }
                for (b, s) in self.column_scale.iter_mut().zip(&self.column_sum) {
                    *b = 1.0 / s;
                }
            }
        });
    }

    /// Row sums, mean shifts and spreads of M about `warped`.
    pub(crate) fn moments(&mut self, warped: &[[f64; D]]) {
        let width = self.width;
        self.weight.clear();
        self.shift.clear();
        self.spread.clear();
        Arch::new().dispatch(|| {
            for ((row, y), &a) in self.kernel.chunks_exact(width).zip(warped).zip(&self.row_scale) {
                let m = row_moments(row, &self.column_scale, &self.axes, width, &y.map(|v| v as f32));
                let weight = f64::from(m.0);
                self.weight.push(weight * f64::from(a));
                self.shift.push(m.1.map(|s| if weight > 0.0 { f64::from(s) / weight } else { 0.0 }));
                self.spread.push(f64::from(m.2) * f64::from(a));
            }
        });
    }

    /// Makes rows that the last column normalisation left above one sum to one: where points coincide, a few sweeps do not
    /// converge.
    pub(crate) fn cap_rows(&mut self) {
        for (weight, scale) in self.weight.iter_mut().zip(&mut self.row_scale) {
            let excess = weight.max(1.0);
            *scale /= excess as f32;
            *weight /= excess;
        }
    }

    /// `m_ij` of the last normalisation.
    pub(crate) fn entry(&self, i: usize, j: usize) -> f64 {
        f64::from(self.row_scale[i] * self.kernel[i * self.width + j] * self.column_scale[j])
    }

    /// The affinities of row i.
    pub(crate) fn affinity_row(&self, i: usize) -> &[f32] {
        &self.kernel[i * self.width..i * self.width + self.targets]
    }
}

#[inline(always)]
fn gaussian_row<const D: usize>(row: &mut [f32], axes: &[f32], width: usize, y: &[f32; D], scale: f32) {
    row.fill(0.0);
    for (k, &c) in y.iter().enumerate() {
        let axis = &axes[k * width..(k + 1) * width];
        for (v, t) in row.iter_mut().zip(axis) {
            *v += (t - c) * (t - c);
        }
    }
    for v in row {
        *v = exp(*v * scale);
    }
}

/// eˣ for x ≤ 0 to two units of single precision; 0 below −87.
#[inline(always)]
fn exp(x: f32) -> f32 {
    const MAGIC: f32 = 12_582_912.0; // 1.5 · 2²³: adding it rounds to the nearest integer
    let x = x.max(-88.0);
    let n = (x * std::f32::consts::LOG2_E + MAGIC) - MAGIC;
    let f = (x - n * 0.693_359_4) - n * -2.121_944_4e-4;
    let p = 1.0
        + f * (1.0
            + f * (0.5 + f * (0.166_666_57 + f * (0.041_665_795 + f * (8.334_52e-3 + f * 1.388_89e-3)))));
    let power = f32::from_bits((((n + MAGIC).to_bits() << 23) as i32).wrapping_add(0x3f80_0000) as u32);
    if x > -87.0 { p * power } else { 0.0 }
}

#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for (x, y) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for l in 0..LANES {
            sums[l] += x[l] * y[l];
        }
    }
    sums.iter().sum()
}

#[inline(always)]
fn row_moments<const D: usize>(
    row: &[f32],
    columns: &[f32],
    axes: &[f32],
    width: usize,
    y: &[f32; D],
) -> (f32, [f32; D], f32) {
    let mut weight = [0.0_f32; LANES];
    let mut shift = [[0.0_f32; LANES]; D];
    let mut spread = [0.0_f32; LANES];
    for start in (0..width).step_by(LANES) {
        let (k, b) = (&row[start..start + LANES], &columns[start..start + LANES]);
        let mut m = [0.0_f32; LANES];
        for l in 0..LANES {
            m[l] = k[l] * b[l];
            weight[l] += m[l];
        }
        for (d, &c) in y.iter().enumerate() {
            let t = &axes[d * width + start..d * width + start + LANES];
            for l in 0..LANES {
                let e = t[l] - c;
                shift[d][l] += m[l] * e;
                spread[l] += m[l] * e * e;
            }
        }
    }
    (weight.iter().sum(), shift.map(|s| s.iter().sum()), spread.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_is_single_precision() {
        for i in 0..2000 {
            let x = -0.043 * i as f32;
            let (found, expected) = (f64::from(exp(x)), f64::from(x).exp());
            // Two units of single precision; below the normal range zero is right.
            assert!((found - expected).abs() <= 2.4e-7 * expected + 1e-37, "{x}: {found} {expected}");
        }
        assert_eq!(exp(f32::MIN), 0.0);
    }

    #[test]
    fn rows_and_columns_sum_to_one_with_their_slack() {
        let targets: Vec<[f64; 2]> = (0..21).map(|i| [f64::from(i) * 0.1, f64::from(i % 4) * 0.2]).collect();
        let warped: Vec<[f64; 2]> = targets.iter().take(17).map(|t| [t[0] + 0.02, t[1] - 0.01]).collect();
        let mut soft = SoftAssignment::default();
        soft.set_targets(&targets);
        soft.affinities(&warped, 0.02);
        soft.normalise(300, 0.05, 0.05);
        soft.moments(&warped);
        for i in 0..17 {
            let slack = f64::from(soft.row_scale[i]) * 0.05;
            let sum: f64 = (0..21).map(|j| soft.entry(i, j)).sum();
            // Single precision sums of 21 terms, at the fixed point of the sweeps.
            assert!((sum + slack - 1.0).abs() < 1e-5 && (sum - soft.weight[i]).abs() < 1e-5);
        }
        for j in 0..21 {
            let sum: f64 = (0..17).map(|i| soft.entry(i, j)).sum();
            assert!((sum + f64::from(soft.column_scale[j]) * 0.05 - 1.0).abs() < 1e-5);
        }
    }
}
