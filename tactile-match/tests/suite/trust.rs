//! Additional results of the matchers: standard deviations, confidences and doubts.

use crate::common::{Scene, Stream, bend, scattered};
use nalgebra::{Point, Point2, SVector};
use tactile_match::{
    AnnealedSoftassign, CoherentPointDrift, Doubt, Judgement, LinearAssignment, Matching,
    NearestNeighbour, PointMatcher, RelaxationLabelling, Rotation, Transformation,
};

/// Adds Gaussian noise and a fraction of uniform outliers to the true positions of the `seen`
/// points, and shuffles them.
fn scene<const D: usize>(
    model: Vec<Point<f64, D>>,
    truth: Vec<Point<f64, D>>,
    seen: impl Fn(&Point<f64, D>) -> bool,
    (noise, outliers): (f64, f64),
    seed: u64,
) -> Scene<D> {
    let mut stream = Stream::new(seed);
    let mut order = stream.permutation(model.len());
    order.retain(|&i| seen(&truth[i]));
    let outliers = (outliers * order.len() as f64) as usize;
    Scene::new(model, truth, order, |_| noise, outliers, &mut stream)
}

fn matched<const D: usize>(scene: &Scene<D>) -> Matching<D> {
    AnnealedSoftassign::default()
        .match_points(&scene.model, &scene.target)
        .expect("good points")
}

/// Fraction of the visible points with their own partner.
fn right<const D: usize>(scene: &Scene<D>, found: &Matching<D>) -> f64 {
    scene.right(&found.assignment) as f64 / scene.order.len() as f64
}

/// 105 points, bent, with noise of a fifth of their spacing.
fn noisy<const D: usize>(seed: u64, outliers: f64) -> Scene<D> {
    let model = scattered::<D>(105, seed);
    let truth = bend(&model, 0.06);
    let noise = 0.15 * 105_f64.powf(-1.0 / D as f64);
    scene(model, truth, |_| true, (noise, outliers), seed + 1000)
}

/// Fraction of the coordinates within one standard deviation of the true values, and the
/// calibration of the confidences: for every tenth, the number of pairs, the sum of their
/// confidences, and the number of correct pairs.
fn trust<const D: usize>(outliers: f64) -> (f64, [[f64; 3]; 10]) {
    let (mut within, mut all) = (0, 0);
    let mut tenths = [[0.0; 3]; 10];
    for seed in 0..16 {
        let scene = noisy::<D>(seed, outliers);
        let found = matched(&scene);
        for &i in &scene.order {
            for k in 0..D {
                let deviation = found.displacement_covariance[i][(k, k)].sqrt();
                within += usize::from((found.warped[i][k] - scene.truth[i][k]).abs() < deviation);
                all += 1;
            }
        }
        for (i, partner) in found.assignment.iter().enumerate() {
            let &Some(j) = partner else { continue };
            let tenth = &mut tenths[((10.0 * found.confidence[i]) as usize).min(9)];
            tenth[0] += 1.0;
            tenth[1] += found.confidence[i];
            tenth[2] += f64::from(u8::from(scene.is_right(i, j)));
        }
    }
    (f64::from(within as u32) / f64::from(all as u32), tenths)
}

fn check_trust<const D: usize>(outliers: f64) {
    let (within, tenths) = trust::<D>(outliers);
    // Sixteen smooth fields with about twenty modes each: their fraction varies by 3 % about the 68
    // % of a normal distribution.
    assert!(
        (0.60..0.76).contains(&within),
        "{D}-D: {within} within one standard deviation"
    );
    let total = |column: usize| tenths.iter().map(|tenth| tenth[column]).sum::<f64>();
    // Confidences also allow for displaced parts, which do not occur in these scenes: they are too
    // low by 2 to 4 %.
    assert!(
        (total(1) - total(2)).abs() < 0.04 * total(0),
        "{D}-D: confidence {} in all, {} of {} pairs are right",
        total(1),
        total(2),
        total(0)
    );
    for [count, confidence, right] in tenths {
        // Over all kinds of scenes the agreement is better (`--example confidence`). Ten points are
        // allowed for one kind, plus the statistical variation of the fraction for this number of
        // pairs.
        if count > 100.0 {
            let chance = 0.5 / f64::sqrt(count);
            assert!(
                (confidence - right).abs() < (0.1 + chance) * count,
                "{D}-D: of {count} pairs of confidence {} {} are right",
                confidence / count,
                right / count
            );
        }
    }
}

#[test]
fn standard_deviations_and_confidences_are_honest_in_the_plane() {
    check_trust::<2>(0.0);
    check_trust::<2>(0.2);
}

#[test]
fn standard_deviations_and_confidences_are_honest_in_space() {
    check_trust::<3>(0.0);
    check_trust::<3>(0.2);
}

