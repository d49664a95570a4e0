//! The padded grid of the mask's bounding box the sweeps run on, in units of a pixel's width.

use super::front::Front;
use crate::{Domain, PixelFlags, Scalar, Surface};

/// What a node of the grid is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Node {
    /// Not in the mask.
    #[default]
    Outside,
    /// To be solved for.
    Unknown,
    /// In the mask, height given.
    Known,
}

/// Buffers of the sweeps: the mask's box with a border of one pixel all around.
#[derive(Debug, Default)]
pub(crate) struct EikonalBuffers<T> {
    /// Nodes per row.
    pub(super) width: usize,
    /// Height of a pixel over its width.
    pub(super) aspect: T,
    pub(super) node: Vec<Node>,
    /// Nodes whose value may still improve.
    pub(super) active: Vec<bool>,
    /// Rows that may have active nodes.
    pub(super) busy: Vec<bool>,
    /// Reflectance R = cos of the angle between normal and light.
    pub(super) cosine: Vec<T>,
    /// sin of that angle.
    pub(super) sine: Vec<T>,
    /// Given heights: inside the mask at the pixel's centre, outside it at the mask's border; NaN elsewhere.
    pub(super) given: Vec<T>,
    /// Height of the convex branch, or minus that of the concave one; +∞ where not reached.
    pub(super) value: Vec<T>,
    /// Values of the branch solved first.
    pub(super) kept: Vec<T>,
    /// Boundary offset: height of a node above the boundary next to it, NaN away from the boundary.
    pub(super) offset: Vec<T>,
    /// 1/(slope · step)² of the edge to the next node in x and in y.
    pub(super) edges: Vec<[T; 2]>,
    /// cos²φ of the gradient, whether sweeps use it, and whether a fitted profile has told it before any solution.
    pub(super) along_x: Vec<T>,
    pub(super) corrected: bool,
    pub(super) directed: bool,
    /// Nodes whose intensity is not finite.
    pub(super) holes: Vec<usize>,
    /// Unknown nodes in the order in which the front is expected to reach them; none where nothing is expected.
    pub(super) front: Front,
}

impl<T: Scalar> EikonalBuffers<T> {
    pub(super) fn clear(&mut self, rows: usize, columns: usize) {
        self.width = columns + 2;
        let length = self.width * (rows + 2);
        fill(&mut self.node, length, Node::Outside);
        fill(&mut self.active, length, false);
        fill(&mut self.busy, rows + 2, false);
        fill(&mut self.cosine, length, T::one());
        fill(&mut self.sine, length, T::zero());
        fill(&mut self.given, length, T::nan());
        fill(&mut self.value, length, T::infinity());
        fill(&mut self.offset, length, T::nan());
        fill(&mut self.edges, length, [T::one(); 2]);
        fill(&mut self.along_x, length, T::nan());
        self.corrected = false;
        self.directed = false;
        self.front.nodes.clear();
        self.holes.clear();
    }

    /// 1/(slope · step)² by the chord rule for every edge between two nodes of the mask.
    pub(super) fn measure_edges(&mut self) {
        // A floor keeps flat parts (slope 0) from dividing by zero: 10⁻⁶ pixels per pixel.
        let floor = T::of(1e-6);
        let metric = |sine: [T; 2], cosine: [T; 2], step: T| {
            let slope = (sine[0] + sine[1]) / (cosine[0] + cosine[1]);
            (slope.max(floor) * step).powi(-2)
        };
        let (width, aspect) = (self.width, self.aspect);
        let rest = self.node.len() - 2 * width;
        // Every node and those after and below it, as slices of one length: no step asks where it is.
        let (sine, cosine) = (&self.sine[width..], &self.cosine[width..]);
        let (sine_right, cosine_right) = (&sine[1..=rest], &cosine[1..=rest]);
        let (sine_below, cosine_below) = (&sine[width..][..rest], &cosine[width..][..rest]);
        let (sine, cosine) = (&sine[..rest], &cosine[..rest]);
        let nodes = &self.node[width..][..rest];
        let edges = &mut self.edges[width..][..rest];
        for i in 0..rest {
            let (s, c) = (sine[i], cosine[i]);
            let right = metric([s, sine_right[i]], [c, cosine_right[i]], T::one());
            let below = metric([s, sine_below[i]], [c, cosine_below[i]], aspect);
            edges[i] = if nodes[i] == Node::Outside {
                [T::one(); 2]
            } else {
                [right, below]
            };
        }
    }

    /// Keeps the values of the branch just solved.
    pub(super) fn keep(&mut self) {
        self.kept.clear();
        self.kept.extend_from_slice(&self.value);
    }

    /// Takes the kept values back.
    pub(super) fn restore(&mut self) {
        core::mem::swap(&mut self.value, &mut self.kept);
    }

    /// Writes value × `scale` to the surface.
    pub(super) fn store(&self, scale: T, domain: &Domain<'_, T>, surface: &mut Surface<T>) {
        let area = surface.bounding_box;
        for (row, column) in area.pixels() {
            let i = (row - area.top + 1) * self.width + column - area.left + 1;
            match self.node[i] {
                Node::Outside => {}
                Node::Known => surface.set(
                    row,
                    column,
                    domain.known(row, column).unwrap_or_else(T::nan),
                ),
                Node::Unknown if self.value[i].is_finite() => {
                    surface.set(row, column, scale * self.value[i])
                }
                Node::Unknown => surface.flags[[row, column]] |= PixelFlags::UNREACHED,
            }
        }
    }
}

/// Makes a buffer `length` copies of `value`.
fn fill<A: Copy>(buffer: &mut Vec<A>, length: usize, value: A) {
    buffer.clear();
    buffer.resize(length, value);
}
