//! Masks as runs of pixels in rows: components, holes, margins.

use std::ops::Range;

/// Pixels `start..end` of a row, relative to a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub row: u32,
    pub start: u32,
    pub end: u32,
}

impl Run {
    pub(crate) fn len(&self) -> usize {
        (self.end - self.start) as usize
    }

    /// Index range of its pixels in a row-major region of the given width.
    pub(crate) fn span(&self, columns: usize) -> Range<usize> {
        let first = self.row as usize * columns;
        first + self.start as usize..first + self.end as usize
    }
}

/// Number of pixels tested together.
const BLOCK: usize = 32;

/// Appends the runs of a row for which `inside` is true.
#[inline(always)]
pub(crate) fn push_runs<P>(
    runs: &mut Vec<Run>,
    row: usize,
    pixels: &[P],
    inside: impl Fn(&P) -> bool,
) {
    let mut start = None;
    for (block, pixels) in pixels.chunks(BLOCK).enumerate() {
        // Most blocks are entirely inside or outside. Counting uses SIMD instructions; pixels of an
        // edge are tested one by one.
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
pub(crate) struct Components {
    parent: Vec<u32>,
    area: Vec<usize>,
}

impl Components {
    /// Joins runs of adjacent rows that overlap, or touch at a corner if `diagonal`.
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
            // Path halving keeps later searches short.
            let up = self.parent[self.parent[k as usize] as usize];
            self.parent[k as usize] = up;
            k = up;
        }
        k
    }

    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // The first run of a component stays its root, independently of the order of the joins.
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// Keeps the runs of the largest 8-connected component. Returns its area and the number of
    /// other components of at least `notable` pixels and a hundredth of its area.
    pub(crate) fn keep_largest(&mut self, runs: &mut Vec<Run>, notable: usize) -> (usize, usize) {
        self.join(runs, true);
        self.area.clear();
        self.area.resize(runs.len(), 0);
        for (k, run) in runs.iter().enumerate() {
            let root = self.root(k as u32) as usize;
            self.area[root] += run.len();
        }
        // The first among equals, so that the result depends only on the image.
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

    /// Adds all enclosed areas: background that no 4-connected path joins to the border. Returns
    /// the filled area.
    pub(crate) fn fill_holes(
        &mut self,
        runs: &mut Vec<Run>,
        background: &mut Vec<Run>,
        rows: usize,
        columns: usize,
    ) -> usize {
        complement(runs, background, rows, columns);
        // The object is 8-connected, so the background must be 4-connected; otherwise the two could
        // cross.
        self.join(background, false);
        // Background components that reach the border are open.
        let (last, columns) = (rows as u32 - 1, columns as u32);
        self.area.clear();
        self.area.resize(background.len(), 0);
        for (k, b) in background.iter().enumerate() {
            if b.row == 0 || b.row == last || b.start == 0 || b.end == columns {
                let root = self.root(k as u32) as usize;
                self.area[root] = OPEN;
            }
        }
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

/// Marker instead of an area, for background that reaches the border.
const OPEN: usize = 1;

/// The gaps between the runs.
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

/// The runs, sorted by row and start, dilated by a square of half width `margin` and clipped to the
/// region.
pub(crate) fn grow(runs: &[Run], grown: &mut Vec<Run>, margin: usize, rows: usize, columns: usize) {
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
