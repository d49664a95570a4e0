//! Shape contexts: the distribution of the other points of a set as seen from each point.
//!
//! The context of a point is a histogram of the vectors to all other points, in bins of
//! log-distance and direction [Belongie, Malik & Puzicha, *Shape matching and object recognition
//! using shape contexts*, PAMI 24 (2002)]. Two contexts are compared by the χ² distance
//! `½ Σ (g − h)²/(g + h)` of the histograms, divided by their mean count. The directions are twelve
//! sectors in the plane, and the 26 neighbours of a cube's centre in space. In the plane, points
//! between two sectors contribute to both in proportion, so that a small rotation changes the
//! histogram only a little.

use crate::{MatchError, error};
use nalgebra::Point;
use tactile_core::vectorised;

/// Radial bins: the outermost ends at the largest radius, and each further one at half the previous
/// radius.
const SHELLS: usize = 5;
/// The number of bins is padded to a multiple of this.
const LANES: usize = 16;

/// The shape contexts of a point set.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::ShapeContexts;
/// # fn main() -> Result<(), tactile_match::MatchError> {
/// let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.3, 0.45]].map(Point2::from);
/// let moved = square.map(|p| Point2::new(p.x + 7.0, p.y - 2.0));
/// let (a, b) = (ShapeContexts::new(&square, 2.0)?, ShapeContexts::new(&moved, 2.0)?);
/// let mut costs = Vec::new();
/// a.costs_into(4, &b, &mut costs);
/// assert!(costs[4] < 1e-6 && costs[0] > 0.1);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapeContexts {
    bins: usize,
    width: usize,
    histograms: Vec<f32>,
    totals: Vec<f32>,
}

impl ShapeContexts {
    /// Computes the contexts of all `points` from neighbours up to `radius` away: `O(n²)`.
    ///
    /// # Errors
    /// [`MatchError::NotFinite`] for a coordinate that is not finite, [`MatchError::InvalidOption`]
    /// for a radius that is not positive and finite.
    pub fn new<const D: usize>(points: &[Point<f64, D>], radius: f64) -> Result<Self, MatchError> {
        error::option_within("radius", radius, f64::MIN_POSITIVE, f64::MAX, "(0, ∞)")?;
        if !points.is_empty() {
            error::point_set("model", points)?;
        }
        let plain: Vec<[f64; D]> = points
            .iter()
            .map(|p| std::array::from_fn(|k| p[k]))
            .collect();
        let mut contexts = Self::default();
        contexts.build(&plain, radius);
        Ok(contexts)
    }

    /// The histogram of point `i`, in shells from the innermost outwards.
    #[cfg(test)]
    fn histogram(&self, i: usize) -> &[f32] {
        &self.histograms[i * self.width..i * self.width + self.bins]
    }

    /// χ² distance between the context of point `i` here and that of point `j` in `other`, in [0,
    /// 1].
    #[must_use]
    pub(crate) fn cost(&self, i: usize, other: &Self, j: usize) -> f32 {
        let (g, h) = (self.row(i), other.row(j));
        chi_squared(g, h) / (self.totals[i] + other.totals[j]).max(1.0)
    }

    /// Writes the costs of point `i` and all points of `other` into `costs`: the χ² distances of
    /// their contexts, in [0, 1].
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_match::ShapeContexts;
    /// let points =
    ///     [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.3, 0.45]].map(Point2::from);
    /// let contexts = ShapeContexts::new(&points, 2.0)?;
    /// let mut costs = Vec::new();
    /// contexts.costs_into(4, &contexts, &mut costs);
    /// assert!(costs[4] < 1e-6 && costs[..4].iter().all(|&c| c > 0.1));
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    pub fn costs_into(&self, i: usize, other: &Self, costs: &mut Vec<f32>) {
        costs.clear();
        let (g, total) = (self.row(i), self.totals[i]);
        vectorised(
            #[inline(always)]
            || {
                let rows = other.histograms.chunks_exact(other.width.max(1));
                costs.extend(
                    rows.zip(&other.totals)
                        .map(|(h, t)| chi_squared(g, h) / (total + t).max(1.0)),
                );
            },
        );
    }

    fn row(&self, i: usize) -> &[f32] {
        &self.histograms[i * self.width..(i + 1) * self.width]
    }

    /// Recomputes the contexts, reusing the memory.
    pub(crate) fn build<const D: usize>(&mut self, points: &[[f64; D]], radius: f64) {
        self.bins = SHELLS * sectors::<D>();
        self.width = self.bins.next_multiple_of(LANES);
        self.histograms.clear();
        self.histograms.resize(points.len() * self.width, 0.0);
        self.totals.clear();
        for (i, p) in points.iter().enumerate() {
            let histogram = &mut self.histograms[i * self.width..(i + 1) * self.width];
            for q in points {
                let offset: [f64; D] = std::array::from_fn(|k| q[k] - p[k]);
                count(histogram, &offset, radius);
            }
            self.totals.push(histogram.iter().sum());
        }
    }
}

fn sectors<const D: usize>() -> usize {
    match D {
        2 => 12,
        3 => 26,
        _ => 2 * D,
    }
}

