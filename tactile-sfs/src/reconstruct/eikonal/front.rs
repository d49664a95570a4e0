//! The order in which a front that starts at the known heights is expected to reach the nodes.
//!
//! Every node is upwind of those that it lowers: visited in the order of their values, all have their final value after one pass (Tsitsiklis
//! 1995; Sethian 1996). A profile fitted to a contact tells nearly that order before anything is solved. It is only a start: sweeps follow
//! until nothing changes, so that answers hardly depend on it: under a ripple of 3 % by less than a thousandth.

/// Levels that keys are told apart by.
const LEVELS: usize = 4096;

/// Unknown nodes in rising order of a key, and the buffers of the sort.
#[derive(Debug, Default)]
pub(crate) struct Front {
    /// Places in the grid.
    pub(super) nodes: Vec<u32>,
    keys: Vec<(u32, f64)>,
    starts: Vec<u32>,
}

impl Front {
    /// Takes nodes with their keys and sorts them by the level of the key, by counting; nodes of one level keep their order.
    pub(super) fn sort(&mut self, room: usize, nodes_and_keys: impl Iterator<Item = (u32, f64)>) {
        self.keys.clear();
        self.keys.reserve(room);
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
        nodes.resize(keys.len(), 0);
        for &(node, key) in keys.iter() {
            let place = &mut starts[level(key)];
            nodes[*place as usize] = node;
            *place += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{boundary, frontal};
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
        front.sort(5, (10..).zip(keys));
        assert_eq!(front.nodes, [11, 14, 10, 13, 12]);
    }

    const RADIUS: f64 = 26.4;
    const CENTRE: [f64; 2] = [30.3, 29.6];
    /// Of a solve, in pixels.
    const TOLERANCE: f64 = 1e-8;

    /// Light of half a ball with a ripple, which a profile fitted to it knows nothing of.
    fn dome(ripple: f64) -> Array2<f64> {
        Array2::from_shape_fn((61, 61), |(r, c)| {
            let rho = (r as f64 - CENTRE[0]).hypot(c as f64 - CENTRE[1]) / RADIUS;
            let ripple = ripple * (0.7 * c as f64).sin() * (0.5 * r as f64).cos();
            (1.0 - rho * rho).max(0.0).sqrt() + if rho < 0.8 { ripple } else { 0.0 }
        })
    }

    fn method() -> Eikonal<f64> {
        let method = Eikonal::new(Lighting::default());
        let method = method.with_boundary(BoundaryCondition::Height(0.0));
        method.unwrap().with_tolerance(TOLERANCE).unwrap()
    }

    /// The surface of a dome by its profile, and the buffers as they were left.
    fn by_profile(image: &Array2<f64>) -> (Surface<f64>, Workspace<f64>) {
        let mask = image.mapv(|light| light > 0.0);
        let domain = Domain::default().with_mask(mask.view());
        let (mut workspace, mut surface) = (Workspace::default(), Surface::default());
        let frame = Frame::Real(image.view());
        let fitted = method().with_fitted_profile(true);
        fitted
            .reconstruct_with(&mut workspace, frame, &domain, &mut surface)
            .unwrap();
        assert!(!workspace.eikonal.front.nodes.is_empty());
        (surface, workspace)
    }

    #[test]
    fn heights_do_not_depend_on_the_expected_order() {
        let (_, workspace) = by_profile(&dome(0.03));
        let mut grid = workspace.eikonal;
        let marched = grid.value.clone();
        // The same equation again, by sweeps alone.
        boundary::start(&mut grid, true);
        while (0..4).any(|order| frontal::sweep(&mut grid, order, TOLERANCE) > TOLERANCE) {}
        for (i, (swept, marched)) in grid.value.iter().zip(&marched).enumerate() {
            // The correction k belongs to the neighbours that a node is updated from: a value that came early by way of others, with a k that
            // makes it a little lower, is not raised again: 0.012 pixels of 25 under this ripple.
            let same = (swept - marched).abs() < 0.02 || swept == marched;
            assert!(same, "{i}: {swept} {marched}");
        }
    }

    /// Half a ball, whose height is known: a profile's directions serve as well as those measured on a first solution.
    #[test]
    fn directions_of_the_profile_are_those_of_the_surface() {
        let (directed, workspace) = by_profile(&dome(0.0));
        // The same image and mask, the boundary replaced already, without the profile.
        let profile = &workspace.profile;
        let domain = Domain::default().with_mask(profile.mask.view());
        let measured = method()
            .reconstruct(profile.image.view().into(), &domain)
            .unwrap();
        let error = |surface: &Surface<f64>| {
            let mut worst = 0.0_f64;
            for ((r, c), height) in surface.heights.indexed_iter() {
                let away = (r as f64 - CENTRE[0]).hypot(c as f64 - CENTRE[1]);
                if away < 0.95 * RADIUS {
                    worst = worst.max((height - (RADIUS * RADIUS - away * away).sqrt()).abs());
                }
            }
            worst
        };
        // A solution of first order, which directions are measured on, is off by 0.13 pixels near the rim.
        let errors = [error(&directed), error(&measured)];
        assert!(errors[0] < 0.05 && errors[0] < errors[1], "{errors:?}");
    }
}
