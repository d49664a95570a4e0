//! After the first frames, measuring a frame does not allocate.

use ndarray::{Array2, ArrayView2};
use tactile_force::{
    Branch, ContactOptions, DriftCorrection, ForceMeter, ForceOptions, ForceWorkspace,
    ReferenceFrame, ShearCalibration, ShearPair, ShearTracker,
};

use crate::blob::{calibration, hertz, noise};
use crate::simulated::{PIXEL_M, Sensor};

fn frame(radius: f64, seed: u64) -> Array2<u8> {
    let mut noise = noise(seed);
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
    let calibration = calibration();
    let shear_pairs = [1.0, 2.0].map(|u| ShearPair {
        centroid_step_m: [u, u],
        force_n: [u, u],
    });
    let mut tracker = ShearTracker::new(ShearCalibration::fit(&shear_pairs).unwrap());
    for drift in [
        DriftCorrection::None,
        DriftCorrection::Automatic,
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
    // With a local curve.
    let sensor = Sensor::default();
    let reference = sensor.reference();
    let curve = sensor.curve(&reference, 5);
    let pressed = [sensor.frame(0.4, 2.5e-3, [121.3, 97.6], Branch::Loading, 8)];
    let meter = ForceMeter::new([PIXEL_M; 2], &ForceOptions::default()).unwrap();
    let mut workspace = ForceWorkspace::default();
    let allocations = count(&pressed, |f| {
        meter
            .measure_with(&mut workspace, f, &reference, &curve)
            .unwrap();
    });
    assert_eq!(allocations, 0);
}
