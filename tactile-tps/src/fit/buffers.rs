//! Working memory of a solve.

/// Working memory of a solve.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffers {
    /// Targets at the centres, by outputs.
    pub(super) targets: Vec<f64>,
    /// Weights at the centres, by outputs: the solution.
    pub(super) weights: Vec<f64>,
    pub(super) residuals: Vec<f64>,
    pub(super) work: Vec<f64>,
    pub(super) spare: Vec<f64>,
    pub(super) vectors: Vectors,
}

/// Working memory of an iterative solve.
#[derive(Clone, Debug, Default)]
pub(super) struct Vectors {
    pub(super) residual: Vec<f64>,
    pub(super) preconditioned: Vec<f64>,
    pub(super) direction: Vec<f64>,
    pub(super) product: Vec<f64>,
    pub(super) solution: Vec<f64>,
    pub(super) target: Vec<f64>,
    /// Values at the coarse points, and working memory of their solve.
    pub(super) coarse: [Vec<f64>; 2],
}
