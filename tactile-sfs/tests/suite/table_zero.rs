//! The zero of a depth table, for surfaces of known depth.

use tactile_sfs::*;

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
        // The parabola is exact: only rounding.
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
    // Light that decays exponentially, to a seventh over the table.
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
