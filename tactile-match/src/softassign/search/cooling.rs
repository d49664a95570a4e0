//! Schedules of the search's runs.

/// How a run cools: the part of a [`Schedule`] that differs between starts.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Cooling {
    /// First temperature, in radii of the model.
    pub(in super::super) sigma: f64,
    pub(super) rate: f64,
    pub(super) least: f64,
    pub(super) extrapolates: bool,
    pub(super) patience: usize,
    pub(super) stuck: usize,
    pub(super) sweeps: usize,
    /// Undecided matches stand still when residuals and temperature, as variances, differ by less than this share.
    pub(super) still: f64,
    /// By so much a run must be likelier than the best before, as a logarithm.
    pub(super) margin: f64,
}

/// Further runs end when the temperature has stood still for so many iterations: matches that have not settled by then wander for hundreds.
const PATIENCE: usize = 20;
/// The same at the first temperature: colder than the noise, it will not fall.
const STUCK: usize = 8;

/// Temperatures closer to what the residuals leave do not move the warp any more.
const STILL: f64 = 1e-4;

/// The first run: most scenes are easy.
pub(in super::super) const FAST: Cooling = Cooling {
    sigma: 0.3,
    rate: 0.75,
    least: 0.9,
    extrapolates: false,
    patience: usize::MAX,
    stuck: usize::MAX,
    sweeps: 3,
    still: STILL,
    margin: 0.0,
};
/// From the best answer so far.
pub(super) const REHEAT: Cooling = Cooling {
    sigma: 0.1,
    rate: 0.9,
    least: 1.0,
    extrapolates: true,
    patience: PATIENCE,
    stuck: STUCK,
    sweeps: 5,
    still: STILL,
    margin: 0.0,
};
/// The only run between sets that lie near each other. Residuals that stay above the temperature, whatever else moves, end it.
pub(super) const NEAR: Cooling = Cooling {
    sigma: 0.2,
    rate: 0.8,
    least: 1.0,
    extrapolates: false,
    patience: 12,
    stuck: 12,
    sweeps: 3,
    still: STILL,
    margin: 0.0,
};
/// Least first temperature of a run from the last answer of a series.
pub(super) const COOLEST: f64 = 0.03;
/// Further runs.
pub(super) const SLOW: Cooling = Cooling {
    sigma: 0.3,
    rate: 0.93,
    least: 1.0,
    extrapolates: true,
    patience: PATIENCE,
    stuck: STUCK,
    sweeps: 5,
    still: STILL,
    margin: 0.0,
};
/// After relaxation labelling, whose pairs are trusted more than a first guess.
pub(super) const LABELLED: Cooling = Cooling {
    sigma: 0.15,
    ..SLOW
};
/// After a turn that the caller calls unlikely. Where noise hides which point is which, all starts end in fields that explain the targets about
/// as well, and the turned ones are mostly wrong: they have to be likelier by e⁶, and need not converge to fall short of that. Where points can
/// be told apart the right start wins by hundreds.
pub(super) const TURNED: Cooling = Cooling {
    still: 5e-3,
    margin: 6.0,
    ..SLOW
};
