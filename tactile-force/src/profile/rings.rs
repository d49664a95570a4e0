//! Pixels gathered into thin rings about a centre, in blocks if they are well inside.

use std::ops::Range;

use crate::region::Region;
use tactile_core::{Loop, vectorised};

/// Rings that are a quarter of a pixel wide at the edge of the contact, one pixel further in, and
/// four pixels where the profile hardly bends. They are reused from fit to fit.
///
/// Where rings are wide, pixels are added in blocks, with exact sums over the pixels of a block:
/// only the choice of the ring uses the centre of the block.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rings {
    rings: Vec<Ring>,
    /// The longest run of the aperture in each row, and the columns of it that were added in
    /// blocks.
    spans: Vec<[usize; 2]>,
    taken: Vec<[usize; 2]>,
}

/// Number of pixels whose rings are computed together.
const AT_ONCE: usize = 16;

impl Rings {
    /// All rings that contain pixels.
    pub(crate) fn filled(&self) -> impl Iterator<Item = &Ring> {
        self.rings.iter().filter(|ring| ring.place[0] > 0.0)
    }

    /// Gathers the pixels of the aperture. The centre is relative to the first pixel of the region.
    /// `aspect` is the pixel height over its width, and distances are in pixel widths. `radius` is
    /// the approximate contact radius.
    pub(crate) fn gather(&mut self, region: &Region, centre: [f64; 2], aspect: f64, radius: f64) {
        let Self {
            rings,
            spans,
            taken,
        } = self;
        let rows = region.difference.len() / region.columns();
        for lines in [&mut *spans, &mut *taken] {
            lines.clear();
            lines.resize(rows, [0; 2]);
        }
        for run in &region.aperture {
            let span = &mut spans[run.row as usize];
            // Blocks need contiguous rows. Pixels of shorter runs in a row are added one by one.
            if run.len() > span[1] - span[0] {
                *span = [run.start as usize, run.end as usize];
            }
        }
        let inside = |depth: f64| (radius - depth).max(0.0).floor();
        // Distance inside the edge at which pixels are added in blocks of four by four and rings
        // are four pixels wide. At the edge of this disc a² − r² is ten times its change from the
        // middle of a ring to its border. The level takes the spread of r² into account, so the
        // remaining error is of fourth order, 1e-5 of the level.
        // `cargo bench -p tactile-benches --bench work_precision -- force` shows the error.
        let wide = inside(20.0);
        let pixels = std::f64::consts::PI * wide * wide / aspect;
        vectorised(Gather {
            rings,
            taken,
            region,
            grid: Grid {
                centre,
                aspect,
                spans,
            },
            wide,
            // Corresponding distance for blocks of two by two and rings one pixel wide.
            near: inside(8.0),
            // Number of pixels well inside the edge above which some blocks are skipped: the
            // profile is flat there, and they add little information.
            step: (pixels / 8192.0).sqrt().ceil().max(1.0) as usize,
        });
    }
}

struct Gather<'a> {
    rings: &'a mut Vec<Ring>,
    taken: &'a mut [[usize; 2]],
    region: &'a Region,
    grid: Grid<'a>,
    /// Distances up to which rings are four pixels and one pixel wide.
    wide: f64,
    near: f64,
    /// Every n-th row and column of the large blocks is gathered.
    step: usize,
}

