//! What every spline must be: interpolating, affine where its targets are, the same in any frame, unit and order.

use crate::common::{Uniform, bend, largest};
use nalgebra::{Point, Point2, Point3, Rotation2, Rotation3, SMatrix, SVector};
use proptest::prelude::*;
use tactile_tps::{
    Affine, AffineModel, Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Rigid, RigidModel, Smoothing,
    Spline, ThinPlateSpline, TpsError, Warp, WarpModel, Workspace,
};

/// Runs a check with every kernel in both dimensions.
macro_rules! for_all {
    ($check:ident $(, $argument:expr)*) => {
        $check::<2, _>(R2LogR $(, $argument)*);
        $check::<2, _>(R3 $(, $argument)*);
        $check::<3, _>(R2LogR $(, $argument)*);
        $check::<3, _>(NegR $(, $argument)*);
        $check::<3, _>(R3 $(, $argument)*);
    };
}

fn fit<const D: usize, K: Kernel>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    options: &FitOptions<f64, K>,
) -> ThinPlateSpline<f64, D, K> {
    ThinPlateSpline::fit(sources, targets, options).expect("a spline")
}

fn interpolates<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let sources = Uniform(seed).points::<D>(40);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(kernel));
    for (x, y) in sources.iter().zip(&targets) {
        // Rounding of sums of 40 terms whose weights reach some 1e3 for r³ on close points: far below 1e-10.
        assert!((spline.apply(x) - y).norm() < 1e-10);
    }
    let residual = spline.report().residual.expect("measured");
    assert!(residual < 1e-10, "{residual:e}");
}

fn reproduces_affine_maps<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(30);
    let linear = SMatrix::<f64, D, D>::from_fn(|_, _| random.next());
    let map = Affine::new(linear, SVector::from_fn(|_, _| 10.0 * random.next()));
    let targets: Vec<_> = sources.iter().map(|x| map.apply(x)).collect();
    for smoothing in [Smoothing::None, Smoothing::Lambda(0.1), Smoothing::Lambda(1e6)] {
        let spline = fit(&sources, &targets, &FitOptions::new(kernel.clone()).smoothing(smoothing));
        // The targets' own rounding, up to 1e-15 of their size 10 over 30 points, times the condition number: close
        // points under r³ bring it to 1e8.
        let rounding = 5e-15 * spline.report().condition;
        assert!(largest(spline.weights().flat_map(|w| w.iter().copied().collect::<Vec<_>>())) < rounding);
        let far = random.point::<D>() * 50.0;
        assert!((spline.apply(&far) - map.apply(&far)).norm() < 100.0 * rounding);
        assert!((spline.jacobian(&far) - linear).norm() < rounding);
        assert!(spline.bending_energy() < 1e-14 * rounding);
    }
}

/// x ↦ s R x + b on the sources and the queries changes nothing but the units of λ.
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
    let options = |lambda: f64| FitOptions::new(kernel.clone()).smoothing(Smoothing::Lambda(lambda));
    let here = fit(&sources, &targets, &options(0.01));
    let there = fit(&elsewhere, &targets, &options(0.01 * scale.powi(degree)));
    for _ in 0..20 {
        let query = random.point::<D>() * 1.5;
        // Rounding of the moved coordinates, 1e-15, times a condition number below 1e4.
        assert!((here.apply(&query) - there.apply(&moved(&query))).norm() < 1e-10);
    }
}

fn ignores_the_order<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let sources = Uniform(seed).points::<D>(25);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let reversed = |points: &[Point<f64, D>]| points.iter().rev().copied().collect::<Vec<_>>();
    let options = FitOptions::new(kernel);
    let (a, b) = (fit(&sources, &targets, &options), fit(&reversed(&sources), &reversed(&targets), &options));
    let query = Point::from(SVector::repeat(0.3));
    assert!((a.apply(&query) - b.apply(&query)).norm() < 1e-11);
}

fn has_the_derivatives_it_says<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(20);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(kernel));
    // Off the centres, so that −r is smooth within the step.
    let query = (0..).map(|_| random.point::<D>()).find(|q| sources.iter().all(|x| (x - q).norm() > 0.05));
    let query = query.expect("a gap");
    let (jacobian, hessian) = (spline.jacobian(&query), spline.hessian(&query));
    const STEP: f64 = 1e-4;
    for k in 0..D {
        let mut step = SVector::<f64, D>::zeros();
        step[k] = STEP;
        let slope = (spline.apply(&(query + step)) - spline.apply(&(query - step))) / (2.0 * STEP);
        let bend = (spline.jacobian(&(query + step)) - spline.jacobian(&(query - step))) / (2.0 * STEP);
        for m in 0..D {
            // Central differences: h² times third derivatives, at most w/0.05² with weights below 10.
            assert!((slope[m] - jacobian[(m, k)]).abs() < 1e-4);
            for l in 0..D {
                assert!((bend[(m, l)] - hessian[m][(l, k)]).abs() < 1e-2);
            }
        }
    }
}

