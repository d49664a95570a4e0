//! E √(z + N)₊ for a standard normal N: a square-root edge blurred by a Gaussian.
//!
//! With h(z) for that mean, h″ = ½ h − z h′ (√ is homogeneous of degree ½ and Gaussian means obey the heat equation), so every
//! derivative follows from h and h′: h⁽ⁿ⁺²⁾ = (½ − n) h⁽ⁿ⁾ − z h⁽ⁿ⁺¹⁾. At zero h(0) = Γ(¾)/(2^¾ √π), h′(0) = Γ(¼)/(2^(9/4) √π).

/// Nodes every quarter from −8 to 16; below h < 1e-15, above the asymptotic series is exact to 1e-9.
const LOW: f64 = -8.0;
const HIGH: f64 = 16.0;
const STEP: f64 = 0.25;
const NODES: usize = 97;
const TERMS: usize = 9;

/// Taylor coefficients of h about every node.
#[derive(Clone, Debug)]
pub(super) struct BlurredEdge {
    table: Vec<[f64; TERMS]>,
}

impl Default for BlurredEdge {
    fn default() -> Self {
        Self::new()
    }
}

impl BlurredEdge {
    /// Steps the differential equation away from zero in both directions.
    pub(super) fn new() -> Self {
        const H0: f64 = 0.411_089_479_331_229_4;
        const D0: f64 = 0.430_019_993_662_259_85;
        let mut table = vec![[0.0; TERMS]; NODES];
        let zero = (-LOW / STEP) as usize;
        for direction in [1.0, -1.0] {
            let (mut h, mut d) = (H0, D0);
            let mut node = zero;
            loop {
                let series = taylor::<30>(LOW + STEP * node as f64, h, d);
                table[node].copy_from_slice(&series[..TERMS]);
                h = horner(&series, direction * STEP);
                d = horner_derivative(&series, direction * STEP);
                match if direction > 0.0 {
                    node.checked_add(1)
                } else {
                    node.checked_sub(1)
                } {
                    Some(next) if next < NODES => node = next,
                    _ => break,
                }
            }
        }
        Self { table }
    }

    /// [h, h′, h″, h‴, h⁗, h⁽⁵⁾] at z.
    pub(super) fn derivatives(&self, z: f64) -> [f64; 6] {
        if z >= HIGH - 0.5 * STEP {
            return far(z);
        }
        if z <= LOW {
            return [0.0; 6];
        }
        let node = ((z - LOW) / STEP).round();
        let series = &self.table[node as usize];
        let t = z - (LOW + STEP * node);
        let (h, d1) = (horner(series, t), horner_derivative(series, t));
        let d2 = 0.5 * h - z * d1;
        let d3 = -0.5 * d1 - z * d2;
        let d4 = -1.5 * d2 - z * d3;
        [h, d1, d2, d3, d4, -2.5 * d3 - z * d4]
    }
}

/// √z and what the Gaussian adds to it, Σ g⁽²ᵏ⁾(z)/(2ᵏ k!), differentiated term by term.
fn far(z: f64) -> [f64; 6] {
    let root = z.sqrt();
    let (i, i2) = (1.0 / z, 1.0 / (z * z));
    let h = root * (1.0 - i2 * (0.125 + i2 * (15.0 / 128.0 + i2 * (945.0 / 3072.0))));
    let d1 = root * i * (0.5 + i2 * (3.0 / 16.0 + i2 * (105.0 / 256.0)));
    let d2 = -root * i2 * (0.25 + i2 * (15.0 / 32.0));
    let d3 = root * i2 * i * (0.375 + i2 * (105.0 / 64.0));
    let d4 = -root * i2 * i2 * (15.0 / 16.0);
    [h, d1, d2, d3, d4, root * i2 * i2 * i * (105.0 / 32.0)]
}

/// Coefficients of the series about z: (k + 2)(k + 1) c_{k+2} = (½ − k) c_k − z (k + 1) c_{k+1}.
fn taylor<const N: usize>(z: f64, h: f64, d: f64) -> [f64; N] {
    let mut c = [0.0; N];
    (c[0], c[1]) = (h, d);
    for k in 0..N - 2 {
        let n = k as f64;
        c[k + 2] = ((0.5 - n) * c[k] - z * (n + 1.0) * c[k + 1]) / ((n + 2.0) * (n + 1.0));
    }
    c
}

fn horner(c: &[f64], t: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

fn horner_derivative(c: &[f64], t: f64) -> f64 {
    c.iter()
        .enumerate()
        .skip(1)
        .rev()
        .fold(0.0, |sum, (k, c)| sum * t + k as f64 * c)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ √(z + n)₊ φ(n) dn with u = √(z + n): 2 u² φ(u² − z), smooth, by the trapezoidal rule.
    fn by_quadrature(z: f64) -> f64 {
        let step = 1e-3;
        let phi = |n: f64| (-0.5 * n * n).exp() / (2.0 * std::f64::consts::PI).sqrt();
        (1..8000)
            .map(|k| step * f64::from(k))
            .map(|u| 2.0 * u * u * phi(u * u - z) * step)
            .sum()
    }

    #[test]
    fn agrees_with_the_integral() {
        let edge = BlurredEdge::new();
        for k in -90..400 {
            let z = 0.1 * f64::from(k) + 0.013;
            // Table: Taylor remainder 0.125⁹; series at 16: 1e-9.
            assert!(
                (edge.derivatives(z)[0] - by_quadrature(z)).abs() < 3e-9,
                "z = {z}"
            );
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let edge = BlurredEdge::new();
        for z in [-3.3, -0.4, 0.7, 2.9, 9.1, 15.6, 40.0] {
            let e = 1e-4;
            let (above, below, here) = (
                edge.derivatives(z + e),
                edge.derivatives(z - e),
                edge.derivatives(z),
            );
            for k in 0..5 {
                // Differences: e² h⁽ᵏ⁺³⁾/6; far series: its last term.
                let slope = (above[k] - below[k]) / (2.0 * e);
                assert!(
                    (slope - here[k + 1]).abs() < 2e-6,
                    "z = {z}, order {k}: {slope} {}",
                    here[k + 1]
                );
            }
        }
    }
}
