//! A smooth curve through the nodes of a surface.
//!
//! Quadratic edges meet at kinks, where the direction of a frictionless contact's force would jump and
//! Newton's method would not settle. Cubic Hermite segments between neighbouring nodes, with slopes
//! from the parabola through three nodes, have a continuous normal and the edges' order of accuracy;
//! they depend linearly on the nodes.

/// Nodes of a surface from the axis outwards.
#[derive(Debug, Clone)]
pub(crate) struct SurfaceCurve {
    nodes: Vec<usize>,
    /// Reference arc length (of chords) at each node.
    lengths: Vec<f64>,
    /// The first node is on the axis.
    from_axis: bool,
    /// +1 where the body is on the left of the way outwards: its outward normal is (z', −r').
    pub(crate) side: f64,
}

/// Weights of a segment's nodes in the curve's components r, z.
type Weights = [[f64; 2]; 4];

/// A segment's nodes, and their weights in position, first and second derivative at one parameter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CurvePoint {
    pub(crate) nodes: [usize; 4],
    pub(crate) position: Weights,
    pub(crate) first: Weights,
    pub(crate) second: Weights,
}

impl CurvePoint {
    /// Weighted sum over the nodes.
    pub(crate) fn sum(&self, weights: &Weights, at: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (&node, weight) in self.nodes.iter().zip(weights) {
            let point = at(node);
            sum[0] += weight[0] * point[0];
            sum[1] += weight[1] * point[1];
        }
        sum
    }
}

impl SurfaceCurve {
    /// Through the nodes of edges that run along a surface whose radius grows along it.
    pub(crate) fn new(edges: &[[usize; 3]], coordinates: &[[f64; 2]]) -> Self {
        let mut nodes: Vec<usize> = edges.iter().flatten().copied().collect();
        nodes.sort_by(|a, b| {
            let (a, b) = (coordinates[*a], coordinates[*b]);
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
        });
        nodes.dedup();
        let mut lengths = vec![0.0];
        for pair in nodes.windows(2) {
            let (a, b) = (coordinates[pair[0]], coordinates[pair[1]]);
            lengths.push(lengths[lengths.len() - 1] + (b[0] - a[0]).hypot(b[1] - a[1]));
        }
        let outwards = edges
            .first()
            .is_some_and(|edge| coordinates[edge[2]][0] > coordinates[edge[0]][0]);
        Self {
            from_axis: nodes
                .first()
                .is_some_and(|&node| coordinates[node][0] == 0.0),
            side: if outwards { 1.0 } else { -1.0 },
            nodes,
            lengths,
        }
    }

    pub(crate) fn segments(&self) -> usize {
        self.nodes.len().saturating_sub(1)
    }

    /// Ends of a segment.
    pub(crate) fn ends(&self, segment: usize) -> [usize; 2] {
        [self.nodes[segment], self.nodes[segment + 1]]
    }

    /// The point of a segment at `t` in [0, 1].
    pub(crate) fn at(&self, segment: usize, t: f64) -> CurvePoint {
        let length = self.lengths[segment + 1] - self.lengths[segment];
        let slopes = [
            self.slope(segment, segment),
            self.slope(segment + 1, segment),
        ];
        let combine = |a: f64, b: f64, slope_a: f64, slope_b: f64| -> Weights {
            core::array::from_fn(|k| {
                core::array::from_fn(|c| {
                    let own = match k {
                        1 => a,
                        2 => b,
                        _ => 0.0,
                    };
                    own + length * (slope_a * slopes[0][k][c] + slope_b * slopes[1][k][c])
                })
            })
        };
        let last = self.nodes.len() - 1;
        CurvePoint {
            nodes: [
                self.nodes[segment.saturating_sub(1)],
                self.nodes[segment],
                self.nodes[segment + 1],
                self.nodes[(segment + 2).min(last)],
            ],
            position: combine(
                (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t),
                t * t * (3.0 - 2.0 * t),
                t * (1.0 - t) * (1.0 - t),
                t * t * (t - 1.0),
            ),
            first: combine(
                6.0 * t * (t - 1.0),
                6.0 * t * (1.0 - t),
                (1.0 - t) * (1.0 - 3.0 * t),
                t * (3.0 * t - 2.0),
            ),
            second: combine(12.0 * t - 6.0, 6.0 - 12.0 * t, 6.0 * t - 4.0, 6.0 * t - 2.0),
        }
    }

    /// Weights of the segment's four nodes in the slope at node `node`.
    fn slope(&self, node: usize, segment: usize) -> Weights {
        let mut weights = [[0.0; 2]; 4];
        // Place 1 holds node number `segment`.
        let place = |number: usize| number + 1 - segment;
        let last = self.nodes.len() - 1;
        if node == 0 && self.from_axis {
            // By symmetry: r is odd along the curve, z is even.
            weights[place(1)][0] = 1.0 / self.lengths[1];
        } else if node == 0 || node == last {
            let from = node.min(last - 1);
            let step = self.lengths[from + 1] - self.lengths[from];
            weights[place(from)] = [-1.0 / step; 2];
            weights[place(from + 1)] = [1.0 / step; 2];
        } else {
            let before = self.lengths[node] - self.lengths[node - 1];
            let after = self.lengths[node + 1] - self.lengths[node];
            let sum = before + after;
            weights[place(node - 1)] = [-after / (before * sum); 2];
            weights[place(node)] = [(after - before) / (before * after); 2];
            weights[place(node + 1)] = [before / (after * sum); 2];
        }
        weights
    }
}
