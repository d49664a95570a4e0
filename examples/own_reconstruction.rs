//! A user-defined reconstruction: the darkening gives the depth by Beer's law, without any method
//! of the library.
#![allow(clippy::print_stdout)]
use ndarray::{Array2, array};
use tactile_imaging::sfs::{Domain, Image, SfsError, Surface, SurfaceReconstruction};

/// Light that decays as exp(−z/length) with the depth z in metres.
struct Absorption {
    length_m: f64,
}

impl SurfaceReconstruction<f64> for Absorption {
    fn reconstruct(&self, image: Image<'_, '_, f64>) -> Result<Surface<f64>, SfsError> {
        let Image { values, domain } = image;
        domain.bounding_box(values.dim())?;
        let heights = Array2::from_shape_fn(values.dim(), |(row, column)| {
            let depth_m = -self.length_m * values.at(row, column).ln();
            if domain.contains(row, column) {
                depth_m
            } else {
                f64::NAN
            }
        });
        if heights.iter().any(|depth| depth.is_infinite()) {
            return Err(SfsError::custom("a pixel is black: its depth has no end"));
        }
        Ok(Surface::from_heights(heights))
    }
}

fn main() -> Result<(), SfsError> {
    let image = array![[1.0, 0.8, 0.5], [1.0, 0.9, 0.7]];
    let method = Absorption { length_m: 1e-3 };
    let surface = method.reconstruct(Image::new(image.view(), Domain::new([1e-4; 2])?))?;
    println!("depths in mm: {:.3}", surface.heights.mapv(|z| z * 1e3));
    assert!((surface.heights[[0, 2]] - 0.693e-3).abs() < 1e-6);
    let black = array![[1.0, 0.0]];
    let refused = method.reconstruct(Image::new(black.view(), Domain::new([1e-4; 2])?));
    println!("{}", refused.expect_err("a black pixel"));
    Ok(())
}
