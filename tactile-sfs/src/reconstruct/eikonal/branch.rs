//! Which of the two branches the image supports: the wrong one has folds, and folds shade differently.

use super::grid::{EikonalBuffers, Node};
use crate::{Lighting, Scalar};

/// Squared difference of reflectance that an unreached node counts: folds make 0.02 to 0.1 on average, right branches less
/// than 0.005. Under oblique light the right branch often ends at shadows.
const UNREACHED: f64 = 0.01;

impl<T: Scalar> EikonalBuffers<T> {
    /// Whether the kept convex branch, shaded again, is at least as near to the image as the concave one in `value`.
    pub(super) fn kept_is_better(&self, lighting: &Lighting<T>) -> bool {
        let light = lighting.direction();
        self.misfit(&self.kept, T::one(), light) <= self.misfit(&self.value, -T::one(), light)
    }

    /// Sum of squared differences of reflectance over the nodes with four neighbours; around unreached nodes, where there is
    /// nothing to compare, [`UNREACHED`] stands for each.
    fn misfit(&self, value: &[T], sign: T, [x, y, z]: [T; 3]) -> T {
        let (width, half) = (self.width, T::of(0.5) * sign);
        let mut sum = T::zero();
        for i in width..value.len() - width {
            let near = [i - 1, i + 1, i - width, i + width];
            if self.node[i] == Node::Outside || near.iter().any(|&j| self.node[j] == Node::Outside)
            {
                continue;
            }
            if near.iter().any(|&j| !value[j].is_finite()) {
                sum += T::of(UNREACHED);
                continue;
            }
            let p = half * (value[i + 1] - value[i - 1]);
            let q = half * (value[i + width] - value[i - width]) / self.aspect;
            let shade = (z - x * p - y * q) / (T::one() + p * p + q * q).sqrt();
            let difference = shade.max(T::zero()) - self.cosine[i];
            sum += if difference.is_finite() {
                difference * difference
            } else {
                T::one()
            };
        }
        sum
    }
}
