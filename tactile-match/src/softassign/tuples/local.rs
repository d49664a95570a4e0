//! Affine maps about a pair of points: what determines one, and which are plausible.

use nalgebra::{SMatrix, SVector};

/// Stretches of a local map outside this range are not considered.
const STRETCH: [f64; 2] = [0.4, 2.5];

/// An affine map about a pair of points.
#[derive(Clone, Copy)]
pub(super) struct Local<const D: usize> {
    pub(super) linear: SMatrix<f64, D, D>,
    pub(super) from: SVector<f64, D>,
    pub(super) to: SVector<f64, D>,
}

impl<const D: usize> Local<D> {
    /// The image of a point.
    pub(super) fn apply(&self, p: &[f64; D]) -> [f64; D] {
        (self.linear * (SVector::from(*p) - self.from) + self.to).into()
    }
}

/// The D offsets of a point's nearest neighbours that span the most, for their size, and the inverse of their matrix.
pub(super) fn best_basis<const D: usize>(
    offsets: &[SVector<f64, D>],
) -> Option<([usize; D], SMatrix<f64, D, D>)> {
    let count = offsets.len().min(2 * D + 2);
    let mut best = (0.0, None);
    for code in 0..count.pow(D as u32) {
        let mut rest = code;
        let mut chosen = [0; D];
        for slot in &mut chosen {
            *slot = rest % count;
            rest /= count;
        }
        // One order of every choice.
        if chosen.windows(2).any(|pair| pair[0] >= pair[1]) {
            continue;
        }
        let mut columns = SMatrix::<f64, D, D>::zeros();
        let mut size = 1.0;
        for (axis, &at) in chosen.iter().enumerate() {
            columns.set_column(axis, &offsets[at]);
            size *= offsets[at].norm();
        }
        let Some(inverse) = columns.try_inverse() else {
            continue;
        };
        // Near neighbours are more surely in sight together: the spanned volume counts relative to the lengths.
        let volume = volume(&columns).abs() / size;
        if volume > best.0 {
            best = (volume, Some((chosen, inverse)));
        }
    }
    best.1
}

fn volume<const D: usize>(m: &SMatrix<f64, D, D>) -> f64 {
    match D {
        2 => m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(1, 0)],
        3 => {
            m[(0, 0)] * (m[(1, 1)] * m[(2, 2)] - m[(1, 2)] * m[(2, 1)])
                - m[(0, 1)] * (m[(1, 0)] * m[(2, 2)] - m[(1, 2)] * m[(2, 0)])
                + m[(0, 2)] * (m[(1, 0)] * m[(2, 1)] - m[(1, 1)] * m[(2, 0)])
        }
        _ => 1.0,
    }
}

/// Whether a local map is one that a body could follow: no reflection, no stretch out of range, no great turn where turns are limited.
pub(super) fn plausible<const D: usize>(linear: &SMatrix<f64, D, D>, limited: bool) -> bool {
    let [low, high] = STRETCH;
    for k in 0..D {
        if limited && linear[(k, k)] < 0.5 * linear.column(k).norm() {
            return false;
        }
        for v in [linear.column(k).norm(), linear.row(k).norm()] {
            if !(low..=high).contains(&v) {
                return false;
            }
        }
    }
    volume(linear) > low.powi(D as i32 - 1)
}
