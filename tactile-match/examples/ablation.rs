//! Contribution of each mechanism of the default matcher: all scenes with it and without it, and
//! the differences with their standard errors.
//!
//! ```text
//! TACTILE_DATA=FOLDER cargo run --release -p tactile-match --features ablation --example ablation -- [FIRST_SEED SEEDS] [MECHANISM ...]
//! ```
//!
//! The scenes are the published benchmark of Chui and Rangarajan (if the data are available),
//! generated bells and discs, bent, cropped, rotated and stretched sets, dense sets, and sets of
//! thousands of points. For every family of scenes, the means over the scenes are printed: the
//! error of the warp (in per cent of the radius of the model), the fraction of correct pairs and
//! the Brier score of the confidences (both in per cent), and the ratio of the times. Then the
//! changes are printed for every mechanism that is switched off.
#![allow(clippy::print_stdout)]
use nalgebra::{Point, SMatrix, SVector};
use std::ops::ControlFlow;
use std::time::Instant;
use tactile_match::{AnnealedSoftassign, MatchError, Mechanism, SoftassignWorkspace};

#[path = "support/cases.rs"]
mod cases;
#[path = "support/disc.rs"]
mod disc;
#[path = "support/points.rs"]
mod points;
#[path = "support/stream.rs"]
mod stream;
use disc::disc;
use points::{bend, cube, stretch, turn};
use stream::Stream;

const ALL: [Mechanism; 14] = [
    Mechanism::Patterns,
    Mechanism::Reheat,
    Mechanism::Slow,
    Mechanism::Tuples,
    Mechanism::Labelling,
    Mechanism::Moments,
    Mechanism::LastReheat,
    Mechanism::Scales,
    Mechanism::PairOdds,
    Mechanism::LargePatterns,
    Mechanism::Motions,
    Mechanism::Rivals,
    Mechanism::Open,
    Mechanism::Fine,
];

struct Scene<const D: usize> {
    family: &'static str,
    model: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
    /// True positions of the model points.
    truth: Vec<Point<f64, D>>,
    /// Rows of their true partners.
    partner: Vec<Option<usize>>,
}

/// Error, fraction of correct pairs, Brier score, seconds, and whether most pairs are wrong without
/// a doubt.
type Score = [f64; 5];

impl<const D: usize> Scene<D> {
    /// A scene from the displaced model: the `kept` rows are visible, the noise is per axis, and
    /// additional random targets lie in the box of the others.
    fn new(
        family: &'static str,
        model: Vec<Point<f64, D>>,
        truth: Vec<Point<f64, D>>,
        kept: &[usize],
        noise: f64,
        clutter: usize,
        stream: &mut Stream,
    ) -> Self {
        let mut target: Vec<Point<f64, D>> = Vec::new();
        for &i in kept {
            target.push(truth[i] + SVector::from_fn(|_, _| noise * stream.normal()));
        }
        let (mut low, mut high) = (target[0], target[0]);
        for p in &target {
            (low, high) = (low.inf(p), high.sup(p));
        }
        for _ in 0..clutter {
            target.push(low + SVector::from_fn(|k, _| stream.next() * (high[k] - low[k])));
        }
        let order = stream.permutation(target.len());
        let mut partner = vec![None; model.len()];
        let mut shuffled = target.clone();
        for (place, &from) in order.iter().enumerate() {
            shuffled[place] = target[from];
            if let Some(&i) = kept.get(from) {
                partner[i] = Some(place);
            }
        }
        Self {
            family,
            model,
            target: shuffled,
            truth,
            partner,
        }
    }