/// Noise between the rounding of clean data and the resolution of the annealing: no true pair is
/// rejected, the noise is determined, and the warp is closer to the true positions than the noisy
/// points.
fn check_small_noise<const D: usize>(n: usize, size: f64) {
    for noise in [1e-5, 3e-4, 1e-3, 2e-3] {
        let (mut found_noise, mut squares) = (0.0, 0.0);
        for seed in 0..4 {
            let model = scattered::<D>(n, seed);
            let truth = bend(&model, size);
            let scene = scene(model, truth, |_| true, (noise, 0.0), seed + 60);
            let found = matched(&scene);
            assert_eq!(
                right(&scene, &found),
                1.0,
                "{D}-D, {n} points, noise {noise}, seed {seed}"
            );
            assert_eq!(found.report.doubt(), None);
            found_noise += found.report.sigma / 4.0;
            squares += scene.error(&found.warped).powi(2) / 4.0;
        }
        // Four sets of n points. The warp uses up to two thirds of their coordinates: 2 to 5 %.
        assert!(
            (found_noise / noise - 1.0).abs() < 0.15,
            "{D}-D, {n} points: noise {found_noise} for {noise}"
        );
        let error = (squares / D as f64).sqrt();
        assert!(
            error < 0.9 * noise,
            "{D}-D, {n} points, noise {noise}: error {error}"
        );
    }
}

#[test]
fn small_noise_costs_no_pair_and_is_found() {
    for bending in [0.0, 0.03] {
        check_small_noise::<2>(105, bending);
        check_small_noise::<3>(105, bending);
        check_small_noise::<2>(50, bending);
    }
}

/// A warp that follows the noise of fifty points in space loses a third of the partners.
#[test]
fn noise_of_few_points_costs_no_pair() {
    for seed in 0..8 {
        let model = scattered::<3>(50, seed);
        let truth = bend(&model, 0.03);
        let scene = scene(model, truth, |_| true, (0.015, 0.0), seed + 60);
        let found = matched(&scene);
        // One pair in fifty may be exchanged: the noise is a twentieth of the spacing.
        assert!(right(&scene, &found) >= 0.98, "seed {seed}");
        assert!(found.unmatched_model.is_empty(), "seed {seed}");
        // 150 coordinates minus those used by the warp, and at least two standard deviations.
        assert!(
            (found.report.sigma / 0.015 - 1.0).abs() < 0.25,
            "seed {seed}: noise {}",
            found.report.sigma
        );
    }
}

/// A set stretched along x and seen through the original window.
fn stretched<const D: usize>(n: usize, stretch: f64, outliers: f64, seed: u64) -> Scene<D> {
    let model = scattered::<D>(n, seed);
    let truth: Vec<_> = model
        .iter()
        .map(|p| {
            let mut q = *p;
            q[0] = 0.5 + stretch * (p[0] - 0.5);
            q
        })
        .collect();
    let noise = 0.02 * (n as f64).powf(-1.0 / D as f64);
    let in_window = |p: &Point<f64, D>| (0.0..1.0).contains(&p[0]);
    scene(model, truth, in_window, (noise, outliers), seed + 7)
}

/// At most one of 24 scenes has less than 98 % of its pairs: in a plane stretched by a quarter, a
/// part may be displaced by one point.
#[test]
fn stretched_and_cropped_sets_are_matched() {
    let mut short = Vec::new();
    for stretch in [1.25, 1.5, 2.0] {
        for outliers in [0.0, 0.1] {
            for seed in [3, 4] {
                let plane = stretched::<2>(300, stretch, outliers, seed);
                let space = stretched::<3>(300, stretch, outliers, seed);
                let right = [
                    right(&plane, &matched(&plane)),
                    right(&space, &matched(&space)),
                ];
                let missed = right.into_iter().filter(|&right| right < 0.98);
                short.extend(missed.map(|right| (stretch, outliers, seed, right)));
            }
        }
    }
    assert!(
        short.len() <= 1,
        "stretch, outliers, seed, right: {short:?}"
    );
}

/// A lattice is unchanged by a rotation of a half or a quarter: if any rotation is allowed, the
/// result is ambiguous. A protruding point decides.
#[test]
fn a_lattice_that_may_be_turned_is_doubtful() {
    let lattice: Vec<Point2<f64>> = (0..36)
        .map(|k| Point2::new(f64::from(k % 6), f64::from(k / 6)))
        .collect();
    let mut marked = lattice.clone();
    marked.push(Point2::new(7.5, 5.0));
    for transformation in [Transformation::Rigid, Transformation::Smooth] {
        let matcher = AnnealedSoftassign::default().with_transformation(transformation);
        let any = matcher.with_rotation(Rotation::Any);
        let turned: Vec<_> = lattice
            .iter()
            .map(|p| Point2::new(5.0 - p.x, 5.0 - p.y))
            .collect();
        let doubt = |found: Matching<2>| found.report.doubt();
        let found = any.match_points(&lattice, &turned).unwrap();
        assert_eq!(doubt(found), Some(Doubt::Symmetric), "{transformation:?}");
        let found = matcher.match_points(&lattice, &lattice).unwrap();
        assert_eq!(doubt(found), None, "{transformation:?}");
        let found = any.match_points(&marked, &marked).unwrap();
        assert_eq!(doubt(found), None, "{transformation:?}");
    }
}

