//! Splines: kernel, number of points, scalar type, way of solving, λ.

use crate::peers;
use crate::study::Study;
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng, rngs::SmallRng};
use tactile_imaging::tps::{
    Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline, SplineWorkspace,
    ThinPlateSpline,
};

type Points = Vec<Point3<f64>>;

/// Uniform points of the cube [−1, 1]³ moved by five Gaussian bumps, and where 2000 others go.
struct Problem {
    sources: Points,
    targets: Points,
    queries: Points,
    truth: Points,
}

impl Problem {
    fn new(n: usize, noise: f64) -> Self {
        let mut random = SmallRng::seed_from_u64(200);
        let mut point =
            |size: f64| Point3::from(Vector3::from_fn(|_, _| random.random_range(-size..size)));
        let bumps: Vec<_> = (0..5).map(|_| (point(1.0), point(0.17).coords)).collect();
        let map = |p: &Point3<f64>| {
            bumps.iter().fold(*p, |q, (c, a)| {
                q + a * (-(p - c).norm_squared() / 0.72).exp()
            })
        };
        let sources: Points = (0..n).map(|_| point(1.0)).collect();
        let targets = sources
            .iter()
            .map(|p| map(p) + point(noise.max(1e-300)).coords)
            .collect();
        let queries: Points = (0..2000).map(|_| point(0.95)).collect();
        let truth = queries.iter().map(map).collect();
        Self {
            sources,
            targets,
            queries,
            truth,
        }
    }

    fn error<K: Kernel>(&self, spline: &ThinPlateSpline<f64, 3, K>) -> f64 {
        let mut values = vec![Point3::origin(); self.queries.len()];
        spline
            .apply_into(&self.queries, &mut values)
            .expect("equal lengths");
        rms(&values, &self.truth)
    }
}

fn rms(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    (a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm_squared())
        .sum::<f64>()
        / a.len() as f64)
        .sqrt()
}

fn fit<K: Kernel>(
    study: &mut Study,
    knob: &'static str,
    setting: &str,
    is_default: bool,
    p: &Problem,
    options: FitOptions<f64, K>,
) {
    let job = || ThinPlateSpline::fit(&p.sources, &p.targets, &options).expect("a spline");
    study.run(knob, setting, is_default, job, |s| p.error(s));
}

/// Interpolation of exact data; the kernel of the pipeline's warp in space, −r, is the default.
pub(crate) fn clean(study: &mut Study) {
    study.error_label = "rms error at 2000 queries, cube of side 2";
    let p = Problem::new(200, 0.0);
    fit(
        study,
        "kernel",
        "r² ln r, 200 points",
        true,
        &p,
        FitOptions::new(R2LogR),
    );
    fit(
        study,
        "kernel",
        "−r, 200 points",
        true,
        &p,
        FitOptions::new(NegR),
    );
    fit(
        study,
        "kernel",
        "r³, 200 points",
        false,
        &p,
        FitOptions::new(R3),
    );
    for n in study.choose(vec![50, 105, 400], vec![50, 105, 400, 800, 1600]) {
        let p = Problem::new(n, 0.0);
        fit(
            study,
            "points",
            &format!("r² ln r, {n} points"),
            false,
            &p,
            FitOptions::new(R2LogR),
        );
        fit(
            study,
            "points",
            &format!("−r, {n} points"),
            false,
            &p,
            FitOptions::new(NegR),
        );
    }
    single(study, &p);
    refit(study, &p);
    for (package, both, r) in peers::spline_fits() {
        // One interpolant belongs to a kernel: the error is that of ours.
        for (seconds, entry) in [(both, 0), (r, 1)] {
            study
                .peers
                .extend(seconds.map(|s| (package.clone(), s, study.entries[entry].error)));
        }
    }
}

fn single(study: &mut Study, p: &Problem) {
    let short = |points: &[Point3<f64>]| {
        points
            .iter()
            .map(|p| p.map(|x| x as f32))
            .collect::<Vec<_>>()
    };
    let (sources, targets) = (short(&p.sources), short(&p.targets));
    let job =
        || ThinPlateSpline::fit(&sources, &targets, &FitOptions::new(NegR)).expect("a spline");
    study.run("scalar", "−r, 200 points, f32", false, job, |spline| {
        let values: Points = p
            .queries
            .iter()
            .map(|q| spline.apply(&q.map(|x| x as f32)).map(f64::from))
            .collect();
        rms(&values, &p.truth)
    });
}

fn refit(study: &mut Study, p: &Problem) {
    let factorization = Factorization::new(&p.sources, &FitOptions::new(NegR)).expect("a factor");
    let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::default());
    let job = || {
        factorization
            .refit_with(&mut workspace, &p.targets, None, None, &mut spline)
            .expect("a fit");
        spline.clone()
    };
    study.run(
        "solver",
        "−r, 200 points, factors kept",
        false,
        job,
        |s| p.error(s),
    );
}

/// Noise of ±0.02 on the targets: λ and its choice by cross-validation.
pub(crate) fn noisy(study: &mut Study) {
    study.error_label = "rms error at 2000 queries, noise ±0.02";
    let p = Problem::new(200, 0.02);
    fit(
        study,
        "λ",
        "interpolation (default)",
        true,
        &p,
        FitOptions::new(NegR),
    );
    for lambda in study.choose(
        vec![1e-3, 1e-2, 1e-1, 1.0, 10.0],
        vec![1e-4, 1e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 10.0, 1e3],
    ) {
        let options = FitOptions::new(NegR)
            .with_smoothing(Smoothing::Lambda(lambda))
            .expect("a λ");
        fit(study, "λ", &format!("λ = {lambda}"), false, &p, options);
    }
    fit(
        study,
        "λ",
        "cross-validation",
        false,
        &p,
        FitOptions::new(NegR)
            .with_smoothing(Smoothing::Gcv)
            .expect("a rule"),
    );
}
