//! Tests of the building blocks.

use super::*;

/// A scattered number in (−1, 1).
fn scatter(i: usize, k: usize) -> f64 {
    2.0 * ((i * i) as f64 * 0.618_033_988_75 + (i * (k + 1)) as f64 * 0.754_877_666_25).fract()
        - 1.0
}

/// A jittered grid is stretched by 1.7 and cropped to its former window, with one outlier in ten.
#[test]
fn a_stretched_and_cropped_grid_is_put_onto_its_targets() {
    let model: Vec<[f64; 2]> = (0..225)
        .map(|i| {
            let cell = [(i % 15) as f64, (i / 15) as f64];
            [0, 1].map(|k| (cell[k] - 7.0 + 0.3 * scatter(i, k)) * 0.15)
        })
        .collect();
    let moved = |p: &[f64; 2]| [1.7 * p[0], p[1] + 0.1 * p[0]];
    let mut target: Vec<[f64; 2]> = model
        .iter()
        .map(moved)
        .filter(|p| p[0].abs() < 1.1)
        .collect();
    let kept = target.len();
    target.extend((0..kept / 10).map(|i| [1.1 * scatter(i + 400, 0), 1.1 * scatter(i + 400, 1)]));
    let mut tuples = Tuples::default();
    let mut base = Vec::new();
    let go = &mut || ControlFlow::Continue(());
    let found = tuples.find((&model, &target), 0.12, true, &[0.0; 2], &mut base, go);
    assert_eq!(found, ControlFlow::Continue(true));
    for (p, b) in model.iter().zip(&base) {
        let truth = moved(p);
        // Well below the spacing: the fit uses exact pairs and a few outliers hit by chance.
        assert!(
            (b[0] - truth[0]).hypot(b[1] - truth[1]) < 0.05,
            "{p:?}: {b:?}"
        );
    }
}
