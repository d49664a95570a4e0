//! The module `tactile_imaging._native` of the Python package `tactile_imaging`.
mod arrays;
mod errors;
mod matching;
mod press;
mod results;
mod spline;

use pyo3::prelude::*;

/// Runs the program `tactile` on arguments, of which the first is its own name, and returns its
/// exit code.
#[pyfunction]
fn run_program(py: Python<'_>, arguments: Vec<String>) -> u8 {
    py.detach(|| tactile_cli::run_with(arguments))
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add(
        "TactileError",
        module.py().get_type::<errors::TactileError>(),
    )?;
    module.add_class::<press::Object>()?;
    module.add_class::<press::Pipeline>()?;
    module.add_class::<press::Press>()?;
    module.add_class::<press::Session>()?;
    module.add_class::<spline::ThinPlateSpline>()?;
    module.add_class::<results::Contact>()?;
    module.add_class::<results::Estimate>()?;
    module.add_class::<results::Match>()?;
    module.add_class::<results::Modulus>()?;
    module.add_class::<results::SimulatedPress>()?;
    module.add_class::<results::Strain>()?;
    module.add_class::<results::StrainBetween>()?;
    module.add_class::<results::Surface>()?;
    module.add_function(wrap_pyfunction!(matching::match_points, module)?)?;
    module.add_function(wrap_pyfunction!(matching::strain_between, module)?)?;
    module.add_function(wrap_pyfunction!(spline::integrate, module)?)?;
    module.add_function(wrap_pyfunction!(press::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(run_program, module)?)?;
    Ok(())
}
