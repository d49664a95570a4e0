//! After a warm-up a frame costs no allocation.

use ndarray::{Array2, ArrayView2};
use tactile_force::{
    CalibrationPair, ContactOptions, DriftCorrection, ForceMeter, ForceOptions, ForceWorkspace,
    LinearCalibration, ReferenceFrame, ShearCalibration, ShearPair, ShearTracker,
};

use crate::blob::hertz;

fn frame(radius: f64, seed: u64) -> Array2<u8> {
    let mut state = seed;
    let mut noise = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        f64::from((state >> 60) as u8) / 4.0 - 2.0
    };
    let peak = if radius > 1.0 { 150.0 } else { 0.0 };
    hertz((200, 240), [118.3, 96.1], radius, peak).mapv(|v| (v + 20.0 + noise()).round() as u8)
}

fn count(frames: &[Array2<u8>], mut measure: impl FnMut(ArrayView2<'_, u8>)) -> u64 {
    frames.iter().for_each(|f| measure(f.view()));
    allocation_counter::measure(|| frames.iter().for_each(|f| measure(f.view()))).count_total
}

#[test]
fn measuring_with_a_workspace_allocates_nothing() {
    let frames = [
        frame(40.0, 1),
        frame(0.5, 2),
        frame(25.0, 3),
        frame(55.0, 4),
    ];
    let reference = ReferenceFrame::new(frame(0.5, 9).view()).unwrap();
    let pairs: Vec<_> = (0..9)
        .map(|k| 1e5 * f64::from(k))
        .map(|v| CalibrationPair::loading(v, 1e-6 * v))
        .collect();
    let calibration = LinearCalibration::fit(&pairs, &Default::default()).unwrap();
    let shear_pairs = [1.0, 2.0].map(|u| ShearPair {
        centroid_step_m: [u, u],
        force_n: [u, u],
    });
    let mut tracker = ShearTracker::new(ShearCalibration::fit(&shear_pairs).unwrap());
    for drift in [
        DriftCorrection::None,
        DriftCorrection::Plane,
        DriftCorrection::TiltedIllumination,
    ] {
        let contact = ContactOptions::default().with_drift(drift);
        let options = ForceOptions::default().with_contact(contact);
        let meter = ForceMeter::new([1e-5; 2], &options).unwrap();
        let mut workspace = ForceWorkspace::default();
        let allocations = count(&frames, |f| {
            let m = meter
                .measure_with(&mut workspace, f, &reference, &calibration)
                .unwrap();
            tracker.update(m.centroid_m);
        });
        assert_eq!(allocations, 0, "{drift:?}");
    }
}