fn smooths_towards_the_affine_fit<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(30);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let weights: Vec<f64> = (0..30).map(|_| 1.1 + random.next()).collect();
    let options = |lambda| {
        FitOptions::new(kernel.clone()).smoothing(Smoothing::Lambda(lambda)).weights(weights.clone())
    };
    let energies: Vec<f64> =
        (-6..6).map(|k| fit(&sources, &targets, &options(10f64.powi(k))).bending_energy()).collect();
    assert!(energies.windows(2).all(|e| e[1] < e[0]), "{energies:?}");
    let limit = AffineModel.fit(&sources, &targets, Some(&weights)).expect("an affine map");
    let spline = fit(&sources, &targets, &options(1e12));
    let query = random.point::<D>();
    // What is left of the bending goes as 1/λ.
    assert!((spline.apply(&query) - limit.apply(&query)).norm() < 1e-9);
}

/// The same spline by every way in: at once, refitted in place, by the spectrum, with weights and without.
fn refits_to_the_same<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(35);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let weights: Vec<f64> = (0..35).map(|i| if i % 7 == 0 { 0.0 } else { 1.1 + random.next() }).collect();
    let factorization = Factorization::new(&sources, &FitOptions::new(kernel.clone())).expect("a factor");
    let (mut workspace, mut refitted) = (Workspace::new(), Spline::empty(kernel.clone()));
    let query = random.point::<D>();
    for smoothing in [Smoothing::None, Smoothing::Lambda(0.3), Smoothing::Gcv] {
        for weights in [None, Some(&weights[..])] {
            let plain = FitOptions::new(kernel.clone()).smoothing(smoothing);
            let options = weights.map_or(plain.clone(), |w| plain.weights(w.to_vec()));
            let once = fit(&sources, &targets, &options);
            factorization
                .refit_with(&mut workspace, &targets, weights, smoothing, &mut refitted)
                .expect("a refit");
            assert!((once.apply(&query) - refitted.apply(&query)).norm() < 1e-9);
            assert_eq!(once.report().ignored, refitted.report().ignored);
            let (a, b) = (once.report().lambda, refitted.report().lambda);
            assert!((a - b).abs() <= 1e-6 * a);
        }
    }
}

/// The bits of a point's value do not depend on the company it comes in.
fn gives_the_same_bits_in_batches<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(33);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(kernel));
    let queries = random.points::<D>(77);
    let (mut values, mut jacobians) = (vec![Point::origin(); 77], vec![SMatrix::zeros(); 77]);
    spline.apply_and_jacobian_into(&queries, &mut values, &mut jacobians).expect("equal lengths");
    let mut alone = values.clone();
    spline.apply_into(&queries, &mut alone).expect("equal lengths");
    assert_eq!(values, alone);
    for (i, query) in queries.iter().enumerate() {
        assert_eq!((spline.apply(query), spline.jacobian(query)), (values[i], jacobians[i]));
    }
}

/// f32 points give the spline of the same points in f64 to single precision.
fn works_in_single_precision<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let sources = Uniform(seed).points::<D>(30);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let narrow = |points: &[Point<f64, D>]| points.iter().map(|p| p.map(|x| x as f32)).collect::<Vec<_>>();
    let options = FitOptions::new(kernel.clone());
    let single: ThinPlateSpline<f32, D, K> =
        ThinPlateSpline::fit(&narrow(&sources), &narrow(&targets), &FitOptions::new(kernel))
            .expect("a spline");
    let double = fit(&sources, &targets, &options);
    let query: Point<f64, D> = Point::from(SVector::repeat(0.2));
    let difference = single.apply(&query.map(|x: f64| x as f32)).map(f64::from) - double.apply(&query);
    // 1e-7 times weights that sum to at most some hundreds.
    assert!(difference.norm() < 2e-4, "{difference}");
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
    fn frames_and_units_do_not_matter(seed in 1u64..u64::MAX, angle in -3.0..3.0f64, power in -6.0..6.0f64) {
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
    fn derivatives_agree_with_differences(seed in 1u64..u64::MAX) {
        for_all!(has_the_derivatives_it_says, seed);
    }

    #[test]
    fn energy_falls_as_lambda_grows(seed in 1u64..u64::MAX) {
        for_all!(smooths_towards_the_affine_fit, seed);
    }

    #[test]
    fn refits_agree_with_fits(seed in 1u64..u64::MAX) {
        for_all!(refits_to_the_same, seed);
    }

    #[test]
    fn batches_agree_with_single_points(seed in 1u64..u64::MAX) {
        for_all!(gives_the_same_bits_in_batches, seed);
    }

    #[test]
    fn single_precision_follows_double(seed in 1u64..u64::MAX) {
        for_all!(works_in_single_precision, seed);
    }
}