/// Adds one neighbour to a histogram. Coincident points and points beyond the radius are skipped.
fn count<const D: usize>(histogram: &mut [f32], offset: &[f64; D], radius: f64) {
    let square = offset.iter().map(|v| v * v).sum::<f64>() / (radius * radius);
    if square <= 0.0 || square > 1.0 {
        return;
    }
    let shell = (0.5 * square.log2() + SHELLS as f64).clamp(0.0, SHELLS as f64 - 1.0) as usize;
    let shell = &mut histogram[shell * sectors::<D>()..];
    if D == 2 {
        let turn = (offset[1].atan2(offset[0]) / std::f64::consts::TAU + 1.0) * 12.0 - 0.5;
        let share = (turn - turn.floor()) as f32;
        let sector = turn as usize % 12;
        shell[sector] += 1.0 - share;
        shell[(sector + 1) % 12] += share;
    } else {
        shell[sector(offset)] += 1.0;
    }
}

/// The direction at the smallest angle: one of the 26 neighbours of a cube's centre, or the axes in
/// other dimensions.
fn sector<const D: usize>(offset: &[f64; D]) -> usize {
    let best = |a: (f64, usize), b: (f64, usize)| if b.0 > a.0 { b } else { a };
    if D != 3 {
        let axis = (0..D).map(|k| (offset[k].abs(), 2 * k + usize::from(offset[k] < 0.0)));
        return axis.fold((-1.0, 0), best).1;
    }
    // With the components sorted by size, the nearest of (1,0,0), (1,1,0)/√2 and (1,1,1)/√3 has the
    // largest scalar product.
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| offset[b].abs().total_cmp(&offset[a].abs()));
    let (mut sum, mut choice) = (0.0, (-1.0, 0));
    for (axes, root) in [1.0, std::f64::consts::SQRT_2, 1.732_050_807_568_877_2]
        .into_iter()
        .enumerate()
    {
        sum += offset[order[axes]].abs();
        choice = best(choice, (sum / root, axes));
    }
    let mut code = [1_usize; 3];
    for &k in &order[..=choice.1] {
        code[k] = if offset[k] < 0.0 { 0 } else { 2 };
    }
    let index = code[0] * 9 + code[1] * 3 + code[2];
    if index > 13 { index - 1 } else { index }
}

#[inline(always)]
fn chi_squared(g: &[f32], h: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for (x, y) in g.chunks_exact(LANES).zip(h.chunks_exact(LANES)) {
        for l in 0..LANES {
            let difference = x[l] - y[l];
            sums[l] += difference * difference / (x[l] + y[l] + 1e-9);
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point2, Point3};

    #[test]
    fn every_neighbour_within_the_radius_is_counted_once() {
        let points: Vec<Point2<f64>> = (0..30)
            .map(|i| Point2::new(f64::from(i % 6), f64::from(i / 6)))
            .collect();
        let contexts = ShapeContexts::new(&points, 3.0).unwrap();
        for (i, p) in points.iter().enumerate() {
            let near = points
                .iter()
                .filter(|q| (1e-9..=3.0).contains(&(*q - p).norm()))
                .count();
            // The fractions of each unit count are summed in single precision.
            assert!((contexts.histogram(i).iter().sum::<f32>() - near as f32).abs() < 1e-4);
        }
    }

    #[test]
    fn the_sectors_of_space_are_the_nearest_directions() {
        let mut directions = Vec::new();
        for code in (0..27).filter(|&c| c != 13) {
            directions.push([code / 9 - 1, code / 3 % 3 - 1, code % 3 - 1].map(f64::from));
        }
        for (index, d) in directions.iter().enumerate() {
            assert_eq!(sector(d), index);
        }
        for i in 0..200 {
            let v = [
                (i as f64).sin(),
                (1.7 * i as f64).cos(),
                (0.3 * i as f64).sin() - 0.2,
            ];
            let along = |d: &[f64; 3]| {
                let dot: f64 = (0..3).map(|k| d[k] * v[k]).sum();
                dot / d.iter().map(|x| x * x).sum::<f64>().sqrt()
            };
            let best = directions.iter().map(along).fold(f64::MIN, f64::max);
            // The same scalar products, rounded in another order.
            assert!((along(&directions[sector(&v)]) - best).abs() < 1e-12);
        }
    }

    #[test]
    fn costs_are_symmetric_and_zero_for_the_same_context() {
        let points: Vec<Point3<f64>> = (0..20)
            .map(|i| Point3::new((i as f64).sin(), (2.1 * i as f64).cos(), 0.1 * i as f64))
            .collect();
        let contexts = ShapeContexts::new(&points, 2.0).unwrap();
        let mut costs = vec![Vec::new(); 20];
        for i in 0..20 {
            contexts.costs_into(i, &contexts, &mut costs[i]);
        }
        for i in 0..20 {
            assert_eq!(costs[i][i], 0.0);
            for j in 0..20 {
                // The sums over 16 lanes are in single precision.
                assert!((costs[i][j] - costs[j][i]).abs() < 1e-5 && costs[i][j] <= 1.0);
            }
        }
    }

    #[test]
    fn a_radius_that_is_not_positive_is_refused() {
        for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(ShapeContexts::new(&[Point2::new(0.0, 0.0)], radius).is_err());
        }
    }
}