    fn score(
        &self,
        matcher: &AnnealedSoftassign,
        workspace: &mut SoftassignWorkspace<D>,
    ) -> Result<Score, MatchError> {
        let start = Instant::now();
        let go = || ControlFlow::Continue(());
        let found = matcher.match_points_with(workspace, &self.model, &self.target, go)?;
        let seconds = start.elapsed().as_secs_f64();
        let n = self.model.len() as f64;
        let centre: SVector<f64, D> =
            self.model.iter().map(|p| p.coords).sum::<SVector<f64, D>>() / n;
        let radius = (self
            .model
            .iter()
            .map(|p| (p.coords - centre).norm_squared())
            .sum::<f64>()
            / n)
            .sqrt();
        let (mut error, mut right, mut paired, mut brier, mut pairs) =
            (0.0, 0.0, 0.0, 0.0, 0.0_f64);
        for (i, warped) in found.warped().enumerate() {
            let own = f64::from(u8::from(
                found.assignment[i].is_some() && found.assignment[i] == self.partner[i],
            ));
            if self.partner[i].is_some() {
                paired += 1.0;
                error += (warped - self.truth[i]).norm() / radius;
            }
            if found.assignment[i].is_some() {
                pairs += 1.0;
                right += own;
                brier += (found.confidence[i] - own).powi(2);
            }
        }
        let silent = right < 0.9 * pairs && found.report.doubt().is_none();
        Ok([
            100.0 * error / paired,
            100.0 * right / paired,
            100.0 * brier / pairs.max(1.0),
            seconds,
            f64::from(u8::from(silent)) * 100.0,
        ])
    }
}

/// Six broad Gaussian bumps and an affine part whose root mean square displacement is `size`.
fn warp<const D: usize>(
    model: &[Point<f64, D>],
    size: f64,
    stream: &mut Stream,
) -> Vec<Point<f64, D>> {
    let bumps: Vec<(SVector<f64, D>, SVector<f64, D>)> = (0..6)
        .map(|_| {
            (
                SVector::from_fn(|_, _| 2.4 * stream.next() - 1.2),
                SVector::from_fn(|_, _| stream.normal()),
            )
        })
        .collect();
    let affine = SMatrix::<f64, D, D>::from_fn(|_, _| 0.25 * stream.normal());
    let field = |p: &Point<f64, D>| -> SVector<f64, D> {
        let bent: SVector<f64, D> = bumps
            .iter()
            .map(|(c, a)| a * (-(p.coords - c).norm_squared() / 1.28).exp())
            .sum();
        bent + affine * p.coords
    };
    let squares: f64 = model.iter().map(|p| field(p).norm_squared()).sum();
    let factor = size / (squares / model.len() as f64).sqrt();
    model.iter().map(|p| p + field(p) * factor).collect()
}

/// Bells and discs of 105 to 200 points: three sizes of the deformation; clean, noisy, with
/// clutter, and with missing points.
fn bells<const D: usize>(n: usize, seed: u64, scenes: &mut Vec<Scene<D>>) {
    for (level, size) in [0.06, 0.16, 0.3].into_iter().enumerate() {
        for (variant, family) in ["bell clean", "bell noise", "bell clutter", "bell missing"]
            .into_iter()
            .enumerate()
        {
            let mut stream =
                Stream(seed * 7919 + (level * 4 + variant) as u64 * 131 + (n * D) as u64);
            let model = disc::<D>(n, 0.15, &mut stream);
            let truth = warp(&model, size, &mut stream);
            let mut kept = stream.permutation(n);
            if variant == 3 {
                kept.truncate(n - n / 10);
            }
            let noise = if variant == 1 {
                0.04 / (D as f64).sqrt()
            } else {
                0.0
            };
            let clutter = if variant == 2 { n / 5 } else { 0 };
            scenes.push(Scene::new(
                family,
                model,
                truth,
                &kept,
                noise,
                clutter,
                &mut stream,
            ));
        }
    }
}

