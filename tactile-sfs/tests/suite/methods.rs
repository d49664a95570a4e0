//! All implementations, for tests that must hold for each.
use tactile_sfs::*;

pub(crate) fn frontal() -> Lighting<f64> {
    Lighting::default()
}

pub(crate) fn oblique() -> Lighting<f64> {
    Lighting::new([1.0, 0.0, 1.0]).unwrap()
}

pub(crate) fn reconstructions() -> Vec<(&'static str, Box<dyn SurfaceReconstruction<f64>>)> {
    let rim = BoundaryCondition::Height(0.0);
    vec![
        (
            "eikonal",
            Box::new(Eikonal::new(frontal()).with_boundary(rim).unwrap()),
        ),
        (
            "eikonal oblique",
            Box::new(Eikonal::new(oblique()).with_boundary(rim).unwrap()),
        ),
        ("tsai-shah", Box::new(TsaiShah::new(oblique()))),
        (
            "brooks-horn",
            Box::new(BrooksHorn::new(oblique()).with_iterations(40, 10).unwrap()),
        ),
        (
            "depth table",
            Box::new(DepthTable::new(&[(0.0, 0.0), (1.0, 2.0)]).unwrap()),
        ),
    ]
}

pub(crate) fn integrators() -> Vec<(&'static str, Box<dyn SlopeIntegrator<f64>>)> {
    vec![
        ("poisson", Box::new(CosinePoisson)),
        ("frankot-chellappa", Box::new(FrankotChellappa)),
        ("least squares", Box::new(MaskedLeastSquares::default())),
    ]
}
