//! Cholesky factorisation of a dense symmetric positive definite matrix, and its triangular solves.

/// The factor L of A = L Lᵀ, column by column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cholesky {
    m: usize,
    l: Vec<f64>,
}

impl Cholesky {
    /// Factors the m × m matrix that `fill` writes (its lower triangle is read). Fails with the column of a bad pivot.
    pub(crate) fn factor(&mut self, m: usize, fill: impl FnOnce(&mut [f64])) -> Result<(), usize> {
        self.m = m;
        self.l.clear();
        self.l.resize(m * m, 0.0);
        fill(&mut self.l);
        for k in 0..m {
            let (left, right) = self.l.split_at_mut((k + 1) * m);
            let column = &mut left[k * m..];
            let pivot = column[k];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err(k);
            }
            let root = pivot.sqrt();
            column[k..].iter_mut().for_each(|x| *x /= root);
            for (j, other) in right.chunks_exact_mut(m).enumerate() {
                let j = k + 1 + j;
                let factor = column[j];
                other[j..].iter_mut().zip(&column[j..]).for_each(|(o, c)| *o -= factor * c);
            }
        }
        Ok(())
    }

    /// b ← A⁻¹b.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        let m = self.m;
        for k in 0..m {
            let column = &self.l[k * m..(k + 1) * m];
            b[k] /= column[k];
            let x = b[k];
            b[k + 1..].iter_mut().zip(&column[k + 1..]).for_each(|(b, l)| *b -= l * x);
        }
        for k in (0..m).rev() {
            let column = &self.l[k * m..(k + 1) * m];
            let rest: f64 = column[k + 1..].iter().zip(&b[k + 1..]).map(|(l, x)| l * x).sum();
            b[k] = (b[k] - rest) / column[k];
        }
    }

    /// An estimate of the 2-norm condition number: a few steps of power and inverse iteration.
    pub(crate) fn condition(&self, scratch: &mut Vec<f64>) -> f64 {
        if self.m == 0 {
            return 1.0;
        }
        let start = |i: usize| 1.0 + 0.5 * ((i * 7919 % 101) as f64 / 101.0);
        let mut estimate = 1.0;
        for inverse in [false, true] {
            scratch.clear();
            scratch.extend((0..self.m).map(|i| if i % 2 == 0 { start(i) } else { -start(i) }));
            let mut norm = 0.0;
            for _ in 0..4 {
                if inverse {
                    self.solve(scratch)
                } else {
                    self.multiply(scratch)
                }
                norm = scratch.iter().map(|x| x * x).sum::<f64>().sqrt();
                scratch.iter_mut().for_each(|x| *x /= norm);
            }
            estimate *= norm;
        }
        f64::max(estimate, 1.0)
    }

    /// b ← A b.
    fn multiply(&self, b: &mut [f64]) {
        let m = self.m;
        for k in 0..m {
            let column = &self.l[k * m..(k + 1) * m];
            b[k] = column[k..].iter().zip(&b[k..]).map(|(l, x)| l * x).sum();
        }
        for k in (0..m).rev() {
            let column = &self.l[k * m..(k + 1) * m];
            let x = b[k];
            b[k] = column[k] * x;
            b[k + 1..].iter_mut().zip(&column[k + 1..]).for_each(|(b, l)| *b += l * x);
        }
    }
}
