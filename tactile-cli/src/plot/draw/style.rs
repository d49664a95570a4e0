//! Colours and texts that all parts of a panel share.
use super::super::colour::Colour;
use super::super::svg::{Anchor, Text};

/// The colour of numbers at ticks.
pub(super) const TICK_TEXT: Colour = Colour(40, 40, 40);
/// The colour of axes and of frames around colour bars.
pub(super) const AXIS: Colour = Colour(90, 90, 90);

/// A line of black text.
pub(in super::super) fn black(content: &str, at: [f64; 2], size: f64, anchor: Anchor) -> Text<'_> {
    Text {
        content,
        at,
        size,
        colour: Colour::BLACK,
        anchor,
        upright: false,
    }
}
