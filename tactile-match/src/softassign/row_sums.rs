//! The moments of the rows of a match matrix in factored form.

use super::blocks::LANES;
use super::lanes::{Moments, sum};
use super::moments::RowMoments;
use super::soft_assign::{SoftAssignment, row_of, single};
use crate::simd::vectorised;

impl<const D: usize> SoftAssignment<D> {
    /// Sets the moments of M about `warped`.
    pub(crate) fn sum_moments(&mut self, warped: &[[f64; D]]) {
        let mut moments = std::mem::take(&mut self.moments);
        moments.differ = self.errors.differ();
        self.sum(warped, &self.column_scale, &mut moments.powers[0]);
        if moments.differ {
            moments.factors.clone_from(&self.column_scale);
            for power in 1..=2 {
                let factors = moments.factors.iter_mut().zip(&self.errors.precision);
                factors.for_each(|(factor, precision)| *factor *= precision);
                self.sum(warped, &moments.factors, &mut moments.powers[power]);
            }
        }
        self.moments = moments;
    }

    /// The moments with these factors of the columns.
    fn sum(&self, warped: &[[f64; D]], factors: &[f32], moments: &mut RowMoments<D>) {
        let RowMoments {
            weight,
            shift,
            spread,
        } = moments;
        weight.clear();
        shift.clear();
        spread.clear();
        let columns = factors.as_chunks::<LANES>().0;
        vectorised(
            #[inline(always)]
            || {
                for ((i, y), &a) in warped.iter().enumerate().zip(&self.row_scale) {
                    let y = single(y);
                    let mut sums = Moments::new();
                    for (block, k) in row_of(&self.starts, &self.active, &self.kernel, i) {
                        sums.add(k, &columns[block], self.blocks.at(block as u32), &y);
                    }
                    let total = f64::from(sum(sums.weight));
                    let mut mean = [0.0; D];
                    for d in 0..D {
                        if total > 0.0 {
                            mean[d] = f64::from(sum(sums.shift[d])) / total;
                        }
                    }
                    weight.push(total * f64::from(a));
                    shift.push(mean);
                    spread.push(f64::from(sum(sums.spread)) * f64::from(a));
                }
            },
        );
    }

    /// Makes rows that the last column normalisation left above one sum to one: where points coincide, a few sweeps do not
    /// converge.
    pub(crate) fn cap_rows(&mut self) {
        let [plain, weighed @ ..] = &mut self.moments.powers;
        for (i, scale) in self.row_scale.iter_mut().enumerate() {
            let excess = plain.weight[i].max(1.0);
            *scale /= excess as f32;
            plain.weight[i] /= excess;
            for power in weighed.iter_mut().filter(|_| self.moments.differ) {
                power.weight[i] /= excess;
            }
        }
    }
}
