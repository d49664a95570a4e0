//! Targets that were measured with different precision.

use crate::common::{Stream, bend, reordered, scattered};
use nalgebra::{Point, SVector};
use tactile_match::{AnnealedSoftassign, MatchError, Matching, PointMatcher, Transformation};

/// A normal deviate, nearly: the sum of twelve uniform ones.
fn deviate(stream: &mut Stream) -> f64 {
    (0..12).map(|_| stream.next()).sum::<f64>() - 6.0
}

/// A model, its true positions, targets with noise of known deviations and which model point each
/// of them is.
struct Scene<const D: usize> {
    model: Vec<Point<f64, D>>,
    truth: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
    deviations: Vec<f64>,
    order: Vec<usize>,
}

impl<const D: usize> Scene<D> {
    /// `n` points bent. The deviations of the targets, in spacings, are drawn from `choices`.
    fn new(n: usize, choices: &[f64], seed: u64) -> Self {
        let mut stream = Stream::new(seed + 500);
        let model = scattered::<D>(n, seed);
        let truth = bend(&model, 0.06);
        let order = stream.permutation(n);
        let spacing = (n as f64).powf(-1.0 / D as f64);
        let deviations: Vec<f64> = (0..n)
            .map(|_| choices[(stream.next() * choices.len() as f64) as usize] * spacing)
            .collect();
        let target = reordered(&truth, &order)
            .iter()
            .zip(&deviations)
            .map(|(p, s)| p + SVector::from_fn(|_, _| s * deviate(&mut stream)))
            .collect();
        Self {
            model,
            truth,
            target,
            deviations,
            order,
        }
    }

    fn weighted(&self) -> Matching<D> {
        AnnealedSoftassign::default()
            .match_with_target_errors(&self.model, &self.target, &self.deviations)
            .expect("good points and deviations")
    }

    fn plain(&self) -> Matching<D> {
        AnnealedSoftassign::default()
            .match_points(&self.model, &self.target)
            .expect("good points")
    }

    /// Root mean square distance of the warped points from the truth.
    fn error(&self, found: &Matching<D>) -> f64 {
        let pairs = found.warped.iter().zip(&self.truth);
        let squares: f64 = pairs.map(|(w, t)| (w - t).norm_squared()).sum();
        (squares / self.model.len() as f64).sqrt()
    }

    fn right(&self, found: &Matching<D>) -> usize {
        let rows = found.assignment.iter().enumerate();
        rows.filter(|&(i, partner)| partner.is_some_and(|j| self.order[j] == i))
            .count()
    }
}

/// Equal errors say nothing that the residuals do not.
fn check_equal<const D: usize>(choices: &[f64]) {
    let scene = Scene::<D>::new(60, choices, 3);
    let equal = vec![0.37; scene.target.len()];
    let weighted = AnnealedSoftassign::default()
        .match_with_target_errors(&scene.model, &scene.target, &equal)
        .expect("good points");
    let plain = scene.plain();
    assert_eq!(weighted.warped, plain.warped);
    assert_eq!(weighted.assignment, plain.assignment);
    assert_eq!(weighted.confidence, plain.confidence);
    assert_eq!(
        weighted.displacement_covariance,
        plain.displacement_covariance
    );
    assert_eq!(weighted.report, plain.report);
}

#[test]
fn equal_errors_give_the_answer_of_the_common_noise_to_the_bit() {
    for choices in [[0.0].as_slice(), &[0.2], &[0.02, 0.3]] {
        check_equal::<2>(choices);
        check_equal::<3>(choices);
    }
}

/// Half of the targets have some seven times the error of the others, too little for equal weights
/// to take them for outliers: known errors leave at most half the error of the field.
fn check_halved<const D: usize>() {
    let (mut weighted, mut plain) = (0.0, 0.0);
    let (mut right, mut right_plain) = (0, 0);
    for seed in 0..8 {
        let scene = Scene::<D>::new(120, &[0.02, 0.15], seed);
        let (with, without) = (scene.weighted(), scene.plain());
        weighted += scene.error(&with);
        plain += scene.error(&without);
        right += scene.right(&with);
        right_plain += scene.right(&without);
    }
    // Sixty precise points alone would leave a quarter, but for the field's finest modes.
    assert!(
        weighted < 0.5 * plain,
        "{D}-D: {weighted} with errors, {plain} without"
    );
    assert!(
        right >= right_plain,
        "{D}-D: {right} with errors, {right_plain} without"
    );
}