/// Sets of the unit cube that are bent, cropped, rotated, or stretched and cropped.
fn cubes<const D: usize>(seed: u64, scenes: &mut Vec<Scene<D>>) {
    let mut add = |family,
                   n: usize,
                   noise: f64,
                   clutter: f64,
                   random,
                   map: &dyn Fn(&Point<f64, D>) -> Point<f64, D>,
                   window: f64| {
        let mut stream = Stream(seed * 7919 + 13 + scenes.len() as u64 * 101);
        let model = cube::<D>(n, random, &mut stream);
        let truth: Vec<_> = model.iter().map(map).collect();
        let mut kept = stream.permutation(n);
        kept.retain(|&i| (0.0..window).contains(&truth[i][0]));
        let noise = noise * (n as f64).powf(-1.0 / D as f64);
        let clutter = (clutter * kept.len() as f64) as usize;
        scenes.push(Scene::new(
            family,
            model,
            truth,
            &kept,
            noise,
            clutter,
            &mut stream,
        ));
    };
    for random in [false, true] {
        for clutter in [0.0, 0.2] {
            for noise in [0.02, 0.15, 0.25] {
                add("bent", 105, noise, clutter, random, &bend, 1e9);
            }
            for noise in [0.05, 0.15] {
                add("cropped", 150, noise, 0.5 * clutter, random, &bend, 0.75);
                for degrees in [15.0_f64, 30.0, 45.0] {
                    let turned = move |p: &_| turn(p, degrees);
                    add("turned", 105, noise, 0.5 * clutter, random, &turned, 1e9);
                }
            }
            for (noise, factor) in [(0.02, 1.25), (0.02, 1.5), (0.02, 2.0), (0.1, 1.5)] {
                let stretched = move |p: &_| stretch(p, factor);
                add(
                    "stretched",
                    200,
                    noise,
                    0.5 * clutter,
                    random,
                    &stretched,
                    1.0,
                );
            }
        }
    }
}

/// Nearly regular and random sets of hundreds of points.
fn dense<const D: usize>(seed: u64, scenes: &mut Vec<Scene<D>>) {
    for (k, (n, noise, clutter)) in [
        (300, 0.1, 0.06),
        (360, 0.0, 0.1),
        (700, 0.05, 0.06),
        (1680, 0.0, 0.06),
    ]
    .into_iter()
    .enumerate()
    {
        let mut stream = Stream(seed * 104_729 + k as u64 * 17);
        let model = disc::<D>(n, 0.125, &mut stream);
        let truth = warp(&model, 0.2, &mut stream);
        let kept = stream.permutation(n);
        let noise = noise * (std::f64::consts::PI / n as f64).sqrt();
        scenes.push(Scene::new(
            "dense",
            model,
            truth,
            &kept,
            noise,
            (clutter * n as f64) as usize,
            &mut stream,
        ));
    }
}

/// Sets of thousands of points.
fn large(n: usize, seed: u64, scenes: &mut Vec<Scene<3>>) {
    for (k, (noise, clutter)) in [(0.0, 0.0), (0.002, 0.1), (0.02, 0.2)]
        .into_iter()
        .enumerate()
    {
        for surface in [true, false] {
            let mut stream = Stream(seed * 15_485_863 + k as u64 * 29 + n as u64);
            let model = if surface {
                disc::<3>(n, 0.15, &mut stream)
            } else {
                (0..n)
                    .map(|_| Point::from(SVector::from_fn(|_, _| 2.0 * stream.next() - 1.0)))
                    .collect()
            };
            let truth = warp(&model, 0.2, &mut stream);
            let kept = stream.permutation(n);
            scenes.push(Scene::new(
                ["large clean", "large noise", "large hidden"][k],
                model,
                truth,
                &kept,
                noise,
                (clutter * n as f64) as usize,
                &mut stream,
            ));
        }
    }
}

/// The published benchmark, if its data are available.
fn published(scenes: &mut Vec<Scene<2>>) -> Result<(), Box<dyn std::error::Error>> {
    let root = std::env::var("TACTILE_DATA").unwrap_or_default();
    for kind in ["def", "noise", "outlier", "occlusion", "rot"] {
        let family = match kind {
            "def" => "published deformation",
            "noise" => "published noise",
            "outlier" => "published outliers",
            "occlusion" => "published occlusion",
            _ => "published rotation",
        };
        for shape in ["fish", "chinese"] {
            let Ok(text) =
                std::fs::read_to_string(format!("{root}/chui_rangarajan/{shape}_{kind}.txt"))
            else {
                continue;
            };
            let points =
                |rows: &[Vec<f64>]| rows.iter().map(|row| Point::from_slice(row)).collect();
            scenes.extend(cases::read(&text)?.iter().map(|case| {
                Scene {
                    family,
                    model: points(&case.model),
                    target: points(&case.target),
                    truth: points(&case.truth),
                    partner: case
                        .partner
                        .iter()
                        .map(|&row| usize::try_from(row).ok())
                        .collect(),
                }
            }));
        }
    }
    Ok(())
}

