//! The spline's equations in double-double arithmetic, for point sets too ill-conditioned for plain `f64`.
//!
//! The steps are those of [`System`](crate::system::System), written plainly: Householder reflectors, applied to K from
//! both sides, then Cholesky. It costs some fifty times as much and is used where the condition number asks for it.

use crate::{
    Kernel, centres::Centres, double_double::DoubleDouble, null_space::MAX, real::Real,
    system::System,
};

/// A dense matrix, column by column.
struct Matrix {
    rows: usize,
    data: Vec<DoubleDouble>,
}

impl Matrix {
    fn column(&mut self, j: usize) -> &mut [DoubleDouble] {
        &mut self.data[j * self.rows..(j + 1) * self.rows]
    }
    fn at(&self, i: usize, j: usize) -> DoubleDouble {
        self.data[j * self.rows + i]
    }
}

/// A reflector I − τ v vᵀ with v zero before `head`.
struct Reflector {
    head: usize,
    tau: DoubleDouble,
    v: Vec<DoubleDouble>,
}

impl Reflector {
    /// The reflector that takes x to (…, β, 0, …), which it does.
    fn new(x: &mut [DoubleDouble], head: usize) -> Self {
        let norm = dot(&x[head..], &x[head..]).sqrt();
        let top = x[head];
        let beta = if top > DoubleDouble::ZERO {
            -norm
        } else {
            norm
        };
        let mut v = x.to_vec();
        v[..head].fill(DoubleDouble::ZERO);
        x[head + 1..].fill(DoubleDouble::ZERO);
        x[head] = beta;
        if norm.high == 0.0 {
            return Self {
                head,
                tau: DoubleDouble::ZERO,
                v,
            };
        }
        let scale = top - beta;
        v[head] = DoubleDouble::from_f64(1.0);
        v[head + 1..].iter_mut().for_each(|x| *x = *x / scale);
        Self {
            head,
            tau: (beta - top) / beta,
            v,
        }
    }

    fn apply(&self, x: &mut [DoubleDouble]) {
        let product = dot(&self.v[self.head..], &x[self.head..]) * self.tau;
        x[self.head..]
            .iter_mut()
            .zip(&self.v[self.head..])
            .for_each(|(x, v)| *x = *x - product * *v);
    }

    /// K ← H K H for a symmetric matrix kept in full.
    fn apply_both(&self, k: &mut Matrix) {
        let n = k.rows;
        (0..n).for_each(|j| self.apply(k.column(j)));
        for i in 0..n {
            let row = (self.head..n)
                .fold(DoubleDouble::ZERO, |sum, j| sum + k.at(i, j) * self.v[j])
                * self.tau;
            (self.head..n).for_each(|j| k.data[j * n + i] = k.data[j * n + i] - row * self.v[j]);
        }
    }
}

fn dot(a: &[DoubleDouble], b: &[DoubleDouble]) -> DoubleDouble {
    a.iter()
        .zip(b)
        .fold(DoubleDouble::ZERO, |sum, (a, b)| sum + *a * *b)
}

/// Solves as [`System::solve`]; `None` if the matrix is not definite even in double-double arithmetic.
///
/// `y` holds the values at all centres, output by output, and receives the weights.
pub(crate) fn solve<const D: usize, const M: usize, K: Kernel>(
    kernel: &K,
    centres: &Centres<D>,
    system: &System<D>,
    lambda: f64,
    y: &mut [f64],
) -> Option<[[f64; MAX]; M]> {
    let (n, count) = (system.active.len(), centres.len());
    let scale = |i: usize| DoubleDouble::from_f64(system.scales.get(i).copied().unwrap_or(1.0));
    let projected = Projected::new(kernel, centres, system, scale, lambda)?;
    let mut affine = [[0.0; MAX]; M];
    for m in 0..M {
        let values = &mut y[m * count..(m + 1) * count];
        let mut b: Vec<_> = (0..n)
            .map(|i| DoubleDouble::from_f64(values[system.active[i]]) * scale(i))
            .collect();
        affine[m] = projected.solve(&mut b);
        values.fill(0.0);
        (0..n).for_each(|i| values[system.active[i]] = (b[i] * scale(i)).high);
    }
    Some(affine)
}

/// QᵀKQ with its lower right block factored, and QᵀP.
struct Projected {
    k: Matrix,
    p: Matrix,
    reflectors: Vec<Reflector>,
}

