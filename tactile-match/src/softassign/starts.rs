//! The starts of the runs, in their order, with their schedules. The starts from moments are maps
//! of their own; the others are in files of their own.

use super::problem::Problem;
use super::run::Cooling;
use super::{Mechanism, Rotation, mean};
use nalgebra::{Matrix3, SMatrix, SVector, SymmetricEigen};

/// Cooling of the first run. Its temperature falls independently of the residuals.
pub(super) const FAST: Cooling = Cooling {
    sigma: 0.3,
    rate: 0.75,
    least: 0.9,
    patience: usize::MAX,
    stuck: usize::MAX,
    sweeps: 3,
    still: 1e-4,
    open: false,
};
/// Cooling of further runs, which follow the residuals. They end when the temperature has not
/// fallen for `patience` iterations: matches that are still unsettled can drift for hundreds of
/// iterations.
pub(super) const SLOW: Cooling = Cooling {
    rate: 0.93,
    least: 1.0,
    patience: 20,
    stuck: 8,
    sweeps: 5,
    // A tenth of this changes no mean of the ablation study and takes a fifth more time under
    // noise.
    still: 1e-3,
    ..FAST
};
/// Cooling if a few points have lost their partners below the noise.
pub(super) const OPEN: Cooling = Cooling {
    rate: FAST.rate,
    open: true,
    ..SLOW
};
/// Cooling from the best answer so far.
pub(super) const REHEAT: Cooling = Cooling {
    sigma: 0.1,
    rate: 0.9,
    ..SLOW
};
/// Cooling from the motions of blocks. The temperature is their error, in mean spacings.
pub(super) const MOVED: Cooling = Cooling {
    sigma: 0.4,
    rate: FAST.rate,
    sweeps: FAST.sweeps,
    ..SLOW
};
/// Cooling after relaxation labelling, whose pairs are more reliable than a first guess.
pub(super) const LABELLED: Cooling = Cooling {
    sigma: 0.15,
    ..SLOW
};
/// Cooling of the only run between sets that are near each other.
pub(super) const NEAR: Cooling = Cooling {
    sigma: 0.2,
    rate: 0.8,
    least: 1.0,
    patience: 12,
    stuck: 12,
    ..FAST
};

/// Cooling from the patterns or tuples of points. A higher temperature would contract a cropped set
/// at its edges.
fn seeded(spacing: f64) -> Cooling {
    Cooling {
        sigma: 0.3 * spacing,
        ..REHEAT
    }
}

/// Start of a run.
#[derive(Clone, Copy, Debug)]
pub(super) enum Start<const D: usize> {
    /// The centroids are aligned.
    Centred,
    /// The best answer so far.
    Best,
    /// The best answer so far, corrected by the local patterns of a dense set.
    Patterns,
    /// The pairs of relaxation labelling.
    Labelling,
    /// The unmoved sets, corrected by the motions of blocks.
    Moved,
    /// The second moments are aligned, after a rotation.
    Moments(SMatrix<f64, D, D>),
    /// The affine map on which local tuples of points agree.
    Tuples,
}

/// The starts after the first, with their schedules, from the cheapest to the most expensive.
pub(super) fn further_starts<const D: usize>(
    problem: &Problem<D>,
) -> impl Iterator<Item = (Start<D>, Cooling)> + use<D> {
    let (options, dense) = (problem.options, problem.is_dense());
    let limited = options.rotation == Rotation::Limited;
    let seeded = seeded(problem.spacing);
    let when = |wanted: bool, mechanism, start, cooling| {
        (wanted && options.has(mechanism)).then_some((start, cooling))
    };
    // Repeats from the improved field as long as more points are matched.
    let patterns = when(dense, Mechanism::Patterns, Start::Patterns, seeded);
    let first = [
        when(!dense, Mechanism::Motions, Start::Moved, MOVED),
        when(dense, Mechanism::Tuples, Start::Tuples, seeded),
        when(true, Mechanism::Reheat, Start::Best, REHEAT),
        when(true, Mechanism::Slow, Start::Centred, SLOW),
        when(!dense, Mechanism::Tuples, Start::Tuples, seeded),
        when(limited, Mechanism::Labelling, Start::Labelling, LABELLED),
    ];
    let rotations = rotations::<D>(options.rotation)
        .filter(move |_| options.has(Mechanism::Moments))
        .map(|rotation| (Start::Moments(rotation), SLOW));
    let last = when(true, Mechanism::LastReheat, Start::Best, REHEAT);
    let first = [patterns; 6].into_iter().chain(first).flatten();
    first.chain(rotations).chain(last)
}

