//! Tests of the facade, in a single binary, so that all dependencies are compiled and linked once.
#![allow(missing_docs)]

mod architecture;
mod assumptions;
mod cautions;
mod check_presses;
mod circles;
mod common;
mod corpus;
mod few_pairs;
mod finite_element_presses;
mod force_on_simulated_frames;
#[path = "../support/hostile.rs"]
mod hostile;
mod io_properties;
mod pipeline;
mod press_9dtact;
mod recorded_answers;
mod scene_files;
mod sensor_calibration;
mod serialtrack_strain;
mod simulator;
mod sound;
mod stability;
mod stated_errors;
mod uniaxial;
