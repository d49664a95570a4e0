//! Inputs on which users first try a matcher: the same points twice, drifts, lattices that extend
//! beyond the view, noisy grids, partial overlaps, distant points, points on a line.

use crate::common::Stream;
use nalgebra::{Point, Point2, Point3, SVector};
use tactile_match::{
    AnnealedSoftassign, Doubt, LinearAssignment, NearestNeighbour, Outliers, PointMatcher, Search,
};

/// Points of both views, with the targets in another order. `partner[i]` is the target of model row
/// `i`, or `None` if it is not in view.
struct Views<const D: usize> {
    model: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
    partner: Vec<Option<usize>>,
}

impl<const D: usize> Views<D> {
    /// Visible points before and after, with noise of the targets.
    fn new(
        world: impl IntoIterator<Item = (Point<f64, D>, Point<f64, D>)>,
        seen: impl Fn(&Point<f64, D>, &mut Stream) -> bool,
        noise: f64,
        stream: &mut Stream,
    ) -> Self {
        let (mut model, mut images) = (Vec::new(), Vec::new());
        for (before, after) in world {
            let after = after + SVector::from_fn(|_, _| noise * stream.normal());
            let own = seen(&before, stream);
            if seen(&after, stream) {
                images.push((own.then_some(model.len()), after));
            }
            if own {
                model.push(before);
            }
        }
        let mut partner = vec![None; model.len()];
        let order = stream.permutation(images.len());
        let rows = order.iter().enumerate();
        for (place, row) in rows.filter_map(|(place, &from)| Some((place, images[from].0?))) {
            partner[row] = Some(place);
        }
        let target = order.iter().map(|&from| images[from].1).collect();
        Self {
            model,
            target,
            partner,
        }
    }

    /// Fraction of the true pairs that are found, and the doubt.
    fn found(&self, matcher: AnnealedSoftassign) -> (f64, Option<Doubt>)
    where
        AnnealedSoftassign: PointMatcher<D>,
    {
        let found = matcher.match_points(&self.model, &self.target).unwrap();
        let pairs = found.assignment.iter().zip(&self.partner);
        let right = pairs.filter(|(found, own)| own.is_some() && found == own);
        let possible = self.partner.iter().flatten().count();
        (right.count() as f64 / possible as f64, found.report.doubt())
    }
}

fn random<const D: usize>(n: usize, stream: &mut Stream) -> Vec<Point<f64, D>> {
    let mut place = || Point::from(SVector::from_fn(|_, _| stream.next()));
    (0..n).map(|_| place()).collect()
}

/// A lattice of step 10 that is rotated and displaced behind a window of 14 steps.
fn lattice(hexagonal: bool, noise: f64, degrees: f64, shift: f64) -> Views<2> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let points = (-20..40_i32).flat_map(|row| (-20..40_i32).map(move |column| (row, column)));
    let world = points.map(|(row, column)| {
        let (mut x, mut y) = (10.0 * f64::from(column) + 5.0, 10.0 * f64::from(row) + 5.0);
        if hexagonal {
            x += 5.0 * f64::from(row.rem_euclid(2));
            y *= 0.75_f64.sqrt();
        }
        let (u, v) = (x - 70.0, y - 70.0);
        let after = Point2::new(70.0 + cos * u - sin * v + shift, 70.0 + sin * u + cos * v);
        (Point2::new(x, y), after)
    });
    let inside = |p: &Point2<f64>, _: &mut Stream| p.iter().all(|c| (0.0..140.0).contains(c));
    Views::new(world, inside, noise, &mut Stream::new(5))
}

/// A lattice is unchanged by a step. A displacement of less than a sixth of a step is recognised;
/// otherwise the result is correct, or its doubt names the step.
#[test]
fn a_lattice_beyond_the_view_is_right_or_named() {
    for hexagonal in [false, true] {
        for (degrees, shift) in [
            (0.0, 1.0),
            (0.0, 3.0),
            (0.0, 6.0),
            (0.0, 8.0),
            (0.0, 14.0),
            (5.0, 0.0),
            (14.0, 0.0),
            (24.0, 0.0),
        ] {
            for noise in [0.0, 0.1] {
                let views = lattice(hexagonal, noise, degrees, shift);
                let (right, doubt) = views.found(AnnealedSoftassign::default());
                let scene = format!("{hexagonal} {noise} {degrees} {shift}: {right}, {doubt:?}");
                match doubt {
                    Some(Doubt::Repeats { step }) => {
                        assert!((9.0..15.0).contains(&step.length()), "{scene}");
                        assert!(shift != 1.0, "{scene}");
                    }
                    other => assert!(other.is_none() && right == 1.0, "{scene}"),
                }
            }
        }
    }
}

