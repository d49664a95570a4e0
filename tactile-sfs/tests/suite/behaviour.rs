//! What every implementation must do: bad input, reused workspaces, masks, float types, determinism.
#![allow(clippy::print_stdout)]

use crate::common::{Sampled, sphere};
use ndarray::Array2;
use tactile_sfs::*;

fn frontal() -> Lighting<f64> {
    Lighting::frontal()
}

fn oblique() -> Lighting<f64> {
    Lighting::new([1.0, 0.0, 1.0]).unwrap()
}

fn reconstructions() -> Vec<(&'static str, Box<dyn SurfaceReconstruction<f64>>)> {
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
        ("pentland", Box::new(Pentland::new(oblique()))),
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

fn integrators() -> Vec<(&'static str, Box<dyn SlopeIntegrator<f64>>)> {
    vec![
        ("poisson", Box::new(CosinePoisson)),
        ("frankot-chellappa", Box::new(FrankotChellappa)),
        ("least squares", Box::new(MaskedLeastSquares::default())),
    ]
}

/// NaN-aware equality of the bits that matter.
fn same(a: &Surface<f64>, b: &Surface<f64>) -> bool {
    a.mask == b.mask
        && a.flags == b.flags
        && a.heights
            .iter()
            .zip(&b.heights)
            .all(|(x, y)| x.to_bits() == y.to_bits() || x.is_nan() && y.is_nan())
}

#[test]
fn a_reused_workspace_changes_nothing_and_does_not_allocate() {
    let (small, large) = (Sampled::new(24, sphere), Sampled::new(48, sphere));
    for (name, method) in reconstructions() {
        let (mut workspace, mut surface) = (Workspace::default(), Surface::default());
        for case in [&large, &small, &large] {
            let domain = Domain::pixels().with_mask(case.mask.view());
            method
                .reconstruct_with(
                    &mut workspace,
                    Frame::Real(case.image.view()),
                    &domain,
                    &mut surface,
                )
                .unwrap();
            assert!(
                same(
                    &surface,
                    &method.reconstruct(case.image.view(), &domain).unwrap()
                ),
                "{name}"
            );
        }
        let domain = Domain::pixels().with_mask(large.mask.view());
        let counted = allocation_counter::measure(|| {
            method
                .reconstruct_with(
                    &mut workspace,
                    Frame::Real(large.image.view()),
                    &domain,
                    &mut surface,
                )
                .unwrap();
        });
        assert_eq!(counted.count_total, 0, "{name}");
    }
    for (name, method) in integrators() {
        let (mut workspace, mut surface) = (Workspace::default(), Surface::default());
        let domain = Domain::pixels().with_mask(large.mask.view());
        let mut run = |surface: &mut Surface<f64>| {
            method
                .integrate_with(
                    &mut workspace,
                    large.p.view(),
                    large.q.view(),
                    &domain,
                    surface,
                )
                .unwrap();
        };
        run(&mut surface);
        let counted = allocation_counter::measure(|| run(&mut surface));
        assert_eq!(counted.count_total, 0, "{name}");
        let fresh = method
            .integrate(large.p.view(), large.q.view(), &domain)
            .unwrap();
        assert!(same(&surface, &fresh), "{name}");
    }
}

#[test]
fn nothing_outside_the_mask_matters() {
    let case = Sampled::new(40, sphere);
    let spoiled = Array2::from_shape_fn((40, 40), |at| {
        if case.mask[at] {
            case.image[at]
        } else {
            f64::NAN
        }
    });
    let spoil = |slopes: &Array2<f64>| {
        Array2::from_shape_fn((40, 40), |at| {
            if case.mask[at] {
                slopes[at]
            } else {
                f64::INFINITY
            }
        })
    };
    let domain = Domain::pixels().with_mask(case.mask.view());
    for (name, method) in reconstructions() {
        let (a, b) = (
            method.reconstruct(case.image.view(), &domain),
            method.reconstruct(spoiled.view(), &domain),
        );
        assert!(same(&a.unwrap(), &b.unwrap()), "{name}");
    }
    for (name, method) in integrators() {
        let a = method
            .integrate(case.p.view(), case.q.view(), &domain)
            .unwrap();
        let b = method
            .integrate(spoil(&case.p).view(), spoil(&case.q).view(), &domain)
            .unwrap();
        assert!(same(&a, &b), "{name}");
        assert!(
            a.heights
                .indexed_iter()
                .all(|(at, z)| z.is_finite() == case.mask[at]),
            "{name}"
        );
    }
}

#[test]
fn frames_of_any_position_give_the_same_contact() {
    // The same contact in a corner of a larger frame.
    let case = Sampled::new(32, sphere);
    let place = |r: usize, c: usize| (r.checked_sub(7), c.checked_sub(21));
    let inside = |r, c| match place(r, c) {
        (Some(r), Some(c)) if r < 32 && c < 32 => Some([r, c]),
        _ => None,
    };
    let image = Array2::from_shape_fn((60, 80), |(r, c)| {
        inside(r, c).map_or(0.3, |at| case.image[at])
    });
    let mask = Array2::from_shape_fn((60, 80), |(r, c)| {
        inside(r, c).is_some_and(|at| case.mask[at])
    });
    for (name, method) in reconstructions() {
        let a = method
            .reconstruct(
                case.image.view(),
                &Domain::pixels().with_mask(case.mask.view()),
            )
            .unwrap();
        let b = method
            .reconstruct(image.view(), &Domain::pixels().with_mask(mask.view()))
            .unwrap();
        for ((r, c), z) in a.heights.indexed_iter() {
            let moved = b.heights[[r + 7, c + 21]];
            assert!(
                z.to_bits() == moved.to_bits() || z.is_nan() && moved.is_nan(),
                "{name}"
            );
        }
    }
}

#[test]
fn bytes_are_grey_levels() {
    let case = Sampled::new(32, sphere);
    let bytes = case.image.mapv(|v| (255.0 * v).round() as u8);
    let floats = bytes.mapv(f64::from);
    let light = frontal().with_normal_intensity(255.0).unwrap();
    let method = Eikonal::new(light)
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let domain = Domain::pixels().with_mask(case.mask.view());
    let (a, b) = (
        method.reconstruct(floats.view(), &domain),
        method.reconstruct_u8(bytes.view(), &domain),
    );
    assert!(same(&a.unwrap(), &b.unwrap()));
}

#[test]
fn single_precision_agrees() {
    let case = Sampled::new(64, sphere);
    let image = case.image.mapv(|v| v as f32);
    let wide = Eikonal::new(frontal())
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let narrow = Eikonal::new(Lighting::<f32>::frontal())
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let a = wide
        .reconstruct(
            case.image.view(),
            &Domain::pixels().with_mask(case.mask.view()),
        )
        .unwrap();
    let b = narrow
        .reconstruct(image.view(), &Domain::pixels().with_mask(case.mask.view()))
        .unwrap();
    let error = height_error(
        b.heights.mapv(f64::from).view(),
        a.heights.view(),
        None,
        Alignment::None,
    )
    .unwrap();
    // cos² loses half the digits of f32 near 1: 10⁻³ of slope at worst near the peak, over a few pixels.
    assert!(error.error.max < 2e-2, "{error:?}");
    let [p, q] = [&case.p, &case.q].map(|s| s.mapv(|v| v as f32));
    for (name, method, narrow) in [
        (
            "poisson",
            Box::new(CosinePoisson) as Box<dyn SlopeIntegrator<f64>>,
            Box::new(CosinePoisson) as Box<dyn SlopeIntegrator<f32>>,
        ),
        (
            "least squares",
            Box::new(MaskedLeastSquares::default()),
            Box::new(MaskedLeastSquares::default()),
        ),
    ] {
        let a = method
            .integrate(case.p.view(), case.q.view(), &Domain::pixels())
            .unwrap();
        let b = narrow
            .integrate(p.view(), q.view(), &Domain::pixels())
            .unwrap();
        let error = height_error(
            b.heights.mapv(f64::from).view(),
            a.heights.view(),
            None,
            Alignment::None,
        )
        .unwrap();
        // 64² pixels of height 25: a few hundred roundings of 6·10⁻⁸ · 25.
        assert!(error.error.max < 1e-3, "{name} {error:?}");
    }
}

#[test]
fn bad_pixels_are_flagged_and_do_little_harm() {
    let case = Sampled::new(48, sphere);
    let mut image = case.image.clone();
    image[[20, 20]] = f64::NAN;
    image[[24, 30]] = 1.7;
    image[[30, 18]] = 0.0;
    let domain = Domain::pixels().with_mask(case.mask.view());
    let method = Eikonal::new(frontal())
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let surface = method.reconstruct(image.view(), &domain).unwrap();
    assert!(surface.flags[[20, 20]].contains(PixelFlags::NON_FINITE));
    assert!(surface.flags[[24, 30]].contains(PixelFlags::SATURATED));
    assert!(surface.flags[[30, 18]].contains(PixelFlags::DARK));
    assert_eq!(surface.report.flagged, 3);
    let clean = method.reconstruct(case.image.view(), &domain).unwrap();
    let error = height_error(
        surface.heights.view(),
        clean.heights.view(),
        None,
        Alignment::None,
    )
    .unwrap();
    assert!(error.error.mean_absolute < 0.2, "{error:?}"); // pixels of 19
}

#[test]
fn narrow_domains_are_right() {
    // 1 × N: a ramp of slope 1 from a known end.
    let image = Array2::from_elem((1, 9), 0.5_f64.sqrt());
    let mut known = Array2::from_elem((1, 9), f64::NAN);
    known[[0, 0]] = 2.0;
    let domain = Domain::pixels().with_known_heights(known.view());
    let method = Eikonal::new(frontal()).with_branch(Branch::Convex);
    let surface = method.reconstruct(image.view(), &domain).unwrap();
    assert!((surface.heights[[0, 8]] - 10.0).abs() < 1e-9);
    for (name, method) in integrators() {
        let (p, q) = (Array2::from_elem((1, 8), 0.5), Array2::zeros((1, 8)));
        let surface = method
            .integrate(p.view(), q.view(), &Domain::pixels())
            .unwrap();
        let rise = surface.heights[[0, 7]] - surface.heights[[0, 0]];
        // The periodic method cannot hold a ramp: its mean slope is lost.
        let expected = if name == "frankot-chellappa" {
            0.0
        } else {
            3.5
        };
        assert!((rise - expected).abs() < 1e-9, "{name}: {rise}");
    }
    // A diagonal staircase one pixel wide.
    let mask = Array2::from_shape_fn((20, 20), |(r, c)| c == r || c == r + 1);
    let (p, q) = (
        Array2::from_elem((20, 20), 1.0),
        Array2::from_elem((20, 20), 2.0),
    );
    let domain = Domain::pixels().with_mask(mask.view());
    let surface = MaskedLeastSquares::default()
        .integrate(p.view(), q.view(), &domain)
        .unwrap();
    assert!((surface.heights[[19, 19]] - surface.heights[[0, 0]] - 57.0_f64).abs() < 1e-5);
}

#[test]
fn nonsense_is_refused() {
    let image = Array2::from_elem((4, 5), 0.5);
    let empty = Array2::from_elem((4, 5), false);
    let wrong = Array2::from_elem((5, 4), true);
    for (name, method) in reconstructions() {
        let run = |domain: Domain<'_, f64>| method.reconstruct(image.view(), &domain).unwrap_err();
        assert_eq!(
            run(Domain::pixels().with_mask(empty.view())),
            SfsError::EmptyMask,
            "{name}"
        );
        let shape = SfsError::ShapeMismatch {
            input: Input::Mask,
            expected: [4, 5],
            found: [5, 4],
        };
        assert_eq!(
            run(Domain::pixels().with_mask(wrong.view())),
            shape,
            "{name}"
        );
        let size = Domain {
            pixel_size_m: [f64::NAN, 1.0],
            ..Domain::pixels()
        };
        assert!(matches!(run(size), SfsError::NotPositive { .. }), "{name}");
        let none = method.reconstruct(Array2::zeros((0, 3)).view(), &Domain::pixels());
        assert_eq!(
            none.unwrap_err(),
            SfsError::EmptyImage {
                rows: 0,
                columns: 3
            },
            "{name}"
        );
    }
    assert_eq!(
        Eikonal::new(frontal())
            .reconstruct(image.view(), &Domain::pixels())
            .unwrap_err(),
        SfsError::NoKnownHeight
    );
    assert!(matches!(
        Lighting::new([0.0, 0.0, -1.0]),
        Err(SfsError::LightFromBelow { .. })
    ));
    for bad in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
        assert!(frontal().with_albedo(bad).is_err());
        assert!(frontal().with_normal_intensity(bad).is_err());
        assert!(Eikonal::new(frontal()).with_tolerance(bad).is_err());
        assert!(Eikonal::new(frontal()).with_max_slope(bad).is_err());
        assert!(TsaiShah::new(frontal()).with_noise(bad).is_err());
        assert!(BrooksHorn::new(frontal()).with_smoothness(bad).is_err());
        assert!(Pentland::new(frontal()).with_regularisation(bad).is_err());
        assert!(MaskedLeastSquares::default().with_tolerance(bad).is_err());
    }
    assert!(CurvatureAdaptive::new(f64::NAN).is_err());
    assert!(DepthTable::new(&[(0.0, 0.0), (0.0, 1.0)]).is_err());
    assert!(DepthTable::new(&[(0.0, 0.0)]).is_err());
}

