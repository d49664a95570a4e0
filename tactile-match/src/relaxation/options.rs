//! What a caller may say about a scene.

use super::anneal::Slack;
use crate::{MatchError, validate::option_within};

/// Weight of the slack on a side where no stray points are expected.
const RARE: f64 = 0.01;

/// How far the target may be turned against the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rotation {
    /// By up to about half a right angle.
    #[default]
    Limited,
    /// By any angle.
    Any,
}

/// On which side points without a partner are expected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outliers {
    /// Every point may lack its partner.
    #[default]
    Both,
    /// Only model points: parts of the object are out of sight.
    Model,
    /// Only target points: clutter.
    Target,
    /// The sets are the same points.
    None,
}

/// How far the search for the right start goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Search {
    /// Until an answer is exact, or every start is tried and the scales of the prior are fitted to the data: any scene.
    #[default]
    Thorough,
    /// One annealing run from the sets as they lie, centred: for sets known to be near each other, such as those of one
    /// contact at two loads. A fixed, small number of iterations.
    Near,
}

/// Options of [`RelaxationMatcher`](crate::RelaxationMatcher); all of them have defaults that suit every scene tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaxationOptions {
    pub(crate) rotation: Rotation,
    pub(crate) outliers: Outliers,
    pub(crate) search: Search,
    pub(crate) share: f64,
    pub(crate) max_iterations: usize,
}

impl Default for RelaxationOptions {
    fn default() -> Self {
        Self {
            rotation: Rotation::Limited,
            outliers: Outliers::Both,
            search: Search::Thorough,
            share: 0.1,
            max_iterations: 200,
        }
    }
}

impl RelaxationOptions {
    /// Says how far the target may be turned.
    #[must_use]
    pub fn rotation(mut self, rotation: Rotation) -> Self {
        self.rotation = rotation;
        self
    }

    /// Says where points without a partner are expected.
    #[must_use]
    pub fn outliers(mut self, outliers: Outliers) -> Self {
        self.outliers = outliers;
        self
    }

    /// Says how far to search.
    #[must_use]
    pub fn search(mut self, search: Search) -> Self {
        self.search = search;
        self
    }

    /// Sets the expected share of points without a partner, in [10⁻⁶, 0.9] (default 0.1).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] outside that range.
    pub fn stray_share(mut self, share: f64) -> Result<Self, MatchError> {
        option_within("stray_share", share, 1e-6, 0.9, "[1e-6, 0.9]")?;
        self.share = share;
        Ok(self)
    }

    /// Sets the most outer iterations of one start, at least 1 (default 200).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn max_iterations(mut self, limit: usize) -> Result<Self, MatchError> {
        option_within("max_iterations", limit as f64, 1.0, f64::MAX, "[1, ∞)")?;
        self.max_iterations = limit;
        Ok(self)
    }

    pub(crate) fn slack(&self) -> Slack {
        let (model, target) = match self.outliers {
            Outliers::Both => (1.0, 1.0),
            Outliers::Model => (1.0, RARE),
            Outliers::Target => (RARE, 1.0),
            Outliers::None => (RARE, RARE),
        };
        Slack { share: self.share, model, target }
    }
}
