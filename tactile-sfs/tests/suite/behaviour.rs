//! What every implementation must do: reused workspaces, masks, float types, determinism,
//! callbacks.
use crate::common::{Sampled, sphere};
use crate::methods::{frontal, integrators, reconstructions};
use ndarray::Array2;
use tactile_sfs::*;

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
        let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
        for case in [&large, &small, &large] {
            let domain = Domain::default().with_mask(case.mask.view());
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
                    &method
                        .reconstruct(case.image.view().into(), &domain)
                        .unwrap()
                ),
                "{name}"
            );
        }
        let domain = Domain::default().with_mask(large.mask.view());
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
        let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
        let domain = Domain::default().with_mask(large.mask.view());
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
        // A sparse factorisation takes its memory anew.
        if name != "least squares" {
            assert_eq!(counted.count_total, 0, "{name}");
        }
        let fresh = method
            .integrate(large.p.view(), large.q.view(), &domain)
            .unwrap();
        assert!(same(&surface, &fresh), "{name}");
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
    let domain = Domain::default().with_mask(case.mask.view());
    let (a, b) = (
        method.reconstruct(floats.view().into(), &domain),
        method.reconstruct(bytes.view().into(), &domain),
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
    let narrow = Eikonal::new(Lighting::<f32>::default())
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap();
    let a = wide
        .reconstruct(
            case.image.view().into(),
            &Domain::default().with_mask(case.mask.view()),
        )
        .unwrap();
    let b = narrow
        .reconstruct(
            image.view().into(),
            &Domain::default().with_mask(case.mask.view()),
        )
        .unwrap();
    let error = height_error(
        b.heights.mapv(f64::from).view(),
        a.heights.view(),
        None,
        Alignment::None,
    )
    .unwrap();
    // cos² loses half the digits of f32 near 1: 10⁻³ of slope at worst near the peak, over a few
    // pixels.
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
            .integrate(case.p.view(), case.q.view(), &Domain::default())
            .unwrap();
        let b = narrow
            .integrate(p.view(), q.view(), &Domain::default())
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

/// Lines of every short length, for most of which the transform needs no space of its own.
#[test]
fn frames_of_every_width_are_integrated_in_single_precision() {
    for width in 1..20 {
        let slopes = |k: usize| {
            Array2::from_shape_fn((13, width), move |(r, c)| {
                ((7 * r + 5 * c + 3 * k) % 11) as f64 / 11.0 - 0.5
            })
        };
        let (p, q) = (slopes(0), slopes(1));
        let [short_p, short_q] = [&p, &q].map(|s| s.mapv(|v| v as f32));
        fn both<T: PixelScalar>() -> [Box<dyn SlopeIntegrator<T>>; 2] {
            [Box::new(CosinePoisson), Box::new(FrankotChellappa)]
        }
        for (double, single) in both::<f64>().iter().zip(both::<f32>()) {
            let domain = Domain::default();
            let a = double.integrate(p.view(), q.view(), &domain).unwrap();
            let domain = Domain::default();
            let b = single
                .integrate(short_p.view(), short_q.view(), &domain)
                .unwrap();
            let differences = (a.heights.iter().zip(&b.heights)).map(|(a, b)| a - f64::from(*b));
            // Heights of at most ten, some hundred roundings of 6e-8 each.
            let largest = differences.fold(0.0, |m: f64, d| m.max(d.abs()));
            assert!(largest < 1e-4, "{width}: {largest:e}");
        }
    }
}

#[test]
fn progress_can_stop_a_solve() {
    let case = Sampled::new(48, sphere);
    let mut workspace = SurfaceWorkspace::default();
    workspace.on_progress(|_| core::ops::ControlFlow::Break(()));
    let mut surface = Surface::default();
    let domain = Domain::default().with_mask(case.mask.view());
    let method = BrooksHorn::new(frontal()).with_iterations(30, 10).unwrap();
    method
        .reconstruct_with(
            &mut workspace,
            case.image.view().into(),
            &domain,
            &mut surface,
        )
        .unwrap();
    assert_eq!(surface.report.stop, StopReason::Cancelled);
    // The callback is asked at every projection.
    assert_eq!(surface.report.iterations, 10);
}
