//! Regions as runs of pixels: thresholding, labelling, filling and growing cost as much as the outline, not the area.

/// Pixels `start..end` of a row, relative to a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub(crate) row: u32,
    pub(crate) start: u32,
    pub(crate) end: u32,
}

impl Run {
    pub(crate) fn len(&self) -> usize {
        (self.end - self.start) as usize
    }

    /// Position of its pixels in a row-major region of the given width.
    pub(crate) fn span(&self, columns: usize) -> std::ops::Range<usize> {
        let first = self.row as usize * columns;
        first + self.start as usize..first + self.end as usize
    }
}

/// Pixels that are tested together.
const BLOCK: usize = 32;

/// Appends the runs of a row where `inside` holds.
#[inline(always)]
pub(super) fn push_runs<P>(
    runs: &mut Vec<Run>,
    row: usize,
    pixels: &[P],
    inside: impl Fn(&P) -> bool,
) {
    let mut start = None;
    for (block, pixels) in pixels.chunks(BLOCK).enumerate() {
        // Most blocks lie wholly inside or outside; counting takes SIMD instructions, pixels of an edge are tested one by one.
        let count = pixels.iter().map(|p| u32::from(inside(p))).sum::<u32>() as usize;
        if count == if start.is_some() { pixels.len() } else { 0 } {
            continue;
        }
        for (x, pixel) in pixels
            .iter()
            .enumerate()
            .map(|(x, p)| (block * BLOCK + x, p))
        {
            match (inside(pixel), start) {
                (true, None) => start = Some(x),
                (false, Some(first)) => {
                    runs.push(Run {
                        row: row as u32,
                        start: first as u32,
                        end: x as u32,
                    });
                    start = None;
                }
                _ => {}
            }
        }
    }
    if let Some(first) = start {
        runs.push(Run {
            row: row as u32,
            start: first as u32,
            end: pixels.len() as u32,
        });
    }
}

/// Connected components of a list of runs, by union–find.
#[derive(Clone, Debug, Default)]
pub(super) struct Components {
    parent: Vec<u32>,
    area: Vec<usize>,
}

impl Components {
    /// Joins runs of neighbouring rows that overlap, or touch at a corner if `diagonal`.
    fn join(&mut self, runs: &[Run], diagonal: bool) {
        self.parent.clear();
        self.parent.extend(0..runs.len() as u32);
        let reach = u32::from(diagonal);
        let mut above = 0;
        for (k, run) in runs.iter().enumerate() {
            while above < k
                && (runs[above].row + 1 < run.row
                    || (runs[above].row + 1 == run.row && runs[above].end + reach <= run.start))
            {
                above += 1;
            }
            let mut at = above;
            while at < k && runs[at].row + 1 == run.row && runs[at].start < run.end + reach {
                self.unite(at as u32, k as u32);
                at += 1;
            }
        }
    }

    fn root(&mut self, mut k: u32) -> u32 {
        while self.parent[k as usize] != k {
            let up = self.parent[self.parent[k as usize] as usize];
            self.parent[k as usize] = up;
            k = up;
        }
        k
    }

    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// Keeps the runs of the largest 8-connected component. Returns its area and the number of other components of at
    /// least `notable` pixels and a hundredth of its area.
    pub(super) fn keep_largest(&mut self, runs: &mut Vec<Run>, notable: usize) -> (usize, usize) {
        self.join(runs, true);
        self.area.clear();
        self.area.resize(runs.len(), 0);
        for (k, run) in runs.iter().enumerate() {
            let root = self.root(k as u32) as usize;
            self.area[root] += run.len();
        }
        // The first of equals, so that the answer does not depend on anything but the image.
        let Some((best, &area)) = self.area.iter().enumerate().rev().max_by_key(|(_, a)| **a)
        else {
            return (0, 0);
        };
        let others = self
            .area
            .iter()
            .enumerate()
            .filter(|(k, a)| *k != best && **a >= notable.max(area / 100))
            .count();
        let mut k = 0;
        let Self { parent, .. } = self;
        runs.retain(|_| {
            let mut root = k;
            while parent[root] as usize != root {
                root = parent[root] as usize;
            }
            k += 1;
            root == best
        });
        (area, others)
    }

    /// Marks the components of the background that reach the border.
    fn mark_open(&mut self, background: &[Run], rows: u32, columns: u32) {
        self.area.clear();
        self.area.resize(background.len(), 0);
        for (k, b) in background.iter().enumerate() {
            if b.row == 0 || b.row == rows - 1 || b.start == 0 || b.end == columns {
                let root = self.root(k as u32) as usize;
                self.area[root] = OPEN;
            }
        }
    }

    /// Adds everything the runs enclose: the background that no 4-path joins to the border. Returns the area filled.
    pub(super) fn fill_holes(
        &mut self,
        runs: &mut Vec<Run>,
        background: &mut Vec<Run>,
        rows: usize,
        columns: usize,
    ) -> usize {
        complement(runs, background, rows, columns);
        self.join(background, false);
        self.mark_open(background, rows as u32, columns as u32);
        let before = runs.len();
        let mut filled = 0;
        for (k, run) in background.iter().enumerate() {
            let root = self.root(k as u32) as usize;
            if self.area[root] != OPEN {
                filled += run.len();
                runs.push(*run);
            }
        }
        if runs.len() > before {
            runs.sort_unstable_by_key(|r| (r.row, r.start));
            merge(runs);
        }
        filled
    }
}

/// In place of an area: background that reaches the border.
const OPEN: usize = 1;