/// Noise of a known size on a smooth map: cross-validation must come closer to the map than interpolation does.
#[test]
fn cross_validation_finds_the_noise() {
    let mut random = Uniform(7);
    let sources = random.points::<2>(150);
    let targets: Vec<_> =
        sources.iter().map(|x| bend(x) + SVector::<f64, 2>::from_fn(|_, _| 0.05 * random.next())).collect();
    let error = |smoothing| {
        let spline = fit(&sources, &targets, &FitOptions::new(R2LogR).smoothing(smoothing));
        let queries = Uniform(8).points::<2>(200);
        queries
            .iter()
            .map(|q| (spline.apply(&(q * 0.9)) - bend(&(q * 0.9))).norm_squared())
            .sum::<f64>()
            .sqrt()
    };
    assert!(error(Smoothing::Gcv) < 0.6 * error(Smoothing::None));
}

/// Twice the same place with one value is one point; with two values it is their weighted mean, smoothed.
#[test]
fn coinciding_points_are_merged() {
    let mut random = Uniform(11);
    let mut sources = random.points::<2>(12);
    let mut targets: Vec<_> = sources.iter().map(bend).collect();
    let apart = fit(&sources, &targets, &FitOptions::default());
    sources.push(sources[3]);
    targets.push(targets[3]);
    let merged = fit(&sources, &targets, &FitOptions::default());
    let query = random.point();
    assert_eq!((merged.report().merged, merged.apply(&query)), (1, apart.apply(&query)));
    targets[12].x += 0.2;
    let conflict = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default());
    assert_eq!(conflict.err(), Some(TpsError::Conflict { first: 3, second: 12 }));
    let options = FitOptions::default().smoothing(Smoothing::Lambda(0.1));
    let smoothed = fit(&sources, &targets, &options);
    // One point of weight two at the mean is the same problem.
    targets[3].x += 0.1;
    let weights = (0..12).map(|i| if i == 3 { 2.0 } else { 1.0 }).collect();
    let single = fit(&sources[..12], &targets[..12], &options.weights(weights));
    assert!((smoothed.apply(&query) - single.apply(&query)).norm() < 1e-12);
}

/// A flat set in space warps along itself; a tolerance decides what counts as flat.
#[test]
fn directions_that_are_not_spanned_are_dropped() {
    let mut random = Uniform(5);
    let flat = |thickness: f64, random: &mut Uniform| {
        let points = random.points::<3>(25);
        points
            .iter()
            .map(|p| Point3::new(p.x, p.y, 0.5 * p.x - 0.25 * p.y + thickness * p.z))
            .collect::<Vec<_>>()
    };
    let exact = flat(0.0, &mut random);
    let targets: Vec<_> = exact.iter().map(bend).collect();
    let spline = fit(&exact, &targets, &FitOptions::new(NegR));
    assert_eq!(spline.report().rank, 3);
    let normal = SVector::<f64, 3>::new(0.5, -0.25, -1.0).normalize();
    assert!((spline.jacobian(&(exact[0] + normal * 0.0)) * normal).norm() < 1e-10);
    let thin = flat(1e-4, &mut random);
    assert_eq!(fit(&thin, &targets, &FitOptions::new(NegR)).report().rank, 4);
    let dropped = fit(&thin, &targets, &FitOptions::new(NegR).rank_tolerance(1e-2));
    assert_eq!(dropped.report().rank, 3);
    assert!(dropped.report().extents[2] < 1e-3);
}

