//! Scene files: one TOML file that names the frames and all inputs of a measurement.
//!
//! ```toml
//! reference = "reference.png"            # the sensor without contact
//! pixel_size_m = [21.55e-6, 21.55e-6]    # x, y, on the sensing surface
//!
//! [calibration]                          # one of the two, none where every frame has its force_N
//! pairs = "calibration.csv"              # columns integrated_pixel_value,force_N
//! reference = "reference.png"            # the sensor without contact when the pairs were taken:
//!                                        # with it, forces allow for lamps that changed since
//! # depth_table = "depth.csv"            # columns darkness_grey_levels,depth_mm
//!
//! [[frames]]
//! image = "frame_1.png"
//! force_N = 0.70                         # a gauge reading, if there is one
//! force_error_N = 0.002                  # its standard error beside that of the scale
//! time_s = 0.5                           # since the object touched, not decreasing: five times
//!                                        # separate a relaxing sample from a drifting sensor
//!
//! [[frames]]
//! image = "frame_2.png"
//!
//! [object]
//! shape = "sphere"                       # or "block", "cylinder" (a flat face, no size),
//!                                        # "flat_punch", "layer" (radius_m of the ball on it,
//!                                        # thickness_m), "cone" (half_angle_rad), "unknown"
//! radius_m = 3e-3
//! poisson_ratio = 0.5
//!
//! [[waveguide.layers]]                   # from the object's side to the glass, rigid without any
//! refractive_index = 1.41                # (or with waveguide = "rigid")
//! thickness_m = 2e-3
//! youngs_modulus_pa = 1.36e5
//! poisson_ratio = 0.5                    # incompressible where it is absent
//! ```
//!
//! A calibrated [`Sensor`](crate::sensor::Sensor) replaces `pixel_size_m`, `[calibration]`,
//! `flat_field` and `[waveguide]`, and adds their errors:
//!
//! ```toml
//! reference = "reference.png"
//! sensor = "sensor.toml"                 # written by a calibration, see `sensor`
//! frames = [{ image = "frame_1.png" }]
//! [object]
//! shape = "sphere"
//! radius_m = 3e-3
//! radius_error_m = 5e-6
//! poisson_ratio_error = 0.002
//! ```
//!
//! Further fields are possible (`flat_field`, `illumination_drift`, `bits` and `contact_table`
//! stand above the first table):
//!
//! ```toml
//! contact_table = "table.toml"           # of this ball and waveguide, made by `tactile table`
//! bits = 12                              # of the camera, where 16-bit files do not state them
//! illumination_drift = "automatic"       # changes of the lamps since the reference are divided
//!                                        # out where the light outside the contact shows them
//! flat_field = "reference"               # divides by the reference's own brightness (vignetting)
//!
//! [stages]                               # each by name, here the defaults
//! reconstruction = "eikonal"             # ReconstructionChoice, not with a depth table
//! sampler = "contact"                    # SamplerChoice
//! matcher = "annealed-softassign"        # MatcherChoice
//! warp = "thin-plate-spline"             # WarpChoice
//! strain = "green-lagrange"              # StrainChoice
//! estimator = "best"                     # EstimatorChoice
//! ```
//!
//! Presses of known force show the present state of the sensor. A press of the sample or the
//! calibrator measures the gain: forces are divided by it, and its error replaces `coupling_error`.
//! A press of a ball of known modulus corrects the layers of the guide by its contact radius:
//!
//! ```toml
//! [[check]]
//! image = "weight.png"                   # before or after the frames, of the same reference
//! force_N = 0.981
//! force_error_N = 0.001                  # 0.2 % if absent
//! object = "sample"                      # what was pressed: the object that is measured, or the
//!                                        # "calibrator", which leaves the object's coupling open
//! [[check]]
//! image = "ball.png"
//! force_N = 0.981
//! [check.ball]                           # instead of object
//! radius_m = 0.003
//! radius_error_m = 5e-6                  # 0.5 % if absent
//! youngs_modulus_pa = 62e3               # a rigid ball if absent
//! youngs_modulus_error_pa = 600.0        # 2 % if absent
//! poisson_ratio = 0.5                    # 0.5 if absent
//! poisson_ratio_error = 0.002            # 0.01 if absent
//! ```
//!
//! Inputs have standard errors. Errors that are not stated are assumed, and the result names them:
//!
//! ```toml
//! pixel_size_error = 1e-3                # relative, 0.3 % if absent
//! gauge_error = 1e-3                     # relative, of all forces, 0.2 % if absent
//! coupling_error = "exact"               # of the light that another object than the calibrator
//!                                        # couples: exact under a diffusing skin, 12 % if absent
//! layer_error = 0.02                     # of the moduli of all layers, 5 % if absent
//! [object]
//! radius_error_m = 5e-6                  # 0.5 % of the radius if absent
//! poisson_ratio_error = 0.002            # 0.01 if absent
//! adhesion_error_j_per_m2 = 0.0005       # of a ball, 0.001 if absent
//! ```
//!
//! The names of stages are those in [`StagesConfig`](tactile_imaging::pipeline::StagesConfig).
//! Images are PNG, PGM, JPEG or TIFF. Colour is converted to grey by the luma of Rec. 601, see
//! [`read_grey_image`](crate::io::read_grey_image). Relative paths are relative to the scene file.
//! Fields counted in errors (`frames[2]`) start at 1.
mod data;
mod file;
#[cfg(feature = "inclusion")]
mod hidden;
#[cfg(feature = "inclusion")]
mod inclusion;

pub use data::{LoadedCalibration, SceneData, doubt_of_depths, doubt_of_pairs};
#[cfg(feature = "fem")]
pub use file::solve_contact_table;
pub use file::{CalibrationSource, Scene, SceneCheck, SceneFrame, SceneLayer, read_contact_table};
#[cfg(feature = "inclusion")]
pub use hidden::HiddenLumps;
#[cfg(feature = "inclusion")]
pub use inclusion::{InclusionScene, LoadedInclusion};

pub(crate) use file::{elastic_layers, guide, refractive_index};
