use super::*;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};

#[test]
fn tiles_looked_at_are_enough_and_in_every_column() {
    for (rows, columns) in [
        (1, 1),
        (30, 40),
        (131, 44),
        (260, 87),
        (500, 210),
        (2, 30_030),
    ] {
        let tiles = rows * columns;
        let step = FrameCondition::tile_step(tiles, columns);
        let looked_at = tiles.div_ceil(step);
        assert!(looked_at <= 1500 && 2 * looked_at >= tiles.min(1500));
        let mut seen = vec![false; columns];
        (0..tiles)
            .step_by(step)
            .for_each(|tile| seen[tile % columns] = true);
        let all = looked_at >= columns;
        assert!(
            !all || seen.iter().all(|seen| *seen),
            "{rows} × {columns}: {step}"
        );
    }
    // No columns, no tiles.
    assert_eq!(FrameCondition::tile_step(0, 0), 1);
}

/// A fifth of the tiles gives the values of all, to the errors that are stated.
#[test]
fn a_part_of_the_tiles_knows_the_frame() {
    let (rows, columns, sd) = (131, 44, 2.0);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    // 1.2 times the reference's noise, and light that falls off from column to column.
    let tiles: Vec<_> = (0..rows * columns)
        .map(|i| {
            let reference = 256.0 * (40.0 - 0.5 * (i % columns) as f64);
            TileSum {
                x: 32.0 * (i % columns) as f64,
                y: 8.0 * (i / columns) as f64,
                pixels: 256.0,
                reference,
                difference: 0.01 * reference + 1.2 * sd * 16.0 * normal(),
            }
        })
        .collect();
    let step = FrameCondition::tile_step(tiles.len(), columns);
    assert!(step > 3);
    let size = (8 * rows, 32 * columns);
    let of = |step: usize| {
        let tiles = tiles.iter().copied().step_by(step);
        FrameCondition::of(size, tiles, sd, &mut FitWorkspace::default()).expect("background")
    };
    let (all, part) = (of(1), of(step));
    let error = (part.brightness.value - all.brightness.value).abs();
    // Four standard errors. 2 % is what charts look for.
    assert!(
        error < 4.0 * part.brightness.standard_error && error < 2e-4,
        "{error}"
    );
    // The median of |z| of n tiles has a relative standard error of 1.17/√n, 3.4 % of these. Four
    // of them.
    let looked_at = tiles.len().div_ceil(step) as f64;
    let error = (part.noise_ratio / 1.2 - 1.0).abs();
    assert!(error < 4.0 * 1.17 / looked_at.sqrt(), "{part:?}");
    // Every column is looked at as often as others: the fall of the light leaves no trace.
    assert!((part.background_grey - all.background_grey).abs() < 0.1);
}

/// Frames from one false alarm to the next.
fn simulated_interval(shift: f64, interval: f64, frames: usize) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let fresh = Cusum::new(shift, interval, 0.0);
    let (mut chart, mut alarms) = (fresh, 0);
    for _ in 0..frames {
        if chart.update(StandardNormal.sample(&mut rng)) {
            alarms += 1;
            chart = fresh;
        }
    }
    frames as f64 / f64::from(alarms)
}

#[test]
fn false_alarms_come_as_seldom_as_asked() {
    for shift in [0.5, 1.0, 2.0, 20.0] {
        let interval = 2000.0;
        let found = simulated_interval(shift, interval, 2_000_000);
        // Siegmund's approximation is good to some 10 %. 1000 alarms are known to 3 %.
        assert!(
            (0.85..1.35).contains(&(found / interval)),
            "shift {shift}: {found}"
        );
    }
}

#[test]
fn shifts_are_found_after_the_stated_delay() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for shift in [0.7, 1.0, 2.0] {
        let fresh = Cusum::new(shift, 1e5, 0.0);
        let mut total = 0;
        for _ in 0..2000 {
            let mut chart = fresh;
            loop {
                total += 1;
                let z: f64 = StandardNormal.sample(&mut rng);
                if chart.update(z + shift) {
                    break;
                }
            }
        }
        let found = f64::from(total) / 2000.0;
        assert!(
            (found / fresh.delay(shift) - 1.0).abs() < 0.1,
            "shift {shift}: {found} {}",
            fresh.delay(shift)
        );
    }
}
