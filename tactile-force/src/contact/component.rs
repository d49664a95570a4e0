//! The largest connected part of a mask, with its holes filled.

/// Scratch of a labelling.
#[derive(Clone, Debug, Default)]
pub(super) struct Components {
    label: Vec<u32>,
    stack: Vec<usize>,
}

impl Components {
    /// Keeps the largest 8-connected component of `mask` (1 inside, 0 outside) and fills what it encloses. Returns its
    /// area with holes filled.
    pub(super) fn keep_largest(&mut self, mask: &mut [u8], columns: usize) -> usize {
        self.label.clear();
        self.label.resize(mask.len(), 0);
        let (mut best, mut best_area, mut next) = (0, 0, 0);
        for seed in 0..mask.len() {
            if mask[seed] == 1 && self.label[seed] == 0 {
                next += 1;
                let area = self.flood(mask, columns, seed, 1, next, true);
                if area > best_area {
                    (best, best_area) = (next, area);
                }
            }
        }
        for (m, &l) in mask.iter_mut().zip(&self.label) {
            *m = u8::from(best != 0 && l == best);
        }
        best_area + self.fill_holes(mask, columns)
    }

    /// Sets every background pixel that the border cannot reach through 4-neighbours.
    fn fill_holes(&mut self, mask: &mut [u8], columns: usize) -> usize {
        self.label.fill(0);
        let rows = mask.len() / columns;
        for seed in 0..mask.len() {
            let (y, x) = (seed / columns, seed % columns);
            let on_border = y == 0 || x == 0 || y + 1 == rows || x + 1 == columns;
            if on_border && mask[seed] == 0 && self.label[seed] == 0 {
                self.flood(mask, columns, seed, 0, 1, false);
            }
        }
        let mut filled = 0;
        for (m, &l) in mask.iter_mut().zip(&self.label) {
            if *m == 0 && l == 0 {
                *m = 1;
                filled += 1;
            }
        }
        filled
    }

    /// Labels everything of the given value connected to the seed; returns its area.
    fn flood(
        &mut self,
        mask: &[u8],
        columns: usize,
        seed: usize,
        value: u8,
        label: u32,
        diagonal: bool,
    ) -> usize {
        let rows = mask.len() / columns;
        let mut area = 0;
        self.label[seed] = label;
        self.stack.push(seed);
        while let Some(at) = self.stack.pop() {
            area += 1;
            let (y, x) = (at / columns, at % columns);
            for v in y.saturating_sub(1)..(y + 2).min(rows) {
                for u in x.saturating_sub(1)..(x + 2).min(columns) {
                    let neighbour = v * columns + u;
                    let reachable = diagonal || v == y || u == x;
                    if reachable && mask[neighbour] == value && self.label[neighbour] == 0 {
                        self.label[neighbour] = label;
                        self.stack.push(neighbour);
                    }
                }
            }
        }
        area
    }
}
