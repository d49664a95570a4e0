//! Finite elements: time of a ball on the paper's guide, of its contact table and of an inversion.
//!
//! ```console
//! cargo bench -p tactile-benches --features fem --bench finite_elements              # some two minutes; the table alone, once: -- table
//! ```
#![allow(clippy::print_stdout, missing_docs)]

use std::ops::ControlFlow;
use std::time::Instant;
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::elasticity::modulus::{
    Estimate, LoadSeries, LoadState, ModulusEstimator, TabulatedContact,
};
use tactile_imaging::fem::{
    self, AppliedLoad, ContactTableOptions, Material, ObjectPress, ObjectShape, Outcome,
};

const NU: f64 = 0.495;
const PAPER_LAYERS: [(f64, f64); 3] = [(2e-3, 136e3), (3e-3, 80e3), (5e-3, 34e3)];

fn material(youngs_modulus_pa: f64) -> Material {
    Material::new(youngs_modulus_pa, NU).expect("a material")
}

fn paper_guide() -> fem::Guide {
    let layers = PAPER_LAYERS.map(|(thickness_m, modulus)| fem::GuideLayer {
        thickness_m,
        material: material(modulus),
    });
    fem::Guide::new(layers.to_vec(), 25e-3).expect("a guide")
}

fn timed<R>(job: impl FnOnce() -> R) -> (R, f64) {
    let start = Instant::now();
    let answer = job();
    (answer, start.elapsed().as_secs_f64())
}

/// A ball of 3 mm on the paper's guide up to 1.2 N, on three meshes.
fn ball_on_guide(is_test: bool) {
    let ball = ObjectShape::Ball { radius_m: 3e-3 };
    let press = ObjectPress::new(ball, material(103e3)).expect("a press");
    let press = press
        .on_guide(paper_guide())
        .expect("a guide wider than the ball");
    let finest = if is_test { 3 } else { 10 };
    let loads = [0.2, 0.7, 1.2].map(AppliedLoad::Force);
    let solve = |fineness| {
        let scene = press
            .clone()
            .with_fineness(fineness)
            .and_then(|p| p.scene())
            .expect("a scene");
        let (solution, seconds) = timed(|| scene.solve(&loads));
        assert_eq!(solution.report.outcome, Outcome::Solved);
        let radii: Vec<f64> = (solution.states.iter())
            .map(|s| s.contact_radius().expect("a contact").radius_m)
            .collect();
        (radii, seconds, scene.element_count(), solution.report)
    };
    let (fine, ..) = solve(finest);
    for fineness in [3, 4, 5, 7] {
        let (radii, seconds, elements, report) = solve(fineness);
        let off = radii.iter().zip(&fine).map(|(a, b)| (a / b - 1.0).abs());
        let worst = off.fold(0.0, f64::max);
        println!(
            "ball on the paper's guide to 1.2 N, fineness {fineness}: {elements} elements, {} \
             steps, {} iterations, {seconds:.2} s; contact radii within {:.3} % of fineness \
             {finest}",
            report.steps,
            report.iterations,
            100.0 * worst
        );
        if is_test {
            return;
        }
        assert!(fineness != 5 || worst < 2e-3, "{worst}");
    }
}

/// The contact table of the paper's guide, and the inversion of two loads.
fn table(is_test: bool) {
    let layer = |(thickness_m, youngs_modulus_pa)| Layer {
        thickness_m,
        youngs_modulus_pa,
        poisson_ratio: NU,
    };
    let (guide, options) = if is_test {
        let short = ContactTableOptions::default()
            .with_largest_ratio(0.4)
            .expect("a ratio");
        (Waveguide::rigid(), short)
    } else {
        let layers = PAPER_LAYERS.map(layer).to_vec();
        (
            Waveguide::new(layers).expect("a guide"),
            ContactTableOptions::default(),
        )
    };
    let (table, seconds) = timed(|| {
        fem::solve_contact_table(3e-3, NU, &guide, &options, |_| ControlFlow::Continue(()))
    });
    let table = table.expect("a table");
    let contacts: usize = table.curves().iter().map(|c| c.force_n.len()).sum();
    println!(
        "contact table: {} moduli, {contacts} contacts, {seconds:.1} s; interpolation error {:.3} \
         % of the force",
        table.curves().len(),
        100.0 * table.interpolation_error()
    );
    let load = |a: f64| {
        let force = table.force_n(a, 103e3).expect("a force");
        LoadState::new(Estimate::new(force, 2e-3 * force)).with_radius(Estimate::new(a, 2e-6))
    };
    let loads = LoadSeries::new([load(0.6e-3), load(1.1e-3)]);
    let estimator =
        TabulatedContact::new(table.clone(), 3e-3, NU, &guide).expect("the table's guide");
    let runs = if is_test { 1 } else { 20_000 };
    let (_, seconds) = timed(|| {
        for _ in 0..runs {
            let found = std::hint::black_box(&estimator).estimate(std::hint::black_box(&loads));
            let off = found.expect("a modulus").youngs_modulus_pa / 103e3 - 1.0;
            assert!(off.abs() < 1e-9);
        }
    });
    println!(
        "inversion of two loads: {:.1} µs",
        1e6 * seconds / f64::from(runs)
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let is_test = arguments.iter().any(|a| a == "--test");
    let named: Vec<&str> = (arguments.iter().map(String::as_str))
        .filter(|a| !a.starts_with("--"))
        .collect();
    let wanted = |name: &str| named.is_empty() || named.contains(&name);
    if wanted("ball") {
        ball_on_guide(is_test);
    }
    if wanted("table") {
        table(is_test);
    }
}
