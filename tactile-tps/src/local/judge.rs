//! Which pairs contradict their neighbours.

use super::{BLOCK, Found, Point, SVector, nearest_rows, tree::Tree};

/// Standard deviations from the prediction by the others. Fewer drop the largest residuals of a
/// steep field, whose noise is not Gaussian.
const DEVIATIONS: f64 = 6.0;

/// A pair that lies so near to its place, in spacings, does no harm, whatever its neighbours' noise.
const NEAR: f64 = 0.15;

/// Neighbours that may have moved along. Beside a straight crack half of them did.
const NEIGHBOURS: usize = 8;

/// So many of them show that a pair is right: two wrong pairs may meet by chance.
const COMPANY: usize = 3;

/// A neighbour moved along if it did to this share of the distance from the prediction.
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
        // Median of χ² with D degrees, by Wilson and Hilferty.
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
        // Beside a jump a pair is far from the prediction, and moved as those on its side.
        let agrees = |&&j: &&usize| {
            let along = found[i].trend * (sources[i] - sources[j]);
            let apart = displacements[i] - displacements[j] - along;
            j != i && apart.norm() < ALONG * found[i].distance
        };
        wrong[i] = near.iter().filter(agrees).count() < COMPANY;
    }
    wrong
}
