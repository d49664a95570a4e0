//! A first spread of points: the surface cut into strips of rows, the strips into cells of equal weight, a point in the
//! centroid of each.
//!
//! Cuts run through nodes: where the surface is the same but larger, or lies elsewhere between the pixels, the points
//! are the same points of the surface.

/// A grid of weights to be cut into cells.
pub(super) struct Weights<'a> {
    /// Row by row; 0 where there is no surface.
    pub(super) weight: &'a [f64],
    pub(super) columns: usize,
    /// Rows with a weight.
    pub(super) rows: usize,
    /// Pixels on the surface.
    pub(super) count: f64,
    /// Height of a pixel over its width.
    pub(super) aspect: f64,
}

/// Weight of a piece of a column, and its moment along the column.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    weight: f64,
    moment: f64,
}

/// Buffers, and the centroids found.
#[derive(Debug, Default)]
pub(super) struct Strips {
    rows: Cuts,
    cells: Cuts,
    pieces: Vec<Piece>,
    /// Centroids (x, y) in units of the lattice.
    pub(super) places: Vec<[f64; 2]>,
}

impl Strips {
    /// Finds the centroids of `points` cells of equal weight.
    pub(super) fn find(&mut self, grid: &Weights<'_>, points: usize) {
        let row_weight = |row: usize| {
            grid.weight[row * grid.columns..][..grid.columns]
                .iter()
                .sum()
        };
        let bands = bands(grid, points);
        let lines = grid.weight.len() / grid.columns;
        let share = |band: usize| (band * points / bands) as f64 / points as f64;
        self.rows
            .find((0..lines).map(row_weight), (1..=bands).map(share));
        self.pieces.clear();
        self.pieces.resize(grid.columns, Piece::default());
        self.places.clear();
        let mut top = 0.0;
        for band in 0..bands {
            let bottom = self.rows.at[band];
            gather(grid, top, bottom, &mut self.pieces);
            self.split((band + 1) * points / bands - band * points / bands);
            top = bottom;
        }
    }

    /// Cuts the strip gathered last into `cells` of equal weight; their centroids.
    fn split(&mut self, cells: usize) {
        let shares = (1..=cells).map(|cell| cell as f64 / cells as f64);
        self.cells
            .find(self.pieces.iter().map(|piece| piece.weight), shares);
        let mut from = 0.0;
        for &to in &self.cells.at {
            let (mut weight, mut x, mut y) = (0.0, 0.0, 0.0);
            for (column, share, middle) in parts(from, to, self.pieces.len()) {
                weight += share * self.pieces[column].weight;
                x += share * self.pieces[column].weight * middle;
                y += share * self.pieces[column].moment;
            }
            self.places.push([x / weight, y / weight]);
            from = to;
        }
    }
}

/// Number of strips that makes cells about as wide as high.
fn bands(grid: &Weights<'_>, points: usize) -> usize {
    let width = grid.count / grid.rows as f64;
    let square = points as f64 * grid.rows as f64 * grid.aspect / width;
    (square.sqrt().round() as usize).clamp(1, points)
}

/// Cuts of a line of nodes: node k covers [k, k + 1].
#[derive(Debug, Default)]
struct Cuts {
    weights: Vec<f64>,
    at: Vec<f64>,
}

impl Cuts {
    /// Where the running sum of `weights` reaches each of the rising `shares` of its total.
    fn find(&mut self, weights: impl Iterator<Item = f64>, shares: impl Iterator<Item = f64>) {
        let Self { weights: line, at } = self;
        line.clear();
        line.extend(weights);
        at.clear();
        let total: f64 = line.iter().sum();
        let (mut node, mut before) = (0, 0.0);
        at.extend(shares.map(|share| {
            while node + 1 < line.len() && before + line[node] < share * total {
                before += line[node];
                node += 1;
            }
            let part = if line[node] > 0.0 {
                (share * total - before) / line[node]
            } else {
                1.0
            };
            node as f64 + part.clamp(0.0, 1.0)
        }));
    }
}

/// Parts of the nodes between two cuts: node, share of it, middle of that share.
fn parts(from: f64, to: f64, nodes: usize) -> impl Iterator<Item = (usize, f64, f64)> {
    (from as usize..(to.ceil() as usize).min(nodes)).filter_map(move |node| {
        let (low, high) = (from.max(node as f64), to.min(node as f64 + 1.0));
        (high > low).then_some((node, high - low, 0.5 * (low + high) - 0.5))
    })
}

/// Sums the columns of the strip between two cuts.
fn gather(grid: &Weights<'_>, top: f64, bottom: f64, strip: &mut [Piece]) {
    strip.fill(Piece::default());
    for (row, share, middle) in parts(top, bottom, grid.weight.len() / grid.columns) {
        let weights = &grid.weight[row * grid.columns..][..grid.columns];
        for (piece, weight) in strip.iter_mut().zip(weights) {
            piece.weight += share * weight;
            piece.moment += share * weight * middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_run_through_nodes() {
        let mut cuts = Cuts::default();
        cuts.find(
            [1.0, 0.0, 2.0, 1.0].into_iter(),
            [0.125, 0.25, 0.5, 1.0].into_iter(),
        );
        assert_eq!(cuts.at, [0.5, 1.0, 2.5, 4.0]);
        // Without any weight they are numbers all the same.
        cuts.find([0.0; 3].into_iter(), [0.5, 1.0].into_iter());
        assert_eq!(cuts.at, [1.0, 1.0]);
    }

    #[test]
    fn the_centroid_of_one_cell_is_that_of_all() {
        let pieces = [1.0, 3.0]
            .map(|weight| Piece {
                weight,
                moment: 2.0 * weight,
            })
            .to_vec();
        let mut strips = Strips {
            pieces,
            ..Strips::default()
        };
        strips.split(1);
        assert_eq!(strips.places, [[0.75, 2.0]]);
    }
}
