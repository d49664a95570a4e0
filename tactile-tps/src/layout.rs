//! How the columns of dense factors lie in memory.

/// Columns of a panel, and the multiple the matrix is padded to.
pub(crate) const PANEL: usize = 8;

/// Rows and columns before the matrix proper, which the caller may use.
pub(crate) const HEAD: usize = 8;

/// Places in a column for n rows of which the first q stand before the matrix proper.
///
/// Not a multiple of 512 bytes: columns that far apart would crowd into the same few sets of the cache.
pub(crate) fn layout(n: usize, q: usize) -> usize {
    let stride = HEAD + (n - q).div_ceil(PANEL) * PANEL;
    if stride.is_multiple_of(64) {
        stride + PANEL
    } else {
        stride
    }
}