#[test]
fn bad_input_is_named() {
    let points = Uniform(3).points::<2>(6);
    let fit = |sources: &[Point2<f64>], targets: &[Point2<f64>], options| {
        ThinPlateSpline::fit(sources, targets, &options).expect_err("an error").to_string()
    };
    let plain = FitOptions::<f64>::default;
    assert_eq!(fit(&[], &[], plain()), "no source points to fit");
    let mut bad = points.clone();
    bad[4].y = f64::NAN;
    assert_eq!(fit(&bad, &points, plain()), "source points: number 4 (from zero) is not finite");
    assert_eq!(fit(&points, &bad, plain()), "target points: number 4 (from zero) is not finite");
    assert_eq!(fit(&points, &points[1..], plain()), "target points: expected 6 of them, found 5");
    for lambda in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(fit(&points, &points, plain().smoothing(Smoothing::Lambda(lambda))).starts_with("smoothing"));
    }
    for tolerance in [-0.1, 1.0, f64::NAN] {
        assert!(fit(&points, &points, plain().rank_tolerance(tolerance)).starts_with("rank tolerance"));
    }
    let weights = |bad| vec![1.0, 1.0, bad, 1.0, 1.0, 1.0];
    for weight in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(fit(&points, &points, plain().weights(weights(weight))).starts_with("weight 2 "));
    }
    assert_eq!(fit(&points, &points, plain().weights(vec![0.0; 6])), "no weights to fit");
    assert!(fit(&points, &points, plain().weights(vec![1.0; 5])).starts_with("weights: expected 6"));
    let few = fit(&points[..3], &points[..3], plain().smoothing(Smoothing::Gcv));
    assert!(few.starts_with("cross-validation needs more than 3"));
}

/// Far from the points, where a plain sum keeps no digit, the sum in twice the working precision does.
#[test]
fn far_values_keep_their_digits() {
    let sources = Uniform(21).points::<2>(40);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(R3));
    let at = |distance: f64| spline.jacobian(&Point2::new(distance, 0.5 * distance));
    assert!(spline.digits(&Point2::new(1e7, 5e6)) < 2.0 && spline.digits(&sources[0]) > 8.0);
    // With the moments of degree 0 and 1 gone, Σ w ∇r³ of fixed direction tends to a constant as 1/r: a law that a
    // hundredth of the difference lost to rounding, 2e-9 of the Jacobian at the last place, would break.
    let limit = at(1e9);
    let excess = |distance: f64| (at(distance) - limit).norm() * distance;
    for distance in [1e4, 1e5, 1e6] {
        assert!((excess(distance) / excess(1e3) - 1.0).abs() < 0.01, "{} {limit}", at(distance));
    }
}

#[test]
fn rigid_motions_are_found_and_never_reflect() {
    let mut random = Uniform(9);
    let sources = random.points::<3>(10);
    let truth = Rigid {
        rotation: *Rotation3::from_euler_angles(0.4, -1.0, 2.0).matrix(),
        translation: SVector::from([1.0, 2.0, 3.0]),
    };
    let targets: Vec<_> = sources.iter().map(|x| truth.apply(x)).collect();
    let found = RigidModel.fit(&sources, &targets, None).expect("a motion");
    assert!(
        (found.rotation - truth.rotation).norm() < 1e-13
            && (found.translation - truth.translation).norm() < 1e-13
    );
    let mirrored: Vec<_> = sources.iter().map(|x| Point3::new(-x.x, x.y, x.z)).collect();
    let found = RigidModel.fit(&sources, &mirrored, None).expect("a motion");
    assert!((found.rotation.determinant() - 1.0).abs() < 1e-13);
}

#[cfg(feature = "rayon")]
#[test]
fn threads_do_not_change_a_bit() {
    let mut random = Uniform(31);
    let sources = random.points::<3>(40);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(NegR));
    let queries = random.points::<3>(2000);
    let (mut serial, mut parallel) = (vec![Point::origin(); 2000], vec![Point::origin(); 2000]);
    let (mut jacobians, mut others) = (vec![SMatrix::zeros(); 2000], vec![SMatrix::zeros(); 2000]);
    spline.apply_and_jacobian_into(&queries, &mut serial, &mut jacobians).expect("equal lengths");
    spline.par_apply_and_jacobian_into(&queries, &mut parallel, &mut others).expect("equal lengths");
    assert_eq!((&serial, jacobians), (&parallel, others));
    parallel.fill(Point::origin());
    spline.par_apply_into(&queries, &mut parallel).expect("equal lengths");
    assert_eq!(serial, parallel);
}
