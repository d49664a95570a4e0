//! The splines of the plane and of space in `f64`, compiled with this crate.
//!
//! Builds at low optimisation share the instances of generic code that a dependency holds. Without these, every test,
//! example and dependent crate compiles the splines anew.

use crate::{FitOptions, Kernel, NegR, R2LogR, Spline, TpsError};
use nalgebra::{Point, SMatrix};

/// Fitting and evaluating `M` outputs over `D` axes.
type Functions<const D: usize, const M: usize, K> = (
    fn(
        &[Point<f64, D>],
        &[Point<f64, M>],
        &FitOptions<f64, K>,
    ) -> Result<Spline<f64, D, M, K>, TpsError>,
    fn(&Spline<f64, D, M, K>, &Point<f64, D>) -> Point<f64, M>,
    fn(&Spline<f64, D, M, K>, &Point<f64, D>) -> SMatrix<f64, M, D>,
    fn(&Spline<f64, D, M, K>, &[Point<f64, D>], &mut [Point<f64, M>]) -> Result<(), TpsError>,
);

const fn functions<const D: usize, const M: usize, K: Kernel>() -> Functions<D, M, K> {
    (
        Spline::fit,
        Spline::apply,
        Spline::jacobian,
        Spline::apply_into,
    )
}

#[used]
static PLANE: Functions<2, 2, R2LogR> = functions();
#[used]
static SURFACE: Functions<2, 1, R2LogR> = functions();
#[used]
static SPACE: Functions<3, 3, NegR> = functions();
