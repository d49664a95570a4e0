//! Rigid and similarity modes of the default matcher.

use crate::common::{Scene, Stream, rotation, scattered};
use nalgebra::{Point, SVector};
use tactile_match::{AnnealedSoftassign, Matching, PointMatcher, Transformation};

const POINTS: usize = 80;
const TURN: f64 = 0.4;
const SCALE: f64 = 1.3;

/// A model and its rotated and shifted image (scaled for a similarity), which is shuffled, with
/// noise and outliers.
fn scene<const D: usize>(
    transformation: Transformation,
    noise: f64,
    outliers: usize,
    seed: u64,
) -> Scene<D> {
    let mut stream = Stream::new(seed);
    let model = scattered::<D>(POINTS, 41);
    let scale = match transformation {
        Transformation::Similarity => SCALE,
        _ => 1.0,
    };
    let linear = rotation::<D>(TURN) * scale;
    let shift = SVector::repeat(3.0);
    let moved = |p: &Point<f64, D>| Point::from(linear * p.coords + shift);
    let truth = model.iter().map(moved).collect();
    let order = stream.permutation(POINTS);
    let mut scene = Scene::new(model, truth, order, |_| noise, outliers, &mut stream);
    scene.target[POINTS..].iter_mut().for_each(|p| *p += shift);
    scene
}

fn matched<const D: usize>(scene: &Scene<D>, transformation: Transformation) -> Matching<D> {
    let options = AnnealedSoftassign::default().with_transformation(transformation);
    options
        .match_points(&scene.model, &scene.target)
        .expect("good points")
}

fn check_motion<const D: usize>(
    transformation: Transformation,
    determinant: f64,
    scenes: &[(f64, usize)],
) {
    for &(noise, outliers) in scenes {
        let scene = scene::<D>(transformation, noise, outliers, 42);
        let found = matched(&scene, transformation);
        let right = scene.right(&found.assignment);
        let case = format!("{D}-D, {transformation:?}, noise {noise}, {outliers} outliers");
        assert!(right as f64 > 0.95 * POINTS as f64, "{case}");
        // The thin-plate spline through rigidly displaced points is that displacement, within the
        // rounding of its system.
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
fn motions_are_recovered() {
    let scenes = [(0.0, 0), (0.01, 0), (0.01, 12)];
    check_motion::<2>(Transformation::Rigid, 1.0, &scenes);
    check_motion::<3>(Transformation::Rigid, 1.0, &scenes);
    check_motion::<2>(Transformation::Similarity, SCALE.powi(2), &scenes);
    check_motion::<3>(Transformation::Similarity, SCALE.powi(3), &scenes);
}

/// Over many draws of the noise, the squared errors agree with the covariances.
fn check_variances<const D: usize>(transformation: Transformation) {
    let (mut squares, mut variances) = (0.0, 0.0);
    for seed in 0..40 {
        let scene = scene::<D>(transformation, 0.01, 0, 100 + seed);
        let found = matched(&scene, transformation);
        for i in 0..POINTS {
            squares += (found.warped[i] - scene.truth[i]).norm_squared();
            variances += found.displacement_covariance[i].trace();
        }
    }
    let ratio = squares / variances;
    // Forty scenes of three to seven parameters: their mean square varies by an eighth, and the
    // estimated noise adds to it.
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

/// Displacements that are not rigid remain in the residuals. The shape does not change.
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
