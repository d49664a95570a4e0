//! Requirements for every implementation: reused workspaces, masks, floating-point types,
//! determinism, callbacks.
use crate::common::{Alignment, Sampled, errors, from_rim, integrators, reconstructions, sphere};
use tactile_sfs::*;

/// Equality of bits, with equal NaNs.
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
    let mut workspace = SurfaceWorkspace::default();
    let mut surface = Surface::default();
    for (name, method) in reconstructions(Lighting::new([1.0, 0.0, 1.0]).unwrap()) {
        for case in [&large, &small, &large] {
            let (frame, domain) = (Frame::Real(case.image.view()), case.domain());
            let mut run =
                || method.reconstruct_with(&mut workspace, Image::new(frame, domain), &mut surface);
            run().unwrap();
            let counted = allocation_counter::measure(|| run().unwrap());
            assert_eq!(counted.count_total, 0, "{name}");
            let fresh = method.reconstruct(Image::new(frame, domain)).unwrap();
            assert!(same(&surface, &fresh), "{name}");
        }
    }
    for (name, method) in integrators() {
        let (p, q, domain) = (large.p.view(), large.q.view(), large.domain());
        let mut run = || method.integrate_with(&mut workspace, p, q, &domain, &mut surface);
        run().unwrap();
        let counted = allocation_counter::measure(|| run().unwrap());
        // A sparse factorisation allocates its memory anew.
        if name != "least squares" {
            assert_eq!(counted.count_total, 0, "{name}");
        }
        let fresh = method.integrate(p, q, &domain).unwrap();
        assert!(same(&surface, &fresh), "{name}");
    }
}

#[test]
fn bytes_are_grey_levels() {
    let case = Sampled::new(32, sphere);
    let bytes = case.image.mapv(|v| (255.0 * v).round() as u8);
    let floats = bytes.mapv(f64::from);
    let method = from_rim(Lighting::default().with_normal_intensity(255.0).unwrap());
    let solve = |frame: Frame<'_, f64>| {
        method
            .reconstruct(Image::new(frame, case.domain()))
            .unwrap()
    };
    assert!(same(
        &solve(floats.view().into()),
        &solve(bytes.view().into())
    ));
}

#[test]
fn single_precision_agrees() {
    let case = Sampled::new(64, sphere);
    let image = case.image.mapv(|v| v as f32);
    let wide = from_rim(Lighting::default());
    let domain = Domain::default().with_mask(case.mask.view());
    let wide = wide
        .reconstruct(Image::new(case.image.view(), domain))
        .unwrap();
    let narrow = from_rim(Lighting::<f32>::default());
    let domain = Domain::default().with_mask(case.mask.view());
    let narrow = narrow
        .reconstruct(Image::new(image.view(), domain))
        .unwrap();
    let error = errors(&narrow, &wide.heights, Alignment::None);
    // cos² near 1 loses half of the digits of f32: at worst a slope error of 10⁻³ near the peak,
    // over a few pixels.
    assert!(error.max < 2e-2, "{error:?}");
}

#[test]
fn progress_can_stop_a_solve() {
    let case = Sampled::new(48, sphere);
    let mut workspace = SurfaceWorkspace::default();
    workspace.on_progress(|_| core::ops::ControlFlow::Break(()));
    let mut surface = Surface::default();
    let method = TsaiShah::new(Lighting::default());
    let frame = case.image.view();
    method
        .reconstruct_with(
            &mut workspace,
            Image::new(frame, case.domain()),
            &mut surface,
        )
        .unwrap();
    assert_eq!(surface.report.stop, StopReason::Cancelled);
    assert_eq!(surface.report.iterations, 1);
}
