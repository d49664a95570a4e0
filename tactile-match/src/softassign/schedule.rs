//! How an annealing run goes, and where it stands.

/// Points without a partner: their expected share, and how far each side may have them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slack {
    pub(crate) share: f64,
    pub(crate) model: f64,
    pub(crate) target: f64,
}

/// One annealing run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Schedule {
    /// First temperature, as a standard deviation in radii of the model.
    pub(crate) sigma: f64,
    /// Lowest temperature.
    pub(crate) floor: f64,
    /// Largest fall of σ an iteration, as a factor.
    pub(crate) rate: f64,
    /// Smallest fall of σ an iteration, as a factor; 1 lets the residuals decide.
    pub(crate) least: f64,
    /// Most iterations.
    pub(crate) limit: usize,
    /// Whether undecided matches let the temperature fall ahead of the residuals, see [`Extrapolation`].
    pub(crate) extrapolates: bool,
    /// Iterations after which a temperature that no longer falls is the last.
    pub(crate) patience: usize,
    /// The same for the first temperature: a start colder than the noise.
    pub(crate) stuck: usize,
    /// Sinkhorn sweeps an iteration.
    pub(crate) sweeps: usize,
    /// Undecided matches stand still when residuals and temperature, as variances, differ by less than this share.
    pub(crate) still: f64,
    /// A cold run that matches fewer points has collapsed and ends.
    pub(crate) collapse: f64,
    /// So many points can have a partner: with nearly all of them matched, residuals that no longer fall are noise.
    pub(crate) partners: f64,
    /// What is expected of points without a partner.
    pub(crate) slack: Slack,
}

/// Where a run stands.
#[derive(Clone, Debug, Default)]
pub(crate) struct State<const D: usize> {
    /// Where the run's prior puts the model points.
    pub(crate) base: Vec<[f64; D]>,
    /// Where the warp puts them.
    pub(crate) warped: Vec<[f64; D]>,
    /// Standard deviation of the residuals along one axis.
    pub(crate) sigma: f64,
    /// Model points matched, in all.
    pub(crate) matched: f64,
    /// Iterations made.
    pub(crate) iterations: usize,
    /// Energy per model point after every iteration.
    pub(crate) trace: Vec<f64>,
    /// What the run is judged by; less is better.
    pub(crate) energy: f64,
    /// Whether the temperature stopped falling before the limit.
    pub(crate) settled: bool,
    /// Share of the matched points whose residual the noise of the others does not explain, see [`Annealer::tail`].
    pub(crate) tail: f64,
    /// Spread of the soft partners within a row, relative to the temperature: 1 undecided, 0 decided.
    pub(crate) ambiguity: f64,
}

impl<const D: usize> State<D> {
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.base.clone_from(&other.base);
        self.warped.clone_from(&other.warped);
        self.trace.clone_from(&other.trace);
        (self.sigma, self.iterations) = (other.sigma, other.iterations);
        (self.energy, self.settled, self.matched) = (other.energy, other.settled, other.matched);
        (self.tail, self.ambiguity) = (other.tail, other.ambiguity);
    }
}
