//! Detection of pairs that contradict their neighbours.

use super::{BLOCK, Found, Point, SVector, nearest_rows, tree::Tree};

/// Maximum deviation from the prediction by the other pairs, in standard deviations. A smaller
/// limit would reject the largest residuals of a steep field, whose noise is not Gaussian.
const DEVIATIONS: f64 = 6.0;

/// A pair this close to its prediction, in spacings, does no harm, whatever the noise of its
/// neighbours.
const NEAR: f64 = 0.15;

/// Number of neighbours that are checked for a common motion. Next to a straight crack, half of
/// them have it.
const NEIGHBOURS: usize = 8;

/// Number of neighbours with a common motion that confirm a pair: two wrong pairs may agree by
/// chance.
const COMPANY: usize = 3;

/// A neighbour shares the motion if it agrees within this fraction of the distance from the
/// prediction.
const ALONG: f64 = 0.3;

/// Whether each pair contradicts its neighbours.
pub(super) fn contradicted<const D: usize>(
    found: &[Found<D>],
    sources: &[Point<f64, D>],
    displacements: &[SVector<f64, D>],
) -> Vec<bool> {
    let mut wrong = vec![false; found.len()];
    let blocks = Tree::new(sources, (0..sources.len()).collect(), BLOCK);
    let mut suspects: Vec<usize> = Vec::new();
    for block in blocks.leaves() {
        let mut misfits: Vec<f64> = block.iter().map(|&i| found[i].misfit).collect();
        let middle = misfits.len() / 2;
        let median = *misfits.select_nth_unstable_by(middle, f64::total_cmp).1;
        // Median of χ² with D degrees of freedom, by Wilson and Hilferty.
        let usual = D as f64 * (1.0 - 2.0 / (9.0 * D as f64)).powi(3);
        let limit = DEVIATIONS * DEVIATIONS * median / usual;
        let suspect = |&&i: &&usize| {
            found[i].misfit > limit && found[i].distance > NEAR * found[i].value.spacing
        };
        suspects.extend(block.iter().filter(suspect));
    }
    let places: Vec<_> = suspects.iter().map(|&i| sources[i]).collect();
    let near = nearest_rows(sources, &places, NEIGHBOURS + 1);
    for (i, near) in suspects.into_iter().zip(near) {
        // Next to a jump, a pair is far from the prediction but moves like the pairs on its side.
        let agrees = |&&j: &&usize| {
            let along = found[i].trend * (sources[i] - sources[j]);
            let apart = displacements[i] - displacements[j] - along;
            j != i && apart.norm() < ALONG * found[i].distance
        };
        wrong[i] = near.iter().filter(agrees).count() < COMPANY;
    }
    wrong
}
