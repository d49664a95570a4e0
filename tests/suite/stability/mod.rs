//! The whole pipeline in every unit, position and brightness, and at the ends of what frames and
//! loads can be.
mod degenerate;
mod loads;
mod press;
mod stability_scale;
mod steps;
mod symmetry;
mod table;
