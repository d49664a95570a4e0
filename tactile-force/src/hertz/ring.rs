//! Sums over one ring.

/// Sums over the pixels of one ring; (u, v) is a pixel's place relative to the centre, d its difference. Four by four, so
/// that a pixel is added with a few wide instructions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ring {
    /// Σ 1, Σ u, Σ v, Σ r².
    pub(super) place: [f64; 4],
    /// Σ u², Σ u v, Σ r² u, Σ r² v.
    pub(super) product: [f64; 4],
    /// Σ d, Σ d u, Σ d v, Σ d².
    pub(super) difference: [f64; 4],
    /// Σ r⁴.
    pub(super) r4: f64,
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
    pub(super) fn add(&mut self, u: f64, v: f64, r2: f64, d: f64) {
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
    pub(super) fn merge(&mut self, other: &Self) {
        for k in 0..4 {
            self.place[k] += other.place[k];
            self.product[k] += other.product[k];
            self.difference[k] += other.difference[k];
        }
        self.r4 += other.r4;
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
