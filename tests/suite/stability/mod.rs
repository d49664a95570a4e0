//! The whole pipeline in different units, positions and brightness, and for extreme frames and
//! loads.
mod degenerate;
mod loads;
mod press;
mod stability_scale;
mod steps;
mod symmetry;
mod table;
