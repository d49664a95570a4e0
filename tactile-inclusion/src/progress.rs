//! Progress of a search, and its cancellation.

use core::ops::ControlFlow;
use tactile_core::Progress;

/// Counts solutions, reports each, and stops if the callback requests it.
pub(crate) struct Counter<'a> {
    pub done: usize,
    pub expected: usize,
    pub progress: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
    pub cancelled: bool,
}

impl<'a> Counter<'a> {
    pub(crate) fn new(
        expected: usize,
        progress: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Self {
        Self {
            done: 0,
            expected,
            progress,
            cancelled: false,
        }
    }

    /// Reports a solution. Returns `false` if the search must stop.
    pub(crate) fn step(&mut self) -> bool {
        if self.cancelled {
            return false;
        }
        self.done += 1;
        self.expected = self.expected.max(self.done);
        let progress = Progress::new(self.done, self.expected);
        self.cancelled |= (self.progress)(progress).is_break();
        !self.cancelled
    }
}
