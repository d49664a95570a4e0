//! The tracked particles of a uniaxially stretched volume: matching, spline and strain. Mean and
//! local strain are compared with the exact stretch.
#![allow(clippy::print_stdout)]

use nalgebra::{Matrix3, Point, Point3};
use tactile_files::io::read_points;
use tactile_imaging::elasticity::strain::GreenLagrange;
use tactile_imaging::{
    PairsDoubt, StrainBetween, StrainBetweenOptions, StrainSeries, strain_between,
};
use test_support::published;

fn frame<const D: usize>(k: usize) -> Option<Vec<Point<f64, D>>> {
    let path = published(&format!("serialtrack/stretch{D}d_frame{k:02}.csv"))?;
    Some(read_points(&path).expect("a column for each axis"))
}

#[test]
fn particles_of_a_stretched_volume_have_their_local_strain() {
    for k in [1, 2, 5] {
        let (Some(before), Some(after)) = (frame::<3>(0), frame(k)) else {
            return;
        };
        let found = strain_between(&before, &after, &StrainBetweenOptions::default()).unwrap();
        let mut matrix = Matrix3::zeros();
        matrix[(0, 0)] = exact(1.0 + 0.05 * k as f64);
        let gap = (found.summary.mean - matrix).abs();
        let squares = found.strains.iter().map(|e| (e - matrix).norm_squared());
        let local = (squares.sum::<f64>() / found.strains.len() as f64).sqrt();
        let (pairs, errors) = (found.pairs.len(), found.standard_error.amax());
        println!("0 -> {k}: {pairs} pairs, errors {errors:.1e}, local rms {local:.1e}");
        // Three standard errors of the mean, which must be small.
        assert!(gap.amax() < 3.0 * errors && errors < 1e-3, "{gap}");
        assert!(local < 0.01, "{local}");
    }
}

/// Green–Lagrange e_xx of a stretch.
fn exact(stretch: f64) -> f64 {
    0.5 * (stretch * stretch - 1.0)
}

/// The mean strain along x is that of a stretch, within five standard errors or 0.1 %: with nine
/// degrees of freedom, one of a thousand exceeds that. Returns the error in standard errors.
fn check<const D: usize>(found: &StrainBetween<D>, stretch: f64, scene: &str) -> f64 {
    let error = found.standard_error[(0, 0)];
    let off = found.summary.mean[(0, 0)] - exact(stretch);
    let pairs = found.rows.len();
    println!("{scene}: {pairs} pairs, off by {off:+.1e} ± {error:.1e}");
    let allowed = (5.0 * error).max(1e-3 * exact(stretch));
    assert!(off.abs() < allowed, "{scene}: {off} ± {error}");
    off / error
}

fn follow_frames<const D: usize>(frames: &[usize]) {
    let Some(first) = frame::<D>(0) else {
        return;
    };
    let mut series = StrainSeries::new(&first, StrainBetweenOptions::default());
    let mut last = 1.0;
    for &k in frames {
        let found = series
            .push(&frame(k).unwrap())
            .expect("frames that belong together");
        let stretch = 1.0 + 0.05 * k as f64;
        check(&found.step, stretch / last, &format!("{D}-D, step to {k}"));
        check(&found.total.unwrap(), stretch, &format!("{D}-D, 0 -> {k}"));
        last = stretch;
    }
}

#[test]
fn tracked_particles_are_followed() {
    follow_frames::<3>(&[1, 2, 5]);
    follow_frames::<2>(&[1, 2]);
}

/// SplitMix64.
struct Stream(u64);

