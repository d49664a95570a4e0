//! All matchers, and requirements for the results of each.

use nalgebra::Point;
use tactile_match::labelling::Neighbourhood;
use tactile_match::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, Matching, NearestNeighbour,
    PointMatcher, RelaxationLabelling, Rotation, Transformation,
};

pub(crate) type Matchers<const D: usize> = Vec<(&'static str, Box<dyn PointMatcher<D>>)>;

/// The matchers used by every test file. A new one is added only here.
pub(crate) fn matchers<const D: usize>() -> Matchers<D> {
    // Eight neighbours instead of half of all points, to save time: the checks do not depend on it.
    let options = RelaxationLabelling::default().with_neighbourhood(Neighbourhood::Nearest(8));
    let dense = options.expect("neighbours");
    vec![
        ("relaxation", Box::new(AnnealedSoftassign::default())),
        ("dense relaxation", Box::new(dense)),
        (
            "sparse relaxation",
            Box::new(
                RelaxationLabelling::default()
                    .with_candidates(10)
                    .expect("candidates"),
            ),
        ),
        ("nearest neighbour", Box::new(NearestNeighbour::default())),
        ("linear assignment", Box::new(LinearAssignment::default())),
        (
            "coherent point drift",
            Box::new(CoherentPointDrift::default()),
        ),
    ]
}

/// The modes of the default matcher with a different search.
pub(crate) fn modes<const D: usize>() -> Matchers<D> {
    let options = AnnealedSoftassign::default();
    let moves = |transformation| Box::new(options.with_transformation(transformation));
    vec![
        (
            "any rotation",
            Box::new(options.with_rotation(Rotation::Any)),
        ),
        ("rigid", moves(Transformation::Rigid)),
        ("similarity", moves(Transformation::Similarity)),
    ]
}

/// Requirements for every [`Matching`], whatever its origin.
pub(crate) fn assert_consistent<const D: usize>(
    name: &str,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    matching: &Matching<D>,
) {
    let (rows, columns) = (model.len(), target.len());
    let lengths = [
        matching.warped.len(),
        matching.assignment.len(),
        matching.confidence.len(),
        matching.soft.rows(),
    ];
    assert_eq!(lengths, [rows; 4], "{name}: one entry per model point");
    assert_eq!(
        matching.displacement_covariance.len(),
        rows,
        "{name}: one covariance per model point"
    );
    assert_partition(name, columns, matching);
    let probability = |p: f64| (0.0..=1.0 + (1e-5)).contains(&p);
    assert!(
        matching.confidence.iter().all(|&p| probability(p)),
        "{name}: confidence {:?}",
        matching.confidence
    );
    for i in 0..rows {
        let sum = matching.soft.row(i).fold(0.0, |sum, (j, p)| {
            assert!(
                j < columns && probability(p),
                "{name}: soft match ({i}, {j}) = {p}"
            );
            sum + p
        });
        assert!(probability(sum), "{name}: soft row {i} sums to {sum}");
    }
    let finite = |p: &Point<f64, D>| p.iter().all(|c| c.is_finite());
    assert!(
        matching.warped.iter().all(finite),
        "{name}: warped points {:?}",
        matching.warped
    );
    for (i, (point, warped)) in model.iter().zip(&matching.warped).enumerate() {
        // Rounding of the sum of a spline, whose terms may exceed the size of the set by some
        // orders of magnitude.
        let size = target
            .iter()
            .chain(&matching.warped)
            .chain([point])
            .fold(0.0_f64, |m, p| m.max(p.coords.amax()));
        let step = (matching.warp.apply(point) - warped).norm();
        let tolerance: f64 = 1e10 * (0.5 * f64::EPSILON);
        assert!(
            step <= tolerance.min(1e-3) * size,
            "{name}: the warp takes point {i} {step} astray"
        );
    }
    for covariance in &matching.displacement_covariance {
        assert!(
            covariance.iter().all(|c| c.is_finite()),
            "{name}: covariance {covariance}"
        );
        assert!(
            (0..D).all(|d| covariance[(d, d)] >= 0.0),
            "{name}: covariance {covariance}"
        );
    }
    assert!(
        matching.energy.iter().all(|e| e.is_finite()),
        "{name}: energy {:?}",
        matching.energy
    );
    let report = &matching.report;
    assert!(
        report.residual.is_finite() && report.sigma.is_finite(),
        "{name}: {report:?}"
    );
}

/// No target occurs twice, and matched and unmatched rows together are all rows.
fn assert_partition<const D: usize>(name: &str, columns: usize, matching: &Matching<D>) {
    let mut seen = vec![false; columns];
    for &j in matching
        .assignment
        .iter()
        .flatten()
        .chain(&matching.unmatched_target)
    {
        assert!(
            !std::mem::replace(&mut seen[j], true),
            "{name}: target {j} twice"
        );
    }
    assert!(
        seen.iter().all(|s| *s),
        "{name}: a target is neither matched nor unmatched"
    );
    let unmatched: Vec<usize> = (0..matching.assignment.len())
        .filter(|&i| matching.assignment[i].is_none())
        .collect();
    assert_eq!(
        unmatched, matching.unmatched_model,
        "{name}: unmatched model rows"
    );
}