#[test]
fn known_errors_halve_the_error_of_the_field() {
    check_halved::<2>();
    check_halved::<3>();
}

/// Share of the coordinates within one posterior standard deviation of the truth.
fn coverage<const D: usize>(choices: &[f64]) -> f64 {
    let (mut within, mut all) = (0, 0);
    for seed in 20..60 {
        let scene = Scene::<D>::new(105, choices, seed);
        let found = scene.weighted();
        for ((w, t), covariance) in found
            .warped
            .iter()
            .zip(&scene.truth)
            .zip(&found.displacement_covariance)
        {
            for k in 0..D {
                within += u32::from((w[k] - t[k]).abs() < covariance[(k, k)].sqrt());
                all += 1;
            }
        }
    }
    f64::from(within) / f64::from(all)
}

/// Forty fields of some fifteen modes an axis: the share varies by 0.01 to 0.015 about the 0.68 of
/// a normal distribution.
#[test]
fn standard_deviations_hold_where_errors_differ() {
    for choices in [[0.03, 0.3].as_slice(), &[0.05, 0.1, 0.2]] {
        let shares = [coverage::<2>(choices), coverage::<3>(choices)];
        for share in shares {
            assert!((share - 0.683).abs() < 0.04, "{choices:?}: {shares:?}");
        }
    }
}

/// A rigid motion follows the precise points.
#[test]
fn a_rigid_fit_counts_precise_targets_more() {
    let options = AnnealedSoftassign::default().with_transformation(Transformation::Rigid);
    let matcher = options;
    let (mut weighted, mut plain) = (0.0, 0.0);
    for seed in 0..8 {
        let bent = Scene::<2>::new(60, &[0.03, 0.15], seed);
        // The truth is the model itself here: what the bending added is taken away again.
        let moved = bent.target.iter().zip(&bent.order);
        let target = moved
            .map(|(t, &i)| bent.model[i] + (t - bent.truth[i]))
            .collect();
        let scene = Scene {
            truth: bent.model.clone(),
            target,
            ..bent
        };
        let found = |with: bool| {
            let (model, target) = (&scene.model, &scene.target);
            if with {
                matcher.match_with_target_errors(model, target, &scene.deviations)
            } else {
                matcher.match_points(model, target)
            }
        };
        weighted += scene.error(&found(true).expect("good points"));
        plain += scene.error(&found(false).expect("good points"));
    }
    // Three parameters from thirty points of 0.03 spacings instead of sixty of 0.11 in the root
    // mean square: two fifths.
    assert!(
        weighted < 0.6 * plain,
        "{weighted} with errors, {plain} without"
    );
}

/// Large sets, which are matched coarse to fine, count errors too.
#[test]
fn large_sets_count_errors() {
    let scene = Scene::<2>::new(4200, &[0.01, 0.08], 1);
    let (with, without) = (scene.weighted(), scene.plain());
    assert!(scene.right(&with) > scene.right(&without));
    // Half of the points with an eighth of the error.
    assert!(
        scene.error(&with) < 0.5 * scene.error(&without),
        "{} with errors, {} without",
        scene.error(&with),
        scene.error(&without)
    );
}

#[test]
fn deviations_out_of_range_are_typed_errors() {
    let scene = Scene::<2>::new(12, &[0.1], 1);
    let found = |deviations: &[f64]| {
        AnnealedSoftassign::default()
            .match_with_target_errors(&scene.model, &scene.target, deviations)
            .err()
    };
    let expected = MatchError::Shape {
        what: "deviations of the targets",
        expected: 12,
        found: 11,
    };
    assert_eq!(found(&[0.1; 11]), Some(expected));
    for value in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let mut deviations = [0.1; 12];
        deviations[7] = value;
        assert!(
            matches!(
                found(&deviations),
                Some(MatchError::TargetDeviation { row: 7, .. })
            ),
            "{value}"
        );
    }
}
