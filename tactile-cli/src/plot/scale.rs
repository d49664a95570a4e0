//! How axes count, and what values span.

/// How an axis counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub(crate) enum Scale {
    /// Equal steps for equal differences.
    #[default]
    Linear,
    /// Equal steps for equal ratios; positions that are not positive are left out.
    Log10,
}

impl Scale {
    pub(super) fn forward(self, v: f64) -> f64 {
        match self {
            Self::Linear => v,
            Self::Log10 => v.log10(),
        }
    }
}

/// Smallest and largest finite value; (0, 1) where there is none.
pub(super) fn range_of<'a>(values: impl Iterator<Item = &'a f64>) -> [f64; 2] {
    let start = [f64::INFINITY, f64::NEG_INFINITY];
    let [lo, hi] = values
        .filter(|v| v.is_finite())
        .fold(start, |[lo, hi], &v| [lo.min(v), hi.max(v)]);
    if lo > hi { [0.0, 1.0] } else { [lo, hi] }
}

/// A range with a margin; never empty, never without bounds.
pub(super) fn widen([lo, hi]: [f64; 2], share: f64) -> [f64; 2] {
    if !(lo.is_finite() && hi.is_finite()) {
        return [0.0, 1.0];
    }
    let width = hi - lo;
    let least = 1e-9 * lo.abs().max(hi.abs());
    if width > least {
        [lo - share * width, hi + share * width]
    } else {
        let half = if lo == 0.0 { 0.5 } else { 0.1 * lo.abs() };
        [lo - half, hi + half]
    }
}
