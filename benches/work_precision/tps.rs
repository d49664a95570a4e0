//! Splines: kernel, number of points, scalar type, solver and λ.

use crate::study::Study;
use tactile_benches::Problem;
use tactile_imaging::tps::{
    Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline, SplineWorkspace,
    ThinPlateSpline,
};

fn problem(n: usize, noise: f64) -> Problem {
    Problem::new(200, n, noise, 2000)
}

fn fit<K: Kernel>(
    study: &mut Study,
    knob: &'static str,
    setting: &str,
    is_default: bool,
    p: &Problem,
    options: &FitOptions<K>,
) {
    let job = || ThinPlateSpline::fit(&p.sources, &p.targets, options).expect("a spline");
    study.run(knob, setting, is_default, job, |s| p.error(s));
}

/// Interpolation of exact data in space, where r³ is the default.
pub(crate) fn clean(study: &mut Study) {
    study.error_label = "rms error at 2000 queries, cube of side 2";
    let p = problem(200, 0.0);
    fit(
        study,
        "kernel",
        "r² ln r, 200 points",
        false,
        &p,
        &FitOptions::new(R2LogR),
    );
    fit(
        study,
        "kernel",
        "−r, 200 points",
        false,
        &p,
        &FitOptions::new(NegR),
    );
    fit(
        study,
        "kernel",
        "r³, 200 points",
        true,
        &p,
        &FitOptions::new(R3),
    );
    for n in study.choose(vec![50, 105, 400], vec![50, 105, 400, 800, 1600]) {
        let p = problem(n, 0.0);
        let [log, cube] = ["r² ln r", "r³"].map(|kernel| format!("{kernel}, {n} points"));
        fit(study, "points", &log, false, &p, &FitOptions::new(R2LogR));
        fit(study, "points", &cube, false, &p, &FitOptions::new(R3));
    }
    refit(study, &p);
}

fn refit(study: &mut Study, p: &Problem) {
    let factorization = Factorization::new(&p.sources, &FitOptions::new(R3)).expect("a factor");
    let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::default());
    let job = || {
        factorization
            .refit_with(&mut workspace, &p.targets, None, None, &mut spline)
            .expect("a fit");
        spline.clone()
    };
    study.run("solver", "r³, 200 points, factors kept", false, job, |s| {
        p.error(s)
    });
}

/// Noise of ±0.02 on the targets: λ and its choice by cross-validation.
pub(crate) fn noisy(study: &mut Study) {
    study.error_label = "rms error at 2000 queries, noise ±0.02";
    let p = problem(200, 0.02);
    let smoothed = |smoothing| {
        FitOptions::new(R3)
            .with_smoothing(smoothing)
            .expect("a rule")
    };
    fit(
        study,
        "λ",
        "interpolation (default)",
        true,
        &p,
        &FitOptions::new(R3),
    );
    for lambda in study.choose(
        vec![1e-3, 1e-2, 1e-1, 1.0, 10.0],
        vec![1e-4, 1e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 10.0, 1e3],
    ) {
        let options = smoothed(Smoothing::Lambda(lambda));
        fit(study, "λ", &format!("λ = {lambda}"), false, &p, &options);
    }
    let options = smoothed(Smoothing::Gcv);
    fit(study, "λ", "cross-validation", false, &p, &options);
}
