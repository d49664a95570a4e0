//! The zero of a depth table, against surfaces whose depth is known.

use ndarray::Array2;
use tactile_sfs::*;

const BALL: f64 = 4e-3;
const PIXEL: f64 = 0.05e-3;
const SIDE: usize = 181;

/// Depth of the ball's cap of 1.2 mm, 0 outside.
fn cap() -> Array2<f64> {
    let middle = 0.5 * (SIDE - 1) as f64;
    Array2::from_shape_fn((SIDE, SIDE), |(row, column)| {
        let r = (row as f64 - middle).hypot(column as f64 - middle) * PIXEL;
        let height = (BALL * BALL - r * r).max(0.0).sqrt();
        (height - (BALL - 1.2e-3)).max(0.0)
    })
}

/// Largest error of the depth inside the cap, in metres, of a table calibrated at a threshold, as
/// it is and zeroed.
fn worst(signal_of: impl Fn(f64) -> f64, threshold: f64) -> [f64; 2] {
    let truth = cap();
    let image = truth.mapv(signal_of);
    let domain = Domain::new([PIXEL; 2]).unwrap();
    let frame = Frame::Real(image.view());
    let found =
        DepthTable::from_ball(frame, Signal::Intensity, &domain, BALL, threshold, None).unwrap();
    let table = found.table.with_contact_threshold(threshold).unwrap();
    let zeroed = table.clone().zeroed().unwrap();
    [table, zeroed].map(|table| {
        let surface = table.reconstruct(image.view().into(), &domain).unwrap();
        let both = surface.heights.iter().zip(&truth).zip(&image);
        let seen = both.filter(|(_, signal)| **signal > threshold + 1.0);
        seen.map(|((h, z), _)| (h - z).abs()).fold(0.0, f64::max)
    })
}

#[test]
fn a_zeroed_table_does_not_depend_on_the_threshold_it_was_calibrated_at() {
    let proportional = |depth: f64| 4e4 * depth;
    let bent = |depth: f64| 5e4 * depth - 7e6 * depth * depth;
    for threshold in [2.0, 4.0, 8.0] {
        // The level of the threshold is 1/40 mm a grey level deep, and as much is missing
        // everywhere.
        let [raw, zeroed] = worst(proportional, threshold);
        assert!(raw > 0.8 * threshold / 4e4, "{threshold}: {raw}");
        // A table's step is 25 µm, and its levels are the means of their pixels.
        assert!(zeroed < 8e-6, "{threshold}: {zeroed}");
        // Depth is no parabola of this signal: its zero is off by what the parabola misses.
        let [raw, zeroed] = worst(bent, threshold);
        assert!(zeroed < 0.35 * raw, "{threshold}: {raw}, {zeroed}");
    }
}

#[test]
fn a_zeroed_table_keeps_its_differences_and_starts_at_zero() {
    let depth = |s: f64| 0.1 - 0.04 + 0.03 * s - 1e-4 * s * s;
    let entries: Vec<(f64, f64)> = (0..60)
        .map(|s| (f64::from(s), depth(f64::from(s))))
        .collect();
    let table = DepthTable::new(&entries)
        .unwrap()
        .with_contact_threshold(3.0)
        .unwrap();
    let zeroed = table.clone().zeroed().unwrap();
    assert_eq!(zeroed.depth(0.0), (0.0, true));
    for signal in [4.0, 17.5, 59.0] {
        let moved = table.depth(signal).0 - zeroed.depth(signal).0;
        // The parabola is exact: rounding alone.
        assert!((moved - 0.06).abs() < 1e-12, "{signal}: {moved}");
    }
    let again = zeroed.clone().zeroed().unwrap();
    assert!((again.depth(30.0).0 - zeroed.depth(30.0).0).abs() < 1e-12);
    let single: Vec<(f32, f32)> = entries.iter().map(|e| (e.0 as f32, e.1 as f32)).collect();
    let single = DepthTable::new(&single)
        .and_then(|table| table.with_contact_threshold(3.0))
        .and_then(DepthTable::zeroed)
        .unwrap();
    assert!((f64::from(single.depth(30.0).0) - zeroed.depth(30.0).0).abs() < 1e-6);
}

#[test]
fn a_table_that_cannot_tell_its_zero_is_refused() {
    let line: Vec<(f64, f64)> = (0..7).map(|s| (f64::from(s), f64::from(s))).collect();
    let at = |threshold: f64| {
        let table = DepthTable::new(&line).unwrap();
        table.with_contact_threshold(threshold).unwrap().zeroed()
    };
    assert!(at(2.0).is_ok());
    for (threshold, entries) in [(3.0, 3), (9.0, 0)] {
        assert_eq!(
            at(threshold).unwrap_err(),
            SfsError::TableZero {
                entries,
                misfit: 0.0
            }
        );
    }
    // Light that fades exponentially, to a seventh over the table.
    let fading: Vec<(f64, f64)> = (0..60)
        .map(|s| (f64::from(s), -(1.0 - f64::from(s) / 70.0).ln()))
        .collect();
    let error = DepthTable::new(&fading).unwrap().zeroed().unwrap_err();
    assert!(
        matches!(error, SfsError::TableZero { entries: 59, misfit } if misfit > 0.01),
        "{error}"
    );
    assert!(error.to_string().contains("59 entries"), "{error}");
}