/// A displacement of nearly a step looks like a small one the other way. Every matcher names the step
/// by which its pairs may be off, and points that do not repeat have none.
#[test]
fn the_smallest_motion_of_a_lattice_is_stated() {
    let matchers: [Box<dyn PointMatcher<2>>; 3] = [
        Box::new(AnnealedSoftassign::default()),
        Box::new(NearestNeighbour::default()),
        Box::new(LinearAssignment::default()),
    ];
    let mut stream = Stream::new(3);
    let scattered = random::<2>(200, &mut stream);
    for matcher in matchers {
        for hexagonal in [false, true] {
            for shift in [8.5, 9.2] {
                let views = lattice(hexagonal, 0.1, 0.0, shift);
                let report = matcher
                    .match_points(&views.model, &views.target)
                    .unwrap()
                    .report;
                // Optimal assignment mixes the rows of a hexagonal lattice, which is a doubt.
                let Some(step) = report.period else {
                    assert_eq!(report.doubt(), Some(Doubt::LargeResiduals));
                    assert!(hexagonal);
                    continue;
                };
                // The noise of the targets moves the affine part by less than a per cent.
                assert_eq!(report.doubt(), None);
                assert!((step.length() / 10.0 - 1.0).abs() < 0.01, "{step}");
            }
        }
        let report = matcher.match_points(&scattered, &scattered).unwrap().report;
        assert_eq!((report.doubt(), report.period), (None, None));
    }
}

/// If the largest displacement is stated, the result within it is unique.
#[test]
fn a_largest_motion_tells_the_answers_of_a_lattice_apart() {
    for shift in [3.0, 4.5] {
        let matcher = AnnealedSoftassign::default();
        let matcher = matcher.with_largest_motion(5.2).unwrap();
        let found = lattice(false, 0.05, 0.0, shift).found(matcher);
        assert_eq!(found, (1.0, None), "{shift}");
    }
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(
            AnnealedSoftassign::default()
                .with_largest_motion(wrong)
                .is_err()
        );
    }
}

/// A grid with equal noise in both frames cannot be distinguished from its mirror image.
#[test]
fn a_noisy_grid_is_neither_mirrored_nor_turned() {
    for seed in 0..20 {
        let mut stream = Stream::new(seed);
        let mut noisy =
            |p: Point2<f64>| p + SVector::<f64, 2>::from_fn(|_, _| 0.1 * stream.normal());
        let place = |k: u32| Point2::new(10.0 * f64::from(k % 9), 10.0 * f64::from(k / 9));
        let rows = (0..63).map(|k| {
            (
                noisy(place(k)),
                noisy(place(k) + SVector::from([1.3, -0.7])),
            )
        });
        let rows: Vec<_> = rows.collect();
        let views = Views::new(rows, |_, _| true, 0.0, &mut Stream::new(seed));
        let found = views.found(AnnealedSoftassign::default());
        assert_eq!(found, (1.0, None), "{seed}");
    }
}

/// The same points twice, seen through different windows, stretched and bent by several spacings.
#[test]
fn thousands_of_plane_points_are_followed() {
    let mut stream = Stream::new(9);
    let world = random::<2>(40_000, &mut stream);
    let mut check = |name,
                     points,
                     noise,
                     least,
                     seen: &dyn Fn(&Point2<f64>, &mut Stream) -> bool,
                     image: &dyn Fn(&Point2<f64>) -> Point2<f64>| {
        let rows = world[..points].iter().map(|p| (*p, image(p)));
        let views = Views::new(rows, seen, noise, &mut stream);
        let (right, doubt) = views.found(AnnealedSoftassign::default());
        assert!(
            right >= least && doubt.is_none(),
            "{name}: {right}, {doubt:?}"
        );
    };
    check("twice", 6000, 0.0, 0.999, &|_, _| true, &|p| *p);
    let inside = |p: &Point2<f64>, _: &mut Stream| p.iter().all(|c| (0.05..0.95).contains(c));
    check("drift", 6000, 0.0, 0.999, &inside, &|p| {
        Point2::new(p.x + 0.045, p.y)
    });
    // Random points closer than two standard deviations of the noise are exchanged: a fraction πσ²
    // of them, one in thirty. The displacement is up to 24 spacings, and more than one within a
    // block.
    let missing = |_: &Point2<f64>, stream: &mut Stream| stream.next() > 0.1;
    check("bent", 40_000, 0.1 / 200.0, 0.96, &missing, &|p| {
        Point2::new(
            1.05 * p.x + 0.02 * (3.1 * p.y).sin() + 0.05,
            p.y + 0.02 * (6.2 * p.x).sin() - 0.025,
        )
    });
}

