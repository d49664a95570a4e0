//! Landmarks: model points whose place in the target is known, exactly or with an error.

use super::anneal::Annealer;
use super::known::Known;
use super::{AnnealedSoftassign, SoftassignMatch, SoftassignWorkspace, finish};
use crate::validate::option_within;
use crate::{MatchError, Matching};
use nalgebra::Point;
use std::ops::ControlFlow;

/// Where a model point is known to go, as a normal distribution: the fit counts it beside the soft matches, with the weight σ²/s² of its
/// standard deviation s at the temperature σ.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, Landmark, Transformation};
/// // Twelve points of a regular ring: only landmarks can tell that it was turned.
/// let ring = |turn: f64| -> Vec<Point2<f64>> {
///     (0..12).map(|k| f64::from(k).mul_add(30.0, turn).to_radians()).map(|a| Point2::new(a.cos(), a.sin())).collect()
/// };
/// let (model, target) = (ring(0.0), ring(30.0));
/// let landmarks = [0, 4].map(|row| Landmark { row, position: target[row], deviation: 0.0 }); // two known pairs
/// let options = AnnealedSoftassign::default().with_transformation(Transformation::Rigid);
/// let found = options.match_with_landmarks(&model, &target, &landmarks)?;
/// assert!((0..12).all(|i| found.assignment[i] == Some(i)));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark<const D: usize> {
    /// Row of the model point.
    pub row: usize,
    /// Where it goes.
    pub position: Point<f64, D>,
    /// Standard deviation along an axis, in the units of the points; 0 for a hard landmark, which is kept to a thousandth of the model's
    /// radius, and where its position is a target exactly.
    pub deviation: f64,
}

impl<const D: usize> Landmark<D> {
    fn check(&self, points: usize) -> Result<(), MatchError> {
        let row = self.row;
        if row >= points {
            return Err(MatchError::LandmarkRow { row, points });
        }
        let deviation = self.deviation;
        option_within("deviation", deviation, 0.0, f64::MAX, "[0, ∞)")?;
        if !self.position.iter().all(|c| c.is_finite()) {
            return Err(MatchError::LandmarkPosition { row });
        }
        Ok(())
    }
}

impl AnnealedSoftassign {
    /// As [`match_points`](crate::PointMatcher::match_points), with what is known of some model points; several landmarks of one point count
    /// together.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::{AnnealedSoftassign, Landmark};
    /// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2], [0.5, 0.4], [1.8, 0.3]].map(Point2::from);
    /// let target = model.map(|p| Point2::new(1.1 * p.x + 0.1 * p.y, p.y));
    /// let known = Landmark { row: 2, position: target[2], deviation: 0.01 };
    /// let found = AnnealedSoftassign::default().match_with_landmarks(&model, &target, &[known])?;
    /// assert_eq!(found.assignment[2], Some(2));
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// As [`match_points`](crate::PointMatcher::match_points), [`MatchError::LandmarkRow`] for a landmark of a point that the model does not
    /// have, [`MatchError::LandmarkPosition`] for a position that is not finite, and [`MatchError::InvalidOption`] for a deviation that is
    /// negative or not finite.
    pub fn match_with_landmarks<const D: usize>(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        landmarks: &[Landmark<D>],
    ) -> Result<Matching<D>, MatchError> {
        for landmark in landmarks {
            landmark.check(model.len())?;
        }
        let mut workspace = SoftassignWorkspace::default();
        workspace.take(model, target)?;
        let frame = workspace.frame;
        workspace.known.extend(landmarks.iter().map(|known| Known {
            row: known.row,
            position: frame.target(&known.position),
            variance: (known.deviation / frame.scale).max(finish::FLOOR).powi(2),
        }));
        self.solve(&mut workspace, &mut |_, _| ControlFlow::Continue(()));
        Ok(SoftassignMatch::of(&workspace).to_matching(model))
    }
}

impl<const D: usize> Annealer<D> {
    /// Adds what the landmarks say to the request of the soft matches: precisions add up, displacements are averaged by them.
    pub(super) fn add_landmarks(&mut self, base: &[[f64; D]], variance: f64) {
        for known in &self.known {
            let (row, precision) = (known.row, variance / known.variance);
            let total = self.weights[row] + precision;
            for (k, axis) in self.residuals.0.iter_mut().enumerate() {
                let displacement = known.position[k] - base[row][k];
                axis[row] = (self.weights[row] * axis[row] + precision * displacement) / total;
            }
            self.weights[row] = total;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    fn ring(turn: f64) -> Vec<Point2<f64>> {
        let angle = |k: i32| (f64::from(k) * 30.0 + turn).to_radians();
        (0..12)
            .map(|k| Point2::new(angle(k).cos(), angle(k).sin()))
            .collect()
    }

    #[test]
    fn landmarks_out_of_range_are_typed_errors() {
        let origin = Point2::new(0.0, 0.0);
        for deviation in [-1.0, f64::NAN, f64::INFINITY] {
            let landmark = Landmark {
                row: 0,
                position: origin,
                deviation,
            };
            assert!(matches!(
                landmark.check(12),
                Err(MatchError::InvalidOption {
                    option: "deviation",
                    ..
                })
            ));
        }
        let nowhere = Landmark {
            row: 3,
            position: Point2::new(f64::NAN, 0.0),
            deviation: 0.1,
        };
        assert_eq!(
            nowhere.check(12),
            Err(MatchError::LandmarkPosition { row: 3 })
        );
        let beyond = Landmark {
            row: 12,
            position: origin,
            deviation: 0.1,
        };
        let found =
            AnnealedSoftassign::default().match_with_landmarks(&ring(0.0), &ring(0.0), &[beyond]);
        let expected = MatchError::LandmarkRow {
            row: 12,
            points: 12,
        };
        assert_eq!(found.err(), Some(expected));
    }

    /// Without any the answer is that of a plain match, to the bit.
    #[test]
    fn no_landmarks_change_nothing() {
        use crate::PointMatcher;
        let (model, target) = (ring(0.0), ring(7.0));
        let matcher = AnnealedSoftassign::default();
        let plain = matcher.match_points(&model, &target).expect("good points");
        let found = matcher
            .match_with_landmarks(&model, &target, &[])
            .expect("good points");
        assert_eq!(plain.warped, found.warped);
        assert_eq!(plain.confidence, found.confidence);
    }

    /// A point without a partner goes where its landmark says: the closer the smaller its deviation.
    #[test]
    fn softer_landmarks_pull_less() {
        let model: Vec<Point2<f64>> = (0..40)
            .map(|i| {
                Point2::new(
                    f64::from(i % 8) + 0.3 * f64::from(i * i % 7),
                    f64::from(i / 8),
                )
            })
            .collect();
        let target = &model[..39];
        let away = model[39] + nalgebra::Vector2::new(0.4, 0.0);
        let distance = |deviation: f64| {
            let landmark = Landmark {
                row: 39,
                position: away,
                deviation,
            };
            let found = AnnealedSoftassign::default()
                .match_with_landmarks(&model, target, &[landmark])
                .expect("good points");
            (found.warped[39] - away).norm()
        };
        let distances = [0.0, 0.3, 10.0].map(distance);
        assert!(distances.is_sorted(), "{distances:?}");
        // A hard landmark is met to some thousandths of the radius of 3; one of ten units says next to nothing.
        assert!(distances[0] < 0.05 && distances[2] > 0.2, "{distances:?}");
    }
}
