//! Trade-off between smoothness and fidelity of a spline.

/// Trade-off between smoothness and fidelity of a spline.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{FitOptions, Smoothing, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> = (0..25).map(|i| Point2::new(f64::from(i % 5),
///     f64::from(i / 5))).collect();
/// let noise = |i: usize| 0.01 * ((i * 7919 % 101) as f64 / 50.0 - 1.0);
/// let targets: Vec<_> = sources.iter().enumerate().map(|(i, p)| Point2::new(p.x + noise(i),
///     p.y)).collect();
/// let options = FitOptions::default().with_smoothing(Smoothing::Gcv)?;
/// let smooth = ThinPlateSpline::fit(&sources, &targets, &options)?;
/// let through = ThinPlateSpline::fit(&sources, &targets,
///     &options.with_smoothing(Smoothing::None)?)?;
/// assert!(smooth.report.lambda > 0.0 && smooth.bending_energy() < through.bending_energy());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Smoothing {
    /// Interpolation: λ = 0.
    #[default]
    None,
    /// Minimises Σ weightᵢ |f(xᵢ) − yᵢ|² + λ wᵀKw for this λ ≥ 0, in the units of the points and
    /// the kernel.
    Lambda(f64),
    /// Chooses the λ that minimises the generalised cross-validation score (Craven & Wahba 1979;
    /// Golub, Heath & Wahba 1979).
    Gcv,
}

/// The λ that minimises the generalised cross-validation score, from the spectrum of the matrix
/// with σ on `affine` directions.
///
/// V(λ) = n |W^½(y − f)|² / tr(I − H)². Both are sums over the eigenvalues μ: |W^½(y − f)|² = Σ
/// (λ/(μ + λ))² e, and tr(I − H) = Σ λ/(μ + λ) minus the terms of the affine directions. `energies`
/// are the squared coefficients e = (vᵀb)² of the values in the eigenvectors, summed over the
/// outputs.
pub(crate) fn least_gcv(values: &[f64], energies: &[f64], affine: usize, shift: f64) -> f64 {
    let most = values.iter().fold(f64::MIN_POSITIVE, |m, &mu| m.max(mu));
    let score = |log: f64| {
        let filter = |mu: f64| 1.0 / (1.0 + mu.max(0.0) / log.exp2());
        let pairs = values.iter().zip(energies);
        let rss: f64 = pairs.map(|(&mu, e)| filter(mu).powi(2) * e).sum();
        let all: f64 = values.iter().map(|&mu| filter(mu)).sum();
        // The affine directions have the eigenvalue σ, which does not belong to the fit.
        let trace = all - affine as f64 * filter(shift);
        values.len() as f64 * rss / (trace * trace)
    };
    // From far below the rounding of the matrix to a spline that is affine to single precision.
    minimise(most.log2() - 50.0, most.log2() + 24.0, score).exp2()
}

/// The minimum of a function on a grid, refined by golden sections. The larger argument is returned
/// if values are equal.
fn minimise(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    // Steps of half a power of two: the score can have several minima, which the golden section
    // would miss.
    let steps = 148;
    let at = |i: usize| low + (high - low) * i as f64 / steps as f64;
    let scores = (0..=steps).map(|i| (f(at(i)), i));
    let least = |best: (f64, usize), new: (f64, usize)| if new.0 <= best.0 { new } else { best };
    let best = scores.fold((f64::INFINITY, 0), least).1;
    let (mut a, mut b) = (at(best.saturating_sub(1)), at((best + 1).min(steps)));
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    for _ in 0..40 {
        let (c, d) = (b - golden * (b - a), a + golden * (b - a));
        if f(c) < f(d) { b = d } else { a = c }
    }
    0.5 * (a + b)
}