/// The model mapped so that its centroid and covariance equal those of the target, with `rotation`
/// applied before the stretch.
///
/// `A = S C^½ R C^−½`, where S is the symmetric map that takes the model's covariance C to the
/// target's. For R = 1 this is the affine map without rotation.
pub(super) fn moments<const D: usize>(
    model: &[[f64; D]],
    target: &[[f64; D]],
    rotation: &SMatrix<f64, D, D>,
    base: &mut Vec<[f64; D]>,
) {
    let (from, to) = (mean(model), mean(target));
    let [root, inverse, _] = roots(&covariance(model, &from));
    let spread = covariance(target, &to);
    let [middle, ..] = roots(&(root * spread * root));
    let [.., span] = roots(&spread);
    let map = span * inverse * middle * inverse * root * rotation * inverse;
    base.clear();
    base.extend(model.iter().map(|x| {
        let image = map * SVector::from_fn(|k, _| x[k] - from[k]);
        std::array::from_fn(|k| image[k] + to[k])
    }));
}

fn covariance<const D: usize>(points: &[[f64; D]], centre: &[f64; D]) -> SMatrix<f64, D, D> {
    let mut sum = SMatrix::zeros();
    for p in points {
        let d = SVector::<f64, D>::from_fn(|k, _| p[k] - centre[k]);
        sum += d * d.transpose();
    }
    sum / points.len() as f64
}

/// Square root and inverse square root of a covariance, and the projection onto the directions with
/// extent. Directions without extent get a thousandth of the largest.
fn roots<const D: usize>(matrix: &SMatrix<f64, D, D>) -> [SMatrix<f64, D, D>; 3] {
    // Up to three dimensions, padded with zeros to avoid allocation.
    let entry = |r: usize, c: usize| if r < D && c < D { matrix[(r, c)] } else { 0.0 };
    let eigen = SymmetricEigen::new(Matrix3::from_fn(entry));
    let floor = (1e-6 * eigen.eigenvalues.max()).max(f64::MIN_POSITIVE);
    let function = |f: &dyn Fn(f64) -> f64| {
        SMatrix::from_fn(|r, c| {
            let v = &eigen.eigenvectors;
            (0..3)
                .map(|k| v[(r, k)] * f(eigen.eigenvalues[k]) * v[(c, k)])
                .sum()
        })
    };
    [
        function(&|value| value.max(floor).sqrt()),
        function(&|value| value.max(floor).sqrt().recip()),
        function(&|value| if value < floor { 0.0 } else { 1.0 }),
    ]
}

/// Rotations to try. Limited: the identity and ±30° in the plane. Any: multiples of 30° in the
/// plane, the 24 rotations of the cube in space.
pub(super) fn rotations<const D: usize>(
    range: Rotation,
) -> impl Iterator<Item = SMatrix<f64, D, D>> {
    let any = range == Rotation::Any;
    let plane = if any { 12 } else { 3 };
    let space = if any { 24 } else { 1 };
    let count = match D {
        2 => plane,
        3 => space,
        _ => 1,
    };
    (0..count).map(move |k: usize| match D {
        // 0°, 30°, −30°, 60° and so on, smallest first.
        2 => {
            let angle = 30.0 * k.div_ceil(2) as f64;
            let forth = (k % 2 == 1) == any;
            turn(0, 1, if forth { angle } else { -angle }.to_radians())
        }
        3 => cube(k),
        _ => SMatrix::identity(),
    })
}

fn turn<const D: usize>(a: usize, b: usize, angle: f64) -> SMatrix<f64, D, D> {
    let mut r = SMatrix::identity();
    (r[(a, a)], r[(a, b)], r[(b, a)], r[(b, b)]) =
        (angle.cos(), -angle.sin(), angle.sin(), angle.cos());
    r
}

/// Rotation `k` of the 24 that map a cube onto itself, the identity first.
fn cube<const D: usize>(k: usize) -> SMatrix<f64, D, D> {
    let quarter = std::f64::consts::FRAC_PI_2;
    let face = k / 4;
    let up = if face < 4 {
        turn(0, 2, face as f64 * quarter)
    } else {
        turn(1, 2, (2.0 * face as f64 - 9.0) * quarter)
    };
    up * turn::<D>(0, 1, (k % 4) as f64 * quarter)
}
