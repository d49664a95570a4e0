//! Surfaces with closed forms and their images under frontal light, and all implementations, for
//! tests of all of them.
#![allow(unreachable_pub)]

mod quality;

use ndarray::Array2;
use tactile_sfs::*;

pub use quality::{Alignment, HeightError, height_error, render};

/// Heights and slopes of a closed form at a point of the square [−1, 1]². `None` outside its
/// support.
pub type Shape = fn(f64, f64) -> Option<[f64; 3]>;

/// A surface sampled on n × n pixels of size 2/n, with its image.
pub struct Sampled {
    pub pixel: f64,
    pub z: Array2<f64>,
    pub mask: Array2<bool>,
    pub p: Array2<f64>,
    pub q: Array2<f64>,
    /// n·s under frontal light, 0 outside.
    pub image: Array2<f64>,
}

impl Sampled {
    pub fn new(n: usize, shape: Shape) -> Self {
        let pixel = 2.0 / n as f64;
        let at = |r: usize, c: usize| {
            shape(
                (c as f64 + 0.5) * pixel - 1.0,
                (r as f64 + 0.5) * pixel - 1.0,
            )
        };
        let field =
            |k: usize| Array2::from_shape_fn((n, n), |(r, c)| at(r, c).map_or(0.0, |v| v[k]));
        let image = Array2::from_shape_fn((n, n), |(r, c)| {
            at(r, c).map_or(0.0, |[_, p, q]| 1.0 / (1.0 + p * p + q * q).sqrt())
        });
        let mask = Array2::from_shape_fn((n, n), |(r, c)| at(r, c).is_some());
        Self {
            pixel,
            z: field(0),
            mask,
            p: field(1),
            q: field(2),
            image,
        }
    }

    /// The pixels inside the mask.
    pub fn domain(&self) -> Domain<'_, f64> {
        let domain = Domain::new([self.pixel; 2]).unwrap();
        domain.with_mask(self.mask.view())
    }
}

/// Errors of a surface at pixels with a height, unchanged or up to a constant.
pub fn errors<T: PixelScalar>(
    surface: &Surface<T>,
    truth: &Array2<f64>,
    alignment: Alignment,
) -> HeightError {
    let heights = surface.heights.mapv(|z| z.as_f64());
    height_error(heights.view(), truth.view(), alignment)
}

/// The eikonal method from a boundary at height zero.
pub fn from_rim<T: PixelScalar>(lighting: Lighting<T>) -> Eikonal<T> {
    let method = Eikonal::new(lighting);
    method
        .with_boundary(BoundaryCondition::Height(T::zero()))
        .unwrap()
}

pub fn reconstructions(
    light: Lighting<f64>,
) -> Vec<(&'static str, Box<dyn SurfaceReconstruction<f64>>)> {
    let table = DepthTable::new(&[(0.0, 0.0), (1.0, 2.0)]).unwrap();
    vec![
        ("eikonal", Box::new(from_rim(Lighting::default()))),
        ("eikonal oblique", Box::new(from_rim(light))),
        ("tsai-shah", Box::new(TsaiShah::new(light))),
        ("depth table", Box::new(table)),
    ]
}

pub fn integrators<T: PixelScalar>() -> Vec<(&'static str, Box<dyn SlopeIntegrator<T>>)> {
    vec![
        ("poisson", Box::new(CosinePoisson)),
        ("least squares", Box::new(MaskedLeastSquares::default())),
    ]
}

/// A hemisphere of radius 0.8: vertical at its rim.
pub fn sphere(x: f64, y: f64) -> Option<[f64; 3]> {
    let z2 = 0.64 - x * x - y * y;
    (z2 > 0.0).then(|| [z2.sqrt(), -x / z2.sqrt(), -y / z2.sqrt()])
}

/// Half an ellipsoid with axes 0.9, 0.6 and 0.5.
pub fn ellipsoid(x: f64, y: f64) -> Option<[f64; 3]> {
    let z2 = 0.25 * (1.0 - x * x / 0.81 - y * y / 0.36);
    (z2 > 0.0).then(|| {
        [
            z2.sqrt(),
            -0.25 / 0.81 * x / z2.sqrt(),
            -0.25 / 0.36 * y / z2.sqrt(),
        ]
    })
}

/// A paraboloid of height 0.4 that meets the plane at an angle, on a disc of radius 0.8.
pub fn paraboloid(x: f64, y: f64) -> Option<[f64; 3]> {
    let z = 0.4 - 0.625 * (x * x + y * y);
    (z > 0.0).then_some([z, -1.25 * x, -1.25 * y])
}

/// A Gaussian bump of height 0.3 and standard deviation 0.3, off the centre, over the whole square.
pub fn gaussian(x: f64, y: f64) -> Option<[f64; 3]> {
    let (u, v) = (x - 0.1, y + 0.05);
    let z = 0.3 * (-(u * u + v * v) / 0.18).exp();
    Some([z, -u / 0.09 * z, -v / 0.09 * z])
}

/// Waves that do not vanish at the border.
pub fn waves(x: f64, y: f64) -> Option<[f64; 3]> {
    let (a, b) = (2.1 * x + 0.3, 1.7 * y - 0.4);
    Some([
        a.sin() * b.cos(),
        2.1 * a.cos() * b.cos(),
        -1.7 * a.sin() * b.sin(),
    ])
}