impl Stream {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

/// A volume is stretched to three times its length in forty frames. Points leave the field of view,
/// three per cent are missed in a frame, and two per cent are spurious. Every step and every strain
/// since the first frame is correct, and tracks continue after a frame without their point.
#[test]
fn a_volume_is_followed_to_three_times_its_length() {
    let mut stream = Stream(11);
    // Jittered cells: closer particles would not be resolved.
    let mut cell = |i: u32| (f64::from(i) + 0.8 * stream.next()) / 6.0;
    let particles: Vec<Point3<f64>> = (0..216)
        .map(|k| Point3::new(cell(k % 6), cell(k / 6 % 6), cell(k / 36)))
        .collect();
    // The localisation error of the published particles: 0.8 % of the spacing.
    let noise = 0.008 / 6.0;
    let mut frame = |k: usize| {
        let stretch = 1.0 + 0.05 * k as f64;
        let (mut points, mut truth) = (Vec::new(), Vec::new());
        for (particle, p) in particles.iter().enumerate() {
            let x = stretch * (p.x - 0.48) + 0.48;
            if (0.0..1.0).contains(&x) && stream.next() > 0.03 {
                let mut error = || noise * stream.normal();
                points.push(Point3::new(x + error(), p.y + error(), p.z + error()));
                truth.push(Some(particle));
            }
        }
        for _ in 0..points.len() / 50 {
            points.push(Point3::new(stream.next(), stream.next(), stream.next()));
            truth.push(None);
        }
        (points, truth)
    };
    let (first, truth) = frame(0);
    let mut truths = vec![truth];
    let mut series = StrainSeries::new(&first, StrainBetweenOptions::default());
    let (mut squares, mut last) = (0.0, 1.0);
    for k in 1..=40 {
        let (points, truth) = frame(k);
        truths.push(truth);
        let found = series.push(&points).expect("a small step");
        let stretch = 1.0 + 0.05 * k as f64;
        check(&found.step, stretch / last, &format!("step to {k}"));
        squares += check(&found.total.unwrap(), stretch, &format!("0 -> {k}")).powi(2);
        last = stretch;
    }
    // Errors since the first frame have the error of the first frame in common: their mean square
    // has few degrees of freedom.
    assert!(squares / 40.0 < 4.0, "{squares}");
    let (mut links, mut wrong, mut resumed) = (0, 0, 0);
    for pair in series.tracks().iter().flat_map(|track| track.windows(2)) {
        let [a, b] = [pair[0], pair[1]].map(|(frame, row): (usize, usize)| truths[frame][row]);
        links += 1;
        wrong += usize::from(a.is_none() || a != b);
        resumed += usize::from(pair[1].0 > pair[0].0 + 1);
    }
    println!("{links} links, {wrong} wrong, {resumed} over a gap");
    assert!(wrong * 1000 <= links && resumed > 100);
}

/// Scattered points of a unit cube, different for every seed.
fn scattered(seed: f64, count: u32) -> Vec<Point3<f64>> {
    let place = |i: u32, k: f64| (f64::from(i) * f64::from(i) * k + seed * f64::from(i)).fract();
    let point = |i| Point3::new(place(i, 0.618), place(i, 0.755), place(i, 0.569));
    (0..count).map(point).collect()
}

/// If the sample is stretched by 2.6 to 3 and two thirds of its points have left the field of view,
/// the strain is exact or refused.
#[test]
fn a_large_stretch_is_exact_or_refused() {
    let before = scattered(0.1, 700);
    for stretch in [2.6, 2.8, 3.0] {
        let stretched = |p: &Point3<f64>| Point3::new(stretch * (p.x - 0.5) + 0.5, p.y, p.z);
        let mut after: Vec<_> = before.iter().map(stretched).collect();
        after.retain(|p| (0.0..=1.0).contains(&p.x));
        after.reverse();
        let exact = exact(stretch);
        match strain_between(&before, &after, &StrainBetweenOptions::default()) {
            Ok(found) => {
                let gap = found.summary.mean[(0, 0)] - exact;
                println!("stretch {stretch}: {gap:+.1e} of {exact}");
                // Without noise only the error of the smoothing spline remains.
                assert!(gap.abs() < 2e-3 * exact, "{gap}");
            }
            Err(error) => println!("stretch {stretch}: {error}"),
        }
    }
}

/// Two unrelated sets have no strain.
#[test]
fn unrelated_sets_are_refused() {
    let [before, after] = [0.1, 0.37].map(|seed| scattered(seed, 80));
    let found = strain_between(&before, &after, &StrainBetweenOptions::default());
    assert!(found.is_err(), "{:?}", found.map(|f| f.summary.mean));
}

/// Thousands of pairs are fitted patch by patch: mean and local strain are within their errors,
/// wrong pairs have no weight, and points that the matcher missed are found.
#[test]
fn thousands_of_pairs_are_fitted_patch_by_patch() {
    // Fractional parts of multiples of irrational numbers: no two points coincide.
    let place = |i: u32, k: f64| (f64::from(i) * k.sqrt()).fract();
    let point = |i| Point3::new(place(i, 2.0), place(i, 3.0), place(i, 5.0));
    let before: Vec<_> = (0..2400).map(point).collect();
    let bend =
        |p: &Point3<f64>| Point3::new(p.x + 0.04 * p.x * p.x, p.y + 0.01 * (3.0 * p.z).sin(), p.z);
    let after: Vec<_> = before.iter().map(bend).collect();
    // Every fiftieth pair has the partner of its neighbour, and every fortieth is missing.
    let partner = |i: usize| (i, i + usize::from(i.is_multiple_of(50)));
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
        // The field has no noise. Unresolved detail is included in the errors, mostly at corners.
        let limit = 1e-4 + 6.0 * found.standard_errors[k].amax();
        let off = (found.strains[k] - exact(&before[i])).amax();
        assert!(off < limit && limit < 0.05, "{k}: {off}, {limit}");
    }
    assert!(found.rows.len() >= 2390, "{}", found.rows.len());
    assert_eq!(found.doubt, None);
    let centre = Point3::new(0.5, 0.5, 0.5);
    let at = found.at(&[centre], &GreenLagrange).unwrap()[0];
    assert!((at.strain - exact(&centre)).amax() < 1e-5);
    // A plane set in space has no strain across the plane, and a mirror image has none at all.
    let all: Vec<_> = (0..2400).map(|i| (i, i)).collect();
    let doubt = |before: &[Point3<f64>], after: &[Point3<f64>]| {
        let found = StrainBetween::of_pairs(before, after, &all, &GreenLagrange);
        found.unwrap().doubt
    };
    let flat: Vec<_> = before.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();
    assert_eq!(doubt(&flat, &flat), Some(PairsDoubt::Flat));
    let mirrored: Vec<_> = before.iter().map(|p| Point3::new(-p.x, p.y, p.z)).collect();
    assert_eq!(doubt(&before, &mirrored), Some(PairsDoubt::Mirrored));
}

