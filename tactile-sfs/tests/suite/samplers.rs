//! Requirements for every sampler: the requested number of points, inside the mask, evenly
//! distributed, without allocation.

use crate::common::{Sampled, gaussian, sphere};
use ndarray::Array2;
use tactile_sfs::*;

fn samplers() -> [Box<dyn ControlPointSampler<f64>>; 1] {
    [Box::new(EquallySpaced)]
}

#[test]
fn samplers_with_a_workspace_do_not_allocate() {
    let case = Sampled::new(60, sphere);
    for (sampler, count) in samplers()
        .iter()
        .flat_map(|sampler| [(sampler, 40), (sampler, 900)])
    {
        let domain = Domain::new([case.pixel; 2]).unwrap();
        let (z, domain) = (case.z.view(), domain.with_mask(case.mask.view()));
        let (mut workspace, mut points) = (SurfaceWorkspace::default(), Vec::new());
        let mut run = || {
            sampler
                .sample_with(&mut workspace, z, &domain, count, &mut points)
                .unwrap()
        };
        run();
        assert_eq!(
            allocation_counter::measure(&mut run).count_total,
            0,
            "{count}"
        );
        // 40 points move freely, and 900 are nearly as dense as the pixels.
        assert_eq!(points, sampler.sample(z, &domain, count).unwrap());
        assert!(
            sampler
                .sample_with(&mut workspace, z, &domain, 9000, &mut points)
                .is_err()
        );
        assert!(points.is_empty());
    }
}

#[test]
fn samplers_give_the_count_inside_the_mask() {
    let case = Sampled::new(60, sphere);
    let z = Array2::from_shape_fn(
        (60, 60),
        |at| if case.mask[at] { case.z[at] } else { f64::NAN },
    );
    let pixels = case.mask.iter().filter(|&&inside| inside).count();
    for sampler in samplers() {
        for count in [0, 1, 2, 17, 200, 1000, pixels] {
            let points = sampler
                .sample(
                    z.view(),
                    &Domain::new([case.pixel; 2])
                        .unwrap()
                        .with_mask(case.mask.view()),
                    count,
                )
                .unwrap();
            assert_eq!(points.len(), count);
            let mut seen = std::collections::HashSet::new();
            for point in &points {
                let at = [
                    (point.y / case.pixel).round() as usize,
                    (point.x / case.pixel).round() as usize,
                ];
                assert!(case.mask[at] && seen.insert(at));
                assert!(lies_between(&z, case.pixel, point), "{point}");
            }
        }
        let error = sampler
            .sample(
                z.view(),
                &Domain::default().with_mask(case.mask.view()),
                pixels + 1,
            )
            .unwrap_err();
        assert_eq!(
            error,
            SfsError::TooManyPoints {
                requested: pixels + 1,
                available: pixels
            }
        );
    }
}

/// Whether the height of a point is between those of the surrounding pixels.
fn lies_between(z: &Array2<f64>, pixel: f64, point: &nalgebra::Point3<f64>) -> bool {
    let near = |at: f64| {
        [
            (at / pixel + 1e-9).floor() as usize,
            (at / pixel - 1e-9).ceil() as usize,
        ]
    };
    let corners = near(point.y).map(|row| near(point.x).map(|column| z[[row, column]]));
    let heights = corners.iter().flatten();
    let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), &h| {
        (low.min(h), high.max(h))
    });
    // Rounding of a sum of four products.
    low - 1e-12 <= point.z && point.z <= high + 1e-12
}

#[test]
fn the_same_surface_larger_gives_the_same_points_of_it() {
    let bump = |n: usize| {
        let unit = n as f64 / 2.0;
        let at = |i: usize| (i as f64 + 0.5 - unit) / unit;
        Array2::from_shape_fn((n, n), |(r, c)| {
            unit * 0.6 * (-3.0 * ((at(r) - 0.1).powi(2) + at(c).powi(2))).exp()
        })
    };
    let sample = |n: usize| {
        EquallySpaced
            .sample(bump(n).view(), &Domain::default(), 120)
            .unwrap()
    };
    let (small, large) = (sample(90), sample(108));
    // Centres of pixels: the scaling is relative to the corner of the frame, half a pixel away.
    let scaled = |p: &nalgebra::Point3<f64>| (p.coords.xy().add_scalar(0.5) * 1.2).add_scalar(-0.5);
    let apart = small
        .iter()
        .zip(&large)
        .map(|(a, b)| (scaled(a) - b.coords.xy()).norm());
    let mean = apart.sum::<f64>() / 120.0;
    // Points are 8 pixels apart. The remaining error is that of areas from central differences, of
    // second order in the pixel.
    assert!(mean < 0.01, "{mean}");
}

