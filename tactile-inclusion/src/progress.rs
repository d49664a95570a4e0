//! Progress of a search.

use core::ops::ControlFlow;

/// What a search is doing.
///
/// ```
/// use tactile_inclusion::SearchProgress;
///
/// let progress = SearchProgress { done: 3, expected: 30 };
/// assert!(progress.done < progress.expected);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SearchProgress {
    /// Solutions so far.
    pub done: usize,
    /// About how many there will be.
    pub expected: usize,
}

/// Counts solutions, reports each and hears whether to go on.
pub(super) struct Counter<'a> {
    pub(super) done: usize,
    pub(super) expected: usize,
    pub(super) progress: &'a mut dyn FnMut(SearchProgress) -> ControlFlow<()>,
    pub(super) cancelled: bool,
}

impl Counter<'_> {
    /// Reports a solution; `false` where the search is to end.
    pub(super) fn step(&mut self) -> bool {
        if self.cancelled {
            return false;
        }
        self.done += 1;
        self.expected = self.expected.max(self.done);
        let progress = SearchProgress {
            done: self.done,
            expected: self.expected,
        };
        self.cancelled |= (self.progress)(progress).is_break();
        !self.cancelled
    }
}
