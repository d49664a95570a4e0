//! Pressure over the whole face, with an off-axis lump.
//!
//! The block is solved with the lump on the axis, and again without a lump. With r the distance
//! from the axis and ρ that from the lump, the pressure for any position of the lump is
//!
//! $$ p(x, y) = p_\mathrm{plain}(r) \frac{p_\mathrm{axial}(\rho)}{p_\mathrm{plain}(\rho)} $$
//!
//! This is exact on the axis. Off the axis, the load spreads below the face. All lengths are in
//! radii of the face. Let x and z be the distances of the lump's centre from the axis and from the
//! face, and s the outward component of the distance from its apparent position. The lump then
//! appears at x/(1 + k z³), and ρ is this distance times (1 + n (x z)²)(1 + m (1 − 3 x²) x z s).
//! The constants k, n and m were fitted to blocks with a lump that were solved in three dimensions.
//! The remaining error grows as the lump approaches the rim, and is part of the covariance.

use crate::parameters::{Coordinate, Parameters, Place};
use std::sync::Arc;
use tactile_fem::{FrameResponse, SolvedFrames};

/// Excess of the ratio's outward decay over its inward decay, relative to the product of the
/// centre's depth z, its distance x from the axis and the distance from it, in radii of the face,
/// and to 1 − 3 x²: towards the rim both are equal. Solutions in three dimensions give 0.5 to 0.85.
const SKEW: f64 = 0.7;

/// Narrowing of the ratio compared with the axis, relative to the square of the product of the
/// centre's depth and its distance from the axis, in radii of the face. Solutions in three
/// dimensions give 0.1 to 0.6.
const NARROWED: f64 = 0.5;

impl Place {
    /// Distance from the axis at which the inclusion appears on the face, relative to its true
    /// distance, because the load on it comes from nearer to the axis. `squeezed` is the approach
    /// over the block's height, `depth` that of the centre in radii of the face.
    fn shown(&self, squeezed: f64, depth: f64) -> f64 {
        (1.0 + self.carried * squeezed) / (1.0 + self.spread * depth.powi(3))
    }

    /// The equivalent distance from an inclusion on the axis for the ratio at (x, y), in a plane
    /// that is stretched so that the outline is round.
    pub(crate) fn distance(&self, [x, y]: [f64; 2], squeezed: f64, depth: f64, face_m: f64) -> f64 {
        let shown = self.shown(squeezed, depth);
        let [dx, dy] = [x - shown * self.centre_m[0], y - shown * self.centre_m[1]];
        // No lump further out was solved.
        let aside = (self.aside_m() / face_m).min(0.6);
        let outwards = (dx * self.centre_m[0] + dy * self.centre_m[1]) / face_m.powi(2);
        let skew = SKEW * depth * (1.0 - 3.0 * aside.powi(2)).max(0.0);
        let narrowed = 1.0 + NARROWED * (depth * aside).powi(2);
        // Far on the inner side, the skew would reverse the distance.
        let scale = narrowed * (1.0 + skew * outwards).max(0.5);
        let [a, b] = self.elongation;
        let size = a.hypot(b);
        // exp(−S) with S = (a b, b −a), whose square is the identity times a² + b².
        let even = size.cosh();
        let odd = if size > 0.0 { size.sinh() / size } else { 1.0 };
        let along_x = even * dx - odd * (a * dx + b * dy);
        let along_y = even * dy - odd * (b * dx - a * dy);
        scale * along_x.hypot(along_y)
    }

    /// Distance of the centre from the axis.
    pub(crate) fn aside_m(&self) -> f64 {
        self.centre_m[0].hypot(self.centre_m[1])
    }
}

/// Centres of a face's cells, or of the cells of one face pressed at several positions.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CellPositions {
    /// (x, y) relative to the axis of the face.
    pub positions_m: Vec<[f64; 2]>,
    /// The press to which each cell belongs.
    pub presses: Vec<usize>,
    /// Stated position of the axis of each press.
    pub axes_m: Vec<[f64; 2]>,
}

impl CellPositions {
    /// Position of the axis of a press.
    pub(crate) fn axis_m(&self, press: usize, block: &Parameters) -> [f64; 2] {
        let strayed = block.strayed_m.get(press).copied().unwrap_or_default();
        [0, 1].map(|k| self.axes_m[press][k] + strayed[k])
    }

    /// Distances of the inclusion's centre from the axis of each press.
    pub(crate) fn asides_m(&self, block: &Parameters) -> Vec<f64> {
        let [x, y] = block.place.centre_m;
        let axes_m = (0..self.axes_m.len()).map(|press| self.axis_m(press, block));
        axes_m.map(|[a, b]| (x - a).hypot(y - b)).collect()
    }
}

