//! Smoothing chosen by blocked cross-validation, for errors that neighbours share.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::{
    Factorization, FitOptions, LambdaPath, NegR, Pairs, SeriesMemory, Smoothing, SplineWorkspace,
    ThinPlateSpline, TpsError, Warp, WarpModel,
};

/// λ for n points is n/200 times a power of eight, times the points' root mean square radius.
/// The powers go from nearly an interpolant to nearly affine.
const POWERS: core::ops::RangeInclusive<i32> = -5..=2;

type Spline = ThinPlateSpline<3, NegR>;

/// The model of the spline whose gradient is the strain: kernel −r, as stiff as the matches allow.
///
/// Errors of matches on a reconstructed surface are shared by neighbours.
/// Plain (generalised) cross-validation takes such errors for deformation.
/// Across the surface, where no two points lie behind each other, the gradient of its spline is
/// noise.
///
/// Here whole runs of neighbours are predicted from the others
/// ("blocked" cross-validation: Roberts et al., Ecography 40, 2017).
/// Of all λ whose prediction error is within one standard error of the least, the largest is taken
/// (Breiman, Friedman, Olshen & Stone 1984, §3.4.3).
///
/// Points must come with neighbours following each other, as samplers of control points give them.
/// Runs of [`RUN_LENGTH`](Self::RUN_LENGTH) points are dealt to two halves.
/// Each half predicts the other for eight values of λ. O(n³) time.
/// With fewer than four runs [`Smoothing::Gcv`] chooses λ.
///
/// ```
/// use nalgebra::{Matrix3, Point3};
/// use tactile_tps::{StrainSpline, Warp, WarpModel};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// // A dome, sampled along a spiral, stretched by 20 % along its axis.
/// let dome = |i: usize| {
///     let (z, angle) = (1.0 - i as f64 / 60.0, 0.6 * i as f64);
///     let r = (1.0 - z * z).sqrt();
///     Point3::new(r * angle.cos(), r * angle.sin(), z)
/// };
/// let sources: Vec<_> = (0..60).map(dome).collect();
/// let targets: Vec<_> = sources.iter().map(|p| Point3::new(p.x, p.y, 1.2 * p.z)).collect();
/// let warp = StrainSpline.fit(&sources, &targets, None)?;
/// let stretch = Matrix3::from_diagonal(&[1.0, 1.0, 1.2].into());
/// assert!((warp.jacobian(&sources[30]) - stretch).norm() < 1e-9);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StrainSpline;

impl StrainSpline {
    /// Neighbours that share their errors and are left out together.
    pub const RUN_LENGTH: usize = 10;
}

impl WarpModel<3> for StrainSpline {
    fn fit(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        weights: Option<&[f64]>,
    ) -> Result<Box<dyn Warp<3> + Send + Sync>, TpsError> {
        let mut fitter = Fitter::default();
        fitter.fit(Pairs {
            sources,
            targets,
            weights,
        })?;
        Ok(Box::new(fitter.spline))
    }

    fn jacobians_through(
        &self,
        memory: &mut SeriesMemory,
        pairs: Pairs<'_, 3>,
        points: &[Point3<f64>],
        jacobians: &mut [Matrix3<f64>],
    ) -> Result<(), TpsError> {
        let fitter: &mut Fitter = memory.state();
        fitter.fit(pairs)?;
        fitter.spline.jacobian_into(points, jacobians)
    }
}

/// One of the two parts that predict each other.
#[derive(Default)]
struct Half {
    sources: Vec<Point3<f64>>,
    targets: Vec<Point3<f64>>,
    weights: Vec<f64>,
}

/// Fits splines one after the other in the same memory.
struct Fitter {
    options: FitOptions<NegR>,
    halves: [Half; 2],
    lambdas: Vec<f64>,
    path: Option<LambdaPath<3, 3, NegR>>,
    /// For each λ the squared errors of all predicted pairs.
    errors: Vec<Vec<f64>>,
    factorization: Option<Factorization<3, NegR>>,
    workspace: SplineWorkspace<3>,
    /// The last one fitted.
    spline: Spline,
}

impl Default for Fitter {
    fn default() -> Self {
        Self {
            options: FitOptions::new(NegR),
            halves: Default::default(),
            lambdas: Vec::new(),
            path: None,
            errors: Vec::new(),
            factorization: None,
            workspace: SplineWorkspace::default(),
            spline: Spline::default(),
        }
    }
}

impl Fitter {
    fn fit(&mut self, pairs: Pairs<'_, 3>) -> Result<(), TpsError> {
        // λ is chosen on halves, the spline itself goes through all pairs.
        let smoothing = match self.one_standard_error_lambda(pairs) {
            Some(lambda) => Smoothing::Lambda(lambda),
            None => Smoothing::Gcv,
        };
        match pairs.weights {
            Some(weights) => self.options.set_weights(weights)?,
            None => self.options = FitOptions::new(NegR),
        }
        let options = core::mem::replace(&mut self.options, FitOptions::new(NegR));
        self.options = options.with_smoothing(smoothing)?;
        let factorization = match self.factorization.take() {
            Some(kept) => kept.refactor(pairs.sources, &self.options),
            None => Factorization::new(pairs.sources, &self.options),
        };
        self.factorization.insert(factorization?).refit_with(
            &mut self.workspace,
            pairs.targets,
            None,
            None,
            &mut self.spline,
        )
    }