/// A rotated or mirrored jittered grid has a nearby match with itself, whose residuals are the
/// jitter. Rotations are found if they are allowed, and otherwise named in a doubt. A mirror image
/// is named. An unchanged grid has no doubt.
#[test]
fn a_jittered_grid_is_told_from_its_twins() {
    let mut stream = Stream::new(17);
    for (side, jitter) in [(8, 0.3), (12, 0.15), (20, 0.5)] {
        let place = |k: u32, stream: &mut Stream| f64::from(k) + jitter * (stream.next() - 0.5);
        let model: Vec<_> = (0..side * side)
            .map(|k| Point2::new(place(k % side, &mut stream), place(k / side, &mut stream)))
            .collect();
        type Change = fn(f64, f64) -> [f64; 2];
        let cases: [(Change, Option<Doubt>, Option<Doubt>); 6] = [
            (|x, y| [x, y], None, None),
            (|x, y| [-y, x], None, Some(Doubt::Turned)),
            (|x, y| [-x, -y], None, Some(Doubt::Turned)),
            (|x, y| [y, -x], None, Some(Doubt::Turned)),
            (|x, y| [-x, y], Some(Doubt::Mirrored), Some(Doubt::Mirrored)),
            (|x, y| [y, x], Some(Doubt::Mirrored), Some(Doubt::Mirrored)),
        ];
        for (case, (change, of_any, of_limited)) in cases.into_iter().enumerate() {
            let image = |p: &Point2<f64>| Point2::from(change(1.01 * p.x, p.y));
            let target: Vec<_> = model
                .iter()
                .map(|p| image(p) + SVector::from_fn(|_, _| 0.02 * stream.normal()))
                .collect();
            for (range, doubt) in [(Rotation::Any, of_any), (Rotation::Limited, of_limited)] {
                let matcher = AnnealedSoftassign::default().with_rotation(range);
                let found = matcher.match_points(&model, &target).unwrap();
                let scene = format!("{side} a side, jitter {jitter}, case {case}, {range:?}");
                assert_eq!(found.report.doubt(), doubt, "{scene}");
                let right = (0..model.len()).filter(|&i| found.assignment[i] == Some(i));
                assert_eq!(doubt.is_none(), right.count() == model.len(), "{scene}");
            }
        }
    }
}

/// Pairs without a likelihood are judged by the common displacement of neighbours: slightly bent
/// sets are certain, and unrelated sets are doubted.
fn check_pairs<const D: usize>() {
    let matchers: [&dyn PointMatcher<D>; 4] = [
        &NearestNeighbour::default(),
        &LinearAssignment::default(),
        &CoherentPointDrift::default(),
        &RelaxationLabelling::default()
            .with_candidates(8)
            .expect("eight"),
    ];
    for seed in 0..4 {
        let model = scattered::<D>(60, seed);
        let truth = bend(&model, 0.002);
        let scene = scene(model.clone(), truth, |_| true, (0.0, 0.0), seed);
        let mut stream = Stream::new(seed + 100);
        let mut strewn = || Point::from(SVector::<f64, D>::from_fn(|_, _| stream.next()));
        let other: Vec<_> = (0..60).map(|_| strewn()).collect();
        for (k, matcher) in matchers.iter().enumerate() {
            let judgement = |target: &[_]| {
                let found = matcher.match_points(&model, target);
                found.expect("good points").report.judgement
            };
            assert_eq!(judgement(&scene.target), Judgement::Sure, "{k} {seed}");
            let unrelated = judgement(&other);
            assert!(matches!(unrelated, Judgement::Doubtful(_)), "{k} {seed}");
        }
    }
}

#[test]
fn pairs_alone_are_judged_by_the_motions_of_neighbours() {
    check_pairs::<2>();
    check_pairs::<3>();
    // A lattice displaced by six tenths of a step: its nearest neighbours are wrong.
    let lattice = |shift: f64| -> Vec<Point2<f64>> {
        let place = |k: u32| Point2::new(f64::from(k % 12) + shift, f64::from(k / 12));
        (0..144).map(place).collect()
    };
    let found = NearestNeighbour::default().match_points(&lattice(0.0), &lattice(0.6));
    let doubt = found.expect("good points").report.doubt();
    assert!(matches!(doubt, Some(Doubt::Repeats { .. })), "{doubt:?}");
}