impl Gather<'_> {
    /// Index of the ring at a distance. It increases by a quarter, by one and by four per pixel.
    #[inline(always)]
    fn ring(&self, r: f64) -> usize {
        let flat = 0.25 * r;
        let bent = r - 0.75 * self.wide;
        let edge = 4.0 * r - 0.75 * self.wide - 3.0 * self.near;
        let inner = if bent > flat { bent } else { flat };
        let place = if edge > inner { edge } else { inner };
        // Rounds to the nearest integer, which is then in the last digits, because between 2⁵² and
        // 2⁵³ doubles are integers. A saturating conversion has no SIMD instruction.
        (place - 0.5 + 6_755_399_441_055_744.0).to_bits() as u32 as usize
    }

    /// Creates as many empty rings as the farthest pixel of the aperture needs.
    #[inline(always)]
    fn clear(&mut self) {
        let mut farthest = 0.0_f64;
        for run in &self.region.aperture {
            let v = self.grid.v(f64::from(run.row));
            let ends = [run.start, run.end].map(|column| self.grid.u(f64::from(column)).abs());
            let u = ends[0].max(ends[1]);
            farthest = farthest.max(u * u + v * v);
        }
        self.rings.clear();
        self.rings
            .resize(self.ring(farthest.sqrt()) + 1, Ring::default());
    }

    /// Adds the blocks of four rows.
    #[inline(always)]
    fn band(&mut self, row: isize) {
        let (grid, step) = (self.grid, self.step);
        let large = grid.columns::<4>(row, self.wide);
        if !large.is_empty() && grid.number::<4>(row, 1).is_multiple_of(step) {
            self.blocks::<4>(row as usize, large.clone(), step);
        }
        for row in [row, row + 2] {
            let small = grid.columns::<2>(row, self.near);
            if small.is_empty() {
                continue;
            }
            let row = row as usize;
            let (left, right) = if large.is_empty() {
                (small.clone(), small.end..small.end)
            } else {
                (small.start..large.start, large.end..small.end)
            };
            self.blocks::<2>(row, left, 1);
            self.blocks::<2>(row, right, 1);
            self.taken[row..row + 2].fill([small.start, small.end]);
        }
    }

    /// Adds adjacent blocks. `row` is their first row, and `columns` are all their columns.
    #[inline(always)]
    fn blocks<const SIDE: usize>(&mut self, row: usize, columns: Range<usize>, step: usize) {
        let width = self.region.columns();
        let lines: [&[[f32; SIDE]]; SIDE] = std::array::from_fn(|k| {
            let first = (row + k) * width;
            let line = &self.region.difference[first + columns.start..first + columns.end];
            line.as_chunks().0
        });
        let middle = 0.5 * (SIDE as f64 - 1.0);
        let v = self.grid.v(row as f64 + middle);
        for (k, column) in columns.step_by(SIDE).enumerate() {
            if step > 1
                && !self
                    .grid
                    .number::<SIDE>(column as isize, 0)
                    .is_multiple_of(step)
            {
                continue;
            }
            let block = RingBlock {
                pixels: lines.map(|line| line[k]),
                u: self.grid.u(column as f64 + middle),
                v,
                aspect: self.grid.aspect,
            };
            let ring = self.ring((block.u * block.u + v * v).sqrt());
            self.rings[ring].merge(&block.sums());
        }
    }

    /// Adds adjacent pixels of a row.
    #[inline(always)]
    fn pixels(&mut self, row: usize, columns: Range<usize>) {
        let v = self.grid.v(row as f64);
        let mut start = self.grid.u(columns.start as f64);
        let first = row * self.region.columns();
        let differences = &self.region.difference[first + columns.start..first + columns.end];
        for differences in differences.chunks(AT_ONCE) {
            // A fixed number of pixels, for SIMD instructions.
            let (mut squares, mut places) = ([0.0; AT_ONCE], [0; AT_ONCE]);
            for k in 0..AT_ONCE {
                let u = start + f64::from(k as i32);
                squares[k] = u * u + v * v;
                places[k] = self.ring(squares[k].sqrt());
            }
            for (k, d) in differences.iter().enumerate() {
                let u = start + f64::from(k as i32);
                self.rings[places[k]].add(u, v, squares[k], f64::from(*d));
            }
            start += AT_ONCE as f64;
        }
    }
}

