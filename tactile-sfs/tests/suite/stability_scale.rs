//! Heights in every unit and in both precisions; saturated, black and constant images.
#![allow(clippy::print_stdout)]

use crate::common::{Alignment, Sampled, errors, gaussian, integrators, reconstructions, sphere};
use ndarray::Array2;
use tactile_sfs::*;
use test_support::Worst;

/// The unit of length is a factor of the heights. Only its rounding and that of the sums over 48 ×
/// 48 pixels, whose condition is the number of pixels across, may cause differences.
#[test]
fn integrals_have_no_unit() {
    let mut table = Worst::new("slope integration");
    let scene = Sampled::new(48, gaussian);
    let (p, q) = (scene.p.view(), scene.q.view());
    let [short_p, short_q] = [p, q].map(|slopes| slopes.mapv(|x| x as f32));
    for ((name, method), (_, single)) in integrators::<f64>().iter().zip(integrators::<f32>()) {
        let heights = |unit: f64| {
            let domain = Domain::new([scene.pixel * unit; 2]).unwrap();
            method.integrate(p, q, &domain).unwrap()
        };
        let expected = heights(1.0).heights;
        let size = expected.iter().fold(0.0, |m: f64, z| m.max(z.abs()));
        for unit in [1e-9, 1e-3, 1e9] {
            let mut found = heights(unit);
            found.heights /= unit;
            let error = errors(&found, &expected, Alignment::None).max;
            let units = error / size / (f64::EPSILON * 48.0);
            table.enter(&format!("{name}: scale"), units, 10.0);
        }
        let domain = Domain::new([scene.pixel as f32; 2]).unwrap();
        let found = single.integrate(short_p.view(), short_q.view(), &domain);
        let error = errors(&found.unwrap(), &expected, Alignment::None).max;
        let units = error / size / (f64::from(f32::EPSILON) * 48.0);
        table.enter(&format!("{name}: f32 against f64"), units, 10.0);
    }
    table.finish();
}

/// Every image gives a surface or a typed error, and no height inside the mask is NaN or infinite.
#[test]
fn saturated_and_constant_images_have_surfaces() {
    let scene = Sampled::new(24, sphere);
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
    for (name, method) in reconstructions(Lighting::default()) {
        for (what, image) in &images {
            let domain = Domain::new([1e-5; 2]).unwrap().with_mask(scene.mask.view());
            let Ok(surface) = method.reconstruct(Image::new(image.view(), domain)) else {
                continue;
            };
            let mut pixels = surface.heights.iter().zip(&surface.mask);
            assert!(
                pixels.all(|(z, inside)| !inside || z.is_finite()),
                "{name}: {what}"
            );
        }
    }
}
