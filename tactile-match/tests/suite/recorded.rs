//! Recorded results of every matcher on small scenes.
//!
//! A change that is not meant to change results must pass. After a change that is meant to change
//! them, rewrite the record with
//! `RECORD_ANSWERS=1 cargo test -p tactile-match --test suite recorded`; the difference is visible
//! in the review.

use crate::common::{Stream, bend, reordered, rotation, scattered};
use nalgebra::{Point, Point2, SVector};
use tactile_match::labelling::Neighbourhood;
use tactile_match::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, Matching, NearestNeighbour, Outliers,
    PointMatcher, RelaxationLabelling, Rotation, Search, WarmStart,
};
use test_support::Answers;

/// A model and its target.
struct Scene<const D: usize> {
    name: &'static str,
    model: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
}

/// The scenes recorded for every matcher.
fn scenes<const D: usize>() -> Vec<Scene<D>> {
    let mut stream = Stream::new(11);
    let model = scattered::<D>(50, 12);
    let bent = bend(&model, 0.06);
    let order = stream.permutation(50);
    let clean = reordered(&bent, &order);
    let noise: Vec<_> = clean
        .iter()
        .map(|p| p + SVector::from_fn(|_, _| 0.015 * stream.normal()))
        .collect();
    let mut outliers = clean.clone();
    outliers
        .extend((0..8).map(|_| Point::from(SVector::from_fn(|_, _| 1.2 * stream.next() - 0.1))));
    let occluded = clean[..40].to_vec();
    let turn = rotation::<D>(2.0);
    let turned = clean.iter().map(|p| turn * p).collect();
    [
        ("clean", clean),
        ("noise", noise),
        ("outliers", outliers),
        ("occlusion", occluded),
        ("rotation", turned),
    ]
    .map(|(name, target)| Scene {
        name,
        model: model.clone(),
        target,
    })
    .into()
}

/// A jittered sunflower disc, slightly rotated: parts of it are at first displaced by one point.
fn dense_scene() -> Scene<2> {
    let mut stream = Stream::new(13);
    let model: Vec<Point2<f64>> = (0..600)
        .map(|i| {
            let (r, angle) = (((i as f64 + 0.5) / 600.0).sqrt(), 2.399_963 * f64::from(i));
            let mut jitter = || 0.009 * (2.0 * stream.next() - 1.0);
            Point2::new(r * angle.cos() + jitter(), r * angle.sin() + jitter())
        })
        .collect();
    let turn = rotation::<2>(0.12);
    let target = bend(&model, 0.03).iter().map(|p| turn * p).collect();
    Scene {
        name: "dense set",
        model,
        target,
    }
}

/// Numbers that depend on every part of a result: the counts and the report themselves, and
/// weighted sums of the arrays that depend on the order of rows.
fn digest<const D: usize>(answers: &mut Answers, name: &str, found: &Matching<D>) {
    let weight = |i: usize| (1.0 + i as f64).sin();
    let sum = |values: &mut dyn Iterator<Item = f64>| -> f64 {
        values.enumerate().map(|(i, v)| weight(i) * v).sum()
    };
    let partner = |j: &Option<usize>| j.map_or(-1.0, |j| j as f64);
    let report = &found.report;
    let numbers = [
        report.iterations as f64,
        report.starts as f64,
        found.assignment.iter().flatten().count() as f64,
        sum(&mut found.assignment.iter().map(partner)),
        sum(&mut found.warped.iter().flat_map(|p| p.iter().copied())),
        sum(&mut found.confidence.iter().copied()),
        sum(&mut (0..found.soft.rows())
            .map(|i| found.soft.row(i).map(|(j, p)| weight(j) * p).sum())),
        sum(&mut found.displacement_covariance.iter().map(|c| c.trace())),
        sum(&mut found.energy.iter().copied()),
        report.residual,
        report.sigma,
        found
            .warp
            .apply(&Point::from(SVector::repeat(0.4)))
            .coords
            .sum(),
    ];
    answers.add(format!("{name}: {:?}", report.stop), numbers);
}

fn of_dimension<const D: usize>(answers: &mut Answers) {
    let options = AnnealedSoftassign::default();
    let fast = |options| Box::new(options);
    let few = RelaxationLabelling::default()
        .with_neighbourhood(Neighbourhood::Nearest(6))
        .expect("neighbours");
    let dense = few;
    let sparse = few.with_candidates(10).expect("candidates");
    let share = options.with_outlier_ratio(0.2).expect("valid share");
    let matchers: [(&str, Box<dyn PointMatcher<D>>); 10] = [
        ("default", fast(options)),
        ("near", fast(options.with_search(Search::Near))),
        ("any rotation", fast(options.with_rotation(Rotation::Any))),
        ("outlier ratio 0.2", fast(share)),
        (
            "model outliers",
            fast(options.with_outliers(Outliers::Model)),
        ),
        ("dense relaxation", Box::new(dense)),
        ("sparse relaxation", Box::new(sparse)),
        ("drift", Box::new(CoherentPointDrift::default())),
        ("assignment", Box::new(LinearAssignment::default())),
        ("nearest", Box::new(NearestNeighbour::default())),
    ];
    for scene in scenes::<D>() {
        for (name, matcher) in &matchers {
            let found = matcher.match_points(&scene.model, &scene.target);
            let name = format!("{name}, {}, {D}-D", scene.name);
            digest(answers, &name, &found.expect("finite points"));
        }
    }
    let scenes = scenes::<D>();
    let (model, matcher) = (&scenes[0].model, fast(options.with_search(Search::Near)));
    let mut warm = WarmStart::default();
    for step in 1..4 {
        let target = bend(model, 0.02 * f64::from(step));
        let found = matcher.match_next(&mut warm, model, &target);
        let name = format!("series, step {step}, {D}-D");
        digest(answers, &name, &found.expect("finite points"));
    }
}

/// Coordinates are of size one: sums of a few hundred of them in another order differ by less.
const TOLERANCE: f64 = 1e-12;

#[test]
fn answers_are_those_recorded() {
    let mut answers = Answers::default();
    of_dimension::<2>(&mut answers);
    of_dimension::<3>(&mut answers);
    let scene = dense_scene();
    let found = AnnealedSoftassign::default().match_points(&scene.model, &scene.target);
    let name = "default, dense set";
    digest(&mut answers, name, &found.expect("finite points"));
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/reference/recorded_answers.txt"
    );
    answers.check(path, |_, recorded, _| TOLERANCE * recorded.abs().max(1.0));
}