impl Projected {
    /// `None` if the matrix is not definite.
    fn new<K: Kernel, const D: usize>(
        kernel: &K,
        centres: &Centres<D>,
        system: &System<D>,
        scale: impl Fn(usize) -> DoubleDouble,
        lambda: f64,
    ) -> Option<Self> {
        let (n, q) = (system.active.len(), system.null.q);
        let point = |i: usize| centres.precise(system.active[i]);
        let mut k = kernel_matrix(kernel, n, point, &scale, lambda);
        let mut p = Matrix {
            rows: n,
            data: Vec::with_capacity(n * q),
        };
        for c in 0..q {
            p.data
                .extend((0..n).map(|i| system.span.precise(c, &point(i)) * scale(i)));
        }
        let mut reflectors = Vec::with_capacity(q);
        for c in 0..q {
            let reflector = Reflector::new(p.column(c), c);
            (c + 1..q).for_each(|j| reflector.apply(p.column(j)));
            reflector.apply_both(&mut k);
            reflectors.push(reflector);
        }
        cholesky(&mut k, q)?;
        Some(Self { k, p, reflectors })
    }

    /// Turns scaled targets into scaled weights; returns the affine part.
    fn solve(&self, b: &mut [DoubleDouble]) -> [f64; MAX] {
        let Self { k, p, reflectors } = self;
        let (n, q) = (b.len(), reflectors.len());
        reflectors.iter().for_each(|r| r.apply(b));
        substitute(k, q, b);
        let mut head: Vec<_> = (0..q)
            .map(|i| b[i] - (q..n).fold(DoubleDouble::ZERO, |s, j| s + k.at(i, j) * b[j]))
            .collect();
        let mut affine = [0.0; MAX];
        for i in (0..q).rev() {
            let rest = (i + 1..q).fold(head[i], |rest, j| rest - p.at(i, j) * head[j]);
            head[i] = rest / p.at(i, i);
            affine[i] = head[i].high;
        }
        b[..q].fill(DoubleDouble::ZERO);
        reflectors.iter().rev().for_each(|r| r.apply(b));
        affine
    }
}

fn kernel_matrix<K: Kernel, const D: usize>(
    kernel: &K,
    n: usize,
    point: impl Fn(usize) -> [DoubleDouble; D],
    scale: impl Fn(usize) -> DoubleDouble,
    lambda: f64,
) -> Matrix {
    let mut k = Matrix {
        rows: n,
        data: vec![DoubleDouble::ZERO; n * n],
    };
    for j in 0..n {
        for i in j..n {
            let (a, b) = (point(i), point(j));
            let s = (0..D).fold(DoubleDouble::ZERO, |s, c| s + (a[c] - b[c]) * (a[c] - b[c]));
            let mut value = kernel.jet(s).value * scale(i) * scale(j);
            if i == j {
                value = value + DoubleDouble::from_f64(lambda);
            }
            (k.data[j * n + i], k.data[i * n + j]) = (value, value);
        }
    }
    k
}

/// Factors the part below and right of `q` in place, lower triangle.
fn cholesky(k: &mut Matrix, q: usize) -> Option<()> {
    let n = k.rows;
    for c in q..n {
        let (left, right) = k.data.split_at_mut((c + 1) * n);
        let column = &mut left[c * n..];
        if !(column[c].high > 0.0 && column[c].high.is_finite()) {
            return None;
        }
        let root = column[c].sqrt();
        column[c..].iter_mut().for_each(|x| *x = *x / root);
        for (j, other) in (c + 1..n).zip(right.chunks_exact_mut(n)) {
            let factor = column[j];
            other[j..]
                .iter_mut()
                .zip(&column[j..])
                .for_each(|(x, l)| *x = *x - factor * *l);
        }
    }
    Some(())
}

fn substitute(k: &Matrix, q: usize, b: &mut [DoubleDouble]) {
    let n = k.rows;
    for i in q..n {
        let rest = (q..i).fold(b[i], |rest, j| rest - k.at(i, j) * b[j]);
        b[i] = rest / k.at(i, i);
    }
    for i in (q..n).rev() {
        let rest = (i + 1..n).fold(b[i], |rest, j| rest - k.at(j, i) * b[j]);
        b[i] = rest / k.at(i, i);
    }
}
