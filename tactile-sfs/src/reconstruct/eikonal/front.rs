//! The order in which a front that starts at the known heights is expected to reach the nodes.
//!
//! Every node is upwind of those that it lowers: visited in the order of their values, all have their final value after one pass (Tsitsiklis
//! 1995; Sethian 1996). A profile fitted to a contact tells nearly that order before anything is solved. It is only a start: sweeps follow
//! until nothing changes, so that no answer depends on it.

/// Levels that keys are told apart by.
const LEVELS: usize = 4096;

/// Unknown nodes in rising order of a key, and the buffers of the sort.
#[derive(Debug, Default)]
pub(crate) struct Front {
    /// Row and column in the grid.
    pub(super) nodes: Vec<[u32; 2]>,
    keys: Vec<([u32; 2], f64)>,
    starts: Vec<u32>,
}

impl Front {
    /// Takes nodes with their keys and sorts them by the level of the key, by counting; nodes of one level keep their order.
    pub(super) fn sort(&mut self, nodes_and_keys: impl Iterator<Item = ([u32; 2], f64)>) {
        self.keys.clear();
        self.keys.extend(nodes_and_keys);
        let Self {
            nodes,
            keys,
            starts,
        } = self;
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for &(_, key) in keys.iter() {
            (least, most) = (least.min(key), most.max(key));
        }
        let scale = (LEVELS - 1) as f64 / (most - least).max(f64::MIN_POSITIVE);
        // The conversion saturates.
        let level = |key: f64| usize::from(((key - least) * scale) as u16).min(LEVELS - 1);
        starts.clear();
        starts.resize(LEVELS + 1, 0);
        keys.iter()
            .for_each(|&(_, key)| starts[level(key) + 1] += 1);
        for level in 0..LEVELS {
            starts[level + 1] += starts[level];
        }
        nodes.clear();
        nodes.resize(keys.len(), [0; 2]);
        for &(node, key) in keys.iter() {
            let place = &mut starts[level(key)];
            nodes[*place as usize] = node;
            *place += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        BoundaryCondition, Domain, Eikonal, Frame, Lighting, Surface, SurfaceReconstruction,
        Workspace,
    };
    use ndarray::Array2;

    #[test]
    fn nodes_are_sorted_by_their_level_and_keep_their_order_within_it() {
        let keys = [0.7, 0.0, 1.0, 0.7, 0.0];
        let mut front = Front::default();
        front.sort((10..).map(|row| [row, 3]).zip(keys));
        let rows: Vec<_> = front.nodes.iter().map(|node| node[0]).collect();
        assert_eq!(rows, [11, 14, 10, 13, 12]);
    }

    /// A dome with a ripple, seen from its rim to its top along a profile that knows nothing of the ripple.
    #[test]
    fn heights_do_not_depend_on_the_expected_order() {
        let (n, radius) = (61, 26.4);
        let light = |(r, c): (usize, usize)| {
            let rho = (r as f64 - 30.3).hypot(c as f64 - 29.6) / radius;
            let ripple = 0.03 * (0.7 * c as f64).sin() * (0.5 * r as f64).cos();
            (1.0 - rho * rho).max(0.0).sqrt() + if rho < 0.8 { ripple } else { 0.0 }
        };
        let image = Array2::from_shape_fn((n, n), light);
        let mask = image.mapv(|light| light > 0.0);
        let method = Eikonal::new(Lighting::default());
        let method = method
            .with_boundary(BoundaryCondition::Height(0.0))
            .unwrap();
        let fitted = method.with_fitted_profile(true);
        let domain = Domain::default().with_mask(mask.view());
        let mut workspace = Workspace::default();
        let mut marched = Surface::default();
        let frame = Frame::Real(image.view());
        fitted
            .reconstruct_with(&mut workspace, frame, &domain, &mut marched)
            .unwrap();
        // The same image and mask, the boundary replaced already, without the profile.
        let (image, mask) = (
            workspace.profile.image.clone(),
            workspace.profile.mask.clone(),
        );
        let domain = Domain::default().with_mask(mask.view());
        let swept = method.reconstruct(image.view().into(), &domain).unwrap();
        assert!(!workspace.eikonal.front.nodes.is_empty());
        for (at, height) in swept.heights.indexed_iter() {
            // Each solve ends when nothing changes by more than 1e-5 pixels; such changes add up along some of the thirty pixels to the top.
            let other = marched.heights[at];
            let same = (height - other).abs() < 1e-4 || height.is_nan() && other.is_nan();
            assert!(same, "{at:?}: {height} {other}");
        }
    }
}
