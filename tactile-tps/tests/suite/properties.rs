//! Requirements for every spline: it interpolates, it is affine if its targets are, and it does not
//! depend on frame, unit or order.

use crate::common::{Uniform, bend, fit, for_all, largest, options};
use nalgebra::{Point, Point2, Point3, Rotation2, Rotation3, SMatrix, SVector};
use proptest::prelude::*;
use tactile_tps::{
    Affine, Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline,
    SplineWorkspace, Warp,
};

fn interpolates<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let sources = Uniform(seed).points::<D>(40);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(kernel));
    for (x, y) in sources.iter().zip(&targets) {
        // Rounding of sums of 40 terms whose weights reach about 1e3 for r³ on close points: far
        // below 1e-10.
        assert!((spline.apply(x) - y).norm() < 1e-10);
    }
    let residual = spline.report.residual.expect("measured");
    assert!(residual < 1e-10, "{residual:e}");
}

fn reproduces_affine_maps<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(30);
    let linear = SMatrix::<f64, D, D>::from_fn(|_, _| random.next());
    let offset = SVector::from_fn(|_, _| 10.0 * random.next());
    let map = Affine::new(linear, offset);
    let targets: Vec<_> = sources.iter().map(|x| map.apply(x)).collect();
    for smoothing in [
        Smoothing::None,
        Smoothing::Lambda(0.1),
        Smoothing::Lambda(1e6),
    ] {
        let spline = fit(
            &sources,
            &targets,
            &options(kernel.clone(), smoothing, None),
        );
        // The rounding of the targets, up to 1e-15 of their size 10 over 30 points, times the
        // condition number, which reaches 1e8 for close points with r³.
        let rounding = 5e-15 * spline.report.condition;
        assert!(
            largest(
                spline
                    .terms()
                    .flat_map(|(_, w)| w.iter().copied().collect::<Vec<_>>())
            ) < rounding
        );
        let far = random.point::<D>() * 50.0;
        assert!((spline.apply(&far) - map.apply(&far)).norm() < 100.0 * rounding);
        assert!((spline.jacobian(&far) - linear).norm() < rounding);
        assert!(spline.bending_energy() < 1e-14 * rounding);
    }
}

/// x ↦ s R x + b applied to sources and queries changes only the unit of λ.
fn is_the_same_in_any_frame<const D: usize, K: Kernel>(
    kernel: K,
    seed: u64,
    turn: impl Fn(&Point<f64, D>) -> Point<f64, D>,
    scale: f64,
) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(30);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let degree = kernel.degree().expect("a degree");
    let offset = SVector::<f64, D>::from_fn(|_, _| 3.0 * random.next());
    let moved = |x: &Point<f64, D>| Point::from((turn(x).coords + offset) * scale);
    let elsewhere: Vec<_> = sources.iter().map(moved).collect();
    let options = |lambda: f64| options(kernel.clone(), Smoothing::Lambda(lambda), None);
    let here = fit(&sources, &targets, &options(0.01));
    let there = fit(&elsewhere, &targets, &options(0.01 * scale.powi(degree)));
    for _ in 0..20 {
        let query = random.point::<D>() * 1.5;
        // Rounding of the transformed coordinates, 1e-15, times a condition number below 1e4.
        assert!((here.apply(&query) - there.apply(&moved(&query))).norm() < 1e-10);
    }
}

fn ignores_the_order<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let sources = Uniform(seed).points::<D>(25);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let reversed = |points: &[Point<f64, D>]| points.iter().rev().copied().collect::<Vec<_>>();
    let options = FitOptions::new(kernel);
    let (a, b) = (
        fit(&sources, &targets, &options),
        fit(&reversed(&sources), &reversed(&targets), &options),
    );
    let query = Point::from(SVector::repeat(0.3));
    assert!((a.apply(&query) - b.apply(&query)).norm() < 1e-11);
}

fn smooths_towards_the_affine_fit<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(30);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let weights: Vec<f64> = (0..30).map(|_| 1.1 + random.next()).collect();
    let options = |lambda| options(kernel.clone(), Smoothing::Lambda(lambda), Some(&weights));
    let energies: Vec<f64> = (-6..6)
        .map(|k| fit(&sources, &targets, &options(10f64.powi(k))).bending_energy())
        .collect();
    assert!(energies.windows(2).all(|e| e[1] < e[0]), "{energies:?}");
    let limit = Affine::fit(&sources, &targets, Some(&weights)).expect("an affine map");
    let spline = fit(&sources, &targets, &options(1e12));
    let query = random.point::<D>();
    // The remaining bending is proportional to 1/λ.
    assert!((spline.apply(&query) - limit.apply(&query)).norm() < 1e-9);
}

