//! Coherent point drift: rigid, similarity, affine and non-rigid registration by maximum likelihood.
//!
//! The model points `y_m` (`M` of them) are the centres of a Gaussian mixture of one variance `σ²`, with a uniform component of
//! weight `w` for outliers; the target points `x_n` (`N`) are its sample. Expectation maximisation alternates (Myronenko & Song,
//! Point set registration: coherent point drift, IEEE PAMI 32, 2262–2275, 2010):
//!
//! ```text
//! P_mn = exp(−|x_n − T(y_m)|²/2σ²) / (Σ_k exp(−|x_n − T(y_k)|²/2σ²) + (2πσ²)^{D/2} w M / ((1−w) N))
//! T    = the rigid, similarity, affine or non-rigid motion that minimises Σ P_mn |x_n − T(y_m)|² / 2σ² (+ ½ λ |T|²)
//! σ²   = Σ P_mn |x_n − T(y_m)|² / (D Σ P_mn)
//! ```
//!
//! Non-rigid motion is `T(y) = y + Σ_k w_k exp(−|y − y_k|²/2β²)`, neighbours moving coherently. All parameters refer to sets of root mean
//! square radius one ([`Normalization`]): the same settings mean the same in every unit. Two things differ from the usual
//! programs, neither in the answer: `P` is never stored while iterating, and the Gaussian kernel is factorised once, to the rank it
//! numerically has, instead of solving an `M × M` system in every iteration.

mod exp;
mod expectation;
mod global;
mod kernel;
mod non_rigid;
mod options;
mod outcome;
mod registration;
mod warp;

pub use options::CoherentPointDrift;
pub use registration::DriftWorkspace;

use crate::validate::point_sets;
use crate::{MatchError, Matching, PointMatcher};
use nalgebra::Point;

/// How the model may move.
///
/// ```
/// use nalgebra::{Point2, Vector2};
/// use tactile_match::{CoherentPointDrift, Motion, PointMatcher};
/// let model: Vec<_> = (0..20).map(f64::from).map(|k| Point2::new(k.cos() * k, (1.3 * k).sin() * k)).collect();
/// let target: Vec<_> = model.iter().map(|p| p * 1.2 + Vector2::new(0.0, 3.0)).collect(); // swollen by a fifth
/// let residual = |motion| {
///     let matcher = CoherentPointDrift::default().with_motion(motion)?;
///     Ok::<_, tactile_match::MatchError>(matcher.match_points(&model, &target)?.report.residual)
/// };
/// assert!(residual(Motion::Similarity)? < 1e-6);
/// assert!(residual(Motion::Rigid)? > 0.1); // has no scale to offer
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Motion {
    /// Rotation and translation.
    Rigid,
    /// Rotation, translation and one scale.
    Similarity,
    /// Any affine map.
    Affine,
    /// Smooth displacement.
    NonRigid {
        /// Width β of the Gaussian kernel, in root mean square radii: how far neighbours move together.
        beta: f64,
        /// Weight λ of smoothness against likelihood.
        lambda: f64,
        /// Greatest rank of the kernel; `None` for the rank it numerically has. Thirty is customary for speed.
        rank: Option<usize>,
    },
}

impl Motion {
    /// Non-rigid with the customary β = 2, λ = 3, and no bound on the rank.
    pub const NON_RIGID: Self = Self::NonRigid {
        beta: 2.0,
        lambda: 3.0,
        rank: None,
    };
}

/// How the two sets are brought to size one.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, Motion, Normalization, PointMatcher};
/// let model: Vec<_> = (0..24).map(f64::from).map(|k| Point2::new(k % 6.0 + 0.2 * k.sin(), (k / 6.0).floor())).collect();
/// let target: Vec<_> = model[..18].iter().map(|p| Point2::new(p.x + 0.1, p.y)).collect(); // the last row is out of sight
/// let (motion, normalization) = (Motion::Rigid, Normalization::Model);
/// let options = CoherentPointDrift::default().with_motion(motion)?.with_normalization(normalization);
/// let matching = options.match_points(&model, &target)?;
/// assert!((0..18).all(|i| matching.assignment[i] == Some(i)));
/// assert_eq!(matching.unmatched_model, [18, 19, 20, 21, 22, 23]);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Normalization {
    /// Each set by its own centre and root mean square radius: customary in coherent point drift, and right whatever lies between
    /// the sets.
    ///
    /// [`Rigid`](Motion::Rigid) motion, which has no scale to give back, takes the model's radius for both.
    #[default]
    Each,
    /// Both by the centre and the root mean square radius of the model: for sets that nearly lie on one another, where points
    /// without a partner would shift the centre of one of them.
    Model,
    /// None: the parameters are in the units of the points.
    Off,
}

impl CoherentPointDrift {
    /// [`PointMatcher::match_points`] with the memory of the iterations kept between calls.
    ///
    /// ```
    /// use nalgebra::{Point2, Vector2};
    /// use tactile_match::{CoherentPointDrift, DriftWorkspace};
    /// let model: Vec<_> = (0..12).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.2 * k.sin(), (k / 4.0).floor())).collect();
    /// let (matcher, mut workspace) = (CoherentPointDrift::default(), DriftWorkspace::default());
    /// for shift in [0.5, 5.0] {
    ///     let target: Vec<_> = model.iter().map(|p| p + Vector2::new(shift, 0.0)).collect();
    ///     let matching = matcher.match_with(&mut workspace, &model, &target)?;
    ///     assert!((0..12).all(|i| matching.assignment[i] == Some(i)));
    /// }
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// As [`PointMatcher::match_points`].
    pub fn match_with<const D: usize>(
        &self,
        workspace: &mut DriftWorkspace<D>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        point_sets(model, target)?;
        workspace.register(self, model, target);
        Ok(outcome::matching(
            self,
            workspace,
            model.len(),
            target.len(),
        ))
    }
}

impl<const D: usize> PointMatcher<D> for CoherentPointDrift {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        self.match_with(&mut DriftWorkspace::default(), model, target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::{bend, scattered};

    #[test]
    fn a_used_workspace_registers_without_allocating() {
        let options = CoherentPointDrift::default();
        let mut workspace = DriftWorkspace::default();
        let sets: Vec<_> = [(40, 5), (20, 6), (40, 7)]
            .into_iter()
            .map(|(n, seed)| scattered::<3>(n, seed))
            .map(|model| (bend(&model, 0.05), model))
            .collect();
        for (target, model) in &sets {
            workspace.register(&options, model, target);
        }
        let counted = allocation_counter::measure(|| {
            for (target, model) in &sets {
                workspace.register(&options, model, target);
            }
        });
        assert_eq!(counted.count_total, 0);
    }
}