impl Loop for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        self.clear();
        let aperture = &self.region.aperture;
        let (Some(first), Some(last)) = (aperture.first(), aperture.last()) else {
            return;
        };
        let middle = self.grid.first(1);
        let band = |row: u32| (row as isize - middle).div_euclid(4);
        for k in band(first.row)..=band(last.row) {
            self.band(middle + 4 * k);
        }
        for run in aperture {
            let (row, start, end) = (run.row as usize, run.start as usize, run.end as usize);
            let [from, to] = self.taken[row];
            // Only the pixels of the run on both sides of its blocks remain.
            if from < to && start <= from && to <= end {
                self.pixels(row, start..from);
                self.pixels(row, to..end);
            } else {
                self.pixels(row, start..end);
            }
        }
    }
}

/// Sums over the pixels of one ring. (u, v) is the position of a pixel relative to the centre, and
/// d its difference. The sums are in groups of four, so that a pixel is added with a few SIMD
/// instructions.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ring {
    /// Σ 1, Σ u, Σ v, Σ r².
    pub place: [f64; 4],
    /// Σ u², Σ u v, Σ r² u, Σ r² v.
    pub product: [f64; 4],
    /// Σ d, Σ d u, Σ d v, Σ d².
    pub difference: [f64; 4],
    /// Σ r⁴.
    pub r4: f64,
}

impl Ring {
    #[inline(always)]
    pub(crate) fn add(&mut self, u: f64, v: f64, r2: f64, d: f64) {
        let place = [1.0, u, v, r2];
        let product = [u * u, u * v, r2 * u, r2 * v];
        let difference = [d, d * u, d * v, d * d];
        for k in 0..4 {
            self.place[k] += place[k];
            self.product[k] += product[k];
            self.difference[k] += difference[k];
        }
        self.r4 += r2 * r2;
    }

    #[inline(always)]
    pub(crate) fn merge(&mut self, other: &Self) {
        for k in 0..4 {
            self.place[k] += other.place[k];
            self.product[k] += other.product[k];
            self.difference[k] += other.difference[k];
        }
        self.r4 += other.r4;
    }
}

/// Positions of blocks. A corner of four blocks is next to the centre, so that the blocks are the
/// same if the image is mirrored, rotated or shifted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid<'a> {
    /// Column and row of the centre.
    pub centre: [f64; 2],
    /// Height of a pixel over its width.
    pub aspect: f64,
    /// Range of columns in each row that blocks may use.
    pub spans: &'a [[usize; 2]],
}

impl Grid<'_> {
    /// Position of a column relative to the centre.
    #[inline(always)]
    pub(super) fn u(&self, column: f64) -> f64 {
        column - self.centre[0]
    }

    /// Position of a row relative to the centre, in pixel widths.
    #[inline(always)]
    pub(super) fn v(&self, row: f64) -> f64 {
        (row - self.centre[1]) * self.aspect
    }

    /// The first column (`axis` 0) or row (1) beyond the centre, where a block starts.
    #[inline(always)]
    pub(super) fn first(&self, axis: usize) -> isize {
        self.centre[axis].floor() as isize + 1
    }

    /// The index of a block counted from the centre to either side, by its first column or row.
    #[inline(always)]
    pub(super) fn number<const SIDE: usize>(&self, at: isize, axis: usize) -> usize {
        let away = (at - self.first(axis)).div_euclid(SIDE as isize);
        if away < 0 {
            !away as usize
        } else {
            away as usize
        }
    }

    /// The columns of whole blocks in rows from `row` on, whose pixels are all within a distance of
    /// the centre and in the spans of the rows.
    #[inline(always)]
    pub(super) fn columns<const SIDE: usize>(&self, row: isize, distance: f64) -> Range<usize> {
        let Some(spans) = usize::try_from(row)
            .ok()
            .and_then(|row| self.spans.get(row..row + SIDE))
        else {
            return 0..0;
        };
        let ends = [row, row + SIDE as isize - 1].map(|row| self.v(row as f64).abs());
        let farthest = ends[0].max(ends[1]);
        if farthest >= distance {
            return 0..0;
        }
        let half = (distance * distance - farthest * farthest).sqrt();
        let mut start = (self.centre[0] - half).ceil() as isize;
        let mut end = (self.centre[0] + half).floor() as isize + 1;
        for [from, to] in spans {
            start = start.max(*from as isize);
            end = end.min(*to as isize);
        }
        let first = self.first(0);
        if start > first || end < first {
            return 0..0;
        }
        let whole = |columns: isize| columns - columns % SIDE as isize;
        let (left, right) = (first - whole(first - start), first + whole(end - first));
        left as usize..right as usize
    }
}

