//! A reused workspace gives the same results as a new one, for any previous use.

use ndarray::{Array2, ArrayView2};
use tactile_force::{
    ForceMeasurement, ForceMeter, ForceOptions, ForceWorkspace, ReferenceFrame, measure_force,
};

use crate::blob::{calibration, hertz};

fn frame(radius: f64, x: f64) -> Array2<u8> {
    let peak = if radius > 1.0 { 140.0 } else { 0.0 };
    let mut image = hertz((120, 150), [x, 61.3], radius, peak);
    image
        .indexed_iter_mut()
        .for_each(|((r, c), v)| *v += 20.0 + ((r * 7919 + c * 104_729) % 11) as f64 / 4.0);
    image.mapv(|v| v.round() as u8)
}

#[test]
fn the_same_bits_alone_and_in_series() {
    let frames: Vec<_> = (0..12)
        .map(|k| frame([30.0, 0.5, 12.0][k % 3], 60.0 + k as f64))
        .collect();
    let views: Vec<ArrayView2<'_, u8>> = frames.iter().map(|f| f.view()).collect();
    let dark = frame(0.5, 3.0);
    let reference = ReferenceFrame::new(dark.view()).unwrap();
    let calibration = calibration();
    let options = ForceOptions::default();
    let meter = ForceMeter::new([2e-5; 2], &options).unwrap();
    let single: Vec<ForceMeasurement> = views
        .iter()
        .map(|v| measure_force(v.view(), dark.view(), [2e-5; 2], &calibration, &options).unwrap())
        .collect();
    assert!(single[0].contact.is_some() && single[1].contact.is_none());
    let mut workspace = ForceWorkspace::default();
    let series: Vec<_> = views
        .iter()
        .map(|v| meter.measure_with(&mut workspace, v.view(), &reference, &calibration))
        .map(Result::unwrap)
        .collect();
    assert_eq!(series, single);
    #[cfg(feature = "serde")]
    {
        let text = serde_json::to_string(&single).unwrap();
        assert_eq!(
            serde_json::from_str::<Vec<ForceMeasurement>>(&text).unwrap(),
            single
        );
    }
}
