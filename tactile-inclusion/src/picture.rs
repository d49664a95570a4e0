//! Pressure over the whole face, with a lump that is not under its axis.
//!
//! A block solved with the lump under the axis and the same block without one give the pressure
//! with the lump anywhere: with r the distance from the axis, ρ that from the lump,
//!
//! $$ p(x, y) = p_\mathrm{plain}(r) \frac{p_\mathrm{axial}(\rho)}{p_\mathrm{plain}(\rho)} $$
//!
//! It is exact on the axis. Its error grows as the rim comes nearer to the lump, and is part of the
//! errors' covariance.

use std::sync::Arc;
use tactile_fem::SolvedFrames;

/// Where an inclusion is, seen from above, and how far its outline there is from a circle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Its middle (x, y) from the face's axis.
    pub centre_m: [f64; 2],
    /// Half the logarithm of the ratio of its axes, times cosine and sine of twice the angle from x
    /// to the longer one.
    pub elongation: [f64; 2],
    /// How far tissue that is pressed flows away from the axis and carries the inclusion with it,
    /// over its distance from the axis and the approach over the block's height.
    pub carried: f64,
}

impl Place {
    /// Distance from the middle in a plane that is stretched so that the outline is round, at some
    /// approach over the block's height.
    pub fn distance(&self, [x, y]: [f64; 2], squeezed: f64) -> f64 {
        let carried = 1.0 + self.carried * squeezed;
        let [dx, dy] = [
            x - carried * self.centre_m[0],
            y - carried * self.centre_m[1],
        ];
        let [a, b] = self.elongation;
        let size = a.hypot(b);
        // exp(−S) with S = (a b, b −a), whose square is the identity times a² + b².
        let even = size.cosh();
        let odd = if size > 0.0 { size.sinh() / size } else { 1.0 };
        let along_x = even * dx - odd * (a * dx + b * dy);
        let along_y = even * dy - odd * (b * dx - a * dy);
        along_x.hypot(along_y)
    }

    /// Distance of the middle from the axis.
    pub fn aside_m(&self) -> f64 {
        self.centre_m[0].hypot(self.centre_m[1])
    }
}

/// Cells of a face, and the plain block that carries a lump's pressure to them.
#[derive(Debug, Clone)]
pub struct Cells {
    /// (x, y) from the face's axis.
    pub positions_m: Arc<[[f64; 2]]>,
    /// The block without a lump, where it is solved.
    pub plain: Option<Arc<SolvedFrames>>,
    /// Each frame's approach over the block's height.
    pub squeezed: Vec<f64>,
    /// Radius up to which solutions with and without a lump are compared. Beyond, the rim's
    /// singular pressure differs between their meshes, and the ratio stays as it is there.
    pub reach_m: f64,
}

impl Cells {
    /// Pressures of a frame from those of a block with its lump at `place` under the axis, or
    /// without one.
    pub fn pressures(
        &self,
        frame: usize,
        place: Option<&Place>,
        axial: &impl Fn(f64) -> f64,
    ) -> Vec<f64> {
        let states = self.plain.as_ref().map(|plain| plain.states());
        let plain = states.and_then(|states| states.get(frame));
        let at = |&position: &[f64; 2]| {
            let radius = position[0].hypot(position[1]);
            match (place, plain) {
                (Some(place), Some(plain)) => {
                    let distance = place
                        .distance(position, self.squeezed[frame])
                        .min(self.reach_m);
                    plain.pressure_at(radius) * axial(distance) / plain.pressure_at(distance)
                }
                _ => axial(radius),
            }
        };
        self.positions_m.iter().map(at).collect()
    }

    /// How much more than a plain block's the pressure above the lump is, in the last frame,
    /// relative.
    pub fn lift(&self, with_lump: &SolvedFrames) -> f64 {
        let last = |frames: &SolvedFrames| frames.states().last().map(|s| s.pressure_at(0.0));
        let plain = self.plain.as_ref().and_then(|plain| last(plain));
        match (last(with_lump), plain) {
            (Some(with), Some(without)) if without > 0.0 => (with / without - 1.0).abs(),
            _ => 0.0,
        }
    }

    /// The place about which the measured pressures over the plain block's are most nearly
    /// symmetric: within half a cell of a lump's middle, where there is one.
    pub fn most_symmetric(&self, measured: &[f64], face_radius_m: f64) -> [f64; 2] {
        let Some(plain) = &self.plain else {
            return [0.0; 2];
        };
        let count = self.positions_m.len();
        let mut sums = vec![[0.0; 2]; count];
        for (frame, state) in plain.states().iter().enumerate() {
            let values = &measured[frame * count..(frame + 1) * count];
            for ((sum, value), [x, y]) in sums.iter_mut().zip(values).zip(&*self.positions_m) {
                sum[0] += value;
                sum[1] += state.pressure_at(x.hypot(*y));
            }
        }
        let ratios: Vec<f64> = sums.iter().map(|[with, without]| with / without).collect();
        // Steps of a first grid and of one around its best node, over the face's radius: a lump
        // that shows is wider than the first, and the fit goes on from the second.
        let steps = [1.0 / 16.0, 1.0 / 64.0];
        // Lumps further out than this part of the face's radius are cut by the used part's edge.
        let farthest = 0.75 * face_radius_m;
        let mut best = ([0.0; 2], f64::INFINITY);
        for (step, reach) in steps.into_iter().zip([12, 4]) {
            let middle: [f64; 2] = best.0;
            for i in -reach..=reach {
                for k in -reach..=reach {
                    let off = [i, k].map(|steps| f64::from(steps) * step * face_radius_m);
                    let centre = [middle[0] + off[0], middle[1] + off[1]];
                    if centre[0].hypot(centre[1]) <= farthest {
                        let scatter = self.scatter(&ratios, centre, steps[0] * face_radius_m);
                        if scatter < best.1 {
                            best = (centre, scatter);
                        }
                    }
                }
            }
        }
        best.0
    }

    /// Variance of values within rings of a given width around a centre.
    fn scatter(&self, values: &[f64], centre: [f64; 2], width_m: f64) -> f64 {
        // Number, sum and sum of squares in each ring.
        let mut rings: Vec<[f64; 3]> = Vec::new();
        for (value, [x, y]) in values.iter().zip(&*self.positions_m) {
            let ring = ((x - centre[0]).hypot(y - centre[1]) / width_m) as usize;
            if rings.len() <= ring {
                rings.resize(ring + 1, [0.0; 3]);
            }
            let sums = &mut rings[ring];
            sums[0] += 1.0;
            sums[1] += value;
            sums[2] += value * value;
        }
        let filled = rings.iter().filter(|ring| ring[0] > 0.0);
        let (mut squares, mut freedom) = (0.0, 0.0);
        for [count, sum, square] in filled {
            squares += square - sum * sum / count;
            freedom += count - 1.0;
        }
        squares / freedom
    }
}
