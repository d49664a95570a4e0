//! Progress of a search, and its cancellation.

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
pub(crate) struct Counter<'a> {
    pub done: usize,
    pub expected: usize,
    pub progress: &'a mut dyn FnMut(SearchProgress) -> ControlFlow<()>,
    pub cancelled: bool,
}

impl<'a> Counter<'a> {
    pub(crate) fn new(
        expected: usize,
        progress: &'a mut dyn FnMut(SearchProgress) -> ControlFlow<()>,
    ) -> Self {
        Self {
            done: 0,
            expected,
            progress,
            cancelled: false,
        }
    }

    /// Reports a solution. `false` where the search is to end.
    pub(crate) fn step(&mut self) -> bool {
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