fn all<const D: usize>(
    scenes: &[Scene<D>],
    matcher: &AnnealedSoftassign,
) -> Result<Vec<(&'static str, Score)>, MatchError> {
    let mut workspace = SoftassignWorkspace::default();
    scenes
        .iter()
        .map(|scene| {
            let rotation = if scene.family == "published rotation" {
                tactile_match::Rotation::Any
            } else {
                tactile_match::Rotation::Limited
            };
            Ok((
                scene.family,
                scene.score(&matcher.with_rotation(rotation), &mut workspace)?,
            ))
        })
        .collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number =
        |at: usize, default: u64| arguments.get(at).map_or(Ok(default), |text| text.parse());
    let (first, count) = (number(0, 0)?, number(1, 3)?);
    let wanted = arguments.get(2..).unwrap_or_default();
    let (mut plane, mut space) = (Vec::new(), Vec::new());
    published(&mut plane)?;
    for seed in first..first + count {
        bells(105, seed, &mut plane);
        bells(105, seed, &mut space);
        bells(200, seed, &mut space);
        cubes(seed, &mut plane);
        cubes(seed, &mut space);
        dense(seed, &mut plane);
        dense(seed, &mut space);
    }
    if wanted.iter().any(|word| word == "large") {
        plane.clear();
        space.clear();
        for n in [2000, 5000] {
            large(n, first, &mut space);
        }
    }
    let run = |matcher: &AnnealedSoftassign| -> Result<_, MatchError> {
        let mut scores = all(&plane, matcher)?;
        scores.extend(all(&space, matcher)?);
        Ok(scores)
    };
    let reference = run(&AnnealedSoftassign::default())?;
    let mut families: Vec<&str> = Vec::new();
    for (family, _) in &reference {
        if !families.contains(family) {
            families.push(family);
        }
    }
    families.push("all");
    println!(
        "{:<18} {:<22} {:>6} {:>9} {:>8} {:>8} {:>9} {:>7}",
        "without", "scenes", "", "error", "right", "Brier", "ms", "silent"
    );
    for family in &families {
        let of: Vec<Score> = reference
            .iter()
            .filter(|(f, _)| f == family || *family == "all")
            .map(|s| s.1)
            .collect();
        let mean = |k: usize| of.iter().map(|s| s[k]).sum::<f64>() / of.len() as f64;
        println!(
            "{:<18} {family:<22} {:>6} {:>9.4} {:>8.2} {:>8.2} {:>9.2} {:>7.1}",
            "nothing",
            of.len(),
            mean(0),
            mean(1),
            mean(2),
            1e3 * mean(3),
            mean(4)
        );
    }
    for mechanism in ALL {
        let named = |word: &String| word != "large";
        if wanted.iter().any(named) && !wanted.contains(&format!("{mechanism:?}")) {
            continue;
        }
        let scores = run(&AnnealedSoftassign::default().without(mechanism))?;
        for family in &families {
            let of: Vec<(Score, Score)> = reference
                .iter()
                .zip(&scores)
                .filter(|(r, _)| r.0 == *family || *family == "all")
                .map(|(r, s)| (r.1, s.1))
                .collect();
            let n = of.len() as f64;
            let change = |k: usize| {
                let mean = of.iter().map(|(r, s)| s[k] - r[k]).sum::<f64>() / n;
                let square = of
                    .iter()
                    .map(|(r, s)| (s[k] - r[k] - mean).powi(2))
                    .sum::<f64>();
                (mean, (square / (n * (n - 1.0).max(1.0))).sqrt())
            };
            let time = |which: fn(&(Score, Score)) -> f64| of.iter().map(which).sum::<f64>();
            let changes = [0, 1, 2, 4].map(change);
            if *family != "all" && changes.iter().all(|(mean, error)| mean.abs() <= *error) {
                continue;
            }
            let [e, r, b, q] = changes.map(|(mean, error)| {
                format!(
                    "{mean:+.3}±{error:.3}{}",
                    if mean.abs() > 2.0 * error { "*" } else { "" }
                )
            });
            println!(
                "{:<18} {family:<22} {e:>17} {r:>15} {b:>15} time {:.2} silent {q}",
                format!("{mechanism:?}"),
                time(|s| s.1[3]) / time(|s| s.0[3])
            );
        }
    }
    Ok(())
}