/// A block without a lump.
#[derive(Debug, Clone)]
pub(crate) struct PlainBlock {
    pub frames: SolvedFrames,
    /// Its pressures by the tangent, the reference for those after a change.
    pub unchanged: Vec<FrameResponse>,
    /// Coordinates of the block with their values, a small step of each, and the pressures after
    /// this step.
    pub changes: Vec<(Coordinate, f64, f64, Vec<FrameResponse>)>,
}

impl PlainBlock {
    /// Pressure of a frame at a distance from the axis, scaled from that of the solved block:
    /// pressures are nearly proportional to powers of moduli and lengths.
    fn pressure_at(&self, frame: usize, radius_m: f64, block: &Parameters) -> f64 {
        let pressure = self.frames.states()[frame].pressure_at(radius_m);
        let before = self.unchanged[frame].pressure_at(radius_m);
        let exponent = self.changes.iter().map(|(coordinate, value, step, after)| {
            let slope = (after[frame].pressure_at(radius_m) / before).ln() / step;
            slope * (block.get(*coordinate) - value)
        });
        pressure * exponent.sum::<f64>().exp()
    }
}

/// Cells, and the plain block with which a lump's pressure is transferred to them.
#[derive(Debug, Clone)]
pub(crate) struct Cells {
    pub positions: Arc<CellPositions>,
    /// The block without a lump. `None` before it is solved.
    pub plain: Option<Arc<PlainBlock>>,
    /// Approach of each frame over the block's height.
    pub squeezed: Vec<f64>,
    pub face_radius_m: f64,
    /// Radius up to which solutions with and without a lump are compared. Outside, the singular
    /// pressure at the rim differs between their meshes.
    pub reach_m: f64,
}

/// Centre of the smallest box around points, and half its longer side.
pub(crate) fn extent(points: &[[f64; 2]]) -> ([f64; 2], f64) {
    let range = |k: usize| {
        let values = points.iter().map(|point| point[k]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    };
    let [x, y] = [range(0), range(1)];
    let middle = [0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])];
    (middle, 0.5 * (x[1] - x[0]).max(y[1] - y[0]))
}

impl Cells {
    /// Pressures of a frame from those of a block with its lump on the axis, or without one, and
    /// from those with a second lump there.
    pub(crate) fn pressures(
        &self,
        frame: usize,
        parameters: &Parameters,
        axial: &dyn Fn(f64) -> f64,
        axial_of_second: &dyn Fn(f64) -> f64,
    ) -> Vec<f64> {
        let CellPositions {
            positions_m,
            presses,
            ..
        } = &*self.positions;
        let radius = |[x, y]: [f64; 2]| x.hypot(y);
        let Some(plain) = self.plain.as_ref().filter(|_| parameters.lump.is_some()) else {
            return positions_m.iter().map(|at| axial(radius(*at))).collect();
        };
        let second = parameters.second.map(|_| parameters.swapped());
        let of_first = self.ratio(plain, frame, parameters, axial);
        let of_second = (second.as_ref()).map(|s| self.ratio(plain, frame, s, axial_of_second));
        let at = |(&position, &press): (&[f64; 2], &usize)| {
            let axis = self.positions.axis_m(press, parameters);
            plain.pressure_at(frame, radius(position), parameters)
                * of_first(position, axis)
                * of_second
                    .as_ref()
                    .map_or(1.0, |ratio| ratio(position, axis))
        };
        positions_m.iter().zip(presses).map(at).collect()
    }

