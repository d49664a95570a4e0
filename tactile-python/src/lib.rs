//! The module `tactile_imaging._native` of the Python package `tactile_imaging`.
// Keyword arguments in Python are arguments here.
#![allow(clippy::too_many_arguments)]

mod arrays;
mod check;
mod errors;
mod gels;
mod inclusion;
mod laws;
mod matching;
mod own;
mod pipeline;
mod press;
mod results;
mod sensor;
mod simulate;
mod spline;
mod surfaces;

use pyo3::prelude::*;

/// Runs the program `tactile` and returns its exit code. The first argument is the name of the
/// program.
#[pyfunction]
fn run_program(py: Python<'_>, arguments: Vec<String>) -> u8 {
    py.detach(|| tactile_cli::run_with(arguments))
}

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::check::CheckPress;
    #[pymodule_export]
    use super::errors::TactileError;
    #[pymodule_export]
    use super::gels::{GelFollower, GelSensor, markers};
    #[pymodule_export]
    use super::inclusion::{inclusion, inclusion_of_scene};
    #[pymodule_export]
    use super::laws::{estimate_modulus, hertz};
    #[pymodule_export]
    use super::matching::{match_points, strain_between, strain_series};
    #[pymodule_export]
    use super::pipeline::{Object, Pipeline};
    #[pymodule_export]
    use super::press::{Press, Session};
    #[pymodule_export]
    use super::results::{
        Contact, Estimate, GelContact, GelFrame, GelReport, HertzContact, HiddenLumps, Inclusion,
        Load, Lump, Markers, Match, Modulus, SimulatedPress, Strain, StrainBetween, StrainGrid,
        Surface,
    };
    #[pymodule_export]
    use super::run_program;
    #[pymodule_export]
    use super::sensor::Sensor;
    #[pymodule_export]
    use super::simulate::simulate;
    #[pymodule_export]
    use super::spline::ThinPlateSpline;
    #[pymodule_export]
    use super::surfaces::{depth, integrate, reconstruct};

    #[pymodule_export]
    #[allow(non_upper_case_globals)] // its name in Python
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
