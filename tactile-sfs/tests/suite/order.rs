//! Order of accuracy on surfaces with closed forms.
#![allow(clippy::print_stdout)]

use crate::common::{
    Alignment, Sampled, Shape, ellipsoid, errors, from_rim, gaussian, integrators, paraboloid,
    sphere, waves,
};
use ndarray::Array2;
use tactile_sfs::*;

const SIZES: [usize; 3] = [64, 128, 256];

/// Orders of errors between successive halvings of the pixel size.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors
        .windows(2)
        .map(|pair| (pair[0] / pair[1]).log2())
        .collect()
}

fn mean_error(sampled: &Sampled, method: &Eikonal<f64>, domain: &Domain<'_, f64>) -> f64 {
    let surface = method.reconstruct(Image::new(sampled.image.view(), *domain));
    errors(&surface.unwrap(), &sampled.z, Alignment::None).mean_absolute
}

fn falling(n: usize, shape: Shape) -> f64 {
    let sampled = Sampled::new(n, shape);
    let mut known = Array2::from_elem(sampled.z.dim(), f64::NAN);
    let heights = sampled.z.indexed_iter();
    let (peak, height) = heights.max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
    known[peak] = *height;
    let method = Eikonal::new(Lighting::default()).with_branch(EikonalBranch::Concave);
    let domain = sampled.domain().with_known_heights(known.view());
    mean_error(&sampled, &method, &domain)
}

const SHAPES: [(&str, Shape); 4] = [
    ("sphere", sphere),
    ("ellipsoid", ellipsoid),
    ("paraboloid", paraboloid),
    ("gaussian", gaussian),
];

#[test]
fn eikonal_error_falls_faster_than_linearly_from_a_known_peak() {
    for (name, shape) in SHAPES {
        let errors = SIZES.map(|n| falling(n, shape));
        println!("{name}: {errors:.5?}, orders {:.2?}", orders(&errors));
        // Second order except at the peak, whose distance from the nearest pixel is up to half a
        // pixel.
        assert!(
            orders(&errors).iter().all(|&order| order > 1.3),
            "{name}: {errors:?}"
        );
    }
}

#[test]
fn eikonal_from_a_rim_is_right_to_a_fraction_of_a_pixel() {
    let method = from_rim(Lighting::default()).with_branch(EikonalBranch::Convex);
    // A vertical rim is determined to a small fraction of a pixel. If the surface meets the plane
    // at an angle (slope 1 here), the image does not contain its position within the pixel, and up
    // to half a pixel of height is lost.
    for ((name, shape), bound) in SHAPES.into_iter().zip([0.1, 0.2, 0.5]) {
        let errors = SIZES.map(|n| {
            let sampled = Sampled::new(n, shape);
            mean_error(&sampled, &method, &sampled.domain()) / sampled.pixel
        });
        println!("{name}: {errors:.3?} pixels");
        assert!(
            errors.iter().all(|&error| error < bound),
            "{name}: {errors:?}"
        );
    }
}

#[test]
fn integrators_are_of_fourth_order() {
    for shape in [gaussian as Shape, waves] {
        for (name, method) in integrators() {
            let errors = SIZES.map(|n| {
                let case = Sampled::new(n, shape);
                let domain = Domain::new([case.pixel; 2]).unwrap();
                let surface = method.integrate(case.p.view(), case.q.view(), &domain);
                errors(&surface.unwrap(), &case.z, Alignment::Offset).rms
            });
            println!("{errors:.5?}, orders {:.2?}", orders(&errors));
            // 4 up to terms of higher order. The rises at the border are of third order, but few.
            assert!(
                orders(&errors).iter().all(|&order| order > 3.4),
                "{name}: {errors:?}"
            );
        }
    }
}

#[test]
fn pixels_need_not_be_square() {
    // The hemisphere with pixels that are 1.5 times as high as wide.
    let (wide, high) = (0.02, 0.03);
    let field = |shape: Shape, k: usize| {
        Array2::from_shape_fn((67, 101), |(r, c)| {
            shape(c as f64 * wide - 1.0, r as f64 * high - 1.0).map_or(0.0, |values| values[k])
        })
    };
    let z = field(sphere, 0);
    let (mask, image) = (z.mapv(|z| z > 0.0), z.mapv(|z| z / 0.8));
    let domain = Domain::new([wide, high]).unwrap();
    let surface = from_rim(Lighting::default())
        .reconstruct(Image::new(image.view(), domain.with_mask(mask.view())))
        .unwrap();
    let error = errors(&surface, &z, Alignment::None);
    // A hundredth of the radius, which is half a pixel: square pixels of this size have the same
    // error.
    assert!(error.mean_absolute < 0.012, "{error:?}");
    let [z, p, q] = [0, 1, 2].map(|k| field(gaussian, k));
    for method in [
        &CosinePoisson as &dyn SlopeIntegrator<f64>,
        &MaskedLeastSquares::default(),
    ] {
        let surface = method.integrate(p.view(), q.view(), &domain).unwrap();
        let error = errors(&surface, &z, Alignment::Offset);
        // Fourth order: h⁴ = 10⁻⁶ times derivatives of several hundred. Rises from the mean of two
        // slopes would exceed this bound.
        assert!(error.max < 2e-4, "{error:?}");
    }
}

#[test]
fn least_squares_on_a_rectangle_is_poissons_equation() {
    let sampled = Sampled::new(48, waves);
    let domain = Domain::new([sampled.pixel, 0.7 * sampled.pixel]).unwrap();
    let (p, q, weights) = (sampled.p.view(), sampled.q.view(), Array2::ones((48, 48)));
    let transformed = MaskedLeastSquares::default();
    let sparse = transformed.with_weights(weights.view());
    let [transformed, sparse] =
        [transformed, sparse].map(|method| method.integrate(p, q, &domain).unwrap());
    assert_eq!(
        (transformed.report.stop, sparse.report.stop),
        (StopReason::Direct, StopReason::Direct)
    );
    let parts = [&transformed, &sparse].map(|surface| {
        let parts = surface.report.components.iter();
        parts.map(|part| part.pixels).collect::<Vec<_>>()
    });
    assert_eq!(parts[0], parts[1]);
    // Rounding of heights near 1, times the condition of a grid of 48 × 48, several thousand.
    let error = errors(&transformed, &sparse.heights, Alignment::None);
    assert!(error.max < 1e-11, "{error:?}");
}
