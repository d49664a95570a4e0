//! The crate tactile-tps alone: a thin-plate spline through pairs of points, its values and its
//! gradient.
#![allow(clippy::print_stdout)]
use nalgebra::Point2;
use tactile_tps::{FitOptions, Smoothing, ThinPlateSpline, TpsError};

fn main() -> Result<(), TpsError> {
    let sources: Vec<Point2<f64>> = (0..36)
        .map(|k| Point2::new(f64::from(k % 6), f64::from(k / 6)))
        .collect();
    let targets: Vec<Point2<f64>> = (sources.iter())
        .map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y))
        .collect();
    let exact = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    let chosen = FitOptions::default().with_smoothing(Smoothing::Gcv)?;
    let smooth = ThinPlateSpline::fit(&sources, &targets, &chosen)?;
    let at = Point2::new(2.5, 2.5);
    for (name, warp) in [("through every point", &exact), ("smoothed", &smooth)] {
        let (value, gradient) = (warp.apply(&at), warp.jacobian(&at));
        println!("{name}: f = ({:.3}, {:.3})", value.x, value.y);
        println!("  ∂f_x/∂y = {:.3}, 0.5 in truth", gradient[(0, 1)]);
        println!("  bending energy {:.4}", warp.bending_energy());
    }
    Ok(())
}
