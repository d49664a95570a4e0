//! Gauss–Legendre nodes.

/// Nodes and weights on [0, 1], by Newton's method on P_n from the cosine guess.
pub(crate) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (p, previous) = legendre(n, x);
                slope = n as f64 * (x * p - previous) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// P_n(x) and P_{n−1}(x).
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut p, mut previous) = (1.0, 0.0);
    for k in 0..n {
        let k = k as f64;
        (p, previous) = (((2.0 * k + 1.0) * x * p - k * previous) / (k + 1.0), p);
    }
    (p, previous)
}

/// Edges from 0 to `end`: panels of width `first` at the origin, growing by half of what lies before, none above `widest`.
pub(crate) fn panel_edges(end: f64, first: f64, widest: f64) -> Vec<f64> {
    let mut edges = vec![0.0];
    let mut last = 0.0;
    while last < end {
        last += (0.5 * last).max(first).min(widest);
        edges.push(last);
    }
    edges
}

/// Nodes and weights between the edges, 16 points a panel.
pub(crate) fn gauss_panels(edges: &[f64]) -> Vec<(f64, f64)> {
    let unit = gauss_legendre(16);
    edges
        .windows(2)
        .flat_map(|edge| {
            let (start, width) = (edge[0], edge[1] - edge[0]);
            unit.iter()
                .map(move |&(x, w)| (start + x * width, w * width))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_for_polynomials_of_degree_2n_minus_1() {
        let rule = gauss_legendre(5);
        for degree in 0..10 {
            let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(degree)).sum();
            // Five terms of order one: a few roundings.
            assert!(
                (sum - 1.0 / f64::from(degree + 1)).abs() < 1e-15,
                "{degree}"
            );
        }
    }
}