/// A plane is stretched or moved, and seen through the same window. Points whose partners have left
/// the window are not matched to others at its edge: the mean strain and the pairs with weight are
/// correct.
#[test]
fn points_that_left_a_plane_get_no_partner() {
    let scenes = [(1.05, 0.0), (1.1, 0.0), (1.2, 0.0), (1.0, 0.05)];
    for (seed, (stretch, shift)) in (0..8).zip(scenes.into_iter().cycle()) {
        let mut stream = Stream(seed);
        let before: Vec<Point<f64, 2>> = (0..1500)
            .map(|_| Point::from([stream.next(), stream.next()]))
            .collect();
        // The noise of the published particles: 2.5 % of the spacing.
        let noise = 0.025 / 1500_f64.sqrt();
        let image = |p: &Point<f64, 2>| Point::from([stretch * (p.x - 0.5) + 0.5 + shift, p.y]);
        let seen = before.iter().map(image);
        let mut after: Vec<_> = seen.filter(|p| (0.0..1.0).contains(&p.x)).collect();
        for p in &mut after {
            *p += nalgebra::Vector2::from_fn(|_, _| noise * stream.normal());
        }
        after.reverse();
        let options = StrainBetweenOptions::default();
        let found = strain_between(&before, &after, &options).expect("a small stretch");
        let scene = format!("seed {seed}, stretched by {stretch}, moved by {shift}");
        check(&found, stretch, &scene);
        let is_wrong = |k: &usize| {
            let [a, b] = &found.pairs[*k];
            found.is_kept(*k) && (image(a) - b).norm() > 6.0 * noise
        };
        let wrong = (0..found.pairs.len()).filter(is_wrong).count();
        // Random points that nearly coincide are exchanged.
        assert!(wrong * 500 <= found.pairs.len(), "{scene}: {wrong} wrong");
    }
}
