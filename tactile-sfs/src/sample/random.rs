//! Seeded random points, uniform over the surface's area.

use nalgebra::Point3;
use ndarray::ArrayView2;

use super::ControlPointSampler;
use super::lattice::Lattice;
use crate::{Scalar, SfsError, Workspace};

/// Random control points: every pixel is drawn with a probability proportional to the surface area over it, without
/// repetition. The same seed gives the same points on every platform and in every version of the library: the generator
/// (SplitMix64) is part of this crate for that reason. O(pixels + count log count).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, Random};
/// let flat = Array2::<f32>::zeros((20, 20));
/// let a = Random { seed: 7 }.sample(flat.view(), None, [1.0, 1.0], 50)?;
/// assert_eq!(a, Random { seed: 7 }.sample(flat.view(), None, [1.0, 1.0], 50)?);
/// assert_ne!(a, Random { seed: 8 }.sample(flat.view(), None, [1.0, 1.0], 50)?);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Random {
    /// The seed.
    pub seed: u64,
}

impl<T: Scalar> ControlPointSampler<T> for Random {
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
        let lattice = Lattice::dense(surface, mask, pixel_size_m, count, weight)?;
        // The `count` least of exponential variates with rates = areas are a draw without repetition (Efraimidis &
        // Spirakis 2006).
        let mut state = self.seed;
        let mut key = |node: usize| -(1.0 - unit(&mut state)).ln() / lattice.weight[node];
        let keys = &mut buffers.keys;
        keys.clear();
        keys.extend(lattice.nodes().map(|node| (key(node), node)));
        let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if count < keys.len() {
            keys.select_nth_unstable_by(count, order);
            keys.truncate(count);
        }
        keys.sort_unstable_by(order);
        points.extend(
            keys.iter()
                .map(|&(_, node)| lattice.point(lattice.pixel(node))),
        );
        buffers.weight = lattice.weight;
        Ok(())
    }
}

/// Uniform in [0, 1): SplitMix64 (Steele, Lea & Flood 2014), the upper 53 bits.
fn unit(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
