//! Recorded results of every method: a change that is not meant to change a number must reproduce
//! them.
//!
//! `RECORD_ANSWERS=1 cargo test -p tactile-sfs --test suite recorded` rewrites the record. Give the
//! reason in the commit.

use ndarray::Array2;
use tactile_sfs::{
    BoundaryCondition, ControlPointSampler, CosinePoisson, Domain, Eikonal, EikonalBranch,
    EquallySpaced, Image, Lighting, MaskedLeastSquares, SlopeIntegrator, Surface,
    SurfaceReconstruction, TsaiShah, slopes,
};
use test_support::Answers;

use super::common::{
    Alignment, Sampled, ellipsoid, from_rim, gaussian, height_error, paraboloid, render, sphere,
    waves,
};

/// Relative to the largest number of a line: the last bits of square roots and of sums in another
/// order, times several hundred steps of some methods.
const TOLERANCE: f64 = 1e-12;

const SIDE: usize = 48;

/// Some of the computed heights, and the counts of the report.
fn add_surface(answers: &mut Answers, name: &str, surface: &Surface<f64>) {
    let solved = surface.heights.iter().filter(|z| z.is_finite());
    answers.add(name, solved.copied().step_by(47));
    let report = &surface.report;
    let counts = [report.iterations, report.solved, report.flagged];
    answers.add(format!("{name}/counts"), counts.map(|n| n as f64));
}

fn reconstructions(answers: &mut Answers) {
    let oblique = Lighting::new([0.3, -0.2, 1.0]).expect("a light");
    let frontal = Lighting::default();
    let steep = Eikonal::new(frontal)
        .with_boundary(BoundaryCondition::Height(0.1))
        .expect("a height");
    for (name, shape) in [
        ("sphere", sphere as super::common::Shape),
        ("ellipsoid", ellipsoid),
        ("paraboloid", paraboloid),
    ] {
        let scene = Sampled::new(SIDE, shape);
        let domain = Domain::new([scene.pixel, 1.1 * scene.pixel]).expect("a size");
        let domain = domain.with_mask(scene.mask.view());
        let lit = render(scene.z.view(), [scene.pixel; 2], &oblique);
        let methods: [(_, &dyn SurfaceReconstruction<f64>, _); 3] = [
            ("eikonal", &steep, &scene.image),
            ("eikonal_oblique", &from_rim(oblique), &lit),
            ("tsai_shah", &TsaiShah::new(frontal), &scene.image),
        ];
        for (method_name, method, image) in methods {
            let surface = method.reconstruct(Image::new(image.view(), domain));
            let surface = surface.expect("a surface");
            add_surface(answers, &format!("{method_name}/{name}"), &surface);
        }
    }
    both_branches(answers, frontal);
}

fn both_branches(answers: &mut Answers, frontal: Lighting<f64>) {
    let scene = Sampled::new(SIDE, gaussian);
    let mut known = Array2::from_elem((SIDE, SIDE), f64::NAN);
    let top = [(22, 26), (23, 26), (22, 27)];
    for at in top {
        known[at] = scene.z[at];
    }
    let domain = Domain::new([scene.pixel; 2]).expect("a size");
    let domain = domain.with_known_heights(known.view());
    let lit = Lighting::new([0.3, -0.2, 1.0]).expect("a light");
    let image = render(scene.z.view(), [scene.pixel; 2], &lit);
    for (name, light, image) in [("frontal", frontal, &scene.image), ("oblique", lit, &image)] {
        let method = Eikonal::new(light).with_branch(EikonalBranch::Auto);
        let surface = method
            .reconstruct(Image::new(image.view(), domain))
            .expect("heights");
        add_surface(answers, &format!("eikonal_known/{name}"), &surface);
    }
}

fn integrators(answers: &mut Answers) {
    let scene = Sampled::new(SIDE, waves);
    let disc = Sampled::new(SIDE, sphere).mask;
    let mut known = Array2::from_elem((SIDE, SIDE), f64::NAN);
    known[[20, 20]] = 0.4;
    known[[30, 24]] = 0.1;
    let whole = Domain::new([scene.pixel, 1.2 * scene.pixel]).expect("a size");
    let masked = whole.with_mask(disc.view());
    let poisson = CosinePoisson;
    let squares = MaskedLeastSquares::default();
    let methods: [(&str, &dyn SlopeIntegrator<f64>); 2] =
        [("poisson", &poisson), ("masked", &squares)];
    for (name, method) in methods {
        for (case, domain) in [
            ("whole", whole),
            ("disc", masked),
            ("known", masked.with_known_heights(known.view())),
        ] {
            let surface = method
                .integrate(scene.p.view(), scene.q.view(), &domain)
                .expect("heights");
            add_surface(answers, &format!("{name}/{case}"), &surface);
        }
    }
}

fn samplers(answers: &mut Answers) {
    let scene = Sampled::new(SIDE, ellipsoid);
    // Few points lie between the pixels, many lie on pixels.
    for count in [9, 60, 500] {
        let points = EquallySpaced.sample(scene.z.view(), &scene.domain(), count);
        let points = points.expect("points");
        let shown = points.iter().step_by(1 + count / 20);
        answers.add(
            format!("equally_spaced/{count}"),
            shown.flat_map(|p| [p.x, p.y, p.z]),
        );
    }
}

fn slope_errors(answers: &mut Answers) {
    let scene = Sampled::new(SIDE, gaussian);
    let (p, q) = slopes(scene.z.view(), [scene.pixel; 2]);
    let of_slope = |found: &Array2<f64>, truth: &Array2<f64>| {
        height_error(found.view(), truth.view(), Alignment::None).rms
    };
    let length = of_slope(&p, &scene.p).hypot(of_slope(&q, &scene.q));
    answers.add("slope_error", [length]);
}

#[test]
fn answers_are_the_recorded_ones() {
    let mut found = Answers::default();
    reconstructions(&mut found);
    integrators(&mut found);
    samplers(&mut found);
    slope_errors(&mut found);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/suite/recorded.txt");
    found.check(path, |_, _, largest| TOLERANCE * largest);
}
