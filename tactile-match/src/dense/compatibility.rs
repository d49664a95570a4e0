//! (16)–(18): how alike two edges are.

use super::Edge;
use nalgebra::{RealField, SVector};

/// What the maximum in α (16) is taken over.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::dense::{DenseOptions, DenseRelaxation, LengthMaximum};
/// let points = [[0.0, 0.0], [1.0, 0.1], [2.5, 0.0], [0.3, 2.0], [1.6, 1.4]].map(Point2::from);
/// for maximum in [LengthMaximum::PerPair, LengthMaximum::Global] {
///     let m = DenseRelaxation::new(DenseOptions { maximum, ..Default::default() })?.relax(&points, &points);
///     assert!((0..5).all(|i| (0..5).all(|j| m[(i, i)] >= m[(i, j)])));
/// }
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LengthMaximum {
    /// The two edges compared: [`alpha`].
    #[default]
    PerPair,
    /// All edges of both graphs: [`alpha_global`].
    Global,
}

/// Which factors the compatibility of two edges has.
///
/// ```
/// use nalgebra::Vector2;
/// use tactile_match::dense::{Compatibility, CompatibilityRule, Edge};
/// let edge = |x: f64, y: f64| Edge { from: 0, to: 1, vector: Vector2::new(x, y), length: x.hypot(y), gamma: 0.5 };
/// let rate = |factors| CompatibilityRule { factors, longest: None }.of(&edge(1.0, 0.0), &edge(0.0, 2.0));
/// assert_eq!(rate(Compatibility::Count), 1.0);
/// assert_eq!(rate(Compatibility::Length), 0.5);
/// assert_eq!(rate(Compatibility::LengthDirection), 0.25); // at right angles: β = 0.5
/// assert_eq!(rate(Compatibility::Full), 0.0625);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compatibility {
    /// One: the support counts neighbours (the method the paper's extends).
    Count,
    /// α: like lengths.
    Length,
    /// αβ: like lengths and directions.
    LengthDirection,
    /// αβγγ: like lengths and directions, near neighbours first. The paper's (19).
    #[default]
    Full,
}

/// α (16), the maximum per pair: `1 − |d − e| / max(d, e) = min(d, e) / max(d, e)`; two lengths of nought are alike.
///
/// The quotient keeps its digits where the lengths differ by many decades; the printed difference loses them.
///
/// ```
/// use tactile_match::dense::alpha;
/// assert_eq!(alpha(1.0, 4.0), 0.25);
/// assert_eq!(alpha(0.0, 0.0), 1.0);
/// ```
#[must_use]
pub fn alpha<T: RealField + Copy>(d: T, e: T) -> T {
    let longer = d.max(e);
    if longer > T::zero() {
        d.min(e) / longer
    } else {
        T::one()
    }
}

/// α (16), the maximum over all edges: `1 − |d − e| / longest`; one where `longest` is nought.
///
/// ```
/// use tactile_match::dense::alpha_global;
/// assert_eq!(alpha_global(1.0, 3.0, 8.0), 0.75);
/// ```
#[must_use]
pub fn alpha_global<T: RealField + Copy>(d: T, e: T, longest: T) -> T {
    if longest > T::zero() {
        T::one() - (d - e).abs() / longest
    } else {
        T::one()
    }
}

/// β (17): `1 − ∠(u, v) / π`, one for parallel and nought for opposite edges, in any dimension; nought if an edge has
/// no length.
///
/// The angle is `atan2(|u ∧ v|, u · v)`, exact at 0 and π where `acos` loses half the digits or returns NaN.
///
/// ```
/// use nalgebra::Vector2;
/// use tactile_match::dense::beta;
/// assert_eq!(beta(&Vector2::new(1.0, 0.0), &Vector2::new(3.0, 0.0)), 1.0);
/// assert_eq!(beta(&Vector2::new(1.0, 0.0), &Vector2::new(0.0, 2.0)), 0.5);
/// assert_eq!(beta(&Vector2::new(1.0, 3.0), &Vector2::new(-1.0, -3.0)), 0.0);
/// ```
#[must_use]
pub fn beta<T: RealField + Copy, const D: usize>(u: &SVector<T, D>, v: &SVector<T, D>) -> T {
    // Largest components scaled to one: no square under- or overflows, and parallel vectors stay exactly parallel.
    let (largest_u, largest_v) = (u.amax(), v.amax());
    if largest_u <= T::zero() || largest_v <= T::zero() {
        return T::zero();
    }
    let (u, v) = (u / largest_u, v / largest_v);
    let mut wedge = T::zero();
    for p in 0..D {
        for q in p + 1..D {
            let minor = u[p] * v[q] - u[q] * v[p];
            wedge += minor * minor;
        }
    }
    // π − ∠(u, v) = ∠(u, −v): near opposite edges keep the digits of a small β.
    wedge.sqrt().atan2(-u.dot(&v)) / T::pi()
}

/// γ (18): `1 − d / longest`, `longest` among the edges of the same point; one where `longest` is nought.
///
/// ```
/// use tactile_match::dense::gamma;
/// assert_eq!(gamma(1.0, 4.0), 0.75);
/// assert_eq!(gamma(4.0, 4.0), 0.0);
/// ```
#[must_use]
pub fn gamma<T: RealField + Copy>(d: T, longest: T) -> T {
    if longest > T::zero() {
        (longest - d) / longest
    } else {
        T::one()
    }
}

/// A [`Compatibility`] ready to be evaluated: the factors and the maximum in α.
///
/// ```
/// use nalgebra::Vector2;
/// use tactile_match::dense::{Compatibility, CompatibilityRule, Edge};
/// let edge = |x: f64| Edge { from: 0, to: 1, vector: Vector2::new(x, 0.0), length: x, gamma: 1.0 };
/// let pair = CompatibilityRule { factors: Compatibility::Length, longest: None };
/// assert_eq!(pair.of(&edge(1.0), &edge(4.0)), 0.25); // 1 − 3/4
/// let global = CompatibilityRule { longest: Some(8.0), ..pair };
/// assert_eq!(global.of(&edge(1.0), &edge(4.0)), 0.625); // 1 − 3/8
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompatibilityRule<T> {
    /// The factors.
    pub factors: Compatibility,
    /// Longest edge of both graphs for [`alpha_global`]; `None` for [`alpha`].
    pub longest: Option<T>,
}

impl<T: RealField + Copy> CompatibilityRule<T> {
    /// `r` of model edge `x` and target edge `y`.
    #[must_use]
    pub fn of<const D: usize>(&self, x: &Edge<T, D>, y: &Edge<T, D>) -> T {
        let length = || match self.longest {
            None => alpha(x.length, y.length),
            Some(longest) => alpha_global(x.length, y.length, longest),
        };
        match self.factors {
            Compatibility::Count => T::one(),
            Compatibility::Length => length(),
            Compatibility::LengthDirection => length() * beta(&x.vector, &y.vector),
            Compatibility::Full => length() * beta(&x.vector, &y.vector) * x.gamma * y.gamma,
        }
    }
}
