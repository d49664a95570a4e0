//! A first spread of points: the surface cut into strips of rows, the strips into cells of equal weight, a point in the
//! centroid of each.
//!
//! Cuts run through nodes: where the surface is the same but larger, or lies elsewhere between the pixels, the points
//! are the same points of the surface.

use super::lattice::Lattice;
use crate::Scalar;

/// Weight of a piece of a column, and its moment along the column.
#[derive(Clone, Copy, Default)]
struct Piece {
    weight: f64,
    moment: f64,
}

/// The centroids (x, y) of `points` cells of equal weight, in units of the lattice.
pub(super) fn centroids<T: Scalar>(lattice: &Lattice<'_, T>, points: usize) -> Vec<[f64; 2]> {
    let row_weight = |row: usize| lattice.weight[row * lattice.columns..][..lattice.columns].iter().sum();
    let rows: Vec<f64> = (0..lattice.rows).map(row_weight).collect();
    let bands = bands(lattice, points);
    let shares: Vec<f64> = (1..=bands).map(|band| (band * points / bands) as f64 / points as f64).collect();
    let cuts = cuts(&rows, &shares);
    let mut strip = vec![Piece::default(); lattice.columns];
    let mut found = Vec::with_capacity(points);
    for band in 0..bands {
        let top = if band == 0 { 0.0 } else { cuts[band - 1] };
        gather(lattice, top, cuts[band], &mut strip);
        split(&strip, (band + 1) * points / bands - band * points / bands, &mut found);
    }
    found
}

/// Number of strips that makes cells about as wide as high.
fn bands<T: Scalar>(lattice: &Lattice<'_, T>, points: usize) -> usize {
    let width = lattice.count as f64 / lattice.rows as f64;
    let square = points as f64 * lattice.rows as f64 * lattice.aspect() / width;
    (square.sqrt().round() as usize).clamp(1, points)
}

/// Where the running sum of `weights` reaches each of the rising `shares` of its total: node k covers [k, k + 1].
fn cuts(weights: &[f64], shares: &[f64]) -> Vec<f64> {
    let total: f64 = weights.iter().sum();
    let (mut node, mut before) = (0, 0.0);
    let reach = |share: &f64| {
        while node + 1 < weights.len() && before + weights[node] < share * total {
            before += weights[node];
            node += 1;
        }
        let part = if weights[node] > 0.0 { (share * total - before) / weights[node] } else { 1.0 };
        node as f64 + part.clamp(0.0, 1.0)
    };
    shares.iter().map(reach).collect()
}

/// Parts of the nodes between two cuts: node, share of it, middle of that share.
fn parts(from: f64, to: f64, nodes: usize) -> impl Iterator<Item = (usize, f64, f64)> {
    (from as usize..(to.ceil() as usize).min(nodes)).filter_map(move |node| {
        let (low, high) = (from.max(node as f64), to.min(node as f64 + 1.0));
        (high > low).then_some((node, high - low, 0.5 * (low + high) - 0.5))
    })
}

/// Sums the columns of the strip between two cuts.
fn gather<T: Scalar>(lattice: &Lattice<'_, T>, top: f64, bottom: f64, strip: &mut [Piece]) {
    strip.fill(Piece::default());
    for (row, share, middle) in parts(top, bottom, lattice.rows) {
        let weights = &lattice.weight[row * lattice.columns..][..lattice.columns];
        for (piece, weight) in strip.iter_mut().zip(weights) {
            piece.weight += share * weight;
            piece.moment += share * weight * middle;
        }
    }
}

/// Cuts a strip into `cells` of equal weight; their centroids.
fn split(strip: &[Piece], cells: usize, found: &mut Vec<[f64; 2]>) {
    let weights: Vec<f64> = strip.iter().map(|piece| piece.weight).collect();
    let shares: Vec<f64> = (1..=cells).map(|cell| cell as f64 / cells as f64).collect();
    let mut from = 0.0;
    for to in cuts(&weights, &shares) {
        let (mut weight, mut x, mut y) = (0.0, 0.0, 0.0);
        for (column, share, middle) in parts(from, to, strip.len()) {
            weight += share * strip[column].weight;
            x += share * strip[column].weight * middle;
            y += share * strip[column].moment;
        }
        found.push([x / weight, y / weight]);
        from = to;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_run_through_nodes() {
        assert_eq!(cuts(&[1.0, 0.0, 2.0, 1.0], &[0.125, 0.25, 0.5, 1.0]), [0.5, 1.0, 2.5, 4.0]);
    }

    #[test]
    fn the_centroid_of_one_cell_is_that_of_all() {
        let strip = [1.0, 3.0].map(|weight| Piece { weight, moment: 2.0 * weight });
        let mut found = Vec::new();
        split(&strip, 1, &mut found);
        assert_eq!(found, [[0.75, 2.0]]);
    }
}
