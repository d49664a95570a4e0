//! More points where the surface is curved.

use nalgebra::Point3;
use ndarray::ArrayView2;

use super::ControlPointSampler;
use super::equally_spaced::spread;
use super::lattice::Lattice;
use crate::error::non_negative;
use crate::{Scalar, SfsError, Workspace};

/// Control points whose density grows with curvature: density ∝ 1 + emphasis · √(κ/κ̄), κ the root of the sum of squares
/// of the second derivatives and κ̄ its mean (the root because a linear interpolant's error goes as κ · spacing²).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, CurvatureAdaptive};
/// // Flat on the left, wavy on the right.
/// let z = Array2::from_shape_fn((60, 80), |(_, c)| if c < 40 { 0.0 } else { (c as f64 * 0.5).sin() });
/// let points = CurvatureAdaptive::new(4.0)?.sample(z.view(), None, [1.0, 1.0], 60)?;
/// let right = points.iter().filter(|p| p.x >= 40.0).count();
/// assert!(right > 40);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvatureAdaptive {
    emphasis: f64,
}

impl CurvatureAdaptive {
    /// The sampler; emphasis 0 is equal spacing.
    ///
    /// # Errors
    /// [`SfsError::Negative`] unless finite and not negative.
    pub fn new(emphasis: f64) -> Result<Self, SfsError> {
        non_negative("emphasis", emphasis)?;
        Ok(Self { emphasis })
    }
}

impl<T: Scalar> ControlPointSampler<T> for CurvatureAdaptive {
    fn sample_with(
        &self,
        workspace: &mut Workspace<T>,
        surface: ArrayView2<'_, T>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [T; 2],
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        points.clear();
        let buffers = &mut workspace.points;
        let weight = core::mem::take(&mut buffers.weight);
        let mut lattice = Lattice::sparse(surface, mask, pixel_size_m, count, weight)?;
        let step = pixel_size_m.map(T::as_f64);
        let curvatures = &mut buffers.curvatures;
        curvatures.clear();
        curvatures.extend(
            lattice
                .nodes()
                .map(|node| curvature(surface, lattice.pixel(node), step)),
        );
        let mean = curvatures.iter().sum::<f64>() / curvatures.len() as f64;
        if mean > 0.0 {
            let nodes = lattice.weight.iter_mut().filter(|weight| **weight > 0.0);
            for (weight, curvature) in nodes.zip(curvatures) {
                *weight *= 1.0 + self.emphasis * (*curvature / mean).sqrt();
            }
        }
        spread(&lattice, count, buffers, points);
        buffers.weight = lattice.weight;
        Ok(())
    }
}

/// Root of the sum of squares of the second derivatives that can be formed.
fn curvature<T: Scalar>(
    z: ArrayView2<'_, T>,
    [row, column]: [usize; 2],
    [hx, hy]: [f64; 2],
) -> f64 {
    let here = z[[row, column]].as_f64();
    let second = |a: [usize; 2], b: [usize; 2], h: f64| -> f64 {
        match (z.get(a), z.get(b)) {
            (Some(a), Some(b)) if a.is_finite() && b.is_finite() => {
                (a.as_f64() - 2.0 * here + b.as_f64()) / (h * h)
            }
            _ => 0.0,
        }
    };
    let (left, above) = (column.wrapping_sub(1), row.wrapping_sub(1));
    second([row, left], [row, column + 1], hx).hypot(second([above, column], [row + 1, column], hy))
}
