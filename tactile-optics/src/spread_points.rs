//! Evenly distributed points.
//!
//! Points follow the additive recurrence with the powers of 1/φ_d, φ_d^(d+1) = φ_d + 1 (M. Roberts,
//! "The unreasonable effectiveness of quasirandom sequences", 2018). They are computed in 64-bit
//! fixed point, so that the number of rays does not affect the precision. The seed shifts the
//! points.

/// Fixed-point steps for two and four dimensions.
const STEPS_2: [f64; 4] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3, 0.0, 0.0];
const STEPS_4: [f64; 4] = [
    0.856_674_883_854_503,
    0.733_891_856_627_126_1,
    0.628_706_724_832_622,
    0.538_597_257_223_612_5,
];

/// A sequence of points in the unit square (two dimensions) or hypercube (four).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Points {
    steps: [u64; 4],
    shift: [u64; 4],
}

impl Points {
    pub(crate) fn new(four: bool, seed: u64) -> Self {
        let steps = if four { STEPS_4 } else { STEPS_2 };
        let fixed = |s: f64| (s * 18_446_744_073_709_551_616.0) as u64;
        let shift = core::array::from_fn(|k| hash(seed ^ hash(k as u64 + 1)));
        Self {
            steps: steps.map(fixed),
            shift,
        }
    }

    /// The coordinates of point `i`, in [0, 1).
    pub(crate) fn point(&self, i: u64) -> [f64; 4] {
        core::array::from_fn(|k| {
            // Overflow at 2⁶⁴ gives the exact fractional part, for any number of points.
            unit(self.shift[k].wrapping_add(self.steps[k].wrapping_mul(i + 1)))
        })
    }
}

/// A number in [0, 1) from the top bits.
pub(crate) fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / 9_007_199_254_740_992.0
}

/// SplitMix64's finaliser (G. Steele, D. Lea, C. Flood, OOPSLA 2014): a 64-bit number with all bits
/// mixed.
pub(crate) fn hash(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
