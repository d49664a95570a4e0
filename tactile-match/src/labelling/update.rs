//! (20): one step of relaxation, and the normalisation after it.

use super::MatchMatrix;

/// How far [`sinkhorn`] came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SinkhornReport {
    /// Sweeps done.
    pub sweeps: usize,
    /// `max_i |1 − Σ_j M_ij|`: how far the rows are from one, the columns being one.
    pub row_defect: f64,
}

/// (20): every model row becomes `[M_ij S_ij, M_i,slack · slack_gain]` over its sum; returns the rows whose sum was zero,
/// which stay as they were. `support` is row-major `I × J`; the slack row is not touched.
///
/// Each product is taken relative to the largest of its row, so that none under- or overflows on the way.
///
/// # Panics
/// If `support` has not `I · J` entries.
pub(crate) fn update(m: &mut MatchMatrix, support: &[f64], slack_gain: f64) -> Vec<usize> {
    let columns = m.columns();
    assert_eq!(support.len(), m.rows() * columns, "size of the support");
    let mut zero_rows = Vec::new();
    for i in 0..m.rows() {
        let gains = support[i * columns..][..columns]
            .iter()
            .copied()
            .chain([slack_gain]);
        let largest = m
            .row(i)
            .iter()
            .copied()
            .zip(gains.clone())
            .fold(None, |best, (p, s)| match best {
                _ if p <= 0.0 || s <= 0.0 => best,
                Some((_, _, log)) if p.ln() + s.ln() <= log => best,
                _ => Some((p, s, p.ln() + s.ln())),
            });
        let Some((largest_p, largest_s, largest_log)) = largest else {
            zero_rows.push(i);
            continue;
        };
        let row = m.row_mut(i);
        for (p, s) in row.iter_mut().zip(gains) {
            let product = (*p / largest_p) * (s / largest_s);
            *p = if *p <= 0.0 || s <= 0.0 {
                0.0
            } else if product.is_finite() {
                product
            } else {
                (p.ln() + s.ln() - largest_log).exp() // one quotient overflowed
            };
        }
        divide_by_sum(row);
    }
    zero_rows
}

/// Alternate normalisation with slack. Each sweep divides the rows `0..I` by their sums over `J + 1` entries, then
/// the columns `0..J` by their sums over `I + 1` entries; the slack row and column are not normalised, sums of zero are
/// skipped. Stops after `sweeps`, or when no row is further than `tolerance` from one.
pub(crate) fn sinkhorn(m: &mut MatchMatrix, sweeps: usize, tolerance: f64) -> SinkhornReport {
    let mut report = SinkhornReport {
        sweeps: 0,
        row_defect: row_defect(m),
    };
    while report.sweeps < sweeps {
        for i in 0..m.rows() {
            divide_by_sum(m.row_mut(i));
        }
        for j in 0..m.columns() {
            let sum = (0..=m.rows()).fold(0.0, |sum, i| sum + m[(i, j)]);
            if sum > 0.0 {
                (0..=m.rows()).for_each(|i| m[(i, j)] /= sum);
            }
        }
        report = SinkhornReport {
            sweeps: report.sweeps + 1,
            row_defect: row_defect(m),
        };
        if report.row_defect <= tolerance {
            break;
        }
    }
    report
}

/// One sweep of relaxation: [`update`], then [`sinkhorn`] with at most `sinkhorn_sweeps` sweeps and no tolerance.
///
/// # Panics
/// If `support` has not `I · J` entries.
#[cfg(test)]
pub(crate) fn sweep(m: &mut MatchMatrix, support: &[f64], slack_gain: f64, sinkhorn_sweeps: usize) {
    update(m, support, slack_gain);
    sinkhorn(m, sinkhorn_sweeps, 0.0);
}

fn divide_by_sum(row: &mut [f64]) {
    let sum = row.iter().fold(0.0, |sum, &p| sum + p);
    if sum > 0.0 {
        row.iter_mut().for_each(|p| *p /= sum);
    }
}

fn row_defect(m: &MatchMatrix) -> f64 {
    (0..m.rows()).fold(0.0, |worst, i| {
        let sum = m.row(i).iter().fold(0.0, |sum, &p| sum + p);
        worst.max((1.0 - sum).abs())
    })
}
