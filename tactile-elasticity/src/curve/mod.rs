//! Force–indentation curves: contact point, modulus, and which law fits.
//!
//! A curve is F_i at positions z_i of a rigid indenter. With contact at z₀,
//!
//! F(z) = F₀ + E* f(z − z₀) beyond z₀, F₀ before,
//!
//! which is linear in (F₀, E*) at a given z₀: the squared residuals, minimised over these, are a function of z₀
//! alone, scanned and then refined. Intervals are those of the profile likelihood; residuals that follow one another (the sign of a wrong law)
//! widen them.

mod fit;
mod indenter;
mod profile;
mod select;

pub use fit::{Baseline, ContactPoint, CurveFit, CurveOptions, fit_curve};
pub use indenter::{Indenter, Model};
pub use select::{CurveSelection, SelectionReason, select_model};

use crate::error::{ElasticityError, Quantity};

/// Forces over positions, widened to f64.
///
/// ```
/// use tactile_elasticity::curve::IndentationCurve;
///
/// // In any order: a curve is sorted by position.
/// let curve = IndentationCurve::new(&[3e-6, 1e-6, 2e-6, 0.0, 5e-6, 4e-6], &[3e-4, 1e-4, 2e-4, 0.0, 5e-4, 4e-4])?;
/// assert_eq!((curve.position_m()[1], curve.force_n()[1]), (1e-6, 1e-4));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct IndentationCurve {
    position_m: Vec<f64>,
    force_n: Vec<f64>,
}

/// Points below which contact point, baseline, modulus and their scatter cannot be told apart.
const FEWEST_POINTS: usize = 6;

impl IndentationCurve {
    /// From positions (m, growing into the sample; in any order) and forces (N, pressing positive).
    ///
    /// # Errors
    /// [`ElasticityError::LengthMismatch`], [`ElasticityError::TooFewLoads`] below six points,
    /// [`ElasticityError::NotFinite`], and [`ElasticityError::EqualLoads`] where all forces or all positions are equal.
    pub fn new(position_m: &[f64], force_n: &[f64]) -> Result<Self, ElasticityError> {
        let (expected, found) = (position_m.len(), force_n.len());
        if expected != found {
            return Err(ElasticityError::LengthMismatch {
                quantity: Quantity::Force,
                expected,
                found,
            });
        }
        if found < FEWEST_POINTS {
            return Err(ElasticityError::TooFewLoads {
                expected: FEWEST_POINTS,
                found,
            });
        }
        let [position_m, force_n] =
            [position_m, force_n].map(|v| v.iter().map(|&x| x).collect::<Vec<_>>());
        for (values, quantity) in [
            (&position_m, Quantity::Indentation),
            (&force_n, Quantity::Force),
        ] {
            if !values.iter().all(|x| x.is_finite()) {
                return Err(ElasticityError::NotFinite { quantity });
            }
            if values.iter().all(|x| *x == values[0]) {
                return Err(ElasticityError::EqualLoads);
            }
        }
        let mut order: Vec<usize> = (0..found).collect();
        order.sort_by(|&i, &j| position_m[i].total_cmp(&position_m[j]));
        let sorted = |v: Vec<f64>| order.iter().map(|&i| v[i]).collect();
        Ok(Self {
            position_m: sorted(position_m),
            force_n: sorted(force_n),
        })
    }

    /// Positions, ascending.
    pub fn position_m(&self) -> &[f64] {
        &self.position_m
    }

    /// Forces, in the order of the positions.
    pub fn force_n(&self) -> &[f64] {
        &self.force_n
    }

    /// First and last position.
    pub(crate) fn span(&self) -> (f64, f64) {
        (
            self.position_m[0],
            self.position_m[self.position_m.len() - 1],
        )
    }
}