/// The runs between the runs.
fn complement(runs: &[Run], background: &mut Vec<Run>, rows: usize, columns: usize) {
    background.clear();
    let width = columns as u32;
    let mut next = runs.iter().peekable();
    for row in 0..rows as u32 {
        let mut start = 0;
        while let Some(run) = next.next_if(|r| r.row == row) {
            if run.start > start {
                background.push(Run {
                    row,
                    start,
                    end: run.start,
                });
            }
            start = run.end;
        }
        if start < width {
            background.push(Run {
                row,
                start,
                end: width,
            });
        }
    }
}

/// Joins sorted runs that overlap or touch.
fn merge(runs: &mut Vec<Run>) {
    runs.dedup_by(|next, last| {
        let joined = next.row == last.row && next.start <= last.end;
        if joined {
            last.end = last.end.max(next.end);
        }
        joined
    });
}

/// The runs, sorted by row and start, grown by a square of half width `margin` and clipped to the region.
pub(super) fn grow(runs: &[Run], grown: &mut Vec<Run>, margin: usize, rows: usize, columns: usize) {
    grown.clear();
    let (Some(top), Some(bottom)) = (runs.first(), runs.last()) else {
        return;
    };
    let (margin, columns) = (margin as u32, columns as u32);
    let (mut first, mut end) = (0, 0);
    for row in top.row.saturating_sub(margin)..=(bottom.row + margin).min(rows as u32 - 1) {
        while end < runs.len() && runs[end].row <= row + margin {
            end += 1;
        }
        while first < end && runs[first].row + margin < row {
            first += 1;
        }
        let begun = grown.len();
        grown.extend(runs[first..end].iter().map(|run| Run {
            row,
            start: run.start.saturating_sub(margin),
            end: (run.end + margin).min(columns),
        }));
        grown[begun..].sort_unstable_by_key(|r| r.start);
    }
    merge(grown);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COLUMNS: usize = 13;

    fn runs_of(mask: &[bool]) -> Vec<Run> {
        let mut runs = Vec::new();
        mask.chunks(COLUMNS)
            .enumerate()
            .for_each(|(y, row)| push_runs(&mut runs, y, row, |m| *m));
        runs
    }

    fn mask_of(runs: &[Run], rows: usize) -> Vec<bool> {
        let mut mask = vec![false; rows * COLUMNS];
        runs.iter().for_each(|r| mask[r.span(COLUMNS)].fill(true));
        mask
    }

    /// Everything of the seed's value that it reaches, by painting until nothing changes.
    fn reached(mask: &[bool], seed: usize, diagonal: bool) -> Vec<bool> {
        let mut set = vec![false; mask.len()];
        set[seed] = true;
        loop {
            let before = set.clone();
            for p in (0..mask.len()).filter(|p| before[*p]) {
                for q in (0..mask.len()).filter(|q| mask[*q] == mask[seed]) {
                    let (dy, dx) = (
                        (p / COLUMNS).abs_diff(q / COLUMNS),
                        (p % COLUMNS).abs_diff(q % COLUMNS),
                    );
                    set[q] |= if diagonal {
                        dy.max(dx) <= 1
                    } else {
                        dy + dx <= 1
                    };
                }
            }
            if set == before {
                return set;
            }
        }
    }

    proptest! {
        #[test]
        fn agrees_with_painting(mask in proptest::collection::vec(proptest::bool::weighted(0.45), 9 * COLUMNS)) {
            let rows = 9;
            let sets: Vec<Vec<bool>> =
                (0..mask.len()).filter(|p| mask[*p]).map(|p| reached(&mask, p, true)).collect();
            let size = |s: &Vec<bool>| s.iter().filter(|m| **m).count();
            let largest = sets.iter().map(size).max().unwrap_or(0);
            let mut runs = runs_of(&mask);
            let (area, _) = Components::default().keep_largest(&mut runs, 1);
            prop_assert_eq!(area, largest);
            let kept = mask_of(&runs, rows);
            prop_assert!(area == 0 || sets.contains(&kept));
            let filled_by = Components::default().fill_holes(&mut runs, &mut Vec::new(), rows, COLUMNS);
            let border = |p: usize| [0, rows - 1].contains(&(p / COLUMNS)) || [0, COLUMNS - 1].contains(&(p % COLUMNS));
            let mut expected = kept.clone();
            for p in (0..kept.len()).filter(|p| !kept[*p]) {
                let set = reached(&kept, p, false);
                expected[p] = !(0..set.len()).any(|q| set[q] && border(q));
            }
            prop_assert_eq!(mask_of(&runs, rows), expected);
            prop_assert_eq!(runs.iter().map(Run::len).sum::<usize>(), area + filled_by);
        }

        #[test]
        fn growing_is_a_maximum_over_the_square(
            mask in proptest::collection::vec(proptest::bool::weighted(0.1), 9 * COLUMNS), margin in 0_usize..4
        ) {
            let mut grown = Vec::new();
            grow(&runs_of(&mask), &mut grown, margin, 9, COLUMNS);
            let near = |p: usize| (0..mask.len()).any(|q| {
                let (dy, dx) = ((p / COLUMNS).abs_diff(q / COLUMNS), (p % COLUMNS).abs_diff(q % COLUMNS));
                mask[q] && dy.max(dx) <= margin
            });
            prop_assert_eq!(mask_of(&grown, 9), (0..mask.len()).map(near).collect::<Vec<_>>());
            prop_assert!(grown.windows(2).all(|w| w[0].row < w[1].row || w[0].end < w[1].start));
        }
    }
}