    /// Ratio of a frame's pressure with a lump to that of a plain block, at a cell's distance from
    /// an axis. `axial` is the pressure with the lump on the axis.
    fn ratio<'a>(
        &'a self,
        plain: &'a PlainBlock,
        frame: usize,
        block: &'a Parameters,
        axial: &'a dyn Fn(f64) -> f64,
    ) -> impl Fn([f64; 2], [f64; 2]) -> f64 + 'a {
        let middle_m = (block.lump).map_or(0.0, |lump| lump.depth_m + 0.5 * lump.axes_m()[1]);
        let (squeezed, face_m) = (self.squeezed[frame], self.face_radius_m);
        let inside =
            move |distance: f64| axial(distance) / plain.pressure_at(frame, distance, block);
        // Outside the edge the slope continues and fades, as it does between the edge and the rim.
        let (step, length) = (face_m / 16.0, face_m / 5.0);
        let edge = inside(self.reach_m);
        let slope = (edge - inside(self.reach_m - step)) / step;
        move |position, axis| {
            let place = Place {
                centre_m: [0, 1].map(|k| block.place.centre_m[k] - axis[k]),
                ..block.place
            };
            let distance = place.distance(position, squeezed, middle_m / face_m, face_m);
            let beyond = distance - self.reach_m;
            let ratio = if beyond > 0.0 {
                edge + slope * length * (1.0 - (-beyond / length).exp())
            } else {
                inside(distance)
            };
            1.0 + self.fade(place.aside_m(), distance) * (ratio - 1.0)
        }
    }

    /// Remaining fraction of a lump's contribution at a distance from it, if it is far from the
    /// axis. It falls with the third power of the distance, like that of a force pair under the
    /// surface.
    pub(crate) fn fade(&self, aside_m: f64, distance_m: f64) -> f64 {
        // Between the edge of the used part and twice this radius, a lump leaves the region under
        // the face.
        let beyond = (aside_m / self.reach_m - 1.0).clamp(0.0, 1.0);
        let far = (self.reach_m / distance_m.max(self.reach_m)).powi(3);
        1.0 - beyond * (1.0 - far)
    }

    /// Whether a sixth of an inclusion lies outside the used part of the face in every press. Two
    /// presses whose used parts cover its centre show it from two sides.
    pub(crate) fn is_at_rim(&self, parameters: &Parameters) -> bool {
        let Some(lump) = parameters.lump else {
            return false;
        };
        let asides = self.positions.asides_m(parameters);
        let is_cut = |aside: &f64| aside + lump.diameter_m / 3.0 > self.reach_m;
        asides.iter().all(is_cut) && asides.iter().filter(|a| **a < self.reach_m).count() < 2
    }

    /// Relative excess of the pressure above the lump over that of a plain block, in the last
    /// frame.
    pub(crate) fn lift(&self, with_lump: &SolvedFrames) -> f64 {
        let last = |frames: &SolvedFrames| frames.states().last().map(|s| s.pressure_at(0.0));
        let plain = self.plain.as_ref().and_then(|plain| last(&plain.frames));
        match (last(with_lump), plain) {
            (Some(with), Some(without)) if without > 0.0 => (with / without - 1.0).abs(),
            _ => 0.0,
        }
    }

    /// The position about which the measured pressures, relative to the plain block, are most
    /// nearly symmetric. If there is a lump, its centre is within half a cell of it.
    pub(crate) fn most_symmetric(&self, measured: &[f64]) -> [f64; 2] {
        let Some(plain) = &self.plain else {
            return [0.0; 2];
        };
        let CellPositions {
            positions_m,
            axes_m,
            ..
        } = &*self.positions;
        let count = positions_m.len();
        let mut sums = vec![[0.0; 2]; count];
        for (frame, state) in plain.frames.states().iter().enumerate() {
            let values = &measured[frame * count..(frame + 1) * count];
            for ((sum, value), [x, y]) in sums.iter_mut().zip(values).zip(positions_m) {
                sum[0] += value;
                sum[1] += state.pressure_at(x.hypot(*y));
            }
        }
        let ratios: Vec<f64> = sums.iter().map(|[with, without]| with / without).collect();
        // Steps of a first grid and of one around its best node, relative to the face radius. A
        // detectable lump is wider than the first, and the fit refines the second.
        let steps = [1.0 / 16.0, 1.0 / 64.0];
        // Lumps further out than this fraction of the face radius are cut by the edge of the used
        // part.
        let face_radius_m = self.face_radius_m;
        let farthest = 0.75 * face_radius_m;
        let is_under =
            |[x, y]: [f64; 2]| (axes_m.iter()).any(|a| (x - a[0]).hypot(y - a[1]) <= farthest);
        let (middle, half_width) = extent(axes_m);
        let wide = 12 + (half_width / (steps[0] * face_radius_m)).ceil() as i32;
        let mut best = (middle, f64::INFINITY);
        for (step, reach) in steps.into_iter().zip([wide, 4]) {
            let middle: [f64; 2] = best.0;
            for i in -reach..=reach {
                for k in -reach..=reach {
                    let off = [i, k].map(|steps| f64::from(steps) * step * face_radius_m);
                    let centre = [middle[0] + off[0], middle[1] + off[1]];
                    if is_under(centre) {
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
        let CellPositions {
            positions_m,
            presses,
            axes_m,
        } = &*self.positions;
        let cells = positions_m.iter().zip(presses);
        for (value, ([x, y], press)) in values.iter().zip(cells) {
            let off = [0, 1].map(|k| axes_m[*press][k] - centre[k]);
            let ring = ((x + off[0]).hypot(y + off[1]) / width_m) as usize;
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
