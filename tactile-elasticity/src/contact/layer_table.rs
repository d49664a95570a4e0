//! Solutions of the layer equation, tabulated once and interpolated.

use super::interpolation::{Chebyshev, cubic};
use super::layer_equation::{DiscreteKernel, LARGEST_A_OVER_H, LayerEquation};
use super::layer_kernel::LayerKernel;

/// ln(F/F_Hertz) over ln χ for a sphere that does not yield.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LayerTable {
    rows: Vec<(f64, f64)>,
}

/// Nodes 0.18 apart in ln a: cubic interpolation leaves 2·10⁻⁵ (see the test).
const NODES: usize = 81;
const SMALLEST_A_OVER_H: f64 = 1e-5;

impl LayerTable {
    pub(crate) fn new(equation: &LayerEquation) -> Self {
        let span = (LARGEST_A_OVER_H / SMALLEST_A_OVER_H).ln();
        let at = |k: usize| SMALLEST_A_OVER_H * (span * k as f64 / (NODES - 1) as f64).exp();
        let solved = (0..NODES).filter_map(|k| equation.solve(at(k).min(LARGEST_A_OVER_H)).ok());
        Self {
            rows: solved.map(|c| (c.chi.ln(), c.force_ratio.ln())).collect(),
        }
    }

    /// ln(F/F_Hertz) at χ and its slope in ln χ; None beyond the table.
    pub(crate) fn of_chi(&self, chi: f64) -> Option<(f64, f64)> {
        let (at, rows) = (chi.ln(), &self.rows);
        if at > rows.last()?.0 {
            return None;
        }
        if at < rows[0].0 {
            // ln(1 + c χ) ≈ c χ.
            let value = rows[0].1 * (at - rows[0].0).exp();
            return Some((value, value));
        }
        let next = rows.partition_point(|r| r.0 < at).clamp(2, rows.len() - 2);
        let window = [rows[next - 2], rows[next - 1], rows[next], rows[next + 1]];
        Some(cubic(window, at))
    }
}

/// What a contact of given a/h is beside Hertz's of the same radius, with slopes in ln a.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SharedContact {
    /// ln of the force over Hertz's.
    pub(crate) force: f64,
    pub(crate) force_slope: f64,
    /// ln of the indentation over Hertz's.
    pub(crate) indentation: f64,
    pub(crate) indentation_slope: f64,
}

/// Contacts of a sphere that yields with the layers: cubic in ln(a/h), Chebyshev in the touched layer's share of 1/E*.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SharedLayerTable {
    first: f64,
    rows: Vec<Row>,
}

/// Twelve shares leave 10⁻⁷ at a/h = 3 (see the test); each costs one factorisation a row.
const SHARES: usize = 12;

/// Width of a row in ln a; the cubic's error goes as its fourth power and is 5·10⁻⁶ here.
const STEP: f64 = 0.1;

#[derive(Debug, Clone, PartialEq)]
struct Row {
    force: Chebyshev<SHARES>,
    indentation: Chebyshev<SHARES>,
}

impl SharedLayerTable {
    /// For a/h in `range`, the upper end at most [`LARGEST_A_OVER_H`]; None where a row cannot be solved.
    pub(crate) fn new(kernel: &LayerKernel, range: (f64, f64)) -> Option<Self> {
        let (first, last) = (range.0.ln(), range.1.min(LARGEST_A_OVER_H).ln());
        let count = ((last - first) / STEP).ceil().max(3.0) as usize + 1;
        let at = |k: usize| (first + STEP * k as f64).exp().min(LARGEST_A_OVER_H);
        let rows: Option<Vec<_>> = (0..count).map(|k| Row::solve(kernel, at(k))).collect();
        Some(Self { first, rows: rows? })
    }

    /// At a/h and a share in [0, 1]; None beyond the table.
    pub(crate) fn at(&self, a_over_h: f64, share: f64) -> Option<SharedContact> {
        let (rows, at) = (&self.rows, a_over_h.ln());
        let place = (at - self.first) / STEP;
        if place > (rows.len() - 1) as f64 {
            return None;
        }
        if place < 0.0 {
            // A contact that is small beside the layer: ln(1 + c a) ≈ c a.
            let shrink = (at - self.first).exp();
            let (force, indentation) = rows[0].at(share);
            return Some(SharedContact {
                force: force * shrink,
                force_slope: force * shrink,
                indentation: indentation * shrink,
                indentation_slope: indentation * shrink,
            });
        }
        let start = (place as usize).saturating_sub(1).min(rows.len() - 4);
        let window: [(f64, (f64, f64)); 4] = std::array::from_fn(|i| {
            let k = start + i;
            (self.first + STEP * k as f64, rows[k].at(share))
        });
        let (force, force_slope) = cubic(window.map(|(x, v)| (x, v.0)), at);
        let (indentation, indentation_slope) = cubic(window.map(|(x, v)| (x, v.1)), at);
        Some(SharedContact {
            force,
            force_slope,
            indentation,
            indentation_slope,
        })
    }
}

