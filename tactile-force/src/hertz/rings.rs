//! Pixels gathered into thin rings about a centre.

/// Sums over the pixels of one ring; c and s are cosine and sine of a pixel's direction, d its difference.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ring {
    pub(super) n: f64,
    pub(super) r2: f64,
    pub(super) r4: f64,
    pub(super) c: f64,
    pub(super) s: f64,
    pub(super) cc: f64,
    pub(super) cs: f64,
    pub(super) d: f64,
    pub(super) dc: f64,
    pub(super) ds: f64,
    pub(super) dd: f64,
}

/// Rings of half a pixel's width, reused from fit to fit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rings {
    pub(super) rings: Vec<Ring>,
}

/// Rings per pixel of distance.
const PER_PIXEL: f64 = 2.0;

impl Rings {
    /// Gathers the pixels where `inside` is 1. The centre is relative to the first pixel; `aspect` is the pixel's height
    /// over its width, and distances are in pixel widths.
    pub(super) fn gather(
        &mut self,
        difference: &[i16],
        inside: &[u8],
        columns: usize,
        centre: [f64; 2],
        aspect: f64,
    ) {
        self.rings.clear();
        let rows = difference.chunks(columns).zip(inside.chunks(columns));
        for (y, (differences, inside)) in rows.enumerate() {
            let v = (y as f64 - centre[1]) * aspect;
            for (x, (&d, _)) in differences.iter().zip(inside).enumerate().filter(|(_, (_, m))| **m == 1) {
                let u = x as f64 - centre[0];
                let r2 = u * u + v * v;
                let r = r2.sqrt();
                let at = (PER_PIXEL * r) as usize;
                if at >= self.rings.len() {
                    self.rings.resize(at + 1, Ring::default());
                }
                let d = f64::from(d);
                let (c, s) = if r > 0.0 { (u / r, v / r) } else { (0.0, 0.0) };
                let ring = &mut self.rings[at];
                ring.n += 1.0;
                ring.r2 += r2;
                ring.r4 += r2 * r2;
                ring.c += c;
                ring.s += s;
                ring.cc += c * c;
                ring.cs += c * s;
                ring.d += d;
                ring.dc += d * c;
                ring.ds += d * s;
                ring.dd += d * d;
            }
        }
    }
}
