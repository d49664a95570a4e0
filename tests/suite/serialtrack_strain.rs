//! The tracked particles of a uniaxially stretched volume, matched, splined and strained: mean and
//! local strain against the exact stretch.
#![allow(clippy::print_stdout)]

use nalgebra::{Matrix3, Point3};
use std::path::PathBuf;
use tactile_imaging::elasticity::strain::GreenLagrange;
use tactile_imaging::io::read_points;
use tactile_imaging::{PairsDoubt, StrainBetween, StrainBetweenOptions, strain_between};

fn frame(k: usize) -> Option<Vec<Point3<f64>>> {
    let folder = std::env::var_os("TACTILE_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")),
        PathBuf::from,
    );
    let path = folder.join(format!("serialtrack/stretch3d_frame{k:02}.csv"));
    if !path.exists() {
        println!("skipped: no {} (set TACTILE_DATA)", path.display());
        return None;
    }
    Some(read_points::<3>(&path).expect("the file has three columns"))
}

fn stretch(k: usize) {
    let (Some(before), Some(after)) = (frame(0), frame(k)) else {
        return;
    };
    let found = strain_between(&before, &after, &StrainBetweenOptions::default()).unwrap();
    let mut exact = Matrix3::zeros();
    exact[(0, 0)] = 0.5 * ((1.0 + 0.05 * k as f64).powi(2) - 1.0);
    let gap = found.summary.mean - exact;
    let squares: f64 = found
        .strains
        .iter()
        .map(|e| (e - exact).norm_squared())
        .sum();
    let local = (squares / found.strains.len() as f64).sqrt();
    println!(
        "0 -> {k}: {} pairs, mean off by xx {:+.1e}, others {:.1e}, standard errors {:.1e}, local \
         rms {local:.1e}",
        found.pairs.len(),
        gap[(0, 0)],
        (gap - Matrix3::from_diagonal(&[gap[(0, 0)], 0.0, 0.0].into())).amax(),
        found.standard_error.amax()
    );
    assert!(gap.amax() < 5e-4, "{gap}");
    assert!(local < 0.01, "{local}");
}

#[test]
fn five_percent() {
    stretch(1);
}

#[test]
fn ten_percent() {
    stretch(2);
}

#[test]
fn twenty_five_percent() {
    stretch(5);
}

/// Scattered points of a unit cube, other ones for another seed.
fn scattered(seed: f64, count: u32) -> Vec<Point3<f64>> {
    let place = |i: u32, k: f64| (f64::from(i) * f64::from(i) * k + seed * f64::from(i)).fract();
    let point = |i| Point3::new(place(i, 0.618), place(i, 0.755), place(i, 0.569));
    (0..count).map(point).collect()
}

/// Where the sample is stretched by 2.6 to 3 and two thirds of its points have left the field of
/// view, the strain is exact or refused.
#[test]
fn a_large_stretch_is_exact_or_refused() {
    let before = scattered(0.1, 700);
    for stretch in [2.6, 2.8, 3.0] {
        let stretched = |p: &Point3<f64>| Point3::new(stretch * (p.x - 0.5) + 0.5, p.y, p.z);
        let mut after: Vec<_> = before.iter().map(stretched).collect();
        after.retain(|p| (0.0..=1.0).contains(&p.x));
        after.reverse();
        let exact = 0.5 * (stretch * stretch - 1.0);
        match strain_between(&before, &after, &StrainBetweenOptions::default()) {
            Ok(found) => {
                let gap = found.summary.mean[(0, 0)] - exact;
                println!("stretch {stretch}: {gap:+.1e} of {exact}");
                // Without noise only the smoothing spline's own error is left.
                assert!(gap.abs() < 2e-3 * exact, "{gap}");
            }
            Err(error) => println!("stretch {stretch}: {error}"),
        }
    }
}

/// Two sets that have nothing to do with each other have no strain.
#[test]
fn unrelated_sets_are_refused() {
    let found = strain_between(
        &scattered(0.1, 80),
        &scattered(0.37, 80),
        &StrainBetweenOptions::default(),
    );
    assert!(found.is_err(), "{:?}", found.map(|f| f.summary.mean));
}

/// Thousands of pairs are fitted patch by patch: mean and local strain are within their errors,
/// pairs of the wrong point have no weight, and points that the matcher missed are found.
#[test]
fn thousands_of_pairs_are_fitted_patch_by_patch() {
    // Fractions of multiples of irrational numbers: no two points coincide.
    let place = |i: u32, k: f64| (f64::from(i) * k.sqrt()).fract();
    let point = |i| Point3::new(place(i, 2.0), place(i, 3.0), place(i, 5.0));
    let before: Vec<_> = (0..2400).map(point).collect();
    let bend =
        |p: &Point3<f64>| Point3::new(p.x + 0.04 * p.x * p.x, p.y + 0.01 * (3.0 * p.z).sin(), p.z);
    let after: Vec<_> = before.iter().map(bend).collect();
    // Every fiftieth pair has its neighbour's partner, every fortieth is missing.
    let partner = |i: usize| {
        if i.is_multiple_of(50) {
            (i, i + 1)
        } else {
            (i, i)
        }
    };
    let pairs: Vec<_> = (0..2399).filter(|i| i % 40 != 7).map(partner).collect();
    let found = StrainBetween::of_pairs(&before, &after, &pairs, &GreenLagrange).unwrap();
    let exact = |p: &Point3<f64>| {
        let mut h = Matrix3::zeros();
        h[(0, 0)] = 0.08 * p.x;
        h[(1, 2)] = 0.03 * (3.0 * p.z).cos();
        0.5 * (h + h.transpose() + h.transpose() * h)
    };
    for (k, &(i, j)) in found.rows.iter().enumerate() {
        assert_eq!(found.weights[k] > 0.0, i == j, "pair {i} {j}");
        if i != j {
            continue; // the first of them is the outermost corner
        }
        // The field has no noise. What the pairs do not resolve is in the errors, mostly at
        // corners.
        let limit = 1e-4 + 6.0 * found.standard_errors[k].amax();
        let off = (found.strains[k] - exact(&before[i])).amax();
        assert!(off < limit && limit < 0.05, "{k}: {off}, {limit}");
    }
    assert!(found.rows.len() >= 2390, "{}", found.rows.len());
    assert_eq!(found.doubt, None);
    let centre = Point3::new(0.5, 0.5, 0.5);
    let at = found.at(&[centre], &GreenLagrange).unwrap()[0];
    assert!((at.strain - exact(&centre)).amax() < 1e-5);
    // A set in a plane of space has no strain across it, and a mirror image none at all.
    let flat: Vec<_> = before.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();
    let all: Vec<_> = (0..2400).map(|i| (i, i)).collect();
    let doubt = StrainBetween::of_pairs(&flat, &flat, &all, &GreenLagrange)
        .unwrap()
        .doubt;
    assert_eq!(doubt, Some(PairsDoubt::Flat));
    let mirrored: Vec<_> = before.iter().map(|p| Point3::new(-p.x, p.y, p.z)).collect();
    let doubt = StrainBetween::of_pairs(&before, &mirrored, &all, &GreenLagrange)
        .unwrap()
        .doubt;
    assert_eq!(doubt, Some(PairsDoubt::Mirrored));
}
