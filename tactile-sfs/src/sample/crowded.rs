//! Points nearly as dense as the nodes: strips of rows, and runs of whole nodes of equal weight within them.

use super::lattice::Lattice;
use crate::Scalar;

/// Chooses one node from the middle of each of `points` cells of equal weight; `all` is a buffer for the nodes.
pub(super) fn cut<T: Scalar>(
    lattice: &Lattice<'_, T>,
    points: usize,
    all: &mut Vec<usize>,
    chosen: &mut Vec<usize>,
) {
    all.clear();
    all.extend(lattice.nodes());
    chosen.clear();
    let weight = |node: &usize| lattice.weight[*node];
    let total: f64 = all.iter().map(weight).sum();
    let width = all.len() as f64 / lattice.rows as f64;
    let bands = (points as f64 * lattice.rows as f64 * lattice.aspect() / width)
        .sqrt()
        .round() as usize;
    let bands = bands.clamp(1, points);
    let (mut start, mut done) = (0, 0.0);
    for band in 0..bands {
        // The band gets its share of points and of weight, and leaves a node for every point still to come.
        let (before, after) = (band * points / bands, (band + 1) * points / bands);
        let goal = total * after as f64 / points as f64;
        let last = if band + 1 == bands {
            all.len()
        } else {
            all.len() - (points - after)
        };
        let mut end = start;
        while end < last && (done < goal || end < start + after - before || band + 1 == bands) {
            done += weight(&all[end]);
            end += 1;
        }
        let cells = &mut all[start..end];
        cells.sort_unstable_by_key(|node| (node % lattice.columns, node / lattice.columns));
        pick(lattice, cells, after - before, chosen);
        start = end;
    }
}

/// The middle node of each of `points` runs of equal weight.
fn pick<T: Scalar>(
    lattice: &Lattice<'_, T>,
    cells: &[usize],
    points: usize,
    chosen: &mut Vec<usize>,
) {
    let weight = |node: usize| lattice.weight[node];
    let total: f64 = cells.iter().map(|&node| weight(node)).sum();
    let (mut start, mut done) = (0, 0.0);
    for point in 0..points {
        let goal = total * (point + 1) as f64 / points as f64;
        let last = cells.len() - (points - point - 1);
        let mut end = start + 1;
        done += weight(cells[start]);
        while end < last && done < goal {
            done += weight(cells[end]);
            end += 1;
        }
        chosen.extend(middle(&cells[start..end], lattice.columns));
        start = end;
    }
}

/// The node of a run nearest to its centroid.
fn middle(run: &[usize], columns: usize) -> Option<usize> {
    let place = |node: usize| [(node / columns) as f64, (node % columns) as f64];
    let [row, column] = [0, 1]
        .map(|axis| run.iter().map(|&node| place(node)[axis]).sum::<f64>() / run.len() as f64);
    let distance = |node: usize| (place(node)[0] - row).powi(2) + (place(node)[1] - column).powi(2);
    run.iter()
        .copied()
        .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
}
