//! Heights in every unit and both precisions; saturated, black and constant images.
#![allow(clippy::print_stdout)]

use test_support as worst;

use crate::common::{Sampled, gaussian, sphere};
use ndarray::Array2;
use tactile_sfs::*;
use worst::Worst;

/// A method in both precisions.
type Integrators = (
    &'static str,
    Box<dyn SlopeIntegrator<f64>>,
    Box<dyn SlopeIntegrator<f32>>,
);

fn integrators() -> [Integrators; 3] {
    [
        (
            "Frankot-Chellappa",
            Box::new(FrankotChellappa),
            Box::new(FrankotChellappa),
        ),
        (
            "cosine Poisson",
            Box::new(CosinePoisson),
            Box::new(CosinePoisson),
        ),
        (
            "masked least squares",
            Box::new(MaskedLeastSquares::default()),
            Box::new(MaskedLeastSquares::default()),
        ),
    ]
}

/// The unit of length is a factor of the heights; its rounding and that of the sums over 48 × 48
/// pixels, whose condition is the number of pixels across, are all that may differ.
#[test]
fn integrals_have_no_unit() {
    let mut table = Worst::new("slope integration");
    let scene = Sampled::new(48, gaussian);
    for (name, method, single) in integrators() {
        let heights = |unit: f64| {
            let domain = Domain::new([scene.pixel * unit; 2]).unwrap();
            method
                .integrate(scene.p.view(), scene.q.view(), &domain)
                .unwrap()
                .heights
        };
        let expected = heights(1.0);
        let size = expected.iter().fold(0.0, |m: f64, z| m.max(z.abs()));
        for unit in [1e-9, 1e-3, 1e9] {
            let error = heights(unit)
                .iter()
                .zip(&expected)
                .map(|(z, e)| (z / unit - e).abs())
                .fold(0.0, f64::max);
            table.enter(
                &format!("{name}: scale"),
                error / size / (f64::EPSILON * 48.0),
                10.0,
            );
        }
        let domain = Domain::new([scene.pixel as f32; 2]).unwrap();
        let short = |a: &Array2<f64>| a.mapv(|x| x as f32);
        let found = single
            .integrate(short(&scene.p).view(), short(&scene.q).view(), &domain)
            .unwrap()
            .heights;
        let error = found
            .iter()
            .zip(&expected)
            .map(|(z, e)| (f64::from(*z) - e).abs())
            .fold(0.0, f64::max);
        // An iterative solver in single precision stops at its own tolerance, some hundred
        // roundings.
        table.enter(
            &format!("{name}: f32 against f64"),
            error / size / (f64::from(f32::EPSILON) * 48.0),
            10.0,
        );
    }
    table.finish();
}

/// Whatever the image, a surface or a typed error comes back, and no height inside the mask is NaN
/// or infinite.
#[test]
fn saturated_and_constant_images_have_surfaces() {
    let scene = Sampled::new(24, sphere);
    let light = Lighting::default();
    let methods: [(&str, Box<dyn SurfaceReconstruction<f64>>); 3] = [
        (
            "eikonal",
            Box::new(
                Eikonal::new(light)
                    .with_boundary(BoundaryCondition::Height(0.0))
                    .unwrap(),
            ),
        ),
        ("Tsai-Shah", Box::new(TsaiShah::new(light))),
        (
            "Brooks-Horn",
            Box::new(BrooksHorn::new(light).with_iterations(20, 5).unwrap()),
        ),
    ];
    let images = [
        ("black", Array2::zeros((24, 24))),
        ("saturated", Array2::from_elem((24, 24), 1.0)),
        ("constant", Array2::from_elem((24, 24), 0.4)),
        ("over-exposed", Array2::from_elem((24, 24), 40.0)),
        (
            "one bright pixel",
            Array2::from_shape_fn((24, 24), |at| f64::from(u8::from(at == (12, 12)))),
        ),
        ("clipped ball", scene.image.mapv(|v| v.min(0.8))),
        ("tiny values", Array2::from_elem((24, 24), 1e-300)),
    ];
    for (name, method) in &methods {
        for (what, image) in &images {
            let domain = Domain::new([1e-5; 2]).unwrap().with_mask(scene.mask.view());
            let Ok(surface) = method.reconstruct(image.view().into(), &domain) else {
                continue;
            };
            let inside = surface
                .heights
                .iter()
                .zip(&surface.mask)
                .filter(|(_, inside)| **inside);
            assert!(
                inside.into_iter().all(|(z, _)| z.is_finite()),
                "{name}: {what}"
            );
        }
    }
}