#[test]
fn equal_spacing_is_even_on_the_surface() {
    let case = Sampled::new(200, gaussian);
    let z = case.z.mapv(|z| 3.0 * z);
    let points = EquallySpaced
        .sample(z.view(), &Domain::new([case.pixel; 2]).unwrap(), 200)
        .unwrap();
    let nearest: Vec<f64> = points
        .iter()
        .enumerate()
        .map(|(i, a)| {
            let others = points.iter().enumerate().filter(|&(j, _)| j != i);
            others
                .map(|(_, b)| (a - b).norm())
                .fold(f64::INFINITY, f64::min)
        })
        .collect();
    let mean = nearest.iter().sum::<f64>() / 200.0;
    let spread = (nearest.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / 200.0).sqrt() / mean;
    // A random draw has a spread of 0.52, and a hexagonal lattice of 0.
    assert!(spread < 0.2, "{spread}");
}

/// Points of a ball represent equal areas, with slopes limited to 63°: their fraction within a
/// radius is an integral, whatever the shape of the pixels.
#[test]
fn points_of_a_contact_stand_for_equal_areas_on_oblong_pixels_too() {
    const RADIUS: f64 = 40.0;
    const COUNT: usize = 500;
    let area = |to: f64| {
        let radii = (0..4000).map(|k| to * (f64::from(k) + 0.5) / 4000.0);
        let slope_squared = |r: f64| r * r / (RADIUS * RADIUS - r * r);
        let rings = radii.map(|r| r * (1.0 + slope_squared(r).min(4.0)).sqrt());
        rings.sum::<f64>() * to
    };
    for pixel in [[1.0, 1.0], [1.0, 2.0], [2.0, 1.0]] {
        let shape = [100.0 / pixel[1], 100.0 / pixel[0]].map(|n| n as usize);
        let distance = |x: f64, y: f64| (x - 49.3).hypot(y - 49.8);
        let z = Array2::from_shape_fn(shape, |(r, c)| {
            let r = distance(pixel[0] * c as f64, pixel[1] * r as f64);
            (RADIUS * RADIUS - r * r).max(0.0).sqrt()
        });
        let mask = z.mapv(|z| z > 0.0);
        let points = ContactSampler.sample(
            z.view(),
            &Domain::new(pixel).unwrap().with_mask(mask.view()),
            COUNT,
        );
        let points = points.unwrap();
        for within in [16.0, 28.0] {
            let inside = points.iter().filter(|p| distance(p.x, p.y) < within);
            let found = inside.count() as f64 / COUNT as f64;
            let expected = area(within) / area(RADIUS);
            // A circle cuts about forty cells of the points, and may add or lose one of ten.
            assert!(
                (found - expected).abs() < 0.015,
                "{pixel:?}, {within}: {found} {expected}"
            );
        }
    }
}

/// The slope of a round body is infinite at its rim: points must follow the body, not the pixels
/// there. Root mean square distance of the control points of a hemisphere from its axis, divided by
/// its radius in pixels.
fn spread(radius: f64, centre: [f64; 2], count: usize) -> f64 {
    let square =
        |r: usize, c: usize| (r as f64 - centre[0]).powi(2) + (c as f64 - centre[1]).powi(2);
    let n = 2 * (radius.ceil() as usize + 3);
    let z = Array2::from_shape_fn((n, n), |(r, c)| {
        (radius * radius - square(r, c)).max(0.0).sqrt()
    });
    let mask = Array2::from_shape_fn((n, n), |(r, c)| square(r, c) < radius * radius);
    let points = EquallySpaced
        .sample(z.view(), &Domain::default().with_mask(mask.view()), count)
        .unwrap();
    let places = || points.iter().map(|p| p.coords.xy());
    let middle = places().sum::<nalgebra::Vector2<f64>>() / count as f64;
    let squares: f64 = places().map(|p| (p - middle).norm_squared()).sum();
    (squares / count as f64).sqrt() / radius
}

#[test]
fn a_larger_hemisphere_has_the_same_points() {
    for k in 0..12 {
        let shift = [0.13 * f64::from(k), 0.29 * f64::from(k)].map(f64::fract);
        let at = |radius: f64| spread(radius, shift.map(|s| radius.ceil() + 3.0 + s), 200);
        // Radii of 35 and 42 pixels, as for the contact of a ball at 0.7 N and 1.2 N. One pixel of
        // 4000 is 1.2e-4 of the radius, and the effect of the ragged edge is about ten times that.
        // With the unlimited area of the rim pixels it would be larger by 3e-3, always in one
        // direction.
        let apart = at(42.0) / at(35.1) - 1.0;
        assert!(apart.abs() < 2.5e-3, "{apart}");
    }
}
