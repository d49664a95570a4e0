//! Schedules of the search's runs.

/// How a run cools: the part of a [`Schedule`] that differs between starts.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Cooling {
    /// First temperature, in radii of the model.
    pub(in super::super) sigma: f64,
    pub(super) rate: f64,
    pub(super) least: f64,
    pub(super) patience: usize,
    pub(super) sweeps: usize,
}

/// Further runs end when the temperature has stood still for so many iterations: matches that have not settled by then wander for hundreds.
const PATIENCE: usize = 20;

/// The first run: most scenes are easy.
pub(in super::super) const FAST: Cooling = Cooling {
    sigma: 0.3,
    rate: 0.75,
    least: 0.9,
    patience: usize::MAX,
    sweeps: 3,
};
/// From the best answer so far.
pub(super) const REHEAT: Cooling = Cooling {
    sigma: 0.1,
    rate: 0.9,
    least: 1.0,
    patience: PATIENCE,
    sweeps: 5,
};
/// The only run between sets that lie near each other. Residuals that stay above the temperature, whatever else moves, end it.
pub(super) const NEAR: Cooling = Cooling {
    sigma: 0.2,
    rate: 0.8,
    least: 1.0,
    patience: 12,
    sweeps: 3,
};
/// Least first temperature of a run from the last answer of a series.
pub(super) const COOLEST: f64 = 0.03;
/// Further runs.
pub(super) const SLOW: Cooling = Cooling {
    sigma: 0.3,
    rate: 0.93,
    least: 1.0,
    patience: PATIENCE,
    sweeps: 5,
};
/// After relaxation labelling, whose pairs are trusted more than a first guess.
pub(super) const LABELLED: Cooling = Cooling {
    sigma: 0.15,
    ..SLOW
};
