//! The mask grown by a margin, and the sums over it.

use crate::BoundingBox;

/// A region of interest: differences (positive in contact), mask and aperture, all row-major over one box.
#[derive(Clone, Debug, Default)]
pub(crate) struct Aperture {
    pub(crate) region: Option<BoundingBox>,
    /// Frame − reference, sign turned so that contact is positive.
    pub(crate) difference: Vec<i16>,
    /// 1 in the contact.
    pub(crate) mask: Vec<u8>,
    /// 1 within the margin of the contact.
    pub(crate) grown: Vec<u8>,
    scratch: Vec<u8>,
}

/// Sums over the aperture, coordinates relative to the region's first pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ApertureSums {
    pub(crate) count: usize,
    pub(crate) sum: i64,
    pub(crate) sum_x: i64,
    pub(crate) sum_y: i64,
}

impl Aperture {
    /// Grows the mask by a square of half width `margin`.
    pub(crate) fn grow(&mut self, margin: usize) {
        let Some(region) = self.region else { return };
        let (rows, columns) = (region.rows(), region.columns());
        self.scratch.clear();
        self.scratch.resize(self.mask.len(), 0);
        self.grown.clear();
        self.grown.resize(self.mask.len(), 0);
        for (source, target) in self.mask.chunks(columns).zip(self.scratch.chunks_mut(columns)) {
            for (x, _) in source.iter().enumerate().filter(|(_, m)| **m == 1) {
                target[x.saturating_sub(margin)..(x + margin + 1).min(columns)].fill(1);
            }
        }
        for y in 0..rows {
            let source = &self.scratch[y * columns..(y + 1) * columns];
            for v in y.saturating_sub(margin)..(y + margin + 1).min(rows) {
                let target = &mut self.grown[v * columns..(v + 1) * columns];
                target.iter_mut().zip(source).for_each(|(t, s)| *t |= s);
            }
        }
    }

    pub(crate) fn sums(&self) -> ApertureSums {
        let mut total = ApertureSums::default();
        let Some(region) = self.region else { return total };
        let columns = region.columns();
        for (y, (d, m)) in self.difference.chunks(columns).zip(self.grown.chunks(columns)).enumerate() {
            let (mut row, mut row_x) = (0_i64, 0_i64);
            for (x, (&d, &m)) in d.iter().zip(m).enumerate() {
                let d = i64::from(d) * i64::from(m);
                row += d;
                row_x += x as i64 * d;
                total.count += usize::from(m);
            }
            total.sum += row;
            total.sum_x += row_x;
            total.sum_y += y as i64 * row;
        }
        total
    }

    /// Σ |x − cx|² and Σ |y − cy|² weights of the centroid's error, and Σ d of them: what noise in the aperture does to the centroid.
    pub(crate) fn spread(&self, centre: [f64; 2]) -> Spread {
        let mut s = Spread::default();
        let Some(region) = self.region else { return s };
        let columns = region.columns();
        for (at, (&d, &m)) in self.difference.iter().zip(&self.grown).enumerate() {
            if m == 1 {
                let (dx, dy) = ((at % columns) as f64 - centre[0], (at / columns) as f64 - centre[1]);
                let d = f64::from(d);
                s.xx += dx * dx;
                s.yy += dy * dy;
                s.xx_d += dx * dx * d;
                s.yy_d += dy * dy * d;
            }
        }
        s
    }
}

/// Second moments of the aperture about a centre, plain and weighted with the difference.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spread {
    pub(crate) xx: f64,
    pub(crate) yy: f64,
    pub(crate) xx_d: f64,
    pub(crate) yy_d: f64,
}