impl Row {
    fn solve(kernel: &LayerKernel, a_over_h: f64) -> Option<Self> {
        let kernel = DiscreteKernel::new(kernel, a_over_h).ok()?;
        let (mut force, mut indentation) = ([0.0; SHARES], [0.0; SHARES]);
        for (j, share) in Chebyshev::<SHARES>::nodes().into_iter().enumerate() {
            let contact = kernel.contact(share).ok()?;
            force[j] = contact.force_ratio_same_radius.ln();
            indentation[j] = contact.indentation_ratio.ln();
        }
        let finite = force.iter().chain(&indentation).all(|x| x.is_finite());
        finite.then(|| Self {
            force: Chebyshev::through(&force),
            indentation: Chebyshev::through(&indentation),
        })
    }

    fn at(&self, share: f64) -> (f64, f64) {
        (self.force.value(share), self.indentation.value(share))
    }
}

#[cfg(test)]
mod tests {
    use super::super::layer_kernel::Bond;
    use super::*;
    use crate::contact::{Layer, Waveguide};

    #[test]
    fn the_table_agrees_with_the_equation_between_its_nodes() {
        let equation = LayerEquation::new(Bond::Bonded, 0.5).unwrap();
        let table = LayerTable::new(&equation);
        for a in [3e-6, 0.0123, 0.3, 0.77, 2.3, 11.0] {
            let exact = equation.solve(a).unwrap();
            let (value, _) = table.of_chi(exact.chi).unwrap();
            // Cubic interpolation with nodes 0.18 apart in ln a.
            let gap = value - exact.force_ratio.ln();
            assert!(gap.abs() < 2e-5, "{a}: {gap:e}");
        }
        assert!(table.of_chi(1e3).is_none());
    }

    #[test]
    fn the_slope_is_the_derivative() {
        let table = LayerTable::new(&LayerEquation::new(Bond::Bonded, 0.4).unwrap());
        let (high, low) = (
            table.of_chi(0.5 * 1.001).unwrap().0,
            table.of_chi(0.5 / 1.001).unwrap().0,
        );
        let slope = (high - low) / (2.0 * 1.001f64.ln());
        assert!((table.of_chi(0.5).unwrap().1 - slope).abs() < 1e-5);
    }

    #[test]
    fn shares_and_radii_between_the_nodes() {
        let layer = |thickness_m, youngs_modulus_pa| Layer {
            thickness_m,
            youngs_modulus_pa,
            poisson_ratio: 0.495,
        };
        let layers = vec![layer(2e-3, 1.36e5), layer(3e-3, 8e4), layer(5e-3, 3.4e4)];
        let guide = Waveguide::new(layers).unwrap();
        let stack = LayerEquation::of_layers(&guide, Bond::Bonded).unwrap();
        let single = LayerEquation::new(Bond::Bonded, 0.5).unwrap();
        for equation in [stack, single] {
            let table = SharedLayerTable::new(equation.kernel(), (0.01, 3.0)).unwrap();
            for (a, share) in [
                (0.004, 0.5),
                (0.05, 0.03),
                (0.33, 0.51),
                (1.1, 0.98),
                (2.6, 0.7),
            ] {
                let exact = equation.clone().with_share(share);
                let exact = exact.solve(a).unwrap();
                let found = table.at(a, share).unwrap();
                // Below the table the correction is taken as linear in a: its square is left out.
                let tolerance = if a < 0.01 { 3e-5 } else { 1e-5 };
                let force_gap = found.force - exact.force_ratio_same_radius.ln();
                let indentation_gap = found.indentation - exact.indentation_ratio.ln();
                let gap = force_gap.abs().max(indentation_gap.abs());
                assert!(gap < tolerance, "{a} {share}: {gap:e}");
            }
            assert!(table.at(4.0, 0.5).is_none());
        }
    }
}
