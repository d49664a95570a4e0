//! Square blocks of pixels about a contact's centre, and the sums over their pixels.

use std::ops::Range;

use super::ring::Ring;

/// Where blocks lie: a corner of four of them is beside the centre, so that they are the same whichever way the image is mirrored, turned or moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid<'a> {
    /// Column and row of the centre.
    pub(super) centre: [f64; 2],
    /// A pixel's height over its width.
    pub(super) aspect: f64,
    /// Columns of every row that blocks may use, from and to.
    pub(super) spans: &'a [[usize; 2]],
}

impl Grid<'_> {
    /// A column relative to the centre.
    #[inline(always)]
    pub(super) fn u(&self, column: f64) -> f64 {
        column - self.centre[0]
    }

    /// A row relative to the centre, in pixel widths.
    #[inline(always)]
    pub(super) fn v(&self, row: f64) -> f64 {
        (row - self.centre[1]) * self.aspect
    }

    /// The first column (`axis` 0) or row (1) beyond the centre, where a block begins.
    #[inline(always)]
    pub(super) fn first(&self, axis: usize) -> isize {
        self.centre[axis].floor() as isize + 1
    }

    /// The number of a block counted from the centre to either side, by its first column or row.
    #[inline(always)]
    pub(super) fn number<const SIDE: usize>(&self, at: isize, axis: usize) -> usize {
        let away = (at - self.first(axis)).div_euclid(SIDE as isize);
        if away < 0 {
            !away as usize
        } else {
            away as usize
        }
    }

    /// The columns of whole blocks in rows from `row` on, all of whose pixels lie within a distance of the centre and in the rows' spans.
    #[inline(always)]
    pub(super) fn columns<const SIDE: usize>(&self, row: isize, distance: f64) -> Range<usize> {
        let none = 0..0;
        let Some(spans) = usize::try_from(row)
            .ok()
            .and_then(|row| self.spans.get(row..row + SIDE))
        else {
            return none;
        };
        let ends = [row, row + SIDE as isize - 1].map(|row| self.v(row as f64).abs());
        let farthest = ends[0].max(ends[1]);
        if farthest >= distance {
            return none;
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
            return none;
        }
        let whole = |columns: isize| columns - columns % SIDE as isize;
        let (left, right) = (first - whole(first - start), first + whole(end - first));
        left as usize..right as usize
    }
}

/// A block of pixels: its differences, and where its centre is relative to that of the contact, in pixel widths.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<const SIDE: usize> {
    pub(super) pixels: [[f32; SIDE]; SIDE],
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) aspect: f64,
}

impl<const SIDE: usize> Block<SIDE> {
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

    /// What the pixels one by one add to a ring. With u + p and v + q the place of a pixel, sums of odd powers of p and q vanish.
    #[inline(always)]
    pub(super) fn sums(&self) -> Ring {
        let (u, v, side) = (self.u, self.v, SIDE as f64);
        let n = side * side;
        let [pp, pppp] = Self::SQUARES;
        let aspect2 = self.aspect * self.aspect;
        let [qq, qqqq] = [aspect2 * pp, aspect2 * aspect2 * pppp];
        let (u2, v2) = (u * u, v * v);
        // Over one row and one column: the square, of which the block has as many as its side.
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

    /// Σ d, Σ d p, Σ d q and Σ d², q in rows.
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
mod tests {
    use super::*;

    /// Pixels of whole quarters: sums of a block are those of its pixels to rounding.
    fn compare<const SIDE: usize>(aspect: f64) {
        let value = |k: usize, j: usize| (k * 7 + j * 13 % 5) as f32 - 9.25;
        let block = Block::<SIDE> {
            pixels: std::array::from_fn(|k| std::array::from_fn(|j| value(k, j))),
            u: -31.25,
            v: 12.5,
            aspect,
        };
        let mut expected = Ring::default();
        for (k, row) in block.pixels.iter().enumerate() {
            for (j, d) in row.iter().enumerate() {
                let from_centre = |at: usize| at as f64 - 0.5 * (SIDE as f64 - 1.0);
                let (u, v) = (block.u + from_centre(j), block.v + aspect * from_centre(k));
                expected.add(u, v, u * u + v * v, f64::from(*d));
            }
        }
        let found = block.sums();
        let flat = |ring: &Ring| {
            let mut all = [ring.place, ring.product, ring.difference].concat();
            all.push(ring.r4);
            all
        };
        for (k, (found, expected)) in flat(&found).iter().zip(flat(&expected)).enumerate() {
            let error = (found - expected).abs();
            assert!(error <= 1e-13 * expected.abs(), "{k}: {found} {expected}");
        }
    }

    #[test]
    fn a_block_is_its_pixels() {
        for aspect in [1.0, 0.75] {
            compare::<2>(aspect);
            compare::<4>(aspect);
        }
    }

    /// Mirrored about a centre that is not in the middle of a pixel: the blocks are mirrored, too, and counted alike.
    #[test]
    fn blocks_are_mirrored_with_the_image() {
        let size = 40;
        let spans = vec![[0, size]; size];
        let grid = |centre: [f64; 2]| Grid {
            centre,
            aspect: 1.0,
            spans: &spans,
        };
        let centre = [17.3, 21.8];
        let (one, other) = (grid(centre), grid(centre.map(|c| size as f64 - 1.0 - c)));
        for k in -3..3 {
            let row = one.first(1) + 4 * k;
            let (here, there) = (
                one.columns::<4>(row, 11.0),
                other.columns::<4>(size as isize - 4 - row, 11.0),
            );
            assert_eq!(here.is_empty(), !(-2..2).contains(&k), "{here:?}");
            if !here.is_empty() {
                assert_eq!(here, size - there.end..size - there.start);
            }
            let mirrored = other.number::<4>(size as isize - 4 - row, 1);
            assert_eq!(one.number::<4>(row, 1), mirrored);
        }
        assert_eq!(one.columns::<4>(-1, 11.0), 0..0, "a row outside");
    }
}
