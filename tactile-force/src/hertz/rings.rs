//! Pixels gathered into thin rings about a centre.

use crate::contact::Region;

/// Sums over the pixels of one ring; (u, v) is a pixel's place relative to the centre, d its difference.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ring {
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

/// Rings of a quarter of a pixel's width, reused from fit to fit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rings {
    pub(super) rings: Vec<Ring>,
}

/// Rings per pixel of distance.
const PER_PIXEL: f64 = 4.0;

impl Rings {
    /// Gathers the pixels of the aperture. The centre is relative to the region's first pixel; `aspect` is the pixel's
    /// height over its width, and distances are in pixel widths.
    pub(super) fn gather(&mut self, region: &Region, centre: [f64; 2], aspect: f64) {
        self.rings.clear();
        let columns = region.columns();
        for run in &region.aperture {
            let v = (f64::from(run.row) - centre[1]) * aspect;
            let first = f64::from(run.start) - centre[0];
            let far = first.abs().max((first + run.len() as f64).abs()).hypot(v);
            let needed = (PER_PIXEL * far) as usize + 1;
            if needed > self.rings.len() {
                self.rings.resize(needed, Ring::default());
            }
            for (x, d) in region.difference[run.span(columns)].iter().enumerate() {
                let (u, d) = (first + x as f64, f64::from(*d));
                let r2 = u * u + v * v;
                let ring = &mut self.rings[(PER_PIXEL * r2.sqrt()) as usize];
                ring.n += 1.0;
                ring.r2 += r2;
                ring.r4 += r2 * r2;
                ring.u += u;
                ring.v += v;
                ring.uu += u * u;
                ring.uv += u * v;
                ring.r2u += r2 * u;
                ring.r2v += r2 * v;
                ring.d += d;
                ring.du += d * u;
                ring.dv += d * v;
                ring.dd += d * d;
            }
        }
    }
}
