//! A ball of known radius fitted to a depth map.
use super::surface::ContactSurface;
use nalgebra::{Matrix3, Vector3};

/// A spherical cap z = √(R² − ρ²) − √(R² − a²), ρ the distance from the centre, fitted to a surface.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::pipeline::{BallFit, DarkContact, Object, Pipeline, SurfaceInput};
/// // A grey level is 5 µm, a pixel 0.1 mm. A ball of 4 mm radius in contact up to 2.4 mm from its axis: 4 − √(4² − 2.4²) = 0.8 mm deep.
/// let table = [(0.0, 0.0), (200.0, 1e-3)];
/// let depth_mm = |x: f64, y: f64| (16.0 - 0.01 * (x * x + y * y)).sqrt() - 3.2;
/// let grey = |(r, c): (usize, usize)| 220 - (depth_mm(c as f64 - 32.0, r as f64 - 32.0) / 5e-3).round() as u8;
/// let (reference, frame) = (Array2::from_elem((64, 64), 220_u8), Array2::from_shape_fn((64, 64), grey));
/// let pipeline = Pipeline::new(DarkContact::new(&table, [1e-4; 2])?, Object::sphere(4e-3))?
///     .with_surface(DarkContact::depth_table(&table)?, SurfaceInput::Signal);
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// let fit: BallFit = press.surface(0)?.fit_ball(4e-3).expect("a cap");
/// assert!((fit.contact_radius_m - 2.4e-3).abs() < 5e-6 && fit.mean_absolute_error_m < 5e-6);
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct BallFit {
    /// The ball's radius R in metres: given, not fitted.
    pub radius_m: f64,
    /// Centre (x, y) in metres from the frame's first pixel.
    pub centre_m: [f64; 2],
    /// Radius a of the circle where the cap meets depth zero, in metres.
    pub contact_radius_m: f64,
    /// Mean absolute difference between surface and cap over the surface's pixels inside that circle, in metres.
    pub mean_absolute_error_m: f64,
    /// Number of those pixels.
    pub pixels: usize,
    /// Gauss–Newton steps.
    pub iterations: usize,
}

impl BallFit {
    /// Depth of the cap in metres at (x, y) in metres; zero outside the circle.
    pub(crate) fn depth_m(&self, [x, y]: [f64; 2]) -> f64 {
        let square = (x - self.centre_m[0]).powi(2) + (y - self.centre_m[1]).powi(2);
        if square >= self.contact_radius_m.powi(2) {
            return 0.0;
        }
        let r2 = self.radius_m.powi(2);
        (r2 - square).sqrt() - (r2 - self.contact_radius_m.powi(2)).sqrt()
    }
}

impl ContactSurface {
    /// Pixels of the surface as (x, y, height) in metres.
    fn pixels(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let ([x0, y0], [hx, hy]) = (self.origin_m, self.pixel_size_m);
        let heights = self.surface.heights.indexed_iter();
        let inside = heights.filter(|(at, h)| self.surface.mask[*at] && h.is_finite());
        inside.map(move |((row, column), h)| [x0 + column as f64 * hx, y0 + row as f64 * hy, *h])
    }

    /// Fits a ball of radius `radius_m` by least squares over the centre and the height of its equator (Gauss–Newton,
    /// O(pixels) a step). `None` where the surface has fewer than 16 pixels, is wider than the ball, or no cap fits.
    pub fn fit_ball(&self, radius_m: f64) -> Option<BallFit> {
        let pixels: Vec<_> = self.pixels().collect();
        let n = pixels.len() as f64;
        let mean = |k: usize| pixels.iter().map(|p| p[k]).sum::<f64>() / n;
        if pixels.len() < 16 || !(radius_m > 0.0 && radius_m.is_finite()) {
            return None;
        }
        let mut at = Vector3::new(mean(0), mean(1), 0.0);
        let mut iterations = 0;
        while iterations < 50 {
            iterations += 1;
            let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
            for [x, y, z] in &pixels {
                let (u, v) = (x - at.x, y - at.y);
                let square = radius_m * radius_m - u * u - v * v;
                if square > 1e-6 * radius_m * radius_m {
                    let up = square.sqrt();
                    let slope = Vector3::new(u / up, v / up, 1.0);
                    normal += slope * slope.transpose();
                    right += slope * (z - up - at.z);
                }
            }
            let step = normal.cholesky()?.solve(&right);
            at += step;
            if step.amax() < 1e-9 * radius_m {
                break;
            }
        }
        let contact_radius_m = (radius_m * radius_m - at.z * at.z).sqrt();
        let (centre_m, mean_absolute_error_m) = ([at.x, at.y], 0.0);
        let mut fit = BallFit {
            radius_m,
            centre_m,
            contact_radius_m,
            mean_absolute_error_m,
            pixels: 0,
            iterations,
        };
        if !(at.z < 0.0 && contact_radius_m > 0.0) {
            return None;
        }
        let (mean_absolute_error_m, pixels) = fit_error(&fit, &pixels);
        fit.mean_absolute_error_m = mean_absolute_error_m;
        fit.pixels = pixels;
        Some(fit)
    }
}

fn fit_error(fit: &BallFit, pixels: &[[f64; 3]]) -> (f64, usize) {
    let depth = pixels
        .iter()
        .map(|[x, y, z]| (fit.depth_m([*x, *y]), z))
        .filter(|(d, _)| *d > 0.0);
    let (sum, n) = depth.fold((0.0, 0), |(s, n), (d, z)| (s + (z - d).abs(), n + 1));
    (sum / n.max(1) as f64, n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::BoundingBox;
    use crate::sfs::{DepthTable, Domain, SurfaceReconstruction};
    use ndarray::Array2;

    #[test]
    fn an_exact_cap_comes_back() {
        let truth = BallFit {
            radius_m: 4e-3,
            centre_m: [3.11e-3, 2.57e-3],
            contact_radius_m: 2.5e-3,
            mean_absolute_error_m: 0.0,
            pixels: 0,
            iterations: 0,
        };
        let size = [50e-6, 40e-6];
        let depth = |(r, c): (usize, usize)| {
            truth.depth_m([(c + 10) as f64 * size[0], (r + 4) as f64 * size[1]])
        };
        let heights = Array2::from_shape_fn((130, 110), depth);
        let mask = heights.mapv(|h| h > 0.0);
        let table = DepthTable::new(&[(0.0, 0.0), (1.0, 1.0)]).unwrap();
        let domain = Domain::new(size).unwrap().with_mask(mask.view());
        let surface = table.reconstruct(heights.view().into(), &domain).unwrap();
        let region = BoundingBox {
            row_start: 4,
            row_end: 134,
            column_start: 10,
            column_end: 120,
        };
        let fit = ContactSurface {
            surface,
            region,
            binning: 1,
            pixel_size_m: size,
            origin_m: [10.0 * size[0], 4.0 * size[1]],
        }
        .fit_ball(4e-3)
        .unwrap();
        // Gauss–Newton stops at 10⁻⁹ of the radius.
        for k in 0..2 {
            assert!((fit.centre_m[k] - truth.centre_m[k]).abs() < 1e-10);
        }
        assert!((fit.contact_radius_m - truth.contact_radius_m).abs() < 1e-10);
        assert!(fit.mean_absolute_error_m < 1e-10);
    }
}