/// A block of pixels: its differences, and the position of its centre relative to that of the
/// contact, in pixel widths.
#[derive(Clone, Copy, Debug)]
pub(super) struct RingBlock<const SIDE: usize> {
    pub pixels: [[f32; SIDE]; SIDE],
    pub u: f64,
    pub v: f64,
    pub aspect: f64,
}

impl<const SIDE: usize> RingBlock<SIDE> {
    /// Σ o² and Σ o⁴ over the distances o of a block's columns from its centre.
    const SQUARES: [f64; 2] = {
        let (mut sums, mut k) = ([0.0; 2], 0);
        while k < SIDE {
            let o = k as f64 - 0.5 * (SIDE as f64 - 1.0);
            sums = [sums[0] + o * o, sums[1] + o * o * o * o];
            k += 1;
        }
        sums
    };

    /// The sums that the pixels would add to a ring one by one. The position of a pixel is u + p
    /// and v + q; sums of odd powers of p and q vanish.
    #[inline(always)]
    pub(super) fn sums(&self) -> Ring {
        let (u, v, side) = (self.u, self.v, SIDE as f64);
        let n = side * side;
        let [pp, pppp] = Self::SQUARES;
        let aspect2 = self.aspect * self.aspect;
        let [qq, qqqq] = [aspect2 * pp, aspect2 * aspect2 * pppp];
        let (u2, v2) = (u * u, v * v);
        // Sums over one row and one column: the block has as many of them as its side. Σ(u + p)²
        // over a row is side u² + Σp², because Σp vanishes about the centre of the block.
        let (row_uu, column_vv) = (side * u2 + pp, side * v2 + qq);
        let (uu, vv) = (side * row_uu, side * column_vv);
        let r2u = u * (uu + 2.0 * side * pp + vv);
        let r2v = v * (vv + 2.0 * side * qq + uu);
        let uuuu = side * (side * u2 * u2 + 6.0 * u2 * pp + pppp);
        let vvvv = side * (side * v2 * v2 + 6.0 * v2 * qq + qqqq);
        let [d, dp, dq, dd] = self.differences();
        Ring {
            place: [n, n * u, n * v, uu + vv],
            product: [uu, n * u * v, r2u, r2v],
            difference: [d, d * u + dp, d * v + self.aspect * dq, dd],
            r4: uuuu + 2.0 * row_uu * column_vv + vvvv,
        }
    }

    /// Σ d, Σ d p, Σ d q and Σ d², with q in rows.
    #[inline(always)]
    fn differences(&self) -> [f64; 4] {
        let (mut columns, mut squares) = ([0.0; SIDE], [0.0; SIDE]);
        let mut dq = 0.0;
        for (k, row) in self.pixels.iter().enumerate() {
            let mut sum = 0.0;
            for j in 0..SIDE {
                let d = f64::from(row[j]);
                columns[j] += d;
                squares[j] += d * d;
                sum += d;
            }
            dq += (k as f64 - 0.5 * (SIDE as f64 - 1.0)) * sum;
        }
        let (mut d, mut dp, mut dd) = (0.0, 0.0, 0.0);
        for j in 0..SIDE {
            d += columns[j];
            dp += (j as f64 - 0.5 * (SIDE as f64 - 1.0)) * columns[j];
            dd += squares[j];
        }
        [d, dp, dq, dd]
    }
}

#[cfg(test)]
#[path = "rings_tests.rs"]
mod tests;
