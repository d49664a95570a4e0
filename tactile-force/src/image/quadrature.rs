//! Gauss–Legendre quadrature.

/// Nodes and weights on [−1, 1].
#[derive(Clone, Debug)]
pub(super) struct Gauss<const N: usize> {
    nodes: [(f64, f64); N],
}

impl<const N: usize> Gauss<N> {
    /// By Newton's method on the Legendre polynomial.
    pub(super) fn new() -> Self {
        let nodes = std::array::from_fn(|k| {
            let mut x = (std::f64::consts::PI * (k as f64 + 0.75) / (N as f64 + 0.5)).cos();
            for _ in 0..10 {
                let (p, slope) = legendre(N, x);
                x -= p / slope;
            }
            let slope = legendre(N, x).1;
            (x, 2.0 / ((1.0 - x) * (1.0 + x) * slope * slope))
        });
        Self { nodes }
    }

    /// ∫ f over [from, to]; f gives several integrands at once.
    pub(super) fn integrate<const M: usize>(
        &self,
        from: f64,
        to: f64,
        mut f: impl FnMut(f64) -> [f64; M],
    ) -> [f64; M] {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let mut total = [0.0; M];
        for (x, w) in &self.nodes {
            let values = f(middle + half * x);
            total
                .iter_mut()
                .zip(values)
                .for_each(|(t, v)| *t += half * w * v);
        }
        total
    }
}

/// Legendre polynomial and its derivative.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut now) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (before, now) = (now, ((2.0 * k - 1.0) * x * now - (k - 1.0) * before) / k);
    }
    let slope = n as f64 * (before - x * now) / ((1.0 - x) * (1.0 + x));
    (now, slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_exact_for_polynomials_of_degree_2n_minus_1() {
        let gauss = Gauss::<8>::new();
        for degree in 0..16 {
            let [value] = gauss.integrate(0.0, 2.0, |x| [x.powi(degree)]);
            let exact = 2.0_f64.powi(degree + 1) / f64::from(degree + 1);
            assert!((value / exact - 1.0).abs() < 1e-14, "degree {degree}");
        }
    }
}
