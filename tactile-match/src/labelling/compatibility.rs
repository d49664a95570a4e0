//! (15)–(18): how alike two edges are.

use super::Edge;
use nalgebra::SVector;

/// What the maximum in α (15) is taken over.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::labelling::LengthMaximum;
/// use tactile_match::{PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..12).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
/// for maximum in [LengthMaximum::PerPair, LengthMaximum::Global] {
///     let options = RelaxationLabelling::default().with_length_maximum(maximum);
///     let found = options.match_points(&model, &target)?;
///     assert!((0..12).all(|i| found.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LengthMaximum {
    /// The two edges compared, `max(d, e)`.
    #[default]
    PerPair,
    /// All edges of both graphs.
    Global,
}

/// Which factors the compatibility r (18) of two edges has.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::labelling::Compatibility;
/// use tactile_match::{PointMatcher, RelaxationLabelling};
/// let model: Vec<_> = (0..12).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.2 * (3.0 * k).sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().map(|p| Point2::new(p.x + 0.1 * p.y, p.y)).collect();
/// for compatibility in [Compatibility::LengthDirection, Compatibility::Printed, Compatibility::Full] {
///     let options = RelaxationLabelling::default().with_compatibility(compatibility);
///     let found = options.match_points(&model, &target)?;
///     assert!((0..12).all(|i| found.assignment[i] == Some(i)));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compatibility {
    /// One: the support counts neighbours (the method the paper's extends).
    Count,
    /// α: like lengths.
    Length,
    /// αβ: like lengths and directions.
    LengthDirection,
    /// αβγ with the γ of the model's edge alone, as (18) is printed.
    Printed,
    /// αβγγ′ with the γ of both edges: neither graph is preferred.
    #[default]
    Full,
}

/// α (15), the maximum per pair: `1 − |d − e| / max(d, e) = min(d, e) / max(d, e)`; two lengths of zero are alike.
///
/// The quotient keeps its digits where the lengths differ by many decades; the printed difference loses them.
#[must_use]
pub(crate) fn alpha(d: f64, e: f64) -> f64 {
    let longer = d.max(e);
    if longer > 0.0 { d.min(e) / longer } else { 1.0 }
}

/// α (15), the maximum over all edges: `1 − |d − e| / longest`; one where `longest` is zero.
#[must_use]
pub(crate) fn alpha_global(d: f64, e: f64, longest: f64) -> f64 {
    if longest > 0.0 {
        1.0 - (d - e).abs() / longest
    } else {
        1.0
    }
}

/// β (16): `1 − ∠(u, v) / π`, one for parallel and zero for opposite edges, in any dimension; zero if an edge has
/// no length.
///
/// The angle is `atan2(|u ∧ v|, u · v)`, exact at 0 and π where `acos` loses half the digits or returns NaN.
#[must_use]
pub(crate) fn beta<const D: usize>(u: &SVector<f64, D>, v: &SVector<f64, D>) -> f64 {
    // Largest components scaled to one: no square under- or overflows, and parallel vectors stay exactly parallel.
    let (largest_u, largest_v) = (u.amax(), v.amax());
    if largest_u <= 0.0 || largest_v <= 0.0 {
        return 0.0;
    }
    let (u, v) = (u / largest_u, v / largest_v);
    let mut wedge = 0.0;
    for p in 0..D {
        for q in p + 1..D {
            let minor = u[p] * v[q] - u[q] * v[p];
            wedge += minor * minor;
        }
    }
    // π − ∠(u, v) = ∠(u, −v): near opposite edges keep the digits of a small β.
    wedge.sqrt().atan2(-u.dot(&v)) / std::f64::consts::PI
}

/// γ (17): `1 − d / longest`, `longest` among the edges of the same point; one where `longest` is zero.
#[must_use]
pub(crate) fn gamma(d: f64, longest: f64) -> f64 {
    if longest > 0.0 {
        (longest - d) / longest
    } else {
        1.0
    }
}

/// A [`Compatibility`] ready to be evaluated: the factors and the maximum in α.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CompatibilityRule {
    /// The factors.
    pub factors: Compatibility,
    /// Longest edge of both graphs for [`alpha_global`]; `None` for [`alpha`].
    pub longest: Option<f64>,
}

impl CompatibilityRule {
    /// r (18) of model edge `x` and target edge `y`.
    #[must_use]
    pub(crate) fn of<const D: usize>(&self, x: &Edge<D>, y: &Edge<D>) -> f64 {
        let length = || match self.longest {
            None => alpha(x.length, y.length),
            Some(longest) => alpha_global(x.length, y.length, longest),
        };
        match self.factors {
            Compatibility::Count => 1.0,
            Compatibility::Length => length(),
            Compatibility::LengthDirection => length() * beta(&x.vector, &y.vector),
            Compatibility::Printed => length() * beta(&x.vector, &y.vector) * x.gamma,
            Compatibility::Full => length() * beta(&x.vector, &y.vector) * x.gamma * y.gamma,
        }
    }
}
