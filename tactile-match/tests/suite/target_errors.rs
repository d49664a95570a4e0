//! Targets that were measured with different precision.

use crate::common::{Scene, Stream, bend, scattered};
use tactile_match::{AnnealedSoftassign, MatchError, Matching, PointMatcher, Transformation};

/// Points bent, and targets with noise of known standard deviations.
struct Measured<const D: usize> {
    scene: Scene<D>,
    deviations: Vec<f64>,
}

impl<const D: usize> Measured<D> {
    /// `n` points. The deviations of the targets, in spacings, are drawn from `choices`.
    fn new(n: usize, choices: &[f64], seed: u64) -> Self {
        let mut stream = Stream::new(seed + 500);
        let model = scattered::<D>(n, seed);
        let (truth, order) = (bend(&model, 0.06), stream.permutation(n));
        let spacing = (n as f64).powf(-1.0 / D as f64);
        let deviations: Vec<f64> = (0..n)
            .map(|_| choices[(stream.next() * choices.len() as f64) as usize] * spacing)
            .collect();
        let scene = Scene::new(model, truth, order, |j| deviations[j], 0, &mut stream);
        Self { scene, deviations }
    }

    /// With the deviations, and without.
    fn matched(&self, matcher: AnnealedSoftassign) -> [Matching<D>; 2] {
        let Scene { model, target, .. } = &self.scene;
        [
            matcher.match_with_target_errors(model, target, &self.deviations),
            matcher.match_points(model, target),
        ]
        .map(|found| found.expect("good points and deviations"))
    }
}

/// Equal errors say nothing that the residuals do not.
fn check_equal<const D: usize>(choices: &[f64]) {
    let mut measured = Measured::<D>::new(60, choices, 3);
    measured.deviations.fill(0.37);
    let [weighted, plain] = measured.matched(AnnealedSoftassign::default());
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
        let measured = Measured::<D>::new(120, &[0.02, 0.15], seed);
        let [with, without] = measured.matched(AnnealedSoftassign::default());
        weighted += measured.scene.error(&with.warped);
        plain += measured.scene.error(&without.warped);
        right += measured.scene.right(&with.assignment);
        right_plain += measured.scene.right(&without.assignment);
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
        let Measured { scene, deviations } = Measured::<D>::new(105, choices, seed);
        let found = AnnealedSoftassign::default()
            .match_with_target_errors(&scene.model, &scene.target, &deviations)
            .expect("good points and deviations");
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
    let matcher = AnnealedSoftassign::default().with_transformation(Transformation::Rigid);
    let (mut weighted, mut plain) = (0.0, 0.0);
    for seed in 0..8 {
        let mut measured = Measured::<2>::new(60, &[0.03, 0.15], seed);
        // The truth is the model itself here: what the bending added is taken away again.
        let scene = &mut measured.scene;
        for (t, &i) in scene.target.iter_mut().zip(&scene.order) {
            *t = scene.model[i] + (*t - scene.truth[i]);
        }
        scene.truth.clone_from(&scene.model);
        let [with, without] = measured.matched(matcher);
        weighted += measured.scene.error(&with.warped);
        plain += measured.scene.error(&without.warped);
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
    let measured = Measured::<2>::new(4200, &[0.01, 0.08], 1);
    let found = measured.matched(AnnealedSoftassign::default());
    let [right, right_plain] = found
        .each_ref()
        .map(|m| measured.scene.right(&m.assignment));
    assert!(right > right_plain);
    // Half of the points with an eighth of the error.
    let [error, plain] = found.map(|m| measured.scene.error(&m.warped));
    assert!(error < 0.5 * plain, "{error} with errors, {plain} without");
}

#[test]
fn deviations_out_of_range_are_typed_errors() {
    let Measured { scene, .. } = Measured::<2>::new(12, &[0.1], 1);
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