/// Every method gives the same spline: fitted directly, refitted in place, from the spectrum, with
/// and without weights.
fn refits_to_the_same<const D: usize, K: Kernel + Default>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(35);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let weights: Vec<f64> = (0..35)
        .map(|i| if i % 7 == 0 { 0.0 } else { 1.1 + random.next() })
        .collect();
    let factorization =
        Factorization::new(&sources, &FitOptions::new(kernel.clone())).expect("a factor");
    let (mut workspace, mut refitted) = (SplineWorkspace::default(), Spline::default());
    let query = random.point::<D>();
    for smoothing in [Smoothing::None, Smoothing::Lambda(0.3), Smoothing::Gcv] {
        for weights in [None, Some(&weights[..])] {
            let options = options(kernel.clone(), smoothing, weights);
            let once = fit(&sources, &targets, &options);
            factorization
                .refit_with(
                    &mut workspace,
                    &targets,
                    weights,
                    Some(smoothing),
                    &mut refitted,
                )
                .expect("a refit");
            assert!((once.apply(&query) - refitted.apply(&query)).norm() < 1e-9);
            assert_eq!(once.report.ignored, refitted.report.ignored);
            let (a, b) = (once.report.lambda, refitted.report.lambda);
            assert!((a - b).abs() <= 1e-6 * a);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn splines_interpolate(seed in 1u64..u64::MAX) {
        for_all!(interpolates, seed);
    }

    #[test]
    fn affine_targets_give_affine_maps(seed in 1u64..u64::MAX) {
        for_all!(reproduces_affine_maps, seed);
    }

    #[test]
    fn frames_and_units_do_not_matter(
        seed in 1u64..u64::MAX,
        angle in -3.0..3.0f64,
        power in -6.0..6.0f64,
    ) {
        let turn2 = |x: &Point2<f64>| Rotation2::new(angle) * x;
        let turn3 = |x: &Point3<f64>| Rotation3::from_euler_angles(angle, 0.3, -0.7 * angle) * x;
        let scale = 10f64.powf(power);
        is_the_same_in_any_frame(R2LogR, seed, turn2, scale);
        is_the_same_in_any_frame(R3, seed, turn2, scale);
        is_the_same_in_any_frame(R2LogR, seed, turn3, scale);
        is_the_same_in_any_frame(NegR, seed, turn3, scale);
        is_the_same_in_any_frame(R3, seed, turn3, scale);
    }

    #[test]
    fn the_order_of_points_does_not_matter(seed in 1u64..u64::MAX) {
        for_all!(ignores_the_order, seed);
    }

    #[test]
    fn energy_falls_as_lambda_grows(seed in 1u64..u64::MAX) {
        for_all!(smooths_towards_the_affine_fit, seed);
    }

    #[test]
    fn refits_agree_with_fits(seed in 1u64..u64::MAX) {
        for_all!(refits_to_the_same, seed);
    }
}

/// Noise of a known size on a smooth map: cross-validation must be closer to the map than
/// interpolation.
#[test]
fn cross_validation_finds_the_noise() {
    let mut random = Uniform(7);
    let sources = random.points::<2>(150);
    let targets: Vec<_> = sources
        .iter()
        .map(|x| bend(x) + SVector::<f64, 2>::from_fn(|_, _| 0.05 * random.next()))
        .collect();
    let error = |smoothing| {
        let spline = fit(&sources, &targets, &options(R2LogR, smoothing, None));
        let queries = Uniform(8).points::<2>(200);
        queries
            .iter()
            .map(|q| (spline.apply(&(q * 0.9)) - bend(&(q * 0.9))).norm_squared())
            .sum::<f64>()
            .sqrt()
    };
    assert!(error(Smoothing::Gcv) < 0.6 * error(Smoothing::None));
}

#[test]
fn rigid_motions_are_found_and_never_reflect() {
    let mut random = Uniform(9);
    let sources = random.points::<3>(10);
    let turn = Rotation3::from_euler_angles(0.4, -1.0, 2.0);
    let truth = Affine::new(*turn.matrix(), SVector::from([1.0, 2.0, 3.0]));
    let targets: Vec<_> = sources.iter().map(|x| truth.apply(x)).collect();
    let found = Affine::fit_rigid(&sources, &targets, None).expect("a motion");
    assert!(
        (found.linear - truth.linear).norm() < 1e-13
            && (found.offset - truth.offset).norm() < 1e-13
    );
    let mirrored: Vec<_> = sources
        .iter()
        .map(|x| Point3::new(-x.x, x.y, x.z))
        .collect();
    let found = Affine::fit_rigid(&sources, &mirrored, None).expect("a motion");
    assert!((found.linear.determinant() - 1.0).abs() < 1e-13);
}
