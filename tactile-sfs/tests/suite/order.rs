//! Order of accuracy on surfaces with closed forms.
#![allow(clippy::print_stdout)]

use crate::common::{Sampled, Shape, ellipsoid, gaussian, paraboloid, sphere, waves};
use ndarray::Array2;
use tactile_sfs::{
    Alignment, BoundaryCondition, CosinePoisson, Domain, Eikonal, EikonalBranch, Lighting,
    MaskedLeastSquares, SlopeIntegrator, StopReason, SurfaceReconstruction, height_error,
};

const SIZES: [usize; 3] = [64, 128, 256];

/// Mean absolute error, as orders between successive halvings of the pixel.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors
        .windows(2)
        .map(|pair| (pair[0] / pair[1]).log2())
        .collect()
}

fn rising(n: usize, shape: Shape) -> f64 {
    let sampled = Sampled::new(n, shape);
    let domain = Domain::new([sampled.pixel; 2])
        .unwrap()
        .with_mask(sampled.mask.view());
    let method = Eikonal::new(Lighting::default())
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let surface = method
        .with_branch(EikonalBranch::Convex)
        .reconstruct(sampled.image.view().into(), &domain)
        .unwrap();
    let error = height_error(
        surface.heights.view(),
        sampled.z.view(),
        Some(sampled.mask.view()),
        Alignment::None,
    );
    error.unwrap().error.mean_absolute
}

fn falling(n: usize, shape: Shape) -> f64 {
    let sampled = Sampled::new(n, shape);
    let mut known = Array2::from_elem(sampled.z.dim(), f64::NAN);
    let peak = sampled
        .z
        .indexed_iter()
        .max_by(|a, b| a.1.total_cmp(b.1))
        .unwrap()
        .0;
    known[peak] = sampled.z[peak];
    let domain = Domain::new([sampled.pixel; 2])
        .unwrap()
        .with_mask(sampled.mask.view())
        .with_known_heights(known.view());
    let method = Eikonal::new(Lighting::default()).with_branch(EikonalBranch::Concave);
    let surface = method
        .reconstruct(sampled.image.view().into(), &domain)
        .unwrap();
    let error = height_error(
        surface.heights.view(),
        sampled.z.view(),
        Some(sampled.mask.view()),
        Alignment::None,
    );
    error.unwrap().error.mean_absolute
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
        // Second order but for the peak, which the nearest pixel misses by up to half a pixel.
        assert!(
            orders(&errors).iter().all(|&order| order > 1.3),
            "{name}: {errors:?}"
        );
    }
}

#[test]
fn eikonal_from_a_rim_is_right_to_a_fraction_of_a_pixel() {
    // A vertical rim is found to a small part of a pixel; where the surface meets the plane at an
    // angle (slope 1 here) its place within the pixel is not in the image, and up to half a pixel
    // of height is lost.
    for ((name, shape), bound) in SHAPES.into_iter().zip([0.1, 0.2, 0.5]) {
        let errors = SIZES.map(|n| rising(n, shape) * n as f64 / 2.0);
        println!("{name}: {errors:.3?} pixels");
        assert!(
            errors.iter().all(|&error| error < bound),
            "{name}: {errors:?}"
        );
    }
}

#[test]
fn integrators_are_of_fourth_order() {
    let solve = |n: usize, method: &dyn SlopeIntegrator<f64>, shape: Shape| {
        let sampled = Sampled::new(n, shape);
        let domain = Domain::new([sampled.pixel; 2]).unwrap();
        let surface = method
            .integrate(sampled.p.view(), sampled.q.view(), &domain)
            .unwrap();
        let error = height_error(
            surface.heights.view(),
            sampled.z.view(),
            None,
            Alignment::Offset,
        )
        .unwrap();
        error.error.rms
    };
    for shape in [gaussian as Shape, waves] {
        for method in [
            &CosinePoisson as &dyn SlopeIntegrator<f64>,
            &MaskedLeastSquares::default(),
        ] {
            let errors = SIZES.map(|n| solve(n, method, shape));
            println!("{errors:.5?}, orders {:.2?}", orders(&errors));
            // 4 up to terms of higher order; the rises at the border are of third order, but few.
            assert!(
                orders(&errors).iter().all(|&order| order > 3.4),
                "{errors:?}"
            );
        }
    }
}

#[test]
fn pixels_need_not_be_square() {
    // The hemisphere seen through pixels 1.5 times as high as wide.
    let (wide, high) = (0.02, 0.03);
    let at = |r: usize, c: usize| sphere(c as f64 * wide - 1.0, r as f64 * high - 1.0);
    let shape = (67, 101);
    let z = Array2::from_shape_fn(shape, |(r, c)| at(r, c).map_or(0.0, |v| v[0]));
    let mask = Array2::from_shape_fn(shape, |(r, c)| at(r, c).is_some());
    let image = z.mapv(|z| z / 0.8);
    let domain = Domain::new([wide, high]).unwrap().with_mask(mask.view());
    let method = Eikonal::new(Lighting::default())
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let surface = method.reconstruct(image.view().into(), &domain).unwrap();
    let error = height_error(
        surface.heights.view(),
        z.view(),
        Some(mask.view()),
        Alignment::None,
    )
    .unwrap();
    // A hundredth of the radius, half a pixel: square pixels of this size reach the same.
    assert!(error.error.mean_absolute < 0.012, "{error:?}");
    let [p, q] = [1, 2].map(|k| {
        Array2::from_shape_fn(shape, |(r, c)| {
            gaussian(c as f64 * wide - 1.0, r as f64 * high - 1.0).unwrap()[k]
        })
    });
    let truth = Array2::from_shape_fn(shape, |(r, c)| {
        gaussian(c as f64 * wide - 1.0, r as f64 * high - 1.0).unwrap()[0]
    });
    let domain = Domain::new([wide, high]).unwrap();
    for method in [
        &CosinePoisson as &dyn SlopeIntegrator<f64>,
        &MaskedLeastSquares::default(),
    ] {
        let surface = method.integrate(p.view(), q.view(), &domain).unwrap();
        let error = height_error(
            surface.heights.view(),
            truth.view(),
            None,
            Alignment::Offset,
        )
        .unwrap();
        // Of fourth order, h⁴ = 10⁻⁶ times derivatives of some hundred; rises by the mean of two
        // slopes miss this.
        assert!(error.error.max < 2e-4, "{error:?}");
    }
}

#[test]
fn least_squares_on_a_rectangle_is_poissons_equation() {
    let sampled = Sampled::new(48, waves);
    let domain = Domain::new([sampled.pixel, 0.7 * sampled.pixel]).unwrap();
    let (p, q, weights) = (sampled.p.view(), sampled.q.view(), Array2::ones((48, 48)));
    let transformed = MaskedLeastSquares::default()
        .integrate(p, q, &domain)
        .unwrap();
    let sparse = MaskedLeastSquares::default()
        .with_weights(weights.view())
        .integrate(p, q, &domain)
        .unwrap();
    assert_eq!(
        (transformed.report.stop, sparse.report.stop),
        (StopReason::Direct, StopReason::Direct)
    );
    let parts = [&transformed, &sparse].map(|surface| {
        surface
            .report
            .components
            .iter()
            .map(|c| c.pixels)
            .collect::<Vec<_>>()
    });
    assert_eq!(parts[0], parts[1]);
    // Rounding of heights near 1, times the condition of a grid of 48 × 48, some thousand.
    let difference = (&transformed.heights - &sparse.heights)
        .iter()
        .fold(0.0_f64, |most, d| most.max(d.abs()));
    assert!(difference < 1e-11, "{difference}");
}
