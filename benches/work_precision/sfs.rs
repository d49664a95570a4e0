//! Surfaces from images and from slopes: method, grid, sweeps, tolerance, scalar type.

use crate::study::{Effort, Study};
use ndarray::Array2;
use tactile_imaging::sfs::{
    BoundaryCondition, CosinePoisson, Domain, Eikonal, Image, Lighting, MaskedLeastSquares,
    PixelScalar, SlopeIntegrator, SurfaceReconstruction, TsaiShah,
};

/// A field over the pixels of the square [−1, 1]².
fn field<T>([rows, columns]: [usize; 2], at: impl Fn(f64, f64) -> T) -> Array2<T> {
    let position = |k: usize, n: usize| (k as f64 + 0.5) * 2.0 / n as f64 - 1.0;
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        at(position(c, columns), position(r, rows))
    })
}

/// Mean absolute error relative to the height of the surface, with a free constant.
fn mean_error(
    found: &Array2<f64>,
    truth: &Array2<f64>,
    mask: Option<&Array2<bool>>,
    range: f64,
) -> f64 {
    let inside = |at| mask.is_none_or(|mask| mask[at]);
    let errors = found.indexed_iter().filter(|(at, _)| inside(*at));
    let errors = errors.map(|(at, z)| z - truth[at]);
    let errors: Vec<f64> = errors.filter(|error| error.is_finite()).collect();
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / errors.len() as f64;
    let offset = mean(&mut errors.iter().copied());
    mean(&mut errors.iter().map(|error| (error - offset).abs())) / range
}

/// A paraboloid of height 0.4 on a disc of radius 0.8, under frontal light.
pub(crate) fn surfaces(study: &mut Study) {
    study.error_label = "mean error over the height";
    let light = Lighting::default();
    let eikonal = Eikonal::new(light)
        .with_boundary(BoundaryCondition::Height(0.0))
        .expect("valid");
    let tolerances = [1e-1, 1e-2, 1e-3, 1e-8];
    let sizes = study.choose(vec![48, 192], vec![24, 48, 192, 384]);
    let mut run = |knob, setting: &str, n, method: &dyn SurfaceReconstruction<f64>| {
        surface(study, knob, setting, setting == "default", n, method);
    };
    let n = 96;
    run("eikonal", "default", n, &eikonal);
    for tolerance in tolerances {
        let method = eikonal.with_tolerance(tolerance).expect("valid");
        run("tolerance", &tolerance.to_string(), n, &method);
    }
    for n in sizes {
        run("grid", &format!("{n} × {n}"), n, &eikonal);
    }
    for iterations in [1, 3, 12, 48] {
        let method = TsaiShah::new(light).with_iterations(iterations);
        let setting = format!("{iterations} iterations");
        run("Tsai–Shah", &setting, n, &method.expect("valid"));
    }
}

fn surface(
    study: &mut Study,
    knob: &'static str,
    setting: &str,
    is_default: bool,
    n: usize,
    method: &dyn SurfaceReconstruction<f64>,
) {
    let height = |x: f64, y: f64| 0.4 - 0.625 * (x * x + y * y);
    let shape = [n; 2];
    let mask = field(shape, |x, y| height(x, y) > 0.0);
    let image = field(shape, |x, y| {
        if height(x, y) > 0.0 {
            1.0 / (1.0 + 1.5625 * (x * x + y * y)).sqrt()
        } else {
            0.0
        }
    });
    let truth = field(shape, |x, y| height(x, y).max(0.0));
    let domain = Domain::new([2.0 / n as f64; 2])
        .expect("valid")
        .with_mask(mask.view());
    let job = || {
        method
            .reconstruct(Image::new(image.view(), domain))
            .expect("a surface")
            .heights
    };
    study.run(knob, setting, is_default, job, |z| {
        mean_error(z, &truth, Some(&mask), 0.4)
    });
}

/// A Gaussian bump from its slopes, over a square that is larger than the bump.
pub(crate) fn slopes(study: &mut Study) {
    study.error_label = "mean error over the height";
    let square = |n: usize| [n; 2];
    let quick = [64, 128].map(square).to_vec();
    let full = [64, 128, 256, 512].map(square).to_vec();
    for shape in study.choose(quick, full) {
        integral::<f64>(study, "cosine Poisson", shape, true, &CosinePoisson);
        integral::<f32>(study, "cosine, f32", shape, false, &CosinePoisson);
        let method = MaskedLeastSquares::default();
        integral::<f64>(study, "least squares", shape, false, &method);
    }
    if study.effort == Effort::Full {
        // The frame size of the paper.
        integral::<f64>(study, "cosine, frame", [1042, 1392], false, &CosinePoisson);
        integral::<f32>(study, "frame, f32", [1042, 1392], false, &CosinePoisson);
    }
}

fn integral<T: PixelScalar>(
    study: &mut Study,
    knob: &'static str,
    [rows, columns]: [usize; 2],
    is_default: bool,
    method: &dyn SlopeIntegrator<T>,
) {
    let height = |x: f64, y: f64| 0.3 * (-((x - 0.1).powi(2) + (y + 0.05).powi(2)) / 0.18).exp();
    let shape = [rows, columns];
    let p = field(shape, |x, y| T::of(-(x - 0.1) / 0.09 * height(x, y)));
    let q = field(shape, |x, y| T::of(-(y + 0.05) / 0.09 * height(x, y)));
    let truth = field(shape, height);
    let side = |n: usize| T::of(2.0 / n as f64);
    let domain = Domain::new([side(columns), side(rows)]).expect("valid");
    let job = || {
        method
            .integrate(p.view(), q.view(), &domain)
            .expect("a surface")
            .heights
    };
    let setting = format!("{columns} × {rows}");
    study.run(knob, setting, is_default, job, |z| {
        let wide = z.mapv(|v| num_traits::ToPrimitive::to_f64(&v).expect("a number"));
        mean_error(&wide, &truth, None, 0.3)
    });
}
