//! Answers of every method, compared with recorded ones: a change that is not meant to move a
//! number must not.
//!
//! `RECORD_ANSWERS=1 cargo test -p tactile-sfs --test suite recorded` writes the record anew; the
//! commit says why numbers moved.

use ndarray::Array2;
use tactile_sfs::{
    Alignment, BoundaryCondition, BrooksHorn, ControlPointSampler, CosinePoisson,
    CurvatureAdaptive, DepthTable, Domain, Eikonal, EikonalBranch, EquallySpaced, Frame,
    FrankotChellappa, Lighting, MaskedLeastSquares, Random, Signal, SlopeIntegrator, Surface,
    SurfaceReconstruction, TsaiShah, height_error, render, reprojection, slopes,
};
use test_support::Answers;

use super::common::{Sampled, ellipsoid, from_rim, gaussian, paraboloid, sphere, waves};

/// Relative to the largest number of a line: the last bits of square roots and sums in another
/// order, times the few hundred steps that some methods take.
const TOLERANCE: f64 = 1e-12;

const SIDE: usize = 48;

/// Some of the solved heights, and the counts of the report.
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
        let brooks_horn = BrooksHorn::new(frontal).with_occluding_boundary(true);
        let methods: [(_, &dyn SurfaceReconstruction<f64>, _); 4] = [
            ("eikonal", &steep, &scene.image),
            ("eikonal_oblique", &from_rim(oblique), &lit),
            ("tsai_shah", &TsaiShah::new(frontal), &scene.image),
            ("brooks_horn", &brooks_horn, &scene.image),
        ];
        for (method_name, method, image) in methods {
            let surface = method.reconstruct(image.view().into(), &domain);
            let surface = surface.expect("a surface");
            add_surface(answers, &format!("{method_name}/{name}"), &surface);
        }
    }
    both_branches(answers, frontal);
    depth_table(answers);
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
            .reconstruct(image.view().into(), &domain)
            .expect("heights");
        add_surface(answers, &format!("eikonal_known/{name}"), &surface);
    }
}

fn depth_table(answers: &mut Answers) {
    let square = |r: usize, c: usize| (r as f64 - 30.2).powi(2) + (c as f64 - 29.7).powi(2);
    let depth = |r, c| ((1600.0 - square(r, c)).sqrt() - 1200.0_f64.sqrt()).max(0.0);
    let image = Array2::from_shape_fn((61, 61), |(r, c)| (20.0 * depth(r, c)).round());
    let domain = Domain::new([1e-4, 1e-4]).expect("a size");
    let frame = Frame::Real(image.view());
    let found = DepthTable::from_ball(frame, Signal::Intensity, &domain, 4e-3, 1.0, None)
        .expect("a calibration");
    let numbers = [
        found.contact_radius_m,
        found.indentation_m,
        found.mean_residual_m,
    ];
    answers.add("ball", numbers);
    let surface = found
        .table
        .reconstruct(image.view().into(), &domain)
        .expect("depths");
    add_surface(answers, "depth_table", &surface);
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
    let fourier = FrankotChellappa;
    let squares = MaskedLeastSquares::default();
    let methods: [(&str, &dyn SlopeIntegrator<f64>); 3] = [
        ("poisson", &poisson),
        ("frankot_chellappa", &fourier),
        ("masked", &squares),
    ];
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
    let adaptive = CurvatureAdaptive::new(4.0).expect("an emphasis");
    let (even, random) = (EquallySpaced, Random { seed: 11 });
    let samplers: [(&str, &dyn ControlPointSampler<f64>); 3] = [
        ("equally_spaced", &even),
        ("adaptive", &adaptive),
        ("random", &random),
    ];
    for (name, sampler) in samplers {
        // Few points lie between the pixels, many on them.
        for count in [9, 60, 500] {
            let points = sampler
                .sample(
                    scene.z.view(),
                    &Domain::new([scene.pixel; 2])
                        .unwrap()
                        .with_mask(scene.mask.view()),
                    count,
                )
                .expect("points");
            let shown = points.iter().step_by(1 + count / 20);
            answers.add(
                format!("{name}/{count}"),
                shown.flat_map(|p| [p.x, p.y, p.z]),
            );
        }
    }
}

fn quality(answers: &mut Answers) {
    let (scene, other) = (Sampled::new(SIDE, gaussian), Sampled::new(SIDE, waves));
    let light = Lighting::new([0.3, -0.2, 1.0]).expect("a light");
    for alignment in [Alignment::None, Alignment::Offset, Alignment::Affine] {
        let error = height_error(other.z.view(), scene.z.view(), None, alignment).expect("errors");
        let summary = &error.error;
        answers.add(
            format!("height_error/{alignment:?}"),
            [summary.rms, summary.mean_absolute, summary.max],
        );
    }
    let (p, q) = slopes(scene.z.view(), [scene.pixel; 2]);
    let of_slope = |found: &Array2<f64>, truth: &Array2<f64>| {
        let error = height_error(found.view(), truth.view(), None, Alignment::None);
        error.expect("errors").error.rms
    };
    let length = of_slope(&p, &scene.p).hypot(of_slope(&q, &scene.q));
    answers.add("slope_error", [length]);
    let image = render(scene.z.view(), [scene.pixel; 2], &light);
    let frame = Frame::Real(image.view());
    let found = reprojection(other.z.view(), frame, [scene.pixel; 2], &light).expect("errors");
    answers.add("reprojection", [found.1.rms]);
}

#[test]
fn answers_are_the_recorded_ones() {
    let mut found = Answers::default();
    reconstructions(&mut found);
    integrators(&mut found);
    samplers(&mut found);
    quality(&mut found);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/suite/recorded.txt");
    found.check(path, |_, _, largest| TOLERANCE * largest);
}
