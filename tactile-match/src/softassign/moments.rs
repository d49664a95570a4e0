//! Moments of the rows of the match matrix: how much of a point is matched, and where its soft partners lie.

/// Sums over the rows of M, each entry times a power of its target's precision.
#[derive(Clone, Debug, Default)]
pub(crate) struct RowMoments<const D: usize> {
    /// Row sums without the slack.
    pub(crate) weight: Vec<f64>,
    /// Mean of `tⱼ − yᵢ` under row i.
    pub(crate) shift: Vec<[f64; D]>,
    /// Sum of `m_ij |tⱼ − yᵢ|²` over row i.
    pub(crate) spread: Vec<f64>,
}

/// Moments with the entries times the precisions of their targets to the power of 0, 1 and 2.
#[derive(Clone, Debug, Default)]
pub(crate) struct AllMoments<const D: usize> {
    pub(super) powers: [RowMoments<D>; 3],
    /// Column scales times precisions.
    pub(super) factors: Vec<f32>,
    /// Whether the powers differ; otherwise there is the first alone.
    pub(super) differ: bool,
}

impl<const D: usize> AllMoments<D> {
    /// As they are: how much of each point is matched.
    pub(crate) fn plain(&self) -> &RowMoments<D> {
        &self.powers[0]
    }

    /// By precision: what the warp is fitted to.
    pub(crate) fn by_precision(&self) -> &RowMoments<D> {
        &self.powers[usize::from(self.differ)]
    }

    /// By squared precision: what the noise is estimated from.
    pub(crate) fn by_squared_precision(&self) -> &RowMoments<D> {
        &self.powers[2 * usize::from(self.differ)]
    }
}
