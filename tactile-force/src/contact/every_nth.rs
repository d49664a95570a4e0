//! Some of many rows or columns, evenly chosen.
use std::ops::Range;

/// Every n-th number of a range, counted from its middle to both sides: the same rows and columns of a contact whichever way the image is
/// mirrored, turned or moved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EveryNth {
    /// The middle of the range, rounded down and up.
    low: usize,
    high: usize,
    step: usize,
}

impl EveryNth {
    /// Of a range that is not empty.
    pub(crate) fn of(range: Range<usize>, step: usize) -> Self {
        let ends = range.start + range.end.saturating_sub(1);
        Self {
            low: ends / 2,
            high: ends.div_ceil(2),
            step: step.max(1),
        }
    }

    /// Whether a number is one of them.
    pub(crate) fn contains(&self, at: usize) -> bool {
        let away = if at <= self.low {
            self.low - at
        } else {
            at - self.high
        };
        away.is_multiple_of(self.step)
    }

    /// Those within a range, from the middle up and then from the middle down.
    #[inline]
    pub(crate) fn within(&self, range: Range<usize>) -> impl Iterator<Item = usize> {
        let step = self.step;
        // Where both middles are one, it is counted once.
        let above = if self.low == self.high {
            self.high + step
        } else {
            self.high
        };
        let skipped = range.start.saturating_sub(above).div_ceil(step);
        let up = (above + skipped * step..range.end).step_by(step);
        let skipped = (self.low + 1).saturating_sub(range.end).div_ceil(step);
        let first_down = self.low.checked_sub(skipped * step);
        let room = first_down.and_then(|first| (first + 1).checked_sub(range.start));
        let (first, room) = (first_down.unwrap_or(0), room.unwrap_or(0));
        let down = (0..room.div_ceil(step)).map(move |k| first - k * step);
        up.chain(down)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn those_within_are_those_contained_and_mirroring_changes_none(
            start in 0_usize..20, length in 1_usize..40, step in 1_usize..7, from in 0_usize..60, count in 0_usize..60
        ) {
            let every = EveryNth::of(start..start + length, step);
            let mut found: Vec<usize> = every.within(from..from + count).collect();
            found.sort_unstable();
            let expected: Vec<usize> = (from..from + count).filter(|&at| every.contains(at)).collect();
            prop_assert_eq!(found, expected);
            for at in start..start + length {
                let mirrored = 2 * start + length - 1 - at;
                prop_assert_eq!(every.contains(at), every.contains(mirrored));
            }
        }
    }
}