    /// The greatest λ that predicts left-out runs as well as the best, to one standard error.
    /// `None` where too few pairs, or too badly placed ones, are there to be split.
    fn one_standard_error_lambda(&mut self, pairs: Pairs<'_, 3>) -> Option<f64> {
        let n = pairs.sources.len();
        // Lengths that differ are left to the fit, which names them in its error.
        let as_many = pairs.targets.len() == n && pairs.weights.is_none_or(|w| w.len() == n);
        if n < 4 * StrainSpline::RUN_LENGTH || !as_many {
            return None;
        }
        self.split(pairs);
        let unit = mean_radius(pairs.sources) * n as f64 / 200.0;
        let lambda = |power: i32| unit * 8_f64.powi(power);
        self.lambdas.clear();
        // The sum of squares of a half has half its terms.
        self.lambdas.extend(POWERS.map(|power| 0.5 * lambda(power)));
        self.errors.resize_with(self.lambdas.len(), Vec::new);
        self.errors.iter_mut().for_each(Vec::clear);
        // Each half predicts the other, so that every pair is predicted once.
        self.predict(0)?;
        self.predict(1)?;
        let scores = || self.errors.iter().map(|errors| mean_with_error(errors));
        let (least, error) = scores().min_by(|a, b| a.0.total_cmp(&b.0))?;
        POWERS
            .zip(scores())
            .filter(|(_, (mean, _))| *mean <= least + error)
            .last()
            .map(|(power, _)| lambda(power))
    }

    /// Deals runs of neighbours in turn to the two halves.
    fn split(&mut self, pairs: Pairs<'_, 3>) {
        for half in &mut self.halves {
            half.sources.clear();
            half.targets.clear();
            half.weights.clear();
        }
        for (i, (source, target)) in pairs.sources.iter().zip(pairs.targets).enumerate() {
            let half = &mut self.halves[i / StrainSpline::RUN_LENGTH % 2];
            half.sources.push(*source);
            half.targets.push(*target);
            half.weights.push(pairs.weights.map_or(1.0, |w| w[i]));
        }
    }

    /// Adds, for every λ, the squared distances from where the spline through one half puts the
    /// sources of the other to their targets, times the weights.
    fn predict(&mut self, half: usize) -> Option<()> {
        let (own, other) = (&self.halves[half], &self.halves[1 - half]);
        self.options.set_weights(&own.weights).ok()?;
        let (sources, targets) = (&own.sources, &own.targets);
        let path = match self.path.take() {
            Some(kept) => kept.refit(sources, targets, &self.options, &self.lambdas),
            None => LambdaPath::fit(sources, targets, &self.options, &self.lambdas),
        };
        let path = self.path.insert(path.ok()?);
        let pairs = other.sources.iter().zip(&other.targets);
        for ((source, target), weight) in pairs.zip(&other.weights) {
            let values = path.values(source);
            for (errors, value) in self.errors.iter_mut().zip(values) {
                // A pair of little weight counts as little here as in the fit.
                errors.push(weight * (value - target).norm_squared());
            }
        }
        Some(())
    }
}

/// Root mean square distance from the centroid.
fn mean_radius(points: &[Point3<f64>]) -> f64 {
    let n = points.len() as f64;
    let centroid = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
    (points
        .iter()
        .map(|p| (p.coords - centroid).norm_squared())
        .sum::<f64>()
        / n)
        .sqrt()
}

