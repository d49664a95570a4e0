//! Where the legend stands.

/// Where the legend stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub(crate) enum Legend {
    /// In the corner where it hides the least.
    #[default]
    Emptiest,
    /// Above the data, on the right.
    UpperRight,
    /// Above the data, on the left.
    UpperLeft,
    /// Below the data, on the right.
    LowerRight,
    /// Below the data, on the left.
    LowerLeft,
}
