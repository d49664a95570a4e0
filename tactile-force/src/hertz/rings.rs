//! Pixels gathered into thin rings about a centre.

use crate::contact::{EveryNth, Region};
use crate::simd::vectorized;

/// Sums over the pixels of one ring; (u, v) is a pixel's place relative to the centre, d its difference. Four by four, so
/// that a pixel is added with a few wide instructions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ring {
    /// Σ 1, Σ u, Σ v, Σ r².
    place: [f64; 4],
    /// Σ u², Σ u v, Σ r² u, Σ r² v.
    product: [f64; 4],
    /// Σ d, Σ d u, Σ d v, Σ d².
    difference: [f64; 4],
    /// Σ r⁴.
    r4: f64,
}

/// The sums by name.
#[derive(Clone, Copy, Debug)]
pub(super) struct RingSums {
    pub(super) n: f64,
    pub(super) r2: f64,
    pub(super) r4: f64,
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) uu: f64,
    pub(super) uv: f64,
    pub(super) r2u: f64,
    pub(super) r2v: f64,
    pub(super) d: f64,
    pub(super) du: f64,
    pub(super) dv: f64,
    pub(super) dd: f64,
}

impl Ring {
    #[inline(always)]
    fn add(&mut self, u: f64, v: f64, r2: f64, d: f64) {
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

    pub(super) fn sums(&self) -> RingSums {
        let [n, u, v, r2] = self.place;
        let [uu, uv, r2u, r2v] = self.product;
        let [d, du, dv, dd] = self.difference;
        RingSums {
            n,
            r2,
            r4: self.r4,
            u,
            v,
            uu,
            uv,
            r2u,
            r2v,
            d,
            du,
            dv,
            dd,
        }
    }
}

/// Rings of a quarter of a pixel's width near the contact's edge and four pixels' further in, where the profile hardly bends
/// across a ring; reused from fit to fit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rings {
    rings: Vec<Ring>,
}

/// Pixels well inside the edge beyond which some are left out there: the profile is flat and they only repeat each other.
const ENOUGH: f64 = 8192.0;
/// Rings per pixel of distance near the edge.
const PER_PIXEL: f64 = 4.0;
/// How far inside the edge the rings are thin, in pixels.
const EDGE: f64 = 20.0;
/// Rings per pixel of distance further in. At the innermost thin ring a² − r² is ten times its change across a wide one, whose spread in r² the
/// level takes into account: what is left is of the fourth order, 1e-6 of the level.
const PER_PIXEL_INSIDE: f64 = 0.25;

impl Rings {
    /// Every ring that has pixels.
    pub(super) fn filled(&self) -> impl Iterator<Item = RingSums> + '_ {
        self.rings.iter().map(Ring::sums).filter(|r| r.n > 0.0)
    }

    /// Gathers the pixels of the aperture. The centre is relative to the region's first pixel; `aspect` is the pixel's
    /// height over its width, and distances are in pixel widths. `radius` is about that of the contact.
    pub(super) fn gather(&mut self, region: &Region, centre: [f64; 2], aspect: f64, radius: f64) {
        self.rings.clear();
        let wide = (radius - EDGE).max(0.0).floor();
        let inside = std::f64::consts::PI * wide * wide / aspect;
        let step = (inside / ENOUGH).sqrt().ceil() as usize;
        let gather = Gather {
            rings: &mut self.rings,
            region,
            centre,
            aspect,
            wide,
            every: region.every_nth(&region.aperture, step),
        };
        vectorized(gather);
    }
}

struct Gather<'a> {
    rings: &'a mut Vec<Ring>,
    region: &'a Region,
    centre: [f64; 2],
    aspect: f64,
    /// Distance up to which rings are wide.
    wide: f64,
    /// Of the rows and columns inside that distance, those that are gathered.
    every: [EveryNth; 2],
}

impl Gather<'_> {
    /// Number of the ring at a distance: slowly growing up to `wide`, steeply beyond.
    #[inline(always)]
    fn ring(&self, r: f64) -> usize {
        let inside = PER_PIXEL_INSIDE * r;
        let thin = PER_PIXEL * r - (PER_PIXEL - PER_PIXEL_INSIDE) * self.wide;
        (if thin > inside { thin } else { inside }) as i32 as usize
    }

    /// The pixels of a row that lie inside the distance `wide`.
    #[inline(always)]
    fn inner(&self, v: f64, first: f64, len: usize) -> std::ops::Range<usize> {
        let half = (self.wide * self.wide - v * v).max(0.0).sqrt();
        let at = |u: f64| ((u - first).max(0.0).ceil() as usize).min(len);
        let (start, end) = (at(-half), at(half));
        if start < end { start..end } else { 0..0 }
    }

    /// Adds pixels side by side, the first at (u, v).
    #[inline(always)]
    fn row(&mut self, v: f64, mut u: f64, differences: &[f32]) {
        for d in differences {
            let r2 = u * u + v * v;
            let ring = self.ring(r2.sqrt());
            self.rings[ring].add(u, v, r2, f64::from(*d));
            u += 1.0;
        }
    }
}

impl pulp::NullaryFnOnce for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let columns = self.region.columns();
        let [every_row, every_column] = self.every;
        for run in &self.region.aperture {
            let v = (f64::from(run.row) - self.centre[1]) * self.aspect;
            let first = f64::from(run.start) - self.centre[0];
            let far = first.abs().max((first + run.len() as f64).abs()).hypot(v);
            let needed = self.ring(far) + 1;
            if needed > self.rings.len() {
                self.rings.resize(needed, Ring::default());
            }
            let pixels = &self.region.difference[run.span(columns)];
            let inner = self.inner(v, first, pixels.len());
            self.row(v, first, &pixels[..inner.start]);
            self.row(v, first + inner.end as f64, &pixels[inner.end..]);
            if every_row.contains(run.row as usize) {
                let start = run.start as usize;
                for column in every_column.within(start + inner.start..start + inner.end) {
                    let at = column - start;
                    self.row(v, first + at as f64, &pixels[at..=at]);
                }
            }
        }
    }
}
