//! Calibration of the default matcher's confidences, standard deviations and doubts. The sets are
//! bent, cropped, rotated and stretched, with noise and outliers; they are jittered grids and
//! random points, in the plane and in space.
//!
//! ```text
//! cargo run --release -p tactile-match --example confidence -- [FIRST_SEED SEEDS]
//! ```
//!
//! The constants of the confidences were chosen on seeds 0 to 19, and those of results with a doubt
//! on 0 to 7. Other seeds are independent (default: 100 to 103). For every tenth of confidence, the
//! number of pairs, their mean confidence and the fraction of correct pairs are printed. For every
//! kind of scene, the fraction of coordinates within one standard deviation of the true values is
//! printed, and the number of scenes with less than 90 % of correct pairs, with and without a
//! doubt.
#![allow(clippy::print_stdout)]
use nalgebra::{Point, SVector};
use tactile_match::{AnnealedSoftassign, MatchError, Matching, PointMatcher};

#[path = "support/points.rs"]
mod points;
#[path = "support/scene.rs"]
mod scene;
#[path = "support/stream.rs"]
mod stream;
#[path = "support/tenths.rs"]
mod tenths;
use points::{bend, cube, stretch, turn};
use scene::Scene;
use stream::Stream;
use tenths::Tenths;

/// Transformation of the points of the unit cube.
#[derive(Clone, Copy, PartialEq)]
enum Change {
    /// Bent.
    Bent,
    /// Bent, and visible up to three quarters of the width.
    Cropped,
    /// Bent, and rotated about the centre, in degrees.
    Turned(f64),
    /// Stretched along x, and seen through the original window.
    Stretched(f64),
}

#[derive(Clone, Copy)]
struct Kind {
    change: Change,
    /// In mean spacings.
    noise: f64,
    /// Fraction of the visible points.
    outliers: f64,
    /// Random points in place of a jittered grid.
    random: bool,
}

impl<const D: usize> Scene<D> {
    fn new(kind: Kind, seed: u64) -> Self {
        let mut stream = Stream(seed.wrapping_mul(7919) + 13);
        let n = match kind.change {
            Change::Bent | Change::Turned(_) => 105,
            Change::Cropped => 150,
            Change::Stretched(_) => 200,
        };
        let model = cube::<D>(n, kind.random, &mut stream);
        let truth: Vec<_> = model.iter().map(|p| kind.change.apply(p)).collect();
        let mut order = stream.permutation(n);
        order.retain(|&i| match kind.change {
            Change::Bent | Change::Turned(_) => true,
            Change::Cropped => (0.0..0.75).contains(&truth[i][0]),
            Change::Stretched(_) => (0.0..1.0).contains(&truth[i][0]),
        });
        let noise = kind.noise * (n as f64).powf(-1.0 / D as f64);
        let mut target: Vec<_> = order
            .iter()
            .map(|&i| truth[i] + SVector::from_fn(|_, _| noise * stream.normal()))
            .collect();
        let clutter = (kind.outliers * order.len() as f64) as usize;
        target.extend((0..clutter).map(|_| Point::from(SVector::from_fn(|_, _| stream.next()))));
        Self {
            model,
            truth,
            target,
            order,
        }
    }
}

impl Change {
    fn apply<const D: usize>(self, p: &Point<f64, D>) -> Point<f64, D> {
        match self {
            Self::Bent | Self::Cropped => bend(p),
            Self::Turned(degrees) => turn(p, degrees),
            Self::Stretched(factor) => stretch(p, factor),
        }
    }
}

fn kinds() -> Vec<Kind> {
    let turned = [15.0, 30.0, 45.0, 90.0].map(Change::Turned);
    let stretched = [1.25, 1.5, 2.0].map(Change::Stretched);
    let mut kinds = Vec::new();
    for random in [false, true] {
        let mut add = |changes: &[Change], noises: &[f64], outliers: [f64; 2]| {
            for outliers in outliers {
                for &noise in noises {
                    kinds.extend(changes.iter().map(|&change| Kind {
                        change,
                        noise,
                        outliers,
                        random,
                    }));
                }
            }
        };
        add(&[Change::Bent], &[0.1, 0.15, 0.25], [0.0, 0.2]);
        add(&[Change::Cropped], &[0.05, 0.15], [0.0, 0.1]);
        add(&turned, &[0.05, 0.15], [0.0, 0.1]);
        add(&stretched, &[0.02, 0.1], [0.0, 0.1]);
    }
    kinds
}

/// Counts of one family of scenes.
#[derive(Clone, Copy, Default)]
struct Tally {
    scenes: usize,
    doubted: usize,
    wrong: usize,
    silent: usize,
    within: f64,
    coordinates: f64,
}

fn add<const D: usize>(
    kind: Kind,
    seed: u64,
    tally: &mut Tally,
    tenths: &mut Tenths,
) -> Result<(), MatchError> {
    let scene = Scene::<D>::new(kind, seed);
    let found = AnnealedSoftassign::default().match_points(&scene.model, &scene.target)?;
    let (mut right, mut pairs) = (0.0, 0.0);
    for (i, partner) in found.assignment.iter().enumerate() {
        let &Some(j) = partner else { continue };
        let is_right = scene.is_right(i, j);
        right += f64::from(u8::from(is_right));
        pairs += 1.0;
        tenths.add(found.confidence[i], is_right);
    }
    let doubted = found.report.doubt().is_some();
    tally.scenes += 1;
    tally.doubted += usize::from(doubted);
    if right < 0.9 * pairs {
        tally.wrong += 1;
        tally.silent += usize::from(!doubted);
    }
    if !doubted {
        count_within(&scene, &found, tally);
    }
    Ok(())
}

fn count_within<const D: usize>(scene: &Scene<D>, found: &Matching<D>, tally: &mut Tally) {
    for &i in &scene.order {
        for k in 0..D {
            let deviation = found.displacement_covariance[i][(k, k)].sqrt();
            let error = (found.warped[i][k] - scene.truth[i][k]).abs();
            tally.within += f64::from(u8::from(error < deviation));
            tally.coordinates += 1.0;
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let first: u64 = arguments.next().map_or(Ok(100), |text| text.parse())?;
    let count: u64 = arguments.next().map_or(Ok(4), |text| text.parse())?;
    let mut tenths = Tenths::default();
    let mut families = [
        ("bent", Tally::default()),
        ("bent, with outliers", Tally::default()),
        ("cropped", Tally::default()),
        ("turned by 15 to 45 degrees", Tally::default()),
        ("turned by 90 degrees", Tally::default()),
        ("stretched and cropped", Tally::default()),
    ];
    for kind in kinds() {
        let family = match kind.change {
            Change::Bent => usize::from(kind.outliers > 0.0),
            Change::Cropped => 2,
            Change::Turned(degrees) => 3 + usize::from(degrees > 60.0),
            Change::Stretched(_) => 5,
        };
        for seed in first..first + count {
            add::<2>(kind, seed, &mut families[family].1, &mut tenths)?;
            add::<3>(kind, seed, &mut families[family].1, &mut tenths)?;
        }
    }
    tenths.print();
    println!(
        "scenes, doubted, below 90 % right, of these without a doubt; of those without, within \
         one standard deviation"
    );
    for (name, tally) in families {
        println!(
            "  {name:<28} {:>4} {:>4} {:>4} {:>4}  {:.3}",
            tally.scenes,
            tally.doubted,
            tally.wrong,
            tally.silent,
            tally.within / tally.coordinates
        );
    }
    Ok(())
}
