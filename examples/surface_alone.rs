//! The crate tactile-sfs alone: a surface from one shaded image, with two methods behind one trait.
#![allow(clippy::print_stdout)]
use ndarray::Array2;
use tactile_sfs::{
    BoundaryCondition, BrooksHorn, Domain, Eikonal, Lighting, SfsError, SurfaceReconstruction,
};

fn main() -> Result<(), SfsError> {
    // A hemisphere of radius 20 px seen under frontal light: n·s = z/20.
    let truth = Array2::from_shape_fn((45, 45), |(r, c)| {
        let square = (r as f64 - 22.0).powi(2) + (c as f64 - 22.0).powi(2);
        (400.0 - square).max(0.0).sqrt()
    });
    let image = truth.mapv(|z| z / 20.0);
    let mask = truth.mapv(|z| z > 0.0);
    let domain = Domain::default().with_mask(mask.view());
    let light = Lighting::default();
    let eikonal = Eikonal::new(light).with_boundary(BoundaryCondition::Height(0.0))?;
    let brooks_horn = BrooksHorn::new(light).with_occluding_boundary(true);
    let methods: [(&str, &dyn SurfaceReconstruction<f64>); 2] =
        [("eikonal", &eikonal), ("Brooks–Horn", &brooks_horn)];
    for (name, method) in methods {
        let surface = method.reconstruct(image.view().into(), &domain)?;
        let top = surface.heights.iter().copied().fold(f64::MIN, f64::max);
        println!("{name}: highest point {top:.2} px, 20 px in truth");
    }
    Ok(())
}
