//! A surface from one image under frontal light: `cargo run --example surface_from_image`.
//!
//! Dark pixels are outside the object, whose rim has height zero. Heights are in pixels.
#![allow(clippy::print_stdout)]
use std::error::Error;
use std::path::Path;
use tactile_files::io::{Grey, read_grey_image};
use tactile_imaging::sfs::{
    BoundaryCondition, Domain, Eikonal, Image, Lighting, SurfaceReconstruction,
};

fn main() -> Result<(), Box<dyn Error>> {
    let path = Path::new("examples/data/ball.pgm");
    let image = read_grey_image(path, Grey::default(), None)?.levels;
    let mask = image.mapv(|level| level > 0.0);
    let light = Lighting::new([0.0, 0.0, 1.0])?.with_normal_intensity(255.0)?;
    let method = Eikonal::new(light).with_boundary(BoundaryCondition::Height(0.0))?;
    let domain = Domain::default().with_mask(mask.view());
    let surface = method.reconstruct(Image::new(image.view(), domain))?;
    let heights = surface.heights.iter().copied().filter(|z| z.is_finite());
    let top = heights.fold(0.0, f64::max);
    let report = &surface.report;
    println!(
        "{} pixels, {} sweeps, the top is {top:.2} pixels high",
        report.solved, report.iterations
    );
    assert!(top > 0.0);
    Ok(())
}
