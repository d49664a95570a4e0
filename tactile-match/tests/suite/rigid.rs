//! Rigid and similarity modes of the default matcher.

use crate::common::{Stream, reordered, rotation, scattered};
use nalgebra::{Point, SVector};
use tactile_match::{AnnealedSoftassign, Matching, PointMatcher, Transformation};

const POINTS: usize = 80;
const TURN: f64 = 0.4;
const SCALE: f64 = 1.3;

/// A model, its turned and shifted (and for a similarity enlarged) image, and that image shuffled,
/// with noise and outliers.
struct Scene<const D: usize> {
    model: Vec<Point<f64, D>>,
    truth: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
    order: Vec<usize>,
    transformation: Transformation,
}

impl<const D: usize> Scene<D> {
    fn new(transformation: Transformation, noise: f64, outliers: usize, seed: u64) -> Self {
        let mut stream = Stream::new(seed);
        let model = scattered::<D>(POINTS, 41);
        let scale = match transformation {
            Transformation::Similarity => SCALE,
            _ => 1.0,
        };
        let linear = rotation::<D>(TURN) * scale;
        let truth: Vec<_> = model
            .iter()
            .map(|p| Point::from(linear * p.coords + SVector::repeat(3.0)))
            .collect();
        let order = stream.permutation(POINTS);
        let mut deviate = || (0..12).map(|_| stream.next()).sum::<f64>() - 6.0;
        let mut target: Vec<_> = reordered(&truth, &order)
            .iter()
            .map(|p| p + SVector::from_fn(|_, _| noise * deviate()))
            .collect();
        let clutter =
            (0..outliers).map(|_| Point::from(SVector::from_fn(|_, _| 3.0 + stream.next())));
        target.extend(clutter);
        Self {
            model,
            truth,
            target,
            order,
            transformation,
        }
    }

    fn matched(&self) -> Matching<D> {
        let options = AnnealedSoftassign::default().with_transformation(self.transformation);
        options
            .match_points(&self.model, &self.target)
            .expect("good points")
    }
}

fn check_motion<const D: usize>(
    transformation: Transformation,
    determinant: f64,
    scenes: &[(f64, usize)],
) {
    for &(noise, outliers) in scenes {
        let scene = Scene::<D>::new(transformation, noise, outliers, 42);
        let found = scene.matched();
        let own = |i: usize, j: usize| scene.order.get(j) == Some(&i);
        let right = (0..POINTS).filter(|&i| found.assignment[i].is_some_and(|j| own(i, j)));
        let case = format!("{D}-D, {transformation:?}, noise {noise}, {outliers} outliers");
        assert!(right.count() as f64 > 0.95 * POINTS as f64, "{case}");
        // The thin-plate spline through points that moved so is that motion, to the rounding of its
        // system.
        let jacobian = found.warp.jacobian(&scene.model[0]);
        let size = (jacobian.transpose() * jacobian)[(0, 0)].sqrt();
        let shape = jacobian.transpose() * jacobian / (size * size);
        assert!(
            (shape - nalgebra::SMatrix::identity()).amax() < 1e-6,
            "{case}: {jacobian}"
        );
        // A relative noise of 1 % over eighty points: the size is known to 0.3 %, or exactly.
        let allowed = if noise > 0.0 { 0.02 } else { 1e-6 };
        assert!(
            (size.powi(D as i32) - determinant).abs() < allowed * determinant,
            "{case}: {size}"
        );
        for (w, t) in found.warped.iter().zip(&scene.truth) {
            // Three parameters or more from eighty points: a fifth of the noise, and rarely four
            // times that.
            assert!((w - t).norm() < 0.8 * noise + 1e-6, "{case}: {w} {t}");
        }
    }
}

#[test]
fn rigid_motions_are_recovered() {
    let scenes = [(0.0, 0), (0.01, 0), (0.01, 12)];
    check_motion::<2>(Transformation::Rigid, 1.0, &scenes);
    check_motion::<3>(Transformation::Rigid, 1.0, &scenes);
}

#[test]
fn similarities_are_recovered() {
    let scenes = [(0.0, 0), (0.01, 0), (0.01, 12)];
    check_motion::<2>(Transformation::Similarity, SCALE.powi(2), &scenes);
    check_motion::<3>(Transformation::Similarity, SCALE.powi(3), &scenes);
}

/// Over many noises the squared errors are what the covariances say.
fn check_variances<const D: usize>(transformation: Transformation) {
    let (mut squares, mut variances) = (0.0, 0.0);
    for seed in 0..40 {
        let scene = Scene::<D>::new(transformation, 0.01, 0, 100 + seed);
        let found = scene.matched();
        for i in 0..POINTS {
            squares += (found.warped[i] - scene.truth[i]).norm_squared();
            variances += found.displacement_covariance[i].trace();
        }
    }
    let ratio = squares / variances;
    // Forty scenes of three to seven parameters: their mean square varies by an eighth; the noise
    // that is estimated adds to it.
    assert!(
        (0.65..1.5).contains(&ratio),
        "{D}-D, {transformation:?}: {ratio}"
    );
}

#[test]
fn covariances_are_those_of_the_motion() {
    check_variances::<2>(Transformation::Rigid);
    check_variances::<3>(Transformation::Rigid);
    check_variances::<2>(Transformation::Similarity);
    check_variances::<3>(Transformation::Similarity);
}

/// What no rigid motion explains stays in the residuals. The shape does not change.
#[test]
fn shapes_are_kept() {
    let model = scattered::<2>(POINTS, 43);
    let target: Vec<_> = model
        .iter()
        .map(|p| Point::from([1.05 * p.x, p.y]))
        .collect();
    let options = AnnealedSoftassign::default().with_transformation(Transformation::Rigid);
    let found = options.match_points(&model, &target).expect("good points");
    for i in 1..POINTS {
        let (before, after) = (model[i] - model[0], found.warped[i] - found.warped[0]);
        // Rounding.
        assert!((before.norm() - after.norm()).abs() < 1e-12);
    }
    assert!(found.report.residual > 0.005, "{:?}", found.report);
}

#[test]
fn few_and_coincident_points_are_answered() {
    for points in [
        vec![Point::from([1.0, 2.0]); 3],
        vec![Point::from([0.0, 0.0])],
    ] {
        for transformation in [Transformation::Rigid, Transformation::Similarity] {
            let options = AnnealedSoftassign::default().with_transformation(transformation);
            let found = options.match_points(&points, &points).expect("good points");
            assert!(found.warped.iter().all(|p| p.coords.norm() < 10.0));
        }
    }
}