#[test]
fn progress_can_stop_a_solve() {
    let case = Sampled::new(48, sphere);
    let mut workspace = Workspace::default();
    workspace.on_progress(|_| core::ops::ControlFlow::Break(()));
    let mut surface = Surface::default();
    // A rectangle would be solved directly.
    let domain = Domain::pixels().with_mask(case.mask.view());
    MaskedLeastSquares::default()
        .integrate_with(
            &mut workspace,
            case.p.view(),
            case.q.view(),
            &domain,
            &mut surface,
        )
        .unwrap();
    assert_eq!(surface.report.stop, StopReason::Cancelled);
    assert_eq!(surface.report.iterations, 1);
}

#[test]
fn noise_at_the_rim_does_not_draw_the_surface_down() {
    // The solution is a minimum over all rim pixels; with each judged alone, grey levels with a noise of one lose 4 % here.
    let (radius, mut state) = (60.0_f64, 7_u64);
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let square = |r: usize, c: usize| {
        radius * radius - (r as f64 - radius - 4.3).powi(2) - (c as f64 - radius - 4.1).powi(2)
    };
    let z = Array2::from_shape_fn((129, 129), |(r, c)| square(r, c).max(0.0).sqrt());
    let mask = z.mapv(|z| z > 0.0);
    // The sum of twelve uniform numbers has variance 1.
    let image = z
        .mapv(|z| 200.0 * z / radius + (0..12).map(|_| uniform()).sum::<f64>() - 6.0)
        .mapv(|v| v.round() as u8);
    let lighting = Lighting::frontal().with_normal_intensity(200.0).unwrap();
    let method = Eikonal::new(lighting)
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let surface = method
        .reconstruct_u8(image.view(), &Domain::pixels().with_mask(mask.view()))
        .unwrap();
    let error = height_error(
        surface.heights.view(),
        z.view(),
        Some(mask.view()),
        Alignment::None,
    )
    .unwrap();
    // 0.8 % of the radius for this seed; the bound leaves the spread of other seeds.
    assert!(
        error.error.mean_absolute < 0.012 * radius,
        "{}",
        error.error.mean_absolute
    );
}