/// Mean and its standard error.
fn mean_with_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (
        mean,
        values
            .iter()
            .map(|v| (v - mean) * (v - mean))
            .sum::<f64>()
            .sqrt()
            / n,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 200 points of a hemisphere, strip by strip, and errors that neighbours share.
    fn dome(error: f64) -> (Vec<Point3<f64>>, Vec<Point3<f64>>) {
        let point = |i: usize| {
            let (z, angle) = (1.0 - i as f64 / 200.0, 2.4 * i as f64);
            let r = (1.0 - z * z).sqrt();
            Point3::new(r * angle.cos(), r * angle.sin(), z)
        };
        let mut sources: Vec<_> = (0..200).map(point).collect();
        let strip = |p: &Point3<f64>| (10.0 * p.y).floor();
        sources.sort_by(|a, b| {
            (strip(a), a.x)
                .partial_cmp(&(strip(b), b.x))
                .expect("finite")
        });
        // Four neighbours have the same error.
        let wave = |i: usize| {
            2.0 * (((i / 4) as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(1.0) - 1.0
        };
        let targets = sources.iter().enumerate();
        let targets = targets
            .map(|(i, p)| Point3::from(1.2 * p.coords * (1.0 + error * wave(i))))
            .collect();
        (sources, targets)
    }

    fn fit_spline(
        smoothing: Smoothing,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
    ) -> Spline {
        let options = FitOptions::new(NegR).with_smoothing(smoothing);
        Spline::fit(sources, targets, &options.expect("a positive λ")).expect("a spline")
    }

    /// What was fitted before leaves no trace, and nothing is allocated for as many points.
    #[test]
    fn splines_one_after_the_other_are_those_fitted_alone() {
        let mut memory = SeriesMemory::default();
        let few: Vec<_> = (0..200).map(|i| f64::from(i as u32 % 4)).collect();
        for (n, error, weights) in [
            (200, 0.03, None),
            (90, 0.01, Some(&few[..90])),
            (30, 0.02, None),
            (200, 0.0, Some(&few[..])),
        ] {
            let (sources, targets) = dome(error);
            let (sources, targets) = (&sources[..n], &targets[..n]);
            let pairs = Pairs {
                sources,
                targets,
                weights,
            };
            let mut jacobians = [Matrix3::zeros(); 3];
            StrainSpline
                .jacobians_through(&mut memory, pairs, &sources[..3], &mut jacobians)
                .expect("a spline");
            let alone = StrainSpline
                .fit(sources, targets, weights)
                .expect("a spline");
            assert_eq!(jacobians[2], alone.jacobian(&sources[2]), "{n}");
        }
    }

    fn mean_across(warp: &dyn Warp<3>, points: &[Point3<f64>]) -> f64 {
        points.iter().map(|p| warp.jacobian(p)[(2, 2)]).sum::<f64>() / points.len() as f64 - 1.0
    }

    #[test]
    fn errors_that_neighbours_share_do_not_spoil_the_strain_across_the_surface() {
        let (sources, targets) = dome(0.03);
        let stiff = StrainSpline
            .fit(&sources, &targets, None)
            .expect("a spline");
        let loose = FitOptions::new(NegR).fit(&sources, &targets, None);
        let error = |warp: &dyn Warp<3>| {
            let square = |p| (warp.jacobian(p)[(2, 2)] - 1.2).powi(2);
            (sources.iter().map(square).sum::<f64>() / sources.len() as f64).sqrt()
        };
        let [stiff, loose] = [stiff, loose.expect("a spline")].map(|warp| error(&*warp));
        // An affine fit has the error of 0.03 × 1.2/√3 of 50 groups over the spread 1/√12 of z,
        // 0.010. The limit is two and a half standard deviations.
        assert!(stiff < 0.025, "{stiff}, interpolated {loose}");
        assert!(stiff < 0.5 * loose, "{stiff}, interpolated {loose}");
    }

    #[test]
    fn bending_that_errors_do_not_hide_is_kept() {
        let (sources, _) = dome(0.0);
        let bend = |p: &Point3<f64>| Point3::new(p.x + 0.3 * p.x * p.x, p.y, p.z);
        let targets: Vec<_> = sources.iter().map(bend).collect();
        let error = |warp: &dyn Warp<3>| {
            let inner = sources.iter().filter(|p| p.z > 0.5);
            inner
                .map(|p| (warp.jacobian(p)[(0, 0)] - 1.0 - 0.6 * p.x).abs())
                .sum::<f64>()
        };
        let chosen = StrainSpline.fit(&sources, &targets, None);
        let chosen = error(&*chosen.expect("a spline"));
        let [affine, interpolated] = [Smoothing::Lambda(1e9), Smoothing::None]
            .map(|smoothing| error(&fit_spline(smoothing, &sources, &targets)));
        // Of the bending that the gradient of a spline through points of a surface can have, all
        // but a third is found.
        assert!(
            chosen < interpolated + affine / 3.0,
            "{chosen}: {interpolated} to {affine}"
        );
    }

    #[test]
    fn a_scale_of_the_points_changes_no_strain() {
        let (sources, targets) = dome(0.02);
        let millimetres = |v: &[Point3<f64>]| v.iter().map(|p| p * 1e-3).collect::<Vec<_>>();
        let one = StrainSpline
            .fit(&sources, &targets, None)
            .expect("a spline");
        let other = StrainSpline
            .fit(&millimetres(&sources), &millimetres(&targets), None)
            .expect("a spline");
        let (a, b) = (
            mean_across(&*one, &sources),
            mean_across(&*other, &millimetres(&sources)),
        );
        // λ scales as the kernel: the same equations, to the rounding of a system of 200.
        assert!((a - b).abs() < 1e-8, "{a} {b}");
    }

    #[test]
    fn few_or_unusable_pairs_leave_the_choice_to_the_spline() {
        let (sources, targets) = dome(0.01);
        assert!(
            StrainSpline
                .fit(&sources[..20], &targets[..20], None)
                .is_ok()
        );
        assert!(StrainSpline.fit(&sources, &targets[1..], None).is_err());
        let flat: Vec<_> = sources.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();
        let chosen = StrainSpline.fit(&flat, &flat, None).expect("a spline");
        let own = fit_spline(Smoothing::Gcv, &flat, &flat);
        // Nothing to smooth: both leave the points where they are, to the rounding of a system of
        // 200.
        assert!((chosen.apply(&flat[7]) - own.apply(&flat[7])).norm() < 1e-8);
    }
}
