//! Pixels gathered into thin rings about a centre.

use super::blocks::{Block, Grid};
use super::ring::{Ring, RingSums};
use crate::contact::Region;
use crate::simd::vectorized;

/// Rings a quarter of a pixel wide at the contact's edge, one pixel further in and four pixels where the profile hardly bends; reused from fit
/// to fit.
///
/// Where rings are wide, pixels are added in blocks, with the sums over all pixels of a block: only the ring is that of the block's centre.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rings {
    rings: Vec<Ring>,
    /// The longest run of the aperture in every row, and what of it was added in blocks: columns from and to.
    spans: Vec<[usize; 2]>,
    taken: Vec<[usize; 2]>,
}

/// How far inside the edge pixels are added in blocks of four by four, and rings are four pixels wide. At the edge of that disc a² − r² is ten times
/// its change from the middle of a ring to its border, whose spread in r² the level takes into account: what is left is of the fourth order, 1e-5
/// of the level. `cargo bench -p tactile-benches --bench work_precision -- force` shows the error.
const WIDE: f64 = 20.0;
/// The same for blocks of two by two and rings one pixel wide.
const NEAR: f64 = 8.0;
/// Pixels well inside the edge beyond which some blocks are left out there: the profile is flat and they only repeat each other.
const ENOUGH: f64 = 8192.0;
/// Between 2⁵² and 2⁵³ a double has whole numbers alone.
const WHOLE: f64 = 6_755_399_441_055_744.0;
/// Pixels whose rings are found at once.
const AT_ONCE: usize = 16;

impl Rings {
    /// Every ring that has pixels.
    pub(super) fn filled(&self) -> impl Iterator<Item = RingSums> + '_ {
        self.rings.iter().map(Ring::sums).filter(|r| r.n > 0.0)
    }

    /// Gathers the pixels of the aperture. The centre is relative to the region's first pixel; `aspect` is the pixel's
    /// height over its width, and distances are in pixel widths. `radius` is about that of the contact.
    pub(super) fn gather(&mut self, region: &Region, centre: [f64; 2], aspect: f64, radius: f64) {
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
            if run.len() > span[1] - span[0] {
                *span = [run.start as usize, run.end as usize];
            }
        }
        let inside = |depth: f64| (radius - depth).max(0.0).floor();
        let wide = inside(WIDE);
        let pixels = std::f64::consts::PI * wide * wide / aspect;
        vectorized(Gather {
            rings,
            taken,
            region,
            grid: Grid {
                centre,
                aspect,
                spans,
            },
            wide,
            near: inside(NEAR),
            step: (pixels / ENOUGH).sqrt().ceil().max(1.0) as usize,
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
    /// Of the large blocks every so many rows and columns are gathered.
    step: usize,
}

impl Gather<'_> {
    /// Number of the ring at a distance, which grows by a quarter, by one and by four a pixel.
    #[inline(always)]
    fn ring(&self, r: f64) -> usize {
        let flat = 0.25 * r;
        let bent = r - 0.75 * self.wide;
        let edge = 4.0 * r - 0.75 * self.wide - 3.0 * self.near;
        let inner = if bent > flat { bent } else { flat };
        let place = if edge > inner { edge } else { inner };
        // Rounds to the nearest whole number, which then stands in the last digits; a conversion that minds its limits has no wide instruction.
        (place - 0.5 + WHOLE).to_bits() as u32 as usize
    }

    /// As many rings as the farthest pixel of the aperture needs, all empty.
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

    /// Adds blocks side by side, of which `row` and `columns` are the first row and all columns.
    #[inline(always)]
    fn blocks<const SIDE: usize>(
        &mut self,
        row: usize,
        columns: std::ops::Range<usize>,
        step: usize,
    ) {
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
            let block = Block {
                pixels: lines.map(|line| line[k]),
                u: self.grid.u(column as f64 + middle),
                v,
                aspect: self.grid.aspect,
            };
            let ring = self.ring((block.u * block.u + v * v).sqrt());
            self.rings[ring].merge(&block.sums());
        }
    }

    /// Adds pixels side by side of a row.
    #[inline(always)]
    fn pixels(&mut self, row: usize, columns: std::ops::Range<usize>) {
        let v = self.grid.v(row as f64);
        let mut start = self.grid.u(columns.start as f64);
        let first = row * self.region.columns();
        let differences = &self.region.difference[first + columns.start..first + columns.end];
        for differences in differences.chunks(AT_ONCE) {
            // Always for as many, by wide instructions.
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

impl pulp::NullaryFnOnce for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
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
            if from < to && start <= from && to <= end {
                self.pixels(row, start..from);
                self.pixels(row, to..end);
            } else {
                self.pixels(row, start..end);
            }
        }
    }
}
