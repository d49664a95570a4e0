//! Fuzzy graph matching of point sets by relaxation labelling, with a thin-plate-spline warp.
#![forbid(unsafe_code)]