/// If a third of the points of each set lies outside the other, the rest is found.
#[test]
fn a_partial_overlap_in_space_loses_no_pairs() {
    for seed in 0..12 {
        let mut stream = Stream::new(40 + seed);
        let world = random::<3>(60 + 20 * (seed as usize % 3), &mut stream);
        let noise = 0.003 * (seed % 2) as f64;
        let mut views = Views::new(
            world.iter().map(|p| (*p, *p)),
            |_, _| true,
            noise,
            &mut stream,
        );
        let keep: Vec<_> = views.target.iter().map(|t| t.x > 0.15).collect();
        let mut rows = Vec::new();
        let mut target = Vec::new();
        for (t, kept) in views.target.iter().zip(&keep) {
            rows.push(kept.then_some(target.len()));
            target.extend(kept.then_some(*t));
        }
        let seen: Vec<_> = views.model.iter().map(|p| p.x < 0.85).collect();
        let partner = views.partner.iter().map(|j| j.and_then(|j| rows[j]));
        views.partner = partner
            .zip(&seen)
            .filter(|(_, seen)| **seen)
            .map(|(p, _)| p)
            .collect();
        let model = views.model.iter().zip(&seen).filter(|(_, seen)| **seen);
        views.model = model.map(|(p, _)| *p).collect();
        views.target = target;
        let (right, doubt) = views.found(AnnealedSoftassign::default());
        assert!(
            right > 0.97 && doubt.is_none(),
            "{seed}: {right}, {doubt:?}"
        );
    }
}

/// A single point at a thousand times the size affects neither centre nor scale.
#[test]
fn a_point_far_away_does_not_hinder_the_others() {
    let mut stream = Stream::new(3);
    for search in [Search::Near, Search::Thorough] {
        let mut model = random::<2>(60, &mut stream);
        model.push(Point2::new(1000.0, -300.0));
        let rows = model
            .iter()
            .map(|p| (*p, Point2::new(1.02 * p.x + 0.01, p.y)));
        let views = Views::new(rows, |_, _| true, 0.0, &mut Stream::new(4));
        let found = AnnealedSoftassign::default().with_search(search);
        let (right, doubt) = views.found(found);
        assert!(
            right > 0.96 && doubt.is_none(),
            "{search:?}: {right}, {doubt:?}"
        );
    }
}

/// Points on a line have an estimated noise, and every pair is found.
#[test]
fn points_on_a_line_are_matched() {
    for n in [5_u32, 20, 60] {
        let place = |k: u32| f64::from(k) + 0.3 * f64::from(k * k % 7);
        let model: Vec<_> = (0..n)
            .map(|k| Point3::new(place(k), 2.0 * place(k), 0.0))
            .collect();
        let target: Vec<_> = model
            .iter()
            .map(|p| p + SVector::from([0.1, 0.0, 0.2]))
            .collect();
        let found = AnnealedSoftassign::default()
            .match_points(&model, &target)
            .unwrap();
        assert!(
            found.report.sigma.is_finite(),
            "{n}: {}",
            found.report.sigma
        );
        let right = (0..n as usize).all(|i| found.assignment[i] == Some(i));
        assert!(right || found.report.doubt().is_some(), "{n}");
    }
}

/// If every point has a partner, all are paired, whatever the noise.
#[test]
fn sets_of_the_same_points_are_paired_completely() {
    let mut stream = Stream::new(11);
    let world = random::<2>(80, &mut stream);
    let views = Views::new(
        world.iter().map(|p| (*p, *p)),
        |_, _| true,
        0.05,
        &mut stream,
    );
    let matcher = AnnealedSoftassign::default().with_outliers(Outliers::None);
    let found = matcher.match_points(&views.model, &views.target).unwrap();
    assert!(found.unmatched_model.is_empty() && found.unmatched_target.is_empty());
}

/// The same file twice: a sunflower, in which each point has neighbours with nearly the same
/// surroundings.
#[test]
fn the_same_points_twice_are_all_matched() {
    let leaf = |k: usize| {
        let (radius, angle) = ((k as f64).sqrt(), 2.4 * k as f64);
        Point::from([radius * angle.cos(), 1.1 * radius * angle.sin()])
    };
    let leaves: Vec<Point<f64, 2>> = (0..2000).map(leaf).collect();
    let found = AnnealedSoftassign::default()
        .match_points(&leaves, &leaves)
        .unwrap();
    assert!((0..2000).all(|i| found.assignment[i] == Some(i)));
}
