//! Results for clean and noisy warps and outliers.
use crate::common::{self, Scene};
use nalgebra::{Point2, Point3};
use tactile_match::{AnnealedSoftassign, Outliers, PointMatcher, StopReason};

fn all_right<const D: usize>(n: usize) {
    let scene = Scene::<D>::bent(n, 0.06, 21);
    let found = AnnealedSoftassign::default()
        .match_points(&scene.model, &scene.target)
        .unwrap();
    assert_eq!(scene.right(&found.assignment), n);
    assert_eq!(found.report.stop, StopReason::Exact);
    for (i, (p, truth)) in scene.model.iter().zip(&scene.truth).enumerate() {
        // Interpolation of clean pairs: only the rounding of the solution of the spline.
        assert!((found.warp.apply(p) - truth).norm() < 1e-9);
        assert!((found.warped[i] - truth).norm() < 1e-12 && found.confidence[i] > 0.9);
    }
    assert!(found.unmatched_model.is_empty() && found.unmatched_target.is_empty());
    // Exact means that the returned points coincide with their partners.
    assert!(found.report.residual < 1e-12);
}

#[test]
fn clean_warps_of_plane_and_space_are_found_exactly() {
    all_right::<2>(52);
    all_right::<3>(61);
    all_right::<2>(502);
}

/// If the noise is well below the spacing, the first run ends at the noise. At lower temperatures
/// points would lose their partners, and a second start would have to find them again.
#[test]
fn noise_below_the_spacing_rarely_takes_a_third_start() {
    /// A tenth of the spacing, (1/105)^⅓ of the side of the cube, in both directions.
    const NOISE: f64 = 0.02;
    let mut of_few_starts = 0;
    for seed in 0..8 {
        let mut stream = common::Stream::new(seed);
        let model = common::scattered::<3>(105, seed);
        let truth = common::bend(&model, 0.06);
        let order = stream.permutation(105);
        let mut noisy = |p: &Point3<f64>| p.map(|x| x + NOISE * (2.0 * stream.next() - 1.0));
        let target: Vec<_> = common::reordered(&truth, &order)
            .iter()
            .map(&mut noisy)
            .collect();
        let found = AnnealedSoftassign::default()
            .match_points(&model, &target)
            .unwrap();
        of_few_starts += usize::from(found.report.starts <= 2);
        let right = (order.iter().enumerate())
            .filter(|&(j, &i)| found.assignment[i] == Some(j))
            .count();
        assert!(right >= 104, "{seed}: {right}");
        // The field is smooth: its points are closer to the true positions than the noise with its
        // standard deviation NOISE/√3 per axis.
        let squares = (found.warped.iter().zip(&truth)).map(|(w, t)| (w - t).norm_squared());
        let error = (squares.sum::<f64>() / 105.0).sqrt();
        assert!(error < 0.8 * NOISE, "{seed}: {error}");
    }
    // The first start follows the sets at their positions. If a point of the eight sets is too far
    // away to be matched, a third start searches for it. Without a sign of noise all sets use it.
    assert!(of_few_starts >= 4, "{of_few_starts}");
}

/// If no outliers are expected, every point gets a partner. Otherwise a distant point has none.
#[test]
fn the_outliers_option_says_which_side_may_stay_alone() {
    let mut scene = Scene::<2>::bent(31, 0.06, 22);
    scene.target.push(Point2::new(2.5, 2.5));
    let (model, target) = (&scene.model, &scene.target);
    for side in [Outliers::Both, Outliers::Target] {
        let options = AnnealedSoftassign::default().with_outliers(side);
        let found = options.match_points(model, target).unwrap();
        assert_eq!(scene.right(&found.assignment), 31);
        assert_eq!(found.unmatched_target, [31]);
        // The sides are exchanged: now a model point has no partner.
        let other = if side == Outliers::Target {
            Outliers::Model
        } else {
            side
        };
        let options = AnnealedSoftassign::default().with_outliers(other);
        let found = options.match_points(target, model).unwrap();
        assert_eq!(
            (found.unmatched_model, found.unmatched_target),
            (vec![31], vec![])
        );
    }
}
